/* bench_riemann.c: which Riemann solver for which flow? Time of one problem, alone and in a batch,
   beside the error of P* and v* against a bisection in long double that shares no code with them.

   make bench-riemann builds and runs it. Mixes of states go from smooth flow to charges in air. Two
   peers that are not in the library join: Dukowicz's two shocks without iteration, and Newton in
   the root of P. Writes riemann.csv. One thread; processor time; all solvers in turn, repeat after
   repeat, so that a busy moment meets them all. */
#include "../examples/example.h"

#define SPHPA_RIEMANN_IMPLEMENTATION
#include "sphpa.h"

#include "bench_clock.h"

enum { BENCH_N = 4096, BENCH_MIXES = 7, BENCH_PEERS = 2, BENCH_REPEATS = 11 };
enum { BENCH_SOLVERS = SPHPA_RIEMANN_SOLVERS + BENCH_PEERS };
#define BENCH_SAMPLE 4e-3 /* [s] least length of one timing */

/* What problems a mix has; g = 1.4. */
static const char *const bench_mixes[BENCH_MIXES][2] = {
    {"smooth", "a normal deviate of 1e-6 to 0.1, log-uniform, of ln rho, ln P and v/c"},
    {"toro", "Toro's five tests, every number changed by 10 %"},
    {"tubes", "at rest; P ratio 1e3 to 1e8, rho 0.1 to 1e3 against 0.1 to 10"},
    {"charge", "1000 kg/m3 and 5.3e11 Pa into air (816:1, 5.2e6:1), +-30 and 50 %, v +-0.5 c"},
    {"collide", "gases that meet at Mach 0.1 to 1e4"},
    {"wide", "P to 1e8:1, rho to 1e4:1, Mach 0.01 to 1e3, both signs; a sixth opens a vacuum"},
    {"near-vacuum", "gases that part by 1e-6 to 1 less than what opens a vacuum"},
};

/* n problems, and what is right */
typedef struct bench_problems {
    double in[6][BENCH_N]; /* rho, v, P of the left, then of the right */
    double P[BENCH_N], v[BENCH_N], scale_P[BENCH_N], scale_v[BENCH_N];
} bench_problems;

/* how a solver did in a mix */
typedef struct bench_row {
    int mix, solver;
    double ns, batch_ns, spread_pct; /* a problem; the spread of the batch, or of the peer */
    double P_median, P_largest, v_median, v_largest;
    double iterations, alone; /* a problem; share that was not solved side by side */
    int iterations_most;
    unsigned long long failed;
} bench_row;

typedef struct bench_settings {
    const char *out, *only;
    int quick;
} bench_settings;

static const double bench_gamma = 1.4;

/* ---- what is right --------------------------------------------------------------------------- */

/* f of one side, after Toro 2009, 4.6 and 4.7, in long double */
static long double exact_f(long double P, long double rho, long double p) {
    long double g = (long double)bench_gamma, c = sqrtl(g * p / rho);
    if (P <= p) return 2.0L * c / (g - 1.0L) * (powl(P / p, (g - 1.0L) / (2.0L * g)) - 1.0L);
    return (P - p) * sqrtl(2.0L / (rho * ((g + 1.0L) * P + (g - 1.0L) * p)));
}

/* P* and v*, by halving ln P */
static void exact_solve(bench_problems *b, int k) {
    long double rho_l = b->in[0][k], v_l = b->in[1][k], P_l = b->in[2][k];
    long double rho_r = b->in[3][k], v_r = b->in[4][k], P_r = b->in[5][k];
    long double g = (long double)bench_gamma, dv = v_r - v_l, low = 1e-120L, high = 1e60L;
    long double c_l = sqrtl(g * P_l / rho_l), c_r = sqrtl(g * P_r / rho_r);
    b->scale_v[k] = (double)(c_l + c_r + fabsl(dv));
    b->scale_P[k] = 1e-3 * fmin((double)P_l, (double)P_r);
    if (dv >= 2.0L * (c_l + c_r) / (g - 1.0L)) {
        b->P[k] = 0.0;
        b->v[k] = (double)(0.5L * (v_l + v_r) + (c_l - c_r) / (g - 1.0L));
        return;
    }
    for (int n = 0; n < 80; n++) {
        long double P = sqrtl(low * high);
        if (exact_f(P, rho_l, P_l) + exact_f(P, rho_r, P_r) + dv < 0.0L) low = P;
        else high = P;
    }
    b->P[k] = (double)low;
    b->v[k] = (double)(0.5L * (v_l + v_r) +
                       0.5L * (exact_f(low, rho_r, P_r) - exact_f(low, rho_l, P_l)));
    b->scale_P[k] = fmax(b->scale_P[k], b->P[k]);
}

/* ---- problems -------------------------------------------------------------------------------- */

static double bench_between(sphpa_rng *rng, double low, double high) {
    return exp(log(low) + (log(high) - log(low)) * sphpa_rng_uniform(rng));
}

static void bench_draw_tubes(sphpa_rng *rng, int mix, double q[6]) {
    static const double toro[5][6] = {
        {1.0, 0.0, 1.0, 0.125, 0.0, 0.1},     {1.0, -2.0, 0.4, 1.0, 2.0, 0.4},
        {1.0, 0.0, 1000.0, 1.0, 0.0, 0.01},   {1.0, 0.0, 0.01, 1.0, 0.0, 100.0},
        {5.99924, 19.5975, 460.894, 5.99242, -6.19633, 46.0950}};
    uint32_t test = sphpa_rng_below(rng, 5);
    if (mix == 1) {
        for (int a = 0; a < 6; a++) q[a] = toro[test][a] * exp(0.1 * sphpa_rng_normal(rng));
        return;
    }
    q[0] = bench_between(rng, 0.1, 1e3);
    q[2] = bench_between(rng, 1e3, 1e6);
    q[3] = bench_between(rng, 0.1, 10.0);
    q[5] = bench_between(rng, 0.01, 1.0);
    if (mix == 2) return;
    q[0] = 1000.0 * exp(0.3 * sphpa_rng_normal(rng));
    q[2] = 5.3e11 * exp(0.5 * sphpa_rng_normal(rng));
    q[3] = 1.225 * exp(0.3 * sphpa_rng_normal(rng));
    q[5] = 1.02e5 * exp(0.5 * sphpa_rng_normal(rng));
    q[1] = 0.5 * sphpa_rng_normal(rng) * sqrt(bench_gamma * q[2] / q[0]);
}

static void bench_draw_apart(sphpa_rng *rng, int mix, double q[6]) {
    double span_rho = mix == 5 ? 100.0 : 10.0, span_P = mix == 5 ? 1e4 : 10.0;
    for (int a = 0; a < 6; a += 3) {
        q[a] = bench_between(rng, 1.0 / span_rho, span_rho);
        q[a + 2] = bench_between(rng, 1.0 / span_P, span_P);
    }
    double c = sqrt(bench_gamma * q[2] / q[0]) + sqrt(bench_gamma * q[5] / q[3]);
    if (mix == 4) q[4] = -c * bench_between(rng, 0.1, 1e4);
    if (mix == 5) q[4] = c * bench_between(rng, 1e-2, 1e3) * (sphpa_rng_below(rng, 3) ? -1.0 : 1.0);
    if (mix == 6) q[4] = 5.0 * c * (1.0 - bench_between(rng, 1e-6, 1.0));
}

static void bench_draw(bench_problems *b, int mix) {
    sphpa_rng rng = sphpa_rng_seed(1, (uint64_t)mix + 1);
    for (int k = 0; k < BENCH_N; k++) {
        double q[6] = {1.0, 0.0, 1.0, 1.0, 0.0, 1.0};
        if (mix == 0) {
            double jump = bench_between(&rng, 1e-6, 0.1);
            q[3] = exp(jump * sphpa_rng_normal(&rng));
            q[5] = exp(jump * sphpa_rng_normal(&rng));
            q[4] = jump * sphpa_rng_normal(&rng) * sqrt(bench_gamma);
        } else if (mix <= 3) {
            bench_draw_tubes(&rng, mix, q);
        } else {
            bench_draw_apart(&rng, mix, q);
        }
        int mirror = sphpa_rng_below(&rng, 2) != 0; /* who is left is chance */
        for (int a = 0; a < 6; a++) b->in[a][k] = q[mirror ? (a + 3) % 6 : a];
        if (mirror) b->in[1][k] = -b->in[1][k];
        if (mirror) b->in[4][k] = -b->in[4][k];
        exact_solve(b, k);
    }
}

/* ---- peers ----------------------------------------------------------------------------------- */

/* Dukowicz 1985 (J. Comput. Phys. 61, 119): shock speeds rise linearly with the jump of velocity,
   by (g + 1)/2; each side is then a parabola P(v), and where two of these meet is the root of a
   quadratic equation. */
static void peer_dukowicz(const double q[6], double *P, double *v) {
    double A = 0.5 * (bench_gamma + 1.0), w = 0.5 / A;
    double rho_l = q[0] * A, rho_r = q[3] * A;
    double c_l = sqrt(bench_gamma * q[2] / q[0]), c_r = sqrt(bench_gamma * q[5] / q[3]);
    double top_l = q[1] + w * c_l, top_r = q[4] - w * c_r; /* where the parabolas turn */
    double p_l = q[2] - 0.5 * w * q[0] * c_l * c_l, p_r = q[5] - 0.5 * w * q[3] * c_r * c_r;
    double d = top_l - top_r;
    double a_l = p_l - p_r - rho_r * d * fabs(d) > 0.0 ? -rho_l : rho_l;
    double a_r = p_l + rho_l * d * fabs(d) - p_r > 0.0 ? rho_r : -rho_r;
    /* p_l + a_l (d - t)^2 = p_r + a_r t^2 with t = v - top_r */
    double a = a_l - a_r, b = -a_l * d, c = p_l - p_r + a_l * d * d;
    double root = sqrt(fmax(b * b - a * c, 0.0)), sum = -b - (b > 0.0 ? root : -root);
    double t1 = sum / a, t2 = c / sum, t = t1;
    bool first = (t1 >= 0.0) == (a_r > 0.0) && (d - t1 >= 0.0) == (a_l > 0.0);
    if (!first || !isfinite(t1)) t = t2;
    *v = top_r + t;
    *P = fmax(0.5 * ((p_l + a_l * (d - t) * (d - t)) + (p_r + a_r * t * t)), 0.0);
}

/* F, eq. (1), and its slope in s = sqrt(P) */
static double peer_f(double P, double rho, double p, double *slope) {
    double g = bench_gamma, c = sqrt(g * p / rho), z = 0.5 * (g - 1.0) / g;
    if (P <= p) {
        double y = pow(P / p, z);
        *slope += 2.0 * c * y / (g * sqrt(P));
        return 2.0 * c / (g - 1.0) * (y - 1.0);
    }
    double e = (g + 1.0) * P + (g - 1.0) * p, root = sqrt(2.0 / (rho * e));
    *slope += 2.0 * sqrt(P) * root * (1.0 - 0.5 * (g + 1.0) * (P - p) / e);
    return (P - p) * root;
}

/* three steps of Newton in sqrt(P) from eq. (9) */
static void peer_root_P(const double q[6], double *P, double *v) {
    double g = bench_gamma, p = fmax(q[2], q[5]), dv = q[4] - q[1];
    double u_l = sqrt(p / q[0]), u_r = sqrt(p / q[3]), per = 1.0 / (u_l + u_r);
    double X = (q[2] * u_l + q[5] * u_r) / p * per, w = -sqrt(0.5) * dv * per;
    double b = 0.5 * (g + 1.0) * w, x = X + w * (b + sqrt(b * b + 2.0 * g * X));
    double s = sqrt(p * fmax(x, 1e-3 * fmin(q[2], q[5]) / p)), f_l = 0.0, f_r = 0.0;
    for (int n = 0; n < 3; n++) {
        double slope = 0.0;
        f_l = peer_f(s * s, q[0], q[2], &slope);
        f_r = peer_f(s * s, q[3], q[5], &slope);
        s = fmax(s - (f_l + f_r + dv) / slope, 0.05 * s);
    }
    *P = s * s;
    *v = 0.5 * (q[1] + q[4]) + 0.5 * (f_r - f_l);
}

/* ---- running --------------------------------------------------------------------------------- */

static const char *bench_name(int solver) {
    static const char *const peers[BENCH_PEERS] = {"(dukowicz)", "(root-P, 3 steps)"};
    if (solver >= (int)SPHPA_RIEMANN_SOLVERS) return peers[solver - (int)SPHPA_RIEMANN_SOLVERS];
    return sphpa_riemann_name((sphpa_riemann_solver)solver);
}

static void bench_one_by_one(const bench_problems *b, int solver, double *P, double *v) {
    for (int k = 0; k < BENCH_N; k++) {
        double q[6];
        for (int a = 0; a < 6; a++) q[a] = b->in[a][k];
        if (solver == (int)SPHPA_RIEMANN_SOLVERS) peer_dukowicz(q, &P[k], &v[k]);
        if (solver == (int)SPHPA_RIEMANN_SOLVERS + 1) peer_root_P(q, &P[k], &v[k]);
        if (solver >= (int)SPHPA_RIEMANN_SOLVERS) continue;
        sphpa_riemann_state l, r;
        sphpa_riemann_star star;
        l.rho = q[0];
        l.v = q[1];
        l.P = q[2];
        r.rho = q[3];
        r.v = q[4];
        r.P = q[5];
        if (sphpa_riemann_solve((sphpa_riemann_solver)solver, bench_gamma, &l, &r, &star) !=
            SPHPA_OK)
            star.P = star.v = 0.0;
        P[k] = star.P;
        v[k] = star.v;
    }
}

static void bench_batch(const bench_problems *b, int solver, double *P, double *v,
                        sphpa_riemann_stats *stats) {
    (void)sphpa_riemann_batch((sphpa_riemann_solver)solver, bench_gamma, BENCH_N, b->in[0],
                              b->in[1], b->in[2], b->in[3], b->in[4], b->in[5], P, v, stats);
}

/* [ns] a problem; batch: 0 or 1 */
static double bench_sample(const bench_problems *b, int solver, int batch, int passes) {
    static double P[BENCH_N], v[BENCH_N];
    clock_t since = clock(); /* of the processor */
    for (int k = 0; k < passes; k++) {
        if (batch != 0) bench_batch(b, solver, P, v, NULL);
        else bench_one_by_one(b, solver, P, v);
    }
    return 1e9 * (double)(clock() - since) / CLOCKS_PER_SEC / passes / BENCH_N;
}

static void bench_time(const bench_problems *b, bench_row *rows, int repeats) {
    static double sample[2][BENCH_SOLVERS][BENCH_REPEATS];
    int passes[2][BENCH_SOLVERS];
    for (int j = 0; j < 2 * BENCH_SOLVERS; j++) {
        int solver = j / 2, batch = j % 2;
        if (batch != 0 && solver >= (int)SPHPA_RIEMANN_SOLVERS) continue;
        double ns = fmax(bench_sample(b, solver, batch, 2), 0.5);
        passes[batch][solver] = 1 + (int)(BENCH_SAMPLE / (1e-9 * ns * BENCH_N));
    }
    for (int repeat = 0; repeat < repeats; repeat++)
        for (int turn = 0; turn < 2 * BENCH_SOLVERS; turn++) {
            int j = (turn + 2 * repeat) % (2 * BENCH_SOLVERS), solver = j / 2, batch = j % 2;
            if (batch != 0 && solver >= (int)SPHPA_RIEMANN_SOLVERS) continue;
            sample[batch][solver][repeat] = bench_sample(b, solver, batch, passes[batch][solver]);
        }
    for (int solver = 0; solver < BENCH_SOLVERS; solver++) {
        rows[solver].ns = bench_median(sample[0][solver], repeats, &rows[solver].spread_pct);
        if (solver < (int)SPHPA_RIEMANN_SOLVERS)
            rows[solver].batch_ns =
                bench_median(sample[1][solver], repeats, &rows[solver].spread_pct);
    }
}

static void bench_judge(const bench_problems *b, int solver, bench_row *row) {
    static double P[BENCH_N], v[BENCH_N], off_P[BENCH_N], off_v[BENCH_N];
    double spread;
    sphpa_riemann_stats stats;
    memset(&stats, 0, sizeof stats);
    if (solver < (int)SPHPA_RIEMANN_SOLVERS) bench_batch(b, solver, P, v, &stats);
    else bench_one_by_one(b, solver, P, v);
    for (int k = 0; k < BENCH_N; k++) {
        off_P[k] = fabs(P[k] - b->P[k]) / b->scale_P[k];
        off_v[k] = fabs(v[k] - b->v[k]) / b->scale_v[k];
        if (!(off_P[k] + off_v[k] < HUGE_VAL)) off_P[k] = off_v[k] = HUGE_VAL;
    }
    row->P_median = bench_median(off_P, BENCH_N, &spread);
    row->v_median = bench_median(off_v, BENCH_N, &spread);
    row->P_largest = off_P[BENCH_N - 1]; /* it has sorted them */
    row->v_largest = off_v[BENCH_N - 1];
    row->iterations = (double)stats.iterations / BENCH_N;
    row->iterations_most = stats.iterations_max;
    row->alone = (double)stats.alone / BENCH_N;
    row->failed = (unsigned long long)stats.failed;
}

/* ---- telling --------------------------------------------------------------------------------- */

static void bench_about(FILE *to, const char *mark) {
    char cpu[128];
    bench_read_cpu(cpu);
    fprintf(to, "%ssphpa %s, Riemann solvers, gamma %g, one thread\n", mark, SPHPA_VERSION,
            bench_gamma);
    fprintf(to, "%scpu: %s\n%scompiler: %s\n%sflags: %s\n", mark, cpu, mark, BENCH_COMPILER, mark,
            BENCH_FLAGS);
    fprintf(to, "%stimes: processor time of a problem, medians of interleaved repeats; errors: of "
                "P* relative to the larger of P* and a thousandth of both pressures, of v* "
                "relative to c_l + c_r + |v_r - v_l|\n", mark);
}

static void bench_print(int mix, const bench_row *rows) {
    printf("\n### %s: %s\n\n", bench_mixes[mix][0], bench_mixes[mix][1]);
    printf("| solver | ns alone | ns in a batch | spread %% | P* off: median | largest | v* off: "
           "median | largest | iterations: mean | most | alone %% | failed |\n"
           "|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (int k = 0; k < BENCH_SOLVERS; k++) {
        const bench_row *r = &rows[k];
        char batch[32] = "-";
        if (r->batch_ns > 0.0) snprintf(batch, sizeof batch, "%.1f", r->batch_ns);
        printf("| %s | %.0f | %s | %.0f | %.1e | %.1e | %.1e | %.1e | %.2f | %d | %.1f | %llu |\n",
               bench_name(k), r->ns, batch, r->spread_pct, r->P_median, r->P_largest, r->v_median,
               r->v_largest, r->iterations, r->iterations_most, 100.0 * r->alone, r->failed);
    }
    fflush(stdout);
}

static void bench_write(const bench_settings *s, const bench_row *rows, int count) {
    example_file file = example_open(s->out, "riemann.csv");
    bench_about(file.stream, "# ");
    fprintf(file.stream, "mix,solver,ns,batch_ns,spread_pct,P_median,P_largest,v_median,v_largest,"
                         "iterations,iterations_most,alone,failed\n");
    for (int k = 0; k < count; k++) {
        const bench_row *r = &rows[k];
        fprintf(file.stream, "%s,\"%s\",%.2f,%.2f,%.2f,%.3e,%.3e,%.3e,%.3e,%.3f,%d,%.4f,%llu\n",
                bench_mixes[r->mix][0], bench_name(r->solver), r->ns, r->batch_ns, r->spread_pct,
                r->P_median, r->P_largest, r->v_median, r->v_largest, r->iterations,
                r->iterations_most, r->alone, r->failed);
    }
    example_close(&file);
    fprintf(stderr, "wrote %s/riemann.csv\n", s->out);
}

int main(int argc, char **argv) {
    bench_settings s;
    memset(&s, 0, sizeof s);
    s.out = "build/bench";
    s.only = "";
    const example_option options[] = {
        example_flag("quick", &s.quick, "three repeats"),
        example_text("only", "NAME", &s.only, "mixes whose names hold this"),
        example_text("out", "DIR", &s.out, "where riemann.csv goes")};
    example_parse(argc, argv, "Riemann solvers, time beside error", SPHPA_VERSION, options,
                  (int)(sizeof options / sizeof options[0]));
    (void)example_threads(1);
    example_folder(s.out);
    static bench_row rows[BENCH_MIXES * BENCH_SOLVERS];
    static bench_problems problems;
    int count = 0;
    bench_about(stdout, "- ");
    for (int mix = 0; mix < BENCH_MIXES; mix++) {
        if (strstr(bench_mixes[mix][0], s.only) == NULL) continue;
        bench_draw(&problems, mix);
        for (int k = 0; k < BENCH_SOLVERS; k++) {
            rows[count + k].mix = mix;
            rows[count + k].solver = k;
            bench_judge(&problems, k, &rows[count + k]);
        }
        bench_time(&problems, rows + count, s.quick ? 3 : BENCH_REPEATS);
        bench_print(mix, rows + count);
        count += BENCH_SOLVERS;
    }
    if (count == 0) example_fail(2, "--only %s: no mix has that in its name", s.only);
    bench_write(&s, rows, count);
    if (fflush(stdout) != 0 || ferror(stdout))
        example_fail(1, "cannot write to standard output (%s)", strerror(errno));
    return 0;
}
