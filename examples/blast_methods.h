/* blast_methods.h: the three ways in which blast.c solves its case: begin, go on to a time, let the
   domain grow, say what there is. Reads settings; prints nothing but progress. */
#ifndef BLAST_METHODS_H
#define BLAST_METHODS_H

enum { BLAST_GOES_ON = 0, BLAST_GROWS, BLAST_OUT_OF_TIME, BLAST_INTERRUPTED }; /* why a run pauses */

/* The first steps of particles: dt <= dt0 step^2 until BLAST_EARLY. */
typedef struct blast_first_steps {
    double dt0;      /* [s] */
    uint64_t before; /* steps of simulations that this one goes on from */
} blast_first_steps;

/* One method at work. Must stay where it is: modules point into it. */
typedef struct blast_run {
    const blast_settings *s;
    int method, quiet, why;
    double side;       /* [m] of the domain now */
    size_t across;     /* particles, or cells of fvm, along it */
    double time, t_end; /* [s] reached; of the run under way */
    sphpa_ideal ideal;
    sphpa_eos eos;
    sphpa_godunov_params god;
    sphpa_edges_params edges;
    blast_first_steps first;
    sphpa_scene scene;
    sphpa_grid grid;     /* of fvm */
    sphpa_sim sim;       /* of sph */
    sphpa_hybrid hybrid;
    sphpa_grid_sums begun; /* what there was, and the air that came with growing */
    sphpa_grid_sums lost;  /* what left before the last growth */
    uint64_t fvm_steps, updates;
    double cpu, wall, cpu_since, wall_since; /* [s] solving; since when, while it runs */
    const volatile int *stop;
    example_progress progress;
    unsigned char *was;  /* (cells) hybrid: what they were before the step, until `seen` is called */
    void (*seen)(struct blast_run *run); /* hybrid: when cells first became particles' at t_seen */
    double t_seen;       /* [s] */
    const char *out;     /* for `seen` */
} blast_run;

static double blast_cpu(void) { return (double)clock() / (double)CLOCKS_PER_SEC; }

static void blast_clocks_start(blast_run *run) {
    run->cpu_since = blast_cpu();
    run->wall_since = sphpa_wall_clock();
}

static void blast_clocks_stop(blast_run *run) {
    run->cpu += blast_cpu() - run->cpu_since;
    run->wall += sphpa_wall_clock() - run->wall_since;
}

/* ---- domains --------------------------------------------------------------------------------- */

/* the paper's: 10 m, then 5 m more up to 50 m, 10 m more up to 100 m, 25 m more */
static double blast_next_side(double side) {
    return side + (side < 50.0 * (1.0 - 1e-9) ? 5.0 : side < 100.0 * (1.0 - 1e-9) ? 10.0 : 25.0);
}

static double blast_side_that_holds(double half) {
    double side = 10.0;
    while (side < 2.0 * half) side = blast_next_side(side);
    return side;
}

/* an even number of cells of width dx that is as wide as the side, or a little wider: so every
   domain has a corner of cells in its middle, and the cells of a larger one are those of a smaller */
static size_t blast_across(double side, double dx) {
    return 2 * (size_t)ceil(0.5 * side / dx * (1.0 - 1e-12));
}

static sphpa_result blast_too_many(size_t across, sphpa_error *err) {
    return sphpa_error_set(err, SPHPA_ERROR_RANGE, "%zu x %zu cells are more than 2^31; give a "
                           "larger --dx or a smaller --size", across, across);
}

/* ---- the particles' scene -------------------------------------------------------------------- */

static double blast_first_limit(const sphpa_sim *sim, const void *params, size_t i) {
    const blast_first_steps *first = (const blast_first_steps *)params;
    double step = (double)(sim->stats.steps + first->before + 1);
    (void)i;
    return sim->time < BLAST_EARLY ? first->dt0 * step * step : HUGE_VAL;
}

static sphpa_module blast_first_module(blast_first_steps *first) {
    sphpa_module module;
    memset(&module, 0, sizeof module);
    module.name = "first steps";
    module.params = first;
    module.passes = 1;
    module.pass[0].name = "first steps";
    module.pass[0].stage = SPHPA_STAGE_LIMIT;
    module.pass[0].kind = SPHPA_PASS_REDUCE;
    module.pass[0].limit = blast_first_limit;
    return module;
}

static sphpa_module blast_scheme(blast_run *run) {
    switch (run->s->scheme) {
    case BLAST_GAS: return sphpa_gas(&run->god.gas);
    case BLAST_ADKE: return sphpa_godunov_adke(&run->god);
    case BLAST_MPM: return sphpa_godunov_mpm(&run->god);
    default: return sphpa_godunov(&run->god);
    }
}

static sphpa_result blast_make_scene(blast_run *run, sphpa_error *err) {
    const blast_settings *s = run->s;
    sphpa_godunov_params *god = &run->god;
    run->ideal.gamma = s->gamma;
    run->eos = sphpa_ideal_eos(&run->ideal);
    god->gas.eos = &run->eos;
    god->gas.materials = 1;
    god->gas.eta = s->eta;
    god->gas.h_max = s->h_max;
    god->pilot = s->pilot;
    god->g1 = s->g1;
    god->g2 = s->g2;
    god->riemann = s->riemann;
    god->slopes = s->slopes;
    god->lattice = 1;
    god->by_number = !s->by_mass;
    run->first.dt0 = s->dt_start;
    memset(&run->scene, 0, sizeof run->scene);
    sphpa_result result = sphpa_scene_add(&run->scene, blast_scheme(run));
    if (result == SPHPA_OK && s->dt_start > 0.0)
        result = sphpa_scene_add(&run->scene, blast_first_module(&run->first));
    if (result == SPHPA_OK && run->method == BLAST_SPH)
        result = sphpa_scene_add(&run->scene, sphpa_edges(&run->edges));
    if (result != SPHPA_OK && err != NULL) *err = run->scene.error;
    return result;
}

/* supports that a particle's sums reach */
static double blast_reach(const blast_settings *s) {
    return s->scheme == BLAST_GSPH || s->scheme == BLAST_ADKE ? s->pilot : 1.0;
}

static sphpa_sim_options blast_sim_options(const blast_settings *s) {
    sphpa_sim_options options;
    memset(&options, 0, sizeof options);
    options.cfl = s->cfl;
    options.kernel = (sphpa_kernel)s->kernel;
    options.dt_growth = s->dt_start > 0.0 ? 4.0 : 0.0; /* step^2: from the first to the second */
    return options;
}

/* ---- finite volumes -------------------------------------------------------------------------- */

static sphpa_grid_options blast_grid_options(const blast_settings *s, double dx, size_t across) {
    sphpa_grid_options options;
    memset(&options, 0, sizeof options);
    for (int a = 0; a < 2; a++) {
        options.high[a] = 0.5 * dx * (double)across;
        options.low[a] = -options.high[a];
    }
    options.nx = options.ny = across;
    options.gamma = s->gamma;
    options.cfl = s->cfl_mesh;
    return options;
}

static sphpa_result blast_begin_fvm(blast_run *run, sphpa_error *err) {
    blast_filler filler = {run->s, run->s->dx, 0};
    sphpa_grid_options options = blast_grid_options(run->s, run->s->dx, run->across);
    sphpa_result result = sphpa_grid_create(&run->grid, &options, err);
    if (result == SPHPA_OK) result = sphpa_grid_fill(&run->grid, blast_fill, &filler, 1, err);
    if (result == SPHPA_OK) run->begun = sphpa_grid_totals(&run->grid);
    return result;
}

/* the old cells in the middle of the new ones, still air around them */
static sphpa_result blast_grow_fvm(blast_run *run, size_t across, sphpa_error *err) {
    const blast_settings *s = run->s;
    sphpa_grid larger, *old = &run->grid;
    sphpa_grid_options options = blast_grid_options(s, s->dx, across);
    sphpa_result result = sphpa_grid_create(&larger, &options, err);
    if (result != SPHPA_OK) return result;
    size_t shift = (across - run->across) / 2, bytes = old->nx * sizeof(double);
    double *const to[4] = {larger.rho, larger.mx, larger.my, larger.E};
    double *const from[4] = {old->rho, old->mx, old->my, old->E};
    const double air[4] = {s->rho_air, 0.0, 0.0, s->P_air / (s->gamma - 1.0)};
    for (int q = 0; q < 4; q++) {
        for (size_t c = 0; c < larger.n; c++) to[q][c] = air[q];
        for (size_t j = 0; j < old->ny; j++)
            memcpy(to[q] + shift + across * (j + shift), from[q] + old->nx * j, bytes);
    }
    larger.time = old->time;
    larger.dt = old->dt;
    larger.dt_free = old->dt_free;
    larger.stats = old->stats;
    larger.left = old->left;
    sphpa_grid_free(old);
    run->grid = larger;
    return SPHPA_OK;
}

static double blast_cell_pressure(const sphpa_grid *grid, size_t c) {
    double kinetic = 0.5 * (grid->mx[c] * grid->mx[c] + grid->my[c] * grid->my[c]) / grid->rho[c];
    return (grid->options.gamma - 1.0) * (grid->E[c] - kinetic);
}

/* whether the shock's foot has come so near to the edges */
static bool blast_near_edge_fvm(const blast_run *run) {
    const sphpa_grid *grid = &run->grid;
    size_t n = grid->nx, low = BLAST_MARGIN, high = n - 1 - BLAST_MARGIN;
    for (size_t k = 0; k < n; k++) {
        const size_t at[4] = {low + n * k, high + n * k, k + n * low, k + n * high};
        for (int side = 0; side < 4; side++)
            if (blast_cell_pressure(grid, at[side]) > 2.0 * run->s->P_air) return true;
    }
    return false;
}

/* ---- particles ------------------------------------------------------------------------------- */

/* where particles go: first counted, then put */
typedef struct blast_placing {
    const blast_settings *s;
    sphpa_particles *p; /* NULL: only count */
    size_t count;       /* so many so far; or the place of the next one */
} blast_placing;

/* the particles of the square of the lattice whose lower corner is low: one, or split x split */
static void blast_place(blast_placing *placing, const double low[2]) {
    const blast_settings *s = placing->s;
    blast_filler filler = {s, s->dx, 0};
    double middle[2] = {low[0] + 0.5 * s->dx, low[1] + 0.5 * s->dx};
    size_t split = blast_share(&filler, middle) > 0.0 ? (size_t)s->split : 1;
    double d = filler.width = s->dx / (double)split;
    for (size_t k = 0; k < split * split; k++, placing->count++) {
        if (placing->p == NULL) continue;
        sphpa_grid_state state;
        size_t at = placing->count;
        double *x = placing->p->x + 3 * at;
        x[0] = low[0] + ((double)(k % split) + 0.5) * d;
        x[1] = low[1] + ((double)(k / split) + 0.5) * d;
        blast_fill(x, &filler, &state);
        placing->p->rho[at] = state.rho;
        placing->p->m[at] = (sphpa_real)(state.rho * d * d);
        placing->p->h[at] = (sphpa_real)(s->eta * d);
        placing->p->u[at] = state.P / ((s->gamma - 1.0) * state.rho);
    }
}

/* the lattice of the domain, without what lies in the inner `hole` by `hole` of it */
static void blast_place_all(blast_placing *placing, size_t across, size_t hole) {
    size_t low = (across - hole) / 2, high = low + hole;
    for (size_t k = 0; k < across * across; k++) {
        size_t i = k % across, j = k / across;
        if (i >= low && i < high && j >= low && j < high) continue;
        double corner[2] = {((double)i - 0.5 * (double)across) * placing->s->dx,
                            ((double)j - 0.5 * (double)across) * placing->s->dx};
        blast_place(placing, corner);
    }
}

static sphpa_result blast_add_lattice(const blast_settings *s, size_t across, size_t hole,
                                      sphpa_particles *p, sphpa_error *err) {
    blast_placing placing = {s, NULL, 0};
    size_t at = 0;
    blast_place_all(&placing, across, hole);
    sphpa_result result = sphpa_particles_add(p, placing.count, &at, err);
    if (result != SPHPA_OK) return result;
    placing.p = p;
    placing.count = at;
    blast_place_all(&placing, across, hole);
    return SPHPA_OK;
}

static sphpa_result blast_start_sph(blast_run *run, const sphpa_particles *p, sphpa_sim *sim,
                                    sphpa_error *err) {
    sphpa_sim_options options = blast_sim_options(run->s);
    for (int a = 0; a < 2; a++) {
        run->edges.high[a] = 0.5 * run->s->dx * (double)run->across;
        run->edges.low[a] = -run->edges.high[a];
        /* nothing reaches the edges of a domain that grows: images of it are the least work */
        run->edges.edge_low[a] = run->edges.edge_high[a] =
            run->s->fixed ? SPHPA_EDGE_OPEN : SPHPA_EDGE_MIRROR;
    }
    run->edges.reach = blast_reach(run->s);
    sphpa_result result = sphpa_sim_create(sim, &run->scene, p, &options, err);
    if (result == SPHPA_OK) sim->time = run->time;
    return result;
}

static sphpa_grid_sums blast_sph_totals(const sphpa_sim *sim) {
    sphpa_totals totals = sphpa_sim_totals(sim);
    sphpa_grid_sums sums;
    sums.mass = totals.mass;
    sums.momentum[0] = totals.momentum[0];
    sums.momentum[1] = totals.momentum[1];
    sums.energy = totals.energy;
    return sums;
}

static sphpa_result blast_begin_sph(blast_run *run, sphpa_error *err) {
    sphpa_particles p;
    sphpa_result result =
        sphpa_particles_create(&p, 2, run->across * run->across, 0, 0, NULL, 0, err);
    if (result == SPHPA_OK) result = blast_add_lattice(run->s, run->across, 0, &p, err);
    if (result == SPHPA_OK) result = blast_start_sph(run, &p, &run->sim, err);
    sphpa_particles_free(&p);
    if (result == SPHPA_OK) run->begun = blast_sph_totals(&run->sim);
    return result;
}

/* u that had fallen below 0, where a simulation must not begin; it sorts its particles */
static void blast_put_back(sphpa_sim *sim, const sphpa_particles *p, const double *below, size_t n) {
    for (size_t k = 0; k < n; k++)
        for (size_t i = 0; below[k] < 0.0 && i < sim->p.n; i++)
            if (sim->p.ghost[i] == 0 && sim->p.id[i] == p->id[k]) sim->p.u[i] = below[k];
}

/* Particles that a run has brought to one point (their kernels do not push there) are a little apart,
   as a simulation must begin. */
static sphpa_result blast_part_twins(sphpa_particles *p, sphpa_error *err) {
    sphpa_tree tree;
    size_t i = 0, j = 0;
    double *support = (double *)malloc(p->n * sizeof *support);
    memset(&tree, 0, sizeof tree);
    if (support == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "no memory for %zu particles", p->n);
    for (size_t k = 0; k < p->n; k++) support[k] = (double)p->h[k];
    sphpa_result result = sphpa_tree_build(&tree, 2, p->n, p->x, support, NULL, err);
    while (result == SPHPA_OK && sphpa_tree_coincident(&tree, &i, &j) != SPHPA_OK) {
        p->x[3 * j] += 1e-6 * support[j];
        result = sphpa_tree_build(&tree, 2, p->n, p->x, support, NULL, err);
    }
    sphpa_tree_free(&tree);
    free(support);
    return result;
}

/* The particles without their images, and still air around them. */
static sphpa_result blast_grow_sph(blast_run *run, size_t across, sphpa_error *err) {
    sphpa_particles p, *old = &run->sim.p;
    sphpa_mask also = old->h0 != NULL ? SPHPA_F(h0) : 0;
    size_t n = old->n, before = run->across;
    unsigned char *keep = (unsigned char *)malloc(n);
    double *below = (double *)calloc(n, sizeof *below);
    sphpa_result result = sphpa_particles_create(&p, 2, across * across, also, 0, NULL, 0, err);
    if (result == SPHPA_OK) result = sphpa_particles_append(&p, old, err);
    if (result == SPHPA_OK && (keep == NULL || below == NULL))
        result = sphpa_error_set(err, SPHPA_ERROR_MEMORY, "no memory for %zu particles", n);
    for (size_t i = 0; i < n && result == SPHPA_OK; i++) keep[i] = old->ghost[i] == 0;
    if (result == SPHPA_OK) result = sphpa_particles_remove(&p, keep, err);
    if (result == SPHPA_OK) result = blast_part_twins(&p, err);
    size_t kept = result == SPHPA_OK ? p.n : 0;
    for (size_t i = 0; i < kept; i++) {
        below[i] = p.u[i];
        p.u[i] = fmax(p.u[i], 0.0);
    }
    if (result == SPHPA_OK) result = blast_add_lattice(run->s, across, before, &p, err);
    if (result == SPHPA_OK) {
        for (int a = 0; a < 2; a++) run->lost.momentum[a] += run->edges.lost[1 + a];
        run->lost.mass += run->edges.lost[0];
        run->lost.energy += run->edges.lost[4];
        run->first.before += run->sim.stats.steps;
        sphpa_sim_free(&run->sim);
        run->across = across;
        result = blast_start_sph(run, &p, &run->sim, err);
        if (result == SPHPA_OK) blast_put_back(&run->sim, &p, below, kept);
    }
    free(keep);
    free(below);
    sphpa_particles_free(&p);
    return result;
}

static bool blast_near_edge_sph(const blast_run *run) {
    const sphpa_particles *p = &run->sim.p;
    double margin = run->edges.high[0] - BLAST_MARGIN * run->s->dx, P_air = run->s->P_air;
    for (size_t i = 0; i < p->n; i++) {
        if (p->ghost[i] != 0) continue;
        if (fmax(fabs(p->x[3 * i]), fabs(p->x[3 * i + 1])) < margin) continue;
        if ((double)p->P[i] > 2.0 * P_air) return true;
    }
    return false;
}

/* ---- the hybrid ------------------------------------------------------------------------------ */

static sphpa_result blast_begin_hybrid(blast_run *run, sphpa_error *err) {
    const blast_settings *s = run->s;
    sphpa_hybrid_options options;
    double width = s->dx * (double)s->beta;
    blast_filler filler = {s, s->dx / (double)(BLAST_SAMPLES * s->split), 0}; /* of the finest */
    memset(&options, 0, sizeof options);
    run->across = blast_across(run->side, width);
    options.grid = blast_grid_options(s, width, run->across);
    options.scene = &run->scene;
    options.sim = blast_sim_options(s);
    options.threshold = s->threshold;
    options.floor_rho = s->rho_air;
    options.floor_P = s->P_air;
    options.flag_by = s->flag_by;
    options.beta = (int)s->beta;
    options.active = s->active > 0 ? (int)s->active : -1;
    options.buffer = (int)s->buffer;
    options.eta = s->eta;
    options.reach = blast_reach(s);
    options.published = s->published;
    options.merge = s->merge;
    options.mass_max = (1.0 + 1e-9) * s->rho_charge * s->dx * s->dx / (double)(s->split * s->split);
    sphpa_result result = sphpa_hybrid_create(&run->hybrid, &options, err);
    if (result == SPHPA_OK) result = sphpa_hybrid_fill(&run->hybrid, blast_fill, &filler, BLAST_SAMPLES, err);
    if (result != SPHPA_OK) return result;
    run->begun = sphpa_grid_totals(&run->hybrid.grid);
    run->was = (unsigned char *)malloc(run->hybrid.grid.n);
    if (run->was == NULL) return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "out of memory");
    memcpy(run->was, run->hybrid.cell, run->hybrid.grid.n);
    return SPHPA_OK;
}

/* the first step after t_seen in which cells of the mesh became particles' */
static void blast_look(blast_run *run) {
    const sphpa_hybrid *h = &run->hybrid;
    bool found = false;
    if (run->seen == NULL) return;
    blast_clocks_stop(run);
    for (size_t c = 0; c < h->grid.n && !found; c++)
        found = (run->was[c] & 3) == SPHPA_HYBRID_MESH && (h->cell[c] & 3) != SPHPA_HYBRID_MESH;
    if (found && h->grid.time >= run->t_seen) {
        run->seen(run);
        run->seen = NULL;
    }
    memcpy(run->was, h->cell, h->grid.n);
    blast_clocks_start(run);
}

/* ---- any of them ----------------------------------------------------------------------------- */

static sphpa_result blast_begin(blast_run *run, sphpa_error *err) {
    const blast_settings *s = run->s;
    run->side = s->fixed || run->method == BLAST_HYBRID
                    ? s->size
                    : blast_side_that_holds(s->radius + (BLAST_MARGIN + 1) * s->dx);
    run->across = blast_across(run->side, s->dx);
    if (run->across > 46340) return blast_too_many(run->across, err);
    sphpa_result result = run->method == BLAST_FVM ? SPHPA_OK : blast_make_scene(run, err);
    if (result != SPHPA_OK) return result;
    return run->method == BLAST_FVM   ? blast_begin_fvm(run, err)
           : run->method == BLAST_SPH ? blast_begin_sph(run, err)
                                      : blast_begin_hybrid(run, err);
}

static void blast_end(blast_run *run) {
    sphpa_grid_free(&run->grid);
    sphpa_sim_free(&run->sim);
    sphpa_hybrid_free(&run->hybrid);
    free(run->was);
    run->was = NULL;
}

/* a larger domain; what it brings along is added to what there was */
static sphpa_result blast_grow(blast_run *run, sphpa_error *err) {
    const blast_settings *s = run->s;
    double side = blast_next_side(run->side);
    size_t before = run->across, across = blast_across(side, s->dx);
    if (across > 46340) return blast_too_many(across, err);
    sphpa_result result = run->method == BLAST_FVM ? blast_grow_fvm(run, across, err)
                                                   : blast_grow_sph(run, across, err);
    if (result != SPHPA_OK) return result;
    run->side = side;
    run->across = across;
    double area = s->dx * s->dx * ((double)across * (double)across - (double)before * (double)before);
    run->begun.mass += area * s->rho_air;
    run->begun.energy += area * s->P_air / (s->gamma - 1.0);
    return SPHPA_OK;
}

/* after each step: whether the run goes on */
static sphpa_result blast_after_step(blast_run *run, double time, double dt, uint64_t steps,
                                     size_t updates, bool near_edge, sphpa_error *err) {
    double wall = run->wall + sphpa_wall_clock() - run->wall_since, end = run->s->t_end;
    run->time = time;
    run->updates += updates;
    example_progress_show(&run->progress, time / end, time, dt, steps, run->updates);
    if (time >= end) return SPHPA_OK;
    run->why = *run->stop                                                   ? BLAST_INTERRUPTED
               : run->s->max_seconds > 0.0 && wall >= run->s->max_seconds ? BLAST_OUT_OF_TIME
               : near_edge                                                  ? BLAST_GROWS
                                                                            : BLAST_GOES_ON;
    if (run->why == BLAST_GOES_ON) return SPHPA_OK;
    return sphpa_error_set(err, SPHPA_STOPPED, "stopped at t = %.9e s", time);
}

static sphpa_result blast_after_grid_step(sphpa_grid *grid, void *user, sphpa_error *err) {
    blast_run *run = (blast_run *)user;
    if (run->method == BLAST_FVM)
        return blast_after_step(run, grid->time, grid->dt, grid->stats.steps, grid->n,
                                !run->s->fixed && blast_near_edge_fvm(run), err);
    const sphpa_hybrid_stats *stats = &run->hybrid.stats;
    blast_look(run);
    run->updates = stats->particle_steps + stats->ghost_steps;
    return blast_after_step(run, grid->time, grid->dt, stats->substeps, 0, false, err);
}

static sphpa_result blast_after_sim_step(sphpa_sim *sim, void *user, sphpa_error *err) {
    blast_run *run = (blast_run *)user;
    return blast_after_step(run, sim->time, sim->dt, sim->stats.steps + run->first.before, sim->p.n,
                            !run->s->fixed && blast_near_edge_sph(run), err);
}

static sphpa_result blast_advance_once(blast_run *run, double t_end, sphpa_error *err) {
    sphpa_grid_schedule schedule;
    sphpa_run steps;
    memset(&schedule, 0, sizeof schedule);
    memset(&steps, 0, sizeof steps);
    schedule.t_end = steps.t_end = t_end;
    schedule.resumed = steps.resumed = 1;
    schedule.user = steps.user = run;
    schedule.step = blast_after_grid_step;
    steps.step = blast_after_sim_step;
    return run->method == BLAST_FVM   ? sphpa_grid_run(&run->grid, &schedule, err)
           : run->method == BLAST_SPH ? sphpa_sim_run(&run->sim, &steps, err)
                                      : sphpa_hybrid_run(&run->hybrid, &schedule, err);
}

/* On to t_end [s], the domain grown where it must be. STOPPED: why says for what. */
static sphpa_result blast_advance(blast_run *run, double t_end, sphpa_error *err) {
    sphpa_result result = SPHPA_OK;
    blast_clocks_start(run);
    do {
        run->why = BLAST_GOES_ON;
        result = blast_advance_once(run, t_end, err);
        if (run->why != BLAST_GROWS) break;
        result = blast_grow(run, err);
    } while (result == SPHPA_OK);
    blast_clocks_stop(run);
    return result;
}

/* ---- what there is --------------------------------------------------------------------------- */

static sphpa_grid_sums blast_sums(const blast_run *run) {
    const sphpa_grid *grid = run->method == BLAST_FVM ? &run->grid : &run->hybrid.grid;
    sphpa_grid_sums sums = run->method == BLAST_SPH ? blast_sph_totals(&run->sim)
                                                    : sphpa_grid_totals(grid);
    bool sph = run->method == BLAST_SPH;
    sums.mass += run->lost.mass + (sph ? run->edges.lost[0] : grid->left.mass);
    for (int a = 0; a < 2; a++)
        sums.momentum[a] += run->lost.momentum[a] +
                            (sph ? run->edges.lost[1 + a] : grid->left.momentum[a]);
    sums.energy += run->lost.energy + (sph ? run->edges.lost[4] : grid->left.energy);
    return sums;
}

static uint64_t blast_steps(const blast_run *run) {
    return run->method == BLAST_FVM   ? run->grid.stats.steps
           : run->method == BLAST_SPH ? run->sim.stats.steps + run->first.before
                                      : run->hybrid.stats.steps;
}

static const sphpa_particles *blast_set(const blast_run *run) {
    return run->method == BLAST_HYBRID ? &run->hybrid.sim.p : &run->sim.p;
}

/* of fields, a particle */
static size_t blast_bytes(const blast_run *run) {
    return run->method == BLAST_FVM ? 0 : sphpa_particles_bytes_each(blast_set(run));
}

/* without images beyond the domain's edges; of the hybrid with those that the mesh drives */
static size_t blast_particles(const blast_run *run) {
    const sphpa_particles *p = blast_set(run);
    size_t count = 0, n = run->method == BLAST_FVM ? 0 : p->n;
    for (size_t i = 0; i < n; i++)
        count += p->ghost[i] == 0 || (run->method == BLAST_HYBRID && p->ghost[i] == 1);
    return count;
}

static size_t blast_cells(const blast_run *run) {
    return run->method == BLAST_FVM ? run->grid.n : run->method == BLAST_SPH ? 0 : run->hybrid.grid.n;
}

/* the bilinear state of a mesh at x; of its own cells beyond its edges */
static void blast_grid_state(const sphpa_grid *grid, const double *rho, const double *P, double x,
                             double y, double *rho_at, double *P_at) {
    double at[2] = {x, y}, w[2];
    size_t low[2], high[2], n[2] = {grid->nx, grid->ny};
    for (int a = 0; a < 2; a++) {
        double cell = (at[a] - grid->options.low[a]) / grid->dx[a] - 0.5;
        cell = fmin(fmax(cell, 0.0), (double)(n[a] - 1));
        low[a] = (size_t)cell;
        high[a] = low[a] + 1 < n[a] ? low[a] + 1 : low[a];
        w[a] = cell - (double)low[a];
    }
    size_t c[4] = {low[0] + n[0] * low[1], high[0] + n[0] * low[1], low[0] + n[0] * high[1],
                   high[0] + n[0] * high[1]};
    double share[4] = {(1.0 - w[0]) * (1.0 - w[1]), w[0] * (1.0 - w[1]), (1.0 - w[0]) * w[1],
                       w[0] * w[1]};
    *rho_at = *P_at = 0.0;
    for (int k = 0; k < 4; k++) {
        *rho_at += share[k] * rho[c[k]];
        *P_at += share[k] * P[c[k]];
    }
}

/* (n) the pressure of every cell; the caller's to free */
static double *blast_pressures(const sphpa_grid *grid) {
    double *P = (double *)malloc(grid->n * sizeof *P);
    if (P == NULL) example_fail(1, "out of memory");
    for (size_t c = 0; c < grid->n; c++) P[c] = blast_cell_pressure(grid, c);
    return P;
}

/* each cell by `samples` by `samples` points; with a hybrid those that are the mesh's */
static void blast_profile_grid(const blast_run *run, const sphpa_grid *grid, int samples,
                               blast_profile *profile) {
    double *P = blast_pressures(grid), d = grid->dx[0] / samples, rho_at = 0.0, P_at = 0.0;
    for (size_t c = 0; c < grid->n; c++) {
        if (run->method == BLAST_HYBRID && (run->hybrid.cell[c] & 3) == SPHPA_HYBRID_ACTIVE) continue;
        for (int k = 0; k < samples * samples; k++) {
            double x = grid->options.low[0] + (double)(c % grid->nx) * grid->dx[0] +
                       (k % samples + 0.5) * d;
            double y = grid->options.low[1] + (double)(c / grid->nx) * grid->dx[1] +
                       (k / samples + 0.5) * d;
            blast_grid_state(grid, grid->rho, P, x, y, &rho_at, &P_at);
            blast_profile_add(profile, x, y, rho_at, P_at, d * d);
        }
    }
    free(P);
}

static void blast_profile_particles(const sphpa_sim *sim, blast_profile *profile) {
    const sphpa_particles *p = &sim->p;
    for (size_t i = 0; i < p->n; i++)
        if (p->ghost[i] == 0)
            blast_profile_add(profile, p->x[3 * i], p->x[3 * i + 1], p->rho[i], (double)p->P[i],
                              (double)p->m[i] / p->rho[i]);
}

/* Means in rings of dx, those that are whole within the domain. */
static sphpa_result blast_measure(blast_run *run, blast_profile *profile, sphpa_error *err) {
    sphpa_sim *sim = run->method == BLAST_SPH ? &run->sim : &run->hybrid.sim;
    bool particles = run->method == BLAST_SPH || (run->method == BLAST_HYBRID && run->hybrid.running);
    const sphpa_grid *grid = run->method == BLAST_FVM ? &run->grid : &run->hybrid.grid;
    sphpa_result result = particles ? sphpa_sim_refresh(sim, err) : SPHPA_OK;
    if (result != SPHPA_OK) return result;
    blast_profile_begin(profile, 0.5 * run->side, run->s->dx);
    int samples = run->method == BLAST_FVM ? 4 : run->s->beta < 4 ? 4 : (int)run->s->beta;
    if (run->method != BLAST_SPH) blast_profile_grid(run, grid, samples, profile);
    if (particles) blast_profile_particles(sim, profile);
    blast_profile_end(profile, run->s);
    return SPHPA_OK;
}

#endif
