/* stress_states.h: materials, crush curves and states for `make stress-eos`, drawn so that what is
   hard is common: brackets of 1e-12 and of 100, curves that are nearly a jump, alpha_old one
   rounding from an end, roots strictly inside, pressures at a kink of the curve, hot expanded
   matter, subnormal numbers. */
#ifndef STRESS_STATES_H
#define STRESS_STATES_H

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* One material, one curve and one tolerance: what a block of states shares. */
typedef struct stress_case {
    const char *material; /* a name of the table */
    sphpa_tillotson mat;
    sphpa_crush curve;
    sphpa_palpha_options opt;
    int keep_B; /* not 0: zero_B_expanded was turned off */
} stress_case;

typedef struct stress_state {
    double rho, u, alpha_old;
} stress_state;

static inline double stress_between(sphpa_rng *rng, double low, double high) {
    return low + (high - low) * sphpa_rng_uniform(rng);
}

static inline double stress_log(sphpa_rng *rng, double low10, double high10) {
    return pow(10.0, stress_between(rng, low10, high10));
}

/* the next double towards `to`, n times */
static inline double stress_nudge(double x, double to, int n) {
    for (int k = 0; k < n; k++) x = nextafter(x, to);
    return x;
}

/* ---- cases ----------------------------------------------------------------------------------- */

static inline void stress_draw_material(sphpa_rng *rng, stress_case *c) {
    size_t rows = sphpa_material_count(), kept = 0, row;
    for (row = 0; row < rows; row++) kept += sphpa_material_at(row)->eos.zero_B_expanded != 0;
    size_t pick = sphpa_rng_below(rng, (uint32_t)(rows + kept));
    c->keep_B = pick >= rows;
    for (row = 0; c->keep_B; row++)
        if (sphpa_material_at(row)->eos.zero_B_expanded != 0 && pick-- == rows) break;
    const sphpa_material *material = sphpa_material_at(c->keep_B ? row : pick);
    c->material = material->name;
    c->mat = material->eos;
    if (c->keep_B) c->mat.zero_B_expanded = 0;
    if (sphpa_rng_below(rng, 8) == 0) c->mat.tensile_limit = stress_log(rng, 5.0, 10.0);
    if (sphpa_rng_below(rng, 8) == 0) c->mat.eta_cut = stress_between(rng, 0.5, 1.0);
}

static inline double stress_draw_alpha0(sphpa_rng *rng) {
    double pick = sphpa_rng_uniform(rng);
    if (pick < 0.08) return 1.0 + 1e-12;
    if (pick < 0.25) return 1.0 + stress_log(rng, -12.0, 0.0);
    if (pick < 0.30) return 100.0;
    if (pick < 0.31) return 1.0;
    if (pick < 0.65) return stress_between(rng, 1.0, 5.0);
    return stress_log(rng, 0.0, 2.0);
}

/* kind, exponents and knee of a two-exponent curve; Pe, Ps and alpha0 are there */
static inline void stress_draw_knee(sphpa_rng *rng, sphpa_crush *curve) {
    double top = curve->alpha0, pick = sphpa_rng_uniform(rng);
    curve->kind = SPHPA_CRUSH_TWO_EXPONENT;
    if (sphpa_rng_below(rng, 6) == 0) {
        curve->rescale = 1;
        curve->alpha_e = top = stress_nudge(stress_between(rng, 1.0, top), 2.0 * top, 1);
        if (top > curve->alpha0) curve->alpha_e = top = curve->alpha0;
    }
    curve->Pt = stress_between(rng, curve->Pe, curve->Ps);
    if (pick < 0.15) curve->Pt = curve->Ps;
    else if (pick < 0.25) curve->Pt = stress_nudge(curve->Pe, curve->Ps, 1);
    pick = sphpa_rng_uniform(rng);
    curve->alpha_t = stress_between(rng, 1.0, top);
    if (pick < 0.15) curve->alpha_t = 1.0;
    else if (pick < 0.25) curve->alpha_t = top;
    if (curve->Pt <= curve->Pe) curve->alpha_t = top;
    bool whole = sphpa_rng_below(rng, 2) == 0;
    curve->n1 = whole ? 1.0 + sphpa_rng_below(rng, 12) : stress_log(rng, 0.0, 1.5);
    curve->n2 = whole ? 1.0 + sphpa_rng_below(rng, 6) : stress_log(rng, 0.0, 1.0);
}

static inline void stress_draw_curve(sphpa_rng *rng, stress_case *c) {
    double pick = sphpa_rng_uniform(rng);
    double Ps = sphpa_rng_below(rng, 2) == 0 ? stress_log(rng, 7.0, 10.0)
                                             : stress_log(rng, 0.0, 12.0);
    double Pe = 0.0;
    if (pick < 0.2) Pe = stress_nudge(Ps, 0.0, 1);
    else if (pick < 0.5) Pe = stress_between(rng, 0.0, Ps);
    else if (pick < 0.8) Pe = Ps * stress_log(rng, -8.0, 0.0);
    if (!(Pe < Ps)) Pe = 0.0;
    c->curve = sphpa_crush_quadratic(stress_draw_alpha0(rng), Pe, Ps);
    if (sphpa_rng_below(rng, 2) == 0) stress_draw_knee(rng, &c->curve);
    if (sphpa_rng_below(rng, 10) != 0) return;
    sphpa_crush with_line = c->curve; /* where the elastic line allows it */
    double c_s = sqrt(c->mat.A / c->mat.rho0);
    with_line.elastic = SPHPA_CRUSH_HERRMANN;
    with_line.c_e = sphpa_rng_below(rng, 3) == 0 ? 0.0 : c_s * stress_between(rng, 0.05, 0.95);
    if (sphpa_crush_prepare(&with_line, c->mat.rho0, c_s, NULL) == SPHPA_OK &&
        (with_line.alpha_y > 1.0 || !(with_line.alpha0 > 1.0)))
        c->curve = with_line;
}

static inline stress_case stress_draw_case(sphpa_rng *rng) {
    static const double tolerances[10] = {1e-12, 1e-12, 1e-12, 1e-12, 1e-12,
                                          1e-12, 1e-12, 1e-14, 1e-14, 1e-9};
    stress_case c;
    memset(&c, 0, sizeof c);
    stress_draw_material(rng, &c);
    stress_draw_curve(rng, &c);
    c.opt.tol = tolerances[sphpa_rng_below(rng, 10)];
    return c;
}

/* ---- states ---------------------------------------------------------------------------------- */

static inline double stress_draw_alpha_old(sphpa_rng *rng, double alpha0) {
    double pick = sphpa_rng_uniform(rng), alpha;
    if (pick < 0.06) return 1.0;
    if (pick < 0.25) return alpha0;
    if (pick < 0.30) alpha = stress_nudge(1.0, 2.0, 1);
    else if (pick < 0.35) alpha = stress_nudge(alpha0, 1.0, 1);
    else if (pick < 0.38) return alpha0 + 2.0 * DBL_EPSILON * alpha0; /* is clamped */
    else if (pick < 0.50) alpha = 1.0 + (alpha0 - 1.0) * stress_log(rng, -12.0, 0.0);
    else alpha = stress_between(rng, 1.0, alpha0);
    return fmin(fmax(alpha, 1.0), alpha0);
}

static inline double stress_draw_u(sphpa_rng *rng, const sphpa_tillotson *mat) {
    double pick = sphpa_rng_uniform(rng), edge = sphpa_rng_below(rng, 2) ? mat->u_iv : mat->u_cv;
    if (pick < 0.15) return 0.0;
    if (pick < 0.18) return 4.9406564584124654e-324 * (1.0 + sphpa_rng_below(rng, 8));
    if (pick < 0.20) return stress_log(rng, -320.0, 0.0);
    if (pick < 0.45) return stress_log(rng, 0.0, 6.5);
    if (pick < 0.50) return stress_nudge(edge, sphpa_rng_below(rng, 2) ? 0.0 : 1e14, 1);
    if (pick < 0.60) return edge * stress_between(rng, 0.9, 1.1);
    if (pick < 0.85) return mat->u_iv * stress_log(rng, 0.0, 1.5);
    return stress_log(rng, 0.0, 14.0);
}

/* the density of the matrix at which its pressure is near P, by a few steps of Newton */
static inline double stress_density_at(const sphpa_tillotson *mat, double P, double u) {
    double rho = mat->rho0 * (1.0 + fmin(fmax(P / mat->A, -0.3), 1.0)), stiff = mat->A / mat->rho0;
    for (int k = 0; k < 5; k++) {
        sphpa_eos_point point;
        if (sphpa_tillotson_eval(mat, rho, u, &point) != SPHPA_OK) return mat->rho0;
        rho -= (point.P - P) / fmax(point.dP_drho, 0.05 * stiff);
        rho = fmin(fmax(rho, 0.02 * mat->rho0), 30.0 * mat->rho0);
    }
    return rho;
}

/* a pressure on the curve: anywhere, or as near as rounding to one of its kinks */
static inline double stress_draw_P(sphpa_rng *rng, const sphpa_crush *curve, double alpha_old,
                                   bool kink) {
    if (!kink) {
        double share = sphpa_rng_uniform(rng);
        if (sphpa_rng_below(rng, 4) == 0) share = stress_log(rng, -15.0, 0.0);
        if (sphpa_rng_below(rng, 4) == 0) share = 1.0 - stress_log(rng, -15.0, 0.0);
        return curve->Pe + share * (curve->Ps - curve->Pe);
    }
    double P = curve->Pe, away = stress_log(rng, -17.0, -8.0);
    switch (sphpa_rng_below(rng, 4)) {
    case 0: P = curve->Ps; break;
    case 1: P = curve->kind == SPHPA_CRUSH_TWO_EXPONENT ? curve->Pt : curve->Pe; break;
    case 2: P = sphpa_crush_yield(curve, fmin(alpha_old, curve->alpha0)); break;
    default: break;
    }
    return P * (sphpa_rng_below(rng, 2) ? 1.0 + away : 1.0 - away);
}

static inline stress_state stress_draw_state(sphpa_rng *rng, const stress_case *c) {
    stress_state s;
    double pick = sphpa_rng_uniform(rng);
    s.alpha_old = stress_draw_alpha_old(rng, c->curve.alpha0);
    s.u = stress_draw_u(rng, &c->mat);
    double alpha = stress_between(rng, 1.0, s.alpha_old);
    if (pick < 0.60) { /* a root at alpha, strictly inside where the curve is below alpha_old */
        double P = stress_draw_P(rng, &c->curve, s.alpha_old, pick < 0.15);
        if (c->curve.alpha0 > 1.0) alpha = fmin(sphpa_crush_alpha(&c->curve, P, NULL), s.alpha_old);
        s.rho = stress_density_at(&c->mat, P * alpha, s.u) / alpha;
    } else if (pick < 0.85) { /* expanded */
        double eta = sphpa_rng_below(rng, 2) ? stress_between(rng, 0.02, 1.0)
                                             : 1.0 - stress_log(rng, -16.0, 0.0);
        s.rho = c->mat.rho0 * fmax(eta, 1e-3) / alpha;
    } else if (pick < 0.98) {
        s.rho = stress_log(rng, -10.0, 6.0);
    } else {
        s.rho = stress_log(rng, -323.0, -10.0);
    }
    return s;
}

/* ---- replay ---------------------------------------------------------------------------------- */

/* the options that bring a state back, to the last bit */
static inline void stress_print_replay(FILE *file, const stress_case *c, const stress_state *s,
                                       const char *solver) {
    const sphpa_crush *k = &c->curve;
    bool two = k->kind == SPHPA_CRUSH_TWO_EXPONENT;
    fprintf(file, "--state %.17g %.17g %.17g --material %s%s --curve %s --alpha0 %.17g",
            s->rho, s->u, s->alpha_old, c->material, c->keep_B ? " --keep-B" : "",
            two ? "two-exponent" : "quadratic", k->alpha0);
    fprintf(file, " --Pe %.17g --Ps %.17g", k->Pe, k->Ps);
    if (two)
        fprintf(file, " --Pt %.17g --alpha-t %.17g --n1 %.17g --n2 %.17g", k->Pt, k->alpha_t,
                k->n1, k->n2);
    if (k->rescale != 0) fprintf(file, " --alpha-e %.17g", k->alpha_e);
    if (k->elastic == SPHPA_CRUSH_HERRMANN) fprintf(file, " --herrmann --c-e %.17g", k->c_e);
    if (c->mat.tensile_limit > 0.0) fprintf(file, " --tensile-limit %.17g", c->mat.tensile_limit);
    if (c->mat.eta_cut > 0.0) fprintf(file, " --eta-cut %.17g", c->mat.eta_cut);
    fprintf(file, " --tol %g --solver %s\n", c->opt.tol, solver);
}

#endif /* STRESS_STATES_H */
