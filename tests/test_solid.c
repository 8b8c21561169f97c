/* Elastic solids: exact gradients, waves, rotation, conservation, contact, rubber rings. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sphpa.h"

#include "near.h"

static const double pi = 3.14159265358979323846;

/* ---- a scene of one elastic material in its own units: rho0 = K = 1 ---------------------------- */

typedef struct scene_of {
    sphpa_murnaghan rubber;
    sphpa_solid_material material;
    sphpa_solid_params solid;
    sphpa_sim_options options;
    sphpa_module extra; /* added last, if it has a name */
} scene_of;

static scene_of elastic(double G) {
    scene_of s;
    memset(&s, 0, sizeof s);
    s.rubber.rho0 = s.rubber.K = 1.0;
    s.rubber.n = 1.0; /* P = K (rho/rho0 - 1) */
    s.material.G = G;
    s.solid.materials = 1;
    s.solid.correction = 1;
    return s;
}

static void ok(sphpa_result result, const sphpa_error *err) {
    if (result == SPHPA_OK) return;
    print_error("%s\n", err->message);
    fail();
}

static void start(scene_of *s, const sphpa_particles *initial, sphpa_sim *sim) {
    sphpa_scene scene;
    sphpa_error err;
    memset(&scene, 0, sizeof scene);
    s->material.eos = sphpa_murnaghan_eos(&s->rubber);
    s->solid.material = &s->material;
    assert_int_equal(sphpa_scene_add(&scene, sphpa_solid(&s->solid)), SPHPA_OK);
    if (s->extra.name != NULL) assert_int_equal(sphpa_scene_add(&scene, s->extra), SPHPA_OK);
    ok(sphpa_sim_create(sim, &scene, initial, &s->options, &err), &err);
}

static void step(sphpa_sim *sim, double limit) {
    sphpa_error err;
    ok(sphpa_sim_step(sim, limit, &err), &err);
}

static void until(sphpa_sim *sim, double t_end) {
    while (sim->time < t_end * (1.0 - 1e-12)) step(sim, t_end - sim->time);
}

static sphpa_body body_of(double spacing) {
    sphpa_body body;
    memset(&body, 0, sizeof body);
    body.rho = 1.0;
    body.spacing = spacing;
    return body;
}

static sphpa_particles set_of(int dim) {
    sphpa_particles p;
    sphpa_error err;
    ok(sphpa_make_begin(&p, dim, &err), &err);
    return p;
}

static void add_ball(sphpa_particles *p, double x, double y, double radius, const sphpa_body *body) {
    const double centre[3] = {x, y, 0.0};
    sphpa_error err;
    ok(sphpa_make_sphere(p, centre, radius, body, &err), &err);
}

static void add_box(sphpa_particles *p, double x0, double y0, double z0, double x1, double y1,
                    double z1, const sphpa_body *body) {
    const double low[3] = {x0, y0, z0}, high[3] = {x1, y1, z1};
    sphpa_error err;
    ok(sphpa_make_box(p, low, high, body, &err), &err);
}

/* moves every particle by up to `share` of its size on each axis */
static void jitter(sphpa_particles *p, double share, uint64_t seed) {
    sphpa_rng rng = sphpa_rng_seed(seed, 7);
    for (size_t i = 0; i < p->n; i++)
        for (int a = 0; a < p->dim; a++)
            p->x[3 * i + (size_t)a] += share * (double)p->h[i] / 1.2 *
                                       (2.0 * sphpa_rng_uniform(&rng) - 1.0);
}

static void set_linear_velocity(sphpa_particles *p, const double L[9]) {
    for (size_t i = 0; i < p->n; i++)
        for (size_t a = 0; a < 3; a++) {
            const double *x = p->x + 3 * i;
            p->v[3 * i + a] =
                (sphpa_real)(L[3 * a] * x[0] + L[3 * a + 1] * x[1] + L[3 * a + 2] * x[2]);
        }
}

/* a module that lets every particle fly on as it was: x = x0 + t v0 */
static sphpa_result no_force(sphpa_sim *sim, void *params, size_t first, size_t last, size_t *bad) {
    (void)params;
    (void)bad;
    memset(sim->p.a + 3 * first, 0, 3 * (last - first) * sizeof(sphpa_real));
    return SPHPA_OK;
}

/* a module of one pass over particles */
static sphpa_module one_pass(const char *name, sphpa_stage stage, sphpa_mask writes,
                             sphpa_result (*particle)(sphpa_sim *, void *, size_t, size_t,
                                                      size_t *)) {
    sphpa_module module;
    memset(&module, 0, sizeof module);
    module.name = module.pass[0].name = name;
    module.passes = 1;
    module.pass[0].stage = stage;
    module.pass[0].writes = writes;
    module.pass[0].particle = particle;
    return module;
}

static sphpa_module ballistic(void) {
    return one_pass("no force", SPHPA_STAGE_FORCES, SPHPA_F(a), no_force);
}

static sphpa_result leave_damage(sphpa_sim *sim, void *params, size_t first, size_t last,
                                 size_t *bad) {
    (void)sim, (void)params, (void)first, (void)last, (void)bad;
    return SPHPA_OK;
}

/* a module that has D and leaves it as it is */
static sphpa_module given_damage(void) {
    return one_pass("leave damage", SPHPA_STAGE_DAMAGE, SPHPA_F(D), leave_damage);
}

/* sum of m x outer grad W of the mean kernel over all others, by brute force */
static double moment(const sphpa_particles *p, size_t i, double M[9], int *count) {
    memset(M, 0, 9 * sizeof(double));
    *count = 0;
    for (size_t j = 0; j < p->n; j++) {
        double d[3], r = 0.0;
        for (size_t a = 0; a < 3; a++)
            d[a] = p->x[3 * i + a] - p->x[3 * j + a], r += d[a] * d[a];
        r = sqrt(r);
        double hi = (double)p->h[i], hj = (double)p->h[j];
        if (j == i || r >= 2.0 * fmax(hi, hj)) continue;
        double dw = 0.5 * (sphpa_kernel_dw(SPHPA_KERNEL_CUBIC, p->dim, r, hi) +
                           sphpa_kernel_dw(SPHPA_KERNEL_CUBIC, p->dim, r, hj));
        for (size_t a = 0; a < 3; a++)
            for (size_t b = 0; b < 3; b++)
                M[3 * a + b] -= (double)p->m[j] / p->rho[j] * d[a] * d[b] / r * dw;
        ++*count;
    }
    for (int a = p->dim; a < 3; a++) M[4 * a] = 1.0;
    return M[0] * (M[4] * M[8] - M[5] * M[7]) - M[1] * (M[3] * M[8] - M[5] * M[6]) +
           M[2] * (M[3] * M[7] - M[4] * M[6]);
}

/* C is used as it is, neither blended nor left out */
static int corrected(double det, int count, int dim) {
    static const int enough[4] = {0, 1, 5, 10};
    return 1.0 / det > 0.2 && 1.0 / det < 5.0 && count >= enough[dim];
}

/* What the velocities' rounding leaves in L: FLOAT_ROUNDING |v|, over a distance h, times |C| <= 5
   where C is used whole. (Pairs round independently, so it is less.) */
static double rounding_of_L(const sphpa_particles *p) {
    double most = 0.0;
    for (size_t i = 0; i < p->n; i++) {
        const sphpa_real *v = p->v + 3 * i;
        for (int a = 0; a < 3; a++) most = fmax(most, fabs((double)v[a]) / (double)p->h[i]);
    }
    return FLOAT_ROUNDING * 5.0 * most;
}

static const double any_L[9] = {0.3, -0.7, 0.2, 0.5, -0.1, 0.9, -0.4, 0.6, 0.25};

/* ---- gradients --------------------------------------------------------------------------------- */

/* a linear velocity comes out exactly wherever C is not blended, at the surface too, and with it
   Balsara's factor */
static void linear_velocity_is_exact(void **state) {
    (void)state;
    for (int dim = 1; dim <= 3; dim++) {
        sphpa_particles p = set_of(dim);
        sphpa_body body = body_of(dim == 3 ? 0.2 : 0.1);
        add_ball(&p, 0.0, 0.0, 1.0, &body);
        jitter(&p, 0.15, 5);
        double L[9];
        memset(L, 0, sizeof L);
        for (int a = 0; a < dim; a++)
            for (int b = 0; b < dim; b++) L[3 * a + b] = any_L[3 * a + b];
        set_linear_velocity(&p, L);
        scene_of s = elastic(0.5);
        s.solid.viscosity.balsara = 1;
        sphpa_sim sim;
        start(&s, &p, &sim);
        sphpa_error err;
        step(&sim, 1e-18); /* moves nothing, but brings the c that Balsara's factor is made with */
        ok(sphpa_sim_refresh(&sim, &err), &err);
        int exact = 0, exact_at_surface = 0;
        double rounding = rounding_of_L(&sim.p), div = L[0] + L[4] + L[8];
        double curl = sqrt(pow(L[7] - L[5], 2.0) + pow(L[2] - L[6], 2.0) + pow(L[3] - L[1], 2.0));
        for (size_t i = 0; i < sim.p.n; i++) {
            double M[9], worst = 0.0;
            int count;
            double det = moment(&sim.p, i, M, &count);
            for (size_t k = 0; k < 9; k++)
                worst = fmax(worst, fabs((double)sim.p.L[9 * i + k] - L[k]));
            if (corrected(det, count, dim)) {
                assert_near_abs(worst, 0.0, FINE(2e-12, rounding));
                assert_near((double)sim.p.div_v[i], div, FINE(1e-11, dim * rounding / fabs(div)));
                double noise = 1e-4 * (double)sim.p.c[i] / (double)sim.p.h[i];
                assert_near((double)sim.p.balsara[i], fabs(div) / (fabs(div) + curl + noise),
                            FINE(1e-11, dim * rounding / fabs(div) + FLOAT_ROUNDING));
                exact++;
                exact_at_surface += det < 0.7;
            }
        }
        assert_true(exact > (int)sim.p.n / 2); /* not a few: in 3-D a quarter is blended */
        assert_true(exact_at_surface > 0);
        /* without the correction the surface is wrong by tens of per cent */
        s.solid.correction = 0;
        sphpa_sim plain;
        start(&s, &p, &plain);
        ok(sphpa_sim_refresh(&plain, &err), &err);
        double worst = 0.0;
        for (size_t i = 0; i < plain.p.n; i++)
            worst = fmax(worst, fabs((double)plain.p.div_v[i] - L[0] - L[4] - L[8]));
        assert_true(worst > 0.05);
        assert_null(plain.p.C);
        sphpa_sim_free(&plain);
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

/* a particle far thinner than its neighbours counts each of them many times, and is still strained
   as they are: exactly in the body, boundedly where it has only two neighbours, in a row */
static void thin_particle_is_not_torn_further(void **state) {
    (void)state;
    static const double thin[3] = {1e-1, 1e-3, 1e-6};
    for (int k = 0; k < 3; k++) {
        sphpa_particles p = set_of(3);
        sphpa_body body = body_of(0.2);
        add_ball(&p, 0.0, 0.0, 1.0, &body);
        jitter(&p, 0.15, 5);
        size_t inside = 0, row = p.n;
        for (size_t i = 0; i < p.n; i++) {
            double *x = p.x + 3 * i, *c = p.x + 3 * inside;
            if (hypot(hypot(x[0], x[1]), x[2]) < hypot(hypot(c[0], c[1]), c[2])) inside = i;
        }
        add_box(&p, 40.0, 0.0, 0.0, 40.6, 0.2, 0.2, &body);
        assert_int_equal(p.n, row + 3);
        p.rho[inside] *= thin[k], p.rho[row + 1] *= thin[k];
        set_linear_velocity(&p, any_L);
        scene_of s = elastic(0.5);
        sphpa_sim sim;
        start(&s, &p, &sim);
        sphpa_error err;
        ok(sphpa_sim_refresh(&sim, &err), &err);
        /* the start sorts the particles along the tree */
        double rounding = rounding_of_L(&sim.p), largest = 0.0;
        int found = 0;
        for (size_t c = 0; c < 9; c++) largest = fmax(largest, fabs(any_L[c]));
        for (size_t i = 0; i < sim.p.n; i++) {
            if ((size_t)sim.p.id[i] != inside && (size_t)sim.p.id[i] != row + 1) continue;
            bool exact = (size_t)sim.p.id[i] == inside;
            found++;
            for (size_t c = 0; c < 9; c++) {
                double got = (double)sim.p.L[9 * i + c];
                if (exact) assert_near_abs(got, any_L[c], FINE(1e-11, rounding));
                else assert_true(fabs(got) < 4.0 * largest);
            }
        }
        assert_int_equal(found, 2);
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

/* C itself against the inverse of the brute-force sum; the identity where a particle is alone */
static void correction_is_the_inverse(void **state) {
    (void)state;
    sphpa_particles p = set_of(2);
    sphpa_body body = body_of(0.15);
    add_ball(&p, 0.0, 0.0, 1.0, &body);
    jitter(&p, 0.15, 9);
    add_box(&p, 40.0, 0.0, 0.0, 40.15, 0.15, 0.0, &body);
    scene_of s = elastic(0.5);
    sphpa_sim sim;
    sphpa_error err;
    start(&s, &p, &sim);
    ok(sphpa_sim_refresh(&sim, &err), &err);
    int checked = 0, alone = 0;
    const double near = FINE(1e-12, 15.0 * FLOAT_ROUNDING); /* C is below 5, its sums are of floats */
    for (size_t i = 0; i < sim.p.n; i++) {
        double M[9];
        int count;
        double det = moment(&sim.p, i, M, &count);
        const sphpa_real *C = sim.p.C + 6 * i;
        if (count == 0) {
            const double one[6] = {1.0, 1.0, 1.0, 0.0, 0.0, 0.0};
            for (int k = 0; k < 6; k++) assert_true((double)C[k] == one[k]);
            alone++;
        } else if (corrected(det, count, 2)) {
            assert_near_abs((double)C[0], M[4] / det, near);
            assert_near_abs((double)C[1], M[0] / det, near);
            assert_near_abs((double)C[3], -M[1] / det, near);
            assert_near_abs((double)C[2], 1.0, 1e-12);
            checked++;
        }
    }
    assert_true(checked > 100 && alone == 1);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

/* C from its documented blend: the inverse of M where det(s C) is below 5, I/s from 8 on; the
   inverse where neighbours are 5 (2-D) or 10 (3-D), I/s where they are 3 or 6;
   s = max(1, tr M/dim) */
static double blend_by_hand(const double M[9], double det, int count, int dim, double C[6]) {
    static const double few[4] = {0.0, 0.0, 3.0, 6.0}, enough[4] = {1.0, 1.0, 5.0, 10.0};
    static const int row[6] = {0, 1, 2, 0, 1, 0}, column[6] = {0, 1, 2, 1, 2, 2};
    double trace = M[0] + (dim > 1 ? M[4] : 0.0) + (dim > 2 ? M[8] : 0.0);
    double s = fmax(1.0, trace / dim), share = 0.0;
    if (det > 0.0)
        share = fmin(1.0, fmax(0.0, (8.0 - pow(s, dim) / det) / 3.0)) *
                fmin(1.0, fmax(0.0, (count - few[dim]) / (enough[dim] - few[dim])));
    for (int k = 0; k < 6; k++) {
        int a = row[k], b = column[k], c = (a + 1) % 3, d = (a + 2) % 3, e = (b + 1) % 3,
            f = (b + 2) % 3;
        double cofactor = M[3 * c + e] * M[3 * d + f] - M[3 * c + f] * M[3 * d + e];
        C[k] = (share > 0.0 ? share * cofactor / det : 0.0) + (a == b ? (1.0 - share) / s : 0.0);
    }
    return share;
}

/* how far C moves when the sums of M, of which each term is rounded with the size of the largest,
   are off by that: much, where neighbours lie nearly in line */
static void moved_by_rounding(const double M[9], int count, int dim, const double C[6],
                              double slack[6]) {
    static const int row[6] = {0, 1, 2, 0, 1, 0}, column[6] = {0, 1, 2, 1, 2, 2};
    double size = 4.0 * FLOAT_ROUNDING * (M[0] + M[4] + M[8]);
    for (int k = 0; k < 6; k++) slack[k] = 0.0;
    for (int e = 0; e < 6; e++) {
        double N[9], other[6];
        if (row[e] >= dim || column[e] >= dim) continue;
        memcpy(N, M, sizeof N);
        N[3 * row[e] + column[e]] += size;
        if (row[e] != column[e]) N[3 * column[e] + row[e]] += size;
        double det = N[0] * (N[4] * N[8] - N[5] * N[7]) - N[1] * (N[3] * N[8] - N[5] * N[6]) +
                     N[2] * (N[3] * N[7] - N[4] * N[6]);
        (void)blend_by_hand(N, det, count, dim, other);
        for (int k = 0; k < 6; k++) slack[k] += fabs(other[k] - C[k]);
    }
}

/* a cloud that thins outwards along x, of any masses, half of it pressed together along y:
   particles with few neighbours, and with many in a row */
static void correction_is_blended(void **state) {
    (void)state;
    for (int dim = 2; dim <= 3; dim++) {
        sphpa_particles p = set_of(dim);
        sphpa_body body = body_of(dim == 3 ? 0.17 : 0.04);
        sphpa_rng rng = sphpa_rng_seed(17, 2);
        add_ball(&p, 0.0, 0.0, 1.0, &body);
        jitter(&p, 0.3, 9);
        for (size_t i = 0; i < p.n; i++) {
            double *x = p.x + 3 * i, r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
            x[0] *= 1.0 + 1.8 * r2;
            x[1] *= p.id[i] % 2 ? 1.0 + 0.5 * r2 : 1.0 / (1.0 + r2);
            p.m[i] *= (sphpa_real)(1.0 + 9.0 * sphpa_rng_uniform(&rng));
        }
        scene_of s = elastic(0.5);
        sphpa_sim sim;
        sphpa_error err;
        start(&s, &p, &sim);
        ok(sphpa_sim_refresh(&sim, &err), &err);
        int thin = 0, lopsided = 0;
        for (size_t i = 0; i < sim.p.n; i++) {
            double M[9], C[6], slack[6];
            int count;
            double det = moment(&sim.p, i, M, &count), share = blend_by_hand(M, det, count, dim, C);
            moved_by_rounding(M, count, dim, C, slack);
            for (int k = 0; k < 6; k++)
                assert_near_abs((double)sim.p.C[6 * i + (size_t)k], C[k],
                                FINE(1e-11, 5.0 * FLOAT_ROUNDING + slack[k]));
            bool full = count >= (dim == 3 ? 10 : 5);
            lopsided += full && share > 0.02 && share < 0.98;
            thin += !full && share > 0.02 && share < 0.98;
        }
        print_message("# C blended in %d-D: %d lopsided, %d with few neighbours\n", dim, lopsided,
                      thin);
        assert_true(lopsided > 10 && thin > 10);
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

/* ---- homogeneous flows: density, smoothing length, stress --------------------------------------- */

/* v = -x/4 for all: after t = 1 every length is 3/4; density is mass over volume */
static double compression_error(int dim, double dt) {
    sphpa_particles p = set_of(dim);
    sphpa_body body = body_of(dim == 3 ? 0.3 : 0.2);
    add_ball(&p, 0.0, 0.0, 1.0, &body);
    double L[9];
    memset(L, 0, sizeof L);
    for (int a = 0; a < dim; a++) L[4 * a] = -0.25;
    set_linear_velocity(&p, L);
    scene_of s = elastic(0.5);
    s.options.dt_fixed = dt;
    s.extra = ballistic();
    sphpa_sim sim;
    start(&s, &p, &sim);
    until(&sim, 1.0);
    double rho = 1.0 / pow(0.75, dim), worst = 0.0;
    for (size_t i = 0; i < sim.p.n; i++) {
        const double *x = sim.p.x + 3 * i;
        if (x[0] * x[0] + x[1] * x[1] + x[2] * x[2] > 0.2) continue; /* away from the surface */
        worst = fmax(worst, fabs(sim.p.rho[i] / rho - 1.0));
        /* every step rounds h */
        assert_near((double)sim.p.h[i] * pow(sim.p.rho[i], 1.0 / dim), (double)sim.p.h0[i],
                    FINE(1e-12, FLOAT_ROUNDING / dt));
        /* P = K (rho - 1), committed with the density of the step's end */
        assert_near((double)sim.p.P[i], sim.p.rho[i] - 1.0, FINE(1e-12, FLOAT_ROUNDING));
    }
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return worst;
}

static void density_is_mass_over_volume(void **state) {
    (void)state;
    for (int dim = 1; dim <= 3; dim++) {
        double coarse = compression_error(dim, 0.1), fine = compression_error(dim, 0.05);
        print_message("# %d-D: density off by %.2e, %.2e with half the step\n", dim, coarse, fine);
        assert_true(fine < 1e-3);
        assert_true(log2(coarse / fine) > 1.9);
    }
}

/* simple shear at rate 1: Jaumann's S_xy = G sin(t), S_xx = -S_yy = G (1 - cos t) */
static double shear_error(double dt, sphpa_integrator integrator) {
    static const double L[9] = {0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    sphpa_particles p = set_of(2);
    sphpa_body body = body_of(0.2);
    add_ball(&p, 0.0, 0.0, 1.0, &body);
    set_linear_velocity(&p, L);
    scene_of s = elastic(0.5);
    s.solid.viscosity.a = s.solid.viscosity.b = -1.0; /* it would heat */
    s.options.dt_fixed = dt;
    s.options.integrator = integrator;
    s.extra = ballistic();
    sphpa_sim sim;
    start(&s, &p, &sim);
    until(&sim, 1.0);
    double worst = 0.0;
    for (size_t i = 0; i < sim.p.n; i++) {
        const sphpa_real *S = sim.p.S + 6 * i;
        if (hypot(sim.p.x[3 * i], sim.p.x[3 * i + 1]) > 0.4) continue;
        worst = fmax(worst, fabs((double)S[3] - 0.5 * sin(1.0)));
        worst = fmax(worst, fabs((double)S[0] - 0.5 * (1.0 - cos(1.0))));
        worst = fmax(worst, fabs((double)S[1] + 0.5 * (1.0 - cos(1.0))));
        /* every step rounds three numbers below 0.25 */
        assert_near_abs((double)S[0] + (double)S[1] + (double)S[2], 0.0,
                        FINE(1e-14, 0.75 * FLOAT_ROUNDING / dt));
        /* du = sigma:L/rho: u = G (1 - cos t) */
        worst = fmax(worst, fabs(sim.p.u[i] - 0.5 * (1.0 - cos(1.0))));
    }
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return worst;
}

static void shear_follows_jaumann(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        double coarse = shear_error(0.1, (sphpa_integrator)k);
        double fine = shear_error(0.05, (sphpa_integrator)k);
        print_message("# simple shear: stress off by %.2e, %.2e with half the step\n", coarse, fine);
        assert_true(fine < 1e-3);
        assert_true(log2(coarse / fine) > 1.9);
    }
}

/* ---- waves -------------------------------------------------------------------------------------- */

/* [1/s] of a standing wave of velocity along `axis` in a periodic column along x, length 1 */
static double wave_frequency(int dim, int cells, int axis, double G) {
    sphpa_particles p = set_of(dim);
    double d = 1.0 / cells, side = 6.0 * d, k = 2.0 * pi;
    sphpa_body body = body_of(d);
    body.u = 0.01;
    add_box(&p, 0.0, 0.0, 0.0, 1.0, side, side, &body);
    for (size_t i = 0; i < p.n; i++)
        p.v[3 * i + (size_t)axis] = (sphpa_real)(1e-5 * sin(k * p.x[3 * i]));
    scene_of s = elastic(G);
    s.solid.viscosity.a = s.solid.viscosity.b = -1.0;
    s.options.cfl = 0.1;
    for (int a = 0; a < dim; a++) {
        s.options.box.periodic[a] = 1;
        s.options.box.high[a] = a == 0 ? 1.0 : side;
    }
    sphpa_sim sim;
    start(&s, &p, &sim);
    double before = 0.0, t_before = 0.0, crossing = 0.0;
    while (crossing == 0.0) { /* the amplitude falls as cos(w t): its first zero */
        double amplitude = 0.0;
        for (size_t i = 0; i < sim.p.n; i++)
            amplitude += (double)sim.p.v[3 * i + (size_t)axis] * sin(k * sim.p.x[3 * i]);
        if (amplitude < 0.0)
            crossing = t_before + (sim.time - t_before) * before / (before - amplitude);
        before = amplitude;
        t_before = sim.time;
        step(&sim, HUGE_VAL);
        assert_true(sim.time < 5.0);
    }
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return 0.5 * pi / crossing;
}

static void wave_speeds(void **state) {
    (void)state;
    const double G = 0.6, k = 2.0 * pi;
    double along = k * sqrt(1.0 + 4.0 / 3.0 * G), across = k * sqrt(G);
    double e20 = wave_frequency(1, 20, 0, G) / along - 1.0;
    double e40 = wave_frequency(1, 40, 0, G) / along - 1.0;
    print_message("# 1-D longitudinal: speed off by %.2e, %.2e\n", e20, e40);
    assert_near_abs(e40, 0.0, 0.01);
    assert_true(log2(e20 / e40) > 1.8);
    double s20 = wave_frequency(2, 20, 1, G) / across - 1.0;
    double s40 = wave_frequency(2, 40, 1, G) / across - 1.0;
    print_message("# 2-D shear: speed off by %.2e, %.2e\n", s20, s40);
    assert_near_abs(s40, 0.0, 0.01);
    assert_true(log2(s20 / s40) > 1.8);
    double strain = wave_frequency(2, 40, 0, G) / along - 1.0; /* plane strain */
    assert_near_abs(strain, 0.0, 0.01);
    double deep = wave_frequency(3, 24, 0, G) / along - 1.0;
    print_message("# longitudinal: 2-D off by %.2e, 3-D by %.2e\n", strain, deep);
    assert_near_abs(deep, 0.0, 0.02);
    double turned = wave_frequency(3, 14, 2, G) / across - 1.0;
    assert_near_abs(turned, 0.0, 0.05);
}

/* waves of every length, without viscosity: the scheme itself must not feed them */
static void noise_does_not_grow(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        sphpa_particles p = set_of(1);
        sphpa_body body = body_of(0.01);
        sphpa_rng rng = sphpa_rng_seed(3, 3);
        body.u = 0.01;
        add_box(&p, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, &body);
        for (size_t i = 0; i < p.n; i++)
            p.v[3 * i] = (sphpa_real)(1e-7 * (2.0 * sphpa_rng_uniform(&rng) - 1.0));
        scene_of s = elastic(0.5);
        s.solid.viscosity.a = s.solid.viscosity.b = -1.0;
        s.options.box.periodic[0] = 1;
        s.options.box.high[0] = 1.0;
        s.options.integrator = (sphpa_integrator)k;
        sphpa_sim sim;
        start(&s, &p, &sim);
        double first = sphpa_sim_totals(&sim).kinetic;
        for (int n = 0; n < 1500; n++) step(&sim, HUGE_VAL);
        double last = sphpa_sim_totals(&sim).kinetic;
        print_message("# noise after 1500 steps: %.3g of the first kinetic energy\n", last / first);
        assert_true(last < 2.0 * first);
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

/* ---- rest and conservation ---------------------------------------------------------------------- */

static void unstressed_body_rests(void **state) {
    (void)state;
    sphpa_particles p = set_of(3);
    sphpa_body body = body_of(0.25);
    const sphpa_material *basalt = sphpa_material_find("basalt");
    body.rho = basalt->eos.rho0;
    body.seed = 3;
    add_ball(&p, 0.0, 0.0, 1.0, &body);
    sphpa_solid_material material;
    sphpa_solid_params solid;
    sphpa_scene scene;
    sphpa_sim sim;
    sphpa_error err;
    memset(&scene, 0, sizeof scene);
    memset(&solid, 0, sizeof solid);
    memset(&material, 0, sizeof material);
    material.eos = sphpa_tillotson_eos(&basalt->eos);
    material.G = basalt->G;
    solid.material = &material;
    solid.materials = solid.correction = 1;
    solid.viscosity.balsara = 1;
    solid.artificial_stress = 0.3;
    assert_int_equal(sphpa_scene_add(&scene, sphpa_solid(&solid)), SPHPA_OK);
    ok(sphpa_sim_create(&sim, &scene, &p, NULL, &err), &err);
    for (int k = 0; k < 5; k++) step(&sim, HUGE_VAL);
    for (size_t i = 0; i < sim.p.n; i++) {
        size_t from = (size_t)sim.p.id[i];
        for (size_t a = 0; a < 3; a++) {
            assert_true(sim.p.x[3 * i + a] == p.x[3 * from + a]);
            assert_true((double)sim.p.a[3 * i + a] == 0.0 && (double)sim.p.v[3 * i + a] == 0.0);
        }
        assert_true(sim.p.u[i] == 0.0 && sim.p.rho[i] == body.rho);
    }
    /* c: that of a longitudinal wave */
    double c = sqrt((basalt->eos.A + 4.0 / 3.0 * basalt->G) / basalt->eos.rho0);
    assert_near((double)sim.p.c[0], c, 1e-6);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

static double momentum_scale(const sphpa_sim *sim) {
    double sum = 0.0;
    for (size_t i = 0; i < sim->p.n; i++)
        for (size_t a = 0; a < 3; a++) sum += fabs((double)sim->p.m[i] * (double)sim->p.v[3 * i + a]);
    return sum;
}

/* two balls collide off centre: energy and momentum to rounding, heat while they are pressed */
static void collision_conserves(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        sphpa_particles p = set_of(3);
        sphpa_body body = body_of(0.3);
        body.u = 0.1;
        body.v[0] = 0.3;
        add_ball(&p, -1.05, 0.0, 1.0, &body);
        body.v[0] = -0.3;
        body.body = 1;
        add_ball(&p, 1.05, 0.5, 1.0, &body);
        scene_of s = elastic(0.5);
        s.solid.viscosity.balsara = 1;
        s.solid.artificial_stress = 0.2;
        s.options.integrator = (sphpa_integrator)k;
        sphpa_sim sim;
        start(&s, &p, &sim);
        sphpa_totals first = sphpa_sim_totals(&sim);
        double scale = momentum_scale(&sim), hottest = 0.0;
        while (sim.time < 6.0) {
            step(&sim, 6.0 - sim.time);
            hottest = fmax(hottest, sphpa_sim_totals(&sim).internal - first.internal);
        }
        sphpa_totals last = sphpa_sim_totals(&sim);
        assert_true(hottest > 0.3 * first.kinetic);
        assert_true(sim.stats.u_below == 0);
        double walk = float_walk(sim.stats.steps, sim.p.n);
        assert_near(last.energy, first.energy, FINE(1e-12, walk));
        assert_true(fabs(last.kinetic / first.kinetic - 1.0) > 0.01); /* something happened */
        for (int a = 0; a < 3; a++)
            assert_near_abs(last.momentum[a] - first.momentum[a], 0.0, FINE(1e-13, walk) * scale);
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

/* a block at 1.1 times its density expands: its heat turns into motion */
static void pressed_block_cools(void **state) {
    (void)state;
    sphpa_particles p = set_of(2);
    sphpa_body body = body_of(0.1);
    body.u = 0.1;
    body.rho = 1.1;
    add_box(&p, -0.5, -0.5, 0.0, 0.5, 0.5, 0.0, &body);
    jitter(&p, 0.02, 9); /* or eight particles mirror each other, and round alike in float */
    scene_of s = elastic(0.3);
    sphpa_sim sim;
    start(&s, &p, &sim);
    sphpa_totals first = sphpa_sim_totals(&sim);
    until(&sim, 0.3);
    sphpa_totals moving = sphpa_sim_totals(&sim);
    assert_true(moving.internal < first.internal);
    assert_near(moving.kinetic, first.internal - moving.internal,
                FINE(1e-9, float_walk(sim.stats.steps, sim.p.n)));
    /* the pressure's work, K (ln r + 1/r - 1) per mass at most, is the order of what moves */
    double most = first.mass * (log(1.1) + 1.0 / 1.1 - 1.0);
    assert_true(moving.kinetic > 0.1 * most && moving.kinetic < most);
    until(&sim, 4.0);
    sphpa_totals last = sphpa_sim_totals(&sim);
    double walk = float_walk(sim.stats.steps, sim.p.n);
    assert_near(last.energy, first.energy, FINE(1e-12, walk));
    assert_true(sim.stats.u_below == 0);
    double scale = sqrt(2.0 * most * first.mass);
    for (int a = 0; a < 2; a++)
        assert_near_abs(last.momentum[a], 0.0, FINE(1e-13, walk) * scale);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

/* Two densities, 1 and 4, at one pressure and strained alike: every particle is heated by P div v of
   its own, -P div v/rho, on both sides of the jump. Halves of one body, or two bodies. */
static void heat_at_a_jump(int dim, int correction, int bodies) {
    sphpa_particles p = set_of(dim);
    sphpa_body body = body_of(dim == 3 ? 0.2 : 0.1);
    add_box(&p, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, &body);
    jitter(&p, 0.1, 3);
    for (size_t i = 0; i < p.n; i++) {
        double factor = p.x[3 * i] > 0.0 ? 4.0 : 1.0;
        p.material[i] = factor > 1.0;
        p.body[i] = bodies > 1 ? p.material[i] : 0;
        p.rho[i] = 1.1 * factor; /* P = 0.1 */
        p.m[i] = (sphpa_real)((double)p.m[i] * factor);
    }
    double L[9];
    memset(L, 0, sizeof L);
    for (int a = 0; a < dim; a++) L[4 * a] = -0.1 * (a + 1);
    set_linear_velocity(&p, L);
    sphpa_murnaghan rubber[2];
    sphpa_solid_material material[2];
    sphpa_solid_params solid;
    sphpa_sim_options options;
    sphpa_scene scene;
    sphpa_sim sim;
    sphpa_error err;
    memset(rubber, 0, sizeof rubber);
    memset(material, 0, sizeof material);
    memset(&solid, 0, sizeof solid);
    memset(&options, 0, sizeof options);
    memset(&scene, 0, sizeof scene);
    for (int k = 0; k < 2; k++) {
        rubber[k].rho0 = k ? 4.0 : 1.0;
        rubber[k].K = rubber[k].n = 1.0;
        material[k].eos = sphpa_murnaghan_eos(&rubber[k]);
    }
    solid.material = material;
    solid.materials = 2;
    solid.correction = correction;
    solid.viscosity.a = solid.viscosity.b = -1.0;
    assert_int_equal(sphpa_scene_add(&scene, sphpa_solid(&solid)), SPHPA_OK);
    ok(sphpa_sim_create(&sim, &scene, &p, &options, &err), &err);
    step(&sim, 1e-9); /* rates are those of a step; this one moves nothing */
    int across = 0;
    for (size_t i = 0; i < sim.p.n; i++) {
        double heat = -0.1 * (double)sim.p.div_v[i] / sim.p.rho[i];
        assert_near((double)sim.p.du[i], heat, FINE(1e-8, 1e-3));
        across += fabs(sim.p.x[3 * i]) < 1.2 * (double)sim.p.h[i];
    }
    assert_true(across > 1);
    double work = 0.0, heat = 0.0;
    for (size_t i = 0; i < sim.p.n; i++) {
        heat += (double)sim.p.m[i] * (double)sim.p.du[i];
        for (size_t a = 0; a < 3; a++)
            work += (double)sim.p.m[i] * (double)sim.p.a[3 * i + a] * (double)sim.p.v[3 * i + a];
    }
    assert_near(heat, -work, FINE(1e-8, 1e-4));
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

static void heat_is_that_of_the_own_stress(void **state) {
    (void)state;
    for (int dim = 1; dim <= 3; dim++) {
        heat_at_a_jump(dim, 1, 1);
        heat_at_a_jump(dim, 0, 1);
        heat_at_a_jump(dim, 0, 2);
    }
}

/* ---- equations (5) to (7), written out ---------------------------------------------------------- */

/* The principal stresses of a particle's undamaged deviator and their axes, rows of `axis`. */
typedef struct stress_of {
    double l[3], axis[3][3];
} stress_of;

/* turned about z and, in three dimensions, about x and z again */
static stress_of any_stress(sphpa_rng *rng, int dim) {
    stress_of s;
    double size = 0.3 * sphpa_rng_uniform(rng), mean;
    memset(&s, 0, sizeof s);
    for (int k = 0; k < 3; k++) {
        s.l[k] = size * (2.0 * sphpa_rng_uniform(rng) - 1.0);
        s.axis[k][k] = 1.0;
    }
    mean = (s.l[0] + s.l[1] + s.l[2]) / 3.0;
    for (int k = 0; k < 3; k++) s.l[k] -= mean;
    for (int turn = 0; turn < (dim == 3 ? 3 : 1); turn++) {
        double angle = 2.0 * pi * sphpa_rng_uniform(rng), c = cos(angle), d = sin(angle);
        int a = turn == 1 ? 1 : 0, b = a + 1;
        for (int k = 0; k < 3; k++) {
            double x = s.axis[k][a], y = s.axis[k][b];
            s.axis[k][a] = c * x - d * y;
            s.axis[k][b] = d * x + c * y;
        }
    }
    return s;
}

/* sum over the axes of value[k] n_k n_k */
static void of_axes(const stress_of *s, const double value[3], double out[9]) {
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            out[3 * a + b] = 0.0;
            for (int k = 0; k < 3; k++) out[3 * a + b] += value[k] * s->axis[k][a] * s->axis[k][b];
        }
}

typedef struct by_hand {
    const sphpa_solid_params *solid;
    const sphpa_particles *p;
    const stress_of *stress; /* (n) by id */
} by_hand;

static double distance(const sphpa_particles *p, size_t i, size_t j, double x[3]) {
    double r2 = 0.0;
    for (size_t a = 0; a < 3; a++) {
        x[a] = p->x[3 * i + a] - p->x[3 * j + a];
        r2 += x[a] * x[a];
    }
    return sqrt(r2);
}

static int are_neighbours(const sphpa_particles *p, size_t i, size_t j) {
    double x[3];
    return i != j && distance(p, i, j, x) < 2.0 * fmax((double)p->h[i], (double)p->h[j]);
}

static int is_broken(const sphpa_particles *p, size_t i) {
    return (double)p->D[i] >= 1.0;
}

/* sigma' in its axes */
static void principal(const by_hand *b, size_t i, double value[3]) {
    double P = (double)b->p->P[i], whole = 1.0 - (double)b->p->D[i];
    const stress_of *s = b->stress + b->p->id[i];
    for (int k = 0; k < 3; k++)
        value[k] = (b->solid->material->damage_in_yield ? 1.0 : whole) * s->l[k] - (P < 0.0 ? whole * P : P);
}

/* n.C n along the k-th axis */
static double along_by_hand(const by_hand *b, size_t i, int k) {
    static const size_t at[9] = {0, 3, 5, 3, 1, 4, 5, 4, 2};
    const stress_of *s = b->stress + b->p->id[i];
    double sum = 0.0;
    if (b->p->C == NULL) return 1.0;
    for (int a = 0; a < 3; a++)
        for (int c = 0; c < 3; c++)
            sum += s->axis[k][a] * (double)b->p->C[6 * i + at[3 * a + c]] * s->axis[k][c];
    return sum;
}

/* a neighbour whose part of C is missing: i is whole and it is not, or of another body; but not one
   that leaves while i is not pressed, which does not count at all */
static int at_a_cut(const by_hand *b, size_t i) {
    const sphpa_particles *p = b->p;
    if (b->solid->any_neighbour || is_broken(p, i)) return 0;
    for (size_t j = 0; j < p->n; j++) {
        double x[3], vx = 0.0;
        int foreign = p->body[i] != p->body[j], broken = is_broken(p, j);
        if (!are_neighbours(p, i, j) || !(foreign || broken)) continue;
        (void)distance(p, i, j, x);
        for (size_t a = 0; a < 3; a++)
            vx += x[a] * ((double)p->v[3 * i + a] - (double)p->v[3 * j + a]);
        if ((double)p->P[i] > 0.0 || vx <= 0.0 || !(broken || !b->solid->bodies_stick)) return 1;
    }
    return 0;
}

static int joined(const by_hand *b, size_t i, size_t j) {
    const sphpa_particles *p = b->p;
    return (b->solid->bodies_stick || p->body[i] == p->body[j]) &&
           (b->solid->any_neighbour || is_broken(p, i) == is_broken(p, j));
}

/* T_ij */
static void pair_stress(const by_hand *b, size_t i, size_t j, double T[9]) {
    const sphpa_particles *p = b->p;
    double push = fmax((double)p->P[i], 0.0), value[3], A[9];
    double exponent = b->solid->correction ? 0.5 : p->body[i] != p->body[j] ? 0.0 : 1.0;
    double per = pow(p->rho[i], -1.0 - exponent) * pow(p->rho[j], exponent - 1.0);
    static const int at[9] = {0, 3, 5, 3, 1, 4, 5, 4, 2}; /* of xx yy zz xy yz xz */
    memset(T, 0, 9 * sizeof *T);
    if (!joined(b, i, j)) {
        T[0] = T[4] = T[8] = -push * per;
        return;
    }
    principal(b, i, value);
    double across = at_a_cut(b, i) ? push : 0.0;
    for (int k = 0; k < 3; k++) value[k] += across;
    of_axes(b->stress + p->id[i], value, A);
    for (size_t a = 0; a < 3; a++)
        for (size_t c = 0; c < 3; c++) {
            for (size_t k = 0; k < 3; k++)
                T[3 * a + c] += A[3 * a + k] * (p->C != NULL
                                                    ? (double)p->C[6 * i + (size_t)at[3 * k + c]]
                                                    : (double)(k == c));
            T[3 * a + c] = per * (T[3 * a + c] - (a == c ? across : 0.0));
        }
}

/* -Pi I + f^n (R_i + R_j) */
static void pair_shared(const by_hand *b, size_t i, size_t j, double Q[9]) {
    const sphpa_particles *p = b->p;
    const sphpa_solid_params *solid = b->solid;
    double x[3], r = distance(p, i, j, x), vx = 0.0, h = 0.5 * ((double)p->h[i] + (double)p->h[j]);
    memset(Q, 0, 9 * sizeof *Q);
    for (size_t a = 0; a < 3; a++)
        vx += x[a] * ((double)p->v[3 * i + a] - (double)p->v[3 * j + a]);
    if (solid->artificial_stress > 0.0 && joined(b, i, j))
        for (int k = 0; k < 2; k++) {
            size_t of = k == 0 ? i : j;
            double value[3], R[9];
            double near = sphpa_kernel_w(SPHPA_KERNEL_CUBIC, p->dim, r, h) /
                          sphpa_kernel_w(SPHPA_KERNEL_CUBIC, p->dim, h / 1.2, h);
            principal(b, of, value);
            for (int c = 0; c < 3; c++)
                value[c] = -solid->artificial_stress * fmax(1.0, along_by_hand(b, of, c)) *
                           fmax(value[c], 0.0) / (p->rho[of] * p->rho[of]);
            of_axes(b->stress + p->id[of], value, R);
            for (int c = 0; c < 9; c++) Q[c] += pow(near, 4.0) * R[c];
        }
    if (!(vx < 0.0)) return;
    double mu = h * vx / (r * r + 0.01 * h * h), c = 0.5 * ((double)p->c[i] + (double)p->c[j]);
    double f = p->balsara == NULL ? 1.0 : 0.5 * ((double)p->balsara[i] + (double)p->balsara[j]);
    double Pi = f * (-solid->viscosity.a * c * mu + solid->viscosity.b * mu * mu) /
                (0.5 * (p->rho[i] + p->rho[j]));
    for (int a = 0; a < 9; a += 4) Q[a] -= Pi;
}

/* dv/dt and du/dt of i, and the sums of their terms' sizes */
static void rates_by_hand(const by_hand *b, size_t i, double a[3], double *du, double size[2]) {
    const sphpa_particles *p = b->p;
    memset(a, 0, 3 * sizeof *a);
    *du = size[0] = size[1] = 0.0;
    for (size_t j = 0; j < p->n; j++) {
        double x[3], T[9], back[9], Q[9];
        if (!are_neighbours(p, i, j)) continue;
        double r = distance(p, i, j, x);
        double g = (double)p->m[j] * 0.5 / r *
                   (sphpa_kernel_dw(SPHPA_KERNEL_CUBIC, p->dim, r, (double)p->h[i]) +
                    sphpa_kernel_dw(SPHPA_KERNEL_CUBIC, p->dim, r, (double)p->h[j]));
        pair_stress(b, i, j, T);
        pair_stress(b, j, i, back);
        pair_shared(b, i, j, Q);
        for (size_t k = 0; k < 3; k++) {
            double v = (double)p->v[3 * i + k] - (double)p->v[3 * j + k];
            for (size_t l = 0; l < 3; l++) {
                double force = (T[3 * k + l] + back[3 * k + l] + Q[3 * k + l]) * g * x[l];
                double heat = -v * (T[3 * k + l] + 0.5 * Q[3 * k + l]) * g * x[l];
                a[k] += force;
                *du += heat;
                size[0] += fabs(force);
                size[1] += fabs(heat);
            }
        }
    }
}

/* two bodies in one another's reach, of any density, speed, stress and damage, whole and broken */
static void any_state(sphpa_particles *p, int dim, sphpa_rng *rng) {
    sphpa_body body = body_of(dim == 3 ? 0.25 : 0.125);
    *p = set_of(dim);
    add_box(p, 0.0, 0.0, 0.0, 0.5, 1.0, 1.0, &body);
    body.body = 1;
    add_box(p, 0.5, 0.0, 0.0, 1.0, 1.0, 1.0, &body);
    jitter(p, 0.2, 3);
    for (size_t i = 0; i < p->n; i++) {
        p->u[i] = 0.1;
        p->rho[i] *= 0.85 + 0.3 * sphpa_rng_uniform(rng);
        p->h[i] = (sphpa_real)((double)p->h[i] * (0.9 + 0.2 * sphpa_rng_uniform(rng)));
        for (int a = 0; a < dim; a++)
            p->v[3 * i + (size_t)a] = (sphpa_real)(sphpa_rng_uniform(rng) - 0.5);
    }
}

/* adds to `whole` the particles that are, away from a cut and at one */
static void compare_with_hand(int dim, const sphpa_solid_params *solid, int in_yield,
                              uint64_t seed, int whole[2]) {
    enum { MOST = 128 };
    sphpa_rng rng = sphpa_rng_seed(seed, 11);
    sphpa_particles p;
    stress_of stress[MOST];
    double D[MOST];
    sphpa_sim sim;
    any_state(&p, dim, &rng);
    assert_true(p.n <= MOST);
    for (size_t id = 0; id < p.n; id++) {
        stress[id] = any_stress(&rng, dim);
        D[id] = fmin(1.0, fmax(0.0, 1.8 * sphpa_rng_uniform(&rng) - 0.7)); /* 5 % at 1 */
    }
    scene_of s = elastic(0.5);
    s.solid = *solid;
    s.material.damage_in_yield = in_yield;
    s.extra = given_damage();
    start(&s, &p, &sim);
    for (size_t i = 0; i < sim.p.n; i++) {
        static const int row[6] = {0, 1, 2, 0, 1, 0}, column[6] = {0, 1, 2, 1, 2, 2};
        const stress_of *own = stress + sim.p.id[i];
        double S[9];
        of_axes(own, own->l, S);
        for (size_t c = 0; c < 6; c++)
            sim.p.S[6 * i + c] = (sphpa_real)S[3 * row[c] + column[c]];
        sim.p.D[i] = (sphpa_real)D[sim.p.id[i]];
    }
    step(&sim, 1e-12); /* rates are those of a step; two, for who is pressed is the last one's P */
    step(&sim, 1e-12);
    const by_hand b = {&s.solid, &sim.p, stress};
    for (size_t i = 0; i < sim.p.n; i++) {
        double a[3], du, size[2];
        rates_by_hand(&b, i, a, &du, size);
        for (size_t k = 0; k < 3; k++)
            assert_near_abs((double)sim.p.a[3 * i + k], a[k],
                            FINE(1e-10, 24.0 * FLOAT_ROUNDING) * size[0]);
        assert_near_abs((double)sim.p.du[i], du, FINE(1e-10, 24.0 * FLOAT_ROUNDING) * size[1]);
        assert_int_equal(at_a_cut(&b, i), sim.p.cut[i] > 0);
        if (!is_broken(&sim.p, i)) whole[sim.p.cut[i] > 0]++;
    }
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

static void forces_and_heat_by_hand(void **state) {
    (void)state;
    int whole[2] = {0, 0};
    for (int k = 0; k < 12; k++) {
        sphpa_solid_params solid;
        memset(&solid, 0, sizeof solid);
        solid.materials = 1;
        solid.correction = k % 2 == 0;
        solid.any_neighbour = k % 6 == 2;
        solid.bodies_stick = k % 6 == 3;
        solid.artificial_stress = k % 6 < 2 ? 0.3 : 0.0;
        solid.viscosity.a = 0.8;
        solid.viscosity.b = 1.7;
        solid.viscosity.balsara = k % 6 == 5 || k % 6 == 0;
        compare_with_hand(k < 6 ? 2 : 3, &solid, k % 6 == 4, (uint64_t)k, whole);
    }
    print_message("# forces by hand: %d whole particles at a cut, %d not\n", whole[1], whole[0]);
    assert_true(whole[0] > 100 && whole[1] > 100);
}

/* Without the correction (3) is the rate of sum_j m_j (W_i + W_j)/2 of this very evaluation: at its
   positions and velocities, and with the density that the rate before makes of the one at the start. */
typedef struct of_the_sum {
    double before[400]; /* by id: div v of the step before */
    double worst;       /* relative error of div v */
    int seen;
} of_the_sum;

static double rate_of_sum(const sphpa_sim *sim, size_t i) {
    const sphpa_particles *p = &sim->p;
    double sum = 0.0;
    for (size_t j = 0; j < p->n; j++) {
        double dot = 0.0, r2 = 0.0;
        for (size_t a = 0; a < 3; a++) {
            double dx = p->x[3 * i + a] - p->x[3 * j + a];
            r2 += dx * dx;
            dot += dx * ((double)p->v[3 * i + a] - (double)p->v[3 * j + a]);
        }
        double r = sqrt(r2) + 1e-300;
        sum += (double)p->m[j] * dot / r * 0.5 *
               (sphpa_kernel_dw(sim->options.kernel, p->dim, r, (double)p->h[i]) +
                sphpa_kernel_dw(sim->options.kernel, p->dim, r, (double)p->h[j]));
    }
    return sum;
}

static sphpa_result compare_with_sum(sphpa_sim *sim, void *params, size_t first, size_t last,
                                     size_t *bad) {
    of_the_sum *o = (of_the_sum *)params;
    (void)bad;
    for (size_t i = first; i < last && !sim->committing; i++) {
        double rho = sim->p.start.rho[i] * exp(-sim->dt_stage * o->before[sim->p.id[i]]);
        double want = -rate_of_sum(sim, i) / rho;
        o->worst = fmax(o->worst, fabs((double)sim->p.div_v[i] - want) / (fabs(want) + 0.1));
        o->seen++;
    }
    return SPHPA_OK;
}

static void continuity_is_the_rate_of_the_sum(void **state) {
    (void)state;
    for (int dim = 1; dim <= 3; dim++) {
        sphpa_particles p = set_of(dim);
        sphpa_body body = body_of(dim == 3 ? 0.34 : 0.1);
        add_box(&p, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, &body);
        jitter(&p, 0.2, 5);
        sphpa_rng rng = sphpa_rng_seed(6, (uint64_t)dim);
        for (size_t i = 0; i < p.n; i++) {
            p.rho[i] *= 1.0 + sphpa_rng_uniform(&rng);
            for (int a = 0; a < dim; a++)
                p.v[3 * i + (size_t)a] =
                    (sphpa_real)(0.5 * sphpa_rng_uniform(&rng) - p.x[3 * i + (size_t)a]);
        }
        scene_of s = elastic(0.0);
        s.solid.correction = 0;
        s.options.dt_fixed = 0.02;
        of_the_sum o;
        memset(&o, 0, sizeof o);
        assert_true(p.n <= 400);
        s.extra.name = "look";
        s.extra.params = &o;
        s.extra.passes = 1;
        s.extra.pass[0].name = "look";
        s.extra.pass[0].stage = SPHPA_STAGE_PRESSURE;
        s.extra.pass[0].reads = SPHPA_F(rho) | SPHPA_F(div_v);
        s.extra.pass[0].particle = compare_with_sum;
        sphpa_sim sim;
        start(&s, &p, &sim);
        for (int k = 0; k < 4; k++) {
            o.worst = 0.0;
            o.seen = 0;
            step(&sim, 1.0);
            assert_true(o.seen > 0); /* the first step has no rate before it that could be seen */
            if (k > 0) assert_near_abs(o.worst, 0.0, FINE(1e-11, 1e-4));
            for (size_t i = 0; i < p.n; i++) o.before[sim.p.id[i]] = (double)sim.p.div_v[i];
        }
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

/* ---- rotation ----------------------------------------------------------------------------------- */

typedef struct rotation {
    double kept;   /* angular momentum at the end to that at the start */
    double stress; /* largest |S_ab| at the end, of G */
} rotation;

static rotation rotate(int dim, int correction, double turns) {
    sphpa_particles p = set_of(dim);
    sphpa_body body = body_of(0.0);
    body.count = dim == 2 ? 120 : 200;
    body.lattice = SPHPA_LATTICE_HEXAGONAL;
    body.u = 0.1;
    body.spin[2] = 2.0 * pi / 100.0;
    body.seed = 4; /* a rough surface */
    add_ball(&p, 0.0, 0.0, 1.0, &body);
    scene_of s = elastic(1.0);
    s.solid.correction = correction;
    s.solid.viscosity.balsara = 1;
    sphpa_sim sim;
    start(&s, &p, &sim);
    double before = sphpa_sim_totals(&sim).angular[2];
    until(&sim, 100.0 * turns);
    rotation out = {sphpa_sim_totals(&sim).angular[2] / before, 0.0};
    for (size_t k = 0; k < 6 * sim.p.n; k++)
        out.stress = fmax(out.stress, fabs((double)sim.p.S[k]));
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return out;
}

/* a solid that turns rigidly is strained by what holds it together alone: rho w^2 r^2 = 0.004 */
static void rotation_is_not_strain(void **state) {
    (void)state;
    for (int dim = 2; dim <= 3; dim++) {
#ifdef SPHPA_TEST_SMALL
        const double turns = dim == 2 ? 0.2 : 0.05;
#else
        const double turns = dim == 2 ? 0.5 : 0.1;
#endif
        rotation on = rotate(dim, 1, turns), off = rotate(dim, 0, turns);
        print_message("# %d-D, %g turns: angular momentum %.7f, largest S %.1e with correction; %.4f, "
                      "%.1e without\n", dim, turns, on.kept, on.stress, off.kept, off.stress);
        assert_near(on.kept, 1.0, 1e-4);
        assert_true(on.stress < 0.008);
        assert_true(fabs(off.kept - 1.0) > 0.003 && off.stress > 0.02); /* so the test can fail */
    }
}

/* the very first strain rate of a rigid rotation, particle by particle, of a rough surface */
static void rotation_has_no_strain_rate(void **state) {
    (void)state;
    static const double W[9] = {0.0, -0.3, 0.2, 0.3, 0.0, -0.5, -0.2, 0.5, 0.0};
    sphpa_particles p = set_of(3);
    sphpa_body body = body_of(0.2);
    body.seed = 8;
    add_ball(&p, 0.0, 0.0, 1.0, &body);
    set_linear_velocity(&p, W);
    scene_of s = elastic(1.0);
    sphpa_sim sim;
    sphpa_error err;
    for (int correction = 0; correction < 2; correction++) {
        s.solid.correction = correction;
        start(&s, &p, &sim);
        ok(sphpa_sim_refresh(&sim, &err), &err);
        double worst = 0.0, rounding = rounding_of_L(&sim.p);
        size_t bad = 0;
        for (size_t i = 0; i < sim.p.n; i++) {
            const sphpa_real *L = sim.p.L + 9 * i;
            double rate = 0.0;
            for (size_t a = 0; a < 3; a++)
                for (size_t b = 0; b < 3; b++)
                    rate = fmax(rate, fabs((double)L[3 * a + b] + (double)L[3 * b + a]));
            if (rate > FINE(1e-12, 2.0 * rounding)) bad++;
            worst = fmax(worst, rate);
        }
        print_message("# rigid rotation, correction %d: largest strain rate %.2e, %zu of %zu particles "
                      "have one\n", correction, worst, bad, sim.p.n);
        if (correction) assert_int_equal(bad, 0); /* also where C is blended, as in corners */
        else assert_true(bad > sim.p.n * 3 / 4 && worst > 0.05);
        sphpa_sim_free(&sim);
    }
    sphpa_particles_free(&p);
}

/* ---- two bodies --------------------------------------------------------------------------------- */

/* momentum that body 0, at rest, has after body 1 moved away from it along x, or slid along y */
static void leaving(int stick, double vx, double vy, double pull[2], double *strained) {
    sphpa_particles p = set_of(2);
    sphpa_body body = body_of(0.1);
    body.u = 0.1;
    add_box(&p, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, &body);
    body.body = 1;
    body.v[0] = vx;
    body.v[1] = vy;
    add_box(&p, 1.0, 0.0, 0.0, 1.5, 1.0, 0.0, &body);
    scene_of s = elastic(0.5);
    s.solid.bodies_stick = s.solid.any_neighbour = stick;
    s.solid.viscosity.a = s.solid.viscosity.b = -1.0; /* it acts across, as it should */
    sphpa_sim sim;
    start(&s, &p, &sim);
    until(&sim, 0.5);
    pull[0] = pull[1] = *strained = 0.0;
    for (size_t i = 0; i < sim.p.n; i++) {
        if (sim.p.body[i] != 0) continue;
        for (size_t a = 0; a < 2; a++)
            pull[a] += (double)sim.p.m[i] * (double)sim.p.v[3 * i + a];
        *strained = fmax(*strained, fabs(sim.p.rho[i] - 1.0));
    }
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

static void bodies_do_not_glue(void **state) {
    (void)state;
    double pull[2], strained;
    leaving(0, 0.1, 0.0, pull, &strained); /* away */
    assert_near_abs(pull[0], 0.0, 1e-15);
    assert_near_abs(strained, 0.0, 1e-15);
    leaving(1, 0.1, 0.0, pull, &strained);
    assert_true(pull[0] > 1e-3 && strained > 1e-3);
    leaving(0, -0.1, 0.0, pull, &strained); /* into it */
    assert_true(pull[0] < -1e-3 && strained > 1e-3);
    leaving(1, 0.0, 0.1, pull, &strained); /* along it */
    double stuck = pull[1];
    assert_true(stuck > 1e-3);
    leaving(0, 0.0, 0.1, pull, &strained); /* what is left is rows of particles that ride over rows */
    print_message("# momentum that sliding gives: %.2e stuck together, %.2e not\n", stuck, pull[1]);
    assert_true(fabs(pull[1]) < 0.02 * stuck);
}

/* debris of the same body that flies off pulls at nothing and strains nothing; debris that comes
   presses. any_neighbour: it does pull. */
static void debris_does_not_pull(void **state) {
    (void)state;
    double moved[3], strained[3];
    for (int k = 0; k < 3; k++) { /* away; away, as if whole; into it */
        sphpa_particles p = set_of(2);
        sphpa_body body = body_of(0.1);
        body.u = 0.1;
        add_box(&p, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, &body);
        size_t whole = p.n;
        body.v[0] = k < 2 ? 0.1 : -0.1;
        add_box(&p, 1.0, 0.0, 0.0, 1.5, 1.0, 0.0, &body);
        scene_of s = elastic(0.5);
        s.solid.any_neighbour = k == 1;
        s.solid.viscosity.a = s.solid.viscosity.b = -1.0;
        s.extra = given_damage();
        sphpa_sim sim;
        start(&s, &p, &sim);
        for (size_t i = 0; i < sim.p.n; i++) sim.p.D[i] = sim.p.id[i] >= (int64_t)whole ? 1.0 : 0.0;
        until(&sim, 0.3);
        moved[k] = strained[k] = 0.0;
        for (size_t i = 0; i < sim.p.n; i++) {
            if ((double)sim.p.D[i] >= 1.0) continue;
            moved[k] += (double)sim.p.m[i] * (double)sim.p.v[3 * i];
            strained[k] = fmax(strained[k], fabs(sim.p.rho[i] - 1.0));
        }
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
    assert_near_abs(moved[0], 0.0, 1e-15);
    assert_near_abs(strained[0], 0.0, 1e-15);
    assert_true(moved[1] > 1e-4 && strained[1] > 1e-3);
    assert_true(moved[2] < -1e-4 && strained[2] > 1e-3);
}

/* a stretched body draws itself together, not what lies beside it */
static void tension_stays_inside(void **state) {
    (void)state;
    for (int stick = 0; stick < 2; stick++) {
        sphpa_particles p = set_of(2);
        sphpa_body body = body_of(0.1);
        body.u = 0.1;
        body.rho = 0.95;
        add_box(&p, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, &body);
        body.body = 1;
        body.rho = 1.0;
        add_box(&p, 1.0, 0.0, 0.0, 1.5, 1.0, 0.0, &body);
        scene_of s = elastic(0.5);
        s.solid.bodies_stick = stick;
        s.solid.viscosity.a = s.solid.viscosity.b = -1.0;
        sphpa_sim sim;
        start(&s, &p, &sim);
        until(&sim, 0.05);
        double other = 0.0, moving = 0.0;
        for (size_t i = 0; i < sim.p.n; i++) {
            double momentum = (double)sim.p.m[i] * (double)sim.p.v[3 * i];
            if (sim.p.body[i] == 1) other += momentum;
            else moving += fabs(momentum);
        }
        assert_true(moving > 1e-5);
        if (stick) assert_true(other < -1e-5);
        else assert_true(other >= 0.0 && other < 1e-4 * moving); /* a corner that shrinks touches */
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

/* ---- limits and errors --------------------------------------------------------------------------- */

static const char *limit_of(scene_of *s, double L_xx) {
    double L[9];
    memset(L, 0, sizeof L);
    L[0] = L_xx;
    sphpa_particles p = set_of(2);
    sphpa_body body = body_of(0.2);
    body.u = 0.1;
    add_ball(&p, 0.0, 0.0, 1.0, &body);
    set_linear_velocity(&p, L);
    sphpa_sim sim;
    start(s, &p, &sim);
    step(&sim, HUGE_VAL); /* the first step's length is set by the state at its start */
    int chosen = -1;
    for (int k = 0; k < sim.stats.limits; k++)
        if (sim.stats.limit[k].steps > 0) chosen = k;
    static char name[40];
    snprintf(name, sizeof name, "%s", sim.stats.limit[chosen].name);
    /* each limit's formula, at the start: no particle exceeds it by more than the acceleration does */
    if (strcmp(name, "density change") == 0)
        assert_near(sim.dt * L_xx, 0.05, FINE(1e-9, 8.0 * FLOAT_ROUNDING));
    if (L_xx < 0.0) { /* viscosity has its share of Courant's limit */
        double least = HUGE_VAL, mu = 0.0, c = sqrt(1.0 + 4.0 / 3.0 * s->material.G);
        for (size_t i = 0; i < sim.p.n; i++) {
            mu = fmax(mu, (double)sim.p.mu_max[i]);
            least = fmin(least, 0.3 * (double)sim.p.h[i] /
                                    (2.2 * (double)sim.p.c[i] + 2.4 * (double)sim.p.mu_max[i]));
        }
        assert_true(mu > 0.1 * c);
        assert_near(sim.dt_next, least, 1e-12);
    } else if (strcmp(name, "courant") == 0)
        assert_near(sim.dt, 0.3 * (double)sim.p.h0[0] / (sqrt(1.0 + 4.0 / 3.0 * s->material.G) * 2.2),
                    FINE(1e-9, 2.0 * FLOAT_ROUNDING)); /* of c, and of the density before it */
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return name;
}

/* the change of u limits a compression of cold matter by the defaults: a tenth of u + K/(100 rho0) */
static void heat_limits_the_step(void **state) {
    (void)state;
    const double L[9] = {-0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    sphpa_particles p = set_of(2);
    sphpa_body body = body_of(0.2);
    body.rho = 1.3;
    add_ball(&p, 0.0, 0.0, 1.0, &body);
    set_linear_velocity(&p, L);
    for (size_t i = 0; i < p.n; i++) p.u[i] = 1e-3 * (double)i / (double)p.n;
    scene_of s = elastic(0.5);
    sphpa_sim sim;
    start(&s, &p, &sim);
    for (int k = 0; k < 3; k++) {
        double least = HUGE_VAL;
        step(&sim, HUGE_VAL);
        for (size_t i = 0; i < sim.p.n; i++)
            least = fmin(least, 0.1 * (sim.p.u[i] + 0.01) / fabs((double)sim.p.du[i]));
        assert_string_equal(sim.stats.limit[sim.stats.limit_last].name, "energy change");
        assert_near(sim.dt_next, least, 1e-12);
    }
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

/* u a little below 0 limits it as u = 0 does, not the more the nearer it comes to -K/(100 rho0) */
static void heat_below_zero_limits_as_none(void **state) {
    (void)state;
    const double L[9] = {-0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    sphpa_particles p = set_of(2);
    sphpa_body body = body_of(0.2);
    body.rho = 1.3;
    add_ball(&p, 0.0, 0.0, 1.0, &body);
    set_linear_velocity(&p, L);
    scene_of s = elastic(0.5);
    s.options.dt_growth = 1e9;
    sphpa_sim sim;
    start(&s, &p, &sim);
    for (size_t i = 0; i < sim.p.n; i++) sim.p.u[i] = -0.008;
    step(&sim, 1e-6);
    double least = HUGE_VAL;
    for (size_t i = 0; i < sim.p.n; i++) {
        assert_near(sim.p.u[i], -0.008, 1e-3);
        least = fmin(least, 0.1 * 0.01 / fabs((double)sim.p.du[i]));
    }
    assert_string_equal(sim.stats.limit[sim.stats.limit_last].name, "energy change");
    assert_near(sim.dt_next, least, 1e-12);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

static void limits_by_name(void **state) {
    (void)state;
    scene_of s = elastic(0.5);
    assert_string_equal(limit_of(&s, 1e-9), "courant");
    assert_string_equal(limit_of(&s, 5.0), "density change");
    s.solid.rho_step = 1e9;
    (void)limit_of(&s, -1.5);
    s.solid.rho_step = 1e9;
    s.solid.u_step = 1e-6;
    s.rubber.n = 4.0;
    sphpa_particles p = set_of(2); /* heat: a body under pressure that is pressed further */
    sphpa_body body = body_of(0.2);
    body.rho = 1.1;
    body.u = 0.1;
    add_ball(&p, 0.0, 0.0, 1.0, &body);
    static const double L[9] = {-0.1, 0, 0, 0, -0.1, 0, 0, 0, 0};
    set_linear_velocity(&p, L);
    sphpa_sim sim;
    start(&s, &p, &sim);
    step(&sim, HUGE_VAL);
    assert_string_equal(sim.stats.limit[sim.stats.limit_last].name, "energy change");
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

static void smoothing_length_stays_in_its_range(void **state) {
    (void)state;
    for (int k = 0; k < 3; k++) { /* 2: a material with a bound of its own */
        sphpa_particles p = set_of(2);
        sphpa_body body = body_of(0.2);
        add_ball(&p, 0.0, 0.0, 1.0, &body);
        double L[9];
        memset(L, 0, sizeof L);
        L[0] = L[4] = k ? 1.0 : -0.5;
        set_linear_velocity(&p, L);
        scene_of s = elastic(0.0);
        s.material.h_max = k == 2 ? 1.75 : 0.0;
        s.options.dt_fixed = 0.02;
        s.extra = ballistic();
        sphpa_sim sim;
        start(&s, &p, &sim);
        until(&sim, 1.0); /* to half, or twice, the size */
        double least = HUGE_VAL, most = 0.0;
        for (size_t i = 0; i < sim.p.n; i++) {
            least = fmin(least, (double)sim.p.h[i] / (double)sim.p.h0[i]);
            most = fmax(most, (double)sim.p.h[i] / (double)sim.p.h0[i]);
            for (size_t c = 0; c < 6; c++) assert_true((double)sim.p.S[6 * i + c] == 0.0);
        }
        if (k) assert_near(most, k == 2 ? 1.75 : 1.5, FINE(1e-15, FLOAT_ROUNDING));
        else assert_near(least, 0.6, FINE(1e-15, FLOAT_ROUNDING));
        /* and back: h goes by the density, whatever its bound cut off on the way */
        for (size_t i = 0; i < 3 * sim.p.n; i++) sim.p.v[i] = -sim.p.v[i];
        until(&sim, 2.0);
        for (size_t i = 0; i < sim.p.n; i++) {
            double back = sqrt((double)sim.p.rho_h0[i] / sim.p.rho[i]);
            assert_near((double)sim.p.h[i] / (double)sim.p.h0[i],
                        fmin(k == 2 ? 1.75 : 1.5, fmax(0.6, back)), FINE(1e-14, 2.0 * FLOAT_ROUNDING));
        }
        assert_near((double)sim.p.h[0], (double)sim.p.h0[0], 0.05);
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

static void bad_input_is_named(void **state) {
    (void)state;
    sphpa_particles p = set_of(2);
    sphpa_body body = body_of(0.4);
    add_ball(&p, 0.0, 0.0, 1.0, &body);
    scene_of s = elastic(0.5);
    sphpa_scene scene;
    sphpa_sim sim;
    sphpa_error err;
    memset(&scene, 0, sizeof scene);
    assert_int_equal(sphpa_scene_add(&scene, sphpa_solid(&s.solid)), SPHPA_OK);
    s.solid.material = NULL;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_ERROR_MISSING);
    s.solid.material = &s.material;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_ERROR_MATERIAL);
    s.material.eos = sphpa_murnaghan_eos(&s.rubber);
    s.material.G = -1.0;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_ERROR_MATERIAL);
    assert_non_null(strstr(err.message, "-1"));
    s.material.G = (double)NAN;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_ERROR_MATERIAL);
    s.material.G = (double)INFINITY;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_ERROR_MATERIAL);
    s.material.G = 1.0;
    const double bad_h[4] = {-2.0, (double)NAN, (double)INFINITY, 0.5}; /* h_min is 0.6 */
    for (int k = 0; k < 4; k++) {
        s.material.h_max = bad_h[k];
        assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_ERROR_MATERIAL);
        assert_non_null(strstr(err.message, "h_max"));
    }
    s.material.h_max = 0.0;
    s.solid.h_min = 1.8; /* above the default h_max, 1.5 */
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_ERROR_MATERIAL);
    assert_non_null(strstr(err.message, "1.8 and 1.5"));
    s.solid.h_max = 1.8; /* h stays h0: odd, and allowed */
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_OK);
    sphpa_sim_free(&sim);
    s.solid.h_min = s.solid.h_max = 0.0;
    p.material[3] = 7;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_ERROR_RANGE);
    assert_non_null(strstr(err.message, "material 7"));
    sphpa_particles_free(&p);
}

static void bad_numbers_are_named(void **state) {
    (void)state;
    static const char *const name[8] = {"artificial_stress", "artificial_exponent", "spacing",
                                        "h_min", "h_max", "rho_step", "u_step", "u_floor"};
    sphpa_particles p = set_of(2);
    sphpa_body body = body_of(0.4);
    add_ball(&p, 0.0, 0.0, 1.0, &body);
    for (int k = 0; k < 10; k++)
        for (int bad = 0; bad < 3; bad++) {
            scene_of s = elastic(0.5);
            s.material.eos = sphpa_murnaghan_eos(&s.rubber);
            s.solid.material = &s.material;
            double *const all[10] = {&s.solid.artificial_stress, &s.solid.artificial_exponent,
                                     &s.solid.spacing, &s.solid.h_min, &s.solid.h_max,
                                     &s.solid.rho_step, &s.solid.u_step, &s.solid.u_floor,
                                     &s.solid.viscosity.a, &s.solid.viscosity.b};
            if (bad == 2 && k > 7) continue; /* a negative viscosity is none */
            *all[k] = bad == 0 ? (double)NAN : bad == 1 ? (double)INFINITY : -0.5;
            sphpa_scene scene;
            sphpa_sim sim;
            sphpa_error err;
            memset(&scene, 0, sizeof scene);
            assert_int_equal(sphpa_scene_add(&scene, sphpa_solid(&s.solid)), SPHPA_OK);
            assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err),
                             bad == 2 ? SPHPA_ERROR_RANGE : SPHPA_ERROR_NOT_FINITE);
            assert_non_null(strstr(err.message, k < 8 ? name[k] : "viscosity"));
        }
    sphpa_particles_free(&p);
}

/* ---- rubber rings (Monaghan 2000) ---------------------------------------------------------------- */

static int in_ring(const double x[3], void *user) {
    const double *centre = (const double *)user;
    double r = hypot(x[0] - *centre, x[1]);
    return r > 3.0 && r < 4.0;
}

static void add_ring(sphpa_particles *p, double centre, double v, int number, double spacing) {
    sphpa_body body = body_of(spacing);
    body.u = 0.01;
    body.body = number;
    body.v[0] = v;
    const double low[3] = {centre - 4.1, -4.1, 0.0}, high[3] = {centre + 4.1, 4.1, 0.0};
    sphpa_error err;
    ok(sphpa_make_shape(p, in_ring, &centre, low, high, pi * 7.0, &body, &err), &err);
}

/* groups of one body's particles within `link`, and the largest gap to the nearest friend */
static int pieces(const sphpa_particles *p, int body, double link) {
    size_t n = p->n;
    uint32_t *root = (uint32_t *)malloc(n * sizeof *root);
    for (size_t i = 0; i < n; i++) root[i] = (uint32_t)i;
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < i && p->body[i] == body; j++) {
            if (p->body[j] != body ||
                hypot(p->x[3 * i] - p->x[3 * j], p->x[3 * i + 1] - p->x[3 * j + 1]) > link)
                continue;
            uint32_t a = (uint32_t)i, b = (uint32_t)j;
            while (root[a] != a) a = root[a];
            while (root[b] != b) b = root[b];
            root[a > b ? a : b] = a > b ? b : a;
        }
    int count = 0;
    for (size_t i = 0; i < n; i++) count += p->body[i] == body && root[i] == i;
    free(root);
    return count;
}

typedef struct rings {
    int pieces;
    double speed[2], energy; /* of the centres of mass; relative drift */
    double walk;             /* and what rounding to float may make of it */
} rings;

static rings collide_rings(double artificial, double t_end) {
#ifdef SPHPA_TEST_SMALL
    const double spacing = 0.333;
#else
    const double spacing = 0.29;
#endif
    sphpa_particles p = set_of(2);
    add_ring(&p, -4.1, 0.059, 0, spacing);
    add_ring(&p, 4.1, -0.059, 1, spacing);
    scene_of s = elastic(0.22);
    s.solid.artificial_stress = artificial;
    sphpa_sim sim;
    start(&s, &p, &sim);
    double before = sphpa_sim_totals(&sim).energy, mass = 0.0;
    until(&sim, t_end);
    rings out;
    memset(&out, 0, sizeof out);
    out.pieces = pieces(&sim.p, 0, 1.6 * spacing) + pieces(&sim.p, 1, 1.6 * spacing);
    for (size_t i = 0; i < sim.p.n; i++) {
        out.speed[sim.p.body[i]] += (double)sim.p.m[i] * (double)sim.p.v[3 * i];
        mass += 0.5 * (double)sim.p.m[i];
    }
    out.speed[0] /= mass;
    out.speed[1] /= mass;
    out.energy = sphpa_sim_totals(&sim).energy / before - 1.0;
    out.walk = float_walk(sim.stats.steps, sim.p.n);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return out;
}

static void rubber_rings_bounce(void **state) {
    (void)state;
    rings with = collide_rings(0.3, 120.0);
    print_message("# rings: %d pieces, speeds %.4f %.4f, energy %.1e\n", with.pieces, with.speed[0],
                  with.speed[1], with.energy);
    assert_int_equal(with.pieces, 2);
    assert_true(with.speed[0] < -0.01 && with.speed[1] > 0.01);
    assert_near_abs(with.speed[0] + with.speed[1], 0.0, FINE(1e-13, 0.059 * with.walk));
    assert_near_abs(with.energy, 0.0, FINE(1e-12, with.walk));
}

/* ---- threads ------------------------------------------------------------------------------------- */

static uint64_t hash_of(const void *data, size_t bytes, uint64_t hash) {
    const unsigned char *byte = (const unsigned char *)data;
    for (size_t k = 0; k < bytes; k++) hash = (hash ^ byte[k]) * 1099511628211u;
    return hash;
}

static uint64_t collide(int threads) {
    set_threads(threads);
    sphpa_particles p = set_of(3);
    sphpa_body body = body_of(0.16); /* enough for more than one thread to have work */
    body.u = 0.1;
    body.v[0] = 0.3;
    add_ball(&p, -1.05, 0.0, 1.0, &body);
    body.body = 1;
    body.v[0] = -0.3;
    add_ball(&p, 1.05, 0.3, 1.0, &body);
    scene_of s = elastic(0.5);
    s.solid.viscosity.balsara = 1;
    s.solid.artificial_stress = 0.3;
    sphpa_sim sim;
    start(&s, &p, &sim);
    for (int k = 0; k < 8; k++) step(&sim, HUGE_VAL);
    uint64_t hash = 14695981039346656037u;
    hash = hash_of(sim.p.x, 3 * sim.p.n * sizeof(double), hash);
    hash = hash_of(sim.p.v, 3 * sim.p.n * sizeof(sphpa_real), hash);
    hash = hash_of(sim.p.S, 6 * sim.p.n * sizeof(sphpa_real), hash);
    hash = hash_of(sim.p.u, sim.p.n * sizeof(double), hash);
    hash = hash_of(&sim.dt, sizeof(double), hash);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return hash;
}

static void threads_do_not_matter(void **state) {
    (void)state;
#ifdef _OPENMP
    int most = omp_get_max_threads();
    uint64_t one = collide(1);
    assert_true(collide(3) == one);
    omp_set_num_threads(most);
#else
    assert_true(collide(1) == collide(1));
#endif
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(linear_velocity_is_exact),
        cmocka_unit_test(thin_particle_is_not_torn_further),
        cmocka_unit_test(correction_is_the_inverse),
        cmocka_unit_test(correction_is_blended),
        cmocka_unit_test(density_is_mass_over_volume),
        cmocka_unit_test(shear_follows_jaumann),
        cmocka_unit_test(wave_speeds),
        cmocka_unit_test(unstressed_body_rests),
        cmocka_unit_test(collision_conserves),
        cmocka_unit_test(pressed_block_cools),
        cmocka_unit_test(heat_is_that_of_the_own_stress),
        cmocka_unit_test(forces_and_heat_by_hand),
        cmocka_unit_test(continuity_is_the_rate_of_the_sum),
        cmocka_unit_test(rotation_has_no_strain_rate),
        cmocka_unit_test(rotation_is_not_strain),
        cmocka_unit_test(bodies_do_not_glue),
        cmocka_unit_test(debris_does_not_pull),
        cmocka_unit_test(tension_stays_inside),
        cmocka_unit_test(noise_does_not_grow),
        cmocka_unit_test(limits_by_name),
        cmocka_unit_test(heat_limits_the_step),
        cmocka_unit_test(heat_below_zero_limits_as_none),
        cmocka_unit_test(smoothing_length_stays_in_its_range),
        cmocka_unit_test(bad_input_is_named),
        cmocka_unit_test(bad_numbers_are_named),
        cmocka_unit_test(rubber_rings_bounce),
        cmocka_unit_test(threads_do_not_matter),
    };
    return cmocka_run_group_tests_name("solid", tests, NULL, NULL);
}
