/* bench_eos.c: how long a P-alpha solve takes and how large its error is, solver beside solver.

   make bench-eos builds and runs it; --help lists what it can be asked for, and how a solver of
   your own joins. For every mix of states (bench_mixes.h), tolerance and solver (bench_solvers.h)
   it writes a line of eos.csv: median time, spread, evaluations of the equation of state, and the
   error against long double (eos_reference.h). Pictures are made in bench_draw.h. One thread. */
#include "../examples/example.h"

#include <float.h>

#define SPHPA_POROSITY_IMPLEMENTATION
#include "sphpa.h"

#include "bench_clock.h"
#include "bench_solvers.h"
#include "bench_mixes.h"
#include "eos_reference.h"

enum {
    BENCH_TOLS = 7,
    BENCH_REPEATS = 11,
    BENCH_ROWS = BENCH_PLANS * BENCH_TOLS * BENCH_SOLVER_COUNT,
    BENCH_HISTOGRAM = 64, /* evaluations that are told apart */
    BENCH_ENOUGH = 10000  /* states that no branch predictor remembers */
};
#define BENCH_SAMPLE 1e-3    /* [s] least length of one timing */
#define BENCH_TABLE_TOL 1e-12 /* of the printed tables */

/* ---- settings and results -------------------------------------------------------------------- */

typedef struct bench_options {
    const char *filter, *csv, *out, *states;
    double tol; /* 0: all */
    long n, seed;
    int quick, no_pictures;
} bench_options;

/* a line of the CSV */
typedef struct bench_row {
    int solver, mix; /* in bench_solvers, bench_plans */
    double tol, ns, spread_pct, evals_mean, error;
    int evals_max;
    size_t converged, failures, other_root, ill;
} bench_row;

typedef struct bench_report {
    const bench_options *o;
    double tols[BENCH_TOLS];
    double noise_pct; /* worst spread of a fixed piece of work beside the solvers */
    int tol_count, count;
    size_t n; /* states a mix, asked for */
    bench_mix mix[BENCH_PLANS]; /* set.n is 0 where it was filtered out */
    bench_row row[BENCH_ROWS];
    /* of the states at the table's tolerance, by evaluations: how many */
    size_t histogram[BENCH_PLANS][BENCH_SOLVER_COUNT][BENCH_HISTOGRAM];
    char cpu[128];
} bench_report;

/* the row of a solver on a mix, or NULL */
static const bench_row *bench_find(const bench_report *report, int mix, int solver, double tol) {
    for (int k = 0; k < report->count; k++) {
        const bench_row *row = &report->row[k];
        if (row->mix == mix && row->solver == solver && row->tol == tol) return row;
    }
    return NULL;
}

static int bench_solver_named(const char *name) {
    for (int k = 0; k < BENCH_SOLVER_COUNT; k++)
        if (strcmp(bench_solvers[k].name, name) == 0) return k;
    return -1;
}

/* the tolerance of tables and summary: 1e-12, or the only one that was asked for */
static double bench_table_tol(const bench_report *report) {
    return report->tol_count == 1 ? report->tols[0] : BENCH_TABLE_TOL;
}

#include "bench_draw.h"

/* ---- errors ---------------------------------------------------------------------------------- */

typedef struct bench_room {
    bench_answers answers;
    bench_set converged;  /* the states that a solver brought to an end: the ones to time */
    long double *largest; /* root of each state, by the reference */
} bench_room;

static bench_room bench_room_make(size_t n) {
    bench_room room;
    memset(&room, 0, sizeof room);
    room.answers.alpha = bench_doubles(n);
    room.answers.P = bench_doubles(n);
    room.answers.evaluations = (int *)calloc(n + 1, sizeof(int));
    room.answers.failed = (unsigned char *)calloc(n + 1, 1);
    room.largest = (long double *)calloc(n + 1, sizeof(long double));
    bench_set_make(&room.converged, n);
    if (room.answers.evaluations == NULL || room.answers.failed == NULL || room.largest == NULL)
        example_fail(1, "out of memory; give a smaller --n");
    return room;
}

static void bench_room_free(bench_room *room) {
    free(room->answers.alpha);
    free(room->answers.P);
    free(room->answers.evaluations);
    free(room->answers.failed);
    free(room->largest);
    bench_set_free(&room->converged);
}

static ref_problem bench_reference(const bench_set *set, size_t i) {
    return ref_make(set->matrix, set->curve, set->rho[i], set->u[i], set->alpha_old[i]);
}

static void bench_find_roots(const bench_set *set, bench_room *room) {
    for (size_t i = 0; i < set->n; i++) {
        ref_problem problem = bench_reference(set, i);
        room->largest[i] = ref_largest(&problem);
    }
}

/* What the reference says of one answer. Within 2 tol of the largest root it is right, by the
   definition of right; only the others are worth the reference's search for more roots. */
static ref_verdict bench_judge(const bench_set *set, const bench_room *room, size_t i, double tol,
                               double *error) {
    long double e = (long double)room->answers.alpha[i] - room->largest[i], backward = 0.0L;
    if (e < 0.0L) e = -e;
    ref_verdict verdict = REF_RIGHT;
    if (!(e <= 2.0L * (long double)tol)) {
        ref_problem problem = bench_reference(set, i);
        verdict = ref_judge(&problem, room->answers.alpha[i], tol, &e, &backward);
    }
    *error = (double)e;
    return verdict;
}

/* runs once, fills in what is not time, and gathers the states that converged */
static void bench_examine(const bench_set *set, bench_room *room, bench_row *row,
                          size_t histogram[BENCH_HISTOGRAM]) {
    const bench_answers *answers = &room->answers;
    bench_set *good = &room->converged;
    double sum = 0.0;
    room->answers.all_evaluations = room->answers.most_evaluations = 0;
    bench_solvers[row->solver].run(set, row->tol, &room->answers);
    good->matrix = set->matrix;
    good->curve = set->curve;
    good->n = 0;
    for (size_t i = 0; i < set->n; i++) {
        if (answers->failed[i]) continue;
        int evaluations = answers->evaluations[i];
        good->rho[good->n] = set->rho[i];
        good->u[good->n] = set->u[i];
        good->alpha_old[good->n++] = set->alpha_old[i];
        sum += evaluations;
        if (evaluations > row->evals_max) row->evals_max = evaluations;
        if (histogram != NULL && evaluations >= 0)
            histogram[evaluations < BENCH_HISTOGRAM ? evaluations : BENCH_HISTOGRAM - 1]++;
        double error = 0.0;
        ref_verdict verdict = bench_judge(set, room, i, row->tol, &error);
        row->failures += verdict == REF_WRONG;
        row->other_root += verdict == REF_OTHER_ROOT;
        row->ill += verdict == REF_ILL;
        if (verdict == REF_RIGHT || verdict == REF_OTHER_ROOT) row->error = fmax(row->error, error);
    }
    row->converged = good->n;
    row->failures += set->n - good->n;
    bool sums_only = answers->most_evaluations > 0; /* over all states, the failed ones too */
    row->evals_mean = sums_only ? answers->all_evaluations / (double)set->n
                                : sum / ((double)good->n + 1e-300);
    if (sums_only) row->evals_max = answers->most_evaluations;
}

/* ---- time ------------------------------------------------------------------------------------ */

/* [s] a solve: so many passes over the set that the clock's grain does not matter */
static double bench_sample(const bench_row *row, const bench_set *set, long passes,
                           bench_answers *out) {
    double since = sphpa_wall_clock();
    for (long k = 0; k < passes; k++) bench_solvers[row->solver].run(set, row->tol, out);
    return (sphpa_wall_clock() - since) / ((double)passes * (double)set->n);
}

/* What is timed side by side: the solvers of one mix at one tolerance. */
typedef struct bench_race {
    bench_row *row[BENCH_SOLVER_COUNT];
    bench_set set[BENCH_SOLVER_COUNT]; /* each its own converged states */
    long passes[BENCH_SOLVER_COUNT];
    double sample[BENCH_SOLVER_COUNT][BENCH_REPEATS];
    int count;
} bench_race;

/* adds a row's converged states: the mix's own arrays where all of them did */
static void bench_enter(bench_race *race, bench_row *row, const bench_set *set,
                        const bench_room *room) {
    int k = race->count++;
    race->row[k] = row;
    race->set[k] = *set;
    if (row->converged == set->n) return;
    const bench_set *good = &room->converged;
    bench_set_make(&race->set[k], good->n);
    memcpy(race->set[k].rho, good->rho, good->n * sizeof(double));
    memcpy(race->set[k].u, good->u, good->n * sizeof(double));
    memcpy(race->set[k].alpha_old, good->alpha_old, good->n * sizeof(double));
}

/* Each repeat runs every solver once, beginning with another one: a busy moment hits them all. */
static void bench_run_race(bench_race *race, const bench_set *set, bench_answers *out,
                           double *noise_pct) {
    double noise[BENCH_REPEATS], spread;
    for (int k = 0; k < race->count; k++) {
        double n = (double)race->set[k].n;
        double pass = n > 0.0 ? n * bench_sample(race->row[k], &race->set[k], 1, out) : 0.0;
        race->passes[k] = (long)ceil(BENCH_SAMPLE / (pass + 1e-9));
    }
    for (int repeat = 0; repeat < BENCH_REPEATS; repeat++) {
        noise[repeat] = bench_fixed_work();
        for (int turn = 0; turn < race->count; turn++) {
            int k = (turn + repeat) % race->count;
            if (race->set[k].n > 0)
                race->sample[k][repeat] =
                    bench_sample(race->row[k], &race->set[k], race->passes[k], out);
        }
    }
    (void)bench_median(noise, BENCH_REPEATS, &spread);
    *noise_pct = fmax(*noise_pct, spread);
    for (int k = 0; k < race->count; k++) {
        bench_row *row = race->row[k];
        row->ns = row->spread_pct = (double)NAN;
        if (race->set[k].n > 0)
            row->ns = 1e9 * bench_median(race->sample[k], BENCH_REPEATS, &row->spread_pct);
        if (row->converged < set->n) bench_set_free(&race->set[k]);
    }
}

/* ---- all of it ------------------------------------------------------------------------------- */

/* does "mix/material/curve/solver" hold the text? solver -1: any solver's */
static bool bench_wanted(const bench_options *o, int mix, int solver) {
    char text[160];
    const bench_plan *plan = &bench_plans[mix];
    if (plan->kind == BENCH_RECORDED && o->states == NULL) return false;
    if (o->filter == NULL) return true;
    for (int k = 0; k < BENCH_SOLVER_COUNT; k++) {
        if (solver >= 0 && k != solver) continue;
        snprintf(text, sizeof text, "%s/%s/%s/%s", plan->name, plan->material, plan->curve,
                 bench_solvers[k].name);
        if (strstr(text, o->filter) != NULL) return true;
    }
    return false;
}

static void bench_one_tol(bench_report *report, int mix, double tol, bench_room *room) {
    const bench_set *set = &report->mix[mix].set;
    bench_race race;
    memset(&race, 0, sizeof race);
    for (int k = 0; k < BENCH_SOLVER_COUNT; k++) {
        if (!bench_wanted(report->o, mix, k)) continue;
        bench_row *row = &report->row[report->count++];
        memset(row, 0, sizeof *row);
        row->solver = k;
        row->mix = mix;
        row->tol = tol;
        bool shown = tol == bench_table_tol(report);
        bench_examine(set, room, row, shown ? report->histogram[mix][k] : NULL);
        bench_enter(&race, row, set, room);
    }
    bench_run_race(&race, set, &room->answers, &report->noise_pct);
}

static void bench_all(bench_report *report) {
    const bench_options *o = report->o;
    report->n = (size_t)(o->n > 0 ? o->n : o->quick ? 2000 : 20000);
    for (int mix = 0; mix < BENCH_PLANS; mix++) {
        if (!bench_wanted(o, mix, -1)) continue;
        double since = sphpa_wall_clock();
        bench_mix *own = &report->mix[mix];
        bench_mix_make(own, mix, report->n, (uint64_t)o->seed, o->states);
        bench_room room = bench_room_make(own->set.n);
        bench_find_roots(&own->set, &room);
        for (int k = 0; k < report->tol_count; k++)
            bench_one_tol(report, mix, report->tols[k], &room);
        bench_room_free(&room);
        fprintf(stderr, "%-8s %-10s %-13s %zu states  %.1f s\n", own->name, own->material,
                own->curve_name, own->set.n, sphpa_wall_clock() - since);
    }
}

/* ---- what is written ------------------------------------------------------------------------- */

/* what the numbers hang on, a line each behind `mark`: "# " in the CSV, "- " above the tables */
static void bench_write_about(FILE *to, const bench_report *report, const char *mark) {
    fprintf(to, "%ssphpa %s, P-alpha solvers, one thread, seed %ld\n", mark, SPHPA_VERSION,
            report->o->seed);
    fprintf(to, "%scpu: %s\n%scompiler: %s\n%sflags: %s\n", mark, report->cpu, mark,
            BENCH_COMPILER, mark, BENCH_FLAGS);
    fprintf(to, "%stimes: medians of %d interleaved repeats; spread: interquartile range\n", mark,
            (int)BENCH_REPEATS);
    fprintf(to, "%sa fixed piece of work beside the solvers spread by at most %.1f %%%s\n", mark,
            report->noise_pct,
            report->noise_pct > BENCH_NOISY_PCT ? ": THE MACHINE IS NOISY, look at the spreads"
                                                : "");
#ifdef BENCH_WITH_GSL
    fprintf(to, "%sgsl-*: GSL %s, which evaluates through a function pointer; all others are "
                "inlined\n", mark, GSL_VERSION);
#endif
    fprintf(to, "%sall but the library's own: the crush curve is prepared outside the loop, no "
                "input is checked, no sound speed is returned\n", mark);
    if (report->n < BENCH_ENOUGH)
        fprintf(to, "%sonly %zu states a mix: a processor learns their branches by heart, and all "
                    "times are too good\n", mark, report->n);
    fprintf(to, "%swhere states do not converge within %d iterations, time and evaluations are "
                "over those that do\n", mark, (int)BENCH_MOST);
}

/* Opens it under another name until it is whole. Called before the long part of the run, so that a
   place that cannot be written is found early. */
static example_file bench_open_csv(const char *path) {
    char folder[EXAMPLE_PATH] = ".";
    const char *slash = strrchr(path, '/');
    if (slash != NULL)
        snprintf(folder, sizeof folder, "%.*s", slash > path ? (int)(slash - path) : 1, path);
    example_folder_of(folder, "--csv");
    return example_open_of(folder, slash != NULL ? slash + 1 : path, "--csv");
}

static void bench_write_csv(const bench_report *report, example_file file) {
    bench_write_about(file.stream, report, "# ");
    for (int k = 0; k < report->count; k++) {
        const bench_row *row = &report->row[k];
        const bench_mix *mix = &report->mix[row->mix];
        if (row->converged < mix->set.n)
            fprintf(file.stream, "# %s on %s/%s/%s at tol %g: %.2f %% converged\n",
                    bench_solvers[row->solver].name, mix->name, mix->material, mix->curve_name,
                    row->tol, 100.0 * (double)row->converged / (double)mix->set.n);
    }
    fprintf(file.stream, "solver,material,curve,alpha0,mix,tol,n,ns_per_solve,spread_pct,"
                         "evals_mean,evals_max,max_abs_error,failures,other_root,ill\n");
    for (int k = 0; k < report->count; k++) {
        const bench_row *row = &report->row[k];
        const bench_mix *mix = &report->mix[row->mix];
        fprintf(file.stream, "%s,%s,%s,%.10g,%s,%g,%zu,%.2f,%.2f,%.3f,%d,%.3e,%zu,%zu,%zu\n",
                bench_solvers[row->solver].name, mix->material, mix->curve_name, mix->curve.alpha0,
                mix->name, row->tol, mix->set.n, row->ns, row->spread_pct, row->evals_mean,
                row->evals_max, row->error, row->failures, row->other_root, row->ill);
    }
    example_close(&file);
}

static void bench_print_table(const bench_report *report, int k) {
    const bench_mix *mix = &report->mix[k];
    double tol = bench_table_tol(report);
    const bench_row *base = bench_find(report, k, bench_solver_named("bisection"), tol);
    printf("\n### %s: %s, %s curve, alpha0 %g, tol %g, %zu states\n\n", mix->name, mix->material,
           mix->curve_name, mix->curve.alpha0, tol, mix->set.n);
    printf("| relative | ns/solve |    solves/s |  err%% |  evals |  max | max error | failed "
           "| other |  ill | solver\n");
    printf("|---------:|---------:|------------:|------:|-------:|-----:|----------:|-------:"
           "|------:|-----:|:-------\n");
    for (int s = 0; s < BENCH_SOLVER_COUNT; s++) {
        const bench_row *row = bench_find(report, k, s, tol);
        if (row == NULL) continue;
        if (base != NULL) printf("| %7.1f%% ", 100.0 * base->ns / row->ns);
        else printf("|          ");
        printf("| %8.1f | %11.0f | %4.1f%% | %6.2f | %4d | %9.1e | %6zu | %5zu | %4zu | `%s`",
               row->ns, 1e9 / row->ns, row->spread_pct, row->evals_mean, row->evals_max, row->error,
               row->failures, row->other_root, row->ill, bench_solvers[s].name);
        if (row->converged < mix->set.n)
            printf(" (time of the %.1f %% that converge)",
                   100.0 * (double)row->converged / (double)mix->set.n);
        printf("%s\n", bench_solvers[s].kind == BENCH_POINTER ? " (called by pointer)" : "");
    }
}

/* the fastest solver of another hand that answers every state of a mix; NULL: none */
static const bench_row *bench_best_peer(const bench_report *report, int mix, double tol) {
    const bench_row *best = NULL;
    for (int s = 0; s < BENCH_SOLVER_COUNT; s++) {
        const bench_row *row = bench_find(report, mix, s, tol);
        if (row == NULL || bench_solvers[s].kind == BENCH_LIBRARY || row->failures > 0) continue;
        if (best == NULL || row->ns < best->ns) best = row;
    }
    return best;
}

#define BENCH_ROUGH_PCT 20.0 /* spread of a row, beyond which its ratios are marked */

/* true: it is marked */
static bool bench_print_ratio(int width, const bench_row *slow, const bench_row *fast) {
    if (slow == NULL || fast == NULL) {
        printf(" %*s |", width, "-");
        return false;
    }
    bool rough = fmax(slow->spread_pct, fast->spread_pct) > BENCH_ROUGH_PCT;
    printf(" %*.2f%s |", rough ? width - 1 : width, slow->ns / fast->ns, rough ? "?" : "");
    return rough;
}

static void bench_print_summary(const bench_report *report) {
    double tol = bench_table_tol(report);
    int fast = bench_solver_named("crush-space"), batch = bench_solver_named("crush-space-batch");
    int slow = bench_solver_named("bisection"), lines = 0;
    bool marked = false;
    for (int k = 0; k < BENCH_PLANS; k++) {
        const bench_mix *mix = &report->mix[k];
        const bench_row *own = bench_find(report, k, fast, tol);
        const bench_row *peer = bench_best_peer(report, k, tol);
        if (own == NULL) continue;
        if (lines++ == 0)
            printf("\n### crush-space at tol %g: how many times faster; its evaluations\n\n"
                   "| mix      | material  | curve        | than bisection | than the best peer "
                   "| which        | batch than scalar | evals |  max |\n"
                   "|:---------|:----------|:-------------|---------------:|-------------------:|"
                   ":-------------|------------------:|------:|-----:|\n", tol);
        printf("| %-8s | %-9s | %-12s |", mix->name, mix->material, mix->curve_name);
        bool rough = bench_print_ratio(14, bench_find(report, k, slow, tol), own);
        rough = bench_print_ratio(18, peer, own) || rough;
        printf(" %-12s |", peer != NULL ? bench_solvers[peer->solver].name : "-");
        rough = bench_print_ratio(17, own, bench_find(report, k, batch, tol)) || rough;
        marked = marked || rough;
        printf(" %5.2f | %4d |\n", own->evals_mean, own->evals_max);
    }
    if (marked)
        printf("?: a time in it spread by more than %g %%; run it again on a quieter machine\n",
               BENCH_ROUGH_PCT);
}

/* ---- the command line ------------------------------------------------------------------------ */

static void bench_parse(int argc, char **argv, bench_options *o) {
    const example_option options[] = {
        example_flag("quick", &o->quick, "fewer states and tolerances: under a minute"),
        example_text("filter", "TEXT", &o->filter,
                     "only where mix/material/curve/solver holds it, as inside/pumice or brent"),
        example_number("tol", "1", &o->tol, 0.0, 0.1, "this tolerance only; 0: 1e-2 to 1e-14"),
        example_count("n", &o->n, 0, 10000000, "states a mix; 0: 20000, 2000 with --quick"),
        example_count("seed", &o->seed, 0, 1000000000, "of the states"),
        example_text("states", "FILE", &o->states, "recorded by pumice_impact, for the mix run"),
        example_text("out", "DIR", &o->out, "where eos.csv and the pictures go"),
        example_text("csv", "FILE", &o->csv, "in place of DIR/eos.csv"),
        example_flag("no-pictures", &o->no_pictures, "numbers only")};
    *example_name_() = "bench_eos";
    for (int k = 1; k < argc; k++)
        if (strcmp(argv[k], "--help") == 0 || strcmp(argv[k], "-h") == 0) {
            example_help_("P-alpha solvers: time, evaluations and errors", options,
                          (int)(sizeof options / sizeof options[0]));
            fputs(bench_own_solver, stdout);
            exit(0);
        }
    example_parse(argc, argv, "P-alpha solvers: time, evaluations and errors", SPHPA_VERSION,
                  options, (int)(sizeof options / sizeof options[0]));
}

static void bench_choose_tols(bench_report *report) {
    static const double all[BENCH_TOLS] = {1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14};
    for (int k = 0; k < BENCH_TOLS; k++)
        if (!report->o->quick || k == 1 || k == 3 || k == 5)
            report->tols[report->tol_count++] = all[k];
    if (report->o->tol > 0.0) {
        report->tol_count = 1;
        report->tols[0] = report->o->tol;
    }
}

static void bench_print(const bench_report *report) {
    bench_write_about(stdout, report, "- ");
    for (int k = 0; k < BENCH_PLANS; k++)
        if (report->mix[k].set.n > 0) bench_print_table(report, k);
    bench_print_summary(report);
}

int main(int argc, char **argv) {
    bench_options o;
    char csv[EXAMPLE_PATH];
    memset(&o, 0, sizeof o);
    o.seed = 1;
    o.out = "build/bench";
    bench_parse(argc, argv, &o);
    (void)example_threads(1);
    example_folder(o.out);
    int n = snprintf(csv, sizeof csv, "%s", o.csv != NULL ? o.csv : o.out);
    if (o.csv == NULL) n += snprintf(csv + n, sizeof csv - (size_t)n, "/eos.csv");
    if ((size_t)n >= sizeof csv)
        example_fail(2, "--csv %.60s...: give a name of at most %d characters", csv, EXAMPLE_PATH);
    bench_report *report = (bench_report *)calloc(1, sizeof *report);
    if (report == NULL) example_fail(1, "out of memory");
    report->o = &o;
    bench_read_cpu(report->cpu);
    bench_choose_tols(report);
    if (o.states == NULL)
        fprintf(stderr, "without --states FILE there is no mix run; pumice_impact --record-states "
                        "makes one\n");
    example_file file = bench_open_csv(csv);
    bench_all(report);
    if (report->count == 0) example_discard(&file);
    if (report->count == 0)
        example_fail(2, "--filter %s: no mix, material, curve or solver is called so; try inside, "
                     "cold, pumice, two-exponent or brent", o.filter != NULL ? o.filter : "");
    bench_write_csv(report, file);
    bench_print(report);
    fflush(stdout);
    fprintf(stderr, "wrote %s\n", csv);
    if (!o.no_pictures) bench_draw(report);
    for (int k = 0; k < BENCH_PLANS; k++) bench_set_free(&report->mix[k].set);
    free(report);
    if (fflush(stdout) != 0 || ferror(stdout))
        example_fail(1, "cannot write to standard output (%s)", strerror(errno));
    return 0;
}
