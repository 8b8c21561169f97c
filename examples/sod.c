/* sod: Sod's shock tube with SPH, against the exact solution of its Riemann problem.

   A periodic tube, twice as long as Sod's and mirrored, so that it has no walls: the dense gas is
   in the middle, and what happens in [0, 1] is his problem. */
#include "example.h"

#define SPHPA_GAS_IMPLEMENTATION
#define SPHPA_RIEMANN_IMPLEMENTATION
#define SPHPA_SETUP_IMPLEMENTATION
#include "sphpa.h"

typedef struct sod_run {
    const sphpa_run *run;
    double gamma;
    example_progress progress;
    uint64_t updates;
} sod_run;

static sphpa_result step_done(sphpa_sim *sim, void *user, sphpa_error *err) {
    sod_run *sod = (sod_run *)user;
    (void)err;
    sod->updates += sim->p.n;
    example_progress_show(&sod->progress, sim->time / sod->run->t_end, sim->time, sim->dt,
                          sim->stats.steps, sod->updates);
    return SPHPA_OK;
}

/* 1: thin gas on both sides of the dense one; all particles have one mass */
static sphpa_result fill(sphpa_particles *p, long count, double gamma, sphpa_error *err) {
    const double edge[4] = {-1.0, -0.5, 0.5, 1.0}, rho[3] = {0.125, 1.0, 0.125};
    const double P[3] = {0.1, 1.0, 0.1};
    sphpa_result result = sphpa_make_begin(p, 1, err);
    for (int k = 0; k < 3 && result == SPHPA_OK; k++) {
        sphpa_body body;
        memset(&body, 0, sizeof body);
        body.rho = rho[k];
        body.u = P[k] / ((gamma - 1.0) * rho[k]);
        body.spacing = 0.5625 / ((double)count * rho[k]); /* 0.5625: the mass in [0, 1] */
        double low[3] = {edge[k], 0.0, 0.0}, high[3] = {edge[k + 1], 0.0, 0.0};
        result = sphpa_make_box(p, low, high, &body, err);
    }
    return result;
}

/* writes the profile and prints the mean errors over [0, 1] */
static void compare(const sphpa_sim *sim, double gamma, const char *out) {
    const sphpa_riemann_state left = {1.0, 0.0, 1.0}, right = {0.125, 0.0, 0.1};
    sphpa_riemann_star star;
    if (sphpa_riemann_exact(gamma, &left, &right, &star) != SPHPA_OK)
        example_fail(1, "no exact solution for --gamma %g", gamma);
    example_file file = example_open(out, "sod.dat");
    fprintf(file.stream, "# x rho v P u   exact: rho v P\n");
    double error[3] = {0.0, 0.0, 0.0};
    int count = 0;
    for (size_t i = 0; i < sim->p.n; i++) {
        double x = sim->p.x[3 * i], v = (double)sim->p.v[3 * i], P = (double)sim->p.P[i];
        sphpa_riemann_state exact = x < 0.5 ? left : right;
        if (x < 0.0 || x > 1.0) continue;
        if (sim->time > 0.0)
            (void)sphpa_riemann_sample(gamma, &left, &right, &star, (x - 0.5) / sim->time, &exact);
        error[0] += fabs(sim->p.rho[i] - exact.rho);
        error[1] += fabs(v - exact.v);
        error[2] += fabs(P - exact.P);
        count++;
        fprintf(file.stream, "%.9g %.9g %.9g %.9g %.9g  %.9g %.9g %.9g\n", x, sim->p.rho[i], v, P,
                sim->p.u[i], exact.rho, exact.v, exact.P);
    }
    example_close(&file);
    printf("# mean |error| over the %d particles of [0, 1] at t = %g\n", count, sim->time);
    printf("rho %.6f\nv   %.6f\nP   %.6f\n", error[0] / count, error[1] / count, error[2] / count);
}

static const char *picture =
    "set multiplot layout 1,3 title \"Sod's shock tube, \".case.\": SPH (points) and the exact solution\"\n"
    "set xrange [0:1]\nset xlabel 'x'\nset xtics 0.25\nunset key\nset grid lc rgb '#dddddd'\n"
    "set offsets 0, 0, graph 0.05, graph 0.05\n"
    "do for [k=1:3] {\n"
    "stats 'sod.dat' using (column(k+1)) nooutput\n"
    "if (STATS_max > STATS_min) { set yrange [*:*] }\n"
    "else { set yrange [STATS_min - 0.5:STATS_max + 0.5] }\n"
    "set ylabel word('density velocity pressure', k)\n"
    "plot 'sod.dat' using 1:(column(k+5)) smooth unique with lines lw 2 lc rgb '#888888', \\\n"
    "     'sod.dat' using 1:(column(k+1)) with points pt 7 ps 0.35 lc rgb '#1f5fa8'\n}\n"
    "unset multiplot";

int main(int argc, char **argv) {
    long particles = 360, threads = 1;
    double t_end = 0.15, cfl = 0.3, gamma = 1.4, conduction = 0.0, viscosity[2] = {1.0, 2.0};
    double eta = 1.2;
    int kernel = 0, integrator = 0, balsara = 0, quiet = 0;
    const char *out = "build/sod";
    const example_option options[] = {
        example_count("particles", &particles, 18, 10000000, "in [0, 1]: 8/9 left, 1/9 right"),
        example_number("t-end", "T", &t_end, 0.0, 0.2, "when to stop and compare"),
        example_number("gamma", "G", &gamma, 1.01, 5.0, "ratio of specific heats"),
        example_choice("kernel",
                       "cubic|quartic|quintic|wendland-c2|wendland-c4|wendland-c6|gaussian",
                       &kernel, "smoothing kernel"),
        example_number("eta", "E", &eta, 0.8, 4.0, "smoothing length in units of the spacing"),
        example_choice("integrator", "pc|rk2", &integrator, "one or two evaluations a step"),
        example_number("cfl", "C", &cfl, 1e-6, 1.0, "share of the Courant limit"),
        example_vector("viscosity", "a,b", viscosity, 2, 0.0, 1000.0,
                       "linear and quadratic coefficient"),
        example_switch("balsara", &balsara, "switch viscosity off in shear (here there is none)"),
        example_number("conduction", "K", &conduction, 0.0, 10.0, "smooths the contact; 0: off"),
        example_count("threads", &threads, 0, 1024, "0: all; one is enough for so few particles"),
        example_text("out", "FOLDER", &out, "for sod.dat and sod.png"),
        example_flag("quiet", &quiet, "no progress line"),
    };
    example_parse(argc, argv, "Sod's shock tube against its exact solution", SPHPA_VERSION, options,
                  (int)(sizeof options / sizeof options[0]));
    example_folder(out);
    (void)example_threads(threads);

    sphpa_ideal gas = {gamma};
    sphpa_eos eos = sphpa_ideal_eos(&gas);
    sphpa_gas_params params = {0};
    params.eos = &eos;
    params.materials = 1;
    params.eta = eta;
    params.conduction = conduction;
    params.viscosity.a = viscosity[0] > 0.0 ? viscosity[0] : -1.0; /* 0 would be the default */
    params.viscosity.b = viscosity[1] > 0.0 ? viscosity[1] : -1.0;
    params.viscosity.balsara = balsara;
    sphpa_sim_options sim_options = {0};
    sim_options.cfl = cfl;
    sim_options.kernel = (sphpa_kernel)kernel;
    sim_options.integrator = (sphpa_integrator)integrator;
    sim_options.box.low[0] = -1.0;
    sim_options.box.high[0] = 1.0;
    sim_options.box.periodic[0] = 1;

    sphpa_error err;
    sphpa_particles p = {0};
    sphpa_scene scene = {0};
    static sphpa_sim sim;
    sphpa_result result = fill(&p, particles, gamma, &err);
    if (result == SPHPA_OK) result = sphpa_scene_add(&scene, sphpa_gas(&params));
    if (result == SPHPA_OK) result = sphpa_sim_create(&sim, &scene, &p, &sim_options, &err);
    if (result != SPHPA_OK) example_fail(1, "%s", err.message);

    sphpa_run run = {0};
    sod_run sod = {0};
    sod.run = &run;
    sod.progress.quiet = quiet;
    run.t_end = t_end;
    run.user = &sod;
    run.step = step_done;
    sphpa_totals before = sphpa_sim_totals(&sim);
    result = sphpa_sim_run(&sim, &run, &err);
    if (result == SPHPA_OK) result = sphpa_sim_refresh(&sim, &err); /* rho and P at t_end */
    example_progress_end(&sod.progress);
    if (result != SPHPA_OK) example_fail(1, "%s", err.message);

    compare(&sim, gamma, out);
    sphpa_totals after = sphpa_sim_totals(&sim);
    printf("# drift of energy, relative, and of momentum\nenergy   %.3e\nmomentum %.3e\n",
           after.energy / before.energy - 1.0, after.momentum[0] - before.momentum[0]);
    static char report[8192];
    (void)sphpa_sim_report(&sim, report, sizeof report);
    fputs(report, stdout);
    char script[2048];
    snprintf(script, sizeof script, "case = '%ld particles, gamma %g, t = %g'\n%s", particles, gamma,
             t_end, picture);
    (void)example_picture(out, "sod.png", 1200, 420, script);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return 0;
}
