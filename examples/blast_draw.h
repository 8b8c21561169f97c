/* blast_draw.h: the pictures of blast.c, by gnuplot from the files that its outputs wrote. */
#ifndef BLAST_DRAW_H
#define BLAST_DRAW_H

#define BLAST_MICRO "\302\265"  /* UTF-8: the sign for 1e-6 */
#define BLAST_CUBED "\302\263"  /* and the exponent 3 */

#define BLAST_COLOURS                                                                              \
    "set linetype 1 lc rgb '#c0392b' lw 2 pt 7\nset linetype 2 lc rgb '#1f5fa8' lw 2 pt 5\n"        \
    "set linetype 3 lc rgb '#2e8b3d' lw 2 pt 9\nset linetype 4 lc rgb '#000000' lw 1.5 pt 6\n"      \
    "set grid lc rgb '#dddddd'\n"

/* A gnuplot script as it grows. */
typedef struct blast_script {
    size_t length;
    char text[16384];
} blast_script;

static void blast_add(blast_script *script, const char *format, ...) EXAMPLE_PRINTF(2, 3);

static void blast_add(blast_script *script, const char *format, ...) {
    size_t room = sizeof script->text - script->length;
    va_list args;
    va_start(args, format);
    int n = vsnprintf(script->text + script->length, room, format, args);
    va_end(args);
    if (n > 0) script->length += (size_t)n < room ? (size_t)n : room - 1;
}

static void blast_draw_plane(const blast_result *results, const blast_settings *s,
                             const blast_reference *reference, const char *out) {
    blast_script script;
    int panels = 0;
    double half = BLAST_VIEW * reference->at[s->times - 1].shell.radius;
    for (int m = 0; m < BLAST_METHODS; m++) panels += results[m].count == s->times;
    if (panels == 0 || !(half > 0.0)) return;
    double dot = 27.0 / half; /* times a particle's width: squares that touch */
    double most = fmax(10.0, reference->at[s->times - 1].shell.rho_max);
    script.length = 0;
    blast_add(&script, "set size ratio -1\nset xrange [%g:%g]\nset yrange [%g:%g]\nunset key\n"
                       "set xlabel 'x [m]'\nset ylabel 'y [m]'\nset logscale cb\n"
                       "set cblabel 'density [kg/m" BLAST_CUBED "]'\nset cbrange [0.1:%g]\n"
                       "set palette defined (0 '#f7fbff', 1 '#9ecae1', 2 '#2171b5', 3 '#fd8d3c', "
                       "4 '#7f0000')\n"
                       "set multiplot layout 1,%d title 'density at %g " BLAST_MICRO "s, dx = %g m'\n",
              -half, half, -half, half, most, panels, 1e6 * s->t_end, s->dx);
    if (results[BLAST_FVM].count == s->times)
        blast_add(&script, "set title 'finite volumes'\nplot 'plane_fvm.dat' using 1:2:3 with image\n");
    if (results[BLAST_SPH].count == s->times)
        blast_add(&script, "set title 'particles'\nplot 'plane_sph.dat' using 1:2:(%g*$6):3 with "
                           "points pt 5 ps variable lc palette\n", dot);
    if (results[BLAST_HYBRID].count == s->times)
        blast_add(&script, "set title 'hybrid; lines: particles, driven ones'\n"
                           "plot 'plane_hybrid.dat' using 1:2:3 with image, \\\n"
                           "  'plane_particles.dat' using 1:($5 == 0 ? $2 : NaN):(%g*$6):3 with "
                           "points pt 5 ps variable lc palette, \\\n"
                           "  'plane_buffer.dat' using 1:2:3:4 with vectors nohead lw 1 dt 2 lc rgb "
                           "'#555555', \\\n"
                           "  'plane_active.dat' using 1:2:3:4 with vectors nohead lw 1.5 lc rgb "
                           "'#000000'\n", dot);
    blast_add(&script, "unset multiplot");
    (void)example_picture(out, "plane.png", 460 * panels + 40, 500, script.text);
}

/* the paper's figure 3: mesh, flagged, regions, new particles */
static void blast_draw_flags(const blast_settings *s, const char *out) {
    char path[2 * EXAMPLE_PATH];
    snprintf(path, sizeof path, "%s/flags.dat", out);
    FILE *there = fopen(path, "r");
    if (there == NULL) return; /* no cell became particles' late enough */
    fclose(there);
    (void)s;
    (void)example_picture(
        out, "flags.png", 1080, 1080,
        "load 'flags_range.gp'\nset size ratio -1\nset xrange [0:half]\nset yrange [0:half]\nunset key\n"
        "set xlabel 'x [m]'\nset ylabel 'y [m]'\nunset colorbox\nset style fill solid noborder\n"
        "set palette defined (0 '#f7fbff', 1 '#9ecae1', 2 '#2171b5', 3 '#fd8d3c', 4 '#7f0000')\n"
        "set multiplot layout 2,2 title sprintf('one step of the hybrid, t = %.1f " BLAST_MICRO
        "s', time)\n"
        "set logscale cb\nset cbrange [0.05:10]\n"
        "box(x) = 0.48*width\n"
        "set title 'A: density of the mesh'\n"
        "plot 'flags.dat' using 1:2:(box(0)):(box(0)):3 with boxxyerror lc palette\n"
        "set title 'B: cells whose differences are above the threshold'\n"
        "plot 'flags.dat' using 1:2:(box(0)):(box(0)) with boxxyerror lc rgb '#e8edf3', \\\n"
        "  '' using ($4 > 0 ? $1 : NaN):2:(box(0)):(box(0)) with boxxyerror lc rgb '#7f0000'\n"
        "set title 'C: active (red) and buffer (grey) cells'\n"
        "plot 'flags.dat' using 1:2:(box(0)):(box(0)) with boxxyerror lc rgb '#e8edf3', \\\n"
        "  '' using ($5 == 1 ? $1 : NaN):2:(box(0)):(box(0)) with boxxyerror lc rgb '#999999', \\\n"
        "  '' using ($5 == 2 ? $1 : NaN):2:(box(0)):(box(0)) with boxxyerror lc rgb '#c0392b'\n"
        "set title 'D: cells with new particles (red); driven ones grey'\n"
        "plot 'flags.dat' using 1:2:(box(0)):(box(0)) with boxxyerror lc rgb '#e8edf3', \\\n"
        "  '' using ($5 > 0 && $6 == 0 ? $1 : NaN):2:(box(0)):(box(0)) with boxxyerror lc rgb '#f0a8a0', \\\n"
        "  'flags_particles.dat' using ($5 > 0 ? $1 : NaN):2 with points pt 7 ps 0.2 lc rgb '#777777', \\\n"
        "  '' using ($5 > 0 ? NaN : $1):2 with points pt 7 ps 0.2 lc rgb '#1f5fa8'\n"
        "unset multiplot");
}

static void blast_draw_lines(const blast_result *results, const blast_settings *s,
                             const blast_reference *reference, const char *out) {
    blast_script script;
    int shown = s->times < 9 ? s->times : 9, first = s->times - shown;
    int rows = shown < 3 ? 1 : (shown + 2) / 3, columns = (shown + rows - 1) / rows;
    script.length = 0;
    blast_add(&script, BLAST_COLOURS "set multiplot layout %d,%d\nset xlabel 'r [m]'\n"
                       "set ylabel 'density [kg/m" BLAST_CUBED "]'\nset logscale y\n"
                       "set key bottom left samplen 1.5\n", rows, columns);
    for (int k = first; k < s->times; k++) {
        double us = 1e6 * s->time[k];
        blast_add(&script, "set title '%g " BLAST_MICRO "s'\nset xrange [0:%g]\nset yrange [0.1:%g]\n"
                           "plot 'blast_reference_%g.dat' using 1:2 with lines lt 4 title 'reference'",
                  us, 1.3 * fmax(reference->at[k].shell.radius, s->radius),
                  fmax(20.0, 1.5 * reference->at[k].shell.rho_max), us);
        for (int m = 0; m < BLAST_METHODS; m++)
            if (results[m].count > k)
                blast_add(&script, ", 'blast_%s_%g.dat' using 1:2 with lines lt %d title '%s'",
                          blast_method_name(m), us, m + 1, blast_method_name(m));
        blast_add(&script, "\nunset key\n");
    }
    blast_add(&script, "unset multiplot");
    (void)example_picture(out, "lineouts.png", 400 * columns, 340 * rows, script.text);
}

/* one panel: column `y` of every log, points on lines; with the reference's column or 0 */
static void blast_add_panel(blast_script *script, const blast_result *results, const char *y,
                            int reference) {
    const char *comma = "plot ";
    if (reference > 0) {
        blast_add(script, "plot 'blast_reference.log' using (1e6*$1):%d with linespoints lt 4 title "
                          "'reference'", reference);
        comma = ", ";
    }
    for (int m = 0; m < BLAST_METHODS; m++) {
        if (results[m].count == 0) continue;
        blast_add(script, "%s'blast_%s.log' using (1e6*$1):%s with linespoints lt %d title '%s'", comma,
                  blast_method_name(m), y, m + 1, blast_method_name(m));
        comma = ", ";
    }
    blast_add(script, "\n");
}

/* [us] between labels of an axis of time: five at most */
static double blast_tics(const blast_result *results) {
    double last = 0.0;
    for (int m = 0; m < BLAST_METHODS; m++)
        if (results[m].count > 0)
            last = fmax(last, 1e6 * results[m].record[results[m].count - 1].time);
    if (!(last > 0.0)) return 1.0;
    double step = last / 5.0, ten = pow(10.0, floor(log10(step)));
    return ten * (step > 5.0 * ten ? 10.0 : step > 2.0 * ten ? 5.0 : 2.0);
}

static void blast_draw_shock(const blast_result *results, const char *out) {
    blast_script script;
    script.length = 0;
    blast_add(&script, BLAST_COLOURS "set multiplot layout 1,2\nset xlabel 'time [" BLAST_MICRO "s]'\n"
                       "set title 'shock radius'\nset ylabel 'R [m]'\nset key above horizontal\nset xtics %g\n",
              blast_tics(results));
    blast_add_panel(&script, results, "2", 2);
    blast_add(&script, "set title 'peak density of the outer shell'\nset ylabel 'density [kg/m"
                       BLAST_CUBED "]'\nset yrange [0:*]\n");
    blast_add_panel(&script, results, "3", 3);
    blast_add(&script, "unset multiplot");
    (void)example_picture(out, "shock.svg", 1000, 440, script.text);
}

/* run time, and over that of the particles (or of the first method there is) */
static void blast_draw_time(const blast_result *results, const char *out) {
    blast_script script;
    int least = BLAST_TIMES, slowest = -1;
    for (int m = BLAST_METHODS - 1; m >= 0; m--)
        if (results[m].count > 0 && (slowest < 0 || m == BLAST_SPH)) slowest = m;
    for (int m = 0; m < BLAST_METHODS; m++)
        if (results[m].count > 0 && results[m].count < least) least = results[m].count;
    if (slowest < 0) return;
    script.length = 0;
    blast_add(&script, BLAST_COLOURS "set multiplot layout 1,2\nset xlabel 'time [" BLAST_MICRO "s]'\n"
                       "set title 'run time'\nset ylabel 'CPU time [s]'\nset logscale y\n"
                       "set format y '%%g'\nset key above horizontal\nset xtics %g\n", blast_tics(results));
    blast_add_panel(&script, results, "10", 0);
    blast_add(&script, "set title 'how many times faster than %s'\nset ylabel 'speed-up'\nset yrange [0.5:*]\n",
              blast_method_name(slowest));
    for (int m = 0, any = 0; m < BLAST_METHODS; m++) {
        if (results[m].count == 0) continue;
        blast_add(&script, "%s'-' using 1:2 with linespoints lt %d title '%s'", any++ ? ", " : "plot ",
                  m + 1, blast_method_name(m));
    }
    blast_add(&script, "\n");
    for (int m = 0; m < BLAST_METHODS; m++) {
        if (results[m].count == 0) continue;
        for (int k = 0; k < least; k++)
            blast_add(&script, "%g %g\n", 1e6 * results[m].record[k].time,
                      results[slowest].record[k].cpu / fmax(results[m].record[k].cpu, 1e-6));
        blast_add(&script, "e\n");
    }
    blast_add(&script, "unset multiplot");
    (void)example_picture(out, "time.svg", 1000, 440, script.text);
}

static void blast_draw_points(const blast_points *points, const blast_settings *s, const char *out) {
    blast_script script;
    const char *comma = "plot ";
    int there[BLAST_METHODS] = {0};
    for (int k = 0; k < points->count; k++) there[points->point[k].method]++;
    if (points->count == 0) return;
    script.length = 0;
    blast_add(&script, BLAST_COLOURS "set title 'error against run time at %g " BLAST_MICRO
                       "s; labels: dx [m]'\nset xlabel 'CPU time [s]'\n"
                       "set ylabel 'L1 of the density, in units of the air'\nset logscale xy\n"
                       "set format x '%%g'\nset key top right\nset offsets graph 0.1, graph 0.1, graph "
                       "0.1, graph 0.1\n", 1e6 * s->t_end);
    for (int m = 0; m < BLAST_METHODS; m++) {
        if (there[m] == 0) continue;
        blast_add(&script, "%s'convergence_%s.dat' using 4:2 with linespoints lt %d title '%s', "
                           "'' using 4:2:1 with labels offset 0,0.9 notitle", comma,
                  blast_method_name(m), m + 1, blast_method_name(m));
        comma = ", \\\n  ";
    }
    (void)example_picture(out, "convergence.svg", 760, 520, script.text);
}

static void blast_draw_all(const blast_result *results, const blast_settings *s,
                           const blast_reference *reference, const char *out) {
    blast_draw_plane(results, s, reference, out);
    if (results[BLAST_HYBRID].count > 0) blast_draw_flags(s, out);
    blast_draw_lines(results, s, reference, out);
    blast_draw_shock(results, out);
    if (s->times > 0) blast_draw_time(results, out);
}

#endif
