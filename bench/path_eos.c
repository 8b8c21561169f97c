/* path_eos.c: one particle that is compressed, released, reheated, compressed again and released:
   the implicit P-alpha solve of every step against the evolution form, at several step sizes.

   make path-eos builds and runs it. Errors are against the exact path (path_methods.h): Runge-Kutta
   steps of the energy alone, cut at the kinks of the crush curve, with alpha from the implicit
   problem at tolerance 1e-15. Writes path_eos.csv and two pictures. One thread. */
#include "../examples/example.h"

#define SPHPA_POROSITY_IMPLEMENTATION
#include "sphpa.h"

#include "bench_clock.h"
#include "path_methods.h"

enum { PATH_CASES = 3, PATH_SIZES = 10, PATH_REPEATS = 11 };
#define PATH_SAMPLE 1e-3 /* [s] least length of one timing */

static const int path_sizes[PATH_SIZES] = {100,  200,   500,   1000,  2000,
                                           5000, 10000, 20000, 50000, 100000};

/* What a method made of a path in n steps. */
typedef struct path_row {
    int which, method, n;
    long steps;                   /* made: the evolution form's limit adds some */
    double ns, spread_pct;        /* a step */
    double alpha_max, alpha_end;  /* [1] off the exact path */
    double P_max, P_end;          /* [Ps] */
    double u_end;                 /* [1] of the energy that came in */
    double drift;                 /* [1] largest |alpha - curve(P)| while the pores close */
    int grew, negative;           /* steps in which alpha grew; with dissipation below zero */
    double dissipated, exact_dissipated; /* [J/kg] */
    double closure;               /* [1] u less heat and work, of the energy that came in */
} path_row;

typedef struct path_options {
    const char *out;
    int quick, no_pictures;
} path_options;

typedef struct path_report {
    const path_options *o;
    path_case cases[PATH_CASES];
    path_trace exact[PATH_CASES];
    double reference_error[PATH_CASES]; /* of alpha: against half as many steps */
    double noise_pct;
    int sizes, count;
    path_row row[PATH_CASES * PATH_METHODS * PATH_SIZES];
    char cpu[128];
} path_report;

static path_trace path_trace_make(int n) {
    path_trace t;
    double *all = (double *)calloc(4 * ((size_t)n + 1), sizeof *all);
    if (all == NULL) example_fail(1, "out of memory");
    t.n = n;
    t.rho = all;
    t.u = all + (n + 1);
    t.alpha = all + 2 * (n + 1);
    t.P = all + 3 * (n + 1);
    return t;
}

static void path_trace_free(path_trace *t) { free(t->rho); }

/* ---- what is measured ------------------------------------------------------------------------ */

/* Of the work -P d(1/rho) that a step does, with 1/rho = alpha v_s and the matrix's pressure
   alpha P, -alpha P dv_s is the matrix's, and reversible; the rest, -P v_s dalpha, closes pores and
   is lost as heat. The second law wants it to be no less than 0. [J/kg], by the trapezium rule. */
static double path_dissipation(const path_trace *t, int k) {
    double rho_s = 0.5 * (t->alpha[k] * t->rho[k] + t->alpha[k + 1] * t->rho[k + 1]);
    return 0.5 * (t->P[k] + t->P[k + 1]) * (t->alpha[k] - t->alpha[k + 1]) / rho_s;
}

static double path_work(const path_trace *t, int k) {
    return -0.5 * (t->P[k] + t->P[k + 1]) * (1.0 / t->rho[k + 1] - 1.0 / t->rho[k]);
}

static double path_heat(const path_case *c) {
    double heat = 0.0;
    for (int leg = 0; leg < PATH_LEGS; leg++) heat += c->leg[leg].heat;
    return heat;
}

static double path_dissipated(const path_trace *t) {
    double sum = 0.0;
    for (int k = 0; k < t->n; k++) sum += path_dissipation(t, k);
    return sum;
}

static void path_compare(const path_case *c, const path_trace *t, const path_trace *exact,
                         path_row *row) {
    int stride = exact->n / t->n;
    double work = 0.0, all = path_heat(c);
    for (int k = 0; k <= t->n; k++) {
        int e = k * stride;
        double off = fabs(t->alpha[k] - exact->alpha[e]);
        double P_off = fabs(t->P[k] - exact->P[e]) / c->curve.Ps;
        row->alpha_max = fmax(row->alpha_max, off);
        row->P_max = fmax(row->P_max, P_off);
        row->alpha_end = off; /* the last one stays */
        row->P_end = P_off;
        if (k > 0 && exact->alpha[e] < exact->alpha[e - 1]) /* the pores close now */
            row->drift = fmax(row->drift,
                              fabs(t->alpha[k] - sphpa_crush_alpha(&c->curve, t->P[k], NULL)));
        if (k == t->n) break;
        double lost = path_dissipation(t, k);
        row->grew += t->alpha[k + 1] > t->alpha[k];
        row->negative += lost < 0.0;
        row->dissipated += lost;
        work += path_work(t, k);
    }
    all += work;
    row->closure = (t->u[t->n] - all) / all;
    row->u_end = (t->u[t->n] - exact->u[exact->n]) / all;
}

/* [s] a path: as often as the clock's grain asks for */
static double path_sample(const path_case *c, const path_method *m, int n, int passes) {
    double since = sphpa_wall_clock();
    for (int k = 0; k < passes; k++) (void)path_run(c, m, n, NULL);
    return (sphpa_wall_clock() - since) / passes;
}

/* every method in turn, so that a busy moment hits them all */
static void path_time(path_report *report, path_row *rows) {
    double sample[PATH_METHODS][PATH_REPEATS], noise[PATH_REPEATS], spread;
    int passes[PATH_METHODS];
    const path_case *c = &report->cases[rows->which];
    for (int m = 0; m < PATH_METHODS; m++)
        passes[m] = (int)ceil(PATH_SAMPLE / (path_sample(c, &path_methods[m], rows->n, 1) + 1e-9));
    for (int repeat = 0; repeat < PATH_REPEATS; repeat++) {
        noise[repeat] = bench_fixed_work();
        for (int turn = 0; turn < PATH_METHODS; turn++) {
            int m = (turn + repeat) % PATH_METHODS;
            sample[m][repeat] = path_sample(c, &path_methods[m], rows->n, passes[m]);
        }
    }
    (void)bench_median(noise, PATH_REPEATS, &spread);
    report->noise_pct = fmax(report->noise_pct, spread);
    for (int m = 0; m < PATH_METHODS; m++)
        rows[m].ns = 1e9 * bench_median(sample[m], PATH_REPEATS, &rows[m].spread_pct) /
                     (double)rows[m].steps;
}

static void path_one_size(path_report *report, int which, int n) {
    path_row *rows = &report->row[report->count];
    const path_case *c = &report->cases[which];
    path_trace trace = path_trace_make(n);
    for (int m = 0; m < PATH_METHODS; m++) {
        path_row *row = &report->row[report->count++];
        memset(row, 0, sizeof *row);
        row->which = which;
        row->method = m;
        row->n = n;
        row->steps = path_run(c, &path_methods[m], n, &trace);
        row->exact_dissipated = path_dissipated(&report->exact[which]);
        path_compare(c, &trace, &report->exact[which], row);
    }
    path_trace_free(&trace);
    path_time(report, rows);
}

static void path_one_case(path_report *report, int which) {
    const path_case *c = &report->cases[which];
    double since = sphpa_wall_clock();
    path_trace *exact = &report->exact[which], half = path_trace_make(PATH_FINEST / 2);
    *exact = path_trace_make(PATH_FINEST);
    path_reference(c, PATH_FINEST, 1, exact);
    path_reference(c, half.n, 1, &half);
    for (int k = 0; k <= half.n; k++)
        report->reference_error[which] =
            fmax(report->reference_error[which], fabs(half.alpha[k] - exact->alpha[2 * k]));
    path_trace_free(&half);
    for (int k = 0; k < report->sizes; k++) path_one_size(report, which, path_sizes[k]);
    fprintf(stderr, "%-22s %.1f s\n", c->name, sphpa_wall_clock() - since);
}

/* our fused right hand side must be the library's: the largest difference along the exact path */
static double path_check_rates(const path_case *c, const path_trace *exact) {
    double worst = 0.0, largest = 0.0;
    for (int k = 0; k < exact->n; k++) {
        path_state x = {exact->rho[k], exact->u[k], exact->alpha[k], exact->P[k]};
        double drho = exact->rho[k + 1] - x.rho, rate, du = x.P * drho / (x.rho * x.rho);
        if (sphpa_palpha_rate(c->matrix, &c->curve, x.rho, x.u, x.alpha, drho, du, &rate) !=
            SPHPA_OK)
            example_fail(1, "%s: sphpa_palpha_rate refuses a state of the path", c->name);
        worst = fmax(worst, fabs(rate - path_rates_at(c, &x, drho, 0.0, false).dalpha));
        largest = fmax(largest, fabs(rate));
    }
    return worst / largest;
}

/* ---- what is written ------------------------------------------------------------------------- */

static void path_write_about(FILE *to, const path_report *report, const char *mark) {
    fprintf(to, "%ssphpa %s, paths of one particle, one thread\n", mark, SPHPA_VERSION);
    fprintf(to, "%scpu: %s\n%scompiler: %s\n%sflags: %s\n", mark, report->cpu, mark,
            BENCH_COMPILER, mark, BENCH_FLAGS);
    fprintf(to, "%stimes: medians of %d interleaved repeats, of a step as it was made; a fixed "
                "piece of work spread by at most %.1f %%%s\n", mark, (int)PATH_REPEATS,
            report->noise_pct, report->noise_pct > BENCH_NOISY_PCT ? ": THE MACHINE IS NOISY" : "");
    fprintf(to, "%simplicit: tolerance 1e-12, two solves a step (one solve: u by the P before); "
                "evolution: |dalpha| <= %g a step, which adds steps\n", mark, PATH_DALPHA);
    fprintf(to, "%scut: such a step ends where the pores begin to close, the next ones load to "
                "their ends, and P >= Ps closes the pores: alpha = 1\n", mark);
}

static void path_write_csv(const path_report *report) {
    example_file file = example_open(report->o->out, "path_eos.csv");
    path_write_about(file.stream, report, "# ");
    fprintf(file.stream,
            "case,method,n,steps,ns_per_step,spread_pct,alpha_error_max,alpha_error_end,"
            "P_error_max_of_Ps,P_error_end_of_Ps,u_error_end,curve_drift_max,alpha_grew,"
            "negative_dissipation,dissipated_J_kg,exact_dissipated_J_kg,energy_closure\n");
    for (int k = 0; k < report->count; k++) {
        const path_row *r = &report->row[k];
        fprintf(file.stream,
                "\"%s\",\"%s\",%d,%ld,%.2f,%.2f,%.3e,%.3e,%.3e,%.3e,%.3e,%.3e,%d,%d,%.9g,%.9g,"
                "%.3e\n",
                report->cases[r->which].name, path_methods[r->method].name, r->n, r->steps, r->ns,
                r->spread_pct, r->alpha_max, r->alpha_end, r->P_max, r->P_end, r->u_end, r->drift,
                r->grew, r->negative, r->dissipated, r->exact_dissipated, r->closure);
    }
    example_close(&file);
    fprintf(stderr, "wrote %s/path_eos.csv\n", report->o->out);
}

static void path_print_legs(const path_report *report, int which) {
    const path_case *c = &report->cases[which];
    const path_trace *t = &report->exact[which];
    printf("\n### %s: alpha0 %g, Pe %g, Ps %g Pa\n\n", c->name, c->curve.alpha0, c->curve.Pe,
           c->curve.Ps);
    printf("| leg of the exact path | rho [kg/m3] | heat [J/kg] |   alpha  |   P [MPa] | u [J/kg] "
           "|\n|:----------------------|------------:|------------:|---------:|----------:"
           "|---------:|\n");
    for (int leg = 0; leg < PATH_LEGS; leg++) {
        int k = t->n / PATH_LEGS * (leg + 1);
        printf("| %d %-19s | %11.1f | %11g | %8.5f | %9.3f | %8.0f |\n", leg + 1, c->leg[leg].what,
               t->rho[k], c->leg[leg].heat, t->alpha[k], 1e-6 * t->P[k], t->u[k]);
    }
    printf("\nExact alpha to %.1e (half as many steps); sphpa_palpha_rate and the rate used here "
           "differ by %.1e of the largest\n\n", report->reference_error[which],
           path_check_rates(c, t));
}

static void path_print_case(const path_report *report, int which) {
    path_print_legs(report, which);
    printf("| method                |      n |  steps | ns/step | err%% | alpha max |       end |"
           "  P/Ps max |       end | off curve | grew | W < 0 | W - exact |   closure |\n"
           "|:----------------------|-------:|-------:|--------:|-----:|----------:|----------:|"
           "----------:|----------:|----------:|-----:|------:|----------:|----------:|\n");
    for (int m = 0; m < PATH_METHODS; m++)
        for (int k = 0; k < report->count; k++) {
            const path_row *r = &report->row[k];
            if (r->which != which || r->method != m ||
                (r->n != 100 && r->n != 1000 && r->n != 10000 && r->n != 100000))
                continue;
            printf("| %-21s | %6d | %6ld | %7.1f | %4.1f | %9.1e | %9.1e | %9.1e | %9.1e | %9.1e "
                   "| %4d | %5d | %9.1e | %9.1e |\n",
                   path_methods[m].name, r->n, r->steps, r->ns, r->spread_pct, r->alpha_max,
                   r->alpha_end, r->P_max, r->P_end, r->drift, r->grew, r->negative,
                   r->dissipated / r->exact_dissipated - 1.0, r->closure);
        }
}

static const char path_legend[] =
    "\n"
    "alpha, P: off the exact path, at worst and at the end. off curve: most |alpha - curve(P)|\n"
    "while the pores close; P is so steep in alpha that in the implicit form this is some hundred\n"
    "times the error of a solve. grew: steps in which alpha grew. W: -P dalpha/(alpha rho) of a\n"
    "step by the trapezium rule, the work that closes pores and is lost as heat: steps in which\n"
    "it is below zero, and its sum less that of the exact path's 100000 steps, of that. closure:\n"
    "u at the end less heat and work -P d(1/rho), by the trapezium rule over the same steps, of\n"
    "that sum.\n"
    "\n"
    "Implicit: alpha follows from rho and u whatever the step; its error comes with that of u, of\n"
    "second order with two solves, of first with one. In pumice it stops falling at 1e-7 until a\n"
    "step resolves the elastic rise to Pe, 0.02 % of rho.\n"
    "Evolution: a step that leaves the elastic branch ends beyond the curve, stiff as the matrix,\n"
    "and the rate keeps that distance; once P is above Ps its alpha' is 0, the pores stay open.\n"
    "Cut steps cure the first by finding the yield: a root, as in the implicit form. Euler's then\n"
    "end below the curve, which is elastic, and come back to it: many steps more. Heun's do so\n"
    "where they are long; what is left of short ones is the millionth of alpha0 - 1 to which a\n"
    "state counts as on the curve, and now and then a step with a kink inside, at Pt or Ps.\n";

/* the fastest run of a method whose alpha is never further off than `error`, or NULL */
static const path_row *path_cheapest(const path_report *report, int which, int method,
                                     double error) {
    const path_row *best = NULL;
    for (int k = 0; k < report->count; k++) {
        const path_row *r = &report->row[k];
        if (r->which != which || r->method != method || !(r->alpha_max <= error)) continue;
        if (best == NULL || r->ns * (double)r->steps < best->ns * (double)best->steps) best = r;
    }
    return best;
}

static void path_print_summary(const path_report *report) {
    static const double errors[4] = {1e-2, 1e-4, 1e-6, 1e-8};
    printf("\n### The least time for a path [us] with alpha never further off than\n\n"
           "| case                   | method                |     1e-2 |     1e-4 |     1e-6 "
           "|     1e-8 |\n|:-----------------------|:----------------------|---------:|---------:"
           "|---------:|---------:|\n");
    for (int which = 0; which < PATH_CASES; which++)
        for (int m = 0; m < PATH_METHODS; m++) {
            printf("| %-22s | %-21s |", report->cases[which].name, path_methods[m].name);
            for (int e = 0; e < 4; e++) {
                const path_row *r = path_cheapest(report, which, m, errors[e]);
                if (r != NULL) printf(" %8.1f |", 1e-3 * r->ns * (double)r->steps);
                else printf("        - |");
            }
            printf("\n");
        }
    int grew = 0, negative = 0;
    for (int k = 0; k < report->count; k++) {
        if (!path_is_implicit(&path_methods[report->row[k].method])) continue;
        grew += report->row[k].grew;
        negative += report->row[k].negative;
    }
    printf("\nimplicit form, all runs: alpha grew in %d steps, dissipation was negative in %d\n",
           grew, negative);
}

/* ---- pictures -------------------------------------------------------------------------------- */

static void path_draw_precision(const path_report *report) {
    char script[8192];
    int n = 0, size = (int)sizeof script;
    double least = HUGE_VAL, most = 0.0; /* [us] of a path: the same axis in every panel */
    for (int k = 0; k < report->count; k++) {
        double time = 1e-3 * report->row[k].ns * (double)report->row[k].steps;
        least = fmin(least, time);
        most = fmax(most, time);
    }
    example_file file = example_open(report->o->out, "path_precision.dat");
    fprintf(file.stream, "# a block for each case and method: time of a path [us], largest error "
                         "of alpha\n");
    n += snprintf(script + n, (size_t)(size - n),
                  "set multiplot layout 1,%d margins screen 0.06,0.84,0.13,0.9 spacing screen "
                  "0.06,0.1\nset logscale xy\nset format y '10^{%%L}'\n"
                  "set format x '10^{%%L}'\nset grid lt 1 lc rgb '#e4e4e4'\n"
                  "set xlabel 'time of the whole path [\302\265s]'\n"
                  "set ylabel 'largest error of alpha' offset 1\nset yrange [1e-12:10]\n"
                  "set xrange [%g:%g]\n"
                  "set key at screen 0.995,0.88 right top Left reverse samplen 2 spacing 1.4 "
                  "font ',10'\n", (int)PATH_CASES, least / 1.5, most * 1.5);
    for (int which = 0; which < PATH_CASES; which++) {
        n += snprintf(script + n, (size_t)(size - n), "set title '%s'\nplot ",
                      report->cases[which].name);
        for (int m = 0; m < PATH_METHODS; m++) {
            for (int k = 0; k < report->count; k++) {
                const path_row *r = &report->row[k];
                if (r->which == which && r->method == m)
                    fprintf(file.stream, "%g %g\n", 1e-3 * r->ns * (double)r->steps,
                            fmax(r->alpha_max, 1e-15));
            }
            fprintf(file.stream, "\n\n");
            n += snprintf(script + n, (size_t)(size - n),
                          "%s'path_precision.dat' index %d with linespoints lc rgb '%s' %s "
                          "title '%s'",
                          m > 0 ? ", \\\n  " : "", which * PATH_METHODS + m,
                          path_methods[m].colour, path_methods[m].rest, path_methods[m].name);
        }
        n += snprintf(script + n, (size_t)(size - n), "\nunset key\n");
    }
    (void)snprintf(script + n, (size_t)(size - n), "unset multiplot");
    example_close(&file);
    (void)example_picture(report->o->out, "path_precision.png", 1350, 480, script);
}

enum { PATH_DRAWN = 100, PATH_LINES = 3 }; /* steps of the runs in the (P, alpha) plane; runs */

/* blocks: the curve, the exact path, the implicit one, two of the evolution form's */
static void path_write_plane(const path_report *report, int which, FILE *to) {
    static const int drawn[PATH_LINES] = {0, 4, 5};
    const path_case *c = &report->cases[which];
    const path_trace *exact = &report->exact[which];
    for (int k = 0; k <= 400; k++) {
        double P = 2.0 * c->curve.Ps * k / 400.0;
        fprintf(to, "%.8g %.8g\n", 1e-6 * P, sphpa_crush_alpha(&c->curve, P, NULL));
    }
    fprintf(to, "\n\n");
    for (int k = 0; k <= exact->n; k += 100)
        fprintf(to, "%.8g %.8g\n", 1e-6 * exact->P[k], exact->alpha[k]);
    fprintf(to, "\n\n");
    path_trace t = path_trace_make(PATH_DRAWN);
    for (int d = 0; d < PATH_LINES; d++) {
        (void)path_run(c, &path_methods[drawn[d]], PATH_DRAWN, &t);
        for (int k = 0; k <= t.n; k++) fprintf(to, "%.8g %.8g\n", 1e-6 * t.P[k], t.alpha[k]);
        fprintf(to, "\n\n");
    }
    path_trace_free(&t);
}

static void path_draw_plane(const path_report *report) {
    char script[8192];
    int n = 0, size = (int)sizeof script;
    example_file file = example_open(report->o->out, "path_plane.dat");
    n += snprintf(script + n, (size_t)(size - n),
                  "set multiplot layout 1,%d\nset grid lt 1 lc rgb '#e4e4e4'\n"
                  "set xlabel 'pressure P [MPa]'\nset ylabel 'distention alpha' offset 1\n"
                  "set key top right Left reverse samplen 2 font ',9' box lc rgb '#b0b0b0' "
                  "opaque\n", (int)PATH_CASES);
    for (int which = 0; which < PATH_CASES; which++) {
        const path_case *c = &report->cases[which];
        path_write_plane(report, which, file.stream);
        n += snprintf(script + n, (size_t)(size - n),
                      "set title '%s: %d steps'\nset xrange [%g:%g]\nset yrange [%g:%g]\nplot ",
                      c->name, (int)PATH_DRAWN, -0.05e-6 * c->curve.Ps, 2.0e-6 * c->curve.Ps,
                      1.0 - 0.04 * (c->curve.alpha0 - 1.0), 1.0 + 1.35 * (c->curve.alpha0 - 1.0));
        static const char *const how[2 + PATH_LINES] = {
            "lines lw 7 lc rgb '#d8d8d8' title 'crush curve'",
            "lines lw 1.5 lc rgb 'black' title 'exact'",
            "points pt 7 ps 0.9 lc rgb '#0b4f9e' title 'implicit'",
            "linespoints pt 8 ps 0.8 lc rgb '#d55e00' title 'evolution, Euler'",
            "linespoints pt 9 ps 0.8 lc rgb '#2a9d4a' title 'evolution, midpoint'"};
        for (int k = 0; k < 2 + PATH_LINES; k++)
            n += snprintf(script + n, (size_t)(size - n), "%s'path_plane.dat' index %d with %s",
                          k > 0 ? ", \\\n  " : "", (2 + PATH_LINES) * which + k, how[k]);
        n += snprintf(script + n, (size_t)(size - n), "\n");
    }
    (void)snprintf(script + n, (size_t)(size - n), "unset multiplot");
    example_close(&file);
    (void)example_picture(report->o->out, "path_plane.png", 1350, 480, script);
}

/* ---- the command ----------------------------------------------------------------------------- */

int main(int argc, char **argv) {
    path_options o;
    memset(&o, 0, sizeof o);
    o.out = "build/bench";
    const example_option options[] = {
        example_flag("quick", &o.quick, "at most 1e4 steps"),
        example_text("out", "DIR", &o.out, "where path_eos.csv and the pictures go"),
        example_flag("no-pictures", &o.no_pictures, "numbers only")};
    example_parse(argc, argv, "paths of one particle, implicit against evolution form",
                  SPHPA_VERSION, options, (int)(sizeof options / sizeof options[0]));
    (void)example_threads(1);
    example_folder(o.out);
    path_report *report = (path_report *)calloc(1, sizeof *report);
    if (report == NULL) example_fail(1, "out of memory");
    report->o = &o;
    report->sizes = o.quick ? 7 : PATH_SIZES;
    bench_read_cpu(report->cpu);
    path_make_cases(report->cases);
    for (int which = 0; which < PATH_CASES; which++) path_one_case(report, which);
    path_write_about(stdout, report, "- ");
    for (int which = 0; which < PATH_CASES; which++) path_print_case(report, which);
    fputs(path_legend, stdout);
    path_print_summary(report);
    fflush(stdout); /* they are there even where no file can be written */
    path_write_csv(report);
    if (!o.no_pictures) path_draw_precision(report);
    if (!o.no_pictures) path_draw_plane(report);
    for (int which = 0; which < PATH_CASES; which++) path_trace_free(&report->exact[which]);
    free(report);
    if (fflush(stdout) != 0 || ferror(stdout))
        example_fail(1, "cannot write to standard output (%s)", strerror(errno));
    return 0;
}
