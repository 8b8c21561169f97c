/* Yield on particles: stress paths against the elastic-perfectly-plastic solution, heat, surfaces. */
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

/* rho0 = K = 1, G = 1/2; a flow that is homogeneous by force (every particle flies on as it was) */
typedef struct scene_of {
    sphpa_murnaghan metal;
    sphpa_solid_material material;
    sphpa_solid_params solid;
    sphpa_plastic_params plastic;
    sphpa_yield yield;
    sphpa_sim_options options;
    int free, yield_first; /* not 0: forces act; plastic is added before solid */
    int worn;              /* a pass gives every particle D, and names alpha, which they brought along */
    double D;
} scene_of;

static scene_of metal(sphpa_yield_kind kind, double Y0) {
    scene_of s;
    memset(&s, 0, sizeof s);
    s.metal.rho0 = s.metal.K = 1.0;
    s.metal.n = 1.0;
    s.material.G = 0.5;
    s.solid.materials = s.plastic.materials = 1;
    s.solid.correction = 1;
    s.solid.viscosity.a = s.solid.viscosity.b = -1.0;
    s.yield.kind = kind;
    s.yield.Y0 = Y0;
    return s;
}

static void ok(sphpa_result result, const sphpa_error *err) {
    if (result == SPHPA_OK) return;
    print_error("%s\n", err->message);
    fail();
}

static sphpa_result no_force(sphpa_sim *sim, void *params, size_t first, size_t last, size_t *bad) {
    (void)params;
    (void)bad;
    memset(sim->p.a + 3 * first, 0, 3 * (last - first) * sizeof(sphpa_real));
    return SPHPA_OK;
}

static sphpa_result give_damage(sphpa_sim *sim, void *params, size_t first, size_t last,
                                size_t *bad) {
    (void)bad;
    for (size_t i = first; i < last; i++) sim->p.D[i] = (sphpa_real)*(const double *)params;
    return SPHPA_OK;
}

static sphpa_result create(scene_of *s, const sphpa_particles *initial, sphpa_sim *sim,
                           sphpa_error *err) {
    sphpa_scene scene;
    sphpa_module fly;
    memset(&scene, 0, sizeof scene);
    memset(&fly, 0, sizeof fly);
    fly.name = "ballistic";
    fly.passes = 1;
    fly.pass[0].name = "no force";
    fly.pass[0].stage = SPHPA_STAGE_FORCES;
    fly.pass[0].writes = SPHPA_F(a);
    fly.pass[0].particle = no_force;
    if (s->worn) {
        fly.params = &s->D;
        fly.passes = 2;
        fly.pass[1].name = "given damage";
        fly.pass[1].stage = SPHPA_STAGE_GRADIENTS;
        fly.pass[1].reads = SPHPA_F(alpha);
        fly.pass[1].writes = SPHPA_F(D);
        fly.pass[1].particle = give_damage;
    }
    s->material.eos = sphpa_murnaghan_eos(&s->metal);
    s->solid.material = &s->material;
    s->plastic.yield = &s->yield;
    if (s->yield_first)
        assert_int_equal(sphpa_scene_add(&scene, sphpa_plastic(&s->plastic)), SPHPA_OK);
    assert_int_equal(sphpa_scene_add(&scene, sphpa_solid(&s->solid)), SPHPA_OK);
    if (!s->yield_first)
        assert_int_equal(sphpa_scene_add(&scene, sphpa_plastic(&s->plastic)), SPHPA_OK);
    if (!s->free) assert_int_equal(sphpa_scene_add(&scene, fly), SPHPA_OK);
    return sphpa_sim_create(sim, &scene, initial, &s->options, err);
}

static void start(scene_of *s, const sphpa_particles *initial, sphpa_sim *sim) {
    sphpa_error err;
    ok(create(s, initial, sim, &err), &err);
}

static void until(sphpa_sim *sim, double t_end) {
    sphpa_error err;
    while (sim->time < t_end * (1.0 - 1e-12))
        ok(sphpa_sim_step(sim, t_end - sim->time, &err), &err);
}

static sphpa_particles disc(int dim, double spacing) {
    sphpa_particles p;
    sphpa_body body;
    sphpa_error err;
    const double centre[3] = {0.0, 0.0, 0.0};
    memset(&body, 0, sizeof body);
    body.rho = 1.0;
    body.u = 0.01;
    body.spacing = spacing;
    ok(sphpa_make_begin(&p, dim, &err), &err);
    ok(sphpa_make_sphere(&p, centre, 1.0, &body, &err), &err);
    return p;
}

/* what is nearest to the centre, away from every surface */
static size_t middle(const sphpa_particles *p) {
    size_t best = 0;
    double least = HUGE_VAL;
    for (size_t i = 0; i < p->n; i++) {
        const double *x = p->x + 3 * i;
        double r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
        if (r2 < least) least = r2, best = i;
    }
    return best;
}

static double von_mises(const sphpa_real *S) {
    double sum = 0.0; /* the squares not in float */
    for (int k = 0; k < 6; k++) sum += (k < 3 ? 1.5 : 3.0) * (double)S[k] * (double)S[k];
    return sqrt(sum);
}

/* ---- uniaxial strain ---------------------------------------------------------------------------- */

/* e = ln(length) along x alone: S_xx = 4/3 G e until |S_xx| = 2/3 Y, then back from there */
static void uniaxial_strain_follows_the_cycle(void **state) {
    (void)state;
    const double Y = 0.05, G = 0.5, rate = 0.2;
    sphpa_particles p = disc(3, 0.22);
    for (size_t i = 0; i < p.n; i++) p.v[3 * i] = (sphpa_real)(-rate * p.x[3 * i]);
    scene_of s = metal(SPHPA_YIELD_VON_MISES, Y);
    s.options.dt_fixed = 0.005;
    sphpa_sim sim;
    start(&s, &p, &sim);
    double S = 0.0, e = 0.0, u = 0.01, work = 0.0;
    int yielding = 0, elastic = 0;
    for (int k = 0; k < 500; k++) { /* pressed for t = 1.25, then pulled */
        if (k == 250)
            for (size_t i = 0; i < 3 * sim.p.n; i++) sim.p.v[i] = -sim.p.v[i];
        until(&sim, 0.005 * (k + 1));
        double t = sim.time < 1.25 ? sim.time : 2.5 - sim.time, e_now = log(1.0 - rate * t);
        double trial = S + 4.0 / 3.0 * G * (e_now - e);
        double S_now = fmin(2.0 / 3.0 * Y, fmax(-2.0 / 3.0 * Y, trial));
        double rho = exp(-e_now);
        /* du = (S_xx - P) de/rho at the middle of the step */
        u += (0.5 * (S + S_now) - (exp(-0.5 * (e + e_now)) - 1.0)) * (e_now - e) *
             exp(0.5 * (e + e_now));
        work += 0.5 * (S + S_now) * (e_now - e) * exp(0.5 * (e + e_now));
        if (S_now == trial) elastic++;
        else yielding++;
        S = S_now, e = e_now;
        size_t i = middle(&sim.p);
        const sphpa_real *now = sim.p.S + 6 * i;
        assert_near(sim.p.rho[i], rho, 1e-4);
        assert_near_abs((double)now[0], S, 3e-5);
        assert_near_abs((double)now[1], -0.5 * S, 3e-5);
        assert_near_abs((double)now[2], -0.5 * S, 3e-5);
        assert_near_abs((double)now[3], 0.0, FINE(1e-12, FLOAT_ROUNDING * Y));
        assert_near_abs(sim.p.u[i], u, 1e-5 + 1e-4 * (u - 0.01));
    }
    assert_true(yielding > 100 && elastic > 100);
    /* back at the first shape: what is left is the plastic work */
    size_t i = middle(&sim.p);
    assert_near(sim.p.rho[i], 1.0, 1e-5);
    assert_true(work > 0.005);
    assert_near(sim.p.u[i] - 0.01, work, 2e-3);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

/* ---- pores and damage --------------------------------------------------------------------------- */

/* The surface of Collins, written out, for pressure P of the matrix at or above 0. */
static double collins_by_hand(const sphpa_yield *y, double P, double u, double D) {
    double whole = y->Y0 + y->mu_i * P / (1.0 + y->mu_i * P / (y->Ym - y->Y0));
    double broken = fmin(y->mu_d * P, whole);
    return ((1.0 - D) * whole + D * broken) * (1.0 - u / y->u_melt);
}

/* Of porous and damaged rock the surface is the matrix's, at its pressure alpha P and with D, and the
   bulk's deviator reaches it over alpha: in uniaxial strain sqrt(J2) = sqrt(3)/2 |S_xx|. */
static void pores_and_damage_weaken(void **state) {
    (void)state;
    double S[2][2];
    for (int porous = 0; porous < 2; porous++)
        for (int damaged = 0; damaged < 2; damaged++) {
            const double alpha = porous ? 1.6 : 1.0, D = damaged ? 0.4 : 0.0;
            sphpa_particles p = disc(3, 0.22);
            for (size_t i = 0; i < p.n; i++) {
                p.v[3 * i] = (sphpa_real)(-0.2 * p.x[3 * i]);
                p.alpha[i] = alpha;
            }
            scene_of s = metal(SPHPA_YIELD_COLLINS, 0.005);
            s.yield.Ym = 0.3;
            s.yield.mu_i = 0.4;
            s.yield.mu_d = 0.2;
            s.yield.u_melt = 0.5;
            s.worn = 1;
            s.material.damage_in_yield = 1;
            s.D = D;
            s.options.dt_fixed = 0.01;
            sphpa_sim sim;
            start(&s, &p, &sim);
            until(&sim, 1.0);
            size_t i = middle(&sim.p);
            double P = (double)sim.p.P[i];
            assert_near(P, sim.p.rho[i] - 1.0, FINE(1e-12, FLOAT_ROUNDING / 0.2));
            assert_near((double)sim.p.D[i], D, FLOAT_ROUNDING);
            double Y = collins_by_hand(&s.yield, alpha * P, sim.p.u[i], D) / alpha;
            assert_near(0.5 * sqrt(3.0) * fabs((double)sim.p.S[6 * i]), Y, FINE(1e-6, 1e-5));
            S[porous][damaged] = fabs((double)sim.p.S[6 * i]);
            sphpa_sim_free(&sim);
            sphpa_particles_free(&p);
        }
    /* each matters: 1/alpha where friction does not help, D where it does */
    assert_true(S[1][0] < 0.95 * S[0][0]);
    assert_true(S[0][1] < 0.95 * S[0][0] && S[1][1] < 0.95 * S[1][0]);
}

/* D weakens the deviator once: in Collins' surface or in the forces; else the scene is refused */
static void damage_counts_once(void **state) {
    (void)state;
    for (int k = 0; k < 4; k++) {
        sphpa_particles p = disc(2, 0.3);
        scene_of s = metal(k % 2 ? SPHPA_YIELD_COLLINS : SPHPA_YIELD_VON_MISES, 0.01);
        s.yield.Ym = 0.3;
        s.worn = 1;
        s.material.damage_in_yield = k / 2;
        sphpa_sim sim;
        sphpa_error err;
        sphpa_result result = create(&s, &p, &sim, &err);
        assert_int_equal(result, k % 2 == k / 2 ? SPHPA_OK : SPHPA_ERROR_MATERIAL);
        if (result != SPHPA_OK)
            assert_non_null(strstr(err.message, k % 2 ? "set damage_in_yield = 1" : "set damage_in_yield = 0"));
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

/* ---- simple shear ------------------------------------------------------------------------------- */

/* Jaumann: S_xy = G sin(g) until it reaches k = Y/sqrt3; then the stress is that of length k whose
   turning, 1 in g, holds the balance with the strain: S_xx = k^2/G, S_xy = k sqrt(1 - k^2/G^2). The
   step back to the surface is of first order in dt. */
static double shear_flow_error(double dt) {
    const double Y = 0.1, G = 0.5, k = Y / sqrt(3.0);
    sphpa_particles p = disc(2, 0.2);
    for (size_t i = 0; i < p.n; i++) p.v[3 * i] = (sphpa_real)p.x[3 * i + 1];
    scene_of s = metal(SPHPA_YIELD_VON_MISES, Y);
    s.options.dt_fixed = dt;
    sphpa_sim sim;
    start(&s, &p, &sim);
    until(&sim, 0.1); /* still elastic */
    size_t i = middle(&sim.p);
    assert_near((double)sim.p.S[6 * i + 3], G * sin(0.1), 1e-5);
    until(&sim, 0.5);
    double heat = sim.p.u[middle(&sim.p)];
    until(&sim, 0.8);
    i = middle(&sim.p);
    double flow = k * sqrt(1.0 - k * k / (G * G)), S_xx = (double)sim.p.S[6 * i];
    assert_near((double)sim.p.S[6 * i + 3], flow, 1e-3);
    assert_near((double)sim.p.S[6 * i + 1], -S_xx, FINE(1e-12, 2.0 * FLOAT_ROUNDING));
    assert_near(von_mises(sim.p.S + 6 * i), Y, FINE(1e-12, FLOAT_ROUNDING));
    assert_near(sim.p.u[i] - heat, 0.3 * flow, 1e-3); /* plastic work is heat */
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return fabs(S_xx - k * k / G) / (k * k / G);
}

static void simple_shear_flows(void **state) {
    (void)state;
    double coarse = shear_flow_error(0.01), fine = shear_flow_error(0.0025);
    print_message("# simple shear: S_xx off by %.1e, %.1e with a quarter of the step\n", coarse, fine);
    assert_true(fine < 0.02 && coarse > 3.5 * fine);
}

/* ---- free bodies -------------------------------------------------------------------------------- */

static sphpa_particles two_balls(double v) {
    sphpa_particles p;
    sphpa_body body;
    sphpa_error err;
    const double left[3] = {-1.05, 0.0, 0.0}, right[3] = {1.05, 0.3, 0.0};
    memset(&body, 0, sizeof body);
    body.rho = 1.0;
    body.u = 0.01;
    body.spacing = 0.3;
    body.v[0] = v;
    ok(sphpa_make_begin(&p, 3, &err), &err);
    ok(sphpa_make_sphere(&p, left, 1.0, &body, &err), &err);
    body.v[0] = -v;
    body.body = 1;
    ok(sphpa_make_sphere(&p, right, 1.0, &body, &err), &err);
    return p;
}

/* of a collision of weak balls: the share of the motion that became heat for good */
static double heat_of_collision(sphpa_yield_kind kind, double Y0) {
    sphpa_particles p = two_balls(0.2);
    scene_of s = metal(kind, Y0);
    s.free = 1;
    s.solid.viscosity.a = s.solid.viscosity.b = 0.0;
    s.yield.Ym = 0.3;
    s.yield.mu_i = 1.2;
    s.yield.mu_d = 0.6;
    s.yield.u_melt = 0.5;
    sphpa_sim sim;
    start(&s, &p, &sim);
    sphpa_totals first = sphpa_sim_totals(&sim);
    size_t on_surface = 0;
    while (sim.time < 8.0) {
        until(&sim, fmin(8.0, sim.time + 0.5));
        for (size_t i = 0; i < sim.p.n && kind != SPHPA_YIELD_NONE; i++) {
            double Y = sphpa_yield_strength(&s.yield, (double)sim.p.P[i], sim.p.u[i], 0.0);
            double size = von_mises(sim.p.S + 6 * i);
            if (kind == SPHPA_YIELD_COLLINS) size /= sqrt(3.0);
            assert_true(size <= Y * (1.0 + FINE(1e-12, FLOAT_ROUNDING)));
            on_surface += size > 0.999 * Y;
        }
    }
    if (kind != SPHPA_YIELD_NONE) assert_true(on_surface > sim.p.n);
    sphpa_totals last = sphpa_sim_totals(&sim);
    assert_true(sim.stats.u_below == 0);
    assert_near(last.energy, first.energy, FINE(1e-12, float_walk(sim.stats.steps, sim.p.n)));
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return (first.kinetic - last.kinetic) / first.kinetic;
}

static void plastic_work_heats(void **state) {
    (void)state;
    double elastic = heat_of_collision(SPHPA_YIELD_NONE, 0.0);
    double soft = heat_of_collision(SPHPA_YIELD_VON_MISES, 0.02);
    double rock = heat_of_collision(SPHPA_YIELD_COLLINS, 0.01);
    print_message("# share of the motion lost: elastic %.3f, von Mises %.3f, Collins %.3f\n", elastic,
                  soft, rock);
    assert_true(soft > elastic + 0.05 && rock > elastic + 0.02);
}

static void order_of_adding_does_not_matter(void **state) {
    (void)state;
    sphpa_particles p = two_balls(0.3);
    double x[2][3];
    for (int k = 0; k < 2; k++) {
        scene_of s = metal(SPHPA_YIELD_VON_MISES, 0.02);
        s.free = 1;
        s.yield_first = k;
        sphpa_sim sim;
        start(&s, &p, &sim);
        until(&sim, 1.0);
        memcpy(x[k], sim.p.x + 3 * (sim.p.n / 2), sizeof x[k]);
        sphpa_sim_free(&sim);
    }
    for (int a = 0; a < 3; a++) assert_true(x[0][a] == x[1][a]);
    sphpa_particles_free(&p);
}

/* two materials: each by its own surface, one by none */
static void every_material_has_its_surface(void **state) {
    (void)state;
    sphpa_particles p = two_balls(0.3);
    for (size_t i = 0; i < p.n; i++) p.material[i] = p.body[i];
    scene_of s = metal(SPHPA_YIELD_NONE, 0.0);
    sphpa_solid_material materials[2];
    sphpa_yield yields[2];
    sphpa_scene scene;
    sphpa_sim sim;
    sphpa_error err;
    memset(yields, 0, sizeof yields);
    memset(&scene, 0, sizeof scene);
    yields[1].kind = SPHPA_YIELD_VON_MISES;
    yields[1].Y0 = 0.02;
    s.material.eos = sphpa_murnaghan_eos(&s.metal);
    materials[0] = materials[1] = s.material;
    s.solid.material = materials;
    s.plastic.yield = yields;
    s.solid.materials = s.plastic.materials = 2;
    assert_int_equal(sphpa_scene_add(&scene, sphpa_solid(&s.solid)), SPHPA_OK);
    assert_int_equal(sphpa_scene_add(&scene, sphpa_plastic(&s.plastic)), SPHPA_OK);
    ok(sphpa_sim_create(&sim, &scene, &p, &s.options, &err), &err);
    until(&sim, 1.5);
    double most[2] = {0.0, 0.0};
    for (size_t i = 0; i < sim.p.n; i++) {
        int k = sim.p.material[i];
        most[k] = fmax(most[k], von_mises(sim.p.S + 6 * i));
    }
    assert_true(most[0] > 0.04);
    assert_near(most[1], 0.02, FINE(1e-12, FLOAT_ROUNDING));
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

static void bad_input_is_named(void **state) {
    (void)state;
    sphpa_particles p = two_balls(0.0);
    scene_of s = metal(SPHPA_YIELD_VON_MISES, -1.0);
    sphpa_scene scene;
    sphpa_sim sim;
    sphpa_error err;
    memset(&scene, 0, sizeof scene);
    s.material.eos = sphpa_murnaghan_eos(&s.metal);
    s.solid.material = &s.material;
    assert_int_equal(sphpa_scene_add(&scene, sphpa_solid(&s.solid)), SPHPA_OK);
    assert_int_equal(sphpa_scene_add(&scene, sphpa_plastic(&s.plastic)), SPHPA_OK);
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_ERROR_MISSING);
    s.plastic.yield = &s.yield;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_ERROR_RANGE);
    assert_non_null(strstr(err.message, "Y0 = -1"));
    s.yield.Y0 = 1.0;
    s.yield.kind = (sphpa_yield_kind)9;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_ERROR_RANGE);
    s.yield.kind = SPHPA_YIELD_VON_MISES;
    s.plastic.materials = 0;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_ERROR_MISSING);
    s.plastic.materials = 1; /* alone, it would let everything fly on */
    memset(&scene, 0, sizeof scene);
    assert_int_equal(sphpa_scene_add(&scene, sphpa_plastic(&s.plastic)), SPHPA_OK);
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, NULL, &err), SPHPA_ERROR_MISSING);
    assert_non_null(strstr(err.message, "plastic: the scene has no sphpa_solid()"));
    sphpa_particles_free(&p);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(uniaxial_strain_follows_the_cycle),
        cmocka_unit_test(pores_and_damage_weaken),
        cmocka_unit_test(damage_counts_once),
        cmocka_unit_test(simple_shear_flows),
        cmocka_unit_test(plastic_work_heats),
        cmocka_unit_test(order_of_adding_does_not_matter),
        cmocka_unit_test(every_material_has_its_surface),
        cmocka_unit_test(bad_input_is_named),
    };
    return cmocka_run_group_tests_name("plastic", tests, NULL, NULL);
}
