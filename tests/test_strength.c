/* Hooke, Jaumann and the yield surfaces against closed forms, exact rotations and random states. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>
#include <float.h>
#include <string.h>

#include "sphpa.h"

#include "near.h"

#define EPS 2.2204460492503131e-16
#define PI 3.14159265358979324

static sphpa_sym3 tensor(double xx, double yy, double zz, double xy, double yz, double xz) {
    sphpa_sym3 S;
    S.xx = xx;
    S.yy = yy;
    S.zz = zz;
    S.xy = xy;
    S.yz = yz;
    S.xz = xz;
    return S;
}

static double between(sphpa_rng *rng, double low, double high) {
    return low + (high - low) * sphpa_rng_uniform(rng);
}

/* 10^e with e uniform */
static double decades(sphpa_rng *rng, double low, double high) {
    return pow(10.0, between(rng, low, high));
}

static sphpa_sym3 random_tensor(sphpa_rng *rng, double size) {
    sphpa_sym3 S;
    S.xx = size * between(rng, -1.0, 1.0);
    S.yy = size * between(rng, -1.0, 1.0);
    S.zz = size * between(rng, -1.0, 1.0);
    S.xy = size * between(rng, -1.0, 1.0);
    S.yz = size * between(rng, -1.0, 1.0);
    S.xz = size * between(rng, -1.0, 1.0);
    return S;
}

static void random_gradient(sphpa_rng *rng, double size, double L[9]) {
    for (int i = 0; i < 9; i++) L[i] = size * between(rng, -1.0, 1.0);
}

static long double big(double x) { return (long double)x; }

static double trace(const sphpa_sym3 *S) { return S->xx + S->yy + S->zz; }

/* |S|^2 = S:S and det S in long double, written out here */
static double norm(const sphpa_sym3 *S) {
    long double normal = big(S->xx) * big(S->xx) + big(S->yy) * big(S->yy) +
                         big(S->zz) * big(S->zz);
    long double shear = big(S->xy) * big(S->xy) + big(S->yz) * big(S->yz) + big(S->xz) * big(S->xz);
    return (double)sqrtl(normal + 2.0L * shear);
}

static double determinant(const sphpa_sym3 *S) {
    long double xx = big(S->xx), yy = big(S->yy), zz = big(S->zz);
    long double xy = big(S->xy), yz = big(S->yz), xz = big(S->xz);
    return (double)(xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz));
}

static double distance(const sphpa_sym3 *A, const sphpa_sym3 *B) {
    sphpa_sym3 D = tensor(A->xx - B->xx, A->yy - B->yy, A->zz - B->zz, A->xy - B->xy, A->yz - B->yz,
                          A->xz - B->xz);
    return norm(&D);
}

/* Q S Q^T with the rotation by `angle` about the unit axis n (Rodrigues), in long double */
static sphpa_sym3 rotated(const sphpa_sym3 *S, const double n[3], double angle) {
    long double c = cosl((long double)angle), s = sinl((long double)angle), Q[3][3], R[3][3];
    const double full[3][3] = {{S->xx, S->xy, S->xz}, {S->xy, S->yy, S->yz}, {S->xz, S->yz, S->zz}};
    const double cross[3][3] = {{0.0, -n[2], n[1]}, {n[2], 0.0, -n[0]}, {-n[1], n[0], 0.0}};
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            Q[a][b] = (a == b ? c : 0.0L) + (1.0L - c) * big(n[a]) * big(n[b]) +
                      s * big(cross[a][b]);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            R[a][b] = 0.0L;
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++) R[a][b] += Q[a][i] * big(full[i][j]) * Q[b][j];
        }
    return tensor((double)R[0][0], (double)R[1][1], (double)R[2][2], (double)R[0][1],
                  (double)R[1][2], (double)R[0][2]);
}

/* the velocity gradient of a rigid rotation, v = omega x r */
static void spin(const double omega[3], double L[9]) {
    const double W[9] = {0.0,      -omega[2], omega[1], omega[2], 0.0,
                         -omega[0], -omega[1], omega[0], 0.0};
    memcpy(L, W, sizeof W);
}

/* ---- Hooke ----------------------------------------------------------------------------------- */

static void hooke_closed_forms(void **state) {
    (void)state;
    const double G = 22.7e9, dt = 1e-7, rate = 300.0, share = 0.25, alpha = 2.0;
    const double k = 2.0 * G * share / alpha * dt;
    /* simple shear dv_x/dy = rate: S_xy = G gamma */
    const double shear[9] = {0.0, rate, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    sphpa_sym3 S = tensor(0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    sphpa_hooke_advance(&S, k, shear);
    assert_near(S.xy, G * (share / alpha) * rate * dt, 1e-14);
    assert_true(S.xx == 0.0 && S.yy == 0.0 && S.zz == 0.0 && S.yz == 0.0 && S.xz == 0.0);
    const double shear_yz[9] = {0.0, 0.0, 0.0, 0.0, 0.0, rate, 0.0, 0.0, 0.0};
    const double shear_xz[9] = {0.0, 0.0, rate, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    sphpa_sym3 Y = tensor(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), X = Y;
    sphpa_hooke_advance(&Y, k, shear_yz);
    sphpa_hooke_advance(&X, k, shear_xz);
    assert_true(Y.yz == S.xy && Y.xy == 0.0 && Y.xz == 0.0);
    assert_true(X.xz == S.xy && X.xy == 0.0 && X.yz == 0.0);
    /* uniaxial strain: 4/3 G e, -2/3 G e, -2/3 G e */
    const double uniaxial[9] = {rate, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    S = tensor(0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (int i = 0; i < 10; i++) sphpa_hooke_advance(&S, k, uniaxial);
    double e = 10.0 * rate * dt * share / alpha;
    assert_near(S.xx, 4.0 / 3.0 * G * e, 1e-14);
    assert_near(S.yy, -2.0 / 3.0 * G * e, 1e-14);
    assert_true(S.yy == S.zz && S.xy == 0.0);
    /* plane strain, isochoric: S_zz = 0, though the 3-D deviator is used; else -2/3 G tr */
    const double plane[9] = {rate, 0.0, 0.0, 0.0, -rate, 0.0, 0.0, 0.0, 0.0};
    S = tensor(0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    sphpa_hooke_advance(&S, k, plane);
    assert_true(S.zz == 0.0 && S.xx == -S.yy);
    assert_near(S.xx, k * rate, 1e-14);
    const double squeeze[9] = {rate, 0.0, 0.0, 0.0, 2.0 * rate, 0.0, 0.0, 0.0, 0.0};
    S = tensor(0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    sphpa_hooke_advance(&S, k, squeeze);
    assert_near(S.zz, -k * rate, 1e-14);
}

/* dilation and rigid rotation leave S bitwise alone; a general L adds 2G dt (e - tr e/3) */
static void hooke_general(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(3, 11);
    for (int i = 0; i < 20000; i++) {
        double L[9], k = decades(&rng, 0.0, 4.0);
        sphpa_sym3 S = random_tensor(&rng, 1e6), T = S;
        double rate = between(&rng, -1e5, 1e5);
        double omega[3] = {between(&rng, -1e5, 1e5), rate, between(&rng, -1e5, 1e5)};
        spin(omega, L);
        L[0] = L[4] = L[8] = rate;
        sphpa_hooke_advance(&T, k, L);
        assert_memory_equal(&S, &T, sizeof S);
        random_gradient(&rng, 1e3, L);
        sphpa_hooke_advance(&T, k, L);
        long double third = (big(L[0]) + big(L[4]) + big(L[8])) / 3.0L;
        double scale = 4.0 * EPS * (1e6 + k * 1e3);
        assert_near_abs(T.xx, (double)(big(S.xx) + big(k) * (big(L[0]) - third)), scale);
        assert_near_abs(T.yy, (double)(big(S.yy) + big(k) * (big(L[4]) - third)), scale);
        assert_near_abs(T.zz, (double)(big(S.zz) + big(k) * (big(L[8]) - third)), scale);
        assert_near_abs(T.xy, S.xy + k * 0.5 * (L[1] + L[3]), scale);
        assert_near_abs(T.yz, S.yz + k * 0.5 * (L[5] + L[7]), scale);
        assert_near_abs(T.xz, S.xz + k * 0.5 * (L[2] + L[6]), scale);
        assert_near_abs(trace(&T), trace(&S), 4.0 * scale);
    }
}

/* ---- Jaumann --------------------------------------------------------------------------------- */

static void rotation_keeps_invariants(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(5, 2);
    double worst = 0.0;
    for (int i = 0; i < 100000; i++) {
        double L[9], size = decades(&rng, -6.0, 9.0);
        sphpa_sym3 S = random_tensor(&rng, size), R = S;
        double n = norm(&S);
        random_gradient(&rng, decades(&rng, -3.0, 3.0), L);
        sphpa_jaumann_rotate(&R, L, decades(&rng, -3.0, 3.0));
        worst = fmax(worst, fabs(norm(&R) / n - 1.0));
        assert_near_abs(trace(&R), trace(&S), 1e-14 * n);
        assert_near_abs(sphpa_strength_j2(&R), 0.5 * n * n, 1e-14 * n * n);
        assert_near_abs(determinant(&R), determinant(&S), 1e-14 * n * n * n);
    }
    assert_true(worst < 2e-15); /* |S| to 9 eps in one call */
}

/* one call is the exact rotation by 2 atan(|w| dt/2) about w, for any size of the angle */
static void rotation_angle(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(6, 2);
    for (int i = 0; i < 20000; i++) {
        double w[3] = {sphpa_rng_normal(&rng), sphpa_rng_normal(&rng), sphpa_rng_normal(&rng)};
        double length = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
        double size = decades(&rng, -8.0, 20.0), dt = decades(&rng, -6.0, 6.0);
        double omega[3], n[3], L[9];
        for (int a = 0; a < 3; a++) {
            n[a] = w[a] / length;
            omega[a] = n[a] * size;
        }
        spin(omega, L);
        double rate = between(&rng, -1.0, 1.0); /* the symmetric part must not count */
        if (size > 1e-3 && size < 1e3) L[0] += rate, L[1] += rate, L[3] += rate;
        sphpa_sym3 S = random_tensor(&rng, 1.0), R = S;
        sphpa_jaumann_rotate(&R, L, dt);
        sphpa_sym3 exact = rotated(&S, n, 2.0 * atan(0.5 * size * dt));
        double lost = size < 1e-3 || size > 1e3 ? 0.0 : EPS * (1.0 + 1.0 / size); /* L rounded */
        assert_near_abs(distance(&R, &exact), 0.0, 2e-14 + 20.0 * lost);
    }
}

/* many small steps against the exact rotation by omega t: the angle is short by
   omega^3 dt^2 t/12, so the error falls by 4 when the step is halved */
static void rotation_order(void **state) {
    (void)state;
    const double n[3] = {2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0}, omega[3] = {2.0, 3.0, 6.0}; /* 7 rad/s */
    const sphpa_sym3 S = tensor(1.0, -3.0, 2.0, 0.5, -1.5, 0.7);
    sphpa_sym3 exact = rotated(&S, n, 7.0);
    double L[9], error[3];
    spin(omega, L);
    for (int m = 0; m < 3; m++) {
        int steps = 1000 << m;
        double dt = 1.0 / steps;
        sphpa_sym3 R = S;
        for (int i = 0; i < steps; i++) sphpa_jaumann_rotate(&R, L, dt);
        error[m] = distance(&R, &exact) / norm(&S);
        assert_near(norm(&R), norm(&S), 1e-13);
        /* the same rotation with the angle that Cayley gives: nothing else is lost */
        sphpa_sym3 cayley = rotated(&S, n, steps * 2.0 * atan(3.5 * dt));
        assert_near_abs(distance(&R, &cayley), 0.0, 1e-12);
    }
    assert_near(log2(error[0] / error[1]), 2.0, 1e-3);
    assert_near(log2(error[1] / error[2]), 2.0, 1e-3);
    /* and to the leading term, the error is that of an angle of 343/12 dt^2 too few */
    sphpa_sym3 late = rotated(&S, n, 7.0 - 343.0 / 12.0 * 1e-6);
    assert_near(error[0], distance(&late, &exact) / norm(&S), 1e-4);
}

static void rotation_edges(void **state) {
    (void)state;
    const sphpa_sym3 S = tensor(1.25, -3.5, 2.25, 0.1, -1.7, -0.0);
    sphpa_sym3 R = S;
    double L[9] = {0.3, 1.7, -2.0, 1.7, 5.0, 0.1, -2.0, 0.1, -8.0}; /* symmetric: no spin */
    sphpa_jaumann_rotate(&R, L, 0.37);
    assert_memory_equal(&R, &S, sizeof S);
    L[1] = 50.0;
    sphpa_jaumann_rotate(&R, L, 0.0);
    assert_memory_equal(&R, &S, sizeof S);
    /* a quarter turn about z: |w| dt/2 = tan(pi/4); x' = y, so xx and yy change places */
    const double half_turn[9] = {0.0, -2.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    sphpa_jaumann_rotate(&R, half_turn, 1.0);
    assert_near(R.xx, S.yy, 1e-15);
    assert_near(R.yy, S.xx, 1e-15);
    assert_near(R.zz, S.zz, 1e-15);
    assert_near(R.xy, -S.xy, 1e-14);
    assert_near(R.xz, -S.yz, 1e-15); /* the new x axis was -y */
    /* |W| dt of 1e300: half a turn about the axis */
    const double huge[9] = {0.0, -1e300, 0.0, 1e300, 0.0, 0.0, 0.0, 0.0, 0.0};
    R = S;
    sphpa_jaumann_rotate(&R, huge, 1.0);
    sphpa_sym3 turned = tensor(S.xx, S.yy, S.zz, S.xy, -S.yz, -S.xz);
    assert_near_abs(distance(&R, &turned), 0.0, 1e-15);
    /* a simple shear turns S clockwise: dS/dt = W S - S W with W_xy = g/2: dS_xx/dt = g S_xy */
    const double shear[9] = {0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    R = tensor(0.0, 0.0, 0.0, 1.0, 0.0, 0.0);
    sphpa_jaumann_rotate(&R, shear, 1e-6);
    assert_near(R.xx, 1e-6, 1e-9);
    assert_near(R.yy, -1e-6, 1e-9);
}

/* Hypoelastic simple shear with the Jaumann rate (Dienes 1979): S_xy = G sin(g t),
   S_xx = G (1 - cos(g t)); split steps converge to it in first order at least */
static void shear_oscillation(void **state) {
    (void)state;
    const double G = 1.0, rate = 1.0;
    const double shear[9] = {0.0, rate, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    double error[2];
    for (int m = 0; m < 2; m++) {
        int steps = 500 << m;
        double dt = 3.0 / steps;
        sphpa_sym3 S = tensor(0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for (int i = 0; i < steps; i++) { /* symmetric splitting: order 2 */
            sphpa_hooke_advance(&S, G * dt, shear);
            sphpa_jaumann_rotate(&S, shear, dt);
            sphpa_hooke_advance(&S, G * dt, shear);
        }
        sphpa_sym3 exact = tensor(G * (1.0 - cos(3.0)), -G * (1.0 - cos(3.0)), 0.0, G * sin(3.0),
                                  0.0, 0.0);
        error[m] = distance(&S, &exact);
    }
    assert_true(error[0] < 1e-4);
    assert_near(log2(error[0] / error[1]), 2.0, 0.01);
}

/* ---- yield ----------------------------------------------------------------------------------- */

static void second_invariant(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(8, 2);
    sphpa_sym3 S = tensor(1.0, 2.0, -3.0, 4.0, 5.0, 6.0);
    assert_true(sphpa_strength_j2(&S) == 0.5 * (1.0 + 4.0 + 9.0) + 16.0 + 25.0 + 36.0);
    for (int i = 0; i < 1000; i++) { /* from the principal values */
        double v[3];
        S = random_tensor(&rng, 3.0);
        sphpa_sym3_eigen(&S, v, NULL);
        assert_near(sphpa_strength_j2(&S), 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), 1e-13);
    }
}

/* at run time, so that C++ does not see that a number has no name */
static sphpa_yield_kind kind_of(int number) { return (sphpa_yield_kind)number; }
static sphpa_yield_match match_of(int number) { return (sphpa_yield_match)number; }

static sphpa_yield surface(sphpa_yield_kind kind) {
    sphpa_yield y;
    memset(&y, 0, sizeof y);
    y.kind = kind;
    y.Y0 = 1e7;
    y.Ym = 3.5e9;
    y.mu_i = 1.5;
    y.mu_d = 0.6;
    y.a_phi = 0.2;
    y.k_c = 5e6;
    return y;
}

/* what S has to stay below, measured as the surface measures it, in long double */
static double measure(const sphpa_yield *y, const sphpa_sym3 *S, double scale) {
    sphpa_sym3 T = tensor(S->xx / scale, S->yy / scale, S->zz / scale, S->xy / scale, S->yz / scale,
                          S->xz / scale);
    double root = norm(&T) * sqrt(0.5);
    return y->kind == SPHPA_YIELD_VON_MISES ? sqrt(3.0) * root : root;
}

static void nothing_stays_outside(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(9, 2);
    const sphpa_yield_kind kinds[3] = {SPHPA_YIELD_VON_MISES, SPHPA_YIELD_DRUCKER_PRAGER,
                                       SPHPA_YIELD_COLLINS};
    int inside = 0, outside = 0;
    for (int i = 0; i < 300000; i++) {
        sphpa_yield y = surface(kinds[i % 3]);
        y.u_melt = i % 2 ? 3.4e6 : 0.0;
        double P = between(&rng, -1.0, 1.0) * decades(&rng, 4.0, 11.0);
        double u = 4e6 * sphpa_rng_uniform(&rng), D = between(&rng, 0.0, 1.0);
        double alpha = between(&rng, 1.0, 5.0), size = decades(&rng, 3.0, 12.0);
        sphpa_sym3 S = random_tensor(&rng, size), before = S;
        double limit = sphpa_yield_strength(&y, P, u, D) / alpha;
        double was = measure(&y, &S, 1.0), factor = sphpa_yield_limit(&y, P, u, D, alpha, &S);
        assert_true(factor >= 0.0 && factor <= 1.0 && limit >= 0.0);
        if (was < limit * (1.0 - 1e-14)) {
            inside++;
            assert_true(factor == 1.0);
        }
        if (factor == 1.0) assert_memory_equal(&S, &before, sizeof S);
        assert_true(measure(&y, &S, 1.0) <= limit * (1.0 + 1e-14));
        if (was > limit * (1.0 + 1e-14)) { /* radially, onto the surface, and no further */
            outside++;
            assert_near(measure(&y, &S, 1.0), limit, 1e-14);
            assert_near(factor, limit / was, 1e-14);
            assert_near_abs(S.xx, before.xx * factor, 1e-14 * limit);
            assert_near_abs(S.yy, before.yy * factor, 1e-14 * limit);
            assert_near_abs(S.zz, before.zz * factor, 1e-14 * limit);
            assert_near_abs(S.xy, before.xy * factor, 1e-14 * limit);
            assert_near_abs(S.yz, before.yz * factor, 1e-14 * limit);
            assert_near_abs(S.xz, before.xz * factor, 1e-14 * limit);
        }
    }
    assert_true(inside > 30000 && outside > 30000); /* both sides were tried */
}

static void extreme_sizes(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(10, 2);
    const sphpa_yield_kind kinds[3] = {SPHPA_YIELD_VON_MISES, SPHPA_YIELD_DRUCKER_PRAGER,
                                       SPHPA_YIELD_COLLINS};
    const double sizes[] = {1e155, 1e200, 1e300, 1.7e308};
    for (int i = 0; i < 12; i++) {
        sphpa_yield y = surface(kinds[i % 3]);
        sphpa_sym3 S = random_tensor(&rng, sizes[i / 3]);
        double limit = sphpa_yield_strength(&y, 1e8, 0.0, 0.5) / 2.0;
        double factor = sphpa_yield_limit(&y, 1e8, 0.0, 0.5, 2.0, &S);
        assert_true(factor >= 0.0 && factor < 1e-100);
        assert_near(measure(&y, &S, limit), 1.0, 1e-14);
        const double tiny = sizes[i / 3] > 1e300 ? 5e-324 : 1.0 / sizes[i / 3]; /* inside */
        S = tensor(tiny, -tiny, 0.0, tiny, 0.0, 0.0);
        sphpa_sym3 before = S;
        assert_true(sphpa_yield_limit(&y, 1e8, 0.0, 0.5, 2.0, &S) == 1.0);
        assert_memory_equal(&S, &before, sizeof S);
        S = tensor(0.0, 0.0, 0.0, 0.0, 0.0, 0.0); /* J2 = 0, with Y > 0 and with Y = 0 */
        assert_true(sphpa_yield_limit(&y, 1e8, 0.0, 0.5, 2.0, &S) == 1.0);
        y.u_melt = 1.0;
        assert_true(sphpa_yield_limit(&y, 1e8, 2.0, 0.5, 2.0, &S) == 1.0);
        assert_true(norm(&S) == 0.0);
        S = tensor(tiny, -tiny, 0.0, tiny, 0.0, 0.0); /* molten: nothing is left, however small */
        assert_true(sphpa_yield_limit(&y, 1e8, 2.0, 0.5, 2.0, &S) == 0.0);
        assert_true(norm(&S) == 0.0);
    }
}

/* a factor below the normal range of doubles must not spoil what S becomes */
static void denormal_factor(void **state) {
    (void)state;
    sphpa_yield y = surface(SPHPA_YIELD_VON_MISES);
    y.Y0 = 1e-5;
    sphpa_sym3 S = tensor(1.1e308, -0.7e308, 0.3e308, 0.9e308, 0.2e308, -1e308);
    assert_true(sphpa_yield_limit(&y, 0.0, 0.0, 0.0, 1.0, &S) < DBL_MIN);
    assert_near(measure(&y, &S, 1.0), y.Y0, 1e-14);
}

static void bad_states(void **state) {
    (void)state;
    const double bad = (double)NAN;
    sphpa_yield y = surface(SPHPA_YIELD_COLLINS);
    const sphpa_sym3 whole = tensor(1e9, -1e9, 0.0, 3e8, 0.0, 0.0);
    sphpa_sym3 S = whole;
    assert_true(isnan(sphpa_yield_limit(&y, bad, 0.0, 0.5, 1.0, &S)));
    assert_true(isnan(sphpa_yield_limit(&y, 1e6, 0.0, bad, 1.0, &S)));
    assert_true(isnan(sphpa_yield_limit(&y, 1e6, 0.0, 0.5, bad, &S)));
    assert_true(isnan(sphpa_yield_limit(&y, 1e6, 0.0, 0.5, 0.0, &S)));
    assert_true(isnan(sphpa_yield_limit(&y, 1e6, 0.0, 0.5, -1.0, &S)));
    y.u_melt = 3e6;
    assert_true(isnan(sphpa_yield_limit(&y, 1e6, bad, 0.5, 1.0, &S)));
    assert_memory_equal(&S, &whole, sizeof S);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 2; j++) {
            double parts[6] = {1e9, -1e9, 0.0, 3e8, 0.0, 0.0};
            parts[i] = j ? bad : HUGE_VAL;
            S = tensor(parts[0], parts[1], parts[2], parts[3], parts[4], parts[5]);
            sphpa_sym3 before = S;
            assert_true(isnan(sphpa_yield_limit(&y, 1e6, 0.0, 0.5, 1.0, &S)));
            assert_memory_equal(&S, &before, sizeof S);
        }
    y = surface(SPHPA_YIELD_DRUCKER_PRAGER);
    assert_true(isnan(sphpa_yield_strength(&y, bad, 0.0, 0.0)));
    y = surface(SPHPA_YIELD_VON_MISES); /* depends on neither P nor D */
    assert_true(sphpa_yield_strength(&y, bad, bad, bad) == 1e7);
}

static void no_surface(void **state) {
    (void)state;
    sphpa_yield y;
    memset(&y, 0, sizeof y);
    const sphpa_sym3 whole = tensor(1e200, -1e9, 0.0, 3e8, 0.0, 0.0);
    sphpa_sym3 S = whole;
    assert_int_equal(y.kind, SPHPA_YIELD_NONE);
    assert_int_equal(sphpa_yield_check(&y, NULL), SPHPA_OK);
    assert_true(sphpa_yield_strength(&y, -1e9, 1e9, 1.0) == HUGE_VAL);
    assert_true(sphpa_yield_limit(&y, -1e9, 1e9, 1.0, 2.0, &S) == 1.0);
    assert_memory_equal(&S, &whole, sizeof S);
}

static void von_mises_and_softening(void **state) {
    (void)state;
    sphpa_yield y = surface(SPHPA_YIELD_VON_MISES);
    /* uniaxial stress sigma has S = sigma (2/3, -1/3, -1/3): it yields at sigma = Y0/alpha */
    sphpa_sym3 S = tensor(2.0 / 3.0 * 2e7, -1.0 / 3.0 * 2e7, -1.0 / 3.0 * 2e7, 0.0, 0.0, 0.0);
    assert_near(sphpa_yield_limit(&y, 0.0, 0.0, 0.0, 1.0, &S), 0.5, 1e-14);
    assert_near(S.xx - S.yy, 1e7, 1e-14);
    assert_near(sphpa_yield_limit(&y, 0.0, 0.0, 0.0, 4.0, &S), 0.25, 1e-14);
    assert_near(S.xx - S.yy, 2.5e6, 1e-14);
    /* pure shear yields at Y0/sqrt(3) */
    S = tensor(0.0, 0.0, 0.0, 1e9, 0.0, 0.0);
    (void)sphpa_yield_limit(&y, 0.0, 0.0, 0.0, 1.0, &S);
    assert_near(S.xy, 1e7 / sqrt(3.0), 1e-14);
    /* Y = Y0 max(0, 1 - u/u_melt), every kind; u < 0 does not harden */
    const sphpa_yield_kind kinds[3] = {SPHPA_YIELD_VON_MISES, SPHPA_YIELD_DRUCKER_PRAGER,
                                       SPHPA_YIELD_COLLINS};
    for (int i = 0; i < 3; i++) {
        y = surface(kinds[i]);
        double cold = sphpa_yield_strength(&y, 2e8, 1e9, 0.3);
        y.u_melt = 4e6;
        assert_near(sphpa_yield_strength(&y, 2e8, 0.0, 0.3), cold, 1e-15);
        assert_near(sphpa_yield_strength(&y, 2e8, 1e6, 0.3), 0.75 * cold, 1e-15);
        assert_near(sphpa_yield_strength(&y, 2e8, 3e6, 0.3), 0.25 * cold, 1e-15);
        assert_true(sphpa_yield_strength(&y, 2e8, 4e6, 0.3) == 0.0);
        assert_true(sphpa_yield_strength(&y, 2e8, 1e9, 0.3) == 0.0);
        assert_true(sphpa_yield_strength(&y, 2e8, -1e6, 0.3) == cold);
    }
}

/* Mohr-Coulomb in the principal stresses (tension positive, s1 >= s3):
   (s1 - s3)/2 + (s1 + s3)/2 sin(phi) - c cos(phi) = 0 */
static double mohr_coulomb(double s1, double s3, double phi, double c) {
    return 0.5 * (s1 - s3) + 0.5 * (s1 + s3) * sin(phi) - c * cos(phi);
}

static void drucker_prager_constants(void **state) {
    (void)state;
    const double degree = PI / 180.0;
    for (int i = 0; i <= 85; i += 5)
        for (int j = 0; j < 4; j++) {
            double phi = i * degree, c = 5e3 * j, confined = -1e5;
            sphpa_yield y = surface(SPHPA_YIELD_COLLINS);
            y.u_melt = 1.0;
            assert_int_equal(sphpa_yield_drucker_prager(phi, c, SPHPA_YIELD_TRIAXIAL, &y, NULL),
                             SPHPA_OK);
            assert_true(y.u_melt == 0.0 && y.Y0 == 0.0 && y.Ym == 0.0 && y.mu_i == 0.0); /* fresh */
            assert_int_equal(y.kind, SPHPA_YIELD_DRUCKER_PRAGER);
            assert_int_equal(sphpa_yield_check(&y, NULL), SPHPA_OK);
            /* triaxial compression: s1 = s2 = confining stress, s3 at Mohr-Coulomb failure */
            double flow = (1.0 + sin(phi)) / (1.0 - sin(phi));
            double s3 = flow * confined - 2.0 * c * sqrt(flow), s1 = confined;
            assert_near_abs(mohr_coulomb(s1, s3, phi, c), 0.0, 1e-12 * fabs(s3));
            double P = -(s1 + s1 + s3) / 3.0, root = (s1 - s3) / sqrt(3.0);
            assert_near_abs(root, sphpa_yield_strength(&y, P, 0.0, 0.0), 1e-12 * fabs(s3));
            /* plane strain with associated flow (Drucker and Prager 1952): s2 follows from
               no plastic strain in z, S_zz = -2 a_phi sqrt(J2), and both criteria then agree */
            assert_int_equal(sphpa_yield_drucker_prager(phi, c, SPHPA_YIELD_PLANE_STRAIN, &y, NULL),
                             SPHPA_OK);
            double radius = 0.5 * (s1 - s3), centre = 0.5 * (s1 + s3);
            /* J2 = radius^2 + 3/4 S_zz^2 */
            root = radius / sqrt(1.0 - 3.0 * y.a_phi * y.a_phi);
            double Szz = -2.0 * y.a_phi * root; /* centre = -P - S_zz/2 */
            P = -centre - 0.5 * Szz;
            assert_near_abs(root, sphpa_yield_strength(&y, P, 0.0, 0.0), 1e-12 * fabs(s3));
        }
}

static void drucker_prager_limits(void **state) {
    (void)state;
    sphpa_yield y;
    /* phi = 0: k_c = 2c/sqrt3 (Tresca in triaxial compression), c in plane strain; no slope */
    (void)sphpa_yield_drucker_prager(0.0, 7e3, SPHPA_YIELD_TRIAXIAL, &y, NULL);
    assert_near(sphpa_yield_strength(&y, 1e9, 0.0, 0.0), 2.0 * 7e3 / sqrt(3.0), 1e-15);
    (void)sphpa_yield_drucker_prager(0.0, 7e3, SPHPA_YIELD_PLANE_STRAIN, &y, NULL);
    assert_near(sphpa_yield_strength(&y, 1e9, 0.0, 0.0), 7e3, 1e-15);
    /* tension: the cone ends at P = -c/tan(phi), where its apex is, and stays 0 beyond */
    for (int match = 0; match < 2; match++) {
        double phi = 0.6, c = 5e3, apex = -c / tan(phi);
        (void)sphpa_yield_drucker_prager(phi, c, match_of(match), &y, NULL);
        assert_near_abs(sphpa_yield_strength(&y, apex, 0.0, 0.0), 0.0, 1e-15 * c);
        assert_true(sphpa_yield_strength(&y, 0.99 * apex, 0.0, 0.0) > 0.0);
        assert_true(sphpa_yield_strength(&y, 1.01 * apex, 0.0, 0.0) == 0.0);
        assert_true(sphpa_yield_strength(&y, -1e12, 0.0, 0.0) == 0.0);
        sphpa_sym3 S = tensor(1.0, -1.0, 0.0, 3.0, 0.0, 0.0);
        assert_true(sphpa_yield_limit(&y, -1e12, 0.0, 0.0, 1.0, &S) == 0.0);
        assert_true(norm(&S) == 0.0);
        assert_near(y.a_phi, match ? tan(phi) / sqrt(9.0 + 12.0 * tan(phi) * tan(phi))
                                   : 2.0 * sin(phi) / (sqrt(3.0) * (3.0 - sin(phi))), 1e-15);
    }
}

static void collins_limits(void **state) {
    (void)state;
    sphpa_yield y = surface(SPHPA_YIELD_COLLINS);
    /* P = 0: cohesion intact, nothing damaged */
    assert_true(sphpa_yield_strength(&y, 0.0, 0.0, 0.0) == y.Y0);
    assert_true(sphpa_yield_strength(&y, 0.0, 0.0, 1.0) == 0.0);
    /* slope mu_i at P = 0; Ym far out, from below; half of Ym - Y0 at P = (Ym - Y0)/mu_i */
    assert_near((sphpa_yield_strength(&y, 1.0, 0.0, 0.0) - y.Y0) / 1.0, y.mu_i, 1e-7);
    const double far[] = {1e13, 1e20, 1e200, 1.7e308, HUGE_VAL};
    for (int i = 0; i < 5; i++) {
        double Y = sphpa_yield_strength(&y, far[i], 0.0, 0.0);
        assert_true(Y <= y.Ym);
        assert_near(Y, y.Ym, i == 0 ? 3e-4 : 1e-9);
    }
    assert_near(sphpa_yield_strength(&y, (y.Ym - y.Y0) / y.mu_i, 0.0, 0.0), 0.5 * (y.Y0 + y.Ym),
                1e-15);
    /* D = 1: friction, capped by the intact curve where the line crosses it */
    assert_near(sphpa_yield_strength(&y, 1e8, 0.0, 1.0), 0.6e8, 1e-15);
    assert_true(sphpa_yield_strength(&y, 1e11, 0.0, 1.0) ==
                sphpa_yield_strength(&y, 1e11, 0.0, 0.0));
    /* D outside [0,1] is clamped */
    assert_true(sphpa_yield_strength(&y, 1e8, 0.0, 1.5) == sphpa_yield_strength(&y, 1e8, 0.0, 1.0));
    assert_true(sphpa_yield_strength(&y, 1e8, 0.0, -0.5) ==
                sphpa_yield_strength(&y, 1e8, 0.0, 0.0));
    sphpa_rng rng = sphpa_rng_seed(12, 4);
    for (int i = 0; i < 20000; i++) { /* never above Ym, not even by rounding */
        sphpa_yield z = y;
        z.Y0 = decades(&rng, 3.0, 8.0);
        z.Ym = z.Y0 + decades(&rng, 3.0, 9.0);
        assert_true(sphpa_yield_strength(&z, 1e200, 0.0, 0.0) <= z.Ym);
    }
    for (int i = 0; i < 20000; i++) { /* the formula as printed, in long double */
        double P = decades(&rng, 3.0, 12.0), D = sphpa_rng_uniform(&rng);
        long double push = big(y.mu_i) * big(P), room = big(y.Ym) - big(y.Y0);
        long double Yi = big(y.Y0) + push / (1.0L + push / room);
        long double Yd = fminl(big(y.mu_d) * big(P), Yi);
        assert_near(sphpa_yield_strength(&y, P, 0.0, D),
                    (double)((1.0L - big(D)) * Yi + big(D) * Yd), 8.0 * EPS);
    }
    /* tension: the tangent at 0, down to 0 at P = -Y0/mu_i; the damaged rock bears nothing */
    assert_near(sphpa_yield_strength(&y, -2e6, 0.0, 0.0), y.Y0 - 3e6, 1e-15);
    assert_near(sphpa_yield_strength(&y, -2e6, 0.0, 0.25), 0.75 * (y.Y0 - 3e6), 1e-15);
    assert_true(sphpa_yield_strength(&y, -2e6, 0.0, 1.0) == 0.0);
    assert_true(sphpa_yield_strength(&y, -7e6, 0.0, 0.0) == 0.0);
    assert_true(sphpa_yield_strength(&y, -1e300, 0.0, 0.0) == 0.0);
    /* Ym = Y0 and no friction: constant, no 0/0 */
    y.Ym = y.Y0;
    assert_true(sphpa_yield_strength(&y, 0.0, 0.0, 0.0) == y.Y0);
    assert_true(sphpa_yield_strength(&y, 1e9, 0.0, 0.0) == y.Y0);
    y.Y0 = y.Ym = y.mu_i = y.mu_d = 0.0;
    assert_true(sphpa_yield_strength(&y, 1e9, 0.0, 0.5) == 0.0);
}

static void refused(sphpa_yield y, sphpa_result expected, const char *word) {
    sphpa_error err;
    memset(&err, 0, sizeof err);
    assert_int_equal(sphpa_yield_check(&y, &err), expected);
    assert_int_equal(err.result, expected);
    assert_non_null(strstr(err.message, word));
    assert_int_equal(sphpa_yield_check(&y, NULL), expected);
}

static void checks(void **state) {
    (void)state;
    const double bad = (double)NAN;
    const sphpa_yield mises = surface(SPHPA_YIELD_VON_MISES),
                      cone = surface(SPHPA_YIELD_DRUCKER_PRAGER),
                      collins = surface(SPHPA_YIELD_COLLINS);
    sphpa_error err;
    err.message[0] = 'x';
    assert_int_equal(sphpa_yield_check(&mises, &err), SPHPA_OK);
    assert_int_equal(sphpa_yield_check(&cone, &err), SPHPA_OK);
    assert_int_equal(sphpa_yield_check(&collins, &err), SPHPA_OK);
    assert_true(err.message[0] == 'x'); /* written on failure only */
    assert_int_equal(sphpa_yield_check(NULL, &err), SPHPA_ERROR_MISSING);
    sphpa_yield y;
#define REFUSED(base, member, value, code)                                                         \
    y = base;                                                                                      \
    y.member = value;                                                                              \
    refused(y, code, #member)
    REFUSED(mises, Y0, -1.0, SPHPA_ERROR_RANGE);
    REFUSED(mises, Y0, bad, SPHPA_ERROR_NOT_FINITE);
    REFUSED(mises, u_melt, -1.0, SPHPA_ERROR_RANGE);
    REFUSED(cone, u_melt, HUGE_VAL, SPHPA_ERROR_NOT_FINITE);
    REFUSED(cone, a_phi, -0.1, SPHPA_ERROR_RANGE);
    REFUSED(cone, a_phi, bad, SPHPA_ERROR_NOT_FINITE);
    REFUSED(cone, k_c, -1.0, SPHPA_ERROR_RANGE);
    REFUSED(cone, k_c, HUGE_VAL, SPHPA_ERROR_NOT_FINITE);
    REFUSED(collins, Y0, -1.0, SPHPA_ERROR_RANGE);
    REFUSED(collins, Ym, 0.5e7, SPHPA_ERROR_RANGE);
    REFUSED(collins, mu_i, -0.1, SPHPA_ERROR_RANGE);
    REFUSED(collins, mu_d, bad, SPHPA_ERROR_NOT_FINITE);
    REFUSED(collins, kind, kind_of(4), SPHPA_ERROR_RANGE);
#undef REFUSED
    /* members of another kind are not looked at */
    y = mises;
    y.mu_i = y.Ym = y.a_phi = bad;
    assert_int_equal(sphpa_yield_check(&y, NULL), SPHPA_OK);
}

static void drucker_prager_errors(void **state) {
    (void)state;
    const double bad = (double)NAN;
    const double phi[] = {-0.1, 0.5 * PI + 0.001, 30.0, bad, HUGE_VAL, 0.5, 0.5, 0.5};
    const double c[] = {0.0, 0.0, 0.0, 0.0, 0.0, -1.0, bad, HUGE_VAL};
    for (int i = 0; i < 8; i++) {
        sphpa_yield y = surface(SPHPA_YIELD_COLLINS), before;
        sphpa_error err;
        memcpy(&before, &y, sizeof y);
        memset(&err, 0, sizeof err);
        bool finite = isfinite(phi[i]) && isfinite(c[i]);
        sphpa_result expected = finite ? SPHPA_ERROR_RANGE : SPHPA_ERROR_NOT_FINITE;
        assert_int_equal(sphpa_yield_drucker_prager(phi[i], c[i], SPHPA_YIELD_TRIAXIAL, &y, &err),
                         expected);
        assert_int_equal(err.result, expected);
        assert_true(err.message[0] != 0);
        assert_memory_equal(&y, &before, sizeof y);
    }
    sphpa_yield y;
    assert_int_equal(sphpa_yield_drucker_prager(0.5, 0.0, match_of(2), &y, NULL),
                     SPHPA_ERROR_RANGE);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hooke_closed_forms),
        cmocka_unit_test(hooke_general),
        cmocka_unit_test(rotation_keeps_invariants),
        cmocka_unit_test(rotation_angle),
        cmocka_unit_test(rotation_order),
        cmocka_unit_test(rotation_edges),
        cmocka_unit_test(shear_oscillation),
        cmocka_unit_test(second_invariant),
        cmocka_unit_test(nothing_stays_outside),
        cmocka_unit_test(extreme_sizes),
        cmocka_unit_test(denormal_factor),
        cmocka_unit_test(bad_states),
        cmocka_unit_test(no_surface),
        cmocka_unit_test(von_mises_and_softening),
        cmocka_unit_test(drucker_prager_constants),
        cmocka_unit_test(drucker_prager_limits),
        cmocka_unit_test(collins_limits),
        cmocka_unit_test(checks),
        cmocka_unit_test(drucker_prager_errors),
    };
    return cmocka_run_group_tests_name("strength", tests, NULL, NULL);
}
