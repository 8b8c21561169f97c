/* verify_hybrid.h: the coupling of >>hybrid on what must cross the edge of a region of particles: a
   contact, sound, shocks, a blast. A strip of finite volumes, periodic across, with particles in a
   fixed part of it ("hybrid"), as the published coupling has it ("published", whose drifts, and that
   it breaks down on the contact, are shown and not judged), with none ("grid") and with particles everywhere ("sph"). n counts cells. L1 is
   the mean over cells along x against the exact solution. */
#ifndef VERIFY_HYBRID_H
#define VERIFY_HYBRID_H

/* What to run, and where particles are: cells [from, to) along x, or, where `from` is `to` and
   threshold is set, where the gradients are. */
typedef struct verify_hybrid {
    const char *problem;
    sphpa_grid_function function;
    void *user;
    size_t nx, ny, from, to;
    double low, width, t_end; /* [m] of the cells; [s] */
    double threshold, floor;  /* floor: both [kg/m3] and [Pa] */
    double g1, g2;
    int beta, buffer, published, samples, wraps; /* wraps: periodic along x, too */
} verify_hybrid;

typedef struct verify_hybrid_rig {
    sphpa_ideal ideal;
    sphpa_eos eos;
    sphpa_godunov_params god;
    sphpa_scene scene;
    sphpa_hybrid hybrid;
} verify_hybrid_rig;

static void verify_hybrid_flag(const sphpa_hybrid *hybrid, void *user, unsigned char *flag) {
    const verify_hybrid *task = (const verify_hybrid *)user;
    for (size_t c = 0; c < hybrid->grid.n; c++) {
        size_t i = c % hybrid->grid.nx;
        flag[c] = i >= task->from && i < task->to;
    }
}

static void verify_hybrid_scheme(const verify_hybrid *task, char text[VERIFY_NAME]) {
    const char *name = task->published ? "published" : "hybrid";
    if (task->from == 0 && task->to == task->nx) name = "sph";
    if (task->from == task->to && !(task->threshold > 0.0)) name = "grid";
    snprintf(text, VERIFY_NAME, "%s", name);
    if (task->beta > 0) verify_gas_word(text, "beta", task->beta);
    if (task->buffer > 0) verify_gas_word(text, "buffer", task->buffer);
}

static sphpa_hybrid_options verify_hybrid_options(verify_hybrid *task) {
    sphpa_hybrid_options o;
    memset(&o, 0, sizeof o);
    o.grid.nx = task->nx, o.grid.ny = task->ny;
    o.grid.low[0] = task->low, o.grid.high[0] = task->low + task->width * (double)task->nx;
    o.grid.low[1] = task->low;
    o.grid.high[1] = o.grid.low[1] + task->width * (double)task->ny;
    bool strip = task->nx != task->ny;
    if (strip) o.grid.edge_low[1] = o.grid.edge_high[1] = SPHPA_GRID_PERIODIC;
    if (task->wraps) o.grid.edge_low[0] = o.grid.edge_high[0] = SPHPA_GRID_PERIODIC;
    o.sim.kernel = SPHPA_KERNEL_GAUSSIAN;
    o.reach = 2.5;
    o.beta = task->beta, o.buffer = task->buffer, o.published = task->published;
    o.threshold = task->threshold;
    o.floor_rho = o.floor_P = task->floor;
    if (task->threshold > 0.0 || (task->from == 0 && task->to == task->nx)) return o;
    o.active = -1;
    o.flag = verify_hybrid_flag;
    o.user = task;
    return o;
}

/* as verify_grid_drift, with what found no place */
static void verify_hybrid_drift(verify *v, verify_row *row, const sphpa_hybrid *hybrid,
                                const sphpa_grid_sums *start) {
    sphpa_grid with = hybrid->grid; /* the published coupling is judged by nobody */
    verify aside = *v;
    with.left.mass -= hybrid->stats.unplaced.mass;
    with.left.energy -= hybrid->stats.unplaced.energy;
    for (int a = 0; a < 2; a++) with.left.momentum[a] -= hybrid->stats.unplaced.momentum[a];
    v->energy = 1e-12; /* by design, but for rounding */
    verify_grid_drift(hybrid->options.published ? &aside : v, row, &with, start);
}

/* Runs to t_end; the hybrid is the caller's to free, whatever is returned. false: it broke down. */
static bool verify_hybrid_run(verify *v, verify_hybrid *task, verify_hybrid_rig *rig,
                              verify_row *row) {
    sphpa_error err;
    sphpa_grid_schedule schedule;
    char scheme[VERIFY_NAME];
    memset(rig, 0, sizeof *rig);
    memset(&schedule, 0, sizeof schedule);
    schedule.t_end = task->t_end;
    rig->ideal.gamma = 1.4;
    rig->eos = sphpa_ideal_eos(&rig->ideal);
    rig->god.gas.eos = &rig->eos;
    rig->god.gas.materials = 1;
    rig->god.gas.eta = 1.5;
    rig->god.pilot = 2.5;
    rig->god.lattice = 1;
    rig->god.g1 = task->g1, rig->god.g2 = task->g2;
    verify_must(sphpa_scene_add(&rig->scene, sphpa_godunov(&rig->god)), &rig->scene.error);
    sphpa_hybrid_options o = verify_hybrid_options(task);
    o.scene = &rig->scene;
    verify_hybrid_scheme(task, scheme);
    *row = verify_row_of(task->problem, scheme, "gaussian", task->nx == task->ny ? 2 : 1);
    (void)example_threads(1);
    verify_must(sphpa_hybrid_create(&rig->hybrid, &o, &err), &err);
    verify_must(sphpa_hybrid_fill(&rig->hybrid, task->function, task->user, task->samples, &err),
                &err);
    row->n = (double)(task->nx == task->ny ? task->nx * task->ny : task->nx);
    sphpa_grid_sums start = sphpa_grid_totals(&rig->hybrid.grid);
    verify_show(v, 0.0, false);
    clock_t begun = clock();
    sphpa_result result = sphpa_hybrid_run(&rig->hybrid, &schedule, &err);
    row->cpu_s = (double)(clock() - begun) / (double)CLOCKS_PER_SEC;
    verify_hybrid_drift(v, row, &rig->hybrid, &start);
    if (result == SPHPA_OK) return true;
    fprintf(stderr, "verify: %s, %s broke down at t = %g of %g: %s\n", task->problem, scheme,
            rig->hybrid.grid.time, task->t_end, err.message);
    if (!task->published) v->broken++;
    return false;
}

/* of particles in the middle third, published and not, of none, of all */
enum { VERIFY_HYBRID_KINDS = 4 };
static void verify_hybrid_kind(verify_hybrid *task, int kind) {
    task->published = kind == 1;
    task->from = kind < 2 ? task->nx * 3 / 8 : 0;
    task->to = kind < 2 ? task->nx * 5 / 8 : kind == 2 ? 0 : task->nx;
    if (kind == 2) task->threshold = 0.0;
}

/* ---- a contact ------------------------------------------------------------------------------- */

/* a bump of density in a flow of 1 m/s, at `user` [m] */
static void verify_hybrid_bump_at(const double x[2], void *user, sphpa_grid_state *out) {
    double d = (x[0] - *(const double *)user) / 0.06;
    out->rho = 1.0 + exp(-d * d);
    out->v[0] = 1.0, out->v[1] = 0.0;
    out->P = 1.0;
}

/* through the region of a metre's strip: from 0.25 to 0.75 m */
static void verify_hybrid_contact(verify *v) {
    for (int kind = 0; kind < VERIFY_HYBRID_KINDS; kind++)
        for (int level = 0; level < verify_levels(v, 2); level++) {
            static verify_hybrid_rig rig;
            verify_hybrid task;
            verify_row row;
            verify_error e = {0.0, 0.0, 0};
            double begin = 0.25, end = 0.75;
            memset(&task, 0, sizeof task);
            task.problem = "hybrid-contact";
            task.function = verify_hybrid_bump_at;
            task.user = &begin;
            task.nx = (size_t)64 << level, task.ny = 6;
            task.wraps = 1;
            task.width = 1.0 / (double)task.nx;
            task.t_end = 0.5;
            task.samples = 2;
            if (v->quick && level > 0) continue;
            verify_hybrid_kind(&task, kind);
            bool ran = verify_hybrid_run(v, &task, &rig, &row);
            for (size_t i = 0; ran && i < task.nx; i++) {
                sphpa_grid_state exact;
                double x[2] = {((double)i + 0.5) * task.width, 0.0};
                verify_hybrid_bump_at(x, &end, &exact);
                verify_error_add(&e, rig.hybrid.grid.rho[i] - exact.rho);
            }
            verify_error_put(&row, &e);
            verify_add(v, row);
            sphpa_hybrid_free(&rig.hybrid);
        }
}

/* ---- sound ----------------------------------------------------------------------------------- */

/* a simple wave to the right: rho = 1 + 0.01 bump of width `user` [m] at 0.15 m */
static void verify_hybrid_sound_at(const double x[2], void *user, sphpa_grid_state *out) {
    double d = (x[0] - 0.15) / *(const double *)user;
    out->rho = 1.0 + 0.01 * exp(-d * d);
    out->P = pow(out->rho, 1.4);
    out->v[0] = 5.0 * sqrt(1.4) * (pow(out->rho, 0.2) - 1.0);
    out->v[1] = 0.0;
}

/* linf: the share of the pulse that comes back, as the largest change of v - 2c/(gamma - 1), which
   the pulse itself leaves as it is; l1: its mean. t: after the entering edge, and after both. */
static void verify_hybrid_sound_run(verify *v, double wide, int kind, int beta, int buffer,
                                    double t) {
    static verify_hybrid_rig rig;
    verify_hybrid task;
    verify_row row;
    verify_error e = {0.0, 0.0, 0};
    char name[VERIFY_NAME];
    double c0 = sqrt(1.4);
    memset(&task, 0, sizeof task);
    snprintf(name, sizeof name, "hybrid-sound-%s-%g", t < 0.45 ? "enters" : "leaves", wide);
    task.problem = name;
    task.function = verify_hybrid_sound_at;
    task.user = &wide;
    task.nx = 80, task.ny = beta == 1 ? 24 : beta == 2 ? 12 : 6; /* the pilot's reach */
    task.width = 1.0 / 80.0;
    task.t_end = t / c0;
    task.samples = 2;
    task.beta = beta, task.buffer = buffer;
    verify_hybrid_kind(&task, kind);
    bool ran = verify_hybrid_run(v, &task, &rig, &row);
    for (size_t i = 0; ran && i < task.nx; i++) {
        sphpa_grid_state q = {0.0, {0.0, 0.0}, 0.0};
        (void)sphpa_grid_primitive(&rig.hybrid.grid, i, 0, &q);
        double back = q.v[0] - 5.0 * (sqrt(1.4 * q.P / q.rho) - c0);
        verify_error_add(&e, back / (0.02 * c0));
    }
    verify_error_put(&row, &e);
    if (kind == 0 && beta == 0 && buffer == 0) verify_limit(&row, "linf_error", "<=", 0.035);
    verify_add(v, row);
    sphpa_hybrid_free(&rig.hybrid);
}

/* the limit: twice what comes back now; what uniform gas sends is rounding (test_hybrid.c) */
static void verify_hybrid_sound(verify *v) {
    static const double wide[2] = {0.05, 0.1};
    for (int w = 0; w < (v->quick ? 1 : 2); w++)
        for (int when = 0; when < 2; when++) {
            double t = when ? 0.65 : 0.35;
            verify_hybrid_sound_run(v, wide[w], 2, 0, 0, t);
            for (int kind = 0; kind < 2; kind++) {
                verify_hybrid_sound_run(v, wide[w], kind, 0, 0, t);
                for (int beta = 1; beta <= 8 && !v->quick; beta *= 2)
                    if (beta != 4) verify_hybrid_sound_run(v, wide[w], kind, beta, 0, t);
                for (int buffer = 1; buffer <= 4 && !v->quick; buffer++)
                    verify_hybrid_sound_run(v, wide[w], kind, 0, buffer, t);
            }
        }
}

/* ---- shocks ---------------------------------------------------------------------------------- */

static void verify_hybrid_tube_at(const double x[2], void *user, sphpa_grid_state *out) {
    const verify_riemann *r = (const verify_riemann *)user;
    const sphpa_riemann_state *side = x[0] < 0.0 ? &r->left : &r->right;
    out->rho = side->rho;
    out->P = side->P;
    out->v[0] = side->v;
    out->v[1] = 0.0;
}

/* Particles from -0.125 to 0.125 m: head, contact and shock cross their edges. L1 of rho. */
static void verify_hybrid_tubes(verify *v) {
    static const int which[2] = {VERIFY_SOD, VERIFY_TORO3};
    for (int k = 0; k < (v->quick ? 1 : 2); k++)
        for (int kind = 0; kind < VERIFY_HYBRID_KINDS; kind++) {
            static verify_hybrid_rig rig;
            static verify_riemann problem;
            sphpa_riemann_star star;
            verify_hybrid task;
            verify_row row;
            verify_error e = {0.0, 0.0, 0};
            char name[VERIFY_NAME];
            problem = verify_riemanns[which[k]];
            snprintf(name, sizeof name, "hybrid-%s-rho", problem.name);
            memset(&task, 0, sizeof task);
            task.problem = name;
            task.function = verify_hybrid_tube_at;
            task.user = &problem;
            task.nx = v->quick ? 64 : 128, task.ny = 6;
            task.low = -0.5, task.width = 1.0 / (double)task.nx;
            task.t_end = problem.t_end;
            task.samples = 1;
            task.g1 = 0.25, task.g2 = 0.5;
            verify_hybrid_kind(&task, kind);
            bool ran = verify_hybrid_run(v, &task, &rig, &row) &&
                       sphpa_riemann_exact(1.4, &problem.left, &problem.right, &star) == SPHPA_OK;
            for (size_t i = 0; ran && i < task.nx; i++) {
                double x = task.low + ((double)i + 0.5) * task.width;
                verify_error_add(&e, rig.hybrid.grid.rho[i] -
                                         verify_riemann_at(&problem, &star, x, task.t_end).rho);
            }
            verify_error_put(&row, &e);
            verify_add(v, row);
            sphpa_hybrid_free(&rig.hybrid);
        }
}

/* ---- a blast --------------------------------------------------------------------------------- */

static void verify_hybrid_blast_at(const double x[2], void *user, sphpa_grid_state *out) {
    double r2 = x[0] * x[0] + x[1] * x[1];
    (void)user;
    out->rho = 1.0;
    out->P = r2 < 0.01 ? 1000.0 : 0.01;
    out->v[0] = out->v[1] = 0.0;
}

/* the same along a radius, by finite volumes of 1/2000 m */
static void verify_hybrid_radial(sphpa_grid *grid, double t_end) {
    sphpa_error err;
    sphpa_grid_schedule schedule;
    sphpa_grid_options o = verify_grid_radius(1600, 0.8, 1);
    memset(&schedule, 0, sizeof schedule);
    schedule.t_end = t_end;
    o.low[1] = -1e-9, o.high[1] = 1e-9;
    verify_must(sphpa_grid_create(grid, &o, &err), &err);
    verify_must(sphpa_grid_fill(grid, verify_hybrid_blast_at, NULL, 4, &err), &err);
    verify_must(sphpa_grid_run(grid, &schedule, &err), &err);
}

/* A pressure of 1e5 to 1 in r < 0.1 m, flags by gradients: rho of cells with r < 0.6 m against the
   radius' solution. */
static void verify_hybrid_blast(verify *v) {
    sphpa_grid radial;
    double t_end = 0.008;
    verify_hybrid_radial(&radial, t_end);
    for (int kind = 0; kind < 3; kind++) {
        static verify_hybrid_rig rig;
        verify_hybrid task;
        verify_row row;
        verify_error e = {0.0, 0.0, 0};
        memset(&task, 0, sizeof task);
        task.problem = "hybrid-blast-rho";
        task.function = verify_hybrid_blast_at;
        task.nx = task.ny = v->quick ? 32 : 56;
        task.low = -0.7, task.width = 1.4 / (double)task.nx;
        task.t_end = t_end;
        task.samples = 4;
        task.g1 = 0.25, task.g2 = 0.5;
        task.published = kind == 1;
        task.threshold = kind < 2 ? 0.2 : 0.0;
        task.floor = 1.0;
        bool ran = verify_hybrid_run(v, &task, &rig, &row);
        for (size_t c = 0; ran && c < rig.hybrid.grid.n; c++) {
            double x = task.low + ((double)(c % task.nx) + 0.5) * task.width;
            double y = task.low + ((double)(c / task.nx) + 0.5) * task.width, r = hypot(x, y);
            if (r > 0.6) continue;
            verify_error_add(&e, rig.hybrid.grid.rho[c] - radial.rho[(size_t)(r / radial.dx[0])]);
        }
        verify_error_put(&row, &e);
        verify_add(v, row);
        sphpa_hybrid_free(&rig.hybrid);
    }
    sphpa_grid_free(&radial);
}

#endif
