/* verify_exact.h: the solutions that the problems of `make verify` are judged by: exact ones, and
   integrals of ordinary equations to (nearly) rounding. */
#ifndef VERIFY_EXACT_H
#define VERIFY_EXACT_H

#define VERIFY_PI 3.14159265358979323846

/* ---- quadrature ------------------------------------------------------------------------------ */

typedef double (*verify_integrand)(double x, void *user);

/* Integral of f over [a, b] by the double-exponential rule (Takahasi & Mori 1974): x = tanh(pi/2
   sinh t) makes the integrand vanish at both ends whatever power it has there, and the trapezoidal
   rule in t, of steps 1/fine, converges to rounding: 16 for what is smooth, 64 for the rest. */
static inline double verify_integral(verify_integrand f, void *user, double a, double b, int fine) {
    double half = 0.5 * (b - a), sum = 0.0, step = 1.0 / fine;
    for (int k = -4 * fine; k <= 4 * fine; k++) {
        double t = k * step, s = 0.5 * VERIFY_PI * sinh(t), c = cosh(s);
        double weight = 0.5 * VERIFY_PI * cosh(t) / (c * c);
        double near = exp(-fabs(s)) / c; /* 1 - |tanh s|, without cancellation */
        if (weight < 1e-300) continue;
        double x = s < 0.0 ? a + half * near : b - half * near;
        if (x <= a || x >= b) continue;
        sum += weight * f(x, user);
    }
    return sum * half * step;
}

/* ---- Riemann problems ------------------------------------------------------------------------ */

/* Two states that meet at x = 0. P_star and v_star are what Toro 2009, table 4.2, prints (0: not
   in the table), P_digit and v_digit a unit of the last digit there. */
typedef struct verify_riemann {
    const char *name;
    double gamma, t_end;
    sphpa_riemann_state left, right;
    double P_star, P_digit, v_star, v_digit;
} verify_riemann;

/* the state at x and t > 0 */
static inline sphpa_riemann_state verify_riemann_at(const verify_riemann *problem,
                                                    const sphpa_riemann_star *star, double x,
                                                    double t) {
    sphpa_riemann_state out = {0.0, 0.0, 0.0};
    if (sphpa_riemann_sample(problem->gamma, &problem->left, &problem->right, star, x / t, &out) !=
        SPHPA_OK)
        out.rho = out.v = out.P = (double)NAN;
    return out;
}

/* ---- sums over a lattice --------------------------------------------------------------------- */

typedef struct verify_wavenumber {
    sphpa_kernel kernel;
    int dim;
    double k;
} verify_wavenumber;

/* J0, by the trapezoidal rule on its integral: exact to rounding for |x| < 400 */
static inline double verify_bessel0(double x) {
    double sum = 0.0;
    for (int k = 0; k < 256; k++) sum += cos(x * sin(VERIFY_PI * (k + 0.5) / 256.0));
    return sum / 256.0;
}

static inline double verify_transform_(double q, void *user) {
    const verify_wavenumber *w = (const verify_wavenumber *)user;
    double f = sphpa_kernel_w(w->kernel, w->dim, q, 1.0), x = w->k * q;
    if (w->dim == 1) return 2.0 * f * cos(x);
    if (w->dim == 2) return 2.0 * VERIFY_PI * q * f * verify_bessel0(x);
    return 4.0 * VERIFY_PI * q * q * f * (x > 0.0 ? sin(x) / x : 1.0);
}

/* the kernel's Fourier transform at wave number k/h; knots are at multiples of 1/2 */
static inline double verify_transform(sphpa_kernel kernel, int dim, double k) {
    verify_wavenumber w = {kernel, dim, k};
    double sum = 0.0;
    int pieces = (int)rint(2.0 * sphpa_kernel_support(kernel));
    for (int p = 0; p < pieces; p++)
        sum += verify_integral(verify_transform_, &w, 0.5 * p, 0.5 * (p + 1), dim == 1 ? 96 : 16);
    return sum;
}

/* sum_j W(r_j, eta) - 1 over the points of a cubic lattice of spacing 1, at one of them: by
   Poisson's formula the transform at all other points of the reciprocal lattice, 2 pi (integers) */
static inline double verify_lattice_bias(sphpa_kernel kernel, int dim, double eta) {
    static const int reach[4] = {0, 30, 10, 8};
    int n = reach[dim], ny = dim > 1 ? n : 0, nz = dim > 2 ? n : 0;
    double sum = 0.0;
    int times[31 * 31];
    memset(times, 0, sizeof times);
    for (int x = -n; x <= n; x++)
        for (int y = -ny; y <= ny; y++)
            for (int z = -nz; z <= nz; z++)
                if (x * x + y * y + z * z <= n * n) times[x * x + y * y + z * z]++;
    for (int k = 1; k <= n * n; k++)
        if (times[k] > 0)
            sum += times[k] *
                   verify_transform(kernel, dim, 2.0 * VERIFY_PI * sqrt((double)k) * eta);
    return sum;
}

/* ---- Sedov's explosion ----------------------------------------------------------------------- */

/* Similarity solution of a point explosion in cold gas of density 1 (Sedov 1959; Kamm & Timmes
   2007, LA-UR-07-2849, standard case): functions of V between the centre, v0, and the shock, v2.
   The parameter here is s in (0, 1]: V = v0 + (v2 - v0) s^(-1/a2), for which lambda = r/R is about
   proportional to s. R = (E t^2/(alpha rho))^(1/(dim + 2)). */
typedef struct verify_sedov {
    int dim;
    double gamma, a0, a1, a2, a3, a4, a5, v0, v2, b, alpha;
    double mass; /* [1] dim times the mass integral over the shocked gas: exactly 1 */
} verify_sedov;

/* r/R and velocity, density, pressure in units of those behind the shock, at s */
typedef struct verify_sedov_point {
    double lambda, f, g, h;
    double dlambda; /* d lambda / ds */
} verify_sedov_point;

static inline verify_sedov_point verify_sedov_at(const verify_sedov *S, double s) {
    double j = S->dim, n = j + 2.0, gm = S->gamma - 1.0, gp = S->gamma + 1.0;
    double w = pow(s, -1.0 / S->a2), V = S->v0 + (S->v2 - S->v0) * w;
    double x1 = 0.25 * n * gp * V, x2 = gp / gm * (0.5 * n * S->gamma * (S->v2 - S->v0) * w);
    double x3 = S->b * (1.0 - 0.5 * (2.0 + j * gm) * V), x4 = gp / gm * (1.0 - 0.5 * n * V);
    verify_sedov_point p;
    p.lambda = pow(x1, -S->a0) * pow(x2, -S->a2) * pow(x3, -S->a1);
    p.f = x1 * p.lambda;
    p.g = pow(x2, S->a3) * pow(x3, S->a4) * pow(x4, S->a5);
    p.h = pow(x1, S->a0 * j) * pow(x3, S->a4 - 2.0 * S->a1) * pow(x4, 1.0 + S->a5);
    double dV = (S->v2 - S->v0) * w / (-S->a2 * s); /* dV/ds */
    p.dlambda = p.lambda * (-S->a0 / V * dV + 1.0 / s +
                            S->a1 * S->b * 0.5 * (2.0 + j * gm) / x3 * dV);
    return p;
}

static inline double verify_sedov_energy_(double s, void *user) {
    const verify_sedov *S = (const verify_sedov *)user;
    verify_sedov_point p = verify_sedov_at(S, s);
    return (p.g * p.f * p.f + p.h) * pow(p.lambda, S->dim - 1.0) * p.dlambda;
}

static inline double verify_sedov_mass_(double s, void *user) {
    const verify_sedov *S = (const verify_sedov *)user;
    verify_sedov_point p = verify_sedov_at(S, s);
    return p.g * pow(p.lambda, S->dim - 1.0) * p.dlambda;
}

static inline verify_sedov verify_sedov_solve(int dim, double gamma) {
    static const double sphere[4] = {0.0, 2.0, 2.0 * VERIFY_PI, 4.0 * VERIFY_PI};
    verify_sedov S;
    double j = dim, n = j + 2.0, gm = gamma - 1.0, gp = gamma + 1.0;
    S.dim = dim;
    S.gamma = gamma;
    S.a0 = 2.0 / n;
    S.a2 = -gm / (2.0 * gm + j);
    S.a1 = n * gamma / (2.0 + j * gm) * (2.0 * j * (2.0 - gamma) / (gamma * n * n) - S.a2);
    S.a3 = j / (2.0 * gm + j);
    S.a4 = n * j / (j * (2.0 - gamma)) * S.a1;
    S.a5 = -2.0 / (2.0 - gamma);
    S.v0 = 2.0 / (n * gamma);
    S.v2 = 4.0 / (n * gp);
    S.b = n * gp / (n * gp - 2.0 * (2.0 + j * gm));
    S.alpha = sphere[dim] * 8.0 / (n * n * gm * gp) *
              verify_integral(verify_sedov_energy_, &S, 0.0, 1.0, 64);
    S.mass = j * gp / gm * verify_integral(verify_sedov_mass_, &S, 0.0, 1.0, 64);
    return S;
}

/* xi0 of R = xi0 (E t^2/rho)^(1/(dim + 2)) */
static inline double verify_sedov_xi0(const verify_sedov *S) {
    return pow(S->alpha, -1.0 / (S->dim + 2.0));
}

/* density at r/R = lambda, in units of that in front of the shock, by bisection in s */
static inline double verify_sedov_density(const verify_sedov *S, double lambda) {
    double low = 0.0, high = 1.0;
    if (lambda >= 1.0) return 1.0;
    for (int k = 0; k < 48; k++) {
        double s = 0.5 * (low + high);
        if (verify_sedov_at(S, s).lambda < lambda) low = s;
        else high = s;
    }
    return (S->gamma + 1.0) / (S->gamma - 1.0) * verify_sedov_at(S, high).g;
}

/* ---- Noh's implosion ------------------------------------------------------------------------- */

/* Cold gas of density 1 falls to the centre at speed 1 and is stopped by a shock that runs out at
   (gamma - 1)/2 (Noh 1987, J. Comput. Phys. 72). */
static inline double verify_noh_shock(double gamma, double t) { return 0.5 * (gamma - 1.0) * t; }

static inline double verify_noh_density(double gamma, int dim, double r, double t) {
    if (r < verify_noh_shock(gamma, t)) return pow((gamma + 1.0) / (gamma - 1.0), dim);
    return pow(1.0 + t / r, dim - 1.0);
}

/* ---- Gresho's vortex ------------------------------------------------------------------------- */

/* A triangular profile of the velocity whose centrifugal force the pressure holds, density 1
   (Gresho & Chan 1990; P so that the sound speed is finite: Liska & Wendroff 2003). */
static inline double verify_gresho_v(double r) {
    return r < 0.2 ? 5.0 * r : r < 0.4 ? 2.0 - 5.0 * r : 0.0;
}

static inline double verify_gresho_P(double r) {
    if (r < 0.2) return 5.0 + 12.5 * r * r;
    if (r < 0.4) return 9.0 + 12.5 * r * r - 20.0 * r + 4.0 * log(5.0 * r);
    return 3.0 + 4.0 * log(2.0);
}

/* ---- a sound wave of any amplitude ----------------------------------------------------------- */

/* A simple wave: v = A sin k(x - (v + c) t), c = c0 + (gamma - 1) v/2, until it breaks (Landau &
   Lifshitz, section 101). Of period 1 in x; rho = 1 where v = 0. */
typedef struct verify_wave {
    double gamma, c0, A;
} verify_wave;

/* v at x and t, by Newton: the wave has not broken, so the function rises */
static inline double verify_wave_v(const verify_wave *wave, double x, double t) {
    double k = 2.0 * VERIFY_PI, steep = 0.5 * (wave->gamma + 1.0), v = 0.0;
    for (int step = 0; step < 60; step++) {
        double phase = k * (x - (wave->c0 + steep * v) * t);
        double change = (v - wave->A * sin(phase)) / (1.0 + wave->A * cos(phase) * k * steep * t);
        v -= change;
        if (fabs(change) < 1e-16 * wave->c0) break;
    }
    return v;
}

static inline double verify_wave_rho(const verify_wave *wave, double v) {
    return pow(1.0 + 0.5 * (wave->gamma - 1.0) * v / wave->c0, 2.0 / (wave->gamma - 1.0));
}

static inline double verify_wave_mass_(double x, void *user) {
    const verify_wave *wave = (const verify_wave *)user;
    return verify_wave_rho(wave, verify_wave_v(wave, x, 0.0));
}

/* ---- growth of a shear layer's wave ---------------------------------------------------------- */

/* The smooth layers of McNally, Lyra & Passy 2012 (ApJS 201, 18): densities 1 and 2, velocities 1/2
   and -1/2, ramps of width 0.025 at y = 1/4 and 3/4, pressure 5/2, gamma 5/3. */
static inline double verify_layer(double y, double outer, double inner) {
    double L = 0.025, mean = 0.5 * (outer - inner);
    if (y < 0.25) return outer - mean * exp((y - 0.25) / L);
    if (y < 0.5) return inner + mean * exp((0.25 - y) / L);
    if (y < 0.75) return inner + mean * exp((y - 0.75) / L);
    return outer - mean * exp((0.75 - y) / L);
}

static inline double verify_layer_rho(double y) { return verify_layer(y, 1.0, 2.0); }
static inline double verify_layer_v(double y) { return verify_layer(y, 0.5, -0.5); }

/* how a point at y counts in the mode's amplitude, their eq. 13 */
static inline double verify_layer_weight(double y) {
    return exp(-4.0 * VERIFY_PI * fabs((y < 0.5 ? y : 1.0 - y) - 0.25));
}

enum { VERIFY_GRID = 512, VERIFY_TIMES = 20 };

/* rho, vx, vy, P of exp(ikx), real and imaginary parts, on a periodic line in y */
typedef struct verify_mode {
    double q[8][VERIFY_GRID];
} verify_mode;

typedef struct verify_base {
    double rho[VERIFY_GRID], drho[VERIFY_GRID], U[VERIFY_GRID], dU[VERIFY_GRID];
} verify_base;

/* sixth-order derivative on the periodic line */
static inline void verify_dy(const double *f, double *df) {
    const int n = VERIFY_GRID;
    for (int i = 0; i < n; i++) {
        int a = (i + 1) % n, b = (i + 2) % n, c = (i + 3) % n;
        int d = (i + n - 1) % n, e = (i + n - 2) % n, g = (i + n - 3) % n;
        df[i] = n * (0.75 * (f[a] - f[d]) - 0.15 * (f[b] - f[e]) + (f[c] - f[g]) / 60.0);
    }
}

/* Euler's equations, linear in the wave; k = 4 pi */
static inline void verify_mode_rate(const verify_base *base, const verify_mode *m,
                                    verify_mode *rate) {
    static double dvy[2][VERIFY_GRID], dP[2][VERIFY_GRID];
    const double k = 4.0 * VERIFY_PI, stiff = 5.0 / 3.0 * 2.5;
    for (int part = 0; part < 2; part++) {
        verify_dy(m->q[4 + part], dvy[part]);
        verify_dy(m->q[6 + part], dP[part]);
    }
    for (int i = 0; i < VERIFY_GRID; i++)
        for (int re = 0; re < 2; re++) { /* i times (a + ib) is -b + ia */
            int other = 1 - re;
            double turn = re == 0 ? -k : k, kU = turn * base->U[i], rho = base->rho[i];
            double div = turn * m->q[2 + other][i] + dvy[re][i], vy = m->q[4 + re][i];
            rate->q[re][i] = -kU * m->q[other][i] - vy * base->drho[i] - rho * div;
            rate->q[2 + re][i] = -kU * m->q[2 + other][i] - vy * base->dU[i] -
                                 turn * m->q[6 + other][i] / rho;
            rate->q[4 + re][i] = -kU * m->q[4 + other][i] - dP[re][i] / rho;
            rate->q[6 + re][i] = -kU * m->q[6 + other][i] - stiff * div;
        }
}

static inline void verify_mode_ahead(const verify_mode *m, const verify_mode *rate, double dt,
                                     verify_mode *out) {
    for (int f = 0; f < 8; f++)
        for (int i = 0; i < VERIFY_GRID; i++) out->q[f][i] = m->q[f][i] + dt * rate->q[f][i];
}

static inline double verify_mode_amplitude(const verify_mode *m) {
    double re = 0.0, im = 0.0, all = 0.0;
    for (int i = 0; i < VERIFY_GRID; i++) {
        double w = verify_layer_weight((double)i / VERIFY_GRID);
        re += w * m->q[4][i], im += w * m->q[5][i], all += w;
    }
    return sqrt(re * re + im * im) / all;
}

/* The mode's amplitude at t_end k/20, k = 1 .. 20, of a wave that is small: the linear equations,
   which leave out what is of second order in 0.01, by Runge-Kutta of fourth order. */
static inline void verify_mode_solve(double t_end, double amplitude[VERIFY_TIMES]) {
    static verify_base base;
    static verify_mode m, at, rate, sum;
    int steps = (int)ceil(t_end / VERIFY_TIMES * VERIFY_GRID * 2.6 / 0.8);
    double dt = t_end / VERIFY_TIMES / steps;
    memset(&m, 0, sizeof m);
    for (int i = 0; i < VERIFY_GRID; i++) {
        double y = (double)i / VERIFY_GRID;
        base.rho[i] = verify_layer_rho(y);
        base.U[i] = verify_layer_v(y);
        m.q[4][i] = 0.01;
    }
    verify_dy(base.rho, base.drho);
    verify_dy(base.U, base.dU);
    for (int k = 0; k < VERIFY_TIMES; k++) {
        for (int s = 0; s < steps; s++) {
            static const double ahead[4] = {0.5, 0.5, 1.0, 0.0}, share[4] = {1.0, 2.0, 2.0, 1.0};
            at = sum = m;
            for (int stage = 0; stage < 4; stage++) {
                verify_mode_rate(&base, &at, &rate);
                verify_mode_ahead(&sum, &rate, dt * share[stage] / 6.0, &sum);
                if (stage < 3) verify_mode_ahead(&m, &rate, dt * ahead[stage], &at);
            }
            m = sum;
        }
        amplitude[k] = verify_mode_amplitude(&m);
    }
}

#endif
