/* Gas dynamics against exact answers: Sod, sound, adiabatic waves, switches, conserved sums. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sphpa.h"

#include "near.h"

#define PI 3.14159265358979323846

/* ---- helpers --------------------------------------------------------------------------------- */

/* a gas and all that a simulation of it points to */
typedef struct gas_scene {
    sphpa_ideal gas;
    sphpa_eos eos;
    sphpa_gas_params params;
    sphpa_sim_options options;
    sphpa_particles p;
    sphpa_sim sim;
} gas_scene;

static gas_scene *gas_new(int dim, double gamma, double low, double high) {
    gas_scene *g = (gas_scene *)calloc(1, sizeof *g);
    g->gas.gamma = gamma;
    g->eos = sphpa_ideal_eos(&g->gas);
    g->params.eos = &g->eos;
    g->params.materials = 1;
    for (int a = 0; a < dim; a++) {
        g->options.box.low[a] = low;
        g->options.box.high[a] = high;
        g->options.box.periodic[a] = 1;
    }
    assert_int_equal(sphpa_particles_create(&g->p, dim, 0, 0, 0, NULL, 0, NULL), SPHPA_OK);
    return g;
}

static size_t gas_add(gas_scene *g, double x, double y, double z, double m, double rho, double u) {
    size_t i = 0;
    assert_int_equal(sphpa_particles_add(&g->p, 1, &i, NULL), SPHPA_OK);
    g->p.x[3 * i] = x;
    g->p.x[3 * i + 1] = y;
    g->p.x[3 * i + 2] = z;
    g->p.m[i] = (sphpa_real)m;
    g->p.rho[i] = rho;
    g->p.u[i] = u;
    g->p.h[i] = (sphpa_real)(1.2 * pow(m / rho, 1.0 / g->p.dim));
    return i;
}

static void gas_start(gas_scene *g) {
    sphpa_scene scene;
    sphpa_error err;
    memset(&scene, 0, sizeof scene);
    assert_int_equal(sphpa_scene_add(&scene, sphpa_gas(&g->params)), SPHPA_OK);
    if (sphpa_sim_create(&g->sim, &scene, &g->p, &g->options, &err) != SPHPA_OK)
        fail_msg("%s", err.message);
}

static void gas_run(gas_scene *g, double t_end) {
    sphpa_run run;
    sphpa_error err;
    memset(&run, 0, sizeof run);
    run.t_end = t_end;
    if (sphpa_sim_run(&g->sim, &run, &err) != SPHPA_OK) fail_msg("%s", err.message);
    if (sphpa_sim_refresh(&g->sim, &err) != SPHPA_OK) fail_msg("%s", err.message);
}

static void gas_step(gas_scene *g) {
    sphpa_error err;
    if (sphpa_sim_step(&g->sim, HUGE_VAL, &err) != SPHPA_OK) fail_msg("%s", err.message);
}

static void gas_free(gas_scene *g) {
    sphpa_sim_free(&g->sim);
    sphpa_particles_free(&g->p);
    free(g);
}

static size_t index_of(const sphpa_particles *p, int64_t id) {
    for (size_t i = 0; i < p->n; i++)
        if (p->id[i] == id) return i;
    fail_msg("no particle has the id %d", (int)id);
    return 0;
}

/* total energy to rounding, momentum too, against what the particles carry */
static void assert_conserved(const sphpa_sim *sim, const sphpa_totals *before) {
    sphpa_totals now = sphpa_sim_totals(sim);
    double scale = sqrt(2.0 * before->energy * before->mass); /* [kg m/s] */
    assert_near(now.mass, before->mass, 1e-15);
    double walk = float_walk(sim->stats.steps, sim->p.n);
    assert_near(now.energy, before->energy, FINE(1e-12, walk));
    for (int a = 0; a < 3; a++)
        assert_near_abs(now.momentum[a], before->momentum[a], FINE(1e-13, walk) * scale);
}

/* n at random, jittered from a lattice of k^dim in [0, 1]^dim, hot and cold, dense and thin */
static gas_scene *gas_mess(int dim, int k, uint64_t seed) {
    gas_scene *g = gas_new(dim, 5.0 / 3.0, 0.0, 1.0);
    sphpa_rng rng = sphpa_rng_seed(seed, 3);
    int ky = dim > 1 ? k : 1, kz = dim > 2 ? k : 1;
    for (int a = 0; a < k; a++)
        for (int b = 0; b < ky; b++)
            for (int c = 0; c < kz; c++) {
                double x[3] = {(double)a, (double)b, (double)c};
                for (int d = 0; d < dim; d++) {
                    double s = (x[d] + 0.5 + 0.3 * (sphpa_rng_uniform(&rng) - 0.5)) / k;
                    x[d] = s + 0.4 * sin(2.0 * PI * s) / (2.0 * PI); /* dense here, thin there */
                }
                double m = pow(1.0 / k, dim) * (0.8 + 0.4 * sphpa_rng_uniform(&rng));
                size_t i = gas_add(g, x[0], x[1], x[2], m, 1.0, 0.5 + sphpa_rng_uniform(&rng));
                for (size_t d = 0; d < (size_t)dim; d++)
                    g->p.v[3 * i + d] = (sphpa_real)(0.6 * sphpa_rng_uniform(&rng) - 0.3);
            }
    return g;
}

/* ---- Sod ------------------------------------------------------------------------------------- */

/* mean of |q - exact| of rho, v, P over the particles of [0, 1] at t = 0.15; a mirrored tube */
static void sod(int left, int integrator, double conduction, double error[3]) {
    gas_scene *g = gas_new(1, 1.4, -1.0, 1.0);
    g->options.integrator = (sphpa_integrator)integrator;
    g->params.conduction = conduction;
    double spacing = 0.5 / left;
    for (int k = 0; k < 2 * left; k++)
        gas_add(g, -0.5 + (k + 0.5) * spacing, 0, 0, spacing, 1.0, 2.5);
    for (int k = 0; k < left / 4; k++) {
        double x = 0.5 + 8.0 * spacing * (k + 0.5);
        gas_add(g, x > 1.0 ? x - 2.0 : x, 0, 0, spacing, 0.125, 2.0);
    }
    gas_start(g);
    sphpa_totals before = sphpa_sim_totals(&g->sim);
    const double t = 0.15;
    gas_run(g, t);
    assert_conserved(&g->sim, &before);
    sphpa_riemann_state l = {1.0, 0.0, 1.0}, r = {0.125, 0.0, 0.1}, q;
    sphpa_riemann_star star;
    assert_int_equal(sphpa_riemann_exact(1.4, &l, &r, &star), SPHPA_OK);
    int count = 0;
    error[0] = error[1] = error[2] = 0.0;
    for (size_t i = 0; i < g->sim.p.n; i++) {
        double x = g->sim.p.x[3 * i];
        if (x < 0.0 || x > 1.0) continue;
        assert_int_equal(sphpa_riemann_sample(1.4, &l, &r, &star, (x - 0.5) / t, &q), SPHPA_OK);
        error[0] += fabs(g->sim.p.rho[i] - q.rho);
        error[1] += fabs((double)g->sim.p.v[3 * i] - q.v);
        error[2] += fabs((double)g->sim.p.P[i] - q.P);
        count++;
    }
    for (int k = 0; k < 3; k++) error[k] /= count;
    gas_free(g);
}

static void sod_converges_to_the_exact_solution(void **state) {
    (void)state;
    double coarse[3], middle[3], fine[3], rk2[3];
    sod(80, SPHPA_PREDICTOR_CORRECTOR, 0.0, coarse);
    sod(160, SPHPA_PREDICTOR_CORRECTOR, 0.0, middle);
    sod(320, SPHPA_PREDICTOR_CORRECTOR, 0.0, fine);
    sod(160, SPHPA_RK2, 0.0, rk2);
    print_message("L1 of Sod (rho, v, P): 80+10 %.5f %.5f %.5f; 160+20 %.5f %.5f %.5f; "
                  "320+40 %.5f %.5f %.5f\n", coarse[0], coarse[1], coarse[2], middle[0], middle[1],
                  middle[2], fine[0], fine[1], fine[2]);
    for (int k = 0; k < 3; k++) { /* shocks: first order, contacts: less */
        double order = 0.5 * log2(coarse[k] / fine[k]);
        assert_true(order > 0.7 && order < 1.4);
        assert_true(middle[k] < coarse[k] && fine[k] < middle[k]);
        assert_near(middle[k], rk2[k], 0.02);
    }
    /* better than PySPH's GSPH with as many particles: .00759, .0142, .00515 (blast.md) */
    assert_true(fine[0] < 0.00759 && fine[1] < 0.0142 && fine[2] < 0.00515);
}

/* ---- density --------------------------------------------------------------------------------- */

static void density_and_h_solve_their_equation(void **state) {
    (void)state;
    const int sides[3] = {200, 30, 11};
    const double edge = FINE(1e-9, 2.0 * FLOAT_ROUNDING); /* so near, a neighbour may be in or out */
    for (int dim = 1; dim <= 3; dim++)
        for (int k = 0; k < (int)SPHPA_KERNEL_COUNT; k += 2) {
            gas_scene *g = gas_mess(dim, sides[dim - 1], 5);
            g->options.kernel = (sphpa_kernel)k;
            g->params.eta = 1.1;
            g->params.h_tol = 1e-10;
            for (size_t i = 0; i < g->p.n; i++) /* bad guesses */
                g->p.h[i] *= (sphpa_real)(i % 3 ? 0.4 : 1.3);
            gas_start(g);
            assert_int_equal(sphpa_sim_refresh(&g->sim, NULL), SPHPA_OK);
            const sphpa_particles *p = &g->sim.p;
            for (size_t i = 0; i < p->n; i += 7) {
                double rho = 0.0, slope = 0.0, h = (double)p->h[i], m = (double)p->m[i];
                double support = h * sphpa_kernel_support(g->options.kernel);
                double jump = 0.0, slope_jump = 0.0;
                for (size_t j = 0; j < p->n; j++) {
                    double r = 0.0;
                    for (size_t a = 0; a < 3; a++)
                        r += pow(remainder(p->x[3 * i + a] - p->x[3 * j + a], 1.0), 2.0);
                    r = sqrt(r);
                    /* the Gaussian ends in a jump: as h grows past a neighbour, rho leaps over the
                       root, and h stays there */
                    if (fabs(r - support) < edge * support) {
                        double in = support * (1.0 - edge);
                        jump += (double)p->m[j] * sphpa_kernel_w(g->options.kernel, dim, in, h);
                        slope_jump += (double)p->m[j]
                                      * fabs(sphpa_kernel_dw_dh(g->options.kernel, dim, in, h));
                    }
                    if (r >= support) continue;
                    rho += (double)p->m[j] * sphpa_kernel_w(g->options.kernel, dim, r, h);
                    slope += (double)p->m[j] * sphpa_kernel_dw_dh(g->options.kernel, dim, r, h);
                }
                /* in float the coordinates are rounded, relative to the group, then each term, and
                   a sum of a hundred is a walk of ten more; h is rounded after the sum */
                assert_near(p->rho[i], rho, FINE(1e-12, 24.0 * FLOAT_ROUNDING + jump / rho));
                assert_near(h, 1.1 * pow(m / p->rho[i], 1.0 / dim),
                            FINE(1e-12, 24.0 * FLOAT_ROUNDING) + jump / (dim * rho));
                assert_near((double)p->omega[i], 1.0 + h * slope / (dim * rho),
                            FINE(1e-6, 3e-6 + 2.0 * h * slope_jump / (dim * rho)));
            }
            gas_free(g);
        }
}

/* the default ends the search with a change of h by less than 3e-4 that no new sum has seen: rho is
   off by the square of that times rho's curvature in h, some ten */
static void the_default_search_for_h_ends_near_enough(void **state) {
    (void)state;
    double worst = 0.0;
    for (int k = 0; k < (int)SPHPA_KERNEL_COUNT; k++) {
        if (k == (int)SPHPA_KERNEL_GAUSSIAN) continue; /* its sums jump */
        gas_scene *g[2];
        for (int fine = 0; fine < 2; fine++) {
            g[fine] = gas_mess(3, 11, 9);
            g[fine]->options.kernel = (sphpa_kernel)k;
            g[fine]->params.h_tol = fine ? 1e-12 : 0.0;
            for (size_t i = 0; i < g[fine]->p.n; i++) /* guesses of all sizes */
                g[fine]->p.h[i] *= (sphpa_real)(1.0 + 1e-4 * ((double)(i % 601) - 300.0));
            gas_start(g[fine]);
            assert_int_equal(sphpa_sim_refresh(&g[fine]->sim, NULL), SPHPA_OK);
        }
        for (size_t i = 0; i < g[0]->sim.p.n; i++) {
            assert_int_equal(g[0]->sim.p.id[i], g[1]->sim.p.id[i]);
            double off = fabs(g[0]->sim.p.rho[i] / g[1]->sim.p.rho[i] - 1.0);
            worst = fmax(worst, off);
            assert_near_abs(off, 0.0, FINE(1e-6, 24.0 * FLOAT_ROUNDING));
        }
        for (int fine = 0; fine < 2; fine++) gas_free(g[fine]);
    }
    printf("# rho with the default h_tol is off by %.1e at most\n", worst);
    assert_true(worst > 1e-12); /* it is the default that was looked at */
}

static void h_max_keeps_lone_particles_alone(void **state) {
    (void)state;
    gas_scene *g = gas_new(3, 1.4, 0.0, 1.0);
    memset(&g->options.box, 0, sizeof g->options.box);
    g->params.h_max = 0.3;
    for (int k = 0; k < 27; k++)
        gas_add(g, 0.1 * (k % 3), 0.1 * (k / 3 % 3), 0.1 * (k / 9), 1e-3, 1.0, 1.0);
    gas_add(g, 50.0, 0.0, 0.0, 1e-3, 1.0, 1.0);
    g->p.h[3] = (sphpa_real)0.9; /* one that begins above the bound */
    gas_start(g);
    assert_int_equal(sphpa_sim_refresh(&g->sim, NULL), SPHPA_OK);
    size_t lone = index_of(&g->sim.p, 27), other = index_of(&g->sim.p, 3);
    assert_near((double)g->sim.p.h[lone], 0.3, FINE(1e-15, FLOAT_ROUNDING));
    assert_near(g->sim.p.rho[lone], 1e-3 * sphpa_kernel_w(SPHPA_KERNEL_CUBIC, 3, 0.0, 0.3),
                FINE(1e-14, 4.0 * FLOAT_ROUNDING)); /* of m, and of h to the power -3 */
    assert_true(g->sim.p.omega[lone] == 1);
    assert_true((double)g->sim.p.h[other] <= 0.3 * (1.0 + 1e-6));
    for (int k = 0; k < 20; k++) gas_step(g); /* it stays where it is, the lump expands */
    lone = index_of(&g->sim.p, 27);
    assert_true(g->sim.p.x[3 * lone] == 50.0 && g->sim.p.v[3 * lone] == 0);
    gas_free(g);
    /* without the bound there is an error that names it, not an endless search */
    g = gas_new(1, 1.4, 0.0, 1.0);
    memset(&g->options.box, 0, sizeof g->options.box);
    gas_add(g, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0);
    gas_start(g);
    sphpa_error err;
    assert_int_equal(sphpa_sim_step(&g->sim, HUGE_VAL, &err), SPHPA_ERROR_STATE);
    assert_non_null(strstr(err.message, "particle 0"));
    assert_non_null(strstr(err.message, "h_max"));
    gas_free(g);
}

/* ---- conserved sums -------------------------------------------------------------------------- */

static void sums_are_conserved_where_h_varies(void **state) {
    (void)state;
    const int sides[3] = {150, 24, 9};
    for (int dim = 1; dim <= 3; dim++)
        for (int integrator = 0; integrator < 2; integrator++) {
            gas_scene *g = gas_mess(dim, sides[dim - 1], 9);
            g->options.integrator = (sphpa_integrator)integrator;
            g->options.kernel = (sphpa_kernel)(dim + integrator); /* also to 2.5 h and 3 h */
            g->params.viscosity.balsara = integrator;
            g->params.conduction = dim == 2 ? 1.0 : 0.0;
            gas_start(g);
            sphpa_totals before = sphpa_sim_totals(&g->sim);
            double low = HUGE_VAL, high = 0.0;
            for (int k = 0; k < 40; k++) gas_step(g);
            for (size_t i = 0; i < g->sim.p.n; i++) {
                low = fmin(low, (double)g->sim.p.h[i]);
                high = fmax(high, (double)g->sim.p.h[i]);
            }
            assert_true(high > 1.2 * low);
            assert_conserved(&g->sim, &before);
            sphpa_totals now = sphpa_sim_totals(&g->sim);
            assert_true(fabs(now.internal - before.internal) > 1e-4 * before.internal);
            gas_free(g);
        }
}

/* the pair force is the gradient of the summed internal energy: without viscosity dE = 0 also to
   first order in any displacement. Central difference of sum m u(rho(x)) at constant entropy. */
static double adiabatic_energy(gas_scene *g, const double *entropy) {
    double sum = 0.0;
    assert_int_equal(sphpa_sim_refresh(&g->sim, NULL), SPHPA_OK);
    for (size_t i = 0; i < g->sim.p.n; i++) {
        double rho = g->sim.p.rho[i];
        sum += (double)g->sim.p.m[i] * entropy[g->sim.p.id[i]] * pow(rho, g->gas.gamma - 1.0) /
               (g->gas.gamma - 1.0);
    }
    return sum;
}

static void forces_are_the_gradient_of_the_energy(void **state) {
    (void)state;
    if (sizeof(sphpa_real) == 4) return; /* differences of floats tell nothing */
    const int sides[3] = {60, 14, 8};
    for (int dim = 1; dim <= 3; dim++) {
        gas_scene *g = gas_mess(dim, sides[dim - 1], 21);
        g->params.viscosity.a = g->params.viscosity.b = -1.0;
        gas_start(g);
        assert_int_equal(sphpa_sim_refresh(&g->sim, NULL), SPHPA_OK);
        sphpa_particles *p = &g->sim.p;
        double *entropy = (double *)calloc(p->n, sizeof(double));
        for (size_t i = 0; i < p->n; i++) /* A = P/rho^gamma */
            entropy[p->id[i]] = (g->gas.gamma - 1.0) * p->u[i] * pow(p->rho[i], 1.0 - g->gas.gamma);
        double *a = (double *)calloc(3 * p->n, sizeof(double)), scale = 0.0;
        memset(p->v, 0, 3 * p->n * sizeof(sphpa_real));
        assert_int_equal(sphpa_sim_step(&g->sim, 1e-14, NULL), SPHPA_OK); /* a at these positions */
        for (size_t i = 0; i < p->n; i++)
            for (size_t d = 0; d < 3; d++) {
                a[3 * (size_t)p->id[i] + d] = (double)p->a[3 * i + d];
                scale = fmax(scale, fabs((double)p->a[3 * i + d]));
            }
        const double step = 1e-5;
        for (int64_t id = 0; id < (int64_t)p->n; id += (int64_t)p->n / 7)
            for (int d = 0; d < dim; d++) {
                size_t i = index_of(p, id);
                double x = p->x[3 * i + (size_t)d], E[2], m = (double)p->m[i];
                for (int side = 0; side < 2; side++) {
                    p->x[3 * index_of(p, id) + (size_t)d] = x + (side ? step : -step);
                    E[side] = adiabatic_energy(g, entropy);
                }
                p->x[3 * index_of(p, id) + (size_t)d] = x;
                double force = -(E[1] - E[0]) / (2.0 * step * m);
                assert_near_abs(a[3 * id + d], force, 2e-5 * scale);
            }
        free(entropy);
        free(a);
        gas_free(g);
    }
}

/* ---- the equations, once more ---------------------------------------------------------------- */

/* x_ij over the periodic edge of 1, its length; v_ij */
static double pair_of(const sphpa_particles *p, size_t i, size_t j, double x[3], double v[3]) {
    double r2 = 0.0;
    for (size_t a = 0; a < 3; a++) {
        x[a] = remainder(p->x[3 * i + a] - p->x[3 * j + a], 1.0);
        v[a] = (double)p->v[3 * i + a] - (double)p->v[3 * j + a];
        r2 += x[a] * x[a];
    }
    return sqrt(r2);
}

/* |div|/(|div| + |curl| + 1e-4 c/h), of sums over all particles */
static double switch_by_hand(const sphpa_sim *sim, size_t i) {
    const sphpa_particles *p = &sim->p;
    double h = (double)p->h[i], div = 0.0, curl[3] = {0.0, 0.0, 0.0}, size = 0.0;
    for (size_t j = 0; j < p->n; j++) {
        double x[3], v[3], r = pair_of(p, i, j, x, v);
        if (i == j) continue;
        double slope = (double)p->m[j] / p->rho[i] *
                       sphpa_kernel_dw(sim->options.kernel, p->dim, r, h) / r;
        for (int a = 0; a < 3; a++) {
            int b = (a + 1) % 3, c = (a + 2) % 3;
            div -= slope * v[a] * x[a];
            curl[a] -= slope * (x[b] * v[c] - x[c] * v[b]); /* grad W x v */
        }
    }
    for (int a = 0; a < 3; a++) size += curl[a] * curl[a];
    return fabs(div) / (fabs(div) + sqrt(size) + 1e-4 * (double)p->c[i] / h);
}

/* Pi_ij of a pair that approaches, with the means of h, c, rho and of the switch */
static double pi_by_hand(const gas_scene *g, size_t i, size_t j, double r, double vx) {
    const sphpa_particles *p = &g->sim.p;
    if (!(vx < 0.0)) return 0.0;
    double h = 0.5 * ((double)p->h[i] + (double)p->h[j]), mu = h * vx / (r * r + 0.01 * h * h);
    double c = 0.5 * ((double)p->c[i] + (double)p->c[j]);
    double f = 0.5 * ((double)p->balsara[i] + (double)p->balsara[j]);
    return f * (-g->params.viscosity.a * c * mu + g->params.viscosity.b * mu * mu) /
           (0.5 * (p->rho[i] + p->rho[j]));
}

/* (3) and (4) of i and the sums of their terms' sizes */
static void rates_by_hand(const gas_scene *g, size_t i, double a[3], double *du, double size[2]) {
    const sphpa_particles *p = &g->sim.p;
    sphpa_kernel kernel = g->options.kernel;
    memset(a, 0, 3 * sizeof *a);
    *du = size[0] = size[1] = 0.0;
    for (size_t j = 0; j < p->n; j++) {
        double x[3], v[3], r = pair_of(p, i, j, x, v);
        if (i == j) continue;
        double vx = (v[0] * x[0] + v[1] * x[1] + v[2] * x[2]) / r;
        double own = sphpa_kernel_dw(kernel, p->dim, r, (double)p->h[i]);
        double other = sphpa_kernel_dw(kernel, p->dim, r, (double)p->h[j]);
        double Pi = pi_by_hand(g, i, j, r, vx * r), m = (double)p->m[j];
        double mine = own * (double)p->P[i] / ((double)p->omega[i] * p->rho[i] * p->rho[i]);
        double its = other * (double)p->P[j] / ((double)p->omega[j] * p->rho[j] * p->rho[j]);
        double heat = m * vx * (mine + 0.25 * Pi * (own + other));
        *du += heat;
        size[1] += fabs(heat);
        for (int k = 0; k < 3; k++) {
            double force = -m * (mine + its + 0.5 * Pi * (own + other)) * x[k] / r;
            a[k] += force;
            size[0] += fabs(force);
        }
    }
}

/* neighbours of any mass, density, heat and speed, h changing from place to place */
static void forces_and_heat_by_hand(void **state) {
    (void)state;
    const int sides[3] = {60, 14, 9};
    for (int dim = 1; dim <= 3; dim++) {
        gas_scene *g = gas_mess(dim, sides[dim - 1], 21);
        g->options.kernel = dim == 2 ? SPHPA_KERNEL_WENDLAND_C2 : SPHPA_KERNEL_CUBIC;
        g->params.viscosity.a = 0.8;
        g->params.viscosity.b = 1.7;
        g->params.viscosity.balsara = 1;
        gas_start(g);
        assert_int_equal(sphpa_sim_step(&g->sim, 1e-13, NULL), SPHPA_OK);
        const sphpa_particles *p = &g->sim.p;
        double low = HUGE_VAL, high = 0.0;
        for (size_t i = 0; i < p->n; i += 7) {
            double a[3], du, size[2];
            rates_by_hand(g, i, a, &du, size);
            for (size_t k = 0; k < 3; k++)
                assert_near_abs((double)p->a[3 * i + k], a[k],
                                FINE(1e-10, 16.0 * FLOAT_ROUNDING) * size[0]);
            assert_near_abs((double)p->du[i], du, FINE(1e-10, 16.0 * FLOAT_ROUNDING) * size[1]);
            assert_near_abs((double)p->balsara[i], switch_by_hand(&g->sim, i),
                            FINE(1e-10, 64.0 * FLOAT_ROUNDING));
            low = fmin(low, p->rho[i]);
            high = fmax(high, p->rho[i]);
        }
        assert_true(high > 1.8 * low);
        gas_free(g);
    }
}

/* u may come out a little below 0: such a gas has no pressure, not one as if u were above */
static void less_than_no_heat_has_no_pressure(void **state) {
    (void)state;
    gas_scene *g = gas_mess(2, 10, 4);
    gas_start(g);
    for (size_t i = 0; i < g->sim.p.n; i += 9) g->sim.p.u[i] = -0.3;
    assert_int_equal(sphpa_sim_refresh(&g->sim, NULL), SPHPA_OK);
    int cold = 0;
    for (size_t i = 0; i < g->sim.p.n; i++) {
        double u = g->sim.p.u[i], P = u < 0.0 ? 0.0 : 2.0 / 3.0 * g->sim.p.rho[i] * u;
        assert_near((double)g->sim.p.P[i], P, FINE(1e-14, FLOAT_ROUNDING));
        cold += u < 0.0;
    }
    assert_int_equal(cold, 12);
    gas_free(g);
}

/* ---- waves ----------------------------------------------------------------------------------- */

/* a standing or running wave of amplitude e in [0, 1]: rho = 1 + e cos, v = e c cos, P adiabatic */
static gas_scene *wave(int n, double e, int dim, double drift) {
    const double gamma = 1.4;
    gas_scene *g = gas_new(dim, gamma, 0.0, 1.0);
    g->params.viscosity.a = g->params.viscosity.b = -1.0;
    g->params.eta = 1.2;
    for (int k = 0; k < n; k++) {
        double s = (k + 0.5) / n, x = s;
        for (int it = 0; it < 30; it++) /* equal masses */
            x = s - e * sin(2.0 * PI * x) / (2.0 * PI);
        double rho = 1.0 + e * cos(2.0 * PI * x), P = pow(rho, gamma) / gamma; /* c = 1 at rest */
        size_t i = gas_add(g, x, 0, 0, 1.0 / n, rho, P / ((gamma - 1.0) * rho));
        /* simple wave: v = 2 (c - 1)/(gamma - 1) */
        double c = sqrt(gamma * P / rho);
        g->p.v[3 * i] = (sphpa_real)(2.0 * (c - 1.0) / (gamma - 1.0) + drift);
    }
    return g;
}

/* phase of the first Fourier component of rho */
static double phase(const sphpa_sim *sim) {
    double c = 0.0, s = 0.0;
    for (size_t i = 0; i < sim->p.n; i++) {
        double volume = (double)sim->p.m[i] / sim->p.rho[i], a = 2.0 * PI * sim->p.x[3 * i];
        c += volume * (sim->p.rho[i] - 1.0) * cos(a);
        s += volume * (sim->p.rho[i] - 1.0) * sin(a);
    }
    return atan2(s, c) / (2.0 * PI);
}

static void sound_travels_at_its_speed(void **state) {
    (void)state;
    double error[2];
    for (int k = 0; k < 2; k++) {
        gas_scene *g = wave(k ? 100 : 50, 1e-3, 1, 0.0);
        gas_start(g);
        assert_int_equal(sphpa_sim_refresh(&g->sim, NULL), SPHPA_OK);
        double start = phase(&g->sim);
        for (size_t i = 0; i < g->sim.p.n; i++)
            assert_near_abs((double)g->sim.p.c[i] * (double)g->sim.p.c[i],
                            1.4 * (double)g->sim.p.P[i] / g->sim.p.rho[i], 1e-5);
        gas_run(g, 0.75); /* it moves by c t = 0.75 */
        error[k] = remainder(phase(&g->sim) - start, 1.0) - remainder(0.75, 1.0);
        gas_free(g);
    }
    print_message("sound speed's error: %.2e with 50, %.2e with 100 particles\n", error[0] / 0.75,
                  error[1] / 0.75);
    assert_near_abs(error[0], 0.0, 0.01 * 0.75);
    if (sizeof(sphpa_real) == 8) assert_near_abs(log2(error[0] / error[1]), 2.0, 0.3);
}

/* u is integrated, not the entropy: how well P/rho^gamma is kept tells the order of the whole */
static double entropy_error(int n, double cfl) {
    gas_scene *g = wave(n, 0.05, 1, 0.0);
    g->options.cfl = cfl;
    g->options.dt_growth = 1e9;
    gas_start(g);
    sphpa_particles *p = &g->sim.p;
    assert_int_equal(sphpa_sim_refresh(&g->sim, NULL), SPHPA_OK);
    double *A = (double *)calloc(p->n, sizeof(double)), error = 0.0;
    for (size_t i = 0; i < p->n; i++) { /* with the summed density, all of one entropy */
        p->u[i] = pow(p->rho[i], 0.4) / (0.4 * 1.4);
        A[p->id[i]] = 1.0 / 1.4;
    }
    gas_run(g, 0.5);
    for (size_t i = 0; i < p->n; i++)
        error = fmax(error, fabs((double)p->P[i] / pow(p->rho[i], 1.4) / A[p->id[i]] - 1.0));
    free(A);
    gas_free(g);
    return error;
}

static void smooth_flow_keeps_its_entropy(void **state) {
    (void)state;
    double coarse = entropy_error(60, 0.3), fine = entropy_error(60, 0.15);
    print_message("entropy's error: %.2e at cfl 0.3, %.2e at 0.15\n", coarse, fine);
    assert_true(coarse < 2e-3);
    if (sizeof(sphpa_real) == 8) { /* (1) and (4) are one identity in space; 2nd order in dt */
        assert_near_abs(log2(coarse / fine), 2.0, 0.3);
        double more = entropy_error(120, 0.3); /* h, and so dt, halved */
        assert_near_abs(log2(coarse / more), 2.0, 0.4);
    }
}

static void a_moving_frame_sees_the_same(void **state) {
    (void)state;
    for (int viscous = 0; viscous < 2; viscous++) {
        gas_scene *rest = wave(50, 0.05, 1, 0.0), *moves = wave(50, 0.05, 1, 3.0);
        if (viscous) {
            memset(&rest->params.viscosity, 0, sizeof rest->params.viscosity);
            memset(&moves->params.viscosity, 0, sizeof moves->params.viscosity);
        }
        gas_start(rest);
        gas_start(moves);
        gas_run(rest, 0.2);
        gas_run(moves, 0.2);
        assert_int_equal(rest->sim.stats.steps, moves->sim.stats.steps);
        for (size_t k = 0; k < rest->sim.p.n; k++) {
            size_t i = index_of(&rest->sim.p, (int64_t)k), j = index_of(&moves->sim.p, (int64_t)k);
            double dx = moves->sim.p.x[3 * j] - rest->sim.p.x[3 * i];
            assert_near_abs(remainder(dx - 0.6, 1.0), 0.0, FINE(1e-12, 1e-5));
            assert_near(moves->sim.p.rho[j], rest->sim.p.rho[i], FINE(1e-11, 1e-4));
            assert_near(moves->sim.p.u[j], rest->sim.p.u[i], FINE(1e-11, 1e-4));
            assert_near_abs((double)(moves->sim.p.v[3 * j] - rest->sim.p.v[3 * i]), 3.0,
                            FINE(1e-11, 1e-5));
        }
        gas_free(rest);
        gas_free(moves);
    }
}

static void a_turned_scene_turns_along(void **state) {
    (void)state;
    const double turn = 0.7, c = cos(turn), s = sin(turn);
    gas_scene *g[2];
    for (int k = 0; k < 2; k++) { /* open space: a lump that collapses, hits, expands */
        g[k] = gas_mess(2, 16, 33);
        memset(&g[k]->options.box, 0, sizeof g[k]->options.box);
        g[k]->params.h_max = 0.5;
        g[k]->params.viscosity.balsara = 1;
        for (size_t i = 0; i < g[k]->p.n; i++) {
            double *x = g[k]->p.x + 3 * i, y[2], w[2];
            sphpa_real *v = g[k]->p.v + 3 * i;
            w[0] = (double)v[0] - 1.5 * (x[0] - 0.5), w[1] = (double)v[1] - 1.5 * (x[1] - 0.5);
            y[0] = k ? c * x[0] - s * x[1] : x[0], y[1] = k ? s * x[0] + c * x[1] : x[1];
            v[0] = (sphpa_real)(k ? c * w[0] - s * w[1] : w[0]);
            v[1] = (sphpa_real)(k ? s * w[0] + c * w[1] : w[1]);
            x[0] = y[0], x[1] = y[1];
        }
        gas_start(g[k]);
        gas_run(g[k], 0.1);
    }
    for (size_t n = 0; n < g[0]->sim.p.n; n++) {
        size_t i = index_of(&g[0]->sim.p, (int64_t)n), j = index_of(&g[1]->sim.p, (int64_t)n);
        const double *x = g[0]->sim.p.x + 3 * i, *y = g[1]->sim.p.x + 3 * j;
        assert_near_abs(y[0], c * x[0] - s * x[1], FINE(1e-11, 1e-4));
        assert_near_abs(y[1], s * x[0] + c * x[1], FINE(1e-11, 1e-4));
        assert_near(g[0]->sim.p.rho[i], g[1]->sim.p.rho[j], FINE(1e-10, 1e-3));
        assert_near(g[0]->sim.p.u[i], g[1]->sim.p.u[j], FINE(1e-10, 1e-3));
    }
    sphpa_totals a = sphpa_sim_totals(&g[0]->sim), b = sphpa_sim_totals(&g[1]->sim);
    assert_near(a.angular[2], b.angular[2], FINE(1e-10, 1e-3));
    gas_free(g[0]);
    gas_free(g[1]);
}

/* ---- switches and dissipation ---------------------------------------------------------------- */

/* 2-D lattice with velocity gradient L: v = L (x - centre); B, rho and du of the middle */
static void flow(double L[4], int balsara, double *factor, double *heat, double *force) {
    gas_scene *g = gas_new(2, 1.4, 0.0, 1.0);
    memset(&g->options.box, 0, sizeof g->options.box);
    g->params.viscosity.balsara = balsara;
    g->params.h_max = 0.1;
    for (int k = 0; k < 400; k++) {
        double x = (k % 20 + 0.5) / 20.0, y = (k / 20 + 0.5) / 20.0;
        size_t i = gas_add(g, x, y, 0.0, 1.0 / 400, 1.0, 1e-2);
        g->p.v[3 * i] = (sphpa_real)(L[0] * (x - 0.5) + L[1] * (y - 0.5));
        g->p.v[3 * i + 1] = (sphpa_real)(L[2] * (x - 0.5) + L[3] * (y - 0.5));
    }
    gas_start(g);
    assert_int_equal(sphpa_sim_step(&g->sim, 1e-9, NULL), SPHPA_OK);
    size_t middle = index_of(&g->sim.p, 210);
    *factor = balsara ? (double)g->sim.p.balsara[middle] : 1.0;
    /* heat beside the reversible -P div v/rho */
    double div = L[0] + L[3], P = (double)g->sim.p.P[middle];
    *heat = (double)g->sim.p.du[middle] + P * div / g->sim.p.rho[middle];
    *force = hypot((double)g->sim.p.a[3 * middle], (double)g->sim.p.a[3 * middle + 1]);
    gas_free(g);
}

static void balsaras_switch_tells_shear_from_compression(void **state) {
    (void)state;
    double shear[4] = {0.0, 1.0, 0.0, 0.0}, spin[4] = {0.0, -1.0, 1.0, 0.0};
    double squeeze[4] = {-1.0, 0.0, 0.0, -1.0}, swell[4] = {1.0, 0.0, 0.0, 1.0};
    double factor, heat, force, full;
    flow(shear, 0, &factor, &full, &force);
    assert_true(full > 1e-5); /* plain viscosity heats a shear flow, */
    flow(shear, 1, &factor, &heat, &force);
    assert_true(factor < 0.01);
    assert_true(fabs(heat) < 0.02 * full); /* this one does not */
    flow(spin, 1, &factor, &heat, &force);
    assert_true(factor < 0.01);
    flow(squeeze, 1, &factor, &heat, &force);
    assert_true(factor > 0.98 && factor <= 1.0);
    flow(squeeze, 0, &factor, &full, &force);
    assert_true(full > 1e-3);
    assert_near(heat, full, 0.03); /* compression is heated as without the switch */
    flow(swell, 0, &factor, &heat, &force);
    assert_true(fabs(heat) < 0.02 * full); /* and expansion never */
}

/* On a cubic lattice the sums give div and curl of a linear flow but for one and the same factor
   near 1: where the noise term is small Balsara's is that of the flow itself. About `axis` the flow
   turns and shears (curl 1.4), along it and across it it expands (div 0.7), all times `scale`. */
static double linear_flow_3d(int axis, double scale, double u, double *noise) {
    gas_scene *g = gas_new(3, 1.4, 0.0, 1.0);
    memset(&g->options.box, 0, sizeof g->options.box);
    g->params.viscosity.balsara = 1;
    g->params.h_max = 0.2;
    size_t b = (size_t)(axis + 1) % 3, c = (size_t)(axis + 2) % 3;
    for (int k = 0; k < 729; k++) {
        double x[3] = {(k % 9 + 0.5) / 9.0, (k / 9 % 9 + 0.5) / 9.0, (k / 81 + 0.5) / 9.0};
        size_t i = gas_add(g, x[0], x[1], x[2], 1.0 / 729, 1.0, u);
        sphpa_real *v = g->p.v + 3 * i;
        v[axis] = (sphpa_real)(scale * 0.9 * (x[axis] - 0.5));
        v[b] = (sphpa_real)(scale * (-0.2 * (x[b] - 0.5) - 0.4 * (x[c] - 0.5)));
        v[c] = (sphpa_real)(scale * (x[b] - 0.5));
    }
    gas_start(g);
    assert_int_equal(sphpa_sim_step(&g->sim, 1e-9, NULL), SPHPA_OK);
    size_t middle = index_of(&g->sim.p, 364);
    double factor = (double)g->sim.p.balsara[middle];
    *noise = 1e-4 * sqrt(1.4 * 0.4 * u) / (double)g->sim.p.h[middle];
    gas_free(g);
    return factor;
}

static void balsaras_switch_knows_every_axis(void **state) {
    (void)state;
    double noise;
    for (int axis = 0; axis < 3; axis++) {
        double factor = linear_flow_3d(axis, 1.0, 1e-8, &noise);
        assert_true(noise < 1e-7);
        assert_near(factor, 0.7 / (0.7 + 1.4), FINE(1e-6, 1e-5));
        factor = linear_flow_3d(axis, 1e-3, 1.0, &noise); /* now the noise counts */
        assert_true(noise > 3e-4 && noise < 1e-3);
        assert_near(factor, 0.7e-3 / (0.7e-3 + 1.4e-3 + noise), 0.01);
    }
}

/* on a lattice the viscous heat of a uniform compression can be summed by hand, once more */
static void viscosity_is_monaghans(void **state) {
    (void)state;
    gas_scene *g = gas_new(1, 1.4, 0.0, 1.0);
    memset(&g->options.box, 0, sizeof g->options.box);
    g->params.viscosity.a = 1.5;
    g->params.viscosity.b = 3.0;
    g->params.h_max = 0.1;
    const double d = 0.01, u = 1.0, squeeze = 2.0;
    for (int k = 0; k < 100; k++) {
        size_t i = gas_add(g, (k + 0.5) * d, 0, 0, d, 1.0, u);
        g->p.v[3 * i] = (sphpa_real)(-squeeze * (k + 0.5) * d);
    }
    gas_start(g);
    assert_int_equal(sphpa_sim_step(&g->sim, 1e-12, NULL), SPHPA_OK);
    size_t i = index_of(&g->sim.p, 50);
    double h = (double)g->sim.p.h[i], rho = g->sim.p.rho[i], c = (double)g->sim.p.c[i], heat = 0.0;
    assert_near(c, sqrt(1.4 * 0.4 * u), FINE(1e-10, FLOAT_ROUNDING));
    for (int k = 1; k <= 3; k++) { /* two neighbours at k d */
        double r = k * d, mu = -h * squeeze * r * r / (r * r + 0.01 * h * h);
        double pi = (-1.5 * c * mu + 3.0 * mu * mu) / rho;
        heat += 2.0 * 0.5 * d * pi * (-squeeze * r) * sphpa_kernel_dw(SPHPA_KERNEL_CUBIC, 1, r, h);
    }
    double work = 0.0, term = (double)g->sim.p.P[i] / ((double)g->sim.p.omega[i] * rho * rho);
    for (int k = 1; k <= 3; k++)
        work += 2.0 * d * term * (-squeeze * k * d) *
                sphpa_kernel_dw(SPHPA_KERNEL_CUBIC, 1, k * d, h);
    assert_near((double)g->sim.p.du[i], heat + work, FINE(1e-8, 1e-4));
    assert_near(work, (double)g->sim.p.P[i] * squeeze / rho, 0.02);
    double most = 0.0; /* largest |mu| of its pairs */
    for (int k = 1; k <= 2; k++)
        most = fmax(most, h * squeeze * pow(k * d, 2.0) / (pow(k * d, 2.0) + 0.01 * h * h));
    assert_near((double)g->sim.p.mu_max[i], most, FINE(1e-8, 1e-5));
    /* and the Courant limit with it */
    double dt = HUGE_VAL;
    for (size_t k = 0; k < g->sim.p.n; k++)
        dt = fmin(dt, 0.3 * (double)g->sim.p.h[k] /
                          ((double)g->sim.p.c[k] + 1.2 * (1.5 * (double)g->sim.p.c[k] +
                                                          3.0 * (double)g->sim.p.mu_max[k])));
    assert_string_equal(g->sim.stats.limit[g->sim.stats.limit_last].name, "courant");
    assert_near(g->sim.dt_next, dt, 1e-12);
    gas_free(g);
}

/* du with conduction less du without it is equation (5), summed here over all pairs */
static void conduction_is_prices(void **state) {
    (void)state;
    const double k = 0.7;
    gas_scene *g[2];
    for (int on = 0; on < 2; on++) {
        g[on] = gas_mess(2, 14, 8);
        g[on]->params.conduction = on ? k : 0.0;
        gas_start(g[on]);
        sphpa_totals before = sphpa_sim_totals(&g[on]->sim);
        assert_int_equal(sphpa_sim_step(&g[on]->sim, 1e-13, NULL), SPHPA_OK);
        assert_conserved(&g[on]->sim, &before);
    }
    const sphpa_particles *p = &g[1]->sim.p;
    double total = 0.0, decay = 0.0, scale = 0.0;
    for (size_t i = 0; i < p->n; i++) scale = fmax(scale, fabs((double)p->du[i]));
    for (size_t i = 0; i < p->n; i++) {
        double want = 0.0;
        for (size_t j = 0; j < p->n; j++) {
            double x = remainder(p->x[3 * i] - p->x[3 * j], 1.0);
            double y = remainder(p->x[3 * i + 1] - p->x[3 * j + 1], 1.0), r = hypot(x, y);
            double rho = 0.5 * (p->rho[i] + p->rho[j]);
            double speed = sqrt(fabs((double)(p->P[i] - p->P[j])) / rho);
            double slope = sphpa_kernel_dw(SPHPA_KERNEL_CUBIC, 2, r, (double)p->h[i]) +
                           sphpa_kernel_dw(SPHPA_KERNEL_CUBIC, 2, r, (double)p->h[j]);
            want += (double)p->m[j] * k * speed * (p->u[i] - p->u[j]) / rho * 0.5 * slope;
        }
        double du = (double)p->du[i] - (double)g[0]->sim.p.du[i];
        assert_near_abs(du, want, FINE(1e-9, 1e-4) * scale);
        total += (double)p->m[i] * du;
        decay += (double)p->m[i] * p->u[i] * du;
    }
    assert_near_abs(total, 0.0, FINE(1e-12, 1e-5) * scale);
    assert_true(decay < -0.01 * scale); /* heat goes from hot to cold */
    gas_free(g[0]);
    gas_free(g[1]);
}

/* ---- bits, errors ---------------------------------------------------------------------------- */

static void bits_of_threads(int side, int steps, uint64_t rebuilds) {
    gas_scene *g[3];
    const int threads[3] = {1, 2, 4};
    for (int k = 0; k < 3; k++) {
        set_threads(threads[k]);
        g[k] = gas_mess(2, side, 77);
        g[k]->params.viscosity.balsara = 1;
        gas_start(g[k]);
        for (int step = 0; step < steps; step++) gas_step(g[k]);
    }
    set_threads(1);
    assert_true(g[0]->sim.stats.rebuilds >= rebuilds);
    for (int k = 1; k < 3; k++)
        for (int f = 0; f < (int)SPHPA_FIELD_COUNT; f++) {
            size_t bytes = sphpa_field_describe((sphpa_field)f).bytes * g[0]->sim.p.n;
            const void *one = sphpa_particles_data(&g[0]->sim.p, (sphpa_field)f, 0);
            const void *two = sphpa_particles_data(&g[k]->sim.p, (sphpa_field)f, 0);
            if (one != NULL) assert_memory_equal(one, two, bytes);
        }
    assert_true(g[0]->sim.dt_next == g[2]->sim.dt_next);
    for (int k = 0; k < 3; k++) gas_free(g[k]);
}

static void threads_give_the_same_bits(void **state) {
    (void)state;
#ifdef SPHPA_TEST_SMALL
    bits_of_threads(40, 10, 2); /* 1600 particles: four chunks of the lists */
    bits_of_threads(132, 2, 1);
#else
    bits_of_threads(50, 50, 3);
    bits_of_threads(140, 8, 2); /* 19,600: enough for every loop to be shared out */
#endif
}

static sphpa_result look(sphpa_sim *sim, void *user, sphpa_error *err) {
    (void)sim, (void)err;
    (*(int *)user)++;
    return SPHPA_OK;
}

static void looking_at_it_does_not_change_it(void **state) {
    (void)state;
    gas_scene *g[2];
    int looks = 0;
    for (int k = 0; k < 2; k++) {
        g[k] = gas_mess(2, 20, 5);
        g[k]->options.dt_fixed = 1e-3;
        gas_start(g[k]);
        sphpa_run run;
        memset(&run, 0, sizeof run);
        run.t_end = 0.05;
        run.every = k ? 1e-3 : 0.0;
        run.user = &looks;
        run.output = k ? look : NULL;
        assert_int_equal(sphpa_sim_run(&g[k]->sim, &run, NULL), SPHPA_OK);
    }
    assert_int_equal(looks, 51);
    for (size_t n = 0; n < g[0]->sim.p.n; n++) { /* to rounding, which grows in a mess like this */
        size_t i = index_of(&g[0]->sim.p, (int64_t)n), j = index_of(&g[1]->sim.p, (int64_t)n);
        assert_near(g[0]->sim.p.u[i], g[1]->sim.p.u[j], FINE(1e-11, 1e-4));
        for (size_t a = 0; a < 2; a++)
            assert_near_abs(g[0]->sim.p.x[3 * i + a], g[1]->sim.p.x[3 * j + a], FINE(1e-12, 1e-5));
    }
    gas_free(g[0]);
    gas_free(g[1]);
}

static void bad_gases_are_refused(void **state) {
    (void)state;
    gas_scene *g = gas_mess(2, 10, 1);
    sphpa_error err;
    for (int k = 0; k < 4; k++) {
        sphpa_eos none = g->eos;
        none.eval = NULL;
        sphpa_gas_params params = g->params;
        if (k == 0) params.eos = NULL;
        if (k == 1) params.materials = 0;
        if (k == 2) params.eos = &none;
        if (k == 3) g->p.material[5] = 1;
        sphpa_scene scene;
        memset(&scene, 0, sizeof scene);
        assert_int_equal(sphpa_scene_add(&scene, sphpa_gas(&params)), SPHPA_OK);
        assert_int_equal(sphpa_sim_create(&g->sim, &scene, &g->p, &g->options, &err),
                         k < 3 ? SPHPA_ERROR_MISSING : SPHPA_ERROR_RANGE);
        assert_non_null(strstr(err.message, k < 3 ? "equation of state" : "material 1"));
    }
    g->p.material[5] = 0;
    for (int k = 0; k < 6; k++)
        for (int bad = 0; bad < 2; bad++) {
            sphpa_gas_params params = g->params;
            double *const all[6] = {&params.eta, &params.h_max, &params.h_tol, &params.conduction,
                                    &params.viscosity.a, &params.viscosity.b};
            if (bad == 1 && k > 3) continue; /* a negative viscosity is none */
            *all[k] = bad ? -3.0 : (double)NAN;
            sphpa_scene scene;
            memset(&scene, 0, sizeof scene);
            assert_int_equal(sphpa_scene_add(&scene, sphpa_gas(&params)), SPHPA_OK);
            assert_int_equal(sphpa_sim_create(&g->sim, &scene, &g->p, &g->options, &err),
                             bad ? SPHPA_ERROR_RANGE : SPHPA_ERROR_NOT_FINITE);
            assert_non_null(strstr(err.message, bad ? "-3" : "nan"));
        }
    gas_start(g); /* without a switch its field is not there, nor anything of a solid's */
    assert_true(g->sim.p.balsara == NULL && g->sim.p.S == NULL && g->sim.p.alpha == NULL &&
                g->sim.p.D == NULL && g->sim.p.L == NULL && g->sim.p.C == NULL);
    gas_free(g);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sod_converges_to_the_exact_solution),
        cmocka_unit_test(density_and_h_solve_their_equation),
        cmocka_unit_test(the_default_search_for_h_ends_near_enough),
        cmocka_unit_test(h_max_keeps_lone_particles_alone),
        cmocka_unit_test(sums_are_conserved_where_h_varies),
        cmocka_unit_test(forces_are_the_gradient_of_the_energy),
        cmocka_unit_test(forces_and_heat_by_hand),
        cmocka_unit_test(less_than_no_heat_has_no_pressure),
        cmocka_unit_test(sound_travels_at_its_speed),
        cmocka_unit_test(smooth_flow_keeps_its_entropy),
        cmocka_unit_test(a_moving_frame_sees_the_same),
        cmocka_unit_test(a_turned_scene_turns_along),
        cmocka_unit_test(balsaras_switch_tells_shear_from_compression),
        cmocka_unit_test(balsaras_switch_knows_every_axis),
        cmocka_unit_test(viscosity_is_monaghans),
        cmocka_unit_test(conduction_is_prices),
        cmocka_unit_test(threads_give_the_same_bits),
        cmocka_unit_test(looking_at_it_does_not_change_it),
        cmocka_unit_test(bad_gases_are_refused),
    };
    set_threads(1); /* but where threads are the question: these scenes are too small for more */
    return cmocka_run_group_tests_name("gas", tests, NULL, NULL);
}
