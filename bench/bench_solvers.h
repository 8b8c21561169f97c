/* bench_solvers.h: every solver that bench_eos times, each with the same evaluation.

   The problem is eq. 4 of the section >>porosity of sphpa.h: F(alpha) = alpha - min(curve(P),
   alpha_old) with P = Peos(alpha rho, u)/alpha, F(1) <= 0 <= F(alpha_old).

   A solver is a function that gets one state and returns alpha, P and how often it asked for F; it
   is inlined into the loop that is timed, so that none pays for a call. Its line in BENCH_SOLVERS
   is all that it takes to join. A peer has three advantages over the library's solvers: the crush
   curve is prepared outside the loop, nothing checks its input, and it returns no sound speed.

   Each peer tests both ends first, alpha_old and then 1, counts these as evaluations, and stops at
   the same tolerance, max(tol, 4 eps alpha), as its author meant it: the bracket, or twice it. */
#ifndef BENCH_SOLVERS_H
#define BENCH_SOLVERS_H

#ifdef BENCH_WITH_GSL
#include <gsl/gsl_errno.h>
#include <gsl/gsl_roots.h>
#include <gsl/gsl_version.h>
#endif

#if defined(__GNUC__) || defined(__clang__)
#define BENCH_INLINE static inline __attribute__((unused, always_inline))
#else
#define BENCH_INLINE static inline
#endif

enum { BENCH_MOST = 100 }; /* iterations, then a solver gives up */

/* ---- one state ------------------------------------------------------------------------------- */

typedef struct bench_problem {
    const sphpa_tillotson *matrix;
    const sphpa_crush *curve;
    sphpa_crush_shape_ shape; /* of the curve, made once for many states */
    double rho, u, alpha_old; /* [kg/m3] bulk, [J/kg], [1] */
    double tol;               /* [1] on alpha */
    int evaluations;          /* so far */
} bench_problem;

/* One alpha, and what was evaluated there. */
typedef struct bench_point {
    double alpha, P, F, dF; /* [1] [Pa] [1] [1] eq. 4 and its derivative */
} bench_point;

typedef struct bench_answer {
    double alpha, P;
    int evaluations;
    int failed; /* not 0: an error, or not converged */
} bench_answer;

/* The one evaluation of all the peers: the library's own arithmetic. What a solver does not use,
   such as dF, the compiler drops. */
BENCH_INLINE bench_point bench_at(bench_problem *problem, double alpha) {
    double P, dP_drho, dP_du, slope;
    bench_point point;
    problem->evaluations++;
    sphpa_tillotson_core_(problem->matrix, alpha * problem->rho, problem->u, &P, &dP_drho, &dP_du);
    double inv_alpha = 1.0 / alpha;
    point.alpha = alpha;
    point.P = P * inv_alpha;
    double on_curve = sphpa_crush_curve_(&problem->shape, problem->shape.way, point.P, &slope);
    bool crushes = on_curve < problem->alpha_old;
    point.F = alpha - (crushes ? on_curve : problem->alpha_old);
    point.dF = 1.0 - (crushes ? slope : 0.0) * (problem->rho * dP_drho - point.P) * inv_alpha;
    return point;
}

/* the width below which a bracket holds no more than rounding */
BENCH_INLINE double bench_small(const bench_problem *problem, double alpha) {
    double rounding = 4.0 * DBL_EPSILON * alpha;
    return problem->tol > rounding ? problem->tol : rounding;
}

BENCH_INLINE bench_answer bench_found(const bench_problem *problem, const bench_point *point) {
    bench_answer answer = {point->alpha, point->P, problem->evaluations, 0};
    return answer;
}

BENCH_INLINE bench_answer bench_gave_up(const bench_problem *problem, const bench_point *point) {
    bench_answer answer = {point->alpha, point->P, problem->evaluations, 1};
    return answer;
}

/* Both ends first. True: *x is the answer, elastic, unloading or compacted. False: the root lies
   between lo, where F < 0, and hi, where F > 0. */
BENCH_INLINE bool bench_ends(bench_problem *problem, bench_point *lo, bench_point *hi,
                             bench_point *x) {
    *hi = *x = bench_at(problem, problem->alpha_old);
    if (!(hi->F > 0.0) || !(hi->alpha > 1.0)) return true;
    *lo = *x = bench_at(problem, 1.0);
    return !(lo->F < 0.0);
}

/* ---- peers, written after their papers ------------------------------------------------------- */

/* Oliveira & Takahashi 2020 (ACM Trans. Math. Softw. 47, 5), "interpolate, truncate, project", with
   their kappa1 = 0.2/(b - a), kappa2 = 2, n0 = 1: never more than one step above bisection. */
BENCH_INLINE bench_answer bench_itp(bench_problem *problem) {
    bench_point lo, hi, x;
    if (bench_ends(problem, &lo, &hi, &x)) return bench_found(problem, &x);
    double eps = bench_small(problem, hi.alpha), width = hi.alpha - lo.alpha;
    double kappa1 = 0.2 / width;
    /* reach: eps 2^(n_half + n0 - j), n_half the halvings that bisection would need */
    double reach = 2.0 * eps * exp2(ceil(log2(fmax(width / (2.0 * eps), 1.0))));
    while (width > 2.0 * eps) {
        double half = 0.5 * (lo.alpha + hi.alpha), r = reach - 0.5 * width;
        double chord = (hi.F * lo.alpha - lo.F * hi.alpha) / (hi.F - lo.F);
        double towards = half - chord < 0.0 ? -1.0 : 1.0, shift = kappa1 * width * width;
        double t = shift <= fabs(half - chord) ? chord + towards * shift : half;
        double next = fabs(t - half) <= r ? t : half - towards * r;
        x = bench_at(problem, next);
        if (x.F == 0.0) return bench_found(problem, &x);
        if (x.F > 0.0) hi = x;
        else lo = x;
        width = hi.alpha - lo.alpha;
        reach *= 0.5;
    }
    x.alpha = 0.5 * (lo.alpha + hi.alpha); /* P is linear over what is left */
    x.P = 0.5 * (lo.P + hi.P);
    return bench_found(problem, &x);
}

/* Chandrupatla 1997 (Adv. Eng. Softw. 28, 145): inverse quadratic interpolation where it is known
   to stay inside, else halves. */
BENCH_INLINE bench_answer bench_chandrupatla(bench_problem *problem) {
    bench_point a, b, c, x; /* newest, across the root from it, the one before */
    if (bench_ends(problem, &a, &b, &x)) return bench_found(problem, &x);
    double t = 0.5;
    for (int k = 0; k < BENCH_MOST; k++) {
        x = bench_at(problem, a.alpha + t * (b.alpha - a.alpha));
        if ((x.F > 0.0) == (a.F > 0.0)) {
            c = a;
        } else {
            c = b;
            b = a;
        }
        a = x;
        const bench_point *best = fabs(a.F) < fabs(b.F) ? &a : &b;
        double least = bench_small(problem, best->alpha) / fabs(b.alpha - a.alpha);
        if (least > 0.5 || best->F == 0.0) return bench_found(problem, best);
        double xi = (a.alpha - b.alpha) / (c.alpha - b.alpha), phi = (a.F - b.F) / (c.F - b.F);
        t = 0.5;
        if (phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi)
            t = a.F / (b.F - a.F) * c.F / (b.F - c.F) +
                (c.alpha - a.alpha) / (b.alpha - a.alpha) * a.F / (c.F - a.F) * b.F / (c.F - b.F);
        t = t < least ? least : t > 1.0 - least ? 1.0 - least : t;
    }
    return bench_gave_up(problem, &x);
}

/* Brent's next step from b, the best point, across c, with a the best one before: inverse quadratic
   interpolation, or the chord where only two points differ; false where halving is better */
BENCH_INLINE bool bench_brent_step(const bench_point *a, const bench_point *b, const bench_point *c,
                                   double least, double before, double *step) {
    double half = 0.5 * (c->alpha - b->alpha), s = b->F / a->F, p, q;
    if (fabs(before) < least || fabs(a->F) <= fabs(b->F)) return false;
    if (a->alpha == c->alpha) {
        p = 2.0 * half * s;
        q = 1.0 - s;
    } else {
        double v = a->F / c->F, r = b->F / c->F;
        p = s * (2.0 * half * v * (v - r) - (b->alpha - a->alpha) * (r - 1.0));
        q = (v - 1.0) * (r - 1.0) * (s - 1.0);
    }
    if (p > 0.0) q = -q;
    else p = -p;
    *step = p / q;
    return 2.0 * p < 3.0 * half * q - fabs(least * q) && p < fabs(0.5 * before * q);
}

/* Brent 1973 (Algorithms for Minimization without Derivatives, chapter 4, "zero"). */
BENCH_INLINE bench_answer bench_brent(bench_problem *problem) {
    bench_point a, b, c, x;
    if (bench_ends(problem, &a, &b, &x)) return bench_found(problem, &x);
    c = a;
    double step = b.alpha - a.alpha, before = step;
    for (int k = 0; k < BENCH_MOST; k++) {
        if (fabs(c.F) < fabs(b.F)) {
            a = b;
            b = c;
            c = a;
        }
        double least = bench_small(problem, b.alpha), half = 0.5 * (c.alpha - b.alpha), next;
        if (fabs(half) <= least || b.F == 0.0) return bench_found(problem, &b);
        if (bench_brent_step(&a, &b, &c, least, before, &next)) {
            before = step;
            step = next;
        } else {
            before = step = half;
        }
        a = b;
        b = bench_at(problem, b.alpha + (fabs(step) > least ? step : copysign(least, half)));
        if ((b.F > 0.0) == (c.F > 0.0)) {
            c = a;
            before = step = b.alpha - a.alpha;
        }
    }
    return bench_gave_up(problem, &b);
}

/* ---- the library's solvers ------------------------------------------------------------------- */

/* as any program calls them, one state at a time */
BENCH_INLINE bench_answer bench_library(bench_problem *problem, sphpa_palpha_solver solver) {
    const sphpa_palpha_options options = {problem->tol, BENCH_MOST};
    sphpa_palpha_solution s;
    s.alpha = s.P = 0.0; /* an error leaves it untouched */
    s.evaluations = 0;
    sphpa_result result = sphpa_palpha_solve(solver, problem->matrix, problem->curve, problem->rho,
                                             problem->u, problem->alpha_old, &options, &s);
    bench_answer answer = {s.alpha, s.P, s.evaluations, result != SPHPA_OK};
    return answer;
}

BENCH_INLINE bench_answer bench_bisection(bench_problem *problem) {
    return bench_library(problem, SPHPA_PALPHA_BISECTION);
}
BENCH_INLINE bench_answer bench_newton(bench_problem *problem) {
    return bench_library(problem, SPHPA_PALPHA_NEWTON);
}
BENCH_INLINE bench_answer bench_safe_newton(bench_problem *problem) {
    return bench_library(problem, SPHPA_PALPHA_SAFE_NEWTON);
}
BENCH_INLINE bench_answer bench_crush_space(bench_problem *problem) {
    return bench_library(problem, SPHPA_PALPHA_CRUSH_SPACE);
}

/* ---- many states ----------------------------------------------------------------------------- */

/* States of one material, and room for a solver's answers. */
typedef struct bench_set {
    const sphpa_tillotson *matrix;
    const sphpa_crush *curve;
    size_t n;
    double *rho, *u, *alpha_old;
} bench_set;

typedef struct bench_answers {
    double *alpha, *P;
    int *evaluations;      /* of each state; -1 where the solver does not tell */
    unsigned char *failed; /* not 0: an error, or not converged */
    double all_evaluations; /* their sum, and the most that one state took: of solvers that only */
    int most_evaluations;   /* tell these; else 0 */
} bench_answers;

typedef void (*bench_run)(const bench_set *set, double tol, bench_answers *out);

BENCH_INLINE bench_problem bench_open(const bench_set *set, double tol) {
    bench_problem problem;
    memset(&problem, 0, sizeof problem);
    problem.matrix = set->matrix;
    problem.curve = set->curve;
    sphpa_crush_shape_of_(set->curve, &problem.shape);
    problem.tol = tol;
    return problem;
}

BENCH_INLINE void bench_put(bench_answers *out, size_t i, bench_answer answer) {
    out->alpha[i] = answer.alpha;
    out->P[i] = answer.P;
    out->evaluations[i] = answer.evaluations;
    out->failed[i] = (unsigned char)(answer.failed != 0);
}

static void bench_batch_run(const bench_set *set, double tol, bench_answers *out) {
    const sphpa_palpha_options options = {tol, BENCH_MOST};
    sphpa_palpha_stats stats;
    memset(&stats, 0, sizeof stats);
    stats.status = out->failed;
    (void)sphpa_palpha_solve_batch(SPHPA_PALPHA_CRUSH_SPACE, set->matrix, set->curve, set->n,
                                   set->rho, set->u, set->alpha_old, &options, out->alpha, out->P,
                                   &stats);
    out->all_evaluations = (double)stats.evaluations;
    out->most_evaluations = stats.evaluations_max;
    for (size_t i = 0; i < set->n; i++) out->evaluations[i] = -1;
}

/* ---- GSL ------------------------------------------------------------------------------------- */

#ifdef BENCH_WITH_GSL
/* GSL calls back through a pointer. It evaluates the ends of a bracket once more when it is given
   one; these two are remembered, so that they cost it nothing. */
typedef struct bench_gsl {
    bench_problem problem;
    bench_point lo, hi, last;
} bench_gsl;

static bench_point bench_gsl_at(bench_gsl *gsl, double alpha) {
    if (alpha == gsl->lo.alpha) return gsl->lo;
    if (alpha == gsl->hi.alpha) return gsl->hi;
    if (alpha == gsl->last.alpha) return gsl->last;
    return gsl->last = bench_at(&gsl->problem, alpha);
}
static double bench_gsl_f(double alpha, void *params) {
    return bench_gsl_at((bench_gsl *)params, alpha).F;
}
static double bench_gsl_df(double alpha, void *params) {
    return bench_gsl_at((bench_gsl *)params, alpha).dF;
}
static void bench_gsl_fdf(double alpha, void *params, double *f, double *df) {
    bench_point point = bench_gsl_at((bench_gsl *)params, alpha);
    *f = point.F;
    *df = point.dF;
}

/* both ends; true: *answer is there */
static bool bench_gsl_begin(bench_gsl *gsl, const bench_set *set, size_t i, bench_answer *answer) {
    bench_point x;
    gsl->problem.rho = set->rho[i];
    gsl->problem.u = set->u[i];
    gsl->problem.alpha_old = set->alpha_old[i];
    gsl->problem.evaluations = 0;
    gsl->last.alpha = gsl->lo.alpha = 0.0;
    bool done = bench_ends(&gsl->problem, &gsl->lo, &gsl->hi, &x);
    *answer = bench_found(&gsl->problem, &x);
    return done;
}

/* the loop of GSL's manual, until its bracket is as small as the tolerance */
static bench_answer bench_gsl_close_in(bench_gsl *gsl, gsl_root_fsolver *solver) {
    gsl_function function = {bench_gsl_f, gsl};
    int status = gsl_root_fsolver_set(solver, &function, gsl->lo.alpha, gsl->hi.alpha);
    for (int k = 0; k < BENCH_MOST && status == GSL_SUCCESS; k++) {
        status = gsl_root_fsolver_iterate(solver);
        if (status != GSL_SUCCESS) break;
        double small = bench_small(&gsl->problem, gsl->hi.alpha);
        status = gsl_root_test_interval(gsl_root_fsolver_x_lower(solver),
                                        gsl_root_fsolver_x_upper(solver), small, 0.0);
        if (status == GSL_SUCCESS) {
            bench_answer answer = {gsl_root_fsolver_root(solver), gsl->last.P,
                                   gsl->problem.evaluations, 0};
            return answer;
        }
        if (status == GSL_CONTINUE) status = GSL_SUCCESS;
    }
    return bench_gave_up(&gsl->problem, &gsl->last);
}

static void bench_gsl_bracket_run(const gsl_root_fsolver_type *type, const bench_set *set,
                                  double tol, bench_answers *out) {
    bench_gsl gsl;
    bench_answer answer;
    memset(&gsl, 0, sizeof gsl);
    gsl.problem = bench_open(set, tol);
    gsl_set_error_handler_off();
    gsl_root_fsolver *solver = gsl_root_fsolver_alloc(type);
    if (solver == NULL) example_fail(1, "out of memory");
    for (size_t i = 0; i < set->n; i++) {
        bool done = bench_gsl_begin(&gsl, set, i, &answer);
        bench_put(out, i, done ? answer : bench_gsl_close_in(&gsl, solver));
    }
    gsl_root_fsolver_free(solver);
}
static void bench_gsl_bisection_run(const bench_set *set, double tol, bench_answers *out) {
    bench_gsl_bracket_run(gsl_root_fsolver_bisection, set, tol, out);
}
static void bench_gsl_brent_run(const bench_set *set, double tol, bench_answers *out) {
    bench_gsl_bracket_run(gsl_root_fsolver_brent, set, tol, out);
}

/* from alpha_old; a step that leads out of [1, alpha_old] is GSL's own to mend, and it does not */
static bench_answer bench_gsl_polish(bench_gsl *gsl, gsl_root_fdfsolver *solver) {
    gsl_function_fdf function = {bench_gsl_f, bench_gsl_df, bench_gsl_fdf, gsl};
    double alpha = gsl->hi.alpha;
    int status = gsl_root_fdfsolver_set(solver, &function, alpha);
    for (int k = 0; k < BENCH_MOST && status == GSL_SUCCESS; k++) {
        double before = alpha;
        status = gsl_root_fdfsolver_iterate(solver);
        alpha = gsl_root_fdfsolver_root(solver);
        if (status != GSL_SUCCESS || !(alpha > 0.0)) break;
        double small = bench_small(&gsl->problem, alpha);
        if (gsl_root_test_delta(alpha, before, small, 0.0) == GSL_SUCCESS) {
            bench_answer answer = {alpha, gsl->last.P, gsl->problem.evaluations, 0};
            return answer;
        }
    }
    return bench_gave_up(&gsl->problem, &gsl->last);
}
static void bench_gsl_newton_run(const bench_set *set, double tol, bench_answers *out) {
    bench_gsl gsl;
    bench_answer answer;
    memset(&gsl, 0, sizeof gsl);
    gsl.problem = bench_open(set, tol);
    gsl_set_error_handler_off();
    gsl_root_fdfsolver *solver = gsl_root_fdfsolver_alloc(gsl_root_fdfsolver_newton);
    if (solver == NULL) example_fail(1, "out of memory");
    for (size_t i = 0; i < set->n; i++) {
        bool done = bench_gsl_begin(&gsl, set, i, &answer);
        bench_put(out, i, done ? answer : bench_gsl_polish(&gsl, solver));
    }
    gsl_root_fdfsolver_free(solver);
}
#define BENCH_GSL_SETS(X)                                                                          \
    X(bench_gsl_bisection, "gsl-bisection", BENCH_POINTER)                                         \
    X(bench_gsl_brent, "gsl-brent", BENCH_POINTER)                                                 \
    X(bench_gsl_newton, "gsl-newton", BENCH_POINTER)
#else
#define BENCH_GSL_SETS(X)
#endif

/* ---- the table ------------------------------------------------------------------------------- */

typedef enum bench_kind {
    BENCH_LIBRARY, /* through sphpa.h's public calls */
    BENCH_PEER,    /* inlined, on bench_at */
    BENCH_POINTER  /* another library's, which calls bench_at through a pointer */
} bench_kind;

/* Solvers of one state: a function of bench_problem, its name, its kind. Yours goes here. */
#define BENCH_SOLVERS(X)                                                                           \
    X(bench_bisection, "bisection", BENCH_LIBRARY)                                                 \
    X(bench_newton, "newton", BENCH_LIBRARY)                                                       \
    X(bench_safe_newton, "safe-newton", BENCH_LIBRARY)                                             \
    X(bench_crush_space, "crush-space", BENCH_LIBRARY)                                             \
    X(bench_itp, "itp", BENCH_PEER)                                                                \
    X(bench_chandrupatla, "chandrupatla", BENCH_PEER)                                              \
    X(bench_brent, "brent", BENCH_PEER)

/* Solvers of a whole set: a function NAME_run of the type bench_run. */
#define BENCH_SETS(X)                                                                              \
    X(bench_batch, "crush-space-batch", BENCH_LIBRARY)                                             \
    BENCH_GSL_SETS(X)

/* the loop that is timed, one a solver; the quadratic curve has one of its own, as in the library */
#define BENCH_LOOP(function, name, kind)                                                           \
    BENCH_INLINE void function##_loop(const bench_set *set, bench_problem problem,                 \
                                      bench_answers *out) {                                        \
        for (size_t i = 0; i < set->n; i++) {                                                      \
            problem.rho = set->rho[i];                                                             \
            problem.u = set->u[i];                                                                 \
            problem.alpha_old = set->alpha_old[i];                                                 \
            problem.evaluations = 0;                                                               \
            bench_put(out, i, function(&problem));                                                 \
        }                                                                                          \
    }                                                                                              \
    static void function##_run(const bench_set *set, double tol, bench_answers *out) {             \
        bench_problem problem = bench_open(set, tol);                                              \
        if (problem.shape.way == SPHPA_CRUSH_SQUARE_) {                                            \
            problem.shape.way = SPHPA_CRUSH_SQUARE_; /* known from here on */                      \
            function##_loop(set, problem, out);                                                    \
        } else {                                                                                   \
            function##_loop(set, problem, out);                                                    \
        }                                                                                          \
    }
BENCH_SOLVERS(BENCH_LOOP)

typedef struct bench_solver {
    const char *name;
    bench_run run;
    bench_kind kind;
} bench_solver;

static const bench_solver bench_solvers[] = {
#define BENCH_ROW(function, name, kind) {name, function##_run, kind},
    BENCH_SOLVERS(BENCH_ROW) BENCH_SETS(BENCH_ROW)
#undef BENCH_ROW
};
enum { BENCH_SOLVER_COUNT = sizeof bench_solvers / sizeof bench_solvers[0] };

/* the end of --help */
static const char bench_own_solver[] =
    "\nA solver of your own joins with a function and a line. In bench/bench_solvers.h:\n\n"
    "  BENCH_INLINE bench_answer bench_halves(bench_problem *problem) {\n"
    "      bench_point lo, hi, x; /* F(lo) < 0 < F(hi) */\n"
    "      if (bench_ends(problem, &lo, &hi, &x)) return bench_found(problem, &x);\n"
    "      do {\n"
    "          x = bench_at(problem, 0.5 * (lo.alpha + hi.alpha)); /* x.P, x.F, x.dF */\n"
    "          if (x.F > 0.0) hi = x;\n"
    "          else lo = x;\n"
    "      } while (hi.alpha - lo.alpha > bench_small(problem, hi.alpha));\n"
    "      return bench_found(problem, &x);\n"
    "  }\n\n"
    "and in the list BENCH_SOLVERS(X) below it:\n\n"
    "    X(bench_halves, \"halves\", BENCH_PEER) \\\n\n"
    "Then: make bench-eos ARGS=\"--quick --filter inside\"\n";

#endif
