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

static bool impact_has_hdf5(void) {
#ifdef SPHPA_WITH_HDF5
    return true;
#else
    return false;
#endif
}

/* the target's centre on every axis [m]: all coordinates are positive, as some readers want them */
static double impact_origin(const impact_settings *s) { return 2.0 * s->target_diameter; }

/* ---- logs ------------------------------------------------------------------------------------ */

#define IMPACT_LOG_HEADER                                                                          \
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

/* A log that is begun anew (until < 0), or continued: lines whose first number is above `until` are
   of steps that will be made again, and go. NULL, with a word on stderr, if it cannot be written. */
static FILE *impact_reopen(const char *path, double until, const char *header) {
    char line[1024], part[EXAMPLE_PATH + 64];
    snprintf(part, sizeof part, "%s.part", path);
    FILE *old = until >= 0.0 ? fopen(path, "r") : NULL, *log = fopen(part, "w");
    if (log != NULL && old == NULL) fputs(header, log);
    while (log != NULL && old != NULL && fgets(line, sizeof line, old) != NULL)
        if (line[0] == '#' || strtod(line, NULL) <= until * (1.0 + 1e-12)) fputs(line, log);
    if (old != NULL) fclose(old);
    if (log == NULL || fflush(log) != 0 || rename(part, path) != 0) {
        if (log != NULL) fclose(log);
        example_fail(1, "cannot write %s (%s); choose another folder with --out", path,
                     strerror(errno));
    }
    return log;
}

/* [Pa] the pressure at a point relative to the target's centre: sum over what reaches it, divided by
   the sum of the weights; 0 where nothing does */
static double impact_gauge(const sphpa_sim *sim, const impact_settings *s) {
    const sphpa_particles *p = &sim->p;
    double sum = 0.0, weight = 0.0, origin = impact_origin(s);
    double at[3] = {origin + s->gauge[0], origin + s->gauge[1], origin + s->gauge[2]};
    for (size_t i = 0; i < p->n; i++) {
        double h = (double)p->h[i], r2 = 0.0;
        for (size_t a = 0; a < 3; a++)
            r2 += (p->x[3 * i + a] - at[a]) * (p->x[3 * i + a] - at[a]);
        if (r2 >= 4.0 * h * h) continue;
        double w = (double)p->m[i] / p->rho[i] *
                   sphpa_kernel_w(sim->options.kernel, 3, sqrt(r2), h);
        sum += w * (double)p->P[i];
        weight += w;
    }
    return weight > 0.0 ? sum / weight : 0.0;
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

static sphpa_result impact_record_now(const sphpa_sim *sim, const impact_options *o,
                                      double target_mass, impact_record *record,
                                      sphpa_error *err) {
    sphpa_fragments found;
    sphpa_result result = impact_find(sim, o->link, o->damage_below, &found, err);
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

#ifdef SPHPA_WITH_HDF5
static sphpa_result impact_write_snapshot(const char *out, const impact_history *history,
                                          const sphpa_sim *sim, sphpa_error *err) {
    static char name[IMPACT_RECORDS][32];
    const char *names[IMPACT_RECORDS];
    double times[IMPACT_RECORDS];
    char path[EXAMPLE_PATH + 64];
    sphpa_snapshot_info info;
    memset(&info, 0, sizeof info);
    info.run = "pumice_impact";
    int count = history->count + 1; /* with the one under way */
    for (int k = 0; k < count; k++) {
        snprintf(name[k], sizeof name[k], "impact_%04d.hdf", k);
        names[k] = name[k];
        times[k] = history->record[k].time;
    }
    snprintf(path, sizeof path, "%s/%s", out, names[count - 1]);
    sphpa_result result = sphpa_snapshot_write(sim, path, &info, err);
    if (result != SPHPA_OK) return result;
    snprintf(path, sizeof path, "%s/impact.hdf.series", out);
    return sphpa_series_write(path, names, times, (size_t)count, err);
}
#else
static sphpa_result impact_write_snapshot(const char *out, const impact_history *history,
                                          const sphpa_sim *sim, sphpa_error *err) {
    char name[64];
    const sphpa_particles *p = &sim->p;
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
    return snapshots ? impact_write_snapshot(out, history, sim, err) : SPHPA_OK;
}

/* ---- results --------------------------------------------------------------------------------- */

static void impact_write_curve(const char *out, const sphpa_crush *crush) {
    example_file file = example_open(out, "curve.dat");
    fprintf(file.stream, "# P[Pa] alpha of the crush curve\n");
    for (int k = 0; k <= 400; k++) {
        double P = 1e5 * pow(1e5, k / 400.0);
        fprintf(file.stream, "%.6e %.9f\n", P, sphpa_crush_alpha(crush, P, NULL));
    }
    example_close(&file);
}

static void impact_write_results(const char *out, const impact_history *history,
                                 const sphpa_sim *sim, const impact_options *o, double target_mass,
                                 const sphpa_crush *crush) {
    sphpa_fragments found;
    sphpa_error err;
    example_file file = example_open(out, "largest.dat");
    fprintf(file.stream, "# t[us] largest second dust, of the target's mass\n");
    for (int k = 0; k < history->count; k++)
        fprintf(file.stream, "%.6f %.6f %.6f %.6f\n", 1e6 * history->record[k].time,
                history->record[k].largest, history->record[k].second, history->record[k].dust);
    example_close(&file);
    impact_write_curve(out, crush);
    if (impact_find(sim, o->link, o->damage_below, &found, &err) != SPHPA_OK)
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
}

/* ---- pictures -------------------------------------------------------------------------------- */

static void impact_draw_palpha(const char *out, const impact_history *history) {
    char script[4096];
    int n = snprintf(script, sizeof script,
                     "set title 'Target particles over the crush curve'\n"
                     "set xlabel 'pressure P [Pa]'\nset ylabel 'distention {/Symbol a}'\n"
                     "set logscale x\nset format x '10^{%%T}'\nset xrange [1e5:1e10]\n"
                     "set yrange [0.9:4.9]\nset key top right box opaque\nset grid\nplot ");
    for (int k = 1; k <= 4; k++) {
        int index = (history->count - 1) * k / 4;
        n += snprintf(script + n, sizeof script - (size_t)n,
                      "'palpha_%04d.dat' using 1:2 with points pointtype 7 pointsize 0.35 title "
                      "'t = %.0f {/Symbol m}s', ",
                      index, 1e6 * history->record[index].time);
    }
    snprintf(script + n, sizeof script - (size_t)n,
             "'curve.dat' with lines linewidth 2 linecolor 'black' title 'crush curve'");
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
             "set multiplot layout 1,2 title 'Cut through the target at t = %.0f {/Symbol m}s'\n"
             "set size ratio -1\nset xrange [%g:%g]\nset yrange [%g:%g]\nunset key\n"
             "set xlabel 'x [cm]'\nset ylabel 'z [cm]'\n"
             "set palette defined (0 '#2c3e82', 0.5 '#e8e2d0', 1 '#b0281a')\n"
             "set cblabel 'damage D'\nset cbrange [0:1]\n"
             "plot 'cut_%04d.dat' using 1:2:4 with points pointtype 7 pointsize %g palette, "
             "'' using ($5==1?$1:1/0):2 with points pointtype 7 pointsize %g linecolor 'black'\n"
             "set palette defined (0 '#22223b', 0.5 '#9a8c98', 1 '#f2e9e4')\n"
             "set cblabel 'distention {/Symbol a}'\nset cbrange [1:4.64]\n"
             "plot 'cut_%04d.dat' using ($5==0?$1:1/0):2:3 with points pointtype 7 pointsize %g "
             "palette\nunset multiplot",
             1e6 * history->record[index].time, -r, r, -r, r, index, point, 0.4 * point, index,
             point);
    example_picture(out, "cut.png", 1200, 560, script);
}

static void impact_draw_spectrum(const char *out) {
    example_picture(
        out, "spectrum.svg", 800, 560,
        "set title 'Cumulative mass spectrum of the fragments'\n"
        "set xlabel 'mass m of the target''s mass'\nset ylabel 'number of fragments of mass m or "
        "more'\nset logscale xy\nset xrange [:1.5]\nset yrange [0.7:]\nset format x '10^{%T}'\n"
        "set grid\nset key bottom left\n"
        "set arrow from 0.0996, graph 0 to 0.0996, graph 1 nohead linewidth 2 linecolor '#2c7fb8'\n"
        "set arrow from 0.0835, graph 0 to 0.0835, graph 1 nohead dashtype 2 linewidth 2 "
        "linecolor '#d95f0e'\n"
        "plot 'spectrum.dat' using 1:2 with steps linewidth 2 linecolor 'black' title 'this run', "
        "'' using 1:2 with points pointtype 7 pointsize 0.5 linecolor 'black' notitle, "
        "1/0 linewidth 2 linecolor '#2c7fb8' title 'largest in the experiment, 0.0996', "
        "1/0 dashtype 2 linewidth 2 linecolor '#d95f0e' title 'largest of GASPHiA, 0.0835'");
}

static void impact_draw_largest(const char *out) {
    example_picture(
        out, "largest.svg", 800, 500,
        "set title 'Largest fragment against time'\nset xlabel 'time [{/Symbol m}s]'\n"
        "set ylabel 'share of the target''s mass'\nset yrange [0:1.02]\nset grid\n"
        "set key center right\n"
        "plot 'largest.dat' using 1:2 with linespoints pointtype 7 pointsize 0.6 linewidth 2 title "
        "'largest fragment', '' using 1:3 with lines linewidth 2 title 'second', "
        "'' using 1:4 with lines linewidth 2 title 'dust (damaged)', "
        "0.0996 linewidth 2 linecolor '#2c7fb8' title 'experiment, 0.0996', "
        "0.0835 dashtype 2 linewidth 2 linecolor '#d95f0e' title 'GASPHiA, 0.0835'");
}

static void impact_draw_gauge(const char *out, const impact_settings *s) {
    char script[1024];
    snprintf(script, sizeof script,
             "set title 'Pressure at (%g, %g, %g) cm from the centre'\n"
             "set xlabel 'time [{/Symbol m}s]'\nset ylabel 'pressure [MPa]'\nset grid\nunset key\n"
             "plot 'gauge.dat' using ($1*1e6):($2*1e-6) with lines linewidth 1.5",
             100.0 * s->gauge[0], 100.0 * s->gauge[1], 100.0 * s->gauge[2]);
    example_picture(out, "gauge.svg", 800, 460, script);
}

static void impact_draw(const char *out, const impact_history *history, size_t particles,
                        const impact_settings *s) {
    impact_draw_palpha(out, history);
    impact_draw_cut(out, history, particles, 0.5 * s->target_diameter);
    impact_draw_spectrum(out);
    impact_draw_largest(out);
    impact_draw_gauge(out, s);
}

/* two slices side by side; off's files are in the folder both_off */
static void impact_draw_beside(const char *out, const impact_history *on, size_t on_particles,
                               const impact_history *off, size_t off_particles, double radius) {
    char script[4096];
    double r = 160.0 * radius;
    snprintf(script, sizeof script,
             "set multiplot layout 1,2\nset size ratio -1\nset xrange [%g:%g]\nset yrange [%g:%g]\n"
             "unset key\nset xlabel 'x [cm]'\nset ylabel 'z [cm]'\nset cblabel 'damage D'\n"
             "set cbrange [0:1]\nset palette defined (0 '#2c3e82', 0.5 '#e8e2d0', 1 '#b0281a')\n"
             "set title 'kernel correction and Balsara on\\n%zu particles, largest %.4f'\n"
             "plot 'cut_%04d.dat' using 1:2:4 with points pointtype 7 pointsize %g palette\n"
             "set title 'both off\\n%zu particles, largest %.4f'\n"
             "plot 'both_off/cut_%04d.dat' using 1:2:4 with points pointtype 7 pointsize %g "
             "palette\nunset multiplot",
             -r, r, -r, r, on_particles, on->record[on->count - 1].largest, on->count - 1,
             impact_point(on_particles), off_particles, off->record[off->count - 1].largest,
             off->count - 1, impact_point(off_particles));
    example_picture(out, "beside.png", 1200, 580, script);
}

/* frames of both runs as an animated GIF */
static bool impact_draw_movie(const char *movie, const char *on, const char *off, int frames,
                              double every, double radius, size_t particles) {
    char script[4096], folder[EXAMPLE_PATH];
    const char *slash = strrchr(movie, '/');
    snprintf(folder, sizeof folder, "%.*s", slash != NULL ? (int)(slash - movie) : 1,
             slash != NULL ? movie : ".");
    example_folder(folder);
    double r = 160.0 * radius, point = impact_point(particles);
    char here[EXAMPLE_PATH];
    if (getcwd(here, sizeof here) == NULL) here[0] = '\0';
    snprintf(script, sizeof script,
             "set size ratio -1\nset xrange [%g:%g]\nset yrange [%g:%g]\nunset key\n"
             "set xlabel 'x [cm]'\nset ylabel 'z [cm]'\nset cblabel 'damage D'\n"
             "set cbrange [0:1]\nset palette defined (0 '#2c3e82', 0.5 '#e8e2d0', 1 '#b0281a')\n"
             "do for [k=0:%d] {\n"
             "set multiplot layout 1,2 title sprintf('t = %%.1f {/Symbol m}s', k*%g)\n"
             "set title 'correction and Balsara on'\n"
             "plot sprintf('%s/%s/cut_%%04d.dat', k) using 1:2:4 with points pointtype 7 "
             "pointsize %g palette\n"
             "set title 'both off'\n"
             "plot sprintf('%s/%s/cut_%%04d.dat', k) using 1:2:4 with points pointtype 7 "
             "pointsize %g palette\nunset multiplot\n}",
             -r, r, -r, r, frames - 1, 1e6 * every, here, on, point, here, off, point);
    return example_picture(folder, slash != NULL ? slash + 1 : movie, 1000, 520, script);
}

/* ---- the table of assumptions ---------------------------------------------------------------- */

enum { IMPACT_TABLE_LINES = 512, IMPACT_TABLE_WIDTH = 256 };

/* A CSV file in memory: what was there and what is added. */
typedef struct impact_table {
    const char *path;
    int count;
    char line[IMPACT_TABLE_LINES][IMPACT_TABLE_WIDTH];
} impact_table;

static const char impact_table_header[] =
    "run,target_diameter_m,weibull_k,weibull_m,seed,particles,projectile_particles,curve,"
    "correction,balsara,t_end_s,link,damage_below,largest,settled";

static impact_table *impact_table_open(const char *path) {
    impact_table *table = (impact_table *)calloc(1, sizeof *table);
    if (table == NULL) example_fail(1, "out of memory");
    table->path = path;
    FILE *file = fopen(path, "r");
    if (file == NULL) return table;
    char line[IMPACT_TABLE_WIDTH];
    bool first = true;
    while (fgets(line, sizeof line, file) != NULL && table->count < IMPACT_TABLE_LINES) {
        line[strcspn(line, "\r\n")] = '\0';
        if (first && strcmp(line, impact_table_header) != 0)
            example_fail(1, "%s is not a table of this program; move it away", path);
        if (!first) memcpy(table->line[table->count++], line, sizeof line);
        first = false;
    }
    fclose(file);
    return table;
}

/* the columns of one run, without those of the reading */
static void impact_table_key(char key[IMPACT_TABLE_WIDTH], const char *name,
                             const impact_settings *s) {
    snprintf(key, IMPACT_TABLE_WIDTH, "%s,%g,%g,%g,%ld,%ld,%ld,%s,%s,%s,%g,", name,
             s->target_diameter, s->weibull_k, s->weibull_m, s->seed, s->particles,
             s->projectile_particles, s->curve == 0 ? "two-exponent" : "quadratic",
             s->correction ? "on" : "off", s->balsara ? "on" : "off", s->t_end);
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
    int last = history->count - 1;
    bool settled = last > 0 && fabs(history->record[last].largest -
                                    history->record[last - 1].largest) < 0.01;
    snprintf(table->line[table->count++], IMPACT_TABLE_WIDTH, "%.180s%g,%g,%.4f,%s", key, link,
             below, largest, settled ? "yes" : "no");
}

static void impact_table_save(const impact_table *table) {
    char folder[EXAMPLE_PATH];
    const char *slash = strrchr(table->path, '/');
    snprintf(folder, sizeof folder, "%.*s", slash != NULL ? (int)(slash - table->path) : 1,
             slash != NULL ? table->path : ".");
    example_folder(folder);
    example_file file = example_open(folder, slash != NULL ? slash + 1 : table->path);
    fprintf(file.stream, "%s\n", impact_table_header);
    for (int k = 0; k < table->count; k++) fprintf(file.stream, "%s\n", table->line[k]);
    example_close(&file);
}

static void impact_table_print(const impact_table *table) {
    printf("%s\n", impact_table_header);
    for (int k = 0; k < table->count; k++) printf("%s\n", table->line[k]);
    printf("reference: experiment 0.0996, GASPHiA 0.0835\n");
}

#endif
