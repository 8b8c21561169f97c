/* bench_mixes.h: the states that the solvers are timed on.

   Each mix is one material with one crush curve: uniform and log-uniform draws from a seeded
   generator, states built so that they sit on a kink of F, and states that were recorded in an
   impact. The same seed gives the same states. */
#ifndef BENCH_MIXES_H
#define BENCH_MIXES_H

typedef enum bench_mix_kind {
    BENCH_HOT = 0, /* rho 300..3000 of pumice, u to 1e7, alpha_old anywhere */
    BENCH_INSIDE,  /* those of them whose root lies strictly between 1 and alpha_old */
    BENCH_COLD,    /* the matrix within 5 % of rho0, u below 1e4, root inside */
    BENCH_EXTREME, /* rho 1e-3..3e4, u 1e-3..1e13, log-uniform */
    BENCH_KINKS,   /* P within 1e-12 of Pe, of Ps, of the curve at alpha_old */
    BENCH_RECORDED /* of an impact */
} bench_mix_kind;

typedef struct bench_mix {
    bench_mix_kind kind;
    char name[16], material[32], curve_name[32];
    sphpa_crush curve;
    bench_set set;
} bench_mix;

enum { BENCH_TRIES = 100000 }; /* draws for one state */

static double *bench_doubles(size_t n) {
    double *values = (double *)malloc((n + 1) * sizeof *values);
    if (values == NULL) example_fail(1, "out of memory; give a smaller --n");
    return values;
}

static void bench_set_make(bench_set *set, size_t n) {
    set->n = n;
    set->rho = bench_doubles(n);
    set->u = bench_doubles(n);
    set->alpha_old = bench_doubles(n);
}

static void bench_set_free(bench_set *set) {
    free(set->rho);
    free(set->u);
    free(set->alpha_old);
    memset(set, 0, sizeof *set);
}

/* ---- one state ------------------------------------------------------------------------------- */

static double bench_between(sphpa_rng *rng, double low, double high) {
    return low + (high - low) * sphpa_rng_uniform(rng);
}
static double bench_log_between(sphpa_rng *rng, double low, double high) {
    return low * pow(high / low, sphpa_rng_uniform(rng));
}

/* is the root strictly between 1 and alpha_old? */
static bool bench_is_inside(bench_problem *problem) {
    bench_point lo, hi, x;
    return !bench_ends(problem, &lo, &hi, &x);
}

static void bench_draw_hot(sphpa_rng *rng, bench_problem *p) {
    double share = p->matrix->rho0 / 2327.0; /* of pumice's densities; others have their own rho0 */
    p->rho = bench_between(rng, 300.0, 3000.0) * share;
    p->u = bench_between(rng, 0.0, 1e7);
    p->alpha_old = bench_between(rng, 1.0, p->curve->alpha0);
}

static void bench_draw_cold(sphpa_rng *rng, bench_problem *p) {
    p->alpha_old = bench_between(rng, 1.0, p->curve->alpha0);
    p->rho = p->matrix->rho0 * bench_between(rng, 0.95, 1.05) / p->alpha_old;
    p->u = bench_between(rng, 0.0, 1e4);
}

static void bench_draw_extreme(sphpa_rng *rng, bench_problem *p) {
    p->rho = bench_log_between(rng, 1e-3, 3e4);
    p->u = bench_log_between(rng, 1e-3, 1e13);
    p->alpha_old = bench_between(rng, 1.0, p->curve->alpha0);
}

/* The density, then the last digits by the energy (P is so steep in rho that neighbouring doubles
   differ by more than 1e-12), such that P at `alpha` is `target`. False: not within 1e-12. */
static bool bench_aim(bench_problem *p, double alpha, double target) {
    double *const knob[2] = {&p->rho, &p->u};
    for (int k = 0; k < 2; k++) {
        double low = k == 0 ? 0.5 * p->matrix->rho0 / alpha : 0.999 * p->u;
        double high = k == 0 ? 2.0 * p->matrix->rho0 / alpha : 1.001 * p->u;
        for (int halving = 0; halving < 60; halving++) {
            *knob[k] = 0.5 * (low + high);
            *(bench_at(p, alpha).P < target ? &low : &high) = *knob[k];
        }
    }
    return fabs(bench_at(p, alpha).P - target) <= 1e-12 * target;
}

/* a third each: virgin material at Pe; fully compacted at Ps; crushed before, back at its curve */
static bool bench_draw_kink(sphpa_rng *rng, bench_problem *p) {
    const sphpa_crush *curve = p->curve;
    uint32_t which = sphpa_rng_below(rng, 3);
    double aside = 1.0 + 0.9e-12 * bench_between(rng, -1.0, 1.0);
    p->alpha_old = which == 0 ? curve->alpha0 : bench_between(rng, 1.0, curve->alpha0);
    p->u = bench_log_between(rng, 1e2, 1e6);
    if (which == 0) return bench_aim(p, p->alpha_old, curve->Pe * aside);
    if (which == 1) return bench_aim(p, 1.0, curve->Ps * aside);
    return bench_aim(p, p->alpha_old, sphpa_crush_yield(curve, p->alpha_old) * aside);
}

static bool bench_draw_state(bench_mix_kind kind, sphpa_rng *rng, bench_problem *p) {
    switch (kind) {
    case BENCH_HOT: bench_draw_hot(rng, p); return true;
    case BENCH_INSIDE: bench_draw_hot(rng, p); return bench_is_inside(p);
    case BENCH_COLD: bench_draw_cold(rng, p); return bench_is_inside(p);
    case BENCH_EXTREME: bench_draw_extreme(rng, p); return true;
    case BENCH_KINKS: return bench_draw_kink(rng, p);
    default: return false;
    }
}

/* ---- states of an impact --------------------------------------------------------------------- */

/* one line of the head, "# key value": takes what it knows */
static void bench_read_head(const char *line, bench_mix *mix) {
    char key[32], word[32];
    if (sscanf(line, "# %31s %31s", key, word) != 2) return;
    double value = strtod(word, NULL);
    sphpa_crush *curve = &mix->curve;
    if (strcmp(key, "material") == 0) snprintf(mix->material, sizeof mix->material, "%s", word);
    if (strcmp(key, "curve") == 0) {
        snprintf(mix->curve_name, sizeof mix->curve_name, "%s", word);
        curve->kind = strcmp(word, "two-exponent") == 0 ? SPHPA_CRUSH_TWO_EXPONENT
                                                        : SPHPA_CRUSH_QUADRATIC;
    }
    const struct {
        const char *name;
        double *place;
    } number[] = {{"alpha0", &curve->alpha0},   {"Pe", &curve->Pe}, {"Pt", &curve->Pt},
                  {"Ps", &curve->Ps},           {"n1", &curve->n1}, {"n2", &curve->n2},
                  {"alpha_e", &curve->alpha_e}, {"alpha_t", &curve->alpha_t}};
    for (size_t k = 0; k < sizeof number / sizeof number[0]; k++)
        if (strcmp(key, number[k].name) == 0) *number[k].place = value;
}

static bool bench_is_state(const double state[3], double alpha0) {
    return state[0] > 0.0 && state[0] <= DBL_MAX && state[1] >= 0.0 && state[1] <= DBL_MAX &&
           state[2] >= 1.0 && state[2] <= alpha0;
}

/* reads the file that pumice_impact --record-states wrote; n states of it, drawn without order */
static void bench_read_states(const char *path, size_t n, sphpa_rng *rng, bench_mix *mix) {
    char line[256];
    size_t seen = 0;
    long number = 0; /* of the line */
    FILE *file = fopen(path, "r");
    if (file == NULL)
        example_fail(1, "--states %s: %s; make it with pumice_impact --record-states %s, or leave "
                     "--states out", path, strerror(errno), path);
    bench_set_make(&mix->set, n);
    while (fgets(line, sizeof line, file) != NULL) {
        double state[3];
        int end = 0;
        line[strcspn(line, "\r\n")] = '\0';
        number++;
        if (line[0] == '#') bench_read_head(line, mix);
        else if (sscanf(line, "%lf %lf %lf %n", &state[0], &state[1], &state[2], &end) == 3 &&
                 line[end] == '\0' && bench_is_state(state, mix->curve.alpha0)) {
            /* each line of the file is kept with the same chance */
            size_t at = seen < n ? seen : sphpa_rng_below(rng, (uint32_t)seen + 1);
            seen++;
            if (at >= n) continue;
            mix->set.rho[at] = state[0];
            mix->set.u[at] = state[1];
            mix->set.alpha_old[at] = state[2];
        } else {
            example_fail(1, "--states %s, line %ld: \"%.60s\" is no state; write rho > 0, u >= 0 and "
                         "alpha_old in [1, alpha0 = %g] of the head, or record it again", path,
                         number, line, mix->curve.alpha0);
        }
    }
    fclose(file);
    if (seen < mix->set.n) mix->set.n = seen;
    if (seen == 0) example_fail(1, "--states %s: it holds no state", path);
    if (sphpa_tillotson_find(mix->material) == NULL)
        example_fail(1, "--states %s: its head names the material \"%s\", which the table has not; "
                     "record it again", path, mix->material);
    sphpa_error err;
    if (sphpa_crush_check(&mix->curve, &err) != SPHPA_OK)
        example_fail(1, "--states %s: the curve of its head: %s; record it again", path, err.message);
}

/* ---- all of them ----------------------------------------------------------------------------- */

/* what is known of a mix before its states are drawn */
typedef struct bench_plan {
    bench_mix_kind kind;
    const char *name, *material, *curve;
} bench_plan;

static const bench_plan bench_plans[] = {
    {BENCH_RECORDED, "run", "pumice", "two-exponent"},
    {BENCH_HOT, "hot", "pumice", "quadratic"},
    {BENCH_INSIDE, "inside", "pumice", "quadratic"},
    {BENCH_COLD, "cold", "pumice", "quadratic"},
    {BENCH_EXTREME, "extreme", "pumice", "quadratic"},
    {BENCH_KINKS, "kinks", "pumice", "quadratic"},
    {BENCH_HOT, "hot", "pumice", "two-exponent"},
    {BENCH_INSIDE, "inside", "pumice", "two-exponent"},
    {BENCH_COLD, "cold", "pumice", "two-exponent"},
    {BENCH_KINKS, "kinks", "pumice", "two-exponent"},
    {BENCH_INSIDE, "inside", "nylon", "quadratic"},
    {BENCH_EXTREME, "extreme", "nylon", "quadratic"},
    {BENCH_INSIDE, "inside", "ice", "quadratic"},
    {BENCH_EXTREME, "extreme", "ice", "quadratic"},
    {BENCH_INSIDE, "inside", "aluminium", "quadratic"},
    {BENCH_EXTREME, "extreme", "aluminium", "quadratic"},
};
enum { BENCH_PLANS = sizeof bench_plans / sizeof bench_plans[0] };

/* The curve of a plan. No source has one of porous nylon or ice: they get the pumice's numbers. */
static sphpa_crush bench_curve_of(const bench_plan *plan) {
    if (strcmp(plan->material, "aluminium") == 0) return sphpa_crush_porous_aluminium();
    if (strcmp(plan->curve, "two-exponent") == 0) return sphpa_crush_pumice();
    return sphpa_crush_quadratic(3.3, 1e6, 2.13e8);
}

static void bench_fill(bench_mix *mix, size_t n, sphpa_rng *rng) {
    bench_set_make(&mix->set, n);
    bench_problem problem = bench_open(&mix->set, 1e-12);
    for (size_t i = 0; i < n; i++) {
        int tries = 0;
        while (!bench_draw_state(mix->kind, rng, &problem))
            if (++tries == BENCH_TRIES)
                example_fail(1, "mix %s of %s: no state found in %d draws", mix->name,
                             mix->material, (int)BENCH_TRIES);
        mix->set.rho[i] = problem.rho;
        mix->set.u[i] = problem.u;
        mix->set.alpha_old[i] = problem.alpha_old;
    }
}

/* plan k with its states; each has a stream of its own, so that --filter does not change them */
static void bench_mix_make(bench_mix *mix, int k, size_t n, uint64_t seed, const char *states) {
    const bench_plan *plan = &bench_plans[k];
    sphpa_rng rng = sphpa_rng_seed(seed, (uint64_t)k);
    memset(mix, 0, sizeof *mix);
    mix->kind = plan->kind;
    snprintf(mix->name, sizeof mix->name, "%s", plan->name);
    snprintf(mix->material, sizeof mix->material, "%s", plan->material);
    snprintf(mix->curve_name, sizeof mix->curve_name, "%s", plan->curve);
    if (plan->kind != BENCH_RECORDED) mix->curve = bench_curve_of(plan);
    mix->set.curve = &mix->curve;
    mix->set.matrix = sphpa_tillotson_find(mix->material);
    if (plan->kind != BENCH_RECORDED) bench_fill(mix, n, &rng);
    else bench_read_states(states, n, &rng, mix);
    mix->set.matrix = sphpa_tillotson_find(mix->material); /* a file may say another */
}

#endif
