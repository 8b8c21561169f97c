/* crush_cube: a cube of porous pumice is squeezed, let go and squeezed again, slowly, and every
   particle is followed over the crush curve.

   Slowly, without waiting for sound to cross it thousands of times: the motion is prescribed. The
   pass below takes the place of the solid's forces and gives each particle the acceleration that
   keeps v = rate x, a press that holds every grain and not the faces alone. All else is the scene's
   own: velocity gradients from the neighbours, density, P-alpha, heat. Inside the cube the strain
   is the same everywhere (the corrected gradient is exact for v = rate x); the eight corners have
   neighbours in one octant only, are strained less, and serve as other points on the curve. */
#include "example.h"

#define SPHPA_PORES_IMPLEMENTATION
#define SPHPA_SETUP_IMPLEMENTATION
#include "sphpa.h"

typedef struct press {
    double rate; /* [1/s] v = rate x; a step's strain is all that matters */
} press;

/* the acceleration that leads to v = rate x at the end of the step; x is that of its middle */
static sphpa_result hold(sphpa_sim *sim, void *params, size_t first, size_t last, size_t *bad) {
    double rate = ((const press *)params)->rate, dt = sim->dt;
    (void)bad;
    if (!(dt > 0.0)) return SPHPA_OK;
    for (size_t k = 3 * first; k < 3 * last; k++) {
        double v = (double)sim->p.start.v[k];
        double goal = rate * sim->p.x[k] / (1.0 - 0.5 * dt * rate);
        sim->p.a[k] = (sphpa_real)((goal - v) / dt);
    }
    return SPHPA_OK;
}

static sphpa_module press_module(press *params) {
    sphpa_module module = {0};
    module.name = "press";
    module.params = params;
    module.passes = 1;
    module.pass[0].name = "press motion";
    module.pass[0].replaces = "solid forces";
    module.pass[0].stage = SPHPA_STAGE_FORCES;
    module.pass[0].writes = SPHPA_F(a) | SPHPA_F(mu_max);
    module.pass[0].particle = hold;
    return module;
}

/* What is watched from step to step; arrays of (n) by the particles' id. */
typedef struct watch {
    double *alpha, *P;    /* before the last step; at the point where the release began */
    double above, away;   /* largest distance above the curve, ever; below it, while loading */
    double retraced;      /* largest |P| amiss after release and reload, over what was let go */
    int64_t centre;       /* id of the particle nearest to the centre */
    double P_centre, alpha_centre;
    size_t grew;          /* steps of particles in which alpha grew */
    example_file path, points;
    const sphpa_crush *crush;
    const char *phase;
} watch;

static void look(const sphpa_sim *sim, watch *w, int loading) {
    for (size_t i = 0; i < sim->p.n; i++) {
        double now = sim->p.alpha[i], P = (double)sim->p.P[i];
        double off = now - sphpa_crush_alpha(w->crush, P, NULL);
        double *before = &w->alpha[sim->p.id[i]];
        if (now > *before) w->grew++;
        w->above = off > w->above ? off : w->above;
        if (loading && now < *before && -off > w->away) w->away = -off;
        *before = now;
        if (sim->p.id[i] != w->centre) continue;
        w->P_centre = P;
        w->alpha_centre = now;
        fprintf(w->path.stream, "%.9g %.9g %.9g %s\n", w->P_centre, now, sim->p.rho[i], w->phase);
    }
}

/* `steps` steps of strain d(ln volume) each */
static void squeeze(sphpa_sim *sim, press *params, watch *w, const char *phase, double strain,
                    long steps) {
    sphpa_error err;
    w->phase = phase;
    params->rate = strain / (3.0 * sim->options.dt_fixed);
    for (size_t k = 0; k < 3 * sim->p.n; k++)
        sim->p.v[k] = (sphpa_real)(params->rate * sim->p.x[k]);
    for (long step = 0; step < steps; step++) {
        if (sphpa_sim_step(sim, HUGE_VAL, &err) != SPHPA_OK) {
            example_discard(&w->path);
            example_discard(&w->points);
            example_fail(1, "%s", err.message);
        }
        look(sim, w, strain < 0.0);
    }
    for (size_t i = 0; i < sim->p.n; i++)
        fprintf(w->points.stream, "%.9g %.9g\n", (double)sim->p.P[i], sim->p.alpha[i]);
}

/* Down the elastic line by nine tenths of the pressure, up again, where P must be what it was, and
   down: with FLAT alpha stands still, dP/dln rho is about A/alpha. */
static void release(sphpa_sim *sim, press *params, watch *w, double A, long steps) {
    double strain = 0.9 * w->P_centre * w->alpha_centre / A / (double)steps, most = 0.0;
    for (size_t i = 0; i < sim->p.n; i++) w->P[sim->p.id[i]] = (double)sim->p.P[i];
    squeeze(sim, params, w, "release", strain, steps);
    double fall = w->P[w->centre] - w->P_centre;
    squeeze(sim, params, w, "reload", -strain, steps);
    for (size_t i = 0; i < sim->p.n; i++)
        most = fmax(most, fabs((double)sim->p.P[i] - w->P[sim->p.id[i]]));
    w->retraced = fmax(w->retraced, most / fall);
    squeeze(sim, params, w, "release", strain, steps);
}

static int64_t nearest_to_centre(const sphpa_particles *p) {
    size_t best = 0;
    double least = HUGE_VAL;
    for (size_t i = 0; i < p->n; i++) {
        const double *x = p->x + 3 * i;
        double r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
        if (r2 < least) least = r2, best = i;
    }
    return p->id[best];
}

/* the exact curve, for the picture */
static void write_curve(const char *out, const sphpa_crush *crush) {
    example_file file = example_open(out, "curve.dat");
    fprintf(file.stream, "# P[Pa] alpha\n");
    for (int k = 0; k <= 1000; k++) {
        double P = 1.1 * crush->Ps * k / 1000.0;
        fprintf(file.stream, "%.9g %.9g\n", P, sphpa_crush_alpha(crush, P, NULL));
    }
    example_close(&file);
}

static const char *picture =
    "set multiplot layout 1,2 title 'porous pumice squeezed slowly, let go and squeezed again'\n"
    "set xlabel 'pressure [MPa]'\nset ylabel 'distention alpha'\nset grid lc rgb '#dddddd'\n"
    "set yrange [0.9:*]\nset key top right\n"
    "do for [k=1:2] {\n"
    "if (k == 2) { set logscale x; set xrange [0.05:*]; set key bottom left }\n"
    "plot 'curve.dat' using (1e-6*$1):2 with lines lw 5 lc rgb '#f0c8a0' title 'crush curve', \\\n"
    "     'path.dat' using (1e-6*$1):2 with lines lw 1.5 lc rgb '#444444' title 'the centre', \\\n"
    "     'points.dat' using (1e-6*$1):2 with points pt 7 ps 0.5 lc rgb '#1f5fa8' "
    "title 'particles'\n}\n"
    "unset multiplot\n";

int main(int argc, char **argv) {
    int kind = 0, solver = 0, integrator = 0;
    long edge = 10, cycles = 4, steps = 50, threads = 0;
    const char *out = "build/crush_cube";
    const example_option options[] = {
        example_choice("curve", "two-exponent|quadratic", &kind, "crush curve of the pumice"),
        example_count("edge", &edge, 4, 200, "particles along an edge of the cube"),
        example_count("cycles", &cycles, 1, 100, "loads, each followed by a release"),
        example_count("steps", &steps, 4, 100000, "of one load"),
        example_choice("solver", "crush-space|bisection|newton|safe-newton", &solver,
                       "of the implicit step"),
        example_choice("integrator", "pc|rk2", &integrator, "predictor-corrector or Runge-Kutta"),
        example_count("threads", &threads, 0, 4096, "0: all"),
        example_text("out", "FOLDER", &out, "for the data and crush_cube.png"),
    };
    example_parse(argc, argv, "a porous cube over its crush curve", SPHPA_VERSION, options,
                  (int)(sizeof options / sizeof options[0]));
    example_folder(out);
    (void)example_threads(threads);

    const sphpa_tillotson *matrix = sphpa_tillotson_find("pumice");
    sphpa_crush crush = sphpa_crush_pumice();
    if (kind == 1) crush = sphpa_crush_quadratic(crush.alpha0, crush.Pe, crush.Ps);
    sphpa_solid_material pumice = {0};
    pumice.eos = sphpa_tillotson_eos(matrix);
    sphpa_solid_params solid = {0};
    solid.material = &pumice;
    solid.materials = 1;
    solid.correction = 1;
    solid.viscosity.a = solid.viscosity.b = -1.0; /* none: nothing is sudden here */
    sphpa_pores_params pores = {0};
    pores.solid = &solid;
    pores.crush = &crush;
    pores.matrix = &matrix;
    pores.solver = (sphpa_palpha_solver)solver;
    press params = {0};

    sphpa_error err;
    sphpa_particles p = {0};
    sphpa_body body = {0};
    const double low[3] = {-0.5, -0.5, -0.5}, high[3] = {0.5, 0.5, 0.5};
    body.rho = matrix->rho0 / crush.alpha0;
    body.alpha = crush.alpha0;
    body.spacing = 1.0 / (double)edge;
    sphpa_sim_options sim_options = {0};
    sim_options.dt_fixed = 1.0; /* there are no waves: time is only a count of steps */
    sim_options.integrator = (sphpa_integrator)integrator;
    sphpa_scene scene = {0};
    static sphpa_sim sim;
    sphpa_result result = sphpa_make_box(&p, low, high, &body, &err);
    if (result == SPHPA_OK) result = sphpa_scene_add(&scene, sphpa_solid(&solid));
    if (result == SPHPA_OK) result = sphpa_scene_add(&scene, sphpa_pores(&pores));
    if (result == SPHPA_OK) result = sphpa_scene_add(&scene, press_module(&params));
    if (result == SPHPA_OK) result = sphpa_sim_create(&sim, &scene, &p, &sim_options, &err);
    if (result != SPHPA_OK) example_fail(1, "%s", err.message);

    watch w = {0};
    w.crush = &crush;
    w.centre = nearest_to_centre(&sim.p);
    w.alpha = malloc(sim.p.n * sizeof *w.alpha);
    w.P = malloc(sim.p.n * sizeof *w.P);
    if (w.alpha == NULL || w.P == NULL) example_fail(1, "out of memory; lower --edge");
    for (size_t i = 0; i < sim.p.n; i++) w.alpha[sim.p.id[i]] = crush.alpha0;
    w.path = example_open(out, "path.dat");
    w.points = example_open(out, "points.dat");
    fprintf(w.path.stream, "# at the centre: P[Pa] alpha rho[kg/m3] phase\n");
    fprintf(w.points.stream, "# particles at the ends of the phases: P[Pa] alpha\n");
    double all = log(crush.alpha0); /* closes all pores, for heat holds up what pressure does not */
    for (long k = 0; k < cycles; k++) {
        squeeze(&sim, &params, &w, "load", -all / (double)(cycles * steps), steps);
        release(&sim, &params, &w, matrix->A, 10);
    }
    example_close(&w.path);
    example_close(&w.points);
    write_curve(out, &crush);

    double room = crush.alpha0 - 1.0;
    printf("# %zu particles, %s curve, %llu steps, alpha at the centre from %g to %g\n", sim.p.n,
           kind ? "quadratic" : "two-exponent", (unsigned long long)sim.stats.steps, crush.alpha0,
           w.alpha_centre);
    printf("largest distance of a loading particle from the curve   %.3e of alpha0 - 1\n",
           pores.stats.distance_max);
    printf("largest distance below the curve while loading          %.3e of alpha0 - 1\n",
           w.away / room);
    printf("largest distance above the curve, ever                  %.3e of alpha0 - 1\n",
           w.above / room);
    printf("particles' steps in which alpha grew                    %zu\n", w.grew);
    printf("release and reload: pressure comes back within          %.3e of its fall\n",
           w.retraced);
    printf("equations of state per solve                            %.2f\n",
           (double)pores.stats.evaluations / (double)pores.stats.solves);
    (void)example_picture(out, "crush_cube.png", 1200, 500, picture);
    free(w.alpha);
    free(w.P);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return 0;
}
