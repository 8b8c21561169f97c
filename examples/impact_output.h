/* impact_output.h: logs, files, tables and pictures of pumice_impact.c, which includes it after its
   settings. Everything here reads the simulation and changes nothing. */
#ifndef IMPACT_OUTPUT_H
#define IMPACT_OUTPUT_H

/* What one output found out. */
typedef struct impact_record {
    double time;                  /* [s] */
    double largest, second, dust; /* [1] of the target's mass */
} impact_record;

typedef struct impact_history {
    int count;
    impact_record record[IMPACT_RECORDS];
} impact_history;

#define IMPACT_WINDOW 2e-5   /* [s] of the run's end over which the largest fragment is watched */
#define IMPACT_SHORTEST 5e-5 /* [s] a run that is shorter tells nothing about the end */

/* How the largest fragment goes on at the end of a run: over its last 20 us or its last fifth,
   whichever is longer, however many outputs lie in them. */
typedef struct impact_trend {
    int outputs;         /* that were looked at */
    double span, change; /* [s] they cover; [1] largest less least share of the target's mass */
    double last_two;     /* [1] between the last two outputs */
    bool short_run, few; /* cannot be told: the run is too short; less than three outputs */
    bool settled;        /* the change is below 0.01 */
} impact_trend;

static impact_trend impact_trend_of(const impact_history *history) {
    impact_trend trend;
    int last = history->count - 1;
    double end = history->record[last].time, window = fmax(IMPACT_WINDOW, 0.2 * end);
    double least = history->record[last].largest, most = least;
    memset(&trend, 0, sizeof trend);
    for (int k = last; k >= 0 && history->record[k].time >= end - window * (1.0 + 1e-9); k--) {
        least = fmin(least, history->record[k].largest);
        most = fmax(most, history->record[k].largest);
        trend.span = end - history->record[k].time;
        trend.outputs++;
    }
    trend.change = most - least;
    if (last > 0)
        trend.last_two = fabs(history->record[last].largest - history->record[last - 1].largest);
    trend.short_run = end < IMPACT_SHORTEST * (1.0 - 1e-9);
    trend.few = trend.outputs < 3;
    trend.settled = !trend.short_run && !trend.few && trend.change < 0.01;
    return trend;
}

static bool impact_has_hdf5(void) {
#ifdef SPHPA_WITH_HDF5
    return true;
#else
    return false;
#endif
}

/* ---- settings as a list ---------------------------------------------------------------------- */

#ifdef SPHPA_WITH_HDF5
/* What files tell of a run. A resumed run must share the first of them with the one before. */
typedef struct impact_setting {
    const char *name; /* of the option; behind a blank, which part of it */
    double value;
    const char *words; /* what values from 0 stand for, or NULL */
} impact_setting;

enum { IMPACT_SHARED = 24, IMPACT_LISTED = 26 };

static void impact_list(const impact_settings *s, impact_setting list[IMPACT_LISTED]) {
    const impact_setting all[IMPACT_LISTED] = {
        {"speed", s->speed, NULL}, {"angle", s->angle, NULL},
        {"target-diameter", s->target_diameter, NULL},
        {"projectile-diameter", s->projectile_diameter, NULL},
        {"particles", (double)s->particles, NULL},
        {"projectile-particles", (double)s->projectile_particles, NULL},
        {"curve", s->curve, IMPACT_CURVES}, {"solver", s->solver, IMPACT_SOLVERS},
        {"weibull-k", s->weibull_k, NULL}, {"weibull-m", s->weibull_m, NULL},
        {"seed", (double)s->seed, NULL}, {"lattice-seed", (double)s->lattice_seed, NULL},
        {"correction", s->correction, "off|on"}, {"balsara", s->balsara, "off|on"},
        {"tension", s->tension, NULL}, {"spread", s->spread, NULL},
        {"viscosity a", s->viscosity[0], NULL}, {"viscosity b", s->viscosity[1], NULL},
        {"every", s->every, NULL}, {"gauge x", s->gauge[0], NULL},
        {"gauge y", s->gauge[1], NULL}, {"gauge z", s->gauge[2], NULL},
        {"link", s->link, NULL}, {"damage-below", s->damage_below, NULL},
        {"cfl", s->cfl, NULL}, {"t-end", s->t_end, NULL}};
    memcpy(list, all, sizeof all);
}

/* a setting's value as one would give it */
static void impact_value(const impact_setting *setting, char text[32]) {
    size_t length = 0;
    const char *word =
        setting->words != NULL ? example_word_(setting->words, (int)setting->value, &length) : NULL;
    if (word != NULL) snprintf(text, 32, "%.*s", (int)length, word);
    else snprintf(text, 32, "%.15g", setting->value);
}

/* the list as the text that a file keeps under /Parameters; must live as long as the info */
typedef struct impact_texts {
    char key[IMPACT_LISTED][40], value[IMPACT_LISTED][32];
    sphpa_setting setting[IMPACT_LISTED];
} impact_texts;

static sphpa_snapshot_info impact_info(const impact_settings *s, impact_texts *texts) {
    sphpa_snapshot_info info;
    impact_setting list[IMPACT_LISTED];
    memset(&info, 0, sizeof info);
    impact_list(s, list);
    for (int k = 0; k < IMPACT_LISTED; k++) {
        snprintf(texts->key[k], sizeof texts->key[k], "Impact:%s", list[k].name);
        snprintf(texts->value[k], sizeof texts->value[k], "%.17g", list[k].value);
        texts->setting[k].key = texts->key[k];
        texts->setting[k].value = texts->value[k];
    }
    info.run = "pumice_impact";
    info.settings = texts->setting;
    info.settings_count = IMPACT_LISTED;
    return info;
}
#endif

/* the target's centre on every axis [m]: all coordinates are positive, as some readers want them */
static double impact_origin(const impact_settings *s) { return 2.0 * s->target_diameter; }

/* ---- logs ------------------------------------------------------------------------------------ */

#define IMPACT_LOG_HEADER                                                                          \
    "# L: angular momentum about the centre of mass\n"                                             \
    "#   step        time[s]          dt[s]        mass[kg]     kinetic[J]    internal[J]  "       \
    "energy drift      px[kg m/s]      py[kg m/s]      pz[kg m/s]      Lx[kg m2/s]     "           \
    "Ly[kg m2/s]     Lz[kg m2/s]   u below 0[J]  neighbours  limit\n"

static void impact_log_line(FILE *log, const sphpa_sim *sim, const sphpa_totals *start) {
    sphpa_totals now = sphpa_sim_totals(sim);
    fprintf(log, "%8llu %14.7e %14.7e %15.9e %14.7e %14.7e %13.3e",
            (unsigned long long)sim->stats.steps, sim->time, sim->dt, now.mass, now.kinetic,
            now.internal, (now.energy - start->energy) / start->energy);
    for (int a = 0; a < 3; a++) fprintf(log, " %15.8e", now.momentum[a]);
    for (int a = 0; a < 3; a++) fprintf(log, " %15.8e", now.angular[a]);
    fprintf(log, " %14.4e %11.1f  %s\n", sim->stats.u_deficit, sim->stats.neighbours_mean,
            sim->stats.limit[sim->stats.limit_last].name);
}

/* A log that is begun anew (until < 0), or continued: lines whose first number is above `until`
   (rounded as the log's numbers are) are of steps that will be made again, and go; so does a line
   that was cut off. Ends the program where it cannot be written. */
static FILE *impact_reopen(const char *path, double until, const char *header) {
    char line[1024], part[EXAMPLE_PATH + 64];
    snprintf(part, sizeof part, "%s.part", path);
    FILE *old = until >= 0.0 ? fopen(path, "r") : NULL, *log = fopen(part, "w");
    if (log != NULL && old == NULL) fputs(header, log);
    while (log != NULL && old != NULL && fgets(line, sizeof line, old) != NULL)
        if (strchr(line, '\n') != NULL &&
            (line[0] == '#' || strtod(line, NULL) <= until * (1.0 + 1e-9)))
            fputs(line, log);
    if (old != NULL) fclose(old);
    if (log == NULL || fflush(log) != 0 || ferror(log) || rename(part, path) != 0) {
        int why = errno;
        if (log != NULL) fclose(log), remove(part);
        example_fail(1, "cannot write %s (%s); choose another folder with --out", path,
                     strerror(why));
    }
    return log;
}

/* [Pa] the pressure at a point relative to the target's centre: mean over the target's particles
   that reach it, by volume and kernel; 0, and false, where none does, as in an emptied crater */
static bool impact_gauge(const sphpa_sim *sim, const impact_settings *s, double *pressure) {
    const sphpa_particles *p = &sim->p;
    double sum = 0.0, weight = 0.0, origin = impact_origin(s);
    double at[3] = {origin + s->gauge[0], origin + s->gauge[1], origin + s->gauge[2]};
    for (size_t i = 0; i < p->n; i++) {
        if (p->body[i] != IMPACT_TARGET) continue;
        double h = (double)p->h[i], r2 = 0.0;
        for (size_t a = 0; a < 3; a++)
            r2 += (p->x[3 * i + a] - at[a]) * (p->x[3 * i + a] - at[a]);
        if (r2 >= 4.0 * h * h) continue;
        double w = (double)p->m[i] / p->rho[i] *
                   sphpa_kernel_w(sim->options.kernel, 3, sqrt(r2), h);
        double P = (double)p->P[i]; /* of the undamaged; what is broken bears no tension */
        sum += w * (P < 0.0 ? (1.0 - (double)p->D[i]) * P : P);
        weight += w;
    }
    *pressure = weight > 0.0 ? sum / weight : 0.0;
    return weight > 0.0;
}

/* ---- the report ------------------------------------------------------------------------------ */

/* What is printed at the end of a run, and kept as report.txt. */
typedef struct impact_report {
    size_t length;
    char text[32768];
} impact_report;

static void say(impact_report *report, const char *format, ...) EXAMPLE_PRINTF(2, 3);

static void say(impact_report *report, const char *format, ...) {
    size_t room = sizeof report->text - report->length;
    va_list args;
    va_start(args, format);
    int n = vsnprintf(report->text + report->length, room, format, args);
    va_end(args);
    if (n > 0) report->length += (size_t)n < room ? (size_t)n : room - 1;
}

/* prints what was said since `from`, and writes all of it */
static void impact_tell(const impact_report *report, size_t from, const char *out) {
    fputs(report->text + from, stdout);
    fflush(stdout);
    example_file file = example_open(out, "report.txt");
    fputs(report->text, file.stream);
    example_close(&file);
}

/* ---- fragments ------------------------------------------------------------------------------- */

static sphpa_result impact_find(const sphpa_sim *sim, double link, double below,
                                sphpa_fragments *found, sphpa_error *err) {
    sphpa_fragment_options options;
    memset(&options, 0, sizeof options);
    memset(found, 0, sizeof *found);
    options.link = link;
    options.damage_below = below > 0.0 ? below : 1e-300;
    options.one_body = 1;
    options.body = IMPACT_TARGET;
    return sphpa_fragment_find(&sim->p, NULL, &options, found, err);
}

static double impact_largest(const sphpa_sim *sim, double link, double below, double target_mass) {
    sphpa_fragments found;
    sphpa_error err;
    if (impact_find(sim, link, below, &found, &err) != SPHPA_OK)
        example_fail(1, "fragments: %s", err.message);
    double share = sphpa_fragment_largest(&found, target_mass);
    sphpa_fragment_free(&found);
    return share;
}

static sphpa_result impact_record_now(const sphpa_sim *sim, const impact_settings *s,
                                      double target_mass, impact_record *record,
                                      sphpa_error *err) {
    sphpa_fragments found;
    sphpa_result result = impact_find(sim, s->link, s->damage_below, &found, err);
    if (result != SPHPA_OK) return result;
    record->time = sim->time;
    record->largest = sphpa_fragment_largest(&found, target_mass);
    record->second = found.count > 1 ? found.list[1].mass / target_mass : 0.0;
    record->dust = found.dust / target_mass;
    sphpa_fragment_free(&found);
    return SPHPA_OK;
}

/* ---- what each output writes ----------------------------------------------------------------- */

/* P and alpha of the target's particles, at most some 20,000 of them */
static void impact_write_palpha(const char *out, int index, const sphpa_sim *sim) {
    char name[64];
    snprintf(name, sizeof name, "palpha_%04d.dat", index);
    example_file file = example_open(out, name);
    size_t stride = sim->p.n / 20000 + 1;
    fprintf(file.stream, "# t = %.6e s: P[Pa] alpha damage\n", sim->time);
    for (size_t i = 0; i < sim->p.n; i += stride)
        if (sim->p.body[i] == IMPACT_TARGET)
            fprintf(file.stream, "%.6e %.9f %.4f\n", (double)sim->p.P[i], sim->p.alpha[i],
                    (double)sim->p.D[i]);
    example_close(&file);
}

/* the slice of particles around the plane of the impact, in cm from the target's centre */
static void impact_write_cut(const char *out, int index, const sphpa_sim *sim,
                             const impact_settings *s) {
    char name[64];
    double origin = impact_origin(s);
    snprintf(name, sizeof name, "cut_%04d.dat", index);
    example_file file = example_open(out, name);
    fprintf(file.stream, "# t = %.6e s: x[cm] z[cm] alpha damage body\n", sim->time);
    for (size_t i = 0; i < sim->p.n; i++) {
        const double *x = sim->p.x + 3 * i;
        if (fabs(x[1] - origin) < 0.5 * (double)sim->p.h[i])
            fprintf(file.stream, "%.5f %.5f %.5f %.4f %d\n", 100.0 * (x[0] - origin),
                    100.0 * (x[2] - origin), sim->p.alpha[i], (double)sim->p.D[i],
                    (int)sim->p.body[i]);
    }
    example_close(&file);
}

/* whether the folder has it: that of a run which went on elsewhere lacks the earlier outputs */
static bool impact_there(const char *out, const char *name) {
    char path[EXAMPLE_PATH + 64];
    snprintf(path, sizeof path, "%s/%s", out, name);
    FILE *file = fopen(path, "rb");
    if (file != NULL) fclose(file);
    return file != NULL;
}

#ifdef SPHPA_WITH_HDF5
static sphpa_result impact_write_snapshot(const char *out, const impact_history *history,
                                          const sphpa_sim *sim, const impact_settings *s,
                                          sphpa_error *err) {
    static char name[IMPACT_RECORDS][32];
    const char *names[IMPACT_RECORDS];
    double times[IMPACT_RECORDS];
    char path[EXAMPLE_PATH + 64];
    impact_texts texts;
    sphpa_snapshot_info info = impact_info(s, &texts);
    snprintf(path, sizeof path, "%s/impact_%04d.hdf", out, history->count);
    sphpa_result result = sphpa_snapshot_write(sim, path, &info, err);
    if (result != SPHPA_OK) return result;
    size_t count = 0;
    for (int k = 0; k <= history->count; k++) { /* with the one under way */
        snprintf(name[count], sizeof name[count], "impact_%04d.hdf", k);
        if (!impact_there(out, name[count])) continue;
        names[count] = name[count];
        times[count++] = history->record[k].time;
    }
    snprintf(path, sizeof path, "%s/impact.hdf.series", out);
    return sphpa_series_write(path, names, times, count, err);
}
#else
static sphpa_result impact_write_snapshot(const char *out, const impact_history *history,
                                          const sphpa_sim *sim, const impact_settings *s,
                                          sphpa_error *err) {
    char name[64];
    const sphpa_particles *p = &sim->p;
    (void)s;
    (void)err;
    snprintf(name, sizeof name, "impact_%04d.txt", history->count);
    example_file file = example_open(out, name);
    fprintf(file.stream, "# t = %.9e s: id body x y z vx vy vz m h rho u P alpha D (SI)\n",
            sim->time);
    for (size_t i = 0; i < p->n; i++)
        fprintf(file.stream,
                "%lld %d %.9g %.9g %.9g %.7g %.7g %.7g %.7g %.7g %.9g %.9g %.7g %.12g %.6g\n",
                (long long)p->id[i], (int)p->body[i], p->x[3 * i], p->x[3 * i + 1],
                p->x[3 * i + 2], (double)p->v[3 * i], (double)p->v[3 * i + 1],
                (double)p->v[3 * i + 2], (double)p->m[i], (double)p->h[i], p->rho[i], p->u[i],
                (double)p->P[i], p->alpha[i], (double)p->D[i]);
    example_close(&file);
    return SPHPA_OK;
}
#endif

/* the output under way, whose record is history->record[history->count] */
static sphpa_result impact_write_state(const char *out, const impact_history *history,
                                       const sphpa_sim *sim, const impact_settings *s,
                                       int snapshots, sphpa_error *err) {
    impact_write_palpha(out, history->count, sim);
    impact_write_cut(out, history->count, sim, s);
    return snapshots ? impact_write_snapshot(out, history, sim, s, err) : SPHPA_OK;
}

/* ---- results --------------------------------------------------------------------------------- */

/* from 10^5 Pa to twice where the last pores close */
static void impact_write_curve(const char *out, const sphpa_crush *crush) {
    example_file file = example_open(out, "curve.dat");
    fprintf(file.stream, "# P[Pa] alpha of the crush curve\n");
    for (int k = 0; k <= 400; k++) {
        double P = 1e5 * pow(2.0 * crush->Ps / 1e5, k / 400.0);
        fprintf(file.stream, "%.6e %.9f\n", P, sphpa_crush_alpha(crush, P, NULL));
    }
    example_close(&file);
}

/* returns the number of fragments */
static size_t impact_write_results(const char *out, const impact_history *history,
                                   const sphpa_sim *sim, const impact_settings *s,
                                   double target_mass, const sphpa_crush *crush) {
    sphpa_fragments found;
    sphpa_error err;
    example_file file = example_open(out, "largest.dat");
    fprintf(file.stream, "# t[us] largest second dust, of the target's mass\n");
    for (int k = 0; k < history->count; k++)
        fprintf(file.stream, "%.6f %.6f %.6f %.6f\n", 1e6 * history->record[k].time,
                history->record[k].largest, history->record[k].second, history->record[k].dust);
    example_close(&file);
    impact_write_curve(out, crush);
    if (impact_find(sim, s->link, s->damage_below, &found, &err) != SPHPA_OK)
        example_fail(1, "fragments: %s", err.message);
    double *mass = (double *)malloc((found.count + 1) * sizeof(double));
    size_t *number = (size_t *)malloc((found.count + 1) * sizeof(size_t));
    if (mass == NULL || number == NULL) example_fail(1, "out of memory");
    size_t count = sphpa_fragment_cumulative(&found, mass, number);
    file = example_open(out, "spectrum.dat");
    fprintf(file.stream, "# mass of the target's mass, number of fragments of that mass or more\n");
    for (size_t k = 0; k < count; k++)
        fprintf(file.stream, "%.9e %zu\n", mass[k] / target_mass, number[k]);
    example_close(&file);
    free(mass);
    free(number);
    sphpa_fragment_free(&found);
    return count;
}

/* ---- pictures -------------------------------------------------------------------------------- */

/* in UTF-8: not every terminal of gnuplot's finds a font of symbols */
#define IMPACT_MICRO "\302\265"
#define IMPACT_ALPHA "\316\261"

/* of damage, and of distention: crushed is red, whole a grey that shows on white */
#define IMPACT_DAMAGE_COLOURS                                                                      \
    "set palette defined (0 '#2c3e82', 0.5 '#e8e2d0', 1 '#b0281a')\n"                              \
    "set cblabel 'damage D'\nset cbrange [0:1]\n"
/* of a cut: the target by its damage, the projectile black; both sizes of points follow */
#define IMPACT_DAMAGE_POINTS                                                                       \
    "using ($5==0?$1:1/0):2:4 with points pointtype 7 pointsize %g palette, "                      \
    "'' using ($5==1?$1:1/0):2 with points pointtype 7 pointsize %g linecolor 'black'"
#define IMPACT_PORES_COLOURS                                                                       \
    "set palette defined (0 '#67000d', 0.35 '#e6550d', 0.7 '#fdae6b', 1 '#b8bec8')\n"              \
    "set cblabel 'distention " IMPACT_ALPHA "'\nset cbrange [1:4.64]\n"

/* the early ones above the later ones, which have spread over more of the picture */
static void impact_draw_palpha(const char *out, const impact_history *history) {
    char script[4096];
    int n = snprintf(script, sizeof script,
                     "set title 'Target particles on and below the crush curve'\n"
                     "set xlabel 'pressure P [Pa]; what lies below 10^5 Pa is drawn at the left "
                     "edge'\nset ylabel 'distention " IMPACT_ALPHA "'\n"
                     "set logscale x\nset format x '10^{%%T}'\nset xrange [1e5:*] noextend\n"
                     "set yrange [0.9:4.9]\nset key top right Left reverse box opaque\n"
                     "set grid\nplot 'curve.dat' with lines linewidth 6 linecolor '#d0d0d0' "
                     "title 'crush curve'");
    static const char *const colour[4] = {"#d7191c", "#fd8d3c", "#2ca25f", "#2c5fa8"};
    const int end = history->count - 1, shown[4] = {1, 2, end / 4, end}; /* most happens early */
    for (int k = 3; k >= 0; k--) {
        char name[32];
        int index = shown[k];
        snprintf(name, sizeof name, "palpha_%04d.dat", index);
        if (index > end || (k > 0 && index <= shown[k - 1]) || !impact_there(out, name)) continue;
        n += snprintf(script + n, sizeof script - (size_t)n,
                      ", '%s' using ($1>1.1e5?$1:1.1e5):2 with points pointtype 7 pointsize 0.5 "
                      "linecolor '%s' title 't = %.3g " IMPACT_MICRO "s'", name, colour[k],
                      1e6 * history->record[index].time);
    }
    example_picture(out, "palpha.png", 900, 620, script);
}

/* how big a point of a slice must be so that neighbours touch */
static double impact_point(size_t particles) {
    return fmax(0.25, 24.0 / cbrt((double)particles));
}

static void impact_draw_cut(const char *out, const impact_history *history, size_t particles,
                            double radius) {
    char script[4096];
    int index = history->count - 1;
    double r = 160.0 * radius, point = impact_point(particles);
    snprintf(script, sizeof script,
             "set multiplot layout 1,2 title 'Slice through the centre, t = %.3g " IMPACT_MICRO
             "s, %zu particles in all'\n"
             "set size ratio -1\nset xrange [%g:%g]\nset yrange [%g:%g]\nunset key\n"
             "set xlabel 'x [cm]'\nset ylabel 'z [cm]'\n"
             IMPACT_DAMAGE_COLOURS
             "set title 'damage of the target (black: the projectile)'\n"
             "plot 'cut_%04d.dat' " IMPACT_DAMAGE_POINTS "\n"
             IMPACT_PORES_COLOURS
             "set title 'distention of the target (1: no pores left)'\n"
             "plot 'cut_%04d.dat' using ($5==0?$1:1/0):2:3 with points pointtype 7 pointsize %g "
             "palette\nunset multiplot",
             1e6 * history->record[index].time, particles, -r, r, -r, r, index, point,
             0.4 * point, index, point);
    example_picture(out, "cut.png", 1200, 580, script);
}

static void impact_draw_spectrum(const char *out, size_t fragments) {
    if (fragments == 0) {
        fprintf(stderr, "left out %s/spectrum.svg: no fragments, all is damaged\n", out);
        return;
    }
    char script[2048];
    snprintf(script, sizeof script,
             "set title 'Cumulative mass spectrum: %zu fragment%s'\n"
             "set xlabel 'mass m of the target''s mass'\nset ylabel 'number of fragments of mass m "
             "or more'\nstats 'spectrum.dat' using 1 nooutput\nset logscale xy\n"
             "set xrange [STATS_min < 0.06 ? 0.5*STATS_min : 0.03:1.5]\nset yrange [0.7:%g]\n"
             "set grid\nset key below height 1\n"
             "set arrow from 0.0996, graph 0 to 0.0996, graph 1 nohead linewidth 2 linecolor "
             "'#2c7fb8'\n"
             "set arrow from 0.0835, graph 0 to 0.0835, graph 1 nohead dashtype 2 linewidth 2 "
             "linecolor '#d95f0e'\n"
             "plot 'spectrum.dat' using 1:2 with steps linewidth 2 linecolor 'black' notitle, "
             "'' using 1:2 with points pointtype 7 pointsize 0.8 linecolor 'black' title 'this run', "
             "1/0 linewidth 2 linecolor '#2c7fb8' title 'largest in the experiment, 0.0996', "
             "1/0 dashtype 2 linewidth 2 linecolor '#d95f0e' title 'largest of GASPHiA, 0.0835'",
             fragments, fragments > 1 ? "s" : "", fmax(4.0, 2.0 * (double)fragments));
    example_picture(out, "spectrum.svg", 800, 560, script);
}

static void impact_draw_largest(const char *out) {
    example_picture(
        out, "largest.svg", 800, 500,
        "set title 'Largest fragment against time'\nset xlabel 'time [" IMPACT_MICRO "s]'\n"
        "set ylabel 'share of the target''s mass'\nset yrange [0:1.02]\nset grid\n"
        "set key below height 1\n"
        "plot 'largest.dat' using 1:2 with linespoints pointtype 7 pointsize 0.6 linewidth 2 "
        "linecolor 'black' title 'largest fragment', "
        "'' using 1:3 with lines linewidth 2 linecolor '#2ca25f' title 'second', "
        "'' using 1:4 with lines linewidth 2 linecolor '#969696' title 'dust (damaged)', "
        "0.0996 linewidth 2 linecolor '#2c7fb8' title 'experiment, 0.0996', "
        "0.0835 dashtype 2 linewidth 2 linecolor '#d95f0e' title 'GASPHiA, 0.0835'");
}

static void impact_draw_gauge(const char *out, const impact_settings *s) {
    char script[2048];
    snprintf(script, sizeof script,
             "set title \"Pressure at (%g, %g, %g) cm from the target's centre\\n"
             "{/*0.8 mean over the target's particles that reach there, by volume and kernel;}\\n"
             "{/*0.8 a broken one bears no tension; 0 where the crater has emptied it}\"\n"
             "set xlabel 'time [" IMPACT_MICRO "s]'\nset ylabel 'mean pressure [MPa]'\nset grid\n"
             "unset key\n"
             "stats 'gauge.dat' using ($2*1e-6) nooutput\n"
             "set yrange [STATS_min < 0 ? 1.05*STATS_min : 0:1.05*STATS_max > 0.01 ? "
             "1.05*STATS_max : 0.01]\n"
             "plot 'gauge.dat' using ($1*1e6):($2*1e-6) with lines linewidth 1.5",
             100.0 * s->gauge[0], 100.0 * s->gauge[1], 100.0 * s->gauge[2]);
    example_picture(out, "gauge.svg", 800, 460, script);
}

static void impact_draw(const char *out, const impact_history *history, size_t particles,
                        const impact_settings *s, size_t fragments) {
    impact_draw_palpha(out, history);
    impact_draw_cut(out, history, particles, 0.5 * s->target_diameter);
    impact_draw_spectrum(out, fragments);
    impact_draw_largest(out);
    impact_draw_gauge(out, s);
}

/* two slices side by side; off's files are in the folder both_off */
static void impact_draw_beside(const char *out, const impact_history *on, size_t on_particles,
                               const impact_history *off, size_t off_particles, double radius) {
    char script[4096];
    double r = 160.0 * radius;
    snprintf(script, sizeof script,
             "set multiplot layout 1,2 title 'Cut at t = %.3g " IMPACT_MICRO "s (black: the "
             "projectile)'\nset size ratio -1\nset xrange [%g:%g]\nset yrange [%g:%g]\n"
             "unset key\nset xlabel 'x [cm]'\nset ylabel 'z [cm]'\n" IMPACT_DAMAGE_COLOURS
             "set title \"kernel correction and Balsara on\\n%zu particles, largest %.4f\"\n"
             "plot 'cut_%04d.dat' " IMPACT_DAMAGE_POINTS "\n"
             "set title \"both off\\n%zu particles, largest %.4f\"\n"
             "plot 'both_off/cut_%04d.dat' " IMPACT_DAMAGE_POINTS "\nunset multiplot",
             1e6 * on->record[on->count - 1].time, -r, r, -r, r, on_particles,
             on->record[on->count - 1].largest, on->count - 1, impact_point(on_particles),
             0.4 * impact_point(on_particles), off_particles,
             off->record[off->count - 1].largest, off->count - 1, impact_point(off_particles),
             0.4 * impact_point(off_particles));
    example_picture(out, "beside.png", 1200, 580, script);
}

/* "dir/name" into the folder "dir" (or "." or "/"); returns the name */
static const char *impact_split(const char *path, char folder[EXAMPLE_PATH]) {
    const char *slash = strrchr(path, '/');
    if (slash == NULL) snprintf(folder, EXAMPLE_PATH, ".");
    else snprintf(folder, EXAMPLE_PATH, "%.*s", slash > path ? (int)(slash - path) : 1, path);
    return slash != NULL ? slash + 1 : path;
}

/* a path as gnuplot finds it from any folder, for between single quotes */
static void impact_absolute(const char *path, char text[3 * EXAMPLE_PATH]) {
    char here[EXAMPLE_PATH] = "";
    size_t n = 0;
    if (path[0] != '/' && getcwd(here, sizeof here - 1) != NULL) strcat(here, "/");
    for (int part = 0; part < 2; part++)
        for (const char *c = part == 0 ? here : path; *c != '\0' && n + 3 < 3 * EXAMPLE_PATH; c++) {
            if (*c == '\'') text[n++] = *c;
            text[n++] = *c;
        }
    text[n] = '\0';
}

/* frames of both runs as an animated GIF */
static bool impact_draw_movie(const char *movie, const char *on, const char *off, int frames,
                              double every, double radius, size_t particles) {
    static char script[8 * EXAMPLE_PATH], on_path[3 * EXAMPLE_PATH], off_path[3 * EXAMPLE_PATH];
    char folder[EXAMPLE_PATH];
    const char *name = impact_split(movie, folder);
    double r = 160.0 * radius, point = impact_point(particles);
    impact_absolute(on, on_path);
    impact_absolute(off, off_path);
    snprintf(script, sizeof script,
             "on = '%s'\noff = '%s'\n"
             "set size ratio -1\nset xrange [%g:%g]\nset yrange [%g:%g]\nunset key\n"
             "set xlabel 'x [cm]'\nset ylabel 'z [cm]'\n" IMPACT_DAMAGE_COLOURS
             "do for [k=0:%d] {\n"
             "set multiplot layout 1,2 title sprintf('t = %%.1f " IMPACT_MICRO "s', k*%g)\n"
             "set title 'correction and Balsara on'\n"
             "plot sprintf('%%s/cut_%%04d.dat', on, k) " IMPACT_DAMAGE_POINTS "\n"
             "set title 'both off'\n"
             "plot sprintf('%%s/cut_%%04d.dat', off, k) " IMPACT_DAMAGE_POINTS "\n"
             "unset multiplot\n}",
             on_path, off_path, -r, r, -r, r, frames - 1, 1e6 * every, point,
             0.4 * point, point, 0.4 * point);
    return example_picture(folder, name, 1000, 520, script);
}

/* ---- the table of assumptions ---------------------------------------------------------------- */

enum { IMPACT_TABLE_LINES = 2048, IMPACT_TABLE_WIDTH = 512 };

/* A CSV file in memory: what was there and what is added. */
typedef struct impact_table {
    const char *path;
    int count;
    char line[IMPACT_TABLE_LINES][IMPACT_TABLE_WIDTH];
} impact_table;

static const char impact_table_header[] =
    "run,speed_m_s,angle_deg,target_diameter_m,projectile_diameter_m,weibull_k,weibull_m,seed,"
    "lattice_seed,particles,projectile_particles,curve,solver,correction,balsara,tension_Pa,"
    "viscosity_a,viscosity_b,cfl,"
    "t_end_s,every_s,link,damage_below,largest,settled";

static void impact_table_save(const impact_table *table) {
    char folder[EXAMPLE_PATH];
    const char *name = impact_split(table->path, folder);
    example_folder_of(folder, "--sensitivity");
    example_file file = example_open_of(folder, name, "--sensitivity");
    fprintf(file.stream, "%s\n", impact_table_header);
    for (int k = 0; k < table->count; k++) fprintf(file.stream, "%s\n", table->line[k]);
    example_close(&file);
}

/* what is there already; saved at once, so that a place that cannot be written is found early */
static impact_table *impact_table_open(const char *path) {
    impact_table *table = (impact_table *)calloc(1, sizeof *table);
    if (table == NULL) example_fail(1, "out of memory");
    table->path = path;
    FILE *file = fopen(path, "r");
    if (file == NULL && errno != ENOENT)
        example_fail(1, "--sensitivity %s: %s; give another name", path, strerror(errno));
    char line[IMPACT_TABLE_WIDTH];
    bool first = true;
    while (file != NULL && fgets(line, sizeof line, file) != NULL) {
        bool whole = strchr(line, '\n') != NULL;
        line[strcspn(line, "\r\n")] = '\0';
        if (!whole || (first && strcmp(line, impact_table_header) != 0))
            example_fail(1, "%s is not a table of this program's; move it away", path);
        if (table->count >= IMPACT_TABLE_LINES)
            example_fail(1, "%s has more than %d lines; move it away", path, IMPACT_TABLE_LINES);
        if (!first) memcpy(table->line[table->count++], line, sizeof line);
        first = false;
    }
    if (file != NULL) fclose(file);
    impact_table_save(table);
    return table;
}

/* the columns of one run, without those of the reading */
static void impact_table_key(char key[IMPACT_TABLE_WIDTH], const char *name,
                             const impact_settings *s) {
    snprintf(key, IMPACT_TABLE_WIDTH,
             "%s,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%ld,%ld,%ld,%ld,%s,%d,%s,%s,%.9g,%.9g,%.9g,%.9g,"
             "%.9g,%.9g,",
             name, s->speed, s->angle, s->target_diameter, s->projectile_diameter, s->weibull_k,
             s->weibull_m, s->seed, s->lattice_seed, s->particles, s->projectile_particles,
             s->curve == 0 ? "two-exponent" : "quadratic", s->solver, s->correction ? "on" : "off",
             s->balsara ? "on" : "off", s->tension, s->viscosity[0],
             s->viscosity[1], s->cfl, s->t_end,
             s->every > 0.0 ? s->every : s->t_end / 20.0);
}

static bool impact_table_has(const impact_table *table, const char *name,
                             const impact_settings *s) {
    char key[IMPACT_TABLE_WIDTH];
    impact_table_key(key, name, s);
    for (int k = 0; k < table->count; k++)
        if (strncmp(table->line[k], key, strlen(key)) == 0) return true;
    return false;
}

static void impact_table_add(impact_table *table, const char *name, const impact_settings *s,
                             double link, double below, double largest,
                             const impact_history *history) {
    char key[IMPACT_TABLE_WIDTH];
    if (table->count >= IMPACT_TABLE_LINES)
        example_fail(1, "%s has more than %d lines; move it away", table->path,
                     (int)IMPACT_TABLE_LINES);
    impact_table_key(key, name, s);
    impact_trend trend = impact_trend_of(history);
    snprintf(table->line[table->count++], IMPACT_TABLE_WIDTH, "%.440s%g,%g,%.4f,%s", key, link,
             below, largest,
             trend.short_run || trend.few ? "unknown" : trend.settled ? "yes" : "no");
}

static void impact_table_print(const impact_table *table) {
    printf("%s\n", impact_table_header);
    for (int k = 0; k < table->count; k++) printf("%s\n", table->line[k]);
    printf("reference: experiment 0.0996, GASPHiA 0.0835\n");
}

#endif
