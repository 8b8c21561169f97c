/* own_pass: physics of your own, without touching the header.

   Heat that spreads in a medium at rest, du/dt = D d2u/dx2, is one PAIR pass:
       du_i = sum_j 2 D m_j/rho_ij (u_i - u_j) W'(r)/r         (Brookshaw 1985; Cleary 1998)
   with rho_ij and W' the pair's means, so that what i loses j gains. A REDUCE pass tells how long a
   step it allows, and a PARTICLE pass at the accepted end of each step keeps a column of our own:
   the hottest that each particle ever was. No gas, no forces: the scene is these three passes.

   The exact answer: u = 1 + A exp(-D q^2 t) cos(q x). */
#include "example.h"

#define SPHPA_SPH_IMPLEMENTATION
#define SPHPA_SETUP_IMPLEMENTATION
#include "sphpa.h"

#define AMPLITUDE 0.5
#define Q (2.0 * 3.14159265358979323846) /* one wave in the box [0, 1] */

typedef struct heat {
    double D; /* [m2/s] */
} heat;

/* one particle and its neighbours: we may write only i, and read what the pass says it reads */
static void spread(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    const heat *own = (const heat *)params;
    const sphpa_particles *p = &sim->p;
    size_t i = near->i;
    double hi = (double)p->h[i], du = 0.0;
    for (size_t k = 0; k < near->count; k++) {
        size_t j = near->j[k];
        double rho = 0.5 * (p->rho[i] + p->rho[j]), r = near->r[k];
        double slope = 0.5 * (sphpa_kernel_dw(sim->options.kernel, p->dim, r, hi) +
                              sphpa_kernel_dw(sim->options.kernel, p->dim, r, near->h[k]));
        du += 2.0 * own->D * (double)p->m[j] / rho * (p->u[i] - p->u[j]) * slope / r;
    }
    sim->p.du[i] += (sphpa_real)du; /* added: other passes of this stage may have their share */
}

/* heat that has spread by a fraction of h: with 0.2 the integrator would begin to overshoot */
static double longest_step(const sphpa_sim *sim, const void *params, size_t i) {
    double h = (double)sim->p.h[i];
    return 0.1 * h * h / ((const heat *)params)->D;
}

static sphpa_result keep_peak(sphpa_sim *sim, void *params, size_t first, size_t last,
                              size_t *bad) {
    double *peak = sphpa_particles_column(&sim->p, "PeakEnergies");
    (void)params, (void)bad;
    for (size_t i = first; i < last; i++)
        if (sim->p.u[i] > peak[i]) peak[i] = sim->p.u[i];
    return SPHPA_OK;
}

/* what sphpa_gas() and its like return, made by hand */
static sphpa_module heat_module(heat *params) {
    sphpa_module module = {0};
    module.name = "heat";
    module.params = params;
    module.passes = 3;
    module.pass[0].name = "heat spreads";
    module.pass[0].stage = SPHPA_STAGE_ENERGY;
    module.pass[0].kind = SPHPA_PASS_PAIR;
    module.pass[0].reads = SPHPA_F(x) | SPHPA_F(m) | SPHPA_F(h) | SPHPA_F(rho) | SPHPA_F(u);
    module.pass[0].writes = SPHPA_F(du);
    module.pass[0].pair = spread;
    module.pass[1].name = "heat step";
    module.pass[1].stage = SPHPA_STAGE_LIMIT;
    module.pass[1].kind = SPHPA_PASS_REDUCE;
    module.pass[1].reads = SPHPA_F(h);
    module.pass[1].limit = longest_step;
    module.pass[2].name = "heat peak";
    module.pass[2].stage = SPHPA_STAGE_COMMIT;
    module.pass[2].reads = SPHPA_F(u);
    module.pass[2].particle = keep_peak;
    module.columns = 1; /* ours: allocated, sorted, written and restarted like any field */
    strcpy(module.column[0].name, "PeakEnergies");
    module.column[0].length = 2; /* [m2/s2] */
    module.column[0].time = -2;
    return module;
}

static double exact(double x, double D, double t) {
    return 1.0 + AMPLITUDE * exp(-D * Q * Q * t) * cos(Q * x);
}

/* largest error of u, and of the column: where it was hot u falls, and the peak is the start */
static void compare(const sphpa_sim *sim, double D, double error[2]) {
    const double *peak = sphpa_particles_column(&sim->p, "PeakEnergies");
    error[0] = error[1] = 0.0;
    for (size_t i = 0; i < sim->p.n; i++) {
        double x = sim->p.x[3 * i], now = exact(x, D, sim->time), start = exact(x, D, 0.0);
        error[0] = fmax(error[0], fabs(sim->p.u[i] - now));
        error[1] = fmax(error[1], fabs(peak[i] - fmax(now, start)));
    }
}

static void show(const sphpa_sim *sim, double D, const char *out) {
    example_file file = example_open(out, "heat.dat");
    fprintf(file.stream, "# x u peak exact start\n");
    const double *peak = sphpa_particles_column(&sim->p, "PeakEnergies");
    for (size_t i = 0; i < sim->p.n; i++) {
        double x = sim->p.x[3 * i];
        fprintf(file.stream, "%.9g %.9g %.9g %.9g %.9g\n", x, sim->p.u[i], peak[i],
                exact(x, D, sim->time), exact(x, D, 0.0));
    }
    example_close(&file);
    char script[2048];
    snprintf(
        script, sizeof script,
        "set title 'heat spreads, %zu particles, D = %g m^2/s, t = %g s: a pass and a column of "
        "one''s own'\n"
        "set xlabel 'x [m]'\nset ylabel 'specific internal energy u [J/kg]'\nset xrange [0:1]\n"
        "set grid lc rgb '#dddddd'\nset key top center Left reverse\nset yrange [0.4:1.6]\n"
        "plot 'heat.dat' using 1:5 with lines lc rgb '#bbbbbb' lw 2 title 'start', \\\n"
        "     '' using 1:4 with lines lc rgb '#888888' lw 2 title 'exact at the end', \\\n"
        "     '' using 1:3 with points pt 6 ps 0.6 lc rgb '#c0392b' title 'hottest ever', \\\n"
        "     '' using 1:2 with points pt 7 ps 0.4 lc rgb '#1f5fa8' title 'SPH at the end'",
        sim->p.n, D, sim->time);
    (void)example_picture(out, "heat.png", 800, 480, script);
}

int main(int argc, char **argv) {
    long particles = 100;
    double t_end = 0.02;
    heat params = {1.0};
    const char *out = "build/own_pass";
    const example_option options[] = {
        example_count("particles", &particles, 20, 100000, "in [0, 1]"),
        example_number("diffusivity", "D", &params.D, 1e-6, 1e6, "m2/s"),
        example_number("t-end", "T", &t_end, 0.0, 1e6, "seconds"),
        example_text("out", "FOLDER", &out, "for heat.dat and heat.png"),
    };
    example_parse(argc, argv, "heat spreads: a pass and a column of one's own", SPHPA_VERSION,
                  options, (int)(sizeof options / sizeof options[0]));
    example_folder(out);
    (void)example_threads(1);

    sphpa_error err;
    sphpa_particles p = {0};
    sphpa_body body = {0};
    body.rho = 1000.0;
    body.u = 1.0;
    body.count = (size_t)particles;
    body.eta = 2.0;
    const double low[3] = {0.0, 0.0, 0.0}, high[3] = {1.0, 0.0, 0.0};
    sphpa_sim_options sim_options = {0};
    sim_options.box.high[0] = 1.0;
    sim_options.box.periodic[0] = 1;
    sim_options.kernel = SPHPA_KERNEL_WENDLAND_C4;

    sphpa_scene scene = {0};
    static sphpa_sim sim;
    sphpa_result result = sphpa_make_begin(&p, 1, &err);
    if (result == SPHPA_OK) result = sphpa_make_box(&p, low, high, &body, &err);
    for (size_t i = 0; i < p.n && result == SPHPA_OK; i++) p.u[i] = exact(p.x[3 * i], 1.0, 0.0);
    (void)sphpa_scene_add(&scene, heat_module(&params)); /* what is wrong with it, create tells */
    if (result == SPHPA_OK) result = sphpa_sim_create(&sim, &scene, &p, &sim_options, &err);
    if (result != SPHPA_OK) example_fail(1, "%s", err.message);
    double *peak = sphpa_particles_column(&sim.p, "PeakEnergies");
    for (size_t i = 0; i < sim.p.n; i++) peak[i] = sim.p.u[i];

    sphpa_run run = {0};
    run.t_end = t_end;
    sphpa_totals before = sphpa_sim_totals(&sim);
    if (sphpa_sim_run(&sim, &run, &err) != SPHPA_OK) example_fail(1, "%s", err.message);

    double error[2];
    compare(&sim, params.D, error);
    printf("# t = %g s, %llu steps, %zu particles\n", sim.time, (unsigned long long)sim.stats.steps,
           sim.p.n);
    printf("amplitude left, exact     %.6f\n", AMPLITUDE * exp(-params.D * Q * Q * sim.time));
    printf("largest error of u        %.6f\n", error[0]);
    printf("largest error of the peak %.6f\n", error[1]);
    printf("drift of the energy       %.2e\n", sphpa_sim_totals(&sim).energy / before.energy - 1.0);
    show(&sim, params.D, out);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return 0;
}
