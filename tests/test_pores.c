/* P-alpha on particles: the porous-aluminium piston against its Hugoniot, a cube on its crush
   curve, what a step commits, the deviator in closed form, what a scene allocates, wrong setups. */
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

static void ok(sphpa_result result, const sphpa_error *err) {
    if (result != SPHPA_OK) fail_msg("%s", err->message);
}

/* ---- a scene -------------------------------------------------------------------------------- */

enum { ALUMINIUM, PUMICE };

/* one material of pores; zeroed members are the defaults, begin() fills the rest */
typedef struct setting {
    int material, dense, order; /* order != 0: pores are added before solid */
    double G;                   /* [Pa] */
    sphpa_crush crush;
    const sphpa_tillotson *matrix;
    sphpa_solid_material solid_material;
    sphpa_solid_params solid;
    sphpa_pores_params pores;
    sphpa_yield yield;
    sphpa_plastic_params plastic;
    sphpa_module press; /* a user's module, where it has a name */
    int press_first;    /* not 0: added before all others */
    sphpa_sim_options options;
    sphpa_particles initial;
    sphpa_sim sim;
} setting;

static void prepare(setting *s, int material, sphpa_crush_elastic elastic) {
    sphpa_error err;
    memset(s, 0, sizeof *s);
    s->material = material;
    s->matrix = sphpa_tillotson_find(material == PUMICE ? "pumice" : "aluminium");
    s->crush = material == PUMICE ? sphpa_crush_pumice() : sphpa_crush_porous_aluminium();
    s->crush.elastic = elastic;
    if (elastic == SPHPA_CRUSH_HERRMANN)
        ok(sphpa_crush_prepare(&s->crush, s->matrix->rho0, sqrt(s->matrix->A / s->matrix->rho0),
                               &err), &err);
    s->solid_material.eos = sphpa_tillotson_eos(s->matrix);
    s->solid.material = &s->solid_material;
    s->solid.materials = 1;
    s->pores.solid = &s->solid;
    s->pores.crush = &s->crush;
    s->pores.matrix = &s->matrix;
    s->plastic.yield = &s->yield;
    s->plastic.materials = 1;
}

static sphpa_body body_of(const setting *s) {
    sphpa_body body;
    memset(&body, 0, sizeof body);
    body.alpha = s->dense ? 1.0 : s->crush.alpha0;
    body.rho = s->matrix->rho0 / body.alpha;
    return body;
}

static sphpa_result create(setting *s, sphpa_error *err) {
    sphpa_scene scene;
    memset(&scene, 0, sizeof scene);
    s->solid_material.G = s->G;
    if (s->press_first) assert_int_equal(sphpa_scene_add(&scene, s->press), SPHPA_OK);
    if (s->order) assert_int_equal(sphpa_scene_add(&scene, sphpa_pores(&s->pores)), SPHPA_OK);
    assert_int_equal(sphpa_scene_add(&scene, sphpa_solid(&s->solid)), SPHPA_OK);
    if (!s->order && s->dense < 2)
        assert_int_equal(sphpa_scene_add(&scene, sphpa_pores(&s->pores)), SPHPA_OK);
    if (s->yield.kind != SPHPA_YIELD_NONE)
        assert_int_equal(sphpa_scene_add(&scene, sphpa_plastic(&s->plastic)), SPHPA_OK);
    if (s->press.name != NULL && !s->press_first)
        assert_int_equal(sphpa_scene_add(&scene, s->press), SPHPA_OK);
    return sphpa_sim_create(&s->sim, &scene, &s->initial, &s->options, err);
}

static void end(setting *s) {
    sphpa_sim_free(&s->sim);
    sphpa_particles_free(&s->initial);
}

/* ---- the piston ----------------------------------------------------------------------------- */

/* Material moves at -v against its mirror image, so the plane x = 0 stands still and is the piston.
   The viscosity is the default one. */
typedef struct piston {
    double v, half; /* [m/s]; [m] of one side */
    sphpa_palpha_shock exact;
    double t_end;
    double slope_main, slope_first; /* [m/s] of the shock and of the precursor, in the lab frame */
    double P, rho, u, alpha;        /* mean between 0.4 and 0.7 of the shocked zone */
    double scatter, spread;         /* [Pa] rms of P there; [kg/m3] mass over length there */
    double front, drift;            /* [m] of the shock at the end; of the energy */
    double l1[4];                   /* P, v, rho, alpha over their scales */
} piston;

/* outermost x > 0 where P falls through `level`; particles are sorted by x in one dimension */
static double front_at(const sphpa_sim *sim, double level) {
    double x = 0.0;
    for (size_t i = 0; i + 1 < sim->p.n; i++) {
        double a = (double)sim->p.P[i], b = (double)sim->p.P[i + 1], xa = sim->p.x[3 * i];
        if (xa > 0.0 && a >= level && b < level)
            x = xa + (a - level) / (a - b) * (sim->p.x[3 * i + 3] - xa);
    }
    return x;
}

typedef struct line {
    double n, t, x, tt, tx;
} line;

static void line_add(line *l, double t, double x) {
    l->n += 1.0, l->t += t, l->x += x, l->tt += t * t, l->tx += t * x;
}

static double line_slope(const line *l) {
    return (l->n * l->tx - l->t * l->x) / (l->n * l->tt - l->t * l->t);
}

static void begin_piston(setting *s, piston *p, double v, long count) {
    sphpa_error err;
    double low[3] = {-1.0, 0.0, 0.0}, high[3] = {1.0, 0.0, 0.0};
    memset(p, 0, sizeof *p);
    p->v = v;
    p->half = 1.0;
    assert_int_equal(sphpa_palpha_hugoniot(s->matrix, &s->crush, v, &p->exact), SPHPA_OK);
    double first = p->exact.waves == 2 || p->exact.speed <= 0.0 ? p->exact.precursor_speed
                                                                 : p->exact.speed;
    p->t_end = 0.85 * p->half / (first - v);
    sphpa_body body = body_of(s);
    body.count = 2 * (size_t)count;
    ok(sphpa_make_begin(&s->initial, 1, &err), &err);
    ok(sphpa_make_box(&s->initial, low, high, &body, &err), &err);
    for (size_t i = 0; i < s->initial.n; i++)
        s->initial.v[3 * i] = (sphpa_real)(s->initial.x[3 * i] > 0.0 ? -v : v);
    s->solid.correction = 1;
    ok(create(s, &err), &err);
}

/* distance of the profiles from the exact ones */
static void measure_l1(const sphpa_sim *sim, piston *p, const setting *s) {
    const sphpa_palpha_shock *e = &p->exact;
    double x1 = (e->speed - p->v) * sim->time, x2 = (e->precursor_speed - p->v) * sim->time;
    double rho0 = s->matrix->rho0 / s->crush.alpha0, n = 0.0;
    for (size_t i = 0; i < sim->p.n; i++) {
        double x = sim->p.x[3 * i];
        if (x <= 0.0 || x > 0.95 * p->half - p->v * sim->time) continue;
        double P = x < x1 ? e->P : x < x2 ? e->precursor_P : 0.0;
        double v = (x < x1 ? e->v : x < x2 ? e->precursor_v : 0.0) - p->v;
        double rho = x < x1 ? e->rho : x < x2 ? e->precursor_rho : rho0;
        double alpha = x < x1 ? e->alpha : x < x2 ? e->precursor_alpha : s->crush.alpha0;
        p->l1[0] += fabs((double)sim->p.P[i] - P) / e->P;
        p->l1[1] += fabs((double)sim->p.v[3 * i] - v) / p->v;
        p->l1[2] += fabs(sim->p.rho[i] - rho) / rho0;
        p->l1[3] += fabs(sim->p.alpha[i] - alpha) / (s->crush.alpha0 - 1.0);
        n += 1.0;
    }
    for (int k = 0; k < 4; k++) p->l1[k] /= n;
}

static void measure_state(const sphpa_sim *sim, piston *p) {
    double n = 0.0, P2 = 0.0, mass = 0.0, from = 0.0, to = 0.0;
    p->front = front_at(sim, 0.5 * (p->exact.P + p->exact.precursor_P));
    for (size_t i = 0; i < sim->p.n; i++) {
        double x = sim->p.x[3 * i], P = (double)sim->p.P[i];
        if (x < 0.4 * p->front || x > 0.7 * p->front) continue;
        p->P += P;
        P2 += P * P;
        p->rho += sim->p.rho[i];
        p->u += sim->p.u[i];
        p->alpha += sim->p.alpha[i];
        if (n > 0.0) mass += (double)sim->p.m[i]; /* of the gaps between the first and the last */
        else from = x;
        to = x;
        n += 1.0;
    }
    assert_true(n >= 3.0);
    p->P /= n, p->rho /= n, p->u /= n, p->alpha /= n;
    p->scatter = sqrt(fmax(0.0, P2 / n - p->P * p->P));
    p->spread = mass / (to - from);
}

static void run_piston(setting *s, piston *p) {
    sphpa_error err;
    sphpa_sim *sim = &s->sim;
    line main_line, first;
    memset(&main_line, 0, sizeof main_line);
    memset(&first, 0, sizeof first);
    double energy = sphpa_sim_totals(sim).energy;
    double at_main = 0.5 * (p->exact.P + p->exact.precursor_P);
    double at_first = 0.5 * p->exact.precursor_P;
    if (p->exact.speed <= 0.0) at_main = at_first = 0.5 * p->exact.P;
    while (sim->time < p->t_end * (1.0 - 1e-12)) {
        ok(sphpa_sim_step(sim, p->t_end - sim->time, &err), &err);
        if (sim->time < 0.3 * p->t_end) continue;
        line_add(&main_line, sim->time, front_at(sim, at_main));
        line_add(&first, sim->time, front_at(sim, at_first));
    }
    p->slope_main = line_slope(&main_line) + p->v;
    p->slope_first = line_slope(&first) + p->v;
    p->drift = sphpa_sim_totals(sim).energy / energy - 1.0;
}

/* Float: a dt a below half of v's last bit is lost, and in a steady shock every particle loses the
   same. No walk, then, but up to FLOAT_ROUNDING in each of the steps of a front's passage, which are
   an eighth of the run's where it is widest. */
static double drift_bound(const sphpa_sim *sim) {
    return FINE(1e-12, FLOAT_ROUNDING * (double)sim->stats.steps / 8.0);
}

/* shock speed within 1 %, the state behind within 1 % and u within 2 %: what is left is the front's
   spread over particles, and the heat at the piston, which the wide slow shock carries along */
static void check_piston(double v, sphpa_crush_elastic elastic, long count) {
    setting s;
    piston p;
    prepare(&s, ALUMINIUM, elastic);
    begin_piston(&s, &p, v, count);
    run_piston(&s, &p);
    measure_state(&s.sim, &p);
    assert_near(p.slope_main, p.exact.speed, 0.01);
    assert_near(p.slope_first, p.exact.precursor_speed, 0.01);
    assert_near(p.P, p.exact.P, 0.01);
    assert_near(p.rho, p.exact.rho, 0.001);
    assert_near(p.u, p.exact.u, 0.02);
    assert_near_abs(p.alpha, p.exact.alpha, 0.005 * (s.crush.alpha0 - 1.0));
    assert_near_abs(p.drift, 0.0, drift_bound(&s.sim));
    assert_true(s.pores.stats.loading > 0);
    assert_int_equal(s.pores.stats.grew, 0);
    assert_true(s.pores.stats.distance_max < FINE(1e-9, 1e-6));
    end(&s);
}

static void test_piston_100(void **state) {
    (void)state;
    check_piston(100.0, SPHPA_CRUSH_FLAT, 500);
    if (!SMALL) check_piston(100.0, SPHPA_CRUSH_HERRMANN, 500);
}

static void test_piston_300(void **state) {
    (void)state;
    check_piston(300.0, SPHPA_CRUSH_FLAT, 200);
    if (!SMALL) check_piston(300.0, SPHPA_CRUSH_HERRMANN, 200);
}

static void test_piston_458(void **state) {
    (void)state;
    check_piston(458.0, SPHPA_CRUSH_HERRMANN, 200);
    if (!SMALL) check_piston(458.0, SPHPA_CRUSH_FLAT, 200);
}

/* Pumice closes four fifths of its volume in one front. Quadratic viscosity 3, as in the impact.
   Bounds in parts: of the speed and of what is behind; of single particles' P; rho_spread: rho of
   the continuity against mass over length, which one front of fourfold density puts apart. */
typedef struct bounds {
    double v; /* [m/s] */
    double speed, P, rho, u, scatter, rho_spread;
} bounds;

static void check_pumice_piston(const bounds *most, long count) {
    setting s;
    piston p;
    prepare(&s, PUMICE, SPHPA_CRUSH_FLAT);
    s.solid.viscosity.b = 3.0;
    begin_piston(&s, &p, most->v, count);
    run_piston(&s, &p);
    measure_state(&s.sim, &p);
    printf("pumice, %4g m/s: speed %+.2e, P %+.2e, rho %+.2e, u %+.2e, alpha %+.2e; P scatters by "
           "%.1e, rho over mass/length %+.2e\n", most->v, p.slope_main / p.exact.speed - 1.0,
           p.P / p.exact.P - 1.0, p.rho / p.exact.rho - 1.0, p.u / p.exact.u - 1.0,
           (p.alpha - p.exact.alpha) / (s.crush.alpha0 - 1.0), p.scatter / p.P,
           p.rho / p.spread - 1.0);
    assert_near(p.slope_main, p.exact.speed, most->speed);
    assert_near(p.P, p.exact.P, most->P);
    assert_near(p.rho, p.exact.rho, most->rho);
    assert_near(p.u, p.exact.u, most->u);
    assert_near_abs(p.alpha, p.exact.alpha, 0.005 * (s.crush.alpha0 - 1.0));
    assert_near(p.rho, p.spread, most->rho_spread);
    assert_true(p.scatter < most->scatter * p.P);
    assert_near_abs(p.drift, 0.0, drift_bound(&s.sim));
    assert_int_equal(s.pores.stats.grew, 0);
    end(&s);
}

/* weak ones, that leave most pores; 200 to 500 m/s, that nearly close them, where a front that is
   too thin overshoots and closes them for good; one that closes all */
static void test_piston_pumice(void **state) {
    (void)state;
    static const bounds most[] = {
        {100.0, 0.005, 0.015, 0.005, 0.03, 0.01, 0.005},
        {300.0, 0.005, 0.005, 0.002, 0.01, 0.01, 0.005},
        {200.0, 0.005, 0.005, 0.005, 0.01, 0.01, 0.005},
        {500.0, 0.005, 0.005, 0.005, 0.01, 0.01, 0.005},
        {1000.0, 0.005, 0.005, 0.001, 0.01, 0.01, 0.005},
    };
    size_t few = 1, all = sizeof most / sizeof most[0];
    for (size_t k = 0; k < (SMALL ? few : all); k++) check_pumice_piston(&most[k], 400);
}

/* fronts are a fixed number of particles wide: errors in the mean fall with the spacing */
static void check_convergence(int material, double v, double b, long coarse, long fine) {
    double first[4];
    for (int round = 0; round < 2; round++) {
        setting s;
        piston p;
        prepare(&s, material, SPHPA_CRUSH_FLAT);
        s.solid.viscosity.b = b;
        begin_piston(&s, &p, v, round ? fine : coarse);
        run_piston(&s, &p);
        measure_l1(&s.sim, &p, &s);
        for (int k = 0; k < 4; k++) {
            if (round == 0) first[k] = p.l1[k];
            else
                assert_near_abs(log(first[k] / p.l1[k]) / log((double)fine / (double)coarse), 1.0,
                                0.25);
        }
        end(&s);
    }
}

static void test_piston_converges(void **state) {
    (void)state;
    check_convergence(ALUMINIUM, 458.0, 0.0, 100, SMALL ? 200 : 400);
    if (!SMALL) check_convergence(PUMICE, 300.0, 3.0, 200, 400);
}

/* a piston too slow to crush anything: HERRMANN's wave goes at c_e, FLAT's at the matrix's speed */
static void test_elastic_waves(void **state) {
    (void)state;
    for (int k = 0; k < 2; k++) {
        setting s;
        piston p;
        prepare(&s, ALUMINIUM, k ? SPHPA_CRUSH_HERRMANN : SPHPA_CRUSH_FLAT);
        begin_piston(&s, &p, 0.2, 150);
        assert_true(p.exact.speed <= 0.0);
        run_piston(&s, &p);
        assert_near(p.slope_first, k ? 4110.0 : sqrt(s.matrix->A / s.matrix->rho0), 0.004);
        end(&s);
    }
}

static void test_solvers_agree(void **state) {
    (void)state;
    static const sphpa_palpha_solver solver[3] = {
        SPHPA_PALPHA_CRUSH_SPACE, SPHPA_PALPHA_BISECTION, SPHPA_PALPHA_SAFE_NEWTON};
    double alpha[3][64], u[3][64];
    for (int k = 0; k < 3; k++) {
        setting s;
        piston p;
        prepare(&s, ALUMINIUM, SPHPA_CRUSH_FLAT);
        s.pores.solver = solver[k];
        begin_piston(&s, &p, 300.0, 32);
        run_piston(&s, &p);
        for (size_t i = 0; i < 64; i++) alpha[k][i] = s.sim.p.alpha[i], u[k][i] = s.sim.p.u[i];
        end(&s);
    }
    /* float: a solver's last bits may turn a rounding of P, a walk of 145 steps; u is v^2/2 */
    const double walk = 12.0 * FLOAT_ROUNDING;
    for (int k = 1; k < 3; k++)
        for (int i = 0; i < 64; i++) {
            assert_near_abs(alpha[k][i], alpha[0][i], FINE(1e-9, walk));
            assert_near_abs(u[k][i], u[0][i], FINE(1e-4, 45e3 * walk));
        }
}

/* plain Newton cycles next to Pe: the run ends with the pass, the particle and the reason */
static void test_newton_fails_loudly(void **state) {
    (void)state;
    setting s;
    piston p;
    sphpa_error err;
    prepare(&s, ALUMINIUM, SPHPA_CRUSH_FLAT);
    s.pores.solver = SPHPA_PALPHA_NEWTON;
    begin_piston(&s, &p, 300.0, 32);
    sphpa_result result = SPHPA_OK;
    while (s.sim.time < p.t_end && result == SPHPA_OK) result = sphpa_sim_step(&s.sim, 1.0, &err);
    assert_int_equal(result, SPHPA_ERROR_STATE);
    assert_non_null(strstr(err.message, "pores pressure"));
    assert_non_null(strstr(err.message, "did not converge"));
    end(&s);
}

/* ---- bits ----------------------------------------------------------------------------------- */

static uint64_t hash_bytes(uint64_t h, const void *data, size_t bytes) {
    const unsigned char *byte = (const unsigned char *)data;
    for (size_t k = 0; k < bytes; k++) h = (h ^ byte[k]) * 1099511628211u;
    return h;
}

static uint64_t hash_state(const sphpa_sim *sim, int pores) {
    const sphpa_particles *p = &sim->p;
    uint64_t h = 14695981039346656037u;
    h = hash_bytes(h, p->x, 3 * p->n * sizeof *p->x);
    h = hash_bytes(h, p->v, 3 * p->n * sizeof *p->v);
    h = hash_bytes(h, p->rho, p->n * sizeof *p->rho);
    h = hash_bytes(h, p->u, p->n * sizeof *p->u);
    h = hash_bytes(h, p->P, p->n * sizeof *p->P);
    h = hash_bytes(h, p->S, 6 * p->n * sizeof *p->S);
    return pores ? hash_bytes(h, p->alpha, p->n * sizeof *p->alpha) : h;
}

/* two blocks of 2-D lattices meet at an angle */
static void begin_blocks(setting *s, sphpa_error *err) {
    double low[3] = {-0.01, -0.005, 0.0}, high[3] = {0.0, 0.005, 0.0};
    double low2[3] = {0.0, -0.004, 0.0}, high2[3] = {0.008, 0.006, 0.0};
    sphpa_body body = body_of(s);
    body.spacing = 4e-4;
    ok(sphpa_make_begin(&s->initial, 2, err), err);
    body.v[0] = 150.0;
    ok(sphpa_make_box(&s->initial, low, high, &body, err), err);
    body.v[0] = -150.0, body.v[1] = 40.0, body.body = 1;
    ok(sphpa_make_box(&s->initial, low2, high2, &body, err), err);
    s->yield.kind = SPHPA_YIELD_VON_MISES;
    s->yield.Y0 = 276e6;
    s->G = 26.9e9;
}

static uint64_t blocks_hash(setting *s, int steps, int pores) {
    sphpa_error err;
    begin_blocks(s, &err);
    ok(create(s, &err), &err);
    for (int k = 0; k < steps; k++) ok(sphpa_sim_step(&s->sim, 1.0, &err), &err);
    return hash_state(&s->sim, pores);
}

static void test_threads(void **state) {
    (void)state;
#ifdef _OPENMP
    static const int threads[3] = {1, 2, 4};
    uint64_t hash[3];
    sphpa_pores_stats stats[3];
    int before = omp_get_max_threads();
    for (int k = 0; k < 3; k++) {
        setting s;
        omp_set_num_threads(threads[k]);
        prepare(&s, ALUMINIUM, SPHPA_CRUSH_FLAT);
        hash[k] = blocks_hash(&s, 25, 1);
        stats[k] = s.pores.stats;
        assert_true(s.pores.stats.loading > 0);
        end(&s);
    }
    omp_set_num_threads(before);
    for (int k = 1; k < 3; k++) {
        assert_true(hash[k] == hash[0]);
        assert_memory_equal(&stats[k], &stats[0], sizeof stats[0]);
    }
#else
    skip();
#endif
}

/* delete a line of the scene, and nothing else changes: dense material has the same bits with and
   without pores, and the order of adding does not matter */
static void test_dense_bits_and_order(void **state) {
    (void)state;
    uint64_t hash[2];
    for (int k = 0; k < 2; k++) {
        setting s;
        prepare(&s, ALUMINIUM, SPHPA_CRUSH_FLAT);
        s.dense = 1 + k; /* 2: no pores in the scene */
        if (k == 0) memset(&s.crush, 0, sizeof s.crush); /* zeroed: a dense material */
        s.matrix = k == 0 ? s.matrix : sphpa_tillotson_find("aluminium");
        hash[k] = blocks_hash(&s, 25, 0);
        if (k == 0) {
            assert_non_null(s.sim.p.alpha);
            for (size_t i = 0; i < s.sim.p.n; i++) assert_true(s.sim.p.alpha[i] == 1.0);
            assert_int_equal(s.pores.stats.solves, 0);
        } else assert_null(s.sim.p.alpha);
        end(&s);
    }
    assert_true(hash[0] == hash[1]);
    for (int k = 0; k < 2; k++) {
        setting s;
        prepare(&s, ALUMINIUM, SPHPA_CRUSH_FLAT);
        s.order = k;
        hash[k] = blocks_hash(&s, 10, 1);
        end(&s);
    }
    assert_true(hash[0] == hash[1]);
}

static void test_fields(void **state) {
    (void)state;
    setting s;
    sphpa_error err;
    prepare(&s, ALUMINIUM, SPHPA_CRUSH_FLAT);
    begin_blocks(&s, &err);
    ok(create(&s, &err), &err);
    size_t flat = sphpa_particles_bytes_each(&s.sim.p);
    assert_non_null(s.sim.p.alpha);
    assert_non_null(s.sim.p.start.alpha);
    assert_null(s.sim.p.alpha_min);
    assert_null(s.sim.p.D);
    end(&s);
    prepare(&s, ALUMINIUM, SPHPA_CRUSH_FLAT);
    s.dense = 2; /* no pores in the scene */
    begin_blocks(&s, &err);
    ok(create(&s, &err), &err);
    assert_null(s.sim.p.alpha);
    assert_null(s.sim.p.start.alpha);
    assert_null(s.sim.p.alpha_min);
    assert_null(s.sim.p.c_visc);
    assert_int_equal(sphpa_particles_bytes_each(&s.sim.p) + 2 * sizeof(double) +
                         sizeof(sphpa_real), flat);
    end(&s);
    prepare(&s, ALUMINIUM, SPHPA_CRUSH_HERRMANN);
    begin_blocks(&s, &err);
    ok(create(&s, &err), &err);
    for (size_t i = 0; i < s.sim.p.n; i++) assert_true(s.sim.p.alpha_min[i] == s.crush.alpha0);
    assert_int_equal(sphpa_particles_bytes_each(&s.sim.p), flat + 2 * sizeof(double));
    end(&s);
}

/* ---- the press: motion prescribed, the material's answer computed --------------------------- */

/* In place of forces it gives every particle the acceleration that keeps v = rate (n.x) n, or
   rate x; gradients, density, pressure, stress and heat are the scene's. */
typedef struct press {
    double rate; /* [1/s] */
    double n[3]; /* unit vector; 0: along all axes alike */
} press;

static const double *press_axis(int axis) {
    static const double unit[4][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}};
    return unit[axis];
}

/* component a of v/rate at x */
static double press_project(const press *hold, const double *x, size_t a) {
    const double *n = hold->n;
    int all = n[0] == 0.0 && n[1] == 0.0 && n[2] == 0.0;
    return all ? x[a] : (n[0] * x[0] + n[1] * x[1] + n[2] * x[2]) * n[a];
}

static void press_fill(sphpa_sim *sim, const press *hold, size_t first, size_t last) {
    double dt = sim->dt;
    if (dt <= 0.0) return;
    for (size_t i = first; i < last; i++) {
        double middle[3];
        for (size_t a = 0; a < 3; a++)
            middle[a] = sim->p.x[3 * i + a]; /* forces are those of the step's middle */
        for (size_t a = 0; a < 3; a++) {
            double goal = hold->rate * press_project(hold, middle, a) / (1.0 - 0.5 * dt * hold->rate);
            sim->p.a[3 * i + a] = (sphpa_real)((goal - (double)sim->p.start.v[3 * i + a]) / dt);
        }
    }
}

static sphpa_result press_pass(sphpa_sim *sim, void *params, size_t first, size_t last,
                               size_t *bad) {
    (void)bad;
    press_fill(sim, (const press *)params, first, last);
    return SPHPA_OK;
}

static sphpa_module press_module(press *hold) {
    sphpa_module module;
    memset(&module, 0, sizeof module);
    module.name = "press";
    module.params = hold;
    module.passes = 1;
    module.pass[0].name = "press motion";
    module.pass[0].replaces = "solid forces";
    module.pass[0].stage = SPHPA_STAGE_FORCES;
    module.pass[0].writes = SPHPA_F(a) | SPHPA_F(mu_max);
    module.pass[0].particle = press_pass;
    return module;
}

static void begin_cube(setting *s, press *hold, int edge, const double n[3]) {
    sphpa_error err;
    double low[3] = {-0.5, -0.5, -0.5}, high[3] = {0.5, 0.5, 0.5};
    sphpa_body body = body_of(s);
    body.spacing = 1.0 / edge;
    ok(sphpa_make_begin(&s->initial, 3, &err), &err);
    ok(sphpa_make_box(&s->initial, low, high, &body, &err), &err);
    memset(hold, 0, sizeof *hold);
    memcpy(hold->n, n, sizeof hold->n);
    s->press = press_module(hold);
    s->solid.correction = 1;
    s->solid.viscosity.a = s->solid.viscosity.b = -1.0; /* none: quasi-static */
    s->options.dt_fixed = 1e-3;
    ok(create(s, &err), &err);
}

static void squeeze(setting *s, press *hold, double rate, int steps) {
    sphpa_error err;
    for (size_t k = 0; k < 3 * s->sim.p.n; k++)
        s->sim.p.v[k] = (sphpa_real)(rate * press_project(hold, s->sim.p.x + k / 3 * 3, k % 3));
    hold->rate = rate;
    for (int k = 0; k < steps; k++) ok(sphpa_sim_step(&s->sim, HUGE_VAL, &err), &err);
}

/* paper I's curves once more, written out */
static double curve_by_hand(const sphpa_crush *c, double P) {
    double t = (c->Ps - P) / (c->Ps - c->Pe), q = (c->Pt - P) / (c->Pt - c->Pe);
    if (P <= c->Pe) return c->alpha0;
    if (P >= c->Ps) return 1.0;
    if (c->kind == SPHPA_CRUSH_QUADRATIC) return 1.0 + (c->alpha0 - 1.0) * t * t;
    return 1.0 + (c->alpha_t - 1.0) * pow(t, c->n2) +
           (P < c->Pt ? (c->alpha_e - c->alpha_t) * pow(q, c->n1) : 0.0);
}

/* every particle at P = Peos(alpha rho, u)/alpha, and never above its curve */
static void check_states(const setting *s, const double *before, int on_curve) {
    const sphpa_particles *p = &s->sim.p;
    double room = s->crush.alpha0 - 1.0;
    for (size_t i = 0; i < p->n; i++) {
        sphpa_eos_point point;
        assert_int_equal(sphpa_tillotson_eval(s->matrix, p->alpha[i] * p->rho[i],
                                              fmax(p->u[i], 0.0), &point), SPHPA_OK);
        assert_near_abs((double)p->P[i], point.P / p->alpha[i],
                        FINE(1e-9, FLOAT_ROUNDING) * (fabs(point.P) + s->crush.Ps));
        double above = p->alpha[i] - curve_by_hand(&s->crush, (double)p->P[i]);
        /* P's rounding times the steepest curve, (Pt/(Pt - Pe)) n1 = 13 */
        assert_true(above / room < FINE(1e-9, 13.0 * FLOAT_ROUNDING));
        if (on_curve) assert_true(above / room > FINE(-1e-9, -13.0 * FLOAT_ROUNDING));
        assert_true(p->alpha[i] <= before[i]);
    }
}

/* load, release, load, release, load: on the curve, never above, alpha never grows, and the second
   loading goes up the line that the release came down */
static void check_cycles(int material, sphpa_crush_kind kind, int integrator) {
    setting s;
    press hold;
    double alpha[1000], low[1000];
    prepare(&s, material, SPHPA_CRUSH_FLAT);
    if (material == PUMICE && kind == SPHPA_CRUSH_QUADRATIC)
        s.crush = sphpa_crush_quadratic(s.crush.alpha0, s.crush.Pe, s.crush.Ps);
    s.options.integrator = (sphpa_integrator)integrator;
    begin_cube(&s, &hold, 6, press_axis(3));
    size_t n = s.sim.p.n;
    double full = material == PUMICE ? 1.15 : 0.25; /* of ln rho; each load is a third of it */
    for (size_t i = 0; i < n; i++) alpha[i] = s.crush.alpha0;
    for (int round = 0; round < 3; round++) {
        uint64_t steps = s.sim.stats.steps, loading = s.pores.stats.loading;
        double rate = -full / 3.0 / (3.0 * 40.0 * s.options.dt_fixed);
        squeeze(&s, &hold, rate, 40);
        check_states(&s, alpha, 1);
        assert_int_equal(s.sim.stats.steps - steps, 40);
        assert_true(s.pores.stats.loading > loading);
        for (size_t i = 0; i < n; i++) alpha[i] = s.sim.p.alpha[i];
        squeeze(&s, &hold, 1e-4 / s.options.dt_fixed, 4); /* release: ln rho falls by 1.2e-3 */
        check_states(&s, alpha, 0);
        for (size_t i = 0; i < n; i++) {
            assert_true(s.sim.p.alpha[i] == alpha[i]);
            low[i] = (double)s.sim.p.P[i];
            assert_true(low[i] < s.crush.Ps);
        }
        squeeze(&s, &hold, -0.5e-4 / s.options.dt_fixed, 4); /* half way back */
        for (size_t i = 0; i < n; i++) {
            assert_true(s.sim.p.alpha[i] == alpha[i]);
            assert_true((double)s.sim.p.P[i] > low[i]);
        }
        squeeze(&s, &hold, 0.5e-4 / s.options.dt_fixed, 4); /* and down the same line */
        for (size_t i = 0; i < n; i++)
            assert_near_abs((double)s.sim.p.P[i], low[i], 1e-6 * s.matrix->A);
    }
    assert_int_equal(s.pores.stats.grew, 0);
    assert_true(s.pores.stats.distance_max < FINE(1e-9, 1e-6));
    assert_true(s.pores.stats.loading <= n * s.sim.stats.steps);
    assert_true(s.pores.stats.solves >= n * (s.sim.stats.steps + s.sim.stats.evaluations));
    end(&s);
}

static void test_cycles(void **state) {
    (void)state;
    check_cycles(PUMICE, SPHPA_CRUSH_TWO_EXPONENT, SPHPA_PREDICTOR_CORRECTOR);
    check_cycles(PUMICE, SPHPA_CRUSH_QUADRATIC, SPHPA_RK2);
    check_cycles(ALUMINIUM, SPHPA_CRUSH_QUADRATIC, SPHPA_PREDICTOR_CORRECTOR);
}

/* HERRMANN: released to P = 0, alpha comes back to the foot of its line and no farther, and the
   least alpha is what it was */
static void test_herrmann_release(void **state) {
    (void)state;
    setting s;
    press hold;
    prepare(&s, ALUMINIUM, SPHPA_CRUSH_HERRMANN);
    begin_cube(&s, &hold, 5, press_axis(3));
    squeeze(&s, &hold, -0.1 / (3.0 * 40.0 * s.options.dt_fixed), 40);
    size_t i = s.sim.p.n / 2;
    double least = s.sim.p.alpha_min[i], loaded = s.sim.p.alpha[i];
    assert_true(loaded < 1.25);
    assert_near(least, loaded, 1e-12);
    squeeze(&s, &hold, 1e-4 / s.options.dt_fixed, 40);
    double foot = sphpa_crush_rest(&s.crush, least);
    assert_true((double)s.sim.p.P[i] < 0.0);
    assert_true(s.sim.p.alpha_min[i] == least);
    assert_true(foot > least * (1.0 + 1e-5));
    assert_near(s.sim.p.alpha[i], foot, 1e-10);
    squeeze(&s, &hold, -1e-4 / s.options.dt_fixed, 41);
    assert_near(s.sim.p.alpha[i], loaded, 1e-3);
    assert_true(s.sim.p.alpha[i] <= foot);
    end(&s);
}

static size_t middle_of(const sphpa_particles *p) {
    size_t middle = 0;
    double most = HUGE_VAL;
    for (size_t i = 0; i < p->n; i++) {
        const double *x = p->x + 3 * i;
        double r = x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
        if (r < most) most = r, middle = i;
    }
    return middle;
}

static size_t place_of(const sphpa_particles *p, int64_t id) {
    size_t i = 0;
    while (p->id[i] != id) i++;
    return i;
}

static double along(const sphpa_real *S, const double n[3]) {
    double sum = 0.0;
    for (int c = 0; c < 6; c++)
        sum += (c < 3 ? 1.0 : 2.0) * n[c % 3] * n[(c + c / 3) % 3] * (double)S[c];
    return sum;
}

/* c: the matrix's at its own density, for P = P_m(alpha rho, u)/alpha has the same slope; and a
   shear modulus G/alpha of matter of density rho */
static void check_sound(const setting *s, size_t i) {
    const sphpa_particles *p = &s->sim.p;
    double dense = p->alpha[i] * p->rho[i];
    sphpa_eos_point point;
    assert_int_equal(sphpa_tillotson_eval(s->matrix, dense, fmax(p->u[i], 0.0), &point), SPHPA_OK);
    assert_near((double)p->c[i], sqrt(point.c * point.c + 4.0 / 3.0 * s->G / dense),
                FINE(1e-9, FLOAT_ROUNDING));
}

/* Uniaxial strain along n of a homogeneous cube: alpha S_nn = -4/3 G times the matrix's strain, which is
   ln(rho_s/rho_s0) whatever the path and the steps, for it telescopes; only where heat swells the
   matrix while its pores close (pumice) it stands still, for f >= 0. The heat is the work along
   that path. */
static void check_deviator(int material, double G, double Y, const double n[3]) {
    setting s;
    press hold;
    prepare(&s, material, SPHPA_CRUSH_FLAT);
    s.G = G;
    if (Y > 0.0) s.yield.kind = SPHPA_YIELD_VON_MISES;
    s.yield.Y0 = Y;
    begin_cube(&s, &hold, 7, n);
    size_t middle = middle_of(&s.sim.p);
    int64_t id = s.sim.p.id[middle];
    double dense = s.sim.p.alpha[middle] * s.sim.p.rho[middle], work = 0.0, power, before = 0.0;
    double strain = 0.0, step = material == PUMICE ? 0.02 : 0.004;
    const double close = FINE(1e-10, 64.0 * FLOAT_ROUNDING); /* every step rounds S */
    for (int k = 0; k < 64; k++) {
        double rho = s.sim.p.rho[middle], turn = k < 48 ? -1.0 : 0.05;
        squeeze(&s, &hold, turn * step / s.options.dt_fixed, 1);
        middle = place_of(&s.sim.p, id);
        const sphpa_particles *p = &s.sim.p;
        double now = p->alpha[middle] * p->rho[middle], more = log(now / dense);
        strain += material == PUMICE && k < 48 ? fmax(more, 0.0) : more;
        dense = now;
        double expect = -4.0 / 3.0 * s.G * strain / p->alpha[middle], limit = 2.0 / 3.0 * Y;
        check_sound(&s, middle);
        double S_nn = along(p->S + 6 * middle, n);
        if (Y > 0.0) {
            limit /= p->alpha[middle]; /* sqrt(3 J2) = 3/2 |S_nn| */
            assert_true(fabs(S_nn) <= limit * (1.0 + 1e-6));
            if (k == 47) assert_near(-S_nn, limit, 1e-6);
        } else {
            for (int c = 0; c < 6; c++) /* 3/2 n n - 1/2 of it */
                assert_near_abs((double)p->S[6 * middle + c],
                                expect * (1.5 * n[c % 3] * n[(c + c / 3) % 3] - 0.5 * (c < 3)),
                                close * s.G * (fabs(strain) + 1e-3));
            power = (double)p->P[middle] - S_nn;
            work += 0.5 * (power + before) * (1.0 / rho - 1.0 / p->rho[middle]);
            before = power;
        }
    }
    if (Y <= 0.0) assert_near(s.sim.p.u[middle], work, 0.02);
    assert_true(s.sim.p.alpha[middle] < 1.0 + 0.5 * (s.crush.alpha0 - 1.0));
    end(&s);
}

/* Squeezed along x, then along y: pores go on closing, but the deviator unloads, and then feels all
   of the strain (f = 1); else it would give back more than it took. */
static void test_deviator_unloads(void **state) {
    (void)state;
    setting s;
    press hold;
    prepare(&s, ALUMINIUM, SPHPA_CRUSH_FLAT);
    s.G = 26.9e9;
    begin_cube(&s, &hold, 7, press_axis(0));
    int64_t id = s.sim.p.id[middle_of(&s.sim.p)];
    squeeze(&s, &hold, -0.004 / s.options.dt_fixed, 20);
    size_t i = place_of(&s.sim.p, id);
    double alpha = s.sim.p.alpha[i], rho = s.sim.p.rho[i], S = alpha * (double)s.sim.p.S[6 * i + 1];
    assert_true(S > 0.0);
    memcpy(hold.n, press_axis(1), sizeof hold.n);
    squeeze(&s, &hold, -0.001 / s.options.dt_fixed, 1);
    i = place_of(&s.sim.p, id);
    assert_true(s.sim.p.alpha[i] < alpha - 1e-4);
    double fall = -4.0 / 3.0 * s.G * log(s.sim.p.rho[i] / rho);
    /* S, rounded in 21 steps, is 40 times what it falls by here */
    assert_near(s.sim.p.alpha[i] * (double)s.sim.p.S[6 * i + 1] - S, fall,
                FINE(1e-9, 21.0 * 40.0 * FLOAT_ROUNDING));
    end(&s);
}

/* Where no time passes nothing loads: an output in the middle of loading leaves the speed that
   viscosity uses as it was, below that of sound. */
static void test_refresh_keeps_the_wave(void **state) {
    (void)state;
    setting s;
    press hold;
    sphpa_error err;
    prepare(&s, PUMICE, SPHPA_CRUSH_FLAT);
    begin_cube(&s, &hold, 6, press_axis(3));
    squeeze(&s, &hold, -0.002 / s.options.dt_fixed, 40);
    size_t i = middle_of(&s.sim.p);
    sphpa_real before = s.sim.p.c_visc[i];
    double crushing;
    assert_true(before < (sphpa_real)0.8 * s.sim.p.c[i]);
    assert_int_equal(sphpa_palpha_loading_c(s.matrix, &s.crush, s.sim.p.rho[i], s.sim.p.u[i],
                                            s.sim.p.alpha[i], &crushing), SPHPA_OK);
    assert_true((double)before > crushing);
    ok(sphpa_sim_refresh(&s.sim, &err), &err);
    assert_true(s.sim.p.c_visc[i] == before);
    end(&s);
}

static void test_deviator(void **state) {
    (void)state;
    const double r = sqrt(0.5);
    const double between[3][3] = {{r, r, 0.0}, {0.0, r, -r}, {-r, 0.0, r}};
    const double oblique[3] = {3.0 / 7.0, -2.0 / 7.0, 6.0 / 7.0};
    check_deviator(ALUMINIUM, 26.9e9, 0.0, press_axis(0));
    for (int k = 0; k < 3; k++) check_deviator(ALUMINIUM, 26.9e9, 0.0, between[k]);
    check_deviator(PUMICE, 1e9, 0.0, oblique);
    check_deviator(PUMICE, 1e9, 3e5, oblique);
}

/* ---- what a step commits -------------------------------------------------------------------- */

/* A step whose middle is squeezed hard but whose end is where it began: the trial crushes, the
   commit must not. The least alpha that a trial saw goes into a column. */
static sphpa_result shake_gradients(sphpa_sim *sim, void *params, size_t first, size_t last,
                                    size_t *bad) {
    (void)bad;
    for (size_t i = first; i < last; i++) {
        for (size_t k = 0; k < 9; k++) sim->p.L[9 * i + k] = (sphpa_real)0;
        sim->p.div_v[i] = (sphpa_real)(-*(const double *)params);
    }
    return SPHPA_OK;
}

static sphpa_result shake_energy(sphpa_sim *sim, void *params, size_t first, size_t last,
                                 size_t *bad) {
    (void)params, (void)bad;
    for (size_t i = first; i < last; i++) sim->p.div_v[i] = (sphpa_real)0;
    return SPHPA_OK;
}

static sphpa_result shake_watch(sphpa_sim *sim, void *params, size_t first, size_t last,
                                size_t *bad) {
    double *seen = sphpa_particles_column(&sim->p, "LeastTrial");
    (void)params, (void)bad;
    for (size_t i = first; i < last; i++)
        if (seen[i] == 0.0 || sim->p.alpha[i] < seen[i]) seen[i] = sim->p.alpha[i];
    return SPHPA_OK;
}

static sphpa_result shake_nothing(sphpa_sim *sim, void *params, size_t first, size_t last,
                                  size_t *bad) {
    (void)sim, (void)params, (void)first, (void)last, (void)bad;
    return SPHPA_OK;
}

static sphpa_module shake_module(double *rate) {
    static const char *const name[4] = {"shake gradients", "shake watch", "shake forces",
                                        "shake energy"};
    static const char *const replaces[4] = {"solid gradients", NULL, "solid forces",
                                            "solid energy"};
    static const sphpa_stage stage[4] = {SPHPA_STAGE_GRADIENTS, SPHPA_STAGE_YIELD,
                                         SPHPA_STAGE_FORCES, SPHPA_STAGE_ENERGY};
    sphpa_result (*const call[4])(sphpa_sim *, void *, size_t, size_t, size_t *) = {
        shake_gradients, shake_watch, shake_nothing, shake_energy};
    sphpa_module module;
    memset(&module, 0, sizeof module);
    module.name = "shake";
    module.params = rate;
    module.passes = 4;
    for (int k = 0; k < 4; k++) {
        module.pass[k].name = name[k];
        module.pass[k].replaces = replaces[k];
        module.pass[k].stage = stage[k];
        module.pass[k].particle = call[k];
    }
    module.pass[0].writes = SPHPA_F(L) | SPHPA_F(div_v);
    module.pass[2].writes = SPHPA_F(mu_max);
    module.columns = 1;
    strcpy(module.column[0].name, "LeastTrial");
    return module;
}

static void test_trials_do_not_commit(void **state) {
    (void)state;
    for (int k = 0; k < 4; k++) {
        setting s;
        sphpa_error err;
        double low[3] = {-1, -1, -1}, high[3] = {1, 1, 1}, rate = 2e2;
        prepare(&s, ALUMINIUM, k < 2 ? SPHPA_CRUSH_FLAT : SPHPA_CRUSH_HERRMANN);
        sphpa_body body = body_of(&s);
        body.spacing = 0.5;
        ok(sphpa_make_begin(&s.initial, 3, &err), &err);
        ok(sphpa_make_box(&s.initial, low, high, &body, &err), &err);
        s.press = shake_module(&rate);
        s.press_first = 1; /* its gradients are there before the density asks for them */
        s.options.dt_fixed = 1e-3;
        s.options.integrator = k % 2 ? SPHPA_RK2 : SPHPA_PREDICTOR_CORRECTOR;
        ok(create(&s, &err), &err);
        const double *seen = sphpa_particles_column(&s.sim.p, "LeastTrial");
        for (int step = 0; step < 5; step++) {
            ok(sphpa_sim_step(&s.sim, HUGE_VAL, &err), &err);
            for (size_t i = 0; i < s.sim.p.n; i++) {
                assert_true(seen[i] < 1.2); /* ln rho is 0.1 higher in the middle */
                assert_near(s.sim.p.alpha[i], s.crush.alpha0, 1e-12);
                if (s.sim.p.alpha_min != NULL)
                    assert_near(s.sim.p.alpha_min[i], s.crush.alpha0, 1e-12);
            }
        }
        assert_int_equal(s.pores.stats.loading, 0);
        assert_int_equal(s.pores.stats.grew, 0);
        end(&s);
    }
}

/* Every particle's L is given, and nothing moves; density, pressure and stress are the scene's. */
enum { GIVEN = 125 };

static sphpa_result given_gradients(sphpa_sim *sim, void *params, size_t first, size_t last,
                                    size_t *bad) {
    (void)bad;
    for (size_t i = first; i < last; i++) {
        const double *L = (const double *)params + 9 * sim->p.id[i];
        for (size_t k = 0; k < 9; k++) sim->p.L[9 * i + k] = (sphpa_real)L[k];
        sim->p.div_v[i] = (sphpa_real)(L[0] + L[4] + L[8]);
    }
    return SPHPA_OK;
}

static sphpa_module given_module(double *L) {
    sphpa_module module = shake_module(NULL);
    module.name = "given";
    module.params = L;
    module.columns = 0;
    module.pass[0].particle = given_gradients;
    module.pass[1].particle = shake_nothing;
    module.pass[3].particle = shake_nothing;
    return module;
}

/* a stress without trace, of size about 1 */
static void any_deviator(sphpa_rng *rng, double S[9]) {
    for (int a = 0; a < 3; a++)
        for (int b = a; b < 3; b++)
            S[3 * a + b] = S[3 * b + a] = 2.0 * sphpa_rng_uniform(rng) - 1.0;
    double third = (S[0] + S[4] + S[8]) / 3.0;
    for (int a = 0; a < 9; a += 4) S[a] -= third;
}

/* dS [Pa] of one short step that the deviator feels the share f of, by which alpha grew by `more` */
static void change_by_hand(const double *S, const double *L, double dt, double G, double f,
                           double alpha, double more, double out[9]) {
    double third = (L[0] + L[4] + L[8]) / 3.0;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            double turn = 0.0, e = 0.5 * (L[3 * a + b] + L[3 * b + a]) - (a == b ? third : 0.0);
            for (int c = 0; c < 3; c++) {
                double W_ac = 0.5 * (L[3 * a + c] - L[3 * c + a]);
                double W_cb = 0.5 * (L[3 * c + b] - L[3 * b + c]);
                turn += W_ac * S[3 * c + b] - S[3 * a + c] * W_cb;
            }
            out[3 * a + b] = dt * (f / alpha * 2.0 * G * e + turn) - S[3 * a + b] / alpha * more;
        }
}

static const size_t given_at[6] = {0, 4, 8, 1, 5, 2}; /* xx yy zz xy yz xz */

/* a stress and a gradient for every particle, of sizes G `size` dt and `size`; all of them close */
static void give_any(setting *s, double size, double *L, double *S) {
    sphpa_rng rng = sphpa_rng_seed(7, 1);
    for (size_t i = 0; i < GIVEN; i++) {
        double *own = S + 9 * s->sim.p.id[i], *l = L + 9 * s->sim.p.id[i];
        any_deviator(&rng, own);
        for (size_t k = 0; k < 9; k++) {
            own[k] *= s->G * size * s->options.dt_fixed;
            l[k] = size * (2.0 * sphpa_rng_uniform(&rng) - 1.0);
        }
        double more = (l[0] + l[4] + l[8]) / 3.0 + size;
        for (size_t k = 0; k < 9; k += 4) l[k] -= more; /* of the trace -3 size */
        for (size_t k = 0; k < 6; k++) s->sim.p.S[6 * i + k] = (sphpa_real)own[given_at[k]];
    }
}

/* In any stress, strained and turned in any way while pores close: the sign of S:edot alone says
   whether the deviator feels all of the strain or the matrix's share. */
static void test_power_decides(void **state) {
    (void)state;
    setting s;
    sphpa_error err;
    double low[3] = {-1, -1, -1}, high[3] = {1, 1, 1}, L[9 * GIVEN], S[9 * GIVEN], before[2][GIVEN];
    const double size = 0.1, dt = 1e-3; /* strains of 1e-4 */
    prepare(&s, ALUMINIUM, SPHPA_CRUSH_FLAT);
    s.G = 26.9e9;
    sphpa_body body = body_of(&s);
    body.spacing = 0.4;
    ok(sphpa_make_begin(&s.initial, 3, &err), &err);
    ok(sphpa_make_box(&s.initial, low, high, &body, &err), &err);
    assert_int_equal(s.initial.n, GIVEN);
    s.press = given_module(L);
    s.press_first = 1;
    s.options.dt_fixed = dt;
    ok(create(&s, &err), &err);
    for (int k = 0; k < 9 * GIVEN; k++) L[k] = k % 9 % 4 == 0 ? -2.0 : 0.0;
    for (int k = 0; k < 20; k++) ok(sphpa_sim_step(&s.sim, HUGE_VAL, &err), &err);
    give_any(&s, size, L, S);
    for (size_t i = 0; i < GIVEN; i++) {
        before[0][s.sim.p.id[i]] = s.sim.p.alpha[i];
        before[1][s.sim.p.id[i]] = s.sim.p.rho[i];
    }
    ok(sphpa_sim_step(&s.sim, HUGE_VAL, &err), &err);
    int loads = 0;
    for (size_t i = 0; i < GIVEN; i++) {
        size_t id = (size_t)s.sim.p.id[i];
        const double *own = S + 9 * id;
        double alpha = s.sim.p.alpha[i], power = 0.0, want[9];
        double bulk = log(s.sim.p.rho[i] / before[1][id]);
        double f = (bulk + log(alpha / before[0][id])) / bulk;
        for (size_t k = 0; k < 9; k++) power += own[k] * L[9 * id + k];
        assert_true(f < 0.7 && f >= 0.0);
        loads += power >= 0.0;
        change_by_hand(own, L + 9 * id, dt, s.G, power >= 0.0 ? f : 1.0, alpha,
                       alpha - before[0][id], want);
        for (size_t k = 0; k < 6; k++)
            assert_near_abs((double)s.sim.p.S[6 * i + k] - own[given_at[k]], want[given_at[k]],
                            1e-3 * s.G * size * dt);
    }
    assert_true(loads > 30 && loads < 95);
    end(&s);
}

/* ---- restart and wrong setups --------------------------------------------------------------- */

typedef struct box_of_bytes {
    unsigned char data[256];
    size_t bytes;
    int reading;
} box_of_bytes;

static sphpa_result exchange(void *user, const char *name, void **data, size_t *bytes,
                             sphpa_error *err) {
    box_of_bytes *box = (box_of_bytes *)user;
    (void)err;
    assert_non_null(name);
    if (!box->reading) {
        assert_true(*bytes <= sizeof box->data);
        memcpy(box->data, *data, *bytes);
        box->bytes = *bytes;
        return SPHPA_OK;
    }
    *data = malloc(box->bytes);
    memcpy(*data, box->data, box->bytes);
    *bytes = box->bytes;
    return SPHPA_OK;
}

static void test_restart(void **state) {
    (void)state;
    setting s, t;
    piston p;
    sphpa_error err;
    box_of_bytes box;
    memset(&box, 0, sizeof box);
    prepare(&s, ALUMINIUM, SPHPA_CRUSH_HERRMANN);
    begin_piston(&s, &p, 300.0, 20);
    for (int k = 0; k < 60; k++) ok(sphpa_sim_step(&s.sim, 1.0, &err), &err);
    sphpa_module module = sphpa_pores(&s.pores);
    ok(module.keep(&s.sim, &s.pores, exchange, &box, &err), &err);
    /* the particles as a restart has them: a history, alpha between its least and its foot */
    prepare(&t, ALUMINIUM, SPHPA_CRUSH_HERRMANN);
    ok(sphpa_particles_create(&t.initial, 1, s.sim.p.n, SPHPA_F(alpha) | SPHPA_F(alpha_min), 0,
                              NULL, 0, &err), &err);
    ok(sphpa_particles_append(&t.initial, &s.sim.p, &err), &err);
    size_t crushed = 0; /* the one that is farthest from its alpha0 */
    for (size_t i = 0; i < s.sim.p.n; i++)
        if (t.initial.alpha[i] < t.initial.alpha[crushed]) crushed = i;
    t.initial.alpha[crushed] *= 1.0 + 1e-6;
    ok(create(&t, &err), &err);
    size_t lower = 0;
    for (size_t i = 0; i < t.sim.p.n; i++) {
        assert_true(t.sim.p.alpha_min[i] == s.sim.p.alpha_min[i]);
        lower += t.sim.p.alpha_min[i] < t.sim.p.alpha[i];
    }
    assert_true(lower > 0);
    box.reading = 1;
    ok(module.keep(&t.sim, &t.pores, exchange, &box, &err), &err);
    assert_memory_equal(&t.pores.stats, &s.pores.stats, sizeof t.pores.stats);
    assert_true(t.pores.stats.loading > 0);
    box.bytes = 7;
    assert_int_equal(module.keep(&t.sim, &t.pores, exchange, &box, &err), SPHPA_ERROR_FORMAT);
    end(&s);
    end(&t);
}

enum {
    NO_SOLID, NO_CRUSH, NO_MATRIX, NULL_MATRIX, INVERTED, PE_ABOVE_PS, NOT_PREPARED, NO_SUCH_SOLVER,
    BAD_TOL, FORGOTTEN, TOO_POROUS, BELOW_ONE, BAD_MATERIAL, OTHER_RHO0, OTHER_SOLID, NAN_CURVE,
    NO_PORES, RHO_OF_MATRIX, MISTAKES
};

static const struct {
    sphpa_result result;
    const char *text;
} mistake[MISTAKES] = {
    {SPHPA_ERROR_MISSING, "set solid"},     {SPHPA_ERROR_MISSING, "crush"},
    {SPHPA_ERROR_MISSING, "matrix"},        {SPHPA_ERROR_MISSING, "no matrix"},
    {SPHPA_ERROR_CURVE, "alpha_t"},         {SPHPA_ERROR_CURVE, "Ps"},
    {SPHPA_ERROR_MISSING, "prepare"},       {SPHPA_ERROR_RANGE, "solver 17"},
    {SPHPA_ERROR_RANGE, "tol = -1"},        {SPHPA_ERROR_ALPHA, "alpha = 1"},
    {SPHPA_ERROR_ALPHA, "above alpha0"},    {SPHPA_ERROR_ALPHA, "at least 1"},
    {SPHPA_ERROR_RANGE, "material 3 of 1"}, {SPHPA_ERROR_MATERIAL, "rho0"},
    {SPHPA_ERROR_MISSING, "sphpa_solid"},   {SPHPA_ERROR_NOT_FINITE, "Ps"},
    {SPHPA_ERROR_ALPHA, "add sphpa_pores()"}, {SPHPA_ERROR_ALPHA, "rho is the bulk's"},
};

static void make_mistake(setting *s, int kind) {
    switch (kind) {
    case NO_SOLID: s->pores.solid = NULL; break;
    case NO_CRUSH: s->pores.crush = NULL; break;
    case NO_MATRIX: s->pores.matrix = NULL; break;
    case NULL_MATRIX: s->matrix = NULL; break;
    case INVERTED: s->crush.alpha_t = 5.0; break;
    case PE_ABOVE_PS: s->crush.Pe = 3e8; break;
    case NOT_PREPARED: s->crush.elastic = SPHPA_CRUSH_HERRMANN; break;
    case NO_SUCH_SOLVER: s->pores.solver = (sphpa_palpha_solver)17; break;
    case BAD_TOL: s->pores.options.tol = -1.0; break;
    case FORGOTTEN: for (size_t i = 0; i < s->initial.n; i++) s->initial.alpha[i] = 1.0; break;
    case RHO_OF_MATRIX:
        for (size_t i = 0; i < s->initial.n; i++) s->initial.rho[i] = s->matrix->rho0;
        break;
    case NO_PORES: s->dense = 2; break;
    case TOO_POROUS: s->initial.alpha[5] = 4.65; break;
    case BELOW_ONE: s->initial.alpha[5] = 0.99; break;
    case BAD_MATERIAL: s->initial.material[7] = 3; break;
    case NAN_CURVE: s->crush.Ps = NAN; break;
    default: break;
    }
}

static void test_wrong_setups(void **state) {
    (void)state;
    sphpa_solid_params other;
    sphpa_tillotson lighter;
    for (int kind = 0; kind < MISTAKES; kind++) {
        setting s;
        sphpa_error err;
        double low[3] = {0, 0, 0}, high[3] = {1, 1, 1};
        prepare(&s, PUMICE, SPHPA_CRUSH_FLAT);
        sphpa_body body = body_of(&s);
        body.spacing = 0.25;
        ok(sphpa_make_begin(&s.initial, 3, &err), &err);
        ok(sphpa_make_box(&s.initial, low, high, &body, &err), &err);
        make_mistake(&s, kind);
        other = s.solid;
        if (kind == OTHER_SOLID) s.pores.solid = &other;
        lighter = *sphpa_tillotson_find("pumice");
        lighter.rho0 *= 0.9;
        if (kind == OTHER_RHO0) s.matrix = &lighter;
        memset(&err, 0, sizeof err);
        s.order = kind % 2; /* pores' checks do not lean on those of solid */
        assert_int_equal(create(&s, &err), mistake[kind].result);
        if (strstr(err.message, mistake[kind].text) == NULL)
            fail_msg("mistake %d: \"%s\" does not say \"%s\"", kind, err.message,
                     mistake[kind].text);
        assert_null(s.sim.work);
        end(&s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_piston_100),
        cmocka_unit_test(test_piston_300),
        cmocka_unit_test(test_piston_458),
        cmocka_unit_test(test_piston_pumice),
        cmocka_unit_test(test_piston_converges),
        cmocka_unit_test(test_elastic_waves),
        cmocka_unit_test(test_solvers_agree),
        cmocka_unit_test(test_newton_fails_loudly),
        cmocka_unit_test(test_threads),
        cmocka_unit_test(test_dense_bits_and_order),
        cmocka_unit_test(test_fields),
        cmocka_unit_test(test_cycles),
        cmocka_unit_test(test_herrmann_release),
        cmocka_unit_test(test_deviator),
        cmocka_unit_test(test_deviator_unloads),
        cmocka_unit_test(test_refresh_keeps_the_wave),
        cmocka_unit_test(test_trials_do_not_commit),
        cmocka_unit_test(test_power_decides),
        cmocka_unit_test(test_restart),
        cmocka_unit_test(test_wrong_setups),
    };
    return cmocka_run_group_tests_name("PORES", tests, NULL, NULL);
}
