/* porous_piston: a piston drives a shock into porous aluminium (Jutzi, Benz & Michel 2008, section
   5.1) or pumice, with SPH and P-alpha, against the exact Hugoniot.

   No wall particles: in the frame of the piston, material comes in at -v and meets its mirror
   image, which comes in at +v. By symmetry the plane between them stands still, as the piston does.
   The far ends are free and nothing reaches them before t_end. What is printed and drawn is in the
   frame of the material at rest, of the half x > 0.

   How it is measured: each front is where P falls through the mean of the pressures on its two
   sides; its speed is the slope of a straight line through its places after every step from
   0.3 t_end on. The state behind the shock is the mean over the particles between 0.4 and 0.7 of
   the way from the piston to the shock: nearer to the piston the start-up has left too much heat,
   nearer to the front the shock is not over. */
#include "example.h"

#define SPHPA_PORES_IMPLEMENTATION
#define SPHPA_SETUP_IMPLEMENTATION
#include "sphpa.h"

/* least squares of x against t */
typedef struct front_line {
    double n, t, x, tt, tx;
} front_line;

typedef struct piston {
    const sphpa_run *run;
    double v, length; /* [m/s] of the piston; [m] of the porous sample */
    sphpa_palpha_shock exact;
    front_line main_front, precursor;
    double P, rho, u, alpha; /* behind the shock */
    double PP;               /* [Pa2] the mean of P^2, for the scatter of single particles */
    int counted;             /* particles that this is the mean of */
    example_progress progress;
    uint64_t updates;
} piston;

static double first_speed(const sphpa_palpha_shock *exact) {
    return exact->precursor_speed > 0.0 ? exact->precursor_speed : exact->speed;
}

/* [m] outermost place on the right where P falls through `level`; in 1-D particles lie in order */
static double front_at(const sphpa_sim *sim, double level) {
    double front = 0.0;
    for (size_t i = 0; i + 1 < sim->p.n; i++) {
        double x = sim->p.x[3 * i], a = (double)sim->p.P[i], b = (double)sim->p.P[i + 1];
        if (x > 0.0 && a >= level && b < level)
            front = x + (a - level) / (a - b) * (sim->p.x[3 * i + 3] - x);
    }
    return front;
}

static void line_add(front_line *line, double t, double x) {
    line->n += 1.0;
    line->t += t;
    line->x += x;
    line->tt += t * t;
    line->tx += t * x;
}

static double line_slope(const front_line *line) {
    return (line->n * line->tx - line->t * line->x) / (line->n * line->tt - line->t * line->t);
}

static double middle_of_shock(const sphpa_palpha_shock *exact) {
    return 0.5 * (exact->P + (exact->speed > 0.0 ? exact->precursor_P : 0.0));
}

static sphpa_result step_done(sphpa_sim *sim, void *user, sphpa_error *err) {
    piston *p = (piston *)user;
    (void)err;
    p->updates += sim->p.n;
    example_progress_show(&p->progress, sim->time / p->run->t_end, sim->time, sim->dt,
                          sim->stats.steps, p->updates);
    if (sim->time < 0.3 * p->run->t_end) return SPHPA_OK;
    line_add(&p->main_front, sim->time, front_at(sim, middle_of_shock(&p->exact)));
    if (p->exact.waves == 2)
        line_add(&p->precursor, sim->time, front_at(sim, 0.5 * p->exact.precursor_P));
    return SPHPA_OK;
}

/* the sample and its mirror image */
static sphpa_result fill(sphpa_particles *p, const sphpa_crush *crush, double rho0, double length,
                         long count, double v, sphpa_error *err) {
    const double low[3] = {-length, 0.0, 0.0}, high[3] = {length, 0.0, 0.0};
    sphpa_body body;
    memset(&body, 0, sizeof body);
    body.rho = rho0 / crush->alpha0;
    body.alpha = crush->alpha0;
    body.count = 2 * (size_t)count;
    sphpa_result result = sphpa_make_begin(p, 1, err);
    if (result == SPHPA_OK) result = sphpa_make_box(p, low, high, &body, err);
    for (size_t i = 0; i < p->n && result == SPHPA_OK; i++)
        p->v[3 * i] = (sphpa_real)(p->x[3 * i] > 0.0 ? -v : v);
    return result;
}

static void measure_state(const sphpa_sim *sim, piston *p) {
    double front = front_at(sim, middle_of_shock(&p->exact));
    for (size_t i = 0; i < sim->p.n; i++) {
        if (sim->p.x[3 * i] < 0.4 * front || sim->p.x[3 * i] > 0.7 * front) continue;
        p->P += (double)sim->p.P[i];
        p->PP += (double)sim->p.P[i] * (double)sim->p.P[i];
        p->rho += sim->p.rho[i];
        p->u += sim->p.u[i];
        p->alpha += sim->p.alpha[i];
        p->counted++;
    }
    if (p->counted == 0)
        example_fail(1, "no particle is behind the shock at t = %g s; raise --particles",
                     sim->time);
    p->P /= p->counted;
    p->PP /= p->counted;
    p->rho /= p->counted;
    p->u /= p->counted;
    p->alpha /= p->counted;
}

/* exact P, v, rho, u, alpha at x [m] from where the piston started */
static void exact_at(const piston *p, double rho0, double alpha0, double t, double x,
                     double state[5]) {
    const sphpa_palpha_shock *e = &p->exact;
    double behind = e->speed > 0.0 ? e->speed * t : e->precursor_speed * t;
    state[0] = state[1] = state[3] = 0.0, state[2] = rho0, state[4] = alpha0;
    if (x < behind)
        state[0] = e->P, state[1] = e->v, state[2] = e->rho, state[3] = e->u, state[4] = e->alpha;
    else if (x < e->precursor_speed * t)
        state[0] = e->precursor_P, state[1] = e->precursor_v, state[2] = e->precursor_rho,
        state[3] = e->precursor_u, state[4] = e->precursor_alpha;
}

/* the profile into a file; mean |error| over the sample into l1 */
static void compare(const sphpa_sim *sim, const piston *p, double rho0, double alpha0,
                    const char *out, double l1[5]) {
    example_file file = example_open(out, "porous_piston.dat");
    fprintf(file.stream, "# x[m] P[Pa] v[m/s] rho[kg/m3] u[J/kg] alpha   exact: the same five\n");
    double n = 0.0;
    for (size_t i = 0; i < sim->p.n; i++) {
        double x = sim->p.x[3 * i] + p->v * sim->time, exact[5];
        if (sim->p.x[3 * i] < 0.0 || x > 0.97 * p->length) continue;
        double now[5] = {(double)sim->p.P[i], (double)sim->p.v[3 * i] + p->v, sim->p.rho[i],
                         sim->p.u[i], sim->p.alpha[i]};
        exact_at(p, rho0, alpha0, sim->time, x, exact);
        fprintf(file.stream, "%.9g", x);
        for (int k = 0; k < 5; k++) fprintf(file.stream, " %.9g", now[k]);
        for (int k = 0; k < 5; k++) fprintf(file.stream, " %.9g", exact[k]);
        fprintf(file.stream, "\n");
        for (int k = 0; k < 5; k++) l1[k] += fabs(now[k] - exact[k]);
        n += 1.0;
    }
    for (int k = 0; k < 5; k++) l1[k] /= n;
    example_close(&file);
}

static void print_line(const char *what, double sph, double exact) {
    printf("%-22s %14.6g %14.6g %9.3f %%\n", what, sph, exact, 100.0 * (sph / exact - 1.0));
}

static void print_results(const sphpa_sim *sim, const piston *p, const double l1[5], double alpha0,
                          double drift, const sphpa_pores_stats *stats) {
    const sphpa_palpha_shock *e = &p->exact;
    printf("# t = %.6e s, %zu particles, %llu steps\n", sim->time, sim->p.n / 2,
           (unsigned long long)sim->stats.steps);
    printf("# %-20s %14s %14s %11s\n", "", "SPH", "exact", "error");
    if (e->waves == 2)
        print_line("precursor speed [m/s]", line_slope(&p->precursor) + p->v, e->precursor_speed);
    print_line(e->speed > 0.0 ? "shock speed [m/s]" : "elastic wave [m/s]",
               line_slope(&p->main_front) + p->v, e->speed > 0.0 ? e->speed : e->precursor_speed);
    print_line("pressure [Pa]", p->P, e->P);
    print_line("density [kg/m3]", p->rho, e->rho);
    print_line("energy [J/kg]", p->u, e->u);
    print_line("distention", p->alpha, e->alpha);
    double scatter = sqrt(fmax(0.0, p->PP - p->P * p->P));
    printf("# state behind the shock: mean of %d particles, whose P scatters by %.1f %% (rms)\n",
           p->counted, 100.0 * scatter / fabs(p->P));
    printf("# mean |error| of the profile, and its share of the jump\n");
    static const char *const name[5] = {"P [Pa]", "v [m/s]", "rho [kg/m3]", "u [J/kg]", "alpha"};
    const double jump[5] = {e->P, p->v, e->rho, e->u, alpha0 - 1.0};
    for (int k = 0; k < 5; k++)
        printf("L1 %-19s %14.6g %13.4f %%\n", name[k], l1[k], 100.0 * l1[k] / jump[k]);
    printf("energy drift           %14.3e\n", drift);
    printf("largest distance from the crush curve over alpha0 - 1   %.3e\n", stats->distance_max);
    printf("particles whose alpha grew in a step                    %llu\n",
           (unsigned long long)stats->grew);
    printf("bytes of fields a particle                              %zu\n",
           sphpa_particles_bytes_each(&sim->p));
    printf("equations of state per solve                            %.2f\n",
           (double)stats->evaluations / (double)stats->solves);
}

static const char *picture =
    "set multiplot layout 2,2 title case.': SPH (points) and exact (lines)'\n"
    "set xlabel 'x [mm]'\nunset key\nset grid lc rgb '#dddddd'\n"
    "set offsets 0, 0, graph 0.05, graph 0.05\nset xtics 20\n"
    "scale(k) = k == 1 ? 1e-9 : 1.0\n"
    "do for [k=1:4] {\n"
    "c = k < 4 ? k : 5\n"
    "stats 'porous_piston.dat' using (scale(k)*column(c+1)) nooutput\n"
    "if (STATS_max > STATS_min) { set yrange [*:*] }\n"
    "else { set yrange [STATS_min - 0.5:STATS_max + 0.5] }\n"
    "set ylabel word('\"P [GPa]\" \"v [m/s]\" \"rho [kg/m^3]\" \"distention alpha\"', k)\n"
    "plot 'porous_piston.dat' using (1e3*$1):(scale(k)*column(c+6)) with lines lw 2 "
    "lc rgb '#c44e00', \\\n"
    "     '' using (1e3*$1):(scale(k)*column(c+1)) with points pt 7 ps 0.3 lc rgb '#1f5fa8'\n}\n"
    "unset multiplot\n";

int main(int argc, char **argv) {
    double v = 458.0, length = 0.1, t_end = 0.0, viscosity[2] = {1.0, 2.0}, cfl = 0.3;
    int porous = 0, elastic = 0, solver = 0, kernel = 0, integrator = 0, correction = 1, quiet = 0;
    long particles = 500, threads = 0;
    const char *out = "build/porous_piston";
    const example_option options[] = {
        example_number("speed", "m/s", &v, 0.01, 3000.0, "of the piston"),
        example_choice("material", "aluminium|pumice", &porous, "of the sample"),
        example_choice("elastic", "flat|herrmann", &elastic, "branch below the crush curve"),
        example_count("particles", &particles, 20, 100000, "in the sample"),
        example_number("length", "m", &length, 1e-6, 1e3, "of the sample"),
        example_choice("solver", "crush-space|bisection|newton|safe-newton", &solver,
                       "of the implicit step (newton cycles and ends the run: for teaching)"),
        example_choice("kernel",
                       "cubic|quartic|quintic|wendland-c2|wendland-c4|wendland-c6|gaussian",
                       &kernel, "of the smoothing"),
        example_choice("integrator", "pc|rk2", &integrator, "predictor-corrector or Runge-Kutta"),
        example_vector("viscosity", "a,b", viscosity, 2, 0.0, 1000.0,
                       "linear and quadratic (the impact has 1,3)"),
        example_switch("correction", &correction, "kernel-gradient correction"),
        example_number("cfl", "C", &cfl, 1e-3, 1.0, "time step over the Courant limit"),
        example_number("t-end", "s", &t_end, 0.0, 1e3, "0: the first wave has crossed 85 %"),
        example_count("threads", &threads, 0, 4096, "0: all"),
        example_text("out", "FOLDER", &out, "for porous_piston.dat and porous_piston.png"),
        example_flag("quiet", &quiet, "no progress line"),
    };
    example_parse(argc, argv, "a shock in a porous solid against its Hugoniot", SPHPA_VERSION,
                  options, (int)(sizeof options / sizeof options[0]));
    sphpa_error err;
    const sphpa_tillotson *matrix = sphpa_tillotson_find(porous ? "pumice" : "aluminium");
    sphpa_crush crush = porous ? sphpa_crush_pumice() : sphpa_crush_porous_aluminium();
    crush.elastic = (sphpa_crush_elastic)elastic;
    if (sphpa_crush_prepare(&crush, matrix->rho0, sqrt(matrix->A / matrix->rho0), &err) != SPHPA_OK)
        example_fail(1, "%s", err.message);
    piston pist = {0};
    sphpa_run run = {0};
    pist.v = v;
    pist.length = length;
    pist.run = &run;
    pist.progress.quiet = quiet;
    sphpa_result result = sphpa_palpha_hugoniot(matrix, &crush, v, &pist.exact);
    if (result != SPHPA_OK)
        example_fail(1, "no exact shock for --speed %g: %s", v, sphpa_result_message(result));
    double longest = length / first_speed(&pist.exact);
    run.t_end = t_end > 0.0 ? t_end : 0.85 * longest;
    if (run.t_end > longest)
        example_fail(2, "--t-end %g: the first wave is at the far end at %.4e s; stop before or "
                        "raise --length", t_end, longest);
    example_folder(out);
    (void)example_threads(threads);

    sphpa_solid_material solid_material = {0};
    solid_material.eos = sphpa_tillotson_eos(matrix);
    sphpa_solid_params solid = {0};
    solid.material = &solid_material;
    solid.materials = 1;
    solid.correction = correction;
    solid.viscosity.a = viscosity[0] > 0.0 ? viscosity[0] : -1.0; /* 0 would be the default */
    solid.viscosity.b = viscosity[1] > 0.0 ? viscosity[1] : -1.0;
    sphpa_pores_params pores = {0};
    pores.solid = &solid;
    pores.crush = &crush;
    pores.matrix = &matrix;
    pores.solver = (sphpa_palpha_solver)solver;
    sphpa_sim_options sim_options = {0};
    sim_options.cfl = cfl;
    sim_options.kernel = (sphpa_kernel)kernel;
    sim_options.integrator = (sphpa_integrator)integrator;

    sphpa_particles p = {0};
    sphpa_scene scene = {0};
    static sphpa_sim sim;
    result = fill(&p, &crush, matrix->rho0, length, particles, v, &err);
    if (result == SPHPA_OK) result = sphpa_scene_add(&scene, sphpa_solid(&solid));
    if (result == SPHPA_OK) result = sphpa_scene_add(&scene, sphpa_pores(&pores));
    if (result == SPHPA_OK) result = sphpa_sim_create(&sim, &scene, &p, &sim_options, &err);
    if (result != SPHPA_OK) example_fail(1, "%s", err.message);

    run.user = &pist;
    run.step = step_done;
    double energy = sphpa_sim_totals(&sim).energy, l1[5] = {0.0};
    result = sphpa_sim_run(&sim, &run, &err);
    example_progress_end(&pist.progress);
    if (result != SPHPA_OK) example_fail(1, "%s", err.message);
    double drift = sphpa_sim_totals(&sim).energy / energy - 1.0;
    measure_state(&sim, &pist);
    compare(&sim, &pist, matrix->rho0 / crush.alpha0, crush.alpha0, out, l1);
    print_results(&sim, &pist, l1, crush.alpha0, drift, &pores.stats);
    char script[2048];
    snprintf(script, sizeof script,
             "case = 'a piston at %g m/s in porous %s, %zu particles, t = %.3g s'\n%s", v,
             porous ? "pumice" : "aluminium", sim.p.n / 2, sim.time, picture);
    (void)example_picture(out, "porous_piston.png", 1200, 850, script);
    sphpa_sim_free(&sim);
    sphpa_particles_free(&p);
    return 0;
}
