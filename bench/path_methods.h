/* path_methods.h: a particle on a prescribed path, and the ways to follow it. Included by
   path_eos.c.

   On each leg of a path rho goes from one density to the next, evenly in time, and heat comes in
   evenly. The rest follows: du = -P d(1/rho) + heat, and alpha by one of two forms,
     implicit    the largest root of alpha = min(curve(P(rho, u, alpha)), alpha at the step's start)
     evolution   dalpha/dt = [du/dt dPeos/du + alpha drho/dt dPeos/drho_s] alpha'
                             / [alpha + alpha' (P - rho dPeos/drho_s)],  alpha' = dalpha/dP */
#ifndef PATH_METHODS_H
#define PATH_METHODS_H

enum {
    PATH_LEGS = 5,
    PATH_FINEST = 100000, /* steps of the reference; all counts divide it */
    PATH_HALVINGS = 24    /* of its steps at a kink: P is told from Pt, Ps and yield there */
};
#define PATH_DALPHA 1e-2 /* the evolution form's usual limit of a step */

typedef struct path_leg {
    const char *what;
    double rho;  /* [kg/m3] at its end */
    double heat; /* [J/kg] that comes in meanwhile */
} path_leg;

typedef struct path_case {
    const char *name, *material;
    sphpa_crush curve;
    const sphpa_tillotson *matrix;
    path_leg leg[PATH_LEGS];
} path_case;

typedef struct path_state {
    double rho, u, alpha, P;
} path_state;

/* what was met on the way, at evenly spaced times; arrays of n + 1 */
typedef struct path_trace {
    int n;
    double *rho, *u, *alpha, *P;
} path_trace;

/* ---- the paths ------------------------------------------------------------------------------- */

/* The releases end where P is small and positive: in tension nothing happens to the pores. */
static void path_make_cases(path_case cases[3]) {
    const path_case all[3] = {
        {"pumice, two exponents", "pumice", sphpa_crush_pumice(), NULL,
         {{"compress", 930.0, 0.0}, {"release", 929.3, 0.0}, {"reheat", 929.3, 4e4},
          {"compress", 2300.0, 0.0}, {"release", 2286.0, 0.0}}},
        {"pumice, quadratic", "pumice", sphpa_crush_quadratic(4.64, 1e6, 2.13e8), NULL,
         {{"compress", 930.0, 0.0}, {"release", 924.0, 0.0}, {"reheat", 924.0, 8e4},
          {"compress", 2300.0, 0.0}, {"release", 2260.0, 0.0}}},
        {"aluminium, quadratic", "aluminium", sphpa_crush_porous_aluminium(), NULL,
         {{"compress", 2350.0, 0.0}, {"release", 2345.0, 0.0}, {"reheat", 2345.0, 1e5},
          {"compress", 2800.0, 0.0}, {"release", 2700.0, 0.0}}}};
    memcpy(cases, all, sizeof all);
    for (int k = 0; k < 3; k++) cases[k].matrix = sphpa_tillotson_find(cases[k].material);
}

static double path_leg_start(const path_case *c, int leg) {
    return leg > 0 ? c->leg[leg - 1].rho : c->matrix->rho0 / c->curve.alpha0;
}

/* rho at the share s of a leg */
static double path_rho(const path_case *c, int leg, double s) {
    double from = path_leg_start(c, leg);
    return s >= 1.0 ? c->leg[leg].rho : from + (c->leg[leg].rho - from) * s;
}

static path_state path_rest(const path_case *c) {
    path_state x = {path_leg_start(c, 0), 0.0, c->curve.alpha0, 0.0};
    return x;
}

static _Noreturn void path_fail(const path_case *c, const path_state *x, sphpa_result result) {
    example_fail(1, "%s at rho %.17g u %.17g alpha %.17g: %s", c->name, x->rho, x->u, x->alpha,
                 sphpa_result_message(result));
}

/* ---- the methods ----------------------------------------------------------------------------- */

typedef enum path_form {
    PATH_IMPLICIT_ONCE = 0, /* u by P at the step's start: one solve a step */
    PATH_IMPLICIT,          /* u by P of a trial in the middle, as the simulations here: two */
    PATH_EULER,
    PATH_MIDPOINT,
    PATH_HEUN
} path_form;

typedef struct path_method {
    const char *name, *colour, *rest; /* rest: how its line is drawn */
    path_form form;
    sphpa_palpha_solver solver;
    bool cut; /* evolution: a step ends where the pores begin to close, one that begins so closes
                 them to its end, and P >= Ps closes them all */
} path_method;

/* the solver of the evolution form is not asked */
static const path_method path_methods[] = {
    {"implicit, crush-space", "#0b4f9e", "pt 7 lw 2", PATH_IMPLICIT, SPHPA_PALPHA_CRUSH_SPACE, 0},
    {"implicit, bisection", "#7f7f7f", "pt 4", PATH_IMPLICIT, SPHPA_PALPHA_BISECTION, 0},
    {"implicit, safe-newton", "#3aa0e8", "pt 6", PATH_IMPLICIT, SPHPA_PALPHA_SAFE_NEWTON, 0},
    {"implicit, one solve", "#7b3fa0", "pt 5", PATH_IMPLICIT_ONCE, SPHPA_PALPHA_CRUSH_SPACE, 0},
    {"evolution, Euler", "#d55e00", "pt 8 lw 2", PATH_EULER, SPHPA_PALPHA_CRUSH_SPACE, 0},
    {"evolution, midpoint", "#2a9d4a", "pt 9", PATH_MIDPOINT, SPHPA_PALPHA_CRUSH_SPACE, 0},
    {"evolution, Heun", "#e7a13d", "pt 10", PATH_HEUN, SPHPA_PALPHA_CRUSH_SPACE, 0},
    {"evolution, Euler, cut", "#d55e00", "pt 8 dt 3", PATH_EULER, SPHPA_PALPHA_CRUSH_SPACE, 1},
    {"evolution, Heun, cut", "#e7a13d", "pt 10 dt 3", PATH_HEUN, SPHPA_PALPHA_CRUSH_SPACE, 1}};
enum { PATH_METHODS = sizeof path_methods / sizeof path_methods[0] };

static bool path_is_implicit(const path_method *m) { return m->form <= PATH_IMPLICIT; }

static void path_solve(const path_case *c, sphpa_palpha_solver solver, double alpha_old,
                       path_state *x) {
    sphpa_palpha_solution out;
    sphpa_result result = sphpa_palpha_solve(solver, c->matrix, &c->curve, x->rho, x->u, alpha_old,
                                             NULL, &out);
    if (result != SPHPA_OK) path_fail(c, x, result);
    x->alpha = out.alpha;
    x->P = out.P;
}

static void path_implicit_step(const path_case *c, const path_method *m, path_state *x, double rho,
                               double heat) {
    double v = 1.0 / x->rho, alpha_old = x->alpha, P = x->P;
    if (m->form == PATH_IMPLICIT) { /* the trial forgets its alpha: pores close once a step */
        path_state middle;
        middle.rho = 0.5 * (x->rho + rho);
        middle.u = x->u - x->P * (1.0 / middle.rho - v) + 0.5 * heat;
        path_solve(c, m->solver, alpha_old, &middle);
        P = middle.P;
    }
    x->u += heat - P * (1.0 / rho - v);
    x->rho = rho;
    path_solve(c, m->solver, alpha_old, x);
}

/* The right hand sides at one state, from one evaluation of the equation of state. */
typedef struct path_rates {
    double P, dalpha; /* [Pa] [1] a unit of time */
} path_rates;

/* What sphpa_palpha_rate does, which asks the equation of state again: a state loads that is at the
   curve, to a millionth of alpha0 - 1, or above it; pores do not open. loads: it does, wherever it
   is. A path that has gone wrong may end in tension below u = 0: the equation of state is asked at
   0, as in the simulations. */
static path_rates path_rates_at(const path_case *c, const path_state *x, double drho,
                                double heating, bool loads) {
    sphpa_eos_point point;
    path_rates r;
    sphpa_result result =
        sphpa_tillotson_eval(c->matrix, x->alpha * x->rho, fmax(x->u, 0.0), &point);
    if (result != SPHPA_OK) path_fail(c, x, result);
    r.P = point.P / x->alpha;
    r.dalpha = 0.0;
    if (!(x->alpha > 1.0) || (!loads && r.P < c->curve.Pe)) return r;
    double slope, on = sphpa_crush_alpha(&c->curve, fmax(r.P, c->curve.Pe), &slope);
    if (!loads && on > x->alpha + 1e-6 * (c->curve.alpha0 - 1.0)) return r;
    double du = r.P * drho / (x->rho * x->rho) + heating;
    double top = (du * point.dP_du + x->alpha * drho * point.dP_drho) * slope;
    r.dalpha = fmin(0.0, top / (x->alpha + slope * (r.P - x->rho * point.dP_drho)));
    return r;
}

/* x goes on to rho, after the time h, with these rates */
static void path_move(path_state *x, path_rates r, double rho, double h, double heating) {
    x->u += heating * h - r.P * (1.0 / rho - 1.0 / x->rho);
    x->alpha = fmax(1.0, x->alpha + h * r.dalpha);
    x->rho = rho;
}

/* One step of length h, that brings x to rho; `r` are the rates at its start. Heun's trial ends
   below a curve that bends upwards. To take that for unloading halves the rate, and the step ends
   above the curve by half of what it closes; so a cut step, with no yield inside, keeps loading. */
static void path_evolution_step(const path_case *c, const path_method *m, path_state *x,
                                path_rates r, double rho, double h, double heating) {
    path_state trial = *x;
    double drho = (rho - x->rho) / h;
    if (m->form == PATH_MIDPOINT) {
        path_move(&trial, r, 0.5 * (x->rho + rho), 0.5 * h, heating);
        r = path_rates_at(c, &trial, drho, heating, false);
    }
    if (m->form == PATH_HEUN) {
        path_move(&trial, r, rho, h, heating);
        bool loads = m->cut && r.dalpha < 0.0;
        path_rates end = path_rates_at(c, &trial, drho, heating, loads);
        r.P = 0.5 * (r.P + end.P);
        r.dalpha = 0.5 * (r.dalpha + end.dalpha);
    }
    path_move(x, r, rho, h, heating);
}

/* [Pa] how far an elastic step of length h from share s would end above the yield */
static double path_beyond(const path_case *c, const path_state *from, int leg, double s, double h,
                          double P, double yield, path_state *end) {
    path_rates r = {P, 0.0};
    *end = *from;
    path_move(end, r, path_rho(c, leg, s + h), h, c->leg[leg].heat);
    return path_rates_at(c, end, 0.0, 0.0, false).P - yield;
}

/* The length of an elastic step that ends where the pores begin to close; h: not before its end.
   The secant with its ends kept (Illinois), from above: there the next step loads. */
static double path_to_yield(const path_case *c, const path_state *x, int leg, double s, double h,
                            double P) {
    path_state end;
    double yield = sphpa_crush_yield(&c->curve, x->alpha), low = 0.0, high = h;
    double f_low = P - yield, f_high = path_beyond(c, x, leg, s, h, P, yield, &end);
    if (!(f_low < 0.0 && f_high > 0.0)) return h;
    for (int k = 0; k < 60 && f_high > 1e-12 * yield; k++) {
        double mid = high - f_high * (high - low) / (f_high - f_low);
        if (!(mid > low && mid < high)) break;
        double f = path_beyond(c, x, leg, s, mid, P, yield, &end);
        if (f > 0.0) {
            high = mid;
            f_high = f;
            f_low *= 0.5;
        } else {
            low = mid;
            f_low = f;
            f_high *= 0.5;
        }
    }
    return high;
}

/* from the share s of a leg to s + step, in as many steps as the limit asks for: how many */
static int path_evolve(const path_case *c, const path_method *m, int leg, double s, double step,
                       path_state *x) {
    double left = step, drho = c->leg[leg].rho - path_leg_start(c, leg), heat = c->leg[leg].heat;
    for (int count = 1;; count++) {
        path_rates r = path_rates_at(c, x, drho, heat, false);
        if (m->cut && r.P >= c->curve.Ps) x->alpha = 1.0;
        double h = left;
        if (-r.dalpha * h > PATH_DALPHA) h = -PATH_DALPHA / r.dalpha;
        if (m->cut && !(r.dalpha < 0.0) && x->alpha > 1.0)
            h = path_to_yield(c, x, leg, s + step - left, h, r.P);
        bool last = h > left * (1.0 - 1e-9);
        left = last ? 0.0 : left - h;
        path_evolution_step(c, m, x, r, path_rho(c, leg, s + step - left), h, heat);
        if (last) return count;
    }
}

static void path_note(const path_case *c, const path_trace *trace, int k, const path_state *x) {
    sphpa_eos_point point;
    trace->rho[k] = x->rho;
    trace->u[k] = x->u;
    trace->alpha[k] = x->alpha;
    trace->P[k] = x->P;
    if (!isnan(x->P)) return;
    sphpa_result result =
        sphpa_tillotson_eval(c->matrix, x->alpha * x->rho, fmax(x->u, 0.0), &point);
    if (result != SPHPA_OK) path_fail(c, x, result);
    trace->P[k] = point.P / x->alpha;
}

/* The whole path in n steps; trace may be NULL. Returns how many were made: the evolution form's
   limit adds some. */
static long path_run(const path_case *c, const path_method *m, int n, const path_trace *trace) {
    path_state x = path_rest(c);
    int each = n / PATH_LEGS;
    long count = 0;
    if (trace != NULL) path_note(c, trace, 0, &x);
    for (int k = 0; k < n; k++) {
        int leg = k / each;
        double s = (double)(k % each) / each, end = (double)(k % each + 1) / each;
        if (path_is_implicit(m)) {
            path_implicit_step(c, m, &x, path_rho(c, leg, end), c->leg[leg].heat / each);
            count++;
        } else {
            count += path_evolve(c, m, leg, s, end - s, &x);
            x.P = (double)NAN; /* it has no use for it; a trace asks */
        }
        if (trace != NULL) path_note(c, trace, k + 1, &x);
    }
    return count;
}

/* ---- the reference --------------------------------------------------------------------------- */

/* On a leg the pores close all the way or not at all, so alpha follows from rho, u and the alpha at
   the leg's start; u alone is left to integrate: Runge and Kutta's fourth order. At a kink (yield,
   Pt, Ps) the right hand side has none of the smoothness that this needs: a step that ends in
   another regime than it began in is halved until nothing is left of it. */
typedef struct path_guide {
    const path_case *c;
    int leg;
    double alpha_old; /* [1] at the leg's start */
    double yield;     /* [Pa] where pores of that size begin to close */
} path_guide;

static path_state path_on(const path_guide *g, double s, double u) {
    path_state x;
    x.rho = path_rho(g->c, g->leg, s);
    x.u = u;
    sphpa_palpha_options opt = {0};
    sphpa_palpha_solution out;
    opt.tol = 1e-15;
    sphpa_result result = sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, g->c->matrix, &g->c->curve,
                                             x.rho, u, g->alpha_old, &opt, &out);
    if (result != SPHPA_OK && result != SPHPA_ERROR_NOT_CONVERGED) path_fail(g->c, &x, result);
    x.alpha = out.alpha;
    x.P = out.P;
    return x;
}

/* du/ds; *regime: elastic, below Pt, below Ps, closed */
static double path_slope(const path_guide *g, double s, double u, int *regime) {
    path_state x = path_on(g, s, u);
    double drho = g->c->leg[g->leg].rho - path_leg_start(g->c, g->leg);
    bool knee = g->c->curve.kind == SPHPA_CRUSH_TWO_EXPONENT;
    *regime = x.P >= g->c->curve.Ps ? 3 : x.P < g->yield ? 0 : knee && x.P < g->c->curve.Pt ? 1 : 2;
    return x.P * drho / (x.rho * x.rho) + g->c->leg[g->leg].heat;
}

static double path_exact_step(const path_guide *g, double s, double h, double u, int depth) {
    int first, last, unused;
    double k1 = path_slope(g, s, u, &first);
    double k2 = path_slope(g, s + 0.5 * h, u + 0.5 * h * k1, &unused);
    double k3 = path_slope(g, s + 0.5 * h, u + 0.5 * h * k2, &unused);
    double k4 = path_slope(g, s + h, u + h * k3, &last);
    double end = u + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    if (first == last || depth == PATH_HALVINGS) return end;
    u = path_exact_step(g, s, 0.5 * h, u, depth + 1);
    return path_exact_step(g, s + 0.5 * h, 0.5 * h, u, depth + 1);
}

/* `n` points, with `finer` steps from each to the next */
static void path_reference(const path_case *c, int n, int finer, const path_trace *trace) {
    path_state x = path_rest(c);
    int each = n / PATH_LEGS;
    path_guide g = {c, 0, x.alpha, 0.0};
    path_note(c, trace, 0, &x);
    for (int k = 0; k < n; k++) {
        double h = 1.0 / ((double)each * finer);
        if (k % each == 0) {
            g.leg = k / each;
            g.alpha_old = x.alpha;
            g.yield = sphpa_crush_yield(&c->curve, x.alpha);
        }
        double u = x.u;
        for (int i = 0; i < finer; i++)
            u = path_exact_step(&g, ((double)(k % each) * finer + i) * h, h, u, 0);
        x = path_on(&g, (double)(k % each + 1) / each, u);
        path_note(c, trace, k + 1, &x);
    }
}

#endif
