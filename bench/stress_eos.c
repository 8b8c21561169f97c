/* stress_eos.c: every P-alpha solver and Tillotson's equation against long double, over states that
   are hard on purpose. `make stress-eos`; what right, other root, ill and wrong mean stands at the
   top of eos_reference.h.

   A block of 256 states shares a material, a curve and a tolerance and has a stream of random
   numbers of its own, so nothing depends on the number of threads. Exit status 1 when a solver
   other than plain Newton failed, when crush-space took more than 40 evaluations or returned
   another root than the largest, when bad input was accepted, or when the judge let a planted
   mistake pass. */
#include "examples/example.h"

#define SPHPA_POROSITY_IMPLEMENTATION
#include "sphpa.h"

#include "bench/eos_reference.h"
#include "bench/stress_states.h"
#include "bench/stress_input.h"
#include "bench/stress_tillotson.h"

enum { BLOCK = 256, SLOW_EVERY = 4, MOST_EVALUATIONS = 40 };

/* columns of the report; the batch is the default solver through sphpa_palpha_solve_batch */
enum { BISECTION, NEWTON, SAFE_NEWTON, CRUSH_SPACE, BATCH, SOLVERS };

static const char *const solver_names[SOLVERS] = {"bisection", "newton", "safe-newton",
                                                  "crush-space", "crush-space-batch"};

static const sphpa_palpha_solver solver_codes[SOLVERS] = {
    SPHPA_PALPHA_BISECTION, SPHPA_PALPHA_NEWTON, SPHPA_PALPHA_SAFE_NEWTON,
    SPHPA_PALPHA_CRUSH_SPACE, SPHPA_PALPHA_CRUSH_SPACE};

/* ---- tallies --------------------------------------------------------------------------------- */

/* The largest of something and where it was; of equals the first, so that the order in which
   threads report does not matter. */
typedef struct extreme {
    long double value;
    uint64_t place;
    stress_case where;
    stress_state state;
} extreme;

#define C_OFF 1e-7L /* what the header promises of c */

/* what one solver did */
typedef struct tally {
    uint64_t states, right, other_root, ill, wrong, not_converged, refused, P_off;
    uint64_t c_off, c_seen; /* sound speeds that were looked at, and those off by more than C_OFF */
    uint64_t wrong_line; /* of the wrong those whose curve has an elastic line (HERRMANN) */
    uint64_t long_ones;  /* took more than MOST_EVALUATIONS */
    extreme alpha;     /* error by tol, where right and 16 eps cond <= tol */
    extreme alpha_all; /* error where right, whatever cond */
    extreme P;         /* |P - P(alpha)| by what is allowed */
    extreme c;         /* relative error of c, at tolerances of 1e-12 or less */
    extreme evaluations;
    extreme backward; /* [roundings] of the ill */
    extreme worst_wrong, worst_line, worst_other, worst_refused, worst_not_converged, worst_P;
    extreme worst_c;
} tally;

typedef struct totals {
    tally solver[SOLVERS];
    uint64_t apart; /* states where batch and scalar solver differ by more than the tolerance */
    extreme worst_apart;
} totals;

static void extreme_see(extreme *e, long double value, uint64_t place, const stress_case *c,
                        const stress_state *s) {
    if (value < e->value || (value == e->value && place >= e->place)) return;
    e->value = value;
    e->place = place;
    e->where = *c;
    e->state = *s;
}

static void extreme_merge(extreme *into, const extreme *from) {
    if (from->place != UINT64_MAX)
        extreme_see(into, from->value, from->place, &from->where, &from->state);
}

static void extreme_clear(extreme *e) {
    memset(e, 0, sizeof *e);
    e->place = UINT64_MAX;
}

/* the same for every extreme of a tally */
enum { EXTREMES = 13 };
static void tally_extremes(tally *t, extreme *list[EXTREMES]) {
    extreme *all[EXTREMES] = {&t->alpha,       &t->alpha_all,     &t->P,
                              &t->evaluations, &t->backward,      &t->worst_wrong,
                              &t->worst_other, &t->worst_refused, &t->worst_not_converged,
                              &t->worst_P,     &t->worst_line,    &t->c,
                              &t->worst_c};
    memcpy(list, all, sizeof all);
}

static void totals_clear(totals *t) {
    extreme *list[EXTREMES];
    memset(t, 0, sizeof *t);
    extreme_clear(&t->worst_apart);
    for (int k = 0; k < SOLVERS; k++) {
        tally_extremes(&t->solver[k], list);
        for (int i = 0; i < EXTREMES; i++) extreme_clear(list[i]);
    }
}

static void totals_merge(totals *into, totals *from) {
    extreme *to[EXTREMES], *of[EXTREMES];
    for (int k = 0; k < SOLVERS; k++) {
        tally *a = &into->solver[k], *b = &from->solver[k];
        a->states += b->states;
        a->right += b->right;
        a->other_root += b->other_root;
        a->ill += b->ill;
        a->wrong += b->wrong;
        a->not_converged += b->not_converged;
        a->refused += b->refused;
        a->P_off += b->P_off;
        a->c_off += b->c_off;
        a->c_seen += b->c_seen;
        a->wrong_line += b->wrong_line;
        a->long_ones += b->long_ones;
        tally_extremes(a, to);
        tally_extremes(b, of);
        for (int i = 0; i < EXTREMES; i++) extreme_merge(to[i], of[i]);
    }
    into->apart += from->apart;
    extreme_merge(&into->worst_apart, &from->worst_apart);
}

/* ---- judging one state ----------------------------------------------------------------------- */

typedef struct answer {
    sphpa_palpha_solution out;
    sphpa_result result;
    bool asked;
} answer;

/* what the judge said of an answer */
typedef struct finding {
    ref_verdict verdict;
    long double error, backward, reach, P_error, P_allowed;
    long double c_error; /* negative: not looked at */
    bool well; /* well-conditioned: 16 eps cond <= tol */
} finding;

/* is the P of an answer that of its alpha, or of one within the tolerance? Where its own slope says
   no, a cut-off may begin there: then the neighbours on both sides are asked. */
static void judge_P(const ref_problem *p, const sphpa_palpha_solution *out, long double tol,
                    finding *f) {
    long double x = ref_wide(out->alpha) - 1.0L, eps16 = 16.0L * ref_wide(DBL_EPSILON);
    long double moved = 2.0L * tol + eps16 * p->cap;
    ref_point point = ref_at(p, x);
    f->P_allowed = fabsl(point.D) * moved + eps16 * point.S;
    f->P_error = fabsl(ref_wide(out->P) - point.P);
    if (!(f->P_error >= 0.0L)) f->P_error = HUGE_VALL; /* NaN */
    if (f->P_error <= f->P_allowed) return;
    ref_point low = ref_at(p, fmaxl(x - moved, 0.0L)), high = ref_at(p, x + moved);
    f->P_allowed = fmaxl(f->P_allowed, fabsl(low.P - point.P) + eps16 * low.S);
    f->P_allowed = fmaxl(f->P_allowed, fabsl(high.P - point.P) + eps16 * high.S);
}

/* alpha and P of an answer; `known` (may be NULL) is a right answer at known_alpha: whoever is
   within reach of it has the same root, and need not look for higher ones again */
/* c is the matrix's adiabatic speed, without cut-offs. Not looked at where its floor is near, where P
   is the small rest of large terms, at the density where Tillotson has a kink, where alpha is not
   known well, and below 1e-140 kg/m3, where the square of rho_s/rho0 leaves the doubles. */
static void judge_c(const ref_problem *p, const sphpa_tillotson *mat,
                    const sphpa_palpha_solution *out, double tol, finding *f) {
    long double x = ref_wide(out->alpha) - 1.0L, rho_s = (1.0L + x) * p->rho;
    long double floor2 = 0.01L * ref_wide(mat->A) / p->rho0, excess = ref_excess(p, x);
    f->c_error = -1.0L;
    if (tol > 1e-12 || !f->well || (f->verdict != REF_RIGHT && f->verdict != REF_OTHER_ROOT)) return;
    if (!(rho_s > 1e-140L) || fabsl(excess) <= 1e-9L * p->rho0) return;
    ref_problem whole = *p;
    whole.tensile_limit = whole.eta_cut = 0.0L;
    ref_matter m = ref_matrix(&whole, rho_s, excess);
    long double c2 = m.dP_drho + (m.P / rho_s) * (m.dP_du / rho_s);
    long double slope = fabsl(m.dP_du); /* and what a difference of two pressures leaves of it */
    if (p->u > p->u_iv && p->u < p->u_cv)
        slope += ref_wide(mat->A + fabs(mat->B)) / (p->u_cv - p->u_iv);
    long double lost = (m.size / rho_s) * (fabsl(m.dP_du) / rho_s) +
                       fabsl(m.P / rho_s) * (slope / rho_s);
    if (!(c2 > 10.0L * floor2 && 1e-8L * c2 > 64.0L * ref_wide(DBL_EPSILON) * lost)) return;
    f->c_error = fabsl(ref_wide(out->c) / sqrtl(c2) - 1.0L);
    if (!(f->c_error >= 0.0L)) f->c_error = HUGE_VALL; /* NaN */
}

static finding judge(const ref_problem *p, const sphpa_palpha_solution *out, double tol,
                     const finding *known, double known_alpha) {
    finding f;
    f.verdict = ref_judge_root(p, out->alpha, tol, &f.error, &f.backward, &f.reach);
    long double x = ref_wide(out->alpha) - 1.0L;
    bool same = known != NULL && known->verdict == REF_RIGHT &&
                fabsl(ref_wide(out->alpha) - ref_wide(known_alpha)) <=
                    2.0L * (known->error + f.error + ref_wide(tol));
    if (f.verdict != REF_WRONG && !same && ref_not_largest(p, x, f.error, ref_wide(tol), f.reach))
        f.verdict = REF_OTHER_ROOT;
    f.well = f.reach <= 3.0L * ref_wide(tol);
    judge_P(p, out, ref_wide(tol), &f);
    return f;
}

static void count(tally *t, const answer *a, const finding *f, double tol, uint64_t place,
                  const stress_case *c, const stress_state *s) {
    t->states++;
    if (a->out.evaluations > MOST_EVALUATIONS) t->long_ones++;
    extreme_see(&t->evaluations, (long double)a->out.evaluations, place, c, s);
    if (a->result == SPHPA_ERROR_NOT_CONVERGED) {
        t->not_converged++;
        extreme_see(&t->worst_not_converged, fabsl(ref_wide(a->out.residual)), place, c, s);
        return;
    }
    switch (f->verdict) {
    case REF_RIGHT: t->right++; break;
    case REF_OTHER_ROOT:
        t->other_root++;
        extreme_see(&t->worst_other, 1.0L, place, c, s);
        break;
    case REF_ILL:
        t->ill++;
        extreme_see(&t->backward, f->backward, place, c, s);
        break;
    case REF_WRONG:
        t->wrong++;
        if (c->curve.elastic == SPHPA_CRUSH_HERRMANN) t->wrong_line++;
        extreme_see(c->curve.elastic == SPHPA_CRUSH_HERRMANN ? &t->worst_line : &t->worst_wrong,
                    f->error, place, c, s);
        return;
    }
    bool root = f->verdict == REF_RIGHT || f->verdict == REF_OTHER_ROOT;
    if (root) extreme_see(&t->alpha_all, f->error, place, c, s);
    if (root && f->well) extreme_see(&t->alpha, f->error / ref_wide(tol), place, c, s);
    if (f->c_error >= 0.0L) {
        t->c_seen++;
        extreme_see(&t->c, f->c_error, place, c, s);
        if (f->c_error > C_OFF) {
            t->c_off++;
            extreme_see(&t->worst_c, f->c_error, place, c, s);
        }
    }
    if (f->P_allowed > 0.0L) extreme_see(&t->P, f->P_error / f->P_allowed, place, c, s);
    if (f->P_error <= f->P_allowed) return;
    t->P_off++;
    extreme_see(&t->worst_P, f->P_error / (f->P_allowed + 1e-320L), place, c, s);
}

static bool answered(const answer *a) {
    return a->asked && (a->result == SPHPA_OK || a->result == SPHPA_ERROR_NOT_CONVERGED);
}

/* all answers to one state: crush-space first, the others are mostly the same root */
static void judge_state(totals *t, const stress_case *c, const stress_state *s,
                        const answer answers[SOLVERS], uint64_t place) {
    static const int order[SOLVERS] = {CRUSH_SPACE, BATCH, BISECTION, NEWTON, SAFE_NEWTON};
    ref_problem p = ref_make(&c->mat, &c->curve, s->rho, s->u, s->alpha_old);
    finding findings[SOLVERS], *known = NULL;
    memset(findings, 0, sizeof findings);
    double known_alpha = 0.0;
    for (int k = 0; k < SOLVERS; k++) {
        const answer *a = &answers[order[k]];
        tally *mine = &t->solver[order[k]];
        finding *f = &findings[order[k]];
        if (a->asked && !answered(a)) {
            mine->states++;
            mine->refused++;
            extreme_see(&mine->worst_refused, 1.0L, place, c, s);
        }
        if (!answered(a)) continue;
        bool same = known != NULL && order[k] == BATCH && a->out.alpha == known_alpha &&
                    a->out.P == answers[CRUSH_SPACE].out.P;
        if (same) *f = *known;
        else if (a->result == SPHPA_OK)
            *f = judge(&p, &a->out, c->opt.tol, known, known_alpha);
        if (a->result == SPHPA_OK) judge_c(&p, &c->mat, &a->out, c->opt.tol, f);
        count(mine, a, f, c->opt.tol, place, c, s);
        if (order[k] != CRUSH_SPACE || a->result != SPHPA_OK) continue;
        known = f;
        known_alpha = a->out.alpha;
    }
    if (known == NULL || answers[BATCH].result != SPHPA_OK) return;
    long double apart = fabsl(ref_wide(answers[BATCH].out.alpha) - ref_wide(known_alpha));
    if (apart <= findings[BATCH].reach) return;
    t->apart++;
    extreme_see(&t->worst_apart, apart, place, c, s);
}

/* one state; through the batch as a batch of one */
static answer ask(int solver, const stress_case *c, const stress_state *s) {
    answer a;
    memset(&a, 0, sizeof a);
    a.asked = true;
    if (solver == BATCH) {
        sphpa_palpha_stats stats;
        memset(&stats, 0, sizeof stats);
        stats.residual = &a.out.residual;
        stats.c = &a.out.c;
        a.result = sphpa_palpha_solve_batch(solver_codes[solver], &c->mat, &c->curve, 1, &s->rho,
                                            &s->u, &s->alpha_old, &c->opt, &a.out.alpha, &a.out.P,
                                            &stats);
        a.out.evaluations = stats.evaluations_max;
        return a;
    }
    a.result = sphpa_palpha_solve(solver_codes[solver], &c->mat, &c->curve, s->rho, s->u,
                                  s->alpha_old, &c->opt, &a.out);
    return a;
}

/* ---- a block of states ----------------------------------------------------------------------- */

typedef struct block {
    stress_state states[BLOCK];
    answer answers[BLOCK][SOLVERS];
    double rho[BLOCK], u[BLOCK], alpha_old[BLOCK], alpha[BLOCK], P[BLOCK], residual[BLOCK];
    double c[BLOCK];
    unsigned char status[BLOCK];
} block;

/* the block's states through the batch; it reports evaluations only as a whole */
static void ask_batch(block *b, const stress_case *c, tally *t, uint64_t first) {
    sphpa_palpha_stats stats;
    memset(&stats, 0, sizeof stats);
    stats.residual = b->residual;
    stats.c = b->c;
    stats.status = b->status;
    for (int i = 0; i < BLOCK; i++) {
        b->rho[i] = b->states[i].rho;
        b->u[i] = b->states[i].u;
        b->alpha_old[i] = b->states[i].alpha_old;
        b->alpha[i] = b->P[i] = (double)NAN;
        b->status[i] = (unsigned char)SPHPA_ERROR_STATE; /* what it leaves out counts as refused */
    }
    (void)sphpa_palpha_solve_batch(SPHPA_PALPHA_CRUSH_SPACE, &c->mat, &c->curve, BLOCK, b->rho,
                                   b->u, b->alpha_old, &c->opt, b->alpha, b->P, &stats);
    for (int i = 0; i < BLOCK; i++) {
        answer *a = &b->answers[i][BATCH];
        memset(a, 0, sizeof *a);
        a->asked = true;
        a->result = (sphpa_result)b->status[i];
        a->out.alpha = b->alpha[i];
        a->out.P = b->P[i];
        a->out.residual = b->residual[i];
        a->out.c = b->c[i];
    }
    extreme_see(&t->evaluations, (long double)stats.evaluations_max, first, c, &b->states[0]);
}

static void run_block(uint64_t seed, uint64_t number, totals *t, block *b) {
    sphpa_rng rng = sphpa_rng_seed(seed, number);
    stress_case c = stress_draw_case(&rng);
    for (int i = 0; i < BLOCK; i++) {
        b->states[i] = stress_draw_state(&rng, &c);
        for (int k = 0; k < BATCH; k++) {
            b->answers[i][k].asked = false;
            if (k == CRUSH_SPACE || i % SLOW_EVERY == 0)
                b->answers[i][k] = ask(k, &c, &b->states[i]);
        }
    }
    ask_batch(b, &c, &t->solver[BATCH], number * BLOCK);
    for (int i = 0; i < BLOCK; i++)
        judge_state(t, &c, &b->states[i], b->answers[i], number * BLOCK + (uint64_t)i);
}

static void show_progress(const char *what, double share, double *last) {
    double now = example_clock();
    if (now - *last < 5.0) return;
    *last = now;
    fprintf(stderr, "%s: %.0f %%\n", what, 100.0 * share);
}

static void run_solvers(uint64_t seed, long states, totals *all) {
    int64_t blocks = (states + BLOCK - 1) / BLOCK;
    double last = example_clock();
    totals_clear(all);
#ifdef _OPENMP
#pragma omp parallel
#endif
    {
        totals mine;
        block *b = (block *)malloc(sizeof *b);
        if (b == NULL) example_fail(1, "out of memory");
        totals_clear(&mine);
#ifdef _OPENMP
#pragma omp for schedule(dynamic, 4)
#endif
        for (int64_t number = 0; number < blocks; number++) {
            run_block(seed, (uint64_t)number, &mine, b);
#ifdef _OPENMP
            if (omp_get_thread_num() != 0) continue;
#endif
            show_progress("solvers", (double)number / (double)blocks, &last);
        }
#ifdef _OPENMP
#pragma omp critical
#endif
        totals_merge(all, &mine);
        free(b);
    }
}

/* ---- the report on the solvers --------------------------------------------------------------- */

/* unless it is the state of `shown` (may be NULL) */
static void print_worst(const char *solver, const char *what, const extreme *e,
                        const extreme *shown) {
    if (e->place == UINT64_MAX || (shown != NULL && shown->place == e->place)) return;
    printf("  %s, %s %.3Lg:\n    ", solver, what, e->value);
    stress_print_replay(stdout, &e->where, &e->state, solver);
}

static void print_count(uint64_t n, int width) {
    printf(" %*llu", width, (unsigned long long)n);
}

static void print_tally(const char *name, const tally *t) {
    printf("%-17s", name);
    print_count(t->states, 10);
    print_count(t->right, 10);
    print_count(t->other_root, 7);
    print_count(t->ill, 6);
    print_count(t->wrong, 6);
    print_count(t->wrong_line, 8);
    print_count(t->not_converged, 9);
    print_count(t->refused, 7);
    print_count(t->P_off, 5);
    print_count(t->c_off, 5);
    printf(" %5.0Lf", t->evaluations.value);
    print_count(t->long_ones, 6);
    printf(" %7.2Lf %8.1Le %7.2Lg %8.1Le %7.2Lf\n", t->alpha.value, t->alpha_all.value, t->P.value,
           t->c.value, t->backward.value);
}

static void print_solvers(const totals *all) {
    printf("%-17s %10s %10s %7s %6s %6s %8s %9s %7s %5s %5s %5s %6s %7s %8s %7s %8s %7s\n", "solver",
           "states", "right", "other", "ill", "wrong", "HERRMANN", "not conv.", "refused", "P off",
           "c off", "evals", "> 40", "err/tol", "max err", "P err", "c err", "ill ulp");
    for (int k = 0; k < SOLVERS; k++) print_tally(solver_names[k], &all->solver[k]);
    printf("HERRMANN: the share of the wrong whose curve has an elastic line.\n");
    printf("evals: the most that one state took. err/tol: largest error of alpha, in tolerances,\n"
           "where 16 eps cond is no more than one; max err: largest where right, whatever cond.\n"
           "P err: largest |P - P(alpha)| by what is allowed, |dP/dalpha| (2 tol + 16 eps alpha)\n"
           "+ 16 eps S; P off: beyond it. c err: largest relative error of c where\n"
           "it is looked at (below, in how many answers of crush-space); c off: above 1e-7.\n"
           "ill ulp: most that the inputs of an ill state had to\n"
           "move, in roundings. batch and scalar apart by more than the tolerance: %llu states\n"
           "c was looked at in %llu answers\n",
           (unsigned long long)all->apart,
           (unsigned long long)all->solver[CRUSH_SPACE].c_seen);
    printf("the worst states:\n");
    for (int k = 0; k < SOLVERS; k++) {
        const char *name = solver_names[k];
        const tally *t = &all->solver[k], *s = k == BATCH ? &all->solver[CRUSH_SPACE] : NULL;
        print_worst(name, "wrong, error", &t->worst_wrong, s ? &s->worst_wrong : NULL);
        print_worst(name, "wrong (HERRMANN), error", &t->worst_line, s ? &s->worst_line : NULL);
        if (k >= CRUSH_SPACE)
            print_worst(name, "not the largest", &t->worst_other, s ? &s->worst_other : NULL);
        print_worst(name, "refused", &t->worst_refused, s ? &s->worst_refused : NULL);
        if (k != NEWTON)
            print_worst(name, "not converged, residual", &t->worst_not_converged,
                        s ? &s->worst_not_converged : NULL);
        print_worst(name, "P off by", &t->worst_P, s ? &s->worst_P : NULL);
        print_worst(name, "c off by", &t->worst_c, s ? &s->worst_c : NULL);
        print_worst(name, "ill, roundings", &t->backward, s ? &s->backward : NULL);
        print_worst(name, "error by tol", &t->alpha, s ? &s->alpha : NULL);
        if (k != BATCH) print_worst(name, "evaluations", &t->evaluations, NULL);
    }
    print_worst("crush-space", "batch apart", &all->worst_apart, NULL);
}

/* failures of one solver, by the rules of the page above */
static uint64_t failures(int solver, const tally *t) {
    uint64_t bad = t->wrong + t->not_converged + t->refused + t->P_off + t->c_off;
    if (solver == NEWTON) return 0;
    if (solver >= CRUSH_SPACE)
        bad += t->other_root + (t->evaluations.value > (long double)MOST_EVALUATIONS);
    return bad;
}

/* ---- who judges the judge? ------------------------------------------------------------------- */

/* Planted answers: the true root and a mistake. */
typedef struct self_test {
    uint64_t true_ones, passed;      /* the root of the reference, rounded to double */
    uint64_t moved, caught;          /* by 1e-11 and 1e-9, where cond leaves no excuse */
    uint64_t other, told;            /* a lower root where there are several */
    uint64_t searched, missed;       /* roots above ref_largest, by a search of its own */
} self_test;

static ref_verdict verdict_on(const ref_problem *p, double alpha) {
    long double error, backward;
    return ref_judge(p, alpha, 1e-12, &error, &backward);
}

/* the lowest root, by looking at n places from the bottom */
static long double lowest_root(const ref_problem *p, int n) {
    long double below = 0.0L;
    for (int k = 1; k <= n; k++) {
        long double x = p->x_cap * (long double)k / (long double)n;
        if (ref_F(p, 1.0L + x) > 0.0L) return 1.0L + ref_bisect(p, below, x, 0.0L);
        below = x;
    }
    return p->cap;
}

/* does any of n places, evenly or densely towards the top, have F <= 0 above the root? */
static bool higher_root(const ref_problem *p, long double root, int n) {
    for (int k = 1; k <= n; k++) {
        long double share = (long double)k / (long double)n, room = p->cap - root;
        if (ref_F(p, root + room * share) < 0.0L) return true;
        if (ref_F(p, p->cap - room * powl(1e-9L, share)) < 0.0L) return true;
    }
    return false;
}

/* cond with the slope that excuses most: of the place or of the chord */
static long double widest_cond(const ref_problem *p, double alpha) {
    ref_point point = ref_at(p, ref_wide(alpha) - 1.0L);
    return fmaxl(ref_cond_of(p, &point, point.slope), ref_cond_of(p, &point, ref_chord(p, &point)));
}

/* dP/du jumps at u_iv and u_cv, by much where the matrix is far expanded */
static bool near_border(long double u, long double border) {
    return fabsl(u - border) <= 64.0L * ref_wide(DBL_EPSILON) * border;
}

static void plant(const ref_problem *p, self_test *t) {
    long double root = ref_largest(p);
    double alpha = (double)root;
    t->true_ones++;
    t->passed += verdict_on(p, alpha) == REF_RIGHT || verdict_on(p, alpha) == REF_ILL;
    bool border = near_border(p->u, p->u_iv) || near_border(p->u, p->u_cv);
    if (border || widest_cond(p, alpha) > 1e8L) return; /* rounding alone moves such a root */
    if (!ref_rises(p, 0.0L, p->x_cap)) {
        t->searched++;
        t->missed += root < p->cap && higher_root(p, root + 1e-15L * root, 64);
        long double low = lowest_root(p, 64);
        if (root - low < 1e-3L * p->x_cap || !(p->x_cap > 1e-6L)) return;
        if (widest_cond(p, (double)low) > 1e8L) return;
        t->other++;
        t->told += verdict_on(p, (double)low) == REF_OTHER_ROOT;
        return;
    }
    long double eps16 = 16.0L * ref_wide(DBL_EPSILON);
    for (int k = 0; k < 4; k++) {
        double moved = alpha + (k < 2 ? 1e-11 : 1e-9) * (k % 2 == 0 ? 1.0 : -1.0);
        long double worst = fmaxl(widest_cond(p, alpha), widest_cond(p, moved));
        if (moved < 1.0 || ref_wide(moved) > p->cap || eps16 * worst > 1e-12L) continue;
        t->moved++;
        t->caught += verdict_on(p, moved) == REF_WRONG;
    }
}

/* plants n states of answers; returns how many the judge got wrong */
static uint64_t judge_the_judge(uint64_t seed, long n) {
    self_test t;
    memset(&t, 0, sizeof t);
    sphpa_rng rng = sphpa_rng_seed(seed, 3000000000u);
    for (long i = 0; i < n; i++) {
        stress_case c = stress_draw_case(&rng);
        stress_state s = stress_draw_state(&rng, &c);
        ref_problem p = ref_make(&c.mat, &c.curve, s.rho, s.u, s.alpha_old);
        plant(&p, &t);
    }
    printf("the judge: passed %llu of %llu true roots; caught %llu of %llu moved by 1e-11 or 1e-9; "
           "told %llu of %llu other roots; missed %llu of %llu largest\n",
           (unsigned long long)t.passed, (unsigned long long)t.true_ones,
           (unsigned long long)t.caught, (unsigned long long)t.moved,
           (unsigned long long)t.told, (unsigned long long)t.other,
           (unsigned long long)t.missed, (unsigned long long)t.searched);
    return t.true_ones - t.passed + t.moved - t.caught + t.other - t.told + t.missed;
}

/* ---- one state, from the command line -------------------------------------------------------- */

typedef struct replay {
    double state[3], tol, alpha0, Pe, Pt, Ps, alpha_e, alpha_t, n1, n2, c_e, tensile_limit, eta_cut;
    const char *material;
    int curve, keep_B, herrmann, solver;
} replay;

static stress_case replay_case(const replay *r) {
    stress_case c;
    sphpa_error err;
    memset(&c, 0, sizeof c);
    const sphpa_tillotson *row = sphpa_tillotson_find(r->material);
    if (row == NULL) example_fail(2, "--material %s: unknown; basalt, nylon, ..", r->material);
    c.material = r->material;
    c.mat = *row;
    c.keep_B = r->keep_B;
    if (r->keep_B) c.mat.zero_B_expanded = 0;
    c.mat.tensile_limit = r->tensile_limit;
    c.mat.eta_cut = r->eta_cut;
    c.curve = sphpa_crush_quadratic(r->alpha0, r->Pe, r->Ps);
    if (r->curve == 1) {
        c.curve.kind = SPHPA_CRUSH_TWO_EXPONENT;
        c.curve.Pt = r->Pt;
        c.curve.alpha_e = r->alpha_e;
        c.curve.rescale = r->alpha_e > 0.0 && r->alpha_e < r->alpha0;
        c.curve.alpha_t = r->alpha_t;
        c.curve.n1 = r->n1;
        c.curve.n2 = r->n2;
    }
    c.curve.c_e = r->c_e;
    c.curve.elastic = r->herrmann ? SPHPA_CRUSH_HERRMANN : SPHPA_CRUSH_FLAT;
    if (sphpa_crush_prepare(&c.curve, c.mat.rho0, sqrt(c.mat.A / c.mat.rho0), &err) != SPHPA_OK)
        example_fail(2, "%s", err.message);
    c.opt.tol = r->tol;
    return c;
}

static void replay_answer(int solver, const stress_case *c, const stress_state *s,
                          const ref_problem *p) {
    static const char *const verdicts[4] = {"right", "other root", "ill", "WRONG"};
    answer a = ask(solver, c, s);
    if (!answered(&a)) {
        printf("%-17s refused: %s\n", solver_names[solver], sphpa_result_message(a.result));
        return;
    }
    finding f = judge(p, &a.out, c->opt.tol, NULL, 0.0);
    printf("%-17s alpha %.17g  P %.17g  residual %.3g  evaluations %d%s%s\n",
           solver_names[solver], a.out.alpha, a.out.P, a.out.residual, a.out.evaluations,
           a.out.fell_back ? "  fell back" : "",
           a.result == SPHPA_ERROR_NOT_CONVERGED ? "  NOT CONVERGED" : "");
    printf("%-17s %s: error %.3Lg, allowed %.3Lg, backward error %.3Lg roundings; P off %.3Lg, "
           "allowed %.3Lg\n",
           "", verdicts[f.verdict], f.error, f.reach, f.backward, f.P_error, f.P_allowed);
}

static void replay_run(const replay *r) {
    stress_case c = replay_case(r);
    stress_state s;
    s.rho = r->state[0];
    s.u = r->state[1];
    s.alpha_old = r->state[2];
    ref_problem p = ref_make(&c.mat, &c.curve, s.rho, s.u, s.alpha_old);
    long double root = ref_largest(&p);
    ref_point there = ref_at(&p, root - 1.0L);
    printf("reference         alpha %.21Lg  P %.21Lg  cond %.3Lg  dP/dalpha %.3Lg\n", root, there.P,
           ref_cond_of(&p, &there, there.slope), there.D);
    printf("%-17s bracket 1 to %.21Lg, P rises all over it: %s; F(1) %.3Lg, F(top) %.3Lg\n", "",
           p.cap, ref_rises(&p, 0.0L, p.x_cap) ? "yes" : "not shown", ref_F(&p, 1.0L),
           ref_F(&p, p.cap));
    for (int k = 0; k < SOLVERS; k++)
        if (r->solver == 0 || r->solver == k + 1) replay_answer(k, &c, &s, &p);
}

/* --state RHO U ALPHA_OLD becomes --state RHO,U,ALPHA_OLD: an option has one value */
static int join_state(int argc, char **argv, char *joined, size_t size) {
    for (int k = 1; k < argc; k++) {
        if (strcmp(argv[k], "--state") != 0 || k + 3 >= argc || strchr(argv[k + 1], ',') != NULL)
            continue;
        snprintf(joined, size, "%s,%s,%s", argv[k + 1], argv[k + 2], argv[k + 3]);
        argv[k + 1] = joined;
        for (int i = k + 2; i + 2 < argc; i++) argv[i] = argv[i + 2];
        return argc - 2;
    }
    return argc;
}

/* ---- the command ----------------------------------------------------------------------------- */

typedef struct settings {
    long states, seed, threads;
    int quick;
    replay one;
} settings;

static void read_command_line(int argc, char **argv, settings *set) {
    replay *r = &set->one;
    const double big = 1e300;
    const example_option options[] = {
        example_count("states", &set->states, 1, 4000000000L, "how many for crush-space"),
        example_flag("quick", &set->quick, "1e6 states"),
        example_count("seed", &set->seed, 0, 1000000000L, "of the random numbers"),
        example_count("threads", &set->threads, 0, 4096, "0: all"),
        example_vector("state", "RHO U ALPHA_OLD", r->state, 3, -big, big,
                       "[kg/m3 J/kg 1] judge this one state, with the options below"),
        example_text("material", "NAME", &r->material, "of the table"),
        example_flag("keep-B", &r->keep_B, "B counts in expansion too"),
        example_choice("curve", "quadratic|two-exponent", &r->curve, "its kind"),
        example_number("alpha0", "1", &r->alpha0, 1.0, big, "distention at rest"),
        example_number("Pe", "Pa", &r->Pe, 0.0, big, "pores begin to close"),
        example_number("Ps", "Pa", &r->Ps, 0.0, big, "pores are closed"),
        example_number("Pt", "Pa", &r->Pt, 0.0, big, "two-exponent: the knee"),
        example_number("alpha-t", "1", &r->alpha_t, 1.0, big, "two-exponent: at the knee"),
        example_number("alpha-e", "1", &r->alpha_e, 0.0, big, "two-exponent: rescaled from it"),
        example_number("n1", "1", &r->n1, 1.0, big, "two-exponent"),
        example_number("n2", "1", &r->n2, 1.0, big, "two-exponent"),
        example_flag("herrmann", &r->herrmann, "with the elastic branch"),
        example_number("c-e", "m/s", &r->c_e, 0.0, big, "its sound speed; 0: half the matrix'"),
        example_number("tensile-limit", "Pa", &r->tensile_limit, 0.0, big, "cut-off; 0: none"),
        example_number("eta-cut", "1", &r->eta_cut, 0.0, big, "cut-off; 0: none"),
        example_number("tol", "1", &r->tol, 0.0, 1.0, "of alpha"),
        example_choice("solver", "all|bisection|newton|safe-newton|crush-space|crush-space-batch",
                       &r->solver, "which to ask"),
    };
    example_parse(argc, argv, "the P-alpha solvers and Tillotson under stress, against long double",
                  SPHPA_VERSION, options, (int)(sizeof options / sizeof options[0]));
}

static int campaign(const settings *set) {
    static totals all;
    eos_tally eos;
    uint64_t seed = (uint64_t)set->seed, bad = 0, wrong = 0, states = 0;
    double begun = example_clock();
    if (!REF_IS_WIDE) printf("warning: long double is double here: no verdict is worth much\n");
    uint64_t judge_bad = judge_the_judge(seed, 20000), input_bad = input_run(seed, 100000);
    eos_run(seed, set->states / 10, &eos);
    uint64_t eos_bad = eos_print(&eos);
    run_solvers(seed, set->states, &all);
    print_solvers(&all);
    for (int k = 0; k < SOLVERS; k++) {
        const tally *t = &all.solver[k];
        bad += failures(k, t);
        states += t->states;
        if (k != NEWTON) wrong += t->wrong + t->P_off + t->c_off;
    }
    printf("%.1f s\n", example_clock() - begun);
    printf("stress-eos: %llu states, %llu wrong (but for newton), %llu failures, Tillotson %llu, "
           "input %llu, judge %llu\n",
           (unsigned long long)states, (unsigned long long)wrong, (unsigned long long)bad,
           (unsigned long long)eos_bad, (unsigned long long)input_bad,
           (unsigned long long)judge_bad);
    return bad + eos_bad + input_bad + judge_bad > 0 ? 1 : 0;
}

int main(int argc, char **argv) {
    settings set;
    char joined[256];
    memset(&set, 0, sizeof set);
    set.states = 10000000;
    set.seed = 1;
    set.one.material = "pumice";
    set.one.alpha0 = 4.64;
    set.one.Pe = 1e6;
    set.one.Pt = 6.8e7;
    set.one.Ps = 2.13e8;
    set.one.alpha_t = 1.9;
    set.one.n1 = 12.0;
    set.one.n2 = 3.0;
    set.one.tol = 1e-12;
    bool one = false;
    for (int i = 1; i < argc; i++)
        one = one || strcmp(argv[i], "--state") == 0 || strncmp(argv[i], "--state=", 8) == 0;
    argc = join_state(argc, argv, joined, sizeof joined);
    read_command_line(argc, argv, &set);
    (void)example_threads(set.threads);
    if (set.quick) set.states = 1000000;
    if (one) {
        const double *at = set.one.state;
        if (!(at[0] > 0.0 && at[1] >= 0.0 && at[2] >= 1.0 && at[2] <= set.one.alpha0))
            example_fail(2, "--state %g %g %g: rho must be positive, u not negative and alpha_old in "
                         "[1, alpha0 = %g]; as in --state 1000 1e4 2", at[0], at[1], at[2],
                         set.one.alpha0);
        replay_run(&set.one);
        return 0;
    }
    return campaign(&set);
}
