/* stress_tillotson.h: Tillotson's equation of sphpa.h against long double, for `make stress-eos`:
   pressure, both slopes against differences, sound speed, continuity, range. */
#ifndef STRESS_TILLOTSON_H
#define STRESS_TILLOTSON_H

/* what is wrong most: by how many times what rounding explains, and where */
typedef struct eos_worst {
    double excess, rho, u;
    char material[48];
} eos_worst;

enum { EOS_P, EOS_DRHO, EOS_DU, EOS_C, EOS_BORDER, EOS_CHECKS };
static const char *const eos_check_names[EOS_CHECKS] = {"P", "dP/drho", "dP/du", "c^2",
                                                        "borders"};

typedef struct eos_tally {
    uint64_t states, refused, below_floor, compared[EOS_CHECKS], off[EOS_CHECKS];
    uint64_t regime[3]; /* compressed or cold, hybrid, vapour */
    eos_worst worst[EOS_CHECKS];
} eos_tally;

/* an error `off`, where `allowed` is explained by rounding */
static void eos_see(eos_tally *t, int check, long double off, long double allowed,
                    const stress_case *c, double rho, double u) {
    double excess = off <= 0.0L ? 0.0 : (double)(off / allowed);
    t->compared[check]++;
    if (!(excess <= 1.0)) t->off[check]++;
    if (excess <= t->worst[check].excess) return; /* a NaN is kept */
    t->worst[check].excess = excess;
    t->worst[check].rho = rho;
    t->worst[check].u = u;
    snprintf(t->worst[check].material, sizeof t->worst[check].material, "%s%s", c->material,
             c->keep_B ? " --keep-B" : "");
}

static void eos_merge(eos_tally *into, const eos_tally *from) {
    into->states += from->states;
    into->refused += from->refused;
    into->below_floor += from->below_floor;
    for (int k = 0; k < 3; k++) into->regime[k] += from->regime[k];
    for (int k = 0; k < EOS_CHECKS; k++) {
        const eos_worst *a = &into->worst[k], *b = &from->worst[k];
        into->compared[k] += from->compared[k];
        into->off[k] += from->off[k];
        if (b->excess > a->excess || (b->excess == a->excess && b->rho < a->rho))
            into->worst[k] = *b;
    }
}

/* P of the reference without cut-offs at (rho, u); p holds the material and is scratch */
static long double eos_book(ref_problem *p, long double rho, long double u) {
    p->u = u;
    return ref_matrix(p, rho, rho - p->rho0).P;
}

/* one branch; the callers leave out of the material what would drown a difference */
static long double eos_branch(ref_problem *p, bool vapour, long double rho, long double u) {
    p->u = u;
    ref_matter m = vapour ? ref_vapour(p, rho, rho - p->rho0) : ref_cold(p, rho, rho - p->rho0);
    return m.P;
}

/* fourth-order central difference of a branch in rho (h_u = 0) or in u (h_rho = 0) */
static long double eos_slope(ref_problem *p, bool vapour, long double rho, long double u,
                             long double h_rho, long double h_u) {
    long double f[4];
    for (int k = 0; k < 4; k++) {
        long double step = k < 2 ? (long double)(2 * k - 1) : (long double)(4 * k - 10);
        f[k] = eos_branch(p, vapour, rho + step * h_rho, u + step * h_u);
    }
    return (8.0L * (f[1] - f[0]) - (f[3] - f[2])) / (12.0L * (h_rho + h_u));
}

/* dP/drho and dP/du from differences of each branch, blended by hand: the gas term's slopes a u and
   a rho are added, and what u does not move is left out of the difference in u */
static void eos_slopes(const ref_problem *p, long double rho, long double u, const long double h[3],
                       long double *drho, long double *du) {
    ref_problem elastic = *p, thermal = *p;
    elastic.a = thermal.a = thermal.A = thermal.B = 0.0L;
    bool cold = rho >= p->rho0 || u <= p->u_iv;
    long double t = cold ? 0.0L : fminl((u - p->u_iv) / (p->u_cv - p->u_iv), 1.0L);
    *drho = p->a * u;
    *du = p->a * rho;
    for (int vapour = 0; vapour < 2; vapour++) {
        long double share = vapour ? t : 1.0L - t;
        if (share <= 0.0L) continue;
        *drho += share * eos_slope(&elastic, vapour != 0, rho, u, h[vapour], 0.0L);
        *du += share * eos_slope(&thermal, vapour != 0, rho, u, 0.0L, h[2]);
    }
    if (t <= 0.0L || t >= 1.0L) return;
    elastic.a = p->a;
    *du += (eos_branch(&elastic, true, rho, u) - eos_branch(&elastic, false, rho, u)) /
           (p->u_cv - p->u_iv);
}

/* The sizes that rounding is relative to: of P, of rho dP/drho, of dP/du; with the steps that suit
   a difference. steep: how much faster than rho itself the exponentials move. */
typedef struct eos_sizes {
    long double P, slope, du, h[3]; /* h: in rho, cold and vapour; in u */
} eos_sizes;

static eos_sizes eos_sizes_at(ref_problem *p, long double rho, long double u) {
    eos_sizes s;
    long double excess = rho - p->rho0, eta = rho / p->rho0;
    long double z = excess < 0.0L ? -excess / rho : 0.0L;
    bool cold = excess >= 0.0L || u <= p->u_iv, hybrid = !cold && u < p->u_cv;
    bool gas = cold || p->alpha * z * z > 80.0L; /* no exponentials, or none that is left */
    long double steep = gas ? 1.0L : 1.0L + 2.0L * p->alpha * z * (1.0L + z) + p->beta * z;
    p->u = u;
    ref_matter c = ref_cold(p, rho, excess), v = cold ? c : ref_vapour(p, rho, excess);
    s.P = cold || hybrid ? c.size : 0.0L;
    if (!cold) s.P += v.size;
    /* what is multiplied by a vanishing exponential does not count */
    long double bulk = cold || hybrid ? p->A * eta + p->B * eta * eta : 0.0L;
    s.slope = s.P + bulk + (cold ? 0.0L : (v.size - p->a * rho * u) * steep);
    if (!gas)
        s.slope += p->A * eta * expl(-(p->beta + p->alpha * z) * z) * steep;
    s.du = rho * (p->a + p->b) + (hybrid ? s.P / (p->u_cv - p->u_iv) : 0.0L);
    s.h[0] = 1e-4L * rho;
    s.h[1] = 1e-4L * rho / steep;
    s.h[2] = 1e-4L * (u + p->E0 * eta * eta);
    return s;
}

/* Do the differences stay on one side of the borders? */
static bool eos_smooth(const ref_problem *p, double rho, double u, const eos_sizes *s) {
    long double d_rho = fabsl(ref_wide(rho) - p->rho0);
    if (d_rho <= 3.0L * s->h[0]) return false;
    if (ref_wide(rho) > p->rho0) return true;
    return fabsl(ref_wide(u) - p->u_iv) > 3.0L * s->h[2] &&
           fabsl(ref_wide(u) - p->u_cv) > 3.0L * s->h[2];
}

static void eos_compare(eos_tally *t, const stress_case *c, double rho, double u) {
    sphpa_eos_point got;
    ref_problem p, cut;
    const long double margin = 64.0L * ref_wide(DBL_EPSILON);
    long double wide_rho = ref_wide(rho), wide_u = ref_wide(u);
    ref_set_material(&cut, &c->mat);
    p = cut;
    p.tensile_limit = p.eta_cut = 0.0L;
    t->states++;
    t->regime[rho >= c->mat.rho0 || u <= c->mat.u_iv ? 0 : u < c->mat.u_cv ? 1 : 2]++;
    if (sphpa_tillotson_eval(&c->mat, rho, u, &got) != SPHPA_OK) {
        t->refused++;
        return;
    }
    double floor2 = 0.01 * c->mat.A / c->mat.rho0;
    if (!(got.c * got.c >= floor2 * (1.0 - 4.0 * DBL_EPSILON))) t->below_floor++;
    eos_sizes s = eos_sizes_at(&p, wide_rho, wide_u);
    long double uncut = eos_book(&p, wide_rho, wide_u), P;
    cut.u = wide_u;
    P = ref_matrix(&cut, wide_rho, wide_rho - cut.rho0).P;
    eos_see(t, EOS_P, fabsl(ref_wide(got.P) - P), margin * s.P, c, rho, u);
    if (!eos_smooth(&p, rho, u, &s)) return;
    long double drho, du;
    eos_slopes(&p, wide_rho, wide_u, s.h, &drho, &du);
    long double c2 = drho + uncut / wide_rho * (du / wide_rho);
    long double c2_size = s.slope / wide_rho + s.P / wide_rho * (s.du / wide_rho);
    c2 = fmaxl(c2, ref_wide(floor2));
    eos_see(t, EOS_C, fabsl(ref_wide(got.c) * ref_wide(got.c) - c2),
            margin * (c2_size + ref_wide(floor2)), c, rho, u);
    if (fabsl(uncut - P) > 0.0L) drho = du = 0.0L; /* held by a cut-off */
    else if (fabsl(uncut + cut.tensile_limit) <= margin * s.P) return;
    eos_see(t, EOS_DRHO, fabsl(ref_wide(got.dP_drho) - drho), margin * s.slope / wide_rho, c, rho,
            u);
    eos_see(t, EOS_DU, fabsl(ref_wide(got.dP_du) - du), margin * s.du, c, rho, u);
}

/* P and dP/drho on both sides of a border, one rounding away */
static void eos_border(eos_tally *t, stress_case *c, sphpa_rng *rng) {
    sphpa_eos_point low, high;
    ref_problem p;
    c->mat.tensile_limit = c->mat.eta_cut = 0.0; /* eta_cut is a step by intent */
    ref_set_material(&p, &c->mat);
    double rho = c->mat.rho0 * stress_log(rng, -1.0, 0.0), u = stress_draw_u(rng, &c->mat);
    double rho_low = rho, u_low = u;
    uint32_t border = sphpa_rng_below(rng, 3);
    if (border == 0) rho = c->mat.rho0, rho_low = nextafter(rho, 0.0);
    else u_low = border == 1 ? c->mat.u_iv : c->mat.u_cv, u = nextafter(u_low, 1e14);
    if (border == 0) u_low = u;
    if (sphpa_tillotson_eval(&c->mat, rho, u, &high) != SPHPA_OK ||
        sphpa_tillotson_eval(&c->mat, rho_low, u_low, &low) != SPHPA_OK) {
        t->refused++;
        return;
    }
    long double margin = 64.0L * ref_wide(DBL_EPSILON), wide_u = ref_wide(u);
    eos_sizes cold = eos_sizes_at(&p, ref_wide(rho_low), fminl(wide_u, p.u_iv));
    eos_sizes hot = eos_sizes_at(&p, ref_wide(rho_low), fmaxl(wide_u, p.u_cv));
    long double rho_size = ref_wide(rho) * ref_wide(high.dP_drho);
    eos_see(t, EOS_BORDER, fabsl(ref_wide(high.P) - ref_wide(low.P)),
            margin * (cold.P + hot.P + fabsl(rho_size)), c, rho, u);
    eos_see(t, EOS_BORDER, fabsl(ref_wide(high.dP_drho) - ref_wide(low.dP_drho)),
            margin * (cold.slope + hot.slope) / ref_wide(rho), c, rho, u);
}

static void eos_run(uint64_t seed, long states, eos_tally *all) {
    int64_t blocks = (states + 999) / 1000;
    memset(all, 0, sizeof *all);
#ifdef _OPENMP
#pragma omp parallel
#endif
    {
        eos_tally mine;
        memset(&mine, 0, sizeof mine);
#ifdef _OPENMP
#pragma omp for schedule(dynamic, 4)
#endif
        for (int64_t b = 0; b < blocks; b++) {
            sphpa_rng rng = sphpa_rng_seed(seed, 1000000000u + (uint64_t)b);
            stress_case c;
            memset(&c, 0, sizeof c);
            stress_draw_material(&rng, &c);
            for (int i = 0; i < 1000; i++) {
                double u = stress_draw_u(&rng, &c.mat), rho = stress_log(&rng, -10.0, 6.0);
                if (i % 4 != 0) rho = c.mat.rho0 * stress_log(&rng, -1.5, 0.7);
                if (i % 16 == 1) rho = c.mat.rho0 * (1.0 + stress_log(&rng, -16.0, -2.0) - 2e-9);
                eos_compare(&mine, &c, rho, u);
            }
            for (int i = 0; i < 100; i++) eos_border(&mine, &c, &rng);
        }
#ifdef _OPENMP
#pragma omp critical
#endif
        eos_merge(all, &mine);
    }
}

/* prints the table; returns how many comparisons failed */
static uint64_t eos_print(const eos_tally *t) {
    uint64_t bad = t->refused + t->below_floor;
    printf("Tillotson: %llu states (compressed or cold %llu, hybrid %llu, vapour %llu), refused or "
           "overflowed %llu, c^2 below its floor %llu\n",
           (unsigned long long)t->states, (unsigned long long)t->regime[0],
           (unsigned long long)t->regime[1], (unsigned long long)t->regime[2],
           (unsigned long long)t->refused, (unsigned long long)t->below_floor);
    printf("%-10s %10s %6s  %s\n", "", "compared", "off",
           "worst, by 64 eps of its terms, and where");
    for (int k = 0; k < EOS_CHECKS; k++) {
        const eos_worst *w = &t->worst[k];
        printf("%-10s %10llu %6llu  %.3f  rho %.17g u %.17g %s\n", eos_check_names[k],
               (unsigned long long)t->compared[k], (unsigned long long)t->off[k], w->excess, w->rho,
               w->u, w->material);
        bad += t->off[k];
    }
    return bad;
}

#endif /* STRESS_TILLOTSON_H */
