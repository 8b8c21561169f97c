/* rotating_body.c: an elastic disc or sphere turns freely. Nothing should happen to it; without the
   correction of the kernel's gradient its rotation is taken for a strain, and it stops.

       build/examples/rotating_body --turns 1

   Prints angular momentum and largest stress against time, with the correction on and off side by
   side, and draws both. */
#include "example.h"

#define SPHPA_SOLID_IMPLEMENTATION
#define SPHPA_SETUP_IMPLEMENTATION
#include "sphpa.h"

typedef struct choices {
    long dim, particles, outputs, threads;
    double turns, omega, viscosity;
    int correction, integrator, kernel, lattice; /* correction: both, on, off */
    const char *out;
    int quiet;
} choices;

/* what is printed of one moment */
typedef struct sample {
    double time, momentum, stress, energy; /* momentum and energy relative to the start */
} sample;

typedef struct body_run {
    sample *rows;
    int count, kept, correction, stopped;
    double momentum, energy; /* at the start */
    const choices *choice;
    example_progress progress;
} body_run;

static void stop_if(sphpa_result result, const sphpa_error *err) {
    if (result != SPHPA_OK) example_fail(1, "%s", err->message);
}

/* [Pa] largest principal size of any particle's deviator */
static double largest_stress(const sphpa_sim *sim) {
    double most = 0.0;
    for (size_t i = 0; i < sim->p.n; i++) {
        const sphpa_real *S = sim->p.S + 6 * i;
        double normal = (double)S[0] * (double)S[0] + (double)S[1] * (double)S[1] +
                        (double)S[2] * (double)S[2];
        double shear = (double)S[3] * (double)S[3] + (double)S[4] * (double)S[4] +
                       (double)S[5] * (double)S[5];
        most = fmax(most, sqrt(1.5 * normal + 3.0 * shear));
    }
    return most;
}

static sphpa_result output(sphpa_sim *sim, void *user, sphpa_error *err) {
    body_run *run = (body_run *)user;
    sphpa_totals now = sphpa_sim_totals(sim);
    (void)err;
    if (run->count == 0) {
        run->momentum = now.angular[2];
        run->energy = now.energy;
    }
    if (run->count >= run->kept) return SPHPA_OK;
    sample *row = &run->rows[run->count++];
    row->time = sim->time;
    row->momentum = now.angular[2] / run->momentum;
    row->stress = largest_stress(sim);
    row->energy = now.energy / run->energy - 1.0;
    return SPHPA_OK;
}

/* how far the body has turned at a time */
static double turns_at(const choices *c, double time) {
    return time * c->omega / 6.283185307179586;
}

static sphpa_result watch(sphpa_sim *sim, void *user, sphpa_error *err) {
    body_run *run = (body_run *)user;
    const choices *c = run->choice;
    (void)err;
    example_progress_show(&run->progress, turns_at(c, sim->time) / c->turns, sim->time,
                          sim->dt, sim->stats.steps, sim->stats.steps * sim->p.n);
    return SPHPA_OK;
}

static void make_body(const choices *c, sphpa_particles *p) {
    const double centre[3] = {0.0, 0.0, 0.0};
    sphpa_body body;
    sphpa_error err;
    memset(&body, 0, sizeof body);
    body.rho = 1.0;
    body.u = 0.01; /* the elastic energy comes from it and goes back to it */
    body.count = (size_t)c->particles;
    body.spin[2] = c->omega;
    body.lattice = (sphpa_lattice)c->lattice;
    stop_if(sphpa_make_begin(p, (int)c->dim, &err), &err);
    stop_if(sphpa_make_sphere(p, centre, 1.0, &body, &err), &err);
}

static void turn(const choices *c, const sphpa_particles *p, body_run *run) {
    sphpa_murnaghan elastic;
    sphpa_solid_material material;
    sphpa_solid_params solid;
    sphpa_sim_options options;
    sphpa_scene scene;
    sphpa_sim sim;
    sphpa_run how;
    sphpa_error err;
    memset(&elastic, 0, sizeof elastic);
    memset(&material, 0, sizeof material);
    memset(&solid, 0, sizeof solid);
    memset(&options, 0, sizeof options);
    memset(&scene, 0, sizeof scene);
    memset(&how, 0, sizeof how);
    elastic.rho0 = elastic.K = elastic.n = 1.0;
    material.eos = sphpa_murnaghan_eos(&elastic);
    material.G = 1.0;
    solid.material = &material;
    solid.materials = 1;
    solid.correction = run->correction;
    solid.viscosity.a = c->viscosity > 0.0 ? c->viscosity : -1.0;
    solid.viscosity.balsara = 1;
    options.integrator = (sphpa_integrator)c->integrator;
    options.kernel = (sphpa_kernel)c->kernel;
    sphpa_scene_add(&scene, sphpa_solid(&solid));
    stop_if(sphpa_sim_create(&sim, &scene, p, &options, &err), &err);
    run->progress.quiet = c->quiet;
    run->choice = c;
    how.t_end = c->turns * 6.283185307179586 / c->omega;
    how.every = how.t_end / (double)c->outputs;
    how.user = run;
    how.output = output;
    how.step = watch;
    how.stop = example_stop_on_interrupt();
    sphpa_result result = sphpa_sim_run(&sim, &how, &err);
    example_progress_end(&run->progress);
    if (result != SPHPA_OK && result != SPHPA_STOPPED) example_fail(1, "%s", err.message);
    if (result == SPHPA_STOPPED) {
        run->stopped = 1;
        fprintf(stderr, "rotating_body: correction %s stopped after %.4f of %g turns; the table "
                "and the picture hold what there is\n", run->correction ? "on" : "off",
                turns_at(c, sim.time), c->turns);
    }
    if (!c->quiet)
        fprintf(stderr, "correction %s: %llu steps, %.1f neighbours, %zu bytes a particle\n",
                run->correction ? "on" : "off", (unsigned long long)sim.stats.steps,
                sim.stats.neighbours_mean, sphpa_particles_bytes_each(&sim.p));
    sphpa_sim_free(&sim);
}

static void table(FILE *to, const choices *c, const body_run run[2]) {
    int rows = run[0].count > run[1].count ? run[0].count : run[1].count;
    fprintf(to, "# rigid rotation, omega %g, K = G = rho = R = 1; J: angular momentum to that at the "
                "start; S: largest von Mises stress over G\n", c->omega);
    fprintf(to, "# %8s %12s %12s %12s %12s %12s %12s\n", "turns", "J on", "S on", "energy on", "J off",
            "S off", "energy off");
    for (int k = 0; k < rows; k++) {
        const body_run *longer = run[0].count == rows ? &run[0] : &run[1];
        fprintf(to, "%10.6g", turns_at(c, longer->rows[k].time));
        for (int side = 0; side < 2; side++)
            if (k < run[side].count)
                fprintf(to, " %12.8f %12.4e %12.2e", run[side].rows[k].momentum,
                        run[side].rows[k].stress, run[side].rows[k].energy);
            else fprintf(to, " %12s %12s %12s", "nan", "nan", "nan");
        fputc('\n', to);
    }
}

/* mean stress of rows [first, last) */
static double mean_stress(const body_run *run, int first, int last) {
    double sum = 0.0;
    for (int k = first; k < last; k++) sum += run->rows[k].stress;
    return last > first ? sum / (last - first) : 0.0;
}

/* the body breathes, so growth is that from the first half to the second */
static void summary(const choices *c, const body_run *run) {
    if (run->count < 2 || run->stopped) return;
    const sample *last = &run->rows[run->count - 1];
    double turns = turns_at(c, last->time);
    int half = (run->count + 1) / 2;
    double growth = mean_stress(run, half, run->count) - mean_stress(run, 1, half);
    double worst = last->momentum; /* on the way: what is lost may come back */
    for (int k = 0; k < run->count; k++)
        if (fabs(run->rows[k].momentum - 1.0) > fabs(worst - 1.0)) worst = run->rows[k].momentum;
    printf("correction %-3s  angular momentum left %.7f, farthest from 1 on the way %.7f; stress "
           "%+.3e G a turn\n", run->correction ? "on:" : "off:", last->momentum, worst,
           growth / (0.5 * turns));
}

static const char *picture =
    "set multiplot layout 2,1 title case.': angular momentum and stress should not change'\n"
    "set key outside right\nset xrange [0:*]\nset grid\nset xlabel 'turns'\n"
    "set ylabel 'angular momentum / start'\n"
    "stats 'rotating_body.txt' using (valid(5) ? $5 : $2) nooutput\n"
    "set yrange [STATS_min < 0.9 ? STATS_min - 0.05 : 0.9:STATS_max > 1.05 ? STATS_max + 0.05 : 1.05]\n"
    "plot 'rotating_body.txt' using 1:2 with lines lw 2 lc rgb '#0060ad' title 'correction on', \\\n"
    "     '' using 1:5 with lines lw 2 dt 2 lc rgb '#c03020' title 'correction off'\n"
    "set ylabel 'largest von Mises stress / G'\nset yrange [*:*]\nset logscale y\n"
    "set format y '10^{%T}'\n"
    "plot 'rotating_body.txt' using 1:($3>0?$3:NaN) with lines lw 2 lc rgb '#0060ad' "
    "title 'correction on', \\\n"
    "     '' using 1:($6>0?$6:NaN) with lines lw 2 dt 2 lc rgb '#c03020' title 'correction off'\n"
    "unset multiplot";

static void draw(const choices *c, size_t particles) {
    char script[2048];
    snprintf(script, sizeof script, "case = 'an elastic %s of %zu particles that turns freely'\n%s",
             c->dim == 2 ? "disc" : "sphere", particles, picture);
    (void)example_picture(c->out, "rotating_body.svg", 900, 640, script);
}

int main(int argc, char **argv) {
    choices c;
    memset(&c, 0, sizeof c);
    c.dim = 3;
    c.particles = 1000;
    c.turns = 1.0;
    c.omega = 6.283185307179586 / 100.0;
    c.viscosity = 1.0;
    c.outputs = 100;
    c.lattice = 1;
    c.out = "build/rotating_body";
    const example_option options[] = {
        example_count("dim", &c.dim, 2, 3, "disc or sphere, of radius 1"),
        example_count("particles", &c.particles, 20, 1000000, "how many, about"),
        example_number("turns", "1", &c.turns, 1e-6, 1e6, "how far"),
        example_number("omega", "1/s", &c.omega, 1e-6, 10.0,
                       "angular velocity; K, G, rho and the radius are 1"),
        example_choice("correction", "both|on|off", &c.correction, "of the kernel's gradient"),
        example_choice("integrator", "pc|rk2", &c.integrator,
                       "predictor-corrector or Runge-Kutta of second order"),
        example_choice("kernel",
                       "cubic|quartic|quintic|wendland-c2|wendland-c4|wendland-c6|gaussian",
                       &c.kernel, "of the sums"),
        example_choice("lattice", "cubic|hexagonal", &c.lattice, "the particles start on"),
        example_number("viscosity", "1", &c.viscosity, 0.0, 10.0, "linear artificial viscosity"),
        example_count("outputs", &c.outputs, 1, 100000, "rows of the table"),
        example_count("threads", &c.threads, 0, 4096, "0: as many as there are"),
        example_text("out", "FOLDER", &c.out, "for the table and the picture"),
        example_flag("quiet", &c.quiet, "no progress"),
    };
    example_parse(argc, argv, "a freely rotating elastic body, kernel correction on and off",
                  SPHPA_VERSION, options, (int)(sizeof options / sizeof options[0]));
    example_threads(c.threads);
    example_folder(c.out);
    sphpa_particles p;
    make_body(&c, &p);
    body_run run[2]; /* on, off */
    memset(run, 0, sizeof run);
    for (int side = 0; side < 2; side++) {
        run[side].correction = side == 0;
        run[side].kept = (int)c.outputs + 2;
        run[side].rows = (sample *)calloc((size_t)run[side].kept, sizeof(sample));
        if (run[side].rows == NULL) example_fail(1, "no memory for %d rows", run[side].kept);
        if (c.correction == 0 || (c.correction == 1) == (side == 0)) turn(&c, &p, &run[side]);
    }
    table(stdout, &c, run);
    summary(&c, &run[0]);
    summary(&c, &run[1]);
    example_file file = example_open(c.out, "rotating_body.txt");
    table(file.stream, &c, run);
    example_close(&file);
    draw(&c, p.n);
    for (int side = 0; side < 2; side++) free(run[side].rows);
    sphpa_particles_free(&p);
    return run[0].stopped || run[1].stopped ? 130 : 0;
}
