/* verify_grid.h: the finite volumes of >>grid on problems with exact solutions. L1 is the mean over
   cells; n counts cells. Grids are always in double, so the float program runs none of this. */
#ifndef VERIFY_GRID_H
#define VERIFY_GRID_H

/* What to run. */
typedef struct verify_grid {
    const char *problem, *scheme;
    sphpa_grid_options options;
    sphpa_grid_function function;
    void *user;
    int samples;  /* along an edge of a cell */
    double t_end; /* [s] */
} verify_grid;

static sphpa_grid_options verify_grid_box(size_t nx, size_t ny, double low, double high) {
    sphpa_grid_options o;
    memset(&o, 0, sizeof o);
    o.nx = nx;
    o.ny = ny;
    for (int a = 0; a < 2; a++) o.low[a] = low, o.high[a] = high;
    return o;
}

/* what is there at the end and what left, against the start; a radius keeps no momentum */
static void verify_grid_drift(verify *v, verify_row *row, const sphpa_grid *grid,
                              const sphpa_grid_sums *start) {
    sphpa_grid_sums now = sphpa_grid_totals(grid);
    double square = 0.0;
    for (int a = 0; a < 2 && grid->options.radial == 0; a++)
        square += pow(now.momentum[a] + grid->left.momentum[a] - start->momentum[a], 2.0);
    row->drift_mass = fabs((now.mass + grid->left.mass) / start->mass - 1.0);
    row->drift_energy = fabs((now.energy + grid->left.energy) / start->energy - 1.0);
    row->drift_momentum = sqrt(square / (2.0 * start->mass * start->energy));
    v->worst_mass = fmax(v->worst_mass, row->drift_mass);
    v->worst_energy = fmax(v->worst_energy, row->drift_energy);
    v->worst_momentum = fmax(v->worst_momentum, row->drift_momentum);
    v->mean_energy += row->drift_energy;
    v->cpu_s += row->cpu_s;
    v->runs++;
}

/* Runs to t_end; the grid is the caller's to free, whatever is returned. false: it broke down. */
static bool verify_grid_run(verify *v, const verify_grid *task, sphpa_grid *grid,
                            verify_row *row) {
    sphpa_error err;
    sphpa_grid_schedule schedule;
    memset(&schedule, 0, sizeof schedule);
    schedule.t_end = task->t_end;
    *row = verify_row_of(task->problem, task->scheme, "none", task->options.ny > 1 ? 2 : 1);
    (void)example_threads(task->options.nx * task->options.ny < 100000 ? 1 : v->max_threads);
    verify_must(sphpa_grid_create(grid, &task->options, &err), &err);
    verify_must(sphpa_grid_fill(grid, task->function, task->user, task->samples, &err), &err);
    row->n = (double)grid->n;
    sphpa_grid_sums start = sphpa_grid_totals(grid);
    verify_show(v, 0.0, false);
    clock_t begun = clock();
    sphpa_result result = sphpa_grid_run(grid, &schedule, &err);
    row->cpu_s = (double)(clock() - begun) / (double)CLOCKS_PER_SEC;
    verify_grid_drift(v, row, grid, &start);
    if (result == SPHPA_OK) return true;
    fprintf(stderr, "verify: %s, %s broke down at t = %g of %g: %s\n", task->problem, task->scheme,
            grid->time, task->t_end, err.message);
    v->broken++;
    return false;
}

/* ---- Riemann problems ------------------------------------------------------------------------ */

/* along x, or along the diagonal of a square */
typedef struct verify_grid_tube {
    const verify_riemann *problem;
    bool diagonal;
} verify_grid_tube;

static double verify_grid_along(const verify_grid_tube *tube, const double x[2]) {
    return tube->diagonal ? (x[0] + x[1]) * sqrt(0.5) : x[0];
}

static void verify_grid_tube_at(const double x[2], void *user, sphpa_grid_state *out) {
    const verify_grid_tube *tube = (const verify_grid_tube *)user;
    const sphpa_riemann_state *side =
        verify_grid_along(tube, x) < 0.0 ? &tube->problem->left : &tube->problem->right;
    out->rho = side->rho;
    out->P = side->P;
    out->v[0] = tube->diagonal ? sqrt(0.5) * side->v : side->v;
    out->v[1] = tube->diagonal ? sqrt(0.5) * side->v : 0.0;
}

/* rho where -0.5 < x < 0.5 along the tube, on the diagonal in a strip that no edge has reached */
static void verify_grid_tube_row(const verify_grid_tube *tube, const sphpa_grid *grid,
                                 verify_row *row) {
    const verify_riemann *r = tube->problem;
    sphpa_riemann_star star;
    verify_error e = {0.0, 0.0, 0};
    if (sphpa_riemann_exact(r->gamma, &r->left, &r->right, &star) != SPHPA_OK) return;
    for (size_t k = 0; k < grid->n; k++) {
        double x[2] = {grid->options.low[0] + grid->dx[0] * ((double)(k % grid->nx) + 0.5),
                       grid->options.low[1] + grid->dx[1] * ((double)(k / grid->nx) + 0.5)};
        double s = verify_grid_along(tube, x);
        if (fabs(s) > 0.5 || (tube->diagonal && fabs(x[0] - x[1]) > 0.2)) continue;
        verify_error_add(&e, grid->rho[k] - verify_riemann_at(r, &star, s, grid->time).rho);
    }
    verify_error_put(row, &e);
}

/* must: of the L1 with n cells; 0: none */
static void verify_grid_tube_run(verify *v, verify_grid_tube tube, const char *name, size_t n,
                                 double t, double must) {
    verify_grid task;
    verify_row row;
    sphpa_grid grid;
    memset(&task, 0, sizeof task);
    task.problem = name;
    task.scheme = tube.diagonal ? "grid+diagonal" : "grid";
    task.options = tube.diagonal ? verify_grid_box(n, n, -0.8, 0.8)
                                 : verify_grid_box(n, 1, -0.5, 0.5);
    task.function = verify_grid_tube_at;
    task.user = &tube;
    task.samples = tube.diagonal ? 4 : 1;
    task.t_end = t;
    if (verify_grid_run(v, &task, &grid, &row)) verify_grid_tube_row(&tube, &grid, &row);
    if (must > 0.0) verify_limit(&row, "l1_error", "<=", must);
    verify_add(v, row);
    sphpa_grid_free(&grid);
}

/* 0.0011 and 0.028 are what pyro2's unsplit solver has with 400 cells (by running it: 0.00112 and
   0.0281). The order: shocks of first order, contacts of some 2/3. */
static void verify_grid_tubes(verify *v) {
    static const int which[] = {VERIFY_SOD,   VERIFY_TORO2, VERIFY_TORO3,
                                VERIFY_TORO4, VERIFY_TORO5, VERIFY_LAX};
    for (size_t k = 0; k < sizeof which / sizeof which[0]; k++) {
        char name[VERIFY_NAME];
        verify_grid_tube tube = {&verify_riemanns[which[k]], false};
        snprintf(name, sizeof name, "grid-%s-rho", tube.problem->name);
        for (int level = 0; level < verify_levels(v, 5); level++) {
            size_t n = (size_t)(v->quick ? 200 : 100) << level;
            double must = n != 400                ? 0.0
                          : which[k] == VERIFY_SOD   ? 0.0011
                          : which[k] == VERIFY_TORO3 ? 0.028
                                                     : 0.0;
            verify_grid_tube_run(v, tube, name, n, tube.problem->t_end, must);
        }
        verify_slope(v, name, 0.7);
    }
    verify_grid_tube tube = {&verify_riemanns[VERIFY_SOD], true};
    for (int level = 0; level < verify_levels(v, 3); level++)
        verify_grid_tube_run(v, tube, "grid-sod-rho", (size_t)128 << level, 0.15, 0.0);
    verify_slope(v, "grid-sod-rho", 0.7);
}

/* ---- smooth flows ---------------------------------------------------------------------------- */

/* a wave of density that the flow carries along, across the cells */
static void verify_grid_wave_at(const double x[2], void *user, sphpa_grid_state *out) {
    (void)user;
    out->rho = 1.0 + 0.2 * sin(2.0 * VERIFY_PI * (x[0] + x[1]));
    out->v[0] = 1.0;
    out->v[1] = 0.5;
    out->P = 1.0;
}

/* a vortex that the flow carries along (Shu 1998, ICASE 97-65), strength 5 */
static void verify_grid_vortex_at(const double x[2], void *user, sphpa_grid_state *out) {
    double r2 = x[0] * x[0] + x[1] * x[1], f = 2.5 / VERIFY_PI * exp(0.5 * (1.0 - r2));
    double T = 1.0 - 0.4 / 2.8 * f * f;
    (void)user;
    out->rho = pow(T, 2.5);
    out->v[0] = 1.0 - x[1] * f;
    out->v[1] = 1.0 + x[0] * f;
    out->P = pow(T, 3.5);
}

/* once round a periodic box: rho against that of the start */
static void verify_grid_round(verify *v, const verify_grid *task) {
    verify_row row;
    sphpa_grid grid, start;
    sphpa_error err;
    verify_error e = {0.0, 0.0, 0};
    bool ran = verify_grid_run(v, task, &grid, &row);
    verify_must(sphpa_grid_create(&start, &task->options, &err), &err);
    verify_must(sphpa_grid_fill(&start, task->function, task->user, task->samples, &err), &err);
    for (size_t k = 0; ran && k < grid.n; k++)
        verify_error_add(&e, grid.rho[k] - start.rho[k]);
    verify_error_put(&row, &e);
    verify_add(v, row);
    sphpa_grid_free(&grid);
    sphpa_grid_free(&start);
}

/* with every slope: the limiter clips extrema, but on a part of the flow that shrinks */
static void verify_grid_smooth(verify *v) {
    static const char *const schemes[] = {"grid", "grid+mc", "grid+unlimited"};
    for (int slope = 0; slope <= SPHPA_GRID_UNLIMITED; slope++)
        for (int vortex = 0; vortex < 2; vortex++) {
            verify_grid task;
            memset(&task, 0, sizeof task);
            task.problem = vortex ? "grid-vortex" : "grid-wave";
            task.scheme = schemes[slope];
            task.function = vortex ? verify_grid_vortex_at : verify_grid_wave_at;
            task.samples = 6;
            task.t_end = vortex ? 10.0 : 2.0;
            for (int level = 0; level < verify_levels(v, 4); level++) {
                size_t n = (size_t)(v->quick ? 64 : 32) << level;
                task.options = vortex ? verify_grid_box(n, n, -5.0, 5.0)
                                      : verify_grid_box(n, n, 0.0, 1.0);
                for (int a = 0; a < 2; a++)
                    task.options.edge_low[a] = task.options.edge_high[a] = SPHPA_GRID_PERIODIC;
                task.options.slope = slope;
                verify_grid_round(v, &task);
            }
            verify_slope(v, task.problem, 1.9); /* it is a scheme of second order */
        }
}

/* ---- explosions and implosions --------------------------------------------------------------- */

typedef struct verify_grid_ball {
    double radius, P_in, P, v; /* v: radial velocity outside; rho is 1 */
} verify_grid_ball;

static void verify_grid_ball_at(const double x[2], void *user, sphpa_grid_state *out) {
    const verify_grid_ball *ball = (const verify_grid_ball *)user;
    double r = sqrt(x[0] * x[0] + x[1] * x[1]);
    bool outside = r >= ball->radius && r > 0.0;
    out->rho = 1.0;
    out->P = outside ? ball->P : ball->P_in;
    out->v[0] = outside ? ball->v * x[0] / r : 0.0;
    out->v[1] = outside ? ball->v * x[1] / r : 0.0;
}

/* along a radius the middle of y is 0 */
static sphpa_grid_options verify_grid_radius(size_t n, double high, int radial) {
    sphpa_grid_options o = verify_grid_box(n, 1, 0.0, high);
    o.radial = radial;
    o.low[1] = -0.5, o.high[1] = 0.5;
    o.edge_low[0] = SPHPA_GRID_REFLECTING;
    return o;
}

/* outermost place on the x axis where rho is half of its most there; *most: that */
static double verify_grid_shock(const sphpa_grid *grid, double *most) {
    size_t line = grid->nx * (grid->ny / 2);
    double place = 0.0;
    *most = 0.0;
    for (size_t i = 0; i < grid->nx; i++) *most = fmax(*most, grid->rho[line + i]);
    for (size_t i = 0; i + 1 < grid->nx; i++) {
        double a = grid->rho[line + i], b = grid->rho[line + i + 1], half = 0.5 * *most;
        if (a >= half && b < half)
            place = grid->options.low[0] +
                    grid->dx[0] * ((double)i + 0.5 + (a - half) / (a - b));
    }
    return place;
}

/* Energy 1, the shock at 1: xi0 of the exact solution. l1: of the radius; linf: how much of the
   density 6 behind the shock is missing. First order, both. */
static void verify_grid_sedov_run(verify *v, const char *problem, size_t n, int dim, bool plane) {
    verify_grid task;
    verify_row row;
    sphpa_grid grid;
    verify_grid_ball ball = {plane ? 0.06 : 0.03, 0.0, 1e-5, 0.0};
    double r = ball.radius, most, xi[4] = {0.0, 0.0, 1.0040216, 1.0327775};
    ball.P_in = 0.4 / (dim == 3 ? 4.0 / 3.0 * VERIFY_PI * r * r * r : VERIFY_PI * r * r);
    memset(&task, 0, sizeof task);
    task.problem = problem;
    task.scheme = plane ? "grid" : dim == 2 ? "grid+radial=1" : "grid+radial=2";
    task.options = plane ? verify_grid_box(n, n, -1.2, 1.2) : verify_grid_radius(n, 1.2, dim - 1);
    task.function = verify_grid_ball_at;
    task.user = &ball;
    task.samples = plane ? 8 : 1;
    task.t_end = pow(xi[dim], -0.5 * (dim + 2));
    bool ran = verify_grid_run(v, &task, &grid, &row);
    row.l1_error = ran ? fabs(verify_grid_shock(&grid, &most) - 1.0) : (double)NAN;
    row.linf_error = ran ? fabs(1.0 - most / 6.0) : (double)NAN;
    verify_add(v, row);
    sphpa_grid_free(&grid);
}

static void verify_grid_sedov(verify *v) {
    for (int level = 0; level < verify_levels(v, 3); level++) {
        verify_grid_sedov_run(v, "grid-sedov2-shock", (size_t)240 << level, 2, false);
        verify_grid_sedov_run(v, "grid-sedov3-shock", (size_t)240 << level, 3, false);
    }
    verify_slope(v, "grid-sedov2-shock", 0.7);
    verify_slope(v, "grid-sedov3-shock", 0.7);
    for (int level = 0; level < verify_levels(v, 3); level++)
        verify_grid_sedov_run(v, "grid-sedov-plane-shock", ((size_t)100 << level) + 1, 2, true);
    verify_slope(v, "grid-sedov-plane-shock", 0.7);
}

/* rho for r in [0.05, 0.35]: the centre is left to wall heating, which every scheme has. Spheral's
   GSPH has 0.0484 in the plane with 100 points there. */
static void verify_grid_noh(verify *v) {
    static const char *const names[] = {"grid-noh1", "grid-noh2", "grid-noh3"};
    static const char *const schemes[] = {"grid", "grid+radial=1", "grid+radial=2"};
    for (int radial = 0; radial <= 2; radial++) {
        for (int level = 0; level < verify_levels(v, 4); level++) {
            verify_grid task;
            verify_row row;
            sphpa_grid grid;
            verify_error e = {0.0, 0.0, 0};
            verify_grid_ball ball = {0.0, 1.0, 1e-6, -1.0};
            memset(&task, 0, sizeof task);
            task.problem = names[radial];
            task.scheme = schemes[radial];
            task.options = verify_grid_radius((size_t)100 << level, 1.6, radial);
            task.options.gamma = 5.0 / 3.0;
            task.function = verify_grid_ball_at;
            task.user = &ball;
            task.t_end = 0.6;
            bool ran = verify_grid_run(v, &task, &grid, &row);
            for (size_t i = 0; ran && i < grid.n; i++) {
                double r = grid.dx[0] * ((double)i + 0.5);
                if (r < 0.05 || r > 0.35) continue;
                double exact = r < 0.2 ? pow(4.0, radial + 1) : pow(1.0 + 0.6 / r, radial);
                verify_error_add(&e, grid.rho[i] - exact);
            }
            verify_error_put(&row, &e);
            verify_add(v, row);
            sphpa_grid_free(&grid);
        }
        verify_slope(v, names[radial], 0.7);
    }
}

/* ---- two blasts (Woodward & Colella 1984, J. Comput. Phys. 54, 115) ------------------------- */

static void verify_grid_blasts_at(const double x[2], void *user, sphpa_grid_state *out) {
    (void)user;
    out->rho = 1.0;
    out->v[0] = out->v[1] = 0.0;
    out->P = x[0] < 0.1 ? 1000.0 : x[0] < 0.9 ? 0.01 : 100.0;
}

/* about the largest rho between two shares of the box: the middle of where it is 0.9 of that;
   sharp: its own place */
static double verify_grid_peak(const sphpa_grid *grid, double from, double to, bool sharp) {
    size_t first = (size_t)(from * (double)grid->n), last = (size_t)(to * (double)grid->n);
    size_t best = first;
    for (size_t i = first; i < last; i++)
        if (grid->rho[i] > grid->rho[best]) best = i;
    if (sharp) return ((double)best + 0.5) * grid->dx[0];
    while (grid->rho[first] < 0.9 * grid->rho[best]) first++;
    while (grid->rho[last] < 0.9 * grid->rho[best]) last--;
    return 0.5 * (double)(first + last + 1) * grid->dx[0];
}

/* rho against the means of a run with 2400 cells. In that: the peak at the shock at 0.65 and the
   middle of the dense gas between the contacts at 0.76 and 0.80 of their figure 2 (read off:
   0.005). */
static void verify_grid_two_blasts(verify *v) {
    enum { FINE = 2400 };
    verify_grid task;
    verify_row row;
    sphpa_grid fine, grid;
    memset(&task, 0, sizeof task);
    task.problem = "grid-two-blasts-peaks";
    task.scheme = "grid";
    task.options = verify_grid_box(FINE, 1, 0.0, 1.0);
    task.options.edge_low[0] = task.options.edge_high[0] = SPHPA_GRID_REFLECTING;
    task.function = verify_grid_blasts_at;
    task.t_end = 0.038;
    bool ran = verify_grid_run(v, &task, &fine, &row);
    row.linf_error = fmax(fabs(verify_grid_peak(&fine, 0.6, 0.7, true) - 0.65),
                          fabs(verify_grid_peak(&fine, 0.7, 0.85, false) - 0.78));
    verify_limit(&row, "linf_error", "<=", 0.005);
    verify_add(v, row);
    task.problem = "grid-two-blasts-rho";
    for (int level = 0; ran && level < verify_levels(v, 4); level++) {
        size_t n = (size_t)150 << level, each = FINE / n;
        verify_error e = {0.0, 0.0, 0};
        task.options.nx = n;
        ran = verify_grid_run(v, &task, &grid, &row);
        for (size_t i = 0; i < n; i++) {
            double mean = 0.0;
            for (size_t k = 0; k < each; k++) mean += fine.rho[each * i + k] / (double)each;
            verify_error_add(&e, grid.rho[i] - mean);
        }
        verify_error_put(&row, &e);
        verify_add(v, row);
        sphpa_grid_free(&grid);
    }
    verify_slope(v, "grid-two-blasts-rho", 0.7);
    sphpa_grid_free(&fine);
}

#endif
