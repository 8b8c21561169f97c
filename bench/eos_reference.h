/* eos_reference.h: the P-alpha problem once more, in long double, to judge solvers by.

   It shares no arithmetic with sphpa.h, only its public structs; include it after sphpa.h.

     ref_problem p = ref_make(&material, &curve, rho, u, alpha_old);
     long double root = ref_largest(&p);                          the answer
     ref_verdict v = ref_judge(&p, alpha, 1e-12, &error, &backward);   of an answer

   Everything inside is a function of x = alpha - 1, so that a bracket of 1e-12 keeps its digits. A
   long double of 64 bits (x86) rounds 2048 times finer than a double and reaches down to 1e-4932:
   that is what the judge's margins rest on, and why there are no guards here against z^2 or
   E0 eta^2 leaving the range. Where long double is double (REF_IS_WIDE is 0) verdicts mean less.

   An answer alpha is judged by F of sphpa.h, eq. (4) of >>porosity:
     right       F changes its sign within d = 2 tol + 16 eps cond of alpha, so a root lies there
     other root  right, but a root above it stays one if the inputs move by 4 roundings
     ill         not right, but F is zero within 2 tol of alpha for inputs moved by 4 roundings
     wrong       none of these
   cond is what a relative change of one of everything that a double program must round would move
   the root by: alpha itself, and the pressure by
     S = (|rho_s dPeos/drho_s| + |u dPeos/du| + the sum of the sizes of Peos' terms)/alpha,
   the first two for rho and u, the third for what is rounded on the way (a term under an
   exponential counts 1 + alpha z^2 + beta z times: so much does the exponential magnify the
   rounding of its argument). P moves the root by |T'|/F', T(P) the alpha that P asks for. Two
   things keep cond honest. Where F' < 1/2 (P falls with alpha) 1/2 is taken, for the root of a
   dip moves like a square root and not like 1/F'. And T' jumps at the curve's kinks: where an
   answer fails with the slope at its own place, the steeper chord of T from P to P +- 16 eps S is
   taken, which sees a kink that rounding reaches, and no other. */
#ifndef EOS_REFERENCE_H
#define EOS_REFERENCE_H

#include <float.h>
#include <math.h>
#include <stdbool.h>

#define REF_IS_WIDE (LDBL_MANT_DIG > DBL_MANT_DIG)

typedef struct ref_problem {
    long double rho0, A, B, E0, u_iv, u_cv, a, b, alpha, beta; /* Tillotson's */
    long double tensile_limit, eta_cut;
    long double Pe, Pt, Ps, k1, k2, n1, n2; /* the curve: x = k1 q^n1 + k2 t^n2 */
    long double x0, x_top;                  /* x at rest, and where the curve begins */
    long double K0, k;                      /* HERRMANN: hh = 1 + k x */
    long double rho, u, x_old;              /* the state */
    long double x_y, Py;                    /* where the state's elastic branch ends on the curve */
    long double x_cap;                      /* top of the bracket */
    long double cap;                        /* the same as alpha, 1 + x_cap */
    bool zero_B_expanded, herrmann;
} ref_problem;

typedef enum ref_verdict { REF_RIGHT, REF_OTHER_ROOT, REF_ILL, REF_WRONG } ref_verdict;

static inline long double ref_wide(double x) { return (long double)x; }

/* ---- Tillotson ------------------------------------------------------------------------------- */

/* Peos at one rho_s, its slopes, and the size of what is added up in it */
typedef struct ref_matter {
    long double P, dP_drho, dP_du, size;
} ref_matter;

/* rho_s - rho0 without the cancellation that alpha rho - rho0 has next to alpha = 1 */
static inline long double ref_excess(const ref_problem *p, long double x) {
    return (p->rho - p->rho0) + x * p->rho;
}

static inline long double ref_inverse_w(const ref_problem *p, long double eta) {
    long double q = p->E0 * eta * eta;
    return q / (q + p->u);
}

static inline ref_matter ref_cold(const ref_problem *p, long double rho_s, long double excess) {
    long double eta = rho_s / p->rho0, mu = excess / p->rho0, f = ref_inverse_w(p, eta);
    long double B = p->zero_B_expanded && excess < 0.0L ? 0.0L : p->B;
    long double gas = p->a * rho_s * p->u, hot = p->b * f * rho_s * p->u;
    ref_matter m;
    m.P = gas + hot + p->A * mu + B * mu * mu;
    m.size = gas + hot + fabsl(p->A * mu) + fabsl(B * mu * mu);
    m.dP_drho = p->u * (p->a + p->b * f * (3.0L - 2.0L * f)) + (p->A + 2.0L * B * mu) / p->rho0;
    m.dP_du = rho_s * (p->a + p->b * f * f);
    return m;
}

static inline ref_matter ref_vapour(const ref_problem *p, long double rho_s, long double excess) {
    long double z = -excess / rho_s, mu = excess / p->rho0, decay = p->alpha * z * z;
    ref_matter m = {p->a * rho_s * p->u, p->a * p->u, p->a * rho_s, p->a * rho_s * p->u};
    if (decay > 11300.0L) return m; /* below the smallest long double */
    long double f = ref_inverse_w(p, rho_s / p->rho0), hot = p->b * f * rho_s * p->u;
    long double Ea = expl(-decay), Eb = expl(-p->beta * z), cold = p->A * mu * Eb;
    long double dz = -(1.0L + z) / rho_s, dcold = p->A * Eb * (1.0L / p->rho0 - p->beta * mu * dz);
    m.P += Ea * (hot + cold);
    m.size += Ea * (hot + fabsl(cold)) * (1.0L + decay + p->beta * z);
    m.dP_drho += Ea * (p->b * f * (3.0L - 2.0L * f) * p->u + dcold -
                       2.0L * p->alpha * z * dz * (hot + cold));
    m.dP_du += Ea * p->b * f * f * rho_s;
    return m;
}

/* eqs. (1) to (7) of >>eos, then the cut-offs (9) */
static inline ref_matter ref_matrix(const ref_problem *p, long double rho_s, long double excess) {
    ref_matter m;
    if (excess >= 0.0L || p->u <= p->u_iv) {
        m = ref_cold(p, rho_s, excess);
    } else if (p->u >= p->u_cv) {
        m = ref_vapour(p, rho_s, excess);
    } else {
        ref_matter v = ref_vapour(p, rho_s, excess), c = ref_cold(p, rho_s, excess);
        long double t = (p->u - p->u_iv) / (p->u_cv - p->u_iv);
        long double s = (p->u_cv - p->u) / (p->u_cv - p->u_iv);
        m.P = t * v.P + s * c.P;
        m.size = t * v.size + s * c.size;
        m.dP_drho = t * v.dP_drho + s * c.dP_drho;
        m.dP_du = t * v.dP_du + s * c.dP_du + (v.P - c.P) / (p->u_cv - p->u_iv);
    }
    long double lowest = p->tensile_limit > 0.0L ? -p->tensile_limit : -HUGE_VALL;
    if (rho_s < p->eta_cut * p->rho0) lowest = 0.0L;
    if (m.P < 0.0L && m.P < lowest) {
        if (m.P + 64.0L * ref_wide(DBL_EPSILON) * m.size < lowest) m.size = -lowest; /* exact */
        m.P = lowest;
        m.dP_drho = m.dP_du = 0.0L;
    }
    return m;
}

/* ---- crush curves ---------------------------------------------------------------------------- */

/* y^n and *slope = n y^(n-1) */
static inline long double ref_power(long double y, long double n, long double *slope) {
    long double below = n == 2.0L ? y : n == 3.0L ? y * y : n == 1.0L ? 1.0L : powl(y, n - 1.0L);
    *slope = n * below;
    return y * below;
}

/* the curve's x at P, and *slope = dx/dP (at a kink that of the crushing side) */
static inline long double ref_curve(const ref_problem *p, long double P, long double *slope) {
    *slope = 0.0L;
    if (P < p->Pe) return p->x_top;
    if (P > p->Ps) return 0.0L;
    long double R = p->Ps - p->Pe, Rt = p->Pt - p->Pe, s1 = 0.0L, s2, first = 0.0L;
    long double second = p->k2 * ref_power((p->Ps - P) / R, p->n2, &s2);
    *slope = -p->k2 * s2 / R;
    if (P < p->Pt && p->k1 > 0.0L) {
        first = p->k1 * ref_power((p->Pt - P) / Rt, p->n1, &s1);
        *slope -= p->k1 * s1 / Rt;
    }
    return fminl(first + second, p->x_top);
}

/* the P at which the curve is at x; its lowest where x = x_top or more. Newton in a bracket by
   t = (Ps - P)/(Ps - Pe), in which the curve rises. */
static inline long double ref_yield(const ref_problem *p, long double x) {
    long double R = p->Ps - p->Pe, Rt = p->Pt - p->Pe, t0 = (p->Ps - p->Pt) / R;
    if (x >= p->x_top) return p->Pe;
    if (x <= 0.0L) return p->k2 > 0.0L ? p->Ps : p->Pt;
    long double knee = p->k2 * powl(t0, p->n2); /* x at Pt */
    if (!(p->k1 > 0.0L) || x <= knee) return p->Ps - R * powl(x / p->k2, 1.0L / p->n2);
    long double low = 0.0L, high = 1.0L, q = 0.5L; /* in q, which does not care how small Rt is */
    for (int k = 0; k < 200; k++) {
        long double t = t0 + q * (Rt / R);
        long double miss = p->k1 * powl(q, p->n1) + p->k2 * powl(t, p->n2) - x;
        long double slope = p->k1 * p->n1 * powl(q, p->n1 - 1.0L) +
                            p->k2 * p->n2 * powl(t, p->n2 - 1.0L) * (Rt / R);
        if (miss > 0.0L) high = q;
        else low = q;
        long double next = q - miss / slope;
        if (!(next > low && next < high) || k > 60) next = 0.5L * (low + high);
        if (!(next > low && next < high) || fabsl(next - q) <= 2.0L * LDBL_EPSILON * q) break;
        q = next;
    }
    return p->Pt - Rt * q;
}

/* HERRMANN: P at x less P at `from` on one elastic line, the integral of
     dP/dx = K0 (1 + k x)^2/((1 + x)^2 k x (2 + k x)) = K0/(1+x)^2 (1 + (1/x - k/(2 + k x))/(2 k)),
   each logarithm that of a ratio next to 1; and *slope = dx/dP at x */
static inline long double ref_line(const ref_problem *p, long double from, long double x,
                                   long double *slope) {
    long double k = p->k, c = 2.0L - k, step = x - from, hh = 1.0L + k * x;
    long double ly = log1pl(step / (1.0L + from)), lx = log1pl(step / from);
    long double lk = log1pl(k * step / (2.0L + k * from));
    long double inv = -step / ((1.0L + x) * (1.0L + from)); /* of 1/(1+x) */
    long double one = lx - ly + inv;                         /* of 1/(x (1+x)^2) */
    long double two = -k / c * inv + k * k / (c * c) * (lk - ly);
    *slope = (1.0L + x) * (1.0L + x) * k * x * (2.0L + k * x) / (p->K0 * hh * hh);
    return p->K0 * (-inv + (one - two) / (2.0L * k));
}

/* HERRMANN: the x >= x_y of the state's line at P <= Py, no more than `high` */
static inline long double ref_line_at(const ref_problem *p, long double P, long double high) {
    long double low = p->x_y, x = low, slope;
    if (ref_line(p, p->x_y, high, &slope) > P - p->Py) return high;
    for (int k = 0; k < 200; k++) {
        long double miss = ref_line(p, p->x_y, x, &slope) - (P - p->Py); /* falls with x */
        if (miss > 0.0L) low = x;
        else high = x;
        long double next = x - miss * slope;
        if (!(next > low && next < high) || k > 60) next = 0.5L * (low + high);
        if (fabsl(next - x) <= 2.0L * LDBL_EPSILON * x || !(next > low && next < high)) return next;
        x = next;
    }
    return x;
}

/* ---- the problem ----------------------------------------------------------------------------- */

static inline void ref_set_state(ref_problem *p, long double rho, long double u,
                                 long double x_old) {
    p->rho = rho;
    p->u = u;
    p->x_old = p->x_y = p->x_cap = fminl(fmaxl(x_old, 0.0L), p->x0);
    p->Py = p->Pe;
    if (p->herrmann && p->x_old > 0.0L) {
        p->x_y = fminl(p->x_old, p->x_top);
        p->Py = ref_yield(p, p->x_y);
        p->x_cap = p->x_old >= p->x_top ? p->x0 : ref_line_at(p, 0.0L, p->x0);
    }
    p->cap = 1.0L + p->x_cap;
}

static inline void ref_set_material(ref_problem *p, const sphpa_tillotson *m) {
    p->rho0 = ref_wide(m->rho0);
    p->A = ref_wide(m->A);
    p->B = ref_wide(m->B);
    p->E0 = ref_wide(m->E0);
    p->u_iv = ref_wide(m->u_iv);
    p->u_cv = ref_wide(m->u_cv);
    p->a = ref_wide(m->a);
    p->b = ref_wide(m->b);
    p->alpha = ref_wide(m->alpha);
    p->beta = ref_wide(m->beta);
    p->tensile_limit = ref_wide(m->tensile_limit);
    p->eta_cut = ref_wide(m->eta_cut);
    p->zero_B_expanded = m->zero_B_expanded != 0;
}

/* HERRMANN's top is taken as sphpa_crush_prepare left it: it is part of the input of a solve */
static inline void ref_set_curve(ref_problem *p, const sphpa_crush *c) {
    p->x0 = p->x_top = ref_wide(c->alpha0) - 1.0L;
    p->herrmann = c->elastic == SPHPA_CRUSH_HERRMANN && p->x0 > 0.0L;
    p->K0 = p->k = 0.0L;
    if (p->herrmann) {
        long double c_e = c->c_e > 0.0 ? ref_wide(c->c_e) : 0.5L * ref_wide(c->c_s);
        p->K0 = ref_wide(c->K0);
        p->k = (c_e / ref_wide(c->c_s) - 1.0L) / p->x0;
        p->x_top = ref_wide(c->alpha_y) - 1.0L;
    }
    p->Pe = p->Pt = ref_wide(c->Pe);
    p->Ps = ref_wide(c->Ps);
    p->k1 = 0.0L;
    p->k2 = p->x_top;
    p->n1 = 1.0L;
    p->n2 = 2.0L;
    if (c->kind != SPHPA_CRUSH_TWO_EXPONENT) return;
    long double x_e = (c->alpha_e > 0.0 ? ref_wide(c->alpha_e) : ref_wide(c->alpha0)) - 1.0L;
    long double grow = c->rescale != 0 && x_e > 0.0L ? p->x_top / x_e : 1.0L;
    p->Pt = ref_wide(c->Pt);
    p->n1 = ref_wide(c->n1);
    p->n2 = ref_wide(c->n2);
    p->k2 = fminl(grow * (ref_wide(c->alpha_t) - 1.0L), p->x_top);
    p->k1 = p->Pt > p->Pe ? p->x_top - p->k2 : 0.0L;
}

/* A curve and material that passed their checks; QUADRATIC or TWO_EXPONENT. */
static inline ref_problem ref_make(const sphpa_tillotson *material, const sphpa_crush *curve,
                                   double rho, double u, double alpha_old) {
    ref_problem p;
    ref_set_material(&p, material);
    ref_set_curve(&p, curve);
    ref_set_state(&p, ref_wide(rho), ref_wide(u), ref_wide(alpha_old) - 1.0L);
    return p;
}

/* the x that P asks for, min(curve, alpha_old) or the elastic line; *slope = dx/dP */
static inline long double ref_target(const ref_problem *p, long double P, long double *slope) {
    *slope = 0.0L;
    if (p->herrmann && p->x_y > 0.0L && P < p->Py) {
        if (P <= 0.0L) return p->x_cap;
        long double x = ref_line_at(p, P, p->x_cap);
        (void)ref_line(p, p->x_y, x, slope);
        return x;
    }
    long double x = ref_curve(p, P, slope);
    if (x < p->x_y) return x;
    *slope = 0.0L;
    return p->x_y;
}

/* the move of an input in roundings of 1: its own size, or that of the least normal number, below
   which doubles lie evenly */
static inline long double ref_moves_by(long double input) {
    return fmaxl(input, ref_wide(DBL_MIN));
}

/* A trial alpha = 1 + x: the bulk's P, D = dP/dalpha, S of the page above, F and T' */
typedef struct ref_point {
    long double x, P, D, S, F, slope;
} ref_point;

static inline ref_point ref_at(const ref_problem *p, long double x) {
    long double alpha = 1.0L + x, rho_s = alpha * p->rho;
    ref_matter m = ref_matrix(p, rho_s, ref_excess(p, x));
    ref_point point;
    point.x = x;
    point.P = m.P / alpha;
    point.D = (p->rho * m.dP_drho - point.P) / alpha;
    point.S = (fabsl(ref_moves_by(p->rho) * alpha * m.dP_drho) +
               fabsl(ref_moves_by(p->u) * m.dP_du) + m.size) / alpha + ref_wide(DBL_MIN);
    point.F = x - ref_target(p, point.P, &point.slope);
    return point;
}

static inline long double ref_P(const ref_problem *p, long double alpha) {
    return ref_at(p, alpha - 1.0L).P;
}

static inline long double ref_F(const ref_problem *p, long double alpha) {
    return ref_at(p, alpha - 1.0L).F;
}

/* ---- the largest root ------------------------------------------------------------------------ */

/* A lower bound of the cold P over [x1, x2]. Over alpha the terms are a rho u, which is constant,
   b rho u/w, which rises, and with k = rho/rho0
     A k - 2 B k + B k^2 alpha - (A - B)/alpha,
   which has at most one turning point, at eta^2 = 1 - A/B. */
static inline long double ref_low_cold(const ref_problem *p, long double x1, long double x2) {
    long double k = p->rho / p->rho0, eta = (1.0L + x1) * k, low = HUGE_VALL;
    long double turn = p->B > p->A ? sqrtl(1.0L - p->A / p->B) / k - 1.0L : x1;
    const long double places[3] = {x1, x2, fminl(fmaxl(turn, x1), x2)};
    for (int i = 0; i < 3; i++) {
        long double excess = ref_excess(p, places[i]), mu = excess / p->rho0;
        long double B = p->zero_B_expanded && excess < 0.0L ? 0.0L : p->B;
        low = fminl(low, (p->A + B * mu) * mu / (1.0L + places[i]));
    }
    return p->rho * p->u * (p->a + p->b * ref_inverse_w(p, eta)) + low;
}

/* The z where the vapour's cold term is deepest: h = z exp(-beta z - alpha z^2) is largest where
   2 alpha z^2 + beta z = 1. */
static inline long double ref_deepest_z(const ref_problem *p) {
    return 2.0L / (p->beta + sqrtl(p->beta * p->beta + 8.0L * p->alpha));
}

/* The same of the vapour, where rho_s <= rho0: exp(-alpha z^2) b rho u/w rises with alpha, and the
   cold term is -A k h(z), which is no deeper than at the z nearest to its deepest. */
static inline long double ref_low_vapour(const ref_problem *p, long double x1, long double x2) {
    long double k = p->rho / p->rho0, eta = (1.0L + x1) * k;
    long double z1 = -ref_excess(p, x1) / ((1.0L + x1) * p->rho);
    long double z2 = fmaxl(-ref_excess(p, x2) / ((1.0L + x2) * p->rho), 0.0L);
    long double z = fminl(fmaxl(ref_deepest_z(p), z2), z1);
    long double hot = p->b * ref_inverse_w(p, eta) * expl(-p->alpha * z1 * z1);
    return p->rho * p->u * (p->a + hot) - p->A * k * z * expl(-(p->beta + p->alpha * z) * z);
}

/* P >= this everywhere in [x1, x2], which has rho_s = rho0 at most at an end */
static inline long double ref_low(const ref_problem *p, long double x1, long double x2) {
    if (ref_excess(p, x1) >= 0.0L || p->u <= p->u_iv) return ref_low_cold(p, x1, x2);
    if (p->u >= p->u_cv) return ref_low_vapour(p, x1, x2);
    long double t = (p->u - p->u_iv) / (p->u_cv - p->u_iv);
    return t * ref_low_vapour(p, x1, x2) + (1.0L - t) * ref_low_cold(p, x1, x2);
}

/* Does P rise all over [x1, x2]? Cold: see ref_low_cold. Vapour: alpha exp(alpha z^2) dP/dalpha is
     b rho u/w [2 (1 - 1/w) + 2 alpha z (1 + z)]
       + A k exp(-beta z)(1 + z)(1 - beta z - 2 alpha z^2),
   each factor taken at the end where the sum is least. */
static inline bool ref_rises(const ref_problem *p, long double x1, long double x2) {
    long double k = p->rho / p->rho0, eta1 = (1.0L + x1) * k, eta2 = (1.0L + x2) * k;
    bool expanded = ref_excess(p, x1) < 0.0L;
    long double B = p->zero_B_expanded && expanded ? 0.0L : p->B;
    bool cold = p->A + B * (eta1 * eta1 - 1.0L) >= 0.0L && p->A + B * (eta2 * eta2 - 1.0L) >= 0.0L;
    if (!expanded || p->u <= p->u_iv) return cold;
    if (p->u < p->u_cv && !cold) return false;
    long double z1 = 1.0L / eta1 - 1.0L, z2 = fmaxl(1.0L / eta2 - 1.0L, 0.0L);
    long double fall = (p->beta + 2.0L * p->alpha * z1) * z1 - 1.0L;
    if (fall <= 0.0L) return true;
    long double f1 = ref_inverse_w(p, eta1), f2 = ref_inverse_w(p, eta2);
    long double rise = p->b * f1 * p->rho * p->u *
                       (2.0L * (1.0L - f2) + 2.0L * p->alpha * z2 * (1.0L + z2));
    return rise >= p->A * k * expl(-p->beta * z2) * (1.0L + z1) * fall;
}

/* The highest interval in [from, x_cap] with F(*lo) <= 0 <= F(*hi) in which F is shown to rise, or
   which is as narrow as 1e-13 of the bracket. False: there is none, to that resolution. An interval
   is dismissed only where the bound of P shows F > 0 all over it. */
static inline bool ref_highest(const ref_problem *p, long double from, long double *lo,
                               long double *hi) {
    ref_point pile[80]; /* lower ends, the next one on top */
    long double kink = p->rho0 / p->rho - 1.0L, slope, narrow = 1e-13L * p->x_cap;
    long double above = p->x_cap;
    int depth = 1, left = 200000;
    *lo = *hi = p->x_cap;
    if (ref_at(p, above).F <= 0.0L) return true;
    pile[0] = ref_at(p, from);
    if (kink > from && kink < above) pile[depth++] = ref_at(p, kink);
    while (depth > 0) {
        long double x = pile[depth - 1].x, middle = x + 0.5L * (above - x);
        bool rises = ref_rises(p, x, above), end = above - x <= narrow || left-- == 0;
        bool clear = rises || end ? pile[depth - 1].F > 0.0L
                                  : ref_target(p, ref_low(p, x, above), &slope) < x;
        if (clear) {
            above = x;
            depth--;
        } else if (rises || end || depth == 80 || !(middle > x && middle < above)) {
            *lo = x;
            *hi = above;
            return true;
        } else {
            pile[depth++] = ref_at(p, middle);
        }
    }
    return false;
}

/* x where F changes its sign between lo and hi, to the last bit or to `width` */
static inline long double ref_bisect(const ref_problem *p, long double lo, long double hi,
                                     long double width) {
    bool rising = ref_at(p, hi).F > 0.0L;
    for (int k = 0; k < 200 && hi - lo > width; k++) {
        long double middle = lo + 0.5L * (hi - lo);
        if (!(middle > lo && middle < hi)) break;
        if ((ref_at(p, middle).F > 0.0L) == rising) hi = middle;
        else lo = middle;
    }
    return lo + 0.5L * (hi - lo);
}

/* The largest root of F on [1, cap], as alpha. */
static inline long double ref_largest(const ref_problem *p) {
    long double lo, hi;
    if (!ref_highest(p, 0.0L, &lo, &hi)) return 1.0L; /* F(1) = 0 but for rounding */
    if (hi <= lo) return 1.0L + hi;
    return 1.0L + ref_bisect(p, lo, hi, LDBL_EPSILON * (1.0L + hi) * 0.5L);
}

/* ---- the judge ------------------------------------------------------------------------------- */

/* HERRMANN: how far a relative change of 1 in alpha_old moves the state's line at x, in x */
static inline long double ref_line_moves(const ref_problem *p, const ref_point *point) {
    long double here, there, curve;
    if (!p->herrmann || !(p->x_y > 0.0L) || !(point->P < p->Py) || !(point->x > 0.0L)) return 0.0L;
    (void)ref_line(p, p->x_y, fmaxl(point->x, p->x_y), &here);
    (void)ref_line(p, p->x_y, p->x_y, &there);
    (void)ref_curve(p, p->Py, &curve);
    if (p->x_old >= p->x_top || !(curve < 0.0L)) return 0.0L;
    return fabsl(here * (1.0L / there - 1.0L / curve)) * (1.0L + p->x_y);
}

/* cond at a point, for T' = slope there */
static inline long double ref_cond_of(const ref_problem *p, const ref_point *point,
                                      long double slope) {
    long double dF = fmaxl(fabsl(1.0L - slope * point->D), 0.5L);
    long double pressure = point->S + (p->herrmann ? fabsl(p->Py) : 0.0L);
    return 1.0L + point->x + (fabsl(slope) * pressure + ref_line_moves(p, point)) / dF;
}

/* cond of the page above at alpha: a root is well-conditioned where 16 eps cond is below tol. */
static inline long double ref_cond(const ref_problem *p, long double alpha) {
    ref_point point = ref_at(p, alpha - 1.0L);
    return ref_cond_of(p, &point, point.slope);
}

/* T' as the steeper of the two chords from P to P +- 16 eps S */
static inline long double ref_chord(const ref_problem *p, const ref_point *point) {
    long double dP = 16.0L * ref_wide(DBL_EPSILON) * point->S, unused;
    long double here = point->x - point->F;
    long double up = here - ref_target(p, point->P + dP, &unused);
    long double down = ref_target(p, point->P - dP, &unused) - here;
    return -fmaxl(fmaxl(up, down), 0.0L) / dP;
}

/* Does F change its sign between the point and x? *error is then how far, by the chord, or by
   halving where the curve bends between. */
static inline bool ref_between(const ref_problem *p, const ref_point *point, long double x,
                               long double *error) {
    ref_point other = ref_at(p, x);
    if (other.F != 0.0L && (other.F > 0.0L) == (point->F > 0.0L)) return false;
    long double width = fabsl(x - point->x);
    *error = width * fabsl(point->F) / (fabsl(point->F) + fabsl(other.F));
    if (fabsl(other.slope - point->slope) <= 0.01L * fabsl(point->slope)) return true;
    long double root = ref_bisect(p, fminl(x, point->x), fmaxl(x, point->x), 1e-6L * width);
    *error = fabsl(root - point->x);
    return true;
}

/* Is a root within d of the point? *error is how far the nearest is: a large d is come to in steps,
   and first on the side on which the root of a rising F lies. */
static inline bool ref_near(const ref_problem *p, const ref_point *point, long double d,
                            long double *error) {
    long double step = fminl(d, 1e-8L);
    *error = 0.0L;
    if (point->F == 0.0L) return true;
    for (;; step = fminl(d, 100.0L * step)) {
        long double down = fmaxl(point->x - step, 0.0L);
        long double up = fmaxl(fminl(point->x + step, p->x_cap), point->x);
        bool first_down = point->F > 0.0L;
        if (ref_between(p, point, first_down ? down : up, error)) return true;
        if (ref_between(p, point, first_down ? up : down, error)) return true;
        if (step >= d) return false;
    }
}

/* the state with rho, u and alpha_old moved by so many roundings */
static inline ref_problem ref_moved(const ref_problem *p, long double rho, long double u,
                                    long double alpha_old) {
    const long double eps = ref_wide(DBL_EPSILON);
    ref_problem moved = *p;
    long double new_rho = p->rho + rho * eps * ref_moves_by(p->rho);
    if (!(new_rho > 0.0L)) new_rho = 0.5L * p->rho;
    long double new_u = fmaxl(p->u + u * eps * ref_moves_by(p->u), 0.0L);
    ref_set_state(&moved, new_rho, new_u, p->x_old + alpha_old * eps * (1.0L + p->x_old));
    return moved;
}

typedef struct ref_signs {
    bool below, zero, above; /* did F < 0, F = 0, F > 0 occur? */
} ref_signs;

/* The signs of F at x - d, x and x + d over the corners of inputs moved by m roundings: which of
   them occur? u is also left where it is: P has a kink in u at u_iv and u_cv, and may be lowest
   there. */
static inline void ref_corners(const ref_problem *p, long double x, long double d, long double m,
                               ref_signs *signs) {
    signs->below = signs->zero = signs->above = false;
    bool top = x >= p->x_cap; /* then the moved bracket's own top is meant */
    for (int corner = 0; corner < 12; corner++) {
        long double move_u = (long double)(corner % 3 - 1) * m;
        ref_problem moved = ref_moved(p, corner % 2 ? m : -m, move_u, corner < 6 ? m : -m);
        for (int side = -1; side <= 1; side++) {
            long double place = fmaxl((top ? moved.x_cap : x) + (long double)side * d, 0.0L);
            long double F = ref_at(&moved, top ? fminl(place, moved.x_cap) : place).F;
            signs->below = signs->below || F < 0.0L;
            signs->zero = signs->zero || F == 0.0L;
            signs->above = signs->above || F > 0.0L;
            if (d <= 0.0L) break;
        }
    }
}

/* Is F zero within d of x for inputs moved by no more than m roundings? */
static inline bool ref_zero_within(const ref_problem *p, long double x, long double d,
                                   long double m) {
    ref_signs signs;
    ref_corners(p, x, d, m, &signs);
    return signs.zero || (signs.below && signs.above);
}

/* The least move of the inputs, in roundings, for which F is zero within d of x: to a tenth below
   4, to a factor of 8 above, and infinite where half a million is not enough. */
static inline long double ref_backward(const ref_problem *p, long double x, long double d) {
    long double low = 0.0L, high = 4.0L;
    while (!ref_zero_within(p, x, d, high)) {
        low = high;
        high *= 8.0L;
        if (high > 1e6L) return HUGE_VALL;
    }
    for (int k = 0; k < 5 && high <= 4.0L; k++) {
        long double middle = 0.5L * (low + high);
        if (ref_zero_within(p, x, d, middle)) high = middle;
        else low = middle;
    }
    return high;
}

/* F < 0 at x, or at the top F <= 0, for all inputs moved by no more than 4 roundings? */
static inline bool ref_surely_below(const ref_problem *p, long double x) {
    ref_signs signs;
    ref_corners(p, x, 0.0L, 4.0L, &signs);
    return !signs.above && (!signs.zero || x >= p->x_cap);
}

/* Is there a root above x that stays one when the inputs move by 4 roundings? A pair that rounding
   joins and parts is none. Two places stand for what lies below the first sign change: where F is
   deepest, and where P is lowest. */
static inline bool ref_root_above(const ref_problem *p, long double x) {
    long double lo, hi;
    if (x >= p->x_cap || !ref_highest(p, x, &lo, &hi)) return false;
    ref_point deepest = ref_at(p, lo), lowest = deepest;
    long double step = lo - x;
    for (int k = 0; k < 50; k++, step *= 0.5L) {
        ref_point trial = ref_at(p, lo - step);
        if (trial.F < deepest.F) deepest = trial;
        if (trial.F < 0.0L && trial.P < lowest.P) lowest = trial;
    }
    return ref_surely_below(p, deepest.x) || ref_surely_below(p, lowest.x);
}

/* Is alpha a root, whichever? RIGHT, ILL or WRONG, and *reach = the d of the page above. */
static inline ref_verdict ref_judge_root(const ref_problem *p, double alpha, double tol,
                                         long double *error, long double *backward,
                                         long double *reach) {
    long double x = ref_wide(alpha) - 1.0L, rounding = 16.0L * ref_wide(DBL_EPSILON);
    *error = *backward = HUGE_VALL;
    *reach = 2.0L * ref_wide(tol) + rounding * p->cap;
    if (!(x >= 0.0L && x <= 2.0L * p->x_cap + *reach)) return REF_WRONG; /* or NaN */
    *backward = 0.0L;
    ref_point point = ref_at(p, x);
    *reach = 2.0L * ref_wide(tol) + rounding * ref_cond_of(p, &point, point.slope);
    if (ref_near(p, &point, *reach, error)) return REF_RIGHT;
    long double wider =
        2.0L * ref_wide(tol) + rounding * ref_cond_of(p, &point, ref_chord(p, &point));
    if (wider > *reach) {
        *reach = 1.001L * wider; /* a root that lies beyond a jump of T is reached to the digit */
        if (ref_near(p, &point, *reach, error)) return REF_RIGHT;
    }
    *error = fabsl(x - (ref_largest(p) - 1.0L)); /* a dip narrower than d hides from its ends */
    if (*error <= *reach) return REF_RIGHT;
    *backward = ref_backward(p, x, 2.0L * ref_wide(tol));
    return *backward <= 4.0L ? REF_ILL : REF_WRONG;
}

/* Is the answer at x, whose root is `error` away, not the largest? Where cond is bad d may reach
   over a dip and hide a root, so it is not d but the root that the search begins above. */
static inline bool ref_not_largest(const ref_problem *p, long double x, long double error,
                                   long double tol, long double reach) {
    if (x >= p->x_cap || ref_rises(p, fmaxl(x - reach, 0.0L), p->x_cap)) return false;
    long double near = x + 2.0L * error + 2.0L * tol + 16.0L * ref_wide(DBL_EPSILON) * (1.0L + x);
    bool beyond = near < x + reach && near < p->x_cap && ref_at(p, near).F > 0.0L;
    return ref_root_above(p, beyond ? near : x + reach);
}

/* The verdict on an answer to the tolerance tol. *error: how far the nearest root is (the largest,
   where the answer is not right). *backward: 0 where right, else by how many roundings the inputs
   must move. */
static inline ref_verdict ref_judge(const ref_problem *p, double alpha, double tol,
                                    long double *error, long double *backward) {
    long double reach;
    ref_verdict verdict = ref_judge_root(p, alpha, tol, error, backward, &reach);
    if (verdict == REF_WRONG) return verdict;
    bool lower = ref_not_largest(p, ref_wide(alpha) - 1.0L, *error, ref_wide(tol), reach);
    return lower ? REF_OTHER_ROOT : verdict;
}

#endif /* EOS_REFERENCE_H */
