/* bench_sph.c: how many particles a second and core? Gases, solids and porous solids, each a whole
   step with everything active: neighbours, sums, equation of state, integration, step limits.

   make bench-sph builds it in both precisions and runs one after the other; the second shows both.
   A row is a scene with a number of threads. The rows' windows of some steps each are run in turn,
   round after round, so that all meet the same noise; a row shows medians over its windows. */
#include "../examples/example.h"

#include "sphpa.h"

#include "bench_clock.h"
#include "bench_scenes.h"

#ifdef SPHPA_FLOAT
#define BENCH_REAL "float"
#else
#define BENCH_REAL "double"
#endif

enum { BENCH_ROWS = 24, BENCH_WINDOWS = 64, BENCH_LARGE = 1000000, BENCH_LARGE_WINDOWS = 3,
       BENCH_LARGE_WARM_UP = 8 };

/* What can be timed; scenes of one name share a simulation. A window has several rebuilds of the
   lists, so that a median does not leave them out. */
typedef struct bench_case {
    const char *name;
    int kind;
    long n;
    double neighbours;
    int threads;
    long steps;  /* a window; half with --quick */
    double skin; /* 0: the default */
    int quick;   /* also with --quick */
    long late;   /* so many times the warm-up: bodies are damaged by then */
} bench_case;

static const bench_case bench_cases[] = {
    {"gas64", SCENE_GAS, 262144, 48.0, 1, 24, 0.0, 1, 1},
    {"gas64", SCENE_GAS, 262144, 48.0, 2, 24, 0.0, 1, 1},
    {"gas100", SCENE_GAS, 1000000, 48.0, 1, 12, 0.0, 0, 1},
    {"elastic", SCENE_ELASTIC, 107000, 65.0, 1, 24, 0.0, 1, 1},
    {"solid", SCENE_SOLID, 107000, 65.0, 1, 24, 0.0, 1, 1},
    {"solid", SCENE_SOLID, 107000, 65.0, 2, 24, 0.0, 1, 1},
    {"pumice", SCENE_PUMICE, 100000, 65.0, 1, 24, 0.0, 1, 1},
    {"pumice", SCENE_PUMICE, 100000, 65.0, 2, 24, 0.0, 0, 1},
    {"solid-late", SCENE_SOLID, 30000, 65.0, 1, 24, 0.0, 0, 6},
    {"pumice-late", SCENE_PUMICE, 30000, 65.0, 1, 24, 0.0, 0, 20},
    {"gsph", SCENE_GSPH, 40000, 64.0, 1, 24, 0.0, 1, 1},
    {"gsph", SCENE_GSPH, 40000, 64.0, 2, 24, 0.0, 0, 1},
    {"adke", SCENE_ADKE, 40000, 64.0, 1, 24, 0.0, 0, 1},
    {"mpm", SCENE_MPM, 40000, 64.0, 1, 24, 0.0, 0, 1},
    {"gas1e4", SCENE_GAS, 9261, 48.0, 1, 40, 0.0, 0, 1},
    {"gas1e5", SCENE_GAS, 97336, 48.0, 1, 24, 0.0, 1, 1},
    {"gas4e6", SCENE_GAS, 4000000, 48.0, 1, 12, 0.0, 0, 1},
};
enum { BENCH_CASES = sizeof bench_cases / sizeof bench_cases[0] };

typedef struct bench_settings {
    long repeats, warm_up;
    int quick, append, report, quiet;
    const char *out, *only;
} bench_settings;

/* a row under way */
typedef struct bench_row {
    const bench_case *what;
    bench_scene *scene;
    int windows;
    double wall[BENCH_WINDOWS], user[BENCH_WINDOWS]; /* [s] of each window */
    uint64_t built[BENCH_WINDOWS];                   /* rebuilds of the lists in each */
    uint64_t steps, rebuilds;
} bench_row;

static void bench_threads(int threads) {
#ifdef _OPENMP
    omp_set_num_threads(threads);
#else
    (void)threads;
#endif
}

static bool bench_wanted(const bench_settings *s, const bench_case *what) {
    if (s->quick && !what->quick) return false;
    return s->only[0] == '\0' || strstr(what->name, s->only) != NULL;
}

/* how many are wanted; tells them, too */
static int bench_list(const bench_settings *s, bool tell) {
    int count = 0;
    for (int k = 0; k < BENCH_CASES; k++) {
        const bench_case *what = &bench_cases[k];
        if (!bench_wanted(s, what)) continue;
        count++;
        if (tell)
            printf("%-10s %8ld particles, %.0f neighbours, %d thread%s\n", what->name, what->n,
                   what->neighbours, what->threads, what->threads > 1 ? "s" : "");
    }
    return count;
}

static bench_scene *bench_scene_of(const bench_settings *s, const bench_row *rows, int count,
                                   const bench_case *what) {
    for (int k = 0; k < count; k++)
        if (strcmp(rows[k].what->name, what->name) == 0) return rows[k].scene;
    if (!s->quiet) fprintf(stderr, "%s, %ld particles, %s\n", what->name, what->n, BENCH_REAL);
    bench_threads(what->threads);
    bench_scene *scene = scene_new(what->kind, what->n, what->neighbours, what->skin);
    scene_steps(scene, what->n < BENCH_LARGE || s->warm_up < BENCH_LARGE_WARM_UP
                           ? what->late * s->warm_up
                           : BENCH_LARGE_WARM_UP);
    return scene;
}

static int bench_begin(const bench_settings *s, bench_row *rows) {
    int count = 0;
    for (int k = 0; k < BENCH_CASES; k++) {
        if (!bench_wanted(s, &bench_cases[k])) continue;
        bench_scene *scene = bench_scene_of(s, rows, count, &bench_cases[k]);
        memset(&rows[count], 0, sizeof rows[count]);
        rows[count].what = &bench_cases[k];
        rows[count++].scene = scene;
    }
    return count;
}

static void bench_window(bench_row *row, long window) {
    sphpa_stats *stats = &row->scene->sim.stats;
    bench_threads(row->what->threads);
    uint64_t steps = stats->steps, rebuilds = stats->rebuilds;
    double user = bench_user_time(), wall = sphpa_wall_clock();
    scene_steps(row->scene, window);
    row->built[row->windows] = stats->rebuilds - rebuilds;
    row->wall[row->windows] = sphpa_wall_clock() - wall;
    row->user[row->windows++] = bench_user_time() - user;
    row->steps += stats->steps - steps;
    row->rebuilds += stats->rebuilds - rebuilds;
}

static void bench_rounds(const bench_settings *s, bench_row *rows, int count) {
    example_progress progress = {0};
    progress.quiet = s->quiet;
    uint64_t updates = 0;
    long steps = 0;
    for (long round = 0; round < s->repeats; round++)
        for (int k = 0; k < count; k++) {
            if (rows[k].what->n >= BENCH_LARGE && round >= BENCH_LARGE_WINDOWS) continue;
            long window = s->quick ? rows[k].what->steps / 2 : rows[k].what->steps;
            bench_window(&rows[k], window);
            double share = ((double)round * count + k + 1.0) / ((double)s->repeats * count);
            steps += window;
            updates += (uint64_t)window * rows[k].scene->sim.p.n;
            example_progress_show(&progress, share, rows[k].scene->sim.time,
                                  rows[k].scene->sim.dt, (uint64_t)steps, updates);
        }
    example_progress_end(&progress);
}

/* ---- what came of it ------------------------------------------------------------------------- */

static const char *const bench_columns =
    "scene,real,n,threads,neighbours,updates_per_s,updates_per_s_core_user,bytes_per_particle,"
    "ns_per_neighbour,rebuilds_per_step,scratch_bytes_per_particle,energy_drift,spread_pct";

static void bench_write_row(FILE *file, const bench_row *row) {
    const sphpa_sim *sim = &row->scene->sim;
    double wall[BENCH_WINDOWS], user[BENCH_WINDOWS], spread, ignore;
    memcpy(wall, row->wall, sizeof wall);
    memcpy(user, row->user, sizeof user);
    double updates = (double)row->steps / row->windows * (double)sim->p.n; /* of a window */
    double w = bench_median(wall, row->windows, &ignore) / updates;
    double u = bench_median(user, row->windows, &spread) / updates;
    fprintf(file, "%s,%s,%zu,%d,%.1f,%.0f,%.0f,%zu,%.2f,%.2f,%.0f,%.1e,%.1f\n", row->what->name,
            BENCH_REAL, sim->p.n, row->what->threads, sim->stats.neighbours_mean, 1.0 / w, 1.0 / u,
            sphpa_particles_bytes_each(&sim->p), 1e9 * u / sim->stats.neighbours_mean,
            (double)row->rebuilds / (double)row->steps, bench_scratch(sim),
            sphpa_sim_totals(sim).energy / row->scene->energy - 1.0, spread);
}

/* Two threads against one: all windows together, and the best pair, of windows that ran one after the
   other with equally many rebuilds, that is with equal work. */
static void bench_speedup(const bench_row *rows, int count) {
    for (int k = 1; k < count; k++) {
        const bench_row *one = &rows[k - 1], *two = &rows[k];
        if (one->scene != two->scene) continue;
        double best = 0.0, wall[2] = {0.0, 0.0};
        int pairs = 0;
        for (int w = 0; w < two->windows; w++) {
            wall[0] += one->wall[w];
            wall[1] += two->wall[w];
            if (one->built[w] != two->built[w]) continue;
            best = fmax(best, one->wall[w] / two->wall[w]);
            pairs++;
        }
        printf("# %s, %s: %d threads are %.2f times one over %d windows each", two->what->name,
               BENCH_REAL, two->what->threads, wall[0] / wall[1], two->windows);
        if (pairs > 0) printf("; best of %d pairs of equal work %.2f", pairs, best);
        putchar('\n');
    }
}

static void bench_report(const bench_row *row) {
    static char text[16384];
    sphpa_sim_report(&row->scene->sim, text, sizeof text);
    printf("\n# ---- %s, %s, %zu particles, warm-up and setup included\n%s", row->what->name,
           BENCH_REAL, row->scene->sim.p.n, text);
}

static void bench_write(const bench_settings *s, const bench_row *rows, int count) {
    char path[EXAMPLE_PATH];
    snprintf(path, sizeof path, "%s/sph.csv", s->out);
    FILE *file = fopen(path, s->append ? "a" : "w");
    if (file == NULL) example_fail(1, "%s: %s; give another --out", path, strerror(errno));
    if (!s->append) fprintf(file, "%s\n", bench_columns);
    for (int k = 0; k < count; k++) bench_write_row(file, &rows[k]);
    if (fclose(file) != 0) example_fail(1, "%s: %s", path, strerror(errno));
}

/* the file as a table */
static void bench_show(const bench_settings *s) {
    char path[EXAMPLE_PATH], line[512];
    snprintf(path, sizeof path, "%s/sph.csv", s->out);
    FILE *file = fopen(path, "r");
    if (file == NULL) return;
    static const int width[13] = {-9, -7, 8, 8, 11, 14, 24, 19, 17, 18, 27, 13, 11};
    while (fgets(line, sizeof line, file) != NULL) {
        int k = 0;
        for (char *word = strtok(line, ",\n"); word != NULL && k < 13; word = strtok(NULL, ",\n"))
            printf("%*s ", width[k++], word);
        putchar('\n');
    }
    fclose(file);
}

int main(int argc, char **argv) {
    bench_settings s = {5, 40, 0, 0, 0, 0, "build/bench", ""};
    int list = 0;
    bench_row rows[BENCH_ROWS];
    const example_option options[] = {
        example_count("repeats", &s.repeats, 1, BENCH_WINDOWS,
                      "windows of each row (a million particles or more: 3)"),
        example_count("warm-up", &s.warm_up, 0, 10000, "steps before the first window"),
        example_flag("quick", &s.quick, "fewer scenes and repeats"),
        example_text("only", "NAME", &s.only, "scenes whose name holds this"),
        example_flag("list", &list, "the scenes, with how many particles and threads; runs nothing"),
        example_flag("append", &s.append, "add to the table that is there, and show all of it"),
        example_flag("report", &s.report, "where the time of each scene went, pass by pass"),
        example_text("out", "FOLDER", &s.out, "for sph.csv"),
        example_flag("quiet", &s.quiet, "no progress"),
    };
    example_parse(argc, argv, "particles a second and core, scene by scene", SPHPA_VERSION,
                  options, (int)(sizeof options / sizeof options[0]));
    if (s.quick && s.repeats > 3) s.repeats = 3;
    if (bench_list(&s, list != 0) == 0)
        example_fail(2, "--only %s: no scene has that in its name; --list shows them", s.only);
    if (list) return 0;
    example_folder(s.out);
    int count = bench_begin(&s, rows);
    bench_rounds(&s, rows, count);
    bench_write(&s, rows, count);
    char cpu[128];
    bench_read_cpu(cpu);
    printf("# %s, %s\n# %s %s\n", BENCH_REAL, cpu, BENCH_COMPILER, BENCH_FLAGS);
    bench_speedup(rows, count);
    printf("# peak memory %.0f MB\n", 1e-6 * example_peak_memory());
    for (int k = 0; k < count && s.report; k++)
        if (k == 0 || rows[k].scene != rows[k - 1].scene) bench_report(&rows[k]);
    bench_show(&s);
    for (int k = 0; k < count; k++)
        if (k == 0 || rows[k].scene != rows[k - 1].scene) scene_free(rows[k].scene);
    return 0;
}
