/* test_grid: the finite volumes against exact solutions of Riemann problems, of smooth flows, of
   Sedov's and Noh's problems; conserved sums; symmetries, tiles and threads to the bit; what they
   do where density or pressure would not stay positive. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#define SPHPA_GRID_IMPLEMENTATION
#include "sphpa.h"

#include "near.h"

/* where the compiler fuses multiply and add, a + b c + d e depends on the order of its terms */
#if defined(__FMA__) || defined(__ARM_FEATURE_FMA) || defined(__aarch64__)
#define SAME_BITS 0
#else
#define SAME_BITS 1
#endif

/* ---- helpers --------------------------------------------------------------------------------- */

static sphpa_grid_options box(size_t nx, size_t ny, double low, double high) {
    sphpa_grid_options o;
    memset(&o, 0, sizeof o);
    o.nx = nx;
    o.ny = ny;
    for (int a = 0; a < 2; a++) o.low[a] = low, o.high[a] = high;
    return o;
}

static void edges(sphpa_grid_options *o, int edge) {
    for (int a = 0; a < 2; a++) o->edge_low[a] = o->edge_high[a] = edge;
}

static void must(sphpa_result result, const sphpa_error *err) {
    if (result != SPHPA_OK) print_error("%s\n", err->message);
    assert_int_equal(result, SPHPA_OK);
}

static sphpa_grid make(const sphpa_grid_options *o, sphpa_grid_function f, void *user,
                       int samples) {
    sphpa_grid grid;
    sphpa_error err;
    must(sphpa_grid_create(&grid, o, &err), &err);
    must(sphpa_grid_fill(&grid, f, user, samples, &err), &err);
    return grid;
}

static void run_to(sphpa_grid *grid, double t) {
    sphpa_grid_schedule s;
    sphpa_error err;
    memset(&s, 0, sizeof s);
    s.t_end = t;
    must(sphpa_grid_run(grid, &s, &err), &err);
    assert_true(grid->time == t);
}

static void steps(sphpa_grid *grid, int count) {
    sphpa_error err;
    for (int k = 0; k < count; k++) must(sphpa_grid_step(grid, HUGE_VAL, &err), &err);
}

static void copy(sphpa_grid *to, const sphpa_grid *from) {
    memcpy(to->rho, from->rho, from->n * sizeof(double));
    memcpy(to->mx, from->mx, from->n * sizeof(double));
    memcpy(to->my, from->my, from->n * sizeof(double));
    memcpy(to->E, from->E, from->n * sizeof(double));
}

static sphpa_grid_state at(const sphpa_grid *grid, size_t i, size_t j) {
    sphpa_grid_state q;
    memset(&q, 0x5a, sizeof q);
    assert_int_equal(sphpa_grid_primitive(grid, i, j, &q), SPHPA_OK);
    return q;
}

/* a flow without symmetry, smooth but for a jump, periodic in the unit square */
static void rough(const double x[2], void *user, sphpa_grid_state *out) {
    double a = 2.0 * SPHPA_PI_ * x[0], b = 2.0 * SPHPA_PI_ * x[1];
    (void)user;
    out->rho = 1.0 + 0.5 * sin(a + 0.3) * cos(b) + (sin(a) + sin(b + 1.0) > 1.0 ? 3.0 : 0.0);
    out->v[0] = 0.7 * sin(b) + 0.2;
    out->v[1] = 0.5 * cos(a + b) - 0.3;
    out->P = 1.0 + 0.4 * cos(a) * sin(b) + (sin(a) + sin(b + 1.0) > 1.0 ? 20.0 : 0.0);
}

/* ---- Riemann problems ------------------------------------------------------------------------ */

typedef struct tube {
    sphpa_riemann_state left, right;
    double t, shift; /* shift: of the velocities */
    int way;         /* 0 along x, 1 along y, 2 along the diagonal */
} tube;

static const tube toro[6] = {
    {{1.0, 0.0, 1.0}, {0.125, 0.0, 0.1}, 0.15, 0.0, 0},
    {{1.0, -2.0, 0.4}, {1.0, 2.0, 0.4}, 0.15, 0.0, 0},
    {{1.0, 0.0, 1000.0}, {1.0, 0.0, 0.01}, 0.0075, 0.0, 0},
    {{1.0, 0.0, 0.01}, {1.0, 0.0, 100.0}, 0.035, 0.0, 0},
    {{5.99924, 19.5975, 460.894}, {5.99242, -6.19633, 46.0950}, 0.035, 0.0, 0},
    {{0.445, 0.698, 3.528}, {0.5, 0.0, 0.571}, 0.14, 0.0, 0}, /* Lax's */
};

static double along(const tube *t, const double x[2]) {
    return t->way == 2 ? (x[0] + x[1]) * sqrt(0.5) : x[t->way];
}

static void tube_at(const double x[2], void *user, sphpa_grid_state *out) {
    const tube *t = (const tube *)user;
    const sphpa_riemann_state *side = along(t, x) < 0.0 ? &t->left : &t->right;
    double v = side->v + t->shift, half = sqrt(0.5);
    out->rho = side->rho;
    out->P = side->P;
    out->v[0] = t->way == 0 ? v : t->way == 1 ? 0.0 : half * v;
    out->v[1] = t->way == 0 ? 0.0 : t->way == 1 ? v : half * v;
}

/* mean of |rho - exact| over the cells where -0.5 < x < 0.5 along the tube, |across| < wide */
static double tube_error(const tube *t, const sphpa_grid *grid, double wide) {
    sphpa_riemann_star star;
    double sum = 0.0, count = 0.0;
    assert_int_equal(sphpa_riemann_exact(1.4, &t->left, &t->right, &star), SPHPA_OK);
    for (size_t k = 0; k < grid->n; k++) {
        double x[2] = {grid->options.low[0] + grid->dx[0] * ((double)(k % grid->nx) + 0.5),
                       grid->options.low[1] + grid->dx[1] * ((double)(k / grid->nx) + 0.5)};
        double s = along(t, x);
        sphpa_riemann_state exact;
        if (fabs(s) > 0.5 || (t->way == 2 && fabs(x[0] - x[1]) > wide)) continue;
        assert_int_equal(sphpa_riemann_sample(1.4, &t->left, &t->right, &star,
                                              s / grid->time - t->shift, &exact),
                         SPHPA_OK);
        sum += fabs(grid->rho[k] - exact.rho);
        count += 1.0;
    }
    return sum / count;
}

static double tube_run(const tube *t, size_t cells, const sphpa_grid_options *base) {
    sphpa_grid_options o = *base;
    tube copy_of = *t;
    o.nx = cells;
    sphpa_grid grid = make(&o, tube_at, &copy_of, 1);
    run_to(&grid, t->t);
    double error = tube_error(t, &grid, 1.0);
    assert_true(grid.stats.retries == 0);
    sphpa_grid_free(&grid);
    return error;
}

/* L1 of rho with 400 cells; pyro2's unsplit solver has 0.00112 and 0.0281 for the first two that
   are named (by running it). Limits are three halves of what was measured. */
static void riemann_problems(void **state) {
    (void)state;
    static const double limit[6] = {0.0011, 0.0021, 0.028, 0.045, 0.16, 0.0062};
    static const double order[6] = {0.8, 1.1, 1.2, 0.9, 0.75, 0.95};
    sphpa_grid_options o = box(400, 1, -0.5, 0.5);
    for (int k = 0; k < 6; k++) {
        double coarse = tube_run(&toro[k], 200, &o), fine = tube_run(&toro[k], 400, &o);
        assert_near_abs(fine, 0.0, limit[k]);
        assert_true(log(coarse / fine) / log(2.0) >= order[k]);
    }
}

/* what the parts are for: each makes some error smaller */
static void parts_of_the_scheme(void **state) {
    (void)state;
    sphpa_grid_options o = box(400, 1, -0.5, 0.5), other = o;
    double sod = tube_run(&toro[0], 400, &o);
    other.slope = SPHPA_GRID_MC;
    assert_true(tube_run(&toro[0], 400, &other) > 1.1 * sod);
    other.slope = SPHPA_GRID_UNLIMITED; /* wiggles, and it lives */
    assert_true(tube_run(&toro[0], 400, &other) > 1.2 * sod);
    other = o;
    other.first = 1.0; /* a full first step leaves more behind */
    assert_true(tube_run(&toro[0], 400, &other) > 1.1 * sod);
    other = o;
    other.gamma = 1.5; /* it is used */
    assert_true(tube_run(&toro[0], 400, &other) > 2.0 * sod);
}

/* the ringing behind a strong shock that moves slowly: flattening and viscosity still it */
static void ringing_behind_a_slow_shock(void **state) {
    (void)state;
    /* Mach 20 into rho = 1.4, P = 1 (c = 1), in a frame where it moves at 0.4 */
    double M = 20.0, P = 1.0 + 2.8 / 2.4 * (M * M - 1.0), v = M - 0.4;
    double rho = 1.4 * 2.4 * M * M / (0.4 * M * M + 2.0);
    tube t = {{0.0, 0.0, 0.0}, {1.4, 0.0, 1.0}, 0.5, 0.0, 0};
    t.left.rho = rho, t.left.P = P, t.left.v = M * (1.0 - 1.4 / rho) - v, t.right.v = -v;
    double total[3];
    for (int k = 0; k < 3; k++) {
        sphpa_grid_options o = box(200, 1, -0.5, 0.5);
        o.unflattened = k > 0;
        o.viscosity = k > 1 ? -1.0 : 0.0;
        sphpa_grid grid = make(&o, tube_at, &t, 1);
        run_to(&grid, t.t); /* at x = 0.2, cell 140 */
        total[k] = 0.0;
        for (size_t i = 1; i < 134; i++) total[k] += fabs(grid.rho[i] - grid.rho[i - 1]) / rho;
        sphpa_grid_free(&grid);
    }
    assert_near_abs(total[0], 0.0, 0.35);
    assert_true(1.3 * total[0] < total[1] && 2.0 * total[1] < total[2]);
}

static void along_x_and_along_y(void **state) {
    (void)state;
    static const size_t across[3] = {1, 2, 7};
    for (int k = 0; k < 3; k++)
        for (int which = 0; which < 3; which++) {
            tube t = toro[which];
            sphpa_grid_options o = box(97, across[k], -0.5, 0.5), p = box(across[k], 97, -0.5, 0.5);
            o.low[1] = p.low[0] = 0.0;
            o.high[1] = p.high[0] = (double)across[k] / 97.0;
            sphpa_grid x = make(&o, tube_at, &t, 1);
            t.way = 1;
            sphpa_grid y = make(&p, tube_at, &t, 1);
            run_to(&x, 0.4 * t.t);
            run_to(&y, 0.4 * t.t);
            for (size_t i = 0; i < 97; i++)
                for (size_t j = 0; j < across[k]; j++) {
                    size_t a = i + 97 * j, b = j + across[k] * i;
                    if (SAME_BITS)
                        assert_true(x.rho[a] == y.rho[b] && x.mx[a] == y.my[b] &&
                                    x.E[a] == y.E[b] && y.mx[b] == 0.0);
                    assert_near(x.rho[a], y.rho[b], 1e-11);
                    assert_true(x.rho[a] == x.rho[i]); /* rows are alike */
                }
            sphpa_grid_free(&x);
            sphpa_grid_free(&y);
        }
}

/* a row of its own and a row among others, to rounding: what is done for y does nothing */
static void one_row_is_like_many(void **state) {
    (void)state;
    tube t = toro[0];
    sphpa_grid_options o = box(100, 1, -0.5, 0.5), p = box(100, 4, -0.5, 0.5);
    p.high[1] = -0.5 + 0.04; /* square cells */
    o.first = p.first = 1.0;
    sphpa_grid one = make(&o, tube_at, &t, 1), many = make(&p, tube_at, &t, 1);
    sphpa_error err;
    for (int k = 0; k < 30; k++) {
        must(sphpa_grid_step(&one, 0.001, &err), &err);
        must(sphpa_grid_step(&many, 0.001, &err), &err);
        assert_true(one.dt == 0.001 && many.dt == 0.001);
    }
    for (size_t i = 0; i < 100; i++) assert_near(one.rho[i], many.rho[i + 200], 1e-12);
    sphpa_grid_free(&one);
    sphpa_grid_free(&many);
}

/* Sod's tube across the cells: what the edges do does not reach the strip by then */
static void along_the_diagonal(void **state) {
    (void)state;
    double error[2];
    for (int k = 0; k < 2; k++) {
        tube t = toro[0];
        size_t n = k == 0 ? 128 : 256;
        t.way = 2;
        sphpa_grid_options o = box(n, n, -0.8, 0.8);
        sphpa_grid grid = make(&o, tube_at, &t, 4);
        run_to(&grid, t.t);
        error[k] = tube_error(&t, &grid, 0.2);
        sphpa_grid_free(&grid);
    }
    /* cells along the tube as wide as with 80 and 160 in it, but cut across */
    assert_near_abs(error[1], 0.0, 0.0025);
    assert_true(log(error[0] / error[1]) / log(2.0) >= 0.9);
}

/* ---- smooth flows ---------------------------------------------------------------------------- */

/* a wave of density that is carried along, through a periodic box */
static void wave_at(const double x[2], void *user, sphpa_grid_state *out) {
    int two = *(const int *)user;
    out->rho = 1.0 + 0.2 * sin(2.0 * SPHPA_PI_ * (x[0] + (two ? x[1] : 0.0)));
    out->v[0] = 1.0;
    out->v[1] = two ? 0.5 : 0.0;
    out->P = 1.0;
}

/* a vortex that is carried along (Shu 1998, ICASE 97-65), strength 5 */
static void vortex_at(const double x[2], void *user, sphpa_grid_state *out) {
    double r2 = x[0] * x[0] + x[1] * x[1], f = 2.5 / SPHPA_PI_ * exp(0.5 * (1.0 - r2));
    double T = 1.0 - 0.4 / 2.8 * f * f;
    (void)user;
    out->rho = pow(T, 2.5);
    out->v[0] = 1.0 - x[1] * f;
    out->v[1] = 1.0 + x[0] * f;
    out->P = pow(T, 3.5);
}

/* mean of |rho - rho at the start| after the flow has gone round */
static double round_trip(const sphpa_grid_options *o, sphpa_grid_function f, int two, double t) {
    sphpa_grid grid = make(o, f, &two, 6), start = make(o, f, &two, 6);
    double sum = 0.0;
    run_to(&grid, t);
    for (size_t k = 0; k < grid.n; k++) sum += fabs(grid.rho[k] - start.rho[k]);
    sum /= (double)grid.n;
    sphpa_grid_free(&grid);
    sphpa_grid_free(&start);
    return sum;
}

/* Second order in the mean with every slope: limiters clip the two extrema of the wave, where they
   are of first order, but on a part of it that shrinks. Their error is three times that of
   unlimited slopes. */
static void waves_are_of_second_order(void **state) {
    (void)state;
    for (int slope = 0; slope <= SPHPA_GRID_UNLIMITED; slope++)
        for (int two = 0; two < (SMALL ? 1 : 2); two++) {
            double e[2];
            for (size_t k = 0; k < 2; k++) {
                sphpa_grid_options o = box((size_t)64 << k, two ? (size_t)64 << k : 1, 0.0, 1.0);
                edges(&o, SPHPA_GRID_PERIODIC);
                o.slope = slope;
                e[k] = round_trip(&o, wave_at, two, two ? 2.0 : 1.0);
            }
            assert_true(log(e[0] / e[1]) / log(2.0) >= 1.95);
            assert_near_abs(e[1], 0.0,
                            slope == SPHPA_GRID_UNLIMITED ? (two ? 1.4e-4 : 5e-5)
                                                          : (two ? 4.3e-4 : 1.9e-4));
        }
}

static void vortex_is_of_second_order(void **state) {
    (void)state;
    double e[2];
    for (size_t k = 0; k < 2; k++) {
        sphpa_grid_options o = box((size_t)64 << k, (size_t)64 << k, -5.0, 5.0);
        edges(&o, SPHPA_GRID_PERIODIC);
        e[k] = round_trip(&o, vortex_at, 0, 10.0);
    }
    assert_true(log(e[0] / e[1]) / log(2.0) >= 2.0);
    assert_near_abs(e[1], 0.0, 1.7e-4);
}

/* a contact stays one: P and v keep their values, however fast it is carried along */
static void frames(void **state) {
    (void)state;
    static const double speed[4] = {0.0, 0.1, 1.0, 10.0};
    double error[4];
    for (int k = 0; k < 4; k++) {
        tube t = {{1.0, 0.0, 1.0}, {0.125, 0.0, 1.0}, 1.0, 0.0, 0};
        t.shift = speed[k];
        sphpa_grid_options o = box(100, 1, -0.5, 0.5);
        edges(&o, SPHPA_GRID_PERIODIC);
        sphpa_grid grid = make(&o, tube_at, &t, 1), start = make(&o, tube_at, &t, 1);
        run_to(&grid, k == 0 ? 1.0 : 1.0 / speed[k]);
        error[k] = 0.0;
        for (size_t i = 0; i < 100; i++) {
            sphpa_grid_state q = at(&grid, i, 0);
            assert_near(q.P, 1.0, 1e-11 * (1.0 + speed[k] * speed[k]));
            assert_near_abs(q.v[0], speed[k], 1e-12 * (1.0 + speed[k]));
            error[k] += 0.01 * fabs(q.rho - start.rho[i]);
        }
        sphpa_grid_free(&grid);
        sphpa_grid_free(&start);
    }
    assert_true(error[0] == 0.0); /* HLLC keeps a contact at rest */
    for (int k = 1; k < 4; k++) assert_near_abs(error[k], 0.0, 0.045);
}

static void uniform_flow_stays(void **state) {
    (void)state;
    for (int k = 0; k < 4; k++) {
        tube t = {{1.3, 0.0, 0.7}, {1.3, 0.0, 0.7}, 1.0, 0.0, 0};
        t.shift = k < 2 ? 3.7 : 0.0;
        t.way = k == 1 ? 2 : 0;
        sphpa_grid_options o = box(33, k < 2 ? 21 : 1, 0.0, 1.0);
        o.radial = k < 2 ? 0 : k - 1;
        sphpa_grid grid = make(&o, tube_at, &t, 1), start = make(&o, tube_at, &t, 1);
        for (size_t i = 0; k > 1 && i < grid.n; i++) /* means along a radius have rounded */
            grid.rho[i] = start.rho[i] = 1.3, grid.E[i] = start.E[i] = 1.75;
        steps(&grid, 50);
        for (size_t i = 0; i < grid.n; i++)
            assert_true(grid.rho[i] == start.rho[i] && grid.mx[i] == start.mx[i] &&
                        grid.my[i] == start.my[i] && grid.E[i] == start.E[i]);
        sphpa_grid_free(&grid);
        sphpa_grid_free(&start);
    }
}

/* ---- strong explosions and implosions -------------------------------------------------------- */

typedef struct charge {
    double r0, rho_in, P_in, rho, P, v; /* v: radial velocity outside */
} charge;

static void charge_at(const double x[2], void *user, sphpa_grid_state *out) {
    const charge *c = (const charge *)user;
    double r = sqrt(x[0] * x[0] + x[1] * x[1]), v = r >= c->r0 && r > 0.0 ? c->v / r : 0.0;
    out->rho = r < c->r0 ? c->rho_in : c->rho;
    out->P = r < c->r0 ? c->P_in : c->P;
    out->v[0] = v * x[0];
    out->v[1] = v * x[1];
}

/* along a radius: the middle of y is 0 */
static sphpa_grid_options radius(size_t n, double high, int radial) {
    sphpa_grid_options o = box(n, 1, 0.0, high);
    o.radial = radial;
    o.low[1] = -0.5, o.high[1] = 0.5;
    o.edge_low[0] = SPHPA_GRID_REFLECTING;
    return o;
}

/* outermost place on the x axis, or on the diagonal, where rho exceeds half of its most */
static double shock_place(const sphpa_grid *grid, size_t j0, bool diagonal, double *most) {
    double dx = grid->dx[0], place = 0.0;
    *most = 0.0;
    for (size_t i = 0; i < grid->nx; i++)
        *most = fmax(*most, grid->rho[i + grid->nx * (diagonal ? i : j0)]);
    for (size_t i = 0; i + 1 < grid->nx; i++) {
        double a = grid->rho[i + grid->nx * (diagonal ? i : j0)], half = 0.5 * *most;
        double b = grid->rho[i + 1 + grid->nx * (diagonal ? i + 1 : j0)];
        if (a >= half && b < half)
            place = grid->options.low[0] + dx * ((double)i + 0.5 + (a - half) / (a - b));
    }
    return diagonal ? sqrt(2.0) * place : place;
}

/* Energy 1 in a disc or ball of r0, shock at R = 1: xi0 of Sedov 1959 */
static double sedov_P(int radial, double r0) {
    return 0.4 / (radial == 2 ? 4.0 / 3.0 * SPHPA_PI_ * r0 * r0 * r0 : SPHPA_PI_ * r0 * r0);
}

static void sedov_along_a_radius(void **state) {
    (void)state;
    static const double xi[3] = {0.0, 1.0040216, 1.0327775};
    for (int radial = 1; radial <= 2; radial++) {
        double miss[2], most[2];
        for (int k = 0; k < 2; k++) {
            charge c = {0.03, 1.0, 0.0, 1.0, 1e-5, 0.0};
            sphpa_grid_options o = radius(k == 0 ? 240 : 480, 1.2, radial);
            c.P_in = sedov_P(radial, c.r0);
            sphpa_grid grid = make(&o, charge_at, &c, 1);
            run_to(&grid, pow(xi[radial], -0.5 * (radial + 3)));
            miss[k] = shock_place(&grid, 0, false, &most[k]) - 1.0;
            sphpa_grid_free(&grid);
        }
        assert_near_abs(miss[1], 0.0, 0.0055);
        assert_true(miss[0] > 1.8 * miss[1] && miss[1] > 0.0); /* of first order, both */
        assert_true(6.0 - most[1] < 0.85 && 6.0 - most[0] > 1.3 * (6.0 - most[1]));
        assert_true(most[1] < 6.0);
    }
}

static void sedov_in_the_plane(void **state) {
    (void)state;
    if (SMALL) skip();
    double axis[2], diagonal[2], most[2];
    for (int k = 0; k < 2; k++) {
        charge c = {0.06, 1.0, 0.0, 1.0, 1e-5, 0.0};
        size_t n = k == 0 ? 101 : 201;
        sphpa_grid_options o = box(n, n, -1.2, 1.2);
        c.P_in = sedov_P(1, c.r0);
        sphpa_grid grid = make(&o, charge_at, &c, 8);
        run_to(&grid, pow(1.0040216, -2.0));
        axis[k] = shock_place(&grid, n / 2, false, &most[k]) - 1.0;
        diagonal[k] = shock_place(&grid, n / 2, true, &most[k]) - 1.0;
        sphpa_grid_free(&grid);
    }
    /* about a cell, also along the diagonal */
    assert_near_abs(axis[1], 0.0, 0.018);
    assert_near_abs(diagonal[1], 0.0, 0.012);
    assert_true(axis[0] > 2.0 * axis[1] && diagonal[0] > 2.0 * diagonal[1]);
    assert_true(most[0] + 0.4 < most[1] && most[1] > 4.4 && most[1] < 6.0);
}

/* shock at 0.2, density 4, 16, 64 behind it; the plateau without the centre, where walls heat */
static void noh(void **state) {
    (void)state;
    for (int radial = 0; radial <= 2; radial++) {
        double error[2], want = pow(4.0, radial + 1);
        for (int k = 0; k < 2; k++) {
            charge c = {0.0, 1.0, 1.0, 1.0, 1e-6, -1.0};
            sphpa_grid_options o = radius(k == 0 ? 200 : 400, 1.6, radial);
            o.gamma = 5.0 / 3.0;
            sphpa_grid grid = make(&o, charge_at, &c, 1);
            run_to(&grid, 0.6);
            double sum = 0.0, count = 0.0;
            for (size_t i = 0; i < grid.n; i++) {
                double r = grid.dx[0] * ((double)i + 0.5);
                if (r < 0.05 || r > 0.35) continue;
                sum += fabs(grid.rho[i] - (r < 0.2 ? want : pow(1.0 + 0.6 / r, radial)));
                count += 1.0;
            }
            error[k] = sum / count / want;
            sphpa_grid_free(&grid);
        }
        assert_near_abs(error[1], 0.0, radial == 0 ? 0.0065 : radial == 1 ? 0.021 : 0.046);
        assert_true(log(error[0] / error[1]) / log(2.0) >= 0.75);
    }
}

/* Woodward & Colella 1984, J. Comput. Phys. 54, 115: two blasts meet */
static void blasts_at(const double x[2], void *user, sphpa_grid_state *out) {
    (void)user;
    out->rho = 1.0;
    out->v[0] = out->v[1] = 0.0;
    out->P = x[0] < 0.1 ? 1000.0 : x[0] < 0.9 ? 0.01 : 100.0;
}

/* In their figure 2 the density has a peak behind the shock at 0.65, and the densest gas is between
   contacts at 0.76 and 0.80. */
static void woodward_colella(void **state) {
    (void)state;
    enum { FINE = 1200 };
    double error[2];
    sphpa_grid_options o = box(FINE, 1, 0.0, 1.0);
    edges(&o, SPHPA_GRID_REFLECTING);
    sphpa_grid fine = make(&o, blasts_at, NULL, 1);
    run_to(&fine, 0.038);
    size_t right = 0, left = 0;
    for (size_t i = 0; i < FINE; i++) {
        if (fine.rho[i] > fine.rho[right]) right = i;
        if (i < FINE * 7 / 10 && fine.rho[i] > fine.rho[left]) left = i;
    }
    size_t low = right, high = right; /* where it is 0.9 of its most */
    while (fine.rho[low - 1] > 0.9 * fine.rho[right]) low--;
    while (fine.rho[high + 1] > 0.9 * fine.rho[right]) high++;
    assert_near_abs(0.5 * (double)(low + high + 1) / FINE, 0.78, 0.005);
    assert_near_abs(((double)left + 0.5) / FINE, 0.65, 0.005);
    for (int k = 0; k < 2; k++) {
        size_t n = k == 0 ? 200 : 400, each = FINE / n;
        o.nx = n;
        sphpa_grid grid = make(&o, blasts_at, NULL, 1);
        run_to(&grid, 0.038);
        error[k] = 0.0;
        for (size_t i = 0; i < n; i++) {
            double mean = 0.0;
            for (size_t m = 0; m < each; m++) mean += fine.rho[each * i + m] / (double)each;
            error[k] += fabs(grid.rho[i] - mean) / (double)n;
        }
        sphpa_grid_free(&grid);
    }
    assert_near_abs(error[1], 0.0, 0.09);
    assert_true(log(error[0] / error[1]) / log(2.0) >= 0.9);
    sphpa_grid_free(&fine);
}

/* ---- conserved sums -------------------------------------------------------------------------- */

static void check_budget(const sphpa_grid *grid, const sphpa_grid_sums *start, double tol,
                         bool momentum) {
    sphpa_grid_sums now = sphpa_grid_totals(grid);
    double push = sqrt(2.0 * start->mass * start->energy);
    assert_near(now.mass + grid->left.mass, start->mass, tol);
    assert_near(now.energy + grid->left.energy, start->energy, tol);
    for (int a = 0; momentum && a < 2; a++)
        assert_near_abs(now.momentum[a] + grid->left.momentum[a], start->momentum[a], tol * push);
}

static void closed_boxes_keep_all(void **state) {
    (void)state;
    for (int k = 0; k < 4; k++) {
        sphpa_grid_options o = box(61, 43, 0.0, 1.0);
        edges(&o, k % 2 == 0 ? SPHPA_GRID_PERIODIC : SPHPA_GRID_REFLECTING);
        if (k == 2) o.edge_low[1] = o.edge_high[1] = SPHPA_GRID_REFLECTING;
        if (k == 3) o.ny = 1;
        sphpa_grid grid = make(&o, rough, NULL, 2);
        sphpa_grid_sums start = sphpa_grid_totals(&grid);
        steps(&grid, 200);
        check_budget(&grid, &start, 1e-13, true);
        assert_near_abs(grid.left.mass, 0.0, 1e-14 * start.mass);
        assert_near_abs(grid.left.energy, 0.0, 1e-14 * start.energy);
        sphpa_grid_free(&grid);
    }
}

static void open_edges_count_what_leaves(void **state) {
    (void)state;
    for (int k = 0; k < 5; k++) {
        sphpa_grid_options o = box(61, k < 1 ? 43 : 1, 0.0, 1.0);
        if (k == 1) o.nx = 1, o.ny = 61; /* a column */
        o.radial = k > 2 ? k - 2 : 0;
        o.high[1] = 0.7;
        if (k == 4) o.low[0] = 0.25; /* a shell */
        sphpa_grid grid = make(&o, rough, NULL, 2);
        sphpa_grid_sums start = sphpa_grid_totals(&grid);
        steps(&grid, 200);
        check_budget(&grid, &start, 1e-13, o.radial == 0);
        assert_true(fabs(grid.left.mass) > 0.01 * start.mass);
        sphpa_grid_free(&grid);
    }
}

/* volumes and areas: a full disc and ball */
static void radial_sums(void **state) {
    (void)state;
    for (int radial = 1; radial <= 2; radial++) {
        charge c = {0.0, 1.0, 1.0, 2.0, 3.0, 0.0};
        sphpa_grid_options o = radius(50, 1.5, radial);
        double V = radial == 1 ? SPHPA_PI_ * 2.25 : 4.0 / 3.0 * SPHPA_PI_ * 3.375;
        sphpa_grid grid = make(&o, charge_at, &c, 3);
        sphpa_grid_sums sums = sphpa_grid_totals(&grid);
        assert_near(sums.mass, 2.0 * V, 1e-14);
        assert_near(sums.energy, 7.5 * V, 1e-14);
        sphpa_grid_free(&grid);
    }
}

/* ---- the same bits --------------------------------------------------------------------------- */

typedef struct view {
    int mirror_x, mirror_y, transpose;
} view;

/* rough() seen otherwise, cell by cell, so that positions do not round */
static sphpa_grid seen(const sphpa_grid *from, const view *v) {
    sphpa_grid_options o = from->options;
    sphpa_grid to;
    sphpa_error err;
    must(sphpa_grid_create(&to, &o, &err), &err);
    for (size_t j = 0; j < from->ny; j++)
        for (size_t i = 0; i < from->nx; i++) {
            size_t a = i + from->nx * j, x = v->mirror_x ? from->nx - 1 - i : i;
            size_t y = v->mirror_y ? from->ny - 1 - j : j, b = v->transpose ? y + to.nx * x
                                                                           : x + to.nx * y;
            double mx = v->mirror_x ? -from->mx[a] : from->mx[a];
            double my = v->mirror_y ? -from->my[a] : from->my[a];
            to.rho[b] = from->rho[a];
            to.mx[b] = v->transpose ? my : mx;
            to.my[b] = v->transpose ? mx : my;
            to.E[b] = from->E[a];
        }
    return to;
}

static void mirrors_and_transposition(void **state) {
    (void)state;
    static const view views[5] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {1, 0, 1}};
    for (int k = 0; k < 10; k++) {
        sphpa_grid_options o = box(58, 58, 0.0, 1.0);
        edges(&o, k < 5 ? SPHPA_GRID_OUTFLOW : SPHPA_GRID_REFLECTING);
        sphpa_grid a = make(&o, rough, NULL, 1), b = seen(&a, &views[k % 5]);
        steps(&a, 40);
        steps(&b, 40);
        sphpa_grid c = seen(&a, &views[k % 5]);
        assert_true(!SAME_BITS || a.dt == b.dt);
        for (size_t i = 0; i < a.n; i++) {
            if (SAME_BITS)
                assert_true(b.rho[i] == c.rho[i] && b.mx[i] == c.mx[i] && b.my[i] == c.my[i] &&
                            b.E[i] == c.E[i]);
            assert_near(b.rho[i], c.rho[i], 1e-10);
        }
        sphpa_grid_free(&a);
        sphpa_grid_free(&b);
        sphpa_grid_free(&c);
    }
}

/* A periodic flow and several copies of it side by side: other tiles, other ends of rows, the same
   bits in each copy. Copies of copies are wider and higher than a tile. */
static void tiles_do_not_show(void **state) {
    (void)state;
    enum { NX = 40, NY = 24, X = 11, Y = 7 };
    sphpa_grid_options o = box(NX, NY, 0.0, 1.0), p = box(X * NX, Y * NY, 0.0, 0.0);
    edges(&o, SPHPA_GRID_PERIODIC);
    edges(&p, SPHPA_GRID_PERIODIC);
    sphpa_grid one = make(&o, rough, NULL, 1), many;
    sphpa_error err;
    p.high[0] = X * NX * one.dx[0];
    p.high[1] = Y * NY * one.dx[1];
    must(sphpa_grid_create(&many, &p, &err), &err);
    many.dx[0] = one.dx[0], many.dx[1] = one.dx[1]; /* to the bit */
    for (size_t k = 0; k < many.n; k++) {
        size_t from = k % (X * NX) % NX + NX * (k / (X * NX) % NY);
        many.rho[k] = one.rho[from], many.mx[k] = one.mx[from];
        many.my[k] = one.my[from], many.E[k] = one.E[from];
    }
    steps(&one, 12);
    steps(&many, 12);
    assert_true(one.dt == many.dt);
    for (size_t k = 0; k < many.n; k++) {
        size_t from = k % (X * NX) % NX + NX * (k / (X * NX) % NY);
        assert_true(many.rho[k] == one.rho[from] && many.mx[k] == one.mx[from] &&
                    many.my[k] == one.my[from] && many.E[k] == one.E[from]);
    }
    sphpa_grid_free(&one);
    sphpa_grid_free(&many);
}

/* two opposed streams, so thin and cold in the middle that cells fall back to first order */
static void parting_at(const double x[2], void *user, sphpa_grid_state *out) {
    double v = *(const double *)user;
    out->rho = 1.0;
    out->P = 0.01;
    out->v[0] = x[0] > 0.0 ? v : -v;
    out->v[1] = x[1] > 0.0 ? v : -v;
}

/* bands of rows and threads, with fallbacks too: one thread makes other bands than eight */
static void any_number_of_threads(void **state) {
    (void)state;
#ifdef _OPENMP
    int most = omp_get_max_threads();
    double v = 10.0;
    for (int k = 0; k < 2; k++) {
        sphpa_grid_options o = box(230, 150, k == 0 ? 0.0 : -1.0, 1.0);
        sphpa_grid first = make(&o, k == 0 ? rough : parting_at, &v, 1), other;
        for (int threads = 1; threads <= 8; threads *= SMALL ? 8 : 2) {
            omp_set_num_threads(threads);
            other = make(&o, k == 0 ? rough : parting_at, &v, 1);
            sphpa_grid *grid = threads == 1 ? &first : &other;
            steps(grid, 40);
            sphpa_grid_sums a = sphpa_grid_totals(&first), b = sphpa_grid_totals(grid);
            assert_true(a.mass == b.mass && a.energy == b.energy &&
                        first.left.energy == grid->left.energy && first.dt == grid->dt);
            assert_true(first.stats.fallbacks == grid->stats.fallbacks);
            assert_memory_equal(first.rho, grid->rho, first.n * sizeof(double));
            assert_memory_equal(first.my, grid->my, first.n * sizeof(double));
            assert_memory_equal(first.E, grid->E, first.n * sizeof(double));
            sphpa_grid_free(&other);
        }
        assert_true((first.stats.fallbacks > 0) == (k == 1));
        sphpa_grid_free(&first);
    }
    omp_set_num_threads(most);
#endif
}

/* ---- at the edge of what there is ------------------------------------------------------------ */

static void check_positive(const sphpa_grid *grid) {
    for (size_t k = 0; k < grid->n; k++) {
        sphpa_grid_state q = at(grid, k % grid->nx, k / grid->nx);
        assert_true(q.rho > 0.0 && q.P > 0.0 && q.P < HUGE_VAL);
    }
}

/* 816:1 in rho and 5.2e6:1 in P, and into next to nothing; full first steps too */
static void charges_on_any_mesh(void **state) {
    (void)state;
    for (int k = 0; k < 20; k += SMALL ? 3 : 1) {
        static const size_t cells[5] = {9, 16, 33, 50, 97};
        charge c = {0.2, 1000.0, 5.3272e11, 1.225, 1.02e5, 0.0};
        sphpa_grid_options o = box(cells[k % 5], cells[k % 5] + (size_t)(k % 2), -1.0, 1.0);
        o.first = k < 10 ? 0.0 : 1.0;
        if (k / 5 % 2 == 1) c.P = 1e-5;
        sphpa_grid grid = make(&o, charge_at, &c, k % 3 == 0 ? 1 : 4);
        sphpa_grid_sums start = sphpa_grid_totals(&grid);
        steps(&grid, 120);
        check_positive(&grid);
        check_budget(&grid, &start, 1e-13, true);
        assert_true(grid.stats.fallbacks == 0);
        sphpa_grid_free(&grid);
    }
}

/* Slopes without limits overshoot at the charge's rim: states at faces that are not positive become
   means, and few cells need to fall back for that. */
static void slopes_that_overshoot(void **state) {
    (void)state;
    charge c = {0.2, 1000.0, 5.3272e11, 1.225, 1.02e5, 0.0};
    sphpa_grid_options o = box(33, 33, -1.0, 1.0);
    o.slope = SPHPA_GRID_UNLIMITED;
    o.unflattened = 1;
    sphpa_grid grid = make(&o, charge_at, &c, 4);
    sphpa_grid_sums start = sphpa_grid_totals(&grid);
    steps(&grid, 80);
    check_positive(&grid);
    check_budget(&grid, &start, 1e-13, true);
    assert_true(grid.stats.fallbacks > 0 && grid.stats.fallbacks < 120);
    sphpa_grid_free(&grid);
}

/* a fallback is made, and loses nothing */
static void fallbacks_lose_nothing(void **state) {
    (void)state;
    for (int k = 0; k < 6; k++) {
        double v = k == 0 ? 2.0 : 10.0;
        sphpa_grid_options o = box(k < 3 ? 50 : 49, k == 1 ? 1 : 40, -1.0, 1.0);
        edges(&o, k == 5 ? SPHPA_GRID_PERIODIC : k == 4 ? SPHPA_GRID_REFLECTING : 0);
        sphpa_grid grid = make(&o, parting_at, &v, 1);
        sphpa_grid_sums start = sphpa_grid_totals(&grid);
        steps(&grid, 100);
        check_positive(&grid);
        check_budget(&grid, &start, 1e-13, true);
        assert_true((grid.stats.fallbacks > 0) == (k != 1)); /* in 1-D none is needed */
        sphpa_grid_free(&grid);
    }
}

typedef struct noise {
    sphpa_rng rng;
    double span, mach;
} noise;

static void noise_at(const double x[2], void *user, sphpa_grid_state *out) {
    noise *n = (noise *)user;
    (void)x;
    out->rho = exp(n->span * (2.0 * sphpa_rng_uniform(&n->rng) - 1.0));
    out->P = exp(n->span * (2.0 * sphpa_rng_uniform(&n->rng) - 1.0));
    double c = sqrt(out->P / out->rho);
    for (int a = 0; a < 2; a++)
        out->v[a] = n->mach * c * (2.0 * sphpa_rng_uniform(&n->rng) - 1.0);
}

/* signals so fast that a step is lost in the time: an error, not a run without end */
static void a_clock_that_stands_is_told(void **state) {
    (void)state;
    sphpa_grid_options o = box(8, 8, 0.0, 1.0);
    noise still = {sphpa_rng_seed(7, 1), 0.0, 0.0};
    double dt = 0.0;
    sphpa_error err;
    sphpa_grid_schedule schedule;
    sphpa_grid grid = make(&o, noise_at, &still, 1);
    memset(&schedule, 0, sizeof schedule);
    grid.time = 1.0;
    grid.E[8 * 3 + 5] = 1e40;
    assert_int_equal(sphpa_grid_limit(&grid, &dt, &err), SPHPA_ERROR_STATE);
    assert_non_null(strstr(err.message, "cell (5, 3)"));
    assert_int_equal(sphpa_grid_step(&grid, HUGE_VAL, &err), SPHPA_ERROR_STATE);
    schedule.t_end = 2.0;
    assert_int_equal(sphpa_grid_run(&grid, &schedule, &err), SPHPA_ERROR_STATE);
    assert_non_null(strstr(err.message, "lost in the time"));
    sphpa_grid_free(&grid);
}

/* Cells without any order, Mach 100: steps fail; they leave the grid alone and say where; half of
   the time does, and sphpa_grid_run finds that out. */
static void failed_steps(void **state) {
    (void)state;
    noise n = {sphpa_rng_seed(7, 1), 8.0, 100.0};
    sphpa_grid_options o = box(60, 50, 0.0, 1.0);
    edges(&o, SPHPA_GRID_PERIODIC);
    o.first = 1.0;
    sphpa_grid grid = make(&o, noise_at, &n, 1), before = make(&o, noise_at, &n, 1);
    sphpa_grid_sums start = sphpa_grid_totals(&grid);
    int failed = 0;
    for (int k = 0; k < 100; k++) {
        double dt = 0.0;
        sphpa_error err;
        copy(&before, &grid);
        sphpa_grid_stats stats = grid.stats;
        sphpa_result result = sphpa_grid_step(&grid, HUGE_VAL, &err);
        if (result == SPHPA_OK) continue;
        failed++;
        assert_int_equal(result, SPHPA_ERROR_STATE);
        assert_non_null(strstr(err.message, "smaller"));
        assert_memory_equal(before.rho, grid.rho, grid.n * sizeof(double));
        assert_memory_equal(before.E, grid.E, grid.n * sizeof(double));
        assert_memory_equal(&stats, &grid.stats, sizeof stats);
        must(sphpa_grid_limit(&grid, &dt, &err), &err);
        must(sphpa_grid_step(&grid, dt / 16.0, &err), &err);
    }
    check_positive(&grid);
    check_budget(&grid, &start, 1e-13, true);
    assert_true(failed > 3);
    n.rng = sphpa_rng_seed(7, 1);
    sphpa_grid again = make(&o, noise_at, &n, 1);
    run_to(&again, grid.time);
    assert_true(again.stats.retries > 0);
    check_budget(&again, &start, 1e-13, true);
    sphpa_grid_free(&grid);
    sphpa_grid_free(&before);
    sphpa_grid_free(&again);
}

/* any number of cells, any edges */
static void all_sizes(void **state) {
    (void)state;
    static const size_t cells[8] = {1, 2, 3, 4, 9, 190, 191, 381};
    for (int k = 0; k < 8 * 8 * 4; k++) {
        size_t nx = cells[k % 8], ny = cells[k / 8 % 8];
        if (nx * ny > 4000) continue;
        sphpa_grid_options o = box(nx, ny, 0.0, 1.0);
        edges(&o, k / 64 % 3);
        if (k / 64 == 3) o.edge_low[0] = SPHPA_GRID_REFLECTING, o.edge_high[1] = 1;
        sphpa_grid grid = make(&o, rough, NULL, 1);
        sphpa_grid_sums start = sphpa_grid_totals(&grid);
        steps(&grid, 6);
        check_positive(&grid);
        check_budget(&grid, &start, 1e-13, true);
        sphpa_grid_free(&grid);
    }
}

/* ---- calls ----------------------------------------------------------------------------------- */

static void create_refuses(void **state) {
    (void)state;
    sphpa_grid_options good = box(4, 4, 0.0, 1.0), o;
    sphpa_grid grid;
    sphpa_error err;
#define REFUSED(change, result, word)                                                              \
    o = good;                                                                                      \
    change;                                                                                        \
    assert_int_equal(sphpa_grid_create(&grid, &o, &err), result);                                  \
    assert_non_null(strstr(err.message, word));                                                    \
    assert_true(grid.rho == NULL && grid.n == 0)
    REFUSED(o.nx = 0, SPHPA_ERROR_RANGE, "0 by 4");
    REFUSED(o.ny = (size_t)-1 / 4, SPHPA_ERROR_RANGE, "cells");
    REFUSED(o.high[1] = 0.0, SPHPA_ERROR_RANGE, "axis 1");
    REFUSED(o.low[0] = (double)NAN, SPHPA_ERROR_NOT_FINITE, "axis 0");
    REFUSED(o.gamma = 1.0, SPHPA_ERROR_RANGE, "gamma = 1");
    REFUSED(o.gamma = (double)NAN, SPHPA_ERROR_NOT_FINITE, "gamma");
    REFUSED(o.cfl = 1.5, SPHPA_ERROR_RANGE, "cfl = 1.5");
    REFUSED(o.cfl = -0.1, SPHPA_ERROR_RANGE, "cfl");
    REFUSED(o.viscosity = 2.0, SPHPA_ERROR_RANGE, "viscosity = 2");
    REFUSED(o.first = 1.5, SPHPA_ERROR_RANGE, "first = 1.5");
    REFUSED(o.growth = 0.5, SPHPA_ERROR_RANGE, "growth = 0.5");
    REFUSED(o.edge_low[1] = 3, SPHPA_ERROR_RANGE, "edges 3");
    REFUSED(o.edge_low[0] = SPHPA_GRID_PERIODIC, SPHPA_ERROR_RANGE, "periodic");
    REFUSED(o.slope = 3, SPHPA_ERROR_RANGE, "slope = 3");
    REFUSED(o.radial = 1, SPHPA_ERROR_RANGE, "radial = 1");
    REFUSED(o.radial = 3, SPHPA_ERROR_RANGE, "radial = 3");
    REFUSED((o.radial = 2, o.ny = 1, o.low[0] = -1.0), SPHPA_ERROR_RANGE, "x >= 0");
#undef REFUSED
    assert_int_equal(sphpa_grid_create(&grid, &good, NULL), SPHPA_OK);
    assert_true(grid.options.gamma == 1.4 && grid.options.cfl == 0.8 && grid.n == 16);
    assert_near(at(&grid, 3, 3).P, 1.0, 1e-15);
    sphpa_grid_free(&grid);
    sphpa_grid_free(&grid); /* twice does no harm */
}

static void bad_at(const double x[2], void *user, sphpa_grid_state *out) {
    rough(x, NULL, out);
    if (x[0] > 0.6 && x[1] > 0.6) out->P = *(const double *)user;
}

static void fill_and_step_refuse(void **state) {
    (void)state;
    sphpa_grid_options o = box(5, 4, 0.0, 1.0);
    sphpa_grid grid = make(&o, rough, NULL, 1);
    sphpa_error err;
    sphpa_grid_state q;
    double P = -1.0, dt = 3.0, rho = grid.rho[7];
    assert_int_equal(sphpa_grid_fill(&grid, bad_at, &P, 1, &err), SPHPA_ERROR_NEGATIVE);
    assert_non_null(strstr(err.message, "P = -1"));
    P = (double)NAN;
    assert_int_equal(sphpa_grid_fill(&grid, bad_at, &P, 1, &err), SPHPA_ERROR_NOT_FINITE);
    assert_int_equal(sphpa_grid_fill(&grid, rough, NULL, -1, &err), SPHPA_ERROR_RANGE);
    assert_true(grid.rho[7] == rho);
    assert_int_equal(sphpa_grid_step(&grid, 0.0, &err), SPHPA_ERROR_RANGE);
    assert_int_equal(sphpa_grid_step(&grid, (double)NAN, &err), SPHPA_ERROR_RANGE);
    assert_int_equal(sphpa_grid_primitive(&grid, 5, 0, &q), SPHPA_ERROR_RANGE);
    assert_int_equal(sphpa_grid_primitive(&grid, 0, 4, &q), SPHPA_ERROR_RANGE);
    for (int k = 0; k < 4; k++) { /* the cell is named, the grid left alone */
        static const double bad[4] = {-1.0, 0.0, (double)NAN, HUGE_VAL};
        double keep = grid.E[13];
        grid.E[13] = bad[k];
        dt = 3.0;
        assert_int_equal(sphpa_grid_limit(&grid, &dt, &err), SPHPA_ERROR_STATE);
        assert_true(dt == 3.0);
        assert_non_null(strstr(err.message, "cell (3, 2)"));
        assert_int_equal(sphpa_grid_step(&grid, HUGE_VAL, NULL), SPHPA_ERROR_STATE);
        grid.E[13] = keep;
    }
    assert_true(grid.time == 0.0 && grid.stats.steps == 0 && grid.rho[7] == rho);
    sphpa_grid_free(&grid);
}

/* (8), by hand: the first step a tenth, then a quarter more each, then the limit, also where
   dt_limit cuts one */
static void lengths_of_steps(void **state) {
    (void)state;
    tube t = {{1.4, 3.0, 1.0}, {1.4, 3.0, 1.0}, 1.0, 0.0, 0};
    sphpa_grid_options o = box(10, 5, 0.0, 1.0);
    sphpa_grid grid = make(&o, tube_at, &t, 1);
    double full = 0.8 * 0.1 / 4.0, dt = 0.0, want = 0.1 * full;
    sphpa_error err;
    for (int k = 0; k < 14; k++) {
        must(sphpa_grid_limit(&grid, &dt, &err), &err);
        assert_near(dt, fmin(want, full), 1e-13);
        must(sphpa_grid_step(&grid, k == 5 ? 1e-6 : HUGE_VAL, &err), &err);
        assert_near(grid.dt, k == 5 ? 1e-6 : fmin(want, full), 1e-13);
        want *= 1.25;
    }
    sphpa_grid_free(&grid);
    o = box(5, 10, 0.0, 1.0);
    o.high[0] = 0.1; /* narrow cells: (0.02 m)/4 against (0.1 m)/1 */
    o.first = 1.0, o.cfl = 0.5;
    grid = make(&o, tube_at, &t, 1);
    must(sphpa_grid_limit(&grid, &dt, &err), &err);
    assert_near(dt, 0.5 * 0.02 / 4.0, 1e-14);
    sphpa_grid_free(&grid);
}

typedef struct log_book {
    int outputs, steps, fail_at;
    double time[20];
    volatile int stop;
} log_book;

static sphpa_result note_output(sphpa_grid *grid, void *user, sphpa_error *err) {
    log_book *book = (log_book *)user;
    (void)err;
    if (book->outputs < 20) book->time[book->outputs] = grid->time;
    book->outputs++;
    return SPHPA_OK;
}

static sphpa_result note_step(sphpa_grid *grid, void *user, sphpa_error *err) {
    log_book *book = (log_book *)user;
    (void)grid;
    if (++book->steps == book->fail_at)
        return sphpa_error_set(err, SPHPA_ERROR_FILE, "as wished");
    return SPHPA_OK;
}

static void runs_land_on_their_times(void **state) {
    (void)state;
    sphpa_grid_options o = box(20, 1, 0.0, 1.0);
    sphpa_grid grid = make(&o, rough, NULL, 1);
    log_book book;
    sphpa_grid_schedule s;
    sphpa_error err;
    memset(&book, 0, sizeof book);
    memset(&s, 0, sizeof s);
    s.t_end = 0.1, s.every = 0.03, s.user = &book;
    s.output = note_output, s.step = note_step;
    must(sphpa_grid_run(&grid, &s, &err), &err);
    assert_int_equal(book.outputs, 5);
    for (int k = 0; k < 5; k++) assert_near_abs(book.time[k], fmin(0.03 * k, 0.1), 1e-15);
    assert_true(book.steps == (int)grid.stats.steps && grid.time == 0.1);
    s.t_end = 0.2, s.resumed = 1; /* no output at once */
    book.outputs = 0;
    must(sphpa_grid_run(&grid, &s, &err), &err);
    assert_true(book.outputs == 4 && fabs(book.time[0] - 0.12) < 1e-15);
    s.t_end = 0.3;
    book.fail_at = book.steps + 2;
    assert_int_equal(sphpa_grid_run(&grid, &s, &err), SPHPA_ERROR_FILE);
    book.stop = 1;
    s.stop = &book.stop;
    int before = book.steps;
    assert_int_equal(sphpa_grid_run(&grid, &s, &err), SPHPA_STOPPED);
    assert_true(book.steps == before + 1);
    s.t_end = (double)NAN;
    assert_int_equal(sphpa_grid_run(&grid, &s, &err), SPHPA_ERROR_RANGE);
    sphpa_grid_free(&grid);
}

/* cell means: of the conserved quantities, by volume along a radius */
static void ramp_at(const double x[2], void *user, sphpa_grid_state *out) {
    (void)user;
    out->rho = 1.0 + x[0];
    out->v[0] = x[0];
    out->v[1] = x[1];
    out->P = 1.0;
}

static void means_of_cells(void **state) {
    (void)state;
    sphpa_grid_options o = box(1, 1, 0.0, 1.0);
    o.nx = 2, o.ny = 2;
    sphpa_grid grid = make(&o, ramp_at, NULL, 100);
    assert_near(grid.rho[1], 1.75, 1e-14);
    assert_near(grid.mx[1], 0.75 + (1.0 - 0.125) / 1.5, 3e-5);      /* mean of x + x^2 */
    assert_near(grid.my[2], 0.75 * 1.25, 1e-14);                    /* of y (1 + x), apart */
    sphpa_grid_free(&grid);
    o.ny = 1, o.radial = 2;
    grid = make(&o, ramp_at, NULL, 400);
    /* of 1 + r by r^2 dr over 1/2 to 1 */
    assert_near(grid.rho[1], 1.0 + (0.9375 / 4.0) / (0.875 / 3.0), 1e-6);
    sphpa_grid_free(&grid);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(riemann_problems),
        cmocka_unit_test(parts_of_the_scheme),
        cmocka_unit_test(ringing_behind_a_slow_shock),
        cmocka_unit_test(along_x_and_along_y),
        cmocka_unit_test(one_row_is_like_many),
        cmocka_unit_test(along_the_diagonal),
        cmocka_unit_test(waves_are_of_second_order),
        cmocka_unit_test(vortex_is_of_second_order),
        cmocka_unit_test(frames),
        cmocka_unit_test(uniform_flow_stays),
        cmocka_unit_test(sedov_along_a_radius),
        cmocka_unit_test(sedov_in_the_plane),
        cmocka_unit_test(noh),
        cmocka_unit_test(woodward_colella),
        cmocka_unit_test(closed_boxes_keep_all),
        cmocka_unit_test(open_edges_count_what_leaves),
        cmocka_unit_test(radial_sums),
        cmocka_unit_test(mirrors_and_transposition),
        cmocka_unit_test(tiles_do_not_show),
        cmocka_unit_test(any_number_of_threads),
        cmocka_unit_test(charges_on_any_mesh),
        cmocka_unit_test(slopes_that_overshoot),
        cmocka_unit_test(fallbacks_lose_nothing),
        cmocka_unit_test(failed_steps),
        cmocka_unit_test(a_clock_that_stands_is_told),
        cmocka_unit_test(all_sizes),
        cmocka_unit_test(create_refuses),
        cmocka_unit_test(fill_and_step_refuse),
        cmocka_unit_test(lengths_of_steps),
        cmocka_unit_test(runs_land_on_their_times),
        cmocka_unit_test(means_of_cells),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
