/* near.h: comparisons of doubles for cmocka (whose assert_float_equal casts to float). */
#ifndef NEAR_H
#define NEAR_H

#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

static inline void near_fail_(const char *what, double a, double b, double bound, const char *file,
                              int line) {
    print_error("%s: %.17g against %.17g, difference %.3g, allowed %.3g\n", what, a, b, a - b,
                bound);
    _fail(file, line);
}

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

#define assert_near(a, b, rel) near_rel_(#a " ~ " #b, a, b, rel, __FILE__, __LINE__)
#define assert_near_abs(a, b, tolerance) near_abs_(#a " ~ " #b, a, b, tolerance, __FILE__, __LINE__)

#endif
