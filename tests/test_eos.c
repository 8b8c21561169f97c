/* test_eos: equations of state against textbook forms in long double, high-order differences,
   isentropes, borders, guards; the material table and the material file. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#define SPHPA_EOS_IMPLEMENTATION
#include "sphpa.h"

#include <locale.h>

#include "near.h"

typedef long double wide;

/* ---- Tillotson as the textbooks print it, in long double ------------------------------------- */

enum { COLD, VAPOUR, HYBRID };

/* P of one branch, and the sum of its terms' magnitudes (what rounding is relative to) */
static wide book_branch(const sphpa_tillotson *m, int branch, wide rho, wide u, wide *size) {
    wide rho0 = (wide)m->rho0, A = (wide)m->A, a = (wide)m->a, b = (wide)m->b;
    wide eta = rho / rho0, mu = eta - 1.0L, z = 1.0L / eta - 1.0L;
    wide w = 1.0L + u / ((wide)m->E0 * eta * eta);
    wide gas = a * rho * u, hot = b * rho * u / w;
    if (branch == COLD) {
        wide B = m->zero_B_expanded != 0 && eta < 1.0L ? 0.0L : (wide)m->B;
        *size = gas + hot + fabsl(A * mu) + fabsl(B * mu * mu);
        return gas + hot + A * mu + B * mu * mu;
    }
    wide Ea = expl(-(wide)m->alpha * z * z), cold = A * mu * expl(-(wide)m->beta * z);
    *size = gas + (hot + fabsl(cold)) * Ea;
    return gas + (hot + cold) * Ea;
}

static wide book_P(const sphpa_tillotson *m, int branch, wide rho, wide u, wide *size) {
    if (branch != HYBRID) return book_branch(m, branch, rho, u, size);
    wide iv = (wide)m->u_iv, cv = (wide)m->u_cv, size_e, size_c;
    wide Pe = book_branch(m, VAPOUR, rho, u, &size_e), Pc = book_branch(m, COLD, rho, u, &size_c);
    *size = size_e + size_c;
    return ((u - iv) * Pe + (cv - u) * Pc) / (cv - iv);
}

/* central difference of eighth order; h in the variable that is moved */
static wide book_slope(const sphpa_tillotson *m, int branch, wide rho, wide u, wide h_rho,
                       wide h_u) {
    static const int weight[4] = {672, -168, 32, -3};
    wide sum = 0.0L, size;
    for (int k = 1; k <= 4; k++) {
        wide up = book_P(m, branch, rho + (wide)k * h_rho, u + (wide)k * h_u, &size);
        wide down = book_P(m, branch, rho - (wide)k * h_rho, u - (wide)k * h_u, &size);
        sum += (wide)weight[k - 1] * (up - down);
    }
    return sum / (840.0L * (h_rho + h_u));
}

/* dP/drho along an isentrope (du = P/rho^2 drho, Runge-Kutta 4), fourth-order difference */
static wide book_isentrope(const sphpa_tillotson *m, int branch, wide rho, wide u, wide h) {
    wide P[4], size;
    static const int offset[4] = {-2, -1, 1, 2};
    for (int k = 0; k < 4; k++) {
        wide d = h * (wide)offset[k], r1 = rho + 0.5L * d, r2 = rho + d;
        wide k1 = book_P(m, branch, rho, u, &size) / (rho * rho);
        wide k2 = book_P(m, branch, r1, u + 0.5L * d * k1, &size) / (r1 * r1);
        wide k3 = book_P(m, branch, r1, u + 0.5L * d * k2, &size) / (r1 * r1);
        wide k4 = book_P(m, branch, r2, u + d * k3, &size) / (r2 * r2);
        P[k] = book_P(m, branch, r2, u + d * (k1 + 2.0L * k2 + 2.0L * k3 + k4) / 6.0L, &size);
    }
    return (P[0] - 8.0L * P[1] + 8.0L * P[2] - P[3]) / (12.0L * h);
}

static double log_between(sphpa_rng *rng, double low, double high) {
    return exp(log(low) + (log(high) - log(low)) * sphpa_rng_uniform(rng));
}

static double between(sphpa_rng *rng, double low, double high) {
    return low + (high - low) * sphpa_rng_uniform(rng);
}

/* a random state well inside one regime */
static int draw_state(const sphpa_tillotson *m, sphpa_rng *rng, double *rho, double *u) {
    int kind = (int)sphpa_rng_below(rng, 4);
    double expanded = between(rng, 0.15, 0.999);
    *rho = m->rho0 * expanded;
    if (kind == 0) { /* compressed, from cold to hotter than u_cv */
        *rho = m->rho0 * between(rng, 1.001, 3.0);
        *u = between(rng, 0.0, 2.0 * m->u_cv);
        return COLD;
    }
    if (kind == 1) {
        *u = between(rng, 0.0, 0.999 * m->u_iv);
        return COLD;
    }
    if (kind == 2) {
        *u = m->u_cv * log_between(rng, 1.001, 100.0);
        return VAPOUR;
    }
    *u = m->u_iv + (m->u_cv - m->u_iv) * between(rng, 0.001, 0.999);
    return HYBRID;
}

static sphpa_eos_point eval(const sphpa_tillotson *m, double rho, double u) {
    sphpa_eos_point point;
    memset(&point, 0, sizeof point);
    assert_int_equal(sphpa_tillotson_eval(m, rho, u, &point), SPHPA_OK);
    return point;
}

/* every row of the table, with B in expansion as in the table and the other way round */
static sphpa_tillotson variant(size_t row, int flip) {
    sphpa_tillotson m = sphpa_material_at(row)->eos;
    if (flip != 0) m.zero_B_expanded = m.zero_B_expanded != 0 ? 0 : 1;
    return m;
}

static void tillotson_matches_the_textbook(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(11, 1);
    int seen[3] = {0, 0, 0};
    for (size_t row = 0; row < sphpa_material_count(); row++)
        for (int n = 0; n < 4000; n++) {
            sphpa_tillotson m = variant(row, n & 1);
            double rho, u;
            int branch = draw_state(&m, &rng, &rho, &u);
            seen[branch]++;
            wide size, P = book_P(&m, branch, (wide)rho, (wide)u, &size);
            sphpa_eos_point point = eval(&m, rho, u);
            /* alpha z^2 is good to an ulp or two, so the exponential to alpha z^2 of them */
            double z = m.rho0 / rho - 1.0, blur = 8.0 + 4.0 * m.alpha * z * z + 2.0 * m.beta * z;
            assert_near_abs(point.P, (double)P, blur * DBL_EPSILON * (double)size);
            double core[3];
            sphpa_tillotson_core_(&m, rho, u, &core[0], &core[1], &core[2]);
            assert_true(core[0] == point.P && core[1] == point.dP_drho && core[2] == point.dP_du);
        }
    assert_true(seen[0] > 1000 && seen[1] > 1000 && seen[2] > 1000);
}

static void derivatives_match_differences(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(12, 1);
    for (size_t row = 0; row < sphpa_material_count(); row++)
        for (int n = 0; n < 2000; n++) {
            sphpa_tillotson m = variant(row, n & 1);
            double rho, u;
            int branch = draw_state(&m, &rng, &rho, &u);
            double eta = rho / m.rho0, z = fabs(1.0 / eta - 1.0);
            /* the step is a small part of the length over which the branch changes */
            double steep = 1.0 + 2.0 * m.alpha * z * (1.0 + z) + m.beta * (1.0 + z);
            double h_rho = 1e-3 * rho / steep, h_u = 1e-3 * (u + m.E0 * eta * eta);
            /* at rho0 - h the stencil must stay on its side: B switches there */
            if (fabs(rho - m.rho0) < 5.0 * h_rho) continue;
            wide size, dr = book_slope(&m, branch, (wide)rho, (wide)u, (wide)h_rho, 0.0L);
            wide du = book_slope(&m, branch, (wide)rho, (wide)u, 0.0L, (wide)h_u);
            (void)book_P(&m, branch, (wide)rho, (wide)u, &size);
            sphpa_eos_point point = eval(&m, rho, u);
            double scale_r = (double)size / rho * steep + m.A / m.rho0 * 1e-6;
            double scale_u = m.a * rho;
            if (branch == HYBRID) scale_u += (double)size / (m.u_cv - m.u_iv);
            assert_near_abs(point.dP_drho, (double)dr, 1e-12 * scale_r + 1e-11 * fabs((double)dr));
            assert_near_abs(point.dP_du, (double)du, 1e-12 * scale_u + 1e-11 * fabs((double)du));
        }
}

/* second central difference of eighth order, in rho */
static wide book_bend(const sphpa_tillotson *m, int branch, wide rho, wide u, wide h) {
    static const wide weight[5] = {-205.0L / 72.0L, 8.0L / 5.0L, -1.0L / 5.0L, 8.0L / 315.0L,
                                   -1.0L / 560.0L};
    wide size, sum = weight[0] * book_P(m, branch, rho, u, &size);
    for (int k = 1; k <= 4; k++)
        sum += weight[k] * (book_P(m, branch, rho + (wide)k * h, u, &size) +
                            book_P(m, branch, rho - (wide)k * h, u, &size));
    return sum / (h * h);
}

/* d2P/(drho du): the difference in u of differences in rho */
static wide book_mixed(const sphpa_tillotson *m, int branch, wide rho, wide u, wide h_rho,
                       wide h_u) {
    static const int weight[4] = {672, -168, 32, -3};
    wide sum = 0.0L;
    for (int k = 1; k <= 4; k++)
        sum += (wide)weight[k - 1] *
               (book_slope(m, branch, rho, u + (wide)k * h_u, h_rho, 0.0L) -
                book_slope(m, branch, rho, u - (wide)k * h_u, h_rho, 0.0L));
    return sum / (840.0L * h_u);
}

/* which the pores' solver steps by */
static void second_derivatives_match_differences(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(14, 1);
    int seen[3] = {0, 0, 0};
    for (size_t row = 0; row < sphpa_material_count(); row++)
        for (int n = 0; n < 2000; n++) {
            sphpa_tillotson m = variant(row, n & 1);
            double rho, u;
            int branch = draw_state(&m, &rng, &rho, &u);
            double eta = rho / m.rho0, z = fabs(1.0 / eta - 1.0), heat = u + m.E0 * eta * eta;
            double steep = 1.0 + 2.0 * m.alpha * z * (1.0 + z) + m.beta * (1.0 + z);
            double h_rho = 2e-3 * rho / steep, h_u = 2e-3 * heat;
            if (fabs(rho - m.rho0) < 5.0 * h_rho) continue;
            wide size, bend = book_bend(&m, branch, (wide)rho, (wide)u, (wide)h_rho);
            wide mixed = book_mixed(&m, branch, (wide)rho, (wide)u, (wide)h_rho, (wide)h_u);
            (void)book_P(&m, branch, (wide)rho, (wide)u, &size);
            sphpa_tillotson_branch_ found = sphpa_tillotson_uncut_(&m, rho, u);
            double slope = (double)size / rho * steep, per_u = heat;
            if (branch == HYBRID) per_u = sphpa_min_(heat, m.u_cv - m.u_iv);
            assert_near_abs(found.d2P_drho2, (double)bend, 1e-11 * slope / rho * steep);
            assert_near_abs(found.d2P_drho_du, (double)mixed, 1e-11 * slope / per_u);
            seen[branch]++;
        }
    assert_true(seen[0] > 1000 && seen[1] > 1000 && seen[2] > 1000);
}

static void sound_speed_is_the_slope_of_the_isentrope(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(13, 1);
    int floored = 0, free_ = 0;
    for (size_t row = 0; row < sphpa_material_count(); row++)
        for (int n = 0; n < 1000; n++) {
            sphpa_tillotson m = variant(row, n & 1);
            double rho, u;
            int branch = draw_state(&m, &rng, &rho, &u);
            double z = fabs(m.rho0 / rho - 1.0);
            double h = 1e-4 * rho / (1.0 + 2.0 * m.alpha * z * (1.0 + z) + m.beta * (1.0 + z));
            if (fabs(rho - m.rho0) < 5.0 * h) continue;
            wide c2 = book_isentrope(&m, branch, (wide)rho, (wide)u, (wide)h);
            double floor2 = 0.01 * m.A / m.rho0;
            sphpa_eos_point point = eval(&m, rho, u);
            double work = point.P / (rho * rho) * point.dP_du, identity = point.dP_drho + work;
            assert_near_abs(point.c * point.c, sphpa_max_(identity, floor2),
                            2e-15 * (fabs(point.dP_drho) + fabs(work) + floor2));
            assert_near_abs(point.c * point.c, sphpa_max_((double)c2, floor2),
                            1e-9 * (fabs((double)c2) + floor2));
            if ((double)c2 < floor2) floored++;
            else free_++;
        }
    assert_true(floored > 50 && free_ > 1000); /* both happen */
}

static void floor_of_the_sound_speed(void **state) {
    (void)state;
    sphpa_tillotson m = *sphpa_tillotson_find("nylon");
    m.zero_B_expanded = 0; /* B > A: dP/drho = A + 2 B mu < 0 in cold expansion */
    double rho = 0.5 * m.rho0;
    assert_true(eval(&m, rho, 0.0).dP_drho < 0.0);
    assert_near(eval(&m, rho, 0.0).c, sqrt(0.01 * m.A / m.rho0), 1e-15);
    m.c2_floor = 0.25;
    assert_near(eval(&m, rho, 0.0).c, sqrt(0.25 * m.A / m.rho0), 1e-15);
    assert_near(eval(&m, m.rho0, 0.0).c, sqrt(m.A / m.rho0), 1e-15);
}

/* Murnaghan's c^2 is K/rho0 (rho/rho0)^(n-1): 1/8 of K/rho0 at half the density with n = 4 */
static void floor_of_murnaghans_sound_speed(void **state) {
    (void)state;
    sphpa_murnaghan m = {2700.0, 7e10, 4.0, 0.0};
    const double floors[3] = {0.0, 0.1, 0.25}, shares[3] = {0.125, 0.125, 0.25};
    sphpa_eos_point point;
    for (int k = 0; k < 3; k++) {
        m.c2_floor = floors[k];
        assert_int_equal(sphpa_murnaghan_eval(&m, 0.5 * m.rho0, 0.0, &point), SPHPA_OK);
        assert_near(point.c, sqrt(shares[k] * m.K / m.rho0), 1e-14);
    }
    m.c2_floor = 0.0; /* the default, where 1/1000 is left */
    assert_int_equal(sphpa_murnaghan_eval(&m, 0.1 * m.rho0, 0.0, &point), SPHPA_OK);
    assert_near(point.c, sqrt(0.01 * m.K / m.rho0), 1e-14);
}

/* P and dP/drho are continuous; dP/du jumps by (Pe - Pc)/(u_cv - u_iv) at the borders in u */
static void borders_are_continuous(void **state) {
    (void)state;
    for (size_t row = 0; row < sphpa_material_count(); row++)
        for (int n = 0; n < 40; n++) {
            sphpa_tillotson m = variant(row, n & 1);
            double rho = m.rho0 * (0.2 + 0.02 * n), border[2] = {m.u_iv, m.u_cv};
            for (int k = 0; k < 2; k++) {
                wide size, size_c;
                double u = border[k];
                wide Pe = book_branch(&m, VAPOUR, (wide)rho, (wide)u, &size);
                wide Pc = book_branch(&m, COLD, (wide)rho, (wide)u, &size_c);
                double all = (double)(size + size_c), jump = (double)(Pe - Pc) / (m.u_cv - m.u_iv);
                sphpa_eos_point at = eval(&m, rho, u); /* cold at u_iv, vapour at u_cv */
                sphpa_eos_point in = eval(&m, rho, nextafter(u, k == 0 ? m.u_cv : m.u_iv));
                assert_near_abs(at.P, (double)(k == 0 ? Pc : Pe), 1e-13 * all);
                assert_near_abs(in.P, at.P, 1e-13 * all);
                assert_near_abs(in.dP_drho, at.dP_drho, 1e-11 * all / rho);
                assert_near_abs(in.dP_du - at.dP_du, jump,
                                1e-12 * (rho + all / (m.u_cv - m.u_iv)));
            }
            /* eta = 1, from cold to far above u_cv: the vapour meets the compressed state */
            double u = n < 20 ? m.u_cv * 0.1 * n : m.u_cv * pow(10.0, 0.1 * n);
            double below = nextafter(m.rho0, 0.0), eps = DBL_EPSILON;
            sphpa_eos_point in = eval(&m, below, u), at = eval(&m, m.rho0, u);
            double w = 1.0 + u / m.E0;
            assert_near(at.P, (m.a + m.b / w) * m.rho0 * u, 8.0 * eps);
            assert_near_abs(in.P, at.P, 8.0 * eps * (at.P + m.A));
            assert_near(in.dP_drho, at.dP_drho, 1e-14);
            bool hybrid = u > m.u_iv && u < m.u_cv; /* Pe = Pc there, so no jump in dP/du either */
            assert_near_abs(in.dP_du, at.dP_du,
                            hybrid ? 1e-13 * (at.dP_du + (at.P + m.A) / (m.u_cv - m.u_iv))
                                   : 1e-14 * at.dP_du);
        }
}

static void cut_offs(void **state) {
    (void)state;
    const sphpa_tillotson *plain = sphpa_tillotson_find("basalt");
    sphpa_tillotson m = *plain;
    double rho = 0.9 * m.rho0;
    sphpa_eos_point torn = eval(&m, rho, 0.0), cut;
    assert_true(torn.P < -1e9);

    m.tensile_limit = 3e8;
    cut = eval(&m, rho, 0.0);
    assert_true(cut.P == -3e8 && cut.dP_drho == 0.0 && cut.dP_du == 0.0 && cut.c == torn.c);
    m.tensile_limit = 1e12; /* weaker tension than the limit passes */
    cut = eval(&m, rho, 0.0);
    assert_true(cut.P == torn.P && cut.dP_drho == torn.dP_drho && cut.dP_du == torn.dP_du);

    m = *plain;
    m.eta_cut = 0.95;
    cut = eval(&m, rho, 0.0);
    assert_true(cut.P == 0.0 && cut.dP_drho == 0.0 && cut.dP_du == 0.0 && cut.c == torn.c);
    m.tensile_limit = 3e8; /* the stricter of the two holds below eta_cut, the limit above it */
    assert_true(eval(&m, rho, 0.0).P == 0.0);
    assert_true(eval(&m, 0.96 * m.rho0, 0.0).P == -3e8);
    m.eta_cut = 0.85;
    assert_true(eval(&m, rho, 0.0).P == -3e8);

    /* only where P < 0: hot compacted pumice at eta = 0.785 keeps its pressure and its slopes */
    m = *sphpa_tillotson_find("pumice");
    sphpa_eos_point free_ = eval(&m, 0.785 * m.rho0, 4.5e6);
    m.eta_cut = 0.9;
    m.tensile_limit = 1.0;
    cut = eval(&m, 0.785 * m.rho0, 4.5e6);
    assert_true(free_.P > 1e9 && cut.P == free_.P && cut.dP_drho == free_.dP_drho &&
                cut.dP_du == free_.dP_du && cut.c == free_.c);

    /* a random tour: never below the limit, and the uncut values wherever those are above it */
    sphpa_rng rng = sphpa_rng_seed(14, 1);
    for (int n = 0; n < 4000; n++) {
        const sphpa_tillotson *row = &sphpa_material_at((size_t)n % sphpa_material_count())->eos;
        double u, d;
        (void)draw_state(row, &rng, &d, &u);
        m = *row;
        m.tensile_limit = log_between(&rng, 1e5, 1e10);
        sphpa_eos_point was = eval(row, d, u), is = eval(&m, d, u);
        bool held = was.P < -m.tensile_limit;
        assert_true(is.P == (held ? -m.tensile_limit : was.P) && is.c == was.c);
        assert_true(is.dP_drho == (held ? 0.0 : was.dP_drho));
        assert_true(is.dP_du == (held ? 0.0 : was.dP_du));
    }
}

/* B > A: with B the cold expanded branch pushes again below mu = -A/B; without it, it pulls */
static void zero_B_cures_the_torn_projectile(void **state) {
    (void)state;
    const char *names[3] = {"nylon", "water", "ice"};
    for (int k = 0; k < 3; k++) {
        sphpa_tillotson cured = *sphpa_tillotson_find(names[k]), plain = cured;
        assert_true(cured.zero_B_expanded != 0);
        plain.zero_B_expanded = 0;
        for (int n = 1; n < 100; n++) {
            double rho = 0.01 * n * cured.rho0, mu = rho / cured.rho0 - 1.0;
            assert_near(eval(&cured, rho, 0.0).P, cured.A * mu, 1e-13);
            assert_near(eval(&cured, rho, 0.0).dP_drho, cured.A / cured.rho0, 1e-15);
            if (plain.B > plain.A && mu < -1.01 * plain.A / plain.B)
                assert_true(eval(&plain, rho, 0.0).P > 0.0);
        }
        sphpa_eos_point a = eval(&cured, 1.2 * cured.rho0, 1e5);
        sphpa_eos_point b = eval(&plain, 1.2 * plain.rho0, 1e5);
        assert_true(a.P == b.P && a.dP_drho == b.dP_drho);
    }
}

static bool all_finite(const sphpa_eos_point *p) {
    return sphpa_finite_(p->P) && sphpa_finite_(p->dP_drho) && sphpa_finite_(p->dP_du) &&
           sphpa_finite_(p->c);
}

static void guards_hold_at_extremes(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(15, 1);
    for (size_t row = 0; row < sphpa_material_count(); row++)
        for (int n = 0; n < 20000; n++) {
            sphpa_tillotson m = variant(row, n & 1);
            double rho = log_between(&rng, 1e-10, 1e6), u = log_between(&rng, 1e-300, 1e14);
            if (n % 16 == 0) u = 0.0;
            if (n % 16 == 1) rho = n % 32 == 1 ? 1e-10 : 1e6;
            if (n % 16 == 2) u = 1e14;
            sphpa_eos_point p = eval(&m, rho, u);
            assert_true(all_finite(&p));
            assert_true(p.c * p.c >= 0.01 * m.A / m.rho0 * (1.0 - 1e-14));
            if (u >= m.u_cv && rho < 0.01 * m.rho0) { /* thin vapour: the ideal gas of eq. (3) */
                assert_near(p.P, m.a * rho * u, 1e-15);
                assert_near(p.dP_drho, m.a * u, 1e-15);
                assert_near(p.dP_du, m.a * rho, 1e-15);
                assert_near(p.c * p.c, sphpa_max_((m.a + 1.0) * m.a * u, 0.01 * m.A / m.rho0),
                            1e-14);
            }
        }
    /* beyond what is promised: a finite answer or an error, and no change of the output */
    for (int n = 0; n < 20000; n++) {
        const sphpa_tillotson *m = &sphpa_material_at((size_t)n % sphpa_material_count())->eos;
        sphpa_eos_point p = {7.0, 7.0, 7.0, 7.0};
        double rho = log_between(&rng, 1e-307, 1e307), u = log_between(&rng, 1e-307, 1e307);
        sphpa_result result = sphpa_tillotson_eval(m, rho, u, &p);
        if (result == SPHPA_OK) assert_true(all_finite(&p) && p.c > 0.0 && p.c != 7.0);
        else assert_true(result == SPHPA_ERROR_RANGE && p.P == 7.0 && p.c == 7.0);
    }
    /* eta^2 underflows and u = 0: b/w is 0/0 in the textbook form; only A mu + B mu^2 is left */
    sphpa_eos_point p = eval(sphpa_tillotson_find("iron"), 1e-200, 0.0);
    assert_near(p.P, 1.05e11 - 1.28e11, 1e-14);
    p.P = 7.0;
    assert_int_equal(sphpa_tillotson_eval(sphpa_tillotson_find("iron"), 1e200, 0.0, &p),
                     SPHPA_ERROR_RANGE);
    assert_true(p.P == 7.0);
}

/* ---- the other equations --------------------------------------------------------------------- */

static void ideal_gas(void **state) {
    (void)state;
    sphpa_ideal gas = {1.4};
    sphpa_eos_point p;
    assert_int_equal(sphpa_ideal_eval(&gas, 1.225, 2e5, &p), SPHPA_OK);
    assert_near(p.P, 98000.0, 1e-14);
    assert_near(p.dP_drho, 8e4, 1e-14);
    assert_near(p.dP_du, 0.49, 1e-14);
    assert_near(p.c * p.c, 1.4 * p.P / 1.225, 1e-14);
    assert_int_equal(sphpa_ideal_eval(&gas, 1.225, 0.0, &p), SPHPA_OK);
    assert_true(p.P == 0.0 && p.c == 0.0);
    p.P = 7.0;
    assert_int_equal(sphpa_ideal_eval(&gas, 1e300, 1e300, &p), SPHPA_ERROR_RANGE);
    gas.gamma = 1.0;
    assert_int_equal(sphpa_ideal_eval(&gas, 1.0, 1.0, &p), SPHPA_ERROR_MATERIAL);
    gas.gamma = nan("");
    assert_int_equal(sphpa_ideal_eval(&gas, 1.0, 1.0, &p), SPHPA_ERROR_MATERIAL);
    assert_true(p.P == 7.0);
}

static void murnaghan(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(17, 1);
    sphpa_murnaghan m = {1000.0, 2.2e9, 7.15, 0.0};
    double floor2 = 0.01 * m.K / m.rho0;
    for (int n = 0; n < 4000; n++) {
        double rho = m.rho0 * log_between(&rng, 0.05, 20.0);
        if (n % 2 == 0) rho = m.rho0 * (1.0 + (n % 4 - 1) * log_between(&rng, 1e-14, 1e-2));
        wide eta = (wide)rho / (wide)m.rho0, order = (wide)m.n;
        wide P = (wide)m.K / order * (powl(eta, order) - 1.0L);
        wide slope = (wide)m.K / (wide)m.rho0 * powl(eta, order - 1.0L);
        sphpa_eos_point p;
        assert_int_equal(sphpa_murnaghan_eval(&m, rho, 5.0, &p), SPHPA_OK);
        /* relative to P itself, also next to rho0; powl - 1 is what loses digits there */
        assert_near_abs(p.P, (double)P, 4e-15 * fabs((double)P) * 10.0 + 1e-18 * m.K);
        assert_near(p.dP_drho, (double)slope, 2e-14);
        assert_near(p.c * p.c, sphpa_max_((double)slope, floor2), 2e-14);
        assert_true(p.dP_du == 0.0);
    }
    sphpa_eos_point p = {7.0, 7.0, 7.0, 7.0};
    assert_int_equal(sphpa_murnaghan_eval(&m, 1e-4, 0.0, &p), SPHPA_OK);
    assert_near(p.c, sqrt(floor2), 1e-15);
    assert_near(p.P, -m.K / m.n, 1e-15);
    m.n = 0.0;
    assert_int_equal(sphpa_murnaghan_eval(&m, 1.0, 1.0, &p), SPHPA_ERROR_MATERIAL);
}

/* each through sphpa_eos: the same numbers, and rho0 and K where there are any */
static void any_equation_of_state(void **state) {
    (void)state;
    sphpa_ideal gas = {5.0 / 3.0};
    sphpa_murnaghan stiff = {1000.0, 2e9, 7.0, 0.0};
    const sphpa_tillotson *iron = sphpa_tillotson_find("iron");
    sphpa_eos eos[3] = {sphpa_ideal_eos(&gas), sphpa_murnaghan_eos(&stiff),
                        sphpa_tillotson_eos(iron)};
    sphpa_eos_point a[3], b;
    assert_int_equal(sphpa_ideal_eval(&gas, 1100.0, 3e6, &a[0]), SPHPA_OK);
    assert_int_equal(sphpa_murnaghan_eval(&stiff, 1100.0, 3e6, &a[1]), SPHPA_OK);
    assert_int_equal(sphpa_tillotson_eval(iron, 1100.0, 3e6, &a[2]), SPHPA_OK);
    for (int k = 0; k < 3; k++) {
        assert_int_equal(eos[k].eval(eos[k].material, 1100.0, 3e6, &b), SPHPA_OK);
        assert_true(a[k].P == b.P && a[k].dP_drho == b.dP_drho && a[k].dP_du == b.dP_du &&
                    a[k].c == b.c);
        if (k == 0) continue; /* K = rho0 dP/drho at (rho0, 0), where P = 0 */
        assert_int_equal(eos[k].eval(eos[k].material, eos[k].rho0, 0.0, &b), SPHPA_OK);
        assert_near(eos[k].K, eos[k].rho0 * b.dP_drho, 1e-14);
        assert_near_abs(b.P, 0.0, 1e-9 * eos[k].K);
    }
    assert_true(eos[0].rho0 == 0.0 && eos[0].K == 0.0);
}

static void bad_states_are_errors(void **state) {
    (void)state;
    sphpa_ideal gas = {1.4};
    sphpa_murnaghan stiff = {1000.0, 2e9, 7.0, 0.0};
    sphpa_eos eos[3] = {sphpa_ideal_eos(&gas), sphpa_murnaghan_eos(&stiff),
                        sphpa_tillotson_eos(sphpa_tillotson_find("basalt"))};
    double bad_rho[6] = {0.0, -1.0, 1.0, nan(""), 1.0, HUGE_VAL};
    double bad_u[6] = {1.0, 1.0, -1e-300, 1.0, nan(""), 1.0};
    sphpa_eos_point p = {7.0, 7.0, 7.0, 7.0};
    for (int k = 0; k < 3; k++) {
        for (int n = 0; n < 6; n++)
            assert_int_equal(eos[k].eval(eos[k].material, bad_rho[n], bad_u[n], &p),
                             n < 3 ? SPHPA_ERROR_NEGATIVE : SPHPA_ERROR_NOT_FINITE);
        assert_int_equal(eos[k].eval(eos[k].material, 1.0, -HUGE_VAL, &p), SPHPA_ERROR_NOT_FINITE);
        assert_int_equal(eos[k].eval(NULL, 1.0, 1.0, &p), SPHPA_ERROR_MISSING);
        assert_int_equal(eos[k].eval(eos[k].material, 1.0, 1.0, NULL), SPHPA_ERROR_MISSING);
    }
    sphpa_tillotson none;
    memset(&none, 0, sizeof none);
    assert_int_equal(sphpa_tillotson_eval(&none, 1.0, 1.0, &p), SPHPA_ERROR_MATERIAL);
    assert_true(p.P == 7.0 && p.dP_drho == 7.0 && p.dP_du == 7.0 && p.c == 7.0);
}

/* every parameter is refused with its name in the message, and the row itself is accepted */
static void check_names_the_parameter(void **state) {
    (void)state;
    const sphpa_tillotson good = *sphpa_tillotson_find("granite");
    const char *names[13] = {": rho0 is", ": A is",     ": B is",    ": E0 is",       ": u_iv is",
                             ": u_cv is", ": a is",     ": b is",    ": alpha is",    ": beta is",
                             ": c2_floor is", ": tensile_limit is", ": eta_cut is"};
    for (int k = 0; k < 13; k++)
        for (int n = 0; n < 2; n++) {
            sphpa_tillotson m = good;
            double *field[13] = {&m.rho0, &m.A, &m.B,     &m.E0,   &m.u_iv,     &m.u_cv,
                                 &m.a,    &m.b, &m.alpha, &m.beta, &m.c2_floor, &m.tensile_limit,
                                 &m.eta_cut};
            *field[k] = n == 0 && k != 2 ? -1.0 : nan("");
            sphpa_error err;
            memset(&err, 0, sizeof err);
            assert_int_equal(sphpa_tillotson_check(&m, &err), SPHPA_ERROR_MATERIAL);
            assert_int_equal(err.result, SPHPA_ERROR_MATERIAL);
            assert_non_null(strstr(err.message, names[k]));
            assert_int_equal(sphpa_tillotson_check(&m, NULL), SPHPA_ERROR_MATERIAL);
        }
    sphpa_tillotson m = good;
    m.u_cv = m.u_iv;
    assert_int_equal(sphpa_tillotson_check(&m, NULL), SPHPA_ERROR_MATERIAL);
    assert_int_equal(sphpa_tillotson_check(&good, NULL), SPHPA_OK);
    assert_int_equal(sphpa_tillotson_check(NULL, NULL), SPHPA_ERROR_MISSING);
}

/* ---- the table ------------------------------------------------------------------------------- */

static void table_holds_the_published_numbers(void **state) {
    (void)state;
    /* rho0, A, B, E0, u_iv, u_cv in g/cm3, GPa and MJ/kg; a, b, alpha; zero_B; G, Y in MPa */
    static const char *names[8] = {"basalt", "pumice", "nylon",     "granite",
                                   "iron",   "water",  "aluminium", "ice"};
    static const double rows[8][12] = {
        {2.700, 26.7, 26.7, 487.0, 4.72, 18.2, 0.5, 1.5, 5.0, 0.0, 22700.0, 3500.0},
        {2.327, 26.7, 26.7, 487.0, 4.72, 18.2, 0.5, 1.5, 5.0, 0.0, 22700.0, 3500.0},
        {1.185, 10.1, 33.8, 7.0, 2.0, 2.4, 0.6, 2.0, 10.0, 1.0, 73.0, 10.0},
        {2.680, 18.0, 18.0, 16.0, 3.5, 18.0, 0.5, 1.3, 5.0, 0.0, 0.0, 0.0},
        {7.800, 128.0, 105.0, 9.5, 2.4, 8.67, 0.5, 1.5, 5.0, 0.0, 82000.0, 350.0},
        {0.998, 2.18, 13.25, 7.0, 0.419, 2.69, 0.7, 0.15, 10.0, 1.0, 0.0, 0.0},
        {2.700, 75.2, 65.0, 5.0, 3.0, 13.9, 0.5, 1.63, 5.0, 0.0, 26900.0, 276.0},
        {0.917, 9.47, 9.47, 10.0, 0.773, 3.04, 0.3, 0.1, 10.0, 1.0, 2800.0, 1000.0},
    };
    assert_int_equal(sphpa_material_count(), 8);
    for (int k = 0; k < 8; k++) {
        const sphpa_material *mat = sphpa_material_find(names[k]);
        assert_non_null(mat);
        const sphpa_tillotson *m = &mat->eos;
        assert_true(sphpa_tillotson_find(names[k]) == m);
        double have[12] = {m->rho0 / 1e3, m->A / 1e9, m->B / 1e9, m->E0 / 1e6,
                           m->u_iv / 1e6, m->u_cv / 1e6, m->a, m->b,
                           m->alpha, (double)m->zero_B_expanded, mat->G / 1e6, mat->Y / 1e6};
        for (int n = 0; n < 12; n++) assert_near(have[n], rows[k][n], 1e-14);
        assert_true(m->beta == 5.0);
        assert_int_equal(sphpa_tillotson_check(m, NULL), SPHPA_OK);
        assert_near(eval(m, m->rho0, 0.0).c, sqrt(m->A / m->rho0), 1e-15);
    }
    assert_true(sphpa_material_find("basalt")->weibull_m == 9.0);
    assert_true(sphpa_material_find("ice")->weibull_k == 1.4e38);
    for (size_t i = 0; i < 8; i++) {
        const sphpa_material *mat = sphpa_material_at(i);
        assert_true(sphpa_material_find(mat->name) == mat); /* so no name is there twice */
    }
    assert_null(sphpa_material_at(8));
    assert_null(sphpa_material_find("cheese"));
    assert_null(sphpa_material_find(NULL));
    assert_null(sphpa_tillotson_find("Basalt"));
}

/* ---- the material file ----------------------------------------------------------------------- */

#define FILE_NAME "test_eos_material.tmp"

static sphpa_result read_text(const char *text, sphpa_material *out, sphpa_error *err) {
    FILE *file = fopen(FILE_NAME, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(text, 1, strlen(text), file), strlen(text));
    assert_int_equal(fclose(file), 0);
    sphpa_result result = sphpa_material_read(FILE_NAME, out, err);
    assert_int_equal(remove(FILE_NAME), 0);
    return result;
}

#define FULL "name = dunite\nrho0 = 3320\nA=1.29e11\nB = 1.29E+11 \n E0 = 4.87e8\nu_iv = 4.72e6\n" \
             "u_cv = 18.2e6\na = .5\nb = 1.4\nalpha = 5.\nbeta = 5\n"

static void material_file_is_read(void **state) {
    (void)state;
    sphpa_material m;
    memset(&m, 0, sizeof m);
    assert_int_equal(read_text("# a comment\n\n" FULL
                               "\tG = 5e10 # shear\r\nY=+1e9\nu_melt = 1e6\nweibull_k = 1e30\n"
                               "weibull_m = 8.5\nc2_floor = 0.02\ntensile_limit = 1e8\n"
                               "eta_cut = 0.9\nzero_B_expanded = 1",
                               &m, NULL),
                     SPHPA_OK);
    assert_string_equal(m.name, "dunite");
    assert_true(m.eos.rho0 == 3320.0 && m.eos.A == 1.29e11 && m.eos.B == 1.29e11 &&
                m.eos.E0 == 4.87e8 && m.eos.u_iv == 4.72e6 && m.eos.u_cv == 1.82e7);
    assert_true(m.eos.a == 0.5 && m.eos.b == 1.4 && m.eos.alpha == 5.0 && m.eos.beta == 5.0);
    assert_true(m.eos.c2_floor == 0.02 && m.eos.tensile_limit == 1e8 && m.eos.eta_cut == 0.9);
    assert_int_equal(m.eos.zero_B_expanded, 1);
    assert_true(m.G == 5e10 && m.Y == 1e9 && m.u_melt == 1e6 && m.weibull_k == 1e30 &&
                m.weibull_m == 8.5);

    /* like: the rest from the row, wherever the line stands */
    sphpa_material nylon = *sphpa_material_find("nylon");
    assert_int_equal(read_text("rho0 = 1140\nzero_B_expanded = 0\nlike = nylon\nname = PA 66\n", &m,
                               NULL),
                     SPHPA_OK);
    assert_string_equal(m.name, "PA 66");
    assert_true(m.eos.rho0 == 1140.0 && m.eos.zero_B_expanded == 0 && m.eos.B == nylon.eos.B &&
                m.eos.u_cv == nylon.eos.u_cv && m.Y == nylon.Y && m.eos.beta == nylon.eos.beta);
    assert_int_equal(read_text("like = nylon", &m, NULL), SPHPA_OK);
    assert_string_equal(m.name, "nylon");

    if (setlocale(LC_NUMERIC, "de_DE.UTF-8") != NULL) { /* where that is installed */
        sphpa_result result = read_text("like = nylon\na = 0.625\nb = 1,5\n", &m, NULL);
        sphpa_result good = read_text("like = nylon\na = 0.625\n", &m, NULL);
        (void)setlocale(LC_NUMERIC, "C");
        assert_int_equal(result, SPHPA_ERROR_PARSE);
        assert_int_equal(good, SPHPA_OK);
        assert_true(m.eos.a == 0.625);
    }
}

/* a file that must be refused: the code, and three things that its message must hold */
typedef struct refusal {
    const char *text;
    sphpa_result result;
    const char *where, *value, *cure;
} refusal;

static void material_file_errors_name_line_value_and_cure(void **state) {
    (void)state;
    static const refusal bad[] = {
        {FULL "rho = 1\n", SPHPA_ERROR_UNKNOWN, ":12:", "\"rho\"", "name, rho0, A, B"},
        {"like = basalt\nE0 = 4,87\n", SPHPA_ERROR_PARSE, ":2:", "4,87", "SI units"},
        {"like = basalt\nE0 = 0x10\n", SPHPA_ERROR_PARSE, ":2:", "0x10", "decimal"},
        {"like = basalt\nE0 = inf\n", SPHPA_ERROR_PARSE, ":2:", "inf", "decimal"},
        {"like = basalt\nE0 = 1e999\n", SPHPA_ERROR_PARSE, ":2:", "1e999", "decimal"},
        {"like = basalt\nE0 = 1e\n", SPHPA_ERROR_PARSE, ":2:", "1e", "decimal"},
        {"like = basalt\nE0 = .\n", SPHPA_ERROR_PARSE, ":2:", "= .", "decimal"},
        {"like = basalt\nE0 = 5 J/kg\n", SPHPA_ERROR_PARSE, ":2:", "5 J/kg", "decimal"},
        {"like = basalt\n\nE0 = # none\n", SPHPA_ERROR_PARSE, ":3:", "E0", "E0 = value"},
        {"like = basalt\nE0 5\n", SPHPA_ERROR_PARSE, ":2:", "E0 5", "key = value"},
        {"like = basalt\nE0 = 5\nE0 = 6\n", SPHPA_ERROR_PARSE, ":3:", "(6)", "line 2"},
        {"like = basalt\nlike = iron\n", SPHPA_ERROR_PARSE, ":2:", "iron", "line 1"},
        {"like = cheese\n", SPHPA_ERROR_UNKNOWN, ":1:", "cheese", "basalt, pumice, nylon"},
        {"name = x\nrho0 = 5\nA = 1\n", SPHPA_ERROR_MISSING, ":3:", "B, E0, u_iv", "like = basalt"},
        {"", SPHPA_ERROR_MISSING, ":0:", "name, rho0", "like = basalt"},
        {"like = basalt\nrho0 = -5\nA = 1", SPHPA_ERROR_MATERIAL, ":2:", "rho0 is -5", "positive"},
        {"like = iron\nu_cv = 1\n", SPHPA_ERROR_MATERIAL, ":2:", "u_cv is 1", "above u_iv"},
        {"like = iron\nG = -1\nY = 1\n", SPHPA_ERROR_MATERIAL, ":2:", "G is -1", "not negative"},
        {"like = iron\nzero_B_expanded = 2\n", SPHPA_ERROR_PARSE, ":2:", "= 2", "0 or 1"},
        {"name = 12345678901234567890123456789012\n", SPHPA_ERROR_PARSE, ":1:", "32 char",
         "most 31"},
    };
    for (size_t n = 0; n < sizeof bad / sizeof bad[0]; n++) {
        sphpa_material out, before;
        sphpa_error err;
        memset(&out, 0x5a, sizeof out);
        memset(&err, 0, sizeof err);
        before = out;
        sphpa_result result = read_text(bad[n].text, &out, &err);
        bool told = strstr(err.message, FILE_NAME) != NULL &&
                    strstr(err.message, bad[n].where) != NULL &&
                    strstr(err.message, bad[n].value) != NULL &&
                    strstr(err.message, bad[n].cure) != NULL;
        if (result != bad[n].result || !told)
            print_error("case %d: %d %s\n", (int)n, (int)result, err.message);
        assert_int_equal(result, bad[n].result);
        assert_true(told);
        assert_int_equal(err.result, result);
        assert_memory_equal(&out, &before, sizeof out);
        assert_int_equal(read_text(bad[n].text, &out, NULL), bad[n].result);
    }
}

static void material_file_that_cannot_be_read(void **state) {
    (void)state;
    sphpa_material m;
    sphpa_error err;
    assert_int_equal(sphpa_material_read("no/such/file.txt", &m, &err), SPHPA_ERROR_FILE);
    assert_non_null(strstr(err.message, "no/such/file.txt"));
    assert_int_equal(sphpa_material_read(".", &m, &err), SPHPA_ERROR_FILE); /* a folder */
    assert_int_equal(sphpa_material_read(NULL, &m, &err), SPHPA_ERROR_MISSING);
    assert_int_equal(sphpa_material_read("x", NULL, &err), SPHPA_ERROR_MISSING);
    char text[600];
    memset(text, 'x', sizeof text);
    text[599] = '\0';
    assert_int_equal(read_text(text, &m, &err), SPHPA_ERROR_PARSE); /* one endless line */
    assert_non_null(strstr(err.message, ":1:"));
    sphpa_rng rng = sphpa_rng_seed(18, 1);
    for (int n = 0; n < 300; n++) { /* noise is refused, and never read out of bounds */
        int length = 1 + (int)sphpa_rng_below(&rng, 598);
        for (int k = 0; k < length; k++) text[k] = (char)(1 + sphpa_rng_below(&rng, 127));
        text[length] = '\0';
        assert_int_not_equal(read_text(text, &m, &err), SPHPA_OK);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tillotson_matches_the_textbook),
        cmocka_unit_test(derivatives_match_differences),
        cmocka_unit_test(second_derivatives_match_differences),
        cmocka_unit_test(sound_speed_is_the_slope_of_the_isentrope),
        cmocka_unit_test(floor_of_the_sound_speed),
        cmocka_unit_test(floor_of_murnaghans_sound_speed),
        cmocka_unit_test(borders_are_continuous),
        cmocka_unit_test(cut_offs),
        cmocka_unit_test(zero_B_cures_the_torn_projectile),
        cmocka_unit_test(guards_hold_at_extremes),
        cmocka_unit_test(ideal_gas),
        cmocka_unit_test(murnaghan),
        cmocka_unit_test(any_equation_of_state),
        cmocka_unit_test(bad_states_are_errors),
        cmocka_unit_test(check_names_the_parameter),
        cmocka_unit_test(table_holds_the_published_numbers),
        cmocka_unit_test(material_file_is_read),
        cmocka_unit_test(material_file_errors_name_line_value_and_cure),
        cmocka_unit_test(material_file_that_cannot_be_read),
    };
    return cmocka_run_group_tests_name("eos", tests, NULL, NULL);
}
