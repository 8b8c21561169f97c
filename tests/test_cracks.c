/* Flaws and damage on particles: counts, seeds, growth against one state alone, strength and rate. */
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

/* rho0 = K = 1, G = 0.6; a cube of edge 1; k V = 1e12, so that flaw 1 opens at 1e-12^(1/9) = 0.046 */
typedef struct scene_of {
    sphpa_murnaghan rock;
    sphpa_solid_material material[2];
    sphpa_solid_params solid;
    sphpa_cracks_material flaws[2];
    sphpa_cracks_params cracks;
    sphpa_sim_options options;
    double pull; /* [1/s] every particle flies on as it was: strain along x alone, of this rate */
    int porous;  /* with the particles' alpha, which a pass of the scene names and none changes */
    int damage_first;
    sphpa_module extra; /* added last, if it has a name */
} scene_of;

static scene_of rock(void) {
    scene_of s;
    memset(&s, 0, sizeof s);
    s.rock.rho0 = s.rock.K = 1.0;
    s.rock.n = 1.0;
    s.material[0].G = 0.6;
    s.solid.materials = 1;
    s.solid.correction = 1;
    s.solid.viscosity.a = s.solid.viscosity.b = -1.0;
    s.flaws[0].k = 1e12;
    s.flaws[0].m = 9.0;
    s.cracks.seed = 12;
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
    if (s->porous) fly.pass[0].reads = SPHPA_F(alpha);
    for (int k = 0; k < 2; k++) s->material[k].eos = sphpa_murnaghan_eos(&s->rock);
    s->solid.material = s->material;
    s->cracks.solid = &s->solid;
    s->cracks.material = s->flaws;
    if (s->damage_first) assert_int_equal(sphpa_scene_add(&scene, sphpa_cracks(&s->cracks)), SPHPA_OK);
    assert_int_equal(sphpa_scene_add(&scene, sphpa_solid(&s->solid)), SPHPA_OK);
    if (!s->damage_first)
        assert_int_equal(sphpa_scene_add(&scene, sphpa_cracks(&s->cracks)), SPHPA_OK);
    if (s->pull != 0.0) assert_int_equal(sphpa_scene_add(&scene, fly), SPHPA_OK);
    if (s->extra.name != NULL) assert_int_equal(sphpa_scene_add(&scene, s->extra), SPHPA_OK);
    return sphpa_sim_create(sim, &scene, initial, &s->options, err);
}

static void start(scene_of *s, const sphpa_particles *initial, sphpa_sim *sim) {
    sphpa_error err;
    ok(create(s, initial, sim, &err), &err);
}

static void step(sphpa_sim *sim, double limit) {
    sphpa_error err;
    ok(sphpa_sim_step(sim, limit, &err), &err);
}

static sphpa_particles porous_cube(int edge, double pull, double alpha) {
    sphpa_particles p;
    sphpa_body body;
    sphpa_error err;
    const double low[3] = {0.0, 0.0, 0.0}, high[3] = {1.0, 1.0, 1.0};
    memset(&body, 0, sizeof body);
    memset(&p, 0, sizeof p);
    body.rho = 1.0;
    body.u = 1.0;
    body.alpha = alpha;
    body.spacing = 1.0 / edge;
    ok(sphpa_make_box(&p, low, high, &body, &err), &err);
    for (size_t i = 0; i < p.n; i++) p.v[3 * i] = (sphpa_real)(pull * p.x[3 * i]);
    return p;
}

static sphpa_particles cube(int edge, double pull) {
    return porous_cube(edge, pull, 1.0);
}

/* where the particle of that number is */
static size_t of_id(const sphpa_particles *p, int64_t id) {
    for (size_t i = 0; i < p->n; i++)
        if (p->id[i] == id) return i;
    fail();
    return 0;
}

/* ---- flaws -------------------------------------------------------------------------------------- */

/* the whole body's flaws below eps, from what the particles hold */
static double flaws_below(const sphpa_sim *sim, const scene_of *s, double eps) {
    double sum = 0.0;
    for (size_t i = 0; i < sim->p.n; i++) {
        if (s->cracks.keep_all) {
            sum += sphpa_flaws_active_list(eps, s->cracks.pool + sim->p.flaw_first[i],
                                           sim->p.flaw_count[i]);
            continue;
        }
        sphpa_flaws few = {sim->p.flaw_min[i], (double)sim->p.flaw_exponent[i],
                           sim->p.flaw_count[i]};
        sum += sphpa_flaws_active(&few, eps);
    }
    return sum;
}

static void counts_follow_weibull(void **state) {
    (void)state;
    sphpa_particles p = cube(12, 0.0);
    double n = (double)p.n;
    for (int kind = 0; kind < 3; kind++) { /* all kept, compressed, sampled */
        scene_of s = rock();
        s.cracks.keep_all = kind == 0;
        s.cracks.sampled = kind == 2;
        sphpa_sim sim;
        start(&s, &p, &sim);
        double total = 0.0;
        for (size_t i = 0; i < sim.p.n; i++) {
            assert_true(sim.p.flaw_count[i] >= 1 && sim.p.flaw_min[i] > 0.0);
            total += sim.p.flaw_count[i];
        }
        assert_near(total, n * (log(n) + 0.5772), 0.25);
        assert_true((s.cracks.pool != NULL) == (kind == 0));
        if (kind == 0) assert_true(s.cracks.pool_count == (size_t)total);
        for (double share = 0.01; share < 3.0; share *= 2.0) {
            double eps = pow(share * n / 1e12, 1.0 / 9.0), wish = share * n;
            double got = flaws_below(&sim, &s, eps);
            if (kind == 0) assert_near_abs(got, wish, 1.001); /* the walk: exact */
            else assert_true(got > wish - 5.0 * sqrt(wish) && got < 1.25 * wish + 5.0 * sqrt(wish));
        }
        sphpa_sim_free(&sim);
        assert_null(s.cracks.pool);
    }
    sphpa_particles_free(&p);
}

/* flaws go by seed and number, not by place in memory; another seed gives others */
static void seeds_decide(void **state) {
    (void)state;
    sphpa_particles p = cube(8, 0.0), turned = cube(8, 0.0);
    uint32_t *order = (uint32_t *)malloc(p.n * sizeof *order);
    sphpa_rng rng = sphpa_rng_seed(1, 1);
    sphpa_error err;
    for (uint32_t i = 0; i < p.n; i++) order[i] = i;
    for (uint32_t i = (uint32_t)p.n - 1; i > 0; i--) {
        uint32_t j = sphpa_rng_below(&rng, i + 1), keep = order[i];
        order[i] = order[j];
        order[j] = keep;
    }
    ok(sphpa_particles_permute(&turned, order, &err), &err);
    for (int kind = 0; kind < 3; kind++) {
        scene_of a = rock(), b = rock(), c = rock();
        a.cracks.keep_all = b.cracks.keep_all = c.cracks.keep_all = kind == 0;
        a.cracks.sampled = b.cracks.sampled = c.cracks.sampled = kind == 2;
        c.cracks.seed = 13;
        sphpa_sim one, two, three;
        start(&a, &p, &one);
        start(&b, &turned, &two);
        start(&c, &p, &three);
        size_t same = 0;
        for (size_t i = 0; i < p.n; i++) {
            size_t j = of_id(&two.p, one.p.id[i]), k = of_id(&three.p, one.p.id[i]);
            assert_true(one.p.flaw_min[i] == two.p.flaw_min[j]);
            assert_true(one.p.flaw_exponent[i] == two.p.flaw_exponent[j]);
            assert_true(one.p.flaw_count[i] == two.p.flaw_count[j]);
            same += fabs(one.p.flaw_min[i] / three.p.flaw_min[k] - 1.0) < 1e-3;
        }
        assert_true(same < p.n / 10);
        sphpa_sim_free(&one);
        sphpa_sim_free(&two);
        sphpa_sim_free(&three);
    }
    free(order);
    sphpa_particles_free(&p);
    sphpa_particles_free(&turned);
}

/* Every set of particles and every particle draws from a stream of its own: two materials of one body
   that alternate, with the same flaws a volume, do not get the same ones, nor a particle those that
   its number would give as a body. */
static void streams_are_apart(void **state) {
    (void)state;
    for (int sampled = 0; sampled < 2; sampled++) {
        sphpa_particles p = cube(6, 0.0);
        for (size_t i = 0; i < p.n; i++) p.material[i] = p.id[i] % 2;
        scene_of s = rock();
        s.solid.materials = 2;
        s.material[1] = s.material[0];
        s.flaws[1] = s.flaws[0];
        s.cracks.sampled = sampled;
        sphpa_sim sim;
        start(&s, &p, &sim);
        int same = 0;
        for (int64_t id = 0; id < (int64_t)p.n; id += 2)
            same += fabs(sim.p.flaw_min[of_id(&sim.p, id)] / sim.p.flaw_min[of_id(&sim.p, id + 1)] -
                         1.0) < 1e-3;
        assert_true(same < (int)p.n / 20);
        if (sampled) { /* body 0, material 0: stream 0 */
            sphpa_rng of_body = sphpa_rng_seed(s.cracks.seed, 0), again = of_body;
            const sphpa_flaw_params params = {s.flaws[0].k, s.flaws[0].m, 0.5};
            sphpa_flaws few;
            double stop = sphpa_flaw_stopping_time(p.n / 2, &of_body);
            assert_int_equal(sphpa_flaw_sample(&params, p.n / 2, &again, stop, &few), SPHPA_OK);
            assert_true(fabs(few.eps_min / sim.p.flaw_min[of_id(&sim.p, 0)] - 1.0) > 1e-3);
        }
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

/* every body has flaws of its own volume; a material without flaws has none and stays whole */
static void bodies_and_materials(void **state) {
    (void)state;
    sphpa_particles p = cube(6, 0.5);
    scene_of s = rock();
    s.solid.materials = 2;
    s.material[1] = s.material[0];
    s.flaws[0].k = 1e14;
    s.pull = 0.5;
    for (size_t i = 0; i < p.n; i++) p.material[i] = p.body[i] = p.x[3 * i + 2] > 0.5;
    sphpa_sim sim;
    start(&s, &p, &sim);
    double weakest = HUGE_VAL;
    for (size_t i = 0; i < sim.p.n; i++)
        if (sim.p.body[i] == 0) weakest = fmin(weakest, sim.p.flaw_min[i]);
        else assert_true(sim.p.flaw_count[i] == 0);
    /* half the cube's volume, to the power 1/9, of masses that are all rounded alike */
    assert_near(weakest, pow(1.0 / (1e14 * 0.5), 1.0 / 9.0), FINE(1e-12, FLOAT_ROUNDING / 9.0));
    while (sim.time < 1.0) step(&sim, 1.0 - sim.time);
    double most = 0.0;
    for (size_t i = 0; i < sim.p.n; i++)
        if (sim.p.body[i] == 0) most = fmax(most, (double)sim.p.D[i]);
        else assert_true((double)sim.p.D[i] == 0.0 && (double)sim.p.n_act[i] == 0.0);
    assert_true(most > 0.5);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

/* Of porous bodies the flaws are those of the solid volume, V/alpha. */
static void pores_have_no_flaws(void **state) {
    (void)state;
    for (int kind = 0; kind < 3; kind++) { /* all kept, compressed, sampled */
        double weakest[2], sum[2] = {0.0, 0.0};
        for (int k = 0; k < 2; k++) {
            const double alpha = k == 0 ? 1.0 : 3.0;
            sphpa_particles p = porous_cube(6, 0.1, alpha);
            scene_of s = rock();
            s.pull = 0.1;
            s.porous = 1;
            s.cracks.keep_all = kind == 0;
            s.cracks.sampled = kind == 2;
            sphpa_sim sim;
            start(&s, &p, &sim);
            weakest[k] = HUGE_VAL;
            for (size_t i = 0; i < sim.p.n; i++) {
                weakest[k] = fmin(weakest[k], sim.p.flaw_min[i]);
                sum[k] += log(sim.p.flaw_min[i]);
            }
            if (kind < 2)
                assert_near(weakest[k], pow(alpha / 1e12, 1.0 / 9.0),
                            FINE(1e-12, FLOAT_ROUNDING / 9.0));
            sphpa_sim_free(&sim);
            sphpa_particles_free(&p);
        }
        /* the same draws, each at a strain that is 3^(1/9) times as large */
        assert_near(weakest[1] / weakest[0], pow(3.0, 1.0 / 9.0), FINE(1e-12, FLOAT_ROUNDING));
        assert_near((sum[1] - sum[0]) / 216.0, log(3.0) / 9.0, FINE(1e-12, FLOAT_ROUNDING));
    }
}

/* bodies are numbered as anybody likes, to the ends of an int32 */
static void any_body_number(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        sphpa_particles p = cube(5, 0.0);
        for (size_t i = 0; i < p.n; i++) p.body[i] = k ? INT32_MIN : INT32_MAX;
        scene_of s = rock();
        sphpa_sim sim;
        start(&s, &p, &sim);
        for (size_t i = 0; i < sim.p.n; i++) assert_true(sim.p.flaw_count[i] >= 1);
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

static sphpa_result spring_back(sphpa_sim *sim, void *params, size_t first, size_t last,
                                size_t *bad) {
    (void)params, (void)bad;
    for (size_t i = first; i < last; i++) {
        sim->p.alpha_min[i] = 1.2;
        sim->p.alpha[i] = sim->time < 0.05 ? 1.2 : 1.25;
    }
    return SPHPA_OK;
}

/* damage by compaction is that of the least distention: what springs back does not heal */
static void compaction_does_not_heal(void **state) {
    (void)state;
    sphpa_particles p = porous_cube(5, 0.0, 1.5);
    scene_of s = rock();
    sphpa_sim sim;
    s.extra.name = "spring";
    s.extra.passes = 1;
    s.extra.pass[0].name = "spring back";
    s.extra.pass[0].stage = SPHPA_STAGE_PRESSURE;
    s.extra.pass[0].advances = SPHPA_F(alpha) | SPHPA_F(alpha_min);
    s.extra.pass[0].particle = spring_back;
    s.extra.pass[0].at_commit = 1;
    s.flaws[0].k = 0.0;
    s.flaws[0].alpha0 = 1.5;
    s.options.dt_fixed = 0.02;
    start(&s, &p, &sim);
    double want = sphpa_damage_compaction(1.2, 1.5);
    assert_true(want > sphpa_damage_compaction(1.25, 1.5) + 0.01);
    for (int k = 0; k < 6; k++) {
        step(&sim, HUGE_VAL);
        for (size_t i = 0; i < sim.p.n; i++)
            assert_near((double)sim.p.D[i], sphpa_damage_total(0.0, want), FLOAT_ROUNDING);
    }
    assert_true(sim.p.alpha[0] == 1.25);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

/* ---- growth against one state alone -------------------------------------------------------------- */

/* The state of one particle under v = pull x along x, by itself. Of porous matter: S and P are the
   bulk's, the strain that opens flaws and the density in the cracks' speed are the matrix's. */
typedef struct alone {
    double D13, n_act, sigma; /* sigma: (1-D) (S_xx - P) */
} alone;

/* the step from t to t + dt: strain e, density, elastic stress, flaws, growth */
static void advance_alone(alone *one, const sphpa_flaws *flaws, double pull, double t, double dt,
                          double h0, double alpha) {
    double e = log(1.0 + pull * (t + dt)), rho = exp(-e), P = rho - 1.0;
    double S_xx = 4.0 / 3.0 * 0.6 * e, strain = alpha * (S_xx - P) * 3.6 / (9.0 * 0.6);
    one->n_act = fmax(one->n_act, sphpa_flaws_active(flaws, strain));
    double c_g = 0.4 * sqrt((1.0 + 0.8) / (alpha * rho)), radius = 2.0 * fmin(h0 * exp(e / 3.0), 1.5 * h0);
    one->D13 = fmax(one->D13, fmin(cbrt(one->n_act / flaws->count),
                                   one->D13 + dt * cbrt(one->n_act) * c_g / radius));
    one->sigma = (1.0 - fmin(1.0, one->D13 * one->D13 * one->D13)) * (S_xx - P);
}

static sphpa_flaws flaws_of(const sphpa_particles *p, size_t i) {
    sphpa_flaws flaws = {p->flaw_min[i], (double)p->flaw_exponent[i], p->flaw_count[i]};
    return flaws;
}

/* far enough from the faces (and edges, where C is blended) of the cube when it was one */
static int inside(int64_t id, int edge) {
    for (int a = 0; a < 3; a++, id /= edge)
        if (id % edge < 2 || id % edge >= edge - 2) return 0;
    return 1;
}

static void damage_grows_as_of_one_state(void **state) {
    (void)state;
    const double pull = 0.2, dt = 0.005;
    const int steps = 160;
    for (int kind = 0; kind < 3; kind += SMALL ? 2 : 1) { /* both integrators, dense; one with pores */
        const double alpha = kind == 2 ? 1.5 : 1.0;
        sphpa_particles p = porous_cube(8, pull, alpha);
        scene_of s = rock();
        s.pull = pull;
        s.porous = kind == 2;
        s.solid.any_neighbour = 1;
        s.options.dt_fixed = dt;
        s.options.integrator = (sphpa_integrator)(kind % 2);
        sphpa_sim sim;
        start(&s, &p, &sim);
        double *before = (double *)calloc(p.n, 2 * sizeof *before);
        for (int k = 0; k < steps; k++) {
            step(&sim, HUGE_VAL);
            for (size_t i = 0; i < sim.p.n; i++) { /* never back, never beyond one step's growth */
                double *old = before + 2 * sim.p.id[i], D13 = (double)sim.p.D13[i];
                double n_act = (double)sim.p.n_act[i];
                assert_true(D13 >= old[0] && n_act >= old[1]);
                double most = old[0] + dt * cbrt(n_act) * 0.4 * sqrt(1.8 / (alpha * sim.p.rho[i])) /
                                           (2.0 * (double)sim.p.h[i]);
                /* D13 is rounded, and a third of the rounding of n_act is in `most` */
                assert_true(D13 <= most * (1.0 + FINE(1e-12, 4.0 / 3.0 * FLOAT_ROUNDING)));
                /* a cube takes three times the rounding of D13, then D is rounded itself */
                assert_true((double)sim.p.D[i] == fmin(1.0, D13 * D13 * D13) ||
                            fabs((double)sim.p.D[i] - D13 * D13 * D13) <
                                FINE(1e-15, 4.0 * FLOAT_ROUNDING));
                old[0] = D13;
                old[1] = n_act;
            }
        }
        int checked = 0, broken = 0;
        for (size_t i = 0; i < sim.p.n; i++) {
            sphpa_flaws flaws = flaws_of(&sim.p, i);
            alone one = {0.0, 0.0, 0.0};
            if (!inside(sim.p.id[i], 8)) continue;
            for (int k = 0; k < steps; k++)
                advance_alone(&one, &flaws, pull, k * dt, dt, (double)sim.p.h0[i], alpha);
            assert_near_abs((double)sim.p.n_act[i], one.n_act, 0.1);
            assert_near_abs((double)sim.p.D13[i], one.D13, 2e-3);
            checked++;
            broken += one.D13 > 0.5;
        }
        assert_true(checked == 64 && broken > 10);
        for (size_t i = 0; i < 3 * sim.p.n; i++) sim.p.v[i] = -sim.p.v[i]; /* let go: nothing heals */
        for (int k = 0; k < steps / 2; k++) step(&sim, HUGE_VAL);
        for (size_t i = 0; i < sim.p.n; i++) {
            assert_true((double)sim.p.D13[i] >= before[2 * sim.p.id[i]]);
            assert_true((double)sim.p.n_act[i] >= before[2 * sim.p.id[i] + 1]);
        }
        free(before);
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

/* ---- strength and rate --------------------------------------------------------------------------- */

/* A cube that is pulled at a steady rate: the largest tension that its inner particles bear together
   on the way, and the same of the particles each alone. */
static double strength(double pull, double *expected) {
    enum { EDGE = 8 };
    sphpa_particles p = cube(EDGE, pull);
    scene_of s = rock();
    s.pull = pull;
    s.solid.any_neighbour = 1;
    s.options.dt_fixed = 0.004 / pull;
    sphpa_sim sim;
    start(&s, &p, &sim);
    alone one[EDGE * EDGE * EDGE];
    memset(one, 0, sizeof one);
    double most = 0.0, sum = 1.0;
    *expected = 0.0;
    while (sum > 0.8 * most) {
        double t = sim.time, other = 0.0;
        step(&sim, HUGE_VAL);
        sum = 0.0;
        for (size_t i = 0; i < sim.p.n; i++) {
            if (!inside(sim.p.id[i], EDGE)) continue;
            double whole = 1.0 - (double)sim.p.D[i];
            sphpa_flaws flaws = flaws_of(&sim.p, i);
            sum += whole * (double)(sim.p.S[6 * i] - sim.p.P[i]) / 64.0;
            advance_alone(&one[sim.p.id[i]], &flaws, pull, t, sim.dt, (double)sim.p.h0[i],
                          1.0);
            other += one[sim.p.id[i]].sigma / 64.0;
        }
        most = fmax(most, sum);
        *expected = fmax(*expected, other);
        assert_true(sim.stats.steps < 1000);
    }
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return most;
}

static void strength_is_that_of_the_particles(void **state) {
    (void)state;
    double one, two, slow = strength(0.1, &one), fast = strength(1.6, &two);
    print_message("# cube: strength %.4f (alone %.4f) at rate 0.1, %.4f (%.4f) at 1.6\n", slow, one,
                  fast, two);
    assert_near(slow, one, 0.01);
    assert_near(fast, two, 0.01);
    assert_true(fast > 1.2 * slow);
}

/* A rod of length 1 that expands at `rate`: largest mean tension on the way. Broken particles unload
   their neighbours at the speed of sound, so along a line eps^(m+1) ~ rate/(k c) (Grady & Kipp with
   one dimension in place of three). */
static double rod(double rate, int n, uint64_t seed, int *fragments) {
    sphpa_particles p;
    sphpa_body body;
    sphpa_error err;
    const double low[3] = {-0.5, 0.0, 0.0}, high[3] = {0.5, 0.0, 0.0};
    memset(&body, 0, sizeof body);
    body.rho = 1.0;
    body.u = 1.0;
    body.spacing = 1.0 / n;
    ok(sphpa_make_begin(&p, 1, &err), &err);
    ok(sphpa_make_box(&p, low, high, &body, &err), &err);
    for (size_t i = 0; i < p.n; i++) p.v[3 * i] = (sphpa_real)(rate * p.x[3 * i]);
    scene_of s = rock();
    s.solid.viscosity.a = s.solid.viscosity.b = 0.0;
    s.flaws[0].k = 1e8;
    s.flaws[0].m = 3.0;
    s.cracks.seed = seed;
    sphpa_sim sim;
    start(&s, &p, &sim);
    double most = 0.0, sum = 1.0;
    while (sum > 0.2 * most) {
        step(&sim, HUGE_VAL);
        sum = 0.0;
        for (size_t i = 0; i < sim.p.n; i++) {
            double whole = 1.0 - (double)sim.p.D[i], P = (double)sim.p.P[i];
            sum += (whole * (double)sim.p.S[6 * i] - (P < 0.0 ? whole * P : P)) / (double)sim.p.n;
        }
        most = fmax(most, sum);
    }
    *fragments = 1;
    for (size_t i = 1; i + 1 < sim.p.n; i++) { /* in 1-D the order is that of the places */
        size_t j = i - 1;
        *fragments += (double)sim.p.D[j] > 0.9 && (double)sim.p.D[i] <= 0.9;
    }
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return most;
}

static void faster_rods_are_stronger(void **state) {
    (void)state;
    double mean[3] = {0.0, 0.0, 0.0}, pieces[3] = {0.0, 0.0, 0.0};
    const uint64_t seeds = SMALL ? 1 : 3;
    for (int k = 0; k < 3; k++)
        for (uint64_t seed = 1; seed <= seeds; seed++) {
            int fragments;
            mean[k] += rod(0.025 * pow(4.0, k), 400, seed, &fragments) / (double)seeds;
            pieces[k] += fragments / (double)seeds;
        }
    double exponent = log(mean[2] / mean[0]) / log(16.0);
    print_message("# rod: strength %.5f %.5f %.5f, pieces %.1f %.1f %.1f: exponent %.3f\n", mean[0],
                  mean[1], mean[2], pieces[0], pieces[1], pieces[2], exponent);
    assert_near_abs(exponent, 0.25, 0.1);
    assert_true(pieces[0] < pieces[1] && pieces[1] < pieces[2]);
}

/* ---- what damage does ---------------------------------------------------------------------------- */

/* acceleration of a stressed pair of halves: fully damaged material carries pressure, no tension */
static double force_at(double D13, double rho, double S_xx) {
    sphpa_particles p = cube(6, 0.0);
    scene_of s = rock();
    sphpa_sim sim;
    for (size_t i = 0; i < p.n; i++) p.rho[i] = rho;
    start(&s, &p, &sim);
    for (size_t i = 0; i < sim.p.n; i++) {
        sim.p.D13[i] = (sphpa_real)D13;
        sim.p.S[6 * i] = (sphpa_real)S_xx;
        sim.p.S[6 * i + 1] = sim.p.S[6 * i + 2] = (sphpa_real)(-0.5 * S_xx);
    }
    step(&sim, 1e-9);
    double a = (double)sim.p.a[3 * of_id(&sim.p, 0)]; /* in the corner at 0 */
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return a;
}

static void damaged_material_carries_pressure_alone(void **state) {
    (void)state;
    double pressed = force_at(0.0, 1.02, 0.0), pulled = force_at(0.0, 0.98, 0.0);
    double sheared = force_at(0.0, 1.0, 0.02);
    assert_true(pressed < -0.01 && pulled > 0.01 && sheared > 0.01);
    assert_near(force_at(1.0, 1.02, 0.0), pressed, 1e-9);
    assert_true(force_at(1.0, 0.98, 0.0) == 0.0);
    assert_true(force_at(1.0, 1.0, 0.02) == 0.0);
    assert_near(force_at(cbrt(0.25), 0.98, 0.0), 0.75 * pulled, 1e-6); /* once, not twice */
    assert_near(force_at(cbrt(0.25), 1.0, 0.02), 0.75 * sheared, 1e-6);
}

/* a cube torn apart: total energy to rounding while it breaks; outputs in between open no flaws */
static void torn_cube_conserves(void **state) {
    (void)state;
    double x[2];
    for (int watched = 0; watched < 2; watched++) {
        sphpa_particles p = cube(8, 0.6);
        scene_of s = rock();
        s.solid.viscosity.a = s.solid.viscosity.b = 0.0;
        sphpa_sim sim;
        sphpa_error err;
        start(&s, &p, &sim);
        sphpa_totals first = sphpa_sim_totals(&sim);
        while (sim.time < 1.0) {
            step(&sim, 1.0 - sim.time);
            for (int k = 0; watched && k < 2; k++) {
                double n_act = (double)sim.p.n_act[7], D13 = (double)sim.p.D13[7];
                int64_t id = sim.p.id[7];
                ok(sphpa_sim_refresh(&sim, &err), &err);
                size_t i = of_id(&sim.p, id);
                assert_true((double)sim.p.n_act[i] == n_act && (double)sim.p.D13[i] == D13);
            }
        }
        sphpa_totals last = sphpa_sim_totals(&sim);
        double most = 0.0;
        for (size_t i = 0; i < sim.p.n; i++) most = fmax(most, (double)sim.p.D[i]);
        assert_true(most > 0.9);
        assert_near(last.energy, first.energy, FINE(1e-12, float_walk(sim.stats.steps, sim.p.n)));
        x[watched] = sim.p.x[3 * of_id(&sim.p, 100)];
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
    /* no more than another order of sums, each rounded, over some hundred steps */
    assert_near(x[0], x[1], FINE(1e-10, 100.0 * FLOAT_ROUNDING));
}

/* all flaws kept against two numbers a particle: means over the body on the way */
static void compressed_agrees_with_all(void **state) {
    (void)state;
    double mean[2] = {0.0, 0.0}, open[2] = {0.0, 0.0};
    for (int keep = 0; keep < 2; keep++) {
        sphpa_particles p = cube(10, 0.2);
        scene_of s = rock();
        s.pull = 0.2;
        s.solid.any_neighbour = 1;
        s.cracks.keep_all = keep;
        s.options.dt_fixed = 0.01;
        sphpa_sim sim;
        start(&s, &p, &sim);
        while (sim.time < 0.6 - 1e-9) step(&sim, HUGE_VAL);
        for (size_t i = 0; i < sim.p.n; i++) {
            mean[keep] += (double)sim.p.D13[i] / (double)sim.p.n;
            open[keep] += (double)sim.p.n_act[i];
        }
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
    print_message("# compressed to all: open flaws %.3f, mean D^(1/3) %.3f\n", open[0] / open[1],
                  mean[0] / mean[1]);
    assert_true(open[1] > 100.0 && open[0] >= open[1] * 0.97 && open[0] < 1.23 * open[1]);
    assert_near(mean[0], mean[1], 0.06);
}

/* the time in which D13 grows by `growth` where it grows fastest and has that far to go */
static double time_of_growth(const sphpa_sim *sim, double growth, double alpha) {
    double least = HUGE_VAL;
    for (size_t i = 0; i < sim->p.n; i++) {
        double root = cbrt((double)sim->p.n_act[i]);
        if (!(root / cbrt(sim->p.flaw_count[i]) > (double)sim->p.D13[i] + growth)) continue;
        double c_g = 0.4 * sqrt(1.8 / (alpha * sim->p.rho[i]));
        least = fmin(least, growth * 2.0 * (double)sim->p.h[i] / (root * c_g));
    }
    return least;
}

static void damage_limits_the_step(void **state) {
    (void)state;
    for (int porous = SMALL; porous < 2; porous++) {
        const double alpha = porous ? 2.0 : 1.0;
        sphpa_particles p = porous_cube(6, 0.4, alpha);
        scene_of s = rock();
        s.pull = 0.4;
        s.porous = porous;
        s.cracks.growth = 0.001;
        sphpa_sim sim;
        start(&s, &p, &sim);
        uint64_t steps = 0;
        while (sim.time < 0.5) {
            step(&sim, 0.5 - sim.time);
            if (strcmp(sim.stats.limit[sim.stats.limit_last].name, "damage growth") != 0) continue;
            assert_near(sim.dt_next, time_of_growth(&sim, s.cracks.growth, alpha),
                        FINE(1e-12, 4.0 * FLOAT_ROUNDING));
            steps++;
        }
        assert_true(steps > 10);
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

/* a crack has grown through a particle when it has run the kernel's radius: c_g over the support */
static void cracks_run_the_support(void **state) {
    (void)state;
    const double supports[SPHPA_KERNEL_COUNT] = {2.0, 2.5, 3.0, 2.0, 2.0, 2.0, 3.0}, dt = 0.005;
    for (int k = 0; k < (int)SPHPA_KERNEL_COUNT; k++) {
        sphpa_particles p = cube(6, 0.4);
        scene_of s = rock();
        s.pull = 0.4;
        s.options.dt_fixed = dt;
        s.options.kernel = (sphpa_kernel)k;
        sphpa_sim sim;
        start(&s, &p, &sim);
        double before[216];
        int grew = 0;
        while (sim.time < 0.35) step(&sim, HUGE_VAL);
        for (size_t i = 0; i < sim.p.n; i++) before[sim.p.id[i]] = (double)sim.p.D13[i];
        step(&sim, HUGE_VAL);
        for (size_t i = 0; i < sim.p.n; i++) {
            double root = cbrt((double)sim.p.n_act[i]), D13 = (double)sim.p.D13[i];
            double c_g = 0.4 * sqrt(1.8 / sim.p.rho[i]), old = before[sim.p.id[i]];
            if (!(root > 0.0) || D13 >= root / cbrt(sim.p.flaw_count[i]) * (1.0 - 1e-5)) continue;
            assert_near(D13 - old, dt * root * c_g / (supports[k] * (double)sim.p.h[i]),
                        FINE(1e-9, 1e-3)); /* of a difference of two numbers up to 1 */
            grew++;
        }
        assert_true(grew > 20);
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
}

/* Particles that have less than `growth` to go to their cap do not limit the step, however fast they
   would grow: those that have all flaws open are at it, or half of `growth` below. The others, with
   one flaw open, do. */
static void particles_at_their_cap_do_not_limit(void **state) {
    (void)state;
    sphpa_particles p = cube(6, 0.0);
    scene_of s = rock();
    s.cracks.growth = 0.05;
    s.options.dt_growth = 1e9;
    sphpa_sim sim;
    start(&s, &p, &sim);
    for (size_t i = 0; i < sim.p.n; i++) {
        int kind = (int)(sim.p.id[i] % 3); /* at the cap, near it, far from it */
        sim.p.n_act[i] = (sphpa_real)(kind == 2 ? 1.0 : (double)sim.p.flaw_count[i]);
        sim.p.D13[i] = (sphpa_real)(kind == 2 ? 0.0 : 1.0 - 0.5 * kind * s.cracks.growth);
    }
    step(&sim, 1e-9);
    double least = HUGE_VAL, others = HUGE_VAL;
    for (size_t i = 0; i < sim.p.n; i++) {
        double c_g = 0.4 * sqrt(1.8 / sim.p.rho[i]), root = cbrt((double)sim.p.n_act[i]);
        double dt = s.cracks.growth * 2.0 * (double)sim.p.h[i] / (root * c_g);
        if (sim.p.id[i] % 3 == 2) least = fmin(least, dt);
        else others = fmin(others, dt);
    }
    assert_true(others < 0.7 * least);
    assert_string_equal(sim.stats.limit[sim.stats.limit_last].name, "damage growth");
    assert_near(sim.dt_next, least, FINE(1e-12, 4.0 * FLOAT_ROUNDING));
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
}

static void order_of_adding_does_not_matter(void **state) {
    (void)state;
    double x[2][3];
    for (int k = 0; k < 2; k++) {
        sphpa_particles p = cube(6, 0.6);
        scene_of s = rock();
        s.damage_first = k;
        sphpa_sim sim;
        start(&s, &p, &sim);
        while (sim.time < 0.5) step(&sim, 0.5 - sim.time);
        memcpy(x[k], sim.p.x + 3 * of_id(&sim.p, 11), sizeof x[k]);
        sphpa_sim_free(&sim);
        sphpa_particles_free(&p);
    }
    for (int a = 0; a < 3; a++) assert_true(x[0][a] == x[1][a]);
}

/* ---- restart and errors --------------------------------------------------------------------------- */

typedef struct kept {
    char name[64];
    void *data;
    size_t bytes;
    int reading;
} kept;

static sphpa_result exchange(void *user, const char *name, void **data, size_t *bytes,
                             sphpa_error *err) {
    kept *box = (kept *)user;
    (void)err;
    if (box->reading) {
        assert_string_equal(name, box->name);
        *data = malloc(box->bytes);
        memcpy(*data, box->data, box->bytes);
        *bytes = box->bytes;
        return SPHPA_OK;
    }
    snprintf(box->name, sizeof box->name, "%s", name);
    box->data = malloc(*bytes);
    box->bytes = *bytes;
    memcpy(box->data, *data, *bytes);
    return SPHPA_OK;
}

static sphpa_result keep(sphpa_sim *sim, kept *box, sphpa_error *err) {
    for (int m = 0; m < sim->scene.modules; m++) {
        const sphpa_module *module = &sim->scene.module[m];
        if (module->keep == NULL) continue;
        sphpa_result result = module->keep(sim, module->params, exchange, box, err);
        if (result != SPHPA_OK) return result;
    }
    return SPHPA_OK;
}

static void all_flaws_survive_a_restart(void **state) {
    (void)state;
    sphpa_particles p = cube(6, 0.0);
    scene_of a = rock(), b = rock();
    a.cracks.keep_all = b.cracks.keep_all = 1;
    b.cracks.seed = 99;
    sphpa_sim one, two;
    sphpa_error err;
    kept box;
    memset(&box, 0, sizeof box);
    start(&a, &p, &one);
    ok(keep(&one, &box, &err), &err);
    assert_true(box.bytes == a.cracks.pool_count * sizeof(double));
    start(&b, &p, &two);
    box.reading = 1;
    for (size_t i = 0; i < p.n; i++) { /* what a checkpoint brings back as fields */
        two.p.flaw_first[i] = one.p.flaw_first[i];
        two.p.flaw_count[i] = one.p.flaw_count[i];
    }
    ok(keep(&two, &box, &err), &err);
    assert_true(b.cracks.pool_count == a.cracks.pool_count);
    assert_true(b.cracks.pool != a.cracks.pool);
    assert_memory_equal(a.cracks.pool, b.cracks.pool, box.bytes);
    two.p.flaw_first[7] = (uint32_t)b.cracks.pool_count; /* a damaged file */
    assert_int_equal(keep(&two, &box, &err), SPHPA_ERROR_FORMAT);
    assert_non_null(strstr(err.message, "particle 7"));
    free(box.data);
    sphpa_sim_free(&one);
    sphpa_sim_free(&two);
    /* compressed flaws are fields: nothing to keep */
    scene_of c = rock();
    memset(&box, 0, sizeof box);
    start(&c, &p, &one);
    ok(keep(&one, &box, &err), &err);
    assert_null(box.data);
    sphpa_sim_free(&one);
    sphpa_particles_free(&p);
}

static void bad_input_is_named(void **state) {
    (void)state;
    sphpa_particles p = cube(4, 0.0);
    sphpa_sim sim;
    sphpa_error err;
    scene_of s = rock();
    s.cracks.keep_all = s.cracks.sampled = 1;
    assert_int_equal(create(&s, &p, &sim, &err), SPHPA_ERROR_RANGE);
    sphpa_scene alone;
    memset(&alone, 0, sizeof alone);
    s = rock();
    s.solid.material = s.material;
    s.cracks.solid = &s.solid;
    s.cracks.material = s.flaws;
    assert_int_equal(sphpa_scene_add(&alone, sphpa_cracks(&s.cracks)), SPHPA_OK);
    assert_int_equal(sphpa_sim_create(&sim, &alone, &p, NULL, &err), SPHPA_ERROR_MISSING);
    assert_non_null(strstr(err.message, "cracks: the scene has no sphpa_solid()"));
    s = rock();
    s.material[0].G = 0.0;
    assert_int_equal(create(&s, &p, &sim, &err), SPHPA_ERROR_MATERIAL);
    s = rock();
    s.flaws[0].k = -4.0;
    assert_int_equal(create(&s, &p, &sim, &err), SPHPA_ERROR_NEGATIVE);
    assert_non_null(strstr(err.message, "-4"));
    s.flaws[0].k = (double)NAN;
    assert_int_equal(create(&s, &p, &sim, &err), SPHPA_ERROR_NOT_FINITE);
    s = rock();
    s.flaws[0].m = 0.0;
    assert_int_equal(create(&s, &p, &sim, &err), SPHPA_ERROR_NEGATIVE);
    s = rock();
    s.flaws[0].alpha0 = (double)NAN;
    assert_int_equal(create(&s, &p, &sim, &err), SPHPA_ERROR_MATERIAL);
    s = rock();
    s.cracks.growth = -0.1;
    assert_int_equal(create(&s, &p, &sim, &err), SPHPA_ERROR_RANGE);
    assert_non_null(strstr(err.message, "growth = -0.1"));
    s = rock();
    p.body[0] = 100000;
    assert_int_equal(create(&s, &p, &sim, &err), SPHPA_ERROR_RANGE);
    sphpa_particles_free(&p);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(counts_follow_weibull),
        cmocka_unit_test(seeds_decide),
        cmocka_unit_test(streams_are_apart),
        cmocka_unit_test(bodies_and_materials),
        cmocka_unit_test(pores_have_no_flaws),
        cmocka_unit_test(any_body_number),
        cmocka_unit_test(compaction_does_not_heal),
        cmocka_unit_test(damage_grows_as_of_one_state),
        cmocka_unit_test(strength_is_that_of_the_particles),
        cmocka_unit_test(faster_rods_are_stronger),
        cmocka_unit_test(damaged_material_carries_pressure_alone),
        cmocka_unit_test(torn_cube_conserves),
        cmocka_unit_test(compressed_agrees_with_all),
        cmocka_unit_test(damage_limits_the_step),
        cmocka_unit_test(cracks_run_the_support),
        cmocka_unit_test(particles_at_their_cap_do_not_limit),
        cmocka_unit_test(order_of_adding_does_not_matter),
        cmocka_unit_test(all_flaws_survive_a_restart),
        cmocka_unit_test(bad_input_is_named),
    };
    return cmocka_run_group_tests_name("cracks", tests, NULL, NULL);
}
