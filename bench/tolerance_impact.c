/* tolerance_impact.c: does a loose tolerance of the P-alpha solve make the damage field ring?

   make tolerance-impact builds it in double and in float and runs both. GASPHiA's authors report
   that alpha must be solved to better than 1e-7 or damage rings. Here one small impact is run with
   tolerances from 1e-2 to 1e-14 and compared with the run at 1e-14; by bisection and safe Newton,
   whose error is as large as their tolerance, and by crush-space, whose last step ends far inside
   it. Since runs of an impact differ by whatever changes a rounding, there are controls at 1e-14:
   the speed of one particle of the projectile changed by one rounding, and, so that they end as far
   from each other as runs of loose tolerance do, by 1e-4. What is no larger than in those is none
   of the tolerance's doing.

   D never falls, by construction, so a damage field cannot swing to and fro; what ringing would
   look like, and is measured over the target's particles:
     jerks   sum |D(k+1) - 2 D(k) + D(k-1)| / sum |D(k+1) - D(k)| over all steps k: near 0 for
             damage that grows smoothly, up to 2 for damage that comes in jolts
     spells  how often damage begins to grow in a particle, after a step in which it did not
     P jerks the same ratio of the pressure, which drives damage: noise from step to step has 1.7
             (independent, normal), a resolved wave of n steps a period 6/n or so
     rough   root mean square of D less the mean D of the particles within the kernel, at the end:
             ringing in space, from one particle to the next */
#include "impact_again.h"

#include "bench_clock.h"

enum { TOL_SAMPLES = 40, TOL_ROWS = 24, TOL_ROUNDED = 2, TOL_CONTROLS = 4 };
#define TOL_REFERENCE 1e-14
#define TOL_NUDGE 1e-4 /* of the controls after the first TOL_ROUNDED, which get a rounding */
#define TOL_DAMAGED 1e-3 /* mean D below which there is nothing to judge */
#define TOL_LOUDER 0.1 /* a measure this much above the reference's rings, if no control's does */

#ifdef SPHPA_FLOAT
#define TOL_REAL "float"
#else
#define TOL_REAL "double"
#endif

/* What one run came to. Arrays by id, of the target's particles. */
typedef struct tol_row {
    again_change change;
    size_t n;
    double *D[TOL_SAMPLES], *alpha[TOL_SAMPLES]; /* at evenly spaced times */
    double jerks, spells, P_jerks, rough;
    double mean_D, largest, drift, off_curve, seconds;
    double D_max, D_rms, alpha_max, alpha_rms; /* off the reference, at the end */
    long steps, fell;                           /* fell: steps in which D of a particle fell */
} tol_row;

typedef struct tol_report {
    const impact_settings *s;
    const char *out;
    int count;
    tol_row row[TOL_ROWS]; /* 0: the reference; then the controls */
} tol_report;

/* ---- one run --------------------------------------------------------------------------------- */

/* sums over steps and particles; the last step's values by id */
typedef struct tol_watch {
    double *D, *dD, *P, *dP;
    double D_moved, D_jerked, P_moved, P_jerked;
    double spells;
    long fell, steps;
} tol_watch;

static void tol_look(tol_watch *w, const sphpa_particles *p) {
    for (size_t i = 0; i < p->n; i++) {
        if (p->body[i] != IMPACT_TARGET) continue;
        size_t id = (size_t)p->id[i];
        double dD = (double)p->D[i] - w->D[id], dP = (double)p->P[i] - w->P[id];
        w->D_moved += fabs(dD);
        w->P_moved += fabs(dP);
        if (w->steps > 0) {
            w->D_jerked += fabs(dD - w->dD[id]);
            w->P_jerked += fabs(dP - w->dP[id]);
            w->spells += dD > 0.0 && !(w->dD[id] > 0.0);
            w->fell += dD < 0.0;
        }
        w->D[id] = (double)p->D[i];
        w->P[id] = (double)p->P[i];
        w->dD[id] = dD;
        w->dP[id] = dP;
    }
    w->steps++;
}

/* rms of D less the mean of the neighbours' D; all pairs, for it is done once a run */
static double tol_rough(const sphpa_particles *p) {
    double square = 0.0, count = 0.0;
    for (size_t i = 0; i < p->n; i++) {
        if (p->body[i] != IMPACT_TARGET) continue;
        double sum = 0.0, near = 0.0, reach = 2.0 * (double)p->h[i];
        for (size_t j = 0; j < p->n; j++) {
            if (j == i || p->body[j] != IMPACT_TARGET) continue;
            double r2 = 0.0;
            for (size_t a = 0; a < 3; a++)
                r2 += (p->x[3 * i + a] - p->x[3 * j + a]) * (p->x[3 * i + a] - p->x[3 * j + a]);
            if (r2 >= reach * reach) continue;
            sum += (double)p->D[j];
            near += 1.0;
        }
        if (near < 1.0) continue;
        double off = (double)p->D[i] - sum / near;
        square += off * off;
        count += 1.0;
    }
    return sqrt(square / fmax(count, 1.0));
}

static void tol_sample(tol_row *row, int k, const sphpa_particles *p) {
    row->D[k] = again_doubles(p->n);
    row->alpha[k] = again_doubles(p->n);
    for (size_t i = 0; i < p->n; i++) {
        if (p->body[i] != IMPACT_TARGET) continue;
        row->D[k][p->id[i]] = (double)p->D[i];
        row->alpha[k][p->id[i]] = p->alpha[i];
    }
}

static void tol_finish(tol_row *row, const impact_run *run, const tol_watch *w) {
    const sphpa_particles *p = &run->sim.p;
    for (size_t i = 0; i < p->n; i++) row->n += p->body[i] == IMPACT_TARGET;
    for (size_t i = 0; i < row->n; i++)
        row->mean_D += row->D[TOL_SAMPLES - 1][i] / (double)row->n;
    row->jerks = w->D_jerked / w->D_moved;
    row->P_jerks = w->P_jerked / w->P_moved;
    row->spells = w->spells / (double)row->n;
    row->rough = tol_rough(p);
    row->fell = w->fell;
    row->steps = w->steps;
    row->largest = impact_largest(&run->sim, run->s.link, run->s.damage_below, run->target_mass);
    row->drift = again_drift(run);
    row->off_curve = run->scene.pores.stats.distance_max *
                     (run->scene.crush[IMPACT_TARGET].alpha0 - 1.0);
}

static void tol_one(tol_report *report, sphpa_palpha_solver solver, double tol, int nudge) {
    tol_row *row = &report->row[report->count++];
    const impact_settings *s = report->s;
    memset(row, 0, sizeof *row);
    row->change.solver = solver;
    row->change.tol = tol;
    row->change.nudge = nudge;
    row->change.size = nudge > TOL_ROUNDED ? TOL_NUDGE : 0.0;
    double since = sphpa_wall_clock();
    impact_run *run = again_begin(s, &row->change, NULL);
    tol_watch w;
    memset(&w, 0, sizeof w);
    double **all[4] = {&w.D, &w.dD, &w.P, &w.dP};
    for (int k = 0; k < 4; k++) *all[k] = again_doubles(run->sim.p.n);
    for (int k = 0; k < TOL_SAMPLES; k++) {
        double until = s->t_end * (k + 1) / TOL_SAMPLES;
        while (run->sim.time < until * (1.0 - 1e-12)) {
            again_step(run, until - run->sim.time);
            tol_look(&w, &run->sim.p);
        }
        tol_sample(row, k, &run->sim.p);
    }
    tol_finish(row, run, &w);
    impact_free(run);
    for (int k = 0; k < 4; k++) free(*all[k]);
    row->seconds = sphpa_wall_clock() - since;
    fprintf(stderr, "%s, %s, tol %g%s: %.1f s\n", TOL_REAL, sphpa_palpha_solver_name(solver), tol,
            nudge == 0 ? "" : nudge > TOL_ROUNDED ? ", nudged by 1e-4" : ", nudged by a rounding",
            row->seconds);
}

/* rms and largest difference of one field, of two runs */
static double tol_apart(const double *a, const double *b, size_t n, double *most) {
    double square = 0.0;
    *most = 0.0;
    for (size_t i = 0; i < n; i++) {
        square += (a[i] - b[i]) * (a[i] - b[i]) / (double)n;
        *most = fmax(*most, fabs(a[i] - b[i]));
    }
    return sqrt(square);
}

static void tol_all(tol_report *report, int quick) {
    static const double tols[8] = {1e-2, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10, 1e-12},
                        few[2][3] = {{1e-4, 1e-6, 1e-7}, {1e-4, 1e-7, 1e-12}};
    for (int k = 0; k <= TOL_CONTROLS; k++)
        tol_one(report, SPHPA_PALPHA_CRUSH_SPACE, TOL_REFERENCE, k);
    for (int k = 0; k < 8; k++)
        if (!quick || k % 3 == 1) tol_one(report, SPHPA_PALPHA_BISECTION, tols[k], 0);
    for (int k = 0; k < (quick ? 1 : 3); k++)
        tol_one(report, SPHPA_PALPHA_SAFE_NEWTON, few[0][k], 0);
    for (int k = 0; k < (quick ? 1 : 3); k++)
        tol_one(report, SPHPA_PALPHA_CRUSH_SPACE, few[1][k], 0);
    for (int k = 0; k < report->count; k++) {
        tol_row *row = &report->row[k];
        const tol_row *reference = &report->row[0];
        int end = TOL_SAMPLES - 1;
        row->D_rms = tol_apart(row->D[end], reference->D[end], row->n, &row->D_max);
        row->alpha_rms = tol_apart(row->alpha[end], reference->alpha[end], row->n, &row->alpha_max);
    }
}

/* ---- the judgement --------------------------------------------------------------------------- */

static double tol_measure(const tol_row *row, int which) {
    const double all[4] = {row->jerks, row->spells, row->P_jerks, row->rough};
    return all[which];
}

/* Louder than the reference by a tenth, and by three times what the loudest control is. */
static bool tol_rings(const tol_report *report, const tol_row *row) {
    for (int m = 0; m < 4; m++) {
        double base = tol_measure(&report->row[0], m), chaos = 0.0;
        for (int k = 1; k <= TOL_CONTROLS; k++)
            chaos = fmax(chaos, fabs(tol_measure(&report->row[k], m) - base));
        if (tol_measure(row, m) > base + fmax(TOL_LOUDER * base, 3.0 * chaos)) return true;
    }
    return false;
}

static double tol_rounding(const tol_report *report) { /* rms of D that a rounding comes to */
    double most = 0.0;
    for (int k = 1; k <= TOL_ROUNDED; k++) most = fmax(most, report->row[k].D_rms);
    return most;
}

/* the least tolerance at which a solver's damage rings, or 0; *off: at which it is off by more than
   three times what a rounding comes to; *most: the largest that was tried */
static double tol_ringing_from(const tol_report *report, sphpa_palpha_solver solver, double *off,
                               double *most) {
    double least = 0.0;
    *off = *most = 0.0;
    for (int k = 1 + TOL_CONTROLS; k < report->count; k++) {
        const tol_row *row = &report->row[k];
        double tol = row->change.tol;
        if (row->change.solver != solver) continue;
        *most = fmax(*most, tol);
        if (tol_rings(report, row) && (least <= 0.0 || tol < least)) least = tol;
        if (row->D_rms > 3.0 * tol_rounding(report) && (*off <= 0.0 || tol < *off)) *off = tol;
    }
    return least;
}

static void tol_print_verdict(const tol_report *report) {
    static const sphpa_palpha_solver solvers[3] = {
        SPHPA_PALPHA_BISECTION, SPHPA_PALPHA_SAFE_NEWTON, SPHPA_PALPHA_CRUSH_SPACE};
    if (!(report->row[0].mean_D > TOL_DAMAGED)) {
        printf("\nHardly any damage: a mean D of %.1e tells nothing; give a larger --t-end\n",
               report->row[0].mean_D);
        return;
    }
    printf("\nThe claim that damage rings where the tolerance is above 1e-7, in this impact, in "
           TOL_REAL ":\n");
    for (int k = 0; k < 3; k++) {
        double off, most, least = tol_ringing_from(report, solvers[k], &off, &most);
        printf("  %-11s %s: ", sphpa_palpha_solver_name(solvers[k]),
               least <= 0.0 ? "REFUTED" : least < 2e-6 ? "REPRODUCED" : "REPRODUCED IN PART");
        if (least > 0.0) printf("it rings from %g on;\n", least);
        else printf("no tolerance up to %g rings;\n", most);
        printf("  %-11s damage is off by %s than 3 times what a rounding comes to", "",
               off > 0.0 ? "more" : "no more");
        if (off > 0.0) printf(" from %g on", off);
        printf("\n");
    }
}

/* ---- what is written ------------------------------------------------------------------------- */

static const char *tol_name(const tol_report *report, const tol_row *row) {
    if (row == &report->row[0]) return "reference";
    if (row->change.nudge > 0) return row->change.size > 0.0 ? "nudged 1e-4" : "rounding";
    return sphpa_palpha_solver_name(row->change.solver);
}

static void tol_print_table(const tol_report *report) {
    printf("| run         |   tol | off curve |   max dD |   rms dD |   max da |   rms da |  jerks "
           "| spells | P jerks |  rough | mean D | largest |   drift | rings |\n"
           "|:------------|------:|----------:|---------:|---------:|---------:|---------:|-------:"
           "|-------:|--------:|-------:|-------:|--------:|--------:|:------|\n");
    for (int k = 0; k < report->count; k++) {
        const tol_row *r = &report->row[k];
        printf("| %-11s | %5.0e | %9.1e | %8.1e | %8.1e | %8.1e | %8.1e | %6.4f | %6.3f | %7.5f |"
               " %6.4f | %6.4f | %7.4f | %7.0e | %-5s |\n",
               tol_name(report, r), r->change.tol, r->off_curve, r->D_max, r->D_rms, r->alpha_max,
               r->alpha_rms, r->jerks, r->spells, r->P_jerks, r->rough, r->mean_D, r->largest,
               r->drift, k > TOL_CONTROLS ? tol_rings(report, r) ? "YES" : "no" : "");
    }
    long fell = 0;
    for (int k = 0; k < report->count; k++) fell += report->row[k].fell;
    printf("\noff curve: largest |alpha - curve(P)| of a loading particle; P is so steep in alpha\n"
           "that this is some hundred times the error of alpha. da: of alpha. rings: one of\n"
           "jerks, spells, P jerks, rough is above the reference's by %g of it and by 3 times the\n"
           "largest change in a control. %ld steps a run; D of a particle fell in %ld of them.\n",
           TOL_LOUDER, report->row[0].steps, fell);
}

static void tol_write_csv(const tol_report *report) {
    example_file file = example_open(report->out, "tolerance_impact_" TOL_REAL ".csv");
    fprintf(file.stream,
            "real,run,tol,steps,off_curve,D_max,D_rms,alpha_max,alpha_rms,jerks,spells,P_jerks,"
            "rough,mean_D,largest,energy_drift,rings,seconds\n");
    for (int k = 0; k < report->count; k++) {
        const tol_row *r = &report->row[k];
        fprintf(file.stream,
                "%s,%s,%g,%ld,%.3e,%.3e,%.3e,%.3e,%.3e,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.2e,%d,"
                "%.2f\n",
                TOL_REAL, tol_name(report, r), r->change.tol, r->steps, r->off_curve, r->D_max,
                r->D_rms, r->alpha_max, r->alpha_rms, r->jerks, r->spells, r->P_jerks, r->rough,
                r->mean_D, r->largest, r->drift, (int)tol_rings(report, r), r->seconds);
    }
    example_close(&file);
    fprintf(stderr, "wrote %s/tolerance_impact_%s.csv\n", report->out, TOL_REAL);
}

/* The double build leaves its reference, headed by what it is of; the float build, run after it,
   says how far it is off. */
static void tol_head(const tol_report *report, char head[256]) {
    const impact_settings *s = report->s;
    snprintf(head, 256, "# D alpha in double: %zu %ld particles, target %.17g m, curve %d, %.17g "
             "s\n", report->row[0].n, s->projectile_particles, s->target_diameter, s->curve,
             s->t_end);
}

#ifndef SPHPA_FLOAT
static void tol_leave_reference(const tol_report *report) {
    const tol_row *row = &report->row[0];
    char head[256];
    example_file file = example_open(report->out, "tolerance_reference.txt");
    tol_head(report, head);
    fputs(head, file.stream);
    for (size_t i = 0; i < row->n; i++)
        fprintf(file.stream, "%.17g %.17g\n", row->D[TOL_SAMPLES - 1][i],
                row->alpha[TOL_SAMPLES - 1][i]);
    example_close(&file);
}
#else
static void tol_print_off_double(const tol_report *report) {
    const tol_row *row = &report->row[0];
    char path[EXAMPLE_PATH + 32], head[256], line[256];
    double *other = again_doubles(2 * row->n), most[2], rms[2];
    size_t n = 0;
    snprintf(path, sizeof path, "%s/tolerance_reference.txt", report->out);
    FILE *file = fopen(path, "r");
    tol_head(report, head);
    if (file != NULL && fgets(line, sizeof line, file) != NULL && strcmp(line, head) == 0)
        for (n = 0; n < row->n; n++)
            if (fscanf(file, "%lf %lf", &other[n], &other[row->n + n]) != 2) break;
    if (file != NULL) fclose(file);
    if (n == row->n && row->n > 0) {
        rms[0] = tol_apart(row->D[TOL_SAMPLES - 1], other, n, &most[0]);
        rms[1] = tol_apart(row->alpha[TOL_SAMPLES - 1], other + n, n, &most[1]);
        printf("\nfloat off double, both at %g: D max %.1e rms %.1e, alpha max %.1e rms %.1e\n",
               TOL_REFERENCE, most[0], rms[0], most[1], rms[1]);
    } else {
        printf("\nfloat off double: unknown, %s is not of this impact; run both, double first\n",
               path);
    }
    free(other);
}
#endif

/* how the line of a row is drawn; false: it is not */
static bool tol_style(const tol_report *report, const tol_row *row, char style[64],
                      char title[32]) {
    static const char *const colours[8] = {"#67000d", "#e31a1c", "#fd8d3c", "#c7c000",
                                           "#41ab5d", "#2a7fb8", "#54278f", "#9e9ac8"};
    const int first = 1 + TOL_CONTROLS; /* of bisection's */
    int k = (int)(row - report->row);
    title[0] = '\0';
    if (row->change.nudge > 0) {
        bool large = row->change.size > 0.0;
        snprintf(style, 64, large ? "lw 2 dt 3 lc rgb 'black'" : "lw 2 dt 2 lc rgb '#707070'");
        if (row->change.nudge == 1 || row->change.nudge == TOL_ROUNDED + 1)
            snprintf(title, 32, "%s", tol_name(report, row));
        return true;
    }
    snprintf(title, 32, "%.16s %g", sphpa_palpha_solver_name(row->change.solver), row->change.tol);
    snprintf(style, 64, "lw 2 lc rgb '%s'", colours[(k - first) % 8]);
    if (row->change.solver == SPHPA_PALPHA_BISECTION) return true;
    snprintf(style, 64, "lw 3 dt 4 lc rgb '%s'",
             row->change.solver == SPHPA_PALPHA_SAFE_NEWTON ? "#c51b8a" : "#1a1a1a");
    return row->change.tol > 1e-5;
}

/* block k: time [us], rms difference of D from the reference, of row k */
static void tol_draw(const tol_report *report) {
    char script[8192], style[64], title[32];
    int n = 0, size = (int)sizeof script;
    double most;
    example_file file = example_open(report->out, "tolerance_impact_" TOL_REAL ".dat");
    n += snprintf(script, sizeof script,
                  "set title 'Damage off the run at tolerance %g, " TOL_REAL "'\nset logscale y\n"
                  "set format y '10^{%%L}'\nset xlabel 'time [\302\265s]'\nset grid\n"
                  "set ylabel 'rms difference of D'\nset key outside right Left reverse\n"
                  "set yrange [1e-18:1]\nplot ", TOL_REFERENCE);
    for (int k = 0; k < report->count; k++) {
        const tol_row *row = &report->row[k];
        for (int q = 0; q < TOL_SAMPLES; q++) {
            double rms = tol_apart(row->D[q], report->row[0].D[q], row->n, &most);
            fprintf(file.stream, "%g %g\n", 1e6 * report->s->t_end * (q + 1) / TOL_SAMPLES,
                    fmax(rms, 1e-18));
        }
        fprintf(file.stream, "\n\n");
        if (k == 0 || !tol_style(report, row, style, title)) continue;
        n += snprintf(script + n, (size_t)(size - n),
                      "%s'tolerance_impact_" TOL_REAL ".dat' index %d with lines %s title '%s'",
                      k > 1 ? ", \\\n  " : "", k, style, title);
    }
    example_close(&file);
    (void)example_picture(report->out, "tolerance_impact_" TOL_REAL ".png", 960, 520, script);
}

int main(int argc, char **argv) {
    impact_settings s = impact_default_settings();
    static tol_report report;
    const char *out = "build/bench";
    char cpu[128];
    int quick = 0, no_pictures = 0;
    long threads = 0;
    s.particles = 2000;
    s.target_diameter = 0.06;
    s.t_end = 3e-5;
    const example_option options[] = {
        example_count("particles", &s.particles, 10, 100000, "of the target"),
        example_count("projectile-particles", &s.projectile_particles, 10, 100000, "of the nylon"),
        example_number("target-diameter", "m", &s.target_diameter, 1e-3, 1e3, "of the sphere"),
        example_number("t-end", "s", &s.t_end, 1e-9, 1.0, "end of each run"),
        example_choice("curve", IMPACT_CURVES, &s.curve, "crush curve of the pumice"),
        example_count("threads", &threads, 0, 4096, "0: as many as there are"),
        example_text("out", "DIR", &out, "where files and the picture go"),
        example_flag("quick", &quick, "fewer tolerances"),
        example_flag("no-pictures", &no_pictures, "numbers only")};
    example_parse(argc, argv, "an impact at tolerances of the P-alpha solve from 1e-2 to 1e-14",
                  SPHPA_VERSION, options, (int)(sizeof options / sizeof options[0]));
    (void)example_threads(threads);
    example_folder(out);
    report.s = &s;
    report.out = out;
    tol_all(&report, quick);
    printf("\n### %s: %ld + %ld particles, target of %g cm, %s curve, %g us; D and alpha off the "
           "run at %g\n\n", TOL_REAL, s.particles, s.projectile_particles,
           100.0 * s.target_diameter, s.curve == 0 ? "two-exponent" : "quadratic", 1e6 * s.t_end,
           TOL_REFERENCE);
    bench_read_cpu(cpu);
    printf("sphpa %s; cpu: %s, %d threads; compiler: %s\n\n", SPHPA_VERSION, cpu,
           example_threads(0), BENCH_COMPILER);
    tol_print_table(&report);
#ifdef SPHPA_FLOAT
    tol_print_off_double(&report);
#endif
    tol_print_verdict(&report);
    fflush(stdout);
    tol_write_csv(&report);
#ifndef SPHPA_FLOAT
    tol_leave_reference(&report);
#endif
    if (!no_pictures) tol_draw(&report);
    if (fflush(stdout) != 0 || ferror(stdout))
        example_fail(1, "cannot write to standard output (%s)", strerror(errno));
    return 0;
}
