/* verify_frame.h: what all problems of `make verify` share: rows, their limits and verdicts, a run
   of a simulation with its time and its conserved drifts measured, convergence orders, verify.csv.

   A problem is a function that makes runs and adds rows, and a line in verify.c's table. A row says
   how wrong one quantity of one run was, and how long that run took. Each limit is set where the
   row is made, with a comment that says where it comes from; a row without one is "reported" and
   counts neither as passed nor as failed. After each problem a row NAME-conserved judges the
   conserved sums of all its runs, reported ones too. */
#ifndef VERIFY_FRAME_H
#define VERIFY_FRAME_H

enum { VERIFY_ROWS_MAX = 16384, VERIFY_NAME = 40, VERIFY_TEXT = 96 };

#ifdef SPHPA_FLOAT
#define VERIFY_REAL "float"
#else
#define VERIFY_REAL "double"
#endif

/* [1] relative drift of the energy that is allowed everywhere. What is left of it in double is
   rounding: pair work and heat cancel (Owen 2014). */
#define VERIFY_ENERGY 1e-4
/* [1] of mass and momentum. Pair forces are opposite to rounding: 1e-16 a step in double times some
   1e4 steps. v in float is rounded to 3e-8 of itself each step, independently. */
#define VERIFY_MASS 1e-12
#define VERIFY_MOMENTUM (sizeof(sphpa_real) == 8 ? 1e-11 : 1e-5)

#define VERIFY_CSV_HEAD                                                                            \
    "problem,scheme,kernel,real,n,neighbours,l1_error,linf_error,order,cpu_s,drift_mass,"          \
    "drift_momentum,drift_energy,limit,verdict"

/* One line of verify.csv. What does not apply is NaN, and empty in the file. */
typedef struct verify_row {
    char problem[VERIFY_NAME]; /* "sod-rho": the problem and what of it is measured */
    char scheme[VERIFY_NAME];  /* "gas+balsara": the modules and all settings that are no default */
    char kernel[16], real[8];
    double n, neighbours;              /* particles; neighbours within the support, mean */
    double l1_error, linf_error;       /* as the problem defines them */
    double order;                      /* of l1_error against the next coarser run of this kind */
    double cpu_s;                      /* [s] CPU time, all threads */
    double drift_mass, drift_momentum, drift_energy; /* [1] largest at any step, see verify_drift */
    char limit[VERIFY_TEXT]; /* "l1_error<=0.009;order>=1.8"; "" for a row that only reports */
    char verdict[12];        /* "passed", "failed", "reported" */
    int dim;                 /* of space, for the order; not in the file */
} verify_row;

struct verify;

/* A problem: one line of the table in verify.c. */
typedef struct verify_problem {
    const char *name; /* --only finds it by a part of this */
    void (*run)(struct verify *v);
    int dim;     /* most dimensions that it needs: --quick leaves out those with 3 */
    int compare; /* not 0: the float program runs it, too */
    double cost, cost_quick; /* [s] about, in double, for the time that is left */
    const char *about;       /* for --list */
} verify_problem;

/* The run of the program. */
typedef struct verify {
    const verify_problem *problems;
    int problem_count, quick, quiet, max_threads;
    const char *only, *out; /* only: NULL for all */
    double energy; /* [1] what the energy of the problem under way may drift */
    /* the problem under way: its place, its runs and their worst drifts */
    int current, runs, broken;
    double worst_mass, worst_momentum, worst_energy, mean_energy, cpu_s;
    double begun, current_begun, shown, cost_all, cost_done; /* [s] */
    sphpa_sim *sim;                                          /* the last run's; not yet freed */
    verify_row *rows;
    int row_count;
} verify;

/* ---- errors ---------------------------------------------------------------------------------- */

/* Sums |difference| over particles: L1 is the mean over all of them. */
typedef struct verify_error {
    double sum, most;
    size_t count;
} verify_error;

static inline void verify_error_add(verify_error *e, double difference) {
    double size = fabs(difference);
    e->sum += size;
    if (!(size <= e->most)) e->most = size; /* a NaN stays */
    e->count++;
}

static inline void verify_error_put(verify_row *row, const verify_error *e) {
    row->l1_error = e->count > 0 ? e->sum / (double)e->count : (double)NAN;
    row->linf_error = e->count > 0 ? e->most : (double)NAN;
}

/* ---- rows ------------------------------------------------------------------------------------ */

static inline verify_row verify_row_of(const char *problem, const char *scheme,
                                       const char *kernel, int dim) {
    verify_row row;
    memset(&row, 0, sizeof row);
    snprintf(row.problem, sizeof row.problem, "%s", problem);
    snprintf(row.scheme, sizeof row.scheme, "%s", scheme);
    snprintf(row.kernel, sizeof row.kernel, "%s", kernel);
    snprintf(row.real, sizeof row.real, VERIFY_REAL);
    row.n = row.neighbours = row.l1_error = row.linf_error = row.order = (double)NAN;
    row.cpu_s = row.drift_mass = row.drift_momentum = row.drift_energy = (double)NAN;
    row.dim = dim;
    return row;
}

/* the columns that a limit may be on */
static inline double *verify_column(verify_row *row, const char *name) {
    const struct {
        const char *name;
        double *value;
    } all[] = {{"n", &row->n},
               {"neighbours", &row->neighbours},
               {"l1_error", &row->l1_error},
               {"linf_error", &row->linf_error},
               {"order", &row->order},
               {"cpu_s", &row->cpu_s},
               {"drift_mass", &row->drift_mass},
               {"drift_momentum", &row->drift_momentum},
               {"drift_energy", &row->drift_energy}};
    for (size_t k = 0; k < sizeof all / sizeof all[0]; k++)
        if (strcmp(all[k].name, name) == 0) return all[k].value;
    example_fail(1, "verify: no column %s; a limit names one of the CSV's", name);
}

/* Adds a limit, verify_limit(&row, "l1_error", "<=", 0.009): all of a row's must hold. Say in a
   comment beside it where the number comes from: a page, a theory, a published result. */
static inline void verify_limit(verify_row *row, const char *column, const char *sense,
                                double value) {
    size_t used = strlen(row->limit);
    (void)verify_column(row, column);
    snprintf(row->limit + used, sizeof row->limit - used, "%s%s%s%.6g", used > 0 ? ";" : "", column,
             sense, value);
    if (strlen(row->limit) + 1 >= sizeof row->limit)
        example_fail(1, "verify: the limits of %s are too long", row->problem);
}

/* does the row meet its limits? They are read from the text that is printed: what one sees is what
   was judged. A NaN meets none. */
static inline bool verify_meets(verify_row *row) {
    const char *text = row->limit;
    while (*text != '\0') {
        char column[VERIFY_NAME];
        size_t length = strcspn(text, "<>");
        snprintf(column, sizeof column, "%.*s", (int)length, text);
        bool less = text[length] == '<';
        char *end = NULL;
        double bound = strtod(text + length + 2, &end), value = *verify_column(row, column);
        if (less ? !(value <= bound) : !(value >= bound)) return false;
        text = *end == ';' ? end + 1 : end;
    }
    return true;
}

/* The order of l1_error between this run and the last coarser one of the same problem, scheme,
   kernel, precision and neighbours (to 10 %). Particles per dimension are its measure of h. */
static inline double verify_order(const verify *v, const verify_row *row) {
    for (int k = v->row_count - 1; k >= 0; k--) {
        const verify_row *old = &v->rows[k];
        if (strcmp(old->problem, row->problem) != 0 || strcmp(old->scheme, row->scheme) != 0 ||
            strcmp(old->kernel, row->kernel) != 0 || strcmp(old->real, row->real) != 0)
            continue;
        bool alike = !(fabs(old->neighbours - row->neighbours) > 0.1 * row->neighbours);
        if (alike && old->n < row->n && row->dim > 0)
            return log(old->l1_error / row->l1_error) * row->dim / log(row->n / old->n);
    }
    return (double)NAN;
}

/* A row NAME-order on the least-squares slope of log l1_error against log n over all resolutions of
   `problem`, of the scheme and kernel of its last row; it must be `least` or more. */
static inline void verify_slope(struct verify *v, const char *problem, double least);

/* "1.234e-05", or nothing at all for what does not apply; n: a whole number, f: fixed */
static inline const char *verify_cell(char cell[32], const char *format, double value) {
    cell[0] = '\0';
    if (!isnan(value)) {
        if (strcmp(format, "n") == 0) snprintf(cell, 32, "%.0f", value);
        else if (strcmp(format, "f") == 0) snprintf(cell, 32, "%.3f", value);
        else snprintf(cell, 32, "%.4e", value);
    }
    return cell;
}

static inline void verify_print_row(FILE *to, const verify_row *row, bool csv) {
    char c[9][32];
    const char *all[9] = {verify_cell(c[0], "n", row->n),
                          verify_cell(c[1], "f", row->neighbours),
                          verify_cell(c[2], "e", row->l1_error),
                          verify_cell(c[3], "e", row->linf_error),
                          verify_cell(c[4], "f", row->order),
                          verify_cell(c[5], "f", row->cpu_s),
                          verify_cell(c[6], "e", row->drift_mass),
                          verify_cell(c[7], "e", row->drift_momentum),
                          verify_cell(c[8], "e", row->drift_energy)};
    if (csv) {
        fprintf(to, "%s,%s,%s,%s", row->problem, row->scheme, row->kernel, row->real);
        for (int k = 0; k < 9; k++) fprintf(to, ",%s", all[k]);
        fprintf(to, ",%s,%s\n", row->limit, row->verdict);
        return;
    }
    fprintf(to, "%-8s %-22s %-28s %-11s %-6s %8s %8s %10s %10s %7s %9s %10s  %s\n", row->verdict,
            row->problem, row->scheme, row->kernel, row->real, all[0], all[1], all[2], all[3],
            all[4], all[5], all[8], row->limit);
}

static inline void verify_print_head(FILE *to) {
    fprintf(to, "# %-6s %-22s %-28s %-11s %-6s %8s %8s %10s %10s %7s %9s %10s  %s\n", "verdict",
            "problem", "scheme", "kernel", "real", "n", "neighb.", "L1", "Linf", "order", "cpu [s]",
            "drift E", "limit");
}

static inline void verify_judge(verify_row *row) {
    bool judged = row->limit[0] != '\0';
    snprintf(row->verdict, sizeof row->verdict, "%s",
             !judged ? "reported" : verify_meets(row) ? "passed" : "failed");
}

/* Takes the row into the table, with its order (unless it is set already) and its verdict. */
static inline void verify_add(verify *v, verify_row row) {
    if (v->row_count >= VERIFY_ROWS_MAX)
        example_fail(1, "verify: more than %d rows; raise VERIFY_ROWS_MAX", VERIFY_ROWS_MAX);
    if (strchr(row.problem, ',') != NULL || strchr(row.scheme, ',') != NULL)
        example_fail(1, "verify: a comma in \"%s\", \"%s\" would be another column of its file",
                     row.problem, row.scheme);
    if (isnan(row.order)) row.order = verify_order(v, &row);
    verify_judge(&row);
    v->rows[v->row_count++] = row;
    verify_print_row(stdout, &row, false);
    fflush(stdout);
}

static inline void verify_slope(verify *v, const char *problem, double least) {
    char name[VERIFY_NAME];
    double count = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
    const verify_row *last = NULL;
    for (int k = v->row_count - 1; k >= 0; k--) {
        const verify_row *row = &v->rows[k];
        if (strcmp(row->problem, problem) != 0 || strcmp(row->real, VERIFY_REAL) != 0) continue;
        if (last == NULL) last = row;
        if (strcmp(row->scheme, last->scheme) != 0 || strcmp(row->kernel, last->kernel) != 0)
            continue;
        double a = log(row->n) / row->dim, b = -log(row->l1_error);
        count += 1.0, x += a, y += b, xx += a * a, xy += a * b;
    }
    if (last == NULL) return;
    snprintf(name, sizeof name, "%.30s-order", problem);
    verify_row row = verify_row_of(name, last->scheme, last->kernel, last->dim);
    row.neighbours = last->neighbours;
    row.n = count; /* resolutions */
    row.order = (count * xy - x * y) / (count * xx - x * x);
    verify_limit(&row, "order", ">=", least);
    verify_add(v, row);
}

/* One quantity of a run that was made before: what the run measured, another name, other errors. */
static inline verify_row verify_also(const verify_row *row, const char *problem) {
    verify_row other = *row;
    snprintf(other.problem, sizeof other.problem, "%s", problem);
    other.l1_error = other.linf_error = other.order = (double)NAN;
    other.limit[0] = '\0';
    return other;
}

/* ---- time ------------------------------------------------------------------------------------ */

static inline double verify_cost(const verify *v, int problem) {
    const verify_problem *p = &v->problems[problem];
    return v->quick ? p->cost_quick : p->cost;
}

/* [s] about how long the rest takes: the table's costs, at the pace of what is done */
static inline double verify_left(const verify *v) {
    double now = example_clock(), current = verify_cost(v, v->current);
    double done = v->current_begun - v->begun;
    double pace = v->cost_done > 20.0 ? done / v->cost_done : 1.0;
    double rest = v->cost_all - v->cost_done - current;
    return fmax(current * pace - (now - v->current_begun), 0.0) + rest * pace;
}

static inline void verify_show(verify *v, double share, bool at_once) {
    double now = example_clock();
    int terminal = example_terminal_();
    if (v->quiet || (!at_once && now - v->shown < (terminal ? 0.5 : 30.0))) return;
    v->shown = now;
    fprintf(stderr, "%s%-18s run %d: %3.0f %%, %.0f s so far, about %.0f s left%s",
            terminal ? "\r" : "", v->problems[v->current].name, v->runs + 1, 100.0 * share,
            now - v->begun, verify_left(v), terminal ? "   " : "\n");
    fflush(stderr);
}

/* ---- a run ----------------------------------------------------------------------------------- */

/* What to run. Zeroed members are none; scene, initial and t_end must be set. */
typedef struct verify_case {
    const sphpa_scene *scene;
    const sphpa_particles *initial; /* stays the caller's */
    sphpa_sim_options options;
    double t_end; /* [s] */
    double every; /* [s] between calls of output; 0: at the end only */
    sphpa_result (*output)(sphpa_sim *sim, void *user, sphpa_error *err);
    sphpa_result (*step)(sphpa_sim *sim, void *user, sphpa_error *err);
    void *user; /* handed to both */
    int threads; /* 0: one below 8000 particles (sharing so few out costs more), else all */
} verify_case;

/* Drifts against the sums at the start. Momentum in units of sqrt(2 M E), which is that of all
   particles if they went one way with the energy that is there. */
typedef struct verify_watch {
    verify *v;
    const verify_case *task;
    sphpa_totals start;
    double mass, momentum, energy, neighbours;
    uint64_t steps;
} verify_watch;

static inline void verify_drift(verify_watch *watch, const sphpa_sim *sim) {
    sphpa_totals now = sphpa_sim_totals(sim);
    const sphpa_totals *then = &watch->start;
    double scale = sqrt(2.0 * then->mass * fmax(then->energy, now.energy)), square = 0.0;
    for (int k = 0; k < 3; k++) square += pow(now.momentum[k] - then->momentum[k], 2.0);
    double mass = fabs(now.mass / then->mass - 1.0);
    double momentum = scale > 0.0 ? sqrt(square) / scale : 0.0;
    double energy = fabs(now.energy - then->energy) / fmax(fabs(then->energy), 1e-300);
    if (!(mass <= watch->mass)) watch->mass = mass; /* a NaN stays */
    if (!(momentum <= watch->momentum)) watch->momentum = momentum;
    if (!(energy <= watch->energy)) watch->energy = energy;
}

static inline sphpa_result verify_step_(sphpa_sim *sim, void *user, sphpa_error *err) {
    verify_watch *watch = (verify_watch *)user;
    verify_drift(watch, sim);
    watch->neighbours += sim->stats.neighbours_mean;
    watch->steps++;
    verify_show(watch->v, sim->time / watch->task->t_end, false);
    return watch->task->step != NULL ? watch->task->step(sim, watch->task->user, err) : SPHPA_OK;
}

static inline sphpa_result verify_output_(sphpa_sim *sim, void *user, sphpa_error *err) {
    const verify_watch *watch = (const verify_watch *)user;
    if (watch->task->output == NULL) return SPHPA_OK;
    return watch->task->output(sim, watch->task->user, err);
}

/* into the row, and into the problem's row on what is conserved */
static inline void verify_note_(verify *v, verify_row *row, const verify_watch *watch) {
    row->drift_mass = watch->mass;
    row->drift_momentum = watch->momentum;
    row->drift_energy = watch->energy;
    row->neighbours = watch->neighbours / fmax((double)watch->steps, 1.0);
    v->worst_mass = fmax(v->worst_mass, isnan(watch->mass) ? HUGE_VAL : watch->mass);
    v->worst_momentum =
        fmax(v->worst_momentum, isnan(watch->momentum) ? HUGE_VAL : watch->momentum);
    v->worst_energy = fmax(v->worst_energy, isnan(watch->energy) ? HUGE_VAL : watch->energy);
    v->mean_energy += watch->energy;
    v->cpu_s += row->cpu_s;
    v->runs++;
}

static inline void verify_release(verify *v) {
    if (v->sim != NULL) sphpa_sim_free(v->sim);
    free(v->sim);
    v->sim = NULL;
}

/* Runs to t_end and refreshes, so that v->sim->p has rho, P, .. of that moment; it is there until
   the next call. Fills n, neighbours (mean over the steps), cpu_s and the drifts of *row. false: it
   broke down, said why on stderr, and the problem's row on what is conserved fails. */
static inline bool verify_simulate(verify *v, const verify_case *task, verify_row *row) {
    sphpa_error err;
    verify_release(v);
    v->sim = (sphpa_sim *)calloc(1, sizeof *v->sim);
    if (v->sim == NULL) example_fail(1, "verify: out of memory");
    verify_watch watch;
    memset(&watch, 0, sizeof watch);
    watch.v = v;
    watch.task = task;
    row->n = (double)task->initial->n;
    int threads = task->threads > 0 ? task->threads : task->initial->n < 8000 ? 1 : v->max_threads;
    (void)example_threads(threads < v->max_threads ? threads : v->max_threads);
    clock_t begun = clock();
    sphpa_result result =
        sphpa_sim_create(v->sim, task->scene, task->initial, &task->options, &err);
    if (result == SPHPA_OK) {
        sphpa_run run;
        memset(&run, 0, sizeof run);
        watch.start = sphpa_sim_totals(v->sim);
        run.t_end = task->t_end;
        run.every = task->every;
        run.user = &watch;
        run.step = verify_step_;
        run.output = verify_output_;
        result = sphpa_sim_run(v->sim, &run, &err);
    }
    if (result == SPHPA_OK) result = sphpa_sim_refresh(v->sim, &err);
    row->cpu_s = (double)(clock() - begun) / (double)CLOCKS_PER_SEC;
    verify_note_(v, row, &watch);
    if (result == SPHPA_OK) return true;
    if (example_terminal_()) fputc('\n', stderr);
    fprintf(stderr, "verify: %s, %s, %s, %zu particles broke down at t = %g of %g: %s\n",
            row->problem, row->scheme, row->kernel, task->initial->n, v->sim->time, task->t_end,
            err.message);
    v->broken++;
    return false;
}

/* how many of a problem's resolutions to run, the coarsest first: two where it should be quick */
static inline int verify_levels(const verify *v, int all) {
    return v->quick && all > 2 ? 2 : all;
}

/* ---- the problems, one after another --------------------------------------------------------- */

/* what all runs of a problem kept; l1: mean drift of the energy, linf: the largest */
static inline void verify_conserved(verify *v, const verify_problem *problem) {
    char name[VERIFY_NAME];
    snprintf(name, sizeof name, "%s-conserved", problem->name);
    verify_row row = verify_row_of(name, "all", "all", 0);
    row.n = v->runs;
    row.l1_error = v->mean_energy / v->runs;
    row.linf_error = row.drift_energy = v->worst_energy;
    row.drift_mass = v->worst_mass;
    row.drift_momentum = v->worst_momentum;
    row.cpu_s = v->cpu_s;
    if (v->broken > 0) row.linf_error = row.drift_energy = (double)NAN; /* meets no limit */
    verify_limit(&row, "drift_energy", "<=", v->energy);
    verify_limit(&row, "drift_mass", "<=", VERIFY_MASS);
    verify_limit(&row, "drift_momentum", "<=", VERIFY_MOMENTUM);
    verify_add(v, row);
}

static inline bool verify_wanted(const verify *v, int k) {
    const verify_problem *problem = &v->problems[k];
    if (v->quick && problem->dim > 2) return false;
    if (sizeof(sphpa_real) == 4 && !problem->compare) return false;
    return v->only == NULL || strstr(problem->name, v->only) != NULL;
}

static inline void verify_run_one(verify *v, int k) {
    v->current = k;
    v->current_begun = example_clock();
    v->runs = v->broken = 0;
    v->worst_mass = v->worst_momentum = v->worst_energy = v->mean_energy = v->cpu_s = 0.0;
    v->energy = VERIFY_ENERGY;
    verify_show(v, 0.0, true);
    if (!v->quiet && example_terminal_()) fputc('\n', stderr);
    v->problems[k].run(v);
    verify_release(v);
    if (v->runs > 0) verify_conserved(v, &v->problems[k]);
    v->cost_done += verify_cost(v, k);
}

/* all that are wanted */
static inline void verify_run_all(verify *v) {
    v->begun = example_clock();
    for (int k = 0; k < v->problem_count; k++)
        if (verify_wanted(v, k)) v->cost_all += verify_cost(v, k);
    verify_print_head(stdout);
    for (int k = 0; k < v->problem_count; k++)
        if (verify_wanted(v, k)) verify_run_one(v, k);
}

/* ---- verify.csv ------------------------------------------------------------------------------ */

static inline void verify_write(const verify *v) {
    example_file file = example_open(v->out, "verify.csv");
    fprintf(file.stream, VERIFY_CSV_HEAD "\n");
    for (int k = 0; k < v->row_count; k++) verify_print_row(file.stream, &v->rows[k], true);
    example_close(&file);
}

/* the next cell of a line, cut to the room there is */
static inline void verify_next_cell(const char **line, char *to, size_t size) {
    size_t length = strcspn(*line, ",\n"), kept = length < size ? length : size - 1;
    memcpy(to, *line, kept);
    to[kept] = '\0';
    *line += length + ((*line)[length] == ',');
}

static inline void verify_read_row(verify *v, const char *line) {
    verify_row row = verify_row_of("", "", "", 0);
    verify_next_cell(&line, row.problem, sizeof row.problem);
    verify_next_cell(&line, row.scheme, sizeof row.scheme);
    verify_next_cell(&line, row.kernel, sizeof row.kernel);
    verify_next_cell(&line, row.real, sizeof row.real);
    double *number[9] = {&row.n,         &row.neighbours,     &row.l1_error,
                         &row.linf_error, &row.order,          &row.cpu_s,
                         &row.drift_mass, &row.drift_momentum, &row.drift_energy};
    for (int k = 0; k < 9; k++) {
        char cell[32];
        verify_next_cell(&line, cell, sizeof cell);
        if (cell[0] != '\0') *number[k] = strtod(cell, NULL);
    }
    verify_next_cell(&line, row.limit, sizeof row.limit);
    verify_next_cell(&line, row.verdict, sizeof row.verdict);
    if (v->row_count < VERIFY_ROWS_MAX) v->rows[v->row_count++] = row;
}

/* the rows that the double program left */
static inline void verify_read(verify *v) {
    char path[EXAMPLE_PATH], line[1024];
    snprintf(path, sizeof path, "%s/verify.csv", v->out);
    FILE *file = fopen(path, "r");
    if (file == NULL || fgets(line, sizeof line, file) == NULL ||
        strncmp(line, VERIFY_CSV_HEAD, strlen(VERIFY_CSV_HEAD)) != 0)
        example_fail(1, "cannot read %s (%s); run verify_double --join first, or leave out --join",
                     path, file == NULL ? strerror(errno) : "it has other columns");
    while (fgets(line, sizeof line, file) != NULL) verify_read_row(v, line);
    fclose(file);
}

/* "12 passed, 0 failed" alone on the last line; returns how many failed */
static inline int verify_count(const verify *v) {
    int passed = 0, failed = 0;
    for (int k = 0; k < v->row_count; k++) {
        passed += strcmp(v->rows[k].verdict, "passed") == 0;
        failed += strcmp(v->rows[k].verdict, "failed") == 0;
    }
    if (failed > 0) printf("# failed:\n");
    for (int k = 0; k < v->row_count; k++)
        if (strcmp(v->rows[k].verdict, "failed") == 0)
            verify_print_row(stdout, &v->rows[k], false);
    printf("%d passed, %d failed\n", passed, failed);
    return failed;
}

#endif
