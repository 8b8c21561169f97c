/* bench_draw.h: the pictures of bench_eos, by gnuplot: error against time, how often each solver
   asks for F, and a state on which Newton's method cycles for ever. Included by bench_eos.c. */
#ifndef BENCH_DRAW_H
#define BENCH_DRAW_H

enum { BENCH_SCRIPT = 16384 };

/* a picture's script while it is put together */
typedef struct bench_script {
    char text[BENCH_SCRIPT];
    size_t length;
} bench_script;

static void bench_add(bench_script *script, const char *format, ...) EXAMPLE_PRINTF(2, 3);
static void bench_add(bench_script *script, const char *format, ...) {
    va_list args;
    va_start(args, format);
    int n = vsnprintf(script->text + script->length, BENCH_SCRIPT - script->length, format, args);
    va_end(args);
    if (n > 0) script->length += (size_t)n;
    if (script->length >= BENCH_SCRIPT) example_fail(1, "a picture's script is too long");
}

/* how a solver is drawn */
typedef struct bench_style {
    const char *solver, *colour, *rest; /* rest: point and dash */
} bench_style;

/* one that is not in the list is black */
static bench_style bench_style_of(const char *solver) {
    static const bench_style styles[] = {
        {"bisection", "#7f7f7f", "pt 4"},          {"newton", "#e7a13d", "pt 1 dt 2"},
        {"safe-newton", "#d55e00", "pt 6"},        {"crush-space", "#0b4f9e", "pt 7 lw 2"},
        {"crush-space-batch", "#3aa0e8", "pt 5 lw 2"}, {"itp", "#8c564b", "pt 8"},
        {"chandrupatla", "#2a9d4a", "pt 9"},       {"brent", "#7b3fa0", "pt 10"},
        {"gsl-bisection", "#a0a0a0", "pt 4 dt 3"}, {"gsl-brent", "#b377d6", "pt 10 dt 3"},
        {"gsl-newton", "#e0b040", "pt 2 dt 3"},
    };
    const bench_style other = {solver, "#000000", "pt 11"};
    for (size_t k = 0; k < sizeof styles / sizeof styles[0]; k++)
        if (strcmp(styles[k].solver, solver) == 0) return styles[k];
    return other;
}

static const char *bench_short_curve(const bench_mix *mix) {
    return mix->curve.kind == SPHPA_CRUSH_TWO_EXPONENT ? "two exponents" : "quadratic";
}

/* ---- error against time ---------------------------------------------------------------------- */

/* block k * solvers + s of the file: solver s on mix k, a line for each tolerance */
static void bench_write_points(const bench_report *report) {
    example_file file = example_open(report->o->out, "work_precision.dat");
    for (int k = 0; k < BENCH_PLANS; k++)
        for (int s = 0; s < BENCH_SOLVER_COUNT; s++) {
            fprintf(file.stream, "# %s %s %s %s: tol, ns a solve, largest error\n",
                    bench_plans[k].name, bench_plans[k].material, bench_plans[k].curve,
                    bench_solvers[s].name);
            int lines = 0;
            for (int t = 0; t < report->tol_count; t++) {
                const bench_row *row = bench_find(report, k, s, report->tols[t]);
                if (row == NULL || row->converged == 0) continue;
                /* a double next to 1 is no nearer to the root than this */
                fprintf(file.stream, "%g %.3f %.3e\n", row->tol, row->ns, fmax(row->error, 1e-17));
                lines++;
            }
            fprintf(file.stream, lines > 0 ? "\n\n" : "NaN NaN NaN\n\n\n");
        }
    example_close(&file);
}

/* the range of times in a panel, and marks that do not run into each other */
static void bench_add_times(bench_script *script, const bench_report *report, int k) {
    double low = HUGE_VAL, high = 0.0;
    for (int r = 0; r < report->count; r++) {
        const bench_row *row = &report->row[r];
        if (row->mix != k || !(row->ns > 0.0)) continue;
        low = fmin(low, row->ns);
        high = fmax(high, row->ns);
    }
    bench_add(script, "set xrange [%g:%g]\nset xtics (", low / 1.4, high * 1.4);
    for (double mark = 1.0; mark < 1e6; mark *= 10.0)
        bench_add(script, high > 50.0 * low ? "%g, '' %g, '' %g, " : "%g, %g, %g, ", mark,
                  2.0 * mark, 5.0 * mark);
    bench_add(script, "1e6)\n");
}

/* one panel: a curve for each solver that was run on the mix */
static void bench_add_panel(bench_script *script, const bench_report *report, int k, bool key) {
    const bench_mix *mix = &report->mix[k];
    bench_add_times(script, report, k);
    bench_add(script, "set title '%s: %s, %s'\n%s\nplot ", mix->name, mix->material,
              bench_short_curve(mix),
              key ? "set key at screen 0.995,0.93 right top Left reverse spacing 1.4"
                  : "unset key");
    const char *comma = "";
    for (int s = 0; s < BENCH_SOLVER_COUNT; s++) {
        const bench_row *row = bench_find(report, k, s, report->tols[0]);
        if (row == NULL) continue;
        bench_style style = bench_style_of(bench_solvers[s].name);
        bench_add(script, "%s'work_precision.dat' index %d using 2:3 with linespoints lc rgb '%s' "
                          "%s title '%s%s'",
                  comma, k * BENCH_SOLVER_COUNT + s, style.colour, style.rest, style.solver,
                  row->converged < mix->set.n ? " (part)" : ""); /* of those that converge */
        comma = ", \\\n  ";
    }
    bench_add(script, "\n");
}

/* the mixes of pumice's quadratic curve and of the run in one picture, the others in another */
static void bench_draw_precision(const bench_report *report, bool others, const char *name) {
    bench_script script;
    int panels = 0, columns = others ? 5 : 3;
    script.length = 0;
    for (int k = 0; k < BENCH_PLANS; k++)
        panels += report->mix[k].set.n > 0 && (k > 5) == others;
    if (panels == 0) return;
    if (panels < columns) columns = panels;
    int rows = (panels + columns - 1) / columns;
    bench_add(&script,
              "set multiplot layout %d,%d margins screen %g,%g,%g,0.93 spacing screen %g,%g\n"
              "set logscale xy\nset format y '10^{%%L}'\nset format x '%%g'\n"
              "set grid lt 1 lc rgb '#e4e4e4'\nset xlabel 'time a solve [ns]' offset 0,0.4\n"
              "set ylabel 'largest error of alpha' offset 0.8\nset yrange [1e-17:0.1]\n",
              rows, columns, others ? 0.05 : 0.07, others ? 0.87 : 0.84, rows > 1 ? 0.08 : 0.14,
              others ? 0.045 : 0.06, 0.13);
    bool first = true;
    for (int k = 0; k < BENCH_PLANS; k++) {
        if (report->mix[k].set.n == 0 || (k > 5) != others) continue;
        bench_add_panel(&script, report, k, first);
        first = false;
    }
    bench_add(&script, "unset multiplot");
    (void)example_picture(report->o->out, name, columns * (others ? 330 : 400) + 180,
                          rows * 380 + 40, script.text);
}

/* ---- evaluations ----------------------------------------------------------------------------- */

/* which mixes the histogram shows: where the root is inside, so that there is something to solve */
static bool bench_in_histogram(const bench_report *report, int k) {
    const bench_plan *plan = &bench_plans[k];
    return report->mix[k].set.n > 0 && strcmp(plan->material, "pumice") == 0 &&
           (plan->kind == BENCH_INSIDE || plan->kind == BENCH_COLD);
}

/* a solver's row of boxes, as high as its commonest count is wide; returns whether there is one */
static bool bench_write_boxes(FILE *to, const size_t histogram[BENCH_HISTOGRAM], int row) {
    size_t most = 0;
    for (int e = 0; e < BENCH_HISTOGRAM; e++)
        if (histogram[e] > most) most = histogram[e];
    for (int e = 0; e < BENCH_HISTOGRAM; e++)
        if (histogram[e] > 0)
            fprintf(to, "%d %d %g %g %d %g\n", e, row, e - 0.42, e + 0.42, row,
                    row + 0.88 * (double)histogram[e] / (double)most);
    if (most > 0) fprintf(to, "\n\n");
    return most > 0;
}

static void bench_add_ridges(bench_script *script, const bench_report *report, int k, FILE *to,
                             int *index) {
    const bench_mix *mix = &report->mix[k];
    char boxes[4096] = "", tics[2048] = "";
    size_t used = 0, named = 0;
    int rows = 0;
    for (int s = BENCH_SOLVER_COUNT - 1; s >= 0; s--) {
        const bench_row *row = bench_find(report, k, s, bench_table_tol(report));
        if (row == NULL || !bench_write_boxes(to, report->histogram[k][s], rows)) continue;
        double share = 100.0 * (double)row->converged / (double)mix->set.n;
        used += (size_t)snprintf(boxes + used, sizeof boxes - used,
                                 "%s'evaluations.dat' index %d using 1:2:3:4:5:6 with boxxyerror "
                                 "fs solid 0.8 noborder lc rgb '%s'", used > 0 ? ", \\\n  " : "",
                                 *index, bench_style_of(bench_solvers[s].name).colour);
        named += (size_t)snprintf(tics + named, sizeof tics - named, "%s'%s",
                                  named > 0 ? ", " : "", bench_solvers[s].name);
        if (share < 100.0)
            named += (size_t)snprintf(tics + named, sizeof tics - named, " (%.3g %%%%)", share);
        named += (size_t)snprintf(tics + named, sizeof tics - named, "' %g", rows + 0.2);
        bench_add(script, "set label %d '%.1f' at graph 0.985,first %g right font ',10'\n",
                  rows + 1, row->evals_mean, rows + 0.45);
        rows++;
        (*index)++;
    }
    if (rows == 0) return;
    bench_add(script, "set title '%s: %s, %s'\nset yrange [-0.1:%d]\nset ytics (%s)\n"
                      "plot %s\nunset label\n",
              mix->name, mix->material, bench_short_curve(mix), rows, tics, boxes);
}

static void bench_draw_evaluations(const bench_report *report) {
    bench_script script;
    int panels = 0, index = 0;
    script.length = 0;
    for (int k = 0; k < BENCH_PLANS; k++) panels += bench_in_histogram(report, k);
    if (panels == 0) return;
    int columns = panels > 1 ? 2 : 1, rows = (panels + columns - 1) / columns;
    example_file file = example_open(report->o->out, "evaluations.dat");
    fprintf(file.stream, "# boxes: evaluations, row, left, right, bottom, top\n");
    bench_add(&script,
              "set multiplot layout %d,%d title 'share of the states over evaluations of the "
              "equation of state, tol %g; right: their mean'\n"
              "unset key\nset xrange [0:54]\nset xlabel 'evaluations'\n"
              "set grid x lt 1 lc rgb '#e4e4e4'\nset tics scale 0.4\n",
              rows, columns, bench_table_tol(report));
    for (int k = 0; k < BENCH_PLANS; k++)
        if (bench_in_histogram(report, k))
            bench_add_ridges(&script, report, k, file.stream, &index);
    example_close(&file);
    bench_add(&script, "unset multiplot");
    if (index > 0)
        (void)example_picture(report->o->out, "evaluations.png", columns * 560, rows * 420 + 30,
                              script.text);
}

/* ---- Newton's cycle and safe Newton's escape ------------------------------------------------- */

enum { BENCH_PATH = 40 };

/* where an iteration went */
typedef struct bench_path {
    bench_point at[BENCH_PATH];
    int count;
} bench_path;

/* Newton's method as it stands in a textbook, kept in [1, alpha_old]; to its end or for 40 steps */
static bench_path bench_newton_path(bench_problem *problem) {
    bench_path path;
    double alpha = problem->alpha_old;
    for (path.count = 0; path.count < BENCH_PATH; path.count++) {
        bench_point x = path.at[path.count] = bench_at(problem, alpha);
        double next = fmin(fmax(alpha - x.F / x.dF, 1.0), problem->alpha_old);
        if (fabs(next - alpha) <= 1e-12) {
            path.count++;
            break;
        }
        alpha = next;
    }
    return path;
}

/* The same with a bracket [a, b] that the sign of F keeps around the root: a step that leaves it is
   replaced by its middle. */
static bench_path bench_safe_path(bench_problem *problem) {
    bench_path path;
    double a = 1.0, b = problem->alpha_old, alpha = b;
    for (path.count = 0; path.count < BENCH_PATH; path.count++) {
        bench_point x = path.at[path.count] = bench_at(problem, alpha);
        if (x.F > 0.0) b = alpha;
        else a = alpha;
        double next = alpha - x.F / x.dF;
        if (!(next > a && next < b)) next = 0.5 * (a + b);
        if (fabs(next - alpha) <= 1e-12 || x.F == 0.0) {
            path.count++;
            break;
        }
        alpha = next;
    }
    return path;
}

/* how wide a cycle of two points the path is from its start, as a share of [1, alpha_old]; or 0 */
static double bench_cycle_width(const bench_problem *problem, const bench_path *path) {
    if (path->count < BENCH_PATH) return 0.0;
    const bench_point *at = path->at;
    if (fabs(at[2].alpha - at[0].alpha) > 1e-12) return 0.0;
    return fabs(at[1].alpha - at[0].alpha) / (problem->alpha_old - 1.0);
}

/* the state of `draws` random ones on which the library's Newton fails and whose cycle shows best:
   wide, with a root well inside; false: none */
static bool bench_find_cycle(bench_problem *problem, sphpa_rng *rng, int draws) {
    bench_problem best = *problem;
    double score = 0.0;
    for (int k = 0; k < draws; k++) {
        bench_draw_hot(rng, problem);
        if (!bench_is_inside(problem)) continue;
        bench_path plain = bench_newton_path(problem), safe = bench_safe_path(problem);
        double width = bench_cycle_width(problem, &plain), span = problem->alpha_old - 1.0;
        double root = safe.at[safe.count - 1].alpha - 1.0;
        if (root < 0.25 * span || root > 0.75 * span || span < 1.0) continue;
        problem->evaluations = 0;
        if (width > score && bench_newton(problem).failed) {
            score = width;
            best = *problem;
        }
    }
    *problem = best;
    return score > 0.0;
}

/* block 0: F(alpha); 1 and 2: the two iterations, with down to the axis between their points */
static void bench_write_path(FILE *to, const bench_path *path) {
    for (int k = 0; k < path->count; k++)
        fprintf(to, "%.12g 0 %d\n%.12g %.12g %d\n", path->at[k].alpha, k, path->at[k].alpha,
                path->at[k].F, k);
    fprintf(to, "\n\n");
}

static void bench_write_cycle(const char *out, bench_problem *problem, const bench_path *plain,
                              const bench_path *safe) {
    example_file file = example_open(out, "newton_cycle.dat");
    fprintf(file.stream, "# rho %.17g u %.17g alpha_old %.17g: alpha F\n", problem->rho, problem->u,
            problem->alpha_old);
    for (int k = 0; k <= 1000; k++) {
        double alpha = 1.0 + (problem->alpha_old - 1.0) * k / 1000.0;
        fprintf(file.stream, "%.12g %.12g\n", alpha, bench_at(problem, alpha).F);
    }
    fprintf(file.stream, "\n\n");
    bench_write_path(file.stream, plain);
    bench_write_path(file.stream, safe);
    example_close(&file);
}

/* both panels: F in grey, the iteration over it, its first or its wider steps numbered */
static void bench_add_cycle(bench_script *script, int steps, double label_away) {
    const struct {
        const char *title, *colour, *shown, *label, *offset;
    } panel[2] = {{"Newton: between two points for ever", "#d1731f", "$3 < 2",
                   "$3 == 0 ? '0, 2, 4, ..' : '1, 3, 5, ..'", "0,0"},
                  {"safe Newton", "#0b4f9e", "abs($2) > 0.05", "sprintf('%d', $3)", "-0.8,0"}};
    for (int k = 0; k < 2; k++) {
        bench_add(script, "set title '%s", panel[k].title);
        if (k == 1) bench_add(script, ": %d steps to 1e-12", steps);
        bench_add(script,
                  "'\nplot 'newton_cycle.dat' index 0 with lines lw 2 lc rgb '#999999' "
                  "title 'F', \\\n"
                  "  '' index %d using 1:2 with lines lw 1.5 lc rgb '%s' title 'steps', \\\n"
                  "  '' index %d using 1:(int($0)%%2==1 ? $2 : NaN) with points pt 7 ps 1.1 lc rgb "
                  "'%s' notitle, \\\n"
                  "  '' index %d using 1:(int($0)%%2==1 && %s ? $2 + %g*sgn($2) : NaN):(%s) "
                  "with labels offset %s notitle\n",
                  k + 1, panel[k].colour, k + 1, panel[k].colour, k + 1, panel[k].shown,
                  label_away, panel[k].label, panel[k].offset);
    }
}

static void bench_draw_cycle(const bench_report *report) {
    bench_script script;
    sphpa_crush curve = bench_curve_of(&bench_plans[1]);
    bench_set set;
    sphpa_rng rng = sphpa_rng_seed((uint64_t)report->o->seed, BENCH_PLANS);
    memset(&set, 0, sizeof set);
    set.matrix = sphpa_tillotson_find("pumice");
    set.curve = &curve;
    bench_problem problem = bench_open(&set, 1e-12);
    script.length = 0;
    if (!bench_find_cycle(&problem, &rng, 100000)) {
        fprintf(stderr, "left out %s/newton_cycle.png: no state found\n", report->o->out);
        return;
    }
    bench_path plain = bench_newton_path(&problem), safe = bench_safe_path(&problem);
    bench_write_cycle(report->o->out, &problem, &plain, &safe);
    double span = problem.alpha_old - 1.0;
    bench_add(&script,
              "set multiplot layout 1,2 title 'pumice, quadratic curve: rho = %.4g kg/m3, u = %.4g "
              "J/kg, alpha_old = %.4g' noenhanced\nset key top left Left reverse\n"
              "set xrange [%g:%g]\nset xlabel 'alpha'\nset ylabel 'F(alpha)'\nset xzeroaxis lt -1\n"
              "set grid lt 1 lc rgb '#eeeeee'\n",
              problem.rho, problem.u, problem.alpha_old, 1.0 - 0.15 * span,
              problem.alpha_old + 0.15 * span);
    bench_add_cycle(&script, safe.count - 1, 0.1 * span);
    bench_add(&script, "unset multiplot");
    (void)example_picture(report->o->out, "newton_cycle.png", 1100, 480, script.text);
}

static void bench_draw(const bench_report *report) {
    if (report->tol_count > 1) {
        bench_write_points(report);
        bench_draw_precision(report, false, "work_precision.png");
        bench_draw_precision(report, true, "work_precision_others.png");
    } else {
        fprintf(stderr, "left out the work-precision pictures: one tolerance makes no curve\n");
    }
    bench_draw_evaluations(report);
    bench_draw_cycle(report);
}

#endif
