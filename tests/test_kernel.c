/* The smoothing kernels against their published pieces in long double, quadratures, identities. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>
#include <string.h>

#include "sphpa.h"

#include "near.h"

#define PI_L 3.14159265358979323846264338327950288L
#define EPS 2.2204460492503131e-16

static const double knots[7][4] = {{0, 1, 2, 2},     {0, 0.5, 1.5, 2.5}, {0, 1, 2, 3}, {0, 2, 2, 2},
                                   {0, 2, 2, 2},     {0, 2, 2, 2},       {0, 1, 2, 3}};

/* sum of the magnitudes that the library's form of w adds at q = 0, over w(0): how much their
   rounding is amplified: (2^3/4 + 1)/1 for the cubic, (3^5 + 6 2^5 + 15)/66 for the quintic */
static const double amplified[7] = {3.0, 4.6, 6.9, 1.0, 1.0, 1.0, 1.0};

#define FOR_ALL(k, dim)                                                                            \
    for (int k = 0; k < (int)SPHPA_KERNEL_COUNT; k++)                                              \
        for (int dim = 1; dim <= 3; dim++)

static sphpa_kernel kernel(int k) { return (sphpa_kernel)k; }

/* ---- an independent statement: the pieces written out, long double, by Horner -----------------*/

static long double poly(long double q, int n, const long double *c) {
    long double sum = 0.0L;
    for (int i = 0; i < n; i++) sum = sum * q + c[i];
    return sum;
}

/* M4, M5, M6 in q = r/h with their unnormalised pieces expanded, highest power first */
static long double spline_piece(int k, int piece, long double q) {
    static const long double cubic[2][4] = {{0.75L, -1.5L, 0.0L, 1.0L},
                                            {-0.25L, 1.5L, -3.0L, 2.0L}};
    static const long double quartic[3][5] = {{6.0L, 0.0L, -15.0L, 0.0L, 14.375L},
                                              {-4.0L, 20.0L, -30.0L, 5.0L, 13.75L},
                                              {1.0L, -10.0L, 37.5L, -62.5L, 39.0625L}};
    static const long double quintic[3][6] = {{-10.0L, 30.0L, 0.0L, -60.0L, 0.0L, 66.0L},
                                              {5.0L, -45.0L, 150.0L, -210.0L, 75.0L, 51.0L},
                                              {-1.0L, 15.0L, -90.0L, 270.0L, -405.0L, 243.0L}};
    if (k == 0) return poly(q, 4, cubic[piece]);
    return k == 1 ? poly(q, 5, quartic[piece]) : poly(q, 6, quintic[piece]);
}

/* Dehnen and Aly 2012, table 1, in x = r/H with H = 2h */
static long double wendland(int k, int dim, long double x) {
    long double t = 1.0L - x;
    if (dim == 1) {
        if (k == 3) return powl(t, 3) * (1.0L + 3.0L * x);
        if (k == 4) return powl(t, 5) * (1.0L + 5.0L * x + 8.0L * x * x);
        return powl(t, 7) * (1.0L + 7.0L * x + 19.0L * x * x + 21.0L * x * x * x);
    }
    if (k == 3) return powl(t, 4) * (1.0L + 4.0L * x);
    if (k == 4) return powl(t, 6) * (1.0L + 6.0L * x + 35.0L / 3.0L * x * x);
    return powl(t, 8) * (1.0L + 8.0L * x + 25.0L * x * x + 32.0L * x * x * x);
}

/* the smooth continuation of the piece of W (h = 1) that holds q = at, evaluated at q */
static long double reference(int k, int dim, long double q, double at) {
    static const long double C[3][3] = {
        {5.0L / 4.0L, 7.0L / PI_L, 21.0L / (2.0L * PI_L)},
        {3.0L / 2.0L, 9.0L / PI_L, 495.0L / (32.0L * PI_L)},
        {55.0L / 32.0L, 78.0L / (7.0L * PI_L), 1365.0L / (64.0L * PI_L)}};
    static const long double N[3][3] = {
        {2.0L / 3.0L, 10.0L / (7.0L * PI_L), 1.0L / PI_L},
        {1.0L / 24.0L, 96.0L / (1199.0L * PI_L), 1.0L / (20.0L * PI_L)},
        {1.0L / 120.0L, 7.0L / (478.0L * PI_L), 1.0L / (120.0L * PI_L)}};
    if (at >= sphpa_kernel_support(kernel(k))) return 0.0L;
    if (k == 6) return powl(PI_L, -0.5L * (long double)dim) * expl(-q * q);
    if (k >= 3) {
        long double scale = powl(2.0L, (long double)dim);
        return C[k - 3][dim - 1] / scale * wendland(k, dim, 0.5L * q);
    }
    int piece = at < knots[k][1] ? 0 : (at < knots[k][2] ? 1 : 2);
    return N[k][dim - 1] * spline_piece(k, piece, q);
}

/* first and second derivative at q by central differences of order 8 in long double */
static void differences(int k, int dim, double q, double *first, double *second) {
    static const long double a[4] = {4.0L / 5.0L, -1.0L / 5.0L, 4.0L / 105.0L, -1.0L / 280.0L};
    static const long double b[4] = {8.0L / 5.0L, -1.0L / 5.0L, 8.0L / 315.0L, -1.0L / 560.0L};
    const long double step = 0.00390625L, wide = 2.0L * step; /* 2^-8, 2^-7 */
    long double x = (long double)q, d1 = 0.0L, d2 = -205.0L / 72.0L * reference(k, dim, x, q);
    for (int i = 0; i < 4; i++) {
        long double dx = (long double)(i + 1) * step, wx = 2.0L * dx;
        d1 += a[i] * (reference(k, dim, x + dx, q) - reference(k, dim, x - dx, q));
        d2 += b[i] * (reference(k, dim, x + wx, q) + reference(k, dim, x - wx, q));
    }
    *first = (double)(d1 / step);
    *second = (double)(d2 / (wide * wide));
}

/* ---- quadrature: 24 Gauss-Legendre points between knots: exact for these polynomials ----------*/

typedef double (*integrand)(int k, int dim, double r, double h);

static double gauss(integrand g, int k, int dim, double h, double a, double b) {
    const int n = 24;
    double sum = 0.0;
    for (int i = 0; i < n; i++) {
        double x = cos(3.14159265358979324 * ((double)i + 0.75) / ((double)n + 0.5)), dp = 1.0;
        for (int pass = 0; pass < 50; pass++) {
            double p0 = 1.0, p1 = x;
            for (int m = 2; m <= n; m++) {
                double p2 = ((2.0 * m - 1.0) * x * p1 - (m - 1.0) * p0) / m;
                p0 = p1;
                p1 = p2;
            }
            dp = n * (x * p1 - p0) / (x * x - 1.0);
            double dx = p1 / dp;
            x -= dx;
            if (fabs(dx) < 1e-16) break;
        }
        double weight = 2.0 / ((1.0 - x * x) * dp * dp);
        sum += weight * g(k, dim, 0.5 * (a + b) + 0.5 * (b - a) * x, h);
    }
    return 0.5 * (b - a) * sum;
}

/* over all space, the surface of the unit sphere being 2, 2 pi, 4 pi */
static double over_space(integrand g, int k, int dim, double h) {
    static const double surface[3] = {2.0, 6.28318530717958648, 12.5663706143591730};
    double sum = 0.0;
    for (int i = 0; i < 3; i++)
        if (knots[k][i + 1] > knots[k][i])
            sum += gauss(g, k, dim, h, knots[k][i] * h, knots[k][i + 1] * h);
    return surface[dim - 1] * sum;
}

static double radial(int dim, double r) { return dim == 1 ? 1.0 : (dim == 2 ? r : r * r); }
static double mass(int k, int dim, double r, double h) {
    return radial(dim, r) * sphpa_kernel_w(kernel(k), dim, r, h);
}
static double second_moment(int k, int dim, double r, double h) {
    return r * r * mass(k, dim, r, h);
}
static double mass_rate(int k, int dim, double r, double h) {
    return radial(dim, r) * sphpa_kernel_dw_dh(kernel(k), dim, r, h);
}
/* r dW/dr integrates to -dim by parts */
static double slope_moment(int k, int dim, double r, double h) {
    return r * radial(dim, r) * sphpa_kernel_dw(kernel(k), dim, r, h);
}
/* r^2 d2W/dr2 integrates to dim (dim + 1) */
static double curvature_moment(int k, int dim, double r, double h) {
    return r * r * radial(dim, r) * sphpa_kernel_d2w(kernel(k), dim, r, h);
}

static double central(int k, int dim) { return sphpa_kernel_w(kernel(k), dim, 0.0, 1.0); }

/* ---- tests ----------------------------------------------------------------------------------- */

static void normalisation(void **state) {
    (void)state;
    const double tail[3] = {erfc(3.0), exp(-9.0),
                            erfc(3.0) + 6.0 / sqrt(3.14159265358979324) * exp(-9.0)};
    FOR_ALL(k, dim) {
        double missing = k == 6 ? tail[dim - 1] : 0.0;
        assert_near_abs(over_space(mass, k, dim, 1.0), 1.0 - missing, 1e-13);
        assert_near_abs(over_space(mass, k, dim, 0.037), 1.0 - missing, 1e-13);
    }
    assert_near(tail[0], 2.2e-5, 0.02); /* the figures that the banner states */
    assert_near(tail[1], 1.2e-4, 0.04);
    assert_near(tail[2], 4.4e-4, 0.02);
}

static void moments(void **state) {
    (void)state;
    /* integral of r^2 W in units of h^2, exact (integrated symbolically); a B-spline M_n in 1-D is
       the density of a sum of n uniform numbers: n/12 */
    static const double exact[6][3] = {{1.0 / 3.0, 31.0 / 49.0, 9.0 / 10.0},
                                       {5.0 / 12.0, 9759.0 / 12208.0, 23.0 / 20.0},
                                       {1.0 / 2.0, 2771.0 / 2868.0, 7.0 / 5.0},
                                       {8.0 / 21.0, 5.0 / 9.0, 4.0 / 5.0},
                                       {4.0 / 15.0, 14.0 / 33.0, 8.0 / 13.0},
                                       {8.0 / 39.0, 12.0 / 35.0, 1.0 / 2.0}};
    FOR_ALL(k, dim) {
        if (k == 6) continue;
        assert_near(over_space(second_moment, k, dim, 1.0), exact[k][dim - 1], 1e-13);
        assert_near(over_space(second_moment, k, dim, 3.0), 9.0 * exact[k][dim - 1], 1e-13);
        assert_near(over_space(slope_moment, k, dim, 1.0), -dim, 1e-13);
        assert_near(over_space(curvature_moment, k, dim, 1.0), dim * (dim + 1), 1e-12);
        assert_near_abs(over_space(mass_rate, k, dim, 1.0), 0.0, 1e-12);
    }
}

/* B-splines at unit spacing sum to 1 wherever they are sampled */
static void partition_of_unity(void **state) {
    (void)state;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 100; i++) {
            double x = 0.01 * i, sum = 0.0;
            for (int j = -4; j <= 4; j++) sum += sphpa_kernel_w(kernel(k), 1, fabs(x - j), 1.0);
            assert_near(sum, 1.0, 4.0 * EPS * amplified[k]);
        }
}

/* sums over a lattice: exact where splines add up to 1, else by the pieces in long double */
static void lattices(void **state) {
    (void)state;
    static const double etas[6] = {0.2, 0.5, 1.0, 1.2, 1.5, 3.0};
    for (int k = 0; k < 3; k++)
        for (int n = 1; n <= 3; n++)
            assert_near(sphpa_kernel_lattice(kernel(k), 1, n), 1.0, 8.0 * EPS * amplified[k]);
    FOR_ALL(k, dim) {
        double support = sphpa_kernel_support(kernel(k));
        for (int e = 0; e < 6; e++) {
            long double sum = 0.0L, eta = etas[e];
            for (int c = dim > 2 ? -10 : 0; c <= (dim > 2 ? 10 : 0); c++)
                for (int b = dim > 1 ? -10 : 0; b <= (dim > 1 ? 10 : 0); b++)
                    for (int a = -10; a <= 10; a++) {
                        long double q = sqrtl((long double)(a * a + b * b + c * c)) / eta;
                        if (q < support) sum += reference(k, dim, q, (double)q) / powl(eta, dim);
                    }
            double found = sphpa_kernel_lattice(kernel(k), dim, etas[e]);
            assert_near(found, (double)sum, 3e-14);
            if (etas[e] == 0.2) /* alone */
                assert_near(found, sphpa_kernel_w(kernel(k), dim, 0.0, 0.2), EPS);
        }
        const double bad[5] = {0.0, -1.0, HUGE_VAL, -HUGE_VAL, (double)NAN};
        for (int b = 0; b < 5; b++)
            assert_true(isnan(sphpa_kernel_lattice(kernel(k), dim, bad[b])));
    }
    assert_true(isnan(sphpa_kernel_lattice(SPHPA_KERNEL_COUNT, 2, 1.2)));
    assert_true(isnan(sphpa_kernel_lattice(SPHPA_KERNEL_CUBIC, 0, 1.2)));
    assert_true(isnan(sphpa_kernel_lattice(SPHPA_KERNEL_CUBIC, 4, 1.2)));
}

static void values_and_derivatives(void **state) {
    (void)state;
    FOR_ALL(k, dim) {
        double top = central(k, dim), support = sphpa_kernel_support(kernel(k));
        for (int i = 0; i < 400; i++) {
            double q = support * ((double)i + 0.37) / 400.0, d1, d2;
            double w = sphpa_kernel_w(kernel(k), dim, q, 1.0);
            assert_near_abs(w, (double)reference(k, dim, (long double)q, q),
                            4.0 * EPS * amplified[k] * top);
            differences(k, dim, q, &d1, &d2);
            assert_near_abs(sphpa_kernel_dw(kernel(k), dim, q, 1.0), d1, 2e-15 * top);
            assert_near_abs(sphpa_kernel_d2w(kernel(k), dim, q, 1.0), d2, 2e-13 * top);
        }
    }
}

/* dW/dr keeps its relative accuracy where r is small: W'/r -> W''(0), W'''(0+) bounded */
static void slope_near_the_centre(void **state) {
    (void)state;
    FOR_ALL(k, dim) {
        double curvature = sphpa_kernel_d2w(kernel(k), dim, 0.0, 1.0);
        assert_true(curvature < 0.0);
        assert_true(sphpa_kernel_dw(kernel(k), dim, 0.0, 1.0) == 0.0);
        for (double q = 1e-4; q > 1e-300; q *= 1e-3) {
            double ratio = sphpa_kernel_dw(kernel(k), dim, q, 1.0) / q;
            assert_near(ratio, curvature, 4.0 * q + 8.0 * EPS);
        }
    }
}

static void positive_and_falling(void **state) {
    (void)state;
    FOR_ALL(k, dim) {
        double support = sphpa_kernel_support(kernel(k)), last = 2.0 * central(k, dim);
        for (int i = 0; i < 20000; i++) {
            double r = support * (double)i / 20000.0;
            double w = sphpa_kernel_w(kernel(k), dim, r, 1.0);
            assert_true(w > 0.0 && w <= last + 2.0 * EPS * central(k, dim));
            if (i > 0) assert_true(sphpa_kernel_dw(kernel(k), dim, r, 1.0) < 0.0);
            last = w;
        }
    }
}

static void support(void **state) {
    (void)state;
    static const double radius[7] = {2.0, 2.5, 3.0, 2.0, 2.0, 2.0, 3.0};
    FOR_ALL(k, dim) {
        sphpa_kernel kind = kernel(k);
        double edge = radius[k];
        assert_true(sphpa_kernel_support(kind) == edge);
        assert_true(sphpa_kernel_w(kind, dim, 0.9999 * edge, 1.0) > 0.0);
        assert_true(sphpa_kernel_dw(kind, dim, 0.9999 * edge, 1.0) < 0.0);
        const double outside[] = {edge, 1.0000001 * edge, 10.0, 1e40, 1e300, HUGE_VAL};
        for (int i = 0; i < 6; i++) {
            assert_true(sphpa_kernel_w(kind, dim, outside[i], 1.0) == 0.0);
            assert_true(sphpa_kernel_dw(kind, dim, outside[i], 1.0) == 0.0);
            assert_true(sphpa_kernel_d2w(kind, dim, outside[i], 1.0) == 0.0);
            assert_true(sphpa_kernel_dw_dh(kind, dim, outside[i], 1.0) == 0.0);
        }
    }
}

/* W, W' and W'' do not jump at a knot; the Gaussian does, at its edge, by its tail */
static void continuity(void **state) {
    (void)state;
    const double e = 1e-9;
    FOR_ALL(k, dim) {
        double top = central(k, dim);
        for (int i = 1; i < 4; i++) {
            double q = knots[k][i];
            if (k == 6 && i == 3) continue;
            double (*const all[3])(sphpa_kernel, int, double, double) = {
                sphpa_kernel_w, sphpa_kernel_dw, sphpa_kernel_d2w};
            for (int m = 0; m < 3; m++) {
                double right = all[m](kernel(k), dim, q + e, 1.0);
                assert_near_abs(right, all[m](kernel(k), dim, q - e, 1.0), 20.0 * e * top);
            }
        }
    }
}

/* dW/dh against differences in h, and W(s r, s h) = s^-d W(r, h) */
static void smoothing_length(void **state) {
    (void)state;
    FOR_ALL(k, dim) {
        sphpa_kernel kind = kernel(k);
        double edge = sphpa_kernel_support(kind);
        for (int i = 0; i < 200; i++) {
            double h = 0.7, step = 1e-4, r = h * edge * ((double)i + 0.31) / 200.0, knot = edge;
            for (int j = 1; j < 4; j++) /* a difference must not straddle a knot */
                if (fabs(r / h - knots[k][j]) < knot) knot = fabs(r / h - knots[k][j]);
            if (knot < 0.003) continue;
            double d = 0.0;
            static const double weight[3] = {0.75, -0.15, 1.0 / 60.0}; /* order 6 */
            for (int j = 0; j < 3; j++) {
                double dh = (j + 1) * step;
                d += weight[j] * (sphpa_kernel_w(kind, dim, r, h + dh) -
                                  sphpa_kernel_w(kind, dim, r, h - dh)) / step;
            }
            double scale = sphpa_kernel_w(kind, dim, 0.0, h) / h;
            assert_near_abs(sphpa_kernel_dw_dh(kind, dim, r, h), d, 2e-11 * scale);
            double identity = -(dim * sphpa_kernel_w(kind, dim, r, h) +
                                r * sphpa_kernel_dw(kind, dim, r, h)) / h;
            assert_near_abs(sphpa_kernel_dw_dh(kind, dim, r, h), identity, 8.0 * EPS * dim * scale);
            /* powers of two: the same bits */
            assert_true(sphpa_kernel_w(kind, dim, 4.0 * r, 4.0 * h) * (double)(1 << (2 * dim)) ==
                        sphpa_kernel_w(kind, dim, r, h));
            assert_true(sphpa_kernel_dw(kind, dim, 4.0 * r, 4.0 * h) * (double)(4 << (2 * dim)) ==
                        sphpa_kernel_dw(kind, dim, r, h));
            assert_true(sphpa_kernel_d2w(kind, dim, 4.0 * r, 4.0 * h) * (double)(16 << (2 * dim)) ==
                        sphpa_kernel_d2w(kind, dim, r, h));
        }
    }
}

static void batch_is_scalar(void **state) {
    (void)state;
    enum { N = 1003 }; /* odd: the vector loop and its remainder */
    static double q[N], f[N + 1], df[N + 1], one[N + 1];
    sphpa_rng rng = sphpa_rng_seed(7, 1);
    FOR_ALL(k, dim) {
        sphpa_kernel kind = kernel(k);
        double edge = sphpa_kernel_support(kind), top = central(k, dim);
        for (int i = 0; i < N; i++) q[i] = (edge + 0.5) * sphpa_rng_uniform(&rng);
        q[0] = 0.0;
        q[1] = edge;
        q[2] = 1e40;
        for (int i = 0; i < 4; i++) q[3 + i] = knots[k][i];
        q[7] = 1e-17;
        f[N] = df[N] = one[N] = 12345.0;
        sphpa_kernel_shape_batch(kind, dim, N, q, f, df);
        for (int i = 0; i < N; i++) {
            assert_near_abs(f[i], sphpa_kernel_w(kind, dim, q[i], 1.0), 3.0 * EPS * top);
            assert_near_abs(df[i], sphpa_kernel_dw(kind, dim, q[i], 1.0), 6.0 * EPS * top);
            if (q[i] >= edge) assert_true(f[i] == 0.0 && df[i] == 0.0);
        }
        sphpa_kernel_shape_batch(kind, dim, N, q, one, NULL);
        assert_memory_equal(one, f, sizeof f);
        sphpa_kernel_shape_batch(kind, dim, N, q, NULL, one);
        assert_memory_equal(one, df, sizeof df);
        assert_true(f[N] == 12345.0 && df[N] == 12345.0);
        sphpa_kernel_shape_batch(kind, dim, 0, q, f, df);
        sphpa_kernel_shape_batch(kind, dim, N, q, NULL, NULL);
        assert_memory_equal(one, df, sizeof df);
        q[5] = (double)NAN;
        sphpa_kernel_shape_batch(kind, dim, N, q, f, df);
        assert_true(isnan(f[5]) && isnan(df[5]) && !isnan(f[4]) && !isnan(df[6]));
    }
}

static void bad_arguments(void **state) {
    (void)state;
    const double nan_value = (double)NAN;
    double (*const all[4])(sphpa_kernel, int, double, double) = {
        sphpa_kernel_w, sphpa_kernel_dw, sphpa_kernel_d2w, sphpa_kernel_dw_dh};
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < (int)SPHPA_KERNEL_COUNT; k++) {
            assert_true(isnan(all[i](kernel(k), 0, 0.5, 1.0)));
            assert_true(isnan(all[i](kernel(k), 4, 0.5, 1.0)));
            assert_true(isnan(all[i](kernel(k), -1, 0.5, 1.0)));
            assert_true(isnan(all[i](kernel(k), 3, 0.5, 0.0)));
            assert_true(isnan(all[i](kernel(k), 3, 0.5, -1.0)));
            assert_true(isnan(all[i](kernel(k), 3, 0.5, nan_value)));
            assert_true(isnan(all[i](kernel(k), 3, 0.5, HUGE_VAL)));
            assert_true(isnan(all[i](kernel(k), 3, nan_value, 1.0)));
            assert_true(isnan(all[i](kernel(k), 3, -0.5, 1.0)));
            assert_true(!isnan(all[i](kernel(k), 3, 0.5, 1.0)));
        }
        assert_true(isnan(all[i](SPHPA_KERNEL_COUNT, 3, 0.5, 1.0)));
    }
    assert_true(isnan(sphpa_kernel_support(SPHPA_KERNEL_COUNT)));
    assert_string_equal(sphpa_kernel_name(SPHPA_KERNEL_COUNT), "unknown");
    double q[3] = {0.0, 0.5, 1.0}, f[3] = {1.0, 1.0, 1.0}, df[3] = {1.0, 1.0, 1.0};
    sphpa_kernel_shape_batch(SPHPA_KERNEL_CUBIC, 4, 2, q, f, df);
    assert_true(isnan(f[0]) && isnan(f[1]) && isnan(df[0]) && isnan(df[1]));
    assert_true(f[2] == 1.0 && df[2] == 1.0);
    f[0] = df[0] = 1.0;
    sphpa_kernel_shape_batch(SPHPA_KERNEL_COUNT, 3, 1, q, f, NULL);
    sphpa_kernel_shape_batch(SPHPA_KERNEL_COUNT, 3, 1, q, NULL, df);
    assert_true(isnan(f[0]) && isnan(df[0]));
}

static void names(void **state) {
    (void)state;
    static const char *const name[7] = {"cubic",       "quartic",     "quintic", "wendland-c2",
                                        "wendland-c4", "wendland-c6", "gaussian"};
    sphpa_error err;
    sphpa_kernel found = SPHPA_KERNEL_COUNT;
    for (int k = 0; k < 7; k++) {
        assert_string_equal(sphpa_kernel_name(kernel(k)), name[k]);
        assert_int_equal(sphpa_kernel_find(name[k], &found, NULL), SPHPA_OK);
        assert_int_equal((int)found, k);
    }
    const char *const wrong[] = {"Cubic", "", "cubi", "cubic ", "wendland", NULL};
    for (int i = 0; i < 6; i++) {
        memset(&err, 0, sizeof err);
        assert_int_equal(sphpa_kernel_find(wrong[i], &found, &err), SPHPA_ERROR_UNKNOWN);
        assert_int_equal(err.result, SPHPA_ERROR_UNKNOWN);
        assert_int_equal((int)found, 6);
        for (int k = 0; k < 7; k++) assert_non_null(strstr(err.message, name[k]));
        if (wrong[i] != NULL) assert_non_null(strstr(err.message, wrong[i]));
    }
    assert_int_equal(sphpa_kernel_find("nothing", &found, NULL), SPHPA_ERROR_UNKNOWN);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(normalisation),        cmocka_unit_test(moments),
        cmocka_unit_test(lattices),
        cmocka_unit_test(partition_of_unity),   cmocka_unit_test(values_and_derivatives),
        cmocka_unit_test(slope_near_the_centre), cmocka_unit_test(positive_and_falling),
        cmocka_unit_test(support),              cmocka_unit_test(continuity),
        cmocka_unit_test(smoothing_length),     cmocka_unit_test(batch_is_scalar),
        cmocka_unit_test(bad_arguments),        cmocka_unit_test(names),
    };
    return cmocka_run_group_tests_name("kernel", tests, NULL, NULL);
}
