/* stress_sph.c: what happens at the edge? make stress-sph builds it in double and in float, runs
   both and prints one table.

   A case survives (it reaches its end with a state that is finite in every field, with its mass,
   momentum and energy, and with the right answer where one is known) or it is stopped by the
   library with a message that says what and where. All else is a failure: a wrong answer, a drift,
   a NaN that went unnoticed, steps that fall for ever, a message that tells nothing, a crash, a
   hang. Each case runs in a child process, so that a crash or a hang of one is a row of the table
   and not the end of it; where there is no fork() they run one after the other in this one. Planted
   mistakes of every kind show on each run that the judge sees them. The scenes, and what their
   errors are of, stand in stress_scenes.h; the guards in stress_run.h. */
#include "examples/example.h"

#include "sphpa.h"

#include "bench/stress_scenes.h"

#if EXAMPLE_POSIX
#include <poll.h>
#endif

#ifdef SPHPA_FLOAT
#define STRESS_REAL "float"
#else
#define STRESS_REAL "double"
#endif

#define STRESS_CASE_S 60.0 /* [s] of processor time that a case may take */
#define STRESS_PLANT_S 1.0 /* the same of a planted mistake */

enum { STRESS_ALL = 2 * STRESS_CASES, STRESS_AT_ONCE = 64 };

/* a row and where it came from */
typedef struct stress_result {
    const stress_case *c;
    char real[8];
    stress_row row;
} stress_result;

typedef struct stress_report {
    const char *out, *only, *leave, *join;
    int quick, quiet;
    long threads;
    double limit; /* [s] */
    int count;
    stress_result result[STRESS_ALL];
    int plants_seen, plants;
} stress_report;

/* ---- one case -------------------------------------------------------------------------------- */

static stress_row stress_empty_row(void) {
    stress_row row;
    memset(&row, 0, sizeof row);
    row.error = row.number = (double)NAN;
    return row;
}

static stress_row stress_one(const stress_case *c, double limit, int quick) {
    static stress_world w;
    stress_row row = stress_empty_row();
    memset(&w, 0, sizeof w);
    w.limit = limit;
    w.most_steps = STRESS_STEPS;
    w.quick = quick;
    w.begun = clock();
    c->run(c, &w, &row);
    row.seconds = stress_seconds(&w);
    stress_judge(c, &row);
    stress_clear(&w);
    return row;
}

/* A child process at work. */
typedef struct stress_child {
    int place; /* of the case; -1: nobody */
    long pid;
    int pipe;
    double killed_at; /* [s] wall clock */
} stress_child;

#if EXAMPLE_POSIX
/* The system ends a child that uses more processor time than it should have ended itself at,
   however busy the machine is; by the clock on the wall only what sleeps for ever. */
static void stress_bound_time(double limit) {
#if defined(RLIMIT_CPU) && defined(SIGXCPU)
    struct rlimit bound;
    bound.rlim_cur = (rlim_t)(limit + 2.0);
    bound.rlim_max = (rlim_t)(limit + 4.0);
    (void)setrlimit(RLIMIT_CPU, &bound);
#endif
}

static bool stress_out_of_time(int status) {
#if defined(RLIMIT_CPU) && defined(SIGXCPU)
    return WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU;
#else
    return false;
#endif
}

static void stress_spawn(stress_child *child, const stress_case *c, int place, double limit,
                         int quick) {
    int ends[2];
    fflush(stdout);
    fflush(stderr);
    if (pipe(ends) != 0) example_fail(1, "no pipe (%s)", strerror(errno));
    pid_t pid = fork();
    if (pid < 0) example_fail(1, "no child process (%s); give --threads 1", strerror(errno));
    if (pid == 0) {
        close(ends[0]);
        stress_bound_time(limit);
        (void)example_threads(1);
        stress_row row = stress_one(c, limit, quick);
        ssize_t sent = write(ends[1], &row, sizeof row); /* less than PIPE_BUF: all or nothing */
        _exit(sent == (ssize_t)sizeof row ? 0 : 1);
    }
    close(ends[1]);
    child->place = place;
    child->pid = (long)pid;
    child->pipe = ends[0];
    child->killed_at = example_clock() + 20.0 * limit + 2.0; /* the machine may be busy */
}

/* what a child that ended left, or why it left nothing */
static stress_row stress_collect(const stress_child *child, int status, bool late) {
    stress_row row = stress_empty_row();
    bool whole = read(child->pipe, &row, sizeof row) == (ssize_t)sizeof row;
    if (whole && WIFEXITED(status)) return row;
    row = stress_empty_row();
    late = late || stress_out_of_time(status);
    row.verdict = late ? STRESS_HUNG : STRESS_CRASHED;
    if (late) snprintf(row.message, sizeof row.message, "did not answer and was killed");
    else if (WIFSIGNALED(status))
        snprintf(row.message, sizeof row.message, "ended by signal %d (%s)", WTERMSIG(status),
                 strsignal(WTERMSIG(status)));
    else snprintf(row.message, sizeof row.message, "left with status %d", WEXITSTATUS(status));
    return row;
}

/* looks once after a child: true where it ended, or was ended, and *row is there */
static bool stress_look(stress_child *child, stress_row *row) {
    int status = 0;
    bool late = example_clock() > child->killed_at;
    if (late) (void)kill((pid_t)child->pid, SIGKILL);
    if (waitpid((pid_t)child->pid, &status, late ? 0 : WNOHANG) != (pid_t)child->pid) return false;
    *row = stress_collect(child, status, late);
    close(child->pipe);
    child->place = -1;
    return true;
}
#endif

/* ---- all of them ----------------------------------------------------------------------------- */

static void stress_say(const stress_report *report, const stress_case *c, const stress_row *row,
                       int left) {
    if (!report->quiet)
        fprintf(stderr, "%-6s %-20s %-10s %5.1f s, %d left\n", STRESS_REAL, c->name,
                stress_verdict_name[row->verdict], row->seconds, left);
}

/* runs `count` cases, as many at a time as there are threads, into rows */
static void stress_all(const stress_report *report, const stress_case *const *cases, int count,
                       double limit, stress_row *rows) {
    int left = count;
#if EXAMPLE_POSIX
    stress_child child[STRESS_AT_ONCE];
    int at_once = (int)report->threads, next = 0;
    for (int k = 0; k < at_once; k++) child[k].place = -1;
    while (left > 0) {
        for (int k = 0; k < at_once; k++) {
            if (child[k].place < 0 && next < count) {
                stress_spawn(&child[k], cases[next], next, limit, report->quick);
                next++;
            }
            int place = child[k].place;
            if (place >= 0 && stress_look(&child[k], &rows[place]))
                stress_say(report, cases[place], &rows[place], --left);
        }
        (void)poll(NULL, 0, 10); /* ms */
    }
#else
    for (int k = 0; k < count; k++) {
        rows[k] = stress_one(cases[k], limit, report->quick);
        stress_say(report, cases[k], &rows[k], --left);
    }
#endif
}

/* does the judge see what it must? Without fork() a crash and a hang cannot be tried. */
static void stress_try_judge(stress_report *report) {
    const stress_case *cases[STRESS_PLANTS];
    stress_row rows[STRESS_PLANTS];
    int wanted[STRESS_PLANTS], count = 0;
    for (int k = 0; k < STRESS_PLANTS; k++) {
        if (!EXAMPLE_POSIX && k <= (int)STRESS_PLANT_HANG) continue;
        cases[count] = &stress_plants[k];
        wanted[count++] = (int)stress_plant_verdict[k];
    }
    stress_all(report, cases, count, STRESS_PLANT_S, rows);
    report->plants += count; /* beside those of the other build */
    for (int k = 0; k < count; k++) report->plants_seen += rows[k].verdict == wanted[k];
}

static bool stress_chosen(const stress_report *report, const stress_case *c) {
    if (report->only != NULL) return strstr(c->name, report->only) != NULL;
    return c->quick || !report->quick;
}

static void stress_run_chosen(stress_report *report) {
    const stress_case *cases[STRESS_CASES];
    static stress_row rows[STRESS_CASES];
    int count = 0;
    for (int k = 0; k < STRESS_CASES; k++)
        if (stress_chosen(report, &stress_cases[k])) cases[count++] = &stress_cases[k];
    stress_all(report, cases, count, report->limit, rows);
    for (int k = 0; k < count; k++) {
        stress_result *result = &report->result[report->count++];
        result->c = cases[k];
        snprintf(result->real, sizeof result->real, "%s", STRESS_REAL);
        result->row = rows[k];
    }
}

/* ---- rows from one program to the next ------------------------------------------------------- */

/* written and read by the two builds of one run, on one machine: as they are in memory */
static const char stress_magic[] = "sphpa stress rows 1\n";

static void stress_leave(const stress_report *report) {
    example_file file = example_open_of(report->out, report->leave, "--leave");
    fputs(stress_magic, file.stream);
    fprintf(file.stream, "%d %d %d %d\n", report->count, report->plants_seen, report->plants,
            report->quick);
    for (int k = 0; k < report->count; k++) {
        const stress_result *r = &report->result[k];
        fprintf(file.stream, "%s\n", r->c->name);
        if (fwrite(&r->row, sizeof r->row, 1, file.stream) != 1)
            example_fail(1, "cannot write %s (%s)", file.part, strerror(errno));
    }
    example_close(&file);
}

static const stress_case *stress_find(const char *name) {
    for (int k = 0; k < STRESS_CASES; k++)
        if (strcmp(stress_cases[k].name, name) == 0) return &stress_cases[k];
    return NULL;
}

/* the rows that the other build left, before those of this one; then that file goes */
static void stress_join(stress_report *report) {
    char path[EXAMPLE_PATH + 64], line[64], name[64];
    int count = 0, seen = 0, plants = 0, quick = 0;
    snprintf(path, sizeof path, "%s/%s", report->out, report->join);
    FILE *file = fopen(path, "rb");
    if (file == NULL)
        example_fail(1, "cannot read %s (%s); run the other build with --leave first", path,
                     strerror(errno));
    bool good = fgets(line, sizeof line, file) != NULL && strcmp(line, stress_magic) == 0 &&
                fgets(line, sizeof line, file) != NULL &&
                sscanf(line, "%d %d %d %d", &count, &seen, &plants, &quick) == 4 && count >= 0 &&
                count <= STRESS_CASES;
    for (int k = 0; k < count && good; k++) {
        stress_result *r = &report->result[report->count];
        good = fgets(name, sizeof name, file) != NULL && strchr(name, '\n') != NULL;
        if (good) *strchr(name, '\n') = '\0';
        good = good && (r->c = stress_find(name)) != NULL &&
               fread(&r->row, sizeof r->row, 1, file) == 1;
        snprintf(r->real, sizeof r->real, "%s", strcmp(STRESS_REAL, "float") ? "float" : "double");
        report->count += good;
    }
    fclose(file);
    if (!good) example_fail(1, "%s was not left by the other build of this program", path);
    remove(path);
    report->plants_seen += seen;
    report->plants += plants;
}

/* ---- what is printed ------------------------------------------------------------------------- */

/* a number for the table, "-" where there is none */
static const char *stress_number(char text[16], double x) {
    if (x == x) snprintf(text, 16, "%.1e", x);
    else snprintf(text, 16, "-");
    return text;
}

/* the first `most` characters of a text; what is cut ends in dots; no | for it would end a cell */
static const char *stress_short(char *out, size_t most, const char *text) {
    size_t length = strlen(text), kept = length < most ? length : most;
    memcpy(out, text, kept);
    out[kept] = '\0';
    if (length > most) memcpy(out + most - 2, "..", 2);
    for (char *c = out; *c != '\0'; c++)
        if (*c == '|' || *c == '\n') *c = '/';
    return out;
}

static void stress_print_row(const stress_result *r, bool same) {
    const stress_row *row = &r->row;
    char error[16], energy[16], momentum[16], words[128];
    bool ended = row->verdict != STRESS_SURVIVED;
    printf("| %-19s | %-38.38s | %-6s | %-10s | %7.0f | %7s | %7s | %7s | %5.1f | %s |\n",
           same ? "" : r->c->name, same ? "" : r->c->setting, r->real,
           stress_verdict_name[row->verdict], row->steps, stress_number(error, row->error),
           stress_number(momentum, ended && row->verdict != STRESS_DRIFTS &&
                                           row->verdict != STRESS_WRONG
                                       ? (double)NAN
                                       : row->momentum),
           stress_number(energy, ended && row->verdict != STRESS_DRIFTS &&
                                         row->verdict != STRESS_WRONG
                                     ? (double)NAN
                                     : row->energy),
           row->seconds, stress_short(words, 100, ended ? row->message : row->note));
}

static const stress_result *stress_other(const stress_report *report, const stress_result *r,
                                         const char *real) {
    for (int k = 0; k < report->count; k++)
        if (report->result[k].c == r->c && strcmp(report->result[k].real, real) == 0)
            return &report->result[k];
    return NULL;
}

/* double and float of a case one under the other, in the order of the table */
static void stress_print_table(const stress_report *report) {
    printf("| case                | setting                                | real   | verdict    |"
           "   steps |   error | dp      | dE      |     s | measured, or what stopped it |\n"
           "|:--------------------|:---------------------------------------|:-------|:-----------|"
           "--------:|--------:|--------:|--------:|------:|:-----------------------------|\n");
    for (int c = 0; c < STRESS_CASES; c++) {
        stress_result any;
        any.c = &stress_cases[c];
        const stress_result *d = stress_other(report, &any, "double");
        const stress_result *f = stress_other(report, &any, "float");
        if (d != NULL) stress_print_row(d, false);
        if (f != NULL) stress_print_row(f, d != NULL);
    }
    printf("\nerror: relative, of what stress_sph.csv names. dp, dE: drift of momentum and\n"
           "energy; up to %g is allowed. s: processor time. stopped: by the library, with this\n"
           "message.\n",
           STRESS_DRIFT);
}

static void stress_csv_text(FILE *to, const char *text) {
    fputc('"', to);
    for (; *text != '\0'; text++) {
        if (*text == '"') fputc('"', to);
        fputc(*text == '\n' ? ' ' : *text, to);
    }
    fputc('"', to);
}

static void stress_write_csv(const stress_report *report) {
    example_file file = example_open(report->out, "stress_sph.csv");
    FILE *to = file.stream;
    fflush(stdout); /* the table comes before what is said here */
    fprintf(to, "case,setting,real,verdict,steps,t_s,t_end_s,dt_least_s,error,error_of,allowed,"
                "drift_mass,drift_momentum,drift_energy,below_zero,number,cpu_s,note,message\n");
    for (int k = 0; k < report->count; k++) {
        const stress_result *r = &report->result[k];
        const stress_row *row = &r->row;
        fprintf(to, "%s,", r->c->name);
        stress_csv_text(to, r->c->setting);
        fprintf(to, ",%s,%s,%.0f,%.6g,%.6g,%.3g,%.4g,", r->real, stress_verdict_name[row->verdict],
                row->steps, row->t, row->t_end, row->dt_least, row->error);
        stress_csv_text(to, r->c->error_of);
        fprintf(to, ",%g,%.3g,%.3g,%.3g,%.3g,%.4g,%.2f,", r->c->allowed, row->mass, row->momentum,
                row->energy, row->below, row->number, row->seconds);
        stress_csv_text(to, row->note);
        fputc(',', to);
        stress_csv_text(to, row->message);
        fputc('\n', to);
    }
    example_close(&file);
    fprintf(stderr, "wrote %s/stress_sph.csv\n", report->out);
}

/* the last lines; returns how many failed */
static int stress_print_sum(const stress_report *report) {
    int survived = 0, stopped = 0, failed = 0;
    double seconds = 0.0;
    for (int k = 0; k < report->count; k++) {
        int verdict = report->result[k].row.verdict;
        survived += verdict == STRESS_SURVIVED;
        stopped += verdict == STRESS_STOPPED;
        failed += verdict > STRESS_STOPPED;
        seconds += report->result[k].row.seconds;
    }
    printf("%d survived, %d stopped with a message; %.0f s of processor time\n", survived, stopped,
           seconds);
    for (int k = 0; k < report->count; k++) {
        const stress_result *r = &report->result[k];
        if (r->row.verdict > STRESS_STOPPED)
            printf("%s: %s, %s: %s\n", stress_verdict_name[r->row.verdict], r->c->name, r->real,
                   r->row.message);
    }
    printf("the judge saw %d of the %d mistakes planted for it (crash, hang, NaN, drift, endless steps, "
           "giving up), which count below\n", report->plants_seen, report->plants);
    failed += report->plants - report->plants_seen;
    printf("%d passed, %d failed\n", report->count + report->plants - failed, failed);
    return failed;
}

static void stress_list(const stress_report *report) {
    for (int k = 0; k < STRESS_CASES; k++)
        if (report->only == NULL || stress_chosen(report, &stress_cases[k]))
            printf("%-20s %s %s\n", stress_cases[k].name,
                   stress_cases[k].quick ? "quick" : "     ", stress_cases[k].setting);
}

int main(int argc, char **argv) {
    static stress_report report;
    int list = 0;
    report.out = "build/stress";
    report.limit = STRESS_CASE_S;
    const example_option options[] = {
        example_flag("quick", &report.quick, "fewer cases, and smaller: under a minute"),
        example_text("only", "NAME", &report.only, "the cases whose names hold this"),
        example_flag("list", &list, "print the cases and end"),
        example_number("limit", "s", &report.limit, 0.1, 1e6, "processor time for a case"),
        example_count("threads", &report.threads, 0, STRESS_AT_ONCE,
                      "cases at a time, each on one thread; 0: as many as the machine has"),
        example_text("out", "FOLDER", &report.out, "for stress_sph.csv"),
        example_text("leave", "FILE", &report.leave,
                     "leave the rows in FOLDER for the other build, print nothing"),
        example_text("join", "FILE", &report.join, "print the rows left there, too"),
        example_flag("quiet", &report.quiet, "do not tell of each case"),
    };
    example_parse(argc, argv, "what happens at the edge (in " STRESS_REAL ")", SPHPA_VERSION,
                  options, (int)(sizeof options / sizeof options[0]));
    if (list) {
        stress_list(&report);
        return 0;
    }
    int chosen = 0;
    for (int k = 0; k < STRESS_CASES; k++) chosen += stress_chosen(&report, &stress_cases[k]);
    if (chosen == 0)
        example_fail(2, "--only %s: no case has that in its name; --list shows all", report.only);
    example_folder(report.out);
    if (report.threads == 0) report.threads = example_threads(0);
    if (report.threads > STRESS_AT_ONCE) report.threads = STRESS_AT_ONCE;
    if (report.join != NULL) stress_join(&report);
    stress_try_judge(&report);
    stress_run_chosen(&report);
    if (report.leave != NULL) {
        stress_leave(&report);
        return 0;
    }
    stress_print_table(&report);
    stress_write_csv(&report);
    return stress_print_sum(&report) > 0;
}
