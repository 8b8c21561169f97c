/* Godunov SPH, ADKE and MPM: every equation against sums over all pairs that are written anew here,
   conserved sums, symmetries, exact solutions, and how bad the state may be. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#define SPHPA_GODUNOV_IMPLEMENTATION
#include "sphpa.h"

#include "near.h"

#define PI 3.14159265358979323846

/* ---- helpers --------------------------------------------------------------------------------- */

typedef enum scheme_kind { GSPH, ADKE, MPM } scheme_kind;

/* a gas and all that a simulation of it points to */
typedef struct gas_scene {
    sphpa_ideal gas;
    sphpa_eos eos;
    scheme_kind kind;
    sphpa_godunov_params params;
    sphpa_sim_options options;
    sphpa_particles p;
    sphpa_sim sim;
    bool with_ghosts; /* somebody asks for the field */
} gas_scene;

static sphpa_result no_change(sphpa_sim *sim, void *params, size_t first, size_t last, size_t *bad) {
    (void)sim, (void)params, (void)first, (void)last, (void)bad;
    return SPHPA_OK;
}

static gas_scene *gas_new(scheme_kind kind, int dim, double gamma, double low, double high) {
    gas_scene *g = (gas_scene *)calloc(1, sizeof *g);
    g->gas.gamma = gamma;
    g->eos = sphpa_ideal_eos(&g->gas);
    g->kind = kind;
    g->params.gas.eos = &g->eos;
    g->params.gas.materials = 1;
    g->options.kernel = SPHPA_KERNEL_GAUSSIAN;
    for (int a = 0; a < dim && high > low; a++) {
        g->options.box.low[a] = low;
        g->options.box.high[a] = high;
        g->options.box.periodic[a] = 1;
    }
    assert_int_equal(sphpa_particles_create(&g->p, dim, 0, 0, 0, NULL, 0, NULL), SPHPA_OK);
    return g;
}

static size_t gas_add(gas_scene *g, const double x[3], double m, double rho, double P) {
    size_t i = 0;
    assert_int_equal(sphpa_particles_add(&g->p, 1, &i, NULL), SPHPA_OK);
    for (size_t a = 0; a < (size_t)g->p.dim; a++) g->p.x[3 * i + a] = x[a];
    g->p.m[i] = (sphpa_real)m;
    g->p.rho[i] = rho;
    g->p.u[i] = P / (rho * (g->gas.gamma - 1.0));
    g->p.h[i] = (sphpa_real)(1.2 * pow(m / rho, 1.0 / g->p.dim));
    return i;
}

static sphpa_result gas_try(gas_scene *g, sphpa_error *err) {
    sphpa_scene scene;
    memset(&scene, 0, sizeof scene);
    sphpa_module module = g->kind == GSPH   ? sphpa_godunov(&g->params)
                          : g->kind == ADKE ? sphpa_godunov_adke(&g->params)
                                            : sphpa_godunov_mpm(&g->params);
    if (g->with_ghosts)
        sphpa_module_pass_(&module, "ghosts", SPHPA_STAGE_PRESSURE, SPHPA_F(ghost), 0)->particle =
            no_change;
    assert_int_equal(sphpa_scene_add(&scene, module), SPHPA_OK);
    return sphpa_sim_create(&g->sim, &scene, &g->p, &g->options, err);
}

static void gas_start(gas_scene *g) {
    sphpa_error err;
    if (gas_try(g, &err) != SPHPA_OK) fail_msg("%s", err.message);
}

static void gas_steps(gas_scene *g, int steps) {
    sphpa_error err;
    for (int k = 0; k < steps; k++)
        if (sphpa_sim_step(&g->sim, HUGE_VAL, &err) != SPHPA_OK) fail_msg("%s", err.message);
}

static void gas_run(gas_scene *g, double t_end) {
    sphpa_run run;
    sphpa_error err;
    memset(&run, 0, sizeof run);
    run.t_end = t_end;
    if (sphpa_sim_run(&g->sim, &run, &err) != SPHPA_OK) fail_msg("%s", err.message);
    if (sphpa_sim_refresh(&g->sim, &err) != SPHPA_OK) fail_msg("%s", err.message);
}

static void gas_free(gas_scene *g) {
    sphpa_sim_free(&g->sim);
    sphpa_particles_free(&g->p);
    free(g);
}

/* total energy to rounding, momentum too, against what the particles carry */
static void assert_conserved(const sphpa_sim *sim, const sphpa_totals *before) {
    sphpa_totals now = sphpa_sim_totals(sim);
    double scale = sqrt(2.0 * before->energy * before->mass); /* [kg m/s] */
    double walk = float_walk(sim->stats.steps, sim->p.n);
    assert_near(now.mass, before->mass, 1e-15);
    assert_near(now.energy, before->energy, FINE(1e-13, 3.0 * walk));
    for (int a = 0; a < 3; a++)
        assert_near_abs(now.momentum[a], before->momentum[a], FINE(1e-14, 2.5 * walk) * scale);
}

/* k^dim particles off their lattice in a box of edge 1 (periodic: in it), dense and thin, hot and
   cold, each with a velocity of its own */
static gas_scene *gas_mess(scheme_kind kind, int dim, int k, int periodic, uint64_t seed) {
    gas_scene *g = gas_new(kind, dim, 1.4, 0.0, periodic ? 1.0 : 0.0);
    sphpa_rng rng = sphpa_rng_seed(seed, 3);
    int ky = dim > 1 ? k : 1, kz = dim > 2 ? k : 1;
    for (int n = 0; n < k * ky * kz; n++) {
        double x[3] = {(double)(n % k), (double)(n / k % ky), (double)(n / (k * ky))};
        for (int d = 0; d < dim; d++) {
            double s = (x[d] + 0.5 + 0.3 * (sphpa_rng_uniform(&rng) - 0.5)) / k;
            x[d] = s + 0.3 * sin(2.0 * PI * s) / (2.0 * PI); /* dense here, thin there */
        }
        double m = pow(1.0 / k, dim) * (0.8 + 0.4 * sphpa_rng_uniform(&rng));
        size_t i = gas_add(g, x, m, 1.0, 0.2 + sphpa_rng_uniform(&rng));
        for (size_t d = 0; d < (size_t)dim; d++)
            g->p.v[3 * i + d] = (sphpa_real)(1.2 * sphpa_rng_uniform(&rng) - 0.6);
    }
    return g;
}

/* rates of the state at the start; h (n) by id: what they were computed with */
static double *gas_rates(gas_scene *g) {
    sphpa_error err;
    double *h = (double *)calloc(g->sim.p.n, sizeof *h);
    bool late = g->kind == MPM || g->params.pilot < 0.0; /* h is found with rho */
    for (size_t i = 0; i < g->sim.p.n; i++) h[g->sim.p.id[i]] = (double)g->sim.p.h[i];
    if (sphpa_sim_start_(&g->sim, &err) != SPHPA_OK) fail_msg("%s", err.message);
    for (size_t i = 0; i < g->sim.p.n && late; i++) h[g->sim.p.id[i]] = (double)g->sim.p.h[i];
    return h;
}

/* ---- the equations, once more, pair by pair -------------------------------------------------- */

typedef struct pair_view {
    double x[3], r, n[3]; /* x_i - x_j of the nearest image */
} pair_view;

static pair_view view(const sphpa_sim *sim, size_t i, size_t j) {
    pair_view pair;
    pair.r = 0.0;
    for (size_t a = 0; a < 3; a++) {
        double d = sim->p.x[3 * i + a] - sim->p.x[3 * j + a];
        if (a < (size_t)sim->p.dim && sim->options.box.periodic[a]) d -= floor(d + 0.5); /* edge 1 */
        pair.x[a] = d;
        pair.r += d * d;
    }
    pair.r = sqrt(pair.r);
    for (int a = 0; a < 3; a++) pair.n[a] = pair.r > 0.0 ? pair.x[a] / pair.r : 0.0;
    return pair;
}

static double dot(const double a[3], const sphpa_real *b) {
    return a[0] * (double)b[0] + a[1] * (double)b[1] + a[2] * (double)b[2];
}

static double kernel(const sphpa_sim *sim, double r, double h) {
    return sphpa_kernel_w(sim->options.kernel, sim->p.dim, r, h);
}

static double kernel_slope(const sphpa_sim *sim, double r, double h) {
    return sphpa_kernel_dw(sim->options.kernel, sim->p.dim, r, h);
}

/* the mean of f(s)^2 between particles at -r/2 and r/2, with the product of their two Gaussians (of the h of
   densities) as weights, by the trapezoidal rule; 1/rho = a polynomial */
static double mean_square(const double c[4], double h, double r) {
    double sum = 0.0, weights = 0.0;
    for (int k = -18; k <= 18; k++) {
        double s = 0.25 * k * h, left = (s + 0.5 * r) / h, right = (s - 0.5 * r) / h;
        double w = exp(0.5 * r * r / (h * h) - left * left - right * right); /* 1 in the middle */
        double f = c[0] + s * (c[1] + s * (c[2] + s * c[3]));
        sum += w * f * f;
        weights += w;
    }
    return sum / weights;
}

/* the cubic through f(-r/2) = fj, f(r/2) = fi with these slopes there, by elimination */
static void cubic_through(double r, double fj, double fi, double slope_j, double slope_i,
                          double c[4]) {
    double s = 0.5 * r, even = 0.5 * (fi + fj), odd = 0.5 * (fi - fj);
    double slope_even = 0.5 * (slope_i - slope_j), slope_odd = 0.5 * (slope_i + slope_j);
    c[2] = slope_even / (2.0 * s);
    c[0] = even - c[2] * s * s;
    c[3] = (slope_odd - odd / s) / (2.0 * s * s);
    c[1] = odd / s - c[3] * s * s;
}

/* equation (5) with h */
static double volume_squared(const gas_scene *g, size_t own, size_t i, size_t j,
                             const pair_view *pair, double h, double mean_h) {
    const sphpa_particles *p = &g->sim.p;
    double mi = g->params.by_number ? (double)p->m[i] : 1.0;
    double mj = g->params.by_number ? (double)p->m[j] : 1.0;
    double c[4] = {0.0, 0.0, 0.0, 0.0}, vi = mi / p->rho[i], vj = mj / p->rho[j];
    if (g->params.volume == SPHPA_GODUNOV_DELTA) return own == i ? vi * vi : vj * vj;
    c[0] = 0.5 * (vi + vj);
    c[1] = (vi - vj) / pair->r;
    if (g->params.volume == SPHPA_GODUNOV_CUBIC) {
        double share = fmin(1.0, 4.0 * pow(pair->r / mean_h, 2.0)), line = c[1];
        double slope_j = -vj * vj / mj * dot(pair->n, p->grad_rho + 3 * j);
        double slope_i = -vi * vi / mi * dot(pair->n, p->grad_rho + 3 * i);
        cubic_through(pair->r, vj, vi, share * slope_j + (1.0 - share) * line,
                      share * slope_i + (1.0 - share) * line, c);
    }
    return mean_square(c, g->params.wide ? sqrt(0.5) * h : h, pair->r);
}

/* in float: a neighbour at the edge of a Gaussian may be counted or not */
static const double float_edge = 1.5e-4;

static double least_of(double a, double b) { return fabs(a) < fabs(b) ? a : b; }

/* what (6) adds to rho, v, P (q: 0, 1, 2) on the way to the middle: D the difference of the pair,
   full what the slope says */
static double reconstruct(int slopes, int q, double D, double full) {
    double far = 2.0 * full - D;
    if (slopes == SPHPA_GODUNOV_FLAT || (slopes == SPHPA_GODUNOV_VAN_LEER && D * far <= 0.0))
        return 0.0;
    if (slopes == SPHPA_GODUNOV_VAN_LEER) return 0.5 * (2.0 * D * far / (D + far));
    if (slopes == SPHPA_GODUNOV_INUTSUKA) return 0.5 * full;
    if (q == 0 || D * full <= 0.0 || (q == 1 && D * far <= 0.0)) return 0.0;
    return 0.5 * least_of(least_of(D, full), q == 1 ? 4.0 * far : D);
}

/* n.grad v.n of particle i */
static double along(const sphpa_particles *p, size_t i, const double n[3]) {
    double sum = 0.0;
    for (size_t a = 0; a < 3; a++) sum += n[a] * dot(n, p->L + 9 * i + 3 * a);
    return sum;
}

/* (6) and the exact solution of it */
static sphpa_riemann_star pair_star(const gas_scene *g, size_t i, size_t j, const pair_view *pair) {
    const sphpa_particles *p = &g->sim.p;
    double f[3][2], full[3][2], add[3][2]; /* rho, v, P; j and i */
    for (int side = 0; side < 2; side++) {
        size_t k = side == 0 ? j : i;
        f[0][side] = p->rho[k], full[0][side] = pair->r * dot(pair->n, p->grad_rho + 3 * k);
        f[1][side] = dot(pair->n, p->v + 3 * k), full[1][side] = pair->r * along(p, k, pair->n);
        f[2][side] = (double)p->P[k], full[2][side] = pair->r * dot(pair->n, p->grad_P + 3 * k);
    }
    double c = fmin((double)p->c[i], (double)p->c[j]);
    bool shock = g->params.slopes == SPHPA_GODUNOV_INUTSUKA && 3.0 * (f[1][0] - f[1][1]) > c;
    bool turns = g->params.slopes == SPHPA_GODUNOV_INUTSUKA && full[1][0] * full[1][1] < 0.0;
    for (int q = 0; q < 3; q++)
        for (int side = 0; side < 2; side++) {
            add[q][side] = reconstruct(g->params.slopes, q, f[q][1] - f[q][0], full[q][side]);
            if (shock || (q == 1 && turns)) add[q][side] = 0.0;
        }
    sphpa_riemann_state l = {f[0][0] + add[0][0], f[1][0] + add[1][0], f[2][0] + add[2][0]};
    sphpa_riemann_state r = {f[0][1] - add[0][1], f[1][1] - add[1][1], f[2][1] - add[2][1]};
    if (!(l.rho > 0.0 && r.rho > 0.0 && l.P > 0.0 && r.P > 0.0)) {
        l.rho = f[0][0], l.v = f[1][0], l.P = f[2][0];
        r.rho = f[0][1], r.v = f[1][1], r.P = f[2][1];
    }
    sphpa_riemann_star star;
    assert_int_equal(sphpa_riemann_exact(g->gas.gamma, &l, &r, &star), SPHPA_OK);
    return star;
}

static double heat_spread(const gas_scene *g, size_t i, double h) {
    const sphpa_particles *p = &g->sim.p;
    double div = (double)p->L[9 * i] + (double)p->L[9 * i + 4] + (double)p->L[9 * i + 8];
    return g->params.g1 * h * (double)p->c[i] + g->params.g2 * h * h * (fabs(div) - div);
}

/* (2) of particle i */
static double gsph_density(const gas_scene *g, const double *h, size_t i) {
    const sphpa_sim *sim = &g->sim;
    double sum = 0.0, narrow = g->params.wide ? sqrt(0.5) : 1.0, hi = h[sim->p.id[i]];
    for (size_t j = 0; j < sim->p.n; j++) {
        double own = g->params.own_h ? hi : 0.5 * (hi + h[sim->p.id[j]]);
        sum += (double)sim->p.m[g->params.by_number ? i : j] *
               kernel(sim, view(sim, i, j).r, narrow * own);
    }
    if (!g->params.lattice) return sum;
    double eta = g->params.gas.eta > 0.0 ? g->params.gas.eta : 1.2, whole = 0.0;
    for (int a = -8; a <= 8; a++) /* what it gives on a square lattice of spacing 1 */
        for (int b = -8; b <= 8; b++) whole += kernel(sim, hypot(a, b), eta);
    return sum / whole;
}

/* (3), (4) with the velocity of the evaluation and (8) of particle i: a, du; and their sizes */
static void gsph_rates(const gas_scene *g, const double *h, size_t i, double a[3], double *du,
                       double size[2]) {
    const sphpa_sim *sim = &g->sim;
    const sphpa_particles *p = &sim->p;
    memset(a, 0, 3 * sizeof *a);
    *du = size[0] = size[1] = 0.0;
    for (size_t j = 0; j < p->n; j++) {
        if (j == i) continue;
        pair_view pair = view(sim, i, j);
        double hi = h[p->id[i]], hj = h[p->id[j]], m = (double)p->m[j];
        double Hi = heat_spread(g, i, hi), Hj = heat_spread(g, j, hj);
        double mean = 0.5 * (hi + hj);
        if (!g->params.own_h) hi = hj = mean;
        double gi = kernel_slope(sim, pair.r, hi), gj = kernel_slope(sim, pair.r, hj);
        if (gi == 0.0 && gj == 0.0) continue;
        sphpa_riemann_star star = pair_star(g, i, j, &pair);
        double per = g->params.by_number ? 1.0 / (double)p->m[i] : m;
        double push = per * star.P * (volume_squared(g, i, i, j, &pair, hi, mean) * gi +
                                      volume_squared(g, j, i, j, &pair, hj, mean) * gj);
        for (int k = 0; k < 3; k++) a[k] -= push * pair.n[k];
        *du -= push * (star.v - dot(pair.n, p->v + 3 * i));
        *du += m * (Hi + Hj) * (p->u[i] - p->u[j]) / (0.5 * (p->rho[i] + p->rho[j]) * pair.r) *
               0.5 * (gi + gj);
        size[0] += fabs(push);
        size[1] += fabs(push) * (double)p->c[i];
    }
}

/* rates anew, of all but ghosts */
static void assert_gsph_now(gas_scene *g) {
    double *h = gas_rates(g);
    const sphpa_particles *p = &g->sim.p;
    for (size_t i = 0; i < p->n; i++) {
        double a[3], du, size[2];
        if (sphpa_ghost_(p, i)) continue;
        assert_near(p->rho[i], gsph_density(g, h, i), FINE(1e-13, float_edge));
        gsph_rates(g, h, i, a, &du, size);
        for (size_t k = 0; k < 3; k++)
            assert_near_abs((double)p->a[3 * i + k], a[k],
                            FINE(2e-13, float_edge) * size[0]);
        assert_near_abs((double)p->du[i], du, FINE(2e-13, float_edge) * size[1]);
    }
    free(h);
}

static void assert_gsph(gas_scene *g) {
    gas_start(g);
    assert_gsph_now(g);
    gas_free(g);
}

/* every third particle 50 times as heavy as the others: what by_number is for */
static void by_number(gas_scene *g) {
    g->params.by_number = 1;
    for (size_t i = 0; i < g->p.n; i += 3) g->p.m[i] *= SPHPA_R(50.0);
}

static void forces_and_heat_are_those_of_all_pairs(void **state) {
    (void)state;
    for (int dim = 1; dim <= 3; dim++)
        for (int slopes = 0; slopes <= SPHPA_GODUNOV_FLAT; slopes++)
            for (int volume = 0; volume <= SPHPA_GODUNOV_DELTA; volume++)
                for (int way = 0; way < 4; way++) {
                    int own = way % 2;
                    /* float: limiters jump where its rounding decides */
                    if (IS_FLOAT && slopes == SPHPA_GODUNOV_INUTSUKA) continue;
                    if (dim == 3 && (slopes + volume + way) % 3 != 0) continue;
                    gas_scene *g = gas_mess(GSPH, dim, dim == 1 ? 40 : dim == 2 ? 11 : 8, 1, 5);
                    g->params.gas.eta = dim == 3 ? 0.9 : 1.3;
                    g->params.slopes = slopes;
                    g->params.volume = volume;
                    g->params.own_h = own;
                    g->params.g1 = 0.25;
                    g->params.g2 = 0.5;
                    g->params.pilot = 1.0;
                    if (way > 1) by_number(g);
                    assert_gsph(g);
                }
}

/* more than one chunk of the lists, other kernels, an open box, wide kernels, h found with rho */
static void forces_do_not_depend_on_how_pairs_are_met(void **state) {
    static const sphpa_kernel kernels[3] = {SPHPA_KERNEL_CUBIC, SPHPA_KERNEL_WENDLAND_C2,
                                            SPHPA_KERNEL_GAUSSIAN};
    (void)state;
    for (int k = 0; k < 3; k++)
        for (int periodic = 0; periodic < 2; periodic++) {
            gas_scene *g = gas_mess(GSPH, 2, 37, periodic, 8);
            g->options.kernel = kernels[k];
            g->params.wide = k == 1;
            g->params.lattice = k == 1;
            g->params.own_h = k == 2 && periodic;
            g->params.pilot = k == 2 && periodic ? -1.0 : 0.0;
            g->params.gas.h_tol = 1e-9; /* rho is as good as its square */
            if (k == 0 && periodic) by_number(g);
            assert_gsph(g);
        }
}

/* Ghosts are neighbours and get no rates: where they lie among the others, as when they have just
   become so; where they are sorted behind them; and when all come back, whom no list is of. */
static void ghosts_are_met_and_meet_nobody(void **state) {
    (void)state;
    for (int way = 0; way < 4; way += SMALL ? 3 : 1) {
        gas_scene *g = gas_mess(GSPH, 2, 37, way % 2, 9);
        sphpa_rng rng = sphpa_rng_seed(4, 4);
        g->with_ghosts = true;
        if (way > 1) by_number(g);
        gas_start(g);
        assert_gsph_now(g);
        sphpa_particles *p = &g->sim.p;
        size_t count = 0;
        for (size_t i = 0; i < p->n; i++) {
            p->ghost[i] = p->x[3 * i] < 0.3 || sphpa_rng_uniform(&rng) < 0.3 ? 1 : 0;
            count += p->ghost[i] != 0 ? 1u : 0u;
        }
        assert_gsph_now(g); /* with the lists that are there */
        assert_int_equal(g->sim.lists.n, p->n);
        g->sim.work->lists_valid = false;
        assert_gsph_now(g);
        assert_int_equal(g->sim.lists.n, p->n - count);
        for (size_t i = 0; i < p->n; i++) assert_int_equal(p->ghost[i] != 0, i >= g->sim.lists.n);
        p->ghost[p->n - 1] = 0;
        assert_gsph_now(g);
        assert_int_equal(g->sim.lists.n, p->n - count + 1);
        for (size_t i = 1; i < p->n; i++) p->ghost[i] = 1;
        assert_gsph_now(g); /* of one */
        assert_int_equal(g->sim.lists.n, p->n - count + 1);
        g->sim.work->lists_valid = false;
        assert_gsph_now(g);
        assert_int_equal(g->sim.lists.n, 1);
        memset(p->ghost, 0, p->n * sizeof *p->ghost);
        assert_gsph_now(g);
        gas_free(g);
    }
}

/* ---- slopes ---------------------------------------------------------------------------------- */

/* (7) of linear v and P on a set without order, up to its very edge */
static void slopes_of_linear_fields_are_exact(void **state) {
    (void)state;
    for (int dim = 1; dim <= 3; dim++) {
        gas_scene *g = gas_mess(GSPH, dim, dim == 3 ? 8 : 15, 0, 6);
        double M[3][3] = {{0.3, -0.7, 0.2}, {1.1, 0.4, -0.5}, {-0.2, 0.6, 0.9}};
        gas_start(g);
        sphpa_particles *p = &g->sim.p;
        assert_int_equal(sphpa_sim_refresh(&g->sim, NULL), SPHPA_OK);
        for (size_t i = 0; i < p->n; i++) {
            double P = 5.0;
            for (size_t a = 0; a < (size_t)dim; a++) {
                double v = 2.0;
                for (size_t b = 0; b < (size_t)dim; b++) v += M[a][b] * p->x[3 * i + b];
                p->v[3 * i + a] = (sphpa_real)v;
                P += M[2][a] * p->x[3 * i + a];
            }
            p->u[i] = P / (0.4 * p->rho[i]);
        }
        assert_int_equal(sphpa_sim_refresh(&g->sim, NULL), SPHPA_OK);
        double tolerance = FINE(2e-13, 400 * FLOAT_ROUNDING) * 15.0;
        for (size_t i = 0; i < p->n; i++)
            for (size_t a = 0; a < (size_t)dim; a++) {
                assert_near_abs((double)p->grad_P[3 * i + a], M[2][a], tolerance);
                for (size_t b = 0; b < (size_t)dim; b++)
                    assert_near_abs((double)p->L[9 * i + 3 * a + b], M[a][b], tolerance);
            }
        gas_free(g);
    }
}

/* that of rho, which no test can choose: M^-1 times the sum, both over all pairs */
static void slopes_of_the_density_are_those_of_all_pairs(void **state) {
    (void)state;
    gas_scene *g = gas_mess(GSPH, 2, 12, 1, 9);
    gas_start(g);
    double *h = gas_rates(g);
    const sphpa_particles *p = &g->sim.p;
    for (size_t i = 0; i < p->n; i++) {
        double M[3] = {0.0, 0.0, 0.0}, sum[2] = {0.0, 0.0};
        for (size_t j = 0; j < p->n; j++) {
            if (j == i) continue;
            pair_view pair = view(&g->sim, i, j);
            double w = (double)p->m[j] / p->rho[j] * kernel_slope(&g->sim, pair.r, h[p->id[i]]);
            for (int a = 0; a < 2; a++) {
                sum[a] += w * pair.n[a] * (p->rho[j] - p->rho[i]);
                M[a] -= w * pair.n[a] * pair.x[a];
            }
            M[2] -= w * pair.n[0] * pair.x[1];
        }
        double det = M[0] * M[1] - M[2] * M[2], tolerance = FINE(1e-12, 40 * FLOAT_ROUNDING) * 10.0;
        assert_near_abs((double)p->grad_rho[3 * i], (M[1] * sum[0] - M[2] * sum[1]) / det,
                        tolerance);
        assert_near_abs((double)p->grad_rho[3 * i + 1], (M[0] * sum[1] - M[2] * sum[0]) / det,
                        tolerance);
    }
    free(h);
    gas_free(g);
}

/* ---- pilot densities ------------------------------------------------------------------------- */

static void pilot_densities_are_those_of_all_pairs(void **state) {
    (void)state;
    for (int dim = 1; dim <= 3; dim++)
        for (int periodic = 0; periodic < 2; periodic++)
            for (int steps = 0; steps <= 7; steps += 7) { /* lists and tree of earlier places */
                gas_scene *g = gas_mess(GSPH, dim, dim == 1 ? 60 : dim == 2 ? 24 : 11, periodic, 7);
                g->params.gas.eta = 1.0;
                g->params.pilot = 1.3;
                g->options.dt_fixed = 2e-3;
                if (dim == 2) by_number(g);
                gas_start(g);
                gas_steps(g, steps);
                const sphpa_particles *p = &g->sim.p;
                double *rho = (double *)calloc(p->n, sizeof *rho);
                sphpa_sim_movement_(&g->sim);
                sphpa_pilot_density_(&g->sim, p->h, 1.3, dim == 2, 0, p->n, rho);
                if (steps > 0) assert_true(g->sim.work->moved_max > 0.0);
                for (size_t i = 0; i < p->n; i++) {
                    double sum = 0.0;
                    for (size_t j = 0; j < p->n; j++)
                        sum += (double)p->m[dim == 2 ? i : j] *
                               kernel(&g->sim, view(&g->sim, i, j).r, 1.3 * (double)p->h[i]);
                    assert_near(rho[i], sum, FINE(1e-13, 25 * FLOAT_ROUNDING));
                }
                free(rho);
                gas_free(g);
            }
}

/* (1): on a lattice of spacing d it gives eta d, whatever h was there before */
static void h_is_eta_spacings(void **state) {
    (void)state;
    for (int wide = 0; wide < 3; wide++) {
        gas_scene *g = gas_new(GSPH, 2, 1.4, 0.0, 1.0);
        for (int k = 0; k < 30 * 30; k++) {
            double x[3] = {(k % 30 + 0.5) / 30.0, (k / 30 + 0.5) / 30.0, 0.0};
            size_t i = gas_add(g, x, 1.0 / 900.0, 1.0, 1.0);
            g->p.h[i] *= (sphpa_real)(k % 2 ? 0.8 : 1.3);
        }
        g->params.gas.eta = 1.4;
        g->params.wide = wide == 1;
        if (wide == 2) g->params.gas.h_max = 0.04;
        gas_start(g);
        for (size_t i = 0; i < g->sim.p.n; i++) /* 1e-4 of the pilot's kernel is cut off at 3 h */
            assert_near((double)g->sim.p.h[i], wide == 2 ? 0.04 : (wide ? sqrt(2.0) : 1.0) * 1.4 / 30.0, 2e-4);
        gas_free(g);
    }
}

/* (9), from all pairs */
static void adke_widens_kernels_where_it_is_thin(void **state) {
    static const double eps[3] = {0.0, 0.8, -1.0}, means[3] = {0.5, 0.8, 0.0};
    (void)state;
    for (int k = 0; k < 3; k++) {
        gas_scene *g = gas_mess(ADKE, 2, 20, 1, 3);
        g->params.k = k == 1 ? 0.9 : 0.0;
        g->params.eps = eps[k];
        gas_start(g);
        const sphpa_particles *p = &g->sim.p;
        double *rho = (double *)calloc(p->n, sizeof *rho), mean = 0.0;
        for (size_t i = 0; i < p->n; i++) {
            for (size_t j = 0; j < p->n; j++)
                rho[i] +=
                    (double)p->m[j] * kernel(&g->sim, view(&g->sim, i, j).r, (double)p->h0[i]);
            mean += log(rho[i]) / (double)p->n;
        }
        for (size_t i = 0; i < p->n; i++)
            assert_near((double)p->h[i],
                        (k == 1 ? 0.9 : 1.0) * (double)p->h0[i] * pow(rho[i] / exp(mean), -means[k]),
                        FINE(1e-13, 25 * FLOAT_ROUNDING));
        free(rho);
        gas_free(g);
    }
}

/* ---- ADKE and MPM, pair by pair -------------------------------------------------------------- */

/* Monaghan's Pi, or that of a Riemann solver; alpha is 1, or what (12) begins with, 0.1 */
static double viscous(const gas_scene *g, size_t i, size_t j, const pair_view *pair, double h) {
    const sphpa_particles *p = &g->sim.p;
    double vn = dot(pair->n, p->v + 3 * i) - dot(pair->n, p->v + 3 * j);
    double c = 0.5 * ((double)p->c[i] + (double)p->c[j]), rho = 0.5 * (p->rho[i] + p->rho[j]);
    if (vn >= 0.0) return 0.0;
    if (g->kind == MPM) return 0.1 * (0.5 * (2.0 * c - 2.0 * vn)) * -vn / rho;
    double mu = h * vn * pair->r / (pair->r * pair->r + 0.01 * h * h);
    return (-c * mu + 2.0 * mu * mu) / rho;
}

static void sph_rates(const gas_scene *g, const double *h, double alpha_u, size_t i, double a[3],
                      double *du, double size[2]) {
    const sphpa_sim *sim = &g->sim;
    const sphpa_particles *p = &sim->p;
    memset(a, 0, 3 * sizeof *a);
    *du = size[0] = size[1] = 0.0;
    double omega_i = g->kind == MPM ? (double)p->omega[i] : 1.0;
    for (size_t j = 0; j < p->n; j++) {
        if (j == i) continue;
        pair_view pair = view(sim, i, j);
        double hi = h[p->id[i]], hj = h[p->id[j]], m = (double)p->m[j];
        double gi = kernel_slope(sim, pair.r, hi), gj = kernel_slope(sim, pair.r, hj);
        double omega_j = g->kind == MPM ? (double)p->omega[j] : 1.0;
        double Fi = (double)p->P[i] / (omega_i * p->rho[i] * p->rho[i]);
        double Fj = (double)p->P[j] / (omega_j * p->rho[j] * p->rho[j]);
        double Pi = viscous(g, i, j, &pair, 0.5 * (hi + hj)), rho = 0.5 * (p->rho[i] + p->rho[j]);
        double vn = dot(pair.n, p->v + 3 * i) - dot(pair.n, p->v + 3 * j), mean = 0.5 * (gi + gj);
        double push = m * (Fi * gi + Fj * gj + Pi * mean);
        for (int k = 0; k < 3; k++) a[k] -= push * pair.n[k];
        *du += m * vn * (Fi * gi + 0.5 * Pi * mean);
        double div[2] = {(double)p->div_v[i], (double)p->div_v[j]}, H = 0.0;
        for (int s = 0; s < 2; s++) {
            double at = s == 0 ? hi : hj, c = (double)p->c[s == 0 ? i : j];
            H += g->params.g1 * at * c + g->params.g2 * at * at * (fabs(div[s]) - div[s]);
        }
        if (g->kind == ADKE) *du += m * H * (p->u[i] - p->u[j]) / (rho * pair.r) * mean;
        else *du += m * alpha_u * sqrt(fabs((double)p->P[i] - (double)p->P[j]) / rho) *
                    (p->u[i] - p->u[j]) / rho * mean;
        size[0] += fabs(push);
        size[1] += fabs(push) * (double)p->c[i];
    }
}

static void adke_and_mpm_are_those_of_all_pairs(void **state) {
    (void)state;
    for (int dim = 1; dim <= 3; dim++)
        for (int kind = ADKE; kind <= (int)MPM; kind++) {
            gas_scene *g = gas_mess((scheme_kind)kind, dim, dim == 1 ? 40 : dim == 2 ? 20 : 11, 1, 4);
            double size[2], a[3], du, alpha_u = kind == (int)MPM ? 0.3 : 0.0;
            g->params.g1 = kind == (int)ADKE ? 0.3 : 0.0;
            g->params.g2 = kind == (int)ADKE ? 0.6 : 0.0;
            g->params.gas.eta = 1.3;
            if (dim == 3) g->options.kernel = SPHPA_KERNEL_CUBIC; /* shorter */
            gas_start(g);
            const sphpa_particles *p = &g->sim.p;
            for (size_t i = 0; i < p->n && kind == (int)MPM; i++)
                sphpa_particles_column(p, "mpm_alpha_u")[i] = alpha_u;
            double *h = gas_rates(g);
            for (size_t i = 0; i < p->n; i++) {
                double rho = 0.0;
                for (size_t j = 0; j < p->n; j++)
                    rho += (double)p->m[j] * kernel(&g->sim, view(&g->sim, i, j).r, h[p->id[i]]);
                if (kind == (int)ADKE) assert_near(p->rho[i], rho, FINE(1e-13, 25 * FLOAT_ROUNDING));
                sph_rates(g, h, alpha_u, i, a, &du, size);
                for (size_t k = 0; k < 3; k++)
                    assert_near_abs((double)p->a[3 * i + k], a[k],
                                    FINE(2e-13, float_edge) * size[0]);
                assert_near_abs((double)p->du[i], du, FINE(2e-13, float_edge) * size[1]);
            }
            free(h);
            gas_free(g);
        }
}

/* (12): one step from what the step's own div v, speeds and Laplacian are */
static void mpm_switches_rise_and_decay(void **state) {
    (void)state;
    gas_scene *g = gas_mess(MPM, 2, 20, 1, 4);
    g->params.sigma = 0.2;
    g->options.dt_fixed = 1e-3;
    gas_start(g);
    const sphpa_particles *p = &g->sim.p;
    double *alpha = sphpa_particles_column(p, "mpm_alpha");
    for (size_t i = 0; i < p->n; i++)
        if (p->id[i] % 2 == 1) alpha[i] = 0.5;
    gas_steps(g, 3);
    alpha = sphpa_particles_column(p, "mpm_alpha");
    const double *alpha_u = sphpa_particles_column(p, "mpm_alpha_u");
    const double *del2 = sphpa_particles_column(p, "mpm_del2_u");
    double before[400], before_u[400];
    for (size_t i = 0; i < p->n; i++)
        before[p->id[i]] = alpha[i], before_u[p->id[i]] = alpha_u[i];
    gas_steps(g, 1);
    double rose = 0.0, fell = 0.0;
    for (size_t i = 0; i < p->n; i++) {
        double dt = 1e-3, h = (double)p->h[i], S = fmax(-(double)p->div_v[i], 0.0);
        double tau = h / (0.2 * ((double)p->c[i] + (double)p->mu_max[i]));
        double old = before[p->id[i]], old_u = before_u[p->id[i]];
        double rate = S * (1.0 - old) + (0.1 - old) / tau;
        double rate_u = 0.1 * h * fabs(del2[i]) / sqrt(p->u[i]) - old_u / tau;
        double stiff = dt * (S + 1.0 / tau); /* the step is implicit: off by this share */
        assert_near_abs(alpha[i] - old, dt * rate, dt * fabs(rate) * 1.5 * stiff + 1e-15);
        if (alpha_u[i] < 1.0)
            assert_near_abs(alpha_u[i] - old_u, dt * rate_u, dt * fabs(rate_u) * 1.5 * stiff + 1e-15);
        rose = fmax(rose, alpha[i] - old), fell = fmin(fell, alpha[i] - old);
    }
    if (!(rose > 1e-3 && fell < -1e-3)) fail_msg("%g %g", rose, fell);
    gas_free(g);
}

/* the Laplacian of a smooth u */
static void mpm_sees_where_u_bends(void **state) {
    (void)state;
    gas_scene *g = gas_new(MPM, 2, 1.4, 0.0, 1.0);
    for (int k = 0; k < 60 * 60; k++) {
        double x[3] = {(k % 60 + 0.5) / 60.0, (k / 60 + 0.5) / 60.0, 0.0};
        size_t i = gas_add(g, x, 1.0 / 3600.0, 1.0, 1.0);
        g->p.u[i] = 2.0 + sin(2.0 * PI * x[0]) * cos(2.0 * PI * x[1]);
    }
    g->params.gas.eta = 1.5;
    gas_start(g);
    free(gas_rates(g));
    const double *del2 = sphpa_particles_column(&g->sim.p, "mpm_del2_u");
    for (size_t i = 0; i < g->sim.p.n; i++) /* of the second order in 2 pi h: 2.7 % */
        assert_near_abs(del2[i], -8.0 * PI * PI * (g->sim.p.u[i] - 2.0), 8.0 * PI * PI * 0.03);
    gas_free(g);
}

/* ---- what is conserved ----------------------------------------------------------------------- */

static void momentum_and_energy_are_conserved(void **state) {
    (void)state;
    for (int dim = 1; dim <= 3; dim++)
        for (int rk2 = 0; rk2 < 2; rk2++)
            for (int variant = 0; variant < 9; variant++) {
                if (SMALL && (dim + rk2 + variant) % 2) continue;
                if (dim == 3 && variant > 1 && variant < 6) continue;
                static const scheme_kind kinds[9] = {GSPH, GSPH, GSPH, GSPH, GSPH,
                                                     GSPH, ADKE, MPM,  GSPH};
                gas_scene *g = gas_mess(kinds[variant], dim, dim == 1 ? 80 : dim == 2 ? 26 : 11, 1,
                                        (uint64_t)variant);
                sphpa_godunov_params *god = &g->params;
                g->options.integrator = rk2 ? SPHPA_RK2 : SPHPA_PREDICTOR_CORRECTOR;
                god->gas.eta = 1.2;
                if (dim == 3) g->options.kernel = SPHPA_KERNEL_CUBIC; /* shorter */
                god->own_h = variant == 1 || variant == 2;
                god->pilot = variant == 2 ? -1.0 : 1.5;
                god->volume = variant == 3 ? SPHPA_GODUNOV_CUBIC : SPHPA_GODUNOV_LINEAR;
                god->slopes = variant == 4 ? SPHPA_GODUNOV_INUTSUKA : SPHPA_GODUNOV_MIDDLE;
                god->riemann = variant == 5 ? SPHPA_RIEMANN_HLLC : SPHPA_RIEMANN_EXACT;
                god->wide = variant == 5 && dim == 1;
                god->g1 = variant == 0 || variant == 6 ? 0.25 : 0.0;
                god->g2 = 2.0 * god->g1;
                if (variant == 8) by_number(g);
                gas_start(g);
                sphpa_totals before = sphpa_sim_totals(&g->sim);
                gas_steps(g, dim == 3 ? 5 : 12);
                assert_conserved(&g->sim, &before);
                gas_free(g);
            }
}

/* Dense gas beside thin gas on one lattice, P the same: by number both have their densities and h, and
   nothing moves; with m_j the thin gas is told to be dense, and flies off. */
static void dense_and_thin_gas_side_by_side(void **state) {
    (void)state;
    for (int number = 0; number < 2; number++) {
        gas_scene *g = gas_new(GSPH, 2, 1.4, 0.0, 1.0);
        for (int k = 0; k < 24 * 24; k++) {
            double x[3] = {(k % 24 + 0.5) / 24.0, (k / 24 + 0.5) / 24.0, 0.0};
            double rho = k % 24 < 12 ? 816.0 : 1.0;
            (void)gas_add(g, x, rho / 576.0, rho, 1.0);
        }
        g->params.gas.eta = 1.5;
        g->params.lattice = 1;
        g->params.by_number = number;
        gas_start(g);
        gas_steps(g, 15);
        double worst = 0.0, fastest = 0.0;
        for (size_t i = 0; i < g->sim.p.n; i++) {
            worst = fmax(worst, fabs(g->sim.p.rho[i] / (576.0 * (double)g->sim.p.m[i]) - 1.0));
            worst = fmax(worst, fabs((double)g->sim.p.h[i] / (1.5 / 24.0) - 1.0));
            fastest = fmax(fastest, fabs((double)g->sim.p.v[3 * i]));
        }
        if (number) {
            assert_near_abs(worst, 0.0, FINE(1e-13, 100 * FLOAT_ROUNDING));
            assert_near_abs(fastest, 0.0, FINE(7e-13, 3600 * FLOAT_ROUNDING)); /* light m */
        } else {
            assert_true(worst > 100.0 && fastest > 0.1);
        }
        gas_free(g);
    }
}

/* equal particles on a lattice: no force, in any frame */
static void a_uniform_gas_stays_as_it_is(void **state) {
    (void)state;
    for (int kind = GSPH; kind <= (int)MPM; kind++)
        for (int moving = 0; moving < 2; moving++) {
            gas_scene *g = gas_new((scheme_kind)kind, 2, 1.4, 0.0, 1.0);
            for (int k = 0; k < 24 * 24; k++) {
                double x[3] = {(k % 24 + 0.5) / 24.0, (k / 24 + 0.5) / 24.0, 0.0};
                size_t i = gas_add(g, x, 1.0 / 576.0, 1.0, 1.0);
                if (moving) g->p.v[3 * i] = SPHPA_R(2.0), g->p.v[3 * i + 1] = SPHPA_R(-1.0);
            }
            gas_start(g);
            gas_steps(g, 15);
            for (size_t i = 0; i < g->sim.p.n; i++) {
                double tolerance = FINE(2e-14, 400 * FLOAT_ROUNDING);
                assert_near_abs((double)g->sim.p.v[3 * i], moving ? 2.0 : 0.0, tolerance);
                assert_near_abs((double)g->sim.p.v[3 * i + 1], moving ? -1.0 : 0.0, tolerance);
                assert_near(g->sim.p.u[i], 2.5, tolerance);
            }
            gas_free(g);
        }
}

static void a_moving_frame_sees_the_same(void **state) {
    (void)state;
    for (int kind = GSPH; kind <= (int)MPM && !IS_FLOAT; kind++) {
        double rho[2][576], v[2][576], u[2][576];
        for (int moving = 0; moving < 2; moving++) {
            gas_scene *g = gas_mess((scheme_kind)kind, 2, 24, 1, 2);
            g->options.dt_fixed = 1e-3;
            for (size_t i = 0; i < g->p.n && moving; i++)
                g->p.v[3 * i] = (sphpa_real)((double)g->p.v[3 * i] + 7.0);
            gas_start(g);
            gas_steps(g, 20);
            for (size_t i = 0; i < g->sim.p.n; i++) {
                int64_t id = g->sim.p.id[i];
                rho[moving][id] = g->sim.p.rho[i];
                u[moving][id] = g->sim.p.u[i];
                v[moving][id] = (double)g->sim.p.v[3 * i] - (moving ? 7.0 : 0.0);
            }
            gas_free(g);
        }
        for (int i = 0; i < 576; i++) {
            assert_near(rho[1][i], rho[0][i], 1e-11);
            assert_near(u[1][i], u[0][i], 1e-11);
            assert_near_abs(v[1][i], v[0][i], 1e-11);
        }
    }
}

/* ---- shocks ---------------------------------------------------------------------------------- */

/* particles of equal mass, or equally far apart, left on [-0.5, 0], right on [0, 0.5], and their
   mirror image on [0.5, 1.5] */
static gas_scene *tube(scheme_kind kind, const sphpa_riemann_state *l, const sphpa_riemann_state *r,
                       int left, int right, double eta) {
    gas_scene *g = gas_new(kind, 1, 1.4, -0.5, 1.5);
    g->params.gas.eta = eta;
    for (int half = 0; half < 2; half++)
        for (int k = 0; k < left + right; k++) {
            const sphpa_riemann_state *s = k < left ? l : r;
            double d = 0.5 / (k < left ? left : right);
            double x[3] = {k < left ? -0.5 + (k + 0.5) * d : (k - left + 0.5) * d, 0.0, 0.0};
            if (half) x[0] = 1.0 - x[0];
            size_t i = gas_add(g, x, s->rho * d, s->rho, s->P);
            g->p.h[i] = (sphpa_real)(eta * d);
        }
    return g;
}

/* mean of |q - exact| of rho, v, P over the particles of [-0.5, 0.5] */
static void tube_error(const gas_scene *g, const sphpa_riemann_state *l,
                       const sphpa_riemann_state *r, double error[3]) {
    const sphpa_particles *p = &g->sim.p;
    sphpa_riemann_star star = {0};
    sphpa_riemann_state exact = {0.0, 0.0, 0.0};
    size_t count = 0;
    error[0] = error[1] = error[2] = 0.0;
    assert_int_equal(sphpa_riemann_exact(1.4, l, r, &star), SPHPA_OK);
    for (size_t i = 0; i < p->n; i++) {
        if (p->x[3 * i] > 0.5) continue;
        assert_int_equal(sphpa_riemann_sample(1.4, l, r, &star, p->x[3 * i] / g->sim.time, &exact),
                         SPHPA_OK);
        error[0] += fabs(p->rho[i] - exact.rho);
        error[1] += fabs((double)p->v[3 * i] - exact.v);
        error[2] += fabs((double)p->P[i] - exact.P);
        count++;
    }
    for (int k = 0; k < 3; k++) error[k] /= (double)count;
}

static const sphpa_riemann_state sod_l = {1.0, 0.0, 1.0}, sod_r = {0.125, 0.0, 0.1};

static void sod_converges_to_the_exact_solution(void **state) {
    /* measured with 320 + 40 particles; a bound is 1.3 times that */
    static const double at_most[3][3] = {
        {0.0033, 0.0058, 0.0032}, {0.0098, 0.024, 0.0118}, {0.0073, 0.018, 0.0086}};
    (void)state;
    for (int kind = GSPH; kind <= (int)MPM; kind++) {
        double error[3][3];
        for (int k = 0; k < 3; k++) {
            gas_scene *g = tube((scheme_kind)kind, &sod_l, &sod_r, 80 << k, 10 << k, 1.5);
            gas_start(g);
            sphpa_totals before = sphpa_sim_totals(&g->sim);
            gas_run(g, 0.15);
            tube_error(g, &sod_l, &sod_r, error[k]);
            assert_conserved(&g->sim, &before);
            gas_free(g);
        }
        for (int q = 0; q < 3; q++) {
            if (!(error[2][q] < at_most[kind][q])) fail_msg("%d %d: %g", kind, q, error[2][q]);
            double order = log2(error[0][q] / error[2][q]) / 2.0; /* a shock allows 1 */
            if (!(order > 0.7 && order < 1.3)) fail_msg("%d %d: order %g", kind, q, order);
        }
    }
}

static void every_riemann_solver_and_slope_has_its_error(void **state) {
    /* rho with exact, van Leer, HLLC, strong; then the other slopes: measured, times 1.2 */
    static const double solver[4] = {0.0030, 0.0030, 0.0030, 0.0030};
    static const double slopes[4] = {0.0030, 0.0039, 0.0043, 0.0090};
    double exact = 0.0;
    (void)state;
    for (int k = 0; k < 8; k += SMALL ? 3 : 1) {
        double error[3], bound = k < 4 ? solver[k] : slopes[k - 4];
        gas_scene *g = tube(GSPH, &sod_l, &sod_r, 320, 40, 1.5);
        g->params.riemann = k < 4 ? k : 0;
        g->params.slopes = k < 4 ? 0 : k - 4;
        gas_start(g);
        gas_run(g, 0.15);
        tube_error(g, &sod_l, &sod_r, error);
        if (!(error[0] < bound && error[0] > 0.5 * bound)) fail_msg("%d: %g", k, error[0]);
        if (k == 0) exact = error[0];
        else if (k != 4) assert_true(fabs(error[0] - exact) > 1e-9); /* they are not the same */
        gas_free(g);
    }
}

/* h is that of (1) after a step whose turn it was, not otherwise: it follows div v */
static void h_is_renewed_as_often_as_asked(void **state) {
    (void)state;
    for (int every = 0; every <= 3; every++) {
        gas_scene *g = gas_mess(GSPH, 2, 16, 1, 4);
        g->params.pilot_every = every;
        g->options.dt_fixed = 2e-4;
        gas_start(g);
        for (int step = 0; step < 9; step++) {
            sphpa_particles *p = &g->sim.p;
            double near = HUGE_VAL, far = 0.0;
            for (size_t i = 0; i < p->n; i++) p->h[i] = (sphpa_real)0.14; /* far from (1) */
            gas_steps(g, 1);
            for (size_t i = 0; i < p->n; i++) {
                near = fmin(near, fabs((double)p->h[i] / 0.14 - 1.0));
                far = fmax(far, fabs((double)p->h[i] / 0.14 - 1.0));
            }
            bool due = step % (every > 0 ? every : 4) == 0;
            if (due ? !(near > 0.02) : !(far < 0.01))
                fail_msg("every %d, step %d: h off by %g to %g", every, step, near, far);
        }
        gas_free(g);
    }
}

/* 1e5 : 1 in pressure; by default and with the options that are sharpest */
static void a_blast_has_the_right_shock(void **state) {
    static const sphpa_riemann_state l = {1.0, 0.0, 1000.0}, r = {1.0, 0.0, 0.01};
    static const double at_most[2][3] = {{0.042, 0.078, 3.2}, {0.031, 0.084, 2.8}};
    (void)state;
    for (int sharp = 0; sharp < (SMALL ? 1 : 2); sharp++) { /* bounds: 1.2 times measured, but for 0.031 */
        double error[3];
        gas_scene *g = tube(GSPH, &l, &r, 200, 200, sharp ? 1.15 : 1.2);
        if (sharp) {
            g->options.kernel = SPHPA_KERNEL_QUARTIC;
            g->params.pilot = 1.6;
            g->params.pilot_every = 1;
            g->params.volume = SPHPA_GODUNOV_CUBIC;
        }
        gas_start(g);
        gas_run(g, 0.0075);
        tube_error(g, &l, &r, error);
        for (int q = 0; q < 3; q++)
            if (!(error[q] < at_most[sharp][q])) fail_msg("%d %d: %g", sharp, q, error[q]);
        gas_free(g);
    }
}

/* the tube is its own mirror image about 0.5 */
static void mirror_images_stay_so(void **state) {
    (void)state;
    for (int kind = GSPH; kind <= (int)MPM; kind++) {
        gas_scene *g = tube((scheme_kind)kind, &sod_l, &sod_r, 160, 20, 1.5);
        double x[360], v[360], u[360];
        gas_start(g);
        gas_run(g, 0.02);
        for (size_t i = 0; i < g->sim.p.n; i++) {
            int64_t id = g->sim.p.id[i];
            x[id] = g->sim.p.x[3 * i];
            v[id] = (double)g->sim.p.v[3 * i];
            u[id] = g->sim.p.u[i];
        }
        for (int i = 0; i < 180; i++) {
            assert_near_abs(x[i] + x[180 + i], 1.0, FINE(1e-13, 1e-5));
            assert_near_abs(v[i], -v[180 + i], FINE(2e-12, 1e-4));
            assert_near(u[i], u[180 + i], FINE(2e-12, 1e-4));
        }
        gas_free(g);
    }
}

/* a charge of 816 times the density, as heavy particles on the same lattice, 5e6 times the pressure,
   of a gas at the pressure P */
static void charge(double P, int steps) {
    gas_scene *g = gas_new(GSPH, 2, 1.4, 0.0, 1.0);
    g->params.gas.eta = 1.5;
    g->params.g1 = 0.25;
    g->params.g2 = 0.5;
    for (int k = 0; k < 36 * 36; k++) {
        double x[3] = {(k % 36 + 0.5) / 36.0, (k / 36 + 0.5) / 36.0, 0.0};
        bool in = hypot(x[0] - 0.5, x[1] - 0.5) < 0.1;
        gas_add(g, x, (in ? 816.0 : 1.0) / 1296.0, in ? 816.0 : 1.0, in ? 5e6 * P : P);
    }
    gas_start(g);
    sphpa_totals before = sphpa_sim_totals(&g->sim);
    gas_steps(g, steps);
    assert_conserved(&g->sim, &before);
    double least = HUGE_VAL, fastest = 0.0;
    for (size_t i = 0; i < g->sim.p.n; i++) {
        least = fmin(least, g->sim.p.rho[i]);
        fastest = fmax(fastest, hypot((double)g->sim.p.v[3 * i], (double)g->sim.p.v[3 * i + 1]));
    }
    assert_true(least > 0.0);
    assert_true(fastest > sqrt(5e6 * P / 816.0)); /* it goes off */
    gas_free(g);
}

static void charges_of_every_strength_go_off(void **state) {
    (void)state;
    charge(1.0, SMALL ? 40 : 80);
    charge(1e-5, SMALL ? 40 : 80);
    if (!SMALL) charge(102e3, 80);
}

/* ---- bits and errors ------------------------------------------------------------------------- */

static void threads_give_the_same_bits(void **state) {
    (void)state;
    for (int kind = GSPH; kind <= (int)MPM; kind++) {
        static double first[3][2025 * 8];
        for (int k = 0; k < 3; k++) {
            set_threads(1 << k);
            gas_scene *g = gas_mess((scheme_kind)kind, 2, 45, 1, 12); /* several chunks and blocks */
            g->params.g1 = 0.25;
            gas_start(g);
            gas_steps(g, 8);
            for (size_t i = 0; i < g->sim.p.n; i++) {
                double *to = first[k] + 8 * (size_t)g->sim.p.id[i];
                for (size_t a = 0; a < 2; a++) {
                    to[a] = g->sim.p.x[3 * i + a];
                    to[2 + a] = (double)g->sim.p.v[3 * i + a];
                }
                to[4] = g->sim.p.rho[i];
                to[5] = g->sim.p.u[i];
                to[6] = (double)g->sim.p.h[i];
                to[7] = (double)i;
            }
            gas_free(g);
            assert_memory_equal(first[0], first[k], sizeof first[0]);
        }
    }
    set_threads(1);
}

static void refused(gas_scene *g, sphpa_result result, const char *why) {
    sphpa_error err;
    assert_int_equal(gas_try(g, &err), result);
    if (strstr(err.message, why) == NULL) fail_msg("\"%s\" has no \"%s\"", err.message, why);
    gas_free(g);
}

static gas_scene *small(scheme_kind kind) { return gas_mess(kind, 1, 12, 1, 1); }

static void bad_parameters_are_refused(void **state) {
    (void)state;
    gas_scene *g = small(GSPH);
    g->params.gas.eos = NULL;
    refused(g, SPHPA_ERROR_MISSING, "equation of state");
    static const sphpa_tillotson *rock;
    rock = sphpa_tillotson_find("basalt");
    g = small(GSPH);
    g->eos = sphpa_tillotson_eos(rock);
    refused(g, SPHPA_ERROR_MISSING, "ideal gas");
    g = small(GSPH);
    g->gas.gamma = 1.0;
    refused(g, SPHPA_ERROR_RANGE, "gamma");
    g = small(GSPH);
    g->params.riemann = 4;
    refused(g, SPHPA_ERROR_UNKNOWN, "riemann = 4");
    g = small(GSPH);
    g->params.slopes = -1;
    refused(g, SPHPA_ERROR_UNKNOWN, "slopes = -1");
    g = small(GSPH);
    g->params.volume = 3;
    refused(g, SPHPA_ERROR_UNKNOWN, "volume = 3");
    g = small(GSPH);
    g->params.pilot = 0.5;
    refused(g, SPHPA_ERROR_RANGE, "pilot = 0.5");
    g = small(GSPH);
    g->params.pilot = -1.0;
    refused(g, SPHPA_ERROR_RANGE, "own_h");
    g = small(GSPH);
    g->params.pilot = (double)NAN;
    refused(g, SPHPA_ERROR_NOT_FINITE, "pilot");
    g = small(GSPH);
    g->params.g1 = -0.1;
    refused(g, SPHPA_ERROR_RANGE, "g1");
    g = small(GSPH);
    g->params.g2 = (double)NAN;
    refused(g, SPHPA_ERROR_NOT_FINITE, "g2");
    g = small(GSPH);
    g->params.pilot_every = -1;
    refused(g, SPHPA_ERROR_RANGE, "pilot_every = -1");
    g = small(ADKE);
    g->params.k = -1.0;
    refused(g, SPHPA_ERROR_RANGE, "k = -1");
    g = small(ADKE);
    g->params.eps = 1.5;
    refused(g, SPHPA_ERROR_RANGE, "eps = 1.5");
    g = small(ADKE);
    g->params.eps = (double)NAN;
    refused(g, SPHPA_ERROR_RANGE, "eps");
    g = small(MPM);
    g->params.sigma = -0.1;
    refused(g, SPHPA_ERROR_RANGE, "sigma");
    g = small(MPM);
    g->params.gas.conduction = 0.5;
    refused(g, SPHPA_ERROR_RANGE, "conduction");
}

/* a gas that is nowhere to be found: not silently another one */
static void what_goes_bad_is_told(void **state) {
    (void)state;
    sphpa_error err;
    gas_scene *g = gas_mess(GSPH, 2, 12, 1, 1);
    gas_start(g);
    gas_steps(g, 1);
    g->sim.p.v[3 * 17] = (sphpa_real)NAN;
    assert_int_equal(sphpa_sim_step(&g->sim, HUGE_VAL, &err), SPHPA_ERROR_STATE);
    gas_free(g);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(forces_and_heat_are_those_of_all_pairs),
        cmocka_unit_test(forces_do_not_depend_on_how_pairs_are_met),
        cmocka_unit_test(ghosts_are_met_and_meet_nobody),
        cmocka_unit_test(slopes_of_linear_fields_are_exact),
        cmocka_unit_test(slopes_of_the_density_are_those_of_all_pairs),
        cmocka_unit_test(pilot_densities_are_those_of_all_pairs),
        cmocka_unit_test(h_is_eta_spacings),
        cmocka_unit_test(adke_widens_kernels_where_it_is_thin),
        cmocka_unit_test(adke_and_mpm_are_those_of_all_pairs),
        cmocka_unit_test(mpm_switches_rise_and_decay),
        cmocka_unit_test(mpm_sees_where_u_bends),
        cmocka_unit_test(momentum_and_energy_are_conserved),
        cmocka_unit_test(dense_and_thin_gas_side_by_side),
        cmocka_unit_test(a_uniform_gas_stays_as_it_is),
        cmocka_unit_test(a_moving_frame_sees_the_same),
        cmocka_unit_test(sod_converges_to_the_exact_solution),
        cmocka_unit_test(every_riemann_solver_and_slope_has_its_error),
        cmocka_unit_test(h_is_renewed_as_often_as_asked),
        cmocka_unit_test(a_blast_has_the_right_shock),
        cmocka_unit_test(mirror_images_stay_so),
        cmocka_unit_test(charges_of_every_strength_go_off),
        cmocka_unit_test(threads_give_the_same_bits),
        cmocka_unit_test(bad_parameters_are_refused),
        cmocka_unit_test(what_goes_bad_is_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
