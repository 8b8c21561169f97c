/* Flaws and damage against exact formulas: order statistics, Hooke's law, the growth equation's
   closed forms. All seeds are fixed; bounds of random sums are 4 to 5 standard deviations. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <float.h>
#include <stdlib.h>
#include <string.h>

#include "near.h"
#include "sphpa.h"

static const double nan_ = (double)NAN;

static sphpa_flaw_params basalt(double volume) {
    sphpa_flaw_params params;
    params.k = 4e35;
    params.m = 9.0;
    params.volume = volume;
    return params;
}

static void assert_nan(double a) { assert_true(a != a); }

static int by_size(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* sup |F1 - F2| of two samples, which it sorts (two-sample Kolmogorov-Smirnov) */
static double ks_two(double *a, size_t n, double *b, size_t m) {
    qsort(a, n, sizeof *a, by_size);
    qsort(b, m, sizeof *b, by_size);
    double worst = 0.0;
    for (size_t i = 0, j = 0; i < n && j < m;) {
        double x = a[i] < b[j] ? a[i] : b[j];
        while (i < n && a[i] <= x) i++;
        while (j < m && b[j] <= x) j++;
        worst = fmax(worst, fabs((double)i / (double)n - (double)j / (double)m));
    }
    return worst;
}

/* sup |F_n - F| from the values F(x_i), which it sorts */
static double ks_one(double *f, size_t n) {
    qsort(f, n, sizeof *f, by_size);
    double worst = 0.0;
    for (size_t i = 0; i < n; i++) {
        worst = fmax(worst, fabs((double)(i + 1) / (double)n - f[i]));
        worst = fmax(worst, fabs((double)i / (double)n - f[i]));
    }
    return worst;
}

/* exceeded with odds 1e-3 (Smirnov 1948, asymptotic) */
static double ks_critical(double n_effective) { return 1.9495 / sqrt(n_effective); }

static double harmonic(size_t n) {
    double sum = 0.0;
    for (size_t j = n; j > 0; j--) sum += 1.0 / (double)j;
    return sum;
}

/* ---- Weibull --------------------------------------------------------------------------------- */

static void test_threshold(void **state) {
    (void)state;
    const double R = 0.05, V = 4.0 / 3.0 * 3.14159265358979323846 * R * R * R;
    sphpa_flaw_params body = basalt(V);
    for (double j = 1.0; j < 1e7; j *= 7.0) {
        double eps = sphpa_flaw_threshold(&body, j);
        double n = 4e35 * V; /* eps^9 by multiplication: another route than exp and log */
        double eps3 = eps * eps * eps;
        assert_near(n * eps3 * eps3 * eps3, j, 1e-12);
        assert_near(sphpa_flaw_count(&body, eps), j, 1e-12);
    }
    /* k V overflows, eps does not: eps = (10^-500)^(1/10) */
    sphpa_flaw_params huge;
    huge.k = 1e300;
    huge.m = 10.0;
    huge.volume = 1e200;
    assert_near(sphpa_flaw_threshold(&huge, 1.0), 1e-50, 1e-12);
    assert_true(sphpa_flaw_count(&body, 0.0) == 0.0);
    assert_true(sphpa_flaw_count(&body, -1e-3) == 0.0);
}

static void test_threshold_bad(void **state) {
    (void)state;
    sphpa_flaw_params body = basalt(1e-3);
    assert_nan(sphpa_flaw_threshold(&body, 0.0));
    assert_nan(sphpa_flaw_threshold(&body, -1.0));
    assert_nan(sphpa_flaw_threshold(&body, nan_));
    assert_nan(sphpa_flaw_threshold(NULL, 1.0));
    assert_nan(sphpa_flaw_count(&body, nan_));
    assert_nan(sphpa_flaw_count(NULL, 1.0));
    body.k = nan_;
    assert_nan(sphpa_flaw_threshold(&body, 1.0));
    assert_nan(sphpa_flaw_count(&body, 1.0));
}

static void test_check(void **state) {
    (void)state;
    sphpa_error err;
    memset(&err, 0, sizeof err);
    sphpa_flaw_params body = basalt(1e-3);
    assert_int_equal(sphpa_flaw_check(&body, 1000, &err), SPHPA_OK);
    assert_true(err.message[0] == '\0');
    assert_int_equal(sphpa_flaw_check(NULL, 1000, &err), SPHPA_ERROR_MISSING);
    assert_int_equal(err.result, SPHPA_ERROR_MISSING);
    assert_int_equal(sphpa_flaw_check(&body, 0, &err), SPHPA_ERROR_EMPTY);
    body.m = -9.0;
    assert_int_equal(sphpa_flaw_check(&body, 1000, &err), SPHPA_ERROR_NEGATIVE);
    assert_non_null(strstr(err.message, "m = -9"));
    body.m = 0.0;
    assert_int_equal(sphpa_flaw_check(&body, 1000, NULL), SPHPA_ERROR_NEGATIVE);
    body = basalt(0.0);
    assert_int_equal(sphpa_flaw_check(&body, 1000, &err), SPHPA_ERROR_NEGATIVE);
    assert_non_null(strstr(err.message, "volume"));
    body = basalt(nan_);
    assert_int_equal(sphpa_flaw_check(&body, 1000, &err), SPHPA_ERROR_NOT_FINITE);
    body = basalt((double)INFINITY);
    assert_int_equal(sphpa_flaw_check(&body, 1000, &err), SPHPA_ERROR_NOT_FINITE);
    body = basalt(1e-3);
    body.m = 0.01; /* thresholds near 1e-3260 */
    assert_int_equal(sphpa_flaw_check(&body, 1000, &err), SPHPA_ERROR_RANGE);
    /* A particle's first flaw may come at any j = n t > 0: j = 1e-20 must still have a threshold
       above DBL_MIN. With k V = 1e10 that is m = log(1e-30)/log(DBL_MIN) = 0.0975; j = 1 alone
       would be content with a third of it. */
    body.k = 1e13;
    double least = log(1e-30) / log(DBL_MIN);
    body.m = least * 1.001;
    assert_int_equal(sphpa_flaw_check(&body, 1000, &err), SPHPA_OK);
    assert_true(sphpa_flaw_threshold(&body, 1e-20) >= DBL_MIN);
    body.m = least * 0.999;
    assert_int_equal(sphpa_flaw_check(&body, 1000, &err), SPHPA_ERROR_RANGE);
    body.m = 0.5 * least;
    assert_int_equal(sphpa_flaw_check(&body, 1000, &err), SPHPA_ERROR_RANGE);
    assert_true(sphpa_flaw_threshold(&body, 1.0) >= DBL_MIN);
    if (sizeof(size_t) > 4) {
        body = basalt(1e-3);
        size_t many = (size_t)0xffffffffu;
        assert_int_equal(sphpa_flaw_check(&body, many, NULL), SPHPA_OK);
        assert_int_equal(sphpa_flaw_check(&body, many + 1, NULL), SPHPA_ERROR_RANGE);
    }
}

/* ---- the walk -------------------------------------------------------------------------------- */

typedef struct walk {
    uint32_t *count;                      /* flaws of each particle so far */
    double *eps_min, *eps_max;            /* first and last threshold of each */
    size_t calls, with, last_particle, n; /* with: particles that have one */
    size_t quit_at;                       /* 0: never */
    double last_eps;
    uint64_t hash;
} walk;

static uint32_t walk_visit(void *user, size_t particle, double eps, size_t j) {
    walk *w = (walk *)user;
    if (w->quit_at != 0 && j >= w->quit_at) return SPHPA_FLAW_QUIT;
    w->calls++;
    assert_true(j == w->calls);
    assert_true(particle < w->n);
    assert_true(w->with < w->n); /* no call after every particle has one */
    assert_true(eps > w->last_eps);
    w->last_eps = eps;
    w->last_particle = particle;
    w->hash = (w->hash ^ particle) * 1099511628211u;
    if (w->count[particle] == 0) {
        w->with++;
        w->eps_min[particle] = eps;
    }
    w->eps_max[particle] = eps;
    return w->count[particle]++;
}

static walk walk_make(size_t n) {
    walk w;
    memset(&w, 0, sizeof w);
    w.n = n;
    w.hash = 14695981039346656037u;
    w.count = (uint32_t *)calloc(n, sizeof *w.count);
    w.eps_min = (double *)calloc(n, sizeof *w.eps_min);
    w.eps_max = (double *)calloc(n, sizeof *w.eps_max);
    assert_true(w.count != NULL && w.eps_min != NULL && w.eps_max != NULL);
    return w;
}

static void walk_free(walk *w) {
    free(w->count);
    free(w->eps_min);
    free(w->eps_max);
}

static void test_assign_gives_each_particle_one(void **state) {
    (void)state;
    sphpa_flaw_params body = basalt(5e-4);
    const size_t n = 2000;
    walk w = walk_make(n);
    sphpa_rng rng = sphpa_rng_seed(7, 1);
    size_t total = 0;
    assert_int_equal(sphpa_flaw_assign(&body, n, &rng, walk_visit, &w, &total), SPHPA_OK);
    assert_true(total == w.calls);
    size_t sum = 0;
    for (size_t i = 0; i < n; i++) {
        assert_true(w.count[i] >= 1);
        sum += w.count[i];
    }
    assert_true(sum == total);
    assert_true(w.count[w.last_particle] == 1); /* the walk ends with the last particle's first */
    assert_near(w.last_eps, sphpa_flaw_threshold(&body, (double)total), 1e-15);
    /* the same seed, the same walk; another, another */
    walk again = walk_make(n), other = walk_make(n);
    rng = sphpa_rng_seed(7, 1);
    assert_int_equal(sphpa_flaw_assign(&body, n, &rng, walk_visit, &again, NULL), SPHPA_OK);
    rng = sphpa_rng_seed(8, 1);
    assert_int_equal(sphpa_flaw_assign(&body, n, &rng, walk_visit, &other, NULL), SPHPA_OK);
    assert_true(again.hash == w.hash && other.hash != w.hash);
    walk_free(&w);
    walk_free(&again);
    walk_free(&other);
}

#define FEW 500 /* particles, with ROOM for the flaws of each */
#define ROOM 64

typedef struct lists {
    double eps[FEW][ROOM];
    uint32_t count[FEW];
} lists;

static uint32_t visit_append(void *user, size_t particle, double eps, size_t j) {
    lists *l = (lists *)user;
    (void)j;
    if (l->count[particle] == ROOM) return SPHPA_FLAW_QUIT;
    l->eps[particle][l->count[particle]] = eps;
    return l->count[particle]++;
}

/* appended lists are sorted, and the body's open flaws are k V eps^m to the very flaw */
static void test_assign_lists_follow_weibull(void **state) {
    (void)state;
    static lists l;
    memset(&l, 0, sizeof l);
    sphpa_flaw_params body = basalt(5e-4);
    sphpa_rng rng = sphpa_rng_seed(4, 4);
    size_t total = 0;
    assert_int_equal(sphpa_flaw_assign(&body, FEW, &rng, visit_append, &l, &total), SPHPA_OK);
    for (size_t i = 0; i < FEW; i++)
        for (uint32_t c = 1; c < l.count[i]; c++) assert_true(l.eps[i][c] > l.eps[i][c - 1]);
    for (double j = 0.5; j < (double)total; j += 37.0) { /* halfway between two flaws */
        double eps = sphpa_flaw_threshold(&body, j), open = 0.0;
        for (size_t i = 0; i < FEW; i++)
            open += sphpa_flaws_active_list(eps, l.eps[i], l.count[i]);
        assert_true(open == floor(sphpa_flaw_count(&body, eps)));
    }
}

static void test_assign_total(void **state) { /* the coupon collector: mean n H_n, variance known */
    (void)state;
    sphpa_flaw_params body = basalt(5e-4);
    const size_t n = 400;
    const int runs = 300;
    double mean = 0.0, variance = 0.0, *hits = (double *)calloc(n, sizeof *hits), flaws = 0.0;
    assert_non_null(hits);
    for (int run = 0; run < runs; run++) {
        walk w = walk_make(n);
        sphpa_rng rng = sphpa_rng_seed(100 + (uint64_t)run, 3);
        size_t total = 0;
        assert_int_equal(sphpa_flaw_assign(&body, n, &rng, walk_visit, &w, &total), SPHPA_OK);
        mean += (double)total / runs;
        flaws += (double)total;
        for (size_t i = 0; i < n; i++) hits[i] += w.count[i];
        walk_free(&w);
    }
    for (size_t i = 1; i < n; i++) { /* sum of the geometric laws' variances (1-p)/p^2 */
        double p = (double)i / (double)n;
        variance += (1.0 - p) / (p * p);
    }
    double expected = (double)n * harmonic(n), sigma = sqrt(variance / runs);
    assert_near_abs(mean, expected, 4.0 * sigma);
    assert_near(expected, (double)n * (log((double)n) + 0.57721566490153286) + 0.5, 1e-6);
    /* no particle is favoured: chi^2 has n - 1 degrees of freedom, variance 2 (n - 1) */
    double chi2 = 0.0, each = flaws / (double)n;
    for (size_t i = 0; i < n; i++) chi2 += (hits[i] - each) * (hits[i] - each) / each;
    assert_near_abs(chi2, (double)(n - 1), 4.0 * sqrt(2.0 * (double)(n - 1)));
    free(hits);
}

static uint32_t visit_liar(void *user, size_t particle, double eps, size_t j) {
    (void)particle;
    (void)eps;
    *(size_t *)user = j;
    return 1;
}

static void test_assign_errors(void **state) {
    (void)state;
    sphpa_flaw_params body = basalt(5e-4);
    walk w = walk_make(50);
    sphpa_rng rng = sphpa_rng_seed(1, 1);
    size_t total = 77, last = 0;
    w.quit_at = 11;
    assert_int_equal(sphpa_flaw_assign(&body, 50, &rng, walk_visit, &w, &total), SPHPA_STOPPED);
    assert_true(w.calls == 10 && total == 77);
    assert_int_equal(sphpa_flaw_assign(&body, 50, &rng, visit_liar, &last, &total),
                     SPHPA_ERROR_NOT_CONVERGED);
    assert_true(total == 77);
    assert_near_abs((double)last, 50.0 * (log(50.0) + 64.0), 1.0);
    assert_int_equal(sphpa_flaw_assign(&body, 0, &rng, walk_visit, &w, &total), SPHPA_ERROR_EMPTY);
    assert_int_equal(sphpa_flaw_assign(&body, 5, NULL, walk_visit, &w, &total),
                     SPHPA_ERROR_MISSING);
    assert_int_equal(sphpa_flaw_assign(&body, 5, &rng, NULL, &w, &total), SPHPA_ERROR_MISSING);
    body.k = -1.0;
    assert_int_equal(sphpa_flaw_assign(&body, 5, &rng, walk_visit, &w, &total),
                     SPHPA_ERROR_NEGATIVE);
    assert_true(total == 77);
    walk_free(&w);
    body = basalt(5e-4); /* one particle: one flaw */
    w = walk_make(1);
    assert_int_equal(sphpa_flaw_assign(&body, 1, &rng, walk_visit, &w, &total), SPHPA_OK);
    assert_true(total == 1 && w.count[0] == 1);
    walk_free(&w);
}

/* ---- sampling -------------------------------------------------------------------------------- */

#define DRAWS 4000

static void test_stopping_time(void **state) {
    (void)state;
    static const size_t sizes[] = {1, 30, 100000};
    static double f[DRAWS];
    for (size_t s = 0; s < 3; s++) {
        sphpa_rng rng = sphpa_rng_seed(21, s);
        double n = (double)sizes[s], mean = 0.0;
        for (int i = 0; i < DRAWS; i++) {
            double T = sphpa_flaw_stopping_time(sizes[s], &rng);
            assert_true(T > 0.0 && T < 100.0);
            mean += T / DRAWS;
            f[i] = pow(1.0 - exp(-T), n); /* uniform, if T has the law of the largest of n */
        }
        assert_true(ks_one(f, DRAWS) < ks_critical(DRAWS));
        double variance = 0.0; /* the largest of n exponentials: mean H_n, variance sum 1/j^2 */
        for (size_t j = sizes[s]; j > 0; j--) variance += 1.0 / ((double)j * (double)j);
        assert_near_abs(mean, harmonic(sizes[s]), 4.0 * sqrt(variance / DRAWS));
    }
    sphpa_rng rng = sphpa_rng_seed(1, 1);
    assert_nan(sphpa_flaw_stopping_time(0, &rng));
    assert_nan(sphpa_flaw_stopping_time(5, NULL));
}

#define MANY 20000

/* one walk and one sample of the same body, stopped at the same time, ready to be compared */
typedef struct pair_of_bodies {
    sphpa_flaw_params params;
    double stop;
    size_t total;
    sphpa_flaws *walked, *sampled;
} pair_of_bodies;

static pair_of_bodies pair_make(uint64_t seed) {
    pair_of_bodies b;
    b.params = basalt(5e-4);
    b.walked = (sphpa_flaws *)calloc(MANY, sizeof *b.walked);
    b.sampled = (sphpa_flaws *)calloc(MANY, sizeof *b.sampled);
    assert_true(b.walked != NULL && b.sampled != NULL);
    walk w = walk_make(MANY);
    sphpa_rng rng = sphpa_rng_seed(seed, 1);
    assert_int_equal(sphpa_flaw_assign(&b.params, MANY, &rng, walk_visit, &w, &b.total), SPHPA_OK);
    b.stop = (double)b.total / MANY;
    for (size_t i = 0; i < MANY; i++) {
        double ends[2];
        ends[0] = w.eps_min[i];
        ends[1] = w.eps_max[i];
        b.walked[i] = sphpa_flaws_compress(ends, 2); /* the ends are all it looks at, ... */
        b.walked[i].count = w.count[i];              /* ... but for the number in eq. 3 */
        if (w.count[i] > 1) b.walked[i].exponent *= log((double)w.count[i]) / log(2.0);
        rng = sphpa_rng_seed(seed, 10 + i);
        assert_int_equal(sphpa_flaw_sample(&b.params, MANY, &rng, b.stop, &b.sampled[i]), SPHPA_OK);
    }
    walk_free(&w);
    return b;
}

static void pair_free(pair_of_bodies *b) {
    free(b->walked);
    free(b->sampled);
}

static void test_sample_agrees_with_walk(void **state) {
    (void)state;
    static double walked[MANY], sampled[MANY];
    pair_of_bodies b = pair_make(5);
    const double critical = ks_critical(MANY / 2.0);
    for (int what = 0; what < 3; what++) {
        for (size_t i = 0; i < MANY; i++) {
            const sphpa_flaws *w = &b.walked[i], *s = &b.sampled[i];
            walked[i] = what == 0 ? w->eps_min : what == 1 ? (double)w->count : w->exponent;
            sampled[i] = what == 0 ? s->eps_min : what == 1 ? (double)s->count : s->exponent;
        }
        assert_true(ks_two(walked, MANY, sampled, MANY) < critical);
    }
    /* and against the exact law of the first arrival, given that it is before the stop */
    for (size_t i = 0; i < MANY; i++) {
        double t = sphpa_flaw_count(&b.params, b.sampled[i].eps_min) / MANY;
        sampled[i] = expm1(-t) / expm1(-b.stop);
    }
    assert_true(ks_one(sampled, MANY) < ks_critical(MANY));
    pair_free(&b);
}

static void test_sample_counts(void **state) {
    (void)state;
    pair_of_bodies b = pair_make(6);
    double T = b.stop, sum = 0.0, mean = T / (1.0 - exp(-T));
    for (size_t i = 0; i < MANY; i++) {
        assert_true(b.sampled[i].count >= 1);
        assert_true(b.sampled[i].eps_min > 0.0);
        sum += (double)b.sampled[i].count;
    }
    /* all flaws below the stop: k V eps^m, and its Poisson error bar */
    double eps_stop = sphpa_flaw_threshold(&b.params, MANY * T);
    assert_near(sphpa_flaw_count(&b.params, eps_stop), (double)b.total, 1e-10);
    assert_near_abs(sum, sphpa_flaw_count(&b.params, eps_stop), 4.0 * sqrt(MANY * T));
    assert_near_abs(sum / MANY, mean, 4.0 * sqrt(T / MANY));
    /* counts are Poisson of mean T, given >= 1: chi^2 over classes that hold at least 10 */
    double chi2 = 0.0, p = exp(-T), classes = 0.0;
    for (uint32_t c = 1; c < 100; c++) {
        p *= T / c;
        double expected = MANY * p / (1.0 - exp(-T)), found = 0.0;
        if (expected < 10.0) continue;
        for (size_t i = 0; i < MANY; i++) found += b.sampled[i].count == c ? 1.0 : 0.0;
        chi2 += (found - expected) * (found - expected) / expected;
        classes += 1.0;
    }
    assert_true(classes > 10.0);
    assert_near_abs(chi2, classes, 4.0 * sqrt(2.0 * classes));
    pair_free(&b);
}

/* sum of the open flaws of a body at eps, and the variance of that sum */
static double open_of(const sphpa_flaws *flaws, double eps, double *variance) {
    double sum = 0.0, squares = 0.0;
    for (size_t i = 0; i < MANY; i++) {
        double n_act = sphpa_flaws_active(&flaws[i], eps);
        sum += n_act;
        squares += n_act * n_act;
    }
    *variance = squares - sum * sum / MANY;
    return sum;
}

/* Open flaws of the whole body against k V eps^m. Eq. 3 goes through the first and the last flaw of
   a particle and knows nothing of those between: up to 1/5 too many there, exact at the end. */
static void test_compressed_follows_weibull(void **state) {
    (void)state;
    pair_of_bodies b = pair_make(9);
    double largest = 0.0;
    for (double t = b.stop; t > 0.02; t *= 0.5) { /* t: flaws a particle that should be open */
        double eps = sphpa_flaw_threshold(&b.params, t * MANY), spread[2];
        double walked = open_of(b.walked, eps, &spread[0]);
        double sampled = open_of(b.sampled, eps, &spread[1]);
        double expected = sphpa_flaw_count(&b.params, eps);
        if (t == b.stop) assert_near(walked, expected, 1e-10);
        assert_near_abs(walked, sampled, 4.0 * sqrt(spread[0] + spread[1]));
        assert_true(walked > expected - 4.0 * sqrt(expected));
        largest = fmax(largest, walked / expected);
    }
    assert_true(largest > 1.1 && largest < 1.2);
    pair_free(&b);
}

static void test_sample_errors(void **state) {
    (void)state;
    sphpa_flaw_params body = basalt(5e-4);
    sphpa_rng rng = sphpa_rng_seed(1, 1);
    sphpa_flaws out, before;
    memset(&out, 0x5a, sizeof out);
    before = out;
    assert_int_equal(sphpa_flaw_sample(&body, 10, &rng, 0.0, &out), SPHPA_ERROR_RANGE);
    assert_int_equal(sphpa_flaw_sample(&body, 10, &rng, nan_, &out), SPHPA_ERROR_RANGE);
    assert_int_equal(sphpa_flaw_sample(&body, 10, &rng, 1001.0, &out), SPHPA_ERROR_RANGE);
    assert_int_equal(sphpa_flaw_sample(&body, 10, NULL, 3.0, &out), SPHPA_ERROR_MISSING);
    assert_int_equal(sphpa_flaw_sample(&body, 10, &rng, 3.0, NULL), SPHPA_ERROR_MISSING);
    assert_int_equal(sphpa_flaw_sample(&body, 0, &rng, 3.0, &out), SPHPA_ERROR_EMPTY);
    body.volume = nan_;
    assert_int_equal(sphpa_flaw_sample(&body, 10, &rng, 3.0, &out), SPHPA_ERROR_NOT_FINITE);
    assert_memory_equal(&out, &before, sizeof out);
    body = basalt(5e-4); /* a stop long before the first natural arrival still gives one flaw */
    for (int i = 0; i < 1000; i++) {
        assert_int_equal(sphpa_flaw_sample(&body, 10, &rng, 1e-9, &out), SPHPA_OK);
        assert_true(out.count == 1 && out.exponent == 0.0);
        assert_true(sphpa_flaw_count(&body, out.eps_min) <= 10.0 * 1e-9 * (1.0 + 1e-12));
    }
}

/* ---- compressed and listed flaws ------------------------------------------------------------- */

static void test_compress(void **state) {
    (void)state;
    double list[12];
    for (int i = 0; i < 12; i++) list[i] = 1e-4 * pow(1.0 + i, 1.0 / 6.5);
    sphpa_flaws f = sphpa_flaws_compress(list, 12);
    assert_true(f.eps_min == list[0] && f.count == 12);
    assert_near(f.exponent, 6.5, 1e-12); /* thresholds of a pure power law give it back */
    for (int i = 0; i < 12; i++)         /* and then both open one by one */
        assert_true(sphpa_flaws_active(&f, list[i]) == i + 1.0 &&
                    sphpa_flaws_active_list(list[i], list, 12) == i + 1.0);
    assert_true(sphpa_flaws_active(&f, 0.5 * (list[4] + list[5])) == 5.0); /* whole in between */
    assert_true(sphpa_flaws_active(&f, list[0] * (1.0 - 1e-15)) == 0.0);
    assert_true(sphpa_flaws_active(&f, list[0]) == 1.0);
    assert_true(sphpa_flaws_active(&f, 1.0) == 12.0);
    assert_true(sphpa_flaws_active(&f, (double)INFINITY) == 12.0);
    assert_true(sphpa_flaws_active(&f, -1.0) == 0.0);
    assert_nan(sphpa_flaws_active(&f, nan_));
    f = sphpa_flaws_compress(list + 3, 1); /* one flaw */
    assert_true(f.count == 1 && f.exponent == 0.0);
    assert_true(sphpa_flaws_active(&f, list[2]) == 0.0 && sphpa_flaws_active(&f, list[3]) == 1.0 &&
                sphpa_flaws_active(&f, 1.0) == 1.0);
    double same[3] = {2e-4, 2e-4, 2e-4}; /* all open at once */
    f = sphpa_flaws_compress(same, 3);
    assert_true(sphpa_flaws_active(&f, 2e-4) == 3.0 && sphpa_flaws_active(&f, 1.9e-4) == 0.0);
}

static void test_compress_bad(void **state) {
    (void)state;
    double bad[3] = {1e-4, 2e-4, nan_}, zero[2] = {0.0, 1e-4}, falling[2] = {2e-4, 1e-4};
    double endless[2] = {1e-4, (double)INFINITY};
    sphpa_flaws none;
    memset(&none, 0, sizeof none);
    assert_true(sphpa_flaws_compress(bad, 3).count == 0);
    assert_true(sphpa_flaws_compress(bad + 2, 1).count == 0);
    assert_true(sphpa_flaws_compress(zero, 2).count == 0);
    assert_true(sphpa_flaws_compress(falling, 2).count == 0);
    assert_true(sphpa_flaws_compress(endless, 2).count == 0);
    assert_true(sphpa_flaws_compress(bad, 0).count == 0);
    assert_true(sphpa_flaws_compress(NULL, 3).count == 0);
    assert_true(sphpa_flaws_active(&none, 1.0) == 0.0);
    assert_nan(sphpa_flaws_active(&none, nan_));
    assert_true(sphpa_flaws_active_list(1.0, NULL, 0) == 0.0);
    assert_nan(sphpa_flaws_active_list(nan_, bad, 2));
}

static void test_active_list_against_count(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(3, 4);
    double list[40];
    for (int trial = 0; trial < 3000; trial++) {
        size_t count = sphpa_rng_below(&rng, 41), open = 0;
        for (size_t i = 0; i < count; i++) list[i] = 1.0 + sphpa_rng_below(&rng, 30); /* ties */
        qsort(list, count, sizeof *list, by_size);
        double eps = 0.5 * sphpa_rng_below(&rng, 70);
        for (size_t i = 0; i < count; i++) open += list[i] <= eps ? 1u : 0u;
        assert_true(sphpa_flaws_active_list(eps, list, count) == (double)open);
        sphpa_flaws f = sphpa_flaws_compress(list, count); /* both agree on none, and on all */
        double n_act = sphpa_flaws_active(&f, eps);
        assert_true((n_act == 0.0) == (open == 0));
        if (open == count) assert_true(n_act == (double)count);
        assert_true(n_act <= (double)count);
    }
}

/* ---- strain ---------------------------------------------------------------------------------- */

static sphpa_sym3 sym3(double xx, double yy, double zz, double xy, double yz, double xz) {
    sphpa_sym3 S;
    S.xx = xx;
    S.yy = yy;
    S.zz = zz;
    S.xy = xy;
    S.yz = yz;
    S.xz = xz;
    return S;
}

static void test_young(void **state) {
    (void)state;
    double K = 2.67e10, G = 2.27e10, nu = (3.0 * K - 2.0 * G) / (2.0 * (3.0 * K + G));
    assert_near(sphpa_damage_young(K, G), 2.0 * G * (1.0 + nu), 1e-14);
    assert_near(sphpa_damage_young(K, G), 3.0 * K * (1.0 - 2.0 * nu), 1e-14);
    assert_nan(sphpa_damage_young(K, 0.0));
    assert_nan(sphpa_damage_young(0.0, G));
    assert_nan(sphpa_damage_young(nan_, G));
    assert_nan(sphpa_damage_young(K, nan_));
}

/* A bar pulled along one axis: the strain is Hooke's, whatever way the axis points. */
static void test_strain_uniaxial(void **state) {
    (void)state;
    const double K = 2.67e10, G = 2.27e10, sigma = 1.3e7;
    double hooke = sigma / (9.0 * K) + sigma / (3.0 * G); /* volume and shear part */
    sphpa_rng rng = sphpa_rng_seed(11, 1);
    for (int trial = 0; trial < 200; trial++) {
        double x = sphpa_rng_normal(&rng), y = sphpa_rng_normal(&rng), z = sphpa_rng_normal(&rng);
        double r = sqrt(x * x + y * y + z * z), P = -sigma / 3.0;
        x /= r;
        y /= r;
        z /= r;
        sphpa_sym3 S = sym3(sigma * x * x + P, sigma * y * y + P, sigma * z * z + P, sigma * x * y,
                            sigma * y * z, sigma * x * z);
        assert_near(sphpa_damage_strain(&S, P, 1.0, K, G), hooke, 1e-13);
        /* the bound is an equality here, J3 > 0 and two equal roots: the tightest case */
        assert_near(sphpa_damage_strain_bound(&S, P, 1.0, K, G), hooke, 1e-12);
        assert_true(sphpa_damage_strain_bound(&S, P, 1.0, K, G) >=
                    sphpa_damage_strain(&S, P, 1.0, K, G));
        /* the porous bulk is softer: its matrix strains alpha times as much for one bulk stress */
        assert_near(sphpa_damage_strain(&S, P, 4.64, K, G), 4.64 * hooke, 1e-13);
    }
    sphpa_sym3 none = sym3(0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    double E = sphpa_damage_young(K, G);
    assert_near(sphpa_damage_strain(&none, -2e6, 1.0, K, G), 2e6 / E, 1e-15);
    assert_true(sphpa_damage_strain(&none, 2e6, 1.0, K, G) < 0.0);
    assert_true(sphpa_damage_strain(&none, 0.0, 1.0, K, G) == 0.0);
    sphpa_sym3 shear = sym3(0.0, 0.0, 0.0, 3e6, 0.0, 0.0); /* largest principal stress: tau - P */
    assert_near(sphpa_damage_strain(&shear, 1e6, 2.0, K, G), 2.0 * 2e6 / E, 1e-14);
}

/* the largest root of the characteristic polynomial in closed form (trigonometric) */
static double largest_principal(const sphpa_sym3 *S) {
    double q = (S->xx + S->yy + S->zz) / 3.0, x = S->xx - q, y = S->yy - q, z = S->zz - q;
    double J2 = 0.5 * (x * x + y * y + z * z) + S->xy * S->xy + S->yz * S->yz + S->xz * S->xz;
    double J3 = x * (y * z - S->yz * S->yz) - S->xy * (S->xy * z - S->yz * S->xz) +
                S->xz * (S->xy * S->yz - y * S->xz);
    double c = 1.5 * sqrt(3.0) * J3 / (J2 * sqrt(J2));
    return q + 2.0 * sqrt(J2 / 3.0) * cos(acos(fmax(-1.0, fmin(1.0, c))) / 3.0);
}

static void test_strain_random(void **state) {
    (void)state;
    const double K = 9.47e9, G = 2.8e9, E = 9.0 * K * G / (3.0 * K + G);
    sphpa_rng rng = sphpa_rng_seed(12, 1);
    double tightest = 1e300, mean_ratio = 0.0;
    for (int trial = 0; trial < 20000; trial++) {
        double s[6];
        for (int c = 0; c < 6; c++) s[c] = 1e7 * sphpa_rng_normal(&rng);
        sphpa_sym3 S = sym3(s[0], s[1], s[2], s[3], s[4], s[5]); /* not even traceless */
        double P = 1e7 * sphpa_rng_normal(&rng), alpha = 1.0 + 3.0 * sphpa_rng_uniform(&rng);
        double size = fabs(s[0]) + fabs(s[1]) + fabs(s[2]) + fabs(s[3]) + fabs(s[4]) + fabs(s[5]);
        double strain = sphpa_damage_strain(&S, P, alpha, K, G), values[3];
        sphpa_sym3 sum = sym3(s[0] - P, s[1] - P, s[2] - P, s[3], s[4], s[5]);
        sphpa_sym3_eigen(&sum, values, NULL); /* of S - P I itself */
        double allowed = 1e-14 * alpha * (size + fabs(P)) / E;
        assert_near_abs(strain, alpha * values[0] / E, allowed);
        /* acos loses half the digits where two roots meet */
        assert_near_abs(strain, alpha * (largest_principal(&S) - P) / E, 1e6 * allowed);
        double bound = sphpa_damage_strain_bound(&S, P, alpha, K, G);
        assert_true(bound >= strain);
        double gap = (bound - strain) * E / (alpha * size);
        tightest = fmin(tightest, gap);
        mean_ratio += gap / 20000.0;
    }
    assert_true(tightest < 1e-4);   /* so it is no trivial bound ... */
    assert_true(mean_ratio < 0.15); /* ... and not far off as a rule */
}

static void test_strain_nan(void **state) {
    (void)state;
    const double K = 2.67e10, G = 2.27e10;
    double bad[2];
    bad[0] = nan_;
    bad[1] = (double)INFINITY;
    for (int which = 0; which < 2; which++)
        for (int c = 0; c < 6; c++) {
            double s[6] = {1e6, 2e6, -3e6, 4e5, 5e5, 6e5};
            s[c] = bad[which];
            sphpa_sym3 S = sym3(s[0], s[1], s[2], s[3], s[4], s[5]);
            assert_nan(sphpa_damage_strain(&S, 1e6, 1.5, K, G));
            double bound = sphpa_damage_strain_bound(&S, 1e6, 1.5, K, G);
            assert_false(bound < 1e300); /* NaN or infinite: the fast path never hides it */
        }
    sphpa_sym3 S = sym3(1e6, 2e6, -3e6, 4e5, 5e5, 6e5);
    assert_nan(sphpa_damage_strain(&S, nan_, 1.5, K, G));
    assert_nan(sphpa_damage_strain_bound(&S, nan_, 1.5, K, G));
    assert_nan(sphpa_damage_strain(&S, 1e6, nan_, K, G));
    assert_nan(sphpa_damage_strain(&S, 1e6, 0.99, K, G));
    assert_nan(sphpa_damage_strain_bound(&S, 1e6, 0.99, K, G));
    assert_nan(sphpa_damage_strain(&S, 1e6, 1.5, K, 0.0));
    assert_nan(sphpa_damage_strain_bound(&S, 1e6, 1.5, -1.0, G));
    sphpa_sym3 tiny = sym3(0.0, 0.0, 0.0, 1e-170, 0.0, 0.0); /* J2 underflows */
    assert_true(sphpa_damage_strain_bound(&tiny, 0.0, 1.0, K, G) >=
                sphpa_damage_strain(&tiny, 0.0, 1.0, K, G));
}

/* ---- growth ---------------------------------------------------------------------------------- */

static double power(double n_act, double n_tot, sphpa_damage_rule rule) {
    return rule == SPHPA_DAMAGE_CBRT     ? pow(n_act, 1.0 / 3.0)
           : rule == SPHPA_DAMAGE_LINEAR ? n_act
                                         : n_act / n_tot;
}

static const sphpa_damage_rule rules[3] = {SPHPA_DAMAGE_CBRT, SPHPA_DAMAGE_LINEAR,
                                           SPHPA_DAMAGE_FRACTION};

static void test_crack_speed(void **state) {
    (void)state;
    double K = 2.67e10, G = 2.27e10, rho = 2700.0, E = sphpa_damage_young(K, G);
    double nu = E / (2.0 * G) - 1.0; /* 0.4 of the speed of longitudinal waves, from E and nu */
    double c_l = sqrt(E * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu) * rho));
    assert_near(sphpa_damage_crack_speed(K, G, rho), 0.4 * c_l, 1e-14);
    assert_near(sphpa_damage_crack_speed(2.18e9, 0.0, 998.0), 0.4 * sqrt(2.18e9 / 998.0), 1e-15);
    assert_nan(sphpa_damage_crack_speed(K, G, 0.0));
    assert_nan(sphpa_damage_crack_speed(K, nan_, rho));
    assert_nan(sphpa_damage_crack_speed(nan_, G, rho));
    assert_nan(sphpa_damage_crack_speed(K, -1.0, rho));
}

/* At constant strain D13 is a straight line up to the cap, however many steps it takes. */
static void test_growth_constant_strain(void **state) {
    (void)state;
    const double c_g = 1838.0, R_s = 2e-3, n_act = 5.0, n_tot = 14.0;
    double cap = pow(n_act / n_tot, 1.0 / 3.0);
    assert_near(sphpa_damage_cap(n_act, n_tot), cap, 1e-15);
    for (int r = 0; r < 3; r++) {
        double rate = power(n_act, n_tot, rules[r]) * c_g / R_s, t_cap = cap / rate;
        assert_near(sphpa_damage_rate(n_act, n_tot, c_g, R_s, rules[r]), rate, 1e-14);
        double D13 = 0.0, dt = t_cap / 64.0;
        for (int step = 1; step <= 100; step++) {
            double before = D13;
            double twice = sphpa_damage_advance(D13, n_act, n_tot, c_g, R_s, 2.0 * dt, rules[r]);
            D13 = sphpa_damage_advance(D13, n_act, n_tot, c_g, R_s, dt, rules[r]);
            assert_true(D13 >= before && twice >= D13);
            assert_near(D13, fmin(cap, rate * step * dt), 1e-13);
        }
        assert_true(D13 == sphpa_damage_cap(n_act, n_tot));
        /* more flaws open: it goes on; fewer flaws: it stays */
        double more = sphpa_damage_advance(D13, 7.0, n_tot, c_g, R_s, dt, rules[r]);
        double fewer = sphpa_damage_advance(D13, 2.0, n_tot, c_g, R_s, dt, rules[r]);
        assert_true(more > D13 && fewer == D13);
        assert_true(sphpa_damage_advance(D13, n_tot, n_tot, c_g, R_s, 1.0, rules[r]) == 1.0);
    }
}

static void test_growth_limits(void **state) {
    (void)state;
    const double c_g = 1838.0, R_s = 2e-3;
    for (int r = 0; r < 3; r++) {
        sphpa_damage_rule q = rules[r];
        assert_true(sphpa_damage_rate(0.0, 14.0, c_g, R_s, q) == 0.0);
        assert_true(sphpa_damage_rate(0.0, 0.0, c_g, R_s, q) == 0.0); /* no flaws at all: no 0/0 */
        assert_true(sphpa_damage_advance(0.3, 0.0, 0.0, c_g, R_s, 1.0, q) == 0.3);
        assert_true(sphpa_damage_advance(0.3, 3.0, 14.0, c_g, R_s, 0.0, q) == 0.3);
        assert_true(sphpa_damage_advance(1.0, 14.0, 14.0, c_g, R_s, 1.0, q) == 1.0);
        assert_nan(sphpa_damage_advance(nan_, 3.0, 14.0, c_g, R_s, 1e-7, q));
        assert_nan(sphpa_damage_advance(0.1, nan_, 14.0, c_g, R_s, 1e-7, q));
        assert_nan(sphpa_damage_advance(0.1, 3.0, nan_, c_g, R_s, 1e-7, q));
        assert_nan(sphpa_damage_advance(0.1, 3.0, 14.0, nan_, R_s, 1e-7, q));
        assert_nan(sphpa_damage_advance(0.1, 3.0, 14.0, c_g, 0.0, 1e-7, q));
        assert_nan(sphpa_damage_advance(0.1, 3.0, 14.0, c_g, R_s, nan_, q));
        assert_nan(sphpa_damage_advance(0.1, 3.0, 14.0, c_g, R_s, -1e-7, q));
        assert_nan(sphpa_damage_rate(3.0, 14.0, -1.0, R_s, q));
    }
    assert_nan(sphpa_damage_rate(3.0, 14.0, c_g, R_s, (sphpa_damage_rule)3));
    assert_true(sphpa_damage_cap(0.0, 14.0) == 0.0 && sphpa_damage_cap(3.0, 0.0) == 0.0);
    assert_true(sphpa_damage_cap(14.0, 14.0) == 1.0 && sphpa_damage_cap(15.0, 14.0) == 1.0);
    assert_nan(sphpa_damage_cap(nan_, 14.0));
    assert_nan(sphpa_damage_cap(3.0, nan_));
}

/* One element pulled at a constant strain rate; eps = rate t. */
typedef struct pull {
    sphpa_flaws flaws;
    double c_g, R_s;
    sphpa_damage_rule rule;
} pull;

/* the gain of D13 from strain eps_0 to eps_1 in midpoint steps; *peak (may be NULL): the largest
   eps (1-D) on the way, which times E is the strength */
static double pull_run(const pull *p, double rate, double eps_0, double eps_1, int steps,
                       double *peak) {
    double D13 = 0.0, n_act = 0.0, strongest = 0.0, d_eps = (eps_1 - eps_0) / steps;
    for (int step = 0; step < steps; step++) {
        double eps = eps_0 + (step + 0.5) * d_eps, N = p->flaws.count;
        n_act = fmax(n_act, sphpa_flaws_active(&p->flaws, eps));
        D13 = sphpa_damage_advance(D13, n_act, N, p->c_g, p->R_s, d_eps / rate, p->rule);
        eps = eps_0 + (step + 1.0) * d_eps;
        strongest = fmax(strongest, eps * (1.0 - sphpa_damage_total(D13, 0.0)));
    }
    if (peak != NULL) *peak = strongest;
    return D13;
}

static pull pull_make(sphpa_damage_rule rule, double m, uint32_t count) {
    pull p;
    p.flaws.eps_min = 1e-5;
    p.flaws.exponent = m;
    p.flaws.count = count;
    p.c_g = 1838.0;
    p.R_s = 2e-3;
    p.rule = rule;
    return p;
}

/* With n_act = (rate t/eps_min)^m and q = n_act^s [/N]: D13 = A rate^(sm) t^(sm+1)/(sm+1),
   A = c_g/(R_s eps_min^(sm)) [/N]. */
static double closed_D13(const pull *p, double rate, double t) {
    double s = p->rule == SPHPA_DAMAGE_CBRT ? 1.0 / 3.0 : 1.0, sm = s * p->flaws.exponent;
    double A = p->c_g / p->R_s / (p->rule == SPHPA_DAMAGE_FRACTION ? p->flaws.count : 1.0);
    return A * pow(rate * t / p->flaws.eps_min, sm) * t / (sm + 1.0);
}

/* sigma/E = rate t (1 - D), D = D13^3 as t^p with p = 3(sm+1): the largest value is where
   D = 1/(p+1), so t_peak follows from closed_D13 (which is a pure power of t). */
static double closed_peak(const pull *p, double rate) {
    double s = p->rule == SPHPA_DAMAGE_CBRT ? 1.0 / 3.0 : 1.0;
    double sm = s * p->flaws.exponent, D = 1.0 / (3.0 * (sm + 1.0) + 1.0);
    double t = pow(pow(D, 1.0 / 3.0) / closed_D13(p, rate, 1.0), 1.0 / (sm + 1.0));
    return rate * t * (1.0 - D);
}

/* a rate at which n_act at the peak is `share` of all flaws: below 1 not all are open, and above
   D_peak the cap does not bind */
static double rate_for(const pull *p, double share) {
    double low = 1e-12, high = 1e12;
    for (int halving = 0; halving < 200; halving++) {
        double rate = sqrt(low * high), s = p->rule == SPHPA_DAMAGE_CBRT ? 1.0 / 3.0 : 1.0;
        double D = 1.0 / (3.0 * (s * p->flaws.exponent + 1.0) + 1.0);
        double eps = closed_peak(p, rate) / (1.0 - D);
        if (pow(eps / p->flaws.eps_min, p->flaws.exponent) < share * p->flaws.count) low = rate;
        else high = rate;
    }
    return sqrt(low * high);
}

static void test_growth_constant_rate(void **state) {
    (void)state;
    for (int r = 0; r < 3; r++) {
        pull p = pull_make(rules[r], 9.0, 2000000000u);
        /* from 2.6e5 to 1.3e8 flaws: that their number is whole changes D13 by 3e-8 of it */
        double eps_0 = 4.0 * p.flaws.eps_min, eps_1 = 8.0 * p.flaws.eps_min;
        double rate = closed_D13(&p, 1.0, eps_1) / 0.3; /* D13 ends near 0.3, the cap near 0.4 */
        double exact = closed_D13(&p, rate, eps_1 / rate) - closed_D13(&p, rate, eps_0 / rate);
        double coarse = fabs(pull_run(&p, rate, eps_0, eps_1, 50, NULL) / exact - 1.0);
        double fine = fabs(pull_run(&p, rate, eps_0, eps_1, 100, NULL) / exact - 1.0);
        assert_true(fine < 2e-4);
        assert_near(log2(coarse / fine), 2.0, 0.01); /* the midpoint rule's order */
    }
}

/* Grady & Kipp: the strength grows as rate^(3/(m+3)); 1/(m+1) for q = n_act or n_act/N. */
static void test_strength_against_rate(void **state) {
    (void)state;
    static const double ms[2] = {6.0, 9.0};
    for (int r = 0; r < 3; r++)
        for (int i = 0; i < 2; i++) {
            double m = ms[i], slope = rules[r] == SPHPA_DAMAGE_CBRT ? 3.0 / (m + 3.0)
                                                                    : 1.0 / (m + 1.0);
            pull p = pull_make(rules[r], m, 2000000000u);
            double first = rate_for(&p, 0.4), last = rate_for(&p, 0.8), peaks[2];
            double rates[2];
            rates[0] = first;
            rates[1] = last;
            for (int k = 0; k < 2; k++) {
                pull_run(&p, rates[k], 0.0, 1.4 * closed_peak(&p, rates[k]), 20000, &peaks[k]);
                assert_near(peaks[k], closed_peak(&p, rates[k]), 1e-4);
            }
            double found = log(peaks[1] / peaks[0]) / log(last / first);
            assert_near(found, slope, 0.002);
        }
}

/* Slow pulling: the cap rules, D = n_act/N, and the strength no longer knows the rate.
   Fast pulling: all flaws are open at once, D13 = N^(1/3) c_g t/R_s, and it grows as the rate. */
static void test_strength_limits(void **state) {
    (void)state;
    const double m = 9.0, N = 14.0;
    pull p = pull_make(SPHPA_DAMAGE_CBRT, m, 14u);
    double eps_max = p.flaws.eps_min * pow(N, 1.0 / m), slow = 0.0, peak;
    for (double k = 0.0; k < N; k += 1.0) /* the stress just before flaw k + 1 opens */
        slow = fmax(slow, p.flaws.eps_min * pow(k + 1.0, 1.0 / m) * (1.0 - k / N));
    for (double rate = 1e-6; rate < 1e-3; rate *= 10.0) {
        pull_run(&p, rate, 0.0, 1.2 * eps_max, 20000, &peak);
        assert_near(peak, slow, 2e-4);
    }
    double b = cbrt(N) * p.c_g / p.R_s;
    for (double rate = 1e6; rate < 1e9; rate *= 10.0) {
        double fast = rate * 0.75 * pow(0.25, 1.0 / 3.0) / b;
        pull_run(&p, rate, 0.0, 2.0 * fast, 20000, &peak);
        assert_near(peak, fast, 1e-3);
    }
}

static void test_dt(void **state) {
    (void)state;
    const double c_g = 1838.0, R_s = 2e-3;
    for (int r = 0; r < 3; r++) {
        sphpa_damage_rule q = rules[r];
        double dt = sphpa_damage_dt(0.1, 9.0, 14.0, c_g, R_s, q, 0.0);
        double after = sphpa_damage_advance(0.1, 9.0, 14.0, c_g, R_s, dt, q);
        assert_near(after, 0.1 + 0.15, 1e-14);
        dt = sphpa_damage_dt(0.1, 9.0, 14.0, c_g, R_s, q, 0.02);
        assert_near(sphpa_damage_advance(0.1, 9.0, 14.0, c_g, R_s, dt, q), 0.12, 1e-14);
        /* no limit: no open flaw, the cap within reach, D13 = 1 */
        assert_true(sphpa_damage_dt(0.1, 0.0, 14.0, c_g, R_s, q, 0.0) == (double)INFINITY);
        assert_true(sphpa_damage_dt(0.0, 0.0, 0.0, c_g, R_s, q, 0.0) == (double)INFINITY);
        double near_cap = sphpa_damage_cap(9.0, 14.0) - 0.149;
        assert_true(sphpa_damage_dt(near_cap, 9.0, 14.0, c_g, R_s, q, 0.0) == (double)INFINITY);
        assert_true(sphpa_damage_dt(near_cap - 0.002, 9.0, 14.0, c_g, R_s, q, 0.0) < 1e-2);
        assert_true(sphpa_damage_dt(1.0, 14.0, 14.0, c_g, R_s, q, 0.0) == (double)INFINITY);
        assert_true(sphpa_damage_dt(0.0, 14.0, 14.0, 0.0, R_s, q, 0.0) == (double)INFINITY);
        assert_nan(sphpa_damage_dt(nan_, 9.0, 14.0, c_g, R_s, q, 0.0));
        assert_nan(sphpa_damage_dt(0.1, nan_, 14.0, c_g, R_s, q, 0.0));
        assert_nan(sphpa_damage_dt(0.1, 9.0, nan_, c_g, R_s, q, 0.0));
        assert_nan(sphpa_damage_dt(0.1, 9.0, 14.0, nan_, R_s, q, 0.0));
        assert_nan(sphpa_damage_dt(0.1, 9.0, 14.0, c_g, R_s, q, -1.0));
        assert_nan(sphpa_damage_dt(0.1, 9.0, 14.0, c_g, R_s, q, nan_));
    }
}

/* ---- compaction and total -------------------------------------------------------------------- */

static void test_compaction(void **state) {
    (void)state;
    const double alpha0 = 4.64, d = 0.01;
    assert_true(sphpa_damage_compaction(alpha0, alpha0) == 0.0);
    assert_true(sphpa_damage_compaction(1.0, alpha0) == 1.0);
    double before = 2.0;
    for (int i = 0; i <= 1000; i++) { /* the published form, and it falls strictly with alpha */
        double alpha = 1.0 + (alpha0 - 1.0) * i / 1000.0;
        double X = 1.0 - (alpha - 1.0) / (alpha0 - 1.0);
        double root = (pow(X + d, 1.0 / 3.0) - pow(d, 1.0 / 3.0)) /
                      (pow(1.0 + d, 1.0 / 3.0) - pow(d, 1.0 / 3.0));
        double D = sphpa_damage_compaction(alpha, alpha0);
        assert_near_abs(cbrt(D), root, 1e-14);
        assert_true(D < before);
        before = D;
    }
    /* the slope of D_por^(1/3) at alpha0 is finite: -d^(-2/3)/3 over (alpha0-1) and the range */
    double range = cbrt(1.0 + d) - cbrt(d);
    double slope = pow(d, -2.0 / 3.0) / 3.0 / range / (alpha0 - 1.0);
    for (double step = 1e-5; step > 1e-12; step *= 0.1) {
        double alpha = alpha0 - step; /* what the subtraction really took away */
        double found = cbrt(sphpa_damage_compaction(alpha, alpha0)) / (alpha0 - alpha);
        assert_near(found, slope, 1e-13 + 40.0 * step);
    }
}

static void test_compaction_edges(void **state) {
    (void)state;
    assert_true(sphpa_damage_compaction(1.0, 1.0) == 0.0); /* no pores: not 0/0 */
    assert_true(sphpa_damage_compaction(0.9, 1.0) == 0.0);
    assert_true(sphpa_damage_compaction(1.0, 0.5) == 0.0);
    assert_true(sphpa_damage_compaction(5.0, 4.64) == 0.0); /* clamped */
    assert_true(sphpa_damage_compaction(0.5, 4.64) == 1.0);
    double next = 1.0 + DBL_EPSILON; /* the least porosity there is */
    assert_true(sphpa_damage_compaction(next, next) == 0.0);
    assert_true(sphpa_damage_compaction(1.0, next) == 1.0);
    assert_nan(sphpa_damage_compaction(nan_, 4.64));
    assert_nan(sphpa_damage_compaction(2.0, nan_));
    assert_nan(sphpa_damage_compaction(nan_, 1.0));
}

static void test_total(void **state) {
    (void)state;
    assert_true(sphpa_damage_total(0.0, 0.0) == 0.0);
    assert_near(sphpa_damage_total(0.5, 0.25), 0.375, 1e-15);
    assert_true(sphpa_damage_total(1.0, 0.0) == 1.0);
    assert_true(sphpa_damage_total(0.0, 1.0) == 1.0);
    assert_true(sphpa_damage_total(0.9, 0.9) == 1.0);
    assert_nan(sphpa_damage_total(nan_, 0.0));
    assert_nan(sphpa_damage_total(0.0, nan_));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_threshold),
        cmocka_unit_test(test_threshold_bad),
        cmocka_unit_test(test_check),
        cmocka_unit_test(test_assign_gives_each_particle_one),
        cmocka_unit_test(test_assign_lists_follow_weibull),
        cmocka_unit_test(test_assign_total),
        cmocka_unit_test(test_assign_errors),
        cmocka_unit_test(test_stopping_time),
        cmocka_unit_test(test_sample_agrees_with_walk),
        cmocka_unit_test(test_sample_counts),
        cmocka_unit_test(test_compressed_follows_weibull),
        cmocka_unit_test(test_sample_errors),
        cmocka_unit_test(test_compress),
        cmocka_unit_test(test_compress_bad),
        cmocka_unit_test(test_active_list_against_count),
        cmocka_unit_test(test_young),
        cmocka_unit_test(test_strain_uniaxial),
        cmocka_unit_test(test_strain_random),
        cmocka_unit_test(test_strain_nan),
        cmocka_unit_test(test_crack_speed),
        cmocka_unit_test(test_growth_constant_strain),
        cmocka_unit_test(test_growth_limits),
        cmocka_unit_test(test_growth_constant_rate),
        cmocka_unit_test(test_strength_against_rate),
        cmocka_unit_test(test_strength_limits),
        cmocka_unit_test(test_dt),
        cmocka_unit_test(test_compaction),
        cmocka_unit_test(test_compaction_edges),
        cmocka_unit_test(test_total),
    };
    return cmocka_run_group_tests_name("damage", tests, NULL, NULL);
}
