/* bench_grid.c: how many cell-steps a second and core, and how wrong is what comes out?

   The problem of the hybrid code's scripts (Myers et al. 2024): in [-1, 1]^2 a disc of r = 0.1 with
   P = 1000 and rho = 1.001 in a gas of P = 0.01 and rho = 1, until t = 0.025. Each row is a whole
   run, with everything that a step needs. Its speed is the median over windows of some steps; its
   error is the mean of |rho - reference| over all cells inside the unit circle, the reference a run
   along the radius with 8000 cells; and how far the shock is from the reference's: where the mean
   of P over rings is half of its largest, outermost. */
#include "../examples/example.h"

#define SPHPA_GRID_IMPLEMENTATION
#include "sphpa.h"

#include "bench_clock.h"

enum { GRID_REFERENCE = 8000, GRID_WINDOWS = 4096, GRID_ROWS = 16 };
#define GRID_RADIUS 0.1
#define GRID_END 0.025

typedef struct grid_row {
    size_t cells; /* along an edge */
    int threads;
    uint64_t steps, fallbacks;
    double per_cpu, per_wall, spread; /* [1/s] cell-steps; [%] of the windows */
    double error, shock, mass, energy; /* drifts with what left */
    double at[GRID_WINDOWS], wall[GRID_WINDOWS];
} grid_row;

static void grid_start(const double x[2], void *user, sphpa_grid_state *out) {
    bool radial = *(const int *)user != 0;
    double r = radial ? x[0] : sqrt(x[0] * x[0] + x[1] * x[1]);
    out->rho = r < GRID_RADIUS ? 1.001 : 1.0;
    out->P = r < GRID_RADIUS ? 1000.0 : 0.01;
    out->v[0] = out->v[1] = 0.0;
}

static void grid_must(sphpa_result result, const sphpa_error *err) {
    if (result != SPHPA_OK) example_fail(1, "bench_grid: %s", err->message);
}

static void grid_make(sphpa_grid *grid, size_t nx, int radial) {
    sphpa_grid_options o;
    sphpa_error err;
    memset(&o, 0, sizeof o);
    o.nx = nx;
    o.ny = radial ? 1 : nx;
    o.radial = radial;
    o.low[0] = o.low[1] = radial ? 0.0 : -1.0;
    o.high[0] = o.high[1] = 1.0;
    grid_must(sphpa_grid_create(grid, &o, &err), &err);
    grid_must(sphpa_grid_fill(grid, grid_start, &radial, radial ? 1 : 8, &err), &err);
}

static double grid_pressure(const sphpa_grid *grid, size_t k) {
    sphpa_grid_state q = {0.0, {0.0, 0.0}, 0.0};
    (void)sphpa_grid_primitive(grid, k % grid->nx, k / grid->nx, &q);
    return q.P;
}

/* the outermost radius where the mean over rings of width dx is half of its largest */
static double grid_shock(const sphpa_grid *grid, bool radial) {
    static double sum[GRID_REFERENCE], count[GRID_REFERENCE];
    double dx = grid->dx[0], most = 0.0;
    size_t rings = radial ? grid->nx : grid->nx / 2;
    memset(sum, 0, sizeof sum);
    memset(count, 0, sizeof count);
    for (size_t k = 0; k < grid->n; k++) {
        double x = grid->options.low[0] + dx * ((double)(k % grid->nx) + 0.5);
        double y = radial ? 0.0 : grid->options.low[1] + dx * ((double)(k / grid->nx) + 0.5);
        size_t ring = (size_t)(sqrt(x * x + y * y) / dx);
        if (ring >= rings) continue;
        sum[ring] += grid_pressure(grid, k);
        count[ring] += 1.0;
    }
    for (size_t k = 0; k < rings; k++) sum[k] /= count[k], most = fmax(most, sum[k]);
    for (size_t k = rings - 1; k > 0; k--)
        if (sum[k - 1] >= 0.5 * most && sum[k] < 0.5 * most)
            return dx * ((double)k - 0.5 + (sum[k - 1] - 0.5 * most) / (sum[k - 1] - sum[k]));
    return 0.0;
}

/* the reference's mean over the ring that a cell is about: of the width of the cell */
static double grid_error(const sphpa_grid *grid, const sphpa_grid *reference) {
    double dx = grid->dx[0], sum = 0.0, count = 0.0;
    for (size_t k = 0; k < grid->n; k++) {
        double x = grid->options.low[0] + dx * ((double)(k % grid->nx) + 0.5);
        double y = grid->options.low[1] + dx * ((double)(k / grid->nx) + 0.5);
        double r = sqrt(x * x + y * y);
        if (r >= 1.0) continue;
        size_t i = (size_t)(r * GRID_REFERENCE);
        sum += fabs(grid->rho[k] - reference->rho[i]);
        count += 1.0;
    }
    return sum / count;
}

/* to the end, in windows of at least 65536 cell-steps */
static void grid_time(sphpa_grid *grid, grid_row *row) {
    int windows = 0;
    sphpa_error err;
    while (grid->time < GRID_END) {
        uint64_t first = grid->stats.steps;
        double cpu = bench_user_time(), wall = sphpa_wall_clock(), updates = 0.0;
        while (grid->time < GRID_END && updates < 65536.0) {
            grid_must(sphpa_grid_step(grid, GRID_END - grid->time, &err), &err);
            updates = (double)(grid->stats.steps - first) * (double)grid->n;
        }
        if (windows == GRID_WINDOWS || updates < 65536.0) continue;
        row->at[windows] = updates / fmax(bench_user_time() - cpu, 1e-9);
        row->wall[windows++] = updates / fmax(sphpa_wall_clock() - wall, 1e-9);
    }
    double ignored;
    row->per_cpu = windows > 0 ? bench_median(row->at, windows, &row->spread) : (double)NAN;
    row->per_wall = windows > 0 ? bench_median(row->wall, windows, &ignored) : (double)NAN;
}

static void grid_run(grid_row *row, const sphpa_grid *reference, double shock) {
    sphpa_grid grid;
    (void)example_threads(row->threads);
    grid_make(&grid, row->cells, 0);
    sphpa_grid_sums start = sphpa_grid_totals(&grid);
    grid_time(&grid, row);
    sphpa_grid_sums end = sphpa_grid_totals(&grid);
    row->steps = grid.stats.steps;
    row->fallbacks = grid.stats.fallbacks;
    row->error = grid_error(&grid, reference);
    row->shock = grid_shock(&grid, false) / shock - 1.0;
    row->mass = (end.mass + grid.left.mass) / start.mass - 1.0;
    row->energy = (end.energy + grid.left.energy) / start.energy - 1.0;
    sphpa_grid_free(&grid);
}

static void grid_print(FILE *to, const grid_row *row, bool csv) {
    fprintf(to,
            csv ? "%zu,%d,%llu,%.4e,%.4e,%.2f,%.4e,%.4e,%.2e,%.2e,%llu\n"
                : "%6zu %8d %6llu %12.3e %12.3e %8.1f %11.4e %11.3e %9.1e %9.1e %9llu\n",
            row->cells, row->threads, (unsigned long long)row->steps, row->per_cpu, row->per_wall,
            row->spread, row->error, row->shock, row->mass, row->energy,
            (unsigned long long)row->fallbacks);
}

int main(int argc, char **argv) {
    const char *out = "build/bench";
    int quick = 0;
    const example_option options[] = {
        example_flag("quick", &quick, "up to 256^2"),
        example_text("out", "FOLDER", &out, "for grid.csv"),
    };
    example_parse(argc, argv, "cell-steps a second and core of the finite volumes", SPHPA_VERSION,
                  options, (int)(sizeof options / sizeof options[0]));
    example_folder(out);
    static grid_row rows[GRID_ROWS];
    sphpa_grid reference;
    sphpa_error err;
    char cpu[128];
    int count = 0, all = example_threads(0);
    bench_read_cpu(cpu);
    printf("# %s\n# %s %s\n", cpu, BENCH_COMPILER, BENCH_FLAGS);
    printf("# a disc of P = 1000 in P = 0.01, until t = %g\n", GRID_END);
    grid_make(&reference, GRID_REFERENCE, 1);
    while (reference.time < GRID_END)
        grid_must(sphpa_grid_step(&reference, GRID_END - reference.time, &err), &err);
    double shock = grid_shock(&reference, true);
    printf("# reference: shock at %.5f\n", shock);
    printf("# cells  threads  steps  per CPU s   per wall s  spread%%    L1 rho       shock"
           "      mass    energy fallbacks\n");
    for (size_t cells = 64; cells <= (quick ? 256u : 1024u); cells *= 2)
        for (int k = 0; k < (all > 1 ? 2 : 1); k++) {
            rows[count].cells = cells;
            rows[count].threads = k == 0 ? 1 : all;
            grid_run(&rows[count], &reference, shock);
            grid_print(stdout, &rows[count++], false);
            fflush(stdout);
        }
    example_file file = example_open(out, "grid.csv");
    fprintf(file.stream, "cells,threads,steps,cell_steps_per_cpu_s,cell_steps_per_wall_s,"
                         "spread_pct,l1_rho,shock_rel,drift_mass,drift_energy,fallbacks\n");
    for (int k = 0; k < count; k++) grid_print(file.stream, &rows[k], true);
    example_close(&file);
    sphpa_grid_free(&reference);
    return 0;
}
