/* test_porosity.c: crush curves, the P-alpha solvers, the exact piston. The reference is a second
   implementation in long double, written here and sharing nothing with the header. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <float.h>
#include <math.h>
#include <string.h>

#include <cmocka.h>

#define SPHPA_POROSITY_IMPLEMENTATION
#include "sphpa.h"

#include "near.h"

/* ---- the reference --------------------------------------------------------------------------- */

#define L(x) ((long double)(x)) /* clang warns on every silent one */

typedef struct ref_material {
    long double rho0, A, B, E0, u_iv, u_cv, a, b, alpha, beta;
    int zero_B_expanded;
} ref_material;

typedef struct ref_curve_data {
    long double alpha0, Pe, Pt, Ps, alpha_t, n1, n2, c_s, c_e, K0;
    bool two_exponent, herrmann;
} ref_curve_data;

typedef struct ref_state {
    ref_material mat;
    ref_curve_data curve;
    long double rho, u, top, alpha_y, Py, cap;
} ref_state;

/* Tillotson straight from the page; *scale is how much rounding of the input can matter */
static long double ref_tillotson(const ref_material *m, long double rho, long double u,
                                 long double *scale) {
    long double eta = rho / m->rho0, mu = eta - 1.0L, z = 1.0L / eta - 1.0L;
    long double w = 1.0L + u / (m->E0 * eta * eta), A = m->A;
    long double B = m->zero_B_expanded && eta < 1.0L ? 0.0L : m->B;
    long double hot = (m->a + m->b / w) * rho * u;
    long double Pc = hot + A * mu + B * mu * mu;
    long double Pe = m->a * rho * u + (m->b * rho * u / w + A * mu * expl(-m->beta * z)) *
                                          expl(-m->alpha * z * z);
    *scale = hot + A * eta + B * eta * eta;
    if (eta >= 1.0L || u <= m->u_iv) return Pc;
    if (u >= m->u_cv) return Pe;
    return ((u - m->u_iv) * Pe + (m->u_cv - u) * Pc) / (m->u_cv - m->u_iv);
}

static long double ref_curve(const ref_curve_data *c, long double P, long double top) {
    long double t = (c->Ps - P) / (c->Ps - c->Pe);
    if (P <= c->Pe) return top;
    if (P >= c->Ps) return 1.0L;
    if (!c->two_exponent) return 1.0L + (top - 1.0L) * t * t;
    long double alpha = 1.0L + (c->alpha_t - 1.0L) * powl(t, c->n2);
    if (P < c->Pt) alpha += (top - c->alpha_t) * powl((c->Pt - P) / (c->Pt - c->Pe), c->n1);
    return alpha;
}

/* dalpha/dP of Herrmann's elastic branch, and a line of it by Runge and Kutta */
static long double ref_slope(const ref_curve_data *c, long double alpha) {
    long double hh = 1.0L + (alpha - 1.0L) * (c->c_e - c->c_s) / (c->c_s * (c->alpha0 - 1.0L));
    return alpha * alpha / c->K0 * (1.0L - 1.0L / (hh * hh));
}

static long double ref_line(const ref_curve_data *c, long double alpha, long double P_from,
                            long double P_to) {
    const int n = 48;
    long double h = (P_to - P_from) / n;
    for (int i = 0; i < n; i++) {
        long double k1 = ref_slope(c, alpha), k2 = ref_slope(c, alpha + 0.5L * h * k1);
        long double k3 = ref_slope(c, alpha + 0.5L * h * k2), k4 = ref_slope(c, alpha + h * k3);
        alpha += h / 6.0L * (k1 + 2.0L * k2 + 2.0L * k3 + k4);
    }
    return alpha;
}

static ref_curve_data ref_curve_of(const sphpa_crush *c) {
    ref_curve_data r;
    r.alpha0 = L(c->alpha0);
    r.Pe = L(c->Pe);
    r.Pt = L(c->Pt);
    r.Ps = L(c->Ps);
    r.alpha_t = L(c->alpha_t);
    r.n1 = L(c->n1);
    r.n2 = L(c->n2);
    r.c_s = L(c->c_s);
    r.c_e = c->c_e > 0.0 ? L(c->c_e) : L(c->c_s) / 2.0L;
    r.K0 = L(c->K0);
    r.two_exponent = c->kind == SPHPA_CRUSH_TWO_EXPONENT;
    r.herrmann = c->elastic == SPHPA_CRUSH_HERRMANN;
    return r;
}

static ref_state ref_make(const sphpa_tillotson *m, const sphpa_crush *curve, double rho, double u,
                          double alpha_old) {
    ref_state s;
    s.mat.rho0 = L(m->rho0);
    s.mat.A = L(m->A);
    s.mat.B = L(m->B);
    s.mat.E0 = L(m->E0);
    s.mat.u_iv = L(m->u_iv);
    s.mat.u_cv = L(m->u_cv);
    s.mat.a = L(m->a);
    s.mat.b = L(m->b);
    s.mat.alpha = L(m->alpha);
    s.mat.beta = L(m->beta);
    s.mat.zero_B_expanded = m->zero_B_expanded;
    s.curve = ref_curve_of(curve);
    s.rho = L(rho);
    s.u = L(u);
    s.top = s.curve.alpha0;
    s.alpha_y = s.cap = L(alpha_old);
    s.Py = 0.0L;
    if (!s.curve.herrmann) return s;
    s.top = ref_line(&s.curve, s.curve.alpha0, 0.0L, s.curve.Pe);
    s.alpha_y = fminl(L(alpha_old), s.top);
    long double low = s.curve.Pe, high = s.curve.Ps;
    for (int k = 0; k < 70; k++) {
        long double middle = 0.5L * (low + high);
        if (ref_curve(&s.curve, middle, s.top) >= s.alpha_y) low = middle;
        else high = middle;
    }
    s.Py = low;
    s.cap = s.alpha_y >= s.top ? s.curve.alpha0 : ref_line(&s.curve, s.alpha_y, s.Py, 0.0L);
    return s;
}

static long double ref_P(const ref_state *s, long double alpha) {
    long double scale;
    return ref_tillotson(&s->mat, alpha * s->rho, s->u, &scale) / alpha;
}

static long double ref_F(const ref_state *s, long double alpha) {
    long double P = ref_P(s, alpha);
    if (s->curve.herrmann && P < s->Py) {
        if (P <= 0.0L) return alpha - s->cap;
        return alpha - ref_line(&s->curve, s->alpha_y, s->Py, P);
    }
    return alpha - fminl(ref_curve(&s->curve, P, s->top), s->alpha_y);
}

static long double ref_bisect(const ref_state *s, long double low, long double high) {
    for (int k = 0; k < 66; k++) {
        long double middle = 0.5L * (low + high);
        if (ref_F(s, middle) > 0.0L) high = middle;
        else low = middle;
    }
    return 0.5L * (low + high);
}

static long double ref_solve(const ref_state *s) {
    if (ref_F(s, s->cap) <= 0.0L) return s->cap;
    return ref_bisect(s, 1.0L, s->cap);
}

/* the largest root, by looking at n places from the top down */
static long double ref_largest(const ref_state *s, int n) {
    long double above = s->cap;
    if (ref_F(s, above) <= 0.0L) return above;
    for (int k = 1; k <= n; k++) {
        long double alpha = k < n ? s->cap - (s->cap - 1.0L) * k / n : 1.0L;
        if (ref_F(s, alpha) <= 0.0L) return ref_bisect(s, alpha, above);
        above = alpha;
    }
    return 1.0L;
}

/* how far off alpha may be: 2 tol + 16 eps cond, cond = what a relative change of 1 in the input
   would move the root by */
static double ref_allowed(const ref_state *s, long double alpha, double tol) {
    long double scale, h = 1e-7L, P = ref_P(s, alpha);
    (void)ref_tillotson(&s->mat, alpha * s->rho, s->u, &scale);
    long double D = (ref_P(s, alpha * (1.0L + h)) - ref_P(s, alpha * (1.0L - h))) / (2.0L * h);
    long double dP = 1e-6L * s->curve.Ps;
    long double slope = (ref_curve(&s->curve, P - dP, s->top) -
                         ref_curve(&s->curve, P + dP, s->top)) / (2.0L * dP);
    long double move = slope * (scale / alpha + s->curve.Ps) / fabsl(1.0L + slope * D / alpha);
    return (double)(2.0L * L(tol) + 16.0L * L(DBL_EPSILON) * (alpha + move));
}

/* does F change its sign next to alpha? (Newton may also meet a root where F falls.) */
static bool ref_root_near(const ref_state *s, long double alpha) {
    long double d = L(ref_allowed(s, alpha, 1e-12));
    return ref_F(s, fmaxl(alpha - d, 1.0L)) * ref_F(s, fminl(alpha + d, s->cap)) <= 0.0L;
}

/* ---- states ---------------------------------------------------------------------------------- */

typedef struct state {
    double rho, u, alpha_old;
} state;

static state draw_state(sphpa_rng *rng, const sphpa_tillotson *mat, double alpha0) {
    state s;
    double pick = sphpa_rng_uniform(rng);
    s.alpha_old = pick < 0.2 ? alpha0 : 1.0 + (alpha0 - 1.0) * sphpa_rng_uniform(rng);
    if (pick > 0.98) s.alpha_old = 1.0;
    double alpha = 1.0 + (s.alpha_old - 1.0) * sphpa_rng_uniform(rng);
    double spread = sphpa_rng_uniform(rng) < 0.5 ? 0.04 : 0.8;
    s.rho = mat->rho0 / alpha * (1.0 + spread * (sphpa_rng_uniform(rng) - 0.5));
    s.u = pow(10.0, 3.0 + 5.0 * sphpa_rng_uniform(rng));
    if (sphpa_rng_uniform(rng) < 0.2) s.u = 0.0;
    return s;
}

static sphpa_tillotson material(const char *name) {
    const sphpa_tillotson *mat = sphpa_tillotson_find(name);
    assert_non_null(mat);
    return *mat;
}

/* ---- curves ---------------------------------------------------------------------------------- */

static double user_cosine(const void *user, double P, double *dalpha_dP) {
    const double *range = (const double *)user; /* Pe, Ps, alpha0 */
    double turn = 3.14159265358979323846 / (range[1] - range[0]);
    double phase = turn * (P - range[0]), half = 0.5 * (range[2] - 1.0);
    *dalpha_dP = -half * turn * sin(phase);
    return 1.0 + half * (1.0 + cos(phase));
}

static const double cosine_range[3] = {2e6, 3e8, 3.0};

static sphpa_crush user_curve(void) {
    sphpa_crush curve = sphpa_crush_quadratic(cosine_range[2], cosine_range[0], cosine_range[1]);
    curve.kind = SPHPA_CRUSH_USER;
    curve.function = user_cosine;
    curve.user = cosine_range;
    return curve;
}

static sphpa_crush regolith(void) {
    sphpa_crush curve = sphpa_crush_quadratic(1.72, 1e2, 1.5e9);
    curve.kind = SPHPA_CRUSH_TWO_EXPONENT;
    curve.Pt = 1.3e9;
    curve.alpha_t = 1.0;
    curve.n1 = curve.n2 = 2.0;
    return curve;
}

static sphpa_crush herrmann(sphpa_crush curve, double rho0, double c_s) {
    sphpa_error err;
    curve.elastic = SPHPA_CRUSH_HERRMANN;
    assert_int_equal(sphpa_crush_prepare(&curve, rho0, c_s, &err), SPHPA_OK);
    return curve;
}

static void test_curve_values(void **unused) {
    (void)unused;
    sphpa_crush q = sphpa_crush_quadratic(1.275, 8e7, 7e8), p = sphpa_crush_pumice();
    assert_near(sphpa_crush_alpha(&q, 0.5 * (8e7 + 7e8), NULL), 1.0 + 0.275 * 0.25, 1e-15);
    assert_near(sphpa_crush_alpha(&p, 6.8e7, NULL), 1.0 + 0.9 * pow(145.0 / 212.0, 3.0), 1e-14);
    assert_near(sphpa_crush_alpha(&p, 3.45e7, NULL),
                1.0 + 2.74 * pow(0.5, 12.0) + 0.9 * pow(178.5 / 212.0, 3.0), 1e-14);
    assert_near(sphpa_tillotson_find("pumice")->rho0 / p.alpha0, 501.5, 1e-4);
    assert_near(1.0 - 1.0 / p.alpha0, 0.784, 1e-3);
    sphpa_crush r = regolith();
    assert_true(sphpa_crush_alpha(&r, 1.3e9, NULL) == 1.0);
    assert_true(sphpa_crush_alpha(&r, 1.4e9, NULL) == 1.0);
    assert_near(sphpa_crush_yield(&r, 1.0), 1.3e9, 1e-15);
    p.alpha_e = 4.0; /* rescaled: both terms times 3.64/3 */
    p.rescale = 1;
    assert_near(sphpa_crush_alpha(&p, 6.8e7, NULL),
                1.0 + 0.9 * 3.64 / 3.0 * pow(145.0 / 212.0, 3.0), 1e-14);
    assert_near(sphpa_crush_alpha(&p, 1.0e6 * (1.0 + 1e-12), NULL), 4.64, 1e-10);
    sphpa_crush dense = sphpa_crush_quadratic(1.0, 0.0, 0.0);
    double slope = 7.0;
    assert_true(sphpa_crush_alpha(&dense, 5e8, &slope) == 1.0 && slope == 0.0);
}

static void check_curve(const sphpa_crush *curve) {
    sphpa_error err;
    assert_int_equal(sphpa_crush_check(curve, &err), SPHPA_OK);
    assert_true(sphpa_crush_alpha(curve, -1e9, NULL) == curve->alpha0);
    assert_true(sphpa_crush_alpha(curve, curve->Ps, NULL) == 1.0);
    assert_true(sphpa_crush_alpha(curve, 1e12, NULL) == 1.0);
    double last = curve->alpha0;
    for (int i = 0; i <= 4000; i++) {
        double P = curve->Ps * (i + 0.37) / 3900.0, h = 1e-5 * curve->Ps, slope;
        double alpha = sphpa_crush_alpha(curve, P, &slope);
        assert_true(alpha >= 1.0 && alpha <= last);
        last = alpha;
        if (alpha > 1.0 + 1e-9 && P > curve->Pe + h)
            assert_near_abs(sphpa_crush_alpha(curve, sphpa_crush_yield(curve, alpha), NULL), alpha,
                            1e-13 * curve->alpha0);
        bool kink = false; /* the difference must not reach over one */
        const double kinks[] = {0.0, curve->Pe, curve->Pt, curve->Ps};
        for (int k = 0; k < 4; k++) kink = kink || fabs(P - kinks[k]) <= 2.0 * h;
        if (kink) continue;
        double up = sphpa_crush_alpha(curve, P + h, NULL);
        double down = sphpa_crush_alpha(curve, P - h, NULL);
        double scale = (curve->alpha0 - 1.0) / curve->Ps, s = slope / scale;
        assert_near_abs(s, (up - down) / (2.0 * h * scale), 2e-5 * (1.0 + fabs(s)));
    }
}

static void test_curve_slopes(void **unused) {
    (void)unused;
    sphpa_crush curves[8];
    curves[0] = sphpa_crush_quadratic(4.64, 1e6, 2.13e8);
    curves[1] = sphpa_crush_pumice();
    curves[2] = sphpa_crush_porous_aluminium();
    curves[3] = regolith();
    curves[4] = user_curve();
    curves[5] = herrmann(sphpa_crush_porous_aluminium(), 2700.0, 5350.0);
    curves[6] = herrmann(user_curve(), 2700.0, 3145.0);
    curves[7] = sphpa_crush_pumice();
    curves[7].n1 = 2.5; /* exponents that are no whole numbers */
    curves[7].n2 = 3.25;
    for (int i = 0; i < 8; i++) check_curve(&curves[i]);
}

static void expect_curve_error(const sphpa_crush *curve, sphpa_result result, const char *a,
                               const char *b) {
    sphpa_error err;
    memset(&err, 0, sizeof err);
    assert_int_equal(sphpa_crush_check(curve, &err), result);
    assert_int_equal(err.result, result);
    if (strstr(err.message, a) == NULL || strstr(err.message, b) == NULL)
        fail_msg("\"%s\" names not both %s and %s", err.message, a, b);
    sphpa_tillotson mat = material("pumice");
    sphpa_palpha_solution out, before;
    memset(&before, 0x5a, sizeof before);
    out = before;
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, curve, 1000.0, 0.0, 1.5,
                                        NULL, &out), result);
    assert_memory_equal(&out, &before, sizeof out);
}

static void test_curve_errors(void **unused) {
    (void)unused;
    sphpa_crush c = sphpa_crush_quadratic(2.0, 5e8, 1e8);
    expect_curve_error(&c, SPHPA_ERROR_CURVE, "5e+08", "1e+08"); /* upside down */
    c = sphpa_crush_quadratic(2.0, 1e8, 1e8);
    expect_curve_error(&c, SPHPA_ERROR_CURVE, "1e+08", "Ps");
    c = sphpa_crush_quadratic(2.0, -1.0, 1e8);
    expect_curve_error(&c, SPHPA_ERROR_CURVE, "-1", "1e+08");
    c = sphpa_crush_quadratic(0.9, 1e6, 1e8);
    expect_curve_error(&c, SPHPA_ERROR_CURVE, "alpha0", "0.9");
    c = sphpa_crush_quadratic((double)NAN, 1e6, 1e8);
    expect_curve_error(&c, SPHPA_ERROR_NOT_FINITE, "alpha0", "nan");
    c = sphpa_crush_quadratic(2.0, 1e6, (double)INFINITY);
    expect_curve_error(&c, SPHPA_ERROR_NOT_FINITE, "Ps", "inf");
    c = sphpa_crush_pumice();
    c.alpha_e = 4.5;
    expect_curve_error(&c, SPHPA_ERROR_CURVE, "4.5", "4.6399999999999997");
    c.rescale = 1;
    assert_int_equal(sphpa_crush_check(&c, NULL), SPHPA_OK);
    c = sphpa_crush_pumice();
    c.alpha_t = 4.7;
    expect_curve_error(&c, SPHPA_ERROR_CURVE, "4.7", "4.64");
    c = sphpa_crush_pumice();
    c.Pt = 3e8;
    expect_curve_error(&c, SPHPA_ERROR_CURVE, "3e+08", "2.13e+08");
    c = sphpa_crush_pumice();
    c.Pt = c.Pe; /* would jump from alpha_e to alpha_t */
    expect_curve_error(&c, SPHPA_ERROR_CURVE, "4.64", "1.9");
    c = sphpa_crush_pumice();
    c.n1 = 0.5;
    expect_curve_error(&c, SPHPA_ERROR_CURVE, "0.5", "3");
    c = user_curve();
    c.function = NULL;
    expect_curve_error(&c, SPHPA_ERROR_MISSING, "USER", "NULL");
    c = user_curve();
    c.alpha0 = 3.5; /* not what the function starts at */
    assert_int_equal(sphpa_crush_check(&c, NULL), SPHPA_ERROR_CURVE);
    assert_int_equal(sphpa_crush_check(NULL, NULL), SPHPA_ERROR_MISSING);
    c = sphpa_crush_porous_aluminium();
    c.elastic = SPHPA_CRUSH_HERRMANN; /* not prepared */
    sphpa_tillotson mat = material("aluminium");
    sphpa_palpha_solution out;
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, &c, 2200.0, 0.0, 1.2, NULL,
                                        &out), SPHPA_ERROR_MISSING);
    sphpa_crush before = c;
    assert_int_equal(sphpa_crush_prepare(&c, 2700.0, 4000.0, NULL), SPHPA_ERROR_CURVE);
    assert_int_equal(sphpa_crush_prepare(&c, -1.0, 5350.0, NULL), SPHPA_ERROR_NEGATIVE);
    assert_int_equal(sphpa_crush_prepare(&c, 2700.0, (double)NAN, NULL), SPHPA_ERROR_NOT_FINITE);
    assert_memory_equal(&c, &before, sizeof c);
}

/* the closed form of the elastic lines against Runge and Kutta; c_e unknown means c_s/2 */
static void test_herrmann_lines(void **unused) {
    (void)unused;
    sphpa_crush curves[3];
    curves[0] = herrmann(sphpa_crush_porous_aluminium(), 2700.0, 5350.0);
    curves[1] = herrmann(sphpa_crush_pumice(), 2327.0, sqrt(2.67e10 / 2327.0));
    curves[2] = herrmann(regolith(), 2650.0, 2600.0);
    for (int i = 0; i < 3; i++) {
        const sphpa_crush *c = &curves[i];
        ref_curve_data ref = ref_curve_of(c);
        /* Phi is of the order of K0 and cancels: some eps K0 times the slope of the line */
        assert_near(c->alpha_y, (double)ref_line(&ref, ref.alpha0, 0.0L, ref.Pe), 3e-14);
        assert_near(sphpa_crush_alpha(c, 0.4 * c->Pe, NULL),
                    (double)ref_line(&ref, ref.alpha0, 0.0L, 0.4L * ref.Pe), 3e-14);
        for (int k = 1; k < 40; k++) {
            double alpha = 1.0 + (c->alpha_y - 1.0) * k / 40.0;
            long double foot = ref_line(&ref, L(alpha), L(sphpa_crush_yield(c, alpha)), 0.0L);
            assert_near(sphpa_crush_rest(c, alpha), (double)foot, 1e-12);
            assert_true(sphpa_crush_rest(c, alpha) > alpha);
        }
        assert_true(sphpa_crush_rest(c, c->alpha0) == c->alpha0);
        assert_true(sphpa_crush_rest(c, 1.0) == 1.0);
    }
}

/* load past the yield point, unload, reload: one line down and up, and alpha0 - alpha grows */
static void test_herrmann_cycle(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("aluminium");
    sphpa_crush curve = herrmann(sphpa_crush_porous_aluminium(), 2700.0, 5350.0);
    double memory = curve.alpha0, rest0 = 2700.0 / curve.alpha0;
    double down[40], top_memory = 0.0;
    for (int k = 0; k <= 160; k++) { /* density up by 8 %, down by 7 %, up again, and past it */
        double up = k <= 40 ? k / 40.0 : k <= 80 ? (80 - k) / 40.0 : (k - 80) / 40.0;
        double rho = rest0 * (1.0 + 0.08 * up);
        sphpa_palpha_solution s;
        assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, &curve, rho, 100.0,
                                            memory, NULL, &s), SPHPA_OK);
        if (s.P >= curve.Pe && s.alpha <= memory)
            assert_near(s.alpha, sphpa_crush_alpha(&curve, s.P, NULL), 1e-11);
        memory = sphpa_min_(memory, s.alpha);
        if (k == 40) top_memory = memory;
        if (k > 40 && k < 80) {
            down[k - 41] = s.alpha;
            assert_true(s.alpha > memory - 1e-12 && s.alpha <= sphpa_crush_rest(&curve, memory));
        }
        if (k > 80 && k < 120) assert_near(s.alpha, down[119 - k], 1e-12); /* the same line */
        if (k > 40 && k < 120) assert_true(memory == top_memory);
        if (k == 150) assert_true(memory < top_memory - 1e-3);
    }
}

/* ---- solvers against the reference ----------------------------------------------------------- */

typedef struct tally {
    int right, other, failed, wrong;
    int evaluations_max;
} tally;

static void judge(tally *t, const ref_state *ref, long double root, double allowed,
                  sphpa_result result, const sphpa_palpha_solution *s) {
    if (s->evaluations > t->evaluations_max) t->evaluations_max = s->evaluations;
    if (result == SPHPA_ERROR_NOT_CONVERGED) {
        t->failed++;
        assert_int_equal(s->iterations, 100);
        assert_near_abs(s->residual, (double)ref_F(ref, L(s->alpha)), 1e-7);
        return;
    }
    assert_int_equal(result, SPHPA_OK);
    double above = !ref->curve.herrmann ? 0.0 : 1e-12; /* its cap is computed */
    assert_true(s->alpha >= 1.0 && s->alpha <= (double)ref->cap + above);
    double P_error = fabs(s->P - (double)ref_P(ref, L(s->alpha)));
    double scale = (double)(ref->mat.A + ref->mat.B + 1e4L * ref->u);
    /* P is that of the root: the matrix's at alpha but for what the tolerance leaves open */
    double open = fabs((double)(ref_P(ref, L(s->alpha) + 1e-12L) - ref_P(ref, L(s->alpha) - 1e-12L)));
    if (!(P_error <= 1e-13 * (fabs(s->P) + scale) + open))
        fail_msg("rho %.17g u %.17g alpha_old %.17g: P %.17g at alpha %.17g is off by %g", (double)ref->rho,
                 (double)ref->u, (double)ref->alpha_y, s->P, s->alpha, P_error);
    if (fabsl(L(s->alpha) - root) <= L(allowed)) t->right++;
    else if (ref_root_near(ref, L(s->alpha))) t->other++;
    else {
        t->wrong++;
        print_error("rho %.17g u %.17g alpha_old %.17g: %.17g, not %.17Lg (allowed %.2g)\n",
                    (double)ref->rho, (double)ref->u, (double)ref->alpha_y, s->alpha, root,
                    allowed);
    }
}

static void run_solvers(const sphpa_tillotson *mat, const sphpa_crush *curve, int n, uint64_t seed,
                        tally tallies[4]) {
    sphpa_rng rng = sphpa_rng_seed(seed, 11);
    memset(tallies, 0, 4 * sizeof *tallies);
    for (int i = 0; i < n; i++) {
        state s = draw_state(&rng, mat, curve->alpha0);
        ref_state ref = ref_make(mat, curve, s.rho, s.u, s.alpha_old);
        long double root = ref_solve(&ref);
        double allowed = ref_allowed(&ref, root, 1e-12);
        for (int k = 0; k < 4; k++) {
            sphpa_palpha_solution out;
            memset(&out, 0, sizeof out);
            sphpa_result result = sphpa_palpha_solve((sphpa_palpha_solver)k, mat, curve, s.rho, s.u,
                                                     s.alpha_old, NULL, &out);
            if (result == SPHPA_OK) {
                sphpa_eos_point point;
                assert_int_equal(sphpa_tillotson_eval(mat, out.alpha * s.rho, s.u, &point),
                                 SPHPA_OK);
                assert_near(out.c, point.c, 1e-7); /* CRUSH_SPACE: along the last step */
            }
            judge(&tallies[k], &ref, root, allowed, result, &out);
        }
    }
}

static void check_solvers(const char *name, int keep_B, const sphpa_crush *curve, int n,
                          bool one_root) {
    sphpa_tillotson mat = material(name);
    tally t[4];
    if (keep_B) mat.zero_B_expanded = 0;
    run_solvers(&mat, curve, n, 2026, t);
    for (int k = 0; k < 4; k++) {
        if (t[k].wrong > 0) fail_msg("%s, solver %d: %d wrong of %d", name, k, t[k].wrong, n);
        assert_int_equal(t[k].right + t[k].other + t[k].failed, n);
        if (k != SPHPA_PALPHA_NEWTON) assert_int_equal(t[k].failed, 0);
        if (one_root) assert_int_equal(t[k].other, 0);
    }
    assert_true(t[SPHPA_PALPHA_NEWTON].failed > n / 20); /* it does cycle */
    assert_true(t[SPHPA_PALPHA_BISECTION].evaluations_max <= 45);
    assert_true(t[SPHPA_PALPHA_CRUSH_SPACE].evaluations_max <= 40);
}

static void test_solvers_pumice(void **unused) {
    (void)unused;
    sphpa_crush q = sphpa_crush_quadratic(4.64, 1e6, 2.13e8), p = sphpa_crush_pumice();
    check_solvers("pumice", 0, &q, 12500, true);
    check_solvers("pumice", 0, &p, 12500, true);
}

static void test_solvers_aluminium(void **unused) {
    (void)unused;
    sphpa_crush q = sphpa_crush_quadratic(4.64, 1e6, 2.13e8), p = sphpa_crush_pumice();
    check_solvers("aluminium", 0, &q, 12500, true);
    check_solvers("aluminium", 0, &p, 12500, true);
}

static void test_solvers_nylon(void **unused) {
    (void)unused;
    sphpa_crush q = sphpa_crush_quadratic(4.64, 1e6, 2.13e8), p = sphpa_crush_pumice();
    check_solvers("nylon", 1, &q, 12500, false);
    check_solvers("nylon", 1, &p, 12500, false);
}

static void test_solvers_ice(void **unused) {
    (void)unused;
    sphpa_crush q = sphpa_crush_quadratic(4.64, 1e6, 2.13e8), p = sphpa_crush_pumice();
    check_solvers("ice", 0, &q, 12500, false);
    check_solvers("ice", 0, &p, 12500, false);
}

static void test_solvers_herrmann(void **unused) {
    (void)unused;
    sphpa_crush a = herrmann(sphpa_crush_porous_aluminium(), 2700.0, 5350.0);
    sphpa_crush p = herrmann(sphpa_crush_pumice(), 2327.0, sqrt(2.67e10 / 2327.0));
    check_solvers("aluminium", 0, &a, 300, true);
    check_solvers("pumice", 0, &p, 300, true);
}

/* a caller's curve, and one with an end before Ps, against bisection of the header's own F */
static void test_solvers_other_curves(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("basalt");
    sphpa_rng rng = sphpa_rng_seed(5, 5);
    sphpa_crush curves[4];
    curves[0] = user_curve();
    curves[1] = regolith();
    curves[2] = herrmann(user_curve(), 2700.0, 3145.0);
    curves[3] = sphpa_crush_pumice();
    curves[3].n1 = 2.5;
    curves[3].n2 = 3.25;
    for (int i = 0; i < 8000; i++) {
        const sphpa_crush *c = &curves[i % 4];
        state s = draw_state(&rng, &mat, c->alpha0);
        sphpa_palpha_solution a, b;
        assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, c, s.rho, s.u,
                                            s.alpha_old, NULL, &a), SPHPA_OK);
        assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_BISECTION, &mat, c, s.rho, s.u,
                                            s.alpha_old, NULL, &b), SPHPA_OK);
        assert_near_abs(a.alpha, b.alpha, 3e-12);
        assert_true(a.evaluations <= 40);
        if (c->elastic == SPHPA_CRUSH_FLAT) { /* alpha obeys the curve, or does not move */
            assert_true(a.alpha <= s.alpha_old);
            double on = sphpa_crush_alpha(c, a.P, NULL);
            assert_near_abs(a.alpha, on < s.alpha_old ? on : s.alpha_old, 1e-8);
        }
    }
}

/* a caller's curve with a mistake: its slope is not its own but `share` of it */
typedef struct wrong_slope {
    double range[3], share;
} wrong_slope;

static double user_mistaken(const void *user, double P, double *dalpha_dP) {
    const wrong_slope *wrong = (const wrong_slope *)user;
    double alpha = user_cosine(wrong->range, P, dalpha_dP);
    *dalpha_dP *= wrong->share;
    return alpha;
}

/* such a curve costs evaluations, or ends in NOT_CONVERGED; it never gives an alpha that is none */
static void test_wrong_slopes(void **unused) {
    (void)unused;
    const double shares[7] = {0.0, 0.01, 0.3, 3.0, 100.0, -1.0, -0.01};
    sphpa_tillotson mat = material("basalt");
    sphpa_rng rng = sphpa_rng_seed(31, 5);
    int solved = 0, states = 0;
    for (int i = 0; i < 14000; i++) {
        wrong_slope wrong = {{2e6, 3e8, 3.0}, shares[i % 7]};
        sphpa_crush c = user_curve();
        c.function = user_mistaken;
        c.user = &wrong;
        if (i % 3 == 0) c = herrmann(c, 2700.0, 3145.0);
        state s = draw_state(&rng, &mat, c.alpha0);
        sphpa_palpha_solution a, b;
        assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_BISECTION, &mat, &c, s.rho, s.u,
                                            s.alpha_old, NULL, &b), SPHPA_OK);
        for (int v = 0; v < 4; v++) {
            sphpa_result r = sphpa_palpha_solve((sphpa_palpha_solver)v, &mat, &c, s.rho, s.u,
                                                s.alpha_old, NULL, &a);
            if (v == SPHPA_PALPHA_NEWTON) continue; /* has nothing but slopes to go by */
            states++;
            if (r == SPHPA_ERROR_NOT_CONVERGED) continue;
            assert_int_equal(r, SPHPA_OK);
            if (!(fabs(a.alpha - b.alpha) <= 1e-9))
                fail_msg("solver %d, slope times %g, rho %.17g u %.17g alpha_old %.17g: %.17g, not "
                         "%.17g", v, wrong.share, s.rho, s.u, s.alpha_old, a.alpha, b.alpha);
            solved++;
        }
    }
    print_message("# curves with wrong slopes: %d of %d solved\n", solved, states);
    assert_true(solved > states / 2);
}

/* Curves of any shape: steep, flat, narrow, with kinks (n = 1); FLAT against long double, HERRMANN
   against bisection of the same F. */
static void test_solvers_odd_curves(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("basalt");
    sphpa_rng rng = sphpa_rng_seed(99, 2);
    for (int i = 0; i < 30000; i++) {
        double alpha0 = 1.0 + pow(10.0, -5.0 + 7.0 * sphpa_rng_uniform(&rng));
        double Pe = i % 7 ? pow(10.0, 9.0 * sphpa_rng_uniform(&rng)) : 0.0;
        double Ps = Pe + pow(10.0, -1.0 + 11.0 * sphpa_rng_uniform(&rng));
        sphpa_crush c = sphpa_crush_quadratic(alpha0, Pe, Ps);
        if (i % 3) {
            c.kind = SPHPA_CRUSH_TWO_EXPONENT;
            c.alpha_t = 1.0 + (alpha0 - 1.0) * sphpa_rng_uniform(&rng);
            c.Pt = Pe + (Ps - Pe) * (0.01 + 0.99 * sphpa_rng_uniform(&rng));
            c.n1 = 1.0 + sphpa_rng_below(&rng, 15);
            c.n2 = 1.0 + sphpa_rng_below(&rng, 4);
        }
        if (i % 5 == 0) c.elastic = SPHPA_CRUSH_HERRMANN;
        if (sphpa_crush_prepare(&c, 2700.0, 3145.0, NULL) != SPHPA_OK) continue;
        state s = draw_state(&rng, &mat, alpha0);
        sphpa_palpha_solution a, b;
        assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, &c, s.rho, s.u,
                                            s.alpha_old, NULL, &a), SPHPA_OK);
        assert_true(a.evaluations <= 70);
        if (c.elastic == SPHPA_CRUSH_FLAT) {
            ref_state ref = ref_make(&mat, &c, s.rho, s.u, s.alpha_old);
            if (!ref_root_near(&ref, L(a.alpha)))
                fail_msg("curve %d: rho %.17g u %.17g gives %.17g", i, s.rho, s.u, a.alpha);
            continue;
        }
        assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_BISECTION, &mat, &c, s.rho, s.u,
                                            s.alpha_old, NULL, &b), SPHPA_OK);
        assert_near(a.alpha, b.alpha, 1e-9);
    }
}

/* A state, the long double answer to it, and how near to that an answer has to be: the tolerance
   and 16 roundings of alpha and P, by how much they move the root. From `make stress-eos`. */
typedef struct hard_state {
    const char *what, *material;
    int keep_B, herrmann;
    double rho_u_alpha[3];
    double curve[8]; /* alpha0, Pe, Pt, Ps, alpha_e, alpha_t, n1, n2 (0: the quadratic one) */
    double c_e, tol, root, P, allowed, P_allowed;
} hard_state;

static sphpa_crush hard_curve(const hard_state *h, const sphpa_tillotson *mat) {
    const double *given = h->curve;
    sphpa_crush c = sphpa_crush_quadratic(given[0], given[1], given[3]);
    if (given[7] > 0.0) {
        c.kind = SPHPA_CRUSH_TWO_EXPONENT;
        c.Pt = given[2];
        c.alpha_e = given[4];
        c.rescale = given[4] > 0.0;
        c.alpha_t = given[5];
        c.n1 = given[6];
        c.n2 = given[7];
    }
    c.c_e = h->c_e;
    return h->herrmann ? herrmann(c, mat->rho0, sqrt(mat->A / mat->rho0)) : c;
}

static void check_hard(const hard_state *h, const sphpa_tillotson *mat, const sphpa_crush *curve,
                       double alpha, double P, int evaluations) {
    const double *at = h->rho_u_alpha;
    ref_state ref = ref_make(mat, curve, at[0], at[1], at[2]);
    double there = (double)ref_P(&ref, L(alpha)); /* h->P is that of the root itself */
    if (!(fabs(alpha - h->root) <= h->allowed && fabs(P - there) <= h->P_allowed &&
          evaluations <= 40))
        fail_msg("%s: alpha %.17g, not %.17g; P %.17g, not %.17g (at the root %.17g); %d "
                 "evaluations", h->what, alpha, h->root, P, there, h->P, evaluations);
}

static void test_hard_states(void **unused) {
    (void)unused;
    static const hard_state states[] = {
        {"the root is where line and curve meet", "nylon", 0, 1, {52.632931116806219,
         2542665.0816289592, 8.0240398785780922}, {8.0240398785780922, 80296749.656691283,
         704377076693.30615, 704377076693.30615, 0, 1.4143975021811397, 1.0116884312072811,
         9.5834783229263749}, 237.63511263728779, 1e-12, 5.1607420632141618, 80296749.656691283,
         2.03e-12, 8.56e-07},
        {"the same, on a curve one rounding wide", "aluminium", 0, 1, {1722.0012844005701,
         5592040.1258347901, 1.3404136586779769}, {3.7485695395025886, 4675807701.3836298,
         4675807701.3836308, 4675807701.3836308, 0, 1.4495104478710557, 14.193247549117261,
         1.5393028893932268}, 3869.4672186222979, 1e-12, 1.3404136586779769, 4675807701.3836298,
         2.01e-12, 0.063},
        {"a line from one rounding above 1", "aluminium", 0, 1, {9043.5634226960246,
         2740951.3393326858, 1.0000000000000002}, {1.0023077304891062, 585096155819.38257, 0,
         590730911950.36316, 0, 0, 0, 0}, 3252.2972765870095, 1e-14, 1.0000000368175719,
         586396056035.67542, 5.17e-07, 0.0245},
        {"the foot of a line whose closed form cancels", "aluminium", 0, 1,
         {1.7748174078892763e-10, 66234518.856267244, 48.746088525595596}, {48.746088525595596,
         6064868.7244934225, 180342556.28805336, 241413017.90013799, 0, 8.0904483017030842,
         3.389139758602171, 2.0335599785622067}, 330.8781996346616, 1e-14, 48.746088478532847,
         0.0058777088534636814, 3.66e-13, 6.26e-17},
        {"a line from 2e-12 above 1", "granite", 0, 1, {16272.041321063574, 0,
         1.0000000000019587}, {1.5090438011529281, 554280505705.24194, 0, 941299218194.96301, 0,
         0, 0, 0}, 1619.2345524842908, 1e-09, 1.0987846696519739, 619831134111.33423, 5e-07,
         1.33e+03},
        {"next to a knee with a kink", "water", 0, 0, {1701.3257610200264, 810150.17243741429,
         8.0230348260429025}, {16.801011574498101, 37458623.415114187, 9303577494.5262489,
         9676942301.4440784, 0, 15.387193087889802, 1, 3}, 0, 1e-14, 1.0008360165849561,
         9303577494.5399952, 2.45e-14, 0.0015},
        {"the same, two straight pieces", "nylon", 1, 0, {639.84700242986537, 0,
         7.6758691111549506}, {7.9280889071470151, 182372278.6557155, 205848433.5363754,
         224193637.32009843, 7.0608097182719529, 2.828333933180271, 1, 1}, 0, 1e-12,
         1.9167749227597062, 205848433.53646696, 2.01e-12, 0.00692},
        {"a narrow dip, Pt one rounding above Pe", "ice", 1, 0, {59.692236575108957,
         190172801.8552112, 86.046524822471412}, {100, 3405551963.4947019, 3405551963.4947023,
         5613111914.3495264, 0, 1, 8, 1}, 0, 1e-12, 13.379609281994821, 3405551963.4947019,
         2.05e-12, 6.1e-05},
        {"a dip below a knee that bends without end", "nylon", 1, 0, {115.58823478028253,
         2056455.4265995456, 20.644154282843932}, {44.124105924527797, 267213121.75720814,
         367867080.60714692, 806774768.44168162, 0, 9.8359550905811641, 1.2042533902150674,
         1.1104845315790055}, 0, 1e-12, 7.9643835022847149, 371308180.54050565, 2.14e-12,
         2.02e-05},
        {"a high power makes much of the last digit", "ice", 1, 0, {22.520757564335909,
         23670522.342807412, 29.611804655740393}, {29.611804655740393, 0, 73884593695.975571,
         171315584559.31766, 0, 8.6873210077191025, 27.634607962779857, 2.2575662106297454}, 0,
         1e-14, 28.382178909488974, 159556495.77192852, 1.34e-13, 1.77e-06},
        {"P of the last parabola", "water", 1, 0, {660.61379817237764, 168022852.54456431,
         1.3610490128733268}, {6.4093168312213882, 7726774.8518600706, 77730836814.497482,
         147815850399.62225, 0, 4.3819669135717412, 8, 6}, 0, 1e-12, 1.0384353201425554,
         77730836814.496338, 2.01e-12, 0.00174},
        {"P where the guess is far above the bracket", "basalt", 0, 0, {2623.035140372092,
         140976.98847583792, 1.0000000000000002}, {100, 3617.6554207059694, 3617.6554207059698,
         3617.6554207059698, 0, 48.691330528346398, 27.269933784149554, 1.1658168509659648}, 0,
         1e-12, 1, 3617.6554207568461, 2e-12, 0.0506},
        {"a lane next to a knee", "pumice", 0, 0, {4769.9792408896119, 18787986.105447382,
         3.8308094525913061}, {3.8308094525913061, 0, 235534073381.77505, 297772954531.12463, 0,
         1.0591590294836108, 1, 3}, 0, 1e-12, 1.0005401950750175, 235534073415.78076, 2e-12,
         0.233},
        {"a lane at a knee one rounding below Pe", "water", 1, 0, {1020.2622829006414, 0,
         1.0000478106690347}, {1.0001177474042218, 55238010.345148012, 55238010.345148019,
         1421744191.5278735, 0, 1.000005690435682, 8, 2}, 0, 1e-12, 1.000005690435682,
         55238010.353758322, 2e-12, 0.00558},
        {"steps to and fro across a straight piece", "pumice", 0, 0, {452.29256837976612,
         9876241.8755507432, 57.635082694057473}, {100, 1677545588.0917757, 4005375386.6709433,
         4662103279.7254772, 0, 1.5940417917007776, 1, 3}, 0, 1e-12, 2.0557746732880249,
         3980567970.6351919, 2.09e-12, 0.00234},
        {"a guess above alpha_old, where P falls", "ice", 1, 0, {80.252180671023481,
         13678458.132856064, 6.5243311478259152}, {19.907415507425139, 314718361.676364,
         322084610.44426918, 564306485.51503968, 0, 5.8348038472895842, 1, 4}, 0, 1e-12,
         4.7990131190754642, 329317828.07310024, 2.24e-12, 3.51e-06},
        {"a high power where P falls with alpha", "nylon", 1, 0, {8.1910827732756708,
         2.0518074716457457, 100}, {100, 143662.36326900695, 982597033.16026509,
         982597033.16026509, 0, 32.56657689631507, 10, 3}, 0, 1e-14, 98.176825887198038,
         2495564.5694130958, 1.18e-12, 8.46e-07},
    };
    for (size_t i = 0; i < sizeof states / sizeof states[0]; i++) {
        const hard_state *h = &states[i];
        sphpa_tillotson mat = material(h->material);
        if (h->keep_B) mat.zero_B_expanded = 0;
        sphpa_crush c = hard_curve(h, &mat);
        const double *at = h->rho_u_alpha;
        sphpa_palpha_options opt = {h->tol, 0};
        sphpa_palpha_solution s;
        assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, &c, at[0], at[1], at[2],
                                            &opt, &s), SPHPA_OK);
        check_hard(h, &mat, &c, s.alpha, s.P, s.evaluations);
        sphpa_palpha_stats stats;
        memset(&stats, 0, sizeof stats);
        assert_int_equal(sphpa_palpha_solve_batch(SPHPA_PALPHA_CRUSH_SPACE, &mat, &c, 1, &at[0],
                                                  &at[1], &at[2], &opt, &s.alpha, &s.P, &stats),
                         SPHPA_OK);
        check_hard(h, &mat, &c, s.alpha, s.P, stats.evaluations_max);
    }
}

/* Where the curve touches alpha = 1 with a high power Newton creeps, and a short step is no bound:
   the bracketed solvers are within their tolerance all the same, coarse or fine. */
static void test_touching_curves(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("basalt");
    sphpa_rng rng = sphpa_rng_seed(5, 11);
    const double powers[] = {2.0, 5.0, 8.5, 16.0}, tols[] = {1e-2, 1e-4, 1e-6, 1e-9, 1e-12};
    const int solvers[] = {SPHPA_PALPHA_BISECTION, SPHPA_PALPHA_SAFE_NEWTON,
                           SPHPA_PALPHA_CRUSH_SPACE};
    int inside = 0;
    for (int i = 0; i < 3000; i++) {
        double Ps = pow(10.0, 10.0 * sphpa_rng_uniform(&rng)); /* A tol: where it shows most */
        sphpa_crush c = sphpa_crush_quadratic(3.9, 0.0, Ps);
        c.kind = SPHPA_CRUSH_TWO_EXPONENT;
        c.Pt = c.Ps;
        c.alpha_t = 1.0; /* the first term alone, which touches at Pt */
        c.n1 = powers[i % 4];
        c.n2 = 1.0;
        double alpha_old = 1.0 + 2.9 * sphpa_rng_uniform(&rng), u = 0.0;
        double rho = mat.rho0 * (1.0 + 1.1 * Ps / mat.A * sphpa_rng_uniform(&rng));
        if (i % 2) rho /= 1.0 + 2.9 * sphpa_rng_uniform(&rng); /* anywhere, or P(1) up to Ps */
        ref_state ref = ref_make(&mat, &c, rho, u, alpha_old);
        long double root = ref_solve(&ref);
        inside += root > 1.0L && root < L(alpha_old);
        for (int k = 0; k < 15; k++) {
            sphpa_palpha_options opt = {tols[k % 5], 0};
            sphpa_palpha_solution s;
            assert_int_equal(sphpa_palpha_solve((sphpa_palpha_solver)solvers[k / 5], &mat, &c, rho,
                                                u, alpha_old, &opt, &s), SPHPA_OK);
            assert_near_abs(s.alpha, (double)root, 2.0 * opt.tol + 64.0 * DBL_EPSILON);
        }
    }
    assert_true(inside > 1500);
}

/* next to the least number matter is a gas, whose speed is that at any low density, or the floor */
static void test_thin_matter(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("pumice");
    sphpa_crush c = sphpa_crush_pumice();
    const double rho[] = {1e-60, 1e-200, 1e-279, 1e-281, 1e-300, 1e-310, 1e-322,
                          4.9406564584124654e-324};
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < 4; k++) {
            double u = k == 0 ? 0.0 : pow(10.0, 5.0 + 3.0 * k); /* cold, or well above u_cv */
            double gas = mat.a * (1.0 + mat.a) * u, least = 0.01 * mat.A / mat.rho0;
            sphpa_palpha_solution s;
            assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, &c, rho[i], u, 3.0,
                                                NULL, &s), SPHPA_OK);
            assert_true(s.c <= 1e12); /* infinity would be near to anything */
            assert_near(s.c, sqrt(k == 0 ? least : gas), 1e-12);
        }
}

/* Every number that a solve looks at has to be finite, and it looks at those of its kind alone. */
static void test_spoilt_curves(void **unused) {
    (void)unused;
    enum { FIELDS = 12, QUADRATIC = 3, FLAT = 8 };
    sphpa_tillotson mat = material("pumice");
    const double bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
    for (int kind = 0; kind < 4; kind++)
        for (int field = 0; field < FIELDS; field++)
            for (int b = 0; b < 3; b++) {
                sphpa_crush c = sphpa_crush_quadratic(3.0, 1e6, 2e8);
                if (kind % 2) c = sphpa_crush_pumice();
                if (kind > 1) c = herrmann(c, mat.rho0, sqrt(mat.A / mat.rho0));
                double *all[FIELDS] = {&c.alpha0, &c.Pe, &c.Ps, &c.Pt, &c.alpha_t, &c.n1,
                                       &c.n2, &c.alpha_e, &c.c_e, &c.c_s, &c.K0, &c.alpha_y};
                bool used = field < QUADRATIC || (field >= FLAT ? kind > 1 : kind % 2 == 1);
                *all[field] = bad[b];
                sphpa_palpha_solution s;
                sphpa_result r = sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, &c, 800.0, 1e3,
                                                    2.0, NULL, &s);
                assert_true((r == SPHPA_OK) == !used);
            }
}

/* tolerances down to rounding end, and tighten */
static void test_tolerances(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("pumice");
    sphpa_crush c = sphpa_crush_pumice();
    sphpa_rng rng = sphpa_rng_seed(8, 1);
    for (int i = 0; i < 2000; i++) {
        state s = draw_state(&rng, &mat, c.alpha0);
        ref_state ref = ref_make(&mat, &c, s.rho, s.u, s.alpha_old);
        long double root = ref_solve(&ref);
        const double tols[] = {1e-4, 1e-8, 1e-14, 1e-18};
        for (int k = 0; k < 4; k++) {
            sphpa_palpha_options opt;
            memset(&opt, 0, sizeof opt);
            opt.tol = tols[k];
            for (int v = 0; v < 4; v++) {
                sphpa_palpha_solution out;
                sphpa_result r = sphpa_palpha_solve((sphpa_palpha_solver)v, &mat, &c, s.rho, s.u,
                                                    s.alpha_old, &opt, &out);
                if (v == SPHPA_PALPHA_NEWTON && r == SPHPA_ERROR_NOT_CONVERGED) continue;
                assert_int_equal(r, SPHPA_OK);
                assert_near_abs(out.alpha, (double)root, ref_allowed(&ref, root, tols[k]));
                assert_true(out.evaluations <= 100);
            }
        }
    }
}

/* ---- what Newton does ------------------------------------------------------------------------ */

/* Plain Newton by hand from the public calls: two points for ever. */
static void test_newton_cycles(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("pumice");
    sphpa_crush c = sphpa_crush_quadratic(4.64, 1e6, 2.13e8);
    double rho = 1.01 * mat.rho0 / c.alpha0, alpha[40];
    alpha[0] = c.alpha0;
    for (int k = 0; k < 39; k++) {
        sphpa_eos_point point;
        double slope;
        assert_int_equal(sphpa_tillotson_eval(&mat, alpha[k] * rho, 0.0, &point), SPHPA_OK);
        double P = point.P / alpha[k], on = sphpa_crush_alpha(&c, P, &slope);
        if (on >= c.alpha0) slope = 0.0;
        double F = alpha[k] - on, dF = 1.0 - slope * (rho * point.dP_drho - P) / alpha[k];
        alpha[k + 1] = alpha[k] - F / dF;
    }
    assert_true(alpha[38] == alpha[36] && alpha[39] == alpha[37]); /* to the last bit */
    assert_true(fabs(alpha[38] - alpha[39]) > 1e-3);
    sphpa_palpha_solution newton, safe, exact;
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_NEWTON, &mat, &c, rho, 0.0, c.alpha0, NULL,
                                        &newton), SPHPA_ERROR_NOT_CONVERGED);
    assert_int_equal(newton.iterations, 100);
    assert_int_equal(newton.evaluations, 101); /* both ends, the first of them where it starts */
    double best = fmin(fabs(newton.alpha - alpha[38]), fabs(newton.alpha - alpha[39]));
    assert_true(best <= 1e-12);
    ref_state ref = ref_make(&mat, &c, rho, 0.0, c.alpha0);
    double F36 = (double)ref_F(&ref, L(alpha[38])), F37 = (double)ref_F(&ref, L(alpha[39]));
    assert_near(fabs(newton.residual), fmin(fabs(F36), fabs(F37)), 1e-9); /* the better one */
    assert_true(fabs(newton.residual) > 1e-6);
    sphpa_palpha_options odd = {0.0, 99}; /* stops on the other point; the best is the same */
    double kept = newton.alpha;
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_NEWTON, &mat, &c, rho, 0.0, c.alpha0, &odd,
                                        &newton), SPHPA_ERROR_NOT_CONVERGED);
    assert_true(newton.alpha == kept && newton.iterations == 99);
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_SAFE_NEWTON, &mat, &c, rho, 0.0, c.alpha0,
                                        NULL, &safe), SPHPA_OK);
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, &c, rho, 0.0, c.alpha0,
                                        NULL, &exact), SPHPA_OK);
    assert_near(safe.alpha, exact.alpha, 1e-12);
    assert_int_equal(safe.fell_back, 0);
    sphpa_palpha_options few = {0.0, 3};
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_SAFE_NEWTON, &mat, &c, rho, 0.0, c.alpha0,
                                        &few, &safe), SPHPA_OK);
    assert_int_not_equal(safe.fell_back, 0);
    assert_near(safe.alpha, exact.alpha, 1e-12);
}

/* nylon with B kept in expansion: the largest root, found by 2000 looks in long double */
static void test_several_roots(void **unused) {
    (void)unused;
    sphpa_rng rng = sphpa_rng_seed(77, 3);
#ifdef SPHPA_TEST_SMALL
    const int states = 1500;
#else
    const int states = 10000;
#endif
    int several = 0, missed = 0;
    for (int i = 0; i < states; i++) {
        sphpa_crush c = i % 2 ? sphpa_crush_pumice() : sphpa_crush_quadratic(4.64, 1e6, 2.13e8);
        sphpa_tillotson mat = material(i % 4 < 2 ? "nylon" : "water");
        mat.zero_B_expanded = 0;
        double alpha_old = 1.0 + 3.64 * sphpa_rng_uniform(&rng);
        double near_rho0 = 0.6 + 0.6 * sphpa_rng_uniform(&rng); /* or anywhere: 0.3 to 4 of it */
        if (i % 5 > 2) near_rho0 = 0.3 * exp(log(4.0 / 0.3) * sphpa_rng_uniform(&rng));
        double rho = mat.rho0 / alpha_old * near_rho0;
        double u = i % 3 ? pow(10.0, 4.0 + 3.0 * sphpa_rng_uniform(&rng)) : 0.0;
        ref_state ref = ref_make(&mat, &c, rho, u, alpha_old);
        long double largest = ref_largest(&ref, 2000), any = ref_solve(&ref);
        sphpa_palpha_solution out;
        assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, &c, rho, u, alpha_old,
                                            NULL, &out), SPHPA_OK);
        double allowed = ref_allowed(&ref, largest, 1e-12);
        if (fabsl(largest - any) > 1e-6L || (largest > 1.0L + 1e-6L && ref_F(&ref, 1.0L) == 0.0L))
            several++;
        if (!(fabsl(L(out.alpha) - largest) <= L(allowed))) {
            missed++;
            print_error("rho %.17g u %.17g alpha_old %.17g: %.17g, largest %.17Lg\n", rho, u,
                        alpha_old, out.alpha, largest);
        }
    }
    assert_true(several > states / 15);
    assert_int_equal(missed, 0);
}

/* ice as vapour, where P is not convex: a dip that its tangents hide; two states once found, and any
   near to those */
static void test_hidden_dips(void **unused) {
    (void)unused;
    const double found[2][5] = {/* alpha0, Ps, rho, u, alpha_old; largest roots 1.4002 and 1.48 */
                                {18.164223705091278, 327234274.116, 580.98207179240524,
                                 2994247.1321147452, 4.7675930476916069},
                                {5.0, 5.01e8, 568.8, 3.005e6, 5.0}};
    sphpa_tillotson mat = material("ice");
    sphpa_rng rng = sphpa_rng_seed(63, 2);
    int hidden = 0;
    for (int i = 0; i < 4000; i++) {
        double at[5];
        for (int k = 0; k < 5; k++) /* within 2 %, the first two as they were */
            at[k] = found[i % 2][k] * (i < 2 ? 1.0 : 1.0 + 0.02 * (2.0 * sphpa_rng_uniform(&rng) - 1.0));
        at[4] = fmin(at[4], at[0]);
        sphpa_crush c = sphpa_crush_quadratic(at[0], 0.0, at[1]);
        ref_state ref = ref_make(&mat, &c, at[2], at[3], at[4]);
        long double largest = ref_largest(&ref, 400);
        sphpa_palpha_solution out;
        assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, &c, at[2], at[3], at[4],
                                            NULL, &out), SPHPA_OK);
        /* it is a root, and none that the looks found is larger */
        if (!ref_root_near(&ref, L(out.alpha)) ||
            !(L(out.alpha) >= largest - L(ref_allowed(&ref, largest, 1e-12))))
            fail_msg("rho %.17g u %.17g: %.17g, largest %.17Lg", at[2], at[3], out.alpha, largest);
        hidden += largest > 1.2L;
    }
    print_message("# ice with a dip: %d of 4000 with a root in it\n", hidden);
    assert_true(hidden > 200);
}

/* Where no second root is looked for: of any Tillotson material, from the alpha up that the header
   says, P_m(alpha rho, u)/alpha never falls with alpha, rho dP/drho >= P, up to the given one. */
static void test_one_root(void **unused) {
    (void)unused;
    sphpa_rng rng = sphpa_rng_seed(41, 1);
    int said[4] = {0, 0, 0, 0}, held_back = 0;
    for (int i = 0; i < 60000; i++) {
        sphpa_tillotson mat = material("basalt");
        mat.B = mat.A * (3.0 * sphpa_rng_uniform(&rng) - (i % 4 == 0));
        mat.a = 0.1 + sphpa_rng_uniform(&rng);
        mat.b = pow(10.0, -1.0 + 2.0 * sphpa_rng_uniform(&rng));
        mat.E0 = mat.A / mat.rho0 * pow(10.0, -1.0 + 2.5 * sphpa_rng_uniform(&rng));
        mat.u_iv = mat.E0 * pow(10.0, -2.0 + 2.0 * sphpa_rng_uniform(&rng));
        mat.u_cv = mat.u_iv * (1.2 + 5.0 * sphpa_rng_uniform(&rng));
        mat.alpha = pow(10.0, -0.3 + 1.5 * sphpa_rng_uniform(&rng));
        mat.beta = pow(10.0, -0.3 + 1.5 * sphpa_rng_uniform(&rng));
        mat.zero_B_expanded = i % 2;
        double rho = mat.rho0 * pow(10.0, -1.5 + 1.7 * sphpa_rng_uniform(&rng));
        double u = mat.u_iv * pow(10.0, -1.0 + 3.0 * sphpa_rng_uniform(&rng));
        int kind = rho >= mat.rho0 ? 0 : u <= mat.u_iv ? 1 : u < mat.u_cv ? 2 : 3;
        double top = pow(30.0, i % 3 ? 1.0 : sphpa_rng_uniform(&rng));
        double from = sphpa_palpha_rising_(&mat, rho, u, top);
        assert_true((mat.B < 0.0) == (from > DBL_MAX));
        if (from > 0.0) held_back++;
        if (from > top) continue;
        said[kind]++;
        for (int k = 0; k <= 100; k++) {
            double at = rho * fmax(1.0, from) * pow(top / fmax(1.0, from), 0.01 * k);
            sphpa_eos_point point;
            assert_int_equal(sphpa_tillotson_eval(&mat, at, u, &point), SPHPA_OK);
            if (at * point.dP_drho - point.P >= -1e-12 * (fabs(point.P) + mat.A)) continue;
            fail_msg("material %d, rho %.17g of %g, u %g: falls by %g at %.17g", i, rho, mat.rho0, u,
                     point.P - at * point.dP_drho, at);
        }
    }
    print_message("# one root: compressed %d, cold %d, hybrid %d, vapour %d; not from the start %d\n",
                  said[0], said[1], said[2], said[3], held_back);
    for (int kind = 0; kind < 4; kind++) assert_true(said[kind] > 1000);
}

/* ---- edges and errors ------------------------------------------------------------------------ */

static void test_edges(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("pumice");
    sphpa_crush c = sphpa_crush_pumice(), dense = sphpa_crush_quadratic(1.0, 1e6, 2e8);
    for (int k = 0; k < 4; k++) {
        sphpa_palpha_solver v = (sphpa_palpha_solver)k;
        sphpa_palpha_solution s;
        sphpa_eos_point point;
        assert_int_equal(sphpa_palpha_solve(v, &mat, &dense, 2400.0, 1e5, 1.0, NULL, &s), SPHPA_OK);
        assert_int_equal(sphpa_tillotson_eval(&mat, 2400.0, 1e5, &point), SPHPA_OK);
        assert_true(s.alpha == 1.0 && s.P == point.P && s.residual == 0.0 && s.evaluations == 1);
        assert_near(s.c, point.c, 1e-15);
        assert_int_equal(sphpa_palpha_solve(v, &mat, &c, 9000.0, 0.0, 4.64, NULL, &s), SPHPA_OK);
        assert_near_abs(s.alpha, 1.0, 1e-12); /* wholly compacted */
        assert_int_equal(sphpa_palpha_solve(v, &mat, &c, 9000.0, 0.0, 1.0, NULL, &s), SPHPA_OK);
        assert_true(s.alpha == 1.0);
        assert_int_equal(sphpa_palpha_solve(v, &mat, &c, 400.0, 0.0, 4.64, NULL, &s), SPHPA_OK);
        assert_true(s.alpha == 4.64 && s.P < 0.0 && s.evaluations == 1); /* in tension */
        double up = 4.64 * (1.0 + 3.0 * DBL_EPSILON), low = 1.0 - 3.0 * DBL_EPSILON;
        assert_int_equal(sphpa_palpha_solve(v, &mat, &c, 400.0, 0.0, up, NULL, &s), SPHPA_OK);
        assert_true(s.alpha == 4.64);
        assert_int_equal(sphpa_palpha_solve(v, &mat, &c, 2400.0, 0.0, low, NULL, &s), SPHPA_OK);
        assert_true(s.alpha == 1.0);
    }
}

/* the cut-offs of the material hold behind the curve as well */
static void test_cut_offs(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("nylon");
    sphpa_crush c = sphpa_crush_quadratic(2.0, 1e6, 2e8);
    sphpa_palpha_solution s;
    sphpa_eos_point point;
    mat.tensile_limit = 5e7;
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, &c, 500.0, 0.0, 2.0, NULL,
                                        &s), SPHPA_OK);
    assert_near(s.P, -2.5e7, 1e-15);
    assert_int_equal(sphpa_tillotson_eval(&mat, 1000.0, 0.0, &point), SPHPA_OK);
    assert_near(s.c, point.c, 1e-15);
}

static void expect_error(sphpa_result result, const sphpa_tillotson *mat, const sphpa_crush *c,
                         double rho, double u, double alpha_old, const sphpa_palpha_options *opt) {
    for (int k = 0; k < 4; k++) {
        sphpa_palpha_solution out, before;
        memset(&before, 0x5a, sizeof before);
        out = before;
        assert_int_equal(sphpa_palpha_solve((sphpa_palpha_solver)k, mat, c, rho, u, alpha_old, opt,
                                            &out), result);
        assert_memory_equal(&out, &before, sizeof out);
        if (mat == NULL) continue;
        sphpa_eos eos = sphpa_tillotson_eos(mat);
        assert_int_equal(sphpa_palpha_solve_eos((sphpa_palpha_solver)k, &eos, c, rho, u, alpha_old,
                                                opt, &out), result);
        assert_memory_equal(&out, &before, sizeof out);
    }
}

static void test_errors(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("pumice"), bad = mat;
    sphpa_crush c = sphpa_crush_pumice();
    const double nan = (double)NAN, inf = (double)INFINITY;
    expect_error(SPHPA_ERROR_NEGATIVE, &mat, &c, -1.0, 0.0, 2.0, NULL);
    expect_error(SPHPA_ERROR_NEGATIVE, &mat, &c, 0.0, 0.0, 2.0, NULL);
    expect_error(SPHPA_ERROR_NEGATIVE, &mat, &c, 1000.0, -1.0, 2.0, NULL);
    expect_error(SPHPA_ERROR_NOT_FINITE, &mat, &c, nan, 0.0, 2.0, NULL);
    expect_error(SPHPA_ERROR_NOT_FINITE, &mat, &c, inf, 0.0, 2.0, NULL);
    expect_error(SPHPA_ERROR_NOT_FINITE, &mat, &c, 1000.0, nan, 2.0, NULL);
    expect_error(SPHPA_ERROR_NOT_FINITE, &mat, &c, 1000.0, inf, 2.0, NULL);
    expect_error(SPHPA_ERROR_NOT_FINITE, &mat, &c, 1000.0, 0.0, nan, NULL);
    expect_error(SPHPA_ERROR_ALPHA, &mat, &c, 1000.0, 0.0, 4.64 * (1.0 + 1e-14), NULL);
    expect_error(SPHPA_ERROR_ALPHA, &mat, &c, 1000.0, 0.0, 1.0 - 1e-14, NULL);
    expect_error(SPHPA_ERROR_MISSING, NULL, &c, 1000.0, 0.0, 2.0, NULL);
    expect_error(SPHPA_ERROR_MISSING, &mat, NULL, 1000.0, 0.0, 2.0, NULL);
    bad.A = -1.0;
    expect_error(SPHPA_ERROR_MATERIAL, &bad, &c, 1000.0, 0.0, 2.0, NULL);
    sphpa_palpha_options opt = {-1e-12, 0};
    expect_error(SPHPA_ERROR_RANGE, &mat, &c, 1000.0, 0.0, 2.0, &opt);
    opt.tol = nan;
    expect_error(SPHPA_ERROR_NOT_FINITE, &mat, &c, 1000.0, 0.0, 2.0, &opt);
    opt.tol = 0.0;
    opt.max_iterations = -1;
    expect_error(SPHPA_ERROR_RANGE, &mat, &c, 1000.0, 0.0, 2.0, &opt);
    sphpa_palpha_solution out;
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_SOLVER_COUNT, &mat, &c, 1000.0, 0.0, 2.0, NULL,
                                        &out), SPHPA_ERROR_RANGE);
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, &c, 1000.0, 0.0, 2.0, NULL,
                                        NULL), SPHPA_ERROR_MISSING);
    assert_string_equal(sphpa_palpha_solver_name(SPHPA_PALPHA_CRUSH_SPACE), "crush-space");
    assert_null(sphpa_palpha_solver_name(SPHPA_PALPHA_SOLVER_COUNT));
}

/* ---- any equation of state, and batches ------------------------------------------------------ */

static sphpa_result eval_fails(const void *mat, double rho, double u, sphpa_eos_point *out) {
    (void)mat, (void)rho, (void)u, (void)out;
    return SPHPA_ERROR_UNKNOWN;
}

static void test_any_eos(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("nylon");
    sphpa_crush c = sphpa_crush_pumice();
    sphpa_eos eos = sphpa_tillotson_eos(&mat);
    sphpa_rng rng = sphpa_rng_seed(3, 3);
    for (int i = 0; i < 2000; i++) {
        state s = draw_state(&rng, &mat, c.alpha0);
        sphpa_palpha_solver v = (sphpa_palpha_solver)(i % 4);
        sphpa_palpha_solution a, b;
        sphpa_result ra = sphpa_palpha_solve(v, &mat, &c, s.rho, s.u, s.alpha_old, NULL, &a);
        sphpa_result rb = sphpa_palpha_solve_eos(v, &eos, &c, s.rho, s.u, s.alpha_old, NULL, &b);
        assert_int_equal(ra, rb);
        assert_true(a.alpha == b.alpha && a.P == b.P && a.evaluations == b.evaluations);
        assert_near(a.c, b.c, 1e-14);
    }
    sphpa_murnaghan linear = {2700.0, 2e10, 1.0, 0.0}; /* P = K (rho/rho0 - 1): a quadratic */
    sphpa_crush q = sphpa_crush_quadratic(3.0, 1e7, 3e8);
    eos = sphpa_murnaghan_eos(&linear);
    for (int i = 1; i < 100; i++) {
        double t = i / 100.0, alpha = 1.0 + 2.0 * t * t, P = 3e8 - 2.9e8 * t;
        double rho = 2700.0 * (1.0 + alpha * P / 2e10) / alpha;
        sphpa_palpha_solution s;
        assert_int_equal(sphpa_palpha_solve_eos(SPHPA_PALPHA_CRUSH_SPACE, &eos, &q, rho, 0.0, 3.0,
                                                NULL, &s), SPHPA_OK);
        assert_near(s.alpha, alpha, 1e-12);
        assert_near(s.P, P, 1e-11);
    }
    sphpa_ideal gas = {1.4}; /* P does not depend on alpha at all */
    eos = sphpa_ideal_eos(&gas);
    sphpa_palpha_solution s;
    assert_int_equal(sphpa_palpha_solve_eos(SPHPA_PALPHA_CRUSH_SPACE, &eos, &q, 1.0, 1e8 / 0.4, 3.0,
                                            NULL, &s), SPHPA_OK);
    assert_near(s.alpha, sphpa_crush_alpha(&q, 1e8, NULL), 1e-12);
    eos.eval = eval_fails;
    assert_int_equal(sphpa_palpha_solve_eos(SPHPA_PALPHA_CRUSH_SPACE, &eos, &q, 1.0, 1.0, 3.0, NULL,
                                            &s), SPHPA_ERROR_UNKNOWN);
    eos.eval = NULL;
    assert_int_equal(sphpa_palpha_solve_eos(SPHPA_PALPHA_CRUSH_SPACE, &eos, &q, 1.0, 1.0, 3.0, NULL,
                                            &s), SPHPA_ERROR_MISSING);
}

/* A state's answer does not depend on what is beside it, on its place, or on the number of threads:
   to the last bit, lanes and leftovers alike; and it is right wherever the scalar solver is. */
static void check_lanes(const sphpa_tillotson *mat, const sphpa_crush *curve, uint64_t seed) {
    enum { MANY = 6000 };
    static double rho[MANY], u[MANY], alpha_old[MANY], alpha[MANY], P[MANY], c[MANY];
    sphpa_rng rng = sphpa_rng_seed(seed, 8);
    for (int i = 0; i < MANY; i++) {
        state s = draw_state(&rng, mat, curve->alpha0);
        rho[i] = s.rho;
        u[i] = s.u;
        alpha_old[i] = s.alpha_old;
    }
    sphpa_palpha_stats stats;
    memset(&stats, 0, sizeof stats);
    stats.c = c;
    const sphpa_palpha_solver fast = SPHPA_PALPHA_CRUSH_SPACE;
    assert_int_equal(sphpa_palpha_solve_batch(fast, mat, curve, MANY, rho, u, alpha_old, NULL, alpha,
                                              P, &stats), SPHPA_OK);
    int crushed = 0;
    for (int i = 0; i < MANY; i++) {
        double alone[3];
        sphpa_palpha_solution s;
        memset(&stats, 0, sizeof stats);
        stats.c = &alone[2];
        assert_int_equal(sphpa_palpha_solve_batch(fast, mat, curve, 1, &rho[i], &u[i], &alpha_old[i],
                                                  NULL, &alone[0], &alone[1], &stats), SPHPA_OK);
        assert_true(alone[0] == alpha[i] && alone[1] == P[i] && alone[2] == c[i]);
        assert_int_equal(sphpa_palpha_solve(fast, mat, curve, rho[i], u[i], alpha_old[i], NULL, &s),
                         SPHPA_OK);
        ref_state ref = ref_make(mat, curve, rho[i], u[i], alpha_old[i]);
        if (fabs(s.alpha - alpha[i]) > 1e-12) assert_true(ref_root_near(&ref, L(alpha[i])));
        if (!(s.alpha < alpha_old[i])) assert_true(alpha[i] == alpha_old[i]); /* every bit of it */
        assert_near_abs(P[i], s.P, 1e-14 * fabs(s.P) + 2e-12 * (mat->A + 4.0 * rho[i] * u[i]));
        crushed += s.alpha < alpha_old[i] && s.alpha > 1.0;
    }
    assert_true(crushed > MANY / 20);
}

static void test_lanes(void **unused) {
    (void)unused;
    sphpa_crush quadratic = sphpa_crush_quadratic(3.3, 1e6, 2.13e8), pumice = sphpa_crush_pumice();
    sphpa_crush single = sphpa_crush_pumice(), straight = sphpa_crush_pumice();
    single.alpha_t = single.alpha_e; /* the second term alone, with its exponent 3 */
    single.Pt = single.Pe;
    straight.n1 = 1.0; /* a kink at Pt */
    const char *const names[] = {"pumice", "ice", "aluminium", "water"};
    for (int k = 0; k < 4; k++) {
        sphpa_tillotson mat = material(names[k]);
        if (k == 3) mat.zero_B_expanded = 0; /* mostly left to the scalar solver */
        check_lanes(&mat, &quadratic, 100 + (uint64_t)k);
        check_lanes(&mat, &pumice, 200 + (uint64_t)k);
        check_lanes(&mat, &single, 300 + (uint64_t)k);
        check_lanes(&mat, &straight, 400 + (uint64_t)k);
    }
}

enum { BATCH = 997 };

/* alpha on top of alpha_old, and no statistics; -7 marks states that fail */
static void check_in_place(sphpa_palpha_solver v, const sphpa_tillotson *mat,
                           const sphpa_crush *curve, const double *rho, const double *u,
                           const double *alpha_old, const double *alpha, double *P) {
    static double same[BATCH];
    memcpy(same, alpha_old, sizeof same);
    assert_int_equal(sphpa_palpha_solve_batch(v, mat, curve, BATCH, rho, u, same, NULL, same, P,
                                              NULL), SPHPA_ERROR_NOT_FINITE);
    for (int i = 0; i < BATCH; i++) {
        double want = alpha[i] == -7.0 ? alpha_old[i] : alpha[i];
        assert_memory_equal(&same[i], &want, sizeof want);
    }
}

static void test_batch(void **unused) {
    (void)unused;
    static double rho[BATCH], u[BATCH], alpha_old[BATCH], alpha[BATCH], P[BATCH], c[BATCH];
    static double residual[BATCH];
    static unsigned char status[BATCH];
    sphpa_tillotson mat = material("ice");
    sphpa_crush curve = sphpa_crush_pumice();
    sphpa_rng rng = sphpa_rng_seed(31, 4);
    for (int i = 0; i < BATCH; i++) {
        state s = draw_state(&rng, &mat, curve.alpha0);
        rho[i] = s.rho;
        u[i] = s.u;
        alpha_old[i] = s.alpha_old;
    }
    rho[17] = -1.0;
    u[400] = (double)NAN;
    alpha_old[401] = 5.0;
    for (int v = 0; v < 4; v++) {
        sphpa_palpha_stats stats;
        memset(&stats, 0, sizeof stats);
        stats.c = c;
        stats.residual = residual;
        stats.status = status;
        for (int i = 0; i < BATCH; i++) alpha[i] = P[i] = c[i] = residual[i] = -7.0;
        sphpa_result worst = sphpa_palpha_solve_batch((sphpa_palpha_solver)v, &mat, &curve, BATCH,
                                                      rho, u, alpha_old, NULL, alpha, P, &stats);
        assert_int_equal(worst, SPHPA_ERROR_NOT_FINITE);
        size_t evaluations = 0, failed = 0, first = BATCH;
        int most = 0;
        for (int i = 0; i < BATCH; i++) {
            sphpa_palpha_solution s;
            sphpa_result r = sphpa_palpha_solve((sphpa_palpha_solver)v, &mat, &curve, rho[i], u[i],
                                                alpha_old[i], NULL, &s);
            assert_int_equal(status[i], r);
            if (r != SPHPA_OK && failed++ == 0) first = (size_t)i;
            if (r != SPHPA_OK && r != SPHPA_ERROR_NOT_CONVERGED) {
                assert_true(alpha[i] == -7.0 && P[i] == -7.0 && c[i] == -7.0);
                continue;
            }
            evaluations += (size_t)s.evaluations;
            if (s.evaluations > most) most = s.evaluations;
            if (v == SPHPA_PALPHA_CRUSH_SPACE) { /* by lanes: to the tolerance */
                assert_near_abs(alpha[i], s.alpha, 2e-12);
                assert_near_abs(P[i], s.P, 1e-10 * fabs(s.P) + 2e-12 * mat.A);
                assert_near(c[i], s.c, 1e-7);
                assert_near_abs(residual[i], 0.0, fmax(2.0 * fabs(s.residual), 1e-11));
                continue;
            }
            assert_memory_equal(&alpha[i], &s.alpha, sizeof s.alpha);
            assert_memory_equal(&P[i], &s.P, sizeof s.P);
            assert_memory_equal(&c[i], &s.c, sizeof s.c);
            assert_memory_equal(&residual[i], &s.residual, sizeof s.residual);
        }
        assert_true(stats.failed == failed && stats.first_failed == first);
        assert_true(v == SPHPA_PALPHA_NEWTON ? failed > 3 : failed == 3);
        if (v == SPHPA_PALPHA_CRUSH_SPACE) {
            assert_true(stats.evaluations <= evaluations + evaluations / 5);
            assert_true(stats.evaluations_max >= 2 && stats.evaluations_max <= 40);
        } else {
            assert_true(stats.evaluations == evaluations && stats.evaluations_max == most);
        }
        check_in_place((sphpa_palpha_solver)v, &mat, &curve, rho, u, alpha_old, alpha, P);
    }
    assert_int_equal(sphpa_palpha_solve_batch(SPHPA_PALPHA_CRUSH_SPACE, &mat, &curve, 0, NULL, NULL,
                                              NULL, NULL, NULL, NULL, NULL), SPHPA_OK);
    assert_int_equal(sphpa_palpha_solve_batch(SPHPA_PALPHA_CRUSH_SPACE, &mat, &curve, 1, rho, NULL,
                                              alpha_old, NULL, alpha, P, NULL),
                     SPHPA_ERROR_MISSING);
}

/* c of the matrix has the floor that the material asks for, of A/rho0; without heat, at eta < 1,
   c^2 is (A + 2 B mu)/rho0 + (a + b) P/rho, P = A mu + B mu^2 */
static void test_sound_floor(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("aluminium");
    sphpa_crush curve = sphpa_crush_porous_aluminium();
    const double mu = -0.1, floors[3] = {0.0, 0.3, 0.95};
    mat.zero_B_expanded = 0;
    double share = 1.0 + 2.0 * mat.B / mat.A * mu +
                   (mat.a + mat.b) * (mu + mat.B / mat.A * mu * mu) / (1.0 + mu);
    double rho = (1.0 + mu) * mat.rho0 / curve.alpha0;
    assert_true(share > 0.3 && share < 0.95);
    for (int v = 0; v < (int)SPHPA_PALPHA_SOLVER_COUNT; v++)
        for (int k = 0; k < 3; k++) {
            sphpa_palpha_solution s;
            mat.c2_floor = floors[k];
            assert_int_equal(sphpa_palpha_solve((sphpa_palpha_solver)v, &mat, &curve, rho, 0.0,
                                                curve.alpha0, NULL, &s), SPHPA_OK);
            assert_near(s.alpha, curve.alpha0, 1e-15);
            assert_near(s.c, sqrt(fmax(share, floors[k]) * mat.A / mat.rho0), 1e-12);
        }
}

/* ---- along the loading path ------------------------------------------------------------------ */

/* the implicit state after an adiabatic compression from rest to rho, in small exact steps: u from
   du = P/rho^2 drho by Runge and Kutta over the solver */
static double path_dudrho(const sphpa_tillotson *mat, const sphpa_crush *c, double rho, double u,
                          sphpa_palpha_solution *s) {
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, mat, c, rho, u, c->alpha0, NULL,
                                        s), SPHPA_OK);
    return s->P / (rho * rho);
}

static double path_u(const sphpa_tillotson *mat, const sphpa_crush *c, double rho0, double u,
                     double rho1, int n) {
    sphpa_palpha_solution s;
    double h = (rho1 - rho0) / n;
    for (int i = 0; i < n; i++) {
        double rho = rho0 + i * h;
        double k1 = path_dudrho(mat, c, rho, u, &s);
        double k2 = path_dudrho(mat, c, rho + 0.5 * h, u + 0.5 * h * k1, &s);
        double k3 = path_dudrho(mat, c, rho + 0.5 * h, u + 0.5 * h * k2, &s);
        double k4 = path_dudrho(mat, c, rho + h, u + h * k3, &s);
        u += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
    return u;
}

/* eq. 6 and dalpha/drho are derivatives along that path */
static void test_loading_derivatives(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("pumice");
    sphpa_crush curves[2];
    curves[0] = sphpa_crush_pumice();
    curves[1] = sphpa_crush_quadratic(4.64, 1e6, 2.13e8);
    for (int i = 0; i < 2; i++) {
        const sphpa_crush *c = &curves[i];
        for (int k = 1; k <= 8; k++) {
            double rho = 520.0 + 180.0 * k, d = 0.01, cl, slope;
            double u = path_u(&mat, c, 510.0, 0.0, rho - d, 40);
            double u0 = path_u(&mat, c, rho - d, u, rho, 4);
            double u1 = path_u(&mat, c, rho, u0, rho + d, 4);
            sphpa_palpha_solution a, b, e;
            (void)path_dudrho(&mat, c, rho - d, u, &a);
            (void)path_dudrho(&mat, c, rho, u0, &e);
            (void)path_dudrho(&mat, c, rho + d, u1, &b);
            assert_true(e.alpha > 1.0 && e.alpha < 4.64);
            assert_int_equal(sphpa_palpha_loading_c(&mat, c, rho, u0, e.alpha, &cl), SPHPA_OK);
            assert_near(cl * cl, (b.P - a.P) / (2.0 * d), 2e-6);
            assert_int_equal(sphpa_palpha_dalpha_drho(&mat, c, rho, u0, e.alpha, &slope), SPHPA_OK);
            assert_near(slope, (b.alpha - a.alpha) / (2.0 * d), 2e-6);
            double share = sphpa_palpha_strain_share(rho - d, a.alpha, rho + d, b.alpha);
            assert_near_abs(share, fmax(0.0, 1.0 + slope * rho / e.alpha), 1e-6);
            assert_true(cl < e.c); /* a crushing wave is slower than an elastic one */
        }
    }
    double zero = -1.0;
    assert_int_equal(sphpa_palpha_dalpha_drho(&mat, &curves[0], 600.0, 0.0, 2.0, &zero), SPHPA_OK);
    assert_true(zero == 0.0); /* far below the curve */
    assert_true(sphpa_palpha_strain_share(1000.0, 2.0, 1000.0, 2.0) == 1.0);
    assert_true(sphpa_palpha_strain_share(1000.0, 1.0, 1100.0, 1.0) == 1.0);
    assert_true(sphpa_palpha_strain_share(1000.0, 2.0, 900.0, 2.0) == 1.0);
    assert_true(sphpa_palpha_strain_share(1000.0, 2.0, 900.0, 2.1) == 1.0); /* springs open */
    assert_near_abs(sphpa_palpha_strain_share(1000.0, 2.0, 1250.0, 1.6), 0.0, 1e-12);
}

/* eq. 7 with Euler steps comes to the implicit solve at first order, with n and 2n steps */
static double evolution_error(const sphpa_tillotson *mat, const sphpa_crush *c, int n) {
    double alpha0 = c->alpha0, rho0 = 1.002 * mat->rho0 / alpha0, rho1 = 1.9 * rho0;
    sphpa_palpha_solution s;
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, mat, c, rho0, 0.0, alpha0, NULL,
                                        &s), SPHPA_OK);
    double alpha = s.alpha, heat = 2e5 / (rho1 - rho0), h = (rho1 - rho0) / n;
    for (int i = 0; i < n; i++) {
        double rate;
        assert_int_equal(sphpa_palpha_rate(mat, c, rho0 + i * h, heat * i * h, alpha, 1.0, heat,
                                           &rate), SPHPA_OK);
        assert_true(rate <= 0.0);
        alpha += h * rate;
    }
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, mat, c, rho1, 2e5, alpha0, NULL,
                                        &s), SPHPA_OK);
    return alpha - s.alpha;
}

static void test_evolution(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("pumice");
    sphpa_crush c = sphpa_crush_quadratic(3.0, 1e6, 2.13e8);
    double e1 = evolution_error(&mat, &c, 2000), e2 = evolution_error(&mat, &c, 4000);
    double e3 = evolution_error(&mat, &c, 8000);
    assert_true(fabs(e1) < 0.05 && fabs(e3) > 1e-7);
    assert_near_abs(log2(fabs(e1 / e2)), 1.0, 0.15);
    assert_near_abs(log2(fabs(e2 / e3)), 1.0, 0.1);
    double rate = 1.0;
    assert_int_equal(sphpa_palpha_rate(&mat, &c, 900.0, 0.0, 2.0, -1.0, 0.0, &rate), SPHPA_OK);
    assert_true(rate == 0.0); /* below the curve */
    sphpa_palpha_solution s;
    assert_int_equal(sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, &mat, &c, 1200.0, 0.0, 3.0, NULL,
                                        &s), SPHPA_OK);
    assert_int_equal(sphpa_palpha_rate(&mat, &c, 1200.0, 0.0, s.alpha, 1.0, 0.0, &rate), SPHPA_OK);
    assert_true(s.alpha < 3.0 && rate < 0.0);
    assert_int_equal(sphpa_palpha_rate(&mat, &c, 1200.0, 0.0, s.alpha, -1.0, 0.0, &rate), SPHPA_OK);
    assert_true(rate == 0.0); /* on the curve, unloading */
}

/* ---- the piston ------------------------------------------------------------------------------ */

/* Rankine-Hugoniot over one wave of speed U between two states. A pressure of the cold matrix is
   known to some eps A whatever its size, and so is all that follows from it. */
static void check_jump(double U, double rho1, double v1, double P1, double u1, double rho2,
                       double v2, double P2, double u2) {
    double flux = rho1 * (U - v1), P_noise = 4.0 * DBL_EPSILON * 7.52e10;
    assert_near(flux, rho2 * (U - v2), 1e-11);
    assert_near_abs(P2 - P1, flux * (v2 - v1), 1e-11 * P2 + P_noise);
    assert_near_abs(u2 - u1, 0.5 * (P1 + P2) * (1.0 / rho1 - 1.0 / rho2),
                    1e-11 * u2 + P_noise * (1.0 / rho1 - 1.0 / rho2));
}

static void check_shock(const sphpa_tillotson *mat, const sphpa_crush *c, double piston,
                        sphpa_palpha_shock *s) {
    double rho = mat->rho0 / c->alpha0;
    assert_int_equal(sphpa_palpha_hugoniot(mat, c, piston, s), SPHPA_OK);
    assert_near(s->v, piston, 1e-15);
    if (s->precursor_speed > 0.0)
        check_jump(s->precursor_speed, rho, 0.0, 0.0, 0.0, s->precursor_rho, s->precursor_v,
                   s->precursor_P, s->precursor_u);
    if (s->speed > 0.0 && s->waves == 2)
        check_jump(s->speed, s->precursor_rho, s->precursor_v, s->precursor_P, s->precursor_u,
                   s->rho, s->v, s->P, s->u);
    if (s->speed > 0.0 && s->waves == 1)
        check_jump(s->speed, rho, 0.0, 0.0, 0.0, s->rho, s->v, s->P, s->u);
    assert_true(s->waves == 1 || s->speed < s->precursor_speed);
    ref_state ref = ref_make(mat, c, s->rho, s->u, c->alpha0);
    long double alpha = ref_solve(&ref);
    assert_near(s->alpha, (double)alpha, 1e-11);
    assert_near(s->P, (double)ref_P(&ref, alpha), 1e-8);
}

static void test_hugoniot(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("aluminium");
    sphpa_crush flat = sphpa_crush_porous_aluminium();
    sphpa_crush curved = herrmann(flat, 2700.0, 5350.0);
    const double speeds[] = {0.01,  1.0,   5.0,   7.2,    9.3,    20.0,
                             100.0, 300.0, 458.0, 1500.0, 3000.0, 2e4};
    sphpa_palpha_shock s;
    for (int i = 0; i < 12; i++) {
        check_shock(&mat, &flat, speeds[i], &s);
        assert_int_equal(s.waves, speeds[i] < 7.14412 || speeds[i] >= 3000.0 ? 1 : 2);
        assert_true((s.speed > 0.0) == (speeds[i] > 7.14413));
        assert_true((s.precursor_speed > 0.0) == (speeds[i] < 3000.0));
        check_shock(&mat, &curved, speeds[i], &s);
        assert_true((s.speed > 0.0) == (speeds[i] > 9.25));
    }
    check_shock(&mat, &flat, 458.0, &s); /* published figures of this very case */
    assert_near(s.precursor_speed, 5287.95, 1e-6);
    assert_near(s.precursor_v, 7.14412, 1e-6);
    assert_near(s.speed, 1983.542, 3e-7);
    assert_near(s.P, 1.969526e9, 3e-7);
    assert_near(s.rho, 2747.204, 3e-7);
    assert_near(s.u, 110267.3, 5e-7);
    assert_true(s.alpha == 1.0);
    check_shock(&mat, &curved, 458.0, &s);
    assert_near(s.speed, 1982.9, 1e-5);
    assert_near(s.P, 1.960e9, 2e-4);
    assert_near(s.rho, 2747.06, 2e-6);
    assert_near(s.u, 1.0932e5, 2e-4);
    assert_true(s.alpha == 1.0);
    /* with c_s the Tillotson one the foot of the elastic branch moves at c_e by construction */
    sphpa_crush own = herrmann(flat, mat.rho0, sqrt(mat.A / mat.rho0));
    check_shock(&mat, &own, 1e-3, &s);
    assert_near(s.precursor_speed, 4110.0, 1e-5);
    sphpa_crush instant = flat;
    instant.Pe = 0.0; /* no elastic branch: no precursor */
    check_shock(&mat, &instant, 458.0, &s);
    assert_true(s.waves == 1 && s.precursor_speed == 0.0);
    sphpa_palpha_shock before = s;
    assert_int_equal(sphpa_palpha_hugoniot(&mat, &flat, -1.0, &s), SPHPA_ERROR_NEGATIVE);
    assert_int_equal(sphpa_palpha_hugoniot(&mat, &flat, (double)NAN, &s), SPHPA_ERROR_NOT_FINITE);
    assert_int_equal(sphpa_palpha_hugoniot(NULL, &flat, 1.0, &s), SPHPA_ERROR_MISSING);
    assert_memory_equal(&s, &before, sizeof s);
}

/* The piston speed at which one shock into the material at rest runs at exactly the precursor's
   speed U: then both waves and the one lie on the same line P = rho U v. Slower, it is overtaken. */
static double swallowing_piston(const sphpa_tillotson *mat, const sphpa_crush *c, double U) {
    double rho = mat->rho0 / c->alpha0, low = 500.0, high = 3000.0;
    for (int k = 0; k < 60; k++) {
        double v = 0.5 * (low + high);
        ref_state ref = ref_make(mat, c, rho * U / (U - v), 0.5 * v * v, c->alpha0);
        if ((double)ref_P(&ref, ref_solve(&ref)) < rho * U * v) low = v;
        else high = v;
    }
    return 0.5 * (low + high);
}

/* The main shock is behind the precursor in the laboratory; through what the precursor has set in
   motion it runs at less than that speed, by the motion's 7 m/s. */
static void test_swallowed_precursor(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("aluminium");
    sphpa_crush flat = sphpa_crush_porous_aluminium();
    sphpa_palpha_shock below, above;
    check_shock(&mat, &flat, 1000.0, &below);
    double U = below.precursor_speed, v = swallowing_piston(&mat, &flat, U);
    assert_true(v > 1500.0 && v < 1700.0);
    check_shock(&mat, &flat, v * (1.0 - 1e-7), &below);
    check_shock(&mat, &flat, v * (1.0 + 1e-7), &above);
    assert_int_equal(below.waves, 2);
    assert_int_equal(above.waves, 1);
    assert_true(above.precursor_speed == 0.0 && above.speed > U && below.speed < U);
    assert_near(below.speed, U, 1e-6); /* and nothing jumps where one becomes the other */
    assert_near(above.speed, U, 1e-6);
    assert_near(below.P, above.P, 1e-6);
    assert_near(below.u, above.u, 1e-6);
}

/* pumice at 100 m/s: the quadratic curve with the same Pe and Ps gives about 2.7 times the pressure
   (2.62 behind the precursor, 2.75 for one wave into the material at rest) */
static void test_hugoniot_pumice(void **unused) {
    (void)unused;
    sphpa_tillotson mat = material("pumice");
    sphpa_crush fit = sphpa_crush_pumice(), quadratic = sphpa_crush_quadratic(4.64, 1e6, 2.13e8);
    sphpa_palpha_shock a, b;
    check_shock(&mat, &fit, 100.0, &a);
    check_shock(&mat, &quadratic, 100.0, &b);
    assert_true(b.P / a.P > 2.6 && b.P / a.P < 2.8);
    check_shock(&mat, &fit, 2000.0, &a); /* hot: expanded though at GPa */
    assert_near(a.rho / mat.rho0, 0.785, 0.005);
    assert_near(a.P, 2.8e9, 0.02);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_curve_values),
        cmocka_unit_test(test_curve_slopes),
        cmocka_unit_test(test_curve_errors),
        cmocka_unit_test(test_herrmann_lines),
        cmocka_unit_test(test_herrmann_cycle),
        cmocka_unit_test(test_solvers_pumice),
        cmocka_unit_test(test_solvers_aluminium),
        cmocka_unit_test(test_solvers_nylon),
        cmocka_unit_test(test_solvers_ice),
        cmocka_unit_test(test_solvers_herrmann),
        cmocka_unit_test(test_solvers_other_curves),
        cmocka_unit_test(test_solvers_odd_curves),
        cmocka_unit_test(test_wrong_slopes),
        cmocka_unit_test(test_hard_states),
        cmocka_unit_test(test_touching_curves),
        cmocka_unit_test(test_thin_matter),
        cmocka_unit_test(test_spoilt_curves),
        cmocka_unit_test(test_tolerances),
        cmocka_unit_test(test_newton_cycles),
        cmocka_unit_test(test_several_roots),
        cmocka_unit_test(test_hidden_dips),
        cmocka_unit_test(test_one_root),
        cmocka_unit_test(test_edges),
        cmocka_unit_test(test_cut_offs),
        cmocka_unit_test(test_errors),
        cmocka_unit_test(test_any_eos),
        cmocka_unit_test(test_batch),
        cmocka_unit_test(test_lanes),
        cmocka_unit_test(test_sound_floor),
        cmocka_unit_test(test_loading_derivatives),
        cmocka_unit_test(test_evolution),
        cmocka_unit_test(test_hugoniot),
        cmocka_unit_test(test_swallowed_precursor),
        cmocka_unit_test(test_hugoniot_pumice),
    };
    return cmocka_run_group_tests_name("porosity", tests, NULL, NULL);
}
