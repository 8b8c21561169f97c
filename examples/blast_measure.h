/* blast_measure.h: what blast.c measures: means in rings, the outer shell, the 1-D reference. */
#ifndef BLAST_MEASURE_H
#define BLAST_MEASURE_H

/* ---- the case as a function of the place ----------------------------------------------------- */

/* the area of the quarter disc of radius r within [0, x] x [0, y], odd in x and in y */
static double blast_corner_area(double x, double y, double r) {
    double sign = (x < 0.0) != (y < 0.0) ? -1.0 : 1.0;
    x = fmin(fabs(x), r);
    y = fmin(fabs(y), r);
    if (x * x + y * y <= r * r) return sign * x * y;
    double s = sqrt(r * r - y * y); /* from there on the circle is lower than y */
    double to = 0.5 * (x * sqrt(r * r - x * x) + r * r * asin(x / r));
    double from = 0.5 * (s * y + r * r * asin(s / r));
    return sign * (s * y + to - from);
}

/* what fills a mesh: exact means over squares, or rings, that are `width` wide */
typedef struct blast_filler {
    const blast_settings *s;
    double width; /* [m] */
    int radial;
} blast_filler;

/* the charge's share of the square, or ring, whose middle is x */
static double blast_share(const blast_filler *filler, const double *x) {
    double r = filler->s->radius, w = 0.5 * filler->width;
    if (filler->radial) {
        double low = x[0] - w, high = fmin(x[0] + w, r);
        return high > low ? (high * high - low * low) / (4.0 * x[0] * w) : 0.0;
    }
    double far = sqrt(x[0] * x[0] + x[1] * x[1]);
    if (far > r + 1.5 * w) return 0.0;
    if (far < r - 1.5 * w) return 1.0;
    double area = blast_corner_area(x[0] + w, x[1] + w, r) - blast_corner_area(x[0] - w, x[1] + w, r) -
                  blast_corner_area(x[0] + w, x[1] - w, r) + blast_corner_area(x[0] - w, x[1] - w, r);
    return fmin(fmax(area / (4.0 * w * w), 0.0), 1.0);
}

static void blast_fill(const double x[2], void *user, sphpa_grid_state *out) {
    const blast_filler *filler = (const blast_filler *)user;
    const blast_settings *s = filler->s;
    double q = blast_share(filler, x);
    out->rho = q * s->rho_charge + (1.0 - q) * s->rho_air;
    out->P = q * blast_charge_pressure(s) + (1.0 - q) * s->P_air;
    out->v[0] = out->v[1] = 0.0;
}

/* ---- means in rings, and the outer shell ----------------------------------------------------- */

/* Means over rings of one width, from the middle outwards. */
typedef struct blast_profile {
    int count;
    double width;            /* [m] */
    double *rho, *P, *area;  /* (count) [kg/m3] [Pa] [m2] that was added up */
} blast_profile;

static void blast_profile_begin(blast_profile *profile, double radius, double width) {
    profile->count = (int)fmax(floor(radius / width), 1.0);
    profile->width = width;
    profile->rho = (double *)calloc((size_t)profile->count * 3, sizeof(double));
    if (profile->rho == NULL) example_fail(1, "out of memory");
    profile->P = profile->rho + profile->count;
    profile->area = profile->P + profile->count;
}

static void blast_profile_free(blast_profile *profile) {
    free(profile->rho);
    memset(profile, 0, sizeof *profile);
}

static void blast_profile_add(blast_profile *profile, double x, double y, double rho, double P,
                              double area) {
    double ring = sqrt(x * x + y * y) / profile->width;
    if (!(ring < profile->count)) return;
    int k = (int)ring;
    profile->rho[k] += area * rho;
    profile->P[k] += area * P;
    profile->area[k] += area;
}

/* Sums become means. Rings that got nothing lie between others (thin gas has few particles): linear
   there; within the first as the first, beyond the last it is air. */
static void blast_profile_end(blast_profile *p, const blast_settings *s) {
    int before = -1;
    for (int k = 0; k < p->count; k++) {
        if (!(p->area[k] > 0.0)) continue;
        p->rho[k] /= p->area[k];
        p->P[k] /= p->area[k];
        for (int i = before + 1; i < k; i++) {
            double w = before < 0 ? 1.0 : (double)(i - before) / (k - before);
            int from = before < 0 ? k : before;
            p->rho[i] = (1.0 - w) * p->rho[from] + w * p->rho[k];
            p->P[i] = (1.0 - w) * p->P[from] + w * p->P[k];
        }
        before = k;
    }
    for (int k = before + 1; k < p->count; k++) {
        p->rho[k] = s->rho_air;
        p->P[k] = s->P_air;
    }
}

/* What is compared at an output. radius 0: there is no shock. */
typedef struct blast_shell {
    double radius;            /* [m] outermost place of half the outer shell's maximum of P */
    double inner;             /* [m] where the outer shell ends inside */
    double P_peak, rho_peak;  /* [Pa] [kg/m3] maxima within the outer shell */
    double rho_max;           /* [kg/m3] maximum of all */
    int borrowed;             /* not 0: the maximum is the reference's */
} blast_shell;

/* The outer shell: from outside to where P has fallen by 5 % below a maximum above 3 P_air. Coarse
   runs have no shell yet at early times, P only rises to that of the charge: where this maximum is
   more than twice that of the reference's shell (P_known; 0: not known), the shell goes to where P
   reaches P_known. */
static blast_shell blast_shell_of(const double *rho, const double *P, int count, double width,
                                  double P_air, double P_known) {
    blast_shell shell;
    int top = count - 1, inner = 0, half = count - 1;
    memset(&shell, 0, sizeof shell);
    for (int k = count - 1; k >= 0; k--) {
        if (P[k] > P[top]) top = k;
        inner = k;
        if (P[top] > 3.0 * P_air && P[k] < 0.95 * P[top]) break;
    }
    shell.P_peak = P[top];
    shell.borrowed = P_known > 0.0 && P[top] > 2.0 * P_known;
    if (shell.borrowed) {
        for (inner = count - 1; P[inner] < P_known;) inner--;
        shell.P_peak = P_known;
        top = inner;
    }
    shell.inner = inner * width;
    for (int k = 0; k < count; k++) {
        if (rho[k] > shell.rho_max) shell.rho_max = rho[k];
        if (k >= inner && rho[k] > shell.rho_peak) shell.rho_peak = rho[k];
    }
    if (!(shell.P_peak > 3.0 * P_air)) return shell;
    while (half > top && P[half] < 0.5 * shell.P_peak) half--;
    double over = P[half] - 0.5 * shell.P_peak;
    double share = half + 1 < count ? over / (P[half] - P[half + 1]) : 0.0;
    shell.radius = (half + 0.5 + fmin(share, 1.0)) * width;
    return shell;
}

/* ---- the reference --------------------------------------------------------------------------- */

enum { BLAST_REFERENCE_FIRST = 250, BLAST_REFERENCE_MOST = 64000 }; /* cells */

/* The solution in one dimension, cylindrical symmetry, at one output time: on a mesh of its own, that
   reaches to where nothing arrives by then; and how far it has converged. */
typedef struct blast_reference_at {
    int cells, solutions;
    double dr;         /* [m] */
    double change;     /* [m] of the shock's radius, from half as many cells */
    double error;      /* [m] estimated, by Richardson's extrapolation */
    blast_shell shell;
    double *rho, *P;   /* (cells) */
} blast_reference_at;

typedef struct blast_reference {
    blast_reference_at at[BLAST_TIMES];
} blast_reference;

static void blast_reference_free(blast_reference *reference) {
    for (int k = 0; k < BLAST_TIMES; k++) free(reference->at[k].rho);
    memset(reference, 0, sizeof *reference);
}

static sphpa_result blast_reference_step(sphpa_grid *grid, void *user, sphpa_error *err) {
    const volatile int *const *stop = (const volatile int *const *)user;
    if (!**stop) return SPHPA_OK;
    return sphpa_error_set(err, SPHPA_STOPPED, "stopped at t = %.9e s", grid->time);
}

static void blast_reference_keep(blast_reference_at *at, const blast_settings *s,
                                 const sphpa_grid *grid) {
    sphpa_grid_state state;
    memset(&state, 0, sizeof state);
    at->cells = (int)grid->nx;
    at->dr = grid->dx[0];
    at->rho = (double *)calloc(2 * grid->nx, sizeof(double));
    if (at->rho == NULL) example_fail(1, "out of memory");
    at->P = at->rho + grid->nx;
    for (size_t i = 0; i < grid->nx; i++) {
        (void)sphpa_grid_primitive(grid, i, 0, &state);
        at->rho[i] = state.rho;
        at->P[i] = state.P;
    }
    at->shell = blast_shell_of(at->rho, at->P, at->cells, at->dr, s->P_air, 0.0);
}

static sphpa_result blast_reference_solve(const blast_settings *s, const volatile int *stop,
                                          double time, int cells, blast_reference_at *at,
                                          sphpa_error *err) {
    sphpa_grid grid;
    sphpa_grid_options options;
    sphpa_grid_schedule schedule;
    double sound = sqrt(s->gamma * s->P_air / s->rho_air);
    memset(&options, 0, sizeof options);
    memset(&schedule, 0, sizeof schedule);
    options.high[0] = 2.0 * s->radius + 1.2 * blast_sedov_radius(s, time) + 1.5 * sound * time;
    options.high[1] = 1.0;
    options.nx = (size_t)cells;
    options.ny = 1;
    options.radial = 1;
    options.gamma = s->gamma;
    schedule.t_end = time;
    schedule.resumed = 1;
    schedule.user = &stop;
    schedule.step = blast_reference_step;
    sphpa_result result = sphpa_grid_create(&grid, &options, err);
    if (result != SPHPA_OK) return result;
    blast_filler filler = {s, grid.dx[0], 1};
    result = sphpa_grid_fill(&grid, blast_fill, &filler, 1, err);
    if (result == SPHPA_OK) result = sphpa_grid_run(&grid, &schedule, err);
    if (result == SPHPA_OK) blast_reference_keep(at, s, &grid);
    sphpa_grid_free(&grid);
    return result;
}

/* The change of the radius; and from the one before, what is left of the error: with order p it
   falls by 2^p each time (p within 1/2 and 2: radii of so sharp shocks do not fall evenly). */
static void blast_reference_compare(blast_reference_at *fine, const blast_reference_at *coarse) {
    double change = fabs(fine->shell.radius - coarse->shell.radius);
    double ratio = change > 0.0 && coarse->solutions > 1 ? coarse->change / change : 2.0;
    fine->change = change;
    fine->error = change / (fmin(fmax(ratio, sqrt(2.0)), 4.0) - 1.0);
}

/* three solutions at least, cells much finer than what is compared, the last change small */
static bool blast_reference_settled(const blast_reference_at *at, const blast_settings *s) {
    return at->solutions >= 3 && at->dr <= 0.125 * s->dx &&
           at->change <= s->tolerance * at->shell.radius;
}

/* Doubles the cells until the radius changes by no more than the tolerance. */
static sphpa_result blast_reference_refine(const blast_settings *s, const volatile int *stop,
                                           double time, blast_reference_at *at, sphpa_error *err) {
    blast_reference_at finer;
    for (int cells = BLAST_REFERENCE_FIRST; cells <= BLAST_REFERENCE_MOST; cells *= 2) {
        memset(&finer, 0, sizeof finer);
        sphpa_result result = blast_reference_solve(s, stop, time, cells, &finer, err);
        if (result != SPHPA_OK) return result;
        finer.solutions = at->solutions + 1;
        if (finer.solutions > 1) blast_reference_compare(&finer, at);
        free(at->rho);
        *at = finer;
        if (blast_reference_settled(at, s)) break;
    }
    return SPHPA_OK;
}

/* [kg/m3] its mean over the ring from a to b */
static double blast_reference_mean(const blast_reference_at *at, double rho_air, double a, double b) {
    double sum = 0.0, dr = at->dr, end = dr * at->cells;
    for (int i = (int)(a / dr); i < at->cells && i * dr < b; i++) {
        double low = fmax(a, i * dr), high = fmin(b, (i + 1) * dr);
        if (high > low) sum += at->rho[i] * (high * high - low * low);
    }
    if (b > end) sum += rho_air * (b * b - fmax(a, end) * fmax(a, end));
    return sum / (b * b - a * a);
}

/* [kg/m3] the peak of its outer shell as methods have theirs: the largest of means over rings dx wide, of
   those that the shell lies in */
static double blast_reference_peak(const blast_reference_at *at, const blast_settings *s) {
    double peak = 0.0, dx = s->dx;
    for (double k = floor(at->shell.inner / dx); k * dx < at->shell.radius; k += 1.0)
        peak = fmax(peak, blast_reference_mean(at, s->rho_air, k * dx, (k + 1.0) * dx));
    return peak;
}

/* [1] see --help */
static double blast_L1(const blast_profile *profile, double rho_air, const blast_reference_at *at) {
    double out = 1.2 * at->shell.radius, sum = 0.0, w = profile->width;
    for (int i = 0; i * w < out; i++) {
        double a = i * w, b = fmin(a + w, out);
        double rho = i < profile->count ? profile->rho[i] : rho_air;
        sum += fabs(rho - blast_reference_mean(at, rho_air, a, b)) * (b * b - a * a);
    }
    return out > 0.0 ? sum / (out * out * rho_air) : 0.0;
}

#endif
