/* stress_scenes.h: the cases of stress_sph.c and what each is measured by. */
#ifndef STRESS_SCENES_H
#define STRESS_SCENES_H

#include "stress_run.h"

#define STRESS_PI 3.14159265358979323846

/* ---- gas: building blocks -------------------------------------------------------------------- */

static void stress_gas(stress_world *w, double gamma) {
    w->ideal.gamma = gamma;
    w->eos = sphpa_ideal_eos(&w->ideal);
    w->gas.eos = &w->eos;
    w->gas.materials = 1;
    sphpa_scene_add(&w->scene, sphpa_gas(&w->gas));
}

static double stress_gas_u(double gamma, double P, double rho) { return P / ((gamma - 1.0) * rho); }

/* an interval of gas on a line, of particles with mass m */
static bool stress_line(stress_world *w, stress_row *row, double low, double high,
                        const sphpa_riemann_state *state, double gamma, double m) {
    const double a[3] = {low, 0.0, 0.0}, b[3] = {high, 0.0, 0.0};
    sphpa_body body;
    sphpa_error err;
    memset(&body, 0, sizeof body);
    err.message[0] = '\0';
    body.rho = state->rho;
    body.u = stress_gas_u(gamma, state->P, state->rho);
    body.v[0] = state->v;
    body.spacing = m / state->rho;
    sphpa_result result = SPHPA_OK;
    if (w->p.dim == 0) result = sphpa_make_begin(&w->p, 1, &err);
    if (result == SPHPA_OK) result = sphpa_make_box(&w->p, a, b, &body, &err);
    return !stress_stopped(row, result, &err);
}

/* mean |rho - exact| over the particles in [low, high], over the mean of exact rho there; the
   Riemann problem lies at x0 */
static double stress_riemann_error(const stress_world *w, double gamma, double x0,
                                   const sphpa_riemann_state *left,
                                   const sphpa_riemann_state *right, double low, double high) {
    sphpa_riemann_star star;
    double off = 0.0, all = 0.0;
    if (sphpa_riemann_exact(gamma, left, right, &star) != SPHPA_OK) return (double)NAN;
    for (size_t i = 0; i < w->sim.p.n; i++) {
        double x = w->sim.p.x[3 * i];
        sphpa_riemann_state exact;
        if (x < low || x > high) continue;
        if (sphpa_riemann_sample(gamma, left, right, &star, (x - x0) / w->sim.time, &exact) !=
            SPHPA_OK)
            return (double)NAN;
        off += fabs(w->sim.p.rho[i] - exact.rho);
        all += exact.rho;
    }
    return off / all;
}

/* ---- gas: pressure ratios, near vacuum, Mach numbers ----------------------------------------- */

/* a: the ratio of the pressures, left 1 Pa, both at rest with rho 1 kg/m3 and gamma 1.4; b: the
   unit of length, 1 m unless it is given (speeds stay, so times grow with it). In the periodic tube
   [-1, 1] with its mirror image, the hot gas in the middle, 400 particles in [0, 1]; until the
   rarefaction is close to the middle or the shock to the end. */
static void stress_ratio(const stress_case *c, stress_world *w, stress_row *row) {
    const double gamma = 1.4, unit = c->b > 0.0 ? c->b : 1.0, m = unit / 400.0;
    const sphpa_riemann_state left = {1.0, 0.0, 1.0}, right = {1.0, 0.0, 1.0 / c->a};
    sphpa_riemann_star star;
    stress_gas(w, gamma);
    w->options.box.periodic[0] = 1;
    w->options.box.low[0] = -unit;
    w->options.box.high[0] = unit;
    if (sphpa_riemann_exact(gamma, &left, &right, &star) != SPHPA_OK) return;
    if (!stress_line(w, row, -unit, -0.5 * unit, &right, gamma, m) ||
        !stress_line(w, row, -0.5 * unit, 0.5 * unit, &left, gamma, m) ||
        !stress_line(w, row, 0.5 * unit, unit, &right, gamma, m) || !stress_begin(w, row) ||
        !stress_go(w, row, 0.4 * unit / fmax(-star.head_l, star.head_r)))
        return;
    row->error = stress_riemann_error(w, gamma, 0.5 * unit, &left, &right, 0.0, unit);
}

/* Two halves that part with the speed a [m/s] each, else as in Toro's second problem (rho 1, P 0.4,
   gamma 1.4, 400 particles in [-0.5, 0.5]); from a = 3.742 on a vacuum opens between them. The
   outer ends are free and so far away that their rarefactions do not reach what is compared: from
   the middle to where the two waves end. Until sound has gone 0.15 m in the gas at rest. */
static void stress_apart(const stress_case *c, stress_world *w, stress_row *row) {
    const double gamma = 1.4, m = 1.0 / 400.0, sound = sqrt(gamma * 0.4), v = c->a;
    const sphpa_riemann_state left = {1.0, -v, 0.4}, right = {1.0, v, 0.4};
    double t = 0.15 / sound, end = 0.1 + 2.2 * sound * t;
    stress_gas(w, gamma);
    if (!stress_line(w, row, -end, 0.0, &left, gamma, m) ||
        !stress_line(w, row, 0.0, end, &right, gamma, m) || !stress_begin(w, row) ||
        !stress_go(w, row, t))
        return;
    double edge = (v + sound) * t;
    row->error = stress_riemann_error(w, gamma, 0.0, &left, &right, -edge, edge);
    double least = HUGE_VAL;
    for (size_t i = 0; i < w->sim.p.n; i++) least = fmin(least, w->sim.p.rho[i]);
    snprintf(row->note, sizeof row->note, "thinnest %.1e kg/m3", least);
}

/* Two halves that meet with 1 m/s each and Mach number a (of that speed and their sound speed),
   gamma 5/3, 200 particles each. b: a gap between them at the start [m], in which there is nothing:
   the collision is later by b/2 and otherwise the same. */
static void stress_wall(const stress_case *c, stress_world *w, stress_row *row) {
    const double gamma = 5.0 / 3.0, m = 1.0 / 200.0, P = 1.0 / (gamma * c->a * c->a);
    const double gap = 0.5 * c->b, t = 0.6;
    const sphpa_riemann_state left = {1.0, 1.0, P}, right = {1.0, -1.0, P};
    stress_gas(w, gamma);
    if (!stress_line(w, row, -1.0 - gap, -gap, &left, gamma, m) ||
        !stress_line(w, row, gap, 1.0 + gap, &right, gamma, m) || !stress_begin(w, row) ||
        !stress_go(w, row, t + gap))
        return;
    w->sim.time = t; /* of the exact solution */
    row->error = stress_riemann_error(w, gamma, 0.0, &left, &right, -0.35, 0.35);
    w->sim.time = t + gap;
}

/* Noh's problem in 2-D or 3-D (b): cold gas with Mach number a at 1 m/s flows to the centre, gamma
   5/3; density behind the shock 4^dim, shock at t/3. The error is that of rho from 0.25 to 0.75 of
   the shock's radius. The quintic kernel, for the cubic clumps behind so strong a shock. In 3-D
   8000 particles are too few for an answer (density 64, shock at 0.2, and h there is 0.04): only
   whether it survives is judged. */
static void stress_noh(const stress_case *c, stress_world *w, stress_row *row) {
    const double gamma = 5.0 / 3.0, origin[3] = {0.0, 0.0, 0.0}, t = 0.6;
    int dim = (int)c->b;
    sphpa_body body;
    sphpa_error err;
    memset(&body, 0, sizeof body);
    err.message[0] = '\0';
    stress_gas(w, gamma);
    w->options.kernel = SPHPA_KERNEL_QUINTIC;
    body.rho = 1.0;
    body.u = 1.0 / (gamma * (gamma - 1.0) * c->a * c->a);
    body.count = dim == 2 ? 4000 : 8000;
    body.lattice = SPHPA_LATTICE_HEXAGONAL;
    body.seed = 1;
    sphpa_result result = sphpa_make_begin(&w->p, dim, &err);
    if (result == SPHPA_OK) result = sphpa_make_sphere(&w->p, origin, 1.0, &body, &err);
    if (stress_stopped(row, result, &err)) return;
    for (size_t i = 0; i < w->p.n; i++) {
        const double *x = w->p.x + 3 * i, r = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
        for (size_t a = 0; a < 3; a++) w->p.v[3 * i + a] = (sphpa_real)(-x[a] / (r + 1e-300));
    }
    if (!stress_begin(w, row) || !stress_go(w, row, t)) return;
    double off = 0.0, count = 0.0, exact = pow(4.0, dim);
    for (size_t i = 0; i < w->sim.p.n; i++) {
        const double *x = w->sim.p.x + 3 * i, r = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
        if (r < 0.25 * t / 3.0 || r > 0.75 * t / 3.0) continue;
        off += fabs(w->sim.p.rho[i] / exact - 1.0);
        count += 1.0;
    }
    row->error = off / count;
}

/* A hot ball (rho 1, u 1, R 1, a dimensions, 2000 particles, in 1-D 200) flies apart until its rms
   radius is 100^(3/a) times the first, its volume 1e6 times. gamma: b. Exact: all internal energy
   becomes kinetic but for about V^(1 - gamma), which must be small against 1; nothing is faster
   than 2 c/(gamma - 1). The error is the larger of 1 - K/E and what the fastest is too fast by. */
static void stress_free(const stress_case *c, stress_world *w, stress_row *row) {
    const double gamma = c->b, origin[3] = {0.0, 0.0, 0.0};
    int dim = (int)c->a;
    sphpa_body body;
    sphpa_error err;
    memset(&body, 0, sizeof body);
    err.message[0] = '\0';
    stress_gas(w, gamma);
    body.rho = body.u = 1.0;
    body.count = dim == 1 ? 200 : 2000;
    body.lattice = SPHPA_LATTICE_HEXAGONAL;
    body.seed = dim > 1;
    sphpa_result result = sphpa_make_begin(&w->p, dim, &err);
    if (result == SPHPA_OK) result = sphpa_make_sphere(&w->p, origin, 1.0, &body, &err);
    if (stress_stopped(row, result, &err) || !stress_begin(w, row)) return;
    double before = 0.0, after = 0.0, fastest = 0.0, top = 2.0 * sqrt(gamma / (gamma - 1.0));
    double grown = pow(100.0, 3.0 / dim), t = grown * sqrt(dim / (dim + 2.0)) / sqrt(2.0);
    for (size_t i = 0; i < w->n; i++)
        for (size_t a = 0; a < 3; a++) before += w->p.x[3 * i + a] * w->p.x[3 * i + a];
    if (!stress_go(w, row, t)) return;
    for (size_t i = 0; i < w->n; i++) {
        const sphpa_real *v = w->sim.p.v + 3 * i;
        for (size_t a = 0; a < 3; a++) after += w->sim.p.x[3 * i + a] * w->sim.p.x[3 * i + a];
        fastest = fmax(fastest, sqrt((double)(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])));
    }
    sphpa_totals now = sphpa_sim_totals(&w->sim);
    row->error = fmax(1.0 - now.kinetic / w->start.energy, fastest / top - 1.0);
    snprintf(row->note, sizeof row->note, "volume x %.1e, fastest %.3f of 2c/(gamma-1)",
             pow(after / before, 0.5 * dim), fastest / top);
}

/* Sod's tube (450 particles in [-1, 1], periodic) that moves with V [m/s], against the exact one
   that moves, too; its sound speeds are near 1. The error of rho at 0.1 s, HUGE_VAL where it
   ended. */
static double stress_moving_error(stress_world *w, stress_row *row, double V) {
    const double gamma = 1.4, m = 0.5625 / 225.0, t = 0.1;
    sphpa_riemann_state left = {1.0, V, 1.0}, right = {0.125, V, 0.1};
    stress_clear(w);
    stress_gas(w, gamma);
    w->options.box.periodic[0] = 1;
    w->options.box.low[0] = -1.0;
    w->options.box.high[0] = 1.0;
    if (!stress_line(w, row, -1.0, -0.5, &right, gamma, m) ||
        !stress_line(w, row, -0.5, 0.5, &left, gamma, m) ||
        !stress_line(w, row, 0.5, 1.0, &right, gamma, m) || !stress_begin(w, row) ||
        !stress_go(w, row, t))
        return HUGE_VAL;
    for (size_t i = 0; i < w->n; i++) {
        double x = w->sim.p.x[3 * i] - fmod(V * t, 2.0);
        w->sim.p.x[3 * i] = x < -1.0 ? x + 2.0 : x;
    }
    left.v = right.v = 0.0;
    return stress_riemann_error(w, gamma, 0.5, &left, &right, 0.0, 1.0);
}

/* Nothing but rounding depends on how fast all moves together. Ten times as fast again and again
   until the error is 1.5 times that at rest and 0.005 more, or the run ends. Wrong where that is
   before a [m/s]. */
static void stress_moving(const stress_case *c, stress_world *w, stress_row *row) {
    double base = stress_moving_error(w, row, 0.0), bound = 1.5 * base + 0.005, off = base;
    double energy = row->energy, momentum = row->momentum;
    char why[48] = "nothing";
    if (row->verdict != STRESS_SURVIVED) return;
    row->number = HUGE_VAL;
    for (double V = 10.0; V < 1e12; V *= 10.0) {
        row->energy = row->momentum = 0.0;
        off = stress_moving_error(w, row, V);
        if (off <= bound) {
            energy = fmax(energy, row->energy), momentum = fmax(momentum, row->momentum);
            continue;
        }
        if (row->verdict > STRESS_STOPPED) return;
        row->number = V;
        if (off < HUGE_VAL) snprintf(why, sizeof why, "error %.2g, was %.2g", off, base);
        else snprintf(why, sizeof why, "%.44s", row->message);
        break;
    }
    row->verdict = STRESS_SURVIVED;
    row->error = row->number > c->a ? base : HUGE_VAL;
    row->energy = energy, row->momentum = momentum; /* the largest of those that held */
    row->below = 0.0;
    snprintf(row->note, sizeof row->note, "breaks at %.0e sound speeds: %s", row->number, why);
}

/* Cold gas (u 0) at rest in a periodic box: nothing may happen, in steps of any length. */
static void stress_still(const stress_case *c, stress_world *w, stress_row *row) {
    const sphpa_riemann_state cold = {1.0, 0.0, 0.0};
    (void)c;
    stress_gas(w, 1.4);
    w->options.box.periodic[0] = 1;
    w->options.box.high[0] = 1.0;
    if (!stress_line(w, row, 0.0, 1.0, &cold, 1.4, 0.01) || !stress_begin(w, row)) return;
    w->start.energy = 1.0; /* a scale for the drift, which must be 0 */
    if (!stress_go(w, row, 1.0)) return;
    row->energy = fabs(sphpa_sim_totals(&w->sim).energy);
    row->error = row->energy;
}

/* A periodic box of 12^3 particles of gas (gamma 5/3, u 1, rho 1, 1 m apart). kind a: */
typedef enum stress_box_kind {
    STRESS_BOX_HEAVY = 0, /* one particle in its middle has b times the mass of the others */
    STRESS_BOX_ETA,       /* h = b (m/rho)^(1/3): too few neighbours */
    STRESS_BOX_CLUMP,     /* eight particles more within b of one in the middle */
    STRESS_BOX_HALF,      /* only half of the box is filled, the rest is empty */
    STRESS_BOX_POINT      /* one particle has b times the energy of all others together */
} stress_box_kind;

/* one particle more, like the one at `like`, off by up to `away` along each axis */
static sphpa_result stress_add_near(sphpa_particles *p, size_t like, double away, sphpa_rng *rng,
                                    sphpa_error *err) {
    size_t i = 0;
    sphpa_result result = sphpa_particles_add(p, 1, &i, err);
    if (result != SPHPA_OK) return result;
    for (size_t a = 0; a < (size_t)p->dim; a++)
        p->x[3 * i + a] = p->x[3 * like + a] + away * (2.0 * sphpa_rng_uniform(rng) - 1.0);
    p->m[i] = p->m[like];
    p->h[i] = p->h[like];
    p->rho[i] = p->rho[like];
    p->u[i] = p->u[like];
    p->alpha[i] = p->alpha[like];
    return SPHPA_OK;
}

/* ten crossings of a spacing by sound */
static void stress_box(const stress_case *c, stress_world *w, stress_row *row) {
    stress_box_kind kind = (stress_box_kind)c->a;
    const double low[3] = {0.0, 0.0, 0.0};
    const double high[3] = {12.0, 12.0, kind == STRESS_BOX_HALF ? 6.0 : 12.0};
    sphpa_rng rng = sphpa_rng_seed(1, 8);
    sphpa_body body;
    sphpa_error err;
    memset(&body, 0, sizeof body);
    err.message[0] = '\0';
    if (kind == STRESS_BOX_ETA) w->gas.eta = c->b;
    stress_gas(w, 5.0 / 3.0);
    for (int a = 0; a < 3; a++) w->options.box.periodic[a] = 1, w->options.box.high[a] = 12.0;
    body.rho = body.u = body.spacing = 1.0;
    sphpa_result result = sphpa_make_begin(&w->p, 3, &err);
    if (result == SPHPA_OK) result = sphpa_make_box(&w->p, low, high, &body, &err);
    size_t middle = w->p.n / 2 + 78; /* at (6.5, 6.5, 6.5) */
    if (result == SPHPA_OK && kind == STRESS_BOX_HEAVY) w->p.m[middle] *= (sphpa_real)c->b;
    if (result == SPHPA_OK && kind == STRESS_BOX_POINT) w->p.u[middle] = c->b * (double)w->p.n;
    for (int k = 0; k < 8 && kind == STRESS_BOX_CLUMP && result == SPHPA_OK; k++)
        result = stress_add_near(&w->p, middle, c->b, &rng, &err);
    if (stress_stopped(row, result, &err) || !stress_begin(w, row)) return;
    double c0 = sqrt(10.0 / 9.0), fastest = 0.0, most = 0.0;
    if (!stress_go(w, row, 10.0 / c0)) return;
    for (size_t i = 0; i < 3 * w->n; i++) fastest = fmax(fastest, fabs((double)w->sim.p.v[i]));
    for (size_t i = 0; i < w->n; i++) most = fmax(most, w->sim.p.rho[i]);
    snprintf(row->note, sizeof row->note,
             "densest %.3g kg/m3, fastest %.2g c, u below 0: %.0e of E", most,
             fastest / c0, w->sim.stats.u_deficit / w->start.energy);
}

/* ---- gas: single particles, and two on one point --------------------------------------------- */

typedef enum stress_lone_kind {
    STRESS_LONE_GAS = 0, /* no bound on h: its density has no answer */
    STRESS_LONE_BOUND,   /* h_max */
    STRESS_LONE_BOX,     /* periodic, h_max */
    STRESS_LONE_FAST,    /* the same, so cold that it crosses the box many times in a step */
    STRESS_LONE_SOLID,
    STRESS_LONE_POROUS
} stress_lone_kind;

static void stress_solid(stress_world *w, const char *name, const char *other);
static void stress_porous(stress_world *w, sphpa_crush crush);

/* One particle (kind a) at 1000 m/s for 1 s. It must fly on straight with its u: the error is of
   its place, by the way it goes. */
static void stress_lone(const stress_case *c, stress_world *w, stress_row *row) {
    stress_lone_kind kind = (stress_lone_kind)c->a;
    const double low[3] = {0.0, 0.0, 0.0}, high[3] = {1.0, 1.0, 1.0};
    bool gas = kind != STRESS_LONE_SOLID && kind != STRESS_LONE_POROUS;
    bool box = kind == STRESS_LONE_BOX || kind == STRESS_LONE_FAST;
    sphpa_body body;
    sphpa_error err;
    memset(&body, 0, sizeof body);
    err.message[0] = '\0';
    if (gas) stress_gas(w, 1.4);
    else stress_solid(w, "basalt", NULL);
    if (kind == STRESS_LONE_POROUS) stress_porous(w, sphpa_crush_quadratic(2.0, 1e6, 1e8));
    if (gas && kind != STRESS_LONE_GAS) w->gas.h_max = 2.0;
    for (int a = 0; a < 3 && box; a++)
        w->options.box.periodic[a] = 1, w->options.box.high[a] = 10.0;
    body.rho = gas ? 1.0 : w->material[0].eos.rho0;
    body.alpha = kind == STRESS_LONE_POROUS ? 2.0 : 1.0;
    body.rho /= body.alpha;
    body.u = kind == STRESS_LONE_FAST ? 1.0 : gas ? 1e5 : 0.0;
    body.v[0] = 1000.0;
    body.count = 1;
    sphpa_result result = sphpa_make_begin(&w->p, 3, &err);
    if (result == SPHPA_OK) result = sphpa_make_box(&w->p, low, high, &body, &err);
    if (stress_stopped(row, result, &err) || !stress_begin(w, row)) return;
    double x0 = w->p.x[0], u0 = w->sim.p.u[0];
    if (!stress_go(w, row, 1.0)) return;
    double went = w->sim.p.x[0] - x0;
    if (box) went += 10.0 * floor((1000.0 - went) / 10.0 + 0.5);
    row->error = fmax(fabs(went / 1000.0 - 1.0), fabs(w->sim.p.u[0] / fmax(u0, 1.0) -
                                                      u0 / fmax(u0, 1.0)));
    snprintf(row->note, sizeof row->note, "rho %.3g of %.3g kg/m3", w->sim.p.rho[0], body.rho);
}

/* distance of the nearest pair, in units of `unit`; the box wraps where it is periodic */
static double stress_nearest(const sphpa_sim *sim, double unit, double *each) {
    double least = HUGE_VAL;
    const sphpa_box *box = &sim->options.box;
    for (size_t i = 0; i < sim->p.n; i++) {
        double own = HUGE_VAL;
        for (size_t j = 0; j < sim->p.n; j++) {
            double r2 = 0.0;
            if (i == j) continue;
            for (size_t a = 0; a < 3; a++) {
                double dx = sim->p.x[3 * i + a] - sim->p.x[3 * j + a];
                double length = box->high[a] - box->low[a];
                if (box->periodic[a]) dx -= length * floor(dx / length + 0.5);
                r2 += dx * dx;
            }
            own = fmin(own, r2);
        }
        if (each != NULL) each[i] = sqrt(own) / unit;
        least = fmin(least, own);
    }
    return sqrt(least) / unit;
}

/* A block of 10^3 particles 1 m apart, and one more at the distance a [m] from one in its middle.
   b: 0 gas (gamma 5/3, u 1, rho 1, periodic box), 1 basalt with 1e4 J/kg, in the open. For ten (gas) or
   three crossings of a spacing by sound. */
static void stress_close(const stress_case *c, stress_world *w, stress_row *row) {
    const double low[3] = {0.0, 0.0, 0.0}, high[3] = {10.0, 10.0, 10.0};
    bool gas = c->b < 0.5;
    sphpa_body body;
    sphpa_error err;
    size_t first = 0, near = 0;
    memset(&body, 0, sizeof body);
    err.message[0] = '\0';
    if (gas) stress_gas(w, 5.0 / 3.0);
    else stress_solid(w, "basalt", NULL);
    for (int a = 0; a < 3 && gas; a++)
        w->options.box.periodic[a] = 1, w->options.box.high[a] = 10.0;
    body.rho = gas ? 1.0 : w->material[0].eos.rho0;
    body.u = gas ? 1.0 : 1e4; /* so that there is pressure */
    body.spacing = 1.0;
    sphpa_result result = sphpa_make_begin(&w->p, 3, &err);
    if (result == SPHPA_OK) result = sphpa_make_box(&w->p, low, high, &body, &err);
    if (result == SPHPA_OK) result = sphpa_particles_add(&w->p, 1, &first, &err);
    if (stress_stopped(row, result, &err)) return;
    sphpa_particles *p = &w->p;
    while (near + 1 < first && fabs(p->x[3 * near] - 4.5) + fabs(p->x[3 * near + 1] - 4.5) +
                                       fabs(p->x[3 * near + 2] - 4.5) > 0.1)
        near++;
    for (size_t a = 0; a < 3; a++) p->x[3 * first + a] = p->x[3 * near + a];
    p->x[3 * first] += c->a * 0.6;
    p->x[3 * first + 1] += c->a * 0.8;
    p->m[first] = p->m[near];
    p->h[first] = p->h[near];
    p->rho[first] = p->rho[near];
    p->u[first] = p->u[near];
    p->alpha[first] = 1.0;
    if (!stress_begin(w, row)) return;
    double sound = gas ? sqrt(10.0 / 9.0) : 5000.0;
    if (!stress_go(w, row, (gas ? 10.0 : 3.0) / sound)) return;
    double fastest = 0.0;
    for (size_t i = 0; i < 3 * w->n; i++) fastest = fmax(fastest, fabs((double)w->sim.p.v[i]));
    snprintf(row->note, sizeof row->note, "nearest pair %.1e, fastest %.2f c",
             stress_nearest(&w->sim, 1.0, NULL), fastest / sound);
}

/* ---- gas: many neighbours -------------------------------------------------------------------- */

static int stress_compare(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Does the kernel a pair up particles at about b neighbours? A disordered periodic box of 12^3
   particles of nearly isothermal gas (gamma 1.01, P 1 and c 1 at rho 1) comes to rest by viscosity,
   over 100 crossings of a spacing by sound (20 with --quick); then the distances to the nearest
   neighbours are sorted. Pairing: many of them are far below a spacing. */
static void stress_pairing(const stress_case *c, stress_world *w, stress_row *row) {
    sphpa_kernel kernel = (sphpa_kernel)c->a;
    const double low[3] = {0.0, 0.0, 0.0}, high[3] = {12.0, 12.0, 12.0};
    sphpa_rng rng = sphpa_rng_seed(1, 7);
    sphpa_body body;
    sphpa_error err;
    memset(&body, 0, sizeof body);
    err.message[0] = '\0';
    w->gas.eta = pow(0.75 * c->b / STRESS_PI, 1.0 / 3.0) / sphpa_kernel_support(kernel);
    w->options.kernel = kernel;
    stress_gas(w, 1.01);
    for (int a = 0; a < 3; a++) w->options.box.periodic[a] = 1, w->options.box.high[a] = 12.0;
    body.rho = body.spacing = 1.0;
    body.u = 100.0;
    body.eta = w->gas.eta;
    sphpa_result result = sphpa_make_begin(&w->p, 3, &err);
    if (result == SPHPA_OK) result = sphpa_make_box(&w->p, low, high, &body, &err);
    if (stress_stopped(row, result, &err)) return;
    for (size_t i = 0; i < 3 * w->p.n; i++) /* within its own cell of the lattice */
        w->p.x[i] += 0.6 * (sphpa_rng_uniform(&rng) - 0.5);
    if (!stress_begin(w, row) || !stress_go(w, row, w->quick ? 20.0 : 100.0))
        return;
    double *each = (double *)malloc(w->n * sizeof *each), pairs = 0.0;
    if (each == NULL) return;
    (void)stress_nearest(&w->sim, 1.0, each);
    for (size_t i = 0; i < w->n; i++) pairs += each[i] < 0.5 ? 1.0 / (double)w->n : 0.0;
    qsort(each, w->n, sizeof *each, stress_compare);
    row->number = pairs;
    row->error = pairs;
    snprintf(row->note, sizeof row->note,
             "%.0f neighbours; nearest at 1, 50, 99 %%: %.2f %.2f %.2f; paired %.0f %%",
             w->sim.stats.neighbours_mean, each[w->n / 100], each[w->n / 2],
             each[w->n - w->n / 100], 100.0 * pairs);
    free(each);
}

/* ---- solids: building blocks ----------------------------------------------------------------- */

/* one or two materials of the table with all of their strength; without flaws where k is 0 */
static void stress_solid(stress_world *w, const char *name, const char *other) {
    const char *const all[STRESS_BODIES] = {name, other != NULL ? other : name};
    for (int k = 0; k < STRESS_BODIES; k++) {
        w->material[k] = *sphpa_material_find(all[k]);
        w->matrix[k] = &w->material[k].eos;
        w->solid_material[k].eos = sphpa_tillotson_eos(&w->material[k].eos);
        w->solid_material[k].G = w->material[k].G;
        w->yield[k].kind = w->material[k].Y > 0.0 ? SPHPA_YIELD_VON_MISES : SPHPA_YIELD_NONE;
        w->yield[k].Y0 = w->material[k].Y;
        w->yield[k].u_melt = w->material[k].u_melt;
        w->flaws[k].k = w->material[k].weibull_k;
        w->flaws[k].m = w->material[k].weibull_m;
        w->crush[k].alpha0 = 1.0;
    }
    w->solid.material = w->solid_material;
    w->solid.materials = STRESS_BODIES;
    w->solid.correction = 1;
    sphpa_scene_add(&w->scene, sphpa_solid(&w->solid));
}

/* body 0 gets pores */
static void stress_porous(stress_world *w, sphpa_crush crush) {
    w->crush[0] = crush;
    w->pores.solid = &w->solid;
    w->pores.crush = w->crush;
    w->pores.matrix = w->matrix;
    sphpa_scene_add(&w->scene, sphpa_pores(&w->pores));
}

static void stress_strength(stress_world *w) {
    w->plastic.yield = w->yield;
    w->plastic.materials = STRESS_BODIES;
    w->cracks.solid = &w->solid;
    w->cracks.material = w->flaws;
    w->cracks.seed = 1;
    sphpa_scene_add(&w->scene, sphpa_plastic(&w->plastic));
    sphpa_scene_add(&w->scene, sphpa_cracks(&w->cracks));
}

/* ---- solids: impacts ------------------------------------------------------------------------- */

/* a block of 14 x 14 x 8 mm (about 3000 particles) and a ball of 5 mm, `away` spacings above it,
   that comes down with v [m/s]; made of the materials of bodies 0 and 1 */
static bool stress_block_and_ball(stress_world *w, stress_row *row, double v, double away) {
    const double scale = w->quick ? 1.4e-3 : 0.8e-3; /* [m] spacing */
    const double low[3] = {-7e-3, -7e-3, -8e-3}, high[3] = {7e-3, 7e-3, 0.0};
    const double centre[3] = {0.0, 0.0, 2.5e-3 + away * scale};
    sphpa_body body;
    sphpa_error err;
    memset(&body, 0, sizeof body);
    err.message[0] = '\0';
    body.alpha = w->crush[0].alpha0;
    body.rho = w->material[0].eos.rho0 / body.alpha;
    body.spacing = scale;
    sphpa_result result = sphpa_make_begin(&w->p, 3, &err);
    if (result == SPHPA_OK) result = sphpa_make_box(&w->p, low, high, &body, &err);
    body.alpha = 1.0;
    body.rho = w->material[1].eos.rho0;
    body.material = body.body = 1;
    body.v[2] = -v;
    if (result == SPHPA_OK) result = sphpa_make_sphere(&w->p, centre, 2.5e-3, &body, &err);
    return !stress_stopped(row, result, &err) && stress_begin(w, row);
}

/* how much of the block is broken, how hot and how fast it all became */
static void stress_impact_note(const stress_world *w, stress_row *row) {
    const sphpa_particles *p = &w->sim.p;
    double broken = 0.0, block = 0.0, hottest = 0.0;
    for (size_t i = 0; i < p->n; i++) {
        hottest = fmax(hottest, p->u[i]);
        if (p->body[i] != 0) continue;
        block += 1.0;
        broken += p->D != NULL && (double)p->D[i] >= 0.9;
    }
    row->number = broken / block;
    snprintf(row->note, sizeof row->note,
             "broken %.1f %%, hottest %.1e J/kg, u below 0: %.0e of E, least dt %.2g of first",
             100.0 * broken / block, hottest, w->sim.stats.u_deficit / w->start.energy,
             row->dt_least / row->dt_first);
}

/* the speed of longitudinal waves in body 0's matrix */
static double stress_wave(const stress_world *w) {
    const sphpa_material *m = &w->material[0];
    return sqrt((m->eos.A + 4.0 / 3.0 * m->G) / m->eos.rho0);
}

/* A block hit at a [m/s]: b 0 basalt on basalt, 1 aluminium on aluminium (no damage), 2 pumice hit
   by nylon (pores and all), 3 the same from 12 spacings away, which it must not fly through. A slow
   one for longer: it takes its time. */
static void stress_impact(const stress_case *c, stress_world *w, stress_row *row) {
    int kind = (int)c->b;
    if (kind == 0) stress_solid(w, "basalt", NULL);
    else if (kind == 1) stress_solid(w, "aluminium", NULL);
    else stress_solid(w, "pumice", "nylon");
    if (kind >= 2) {
        stress_porous(w, sphpa_crush_pumice());
        w->flaws[0].k = 4e35; /* those of basalt, as in the examples */
        w->flaws[0].m = 9.0;
        w->flaws[0].alpha0 = w->crush[0].alpha0;
    }
    stress_strength(w);
    double away = kind == 3 ? 12.0 : 0.5, crossing = 8e-3 / stress_wave(w);
    double waves = kind == 3 ? 1.5 : c->a < 50.0 ? 25.0 : c->a < 500.0 ? 15.0 : 5.0;
    if (!stress_block_and_ball(w, row, c->a, away)) return;
    if (!stress_go(w, row, waves * crossing)) return;
    stress_impact_note(w, row);
    if (kind != 3) return;
    double kinetic = sphpa_sim_totals(&w->sim).kinetic / w->start.energy;
    row->error = kinetic; /* an inelastic collision of bodies that do not fly through each other */
    snprintf(row->note, sizeof row->note, "kinetic energy left %.3f of it", kinetic);
}

/* basalt hit at 1 km/s, with the Weibull exponent a and k = 4e35 m^-3, or b where it is given */
static void stress_weibull(const stress_case *c, stress_world *w, stress_row *row) {
    stress_solid(w, "basalt", NULL);
    for (int k = 0; k < STRESS_BODIES; k++) {
        w->flaws[k].k = c->b > 0.0 ? c->b : 4e35;
        w->flaws[k].m = c->a;
    }
    stress_strength(w);
    if (!stress_block_and_ball(w, row, 1000.0, 0.5)) return;
    if (!stress_go(w, row, 5.0 * 8e-3 / stress_wave(w))) return;
    stress_impact_note(w, row);
}

/* ---- solids: a piston in pores --------------------------------------------------------------- */

/* Two mirrored halves that meet at v: a piston in each. 1-D, `count` particles a half of length 0.1
   m; false: it ended. Then *off is the largest of the relative errors of P, rho and u behind the
   shock (mean of the particles from 0.4 to 0.7 of its exact way) against the exact Hugoniot. */
static bool stress_piston_run(stress_world *w, stress_row *row, double v, size_t count,
                              double *off) {
    const double length = 0.1, low[3] = {-length, 0.0, 0.0}, high[3] = {length, 0.0, 0.0};
    sphpa_palpha_shock exact;
    sphpa_body body;
    sphpa_error err;
    memset(&body, 0, sizeof body);
    err.message[0] = '\0';
    sphpa_result result = sphpa_palpha_hugoniot(w->matrix[0], &w->crush[0], v, &exact);
    if (result != SPHPA_OK)
        (void)sphpa_error_set(&err, result, "no exact shock at %g m/s: %s", v,
                              sphpa_result_message(result));
    body.alpha = w->crush[0].alpha0;
    body.rho = w->material[0].eos.rho0 / body.alpha;
    body.count = 2 * count;
    if (result == SPHPA_OK) result = sphpa_make_begin(&w->p, 1, &err);
    if (result == SPHPA_OK) result = sphpa_make_box(&w->p, low, high, &body, &err);
    if (stress_stopped(row, result, &err)) return false;
    for (size_t i = 0; i < w->p.n; i++)
        w->p.v[3 * i] = (sphpa_real)(w->p.x[3 * i] > 0.0 ? -v : v);
    double fastest = fmax(exact.speed, exact.precursor_speed), t = 0.8 * length / fastest;
    if (!stress_begin(w, row) || !stress_go(w, row, t)) return false;
    double front = ((exact.speed > 0.0 ? exact.speed : exact.precursor_speed) - v) * t;
    double P = 0.0, rho = 0.0, u = 0.0, alpha = 0.0, n = 0.0;
    for (size_t i = 0; i < w->sim.p.n; i++) {
        double x = w->sim.p.x[3 * i];
        if (x < 0.4 * front || x > 0.7 * front) continue;
        P += (double)w->sim.p.P[i], rho += w->sim.p.rho[i], u += w->sim.p.u[i];
        alpha += w->sim.p.alpha[i], n += 1.0;
    }
    *off = fmax(fabs(P / (n * exact.P) - 1.0), fabs(rho / (n * exact.rho) - 1.0));
    *off = fmax(*off, fabs(u / (n * exact.u) - 1.0));
    if (!(n > 0.0)) *off = HUGE_VAL;
    snprintf(row->note, sizeof row->note, "behind: alpha %.4f of exact %.4f, mean of %.0f",
             alpha / n, exact.alpha, n);
    return true;
}

/* alpha0 a; the matrix of pumice, a quadratic curve from 1 to 200 MPa, a piston of b [m/s] */
static void stress_alpha0(const stress_case *c, stress_world *w, stress_row *row) {
    double off = (double)NAN;
    stress_solid(w, "pumice", NULL);
    for (int k = 0; k < STRESS_BODIES; k++) w->solid_material[k].G = 0.0; /* as the Hugoniot */
    stress_porous(w, sphpa_crush_quadratic(c->a, 1e6, 2e8));
    if (stress_piston_run(w, row, c->b, 300, &off)) row->error = off;
}

/* ---- where the CFL number breaks ------------------------------------------------------------- */

typedef enum stress_cfl_kind {
    STRESS_CFL_GAS = 0, /* a Riemann problem, Sod's */
    STRESS_CFL_SOLID,   /* two elastic bars that meet */
    STRESS_CFL_POROUS   /* a piston in porous aluminium */
} stress_cfl_kind;

/* Sod's tube, 200 + 25 particles in [0, 1], mirrored: the error of rho at 0.2 s */
static double stress_cfl_gas(stress_world *w, stress_row *row) {
    const double gamma = 1.4, m = 0.5625 / 225.0;
    const sphpa_riemann_state left = {1.0, 0.0, 1.0}, right = {0.125, 0.0, 0.1};
    stress_gas(w, gamma);
    w->options.box.periodic[0] = 1;
    w->options.box.low[0] = -1.0;
    w->options.box.high[0] = 1.0;
    if (!stress_line(w, row, -1.0, -0.5, &right, gamma, m) ||
        !stress_line(w, row, -0.5, 0.5, &left, gamma, m) ||
        !stress_line(w, row, 0.5, 1.0, &right, gamma, m) || !stress_begin(w, row) ||
        !stress_go(w, row, 0.2))
        return HUGE_VAL;
    return stress_riemann_error(w, gamma, 0.5, &left, &right, 0.0, 1.0);
}

/* Two bars of basalt (Murnaghan; elastic, 1-D, 150 particles each) meet at 1 m/s: behind the waves,
   which run at c_l, they stand still. The mean |v - exact|, in m/s, when the waves have gone 0.6 of
   the bars. */
static double stress_cfl_solid(stress_world *w, stress_row *row) {
    const double low[3] = {-1.0, 0.0, 0.0}, high[3] = {1.0, 0.0, 0.0};
    sphpa_body body;
    sphpa_error err;
    memset(&body, 0, sizeof body);
    err.message[0] = '\0';
    stress_solid(w, "basalt", NULL);
    w->murnaghan.rho0 = w->material[0].eos.rho0;
    w->murnaghan.K = w->material[0].eos.A;
    w->murnaghan.n = 4.0;
    w->solid_material[0].eos = sphpa_murnaghan_eos(&w->murnaghan);
    body.rho = w->murnaghan.rho0;
    body.count = 300;
    sphpa_result result = sphpa_make_begin(&w->p, 1, &err);
    if (result == SPHPA_OK) result = sphpa_make_box(&w->p, low, high, &body, &err);
    if (stress_stopped(row, result, &err)) return HUGE_VAL;
    for (size_t i = 0; i < w->p.n; i++)
        w->p.v[3 * i] = (sphpa_real)(w->p.x[3 * i] > 0.0 ? -1.0 : 1.0);
    double speed = stress_wave(w), t = 0.6 / speed, off = 0.0;
    if (!stress_begin(w, row) || !stress_go(w, row, t)) return HUGE_VAL;
    for (size_t i = 0; i < w->n; i++) {
        double x = w->sim.p.x[3 * i], exact = fabs(x) < 0.6 ? 0.0 : x > 0.0 ? -1.0 : 1.0;
        off += fabs((double)w->sim.p.v[3 * i] - exact) / (double)w->n;
    }
    return off;
}

static double stress_cfl_porous(stress_world *w, stress_row *row) {
    double off = HUGE_VAL;
    stress_solid(w, "aluminium", NULL);
    for (int k = 0; k < STRESS_BODIES; k++) w->solid_material[k].G = 0.0;
    stress_porous(w, sphpa_crush_porous_aluminium());
    return stress_piston_run(w, row, 458.0, w->quick ? 100 : 200, &off) ? off : HUGE_VAL;
}

/* The error with a CFL number; HUGE_VAL where the run ended. alone: without the other limits. */
static double stress_cfl_error(const stress_case *c, stress_world *w, stress_row *row, double cfl) {
    int kind = (int)c->a;
    bool alone = ((int)c->b & 1) != 0;
    stress_clear(w);
    row->energy = 0.0;
    w->options.cfl = cfl;
    w->options.integrator = ((int)c->b & 2) != 0 ? SPHPA_RK2 : SPHPA_PREDICTOR_CORRECTOR;
    if (alone)
        w->options.force_cfl = w->options.flight = w->solid.rho_step = w->solid.u_step = 1e6;
    double off = kind == STRESS_CFL_GAS     ? stress_cfl_gas(w, row)
                 : kind == STRESS_CFL_SOLID ? stress_cfl_solid(w, row)
                                            : stress_cfl_porous(w, row);
    if (row->verdict == STRESS_TOO_SLOW && (double)w->sim.stats.steps >= w->most_steps)
        row->verdict = STRESS_STOPPED; /* a larger CFL number that takes more steps has broken */
    if (row->verdict == STRESS_STOPPED || row->verdict == STRESS_UNCLEAR) {
        row->verdict = STRESS_STOPPED; /* where it broke it need not say why */
        off = HUGE_VAL;
    }
    return row->energy <= STRESS_DRIFT ? off : HUGE_VAL;
}

/* Grows the CFL number until the run ends or its error is 1.5 times the one at 0.05 and 0.01 more,
   then halves the ratio between what held and what did not down to 2 %. a: what is run; b: bit 0,
   without the limits by force, density and energy, which otherwise hide it; bit 1, RK2. Wrong where
   the default, 0.3, does not hold. */
static void stress_cfl(const stress_case *c, stress_world *w, stress_row *row) {
    double base = stress_cfl_error(c, w, row, 0.05), bound = 1.5 * base + 0.01;
    if (row->verdict != STRESS_SURVIVED || !stress_finite(base)) return;
    w->most_steps = 2.0 * row->steps;
    double good = 0.05, bad = 0.0, off = base, at_default = stress_cfl_error(c, w, row, 0.3);
    double energy = row->energy, below = row->below;
    char why[48] = "nothing";
    for (double cfl = 0.1; cfl < 20.0 || bad > 0.0;) {
        if (row->verdict > STRESS_STOPPED) return;
        row->verdict = STRESS_SURVIVED;
        off = stress_cfl_error(c, w, row, cfl);
        if (off <= bound) good = cfl;
        else {
            bad = cfl;
            if (off < HUGE_VAL) snprintf(why, sizeof why, "error %.2g, was %.2g", off, base);
            else snprintf(why, sizeof why, "%.44s", row->message);
        }
        if (bad > 0.0 && bad < 1.02 * good) break;
        cfl = bad > 0.0 ? sqrt(good * bad) : 1.4 * cfl;
    }
    row->verdict = STRESS_SURVIVED;
    row->message[0] = '\0';
    row->number = bad > 0.0 ? bad : HUGE_VAL;
    row->error = at_default <= bound ? at_default : HUGE_VAL;
    row->energy = energy, row->below = below; /* of the default; the last trial may have broken */
    snprintf(row->note, sizeof row->note, "breaks at %.2f (default 0.3): %s", row->number, why);
}

/* ---- planted: what the guards must see ------------------------------------------------------- */

typedef enum stress_plant_kind {
    STRESS_PLANT_CRASH = 0,
    STRESS_PLANT_HANG,
    STRESS_PLANT_NAN,
    STRESS_PLANT_DRIFT,
    STRESS_PLANT_SLOW,
    STRESS_PLANT_END,
    STRESS_PLANTS
} stress_plant_kind;

static const stress_verdict stress_plant_verdict[STRESS_PLANTS] = {
    STRESS_CRASHED, STRESS_HUNG, STRESS_NOT_FINITE, STRESS_DRIFTS, STRESS_TOO_SLOW, STRESS_GAVE_UP};

/* A quiet gas, and after its first half a mistake of the kind a: the judge must find it. */
static void stress_plant(const stress_case *c, stress_world *w, stress_row *row) {
    const sphpa_riemann_state still = {1.0, 0.0, 1.0};
    stress_gas(w, 1.4);
    if (!stress_line(w, row, -0.5, 0.5, &still, 1.4, 0.01) || !stress_begin(w, row)) return;
    if ((int)c->a == STRESS_PLANT_SLOW) w->sim.options.dt_max = 1e-12;
    if ((int)c->a == STRESS_PLANT_END) w->sim.options.dt_min = 1.0;
    if (!stress_go(w, row, 0.05)) return;
    volatile int forever = 1;
    switch ((stress_plant_kind)c->a) {
    case STRESS_PLANT_CRASH: abort();
    case STRESS_PLANT_HANG:
        while (forever) continue;
        break;
    case STRESS_PLANT_NAN:
        w->sim.p.omega[3] = (sphpa_real)NAN;
        (void)stress_sound(&w->sim, row);
        break;
    case STRESS_PLANT_DRIFT:
        w->sim.p.u[3] *= 1.1;
        (void)stress_go(w, row, 0.1);
        break;
    case STRESS_PLANT_SLOW:
    case STRESS_PLANT_END:
    case STRESS_PLANTS: break;
    }
}

/* ---- the table ------------------------------------------------------------------------------- */

#define STRESS_GAP 0.1 /* [m] between clouds that start apart */
#ifdef SPHPA_FLOAT
#define STRESS_IN_FLOAT(words) words
#else
#define STRESS_IN_FLOAT(words) NULL
#endif

static const stress_case stress_cases[] = {
    {"ratio-1e5", "P 1 Pa and 1e-5 Pa, gamma 1.4", stress_ratio, 1e5, 0.0, 0.1, "rho, L1", 1, NULL},
    {"ratio-1e6", "P 1 Pa and 1e-6 Pa", stress_ratio, 1e6, 0.0, 0.1, "rho, L1", 0, NULL},
    {"ratio-1e7", "P 1 Pa and 1e-7 Pa", stress_ratio, 1e7, 0.0, 0.1, "rho, L1", 0, NULL},
    {"ratio-1e8", "P 1 Pa and 1e-8 Pa", stress_ratio, 1e8, 0.0, 0.1, "rho, L1", 0, NULL},
    {"ratio-1e9", "P 1 Pa and 1e-9 Pa", stress_ratio, 1e9, 0.0, 0.1, "rho, L1", 0, NULL},
    {"ratio-1e10", "P 1 Pa and 1e-10 Pa", stress_ratio, 1e10, 0.0, 0.1, "rho, L1", 1, NULL},
    {"scale-1e-12", "the tube of ratio-1e5 1e-12 m long", stress_ratio, 1e5, 1e-12, 0.1, "rho, L1",
     1, NULL},
    {"scale-1e20", "the same 1e20 m long", stress_ratio, 1e5, 1e20, 0.1, "rho, L1", 1,
     STRESS_IN_FLOAT("from 1e-16 to 1e+16 m")},
    {"wall-1e2", "two halves meet, Mach 1e2", stress_wall, 1e2, 0.0, 0.1, "rho, L1", 0, NULL},
    {"wall-1e4", "Mach 1e4", stress_wall, 1e4, 0.0, 0.1, "rho, L1", 1, NULL},
    {"wall-1e6", "Mach 1e6", stress_wall, 1e6, 0.0, 0.1, "rho, L1", 0, NULL},
    {"wall-inf", "of gas without any heat", stress_wall, 1e200, 0.0, 0.1, "rho, L1", 1, NULL},
    {"moving", "Sod's tube, all of it moving", stress_moving, 500.0, 0.0, 1.0, "at rest", 1, NULL},
    {"cold-still", "gas without heat or motion", stress_still, 0.0, 0.0, 1e-12, "energy", 1, NULL},
    {"gap-3", "the same with 0.1 m between, Mach 3", stress_wall, 3.0, STRESS_GAP, 0.1, "rho, L1",
     0, NULL},
    {"gap-10", "the same with 0.1 m between, Mach 10", stress_wall, 10.0, STRESS_GAP, 0.1,
     "rho, L1", 0, NULL},
    {"gap-50", "the same with 0.1 m between, Mach 50", stress_wall, 50.0, STRESS_GAP, 0.1,
     "rho, L1", 1, NULL},
    {"gap-1e2", "the same with 0.1 m between, Mach 1e2", stress_wall, 1e2, STRESS_GAP, 0.1,
     "rho, L1", 1, NULL},
    {"gap-1e4", "0.1 m between, Mach 1e4", stress_wall, 1e4, STRESS_GAP, 0.1, "rho, L1", 1, NULL},
    {"noh-2d", "Noh's problem in 2-D, Mach 1e4", stress_noh, 1e4, 2.0, 0.2, "rho behind", 0, NULL},
    {"noh-3d", "Noh in 3-D, Mach 1e4, 8000 particles", stress_noh, 1e4, 3.0, 0.0, "rho behind", 0,
     NULL},
    {"apart-2", "halves part at 2 m/s (Toro 2)", stress_apart, 2.0, 0.0, 0.1, "rho, L1", 1, NULL},
    {"apart-3.7", "at 3.7 m/s: vacuum from 3.742 on", stress_apart, 3.7, 0.0, 0.1, "rho, L1", 0,
     NULL},
    {"apart-10", "at 10 m/s: a vacuum opens", stress_apart, 10.0, 0.0, 0.1, "rho, L1", 0, NULL},
    {"apart-1000", "at 1000 m/s", stress_apart, 1000.0, 0.0, 0.1, "rho, L1", 1, NULL},
    {"free-3d", "hot ball into nothing, 3-D, gamma 5/3", stress_free, 3.0, 5.0 / 3.0, 0.01,
     "1 - K/E", 0, NULL},
    {"free-3d-1.4", "the same, gamma 1.4", stress_free, 3.0, 1.4, 0.05, "1 - K/E", 0, NULL},
    {"free-1d", "the same in 1-D, gamma 5/3", stress_free, 1.0, 5.0 / 3.0, 0.01, "1 - K/E", 1,
     NULL},
    {"impact-10", "basalt on basalt, 10 m/s", stress_impact, 10.0, 0.0, 0.0, "", 0, NULL},
    {"impact-100", "100 m/s", stress_impact, 100.0, 0.0, 0.0, "", 0, NULL},
    {"impact-1e3", "1 km/s", stress_impact, 1e3, 0.0, 0.0, "", 0, NULL},
    {"impact-5e3", "5 km/s", stress_impact, 5e3, 0.0, 0.0, "", 1, NULL},
    {"impact-1e4", "10 km/s", stress_impact, 1e4, 0.0, 0.0, "", 0, NULL},
    {"impact-3e4", "30 km/s", stress_impact, 3e4, 0.0, 0.0, "", 1, NULL},
    {"impact-1e5", "100 km/s, beyond what is asked", stress_impact, 1e5, 0.0, 0.0, "", 0, NULL},
    {"metal-5e3", "aluminium on aluminium, 5 km/s", stress_impact, 5e3, 1.0, 0.0, "", 0, NULL},
    {"metal-3e4", "30 km/s", stress_impact, 3e4, 1.0, 0.0, "", 0, NULL},
    {"pumice-100", "nylon on pumice, all of it, 100 m/s", stress_impact, 100.0, 2.0, 0.0, "", 0,
     NULL},
    {"pumice-3e3", "3 km/s", stress_impact, 3e3, 2.0, 0.0, "", 1, NULL},
    {"pumice-3e4", "30 km/s", stress_impact, 3e4, 2.0, 0.0, "", 0, NULL},
    {"far-3e4", "from 12 spacings away, 30 km/s", stress_impact, 3e4, 3.0, 0.9, "kinetic energy",
     0, NULL},
    {"far-3e5", "300 km/s", stress_impact, 3e5, 3.0, 0.9, "kinetic energy", 0, NULL},
    {"alpha-1.0001", "piston 1 km/s, alpha0 1.0001", stress_alpha0, 1.0001, 1000.0, 0.1,
     "behind the shock", 1, NULL},
    {"alpha-1.01", "alpha0 1.01", stress_alpha0, 1.01, 1000.0, 0.1, "behind the shock", 0, NULL},
    {"alpha-1.3", "alpha0 1.3", stress_alpha0, 1.3, 1000.0, 0.1, "behind the shock", 0, NULL},
    {"alpha-2", "alpha0 2", stress_alpha0, 2.0, 1000.0, 0.1, "behind the shock", 0, NULL},
    {"alpha-5", "alpha0 5", stress_alpha0, 5.0, 1000.0, 0.1, "behind the shock", 0, NULL},
    {"alpha-10", "alpha0 10", stress_alpha0, 10.0, 1000.0, 0.1, "behind the shock", 0, NULL},
    {"alpha-20", "alpha0 20", stress_alpha0, 20.0, 1000.0, 0.1, "behind the shock", 1, NULL},
    {"alpha-20-slow", "alpha0 20, piston 100 m/s", stress_alpha0, 20.0, 100.0, 0.1,
     "behind the shock", 0, NULL},
    {"alpha-20-fast", "alpha0 20, piston 10 km/s", stress_alpha0, 20.0, 1e4, 0.1,
     "behind the shock", 0, NULL},
    {"weibull-3", "impact 1 km/s, m 3, k 4e35", stress_weibull, 3.0, 0.0, 0.0, "", 1, NULL},
    {"weibull-6", "m 6", stress_weibull, 6.0, 0.0, 0.0, "", 0, NULL},
    {"weibull-9", "m 9", stress_weibull, 9.0, 0.0, 0.0, "", 0, NULL},
    {"weibull-14", "m 14", stress_weibull, 14.0, 0.0, 0.0, "", 0, NULL},
    {"weibull-20", "m 20", stress_weibull, 20.0, 0.0, 0.0, "", 1, NULL},
    {"weibull-k300", "m 20, k 1e300", stress_weibull, 20.0, 1e300, 0.0, "", 0, NULL},
    {"cfl-gas", "Sod's tube, all limits", stress_cfl, STRESS_CFL_GAS, 0.0, 1e9, "at 0.3", 0, NULL},
    {"cfl-gas-alone", "Courant's limit alone", stress_cfl, STRESS_CFL_GAS, 1.0, 1e9, "at 0.3", 1,
     NULL},
    {"cfl-gas-rk2", "alone, with RK2", stress_cfl, STRESS_CFL_GAS, 3.0, 1e9, "at 0.3", 0, NULL},
    {"cfl-solid", "elastic bars meet, all limits", stress_cfl, STRESS_CFL_SOLID, 0.0, 1e9, "at 0.3",
     0, NULL},
    {"cfl-solid-alone", "Courant's limit alone", stress_cfl, STRESS_CFL_SOLID, 1.0, 1e9, "at 0.3",
     1, NULL},
    {"cfl-solid-rk2", "alone, with RK2", stress_cfl, STRESS_CFL_SOLID, 3.0, 1e9, "at 0.3", 0, NULL},
    {"cfl-porous", "piston 458 m/s, all limits", stress_cfl, STRESS_CFL_POROUS, 0.0, 1e9, "at 0.3",
     0, NULL},
    {"cfl-porous-alone", "Courant's limit alone", stress_cfl, STRESS_CFL_POROUS, 1.0, 1e9, "at 0.3",
     1, NULL},
    {"cfl-porous-rk2", "alone, with RK2", stress_cfl, STRESS_CFL_POROUS, 3.0, 1e9, "at 0.3", 0,
     NULL},
    {"close-1e-3", "gas: two 1e-3 spacings apart", stress_close, 1e-3, 0.0, 0.0, "", 0, NULL},
    {"close-1e-6", "1e-6", stress_close, 1e-6, 0.0, 0.0, "", 1, NULL},
    {"close-1e-9", "1e-9", stress_close, 1e-9, 0.0, 0.0, "", 0, NULL},
    {"close-1e-15", "1e-15", stress_close, 1e-15, 0.0, 0.0, "", 1, NULL},
    {"close-0", "on one point", stress_close, 0.0, 0.0, 0.0, "", 1, "both lie at"},
    {"close-solid-1e-3", "basalt: two 1e-3 spacings apart", stress_close, 1e-3, 1.0, 0.0, "", 0,
     NULL},
    {"close-solid-1e-9", "1e-9", stress_close, 1e-9, 1.0, 0.0, "", 1, NULL},
    {"lone-gas", "one gas particle, h unbounded", stress_lone, STRESS_LONE_GAS, 0.0, 1e-6, "place",
     1, "h_max"},
    {"lone-gas-bound", "one gas particle, h_max", stress_lone, STRESS_LONE_BOUND, 0.0, 1e-6,
     "place", 1, NULL},
    {"lone-gas-box", "the same in a periodic box", stress_lone, STRESS_LONE_BOX, 0.0, 1e-6, "place",
     1, NULL},
    {"lone-gas-fast", "the same, Mach 1e3", stress_lone, STRESS_LONE_FAST, 0.0, 1e-6, "place",
     1, NULL},
    {"lone-solid", "one of basalt", stress_lone, STRESS_LONE_SOLID, 0.0, 1e-6, "place", 1, NULL},
    {"lone-porous", "one with pores", stress_lone, STRESS_LONE_POROUS, 0.0, 1e-6, "place", 1, NULL},
    {"box-heavy-1e2", "one particle of 1e2 masses in gas", stress_box, STRESS_BOX_HEAVY, 1e2, 0.0,
     "", 0, "half the periodic box"},
    {"box-heavy-1e4", "one of 1e4 masses", stress_box, STRESS_BOX_HEAVY, 1e4, 0.0, "", 1,
     "half the periodic box"},
    {"box-light-1e-4", "one of 1e-4 masses", stress_box, STRESS_BOX_HEAVY, 1e-4, 0.0, "", 1, NULL},
    {"box-light-1e-12", "one of 1e-12 masses", stress_box, STRESS_BOX_HEAVY, 1e-12, 0.0, "", 1,
     NULL},
    {"box-eta-0.6", "h too small for a density, eta 0.6", stress_box, STRESS_BOX_ETA, 0.6, 0.0,
     "", 1, "eta"},
    {"box-eta-0.8", "eta 0.8", stress_box, STRESS_BOX_ETA, 0.8, 0.0, "", 1, NULL},
    {"box-clump-1e-6", "nine particles within 1e-6 spacings", stress_box, STRESS_BOX_CLUMP, 1e-6,
     0.0, "", 1, NULL},
    {"box-half", "gas, half of a periodic box empty", stress_box, STRESS_BOX_HALF, 0.0, 0.0, "",
     1, NULL},
    {"box-point-1e6", "all energy in one particle, 1e6 times", stress_box, STRESS_BOX_POINT, 1e6,
     0.0, "", 1, "half the periodic box"},
    {"pairing-cubic-58", "cubic spline, 58 neighbours", stress_pairing, SPHPA_KERNEL_CUBIC, 58.0,
     0.0, "", 0, NULL},
    {"pairing-cubic-200", "cubic spline, 200", stress_pairing, SPHPA_KERNEL_CUBIC, 200.0, 0.0, "",
     1, NULL},
    {"pairing-quintic-200", "quintic spline, 200", stress_pairing, SPHPA_KERNEL_QUINTIC, 200.0, 0.0,
     "", 0, NULL},
    {"pairing-c2-200", "Wendland C2, 200", stress_pairing, SPHPA_KERNEL_WENDLAND_C2, 200.0, 0.01,
     "share of pairs", 1, NULL},
    {"pairing-c4-200", "Wendland C4, 200", stress_pairing, SPHPA_KERNEL_WENDLAND_C4, 200.0, 0.01,
     "share of pairs", 0, NULL},
    {"pairing-c6-200", "Wendland C6, 200", stress_pairing, SPHPA_KERNEL_WENDLAND_C6, 200.0, 0.01,
     "share of pairs", 0, NULL},
};

enum { STRESS_CASES = sizeof stress_cases / sizeof stress_cases[0] };

static const stress_case stress_plants[STRESS_PLANTS] = {
    {"planted-crash", "abort()", stress_plant, STRESS_PLANT_CRASH, 0.0, 0.0, "", 1, NULL},
    {"planted-hang", "a loop without end", stress_plant, STRESS_PLANT_HANG, 0.0, 0.0, "", 1, NULL},
    {"planted-nan", "a NaN", stress_plant, STRESS_PLANT_NAN, 0.0, 0.0, "", 1, NULL},
    {"planted-drift", "energy from nowhere", stress_plant, STRESS_PLANT_DRIFT, 0.0, 0.0, "", 1,
     NULL},
    {"planted-slow", "steps of 1e-12 s", stress_plant, STRESS_PLANT_SLOW, 0.0, 0.0, "", 1, NULL},
    {"planted-end", "a floor of dt that is too high", stress_plant, STRESS_PLANT_END, 0.0, 0.0, "", 1,
     NULL},
};

#endif
