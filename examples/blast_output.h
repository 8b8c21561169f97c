/* blast_output.h: runs of blast.c from one output to the next: logs, profiles, tables, pictures. */
#ifndef BLAST_OUTPUT_H
#define BLAST_OUTPUT_H

/* ---- the report ------------------------------------------------------------------------------ */

/* What is printed, and kept as report.txt. */
typedef struct blast_report {
    size_t length;
    char text[32768];
} blast_report;

static void blast_say(blast_report *report, const char *format, ...) EXAMPLE_PRINTF(2, 3);

static void blast_say(blast_report *report, const char *format, ...) {
    size_t room = sizeof report->text - report->length;
    char *at = report->text + report->length;
    va_list args;
    va_start(args, format);
    int n = vsnprintf(at, room, format, args);
    va_end(args);
    if (n > 0) report->length += (size_t)n < room ? (size_t)n : room - 1;
    fputs(at, stdout);
    fflush(stdout);
}

static void blast_keep_report(const blast_report *report, const char *out) {
    example_file file = example_open(out, "report.txt");
    fputs(report->text, file.stream);
    example_close(&file);
}

/* every parameter of the case, each line begun with `mark` */
static void blast_case_text(const blast_settings *s, const char *mark, char *text, size_t size) {
    char scheme[32], kernel[32], riemann[32], slopes[32], density[32], flag[32], coupling[32], buffer[64], h_max[32], merge[32];
    blast_word(BLAST_SCHEME_WORDS, s->scheme, scheme);
    blast_word(BLAST_KERNEL_WORDS, s->kernel, kernel);
    blast_word(BLAST_RIEMANN_WORDS, s->riemann, riemann);
    blast_word(BLAST_SLOPES_WORDS, s->slopes, slopes);
    blast_word(BLAST_DENSITY_WORDS, s->by_mass, density);
    blast_word(BLAST_FLAG_WORDS, s->flag_by, flag);
    blast_word(BLAST_COUPLING_WORDS, s->published, coupling);
    snprintf(buffer, sizeof buffer, "%ld cells", s->buffer);
    if (s->buffer == 0) snprintf(buffer, sizeof buffer, "as wide as sums need");
    snprintf(merge, sizeof merge, "below %g of a new one", s->merge > 0.0 ? s->merge : 1.0);
    if (s->merge < 0.0 || s->published || s->threshold == 0.0) snprintf(merge, sizeof merge, "not");
    snprintf(h_max, sizeof h_max, "%g m", s->h_max);
    if (s->h_max == 0.0) snprintf(h_max, sizeof h_max, "any");
    snprintf(text, size,
             "%s%g kt = %.5g J in one metre; charge: radius %g m, %g kg/m3, %.5g Pa; air: %g kg/m3, "
             "%g Pa; gamma %g\n"
             "%sdx = %g m, until %g us; finite volumes: cfl %g; domain %s\n"
             "%sparticles: %s, density by %s, %s kernel, eta %g, h <= %s, pilot %g, Riemann %s, slopes %s, g1 %g, g2 %g, cfl %g; "
             "%ld x %ld where the charge is; dt <= %.4g s step^2 until %g us%s\n"
             "%shybrid: beta %ld (mesh %g m), threshold %g by %s, active %ld, buffer %s, coupling %s, particles merge %s\n",
             mark, s->yield, blast_energy(s), s->radius, s->rho_charge, blast_charge_pressure(s),
             s->rho_air, s->P_air, s->gamma, mark, s->dx, 1e6 * s->t_end, s->cfl_mesh,
             s->fixed ? "fixed" : "grows (10 m, +5 to 50, +10 to 100, +25)", mark, scheme, density, kernel,
             s->eta, h_max, s->pilot, riemann, slopes, s->g1, s->g2, s->cfl, s->split, s->split,
             s->dt_start, 1e6 * BLAST_EARLY,
             s->dt_start > 0.0 ? "" : " (0: no such limit)", mark, s->beta,
             s->dx * (double)s->beta, s->threshold, flag, s->active, buffer, coupling, merge);
}

static void blast_tell_case(const blast_settings *s, int threads, blast_report *report) {
    char text[2048];
    blast_case_text(s, "", text, sizeof text);
    blast_say(report, "%sthreads: %d\n", text, threads);
}

/* ---- the reference's search ------------------------------------------------------------------ */

static void blast_write_reference(const blast_settings *s, const blast_reference *reference,
                                  const char *out) {
    char name[64];
    for (int k = 0; k < s->times; k++) {
        const blast_reference_at *at = &reference->at[k];
        snprintf(name, sizeof name, "blast_reference_%g.dat", 1e6 * s->time[k]);
        example_file file = example_open(out, name);
        fprintf(file.stream, "# t = %.6e s: r[m] rho[kg/m3] P[Pa]\n", s->time[k]);
        for (int i = 0; i < at->cells; i++)
            fprintf(file.stream, "%.6g %.6g %.6g\n", (i + 0.5) * at->dr, at->rho[i], at->P[i]);
        example_close(&file);
    }
    example_file file = example_open(out, "blast_reference.log");
    fprintf(file.stream, "# t[s] R[m] peak rho[kg/m3] all rho[kg/m3] change of R[m] error of R[m] "
                         "cells dr[m]\n");
    for (int k = 0; k < s->times; k++) {
        const blast_reference_at *at = &reference->at[k];
        fprintf(file.stream, "%.6e %.6g %.6g %.6g %.3e %.3e %d %.6g\n", s->time[k], at->shell.radius,
                at->shell.rho_peak, at->shell.rho_max, at->change, at->error, at->cells, at->dr);
    }
    example_close(&file);
}

static void blast_tell_reference(const blast_settings *s, const blast_reference *reference,
                                 double seconds, blast_report *report) {
    int open = 0;
    blast_say(report, "reference: 1-D, cylindrical symmetry, %.1f s of CPU; R changed by so much as "
                      "its cells were doubled to so many\n", seconds);
    blast_say(report, "t [us]     R [m]      change     error est.  peak rho  of all   [kg/m3]  cells  "
                      "dr [m]\n");
    for (int k = 0; k < s->times; k++) {
        const blast_reference_at *at = &reference->at[k];
        open += blast_reference_settled(at, s) ? 0 : 1;
        blast_say(report, "%-9g  %-9.4f  %-9.1e  %-9.1e   %-8.3f  %-8.4g          %-6d %.2g\n",
                  1e6 * s->time[k], at->shell.radius, at->change / fmax(at->shell.radius, 1e-300),
                  at->error, at->shell.rho_peak, at->shell.rho_max, at->cells, at->dr);
    }
    if (open == 0)
        blast_say(report, "all changes are within the tolerance of %g of R\n", s->tolerance);
    else blast_say(report, "NOT CONVERGED: %d of them changed by more than %g of R; give a larger "
                           "--tolerance\n", open, s->tolerance);
}

/* The exit status: 130 where it was interrupted. */
static int blast_find_reference(const blast_settings *s, const blast_options *o,
                                blast_reference *reference, blast_report *report) {
    sphpa_error err;
    double since = blast_cpu();
    for (int k = 0; k < s->times; k++) {
        if (!o->quiet) fprintf(stderr, "reference: %g us\n", 1e6 * s->time[k]);
        sphpa_result result = blast_reference_refine(s, o->stop, s->time[k], &reference->at[k], &err);
        if (result == SPHPA_STOPPED) return 130;
        if (result != SPHPA_OK) example_fail(1, "reference: %s", err.message);
    }
    blast_tell_reference(s, reference, blast_cpu() - since, report);
    blast_write_reference(s, reference, o->out);
    return 0;
}

/* The side of fixed domains and of the hybrid's: holds the shock, with room for the hybrid's cells
   around it, which must not be those at the edges. */
static void blast_set_size(blast_settings *s, const blast_reference *reference,
                           blast_report *report) {
    double R = reference->at[s->times - 1].shell.radius, mesh = s->dx * (double)s->beta;
    double wide = s->buffer > 0 ? (double)s->buffer
                                : ceil(blast_reach(s) * 3.0 * s->eta / (double)s->beta);
    double half = fmax(1.05 * R, s->radius) + ((double)s->active + wide + 2.0) * mesh;
    if (s->size == 0.0) s->size = blast_side_that_holds(half);
    else if (s->size < 2.0 * half)
        blast_say(report, "the shock at the end is at %.4g m: it leaves, or comes close to the edges "
                          "of, domains of %g m; --size 0 chooses one\n", R, s->size);
    blast_say(report, "side of the hybrid's and of fixed domains: %g m\n", s->size);
}

/* ---- one run --------------------------------------------------------------------------------- */

/* What one output found. */
typedef struct blast_record {
    double time; /* [s] */
    blast_shell shell;
    double L1;   /* [1] */
    double mass, momentum[2], energy; /* [1] drifts */
    double unplaced, exchanged;       /* [1] hybrid: energy that (7) left out, that it moved */
    uint64_t steps, substeps;
    size_t particles, cells;
    size_t bytes; /* of fields, a particle */
    double cpu, wall; /* [s] */
} blast_record;

typedef struct blast_result {
    int method, count, failed;
    char why[600]; /* it ended early; empty: it did not */
    blast_record record[BLAST_TIMES];
} blast_result;

static void blast_record_now(const blast_run *run, const blast_profile *profile,
                             const blast_reference *reference, int k, blast_record *record) {
    const blast_settings *s = run->s;
    sphpa_grid_sums now = blast_sums(run), begun = run->begun;
    double momentum = sqrt(2.0 * begun.mass * begun.energy);
    memset(record, 0, sizeof *record);
    record->time = s->time[k];
    record->shell = blast_shell_of(profile->rho, profile->P, profile->count, profile->width, s->P_air,
                                   reference->at[k].shell.P_peak);
    record->L1 = blast_L1(profile, s->rho_air, &reference->at[k]);
    record->mass = (now.mass - begun.mass) / begun.mass;
    record->energy = (now.energy - begun.energy) / begun.energy;
    for (int a = 0; a < 2; a++)
        record->momentum[a] = (now.momentum[a] - begun.momentum[a]) / momentum;
    if (run->method == BLAST_HYBRID) {
        record->unplaced = run->hybrid.stats.unplaced.energy / begun.energy;
        record->exchanged = run->hybrid.stats.exchanged_energy / begun.energy;
        record->substeps = run->hybrid.stats.substeps;
    }
    record->steps = blast_steps(run);
    record->particles = blast_particles(run);
    record->cells = blast_cells(run);
    record->bytes = blast_bytes(run);
    record->cpu = run->cpu;
    record->wall = run->wall;
}

/* all outputs so far, with the case on top: rewritten at each, so that it is always whole */
static void blast_write_log(const blast_result *result, const blast_settings *s,
                            const blast_reference *reference, const char *out) {
    char name[64], text[2048];
    snprintf(name, sizeof name, "blast_%s.log", blast_method_name(result->method));
    blast_case_text(s, "# ", text, sizeof text);
    example_file file = example_open(out, name);
    fprintf(file.stream,
            "%s# drifts: see --help; hybrid: energy that found no place is part of its drift\n"
            "# %10s %12s %12s %12s %12s %12s %12s %10s %10s %10s %10s %12s %12s %12s %12s %12s "
            "%12s %10s %12s %12s %9s\n",
            text, "t[s]", "R[m]", "rho[kg/m3]", "R_ref[m]", "rho_ref", "L1", "steps", "particles",
            "cells", "cpu[s]", "mass", "px", "py", "energy", "all rho", "P[Pa]", "wall[s]",
            "substeps", "unplaced E", "exchanged E", "own shell");
    for (int k = 0; k < result->count; k++) {
        const blast_record *r = &result->record[k];
        fprintf(file.stream,
                "%12.6e %12.5f %12.5f %12.5f %12.5f %12.5e %12llu %10zu %10zu %10.3f %10.2e %12.3e "
                "%12.3e %12.3e %12.5f %12.5e %12.3f %10llu %12.3e %12.3e %9d\n",
                r->time, r->shell.radius, r->shell.rho_peak, reference->at[k].shell.radius,
                blast_reference_peak(&reference->at[k], s), r->L1, (unsigned long long)r->steps, r->particles,
                r->cells, r->cpu, r->mass, r->momentum[0], r->momentum[1], r->energy,
                r->shell.rho_max, r->shell.P_peak, r->wall, (unsigned long long)r->substeps,
                r->unplaced, r->exchanged, r->shell.borrowed ? 0 : 1);
    }
    example_close(&file);
}

static void blast_write_profile(const blast_run *run, const blast_profile *profile, double time) {
    char name[64];
    snprintf(name, sizeof name, "blast_%s_%g.dat", blast_method_name(run->method), 1e6 * time);
    example_file file = example_open(run->out, name);
    fprintf(file.stream, "# t = %.6e s, means in rings: r[m] rho[kg/m3] P[Pa] area[m2]\n", time);
    for (int k = 0; k < profile->count; k++)
        fprintf(file.stream, "%.6g %.6g %.6g %.6g\n", (k + 0.5) * profile->width, profile->rho[k],
                profile->P[k], profile->area[k]);
    example_close(&file);
}

#define BLAST_VIEW 1.6 /* [R] half of what pictures of the plane show: the hybrid's particles too */

/* ---- what the plane looks like --------------------------------------------------------------- */

/* the edges between cells of another kind, as line segments */
static void blast_write_outline(const sphpa_hybrid *h, int kind, const char *out, const char *name) {
    const sphpa_grid *grid = &h->grid;
    example_file file = example_open(out, name);
    fprintf(file.stream, "# x[m] y[m] dx[m] dy[m] of edges\n");
    for (size_t c = 0; c < grid->n; c++) {
        size_t i = c % grid->nx, j = c / grid->nx;
        double x = grid->options.low[0] + (double)(i + 1) * grid->dx[0];
        double y = grid->options.low[1] + (double)(j + 1) * grid->dx[1];
        bool in = (h->cell[c] & 3) >= kind;
        if (i + 1 < grid->nx && in != ((h->cell[c + 1] & 3) >= kind))
            fprintf(file.stream, "%.6g %.6g 0 %.6g\n", x, y - grid->dx[1], grid->dx[1]);
        if (j + 1 < grid->ny && in != ((h->cell[c + grid->nx] & 3) >= kind))
            fprintf(file.stream, "%.6g %.6g %.6g 0\n", x - grid->dx[0], y, grid->dx[0]);
    }
    if (h->stats.cells == 0) fprintf(file.stream, "0 0 0 0\n"); /* gnuplot wants something */
    example_close(&file);
}

/* a mesh on at most 400 x 400 points within |x|, |y| < half */
static void blast_write_mesh(const sphpa_grid *grid, double half, const char *out,
                             const char *name) {
    double *P = blast_pressures(grid), rho = 0.0, pressure = 0.0;
    half = fmin(half, grid->options.high[0]);
    int n = (int)fmin(400.0, ceil(2.0 * half / grid->dx[0]));
    example_file file = example_open(out, name);
    fprintf(file.stream, "# x[m] y[m] rho[kg/m3] P[Pa]\n");
    for (int k = 0; k < n * n; k++) {
        double x = half * ((2 * (k % n) + 1.0) / n - 1.0), y = half * ((2 * (k / n) + 1.0) / n - 1.0);
        blast_grid_state(grid, grid->rho, P, x, y, &rho, &pressure);
        fprintf(file.stream, "%.6g %.6g %.6g %.6g\n", x, y, rho, pressure);
    }
    example_close(&file);
    free(P);
}

/* particles within |x|, |y| < half: the driven ones too, marked */
static void blast_write_particles(const sphpa_sim *sim, double half, const char *out,
                                  const char *name) {
    const sphpa_particles *p = &sim->p;
    example_file file = example_open(out, name);
    fprintf(file.stream, "# x[m] y[m] rho[kg/m3] P[Pa] driven width[m]\n");
    for (size_t i = 0; i < p->n; i++) {
        const double *x = p->x + 3 * i;
        if (fmax(fabs(x[0]), fabs(x[1])) < half && p->ghost[i] <= 1)
            fprintf(file.stream, "%.6g %.6g %.6g %.6g %d %.6g\n", x[0], x[1], p->rho[i],
                    (double)p->P[i], (int)p->ghost[i], sqrt((double)p->m[i] / p->rho[i]));
    }
    example_close(&file);
}

static void blast_write_plane(const blast_run *run, double half) {
    const char *out = run->out;
    if (run->method == BLAST_FVM) blast_write_mesh(&run->grid, half, out, "plane_fvm.dat");
    if (run->method == BLAST_SPH) blast_write_particles(&run->sim, half, out, "plane_sph.dat");
    if (run->method != BLAST_HYBRID) return;
    blast_write_mesh(&run->hybrid.grid, half, out, "plane_hybrid.dat");
    blast_write_outline(&run->hybrid, SPHPA_HYBRID_ACTIVE, out, "plane_active.dat");
    blast_write_outline(&run->hybrid, SPHPA_HYBRID_BUFFER, out, "plane_buffer.dat");
    if (run->hybrid.running)
        blast_write_particles(&run->hybrid.sim, half, out, "plane_particles.dat");
}

/* one quadrant of the mesh in a step that made cells of it the particles': the paper's figure 3 */
static void blast_write_flags(blast_run *run) {
    const sphpa_hybrid *h = &run->hybrid;
    const sphpa_grid *grid = &h->grid;
    double half = 0.0, width = grid->dx[0];
    example_file file = example_open(run->out, "flags.dat");
    fprintf(file.stream, "# t = %.6e s: x[m] y[m] rho[kg/m3] flagged kind was (0 mesh, 1 buffer, 2 "
                         "active)\n", grid->time);
    for (size_t c = 0; c < grid->n; c++) {
        double x = grid->options.low[0] + ((double)(c % grid->nx) + 0.5) * width;
        double y = grid->options.low[1] + ((double)(c / grid->nx) + 0.5) * width;
        if (x < 0.0 || y < 0.0) continue;
        if ((h->cell[c] & 3) != SPHPA_HYBRID_MESH) half = fmax(half, fmax(x, y) + 2.5 * width);
        fprintf(file.stream, "%.6g %.6g %.6g %d %d %d\n", x, y, grid->rho[c],
                h->cell[c] & SPHPA_HYBRID_FLAGGED ? 1 : 0, h->cell[c] & 3, run->was[c] & 3);
    }
    example_close(&file);
    blast_write_particles(&h->sim, half, run->out, "flags_particles.dat");
    file = example_open(run->out, "flags_range.gp");
    fprintf(file.stream, "half = %.6g\nwidth = %.6g\ntime = %.6g\n", half, width, 1e6 * grid->time);
    example_close(&file);
}

/* ---- a run, from output to output ------------------------------------------------------------ */

static void blast_set_up(blast_run *run, const blast_settings *s, const blast_options *o,
                         int method, const char *out) {
    memset(run, 0, sizeof *run);
    run->s = s;
    run->method = method;
    run->stop = o->stop;
    run->progress.quiet = run->quiet = o->quiet;
    run->out = out;
    run->t_seen = 0.25 * s->t_end;
    if (out != NULL && o->pictures) run->seen = blast_write_flags;
    if (!o->quiet) fprintf(stderr, "%s: dx = %g m\n", blast_method_name(method), s->dx);
}

static void blast_ended(const blast_run *run, const blast_options *o, const sphpa_error *err,
                        blast_result *result) {
    char at[64];
    snprintf(at, sizeof at, "t = %.6g us, step %llu", 1e6 * run->time,
             (unsigned long long)blast_steps(run));
    result->failed = run->why == BLAST_GOES_ON;
    if (run->why == BLAST_OUT_OF_TIME)
        snprintf(result->why, sizeof result->why, "ended by --max-seconds %g at %s",
                 run->s->max_seconds, at);
    else if (run->why == BLAST_INTERRUPTED)
        snprintf(result->why, sizeof result->why, "interrupted at %s", at);
    else snprintf(result->why, sizeof result->why, "failed at %s: %.500s", at, err->message);
    if (result->failed || !o->quiet)
        fprintf(stderr, "%s: %s\n", blast_method_name(run->method), result->why);
}

/* Runs one method through all outputs. out: where its log and profiles go; NULL: nowhere. */
static void blast_solve(const blast_settings *s, const blast_options *o, int method,
                        const blast_reference *reference, const char *out, blast_result *result) {
    static blast_run run;
    blast_profile profile;
    sphpa_error err;
    memset(result, 0, sizeof *result);
    result->method = method;
    blast_set_up(&run, s, o, method, out);
    sphpa_result good = blast_begin(&run, &err);
    for (int k = 0; k < s->times && good == SPHPA_OK; k++) {
        good = blast_advance(&run, s->time[k], &err);
        if (good == SPHPA_OK) good = blast_measure(&run, &profile, &err);
        if (good != SPHPA_OK) break;
        blast_record_now(&run, &profile, reference, k, &result->record[k]);
        result->count = k + 1;
        if (out != NULL) {
            blast_write_profile(&run, &profile, s->time[k]);
            blast_write_log(result, s, reference, out);
        }
        blast_profile_free(&profile);
    }
    example_progress_end(&run.progress);
    if (good != SPHPA_OK) blast_ended(&run, o, &err, result);
    else if (out != NULL && o->pictures)
        blast_write_plane(&run, BLAST_VIEW * reference->at[s->times - 1].shell.radius);
    blast_end(&run);
}

/* ---- tables ---------------------------------------------------------------------------------- */

static double blast_percent(double value, double of) { return 100.0 * (value / of - 1.0); }

/* one row per method and the reference's: what = 0 radius, 1 peak density, 2 L1 */
static void blast_tell_rows(const blast_result *results, const blast_settings *s,
                            const blast_reference *reference, int what, blast_report *report) {
    static const char *const title[3] = {
        "shock radius R [m], and how far off the reference's (*: no shell of its own yet, see --help)",
        "peak density of the outer shell [kg/m3], and how far off the reference's in the same rings",
        "L1 of the density within 1.2 R"};
    blast_say(report, "\n%s\n%-10s", title[what], "t [us]");
    for (int k = 0; k < s->times; k++) blast_say(report, " %17g", 1e6 * s->time[k]);
    if (what < 2) blast_say(report, "\n%-10s", blast_method_name(BLAST_METHODS));
    for (int k = 0; k < s->times && what < 2; k++)
        blast_say(report, " %7.3f          ", what == 0 ? reference->at[k].shell.radius
                                                       : blast_reference_peak(&reference->at[k], s));
    for (int m = 0; m < BLAST_METHODS; m++) {
        if (results[m].count == 0) continue;
        blast_say(report, "\n%-10s", blast_method_name(m));
        for (int k = 0; k < results[m].count; k++) {
            const blast_record *r = &results[m].record[k];
            const blast_reference_at *at = &reference->at[k];
            double of = what == 0 ? at->shell.radius : blast_reference_peak(at, s);
            double value = what == 0 ? r->shell.radius : r->shell.rho_peak;
            if (what == 2) blast_say(report, " %17.4f", r->L1);
            else blast_say(report, " %7.3f %+7.2f %%%s", value, blast_percent(value, of),
                           r->shell.borrowed ? "*" : " ");
        }
    }
    blast_say(report, "\n");
}

static void blast_tell_table(const blast_result *results, const blast_settings *s,
                             const blast_reference *reference, blast_report *report) {
    for (int what = 0; what < 3; what++) blast_tell_rows(results, s, reference, what, report);
    blast_say(report, "\n%-9s %9s %8s %8s %8s %8s %9s %9s  %-9s %-9s %-9s %-9s\n", "method", "CPU s",
              "wall s", "steps", "substeps", "t [us]", "particles", "cells", "mass", "px", "py",
              "energy");
    for (int m = 0; m < BLAST_METHODS; m++) {
        if (results[m].count == 0) continue;
        const blast_record *r = &results[m].record[results[m].count - 1];
        blast_say(report, "%-9s %9.2f %8.2f %8llu %8llu %8g %9zu %9zu  %-+9.1e %-+9.1e %-+9.1e "
                          "%-+9.1e\n", blast_method_name(m), r->cpu, r->wall,
                  (unsigned long long)r->steps, (unsigned long long)r->substeps, 1e6 * r->time,
                  r->particles, r->cells, r->mass, r->momentum[0], r->momentum[1], r->energy);
        if (r->bytes > 0) blast_say(report, "          %zu bytes of fields a particle\n", r->bytes);
        if (m == BLAST_HYBRID)
            blast_say(report, "          %.2e of the energy was moved by its reflux, %.2e "
                              "found no place\n", r->exchanged, r->unplaced);
    }
    for (int m = 0; m < BLAST_METHODS; m++)
        if (results[m].why[0] != '\0')
            blast_say(report, "%s %s\n", blast_method_name(m), results[m].why);
}

static void blast_kernel_head(int method, const blast_settings *s, blast_report *report) {
    blast_say(report, "\nkernels: %s, dx %g m, eta %g, at %g us\n%-12s %-9s %-8s %-10s %-8s %-7s\n",
              blast_method_name(method), s->dx, s->eta, 1e6 * s->t_end, "kernel", "survived", "R [m]",
              "off", "L1", "CPU s");
}

static void blast_kernel_row(const blast_settings *s, const blast_reference *reference,
                             const blast_result *result, blast_report *report) {
    const blast_record *r = &result->record[result->count > 0 ? result->count - 1 : 0];
    char kernel[32];
    blast_say(report, "%-12s %-9s", blast_word(BLAST_KERNEL_WORDS, s->kernel, kernel),
              result->count == s->times ? "yes" : result->failed ? "NO" : "ended");
    if (result->count == s->times)
        blast_say(report, " %-8.3f %+7.2f %%  %-8.4f %-7.2f\n", r->shell.radius,
                  blast_percent(r->shell.radius, reference->at[s->times - 1].shell.radius), r->L1, r->cpu);
    else blast_say(report, " %.400s\n", result->why);
}

/* ---- error against run time ------------------------------------------------------------------ */

typedef struct blast_point {
    int method;
    double dx, L1, off, cpu; /* [m] [1] [%] [s] */
} blast_point;

typedef struct blast_points {
    int count;
    blast_point point[BLAST_METHODS * (BLAST_CONVERGED + 1)];
} blast_points;

/* a run that did not come to the end is left out */
static void blast_add_point(blast_points *points, const blast_settings *s,
                            const blast_reference *reference, const blast_result *result) {
    int last = s->times - 1;
    if (result->count < s->times) return;
    blast_point *point = &points->point[points->count++];
    const blast_record *r = &result->record[last];
    point->method = result->method;
    point->dx = s->dx;
    point->L1 = r->L1;
    point->off = blast_percent(r->shell.radius, reference->at[last].shell.radius);
    point->cpu = r->cpu;
}

static int blast_compare_points(const void *a, const void *b) {
    const blast_point *p = (const blast_point *)a, *q = (const blast_point *)b;
    if (p->method != q->method) return p->method < q->method ? -1 : 1;
    return p->dx < q->dx ? 1 : p->dx > q->dx ? -1 : 0;
}

/* sorts them too */
static void blast_tell_points(blast_points *points, const blast_settings *s, const char *out,
                              blast_report *report) {
    char name[64];
    qsort(points->point, (size_t)points->count, sizeof points->point[0], blast_compare_points);
    blast_say(report, "\nerror against run time, at %g us\n%-9s %8s %9s %10s %9s\n", 1e6 * s->t_end,
              "method", "dx [m]", "L1", "R off", "CPU s");
    for (int method = 0; method < BLAST_METHODS; method++) {
        snprintf(name, sizeof name, "convergence_%s.dat", blast_method_name(method));
        example_file file = example_open(out, name);
        fprintf(file.stream, "# dx[m] L1 R off[%%] CPU[s]\n");
        for (int k = 0; k < points->count; k++) {
            const blast_point *p = &points->point[k];
            if (p->method != method) continue;
            fprintf(file.stream, "%.6g %.6g %.6g %.6g\n", p->dx, p->L1, p->off, p->cpu);
            blast_say(report, "%-9s %8g %9.4f %+8.2f %% %9.2f\n", blast_method_name(method), p->dx,
                      p->L1, p->off, p->cpu);
        }
        example_close(&file);
    }
}

#endif
