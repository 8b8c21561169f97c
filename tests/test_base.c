/* Results and messages, random numbers, eigenvalues, the exponential. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>
#include <string.h>

#define SPHPA_BASE_IMPLEMENTATION
#include "sphpa.h"

#include "near.h"

#define EPS 2.2204460492503131e-16
#define PI 3.14159265358979324

/* ---- results --------------------------------------------------------------------------------- */

static void result_texts(void **state) {
    (void)state;
    assert_int_equal(SPHPA_OK, 0);
    for (int i = 0; i < (int)SPHPA_RESULT_COUNT; i++) {
        const char *message = sphpa_result_message((sphpa_result)i);
        const char *hint = sphpa_result_hint((sphpa_result)i);
        assert_true(strlen(message) > 3 && strlen(hint) > 3);
        assert_string_not_equal(message, hint);
        for (int j = 0; j < i; j++) /* no two codes tell the same */
            assert_string_not_equal(message, sphpa_result_message((sphpa_result)j));
    }
    /* one row by heart: the enum and the texts come from one list and cannot shift apart */
    assert_string_equal(sphpa_result_message(SPHPA_ERROR_MEMORY), "out of memory");
    assert_string_equal(sphpa_result_message(SPHPA_OK), "success");
    assert_true(SPHPA_ERROR_MEMORY == SPHPA_RESULT_COUNT - 1);
}

static void unknown_results(void **state) {
    (void)state;
    const int codes[] = {-1, -1000000, (int)SPHPA_RESULT_COUNT, 1000000};
    for (int i = 0; i < 4; i++) {
        sphpa_result code = (sphpa_result)codes[i];
        assert_string_equal(sphpa_result_message(code), "unknown result code");
        assert_true(strlen(sphpa_result_hint(code)) > 3);
    }
}

static void error_messages(void **state) {
    (void)state;
    sphpa_error err;
    memset(&err, 0, sizeof err);
    assert_int_equal(sphpa_error_set(&err, SPHPA_ERROR_RANGE, "h = %g; pass %s", -0.5, "h > 0"),
                     SPHPA_ERROR_RANGE);
    assert_int_equal(err.result, SPHPA_ERROR_RANGE);
    assert_string_equal(err.message, "h = -0.5; pass h > 0");
    assert_int_equal(sphpa_error_set(NULL, SPHPA_ERROR_FILE, "%d", 1), SPHPA_ERROR_FILE);
    char flood[2000]; /* longer than the message: cut, and still a string */
    memset(flood, 'a', sizeof flood);
    flood[sizeof flood - 1] = 0;
    struct {
        sphpa_error err;
        char guard[8];
    } kept;
    memset(&kept, 'g', sizeof kept);
    (void)sphpa_error_set(&kept.err, SPHPA_ERROR_PARSE, "%s", flood);
    assert_int_equal(strlen(kept.err.message), sizeof kept.err.message - 1);
    assert_memory_equal(kept.guard, "gggggggg", 8);
}

/* ---- random numbers -------------------------------------------------------------------------- */

/* PCG-XSH-RR 64/32 stated again from O'Neill 2014: the state is stepped by an LCG,
   the old state's top five bits choose how far the xorshifted middle is turned to the right */
static uint32_t restated(uint64_t *s, uint64_t increment) {
    uint64_t x = *s;
    unsigned count = (unsigned)(x >> 59);
    *s = x * UINT64_C(6364136223846793005) + increment;
    x ^= x >> 18;
    uint32_t word = (uint32_t)(x >> 27);
    for (unsigned i = 0; i < count; i++) word = (word >> 1) | (word << 31);
    return word;
}

/* the generator itself, started as the author's pcg32_srandom_r starts it */
static void pcg_published(void **state) {
    (void)state;
    /* the first outputs that the author's demonstration prints for seed 42, stream 54 */
    static const uint32_t published[6] = {0xa15c02b7u, 0x7b47f409u, 0xba1d3330u,
                                          0x83d2f293u, 0xbfa4784bu, 0xcbed606eu};
    const uint64_t seeds[] = {0, 1, 42, UINT64_C(0x123456789abcdef0), UINT64_MAX};
    sphpa_rng rng = {0, 2 * 54 + 1};
    (void)sphpa_rng_u32(&rng);
    rng.state += 42;
    (void)sphpa_rng_u32(&rng);
    for (int i = 0; i < 6; i++) assert_true(sphpa_rng_u32(&rng) == published[i]);
    for (int a = 0; a < 5; a++)
        for (int b = 0; b < 5; b++) {
            uint64_t increment = 2 * seeds[b] + 1, s = seeds[a];
            rng.inc = increment;
            rng.state = s;
            for (int i = 0; i < 2000; i++) {
                assert_true(sphpa_rng_u32(&rng) == restated(&s, increment));
                assert_true(rng.inc == increment);
            }
        }
}

/* the first numbers of splitmix64 from 1234567 are widely published; each is the mix of the seed
   plus so many golden ratios */
static void mixing_published(void **state) {
    (void)state;
    static const uint64_t published[5] = {
        UINT64_C(6457827717110365317), UINT64_C(3203168211198807973), UINT64_C(9817491932198370423),
        UINT64_C(4593380528125082431), UINT64_C(16408922859458223821)};
    for (uint64_t k = 0; k < 5; k++)
        assert_true(sphpa_mix_(UINT64_C(1234567) + k * UINT64_C(0x9e3779b97f4a7c15)) ==
                    published[k]);
}

/* n draws: mean within 4.5 sigma of the truth; sigma_mean = sqrt(variance/n) */
static void assert_mean(double sum, double n, double mean, double variance) {
    assert_near_abs(sum / n, mean, 4.5 * sqrt(variance / n));
}

static void uniform_moments(void **state) {
    (void)state;
    enum { N = 1000000, BINS = 100 };
    const double bins = (double)BINS;
    static int count[BINS];
    double s1 = 0.0, s2 = 0.0, s3 = 0.0, pairs = 0.0, last = 0.5;
    uint64_t low_bits = 0;
    sphpa_rng rng = sphpa_rng_seed(2024, 3);
    for (int i = 0; i < N; i++) {
        double x = sphpa_rng_uniform(&rng), c = x - 0.5;
        assert_true(x >= 0.0 && x < 1.0);
        count[(int)(x * bins)]++;
        s1 += x;
        s2 += c * c;
        s3 += c * c * c * c;
        pairs += c * (last - 0.5);
        last = x;
        uint64_t bits = (uint64_t)(x * 9007199254740992.0); /* 2^53: exact */
        assert_true((double)bits == x * 9007199254740992.0);
        low_bits += bits & 1u;
    }
    assert_mean(s1, N, 0.5, 1.0 / 12.0);
    assert_mean(s2, N, 1.0 / 12.0, 1.0 / 80.0 - 1.0 / 144.0);
    assert_mean(s3, N, 1.0 / 80.0, 1.0 / 2304.0 - 1.0 / 6400.0);
    assert_mean(pairs, N, 0.0, 1.0 / 144.0);
    assert_mean((double)low_bits, N, 0.5, 0.25); /* 53 bits: the last one is alive */
    double chi2 = 0.0, expected = (double)N / bins;
    for (int i = 0; i < BINS; i++) chi2 += (count[i] - expected) * (count[i] - expected) / expected;
    assert_near_abs(chi2, bins - 1.0, 4.5 * sqrt(2.0 * (bins - 1.0)));
}

static void normal_moments(void **state) {
    (void)state;
    enum { N = 1000000 };
    double s1 = 0.0, s2 = 0.0, s3 = 0.0, s4 = 0.0, pairs = 0.0, last = 0.0, beyond = 0.0;
    sphpa_rng rng = sphpa_rng_seed(77, 8);
    for (int i = 0; i < N; i++) {
        double x = sphpa_rng_normal(&rng);
        assert_true(isfinite(x));
        s1 += x;
        s2 += x * x;
        s3 += x * x * x;
        s4 += x * x * x * x;
        pairs += x * last;
        last = x;
        beyond += fabs(x) > 2.0 ? 1.0 : 0.0;
    }
    assert_mean(s1, N, 0.0, 1.0);
    assert_mean(s2, N, 1.0, 2.0);
    assert_mean(s3, N, 0.0, 15.0);
    assert_mean(s4, N, 3.0, 105.0 - 9.0);
    assert_mean(pairs, N, 0.0, 1.0);
    double tail = erfc(2.0 / sqrt(2.0));
    assert_mean(beyond, N, tail, tail * (1.0 - tail));
}

static void below_is_unbiased(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(1, 1);
    assert_true(sphpa_rng_below(&rng, 0) == 0 && sphpa_rng_below(&rng, 1) == 0);
    const uint32_t small = 7;
    double count[7] = {0, 0, 0, 0, 0, 0, 0}, chi2 = 0.0;
    for (int i = 0; i < 700000; i++) {
        uint32_t x = sphpa_rng_below(&rng, small);
        assert_true(x < small);
        count[x] += 1.0;
    }
    for (int i = 0; i < 7; i++) chi2 += (count[i] - 1e5) * (count[i] - 1e5) / 1e5;
    assert_true(chi2 < 6.0 + 4.5 * sqrt(12.0));
    /* bound = 3 * 2^30: a plain remainder would give the lowest third half of all draws */
    double low = 0.0;
    for (int i = 0; i < 200000; i++) {
        uint32_t x = sphpa_rng_below(&rng, 0xc0000000u);
        assert_true(x < 0xc0000000u);
        low += x < 0x40000000u ? 1.0 : 0.0;
    }
    assert_mean(low, 200000, 1.0 / 3.0, 2.0 / 9.0);
}

static void same_seed_and_stream_give_the_same(void **state) {
    (void)state;
    sphpa_rng a = sphpa_rng_seed(9, 1), b = sphpa_rng_seed(9, 1);
    for (int i = 0; i < 1000; i++) assert_true(sphpa_rng_u32(&a) == sphpa_rng_u32(&b));
}

/* Seeds and streams that differ in one bit, whichever, have nothing to do with each other: no draw
   in common (to 2^-20), no correlation. An LCG's increments that differ in high bits alone fail. */
static void neighbouring_streams_are_independent(void **state) {
    (void)state;
    enum { STARTS = 20, DRAWS = 256 };
    for (int which = 0; which < 2; which++)
        for (int bit = 0; bit < 64; bit++) {
            double product = 0.0;
            int common = 0;
            for (uint64_t s = 0; s < STARTS; s++) {
                uint64_t other = s ^ UINT64_C(1) << bit;
                sphpa_rng a = which ? sphpa_rng_seed(s, 5) : sphpa_rng_seed(5, s);
                sphpa_rng b = which ? sphpa_rng_seed(other, 5) : sphpa_rng_seed(5, other);
                for (int i = 0; i < DRAWS; i++) {
                    double x = sphpa_rng_uniform(&a) - 0.5, y = sphpa_rng_uniform(&b) - 0.5;
                    product += x * y;
                    common += fabs(x - y) < 1e-6;
                }
            }
            assert_mean(product, (double)STARTS * DRAWS, 0.0, 1.0 / 144.0);
            assert_true(common <= 2); /* 0.01 are to be expected */
        }
}

/* The first draws of streams, and of seeds, that follow each other are as random as those of one
   stream: pairs, `step` apart, fill 16 x 16 boxes evenly (chi squared). */
static void first_draws_are_random(void **state) {
    (void)state;
    enum { N = 100000, BINS = 256 };
    static double first[N];
    for (int which = 0; which < 2; which++) {
        for (uint64_t s = 0; s < N; s++) {
            sphpa_rng rng = which ? sphpa_rng_seed(s, 5) : sphpa_rng_seed(5, s);
            first[s] = sphpa_rng_uniform(&rng);
        }
        for (int step = 1; step <= 4096; step *= 2) {
            double count[BINS], chi2 = 0.0, expected = (double)(N - step) / BINS;
            memset(count, 0, sizeof count);
            for (int s = 0; s + step < N; s++)
                count[16 * (int)(16.0 * first[s]) + (int)(16.0 * first[s + step])] += 1.0;
            for (int k = 0; k < BINS; k++)
                chi2 += (count[k] - expected) * (count[k] - expected) / expected;
            assert_near_abs(chi2, BINS - 1.0, 4.5 * sqrt(2.0 * (BINS - 1.0)));
        }
    }
}

/* ---- eigenvalues ----------------------------------------------------------------------------- */

static sphpa_sym3 tensor(double xx, double yy, double zz, double xy, double yz, double xz) {
    sphpa_sym3 S;
    S.xx = xx;
    S.yy = yy;
    S.zz = zz;
    S.xy = xy;
    S.yz = yz;
    S.xz = xz;
    return S;
}

static double between(sphpa_rng *rng, double low, double high) {
    return low + (high - low) * sphpa_rng_uniform(rng);
}

/* the largest component: a size that does not overflow */
static double size_of(const sphpa_sym3 *S) {
    const double c[6] = {S->xx, S->yy, S->zz, S->xy, S->yz, S->xz};
    double size = 0.0;
    for (int i = 0; i < 6; i++) size = fmax(size, fabs(c[i]));
    return size;
}

/* A v = lambda v, order, trace, |A|^2, orthogonality, right-handedness; everything relative to
   `size`, and divided by it first */
static void assert_eigen(const sphpa_sym3 *S, double size) {
    const double bound = 16.0 * EPS;
    const double A[3][3] = {{S->xx / size, S->xy / size, S->xz / size},
                            {S->xy / size, S->yy / size, S->yz / size},
                            {S->xz / size, S->yz / size, S->zz / size}};
    double value[3], v[3][3], alone[3], trace = 0.0, square = 0.0;
    sphpa_sym3_eigen(S, value, v);
    sphpa_sym3_eigen(S, alone, NULL);
    assert_memory_equal(alone, value, sizeof alone);
    assert_true(value[0] >= value[1] && value[1] >= value[2]);
    for (int k = 0; k < 3; k++) {
        double lambda = value[k] / size;
        trace += lambda;
        square += lambda * lambda;
        for (int a = 0; a < 3; a++) {
            double Av = A[a][0] * v[k][0] + A[a][1] * v[k][1] + A[a][2] * v[k][2];
            assert_near_abs(Av, lambda * v[k][a], bound);
        }
        for (int m = 0; m < 3; m++) {
            double dot = v[k][0] * v[m][0] + v[k][1] * v[m][1] + v[k][2] * v[m][2];
            assert_near_abs(dot, k == m ? 1.0 : 0.0, bound);
        }
    }
    assert_near_abs(trace, A[0][0] + A[1][1] + A[2][2], bound);
    double norm2 = 0.0;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) norm2 += A[a][b] * A[a][b];
    assert_near_abs(square, norm2, 4.0 * bound);
    double triple = 0.0; /* v0 . (v1 x v2) */
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;
        triple += v[0][a] * (v[1][b] * v[2][c] - v[1][c] * v[2][b]);
    }
    assert_near(triple, 1.0, bound);
}

static void eigen_random(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(4, 4);
    for (int i = 0; i < 100000; i++) {
        double p[6];
        for (int j = 0; j < 6; j++) {
            p[j] = between(&rng, -1.0, 1.0);
            if (i % 4 == 1) p[j] *= pow(10.0, between(&rng, -20.0, 0.0)); /* graded */
            if (i % 4 == 2 && sphpa_rng_below(&rng, 2)) p[j] = 0.0;       /* sparse */
            if (i % 4 == 3) p[j] = floor(3.0 * p[j]);                     /* often degenerate */
        }
        sphpa_sym3 S = tensor(p[0], p[1], p[2], p[3], p[4], p[5]);
        double size = size_of(&S);
        assert_eigen(&S, size > 0.0 ? size : 1.0);
    }
}

/* eigenvalues that were chosen: R diag(lambda) R^T with a random rotation, in long double */
static void eigen_known(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(4, 5);
    static const double chosen[][3] = {{3.0, 2.0, 1.0},   {1.0, 1.0, 1.0},   {2.0, 2.0, -1.0},
                                       {1.0, -2.0, -2.0}, {5.0, 0.0, 0.0},   {0.0, 0.0, -7.0},
                                       {1.0, 1e-8, 0.0},  {1.0, 1.0 - 1e-12, -1.0},
                                       {1e9, 1.0, -1e-9}, {0.0, 0.0, 0.0}};
    for (int i = 0; i < 20000; i++) {
        const double *lambda = chosen[i % 10];
        long double q[4], n = 0.0L, Q[3][3], A[3][3];
        for (int j = 0; j < 4; j++) {
            q[j] = (long double)sphpa_rng_normal(&rng);
            n += q[j] * q[j];
        }
        for (int j = 0; j < 4; j++) q[j] /= sqrtl(n);
        for (int a = 0; a < 3; a++) { /* the rotation of a unit quaternion */
            int b = (a + 1) % 3, c = (a + 2) % 3;
            Q[a][a] = 1.0L - 2.0L * (q[b + 1] * q[b + 1] + q[c + 1] * q[c + 1]);
            Q[a][b] = 2.0L * (q[a + 1] * q[b + 1] - q[0] * q[c + 1]);
            Q[b][a] = 2.0L * (q[a + 1] * q[b + 1] + q[0] * q[c + 1]);
        }
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) {
                A[a][b] = 0.0L;
                for (int j = 0; j < 3; j++)
                    A[a][b] += Q[a][j] * (long double)lambda[j] * Q[b][j];
            }
        sphpa_sym3 S = tensor((double)A[0][0], (double)A[1][1], (double)A[2][2], (double)A[0][1],
                              (double)A[1][2], (double)A[0][2]);
        double size = fmax(fabs(lambda[0]), fabs(lambda[2])), value[3];
        assert_eigen(&S, size > 0.0 ? size : 1.0);
        sphpa_sym3_eigen(&S, value, NULL);
        for (int k = 0; k < 3; k++) assert_near_abs(value[k], lambda[k], 8.0 * EPS * size);
    }
}

static void eigen_exact(void **state) {
    (void)state;
    double value[3], v[3][3];
    sphpa_sym3 S = tensor(-3.0, 7.0, 2.0, 0.0, 0.0, 0.0); /* diagonal: bitwise, and sorted */
    sphpa_sym3_eigen(&S, value, v);
    assert_true(value[0] == 7.0 && value[1] == 2.0 && value[2] == -3.0);
    assert_true(fabs(v[0][1]) == 1.0 && fabs(v[1][2]) == 1.0 && fabs(v[2][0]) == 1.0);
    S = tensor(0.0, 0.0, 0.0, 5.0, 0.0, 0.0); /* pure shear: 5, 0, -5 at 45 degrees */
    sphpa_sym3_eigen(&S, value, v);
    assert_near(value[0], 5.0, 2.0 * EPS);
    assert_near_abs(value[1], 0.0, 2.0 * EPS);
    assert_near(value[2], -5.0, 2.0 * EPS);
    assert_near(v[0][0] * v[0][1], 0.5, 4.0 * EPS);
    assert_near(v[2][0] * v[2][1], -0.5, 4.0 * EPS);
    S = tensor(2.0, 2.0, 2.0, -1.0, -1.0, 0.0); /* the chain of three springs: 2 - 2 cos(k pi/4) */
    sphpa_sym3_eigen(&S, value, NULL);
    for (int k = 0; k < 3; k++)
        assert_near(value[k], 2.0 - 2.0 * cos((3 - k) * PI / 4.0), 8.0 * EPS);
}

static void eigen_scaled(void **state) {
    (void)state;
    const double sizes[] = {1e-320, 1e-300, 1e-200, 1e-150, 1e150, 1e200, 1e300};
    sphpa_rng rng = sphpa_rng_seed(4, 6);
    for (int m = 0; m < 7; m++)
        for (int i = 0; i < 1000; i++) {
            double p[6];
            for (int j = 0; j < 6; j++) p[j] = sizes[m] * between(&rng, -1.0, 1.0);
            sphpa_sym3 S = tensor(p[0], p[1], p[2], p[3], p[4], p[5]);
            if (m > 0) { /* denormals have no relative precision left to test */
                assert_eigen(&S, size_of(&S));
                continue;
            }
            double value[3], v[3][3];
            sphpa_sym3_eigen(&S, value, v);
            for (int k = 0; k < 3; k++) {
                double n = v[k][0] * v[k][0] + v[k][1] * v[k][1] + v[k][2] * v[k][2];
                assert_near(n, 1.0, 16.0 * EPS);
                assert_true(fabs(value[k]) <= 4e-320);
            }
        }
}

/* ---- the exponential ------------------------------------------------------------------------- */

/* error of sphpa_exp_ in units of the last place of the true value */
static double exp_error_ulp(double x) {
    long double exact = expl((long double)x);
    int power;
    (void)frexpl(exact, &power);
    long double ulp = ldexpl(1.0L, power - 53);
    long double least = ldexpl(1.0L, -1074);
    if (ulp < least) ulp = least;
    return (double)(fabsl((long double)sphpa_exp_(x) - exact) / ulp);
}

static void exponential_is_good_to_its_stated_error(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(16, 1);
    double worst = 0.0;
    for (int n = 0; n < 200000; n++) {
        worst = fmax(worst, exp_error_ulp(-750.0 * sphpa_rng_uniform(&rng)));
        worst = fmax(worst, exp_error_ulp(-40.0 * sphpa_rng_uniform(&rng)));
        worst = fmax(worst, exp_error_ulp(-pow(10.0, -20.0 * sphpa_rng_uniform(&rng))));
        /* subnormal results */
        worst = fmax(worst, exp_error_ulp(-708.0 - 38.0 * sphpa_rng_uniform(&rng)));
    }
    for (int k = 0; k < 1076; k++) /* where k changes, |r| is largest */
        for (int s = -2; s <= 2; s++)
            worst = fmax(worst, exp_error_ulp(-(k + 0.5) * 0.69314718055994531 * (1 + s * 1e-15)));
    if (!(worst <= 1.1)) print_error("exp: %.4f ulp\n", worst);
    assert_true(worst <= 1.1); /* 1.04: the worst of 4e7 draws */
    double zero = 0.0;
    assert_true(sphpa_exp_(0.0) == 1.0 && sphpa_exp_(-zero) == 1.0);
    assert_true(sphpa_exp_(-745.0) > 0.0 && sphpa_exp_(-745.2) == 0.0);
    assert_true(sphpa_exp_(-1e300) == 0.0 && sphpa_exp_(-HUGE_VAL) == 0.0);
    assert_true(sphpa_exp_(nan("")) != sphpa_exp_(nan("")));
}

/* a loop that a compiler may turn into vectors gives the bits of single calls */
static void exponential_has_the_same_bits_in_a_loop(void **state) {
    (void)state;
    enum { N = 1001 };
    static double x[N], y[N];
    for (int n = 0; n < N; n++) x[n] = -0.77 * n;
    for (int n = 0; n < N; n++) y[n] = sphpa_exp_(x[n]);
    for (int n = 0; n < N; n++) {
        volatile double one = x[n];
        assert_true(sphpa_exp_(one) == y[n]);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(result_texts),   cmocka_unit_test(unknown_results),
        cmocka_unit_test(error_messages), cmocka_unit_test(pcg_published),
        cmocka_unit_test(uniform_moments), cmocka_unit_test(normal_moments),
        cmocka_unit_test(exponential_is_good_to_its_stated_error),
        cmocka_unit_test(exponential_has_the_same_bits_in_a_loop),
        cmocka_unit_test(below_is_unbiased), cmocka_unit_test(mixing_published), cmocka_unit_test(same_seed_and_stream_give_the_same),
        cmocka_unit_test(neighbouring_streams_are_independent), cmocka_unit_test(first_draws_are_random),
        cmocka_unit_test(eigen_random),   cmocka_unit_test(eigen_known),
        cmocka_unit_test(eigen_exact),    cmocka_unit_test(eigen_scaled),
    };
    return cmocka_run_group_tests_name("base", tests, NULL, NULL);
}
