/* example.h: what the example programs share beside the physics: a table of options from which the
   --help text is made, a progress line, folders and files for results, pictures by gnuplot.

   Include it before everything else (it asks for POSIX where there is one). A mistake of the user's
   ends the program here, with one line on stderr that names the value and the cure: exit status 2
   for a bad command line, 1 for the rest. */
#ifndef EXAMPLE_H
#define EXAMPLE_H

#if defined(__unix__) || (defined(__APPLE__) && defined(__MACH__))
#define EXAMPLE_POSIX 1
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif
#else
#define EXAMPLE_POSIX 0
#endif

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#if EXAMPLE_POSIX
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#elif defined(_WIN32)
#include <direct.h>
#endif
#ifdef _OPENMP
#include <omp.h>
#endif

#if defined(__GNUC__) || defined(__clang__)
#define EXAMPLE_PRINTF(text, first) __attribute__((__format__(__printf__, text, first)))
#else
#define EXAMPLE_PRINTF(text, first)
#endif

/* ---- ending with a message ------------------------------------------------------------------- */

/* "sod: ..." on stderr, then exit(status) */
static inline _Noreturn void example_fail(int status, const char *format, ...)
    EXAMPLE_PRINTF(2, 3);

static inline const char **example_name_(void) {
    static const char *name = "example";
    return &name;
}

static inline _Noreturn void example_fail(int status, const char *format, ...) {
    va_list args;
    fflush(stdout);
    fprintf(stderr, "%s: ", *example_name_());
    va_start(args, format);
    vfprintf(stderr, format, args);
    va_end(args);
    fputc('\n', stderr);
    exit(status);
}

/* ---- options --------------------------------------------------------------------------------- */

typedef enum example_kind {
    EXAMPLE_NUMBER,  /* a double within [low, high] */
    EXAMPLE_VECTOR,  /* doubles within [low, high], with commas between them */
    EXAMPLE_COUNT,   /* a long within [low, high] */
    EXAMPLE_CHOICE,  /* one of the words in `argument`; the value is its place, from 0 */
    EXAMPLE_SWITCH,  /* on or off */
    EXAMPLE_FLAG,    /* there or not */
    EXAMPLE_TEXT
} example_kind;

/* One row of the table: made by the functions below. What the variable holds before parsing is the
   default, and is shown as such. */
typedef struct example_option {
    const char *name;     /* "cfl": given as --cfl 0.3 or --cfl=0.3 */
    const char *argument; /* "s", "N", "on|off", ...: shown in the help */
    const char *help;
    example_kind kind;
    void *value; /* double, long, int, or const char * */
    int length;  /* of a vector */
    double low, high;
} example_option;

static inline example_option example_option_(const char *name, const char *argument, void *value,
                                             example_kind kind, const char *help) {
    example_option option;
    memset(&option, 0, sizeof option);
    option.name = name;
    option.argument = argument;
    option.help = help;
    option.kind = kind;
    option.value = value;
    option.low = -HUGE_VAL;
    option.high = HUGE_VAL;
    return option;
}

static inline example_option example_number(const char *name, const char *unit, double *value,
                                            double low, double high, const char *help) {
    const char *shown = strcmp(unit, "1") == 0 ? "NUMBER" : unit; /* a pure number */
    example_option option = example_option_(name, shown, value, EXAMPLE_NUMBER, help);
    option.low = low;
    option.high = high;
    return option;
}

static inline example_option example_vector(const char *name, const char *form, double *values,
                                            int length, double low, double high,
                                            const char *help) {
    example_option option = example_option_(name, form, values, EXAMPLE_VECTOR, help);
    option.length = length;
    option.low = low;
    option.high = high;
    return option;
}

static inline example_option example_count(const char *name, long *value, long low, long high,
                                           const char *help) {
    example_option option = example_option_(name, "N", value, EXAMPLE_COUNT, help);
    option.low = (double)low;
    option.high = (double)high;
    return option;
}

/* words: "cubic|quartic|quintic"; *value becomes 0, 1, 2 */
static inline example_option example_choice(const char *name, const char *words, int *value,
                                            const char *help) {
    return example_option_(name, words, value, EXAMPLE_CHOICE, help);
}

static inline example_option example_switch(const char *name, int *value, const char *help) {
    return example_option_(name, "on|off", value, EXAMPLE_SWITCH, help);
}

static inline example_option example_flag(const char *name, int *value, const char *help) {
    return example_option_(name, "", value, EXAMPLE_FLAG, help);
}

static inline example_option example_text(const char *name, const char *form, const char **value,
                                          const char *help) {
    return example_option_(name, form, value, EXAMPLE_TEXT, help);
}

/* the k-th word of "a|b|c", or NULL; *length is how long it is */
static inline const char *example_word_(const char *words, int k, size_t *length) {
    for (; k > 0; k--) {
        words = strchr(words, '|');
        if (words == NULL) return NULL;
        words++;
    }
    const char *bar = strchr(words, '|');
    *length = bar != NULL ? (size_t)(bar - words) : strlen(words);
    return words;
}

static inline void example_print_default_(const example_option *option) {
    const char *word, *text;
    size_t length = 0;
    switch (option->kind) {
    case EXAMPLE_NUMBER: printf(" [%g]", *(double *)option->value); break;
    case EXAMPLE_COUNT: printf(" [%ld]", *(long *)option->value); break;
    case EXAMPLE_SWITCH: printf(" [%s]", *(int *)option->value ? "on" : "off"); break;
    case EXAMPLE_CHOICE:
        word = example_word_(option->argument, *(int *)option->value, &length);
        if (word != NULL) printf(" [%.*s]", (int)length, word);
        break;
    case EXAMPLE_VECTOR:
        for (int k = 0; k < option->length; k++)
            printf("%s%g", k ? "," : " [", ((double *)option->value)[k]);
        printf("]");
        break;
    case EXAMPLE_TEXT:
        text = *(const char **)option->value;
        if (text != NULL && text[0] != '\0') printf(" [%s]", text);
        break;
    case EXAMPLE_FLAG: break;
    }
}

static inline void example_help_(const char *about, const example_option *options, int count) {
    printf("%s: %s\n\noptions [default]:\n", *example_name_(), about);
    for (int k = 0; k < count; k++) {
        char left[160];
        snprintf(left, sizeof left, "--%s %s", options[k].name, options[k].argument);
        printf(strlen(left) > 28 ? "  %s\n%31s" : "  %-28s %s", left,
               strlen(left) > 28 ? "" : options[k].help);
        if (strlen(left) > 28) printf("%s", options[k].help);
        example_print_default_(&options[k]);
        printf("\n");
    }
    printf("  %-28s %s\n  %-28s %s\n", "--help", "this text", "--version", "the toolkit's version");
}

/* "write --speed 2580": with what the variable holds before it is set, its default */
static inline _Noreturn void example_refuse_(const example_option *option, const char *text,
                                             const char *why) {
    fprintf(stderr, "%s: --%s %s: %s; write --%s ", *example_name_(), option->name, text, why,
            option->name);
    if (option->kind == EXAMPLE_COUNT) fprintf(stderr, "%ld", *(long *)option->value);
    if (option->kind == EXAMPLE_NUMBER) fprintf(stderr, "%g", *(double *)option->value);
    for (int k = 0; k < option->length; k++)
        fprintf(stderr, k ? ",%g" : "%g", ((double *)option->value)[k]);
    fprintf(stderr, " or the like\n");
    exit(2);
}

/* all of *text up to the character `end` as a number; *text goes on behind that */
static inline double example_parse_number_(const example_option *option, const char *all, char end,
                                           const char **text) {
    char *stop = NULL, why[80] = "not a finite number";
    double value = strtod(*text, &stop);
    if (option->length > 1)
        snprintf(why, sizeof why, "not %d finite numbers with commas between", option->length);
    if (stop == *text || *stop != end || !(value - value == 0.0))
        example_refuse_(option, all, why);
    if (!(value >= option->low && value <= option->high))
        example_fail(2, "--%s %s: out of range; %s from %g to %g", option->name, all,
                     option->length > 1 ? "each number goes" : "it goes", option->low,
                     option->high);
    *text = end != '\0' ? stop + 1 : stop;
    return value;
}

static inline int example_parse_word_(const example_option *option, const char *text) {
    size_t length = 0;
    const char *word;
    for (int k = 0; (word = example_word_(option->argument, k, &length)) != NULL; k++)
        if (strlen(text) == length && strncmp(text, word, length) == 0) return k;
    example_fail(2, "--%s %s: unknown; give one of %s", option->name, text, option->argument);
}

/* a whole number, also written like 1e6 */
static inline long example_parse_count_(const example_option *option, const char *text) {
    char *stop = NULL;
    double value = strtod(text, &stop);
    if (stop == text || *stop != '\0' || floor(value) != value || !(value - value == 0.0))
        example_refuse_(option, text, "not a whole number");
    if (value < option->low || value > option->high)
        example_fail(2, "--%s %s: out of range; it goes from %.0f to %.0f", option->name, text,
                     option->low, option->high);
    return (long)value;
}

static inline void example_set_(const example_option *option, const char *text) {
    const char *rest = text;
    switch (option->kind) {
    case EXAMPLE_NUMBER:
        *(double *)option->value = example_parse_number_(option, text, '\0', &rest);
        break;
    case EXAMPLE_VECTOR:
        for (int k = 0; k < option->length; k++)
            ((double *)option->value)[k] =
                example_parse_number_(option, text, k + 1 < option->length ? ',' : '\0', &rest);
        break;
    case EXAMPLE_COUNT: *(long *)option->value = example_parse_count_(option, text); break;
    case EXAMPLE_CHOICE: *(int *)option->value = example_parse_word_(option, text); break;
    case EXAMPLE_SWITCH: *(int *)option->value = example_parse_word_(option, text) == 0; break;
    case EXAMPLE_TEXT: *(const char **)option->value = text; break;
    case EXAMPLE_FLAG: break;
    }
}

/* Reads the command line into the table's variables; answers --help and --version itself. */
static inline void example_parse(int argc, char **argv, const char *about, const char *version,
                                 const example_option *options, int count) {
    if (argc > 0 && argv[0] != NULL) {
        const char *slash = strrchr(argv[0], '/');
        *example_name_() = slash != NULL ? slash + 1 : argv[0];
    }
    for (int k = 1; k < argc; k++) {
        const char *text = argv[k], *equals = strchr(text, '=');
        size_t length = equals != NULL ? (size_t)(equals - text) : strlen(text);
        if (strcmp(text, "--help") == 0 || strcmp(text, "-h") == 0) {
            example_help_(about, options, count);
            exit(0);
        }
        if (strcmp(text, "--version") == 0) {
            printf("%s, sphpa %s\n", *example_name_(), version);
            exit(0);
        }
        const example_option *option = NULL;
        for (int o = 0; o < count; o++)
            if (length == strlen(options[o].name) + 2 && strncmp(text, "--", 2) == 0 &&
                strncmp(text + 2, options[o].name, length - 2) == 0)
                option = &options[o];
        if (option == NULL && strncmp(text, "--", 2) != 0)
            example_fail(2, "%s: not an option, which all begin with --; --help lists them", text);
        if (option == NULL) example_fail(2, "%s: no such option; --help lists them", text);
        if (option->kind == EXAMPLE_FLAG) {
            if (equals != NULL) example_fail(2, "%s: --%s takes no value", text, option->name);
            *(int *)option->value = 1;
        } else if (equals != NULL) example_set_(option, equals + 1);
        else if (k + 1 < argc) example_set_(option, argv[++k]);
        else example_fail(2, "%s: its value is missing; give --%s %s", text, option->name,
                          option->argument);
    }
}

/* ---- threads, interrupt, memory, time -------------------------------------------------------- */

/* 0: as many as the machine or OMP_NUM_THREADS says; returns how many it will be */
static inline int example_threads(long wanted) {
#ifdef _OPENMP
    if (wanted > 0) omp_set_num_threads((int)wanted);
    return omp_get_max_threads();
#else
    if (wanted > 1) fprintf(stderr, "built without OpenMP: one thread, not %ld\n", wanted);
    return 1;
#endif
}

static volatile sig_atomic_t example_stop_flag_;
static inline void example_on_interrupt_(int number) {
    example_stop_flag_ = 1;
    signal(number, SIG_DFL); /* a second Ctrl-C ends the program at once */
}

/* From now on Ctrl-C (and SIGTERM) sets the flag that this returns: sphpa_run.stop takes it. */
static inline const volatile int *example_stop_on_interrupt(void) {
#if EXAMPLE_POSIX
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = example_on_interrupt_;
    action.sa_flags = SA_RESTART; /* writing a file goes on */
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
#else
    signal(SIGINT, example_on_interrupt_);
    signal(SIGTERM, example_on_interrupt_);
#endif
    return &example_stop_flag_;
}

/* [bytes] most memory that the program had so far; 0 where the system does not tell */
static inline double example_peak_memory(void) {
#if EXAMPLE_POSIX
    struct rusage usage;
    if (getrusage(RUSAGE_SELF, &usage) != 0) return 0.0;
#if defined(__APPLE__)
    return (double)usage.ru_maxrss;
#else
    return 1024.0 * (double)usage.ru_maxrss;
#endif
#else
    return 0.0;
#endif
}

static inline double example_clock(void) { /* [s] wall clock */
    struct timespec now;
    return timespec_get(&now, TIME_UTC) == TIME_UTC
               ? (double)now.tv_sec + 1e-9 * (double)now.tv_nsec
               : (double)clock() / (double)CLOCKS_PER_SEC;
}

/* ---- progress -------------------------------------------------------------------------------- */

/* Zero it before the first call; quiet != 0: nothing is printed. */
typedef struct example_progress {
    int quiet;
    double begun, shown, share_begun; /* [s] wall clock; [1] */
    uint64_t updates_begun;
    int on_line; /* not 0: the terminal's cursor stands at the end of a progress line */
} example_progress;

static inline int example_terminal_(void) {
#if EXAMPLE_POSIX
    return isatty(STDERR_FILENO);
#else
    return 0;
#endif
}

/* Call after every step: the share done in [0, 1], time and dt [s], and how many particles were
   moved so far (particles times steps). One line that is written over in a terminal, else a whole
   line every five seconds. */
static inline void example_progress_show(example_progress *p, double share, double time, double dt,
                                         uint64_t steps, uint64_t updates) {
    double now = example_clock();
    if (p->begun <= 0.0) {
        p->begun = p->shown = now;
        p->share_begun = share;
        p->updates_begun = updates;
    }
    int terminal = example_terminal_();
    if (p->quiet || now - p->shown < (terminal ? 0.2 : 5.0)) return;
    p->shown = now;
    double spent = now - p->begun, done = share - p->share_begun;
    double left = done > 0.0 ? spent * (1.0 - share) / done : 0.0;
    fprintf(stderr,
            "%s%5.1f %%  t = %.4e s  dt = %.2e s  %llu steps  %.3g updates/s  %.0f s left%s",
            terminal ? "\r" : "", 100.0 * share, time, dt, (unsigned long long)steps,
            (double)(updates - p->updates_begun) / (spent + 1e-9), left, terminal ? "   " : "\n");
    p->on_line = terminal;
    fflush(stderr);
}

/* at the end, and before anything else is printed */
static inline void example_progress_end(example_progress *p) {
    if (p->on_line) fputc('\n', stderr);
    p->on_line = 0;
}

/* ---- folders and files ----------------------------------------------------------------------- */

#define EXAMPLE_PATH 1024

static inline int example_mkdir_(const char *path) {
#if EXAMPLE_POSIX
    return mkdir(path, 0777);
#elif defined(_WIN32)
    return _mkdir(path);
#else
    (void)path;
    return 0;
#endif
}

static inline bool example_is_folder_(const char *path) {
#if EXAMPLE_POSIX
    struct stat what;
    return stat(path, &what) == 0 && S_ISDIR(what.st_mode);
#else
    (void)path;
    return true; /* opening a file in it will tell */
#endif
}

/* is there something with this name that is no file? */
static inline bool example_is_special_(const char *path) {
#if EXAMPLE_POSIX
    struct stat what;
    return stat(path, &what) == 0 && !S_ISREG(what.st_mode);
#else
    (void)path;
    return false;
#endif
}

/* mkdir -p; ends the program where that cannot be done. `option` is what chose the folder. */
static inline void example_folder_of(const char *path, const char *option) {
    char part[EXAMPLE_PATH];
    size_t length = strlen(path);
    if (length == 0 || length >= sizeof part)
        example_fail(1, "output folder \"%.60s\": give a name of 1 to %d characters with %s", path,
                     EXAMPLE_PATH - 1, option);
    for (size_t k = 1; k <= length; k++) {
        if (path[k] != '/' && path[k] != '\0') continue;
        memcpy(part, path, k);
        part[k] = '\0';
        if (example_mkdir_(part) == 0) continue;
        int why = errno;
        if (!example_is_folder_(part))
            example_fail(1, "output folder %s: cannot make %s (%s); choose another with %s", path,
                         part, strerror(why), option);
    }
}

static inline void example_folder(const char *path) { example_folder_of(path, "--out"); }

/* A file that has its name only once it is whole: it is written as NAME.part. */
typedef struct example_file {
    FILE *stream; /* print into it */
    char path[EXAMPLE_PATH], part[EXAMPLE_PATH + 8];
} example_file;

static inline example_file example_open_of(const char *folder, const char *name,
                                           const char *option) {
    example_file file;
    int n = snprintf(file.path, sizeof file.path, "%s/%s", folder, name);
    if (n < 0 || (size_t)n >= sizeof file.path)
        example_fail(1, "%.60s/...: the name is too long", folder);
    snprintf(file.part, sizeof file.part, "%s.part", file.path);
    if (example_is_special_(file.path)) /* it would be replaced by a file */
        example_fail(1, "%s is a folder or a device; give the name of a file with %s", file.path,
                     option);
    file.stream = fopen(file.part, "w");
    if (file.stream == NULL)
        example_fail(1, "cannot write %s (%s); choose another folder with %s", file.part,
                     strerror(errno), option);
    return file;
}

static inline example_file example_open(const char *folder, const char *name) {
    return example_open_of(folder, name, "--out");
}

/* instead of closing it: nothing stays behind */
static inline void example_discard(example_file *file) {
    fclose(file->stream);
    remove(file->part);
}

static inline void example_close(example_file *file) {
    bool good = ferror(file->stream) == 0;
    good = fclose(file->stream) == 0 && good;
#if !EXAMPLE_POSIX
    if (good) remove(file->path); /* rename() replaces a file only in POSIX */
#endif
    good = good && rename(file->part, file->path) == 0;
    if (good) return;
    int why = errno;
    remove(file->part);
    example_fail(1, "could not finish %s (%s); is the disk full?", file->path, strerror(why));
}

/* ---- pictures -------------------------------------------------------------------------------- */

/* The shell's answer to a command: whether it went well. Ends the program where Ctrl-C ended the
   command: system() keeps that signal from us. */
static inline bool example_shell_(const char *command) {
    int status = system(command);
#if EXAMPLE_POSIX
    if (status != -1 && WIFSIGNALED(status) &&
        (WTERMSIG(status) == SIGINT || WTERMSIG(status) == SIGTERM)) {
        fprintf(stderr, "%s: interrupted\n", *example_name_());
        exit(128 + WTERMSIG(status));
    }
#endif
    return status == 0;
}

static inline bool example_have_gnuplot(void) {
#if defined(_WIN32)
    return example_shell_("gnuplot --version > NUL 2>&1");
#else
    return example_shell_("gnuplot --version > /dev/null 2>&1");
#endif
}

/* 'text' for the shell; a quote inside becomes '\'' */
static inline void example_quote_(char *out, size_t size, const char *text) {
    size_t n = 0;
    if (size > 8) out[n++] = '\'';
    for (; *text != '\0' && n + 8 < size; text++) {
        if (*text == '\'') {
            memcpy(out + n, "'\\''", 4);
            n += 4;
        } else out[n++] = *text;
    }
    out[n++] = '\'';
    out[n] = '\0';
}

/* what gnuplot made has its name only once it is whole; what it failed on goes */
static inline bool example_keep_picture_(const char *folder, const char *name, bool good) {
    char path[2 * EXAMPLE_PATH], part[2 * EXAMPLE_PATH + 8];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    snprintf(part, sizeof part, "%s.part", path);
    FILE *made = fopen(part, "rb");
    good = good && made != NULL && fgetc(made) != EOF;
    if (made != NULL) fclose(made);
#if !EXAMPLE_POSIX
    if (good) remove(path);
#endif
    good = good && rename(part, path) == 0;
    if (!good) remove(part);
    return good;
}

/* Draws FOLDER/NAME (.svg, .png or .gif; no quotes in NAME) by a gnuplot script that reads its data
   from that folder; the script is kept beside it as NAME.gp. Says on stderr what it drew or left
   out. */
static inline bool example_picture(const char *folder, const char *name, int width, int height,
                                   const char *script) {
    char script_name[EXAMPLE_PATH], quoted[2 * EXAMPLE_PATH], command[5 * EXAMPLE_PATH];
    const char *dot = strrchr(name, '.');
    bool png = dot != NULL && strcmp(dot, ".png") == 0;
    bool gif = dot != NULL && strcmp(dot, ".gif") == 0;
    snprintf(script_name, sizeof script_name, "%s.gp", name);
    fflush(stdout); /* what was printed comes before what is said here */
    example_file file = example_open(folder, script_name);
    fprintf(file.stream, "set encoding utf8\nif (!exists('part')) part = ''\n");
    fprintf(file.stream, "set terminal %s size %d,%d font 'Sans,%d' background 'white'\n",
            gif ? "gif animate delay 8" : png ? "pngcairo" : "svg", width, height,
            png || gif ? 11 : 14);
    fprintf(file.stream, "set output '%s'.part\n%s\nset output\n", name, script);
    example_close(&file);
    if (!example_have_gnuplot()) {
        fprintf(stderr, "left out %s/%s: no gnuplot here; install it, then: cd %s && gnuplot %s\n",
                folder, name, folder, script_name);
        return false;
    }
    example_quote_(quoted, sizeof quoted, folder);
    int n = snprintf(command, sizeof command, "CDPATH= cd -- %s && gnuplot -e \"part='.part'\" ",
                     quoted);
    example_quote_(quoted, sizeof quoted, script_name);
    snprintf(command + n, sizeof command - (size_t)n, "%s", quoted);
    bool good = example_keep_picture_(folder, name, example_shell_(command));
    if (good) fprintf(stderr, "drew %s/%s\n", folder, name);
    else fprintf(stderr, "left out %s/%s: gnuplot failed on %s\n", folder, name, script_name);
    return good;
}

#endif
