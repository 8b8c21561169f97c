/* impact_again.h: the impact of examples/pumice_impact.c, for programs that run it many times and
   look at it after every step. They write none of its files. Include it first. */
#ifndef IMPACT_AGAIN_H
#define IMPACT_AGAIN_H

/* the example as it is, its scene and its fragments; its command line under another name */
#define main impact_main
#include "../examples/pumice_impact.c"
#undef main

/* what one run differs in from another */
typedef struct again_change {
    sphpa_palpha_solver solver;
    double tol;  /* [1] of alpha */
    int nudge;   /* not 0: the speed of the nudge-th particle of the projectile is changed, */
    double size; /* [1] by this share; 0: by one rounding, the least that the state can hold */
} again_change;

/* what comes of it is the scene's own doing */
static void again_nudge(sphpa_particles *p, int which, double size) {
    for (size_t i = 0; i < p->n; i++) {
        if (p->body[i] != IMPACT_PROJECTILE || --which > 0) continue;
        sphpa_real *v = &p->v[3 * i + 2];
        if (size > 0.0) *v = (sphpa_real)((double)*v * (1.0 - size));
#ifdef SPHPA_FLOAT
        else *v = nextafterf(*v, 0.0f);
#else
        else *v = nextafter(*v, 0.0);
#endif
        return;
    }
}

/* at t = 0; a recorder may be NULL */
static impact_run *again_begin(const impact_settings *settings, const again_change *change,
                               const sphpa_module *recorder) {
    static const impact_options options; /* none */
    sphpa_error err;
    impact_settings s = *settings;
    s.solver = (int)change->solver;
    impact_run *run = impact_new(&s, &options, "");
    impact_materials(&run->scene, &run->s);
    run->scene.pores.options.tol = change->tol;
    impact_modules(&run->scene, &run->s);
    if (recorder != NULL) sphpa_scene_add(&run->scene.scene, *recorder);
    sphpa_particles bodies;
    sphpa_sim_options sim_options;
    memset(&bodies, 0, sizeof bodies);
    memset(&sim_options, 0, sizeof sim_options);
    sim_options.cfl = s.cfl;
    sphpa_result result = impact_bodies(&bodies, &run->scene, &run->s, NULL, &err);
    if (result == SPHPA_OK) {
        if (change->nudge > 0) again_nudge(&bodies, change->nudge, change->size);
        result = sphpa_sim_create(&run->sim, &run->scene.scene, &bodies, &sim_options, &err);
    }
    sphpa_particles_free(&bodies);
    if (result != SPHPA_OK) example_fail(1, "%s", err.message);
    run->start = sphpa_sim_totals(&run->sim);
    for (size_t i = 0; i < run->sim.p.n; i++)
        if (run->sim.p.body[i] == IMPACT_TARGET) run->target_mass += (double)run->sim.p.m[i];
    return run;
}

static void again_step(impact_run *run, double dt_limit) {
    sphpa_error err;
    if (sphpa_sim_step(&run->sim, dt_limit, &err) != SPHPA_OK) example_fail(1, "%s", err.message);
}

static double again_drift(const impact_run *run) { /* of the energy */
    return sphpa_sim_totals(&run->sim).energy / run->start.energy - 1.0;
}

static double *again_doubles(size_t n) {
    double *values = (double *)calloc(n + 1, sizeof *values);
    if (values == NULL) example_fail(1, "out of memory; give fewer particles");
    return values;
}

#endif
