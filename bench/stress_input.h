/* stress_input.h: what no solver may accept, for `make stress-eos`. Each try spoils one value of a
   good call; the call must fail and leave its outputs as they were. */
#ifndef STRESS_INPUT_H
#define STRESS_INPUT_H

/* everything that one call is given */
typedef struct input_call {
    stress_case c;
    stress_state s;
    int solver;
} input_call;

static double input_not_finite(sphpa_rng *rng) {
    static const double values[3] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
    return values[sphpa_rng_below(rng, 3)];
}

/* one of the state's three values */
static const char *input_spoil_state(sphpa_rng *rng, stress_state *s, double alpha0) {
    bool finite = sphpa_rng_below(rng, 3) != 0;
    double size = stress_log(rng, -320.0, 300.0);
    switch (sphpa_rng_below(rng, 3)) {
    case 0: s->rho = finite ? -size * sphpa_rng_below(rng, 2) : input_not_finite(rng); return "rho";
    case 1: s->u = finite ? -size : input_not_finite(rng); return "u";
    default: break;
    }
    bool above = sphpa_rng_below(rng, 2) != 0; /* 6 roundings outside, or far */
    double step = sphpa_rng_below(rng, 2) ? 6.0 * DBL_EPSILON : stress_log(rng, -14.0, 3.0);
    s->alpha_old = above ? alpha0 * (1.0 + step) : 1.0 - step;
    if (!finite) s->alpha_old = input_not_finite(rng);
    return "alpha_old";
}

/* one of the curve's values, of a curve with alpha0 > 1 */
static const char *input_spoil_curve(sphpa_rng *rng, sphpa_crush *k) {
    double *all[8] = {&k->alpha0, &k->Pe, &k->Ps, &k->Pt, &k->alpha_t, &k->n1, &k->n2, &k->alpha_e};
    double *line[4] = {&k->c_e, &k->c_s, &k->K0, &k->alpha_y};
    bool two = k->kind == SPHPA_CRUSH_TWO_EXPONENT;
    if (k->elastic == SPHPA_CRUSH_HERRMANN && sphpa_rng_below(rng, 2) == 0) {
        uint32_t field = sphpa_rng_below(rng, 4);
        *line[field] = input_not_finite(rng);
        return "a value of the elastic line that is not finite";
    }
    if (sphpa_rng_below(rng, 4) == 0) {
        uint32_t field = sphpa_rng_below(rng, two ? 8 : 3); /* drawn first on every compiler */
        *all[field] = input_not_finite(rng);
        return "a value of the curve that is not finite";
    }
    switch (sphpa_rng_below(rng, two ? 8 : 4)) {
    case 0: k->Pe = k->Ps; return "Pe = Ps";
    case 1: k->Pe = -stress_log(rng, -300.0, 10.0); return "Pe < 0";
    case 2: k->alpha0 = 1.0 - stress_log(rng, -15.0, 3.0); return "alpha0 < 1";
    case 3: k->kind = (sphpa_crush_kind)(3 + (int)sphpa_rng_below(rng, 5)); return "kind";
    case 4: k->Pt = k->Ps * (1.0 + 1e-15) + 1e-300; return "Pt > Ps";
    case 5: k->alpha_t = 1.0 - stress_log(rng, -15.0, 3.0); return "alpha_t < 1";
    case 6: k->n1 = 1.0 - stress_log(rng, -15.0, 3.0); return "n1 < 1";
    default: k->alpha_e = k->alpha0 * 1.01; return "alpha_e > alpha0";
    }
}

static const char *input_spoil_material(sphpa_rng *rng, sphpa_tillotson *m) {
    static const char *const names[10] = {"rho0", "A", "B", "E0", "u_iv",
                                          "u_cv", "a", "b", "alpha", "beta"};
    double *any[10] = {&m->rho0, &m->A, &m->B, &m->E0, &m->u_iv,
                       &m->u_cv, &m->a, &m->b, &m->alpha, &m->beta};
    static const int positive[3] = {0, 1, 3};
    uint32_t field = sphpa_rng_below(rng, 10);
    switch (sphpa_rng_below(rng, 3)) {
    case 0:
        *any[positive[field % 3]] *= -(double)sphpa_rng_below(rng, 2);
        return "rho0, A or E0 <= 0";
    case 1: m->u_cv = m->u_iv * (sphpa_rng_below(rng, 2) ? 1.0 : 0.5); return "u_cv <= u_iv";
    default: *any[field] = (double)NAN;
    }
    return names[field];
}

static const char *input_spoil_options(sphpa_rng *rng, input_call *call) {
    switch (sphpa_rng_below(rng, 4)) {
    case 0: call->c.opt.tol = input_not_finite(rng); return "tol that is not finite";
    case 1: call->c.opt.tol = -stress_log(rng, -300.0, 0.0); return "tol < 0";
    case 2:
        call->c.opt.max_iterations = -1 - (int)sphpa_rng_below(rng, 100);
        return "max_iterations";
    default: call->solver = sphpa_rng_below(rng, 2) ? 4 + (int)sphpa_rng_below(rng, 9) : -1;
    }
    return "solver";
}

/* is the call refused, once alone and once among good ones, and are the outputs left alone? */
static bool input_refused(const input_call *call, const stress_state *good) {
    sphpa_palpha_solution out, before;
    memset(&before, 0x5a, sizeof before);
    out = before;
    sphpa_palpha_solver solver = (sphpa_palpha_solver)call->solver;
    sphpa_result result =
        sphpa_palpha_solve(solver, &call->c.mat, &call->c.curve, call->s.rho, call->s.u,
                           call->s.alpha_old, &call->c.opt, &out);
    if (result == SPHPA_OK || result == SPHPA_ERROR_NOT_CONVERGED) return false;
    if (memcmp(&out, &before, sizeof out) != 0) return false;
    double rho[3] = {good->rho, call->s.rho, good->rho}, u[3] = {good->u, call->s.u, good->u};
    double alpha_old[3] = {good->alpha_old, call->s.alpha_old, good->alpha_old};
    double alpha[3] = {-7.0, -7.0, -7.0}, P[3] = {-7.0, -7.0, -7.0};
    result = sphpa_palpha_solve_batch(solver, &call->c.mat, &call->c.curve, 3, rho, u, alpha_old,
                                      &call->c.opt, alpha, P, NULL);
    if (result == SPHPA_OK || result == SPHPA_ERROR_NOT_CONVERGED) return false;
    return alpha[1] == -7.0 && P[1] == -7.0;
}

/* a bad state must not hurt its neighbours in a batch */
static bool input_neighbours_kept(const input_call *call, const stress_state *good) {
    double rho[3] = {good->rho, call->s.rho, good->rho}, u[3] = {good->u, call->s.u, good->u};
    double alpha_old[3] = {good->alpha_old, call->s.alpha_old, good->alpha_old};
    double alpha[3] = {-7.0, -7.0, -7.0}, P[3];
    (void)sphpa_palpha_solve_batch(SPHPA_PALPHA_CRUSH_SPACE, &call->c.mat, &call->c.curve, 3, rho,
                                   u, alpha_old, &call->c.opt, alpha, P, NULL);
    return alpha[0] >= 1.0 && alpha[0] == alpha[2];
}

/* tries n spoiled calls; prints the first few that were accepted and returns their number */
static uint64_t input_run(uint64_t seed, long n) {
    uint64_t accepted = 0, kept = 0;
    sphpa_rng rng = sphpa_rng_seed(seed, 2000000000u);
    for (long i = 0; i < n; i++) {
        input_call call;
        call.c = stress_draw_case(&rng);
        call.s = stress_draw_state(&rng, &call.c);
        call.solver = (int)sphpa_rng_below(&rng, 4);
        stress_state good = call.s;
        const char *what;
        bool dense = !(call.c.curve.alpha0 > 1.0);
        uint32_t kind = sphpa_rng_below(&rng, 6);
        if (kind == 0 && !dense) what = input_spoil_curve(&rng, &call.c.curve);
        else if (kind == 1) what = input_spoil_material(&rng, &call.c.mat);
        else if (kind == 2) what = input_spoil_options(&rng, &call);
        else what = input_spoil_state(&rng, &call.s, call.c.curve.alpha0);
        bool state_only = kind > 2 || (kind == 0 && dense);
        bool refused = input_refused(&call, &good);
        if (state_only && !input_neighbours_kept(&call, &good)) kept++;
        if (refused) continue;
        if (accepted++ >= 2) continue;
        printf("  accepted: %s spoiled, solver %d; before that\n    ", what, call.solver);
        stress_print_replay(stdout, &call.c, &call.s, "crush-space");
    }
    printf("bad input: %ld tries, %llu accepted, %llu hurt a neighbour in the batch\n", n,
           (unsigned long long)accepted, (unsigned long long)kept);
    return accepted + kept;
}

#endif /* STRESS_INPUT_H */
