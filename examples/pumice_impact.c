/* pumice_impact.c: a nylon sphere hits a porous pumice sphere, after the experiment of Jutzi,
   Michel, Hiraoka, Nakamura & Benz 2009 (Icarus 201): 2.58 km/s, largest fragment 9.96 % of the
   target.

   What is known of that experiment and what is assumed is printed at the end of every run. This
   file sets the scene and runs it; files and pictures are made in impact_output.h. */
#include "example.h"

#define SPHPA_IMPLEMENTATION
#ifdef SPHPA_WITH_HDF5
#define SPHPA_SNAPSHOT_IMPLEMENTATION
#endif
#include "sphpa.h"

#define IMPACT_RECORDS 512 /* outputs of a run, at most */
#define IMPACT_SETTLE 8    /* steps between places where a run may be interrupted */

/* ---- settings -------------------------------------------------------------------------------- */

#define IMPACT_CURVES "two-exponent|quadratic" /* words of the options */
#define IMPACT_SOLVERS "crush-space|bisection|newton|safe-newton"

enum { IMPACT_TARGET = 0, IMPACT_PROJECTILE, IMPACT_BODIES }; /* bodies, and their materials */

/* What the command line sets. Numbers only: a checkpoint keeps it, and a resumed run compares
   (impact_list). */
typedef struct impact_settings {
    double speed;              /* [m/s] */
    double angle;              /* [deg] from the surface's normal */
    double target_diameter;    /* [m] */
    double projectile_diameter; /* [m] */
    double weibull_k, weibull_m; /* [m^-3] [1] */
    double tension;            /* [Pa] what nylon bears in tension */
    double spread;             /* [1] largest h of nylon over its first one */
    double viscosity[2];       /* [1] linear and quadratic */
    double cfl;                /* [1] */
    double t_end, every;       /* [s] */
    double gauge[3];           /* [m] */
    double link, damage_below; /* [1] of the fragments, see sphpa_fragment_options */
    long particles, projectile_particles, seed, lattice_seed;
    int curve, solver, correction, balsara; /* curve 0: two exponents, 1: quadratic */
} impact_settings;

/* How it is run and what is made of it. */
typedef struct impact_options {
    long ensemble, threads, compare_particles;
    int dry_run, quiet, compare, snapshots;
    const char *out, *resume, *sensitivity, *movie, *target_file;
    const char *record; /* states of P-alpha solves go there; NULL: nowhere */
    const char *go_on; /* what --resume takes after an interrupt; NULL: the run's own checkpoint */
    int again;         /* not 0: nothing, the same command goes on */
    int scratch;       /* not 0: of several runs; a checkpoint of others is begun anew */
} impact_options;

static impact_settings impact_default_settings(void) {
    impact_settings s;
    memset(&s, 0, sizeof s);
    s.speed = 2580.0;
    s.target_diameter = 0.1;
    s.projectile_diameter = 7e-3;
    s.weibull_k = 4e35;
    s.weibull_m = 9.0;
    s.tension = 1e8;
    s.spread = 5.0;
    s.viscosity[0] = 1.0;
    s.viscosity[1] = 3.0;
    s.cfl = 0.3;
    s.t_end = 2e-4;
    s.gauge[2] = 0.025;
    s.particles = 5000;
    s.projectile_particles = 200;
    s.link = 1.0;
    s.damage_below = 0.9;
    s.seed = s.lattice_seed = 1;
    s.correction = s.balsara = 1;
    return s;
}

#include "impact_output.h"

/* ---- the scene ------------------------------------------------------------------------------- */

/* All that the modules point to; it must stay where it is while the simulation lives. */
typedef struct impact_scene {
    sphpa_material material[IMPACT_BODIES];
    sphpa_crush crush[IMPACT_BODIES];
    const sphpa_tillotson *matrix[IMPACT_BODIES];
    sphpa_solid_material solid_material[IMPACT_BODIES];
    sphpa_yield yield[IMPACT_BODIES];
    sphpa_cracks_material flaws[IMPACT_BODIES];
    sphpa_solid_params solid;
    sphpa_pores_params pores;
    sphpa_plastic_params plastic;
    sphpa_cracks_params cracks;
    sphpa_scene scene;
} impact_scene;

static void impact_materials(impact_scene *scene, const impact_settings *s) {
    static const char *const name[IMPACT_BODIES] = {"pumice", "nylon"};
    sphpa_crush fitted = sphpa_crush_pumice();
    memset(scene, 0, sizeof *scene);
    for (int k = 0; k < IMPACT_BODIES; k++) {
        scene->material[k] = *sphpa_material_find(name[k]);
        scene->matrix[k] = &scene->material[k].eos;
        scene->solid_material[k].eos = sphpa_tillotson_eos(&scene->material[k].eos);
        scene->solid_material[k].G = scene->material[k].G;
        scene->yield[k].kind = SPHPA_YIELD_VON_MISES;
        scene->yield[k].Y0 = scene->material[k].Y;
        scene->yield[k].u_melt = scene->material[k].u_melt;
        scene->crush[k].alpha0 = 1.0;
    }
    scene->material[IMPACT_PROJECTILE].eos.tensile_limit = s->tension;
    scene->solid_material[IMPACT_PROJECTILE].h_max = s->spread;
    scene->crush[IMPACT_TARGET] =
        s->curve == 0 ? fitted : sphpa_crush_quadratic(fitted.alpha0, fitted.Pe, fitted.Ps);
    scene->flaws[IMPACT_TARGET].k = s->weibull_k;
    scene->flaws[IMPACT_TARGET].m = s->weibull_m;
    scene->flaws[IMPACT_TARGET].alpha0 = fitted.alpha0;
}

static void impact_modules(impact_scene *scene, const impact_settings *s) {
    scene->solid.material = scene->solid_material;
    scene->solid.materials = IMPACT_BODIES;
    scene->solid.correction = s->correction;
    scene->solid.viscosity.balsara = s->balsara; /* below, 0 would mean the default */
    scene->solid.viscosity.a = s->viscosity[0] > 0.0 ? s->viscosity[0] : -1.0;
    scene->solid.viscosity.b = s->viscosity[1] > 0.0 ? s->viscosity[1] : -1.0;
    scene->pores.solid = &scene->solid;
    scene->pores.crush = scene->crush;
    scene->pores.matrix = scene->matrix;
    scene->pores.solver = (sphpa_palpha_solver)s->solver;
    scene->plastic.yield = scene->yield;
    scene->plastic.materials = IMPACT_BODIES;
    scene->cracks.solid = &scene->solid;
    scene->cracks.material = scene->flaws;
    scene->cracks.seed = (uint64_t)s->seed;
    sphpa_scene_add(&scene->scene, sphpa_solid(&scene->solid));
    sphpa_scene_add(&scene->scene, sphpa_pores(&scene->pores));
    sphpa_scene_add(&scene->scene, sphpa_plastic(&scene->plastic));
    sphpa_scene_add(&scene->scene, sphpa_cracks(&scene->cracks));
}

#ifdef SPHPA_WITH_HDF5
/* particles of a file become body 0 of pumice, at rest, around the scene's centre; the target's
   diameter becomes that of the sphere around them */
static void impact_place_target(sphpa_particles *p, impact_settings *s) {
    double mean[3] = {0.0, 0.0, 0.0}, far = 0.0, alpha0 = sphpa_crush_pumice().alpha0;
    for (size_t i = 0; i < p->n; i++)
        for (size_t a = 0; a < 3; a++) mean[a] += p->x[3 * i + a] / (double)p->n;
    for (size_t i = 0; i < p->n; i++) {
        double r2 = 0.0;
        for (size_t a = 0; a < 3; a++)
            r2 += (p->x[3 * i + a] - mean[a]) * (p->x[3 * i + a] - mean[a]);
        far = fmax(far, sqrt(r2) + 0.5 * (double)p->h[i] / 1.2);
    }
    s->target_diameter = 2.0 * far;
    for (size_t i = 0; i < p->n; i++) {
        for (size_t a = 0; a < 3; a++) {
            p->x[3 * i + a] += impact_origin(s) - mean[a];
            p->v[3 * i + a] = 0;
        }
        p->body[i] = p->material[i] = IMPACT_TARGET;
        if (p->alpha[i] < 1.0) p->alpha[i] = alpha0;
    }
}
#endif

static sphpa_result impact_read_target(sphpa_particles *bodies, const char *path,
                                       impact_settings *s, sphpa_error *err) {
#ifdef SPHPA_WITH_HDF5
    sphpa_particles shape;
    sphpa_result result = sphpa_snapshot_read(path, &shape, NULL, err);
    if (result != SPHPA_OK) return result;
    if (shape.dim == 3) {
        result = sphpa_make_begin(bodies, 3, err);
        if (result == SPHPA_OK) result = sphpa_particles_append(bodies, &shape, err);
        if (result == SPHPA_OK) impact_place_target(bodies, s);
    } else result = sphpa_error_set(err, SPHPA_ERROR_FORMAT,
                                    "--target %s: %d-D; give a body in 3-D", path, shape.dim);
    sphpa_particles_free(&shape);
    return result;
#else
    (void)bodies;
    (void)s;
    return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                           "--target %s: this program was built without HDF5; install it (make "
                           "deps) and build again", path);
#endif
}

/* the target and, above it, the projectile half a spacing from its surface, flying along -z */
static sphpa_result impact_bodies(sphpa_particles *p, const impact_scene *scene,
                                  impact_settings *s, const char *target_file, sphpa_error *err) {
    double theta = s->angle * 3.14159265358979323846 / 180.0, origin = impact_origin(s);
    double centre[3] = {origin, origin, origin};
    sphpa_body body;
    sphpa_result result;
    memset(&body, 0, sizeof body);
    body.alpha = scene->crush[IMPACT_TARGET].alpha0;
    body.rho = scene->material[IMPACT_TARGET].eos.rho0 / body.alpha;
    body.count = (size_t)s->particles;
    body.seed = (uint64_t)s->lattice_seed;
    body.lattice = SPHPA_LATTICE_HEXAGONAL;
    body.material = body.body = IMPACT_TARGET;
    result = target_file != NULL
                 ? impact_read_target(p, target_file, s, err)
                 : sphpa_make_sphere(p, centre, 0.5 * s->target_diameter, &body, err);
    if (result != SPHPA_OK) return result;
    double radius = 0.5 * s->target_diameter, small = 0.5 * s->projectile_diameter;
    for (int a = 0; a < 3; a++) centre[a] = impact_origin(s); /* of a file's body, too */
    double spacing = 0.0; /* of the coarser of the two */
    for (size_t i = 0; i < p->n; i++) spacing = fmax(spacing, (double)p->h[i] / 1.2);
    double away = radius + small + 0.5 * spacing;
    centre[0] += away * sin(theta);
    centre[2] += away * cos(theta);
    body.alpha = 1.0;
    body.rho = scene->material[IMPACT_PROJECTILE].eos.rho0;
    body.count = (size_t)s->projectile_particles;
    body.seed = (uint64_t)s->lattice_seed + 1000u;
    body.material = body.body = IMPACT_PROJECTILE;
    body.v[2] = -s->speed;
    return sphpa_make_sphere(p, centre, small, &body, err);
}

/* ---- states for the solvers' benchmark ------------------------------------------------------- */

/* A pass of our own writes down what the P-alpha equation was solved for: bulk density, energy and
   the distention that the step began with, of the target's particles at the end of a step. The file
   is text: lines "# key value" that name the material and the curve, then a line rho [kg/m3],
   u [J/kg], alpha_old [1] for each state. Of every particle in turn, at about a hundred times that
   are evenly spread: some ten megabytes, whatever the size of the run. */
enum { IMPACT_SAMPLES = 100, IMPACT_SAMPLE_STATES = 2000 };

typedef struct impact_recorder {
    example_file file; /* stream is NULL: not yet open */
    double every;      /* [s] between samples */
    int samples;       /* taken so far */
} impact_recorder;

/* RESIZE: once a step, after the commit, in one call; it leaves the particles as they are */
static sphpa_result impact_record_states(sphpa_sim *sim, void *params, size_t first, size_t last,
                                         size_t *bad) {
    impact_recorder *recorder = (impact_recorder *)params;
    const sphpa_particles *p = &sim->p;
    (void)bad;
    if (recorder->file.stream == NULL || sim->time < recorder->every * recorder->samples)
        return SPHPA_OK;
    int64_t stride = (int64_t)((last - first) / IMPACT_SAMPLE_STATES) + 1;
    for (size_t i = first; i < last; i++) {
        if (p->material[i] != IMPACT_TARGET || (p->id[i] + recorder->samples) % stride != 0)
            continue;
        fprintf(recorder->file.stream, "%.17g %.17g %.17g\n", p->rho[i], fmax(p->u[i], 0.0),
                p->start.alpha[i]);
    }
    recorder->samples++;
    return SPHPA_OK;
}

static sphpa_module impact_recorder_module(impact_recorder *recorder) {
    sphpa_module module;
    memset(&module, 0, sizeof module);
    module.name = "recorder";
    module.params = recorder;
    module.passes = 1;
    module.pass[0].name = "record states";
    module.pass[0].stage = SPHPA_STAGE_RESIZE;
    module.pass[0].reads =
        SPHPA_F(rho) | SPHPA_F(u) | SPHPA_F(alpha) | SPHPA_F(material) | SPHPA_F(id);
    module.pass[0].particle = impact_record_states;
    return module;
}

static void impact_recorder_open(impact_recorder *recorder, const char *path, double t_end,
                                 const impact_scene *scene) {
    char folder[EXAMPLE_PATH];
    const sphpa_crush *curve = &scene->crush[IMPACT_TARGET];
    const char *name = impact_split(path, folder);
    example_folder_of(folder, "--record-states");
    recorder->file = example_open_of(folder, name, "--record-states");
    recorder->every = t_end / IMPACT_SAMPLES;
    fprintf(recorder->file.stream,
            "# states of P-alpha solves in an impact: rho [kg/m3] u [J/kg] alpha_old [1]\n"
            "# material %s\n# curve %s\n# alpha0 %.17g\n# Pe %.17g\n# Pt %.17g\n# Ps %.17g\n"
            "# alpha_e %.17g\n# alpha_t %.17g\n# n1 %.17g\n# n2 %.17g\n",
            scene->material[IMPACT_TARGET].name,
            curve->kind == SPHPA_CRUSH_TWO_EXPONENT ? "two-exponent" : "quadratic", curve->alpha0,
            curve->Pe, curve->Pt, curve->Ps, curve->alpha_e, curve->alpha_t, curve->n1, curve->n2);
}

/* ---- one run --------------------------------------------------------------------------------- */

typedef struct impact_run {
    impact_settings s;
    const impact_options *o;
    char out[EXAMPLE_PATH], checkpoint[EXAMPLE_PATH + 32]; /* the last good one, or "" */
    impact_scene scene;
    impact_recorder recorder;
    sphpa_sim sim;
    sphpa_totals start; /* at t = 0 */
    double target_mass, projectile_mass;
    impact_history history; /* what the outputs found; kept in checkpoints */
    example_progress progress;
    FILE *log, *gauge;
    double wall;          /* [s] of the steps */
    uint64_t steps_begun; /* made before this program started */
    const volatile int *asked; /* not 0: Ctrl-C */
    volatile int stop;         /* not 0: now is the place for it */
    int resumed, quiet, every_given;
} impact_run;

static sphpa_result impact_checkpoint(impact_run *run, sphpa_error *err) {
#ifdef SPHPA_WITH_HDF5
    char path[EXAMPLE_PATH + 32];
    const sphpa_blob blob[3] = {{"settings", &run->s, sizeof run->s},
                                {"start", &run->start, sizeof run->start},
                                {"history", &run->history, sizeof run->history}};
    impact_texts texts;
    sphpa_snapshot_info info = impact_info(&run->s, &texts);
    info.blobs = blob;
    info.blobs_count = 3;
    snprintf(path, sizeof path, "%s/checkpoint.hdf", run->out);
    sphpa_result result = sphpa_checkpoint_write(&run->sim, path, &info, err);
    if (result == SPHPA_OK) memcpy(run->checkpoint, path, sizeof path);
    return result;
#else
    return sphpa_sim_settle(&run->sim, err); /* the same bits as with a file */
#endif
}

#ifdef SPHPA_WITH_HDF5
/* whether a checkpoint's run and this one differ in one of `shared` settings, and how: "--speed is
   2580 in it and 2000 here" */
static bool impact_differs(const impact_settings *kept, const impact_settings *s, int shared,
                           char how[128]) {
    impact_setting before[IMPACT_LISTED], now[IMPACT_LISTED];
    char then[32], here[32];
    impact_list(kept, before);
    impact_list(s, now);
    for (int k = 0; k < shared; k++) {
        if (fabs(before[k].value - now[k].value) <= 1e-12 * fabs(now[k].value)) continue;
        impact_value(&before[k], then);
        impact_value(&now[k], here);
        snprintf(how, 128, "--%s is %s in it and %s here", now[k].name, then, here);
        return true;
    }
    return false;
}
#endif

/* the checkpoint to go on from, or "" to begin anew */
static void impact_resume_path(const impact_run *run, char path[EXAMPLE_PATH + 32]) {
    path[0] = '\0';
    if (run->o->resume == NULL) return;
    if (strcmp(run->o->resume, "auto") != 0) {
        snprintf(path, EXAMPLE_PATH, "%s", run->o->resume);
        return;
    }
    snprintf(path, EXAMPLE_PATH + 32, "%s/checkpoint.hdf", run->out);
    FILE *there = fopen(path, "rb");
    if (there != NULL) {
        fclose(there);
    } else if (errno == ENOENT) {
        if (!run->quiet && !run->o->scratch) fprintf(stderr, "no %s: begins anew\n", path);
        path[0] = '\0';
    }
}

static sphpa_result impact_resume(impact_run *run, const char *path, sphpa_error *err) {
#ifdef SPHPA_WITH_HDF5
    impact_settings kept;
    impact_history history;
    sphpa_result result = sphpa_checkpoint_blob(path, "settings", &kept, sizeof kept, err);
    if (result != SPHPA_OK) return result;
    if (!run->every_given && !run->o->scratch)
        run->s.every = kept.every; /* also with another --t-end */
    char how[128];
    if (impact_differs(&kept, &run->s, run->o->scratch ? IMPACT_LISTED : IMPACT_SHARED, how))
        return sphpa_error_set(err, SPHPA_ERROR_FORMAT,
                               "%s is of another run: %s; give the same options, or begin anew "
                               "without --resume", path, how);
    size_t particles = run->sim.p.n;
    result = sphpa_checkpoint_read(&run->sim, path, err);
    if (result == SPHPA_OK && run->sim.p.n != particles)
        return sphpa_error_set(err, SPHPA_ERROR_FORMAT,
                               "%s is of a run with %zu particles, not %zu; give the same --target",
                               path, run->sim.p.n, particles);
    if (result == SPHPA_OK)
        result = sphpa_checkpoint_blob(path, "start", &run->start, sizeof run->start, err);
    if (result == SPHPA_OK)
        result = sphpa_checkpoint_blob(path, "history", &history, sizeof history, err);
    if (result != SPHPA_OK) return result;
    if (run->sim.time > run->s.t_end * (1.0 + 1e-9))
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "%s is at t = %g s, beyond --t-end %g; give a later end, or begin "
                               "anew without --resume", path, run->sim.time, run->s.t_end);
    run->history = history;
    run->resumed = 1;
    run->steps_begun = run->sim.stats.steps;
    snprintf(run->checkpoint, sizeof run->checkpoint, "%s", path);
    if (!run->quiet)
        fprintf(stderr, "goes on from %s: t = %g s, %llu steps\n", path, run->sim.time,
                (unsigned long long)run->steps_begun);
    return SPHPA_OK;
#else
    (void)run;
    return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                           "--resume %s: this program was built without HDF5; install it (make "
                           "deps) and build again", path);
#endif
}

static sphpa_result impact_begin(impact_run *run, sphpa_error *err) {
    sphpa_particles bodies;
    sphpa_sim_options options;
    memset(&bodies, 0, sizeof bodies);
    memset(&options, 0, sizeof options);
    options.cfl = run->s.cfl;
    impact_materials(&run->scene, &run->s);
    impact_modules(&run->scene, &run->s);
    if (run->o->record != NULL)
        sphpa_scene_add(&run->scene.scene, impact_recorder_module(&run->recorder));
    sphpa_result result =
        impact_bodies(&bodies, &run->scene, &run->s, run->o->target_file, err);
    if (result == SPHPA_OK)
        result = sphpa_sim_create(&run->sim, &run->scene.scene, &bodies, &options, err);
    sphpa_particles_free(&bodies);
    if (result != SPHPA_OK) return result;
    run->start = sphpa_sim_totals(&run->sim);
    for (size_t i = 0; i < run->sim.p.n; i++)
        *(run->sim.p.body[i] == IMPACT_TARGET ? &run->target_mass : &run->projectile_mass) +=
            (double)run->sim.p.m[i];
    return SPHPA_OK;
}

static sphpa_result impact_create(impact_run *run, sphpa_error *err) {
    char path[EXAMPLE_PATH + 32];
    sphpa_result result = impact_begin(run, err);
    if (result != SPHPA_OK) return result;
    impact_resume_path(run, path);
    if (path[0] == '\0') return SPHPA_OK;
    result = impact_resume(run, path, err);
    if (result == SPHPA_OK || !run->o->scratch) return result;
    fprintf(stderr, "%s is not of this run: begins anew\n", path);
    sphpa_sim_free(&run->sim);
    run->target_mass = run->projectile_mass = 0.0;
    return impact_begin(run, err);
}

/* A checkpoint settles the simulation: neighbours come in another order, sums round differently.
   So that an interrupt leaves no trace in the bits, every run settles every few steps, and only
   there it can be interrupted. */
static sphpa_result impact_on_step(sphpa_sim *sim, void *user, sphpa_error *err) {
    impact_run *run = (impact_run *)user;
    if (sim->stats.steps % 10 == 0) impact_log_line(run->log, sim, &run->start);
    double pressure = 0.0;
    (void)impact_gauge(sim, &run->s, &pressure);
    fprintf(run->gauge, "%.9e %.6e\n", sim->time, pressure);
    if (!run->quiet)
        example_progress_show(&run->progress, sim->time / run->s.t_end, sim->time, sim->dt,
                              sim->stats.steps, sim->stats.steps * sim->p.n);
    if (sim->stats.steps % IMPACT_SETTLE != 0) return SPHPA_OK;
    run->stop = *run->asked;
    return sphpa_sim_settle(sim, err);
}

static sphpa_result impact_on_output(sphpa_sim *sim, void *user, sphpa_error *err) {
    impact_run *run = (impact_run *)user;
    impact_history *history = &run->history;
    if (history->count >= IMPACT_RECORDS)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "more than %d outputs; give a larger --every", IMPACT_RECORDS);
    sphpa_result result = impact_record_now(sim, &run->s, run->target_mass,
                                            &history->record[history->count], err);
    if (result != SPHPA_OK) return result;
    result = impact_write_state(run->out, history, sim, &run->s, run->o->snapshots, err);
    if (result != SPHPA_OK) return result;
    history->count++;
    if (fflush(run->log) != 0 || fflush(run->gauge) != 0 || ferror(run->log) || ferror(run->gauge))
        return sphpa_error_set(err, SPHPA_ERROR_FILE, "cannot write %s/log.txt or gauge.dat (%s); "
                               "is the disk full?", run->out, strerror(errno));
    return impact_checkpoint(run, err);
}

static void impact_open_logs(impact_run *run) {
    char path[EXAMPLE_PATH + 32];
    snprintf(path, sizeof path, "%s/log.txt", run->out);
    run->log = impact_reopen(path, run->resumed ? (double)run->sim.stats.steps : -1.0,
                             IMPACT_LOG_HEADER);
    snprintf(path, sizeof path, "%s/gauge.dat", run->out);
    run->gauge = impact_reopen(path, run->resumed ? run->sim.time : -1.0,
                               "# time[s] pressure[Pa] at the gauge: mean over the target's particles "
                               "that reach it, 0 where none does\n");
    double pressure = 0.0;
    if (!run->resumed && !impact_gauge(&run->sim, &run->s, &pressure))
        fprintf(stderr, "no particle is at the gauge (%g, %g, %g) m from the target's centre: it "
                "shows 0 until one comes\n", run->s.gauge[0], run->s.gauge[1], run->s.gauge[2]);
}

/* a run that was longer leaves outputs behind that this one does not write over */
static void impact_warn_of_others(const impact_run *run) {
    char name[64];
    int beyond = (int)ceil(run->s.t_end / run->s.every - 1e-9) + 1;
    snprintf(name, sizeof name, "cut_%04d.dat", beyond);
    if (impact_there(run->out, name))
        fprintf(stderr, "%s holds a longer run: its outputs from number %d on stay beside this "
                "one's 0 to %d; remove them, or choose another --out\n", run->out, beyond,
                beyond - 1);
}

static void impact_close_logs(impact_run *run) {
    if (run->log != NULL) fclose(run->log);
    if (run->gauge != NULL) fclose(run->gauge);
    run->log = run->gauge = NULL;
}

/* Runs to the end or to an interrupt. Files go to run->out. */
static sphpa_result impact_go(impact_run *run, sphpa_error *err) {
    sphpa_run plan;
    memset(&plan, 0, sizeof plan);
    plan.t_end = run->s.t_end;
    plan.every = run->s.every;
    plan.user = run;
    plan.output = impact_on_output;
    plan.step = impact_on_step;
    plan.stop = &run->stop;
    plan.resumed = run->resumed;
    run->asked = example_stop_on_interrupt();
    impact_open_logs(run);
    impact_warn_of_others(run);
    double since = example_clock();
    sphpa_result result = sphpa_sim_run(&run->sim, &plan, err);
    run->wall = example_clock() - since;
    example_progress_end(&run->progress);
    if (result == SPHPA_STOPPED) {
        sphpa_error why;
        if (impact_checkpoint(run, &why) != SPHPA_OK) fprintf(stderr, "%s\n", why.message);
    }
    impact_close_logs(run);
    return result;
}

static impact_run *impact_new(const impact_settings *s, const impact_options *o, const char *out) {
    impact_run *run = (impact_run *)calloc(1, sizeof *run);
    if (run == NULL) example_fail(1, "out of memory");
    run->s = *s;
    run->every_given = s->every > 0.0;
    if (!run->every_given) run->s.every = run->s.t_end / 20.0;
    if (run->s.t_end / run->s.every > IMPACT_RECORDS - 2.0)
        example_fail(2, "--every %g: %.3g outputs until --t-end %g, more than %d; give a larger "
                     "one", run->s.every, run->s.t_end / run->s.every, run->s.t_end,
                     IMPACT_RECORDS - 2);
    run->o = o;
    run->quiet = run->progress.quiet = o->quiet;
    snprintf(run->out, sizeof run->out, "%s", out);
    return run;
}

static void impact_free(impact_run *run) {
    sphpa_sim_free(&run->sim);
    free(run);
}

/* what a user reads when a run ends early; returns the exit status */
static int impact_explain(const impact_run *run, sphpa_result result, const sphpa_error *err) {
    const char *go_on = run->o->go_on != NULL ? run->o->go_on : run->checkpoint;
    fprintf(stderr, "pumice_impact: %s\n", err->message);
    if (!impact_has_hdf5())
        fprintf(stderr, "built without HDF5, so there is no checkpoint to go on from\n");
    else if (result == SPHPA_STOPPED && run->o->again)
        fprintf(stderr, "to go on, give the same command\n");
    else if (result == SPHPA_STOPPED && run->checkpoint[0] != '\0')
        fprintf(stderr, "to go on, give the same options and --resume %s\n", go_on);
    else if (run->checkpoint[0] != '\0')
        fprintf(stderr, "the last good checkpoint is %s\n", run->checkpoint);
    return result == SPHPA_STOPPED ? 130 : 1;
}

/* what a finished job no longer needs; its next run begins anew */
static void impact_drop_checkpoint(const char *out) {
    char path[EXAMPLE_PATH + 32];
    snprintf(path, sizeof path, "%s/checkpoint.hdf", out);
    (void)remove(path);
}

/* a run from beginning to end, on failure the program ends with its message */
static impact_run *impact_must_run(const impact_settings *s, const impact_options *o,
                                   const char *out) {
    sphpa_error err;
    impact_run *run = impact_new(s, o, out);
    example_folder(run->out);
    sphpa_result result = impact_create(run, &err);
    if (result != SPHPA_OK) example_fail(1, "%s", err.message);
    if (o->record != NULL) impact_recorder_open(&run->recorder, o->record, s->t_end, &run->scene);
    result = impact_go(run, &err);
    if (o->record != NULL && result == SPHPA_OK) example_close(&run->recorder.file);
    if (result == SPHPA_OK) return run;
    if (o->record != NULL) example_discard(&run->recorder.file);
    int status = impact_explain(run, result, &err);
    impact_free(run);
    exit(status);
}

/* ---- what is printed at the end -------------------------------------------------------------- */

static void impact_print_assumptions(impact_report *to, const impact_run *run) {
    const impact_settings *s = &run->s;
    const sphpa_material *pumice = &run->scene.material[IMPACT_TARGET];
    const sphpa_crush *crush = &run->scene.crush[IMPACT_TARGET];
    size_t projectile = 0;
    for (size_t i = 0; i < run->sim.p.n; i++) projectile += run->sim.p.body[i] == 1;
    double ratio = run->target_mass / (double)(run->sim.p.n - projectile) /
                   (run->projectile_mass / (double)projectile);
    say(to, "\nknown of the experiment: impact speed 2580 m/s (here %g), largest fragment 0.0996\n",
            s->speed);
    say(to, "assumed, for no source gives it:\n");
    say(to, "  projectile         nylon sphere of %g mm, %.4f g (the sister experiment's size)\n",
            1e3 * s->projectile_diameter, 1e3 * run->projectile_mass);
    if (run->o->target_file != NULL)
        say(to, "  target             %s, in a sphere of %g cm, %.4f kg\n", run->o->target_file,
                100.0 * s->target_diameter, run->target_mass);
    else
        say(to, "  target             sphere of %g cm, %.4f kg, %.1f kg/m3; hexagonal lattice, "
                "turned by seed %ld\n", 100.0 * s->target_diameter, run->target_mass,
                pumice->eos.rho0 / crush->alpha0, s->lattice_seed);
    say(to, "  impact angle       %g degrees from the normal\n", s->angle);
    say(to, "  crush curve        %s, alpha0 %g, Pe %g, Pt %g, Ps %g Pa: that it is this "
            "pumice's\n",
            s->curve == 0 ? "two exponents" : "quadratic", crush->alpha0, crush->Pe, crush->Pt,
            crush->Ps);
    say(to, "  matrix             K = A = %g Pa, G = %g Pa, Y = %g Pa, melts at %g J/kg\n",
            pumice->eos.A, pumice->G, pumice->Y, pumice->u_melt);
    say(to, "  flaws              Weibull k = %g m^-3, m = %g, of the solid volume; seed %ld\n",
            s->weibull_k, s->weibull_m, s->seed);
    say(to, "  nylon in tension   at most %g Pa; it has no flaws here\n", s->tension);
    say(to, "  nylon that spreads keeps neighbours until h is %g times its first\n", s->spread);
    say(to, "  viscosity          a = %g, b = %g, with the speed of the elastic wave; where pores "
            "begin\n                     to close nearer to that of the crushing wave\n",
            s->viscosity[0], s->viscosity[1]);
    say(to, "  between the bodies no tension, no shear; half a spacing at the start\n");
    say(to, "  fragments          linking length %g supports, particles with D < %g\n",
            s->link, s->damage_below);
    say(to, "  end time           %g s\n", s->t_end);
    say(to, "  particles          %zu + %zu; a target particle has %.1f times the mass of a "
            "projectile one\n", run->sim.p.n - projectile, projectile, ratio);
    if (ratio > 10.0)
        say(to, "  note: at this ratio nylon passes between the target's particles and the crater "
                "is not resolved;\n  more --particles cure that\n");
    if (s->curve == 1)
        say(to, "  note: the quadratic curve with the pumice's Pe and Ps is no fit of pumice: at a "
                "piston of 100 m/s\n  its shock pressure is 2.6 times that of the two-exponent "
                "fit\n");
}

static void impact_print_trend(impact_report *to, const impact_history *history) {
    impact_trend trend = impact_trend_of(history);
    double end = history->record[history->count - 1].time;
    if (trend.short_run)
        say(to, "  too short to tell whether this is the end of it: %g us, less than %g; give a "
                "larger --t-end\n", 1e6 * end, 1e6 * IMPACT_SHORTEST);
    else if (trend.few)
        say(to, "  too few outputs to tell whether this is the end of it: %d in the last %g us; "
                "give a smaller --every\n", trend.outputs, 1e6 * fmax(IMPACT_WINDOW, 0.2 * end));
    else
        say(to, "  %s: over the %d outputs of the last %g us it changed by %.4f, %s\n",
                trend.settled ? "settled" : "NOT SETTLED", trend.outputs, 1e6 * trend.span,
                trend.change,
                trend.settled ? "less than 0.01" : "not less than 0.01; give a larger --t-end");
    if (history->count > 1) say(to, "  the last two outputs differ by %.4f\n", trend.last_two);
}

static void impact_print_fragments(impact_report *to, const impact_run *run) {
    static const double links[3] = {0.5, 1.0, 1.5}, below[4] = {0.5, 0.7, 0.9, 0.99};
    const impact_history *history = &run->history;
    const impact_record *last = &history->record[history->count - 1];
    say(to, "\nlargest fragment: %.4f of the target's mass (experiment 0.0996, GASPHiA 0.0835)\n",
            last->largest);
    say(to, "\nlargest fragment over linking length (rows, in supports) and damage threshold\n");
    say(to, "         ");
    for (int k = 0; k < 4; k++) say(to, "  D < %-4g", below[k]);
    say(to, "\n");
    for (int r = 0; r < 3; r++) {
        say(to, "  %5.2f  ", links[r]);
        for (int k = 0; k < 4; k++)
            say(to, "  %8.4f", impact_largest(&run->sim, links[r], below[k], run->target_mass));
        say(to, "\n");
    }
    say(to, "\nlargest fragment over the last outputs\n  t [s]        largest   second    dust\n");
    int first = history->count > 5 ? history->count - 5 : 0;
    for (int k = first; k < history->count; k++)
        say(to, "  %.4e  %8.4f  %8.4f  %8.4f\n", history->record[k].time,
                history->record[k].largest, history->record[k].second, history->record[k].dust);
    say(to, "  over these outputs it went from %.4f to %.4f\n", history->record[first].largest,
            last->largest);
    impact_print_trend(to, history);
}

/* where the energy is: nylon that has run out of neighbours keeps its pressure, and does no work */
static void impact_print_energy(impact_report *to, const impact_run *run, const sphpa_totals *now) {
    const sphpa_particles *p = &run->sim.p;
    const sphpa_stats *stats = &run->sim.stats;
    double nylon = 0.0, lost = 0.0;
    size_t count = 0;
    for (size_t i = 0; i < p->n; i++) {
        if (p->body[i] != IMPACT_PROJECTILE) continue;
        double own = (double)p->m[i] * p->u[i];
        nylon += own;
        if ((double)p->h[i] < 0.999 * run->s.spread * (double)p->h0[i]) continue;
        lost += own;
        count++;
    }
    say(to, "  of the energy %.1f %% is kinetic, %.1f %% heat of nylon (%.1f %% in %zu particles "
            "that have spread to the bound)\n", 100.0 * now->kinetic / now->energy,
            100.0 * nylon / now->energy, 100.0 * lost / now->energy, count);
    if (stats->u_below > 0)
        say(to, "  the least u is %.3g J/kg, of particle %lld\n", stats->u_least,
                (long long)stats->u_id);
}

static void impact_print_conservation(impact_report *to, const impact_run *run) {
    sphpa_totals now = sphpa_sim_totals(&run->sim);
    const sphpa_totals *then = &run->start;
    const sphpa_pores_stats *pores = &run->scene.pores.stats;
    double push = run->projectile_mass * run->s.speed, p = 0.0, L = 0.0, L0 = 0.0;
    for (int a = 0; a < 3; a++) {
        p += (now.momentum[a] - then->momentum[a]) * (now.momentum[a] - then->momentum[a]);
        L += (now.angular[a] - then->angular[a]) * (now.angular[a] - then->angular[a]);
        L0 += then->angular[a] * then->angular[a];
    }
    L0 = fmax(sqrt(L0), push * 0.5 * run->s.projectile_diameter);
    say(to, "\ncrush curve: largest distance of a loading particle %.2e of alpha0 - 1 (%llu loaded "
            "steps)\n", pores->distance_max, (unsigned long long)pores->loading);
    say(to, "alpha grew: %llu particles\n", (unsigned long long)pores->grew);
    say(to, "drift of mass %.2e, of linear momentum %.2e of the projectile's,\n"
            "  of angular momentum about the centre of mass %.2e of %.2e kg m2/s,\n"
            "  of energy %.2e; internal energy below zero: %.2e of the total, in %llu particles\n",
            (now.mass - then->mass) / then->mass, sqrt(p) / push, sqrt(L) / L0, L0,
            (now.energy - then->energy) / then->energy, run->sim.stats.u_deficit / then->energy,
            (unsigned long long)run->sim.stats.u_below);
    impact_print_energy(to, run, &now);
}

static void impact_print_cost(impact_report *to, const impact_run *run) {
    static char text[16384];
    const sphpa_stats *stats = &run->sim.stats;
    double eos = 0.0, forces = 0.0, steps = stats->steps > 0 ? (double)stats->steps : 1.0;
    for (int k = 0; k < stats->timings; k++) {
        const char *name = stats->timing[k].name;
        if (strcmp(name, "pores pressure") == 0) eos += stats->timing[k].seconds;
        if (strcmp(name, "solid forces") == 0 || strcmp(name, "solid energy") == 0)
            forces += stats->timing[k].seconds;
    }
    sphpa_sim_report(&run->sim, text, sizeof text);
    say(to, "\n%s\n", text);
    say(to, "EOS %.3f ms a step, forces %.3f ms a step: %.1f %%; %.2f evaluations a P-alpha "
            "solve\n",
            1e3 * eos / steps, 1e3 * forces / steps, 100.0 * eos / (forces + 1e-300),
            (double)run->scene.pores.stats.evaluations /
                ((double)run->scene.pores.stats.solves + 1e-300));
    say(to, "%.3g particle updates a second on %d threads; peak memory %.1f MB\n",
            (double)run->sim.p.n * (double)(stats->steps - run->steps_begun) / (run->wall + 1e-9),
            example_threads(0),
            1e-6 * example_peak_memory());
}

static void impact_print(const impact_run *run, impact_report *to) {
    impact_print_assumptions(to, run);
    impact_print_conservation(to, run);
    impact_print_cost(to, run);
    impact_print_fragments(to, run);
    impact_tell(to, 0, run->out);
}

/* ---- what the program can be asked for ------------------------------------------------------- */

enum { IMPACT_SAMPLE = 20000 }; /* particles that are enough to find out what more would take */

/* What a run will take. */
typedef struct impact_cost {
    double particles, bytes, steps, each; /* [1] [1] [1] [s] of a step */
    int measured;                         /* steps that were made to find out */
    size_t sample;                        /* particles of them */
} impact_cost;

/* the settings of a sample; returns how many particles the run has, 0: as many as the sample */
static double impact_sample(const impact_settings *s, const impact_options *o,
                            impact_settings *sample) {
    double all = (double)s->particles + (double)s->projectile_particles;
    double times = all / IMPACT_SAMPLE;
    *sample = *s;
    if (o->target_file != NULL || times <= 1.0) return 0.0;
    sample->particles = (long)fmax(10.0, floor((double)s->particles / times));
    sample->projectile_particles = (long)fmax(10.0, floor((double)s->projectile_particles / times));
    return all;
}

/* the least h of all of a run's particles, from that of a sample's */
static double impact_least_h(const impact_run *sample, const impact_settings *s) {
    double share[IMPACT_BODIES] = {1.0, 1.0}, h = HUGE_VAL;
    share[IMPACT_TARGET] = (double)sample->s.particles / (double)s->particles;
    share[IMPACT_PROJECTILE] =
        (double)sample->s.projectile_particles / (double)s->projectile_particles;
    for (size_t i = 0; i < sample->sim.p.n; i++)
        h = fmin(h, (double)sample->sim.p.h[i] * cbrt(share[sample->sim.p.body[i]]));
    return h;
}

/* from a few steps of it, or of a sample of it; nothing is written */
static impact_cost impact_estimate(const impact_settings *s, const impact_options *o) {
    sphpa_error err;
    impact_cost cost;
    impact_settings sample;
    memset(&cost, 0, sizeof cost);
    cost.particles = impact_sample(s, o, &sample);
    impact_run *run = impact_new(&sample, o, o->out);
    if (impact_create(run, &err) != SPHPA_OK) example_fail(1, "%s", err.message);
    cost.sample = run->sim.p.n;
    if (cost.particles <= 0.0) cost.particles = (double)cost.sample;
    double since = example_clock(), times = cost.particles / (double)cost.sample;
    while (cost.measured < 5 || (example_clock() - since < 2.0 && cost.measured < 50)) {
        if (sphpa_sim_step(&run->sim, s->t_end, &err) != SPHPA_OK)
            example_fail(1, "%s", err.message);
        cost.measured++;
    }
    cost.each = times * (example_clock() - since) / cost.measured;
    /* shocked nylon: about 1.7 times its sound speed, and 0.3 of the impact's speed in mu */
    double c = 1.7 * sqrt(run->scene.material[1].eos.A / run->scene.material[1].eos.rho0);
    cost.steps =
        ceil(s->t_end / (0.8 * s->cfl * impact_least_h(run, s) / (2.2 * c + 2.4 * 0.3 * s->speed)));
    /* the fields twice, for the bodies come first; 650 bytes a particle of pair records, fragments
       and files; 10 MB of program and libraries: the peak of 20,000 to 150,000 particles to 15 % */
    cost.bytes = 1e7 + times * ((double)(2 * sphpa_particles_bytes_each(&run->sim.p) * cost.sample +
                                         sphpa_tree_bytes(&run->sim.tree) +
                                         sphpa_tree_lists_bytes(&run->sim.lists)) +
                                650.0 * (double)cost.sample);
    impact_free(run);
    return cost;
}

static int impact_dry_run(const impact_settings *s, const impact_options *o) {
    impact_options anew = *o;
    anew.resume = NULL;
    impact_cost cost = impact_estimate(s, &anew);
    double seconds = cost.steps * cost.each;
    printf("particles %.0f\nmemory    %.1f MB\nsteps     about %.0f\n", cost.particles,
           1e-6 * cost.bytes, cost.steps);
    printf("time      about %.0f s", seconds);
    if (seconds > 7200.0) printf(" (%.1f %s)", seconds / (seconds > 172800.0 ? 86400.0 : 3600.0),
                                 seconds > 172800.0 ? "days" : "hours");
    printf(" on %d threads, %.2f ms a step; measured over %d steps of %zu particles\n",
           example_threads(0), 1e3 * cost.each, cost.measured, cost.sample);
    return 0;
}

/* the run with both switches off, for the picture beside; smaller */
static void impact_compare(const impact_run *run, impact_report *to) {
    impact_settings s = run->s;
    impact_options o = *run->o;
    char out[EXAMPLE_PATH];
    if (o.compare_particles > 0 && o.compare_particles < s.particles)
        s.particles = o.compare_particles;
    s.correction = s.balsara = 0;
    o.record = NULL;
    o.resume = NULL; /* it is short, and made anew: the run before it is what a checkpoint is for */
    o.go_on = run->checkpoint;
    o.snapshots = 0;
    snprintf(out, sizeof out, "%.990s/both_off", run->out);
    if (!run->quiet) fprintf(stderr, "the same with correction and Balsara off, %ld particles\n",
                             s.particles);
    impact_run *off = impact_must_run(&s, &o, out);
    size_t before = to->length;
    say(to, "\nlargest fragment with correction and Balsara off, %ld particles: %.4f\n",
        s.particles, off->history.record[off->history.count - 1].largest);
    impact_tell(to, before, run->out);
    impact_draw_beside(run->out, &run->history, run->sim.p.n, &off->history, off->sim.p.n,
                       0.5 * s.target_diameter);
    impact_free(off);
}

static int impact_single(const impact_settings *s, const impact_options *o) {
    impact_run *run = impact_must_run(s, o, o->out);
    size_t fragments = impact_write_results(run->out, &run->history, &run->sim, &run->s,
                                            run->target_mass, &run->scene.crush[IMPACT_TARGET]);
    impact_report *report = (impact_report *)calloc(1, sizeof *report);
    if (report == NULL) example_fail(1, "out of memory");
    impact_print(run, report);
    impact_draw(run->out, &run->history, run->sim.p.n, &run->s, fragments);
    if (o->compare && (s->correction || s->balsara)) impact_compare(run, report);
    else if (impact_there(run->out, "beside.png"))
        fprintf(stderr, "%s/beside.png is of an earlier run; remove it, or choose another --out\n",
                run->out);
    free(report);
    impact_free(run);
    return 0;
}

static int impact_ensemble(const impact_settings *s, const impact_options *o) {
    double sum = 0.0, square = 0.0;
    printf("seed  largest  second   dust\n");
    for (long k = 0; k < o->ensemble; k++) {
        impact_settings own = *s;
        char out[EXAMPLE_PATH];
        own.seed = s->seed + k;
        snprintf(out, sizeof out, "%.980s/seed_%ld", o->out, own.seed);
        impact_run *run = impact_must_run(&own, o, out);
        const impact_record *last = &run->history.record[run->history.count - 1];
        printf("%4ld  %.4f   %.4f   %.4f\n", own.seed, last->largest, last->second, last->dust);
        fflush(stdout);
        sum += last->largest;
        square += last->largest * last->largest;
        impact_free(run);
    }
    double n = (double)o->ensemble, mean = sum / n;
    double spread = n > 1.0 ? sqrt(fmax(0.0, (square - n * mean * mean) / (n - 1.0))) : 0.0;
    printf("largest fragment: %.4f +- %.4f of the target's mass over %ld seeds (experiment 0.0996, "
           "GASPHiA 0.0835)\n", mean, spread, o->ensemble);
    return 0;
}

/* one row of the sensitivity table: what is changed, and by how much */
typedef struct impact_row {
    const char *name;
    double diameter, k, m, particles, projectile, viscosity; /* factors */
    long seed;
    int curve, off;
} impact_row;

static const impact_row impact_rows[] = {
    {"default", 1, 1, 1, 1, 1, 1, 0, 0, 0},
    {"target diameter x 0.6", 0.6, 1, 1, 1, 1, 1, 0, 0, 0},
    {"target diameter x 0.8", 0.8, 1, 1, 1, 1, 1, 0, 0, 0},
    {"target diameter x 1.2", 1.2, 1, 1, 1, 1, 1, 0, 0, 0},
    {"weibull k x 0.01", 1, 0.01, 1, 1, 1, 1, 0, 0, 0},
    {"weibull k x 100", 1, 100, 1, 1, 1, 1, 0, 0, 0},
    {"weibull m x 0.9", 1, 1, 0.9, 1, 1, 1, 0, 0, 0},
    {"weibull m x 1.1", 1, 1, 1.1, 1, 1, 1, 0, 0, 0},
    {"flaw seed + 1", 1, 1, 1, 1, 1, 1, 1, 0, 0},
    {"flaw seed + 2", 1, 1, 1, 1, 1, 1, 2, 0, 0},
    {"particles x 0.5", 1, 1, 1, 0.5, 1, 1, 0, 0, 0},
    {"particles x 2", 1, 1, 1, 2, 1, 1, 0, 0, 0},
    {"projectile particles x 5", 1, 1, 1, 1, 5, 1, 0, 0, 0},
    {"viscosity x 0.5", 1, 1, 1, 1, 1, 0.5, 0, 0, 0},
    {"viscosity x 0.15", 1, 1, 1, 1, 1, 0.15, 0, 0, 0},
    {"quadratic crush curve", 1, 1, 1, 1, 1, 1, 0, 1, 0},
    {"correction and Balsara off", 1, 1, 1, 1, 1, 1, 0, 0, 1}};
enum { IMPACT_ROWS = sizeof impact_rows / sizeof impact_rows[0] };

static impact_settings impact_row_settings(const impact_settings *s, const impact_row *row) {
    impact_settings own = *s;
    own.target_diameter *= row->diameter;
    own.weibull_k *= row->k;
    own.weibull_m *= row->m;
    own.particles = (long)((double)own.particles * row->particles);
    own.projectile_particles = (long)((double)own.projectile_particles * row->projectile);
    for (int k = 0; k < 2; k++) own.viscosity[k] *= row->viscosity;
    own.seed += row->seed;
    if (row->curve) own.curve = 1;
    if (row->off) own.correction = own.balsara = 0;
    return own;
}

/* how much work a row is beside the first: particles, and steps that get shorter with them */
static double impact_row_work(const impact_row *row) {
    return pow(row->particles, 4.0 / 3.0) * cbrt(row->projectile) / row->diameter;
}

/* says how long the rows will take that the table lacks; returns the work of them */
static double impact_sensitivity_left(const impact_table *table, const impact_settings *s,
                                      const impact_options *o) {
    double work = 0.0;
    int lacking = 0;
    for (int k = 0; k < IMPACT_ROWS; k++) {
        impact_settings own = impact_row_settings(s, &impact_rows[k]);
        if (impact_table_has(table, impact_rows[k].name, &own)) continue;
        work += impact_row_work(&impact_rows[k]);
        lacking++;
    }
    fprintf(stderr, "%d of %d runs are in %s\n", IMPACT_ROWS - lacking, (int)IMPACT_ROWS,
            o->sensitivity);
    if (lacking == 0) return 0.0;
    impact_options anew = *o;
    anew.resume = NULL;
    impact_cost cost = impact_estimate(s, &anew);
    fprintf(stderr, "about %.0f s for the other %d; stop it at any time: to go on, give the same "
            "%s\n", work * cost.steps * cost.each, lacking,
            o->again ? "command" : "options and --resume auto");
    return work;
}

/* runs what the table lacks; linking length and threshold are other readings of the same run */
static int impact_sensitivity(const impact_settings *s, const impact_options *o) {
    static const double links[3] = {0.5, 1.0, 1.5}, below[3] = {0.5, 0.9, 0.99};
    char out[EXAMPLE_PATH];
    impact_table *table = impact_table_open(o->sensitivity);
    double left = impact_sensitivity_left(table, s, o), done = 0.0, since = example_clock();
    for (int k = 0; k < IMPACT_ROWS; k++) {
        impact_settings own = impact_row_settings(s, &impact_rows[k]);
        if (impact_table_has(table, impact_rows[k].name, &own)) continue;
        if (done > 0.0)
            fprintf(stderr, "about %.0f s left\n", (example_clock() - since) / done * left);
        fprintf(stderr, "%s\n", impact_rows[k].name);
        snprintf(out, sizeof out, "%.980s/sensitivity_%d", o->out, k);
        impact_run *run = impact_must_run(&own, o, out);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                impact_table_add(table, impact_rows[k].name, &own, links[a], below[b],
                                 impact_largest(&run->sim, links[a], below[b], run->target_mass),
                                 &run->history);
        impact_table_save(table);
        impact_drop_checkpoint(out);
        impact_free(run);
        done += impact_row_work(&impact_rows[k]);
        left -= impact_row_work(&impact_rows[k]);
    }
    impact_table_print(table);
    free(table);
    return 0;
}

/* two runs, correction and Balsara on and off, as one animated picture */
static int impact_movie(const impact_settings *s, const impact_options *o) {
    impact_settings own = *s;
    char on[EXAMPLE_PATH], off[EXAMPLE_PATH];
    if (!example_have_gnuplot())
        example_fail(1, "--movie %s: no gnuplot here to draw it; install it (make deps) and give "
                        "the same command", o->movie);
    own.every = own.t_end / 50.0;
    (void)impact_split(o->movie, on);
    example_folder_of(on, "--movie");
    snprintf(on, sizeof on, "%.990s/movie_on", o->out);
    snprintf(off, sizeof off, "%.990s/movie_off", o->out);
    fprintf(stderr, "correction and Balsara on\n");
    impact_run *run = impact_must_run(&own, o, on);
    int frames = run->history.count;
    size_t particles = run->sim.p.n;
    impact_free(run);
    own.correction = own.balsara = 0;
    fprintf(stderr, "correction and Balsara off\n");
    run = impact_must_run(&own, o, off);
    impact_free(run);
    if (!impact_draw_movie(o->movie, on, off, frames, own.every, 0.5 * own.target_diameter,
                           particles))
        return 1;
    impact_drop_checkpoint(on);
    impact_drop_checkpoint(off);
    return 0;
}

/* said before the run, not after it */
static void impact_check_file(const char *option, const char *path) {
    if (path == NULL) return;
    size_t length = strlen(path);
    if (length == 0 || path[length - 1] == '/' || example_is_special_(path))
        example_fail(2, "--%s %s: give the name of a file, not of a folder or a device", option, path);
}

/* what the options mean only together */
static void impact_check(const impact_settings *s, const impact_options *o) {
    const char *many = o->sensitivity != NULL ? "--sensitivity" : o->movie != NULL ? "--movie"
                       : o->ensemble > 0 ? "--ensemble" : NULL;
    size_t length = o->movie != NULL ? strlen(o->movie) : 0;
    if (strlen(o->out) > 960)
        example_fail(2, "--out %.60s...: give a name of at most 960 characters", o->out);
    if ((o->sensitivity != NULL) + (o->movie != NULL) + (o->ensemble > 0) > 1)
        example_fail(2, "--sensitivity, --movie and --ensemble are jobs of their own; give one");
    if (many != NULL && o->resume != NULL && strcmp(o->resume, "auto") != 0)
        example_fail(2, "--resume %s: with %s, which makes several runs, give --resume auto",
                     o->resume, many);
    if (o->record != NULL && (many != NULL || o->resume != NULL))
        example_fail(2, "--record-states %s: of one run from its beginning; leave %s out",
                     o->record, many != NULL ? many : "--resume");
    impact_check_file("record-states", o->record);
    impact_check_file("sensitivity", o->sensitivity);
    if (o->sensitivity != NULL && o->target_file != NULL)
        example_fail(2, "--target %s: --sensitivity varies the sphere; leave one of them out",
                     o->target_file);
    if (o->movie != NULL && (length < 5 || strcmp(o->movie + length - 4, ".gif") != 0 ||
                             o->movie[length - 5] == '/' || strchr(o->movie, '\'') != NULL))
        example_fail(2, "--movie %s: give a name that ends in .gif, without quotes", o->movie);
    if (s->projectile_diameter > 10.0 * s->target_diameter && o->target_file == NULL)
        example_fail(2, "--projectile-diameter %g: more than ten targets of %g m wide; mend one",
                     s->projectile_diameter, s->target_diameter);
}

static void impact_parse(int argc, char **argv, impact_settings *s, impact_options *o) {
    const example_option options[] = {
        example_count("particles", &s->particles, 10, 100000000, "of the target"),
        example_count("projectile-particles", &s->projectile_particles, 10, 10000000,
                      "of the projectile"),
        example_number("speed", "m/s", &s->speed, 1.0, 1e5, "of the projectile"),
        example_number("angle", "deg", &s->angle, 0.0, 89.0, "of the impact, from the normal"),
        example_number("target-diameter", "m", &s->target_diameter, 1e-6, 1e7, "of the sphere"),
        example_number("projectile-diameter", "m", &s->projectile_diameter, 1e-6, 1e7,
                       "of the sphere"),
        example_choice("curve", IMPACT_CURVES, &s->curve, "crush curve of the pumice"),
        example_choice("solver", IMPACT_SOLVERS, &s->solver,
                       "of the P-alpha equation; newton fails"),
        example_number("weibull-k", "m^-3", &s->weibull_k, 0.0, 1e300, "flaws: k eps^m a volume"),
        example_number("weibull-m", "1", &s->weibull_m, 1.0, 100.0, "their exponent"),
        example_count("seed", &s->seed, 0, 1000000000, "of the flaws"),
        example_count("lattice-seed", &s->lattice_seed, 0, 1000000000, "turns the lattices"),
        example_count("ensemble", &o->ensemble, 0, 10000, "so many seeds: mean and spread"),
        example_switch("correction", &s->correction, "of the kernel's gradient"),
        example_switch("balsara", &s->balsara, "no shear viscosity"),
        example_number("tension", "Pa", &s->tension, 0.0, 1e12, "that nylon bears"),
        example_number("spread", "1", &s->spread, 1.0, 100.0,
                       "largest h of nylon over its first one"),
        example_vector("viscosity", "a,b", s->viscosity, 2, 0.0, 1000.0,
                       "linear and quadratic, artificial"),
        example_number("cfl", "1", &s->cfl, 1e-3, 1.0, "Courant number"),
        example_number("t-end", "s", &s->t_end, 1e-12, 1e6, "end of the run"),
        example_number("every", "s", &s->every, 0.0, 1e6, "between outputs; 0: 20 of them"),
        example_vector("gauge", "x,y,z", s->gauge, 3, -1e8, 1e8,
                       "[m] mean pressure of the target there"),
        example_number("link", "1", &s->link, 0.01, 10.0, "fragments: linking length, in supports"),
        example_number("damage-below", "1", &s->damage_below, 0.0, 1.0, "fragments: particles' D"),
        example_text("target", "FILE.hdf", &o->target_file, "a snapshot as the target"),
        example_text("out", "DIR", &o->out, "where files and pictures go"),
        example_text("resume", "FILE|auto", &o->resume, "go on from a checkpoint; auto: if there"),
        example_count("threads", &o->threads, 0, 4096, "0: as many as there are"),
        example_switch("compare", &o->compare, "also run with correction and Balsara off"),
        example_count("compare-particles", &o->compare_particles, 0, 100000000,
                      "of that run, at most; 0: as many"),
        example_switch("snapshots", &o->snapshots, "write them"),
        example_text("sensitivity", "FILE.csv", &o->sensitivity, "run the table of assumptions"),
        example_text("movie", "FILE.gif", &o->movie, "run on beside off, as a movie"),
        example_text("record-states", "FILE", &o->record,
                     "rho, u, alpha_old of P-alpha solves, for make bench-eos"),
        example_flag("dry-run", &o->dry_run, "memory, steps and time only"),
        example_flag("quiet", &o->quiet, "no progress on stderr")};
    int count = (int)(sizeof options / sizeof options[0]);
    example_parse(argc, argv, "a nylon sphere breaks a porous pumice target", SPHPA_VERSION,
                  options, count);
}

int main(int argc, char **argv) {
    impact_settings s = impact_default_settings();
    impact_options o;
    memset(&o, 0, sizeof o);
    o.compare = o.snapshots = 1;
    o.compare_particles = 1500;
    o.out = "build/impact";
    impact_parse(argc, argv, &s, &o);
    example_threads(o.threads);
    impact_check(&s, &o);
    if (!impact_has_hdf5())
        fprintf(stderr, "built without HDF5: plain text output, no checkpoints\n");
    bool one = o.sensitivity == NULL && o.movie == NULL && o.ensemble == 0;
    if (!one) o.go_on = "auto"; /* each run has a folder of its own */
    o.again = o.resume != NULL && strcmp(o.resume, "auto") == 0;
    o.scratch = o.sensitivity != NULL || o.movie != NULL;
    if (o.scratch) o.snapshots = 0;
    int status = o.dry_run               ? impact_dry_run(&s, &o)
                 : o.sensitivity != NULL ? impact_sensitivity(&s, &o)
                 : o.movie != NULL       ? impact_movie(&s, &o)
                 : one                   ? impact_single(&s, &o)
                                         : impact_ensemble(&s, &o);
    if (fflush(stdout) != 0 || ferror(stdout))
        example_fail(1, "cannot write to standard output (%s)", strerror(errno));
    return status;
}
