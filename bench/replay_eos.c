/* replay_eos.c: the same impact with each P-alpha solver: what a step costs, and whether the
   results are equal.

   make replay-eos builds and runs it. Two ways to compare: (1) the impact of pumice_impact.c is run
   with each solver for the same number of steps, and the passes' own timings are read; (2) the
   states that its P-alpha equation met are recorded once, and each solver gets the same ones. In
   (2) answers differ by the tolerance at most; in (1) what differs by a rounding changes with time,
   as it does in any impact: beside it a run with the same solver and one particle's speed changed
   by one rounding. */
#include "impact_again.h"

#include "bench_clock.h"

enum {
    REPLAY_SOLVERS = 3,
    REPLAY_RUNS = 4, /* the last one: nudged */
    REPLAY_REPEATS = 9,
    REPLAY_STATES = 4000000 /* recorded, at most: of evenly spread steps */
};

static const sphpa_palpha_solver replay_solvers[REPLAY_SOLVERS] = {
    SPHPA_PALPHA_CRUSH_SPACE, SPHPA_PALPHA_SAFE_NEWTON, SPHPA_PALPHA_BISECTION};
static const char *const replay_names[REPLAY_RUNS] = {"crush-space", "safe-newton", "bisection",
                                                      "crush-space, nudged"};

typedef struct replay_options {
    long steps, repeats, threads;
    double tol;
    int quick;
} replay_options;

/* ---- the states that are recorded ------------------------------------------------------------ */

typedef struct replay_states {
    size_t n, room, each; /* states; memory for; particles of the target */
    long step, stride;    /* seen so far; every stride-th is recorded */
    double *rho, *u, *alpha_old;
} replay_states;

/* RESIZE: once a step, after the commit, in one call */
static sphpa_result replay_record(sphpa_sim *sim, void *params, size_t first, size_t last,
                                  size_t *bad) {
    replay_states *states = (replay_states *)params;
    const sphpa_particles *p = &sim->p;
    (void)bad;
    if (states->step++ % states->stride != 0) return SPHPA_OK;
    for (size_t i = first; i < last; i++) {
        if (p->material[i] != IMPACT_TARGET || states->n == states->room) continue;
        states->rho[states->n] = p->rho[i];
        states->u[states->n] = fmax(p->u[i], 0.0);
        states->alpha_old[states->n++] = p->start.alpha[i];
    }
    return SPHPA_OK;
}

static sphpa_module replay_recorder(replay_states *states) {
    sphpa_module module;
    memset(&module, 0, sizeof module);
    module.name = "recorder";
    module.params = states;
    module.passes = 1;
    module.pass[0].name = "record states";
    module.pass[0].stage = SPHPA_STAGE_RESIZE;
    module.pass[0].reads = SPHPA_F(rho) | SPHPA_F(u) | SPHPA_F(alpha) | SPHPA_F(material);
    module.pass[0].particle = replay_record;
    return module;
}

/* ---- (1) the runs ---------------------------------------------------------------------------- */

/* of one run; times [ms] a step */
typedef struct replay_run {
    double eos, gradients, forces, step, evaluations, drift, *alpha, *D;
    size_t n; /* particles of the target, whose alpha and D are here by id */
} replay_run;

static double replay_time(const sphpa_sim *sim, const char *names) {
    double sum = 0.0;
    for (int k = 0; k < sim->stats.timings; k++) {
        char name[64];
        snprintf(name, sizeof name, "%s|", sim->stats.timing[k].name);
        if (strstr(names, name) != NULL) sum += sim->stats.timing[k].seconds;
    }
    return 1e3 * sum / (double)sim->stats.steps;
}

static void replay_keep(const impact_run *run, replay_run *out) {
    const sphpa_particles *p = &run->sim.p;
    const sphpa_pores_stats *pores = &run->scene.pores.stats;
    if (out->alpha == NULL) {
        out->alpha = again_doubles(p->n);
        out->D = again_doubles(p->n);
    }
    out->n = 0;
    for (size_t i = 0; i < p->n; i++) {
        if (p->body[i] != IMPACT_TARGET) continue;
        out->alpha[p->id[i]] = p->alpha[i];
        out->D[p->id[i]] = (double)p->D[i];
        out->n++;
    }
    out->evaluations = (double)pores->evaluations / (double)pores->solves;
    out->drift = again_drift(run);
}

/* the target is made first: its ids are 0, 1, .. */
static void replay_one(const impact_settings *s, const again_change *change, long steps,
                       const sphpa_module *recorder, replay_run *out) {
    impact_run *run = again_begin(s, change, recorder);
    double since = sphpa_wall_clock();
    for (long k = 0; k < steps; k++) again_step(run, HUGE_VAL);
    out->step = 1e3 * (sphpa_wall_clock() - since) / (double)steps;
    out->eos = replay_time(&run->sim, "pores pressure|");
    out->gradients = replay_time(&run->sim, "solid gradients|solid density|");
    out->forces = replay_time(&run->sim, "solid forces|solid energy|");
    replay_keep(run, out);
    impact_free(run);
}

/* medians over the repeats, each of which runs every solver once */
static void replay_all(const impact_settings *s, const replay_options *o,
                       replay_run runs[REPLAY_RUNS], double spread[REPLAY_SOLVERS], double *noise) {
    static double sample[REPLAY_SOLVERS][4][REPLAY_REPEATS], fixed[REPLAY_SOLVERS * REPLAY_REPEATS];
    double unused;
    int repeats = (int)o->repeats;
    for (int r = 0; r < repeats; r++)
        for (int turn = 0; turn < REPLAY_SOLVERS; turn++) {
            int k = (turn + r) % REPLAY_SOLVERS;
            again_change change = {replay_solvers[k], o->tol, 0, 0.0};
            replay_one(s, &change, o->steps, NULL, &runs[k]);
            fixed[r * REPLAY_SOLVERS + turn] = bench_fixed_work();
            const double part[4] = {runs[k].eos, runs[k].gradients, runs[k].forces, runs[k].step};
            for (int q = 0; q < 4; q++) sample[k][q][r] = part[q];
            fprintf(stderr, "run %d of %d, %s: %.3f ms a step\n", r * REPLAY_SOLVERS + turn + 1,
                    repeats * REPLAY_SOLVERS, replay_names[k], runs[k].step);
        }
    for (int k = 0; k < REPLAY_SOLVERS; k++) {
        runs[k].eos = bench_median(sample[k][0], repeats, &spread[k]);
        runs[k].gradients = bench_median(sample[k][1], repeats, &unused);
        runs[k].forces = bench_median(sample[k][2], repeats, &unused);
        runs[k].step = bench_median(sample[k][3], repeats, &unused);
    }
    (void)bench_median(fixed, repeats * REPLAY_SOLVERS, noise);
    again_change nudged = {SPHPA_PALPHA_CRUSH_SPACE, o->tol, 1, 0.0};
    replay_one(s, &nudged, o->steps, NULL, &runs[REPLAY_SOLVERS]);
}

/* ---- (2) the same states to each ------------------------------------------------------------- */

typedef struct replay_answers {
    double *alpha, *P, ns, spread, off; /* off: of crush-space's alpha, at most */
    sphpa_palpha_stats stats;
} replay_answers;

/* one step's particles a call, as in the run; one thread */
static double replay_pass(const impact_scene *scene, const replay_states *states,
                          sphpa_palpha_solver solver, double tol, replay_answers *out) {
    sphpa_palpha_options options;
    memset(&options, 0, sizeof options);
    memset(&out->stats, 0, sizeof out->stats);
    options.tol = tol;
    sphpa_palpha_stats one = out->stats;
    double since = sphpa_wall_clock();
    for (size_t k = 0; k < states->n; k += states->each) {
        size_t n = states->n - k < states->each ? states->n - k : states->each;
        (void)sphpa_palpha_solve_batch(solver, scene->matrix[IMPACT_TARGET],
                                       &scene->crush[IMPACT_TARGET], n, states->rho + k,
                                       states->u + k, states->alpha_old + k, &options,
                                       out->alpha + k, out->P + k, &one);
        out->stats.failed += one.failed;
        out->stats.evaluations += one.evaluations;
    }
    return 1e9 * (sphpa_wall_clock() - since) / (double)states->n;
}

static void replay_states_solve(const impact_scene *scene, const replay_states *states, double tol,
                                replay_answers answers[REPLAY_SOLVERS]) {
    static double sample[REPLAY_SOLVERS][REPLAY_REPEATS];
    for (int r = 0; r < REPLAY_REPEATS; r++)
        for (int k = 0; k < REPLAY_SOLVERS; k++)
            sample[k][r] = replay_pass(scene, states, replay_solvers[k], tol, &answers[k]);
    for (int k = 0; k < REPLAY_SOLVERS; k++) {
        answers[k].ns = bench_median(sample[k], REPLAY_REPEATS, &answers[k].spread);
        for (size_t i = 0; i < states->n; i++)
            answers[k].off =
                fmax(answers[k].off, fabs(answers[k].alpha[i] - answers[0].alpha[i]));
    }
}

/* ---- what is printed ------------------------------------------------------------------------- */

static void replay_print_times(const replay_run runs[REPLAY_RUNS],
                               const double spread[REPLAY_SOLVERS], double noise, long repeats) {
    printf("\n### What a step costs [ms]: medians of %ld\n\n"
           "A fixed piece of work beside the runs spread by %.1f %%%s\n\n"
           "| solver      |    EOS | err%% | gradients | forces | EOS share |   step | evals |\n"
           "|:------------|-------:|-----:|----------:|-------:|----------:|-------:|------:|\n",
           repeats, noise, noise > BENCH_NOISY_PCT ? ": THE MACHINE IS NOISY" : "");
    for (int k = 0; k < REPLAY_SOLVERS; k++) {
        const replay_run *r = &runs[k];
        char err[16] = "-";
        if (repeats > 1) snprintf(err, sizeof err, "%.1f", spread[k]);
        printf("| %-11s | %6.3f | %4s | %9.3f | %6.3f | %7.2f %% | %6.3f | %5.2f |\n",
               replay_names[k], r->eos, err, r->gradients, r->forces,
               100.0 * r->eos / (r->gradients + r->forces), r->step, r->evaluations);
    }
    fputs("\n"
          "EOS: the pass that solves P and alpha, all its calls (trial and commit). gradients:\n"
          "velocity gradient, kernel correction, density. forces: momentum and energy. share: EOS\n"
          "of gradients and forces.\n"
          "\n"
          "Quoted, of GASPHiA: EOS 2.8 ms a step by bisection, 0.237 by safe Newton, right-hand\n"
          "side 2.4 (so 117 % and 9.9 % of it). Another machine, a GPU, another number of\n"
          "particles: only the shares say something here. Every solver here tests both ends\n"
          "first, which is the end of it for most states; so bisection, too, is quick in a run.\n",
          stdout);
}

static void replay_print_states(const replay_states *states,
                                const replay_answers answers[REPLAY_SOLVERS], double tol) {
    size_t inside = 0;
    double halvings = 0.0;
    for (size_t i = 0; i < states->n; i++) {
        inside += answers[0].alpha[i] > 1.0 && answers[0].alpha[i] < states->alpha_old[i];
        halvings += fmax(0.0, ceil(log2((states->alpha_old[i] - 1.0) / tol)));
    }
    printf("\n### The same %zu recorded states to each solver, tolerance %g, one thread\n\n"
           "%.2f %% of them have their root strictly inside [1, alpha_old]; a bisection that tests "
           "no ends\nwould halve each %.1f times\n\n"
           "| solver      | ns/solve | err%% | evals | failed | max alpha off crush-space |\n"
           "|:------------|---------:|-----:|------:|-------:|--------------------------:|\n",
           states->n, tol, 100.0 * (double)inside / (double)states->n,
           halvings / (double)states->n);
    for (int k = 0; k < REPLAY_SOLVERS; k++)
        printf("| %-11s | %8.1f | %4.1f | %5.2f | %6zu | %25.2e |\n",
               replay_names[k], answers[k].ns, answers[k].spread,
               (double)answers[k].stats.evaluations / (double)states->n, answers[k].stats.failed,
               answers[k].off);
    double worst = fmax(answers[1].off, answers[2].off);
    printf("\nequal to the tolerance: %s (each within tol of the root, so within 2 tol of each "
           "other)\n", worst <= 2.0 * tol ? "yes" : "NO");
}

/* records an impact's states, solves and prints; what is allocated goes with the program */
static void replay_same_states(const impact_settings *s, const replay_options *o,
                               size_t particles) {
    replay_states states;
    memset(&states, 0, sizeof states);
    states.stride = (long)(particles * (size_t)o->steps / REPLAY_STATES) + 1;
    states.each = particles;
    states.room = particles * (size_t)((o->steps + states.stride - 1) / states.stride);
    states.rho = again_doubles(states.room);
    states.u = again_doubles(states.room);
    states.alpha_old = again_doubles(states.room);
    again_change change = {SPHPA_PALPHA_CRUSH_SPACE, o->tol, 0, 0.0};
    sphpa_module recorder = replay_recorder(&states);
    replay_run recorded;
    memset(&recorded, 0, sizeof recorded);
    replay_one(s, &change, o->steps, &recorder, &recorded);
    replay_answers answers[REPLAY_SOLVERS];
    memset(answers, 0, sizeof answers);
    for (int k = 0; k < REPLAY_SOLVERS; k++) {
        answers[k].alpha = again_doubles(states.n);
        answers[k].P = again_doubles(states.n);
    }
    static impact_scene scene;
    impact_materials(&scene, s);
    replay_states_solve(&scene, &states, o->tol, answers);
    replay_print_states(&states, answers, o->tol);
}

static void replay_print_runs(const replay_run runs[REPLAY_RUNS], const replay_options *o) {
    double worst = 0.0;
    printf("\n### After %ld steps: off the crush-space run, particle by particle of the target\n\n"
           "| run                       | max alpha |  rms alpha |     max D |     rms D | energy "
           "drift |\n|:--------------------------|----------:|-----------:|----------:|----------:"
           "|-------------:|\n", o->steps);
    for (int k = 0; k < REPLAY_RUNS; k++) {
        double most[2] = {0.0, 0.0}, square[2] = {0.0, 0.0};
        for (size_t i = 0; i < runs[k].n; i++) {
            double off[2] = {fabs(runs[k].alpha[i] - runs[0].alpha[i]),
                             fabs(runs[k].D[i] - runs[0].D[i])};
            for (int q = 0; q < 2; q++) {
                most[q] = fmax(most[q], off[q]);
                square[q] += off[q] * off[q] / (double)runs[k].n;
            }
        }
        printf("| %-25s | %9.1e | %10.1e | %9.1e | %9.1e | %12.1e |\n",
               replay_names[k], most[0], sqrt(square[0]), most[1], sqrt(square[1]), runs[k].drift);
        if (k < REPLAY_SOLVERS) worst = fmax(worst, most[0]);
    }
    printf("\nAt most %.1f tol. nudged: one particle's speed changed by one rounding. Each solve\n"
           "is within tol = %g of its root, but the runs feed on their own results: a difference\n"
           "of tol goes into the forces of every step that loads, and grows or fades from there\n"
           "as a rounding's does. The nudged run shows how much one rounding comes to; no other\n"
           "bound is there than that growth.\n", worst / o->tol, o->tol);
}

static void replay_print_about(const impact_settings *s, const replay_options *o) {
    char cpu[128];
    bench_read_cpu(cpu);
    printf("- sphpa %s, pumice_impact's scene, %s curve, %ld + %ld particles, %ld steps from the "
           "start, tolerance %g\n", SPHPA_VERSION, s->curve == 0 ? "two-exponent" : "quadratic",
           s->particles, s->projectile_particles, o->steps, o->tol);
    printf("- cpu: %s, %d threads\n- compiler: %s\n- flags: %s\n", cpu, example_threads(0),
           BENCH_COMPILER, BENCH_FLAGS);
}

int main(int argc, char **argv) {
    impact_settings s = impact_default_settings();
    replay_options o = {400, 3, 0, 1e-12, 0};
    const example_option options[] = {
        example_count("particles", &s.particles, 10, 1000000, "of the target"),
        example_count("projectile-particles", &s.projectile_particles, 10, 100000, "of the nylon"),
        example_choice("curve", IMPACT_CURVES, &s.curve, "crush curve of the pumice"),
        example_count("steps", &o.steps, 1, 100000, "of each run"),
        example_count("repeats", &o.repeats, 1, REPLAY_REPEATS, "of the runs, for medians"),
        example_number("tol", "1", &o.tol, 1e-15, 1e-2, "of alpha"),
        example_count("threads", &o.threads, 0, 4096, "0: as many as there are"),
        example_flag("quick", &o.quick, "2000 particles, 200 steps, one repeat")};
    example_parse(argc, argv, "one impact with each P-alpha solver", SPHPA_VERSION, options,
                  (int)(sizeof options / sizeof options[0]));
    (void)example_threads(o.threads);
    if (o.quick) s.particles = 2000, o.steps = 200, o.repeats = 1;
    replay_run runs[REPLAY_RUNS];
    double spread[REPLAY_SOLVERS], noise;
    memset(runs, 0, sizeof runs);
    replay_print_about(&s, &o);
    replay_all(&s, &o, runs, spread, &noise);
    replay_print_times(runs, spread, noise, o.repeats);
    replay_same_states(&s, &o, runs[0].n);
    replay_print_runs(runs, &o);
    if (fflush(stdout) != 0 || ferror(stdout))
        example_fail(1, "cannot write to standard output (%s)", strerror(errno));
    return 0;
}
