/* near.h: what the tests share: threads, sizes, comparisons of doubles for cmocka (whose assert_float_equal
   casts to float). */
#ifndef NEAR_H
#define NEAR_H

#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#ifdef _OPENMP
#include <omp.h>
#endif

static inline void near_fail_(const char *what, double a, double b, double bound, const char *file,
                              int line) {
    print_error("%s: %.17g against %.17g, difference %.3g, allowed %.3g\n", what, a, b, a - b,
                bound);
    _fail(file, line);
}

static inline void set_threads(int n) {
#ifdef _OPENMP
    omp_set_num_threads(n);
#else
    (void)n;
#endif
}

/* with SPHPA_TEST_SMALL: fewer cases of the long tests, for where a run takes ten times as long */
#ifdef SPHPA_TEST_SMALL
enum { SMALL = 1 };
#else
enum { SMALL = 0 };
#endif

/* |a - b| <= rel max(|a|, |b|); NaN never passes */
static inline void near_rel_(const char *what, double a, double b, double rel, const char *file,
                             int line) {
    double bound = rel * fmax(fabs(a), fabs(b));
    if (!(fabs(a - b) <= bound)) near_fail_(what, a, b, bound, file, line);
}

/* |a - b| <= tolerance; NaN never passes */
static inline void near_abs_(const char *what, double a, double b, double tolerance,
                             const char *file, int line) {
    if (!(fabs(a - b) <= tolerance)) near_fail_(what, a, b, tolerance, file, line);
}

/* Both precisions. A bound that does not depend on rounding is one number; one that does is
   FINE(in double, in float), the latter as FLOAT_ROUNDING times what the test multiplies it by. */
#ifdef SPHPA_FLOAT
enum { IS_FLOAT = 1 };
#else
enum { IS_FLOAT = 0 };
#endif
#define FLOAT_ROUNDING 6e-8 /* of a number held as float: 2^-24 of it at most */
#define FINE(in_double, in_float) (IS_FLOAT ? (in_float) : (in_double))

/* Every step rounds the velocity of every particle, up or down: a conserved sum takes a random
   walk. How far it may come, as a share of the sum of sizes: four times FLOAT_ROUNDING, which stands
   for three standard deviations where two particles mirror each other and so round alike. (In a
   steady shock all particles round the same way: test_pores.c.) */
static inline double float_walk(uint64_t steps, size_t particles) {
    return 4.0 * FLOAT_ROUNDING * sqrt((double)steps / (double)particles);
}

#define assert_near(a, b, rel) near_rel_(#a " ~ " #b, a, b, rel, __FILE__, __LINE__)
#define assert_near_abs(a, b, tolerance) near_abs_(#a " ~ " #b, a, b, tolerance, __FILE__, __LINE__)

#endif
