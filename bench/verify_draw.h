/* verify_draw.h: pictures of error against run time from the rows of verify.csv, by gnuplot. A
   picture is a line of the table in verify.c. */
#ifndef VERIFY_DRAW_H
#define VERIFY_DRAW_H

enum { VERIFY_SCRIPT = 32768, VERIFY_SERIES = 16 };

/* One picture: a panel for each of `problems`, a line for each kind of run, a point for each
   resolution. scheme, kernel, real: the words that belong, "gas|gas+balsara"; NULL: any. A line is
   named by those of the three that vary. Over the CPU time, or over the number of neighbours. */
typedef struct verify_picture {
    const char *name, *title, *problems, *scheme, *kernel, *real;
    bool over_neighbours;
} verify_picture;

typedef struct verify_script {
    char text[VERIFY_SCRIPT];
    size_t length;
} verify_script;

static void verify_put(verify_script *script, const char *format, ...) EXAMPLE_PRINTF(2, 3);
static void verify_put(verify_script *script, const char *format, ...) {
    va_list args;
    va_start(args, format);
    int n = vsnprintf(script->text + script->length, VERIFY_SCRIPT - script->length, format, args);
    va_end(args);
    if (n > 0) script->length += (size_t)n;
    if (script->length >= VERIFY_SCRIPT) example_fail(1, "a picture's script is too long");
}

static bool verify_in(const char *words, const char *word) {
    size_t length;
    const char *one;
    if (words == NULL) return true;
    for (int k = 0; (one = example_word_(words, k, &length)) != NULL; k++)
        if (strlen(word) == length && strncmp(one, word, length) == 0) return true;
    return false;
}

static bool verify_varies(const char *words) { return words == NULL || strchr(words, '|') != NULL; }

static void verify_label(const verify_picture *picture, const verify_row *row, char label[128]) {
    const char *filter[3] = {picture->scheme, picture->kernel, picture->real};
    const char *value[3] = {row->scheme, row->kernel, row->real};
    label[0] = '\0';
    for (int k = 0; k < 3; k++)
        if (verify_varies(filter[k])) {
            size_t used = strlen(label);
            snprintf(label + used, 128 - used, "%s%s", used > 0 ? ", " : "", value[k]);
        }
}

static bool verify_belongs(const verify_picture *picture, const char *problem,
                           const verify_row *row) {
    return strcmp(row->problem, problem) == 0 && verify_in(picture->scheme, row->scheme) &&
           verify_in(picture->kernel, row->kernel) && verify_in(picture->real, row->real) &&
           row->l1_error > 0.0 && (picture->over_neighbours || row->cpu_s > 0.0);
}

/* the labels of a panel's lines, in the order of the rows; how many */
static int verify_lines(const verify *v, const verify_picture *picture, const char *problem,
                        char labels[VERIFY_SERIES][128]) {
    int count = 0;
    for (int k = 0; k < v->row_count; k++) {
        char label[128];
        bool known = false;
        if (!verify_belongs(picture, problem, &v->rows[k])) continue;
        verify_label(picture, &v->rows[k], label);
        for (int s = 0; s < count; s++) known = known || strcmp(labels[s], label) == 0;
        if (!known && count < VERIFY_SERIES) memcpy(labels[count++], label, sizeof label);
    }
    return count;
}

/* the points of one line as a block of the data file */
static void verify_points(const verify *v, const verify_picture *picture, const char *problem,
                          const char *wanted, FILE *to) {
    fprintf(to, "# %s, %s: time or neighbours, l1_error, n\n", problem, wanted);
    for (int k = 0; k < v->row_count; k++) {
        const verify_row *row = &v->rows[k];
        char label[128];
        if (!verify_belongs(picture, problem, row)) continue;
        verify_label(picture, row, label);
        if (strcmp(label, wanted) == 0)
            fprintf(to, "%.6g %.6g %.0f\n",
                    picture->over_neighbours ? row->neighbours : row->cpu_s, row->l1_error, row->n);
    }
    fprintf(to, "\n\n");
}

/* tics at 1, 2 and 5 where a decade is much of the axis */
static void verify_tics(verify_script *script, char axis, double low, double high) {
    verify_put(script, "set %ctics ", axis);
    if (high / low > 100.0) {
        verify_put(script, "autofreq\n");
        return;
    }
    const char *comma = "(";
    for (int decade = (int)floor(log10(low)); pow(10.0, decade) <= high; decade++) {
        verify_put(script, "%s1e%d, 2e%d, 5e%d", comma, decade, decade, decade);
        comma = ", ";
    }
    verify_put(script, ")\n");
}

/* the axes just around the points, with room above for a key of so many lines */
static void verify_ranges(const verify *v, const verify_picture *picture, const char *problem,
                          int lines, verify_script *script) {
    double low[2] = {HUGE_VAL, HUGE_VAL}, high[2] = {0.0, 0.0};
    for (int k = 0; k < v->row_count; k++) {
        const verify_row *row = &v->rows[k];
        if (!verify_belongs(picture, problem, row)) continue;
        double at[2] = {picture->over_neighbours ? row->neighbours : row->cpu_s, row->l1_error};
        for (int a = 0; a < 2; a++) low[a] = fmin(low[a], at[a]), high[a] = fmax(high[a], at[a]);
    }
    double share = fmin(0.05 * lines + 0.05, 0.5); /* of the height, for the key */
    double top = high[1] * 1.3 * pow(1.7 * high[1] / low[1], share / (1.0 - share));
    verify_put(script, "set xrange [%g:%g]\nset yrange [%g:%g]\n", low[0] / 1.4, high[0] * 1.4,
               low[1] / 1.3, top);
    verify_tics(script, 'x', low[0] / 1.4, high[0] * 1.4);
    verify_tics(script, 'y', low[1] / 1.3, top);
}

/* one panel; *index: the block of the data file where its lines begin */
static void verify_panel(const verify *v, const verify_picture *picture, const char *problem,
                         const char *data, FILE *to, int *index, verify_script *script) {
    static const char *colour[8] = {"#0b4f9e", "#d55e00", "#2a9d4a", "#7b3fa0",
                                    "#c0392b", "#3aa0e8", "#8c564b", "#555555"};
    char labels[VERIFY_SERIES][128];
    int lines = verify_lines(v, picture, problem, labels);
    verify_put(script, "set title '%s' noenhanced\n", problem);
    verify_ranges(v, picture, problem, lines, script);
    for (int s = 0; s < lines; s++) {
        verify_points(v, picture, problem, labels[s], to);
        verify_put(script, "%s'%s' index %d using 1:2 with linespoints lw 1.6 pt %d ps 0.9 lc rgb "
                           "'%s' title \"%s\" noenhanced%s",
                   s == 0 ? "plot " : "", data, (*index)++, 4 + s % 10,
                   colour[s % 8], labels[s], s + 1 < lines ? ", \\\n  " : "\n");
    }
}

/* problems of a picture that have rows: none, no picture */
static bool verify_draw_one(const verify *v, const verify_picture *picture) {
    static verify_script script;
    char problem[8][VERIFY_NAME], data[VERIFY_NAME + 8], labels[VERIFY_SERIES][128];
    int panels = 0, index = 0;
    for (const char *word = picture->problems; *word != '\0' && panels < 8;) {
        size_t length = strcspn(word, ",");
        snprintf(problem[panels], VERIFY_NAME, "%.*s", (int)length, word);
        panels += verify_lines(v, picture, problem[panels], labels) > 0;
        word += length + (word[length] == ',');
    }
    if (panels == 0) return false;
    int columns = panels < 4 ? panels : (panels + 1) / 2, rows = (panels + columns - 1) / columns;
    script.length = 0;
    snprintf(data, sizeof data, "%.*s.dat", (int)strcspn(picture->name, "."), picture->name);
    example_file file = example_open(v->out, data);
    verify_put(&script,
               "set multiplot layout %d,%d title \"%s\" noenhanced\nset logscale xy\n"
               "set format y '%%.0e'\nset format x '%%g'\nset grid lt 1 lc rgb '#e4e4e4'\n"
               "set xlabel '%s'\nset ylabel 'L1 error'\n"
               "set key top right samplen 1.5 spacing 0.95 font ',9'\n",
               rows, columns, picture->title,
               picture->over_neighbours ? "neighbours" : "CPU time of the run [s]");
    for (int k = 0; k < panels; k++)
        verify_panel(v, picture, problem[k], data, file.stream, &index, &script);
    example_close(&file);
    verify_put(&script, "unset multiplot");
    int width = panels > 3 ? 360 : panels > 1 ? 420 : 640, height = panels > 3 ? 350 : 400;
    return example_picture(v->out, picture->name, columns * width + 20, rows * height + 30,
                           script.text);
}

#endif
