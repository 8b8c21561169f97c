/* Scenes of small passes of our own: order, fields, steps, neighbours, limits, errors, threads. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#define SPHPA_SPH_IMPLEMENTATION
#include "sphpa.h"

#include "near.h"

#define ROUNDING FINE(1e-13, FLOAT_ROUNDING)

/* ---- helpers --------------------------------------------------------------------------------- */

static sphpa_module module_named(const char *name, void *params) {
    sphpa_module module;
    memset(&module, 0, sizeof module);
    module.name = name;
    module.params = params;
    return module;
}

static sphpa_pass *add_pass(sphpa_module *module, const char *name, sphpa_stage stage,
                            sphpa_mask reads, sphpa_mask writes) {
    sphpa_pass *pass = &module->pass[module->passes++];
    pass->name = name;
    pass->stage = stage;
    pass->reads = reads;
    pass->writes = writes;
    return pass;
}

static sphpa_pass *add_pair(sphpa_module *module, const char *name, sphpa_stage stage,
                            sphpa_mask reads, sphpa_mask writes,
                            void (*pair)(sphpa_sim *, void *, const sphpa_neighbours *)) {
    sphpa_pass *pass = add_pass(module, name, stage, reads, writes);
    pass->kind = SPHPA_PASS_PAIR;
    pass->pair = pair;
    return pass;
}

static sphpa_result nothing(sphpa_sim *sim, void *params, size_t first, size_t last, size_t *bad) {
    (void)sim, (void)params, (void)first, (void)last, (void)bad;
    return SPHPA_OK;
}

static sphpa_scene scene_of(sphpa_module module) {
    sphpa_scene scene;
    memset(&scene, 0, sizeof scene);
    assert_int_equal(sphpa_scene_add(&scene, module), SPHPA_OK);
    return scene;
}

static sphpa_sim_options options_of(double dt_fixed) {
    sphpa_sim_options options;
    memset(&options, 0, sizeof options);
    options.dt_fixed = dt_fixed;
    return options;
}

/* n particles at random in [-1, 1]^dim, masses and supports from 0.5 to 1 times those given */
static sphpa_particles random_set(int dim, size_t n, double h, uint64_t seed) {
    sphpa_particles p;
    assert_int_equal(sphpa_particles_create(&p, dim, n, 0, 0, NULL, 0, NULL), SPHPA_OK);
    assert_int_equal(sphpa_particles_add(&p, n, NULL, NULL), SPHPA_OK);
    sphpa_rng rng = sphpa_rng_seed(seed, 7);
    for (size_t i = 0; i < n; i++) {
        for (size_t a = 0; a < (size_t)dim; a++) {
            p.x[3 * i + a] = 2.0 * sphpa_rng_uniform(&rng) - 1.0;
            p.v[3 * i + a] = (sphpa_real)(2.0 * sphpa_rng_uniform(&rng) - 1.0);
        }
        p.m[i] = (sphpa_real)(0.5 + 0.5 * sphpa_rng_uniform(&rng));
        p.h[i] = (sphpa_real)(h * (0.5 + 0.5 * sphpa_rng_uniform(&rng)));
        p.rho[i] = 1.0;
        p.u[i] = 1.0;
    }
    return p;
}

static sphpa_sim *sim_of(const sphpa_scene *scene, const sphpa_particles *p,
                         const sphpa_sim_options *options) {
    sphpa_sim *sim = (sphpa_sim *)malloc(sizeof *sim);
    sphpa_error err;
    sphpa_result result = sphpa_sim_create(sim, scene, p, options, &err);
    if (result != SPHPA_OK) fail_msg("%s", err.message);
    return sim;
}

static void sim_drop(sphpa_sim *sim) {
    sphpa_sim_free(sim);
    free(sim);
}

static void sim_steps(sphpa_sim *sim, int steps) {
    sphpa_error err;
    for (int k = 0; k < steps; k++)
        if (sphpa_sim_step(sim, HUGE_VAL, &err) != SPHPA_OK) fail_msg("%s", err.message);
}

static size_t index_of(const sphpa_sim *sim, int64_t id) {
    for (size_t i = 0; i < sim->p.n; i++)
        if (sim->p.id[i] == id) return i;
    fail_msg("no particle has the id %d", (int)id);
    return 0;
}

/* ---- order, names, fields -------------------------------------------------------------------- */

typedef struct journal {
    char text[400];
    double dt_stage[400];
    int committing[400];
} journal;

#define WRITER(name, letter)                                                                       \
    static sphpa_result name(sphpa_sim *sim, void *params, size_t first, size_t last,              \
                             size_t *bad) {                                                        \
        journal *log = (journal *)params;                                                          \
        size_t n = strlen(log->text);                                                              \
        (void)first, (void)last, (void)bad;                                                        \
        log->text[n] = letter;                                                                     \
        log->dt_stage[n] = sim->dt_stage / (sim->dt > 0.0 ? sim->dt : 1.0);                        \
        log->committing[n] = sim->committing;                                                      \
        return SPHPA_OK;                                                                           \
    }
WRITER(write_d, 'd')
WRITER(write_g, 'g')
WRITER(write_p, 'p')
WRITER(write_q, 'q')
WRITER(write_s, 's')
WRITER(write_y, 'y')
WRITER(write_k, 'k')
WRITER(write_f, 'f')
WRITER(write_e, 'e')
WRITER(write_c, 'c')
WRITER(write_r, 'r')

static double limit_tenth(const sphpa_sim *sim, const void *params, size_t i) {
    (void)sim, (void)params, (void)i;
    return 0.1;
}

static void passes_run_by_stage(void **state) {
    (void)state;
    journal log;
    sphpa_module late = module_named("late", &log), early = module_named("early", &log);
    add_pass(&late, "r", SPHPA_STAGE_RESIZE, 0, 0)->particle = write_r;
    add_pass(&late, "e", SPHPA_STAGE_ENERGY, 0, 0)->particle = write_e;
    sphpa_pass *pressure = add_pass(&late, "p", SPHPA_STAGE_PRESSURE, 0, 0);
    pressure->particle = write_p;
    pressure->at_commit = 1;
    add_pass(&late, "q", SPHPA_STAGE_PRESSURE, 0, 0)->particle = write_q;
    add_pass(&late, "d", SPHPA_STAGE_DENSITY, 0, 0)->particle = write_d;
    sphpa_pass *limit = add_pass(&late, "limit", SPHPA_STAGE_LIMIT, 0, 0);
    limit->kind = SPHPA_PASS_REDUCE;
    limit->limit = limit_tenth;
    add_pass(&early, "c", SPHPA_STAGE_COMMIT, 0, 0)->particle = write_c;
    add_pass(&early, "f", SPHPA_STAGE_FORCES, 0, 0)->particle = write_f;
    add_pass(&early, "k", SPHPA_STAGE_DAMAGE, 0, 0)->particle = write_k;
    add_pass(&early, "y", SPHPA_STAGE_YIELD, 0, 0)->particle = write_y;
    add_pass(&early, "s", SPHPA_STAGE_STRESS, 0, 0)->particle = write_s;
    add_pass(&early, "g", SPHPA_STAGE_GRADIENTS, 0, 0)->particle = write_g;
    sphpa_particles p = random_set(3, 10, 0.5, 1);
    for (int order = 0; order < 2; order++)
        for (int integrator = 0; integrator < 2; integrator++) {
            sphpa_scene scene = scene_of(order ? late : early);
            assert_int_equal(sphpa_scene_add(&scene, order ? early : late), SPHPA_OK);
            sphpa_sim_options options = options_of(0.0);
            options.integrator = (sphpa_integrator)integrator;
            sphpa_sim *sim = sim_of(&scene, &p, &options);
            memset(&log, 0, sizeof log);
            sim_steps(sim, 1); /* the first one begins with an evaluation at the start */
            const char *want = integrator ? "dgpqsykfe" "dgpqsykfe" "dgpqsykfe" "pcr"
                                          : "dgpqsykfe" "dgpqsykfe" "pcr";
            assert_string_equal(log.text, want);
            size_t n = strlen(want);
            assert_true(log.dt_stage[0] == 0.0); /* at the start */
            if (integrator) assert_true(log.dt_stage[9] == 0.0);
            assert_true(log.dt_stage[n - 4] == 0.5 && log.committing[n - 4] == 0); /* e, half way */
            assert_true(log.dt_stage[n - 3] == 1.0 && log.committing[n - 3] == 1); /* p again */
            assert_true(log.dt_stage[n - 2] == 1.0 && log.committing[n - 2] == 1); /* c */
            assert_int_equal(log.committing[n - 1], 0);                            /* r */
            sim_drop(sim);
        }
    sphpa_particles_free(&p);
}

static void create_fails(const sphpa_scene *scene, sphpa_result want, const char *words) {
    sphpa_particles p = random_set(2, 5, 0.5, 1);
    static sphpa_sim sim;
    sphpa_error err;
    memset(&err, 0, sizeof err);
    assert_int_equal(sphpa_sim_create(&sim, scene, &p, NULL, &err), want);
    assert_int_equal(err.result, want);
    if (strstr(err.message, words) == NULL) fail_msg("\"%s\" lacks \"%s\"", err.message, words);
    assert_null(sim.p.block);
    assert_null(sim.work);
    sphpa_particles_free(&p);
}

static void clash(sphpa_module *module, sphpa_result want, const char *words) {
    sphpa_scene scene = scene_of(*module);
    create_fails(&scene, want, words);
}

static void clashes_are_errors(void **state) {
    (void)state;
    sphpa_module module = module_named("m", NULL);
    add_pass(&module, "one", SPHPA_STAGE_FORCES, 0, 0)->particle = nothing;
    add_pass(&module, "one", SPHPA_STAGE_ENERGY, 0, 0)->particle = nothing;
    clash(&module, SPHPA_ERROR_RANGE, "\"one\"");
    module.pass[1].name = "two";
    module.pass[1].replaces = "two";
    clash(&module, SPHPA_ERROR_RANGE, "replaces itself");
    module.pass[1].replaces = "one";
    add_pass(&module, "three", SPHPA_STAGE_FORCES, 0, 0)->particle = nothing;
    module.pass[2].replaces = "one";
    clash(&module, SPHPA_ERROR_RANGE, "replaced by two");
    module.pass[2].replaces = NULL;
    module.pass[1].stage = SPHPA_STAGE_FORCES;
    module.pass[0].replaces = "two"; /* and "two" replaces "one": none would be left */
    clash(&module, SPHPA_ERROR_RANGE, "in turn");
    module.pass[0].replaces = "three";
    module.pass[2].replaces = "two";
    clash(&module, SPHPA_ERROR_RANGE, "in turn");
    module.pass[0].replaces = NULL;
    module.passes = 1;
    const sphpa_pass good = module.pass[0];
    module.pass[0].particle = NULL; /* no function */
    clash(&module, SPHPA_ERROR_RANGE, "\"one\"");
    module.pass[0] = good;
    module.pass[0].kind = SPHPA_PASS_PAIR; /* the wrong one */
    clash(&module, SPHPA_ERROR_RANGE, "kind");
    module.pass[0] = good;
    module.pass[0].stage = SPHPA_STAGE_LIMIT; /* only REDUCE belongs there */
    clash(&module, SPHPA_ERROR_RANGE, "stage");
    module.pass[0].stage = SPHPA_STAGE_COUNT;
    clash(&module, SPHPA_ERROR_RANGE, "stage");
    module.pass[0] = good;
    module.pass[0].at_commit = 1; /* forces are over by then */
    clash(&module, SPHPA_ERROR_RANGE, "stage");
    module.pass[0] = good;
    module.pass[0].record_bytes = 8; /* and nothing fills them */
    clash(&module, SPHPA_ERROR_RANGE, "functions");
    module.pass[0] = good;
    module.pass[0].name = NULL;
    clash(&module, SPHPA_ERROR_RANGE, "no name");
    module.pass[0] = good;
    module.columns = 2;
    strcpy(module.column[0].name, "twin");
    strcpy(module.column[1].name, "twin");
    clash(&module, SPHPA_ERROR_RANGE, "twin");

    sphpa_scene scene = scene_of(module_named("m", NULL));
    assert_int_equal(sphpa_scene_add(&scene, module_named("m", NULL)), SPHPA_ERROR_RANGE);
    assert_int_equal(sphpa_scene_add(&scene, module_named(NULL, NULL)), SPHPA_ERROR_RANGE);
    static const char *const names[] = {"a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l"};
    for (int k = 1; k < SPHPA_SCENE_MODULES; k++)
        assert_int_equal(sphpa_scene_add(&scene, module_named(names[k], NULL)), SPHPA_OK);
    assert_int_equal(sphpa_scene_add(&scene, module_named("one more", NULL)), SPHPA_ERROR_RANGE);
    assert_int_equal(scene.modules, SPHPA_SCENE_MODULES);
}

static void replaced_passes_are_gone(void **state) {
    (void)state;
    journal log;
    sphpa_particles p = random_set(2, 5, 0.5, 1);
    for (int order = 0; order < 2; order++) {
        sphpa_module plain = module_named("plain", &log), better = module_named("better", &log);
        add_pass(&plain, "pressure", SPHPA_STAGE_PRESSURE, SPHPA_F(n_act), 0)->particle = write_p;
        add_pass(&plain, "stress", SPHPA_STAGE_STRESS, 0, 0)->particle = write_s;
        sphpa_pass *pass = add_pass(&better, "better pressure", SPHPA_STAGE_PRESSURE, 0, 0);
        pass->particle = write_q;
        pass->replaces = "pressure";
        sphpa_scene scene = scene_of(order ? plain : better);
        assert_int_equal(sphpa_scene_add(&scene, order ? better : plain), SPHPA_OK);
        sphpa_sim_options options = options_of(1e-3);
        sphpa_sim *sim = sim_of(&scene, &p, &options);
        assert_null(sim->p.n_act); /* nor are its fields there */
        memset(&log, 0, sizeof log);
        sim_steps(sim, 1);
        assert_string_equal(log.text, "qsqs");
        sim_drop(sim);
    }
    sphpa_particles_free(&p);
}

static void fields_are_the_union(void **state) {
    (void)state;
    sphpa_module one = module_named("one", NULL), two = module_named("two", NULL);
    sphpa_pass *pass = add_pass(&one, "a", SPHPA_STAGE_STRESS, SPHPA_F(L), 0);
    pass->particle = nothing;
    pass->advances = SPHPA_F(S);
    add_pass(&two, "b", SPHPA_STAGE_PRESSURE, SPHPA_F(alpha), SPHPA_F(P))->particle = nothing;
    sphpa_scene scene = scene_of(one);
    assert_int_equal(sphpa_scene_add(&scene, two), SPHPA_OK);
    sphpa_particles p = random_set(3, 5, 0.5, 1);
    sphpa_sim *sim = sim_of(&scene, &p, NULL);
    sphpa_mask want = SPHPA_BASIC_FIELDS | SPHPA_F(a) | SPHPA_F(du) | SPHPA_F(L) | SPHPA_F(S) |
                      SPHPA_F(alpha) | SPHPA_F(P);
    assert_true(sim->p.fields == want);
    assert_true(sim->p.start_fields == (SPHPA_F(v) | SPHPA_F(u) | SPHPA_F(S)));
    assert_true(sim->p.D == NULL && sim->p.C == NULL && sim->p.n_act == NULL &&
                sim->p.omega == NULL && sim->p.flaw_min == NULL);
    for (size_t i = 0; i < 5; i++) { /* what the caller did not set is solid */
        assert_true(sim->p.alpha[i] == 1.0);
        assert_int_equal(sim->p.id[i], p.id[i]);
    }
    sim_drop(sim);
    sphpa_particles_free(&p);
}

static sphpa_result advance_column(sphpa_sim *sim, void *params, size_t first, size_t last,
                                   size_t *bad) {
    (void)params, (void)bad;
    double *clock = sphpa_particles_column(&sim->p, "clock");
    const double *start = sim->p.column[0].start;
    for (size_t i = first; i < last; i++)
        for (size_t c = 0; c < 2; c++)
            clock[2 * i + c] = start[2 * i + c] + (double)(c + 1) * sim->dt_stage;
    return SPHPA_OK;
}

static void columns_advance_from_the_start(void **state) {
    (void)state;
    sphpa_module module = module_named("clock", NULL);
    sphpa_pass *pass = add_pass(&module, "clock", SPHPA_STAGE_STRESS, 0, 0);
    pass->particle = advance_column;
    pass->at_commit = 1;
    module.columns = 1;
    strcpy(module.column[0].name, "clock");
    module.column[0].components = 2;
    sphpa_scene scene = scene_of(module);
    sphpa_particles p = random_set(2, 300, 0.1, 3), with;
    assert_int_equal(sphpa_particles_create(&with, 2, 0, 0, 0, module.column, 1, NULL), SPHPA_OK);
    assert_int_equal(sphpa_particles_append(&with, &p, NULL), SPHPA_OK);
    for (size_t i = 0; i < with.n; i++) with.column[0].data[2 * i] = (double)i;
    for (int integrator = 0; integrator < 2; integrator++) {
        sphpa_sim_options options = options_of(0.01);
        options.integrator = (sphpa_integrator)integrator;
        sphpa_sim *sim = sim_of(&scene, &with, &options);
        sim_steps(sim, 20);
        assert_int_equal(sphpa_sim_refresh(sim, NULL), SPHPA_OK);
        const double *clock = sphpa_particles_column(&sim->p, "clock");
        for (size_t i = 0; i < sim->p.n; i++) { /* no trial compounds; sorting takes them along */
            assert_near_abs(clock[2 * i] - (double)sim->p.id[i], 0.2, 1e-12);
            assert_near_abs(clock[2 * i + 1], 0.4, 1e-14);
        }
        sim_drop(sim);
    }
    sphpa_particles_free(&with);
    sphpa_particles_free(&p);
}

/* ---- integrators ----------------------------------------------------------------------------- */

typedef struct spring {
    double w2, damping, cooling; /* a = -w2 x - damping v, du = -cooling u */
} spring;

static sphpa_result spring_force(sphpa_sim *sim, void *params, size_t first, size_t last,
                                 size_t *bad) {
    const spring *s = (const spring *)params;
    (void)bad;
    for (size_t k = 3 * first; k < 3 * last; k++)
        sim->p.a[k] += (sphpa_real)(-s->w2 * sim->p.x[k] - s->damping * (double)sim->p.v[k]);
    return SPHPA_OK;
}

static sphpa_result spring_heat(sphpa_sim *sim, void *params, size_t first, size_t last,
                                size_t *bad) {
    const spring *s = (const spring *)params;
    (void)bad;
    for (size_t i = first; i < last; i++)
        sim->p.du[i] += (sphpa_real)(-s->cooling * sim->p.u[i]);
    return SPHPA_OK;
}

static sphpa_scene spring_scene(spring *s) {
    sphpa_module module = module_named("spring", s);
    add_pass(&module, "spring", SPHPA_STAGE_FORCES, SPHPA_F(x) | SPHPA_F(v), SPHPA_F(a))->particle =
        spring_force;
    add_pass(&module, "heat", SPHPA_STAGE_ENERGY, SPHPA_F(u), SPHPA_F(du))->particle = spring_heat;
    return scene_of(module);
}

static sphpa_particles one_particle(void) {
    sphpa_particles p = random_set(1, 1, 0.1, 1);
    p.x[0] = 1.0;
    p.v[0] = (sphpa_real)0.5;
    return p;
}

/* errors of x, v and u at t = 2 with n steps */
static void spring_errors(spring *s, int integrator, int n, double error[3]) {
    sphpa_particles p = one_particle();
    sphpa_scene scene = spring_scene(s);
    sphpa_sim_options options = options_of(2.0 / n);
    options.integrator = (sphpa_integrator)integrator;
    sphpa_sim *sim = sim_of(&scene, &p, &options);
    sim_steps(sim, n);
    double k = 0.5 * s->damping, w = sqrt(s->w2 - k * k), t = 2.0, e = exp(-k * t);
    double B = (0.5 + k) / w; /* x = e^-kt (cos wt + B sin wt) */
    double x = e * (cos(w * t) + B * sin(w * t));
    double v = -k * x + e * w * (B * cos(w * t) - sin(w * t));
    error[0] = fabs(sim->p.x[0] - x);
    error[1] = fabs((double)sim->p.v[0] - v);
    error[2] = fabs(sim->p.u[0] - exp(-s->cooling * t));
    assert_near(sim->time, 2.0, 1e-12);
    assert_int_equal(sim->stats.evaluations, integrator ? 2 * n + 1 : n + 1);
    sim_drop(sim);
    sphpa_particles_free(&p);
}

static void integrators_are_of_second_order(void **state) {
    (void)state;
    spring undamped = {4.0, 0.0, 0.7}, damped = {4.0, 0.9, 0.7};
    spring *springs[2] = {&undamped, &damped};
    for (int which = 0; which < 2; which++)
        for (int integrator = 0; integrator < 2; integrator++) {
            double coarse[3], fine[3];
            spring_errors(springs[which], integrator, 100, coarse);
            spring_errors(springs[which], integrator, 200, fine);
            for (int k = 0; k < 3; k++) {
                double order = log2(coarse[k] / fine[k]);
                if (sizeof(sphpa_real) == 8) assert_near_abs(order, 2.0, 0.15);
                assert_true(coarse[k] < 2e-3);
            }
        }
}

static void the_leapfrog_runs_backwards(void **state) {
    (void)state;
    spring s = {4.0, 0.0, 0.0};
    sphpa_particles p = one_particle();
    sphpa_scene scene = spring_scene(&s);
    sphpa_sim_options options = options_of(0.05);
    sphpa_sim *sim = sim_of(&scene, &p, &options);
    /* each step is a map that its mirror image undoes, if the predictor's a does not matter */
    sim_steps(sim, 500);
    sim->p.v[0] = -sim->p.v[0];
    sim_steps(sim, 500);
    assert_near_abs(sim->p.x[0], 1.0, 5e3 * ROUNDING);
    assert_near_abs((double)sim->p.v[0], -0.5, 5e3 * ROUNDING);
    sim_drop(sim);
    sphpa_particles_free(&p);
}

static void particles_go_round_the_box(void **state) {
    (void)state;
    spring s = {0.0, 0.0, 0.0};
    sphpa_particles p = random_set(2, 400, 0.05, 5);
    sphpa_scene scene = spring_scene(&s);
    sphpa_sim_options options = options_of(0.02);
    for (int a = 0; a < 2; a++) options.box.low[a] = -1.0, options.box.high[a] = 1.0;
    options.box.periodic[0] = 1; /* the other axis is open */
    sphpa_sim *sim = sim_of(&scene, &p, &options);
    sim_steps(sim, 200); /* up to two boxes far */
    for (size_t k = 0; k < sim->p.n; k++) {
        size_t i = (size_t)sim->p.id[k];
        assert_true(sim->p.x[3 * k] >= -1.0 && sim->p.x[3 * k] <= 1.0);
        double x = p.x[3 * i] + 4.0 * (double)p.v[3 * i];
        double gap = remainder(sim->p.x[3 * k] - x, 2.0);
        assert_near_abs(gap, 0.0, 1e-12);
        assert_near_abs(sim->p.x[3 * k + 1], p.x[3 * i + 1] + 4.0 * (double)p.v[3 * i + 1], 1e-12);
    }
    sim_drop(sim);
    sphpa_particles_free(&p);
}

/* ---- neighbours ------------------------------------------------------------------------------ */

/* P = sum m W(h_i), a = sum m x_ij W(h_j), c = how many; S gets what unfiltered passes see */
static void sum_pair(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    const sphpa_particles *p = &sim->p;
    size_t i = near->i;
    double density = 0.0, first[3] = {0.0, 0.0, 0.0};
    for (size_t k = 0; k < near->count; k++) {
        size_t j = near->j[k];
        double m = (double)p->m[j], h = near->h[k];
        density += m * sphpa_kernel_w(sim->options.kernel, p->dim, near->r[k], (double)p->h[i]);
        double w = m * sphpa_kernel_w(sim->options.kernel, p->dim, near->r[k], h);
        first[0] += w * near->dx[k];
        first[1] += w * near->dy[k];
        first[2] += w * near->dz[k];
        if (h != (double)p->h[j]) density = (double)NAN;
    }
    sim->p.P[i] = (sphpa_real)density;
    sim->p.c[i] = (sphpa_real)near->count;
    for (size_t a = 0; a < 3; a++) sim->p.a[3 * i + a] = (sphpa_real)first[a];
}

static void count_pair(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    sim->p.div_v[near->i] = (sphpa_real)near->count;
}

static void compare_with_all_pairs(const sphpa_sim *sim) {
    const sphpa_particles *p = &sim->p;
    double support = sphpa_kernel_support(sim->options.kernel);
    for (size_t i = 0; i < p->n; i++) {
        double density = 0.0, first[3] = {0.0, 0.0, 0.0}, scale = 0.0;
        int count = 0;
        for (size_t j = 0; j < p->n; j++) {
            double dx[3], r = 0.0, hi = (double)p->h[i], hj = (double)p->h[j];
            if (i == j) continue;
            for (size_t a = 0; a < 3; a++) {
                dx[a] = p->x[3 * i + a] - p->x[3 * j + a];
                if (sim->options.box.periodic[a]) dx[a] = remainder(dx[a], 2.0);
                r += dx[a] * dx[a];
            }
            r = sqrt(r);
            if (!(r < support * fmax(hi, hj))) continue;
            count++;
            density += (double)p->m[j] * sphpa_kernel_w(sim->options.kernel, p->dim, r, hi);
            double w = (double)p->m[j] * sphpa_kernel_w(sim->options.kernel, p->dim, r, hj);
            for (size_t a = 0; a < 3; a++) first[a] += w * dx[a];
            scale += w * r;
        }
        assert_int_equal((int)p->c[i], count);
        assert_true((double)p->div_v[i] >= count);
        assert_near(density, (double)p->P[i], 20.0 * ROUNDING);
        for (size_t a = 0; a < 3; a++)
            assert_near_abs(first[a], (double)p->a[3 * i + a], 20.0 * ROUNDING * (scale + 1e-30));
    }
}

static void pair_sums_equal_all_pairs(void **state) {
    (void)state;
    const size_t n = 700; /* two chunks of the lists */
    for (int dim = 1; dim <= 3; dim++)
        for (int periodic = 0; periodic < 2; periodic++) {
            sphpa_module module = module_named("sums", NULL);
            add_pair(&module, "sum", SPHPA_STAGE_FORCES, SPHPA_F(x) | SPHPA_F(m) | SPHPA_F(h),
                     SPHPA_F(P) | SPHPA_F(c) | SPHPA_F(a), sum_pair);
            add_pair(&module, "count", SPHPA_STAGE_FORCES, SPHPA_F(x), SPHPA_F(div_v), count_pair)
                ->unfiltered = 1;
            sphpa_scene scene = scene_of(module);
            const double h[3] = {0.02, 0.08, 0.19};
            sphpa_particles p = random_set(dim, n, h[dim - 1], (uint64_t)dim);
            sphpa_sim_options options = options_of(1e-200); /* no motion */
            options.kernel = (sphpa_kernel)((dim + 2 * periodic) % (int)SPHPA_KERNEL_COUNT);
            for (int a = 0; a < dim; a++) {
                options.box.low[a] = -1.0;
                options.box.high[a] = 1.0;
                options.box.periodic[a] = periodic;
            }
            sphpa_sim *sim = sim_of(&scene, &p, &options);
            sim_steps(sim, 1);
            compare_with_all_pairs(sim);
            assert_true(sim->stats.neighbours_mean > 2.0);
            sim_drop(sim);
            sphpa_particles_free(&p);
        }
}

static void count_balsara(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    sim->p.balsara[near->i] += (sphpa_real)1;
}

/* every third particle's h grows, or moves, between two traversals of one evaluation */
static sphpa_result grow_some(sphpa_sim *sim, void *params, size_t first, size_t last,
                              size_t *bad) {
    (void)bad;
    for (size_t i = first; i < last; i++)
        if (i % 3 == 0) sim->p.h[i] = (sphpa_real)((double)sim->p.h[i] * *(const double *)params);
    return SPHPA_OK;
}

static sphpa_result shift_some(sphpa_sim *sim, void *params, size_t first, size_t last,
                               size_t *bad) {
    const double share = *(const double *)params;
    (void)bad;
    for (size_t i = first; i < last; i++)
        if (i % 3 == 0) sim->p.x[3 * i] += (i % 2 ? share : -share) * (double)sim->p.h[i];
    return SPHPA_OK;
}

typedef struct place {
    double x[3];
} place;

static void place_pack(const sphpa_sim *sim, const void *params, size_t first, size_t last,
                       void *records) {
    (void)params;
    for (size_t i = first; i < last; i++) sphpa_sim_position_(sim, i, ((place *)records)[i].x);
}

/* omega = sum m W(h_i), of a group: its list need hold no more than what is within the supports */
static void place_group(sphpa_sim *sim, void *params, const sphpa_group *near) {
    (void)params;
    const place *places = (const place *)(const void *)near->records;
    for (size_t i = near->first; i < near->first + near->count; i++) {
        double sum = 0.0;
        for (size_t k = 0; k < near->entries; k++) {
            size_t j = SPHPA_TREE_ENTRY_INDEX(near->list[k]);
            const double *centre = near->centre[SPHPA_TREE_ENTRY_IMAGE(near->list[k])];
            double r2 = 0.0;
            for (int a = 0; a < sim->p.dim; a++) {
                double d = places[i].x[a] - near->centre[0][a] - (places[j].x[a] - centre[a]);
                r2 += d * d;
            }
            if (r2 > 0.0)
                sum += (double)sim->p.m[j] * sphpa_kernel_w(SPHPA_KERNEL_CUBIC, sim->p.dim,
                                                            sqrt(r2), (double)sim->p.h[i]);
        }
        sim->p.omega[i] = (sphpa_real)sum;
    }
}

static void lists_follow_what_passes_change(void **state) {
    (void)state;
    /* beyond what the skin allows for, beyond what lists without it do, and within; x moves; farther */
    double grow[5] = {1.4, 1.04, 1.004, 0.03, 0.5};
    for (int k = 0; k < 5; k++) {
        sphpa_module module = module_named("changes", &grow[k]);
        sphpa_mask shape = SPHPA_F(x) | SPHPA_F(m) | SPHPA_F(h);
        add_pair(&module, "before", SPHPA_STAGE_GRADIENTS, shape, SPHPA_F(balsara), count_balsara);
        add_pass(&module, "change", SPHPA_STAGE_PRESSURE, shape, k < 3 ? SPHPA_F(h) : SPHPA_F(x))
            ->particle = k < 3 ? grow_some : shift_some;
        sphpa_pass *group = add_pair(&module, "group", SPHPA_STAGE_STRESS, shape, SPHPA_F(omega),
                                     NULL);
        group->group = place_group;
        group->pack = place_pack;
        group->record_bytes = sizeof(place);
        add_pair(&module, "sum", SPHPA_STAGE_FORCES, shape,
                 SPHPA_F(P) | SPHPA_F(c) | SPHPA_F(a), sum_pair);
        add_pair(&module, "count", SPHPA_STAGE_FORCES, shape, SPHPA_F(div_v), count_pair)
            ->unfiltered = 1;
        sphpa_scene scene = scene_of(module);
        sphpa_particles p = random_set(3, 700, 0.17, 3);
        sphpa_sim_options options = options_of(1e-200);
        for (int a = 0; a < 3; a++) {
            options.box.low[a] = -1.0, options.box.high[a] = 1.0;
            options.box.periodic[a] = 1;
        }
        sphpa_sim *sim = sim_of(&scene, &p, &options);
        sim_steps(sim, 1);
        compare_with_all_pairs(sim);
        for (size_t i = 0; i < sim->p.n; i++)
            assert_near((double)sim->p.omega[i], (double)sim->p.P[i], 40.0 * ROUNDING);
        sim_drop(sim);
        sphpa_particles_free(&p);
    }
}

/* h breathes, so that supports outgrow their lists */
static sphpa_result breathe(sphpa_sim *sim, void *params, size_t first, size_t last, size_t *bad) {
    (void)params, (void)bad;
    double t = sim->time + sim->dt_stage;
    for (size_t i = first; i < last; i++)
        sim->p.h[i] = (sphpa_real)((double)sim->p.h0[i] * (1.0 + 0.3 * sin(9.0 * t)));
    return SPHPA_OK;
}

/* a force that depends on all neighbours, in two passes: P first, then -grad P */
static void push_density(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    double sum = 0.0;
    for (size_t k = 0; k < near->count; k++)
        sum += (double)sim->p.m[near->j[k]] * sphpa_kernel_w(SPHPA_KERNEL_CUBIC, sim->p.dim,
                                                             near->r[k],
                                                             (double)sim->p.h[near->i]);
    sim->p.P[near->i] = (sphpa_real)sum;
}

static void push_force(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    size_t i = near->i;
    double sum[3] = {0.0, 0.0, 0.0};
    for (size_t k = 0; k < near->count; k++) {
        size_t j = near->j[k];
        double h = fmax((double)sim->p.h[i], near->h[k]);
        double f = 3.0 * (double)sim->p.m[j] * (double)(sim->p.P[i] + sim->p.P[j]) /
                   ((double)sim->p.n * (near->r[k] + 1e-3));
        f *= h * h * h * sphpa_kernel_dw(SPHPA_KERNEL_CUBIC, sim->p.dim, near->r[k], h);
        sum[0] -= f * near->dx[k];
        sum[1] -= f * near->dy[k];
        sum[2] -= f * near->dz[k];
    }
    for (size_t a = 0; a < 3; a++) sim->p.a[3 * i + a] += (sphpa_real)sum[a];
}

static sphpa_scene push_scene(bool breathing) {
    sphpa_module module = module_named("push", NULL);
    if (breathing)
        add_pass(&module, "breathe", SPHPA_STAGE_DENSITY, SPHPA_F(h0), SPHPA_F(h))->particle =
            breathe;
    sphpa_mask shape = SPHPA_F(x) | SPHPA_F(m) | SPHPA_F(h);
    add_pair(&module, "density", SPHPA_STAGE_FORCES, shape, SPHPA_F(P), push_density);
    add_pair(&module, "push", SPHPA_STAGE_FORCES, shape | SPHPA_F(P), SPHPA_F(a), push_force);
    return scene_of(module);
}

static sphpa_sim *push_sim(size_t n, double skin, bool breathing) {
    sphpa_particles p = random_set(2, n, 0.7 / sqrt((double)n), 11), full;
    assert_int_equal(sphpa_particles_create(&full, 2, n, SPHPA_F(h0), 0, NULL, 0, NULL), SPHPA_OK);
    assert_int_equal(sphpa_particles_append(&full, &p, NULL), SPHPA_OK);
    for (size_t i = 0; i < n; i++) full.h0[i] = full.h[i];
    sphpa_scene scene = push_scene(breathing);
    sphpa_sim_options options = options_of(2e-3);
    options.skin = skin;
    for (int a = 0; a < 2; a++) {
        options.box.low[a] = -1.0;
        options.box.high[a] = 1.0;
        options.box.periodic[a] = 1;
    }
    sphpa_sim *sim = sim_of(&scene, &full, &options);
    sphpa_particles_free(&p);
    sphpa_particles_free(&full);
    return sim;
}

static void the_skin_changes_nothing(void **state) {
    (void)state;
    const double skins[3] = {0.02, 0.1, 0.9};
    const size_t n = 600;
    sphpa_sim *sim[3];
    for (int s = 0; s < 3; s++) {
        sim[s] = push_sim(n, skins[s], true);
        sim_steps(sim[s], 40);
    }
    assert_true(sim[0]->stats.rebuilds > 30);
    assert_true(sim[2]->stats.rebuilds < 20);
    double scale = 0.0;
    for (size_t k = 0; k < 3 * n; k++) scale = fmax(scale, fabs((double)sim[0]->p.a[k]));
    assert_true(scale > 0.1); /* the force matters */
    for (size_t i = 0; i < n; i++)
        for (int s = 1; s < 3; s++) {
            size_t j = index_of(sim[s], sim[0]->p.id[i]);
            for (size_t a = 0; a < 2; a++) {
                double one = sim[0]->p.x[3 * i + a], two = sim[s]->p.x[3 * j + a];
                assert_near_abs(remainder(one - two, 2.0), 0.0, 10.0 * ROUNDING);
                assert_near_abs((double)sim[0]->p.a[3 * i + a], (double)sim[s]->p.a[3 * j + a],
                                100.0 * ROUNDING * scale);
            }
        }
    for (int s = 0; s < 3; s++) sim_drop(sim[s]);
}

/* ---- records that serve two passes ----------------------------------------------------------- */

typedef struct kick_record {
    double x[3], v, kick;
} kick_record;

static int repacked; /* runs of repack */

static void kick_repack(const sphpa_sim *sim, const void *params, size_t first, size_t last,
                        void *records) {
    (void)params;
    SPHPA_OMP(atomic)
    repacked++;
    for (size_t i = first; i < last; i++)
        ((kick_record *)records)[i].kick = (double)sim->p.a[3 * i];
}

static void kick_pack(const sphpa_sim *sim, const void *params, size_t first, size_t last,
                      void *records) {
    kick_repack(sim, params, first, last, records);
    SPHPA_OMP(atomic)
    repacked--;
    for (size_t i = first; i < last; i++) {
        sphpa_sim_position_(sim, i, ((kick_record *)records)[i].x);
        ((kick_record *)records)[i].v = (double)sim->p.v[3 * i];
    }
}

static void kick_force(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    sim->p.a[3 * near->i] += (sphpa_real)(0.1 * (double)near->count);
}

/* c = sum over neighbours of v + a, as the records have them and as the fields do: the difference */
static void kick_check(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    const kick_record *records = (const kick_record *)(const void *)near->records;
    double wrong = 0.0;
    for (size_t k = 0; k < near->count; k++) {
        size_t j = near->j[k];
        wrong += fabs(records[j].v - (double)sim->p.v[3 * j]) +
                 fabs(records[j].kick - (double)sim->p.a[3 * j]);
    }
    sim->p.c[near->i] += (sphpa_real)wrong;
}

static sphpa_result change_v(sphpa_sim *sim, void *params, size_t first, size_t last, size_t *bad) {
    (void)params, (void)bad;
    for (size_t i = first; i < last; i++) sim->p.v[3 * i] *= (sphpa_real)1.5;
    return SPHPA_OK;
}

static void records_serve_while_they_are_true(void **state) {
    (void)state;
    for (int changed = 0; changed < 2; changed++) {
        sphpa_module module = module_named("kick", NULL);
        sphpa_mask reads = SPHPA_F(x) | SPHPA_F(h) | SPHPA_F(v);
        sphpa_pass *force = add_pair(&module, "force", SPHPA_STAGE_FORCES, reads, SPHPA_F(a),
                                     kick_force);
        if (changed)
            add_pass(&module, "change", SPHPA_STAGE_ENERGY, 0, SPHPA_F(v))->particle = change_v;
        sphpa_pass *check = add_pair(&module, "check", SPHPA_STAGE_ENERGY, reads | SPHPA_F(a),
                                     SPHPA_F(c), kick_check);
        force->pack = check->pack = kick_pack;
        check->repack = kick_repack;
        force->record_bytes = check->record_bytes = sizeof(kick_record);
        sphpa_scene scene = scene_of(module);
        sphpa_particles p = random_set(2, 600, 0.06, 4);
        sphpa_sim_options options = options_of(1e-3);
        sphpa_sim *sim = sim_of(&scene, &p, &options);
        repacked = 0;
        sim_steps(sim, 5);
        assert_true(changed ? repacked == 0 : repacked >= 5);
        for (size_t i = 0; i < sim->p.n; i++) assert_true(sim->p.c[i] == (sphpa_real)0);
        sim_drop(sim);
        sphpa_particles_free(&p);
    }
}

/* ---- passes that share a traversal ----------------------------------------------------------- */

static void fused_one(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    double sum = 0.0;
    for (size_t k = 0; k < near->count; k++) sum += (double)sim->p.m[near->j[k]] * near->r[k];
    for (int s = 0; s < 4; s++) near->scratch[s][0] = 1e9; /* for the pass to use */
    sim->p.omega[near->i] = (sphpa_real)sum;
}

typedef struct two_records {
    double m, x;
} two_records;

static void fused_pack(const sphpa_sim *sim, const void *params, size_t first, size_t last,
                       void *records) {
    (void)params;
    for (size_t i = first; i < last; i++) {
        ((two_records *)records)[i].m = (double)sim->p.m[i];
        ((two_records *)records)[i].x = sim->p.x[3 * i];
    }
}

static void fused_two(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    const two_records *records = (const two_records *)(const void *)near->records;
    double sum = 0.0;
    for (size_t k = 0; k < near->count; k++)
        sum += records[near->j[k]].m * records[near->j[k]].x * near->dx[k];
    sim->p.balsara[near->i] = (sphpa_real)sum;
}

/* both passes in one stage (1), in two (2), or only one of them (3, 4) */
static sphpa_sim *fused_sim(int which) {
    sphpa_module module = module_named("fused", NULL);
    sphpa_mask shape = SPHPA_F(x) | SPHPA_F(m) | SPHPA_F(h);
    if (which != 4)
        add_pair(&module, "one", SPHPA_STAGE_GRADIENTS, shape, SPHPA_F(omega), fused_one);
    if (which != 3) {
        sphpa_pass *two = add_pair(&module, "two",
                                   which == 2 ? SPHPA_STAGE_STRESS : SPHPA_STAGE_GRADIENTS, shape,
                                   SPHPA_F(balsara), fused_two);
        two->record_bytes = sizeof(two_records);
        two->pack = fused_pack;
    }
    sphpa_scene scene = scene_of(module);
    sphpa_particles p = random_set(3, 1200, 0.2, 17);
    sphpa_sim_options options = options_of(1e-3);
    sphpa_sim *sim = sim_of(&scene, &p, &options);
    sim_steps(sim, 5);
    sphpa_particles_free(&p);
    return sim;
}

static void shared_traversals_give_the_same_bits(void **state) {
    (void)state;
    sphpa_sim *together = fused_sim(1), *apart = fused_sim(2), *one = fused_sim(3),
              *two = fused_sim(4);
    size_t bytes = together->p.n * sizeof(sphpa_real);
    assert_memory_equal(together->p.omega, apart->p.omega, bytes);
    assert_memory_equal(together->p.balsara, apart->p.balsara, bytes);
    assert_memory_equal(together->p.omega, one->p.omega, bytes);
    assert_memory_equal(together->p.balsara, two->p.balsara, bytes);
    /* they did share it: all its time is told under the first one's name */
    assert_true(together->stats.timing[SPHPA_TIME_PASSES + 1].seconds == 0.0);
    assert_int_equal(together->stats.timing[SPHPA_TIME_PASSES + 1].calls, 6);
    assert_true(apart->stats.timing[SPHPA_TIME_PASSES + 1].seconds > 0.0);
    sim_drop(together);
    sim_drop(apart);
    sim_drop(one);
    sim_drop(two);
}

static sphpa_result set_P(sphpa_sim *sim, void *params, size_t first, size_t last, size_t *bad) {
    (void)params, (void)bad;
    for (size_t i = first; i < last; i++) sim->p.P[i] = (sphpa_real)(2.0 + sim->p.x[3 * i]);
    return SPHPA_OK;
}

static void read_P(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    double sum = 0.0;
    for (size_t k = 0; k < near->count; k++) sum += (double)sim->p.P[near->j[k]];
    sim->p.c[near->i] = (sphpa_real)sum;
}

static void write_P(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    sim->p.P[near->i] = (sphpa_real)-5;
}

static void read_c(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    double sum = 0.0;
    for (size_t k = 0; k < near->count; k++) sum += (double)sim->p.c[near->j[k]];
    sim->p.div_v[near->i] = (sphpa_real)sum;
}

/* a field that a pass reads only where it is there, `uses`, is a hazard like any other */
static void hazards_keep_passes_apart_where(int uses) {
    sphpa_module module = module_named("hazard", NULL);
    sphpa_mask shape = SPHPA_F(x) | SPHPA_F(h);
    add_pass(&module, "set", SPHPA_STAGE_PRESSURE, SPHPA_F(x), SPHPA_F(P))->particle = set_P;
    sphpa_pass *read_pass =
        add_pair(&module, "read P", SPHPA_STAGE_STRESS, shape | SPHPA_F(P), SPHPA_F(c), read_P);
    add_pair(&module, "write P", SPHPA_STAGE_STRESS, shape, SPHPA_F(P), write_P);
    sphpa_pass *last_pass = add_pair(&module, "read c", SPHPA_STAGE_STRESS, shape | SPHPA_F(c),
                                     SPHPA_F(div_v), read_c);
    if (uses) {
        read_pass->reads = last_pass->reads = shape;
        read_pass->uses = SPHPA_F(P);
        last_pass->uses = SPHPA_F(c);
    }
    sphpa_scene scene = scene_of(module);
    sphpa_particles p = random_set(2, 800, 0.06, 23);
    memset(p.v, 0, 3 * p.n * sizeof(sphpa_real));
    sphpa_sim_options options = options_of(1e-3);
    sphpa_sim *sim = sim_of(&scene, &p, &options);
    sim_steps(sim, 1);
    const sphpa_particles *q = &sim->p;
    double *c = (double *)calloc(q->n, sizeof(double)), *sum = (double *)calloc(q->n, sizeof *sum);
    for (int round = 0; round < 2; round++)
        for (size_t i = 0; i < q->n; i++)
            for (size_t j = 0; j < q->n; j++) {
                double dx = q->x[3 * i] - q->x[3 * j], dy = q->x[3 * i + 1] - q->x[3 * j + 1];
                double support = 2.0 * fmax((double)q->h[i], (double)q->h[j]);
                if (i == j || !(dx * dx + dy * dy < support * support)) continue;
                if (round == 0) c[i] += 2.0 + q->x[3 * j];
                else sum[i] += c[j];
            }
    for (size_t i = 0; i < q->n; i++) {
        assert_near((double)q->c[i], c[i], 10.0 * ROUNDING);
        assert_near((double)q->div_v[i], sum[i], 10.0 * ROUNDING);
        assert_true(q->P[i] == (sphpa_real)-5);
    }
    free(c);
    free(sum);
    sim_drop(sim);
    sphpa_particles_free(&p);
}

static void hazards_keep_passes_apart(void **state) {
    (void)state;
    hazards_keep_passes_apart_where(0);
    hazards_keep_passes_apart_where(1);
}

/* a PAIR pass in COMMIT sees the positions of the end, with all their neighbours */
static void commit_pair(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    sim->p.c[near->i] = (sphpa_real)near->count;
}

static void pairs_at_commit(double dt, int steps) {
    sphpa_module module = module_named("late", NULL);
    add_pair(&module, "late", SPHPA_STAGE_COMMIT, SPHPA_F(x) | SPHPA_F(h), SPHPA_F(c), commit_pair);
    sphpa_scene scene = scene_of(module);
    sphpa_particles p = random_set(2, 500, 0.08, 29);
    sphpa_sim_options options = options_of(dt);
    sphpa_sim *sim = sim_of(&scene, &p, &options);
    const sphpa_particles *q = &sim->p;
    for (int step = 0; step < steps; step++) {
        sim_steps(sim, 1);
        for (size_t i = 0; i < q->n; i++) {
            int count = 0;
            for (size_t j = 0; j < q->n; j++) {
                double dx = q->x[3 * i] - q->x[3 * j], dy = q->x[3 * i + 1] - q->x[3 * j + 1];
                double support = 2.0 * fmax((double)q->h[i], (double)q->h[j]);
                count += i != j && dx * dx + dy * dy < support * support;
            }
            assert_int_equal((int)q->c[i], count);
        }
    }
    assert_true(dt > 0.01 || (int)sim->stats.rebuilds < steps);
    sim_drop(sim);
    sphpa_particles_free(&p);
}

static void pairs_at_commit_have_their_neighbours(void **state) {
    (void)state;
    pairs_at_commit(0.05, 3);    /* steps of many skins */
    pairs_at_commit(0.0004, 60); /* several steps a skin: nobody is missed while it is used up */
}

/* both use up the skin: 1.6 apart, listed to 1.5, and each moves 0.4 before they are 0.8 apart */
static void two_that_meet_find_each_other(void **state) {
    (void)state;
    sphpa_module module = module_named("late", NULL);
    add_pair(&module, "late", SPHPA_STAGE_COMMIT, SPHPA_F(x) | SPHPA_F(h), SPHPA_F(c), commit_pair);
    sphpa_scene scene = scene_of(module);
    sphpa_particles p = random_set(1, 2, 0.5, 1);
    for (size_t i = 0; i < 2; i++) {
        p.x[3 * i] = i ? 0.8 : -0.8;
        p.v[3 * i] = (sphpa_real)(i ? -1 : 1);
        p.h[i] = (sphpa_real)0.5;
    }
    sphpa_sim_options options = options_of(0.04);
    options.skin = 0.5;
    sphpa_sim *sim = sim_of(&scene, &p, &options);
    for (int step = 0; step < 40; step++) {
        sim_steps(sim, 1);
        double apart = fabs(sim->p.x[0] - sim->p.x[3]);
        for (size_t i = 0; i < 2; i++) assert_int_equal((int)sim->p.c[i], apart < 1.0);
    }
    sim_drop(sim);
    sphpa_particles_free(&p);
}

static void count_omega(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    sim->p.omega[near->i] += (sphpa_real)1;
}

static void only_marked_passes_run_at_commit(void **state) {
    (void)state;
    sphpa_particles p = random_set(2, 50, 0.3, 29);
    for (int marked = 0; marked < 2; marked++) { /* which of the two neighbours in the stage */
        sphpa_module module = module_named("twice", NULL);
        add_pair(&module, "one", SPHPA_STAGE_STRESS, 0, SPHPA_F(omega), count_omega);
        add_pair(&module, "two", SPHPA_STAGE_STRESS, 0, SPHPA_F(balsara), count_balsara);
        module.pass[marked].at_commit = 1;
        sphpa_scene scene = scene_of(module);
        sphpa_sim_options options = options_of(1e-3);
        sphpa_sim *sim = sim_of(&scene, &p, &options);
        sim_steps(sim, 1); /* evaluations: at the start, half way, and the commit */
        for (size_t i = 0; i < sim->p.n; i++) {
            assert_int_equal((int)sim->p.omega[i], marked == 0 ? 3 : 2);
            assert_int_equal((int)sim->p.balsara[i], marked == 1 ? 3 : 2);
        }
        sim_drop(sim);
    }
    sphpa_particles_free(&p);
}

/* a module that cannot be added: the scene keeps the reason of the first, and create tells it, also
   where nothing else is in the scene */
static void refused_modules_are_told(void **state) {
    (void)state;
    static const char *const told[4] = {"one of that name", "(99 passes", "(0 passes, -1 col",
                                        "no name"};
    for (int kind = 0; kind < 4; kind++)
        for (int alone = 0; alone < (kind == 0 ? 1 : 2); alone++) {
            sphpa_module module = module_named("mine", NULL);
            sphpa_scene scene = scene_of(module);
            if (alone) memset(&scene, 0, sizeof scene);
            if (kind == 1) module.passes = 99, module.name = "other";
            if (kind == 2) module.columns = -1, module.name = "other";
            if (kind == 3) module.name = NULL;
            assert_int_equal(sphpa_scene_add(&scene, module), SPHPA_ERROR_RANGE);
            module.name = NULL; /* a second refusal does not cover the first */
            assert_int_equal(sphpa_scene_add(&scene, module), SPHPA_ERROR_RANGE);
            assert_int_equal(scene.modules, alone ? 0 : 1);
            create_fails(&scene, SPHPA_ERROR_RANGE, told[kind]);
        }
}

/* ---- the length of a step -------------------------------------------------------------------- */

typedef struct limiter {
    double usual, special;
    int64_t who;
} limiter;

static double limit_of(const sphpa_sim *sim, const void *params, size_t i) {
    const limiter *l = (const limiter *)params;
    return sim->p.id[i] == l->who ? l->special : l->usual;
}

static sphpa_scene limit_scene(limiter *l) {
    sphpa_module module = module_named("limiter", l);
    sphpa_pass *pass = add_pass(&module, "mine", SPHPA_STAGE_LIMIT, 0, 0);
    pass->kind = SPHPA_PASS_REDUCE;
    pass->limit = limit_of;
    return scene_of(module);
}

/* a step is at most dt_growth times the one before, by default 1.25 times */
static void steps_grow_by_a_quarter(void **state) {
    (void)state;
    static const double given[3] = {0.0, 1.25, 2.0}, factor[3] = {1.25, 1.25, 2.0};
    for (int k = 0; k < 3; k++) {
        limiter l = {1e3, 0.125, 3};
        sphpa_scene scene = limit_scene(&l);
        sphpa_particles p = random_set(1, 50, 1e-3, 1);
        memset(p.v, 0, 3 * p.n * sizeof(sphpa_real));
        sphpa_sim_options options = options_of(0.0);
        options.dt_growth = given[k];
        sphpa_sim *sim = sim_of(&scene, &p, &options);
        sim_steps(sim, 1);
        l.special = 1e3; /* set free from the step after the next on */
        sim_steps(sim, 1);
        for (int n = 1; n < 6; n++) {
            sim_steps(sim, 1);
            assert_near(sim->dt, 0.125 * pow(factor[k], n), 1e-14);
        }
        sim_drop(sim);
        sphpa_particles_free(&p);
    }
}

static void limits_are_told_by_name(void **state) {
    (void)state;
    limiter l = {1.0, 0.25, 700};
    sphpa_scene scene = limit_scene(&l);
    sphpa_particles p = random_set(1, 1000, 1e-3, 1);
    memset(p.v, 0, 3 * p.n * sizeof(sphpa_real));
    sphpa_sim_options options = options_of(0.0);
    options.dt_growth = 1.5;
    sphpa_sim *sim = sim_of(&scene, &p, &options);
    const sphpa_stats *stats = &sim->stats;
    sim_steps(sim, 1);
    assert_true(sim->dt == 0.25);
    assert_string_equal(stats->limit[stats->limit_last].name, "mine");
    assert_int_equal(stats->limit_id, 700);
    assert_int_equal(stats->limit[stats->limit_last].steps, 1);
    l.special = 10.0; /* set free: first by growth, then by the others' */
    sim_steps(sim, 1);
    assert_true(sim->dt == 0.25); /* known at the end of the step before */
    sim_steps(sim, 2);
    assert_true(sim->dt == 0.25 * 1.5 * 1.5);
    assert_string_equal(stats->limit[stats->limit_last].name, "growth");
    /* an output time cuts a step; the next is not held back by that */
    assert_int_equal(sphpa_sim_step(sim, 1e-3, NULL), SPHPA_OK);
    assert_true(sim->dt == 1e-3);
    assert_true(sim->dt_next > 0.8);
    sim_steps(sim, 2);
    assert_true(sim->dt == 1.0);
    sim->options.dt_max = 0.5;
    sim_steps(sim, 2);
    assert_true(sim->dt == 0.5);
    assert_string_equal(stats->limit[stats->limit_last].name, "dt_max");
    uint64_t total = 0;
    for (int k = 0; k < stats->limits; k++) total += stats->limit[k].steps;
    assert_int_equal(total, stats->steps);
    assert_int_equal(stats->limit[0].steps, 1); /* "output time" */
    assert_string_equal(stats->limit[0].name, "output time");
    assert_int_equal(sphpa_sim_step(sim, 0.0, NULL), SPHPA_ERROR_RANGE);
    assert_int_equal(sphpa_sim_step(sim, (double)NAN, NULL), SPHPA_ERROR_RANGE);
    sim_drop(sim);
    sphpa_particles_free(&p);
}

static void the_force_limits_the_step(void **state) {
    (void)state;
    spring s = {100.0, 0.0, 0.0};
    sphpa_scene scene = spring_scene(&s);
    sphpa_particles p = one_particle();
    sphpa_sim *sim = sim_of(&scene, &p, NULL);
    sim_steps(sim, 1);
    double h = (double)p.h[0]; /* at the start a = -100 */
    assert_near(sim->dt_first, 0.2 * sqrt(h / 100.0), ROUNDING);
    assert_string_equal(sim->stats.limit[3].name, "force");
    assert_int_equal(sim->stats.limit[3].steps, 1);
    sim_drop(sim);
    sphpa_particles_free(&p);
}

static void bad_limits_and_the_floor_stop_the_run(void **state) {
    (void)state;
    const double values[3] = {(double)NAN, 0.0, 1e-9};
    for (int k = 0; k < 3; k++) {
        limiter l = {1.0, 1.0, 300};
        sphpa_scene scene = limit_scene(&l);
        sphpa_particles p = random_set(1, 1000, 1e-3, 1);
        sphpa_sim *sim = sim_of(&scene, &p, NULL);
        sphpa_error err;
        sim_steps(sim, 2);
        l.special = values[k]; /* of one particle in the middle of many */
        sphpa_result result = sphpa_sim_step(sim, HUGE_VAL, &err);
        if (result == SPHPA_OK) result = sphpa_sim_step(sim, HUGE_VAL, &err);
        assert_int_equal(result, SPHPA_ERROR_STATE);
        assert_int_equal(err.result, SPHPA_ERROR_STATE);
        assert_non_null(strstr(err.message, "(id 300)"));
        assert_non_null(strstr(err.message, "rho = "));
        assert_non_null(strstr(err.message, k < 2 ? "mine" : "floor"));
        sim_drop(sim);
        sphpa_particles_free(&p);
    }
}

/* ---- runs ------------------------------------------------------------------------------------ */

typedef struct diary {
    double time[64];
    int outputs, steps, stop_after;
    volatile int stop;
} diary;

static sphpa_result diary_output(sphpa_sim *sim, void *user, sphpa_error *err) {
    diary *d = (diary *)user;
    (void)err;
    d->time[d->outputs++] = sim->time;
    return SPHPA_OK;
}

static sphpa_result diary_step(sphpa_sim *sim, void *user, sphpa_error *err) {
    diary *d = (diary *)user;
    (void)sim;
    if (++d->steps == d->stop_after) d->stop = 1;
    return d->steps == 1000 ? sphpa_error_set(err, SPHPA_ERROR_FILE, "mine") : SPHPA_OK;
}

static sphpa_run run_of(diary *d, double t_end, double every) {
    sphpa_run run;
    memset(&run, 0, sizeof run);
    run.t_end = t_end;
    run.every = every;
    run.user = d;
    run.output = diary_output;
    run.step = diary_step;
    run.stop = &d->stop;
    return run;
}

static void outputs_come_at_their_times(void **state) {
    (void)state;
    const double dts[4] = {0.0173, 0.1, 0.0999999999, 0.31}; /* the second: one step each */
    const int most[4] = {45, 8, 16, 8};
    for (int k = 0; k < 4; k++) {
        limiter l = {dts[k], dts[k], 0};
        sphpa_scene scene = limit_scene(&l);
        sphpa_particles p = random_set(1, 3, 1e-3, 1);
        sphpa_sim *sim = sim_of(&scene, &p, NULL);
        diary d;
        memset(&d, 0, sizeof d);
        sphpa_run run = run_of(&d, 0.73, 0.1);
        assert_int_equal(sphpa_sim_run(sim, &run, NULL), SPHPA_OK);
        assert_int_equal(d.outputs, 9);
        for (int n = 0; n < 8; n++) assert_true(d.time[n] == 0.1 * n);
        assert_true(d.time[8] == 0.73 && sim->time == 0.73);
        assert_int_equal(d.steps, sim->stats.steps);
        /* the way there is evenly cut: no step is a sliver */
        assert_true((int)sim->stats.steps <= most[k]);
        run.resumed = 1; /* and no output at the start */
        run.t_end = 1.0;
        assert_int_equal(sphpa_sim_run(sim, &run, NULL), SPHPA_OK);
        assert_int_equal(d.outputs, 12); /* 0.8 0.9 1.0 */
        assert_true(d.time[9] == 0.1 * 8 && d.time[11] == 1.0);
        assert_int_equal(sphpa_sim_run(sim, &run, NULL), SPHPA_OK); /* is there already */
        assert_int_equal(d.outputs, 12);
        run.t_end = (double)NAN;
        assert_int_equal(sphpa_sim_run(sim, &run, NULL), SPHPA_ERROR_RANGE);
        sim_drop(sim);
        sphpa_particles_free(&p);
    }
}

static void a_run_stops_when_told(void **state) {
    (void)state;
    limiter l = {0.1, 0.1, 0};
    sphpa_scene scene = limit_scene(&l);
    sphpa_particles p = random_set(1, 3, 1e-3, 1);
    sphpa_sim *sim = sim_of(&scene, &p, NULL);
    sphpa_error err;
    diary d;
    memset(&d, 0, sizeof d);
    d.stop_after = 4; /* at t = 0.4, an output time: which must not get lost */
    sphpa_run run = run_of(&d, 1.0, 0.2);
    assert_int_equal(sphpa_sim_run(sim, &run, &err), SPHPA_STOPPED);
    assert_int_equal(err.result, SPHPA_STOPPED);
    assert_int_equal(sim->stats.steps, 4);
    assert_int_equal(d.outputs, 3);
    d.stop = 0;
    run.resumed = 1;
    assert_int_equal(sphpa_sim_run(sim, &run, &err), SPHPA_OK);
    assert_int_equal(d.outputs, 6);
    for (int n = 0; n < 5; n++) assert_true(d.time[n] == 0.2 * n);
    d.steps = 998; /* a callback's error ends it too */
    run.t_end = 9.0;
    assert_int_equal(sphpa_sim_run(sim, &run, &err), SPHPA_ERROR_FILE);
    assert_string_equal(err.message, "mine");
    sim_drop(sim);
    sphpa_particles_free(&p);
}

/* a solver that is never quite done: each call moves what it advances by a little */
static sphpa_result creep(sphpa_sim *sim, void *params, size_t first, size_t last, size_t *bad) {
    (void)params, (void)bad;
    for (size_t i = first; i < last; i++) {
        sim->p.alpha[i] = sim->p.start.alpha[i] * (1.0 + 1e-12);
        sim->p.P[i] = (sphpa_real)sim->p.x[3 * i];
    }
    return SPHPA_OK;
}

static void refresh_leaves_the_state_alone(void **state) {
    (void)state;
    sphpa_module module = module_named("creep", NULL);
    sphpa_pass *pass = add_pass(&module, "creep", SPHPA_STAGE_PRESSURE, SPHPA_F(x), SPHPA_F(P));
    pass->particle = creep;
    pass->advances = SPHPA_F(alpha);
    pass->at_commit = 1;
    module.columns = 1;
    strcpy(module.column[0].name, "clock");
    module.column[0].components = 2;
    sphpa_pass *clock = add_pass(&module, "clock", SPHPA_STAGE_STRESS, 0, 0);
    clock->particle = advance_column;
    sphpa_scene scene = scene_of(module);
    sphpa_particles p = random_set(2, 600, 0.1, 31);
    sphpa_sim_options options = options_of(0.01);
    sphpa_sim *sim = sim_of(&scene, &p, &options);
    sim_steps(sim, 3);
    sphpa_particles before;
    sphpa_mask fields = sim->p.fields;
    assert_int_equal(sphpa_particles_create(&before, 2, 0, fields, 0, sim->p.column, 1, NULL),
                     SPHPA_OK);
    assert_int_equal(sphpa_particles_append(&before, &sim->p, NULL), SPHPA_OK);
    for (int round = 0; round < 3; round++)
        assert_int_equal(sphpa_sim_refresh(sim, NULL), SPHPA_OK);
    assert_true(sim->dt == 0.01);
    for (size_t k = 0; k < before.n; k++) {
        size_t i = index_of(sim, before.id[k]);
        for (size_t a = 0; a < 3; a++) {
            assert_true(sim->p.x[3 * i + a] == before.x[3 * k + a]);
            assert_true(sim->p.v[3 * i + a] == before.v[3 * k + a]);
        }
        assert_true(sim->p.u[i] == before.u[k]);
        assert_true(sim->p.alpha[i] == before.alpha[k] && sim->p.alpha[i] > 1.0);
        assert_true(sim->p.column[0].data[2 * i] == before.column[0].data[2 * k]);
        assert_near((double)sim->p.P[i], sim->p.x[3 * i], ROUNDING); /* what it is for */
    }
    sphpa_particles_free(&before);
    sim_drop(sim);
    sphpa_particles_free(&p);
}

/* P = (P + x)/2 with the P before: a derived field that the next evaluation starts from */
static sphpa_result remember(sphpa_sim *sim, void *params, size_t first, size_t last, size_t *bad) {
    (void)params;
    (void)bad;
    for (size_t i = first; i < last; i++)
        sim->p.P[i] = (sphpa_real)(0.5 * ((double)sim->p.P[i] + sim->p.x[3 * i]));
    return SPHPA_OK;
}

static sphpa_scene memory_scene(void) {
    sphpa_module module = module_named("memory", NULL);
    add_pass(&module, "memory", SPHPA_STAGE_PRESSURE, SPHPA_F(x), SPHPA_F(P))->particle = remember;
    return scene_of(module);
}

/* the same bits however often a run puts out */
static void outputs_leave_no_trace(void **state) {
    (void)state;
    sphpa_scene scene = memory_scene();
    sphpa_particles p = random_set(2, 600, 0.1, 31);
    sphpa_sim_options options = options_of(0.002);
    sphpa_sim *plain = sim_of(&scene, &p, &options), *watched = sim_of(&scene, &p, &options);
    int shown = 0, sorted = 0; /* settled into another order, with what is shown in place */
    int64_t order[600];
    for (int k = 0; k < 12; k++) {
        assert_int_equal(sphpa_sim_refresh(watched, NULL), SPHPA_OK);
        if (k == 2) assert_int_equal(sphpa_sim_refresh(watched, NULL), SPHPA_OK);
        memcpy(order, watched->p.id, sizeof order);
        if (k % 2) assert_int_equal(sphpa_sim_settle(watched, NULL), SPHPA_OK);
        sorted += memcmp(order, watched->p.id, sizeof order) != 0;
        for (size_t i = 0; i < p.n && k == 4; i++)
            shown += watched->p.P[i] != plain->p.P[index_of(plain, watched->p.id[i])];
        sim_steps(plain, 1);
        sim_steps(watched, 1);
    }
    assert_true(shown > 0 && sorted);
    for (size_t i = 0; i < p.n; i++)
        assert_true(watched->p.P[i] == plain->p.P[index_of(plain, watched->p.id[i])]);
    sim_drop(plain);
    sim_drop(watched);
    sphpa_particles_free(&p);
}

/* particles that someone moves between a refresh and the next step keep their own values: P follows
   x here, and the neighbour's would be far off */
static void moved_after_a_refresh(void **state) {
    (void)state;
    sphpa_scene scene = memory_scene();
    sphpa_particles p = random_set(2, 600, 0.1, 31);
    memset(p.v, 0, 3 * p.n * sizeof(sphpa_real));
    sphpa_sim_options options = options_of(1e-6);
    sphpa_sim *sim = sim_of(&scene, &p, &options);
    sim_steps(sim, 40); /* P is x */
    assert_int_equal(sphpa_sim_refresh(sim, NULL), SPHPA_OK);
    uint32_t order[600];
    for (uint32_t i = 0; i < 600; i++) order[i] = 599 - i;
    assert_int_equal(sphpa_particles_permute(&sim->p, order, NULL), SPHPA_OK);
    assert_int_equal(sphpa_sim_settle(sim, NULL), SPHPA_OK);
    for (size_t i = 0; i < sim->p.n; i++)
        assert_near_abs((double)sim->p.P[i], sim->p.x[3 * i], 1e-6);
    sim_drop(sim);
    sphpa_particles_free(&p);
}

/* u of one particle falls; the statistics name it by its id, wherever sorting puts it */
static sphpa_result cool(sphpa_sim *sim, void *params, size_t first, size_t last, size_t *bad) {
    (void)bad;
    for (size_t i = first; i < last; i++)
        sim->p.du[i] = (sphpa_real)(sim->p.id[i] == *(const int64_t *)params ? -1.0 : 1.0);
    return SPHPA_OK;
}

static void the_least_u_is_named(void **state) {
    (void)state;
    int64_t who = 417;
    sphpa_module module = module_named("cooler", &who);
    add_pass(&module, "cool", SPHPA_STAGE_ENERGY, 0, SPHPA_F(du))->particle = cool;
    sphpa_scene scene = scene_of(module);
    sphpa_particles p = random_set(2, 600, 0.1, 31);
    for (size_t i = 0; i < p.n; i++) p.u[i] = 0.25;
    sphpa_sim_options options = options_of(0.125);
    sphpa_sim *sim = sim_of(&scene, &p, &options);
    for (int k = 1; k < 5; k++) {
        sim_steps(sim, 1);
        assert_int_equal(sphpa_sim_settle(sim, NULL), SPHPA_OK); /* sorted */
        size_t i = index_of(sim, who);
        assert_int_equal(sim->stats.u_id, who);
        assert_true(sim->stats.u_least == 0.25 - 0.125 * k);
        assert_true(sim->stats.u_least == sim->p.u[i]);
        assert_int_equal(sim->stats.u_below, k > 2 ? 1 : 0);
        assert_near_abs(sim->stats.u_deficit,
                        fmax(0.0, -sim->stats.u_least) * (double)sim->p.m[i], 1e-15);
    }
    sim_drop(sim);
    sphpa_particles_free(&p);
}

/* ---- states that go bad ---------------------------------------------------------------------- */

typedef struct saboteur {
    int64_t who;
    int what; /* 0 a = NaN, 1 h < 0, 2 an error of the pass, 3 du = inf, 4 rho = 0 */
} saboteur;

static sphpa_result sabotage(sphpa_sim *sim, void *params, size_t first, size_t last, size_t *bad) {
    const saboteur *s = (const saboteur *)params;
    for (size_t i = first; i < last; i++) {
        if (sim->stats.steps < 3 || sim->p.id[i] != s->who) continue;
        if (s->what == 0) sim->p.a[3 * i] = (sphpa_real)NAN;
        if (s->what == 1) sim->p.h[i] = (sphpa_real)-0.125;
        if (s->what == 3) sim->p.du[i] = (sphpa_real)HUGE_VAL;
        if (s->what == 4) sim->p.rho[i] = 0.0;
        *bad = i;
        if (s->what == 2) return SPHPA_ERROR_CURVE;
    }
    return SPHPA_OK;
}

static void a_bad_state_stops_the_run(void **state) {
    (void)state;
    const char *words[5] = {"NaN", "h = -0.125", "crush curve", "u = inf", "rho = 0"};
    for (int what = 0; what < 5; what++) {
        saboteur s = {321, what};
        sphpa_module module = module_named("saboteur", &s);
        add_pass(&module, "sabotage", what == 3 ? SPHPA_STAGE_ENERGY : SPHPA_STAGE_FORCES, 0, 0)
            ->particle = sabotage;
        sphpa_scene scene = scene_of(module);
        sphpa_particles p = random_set(3, 600, 0.1, 31);
        sphpa_sim_options options = options_of(0.01);
        sphpa_sim *sim = sim_of(&scene, &p, &options);
        sphpa_error err;
        diary d;
        memset(&d, 0, sizeof d);
        sphpa_run run = run_of(&d, 1.0, 0.0);
        assert_int_equal(sphpa_sim_run(sim, &run, &err), SPHPA_ERROR_STATE);
        assert_int_equal(err.result, SPHPA_ERROR_STATE);
        assert_int_equal(sim->stats.steps, 3);
        size_t who = index_of(sim, 321);
        char name[60];
        snprintf(name, sizeof name, "particle %lu (id 321)", (unsigned long)who);
        assert_non_null(strstr(err.message, name));
        assert_non_null(strstr(err.message, "step 3"));
        assert_non_null(strstr(err.message, words[what]));
        sim_drop(sim);
        sphpa_particles_free(&p);
    }
}

static void bad_options_are_refused(void **state) {
    (void)state;
    static const char *const name[8] = {"cfl",       "force_cfl", "dt_max", "dt_min",
                                        "dt_growth", "dt_fixed",  "skin",   "flight"};
    limiter l = {0.1, 0.1, 0};
    sphpa_scene scene = limit_scene(&l);
    static sphpa_sim sim;
    sphpa_error err;
    sphpa_particles p = random_set(2, 20, 0.1, 1);
    for (int k = 0; k < 8; k++)
        for (int bad = 0; bad < 3; bad++) {
            sphpa_sim_options options = options_of(0.0);
            double *const all[8] = {&options.cfl,       &options.force_cfl, &options.dt_max,
                                    &options.dt_min,    &options.dt_growth, &options.dt_fixed,
                                    &options.skin,      &options.flight};
            *all[k] = bad == 0 ? -0.25 : bad == 1 ? (double)NAN : (double)INFINITY;
            assert_int_equal(sphpa_sim_create(&sim, &scene, &p, &options, &err),
                             bad == 0 ? SPHPA_ERROR_RANGE : SPHPA_ERROR_NOT_FINITE);
            assert_non_null(strstr(err.message, name[k]));
            if (bad == 0) assert_non_null(strstr(err.message, "-0.25"));
        }
    sphpa_particles_free(&p);
}

static void bad_starts_are_refused(void **state) {
    (void)state;
    limiter l = {0.1, 0.1, 0};
    sphpa_scene scene = limit_scene(&l), none;
    static sphpa_sim sim;
    sphpa_error err;
    sphpa_particles p = random_set(2, 20, 0.1, 1), empty;
    sphpa_sim_options options = options_of(0.0);
    for (int a = 0; a < 2; a++) options.box.low[a] = -1.5, options.box.high[a] = 1.5;
    options.box.periodic[0] = options.box.periodic[1] = 1;
    memset(&empty, 0, sizeof empty);
    memset(&none, 0, sizeof none);
    assert_int_equal(sphpa_sim_create(&sim, &scene, &empty, &options, &err), SPHPA_ERROR_EMPTY);
    assert_non_null(strstr(err.message, "0 particles"));
    assert_int_equal(sphpa_sim_create(&sim, &scene, NULL, &options, &err), SPHPA_ERROR_EMPTY);
    assert_int_equal(sphpa_sim_create(&sim, &none, &p, &options, &err), SPHPA_ERROR_MISSING);
    assert_int_equal(sphpa_sim_create(&sim, NULL, &p, &options, &err), SPHPA_ERROR_MISSING);

    double kept = p.x[3 * 4];
    p.x[3 * 4] = (double)NAN;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, &options, &err), SPHPA_ERROR_NOT_FINITE);
    assert_non_null(strstr(err.message, "particle 4"));
    p.x[3 * 4] = 1.75;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, &options, &err), SPHPA_ERROR_OUTSIDE);
    assert_non_null(strstr(err.message, "1.75"));
    p.x[3 * 4] = kept;
    p.rho[6] = -2.0;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, &options, &err), SPHPA_ERROR_NEGATIVE);
    p.rho[6] = 1.0;
    p.u[7] = -1e-30;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, &options, &err), SPHPA_ERROR_NEGATIVE);
    assert_non_null(strstr(err.message, "particle 7"));
    p.u[7] = 1.0;
    p.x[3 * 4] = p.x[3 * 9], p.x[3 * 4 + 1] = p.x[3 * 9 + 1];
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, &options, &err), SPHPA_ERROR_COINCIDENT);
    assert_non_null(strstr(err.message, "particles 4 and 9"));
    p.x[3 * 4] = kept;
    p.h[3] = (sphpa_real)0.9; /* reaches over more than half the box */
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, &options, &err), SPHPA_ERROR_RANGE);
    assert_non_null(strstr(err.message, "support[3]"));
    p.h[3] = (sphpa_real)0.72; /* half the box has room for it, but not for a whole skin */
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, &options, &err), SPHPA_OK);
    assert_int_equal(sphpa_sim_step(&sim, HUGE_VAL, &err), SPHPA_OK);
    assert_true(sim.lists.skin > 0.0 && sim.lists.skin < 0.05);
    sphpa_sim_free(&sim);
    p.h[3] = (sphpa_real)0.1;
    options.cfl = (double)NAN;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, &options, &err), SPHPA_ERROR_NOT_FINITE);
    assert_non_null(strstr(err.message, "cfl"));
    options.cfl = 0.0;
    options.kernel = SPHPA_KERNEL_COUNT;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, &options, &err), SPHPA_ERROR_UNKNOWN);
    options.kernel = SPHPA_KERNEL_CUBIC;
    options.integrator = (sphpa_integrator)7;
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, &options, &err), SPHPA_ERROR_UNKNOWN);
    options.integrator = SPHPA_RK2;
    assert_null(sim.p.block); /* each left a zeroed struct */
    assert_int_equal(sphpa_sim_create(&sim, &scene, &p, &options, &err), SPHPA_OK);
    sphpa_sim_free(&sim);
    sphpa_sim_free(&sim);
    sphpa_sim_free(NULL);
    sphpa_particles_free(&p);
}

typedef struct modules_life {
    int set_up, torn_down, fails;
} modules_life;

static sphpa_result life_setup(sphpa_sim *sim, void *params, sphpa_error *err) {
    modules_life *life = (modules_life *)params;
    (void)sim;
    life->set_up++;
    return life->fails ? sphpa_error_set(err, SPHPA_ERROR_MISSING, "by intention") : SPHPA_OK;
}

static void life_teardown(sphpa_sim *sim, void *params) {
    (void)sim;
    ((modules_life *)params)->torn_down++;
}

static void life_ghosts(sphpa_sim *sim, void *params, sphpa_mask fields) {
    (void)sim, (void)params, (void)fields;
}

static void modules_are_set_up_and_torn_down_once(void **state) {
    (void)state;
    modules_life life[3];
    static const char *const names[3] = {"a", "b", "c"};
    sphpa_particles p = random_set(2, 20, 0.1, 1);
    for (int fails = 0; fails < 4; fails++) { /* 0: none; 1, 3: the second; 2: before all of them */
        memset(life, 0, sizeof life);
        life[1].fails = fails == 1 || fails == 3;
        sphpa_scene scene;
        memset(&scene, 0, sizeof scene);
        for (int k = 0; k < 3; k++) {
            sphpa_module module = module_named(names[k], &life[k]);
            module.setup = life_setup;
            module.ghosts = fails == 1 && k == 2 ? life_ghosts : NULL; /* then the last is first */
            module.teardown = life_teardown;
            assert_int_equal(sphpa_scene_add(&scene, module), SPHPA_OK);
        }
        p.rho[3] = fails == 2 ? (double)NAN : 1.0;
        static sphpa_sim sim;
        sphpa_result result = sphpa_sim_create(&sim, &scene, &p, NULL, NULL);
        assert_int_equal(result, fails == 0   ? SPHPA_OK
                                 : fails != 2 ? SPHPA_ERROR_MISSING
                                              : SPHPA_ERROR_NOT_FINITE);
        sphpa_sim_free(&sim);
        for (int k = 0; k < 3; k++) {
            int want = fails < 2 || (fails == 3 && k < 2);
            assert_int_equal(life[k].set_up, want);
            assert_int_equal(life[k].torn_down, want); /* never without its setup */
        }
    }
    sphpa_particles_free(&p);
}

/* ---- particles that come and go -------------------------------------------------------------- */

static sphpa_result resize(sphpa_sim *sim, void *params, size_t first, size_t last, size_t *bad) {
    int *calls = (int *)params;
    (void)first, (void)last, (void)bad;
    (*calls)++;
    if (*calls == 2) { /* from one block of particles to many */
        size_t at = 0, more = 3000;
        sphpa_result result = sphpa_particles_add(&sim->p, more, &at, NULL);
        if (result != SPHPA_OK) return result;
        for (size_t k = at; k < sim->p.n; k++) {
            sim->p.x[3 * k] = 10.0 + 1e-3 * (double)(k - at);
            sim->p.m[k] = sim->p.h[k] = (sphpa_real)2e-3;
            sim->p.rho[k] = 1.0;
        }
    }
    if (*calls == 4) sim->p.n -= 2900; /* whichever are last */
    return SPHPA_OK;
}

static void particles_come_and_go(void **state) {
    (void)state;
    int calls = 0;
    limiter l = {0.01, 0.01, 0};
    sphpa_module module = module_named("resize", &calls);
    add_pass(&module, "resize", SPHPA_STAGE_RESIZE, 0, 0)->particle = resize;
    add_pair(&module, "late", SPHPA_STAGE_FORCES, SPHPA_F(x) | SPHPA_F(h), SPHPA_F(c), commit_pair);
    sphpa_scene scene = scene_of(module), limits = limit_scene(&l);
    assert_int_equal(sphpa_scene_add(&scene, limits.module[0]), SPHPA_OK);
    sphpa_particles p = random_set(1, 100, 0.05, 1);
    sphpa_sim *sim = sim_of(&scene, &p, NULL);
    sim_steps(sim, 3);
    assert_int_equal(sim->p.n, 3100);
    size_t i = index_of(sim, 100 + 1500); /* 1e-3 apart, support 4e-3: 3 on each side, or 4 */
    assert_true(sim->p.c[i] >= 6 && sim->p.c[i] <= 8);
    sim_steps(sim, 3);
    assert_int_equal(sim->p.n, 200);
    assert_int_equal(sim->p.next_id, 3100); /* ids are never used again */
    sim_drop(sim);
    sphpa_particles_free(&p);
}

/* ---- ghosts ---------------------------------------------------------------------------------- */

/* n particles of random_set, the ghosts in three quarters of the room */
static sphpa_particles ghostly_set(int dim, size_t n, double h) {
    sphpa_particles all = random_set(dim, n, h, 5), p;
    assert_int_equal(sphpa_particles_create(&p, dim, n, SPHPA_F(ghost), 0, NULL, 0, NULL),
                     SPHPA_OK);
    assert_int_equal(sphpa_particles_append(&p, &all, NULL), SPHPA_OK);
    for (size_t i = 0; i < n; i++) p.ghost[i] = p.x[3 * i] > -0.5 ? 1 : 0;
    sphpa_particles_free(&all);
    return p;
}

static void visit_pair(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    sim->p.c[near->i] += SPHPA_R(1.0);
}

static void visit_pair_too(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    (void)params;
    sim->p.div_v[near->i] += SPHPA_R(1.0);
}

static void visit_group(sphpa_sim *sim, void *params, const sphpa_group *near) {
    (void)params;
    for (size_t i = near->first; i < near->first + near->count; i++)
        sim->p.omega[i] += SPHPA_R(1.0);
}

static void visit_group_too(sphpa_sim *sim, void *params, const sphpa_group *near) {
    (void)params;
    for (size_t i = near->first; i < near->first + near->count; i++)
        sim->p.balsara[i] += SPHPA_R(1.0);
}

/* whole groups of ghosts are passed over by passes that are not for ghosts, and by no others;
   kinds: 1 those that are not, 2 those that are, 3 both */
static void ghosts_are_passed_over(void **state) {
    (void)state;
    for (int kinds = 1; kinds <= 3; kinds++)
        for (int dim = 1; dim <= 3; dim++) {
            const double h[3] = {0.02, 0.08, 0.19};
            sphpa_module module = module_named("visits", NULL);
            add_pass(&module, "mark", SPHPA_STAGE_PRESSURE, SPHPA_F(ghost),
                     SPHPA_F(c) | SPHPA_F(div_v) | SPHPA_F(omega) | SPHPA_F(balsara))
                ->particle = nothing;
            if (kinds & 1) {
                add_pair(&module, "a", SPHPA_STAGE_FORCES, SPHPA_F(x), SPHPA_F(c), visit_pair);
                add_pair(&module, "b", SPHPA_STAGE_FORCES, SPHPA_F(x), SPHPA_F(omega), NULL)
                    ->group = visit_group;
            }
            if (kinds & 2) {
                add_pair(&module, "c", SPHPA_STAGE_FORCES, SPHPA_F(x), SPHPA_F(div_v),
                         visit_pair_too)->ghosts = 1;
                sphpa_pass *pass = add_pair(&module, "d", SPHPA_STAGE_FORCES, SPHPA_F(x),
                                            SPHPA_F(balsara), NULL);
                pass->group = visit_group_too;
                pass->ghosts = 1;
            }
            sphpa_scene scene = scene_of(module);
            sphpa_particles p = ghostly_set(dim, 700, h[dim - 1]);
            sphpa_sim_options options = options_of(1e-200);
            options.integrator = SPHPA_RK2;
            sphpa_sim *sim = sim_of(&scene, &p, &options);
            sim_steps(sim, 1); /* three evaluations */
            size_t passed = 0;
            for (size_t first = 0; first < p.n; first += SPHPA_LANES_) {
                size_t end = first + SPHPA_LANES_ < p.n ? first + SPHPA_LANES_ : p.n, real = 0;
                for (size_t i = first; i < end; i++) real += sim->p.ghost[i] == 0 ? 1u : 0u;
                passed += real == 0 ? end - first : 0;
                for (size_t i = first; i < end; i++) {
                    bool visited = (kinds & 1) && real > 0 && i < sim->lists.n;
                    sphpa_real plain = visited ? 3 : 0, all = kinds & 2 ? 3 : 0;
                    assert_true(sim->p.c[i] == plain && sim->p.omega[i] == plain);
                    assert_true(sim->p.div_v[i] == all && sim->p.balsara[i] == all);
                }
            }
            assert_true(passed > p.n / 2 && passed < p.n);
            sim_drop(sim);
            sphpa_particles_free(&p);
        }
}

/* they are neighbours all the same */
static void ghosts_are_neighbours(void **state) {
    (void)state;
    sphpa_module module = module_named("sums", NULL);
    add_pass(&module, "mark", SPHPA_STAGE_PRESSURE, SPHPA_F(ghost), 0)->particle = nothing;
    add_pair(&module, "sum", SPHPA_STAGE_FORCES, SPHPA_F(x) | SPHPA_F(m) | SPHPA_F(h),
             SPHPA_F(P) | SPHPA_F(c) | SPHPA_F(a), sum_pair)->ghosts = 1;
    add_pair(&module, "count", SPHPA_STAGE_FORCES, SPHPA_F(x), SPHPA_F(div_v), count_pair)->ghosts =
        1;
    sphpa_scene scene = scene_of(module);
    sphpa_particles p = ghostly_set(2, 700, 0.08);
    sphpa_sim_options options = options_of(1e-200);
    sphpa_sim *sim = sim_of(&scene, &p, &options);
    sim_steps(sim, 1);
    compare_with_all_pairs(sim);
    sim_drop(sim);
    sphpa_particles_free(&p);
}

static double limit_ghosts(const sphpa_sim *sim, const void *params, size_t i) {
    (void)params;
    return sim->p.ghost[i] != 0 ? 1e-9 : 0.01;
}

static sphpa_result push_ghosts(sphpa_sim *sim, void *params, size_t first, size_t last,
                                size_t *bad) {
    (void)params, (void)bad;
    for (size_t i = first; i < last; i++)
        if (sim->p.ghost[i] != 0) sim->p.a[3 * i] = SPHPA_R(1e8); /* would need tiny steps */
    return SPHPA_OK;
}

/* limits, totals, the flow of all and the least u know nothing of ghosts; a bad number is found */
static void ghosts_do_not_count(void **state) {
    (void)state;
    sphpa_module module = module_named("m", NULL);
    sphpa_pass *limit = add_pass(&module, "limit", SPHPA_STAGE_LIMIT, SPHPA_F(ghost), 0);
    limit->kind = SPHPA_PASS_REDUCE;
    limit->limit = limit_ghosts;
    add_pass(&module, "push", SPHPA_STAGE_FORCES, SPHPA_F(ghost), SPHPA_F(a))->particle =
        push_ghosts;
    sphpa_scene scene = scene_of(module);
    sphpa_particles p = ghostly_set(2, 2500, 0.08); /* several blocks */
    double mass = 0.0, v[2] = {0.0, 0.0}, inner = 0.0;
    for (size_t i = 0; i < p.n; i++) {
        p.u[i] = p.ghost[i] != 0 ? 1e-3 : 2.0 + (double)i;
        if (p.ghost[i] != 0) p.m[i] = SPHPA_R(1000.0);
        else mass += (double)p.m[i], inner += (double)p.m[i] * p.u[i];
        for (size_t a = 0; a < 2 && p.ghost[i] == 0; a++)
            v[a] += (double)p.m[i] * (double)p.v[3 * i + a];
    }
    sphpa_sim *sim = sim_of(&scene, &p, NULL);
    sphpa_totals totals = sphpa_sim_totals(sim);
    assert_near(totals.mass, mass, 1e-13);
    assert_near(totals.internal, inner, 1e-13);
    for (int a = 0; a < 2; a++) assert_near_abs(totals.momentum[a], v[a], 1e-12 * mass);
    assert_true(totals.kinetic < mass);
    double spin = 0.0, centre[2] = {0.0, 0.0};
    for (size_t i = 0; i < p.n; i++)
        for (size_t a = 0; a < 2 && p.ghost[i] == 0; a++)
            centre[a] += (double)p.m[i] * p.x[3 * i + a] / mass;
    for (size_t i = 0; i < p.n; i++)
        if (p.ghost[i] == 0)
            spin += (double)p.m[i] * ((p.x[3 * i] - centre[0]) * (double)p.v[3 * i + 1] -
                                      (p.x[3 * i + 1] - centre[1]) * (double)p.v[3 * i]);
    assert_near_abs(totals.angular[2], spin, 1e-12 * mass);
    sim_steps(sim, 1);
    assert_true(sim->dt == 0.01 && sim->dt_next == 0.01);
    for (int a = 0; a < 2; a++) {
        assert_near_abs(sim->work->flow_v[a], v[a] / mass, FINE(1e-14, 1e-6));
        double moved = 0.01 * v[a] / mass;
        assert_near_abs(sim->work->flow_x[a], centre[a] + moved, FINE(1e-13, 1e-6));
    }
    double least = 1e300;
    for (size_t i = 0; i < p.n; i++)
        if (p.ghost[i] == 0) least = fmin(least, p.u[i]);
    assert_true(sim->stats.u_least == least && sim->stats.u_below == 0);
    size_t i = 0;
    while (sim->p.ghost[i] == 0) i++;
    sim->p.v[3 * i] = (sphpa_real)NAN;
    sphpa_error err;
    assert_true(sphpa_sim_step(sim, HUGE_VAL, &err) != SPHPA_OK);
    sim_drop(sim);
    sphpa_particles_free(&p);
}

static sphpa_result write_ones(sphpa_sim *sim, void *params, size_t first, size_t last,
                               size_t *bad) {
    (void)params, (void)bad;
    for (size_t i = first; i < last; i++) sim->p.P[i] = sim->p.omega[i] = SPHPA_R(1.0);
    return SPHPA_OK;
}

/* how often ghosts() came with P among the fields, with all, and with omega alone */
typedef struct ghost_calls {
    int P, all, omega;
} ghost_calls;

static void give_sevens(sphpa_sim *sim, void *params, sphpa_mask fields) {
    ghost_calls *calls = (ghost_calls *)params;
    bool P = (fields & SPHPA_F(P)) != 0, omega = (fields & SPHPA_F(omega)) != 0;
    if (fields == ~(sphpa_mask)0) calls->all++;
    else if (P) calls->P++;
    if (omega && !P) calls->omega++;
    for (size_t i = 0; i < sim->p.n && P; i++)
        if (sim->p.ghost[i] != 0) sim->p.P[i] = SPHPA_R(7.0);
}

static sphpa_result read_sevens(sphpa_sim *sim, void *params, size_t first, size_t last,
                                size_t *bad) {
    (void)params;
    for (size_t i = first; i < last; i++)
        if ((sim->p.ghost[i] != 0) != (sim->p.P[i] == SPHPA_R(7.0))) {
            *bad = i;
            return SPHPA_ERROR_STATE;
        }
    return SPHPA_OK;
}

/* what passes wrote of ghosts is given back before the next pass looks */
static void ghosts_get_their_own_back(void **state) {
    (void)state;
    ghost_calls calls = {0, 0, 0};
    sphpa_module writes = module_named("writes", NULL), gives = module_named("gives", &calls);
    add_pass(&writes, "ones", SPHPA_STAGE_PRESSURE, SPHPA_F(ghost), SPHPA_F(P) | SPHPA_F(omega))
        ->particle = write_ones;
    add_pass(&writes, "look", SPHPA_STAGE_STRESS, SPHPA_F(P), SPHPA_F(omega))->particle =
        read_sevens;
    gives.ghosts = give_sevens;
    sphpa_scene scene = scene_of(writes);
    assert_int_equal(sphpa_scene_add(&scene, gives), SPHPA_OK);
    sphpa_particles p = ghostly_set(2, 50, 0.08);
    sphpa_sim_options options = options_of(1e-3);
    sphpa_sim *sim = sim_of(&scene, &p, &options);
    sim_steps(sim, 4);
    assert_int_equal(calls.P, 5); /* the start's evaluation, too */
    assert_int_equal(calls.omega, 5);
    assert_int_equal(calls.all, 5 + 4); /* before each evaluation, and at the end of each step */
    sim_drop(sim);
    sphpa_particles_free(&p);
}

/* ---- sums, reports --------------------------------------------------------------------------- */

/* of 3000 particles, moved away from the origin and with a velocity of all: angular momentum is
   about the centre of mass, and knows neither */
static void totals_are_sums(void **state) {
    (void)state;
    limiter l = {0.1, 0.1, 0};
    sphpa_scene scene = limit_scene(&l);
    sphpa_particles p = random_set(3, 3000, 0.1, 1);
    sphpa_sim *sim = sim_of(&scene, &p, NULL);
    long double mass = 0, momentum[3] = {0, 0, 0}, angular[3] = {0, 0, 0}, kinetic = 0, inner = 0;
    long double centre[3] = {0, 0, 0};
    for (size_t i = 0; i < p.n; i++)
        for (size_t a = 0; a < 3; a++) {
            mass += a == 0 ? (long double)p.m[i] : 0.0L;
            centre[a] += (long double)p.m[i] * p.x[3 * i + a];
        }
    for (int a = 0; a < 3; a++) centre[a] /= mass;
    for (size_t i = 0; i < p.n; i++) {
        long double m = (long double)p.m[i];
        inner += m * p.u[i];
        for (int a = 0; a < 3; a++) {
            int b = (a + 1) % 3, c = (a + 2) % 3;
            long double v = (long double)p.v[3 * i + (size_t)a];
            momentum[a] += m * v;
            kinetic += m * v * v / 2;
            angular[a] += m * ((p.x[3 * i + (size_t)b] - centre[b]) * p.v[3 * i + (size_t)c] -
                               (p.x[3 * i + (size_t)c] - centre[c]) * p.v[3 * i + (size_t)b]);
        }
    }
    sphpa_totals totals = sphpa_sim_totals(sim);
    assert_near(totals.mass, (double)mass, 1e-14);
    assert_near(totals.kinetic, (double)kinetic, 1e-14);
    assert_near(totals.internal, (double)inner, 1e-14);
    assert_near(totals.energy, (double)(inner + kinetic), 1e-14);
    for (int a = 0; a < 3; a++) {
        assert_near_abs(totals.momentum[a], (double)momentum[a], 1e-12);
        assert_near_abs(totals.angular[a], (double)angular[a], 1e-12);
    }
    for (size_t k = 0; k < 3 * sim->p.n; k++) {
        sim->p.x[k] += 4.0;
        sim->p.v[k] = (sphpa_real)((double)sim->p.v[k] + 8.0);
    }
    totals = sphpa_sim_totals(sim);
    for (int a = 0; a < 3; a++)
        assert_near_abs(totals.angular[a], (double)angular[a], FINE(1e-12, 1e-5) * (double)mass);
    sim_drop(sim);
    sphpa_particles_free(&p);
}

static void the_report_tells_costs(void **state) {
    (void)state;
    sphpa_sim *sim = fused_sim(1);
    static char text[8000], part[100];
    size_t length = sphpa_sim_report(sim, text, sizeof text);
    assert_int_equal(length, strlen(text));
    static const char *const words[] = {"tree build", "tree sort",  "neighbour lists", "integrate",
                                        "one ",       "omega",      "balsara",         "all fields",
                                        "5 steps",    "line above", "dt_max"};
    for (size_t k = 0; k < sizeof words / sizeof words[0]; k++)
        if (strstr(text, words[k]) == NULL) fail_msg("the report lacks \"%s\"", words[k]);
    assert_null(strstr(text, "alpha"));
    assert_int_equal(sphpa_sim_report(sim, NULL, 0), length);
    assert_int_equal(sphpa_sim_report(sim, NULL, 50), length);
    memset(part, 'x', sizeof part);
    assert_int_equal(sphpa_sim_report(sim, part, 50), length);
    assert_int_equal(strlen(part), 49);
    assert_memory_equal(part, text, 49);
    assert_int_equal(part[50], 'x');
    size_t bytes = 0, listed = 0;
    for (int k = 0; k < (int)SPHPA_FIELD_COUNT; k++)
        if ((sim->p.fields >> k) & 1u)
            listed++, bytes += sphpa_field_describe((sphpa_field)k).bytes;
    assert_int_equal(listed, 13); /* nine, a, du, and the two that the passes write */
    bytes += 3 * sizeof(sphpa_real) + 8; /* copies of v and u */
    assert_int_equal(sphpa_particles_bytes_each(&sim->p), bytes);
    sim_drop(sim);
}

/* ---- lanes ----------------------------------------------------------------------------------- */

/* every kernel in lanes against the scalar one, from 0 to beyond the support */
static void lanes_know_the_kernels(void **state) {
    (void)state;
    for (int k = 0; k < (int)SPHPA_KERNEL_COUNT; k++)
        for (int dim = 1; dim <= 3; dim++) {
            sphpa_kernel kernel = (sphpa_kernel)k;
            int shape = sphpa_kernel_shape_(kernel, dim);
            double norm = sphpa_kernel_norm_(kernel, dim), most = 0.0, steepest = 0.0;
            for (int n = 0; n <= 4000; n++) {
                double q = n * 1e-3;
                most = fmax(most, sphpa_kernel_w(kernel, dim, q, 1.0));
                steepest = fmax(steepest, -sphpa_kernel_dw(kernel, dim, q, 1.0));
            }
            for (int n = 0; n <= 4000; n += (int)SPHPA_LANES_) {
                sphpa_lanes_ q = sphpa_lanes_of_(SPHPA_R(0.0)), w, dw;
                for (size_t l = 0; l < SPHPA_LANES_; l++)
                    SPHPA_LANE_(q, l) = (sphpa_real)((n + (int)l) * 1e-3);
                sphpa_lanes_kernel_(shape, q, &w, &dw);
                for (size_t l = 0; l < SPHPA_LANES_; l++) {
                    double at = (double)SPHPA_LANE_(q, l);
                    double off = norm * (double)SPHPA_LANE_(w, l) -
                                 sphpa_kernel_w(kernel, dim, at, 1.0);
                    double slope = norm * (double)SPHPA_LANE_(dw, l) -
                                   sphpa_kernel_dw(kernel, dim, at, 1.0);
                    assert_true(fabs(off) <= 60.0 * ROUNDING * most);
                    assert_true(fabs(slope) <= 60.0 * ROUNDING * steepest);
                    if (at < sphpa_kernel_support(kernel)) continue;
                    assert_true(SPHPA_LANE_(w, l) == SPHPA_R(0.0));
                    assert_true(SPHPA_LANE_(dw, l) == SPHPA_R(0.0));
                }
            }
        }
}

/* ---- bits ------------------------------------------------------------------------------------ */

static void compare_bits(const sphpa_sim *a, const sphpa_sim *b) {
    assert_int_equal(a->p.n, b->p.n);
    assert_true(a->time == b->time && a->dt_next == b->dt_next);
    for (int k = 0; k < (int)SPHPA_FIELD_COUNT; k++) {
        size_t bytes = sphpa_field_describe((sphpa_field)k).bytes * a->p.n;
        const void *one = sphpa_particles_data(&a->p, (sphpa_field)k, 0);
        if (one != NULL && memcmp(one, sphpa_particles_data(&b->p, (sphpa_field)k, 0), bytes) != 0)
            fail_msg("field %s differs", sphpa_field_describe((sphpa_field)k).name);
    }
}

static void threads_give_the_same_bits(void **state) {
    (void)state;
#ifdef SPHPA_TEST_SMALL
    const size_t n = 2200;
    const int steps = 15;
#else
    const size_t n = 3500; /* seven chunks of the lists, 14 blocks */
    const int steps = 50;
#endif
    const int threads[3] = {1, 2, 4};
    sphpa_sim *sim[4];
    for (int t = 0; t < 3; t++) {
        set_threads(threads[t]);
        sim[t] = push_sim(n, 2.0, false);
        sim_steps(sim[t], steps);
    }
    set_threads(1); /* and when their number changes on the way, while lists are in use */
    sim[3] = push_sim(n, 2.0, false);
    int done = 0;
    for (uint64_t built = 0; done < steps - 1; done++) { /* until some were just built */
        if (done > steps / 3 && sim[3]->stats.rebuilds > built) break;
        built = sim[3]->stats.rebuilds;
        sim_steps(sim[3], 1);
    }
    set_threads(4);
    sim_steps(sim[3], steps - done);
    set_threads(1);
    assert_true(sim[0]->stats.rebuilds > 1);
    for (int t = 1; t < 4; t++) compare_bits(sim[0], sim[t]);
    sphpa_totals one = sphpa_sim_totals(sim[0]), two = sphpa_sim_totals(sim[2]);
    assert_memory_equal(&one, &two, sizeof one);
    for (int t = 0; t < 4; t++) sim_drop(sim[t]);
}

static void a_settled_run_goes_on_from_its_arrays(void **state) {
    (void)state;
    sphpa_sim *sim = push_sim(1500, 0.1, false);
    sim_steps(sim, 8);
    assert_int_equal(sphpa_sim_settle(sim, NULL), SPHPA_OK);
    sphpa_scene scene = push_scene(false);
    sphpa_sim *other = sim_of(&scene, &sim->p, &sim->options);
    other->time = sim->time;
    other->dt = sim->dt;
    other->dt_next = sim->dt_next;
    other->dt_free = sim->dt_free;
    other->dt_first = sim->dt_first;
    other->started = 1;
    sim_steps(sim, 12);
    sim_steps(other, 12);
    compare_bits(sim, other);
    sim_drop(sim);
    sim_drop(other);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(passes_run_by_stage),
        cmocka_unit_test(clashes_are_errors),
        cmocka_unit_test(replaced_passes_are_gone),
        cmocka_unit_test(fields_are_the_union),
        cmocka_unit_test(columns_advance_from_the_start),
        cmocka_unit_test(integrators_are_of_second_order),
        cmocka_unit_test(the_leapfrog_runs_backwards),
        cmocka_unit_test(particles_go_round_the_box),
        cmocka_unit_test(pair_sums_equal_all_pairs),
        cmocka_unit_test(the_skin_changes_nothing),
        cmocka_unit_test(lists_follow_what_passes_change),
        cmocka_unit_test(records_serve_while_they_are_true),
        cmocka_unit_test(shared_traversals_give_the_same_bits),
        cmocka_unit_test(hazards_keep_passes_apart),
        cmocka_unit_test(pairs_at_commit_have_their_neighbours),
        cmocka_unit_test(two_that_meet_find_each_other),
        cmocka_unit_test(only_marked_passes_run_at_commit),
        cmocka_unit_test(refused_modules_are_told),
        cmocka_unit_test(limits_are_told_by_name),
        cmocka_unit_test(steps_grow_by_a_quarter),
        cmocka_unit_test(the_force_limits_the_step),
        cmocka_unit_test(bad_limits_and_the_floor_stop_the_run),
        cmocka_unit_test(outputs_come_at_their_times),
        cmocka_unit_test(a_run_stops_when_told),
        cmocka_unit_test(refresh_leaves_the_state_alone),
        cmocka_unit_test(outputs_leave_no_trace),
        cmocka_unit_test(moved_after_a_refresh),
        cmocka_unit_test(the_least_u_is_named),
        cmocka_unit_test(a_bad_state_stops_the_run),
        cmocka_unit_test(bad_options_are_refused),
        cmocka_unit_test(bad_starts_are_refused),
        cmocka_unit_test(modules_are_set_up_and_torn_down_once),
        cmocka_unit_test(particles_come_and_go),
        cmocka_unit_test(ghosts_are_passed_over),
        cmocka_unit_test(ghosts_are_neighbours),
        cmocka_unit_test(ghosts_do_not_count),
        cmocka_unit_test(ghosts_get_their_own_back),
        cmocka_unit_test(totals_are_sums),
        cmocka_unit_test(the_report_tells_costs),
        cmocka_unit_test(lanes_know_the_kernels),
        cmocka_unit_test(threads_give_the_same_bits),
        cmocka_unit_test(a_settled_run_goes_on_from_its_arrays),
    };
    set_threads(1); /* but where threads are the question: these scenes are too small for more */
    return cmocka_run_group_tests_name("sph", tests, NULL, NULL);
}
