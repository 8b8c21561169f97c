/* bench_scenes.h: the scenes that bench_sph.c and leave_out.c time. Each is a whole simulation: its
   materials and parameters live beside it and must stay where they are. A program with one of them
   alone defines SCENE_ONLY to its number: the compiler then drops what the others need. */
#ifndef BENCH_SCENES_H
#define BENCH_SCENES_H

enum { SCENE_GAS = 0, SCENE_ELASTIC, SCENE_SOLID, SCENE_PUMICE, SCENE_GSPH, SCENE_ADKE, SCENE_MPM,
       SCENE_KINDS, SCENE_BODIES = 2 };

static const char *const scene_names[SCENE_KINDS] = {"gas", "elastic", "solid", "pumice", "gsph",
                                                     "adke", "mpm"};

typedef struct bench_scene {
    int kind;
    sphpa_ideal ideal;
    sphpa_eos eos;
    sphpa_gas_params gas;
    sphpa_godunov_params godunov;
    sphpa_crush crush[SCENE_BODIES];
    const sphpa_tillotson *matrix[SCENE_BODIES];
    sphpa_solid_material material[SCENE_BODIES];
    sphpa_yield yield[SCENE_BODIES];
    sphpa_cracks_material flaws[SCENE_BODIES];
    sphpa_solid_params solid;
    sphpa_pores_params pores;
    sphpa_plastic_params plastic;
    sphpa_cracks_params cracks;
    sphpa_scene scene;
    sphpa_sim sim;
    double energy; /* [J] at the start */
} bench_scene;

static inline int scene_kind(const bench_scene *s) {
#ifdef SCENE_ONLY
    (void)s;
    return SCENE_ONLY;
#else
    return s->kind;
#endif
}

static inline void scene_stop_if(sphpa_result result, const sphpa_error *err) {
    if (result != SPHPA_OK) example_fail(1, "%s", err->message);
}

/* h in units of the spacing that gives so many neighbours within 2h in 3-D */
static inline double scene_eta(double neighbours) {
    return 0.5 * cbrt(0.75 * neighbours / 3.14159265358979324);
}

/* ---- a gas in a periodic box ----------------------------------------------------------------- */

/* A cubic lattice, every point moved at random by up to a fifth of the spacing, and a smooth
   vortex (Taylor & Green 1937) of Mach 0.3: pressure noise and shear, but no waste of neighbours. */
static void scene_gas_particles(sphpa_particles *p, long side, double neighbours,
                                double sound_speed) {
    const double two_pi = 6.28318530717958648, low[3] = {0.0, 0.0, 0.0}, high[3] = {1.0, 1.0, 1.0};
    sphpa_body body;
    sphpa_error err;
    sphpa_rng rng = sphpa_rng_seed(1, 0);
    memset(&body, 0, sizeof body);
    body.rho = 1.0;
    body.u = sound_speed * sound_speed * 0.9; /* c2 = gamma (gamma - 1) u */
    body.spacing = 1.0 / (double)side;
    body.eta = scene_eta(neighbours);
    scene_stop_if(sphpa_make_begin(p, 3, &err), &err);
    scene_stop_if(sphpa_make_box(p, low, high, &body, &err), &err);
    for (size_t i = 0; i < p->n; i++) {
        double *x = p->x + 3 * i;
        for (int a = 0; a < 3; a++)
            x[a] += 0.4 * body.spacing * (sphpa_rng_uniform(&rng) - 0.5);
        double speed = 0.3 * sound_speed;
        p->v[3 * i] = (sphpa_real)(speed * sin(two_pi * x[0]) * cos(two_pi * x[1]));
        p->v[3 * i + 1] = (sphpa_real)(-speed * cos(two_pi * x[0]) * sin(two_pi * x[1]));
    }
}

static void scene_gas(bench_scene *s, sphpa_particles *p, long side, double neighbours,
                      sphpa_sim_options *options) {
    s->ideal.gamma = 5.0 / 3.0;
    s->eos = sphpa_ideal_eos(&s->ideal);
    s->gas.eos = &s->eos;
    s->gas.materials = 1;
    s->gas.eta = scene_eta(neighbours);
    sphpa_scene_add(&s->scene, sphpa_gas(&s->gas));
    for (int a = 0; a < 3; a++) options->box.periodic[a] = 1, options->box.high[a] = 1.0;
    scene_gas_particles(p, side, neighbours, 1.0);
}

/* ---- a blast in a periodic square ------------------------------------------------------------ */

/* A square lattice, every point moved at random by up to a tenth of the spacing, the vortex above,
   and in a tenth of the area a charge of a hundred times the pressure: no pair is at rest, so no
   Riemann problem is easy. Schemes for strong shocks, a Gaussian, exact Riemann problems, and the
   conduction that blasts are run with. */
static void scene_blast_particles(sphpa_particles *p, long side, double eta) {
    const double two_pi = 6.28318530717958648, low[3] = {0.0, 0.0, 0.0}, high[3] = {1.0, 1.0, 0.0};
    sphpa_body body;
    sphpa_error err;
    sphpa_rng rng = sphpa_rng_seed(1, 0);
    memset(&body, 0, sizeof body);
    body.rho = 1.0;
    body.u = 1.0 / (1.4 * 0.4); /* a sound speed of 1 */
    body.spacing = 1.0 / (double)side;
    body.eta = eta;
    scene_stop_if(sphpa_make_begin(p, 2, &err), &err);
    scene_stop_if(sphpa_make_box(p, low, high, &body, &err), &err);
    for (size_t i = 0; i < p->n; i++) {
        double *x = p->x + 3 * i;
        for (int a = 0; a < 2; a++)
            x[a] += 0.2 * body.spacing * (sphpa_rng_uniform(&rng) - 0.5);
        p->v[3 * i] = (sphpa_real)(0.3 * sin(two_pi * x[0]) * cos(two_pi * x[1]));
        p->v[3 * i + 1] = (sphpa_real)(-0.3 * cos(two_pi * x[0]) * sin(two_pi * x[1]));
        if (hypot(x[0] - 0.5, x[1] - 0.5) < 0.178) p->u[i] *= 100.0;
    }
}

static void scene_blast(bench_scene *s, sphpa_particles *p, long side, double neighbours,
                        sphpa_sim_options *options) {
    double eta = sqrt(neighbours / 3.14159265358979324) / 3.0;
    s->ideal.gamma = 1.4;
    s->eos = sphpa_ideal_eos(&s->ideal);
    s->godunov.gas.eos = &s->eos;
    s->godunov.gas.materials = 1;
    s->godunov.gas.eta = eta;
    s->godunov.g1 = scene_kind(s) == SCENE_MPM ? 0.0 : 0.25;
    s->godunov.g2 = 2.0 * s->godunov.g1;
    sphpa_godunov_params *params = &s->godunov;
    if (scene_kind(s) == SCENE_GSPH) sphpa_scene_add(&s->scene, sphpa_godunov(params));
    else if (scene_kind(s) == SCENE_ADKE) sphpa_scene_add(&s->scene, sphpa_godunov_adke(params));
    else sphpa_scene_add(&s->scene, sphpa_godunov_mpm(params));
    for (int a = 0; a < 2; a++) options->box.periodic[a] = 1, options->box.high[a] = 1.0;
    options->kernel = SPHPA_KERNEL_GAUSSIAN;
    scene_blast_particles(p, side, eta);
}

/* ---- impacts --------------------------------------------------------------------------------- */

/* what an impact differs in from another */
typedef struct scene_impact {
    const char *name[SCENE_BODIES]; /* materials of target and projectile */
    double diameter[SCENE_BODIES];  /* [m] */
    double speed, angle;            /* [m/s]; [rad] from the vertical */
    double distance;                /* [m] of the centres */
} scene_impact;

static const scene_impact scene_basalt = {
    {"basalt", "basalt"}, {5000.0, 1000.0}, 5000.0, 0.78539816339744831, 3020.0};
static const scene_impact scene_porous = {
    {"pumice", "nylon"}, {0.1, 7e-3}, 2580.0, 0.0, 0.0535};

/* Both bodies' particles have one volume in the basalt impact; pumice's projectile is finer, or it
   would have next to none. They are moved by up to a tenth of the spacing: on the lattice itself the
   number of neighbours jumps from 54 to 78 where a shell comes within the support. Some more of
   them are asked for inside, since those at surfaces have fewer. */
static void scene_bodies(bench_scene *s, const scene_impact *impact, sphpa_particles *p, long n,
                         double neighbours) {
    double centre[3] = {0.0, 0.0, 0.0}, share = pow(impact->diameter[1] / impact->diameter[0], 3.0);
    sphpa_body body;
    sphpa_error err;
    sphpa_rng rng = sphpa_rng_seed(1, 1);
    memset(&body, 0, sizeof body);
    body.eta = scene_eta(1.13 * neighbours);
    body.lattice = SPHPA_LATTICE_HEXAGONAL;
    if (scene_kind(s) == SCENE_PUMICE) share = fmax(share, 0.005);
    for (int k = 0; k < SCENE_BODIES; k++) {
        body.alpha = scene_kind(s) == SCENE_PUMICE && k == 0 ? s->crush[0].alpha0 : 1.0;
        body.rho = s->matrix[k]->rho0 / body.alpha;
        body.count = (size_t)((double)n * (k == 0 ? 1.0 : share) / (1.0 + share));
        body.seed = (uint64_t)k + 1u;
        body.material = body.body = k;
        size_t before = p->n;
        scene_stop_if(sphpa_make_sphere(p, centre, 0.5 * impact->diameter[k], &body, &err), &err);
        for (size_t i = before; i < p->n; i++)
            for (size_t a = 0; a < 3; a++)
                p->x[3 * i + a] += 0.2 * cbrt((double)p->m[i] / body.rho) *
                                   (sphpa_rng_uniform(&rng) - 0.5);
        centre[0] = impact->distance * sin(impact->angle);
        centre[2] = impact->distance * cos(impact->angle);
        body.v[2] = -impact->speed;
    }
}

static void scene_materials(bench_scene *s, const scene_impact *impact) {
    for (int k = 0; k < SCENE_BODIES; k++) {
        const sphpa_material *material = sphpa_material_find(impact->name[k]);
        s->matrix[k] = &material->eos;
        s->material[k].eos = sphpa_tillotson_eos(&material->eos);
        s->material[k].G = material->G;
        s->yield[k].kind = SPHPA_YIELD_VON_MISES;
        s->yield[k].Y0 = material->Y;
        s->yield[k].u_melt = material->u_melt;
        s->crush[k].alpha0 = 1.0;
        if (strcmp(impact->name[k], "nylon") == 0) continue; /* it has no flaws */
        s->flaws[k].k = 4e35;
        s->flaws[k].m = 9.0;
    }
    if (scene_kind(s) != SCENE_PUMICE) return;
    s->crush[0] = sphpa_crush_pumice();
    s->flaws[0].alpha0 = s->crush[0].alpha0;
    s->material[1].h_max = 5.0;
}

static void scene_modules(bench_scene *s) {
    bool all = scene_kind(s) == SCENE_PUMICE;
    s->solid.material = s->material;
    s->solid.materials = SCENE_BODIES;
    s->solid.correction = s->solid.viscosity.balsara = all;
    sphpa_scene_add(&s->scene, sphpa_solid(&s->solid));
    if (scene_kind(s) == SCENE_ELASTIC) return;
    s->plastic.yield = s->yield;
    s->plastic.materials = SCENE_BODIES;
    s->cracks.solid = &s->solid;
    s->cracks.material = s->flaws;
    s->cracks.seed = 1;
    s->pores.solid = &s->solid;
    s->pores.crush = s->crush;
    s->pores.matrix = s->matrix;
    if (all) sphpa_scene_add(&s->scene, sphpa_pores(&s->pores));
    sphpa_scene_add(&s->scene, sphpa_plastic(&s->plastic));
    sphpa_scene_add(&s->scene, sphpa_cracks(&s->cracks));
}

/* n: particles, for a gas the next cube, for a blast the next square; skin: of the options, 0 for the default */
static bench_scene *scene_new(int kind, long n, double neighbours, double skin) {
    bench_scene *s = (bench_scene *)calloc(1, sizeof *s);
    sphpa_particles p;
    sphpa_sim_options options;
    sphpa_error err;
    if (s == NULL) example_fail(1, "out of memory; give fewer particles");
    memset(&p, 0, sizeof p);
    memset(&options, 0, sizeof options);
    options.skin = skin;
    s->kind = kind;
    if (scene_kind(s) == SCENE_GAS) {
        scene_gas(s, &p, lround(cbrt((double)n)), neighbours, &options);
    } else if (scene_kind(s) >= SCENE_GSPH) {
        scene_blast(s, &p, lround(sqrt((double)n)), neighbours, &options);
    } else {
        const scene_impact *impact = scene_kind(s) == SCENE_PUMICE ? &scene_porous : &scene_basalt;
        scene_materials(s, impact);
        scene_modules(s);
        scene_bodies(s, impact, &p, n, neighbours);
    }
    scene_stop_if(sphpa_sim_create(&s->sim, &s->scene, &p, &options, &err), &err);
    sphpa_particles_free(&p);
    s->energy = sphpa_sim_totals(&s->sim).energy;
    return s;
}

static void scene_free(bench_scene *s) {
    sphpa_sim_free(&s->sim);
    free(s);
}

static void scene_steps(bench_scene *s, long steps) {
    sphpa_error err;
    for (long k = 0; k < steps; k++) scene_stop_if(sphpa_sim_step(&s->sim, HUGE_VAL, &err), &err);
}

/* [bytes] a particle of what is no field: tree, lists, records */
static double bench_scratch(const sphpa_sim *sim) {
    char text[8192], *at = text;
    double sum = 0.0;
    sphpa_sim_report(sim, text, sizeof text);
    while ((at = strstr(at, " (scratch)")) != NULL) {
        char *number = at;
        while (number > text && number[-1] != ' ') number--;
        sum += strtod(number, NULL);
        at++;
    }
    return sum;
}

#endif
