/* bench_clock.h: what the benchmarks share that has nothing to do with what they time: medians, a
   fixed piece of work that tells whether the machine is busy, the processor's name. */
#ifndef BENCH_CLOCK_H
#define BENCH_CLOCK_H

#ifndef BENCH_COMPILER
#define BENCH_COMPILER "unknown: built without the Makefile"
#endif
#ifndef BENCH_FLAGS
#define BENCH_FLAGS "unknown: built without the Makefile"
#endif

#define BENCH_NOISY_PCT 5.0 /* spread of a fixed piece of work above which we warn */

static inline int bench_by_size(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* median of the samples, and the interquartile range in percent of it; sorts them */
static inline double bench_median(double *samples, int count, double *spread_pct) {
    qsort(samples, (size_t)count, sizeof *samples, bench_by_size);
    double median = samples[count / 2];
    *spread_pct = 100.0 * (samples[(3 * count) / 4] - samples[count / 4]) / median;
    return median;
}

static inline double bench_user_time(void) { /* [s] of all threads */
#if EXAMPLE_POSIX
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return (double)usage.ru_utime.tv_sec + 1e-6 * (double)usage.ru_utime.tv_usec;
#else
    return (double)clock() / CLOCKS_PER_SEC;
#endif
}

/* [s] of a fixed piece of arithmetic: where this varies, the machine is busy with other things */
static inline double bench_fixed_work(void) {
    volatile double start = 1.0;
    double x = start, since = sphpa_wall_clock();
    for (int k = 0; k < 300000; k++) x = x * 0.999999 + 1e-6;
    start = x;
    return sphpa_wall_clock() - since;
}

static inline void bench_read_cpu(char cpu[128]) {
    char line[256];
    const char *colon;
    snprintf(cpu, 128, "unknown");
    FILE *file = fopen("/proc/cpuinfo", "r");
    while (file != NULL && fgets(line, sizeof line, file) != NULL)
        if (strncmp(line, "model name", 10) == 0 && (colon = strchr(line, ':')) != NULL) {
            snprintf(cpu, 128, "%.*s", (int)strcspn(colon + 2, "\n"), colon + 2);
            break;
        }
    if (file != NULL) fclose(file);
#if defined(__APPLE__)
    FILE *asked = popen("sysctl -n machdep.cpu.brand_string", "r");
    if (asked != NULL && fgets(line, sizeof line, asked) != NULL)
        snprintf(cpu, 128, "%.*s", (int)strcspn(line, "\n"), line);
    if (asked != NULL) pclose(asked);
#endif
}

#endif
