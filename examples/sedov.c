/* sedov: a point explosion in a cold gas, against Sedov's similarity solution.

   Its shock is at R = (E t^2 / (alpha rho))^(1/(d + 2)); alpha follows from the energy integral
   over the solution, which is known in closed form with a parameter V between the centre and the
   shock (Sedov 1959; Kamm & Timmes 2007, LA-UR-07-2849, the standard case with omega = 0). */
#include "example.h"

#define SPHPA_GAS_IMPLEMENTATION
#define SPHPA_SETUP_IMPLEMENTATION
#include "sphpa.h"

#define POINTS 20000 /* of the exact solution */
#define ENERGY 1.0  /* [J], in 2-D [J/m]; density 1, box [-1, 1]^dim */

/* The solution in units of the shock's radius and of the state behind it. */
typedef struct sedov_solution {
    double alpha;
    double lambda[POINTS + 1], f[POINTS + 1], g[POINTS + 1], h[POINTS + 1]; /* r, v, rho, P */
} sedov_solution;

static void sedov_solve(int dim, double gamma, sedov_solution *s) {
    double j = dim, n = j + 2.0, gm = gamma - 1.0, gp = gamma + 1.0;
    double a0 = 2.0 / n, a2 = -gm / (2.0 * gm + j);
    double a1 = n * gamma / (2.0 + j * gm) * (2.0 * j * (2.0 - gamma) / (gamma * n * n) - a2);
    double a3 = j / (2.0 * gm + j), a4 = n * j / (j * (2.0 - gamma)) * a1;
    double a5 = -2.0 / (2.0 - gamma);
    double v0 = 2.0 / (n * gamma), v2 = 4.0 / (n * gp); /* V at the centre and at the shock */
    double d = n * gp / (n * gp - 2.0 * (2.0 + j * gm));
    for (int k = 0; k <= POINTS; k++) { /* V so that lambda is about evenly spread */
        double w = pow((k + 1e-9) / (POINTS + 1e-9), -1.0 / a2), V = v0 + (v2 - v0) * w;
        double x1 = 0.25 * n * gp * V, x2 = gp / gm * (0.5 * n * gamma * (v2 - v0) * w);
        double x3 = d * (1.0 - 0.5 * (2.0 + j * gm) * V), x4 = gp / gm * (1.0 - 0.5 * n * V);
        s->lambda[k] = pow(x1, -a0) * pow(x2, -a2) * pow(x3, -a1);
        s->f[k] = x1 * s->lambda[k];
        s->g[k] = pow(x2, a3) * pow(x3, a4) * pow(x4, a5);
        s->h[k] = pow(x1, a0 * j) * pow(x3, a4 - 2.0 * a1) * pow(x4, 1.0 + a5);
    }
    double sum = 0.0, before = 0.0, pi = acos(-1.0); /* energy in units of rho R^d (dR/dt)^2 */
    for (int k = 0; k <= POINTS; k++) {
        double e = (2.0 * s->g[k] * s->f[k] * s->f[k] + 2.0 * s->h[k]) / (gm * gp);
        e *= (dim == 2 ? 2.0 * pi : 4.0 * pi) * pow(s->lambda[k], j - 1.0);
        if (k > 0) sum += 0.5 * (e + before) * (s->lambda[k] - s->lambda[k - 1]);
        before = e;
    }
    s->alpha = sum * 4.0 / (n * n); /* dR/dt = 2 R/(n t) */
}

static double sedov_radius(const sedov_solution *s, int dim, double t) {
    return pow(ENERGY * t * t / s->alpha, 1.0 / (dim + 2.0));
}

typedef struct sedov_run {
    const sphpa_run *run;
    example_progress progress;
    uint64_t updates;
} sedov_run;

static sphpa_result step_done(sphpa_sim *sim, void *user, sphpa_error *err) {
    sedov_run *sedov = (sedov_run *)user;
    (void)err;
    sedov->updates += sim->p.n;
    example_progress_show(&sedov->progress, sim->time / sedov->run->t_end, sim->time, sim->dt,
                          sim->stats.steps, sedov->updates);
    return SPHPA_OK;
}

/* a lattice without a seam, and the energy in the shape of a kernel of 2 smoothing lengths */
static sphpa_result fill(sphpa_particles *p, int dim, long count, double eta, sphpa_error *err) {
    const double low[3] = {-1.0, -1.0, -1.0}, high[3] = {1.0, 1.0, 1.0};
    sphpa_body body = {0};
    body.rho = 1.0;
    body.u = 1e-6;
    body.count = (size_t)count;
    body.eta = eta;
    body.lattice = SPHPA_LATTICE_HEXAGONAL;
    sphpa_result result = sphpa_make_begin(p, dim, err);
    if (result == SPHPA_OK) result = sphpa_make_box(p, low, high, &body, err);
    double sum = 0.0;
    for (int pass = 0; pass < 2 && result == SPHPA_OK; pass++)
        for (size_t i = 0; i < p->n; i++) {
            const double *x = p->x + 3 * i;
            double r = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
            double w = sphpa_kernel_w(SPHPA_KERNEL_CUBIC, dim, r, 2.0 * (double)p->h[i]);
            if (pass == 0) sum += (double)p->m[i] * w;
            else p->u[i] += ENERGY * w / sum; /* ENERGY in all, exactly */
        }
    return result;
}

static double radius_of(const sphpa_particles *p, size_t i) {
    const double *x = p->x + 3 * i;
    return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
}

/* Where the shells' mean density falls, outside its peak, to half way between peak and 1. */
static double shock_radius(const sphpa_particles *p, double width, double *peak) {
    enum { SHELLS = 2000 };
    static double sum[SHELLS], count[SHELLS];
    int top = 0, last = (int)(1.0 / width) - 1;
    memset(sum, 0, sizeof sum);
    memset(count, 0, sizeof count);
    if (last > SHELLS - 1) last = SHELLS - 1;
    for (size_t i = 0; i < p->n; i++) {
        int k = (int)(radius_of(p, i) / width);
        if (k <= last) sum[k] += p->rho[i], count[k] += 1.0;
    }
    for (int k = 0; k <= last; k++) {
        sum[k] /= fmax(count[k], 1.0);
        if (sum[k] > sum[top]) top = k;
    }
    *peak = sum[top];
    double half = 0.5 * (*peak + 1.0);
    int k = top;
    while (k < last && !(count[k] > 0.0 && sum[k] < half)) k++;
    double slope = k > top ? (sum[k - 1] - half) / (sum[k - 1] - sum[k]) : 0.5;
    return width * (k - 0.5 + slope);
}

static void show(const sphpa_sim *sim, const sedov_solution *exact, double R, double gamma,
                 const char *out) {
    example_file file = example_open(out, "sph.dat");
    fprintf(file.stream, "# r rho P\n");
    size_t every = sim->p.n / 20000 + 1; /* a picture of millions of points helps nobody */
    for (size_t i = 0; i < sim->p.n; i += every)
        fprintf(file.stream, "%.7g %.7g %.7g\n", radius_of(&sim->p, i), sim->p.rho[i],
                (double)sim->p.P[i]);
    example_close(&file);
    file = example_open(out, "exact.dat");
    fprintf(file.stream, "# r rho\n");
    double dense = (gamma + 1.0) / (gamma - 1.0);
    for (int k = 0; k <= POINTS; k += 50)
        fprintf(file.stream, "%.7g %.7g\n", R * exact->lambda[k], dense * exact->g[k]);
    fprintf(file.stream, "%.7g 1\n1 1\n", R);
    example_close(&file);
    char script[1024];
    snprintf(
        script, sizeof script,
        "set title 'a point explosion in %d-D, gamma %.4g, %zu particles, t = %.4g'\n"
        "set xlabel 'distance r from the explosion'\nset ylabel 'density'\nset xrange [0:1]\n"
        "set yrange [0:*]\nset grid lc rgb '#dddddd'\nset key top left\n"
        "plot 'sph.dat' using 1:2 with points pt 7 ps 0.25 lc rgb '#1f5fa8' title 'SPH', \\\n"
        "     'exact.dat' using 1:2 with lines lw 2 lc rgb '#c0392b' title 'Sedov, exact'",
        sim->p.dim, gamma, sim->p.n, sim->time);
    (void)example_picture(out, "sedov.png", 900, 560, script);
}

int main(int argc, char **argv) {
    long particles = 10000, dim = 2, threads = 0;
    double gamma = 5.0 / 3.0, t_end = 0.0, cfl = 0.3, eta = 1.2;
    int integrator = 0, quiet = 0;
    const char *out = "build/sedov";
    const example_option options[] = {
        example_count("dim", &dim, 2, 3, "dimension of space"),
        example_count("particles", &particles, 500, 100000000, "in the box"),
        example_number("gamma", "G", &gamma, 1.05, 1.95, "ratio of specific heats"),
        example_number("t-end", "T", &t_end, 0.0, 10.0, "0: until the shock is at 0.75"),
        example_number("cfl", "C", &cfl, 1e-6, 1.0, "share of the Courant limit"),
        example_number("eta", "E", &eta, 0.8, 3.0, "smoothing length in units of the spacing"),
        example_choice("integrator", "pc|rk2", &integrator, "one or two evaluations a step"),
        example_count("threads", &threads, 0, 1024, "0: as many as there are"),
        example_text("out", "FOLDER", &out, "for the profiles and the picture"),
        example_flag("quiet", &quiet, "no progress line"),
    };
    example_parse(argc, argv, "a point explosion against Sedov's exact solution", SPHPA_VERSION,
                  options, (int)(sizeof options / sizeof options[0]));
    static sedov_solution exact;
    sedov_solve((int)dim, gamma, &exact);
    double at_the_wall = sqrt(exact.alpha / ENERGY); /* when the shock is at 1 */
    if (t_end <= 0.0) t_end = sqrt(exact.alpha / ENERGY * pow(0.75, (double)dim + 2.0));
    if (t_end > at_the_wall)
        example_fail(2, "--t-end %g: the shock is at the side of the box at t = %.4g and meets its "
                        "periodic image; stop before", t_end, at_the_wall);
    example_folder(out);
    (void)example_threads(threads);
    sphpa_ideal gas = {gamma};
    sphpa_eos eos = sphpa_ideal_eos(&gas);
    sphpa_gas_params params = {0};
    params.eos = &eos;
    params.materials = 1;
    params.eta = eta;
    params.viscosity.balsara = 1;
    sphpa_sim_options sim_options = {0};
    sim_options.cfl = cfl;
    sim_options.kernel = SPHPA_KERNEL_QUINTIC; /* the cubic clumps behind so strong a shock */
    sim_options.integrator = (sphpa_integrator)integrator;
    for (int a = 0; a < (int)dim; a++) {
        sim_options.box.low[a] = -1.0;
        sim_options.box.high[a] = 1.0;
        sim_options.box.periodic[a] = 1;
    }
    sphpa_error err;
    sphpa_particles p = {0};
    sphpa_scene scene = {0};
    static sphpa_sim sim;
    sphpa_result result = fill(&p, (int)dim, particles, eta, &err);
    params.h_max = result == SPHPA_OK ? 6.0 * (double)p.h[0] : 0.0; /* the centre gets very thin */
    if (result == SPHPA_OK) result = sphpa_scene_add(&scene, sphpa_gas(&params));
    if (result == SPHPA_OK) result = sphpa_sim_create(&sim, &scene, &p, &sim_options, &err);
    if (result != SPHPA_OK) example_fail(1, "%s", err.message);

    sphpa_run run = {0};
    sedov_run sedov = {0};
    sedov.run = &run;
    sedov.progress.quiet = quiet;
    run.t_end = t_end;
    run.user = &sedov;
    run.step = step_done;
    sphpa_totals before = sphpa_sim_totals(&sim);
    result = sphpa_sim_run(&sim, &run, &err);
    if (result == SPHPA_OK) result = sphpa_sim_refresh(&sim, &err);
    example_progress_end(&sedov.progress);
    if (result != SPHPA_OK) example_fail(1, "%s", err.message);

    double R = sedov_radius(&exact, (int)dim, t_end), peak;
    double spacing = pow(pow(2.0, (double)dim) / (double)sim.p.n, 1.0 / (double)dim);
    double radius = shock_radius(&sim.p, 0.5 * spacing, &peak);
    sphpa_totals after = sphpa_sim_totals(&sim);
    printf("# %zu particles in %ld-D, gamma %.6g, t = %.6g, spacing %.4g\n", sim.p.n, dim, gamma,
           t_end, spacing);
    printf("alpha, xi0 = alpha^(-1/(dim + 2))   %.7f  %.7f\n", exact.alpha,
           pow(exact.alpha, -1.0 / ((double)dim + 2.0)));
    printf("shock radius, exact, difference     %.5f  %.5f  %+.2f %% (%+.2f spacings)\n", radius, R,
           100.0 * (radius / R - 1.0), (radius - R) / spacing);
    printf("densest shell's mean, exact peak    %.3f  %.3f\n", peak, (gamma + 1.0) / (gamma - 1.0));
    printf("drift of energy, of momentum        %.2e  %.2e\n", after.energy / before.energy - 1.0,
           sqrt(pow(after.momentum[0], 2.0) + pow(after.momentum[1], 2.0)));
    static char report[8192];
    (void)sphpa_sim_report(&sim, report, sizeof report);
    fputs(report, stdout);
    show(&sim, &exact, R, gamma, out);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return 0;
}
