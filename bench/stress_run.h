/* stress_run.h: one case of stress_sph.c: the simulation that it runs, the guards around that, and
   how what came of it is judged. Include sphpa.h with its implementation first. */
#ifndef STRESS_RUN_H
#define STRESS_RUN_H

#define STRESS_DRIFT 1e-4   /* energy and momentum: more is a failure, in double and in float */
#define STRESS_MASS 1e-12   /* mass does not change at all; its sum is rounded in another order */
#define STRESS_STEPS 200000.0 /* of a simulation, at most */
#define STRESS_BELOW 0.01   /* of the energy may be below zero, the sum of u < 0 */
#define STRESS_LOOK 16      /* steps between looks at every field */

/* ---- verdicts -------------------------------------------------------------------------------- */

/* what came of a case; the first two are what is asked for */
typedef enum stress_verdict {
    STRESS_SURVIVED = 0, /* reached its end: finite, conserved, and right where that is known */
    STRESS_STOPPED,      /* the library ended it, as it must, with a message */
    STRESS_WRONG,        /* reached its end, but the answer is further off than the case allows */
    STRESS_DRIFTS,       /* reached its end, but mass, momentum or energy did not last */
    STRESS_NOT_FINITE,   /* went on with a NaN, an infinity or a value out of its range */
    STRESS_TOO_SLOW,     /* ran into the limit of steps or of time */
    STRESS_GAVE_UP,      /* ended with a message, where there is nothing to stop for */
    STRESS_UNCLEAR,      /* ended with no message, or one that tells nothing */
    STRESS_HUNG,         /* did not answer and was killed */
    STRESS_CRASHED,      /* ended by a signal, an assert or exit */
    STRESS_VERDICTS
} stress_verdict;

static const char *const stress_verdict_name[STRESS_VERDICTS] = {
    "survived", "stopped", "WRONG", "DRIFTS", "NOT FINITE", "TOO SLOW", "GAVE UP", "UNCLEAR", "HUNG",
    "CRASHED"};

/* A row of the table. A child process sends it through a pipe, so it holds no pointers. */
typedef struct stress_row {
    int verdict;
    double steps, t, t_end;       /* [1] [s] [s] */
    double dt_first, dt_least;    /* [s] of the first step and of the shortest one */
    double error;                         /* against what the case says; NAN: nothing exact */
    double mass, momentum, energy;        /* drifts [1]; see stress_drifts */
    double below;                         /* [1] energy below zero, over the total */
    double seconds;                       /* processor time */
    double number;                        /* the case's own, such as where the CFL number breaks */
    char note[96];                        /* what else was measured */
    char message[512];                    /* what stopped it */
} stress_row;

struct stress_world;

/* A case of the table in stress_scenes.h. */
typedef struct stress_case {
    const char *name, *setting; /* --only takes the beginning of a name */
    void (*run)(const struct stress_case *c, struct stress_world *w, stress_row *row);
    double a, b;          /* the case's numbers; what they mean stands at its function */
    double allowed;       /* error above it is WRONG; 0: there is no exact answer */
    const char *error_of; /* what the error is of */
    int quick;            /* not 0: also with --quick */
    const char *must_say; /* nothing can come of it: it must stop, with these words; or NULL */
} stress_case;

/* ---- the simulation -------------------------------------------------------------------------- */

enum { STRESS_BODIES = 2 };

/* All that a case's simulation points to. */
typedef struct stress_world {
    double limit, most_steps; /* [s] of processor time; [1] of one simulation */
    int quick;
    sphpa_ideal ideal;
    sphpa_murnaghan murnaghan;
    sphpa_eos eos;
    sphpa_gas_params gas;
    sphpa_material material[STRESS_BODIES];
    sphpa_solid_material solid_material[STRESS_BODIES];
    const sphpa_tillotson *matrix[STRESS_BODIES];
    sphpa_crush crush[STRESS_BODIES];
    sphpa_yield yield[STRESS_BODIES];
    sphpa_cracks_material flaws[STRESS_BODIES];
    sphpa_solid_params solid;
    sphpa_pores_params pores;
    sphpa_plastic_params plastic;
    sphpa_cracks_params cracks;
    sphpa_particles p; /* what it starts with */
    sphpa_sim_options options;
    sphpa_scene scene;
    sphpa_sim sim;
    sphpa_totals start;
    size_t n; /* particles at the start */
    stress_row *row;
    clock_t begun;
} stress_world;

/* for the next simulation of the same case */
static void stress_clear(stress_world *w) {
    double limit = w->limit, most_steps = w->most_steps;
    int quick = w->quick;
    clock_t begun = w->begun;
    sphpa_sim_free(&w->sim);
    sphpa_particles_free(&w->p);
    memset(w, 0, sizeof *w);
    w->limit = limit;
    w->most_steps = most_steps;
    w->quick = quick;
    w->begun = begun;
}

static double stress_seconds(const stress_world *w) {
    return (double)(clock() - w->begun) / (double)CLOCKS_PER_SEC;
}

/* The library ended it. What its message must do to be clear: be there, name a number, and not call
   "an argument" what nobody gave as one. */
static bool stress_stopped(stress_row *row, sphpa_result result, const sphpa_error *err) {
    if (result == SPHPA_OK) return false;
    bool clear = strlen(err->message) >= 20 && strpbrk(err->message, "0123456789") != NULL &&
                 strstr(err->message, "an argument is out of its range at t") == NULL;
    row->verdict = clear ? STRESS_STOPPED : STRESS_UNCLEAR;
    snprintf(row->message, sizeof row->message, "%s",
             err->message[0] != '\0' ? err->message : sphpa_result_message(result));
    return true;
}

static bool stress_finite(double x) { return x - x == 0.0; }

/* component `at` of a field as a double; 0 for whole numbers, which are always finite */
static double stress_value(const void *data, sphpa_type type, size_t at) {
    if (type == SPHPA_TYPE_double) return ((const double *)data)[at];
    if (type == SPHPA_TYPE_sphpa_real) return (double)((const sphpa_real *)data)[at];
    return 0.0;
}

/* a value that no particle may have: its field's name, or NULL */
static const char *stress_bad_range(const sphpa_particles *p, size_t i) {
    if (!(p->rho[i] > 0.0)) return "rho";
    if (!(p->h[i] > (sphpa_real)0)) return "h";
    if (!(p->m[i] > (sphpa_real)0)) return "m";
    if (p->alpha != NULL && !(p->alpha[i] >= 1.0)) return "alpha";
    if (p->D != NULL && !(p->D[i] >= (sphpa_real)0 && p->D[i] <= (sphpa_real)1)) return "D";
    return NULL;
}

/* Looks at every component of every field of every particle: the library looks at fewer. */
static bool stress_sound(const sphpa_sim *sim, stress_row *row) {
    const sphpa_particles *p = &sim->p;
    for (int k = 0; k < (int)SPHPA_FIELD_COUNT; k++) {
        sphpa_field_info info = sphpa_field_describe((sphpa_field)k);
        const void *data = sphpa_particles_data(p, (sphpa_field)k, 0);
        size_t all = p->n * (size_t)info.components;
        for (size_t at = 0; data != NULL && at < all; at++) {
            if (stress_finite(stress_value(data, info.type, at))) continue;
            row->verdict = STRESS_NOT_FINITE;
            snprintf(row->message, sizeof row->message, "%s of particle %zu is %g after %llu steps",
                     info.name, at / (size_t)info.components, stress_value(data, info.type, at),
                     (unsigned long long)sim->stats.steps);
            return false;
        }
    }
    for (size_t i = 0; i < p->n; i++) {
        const char *bad = stress_bad_range(p, i);
        if (bad == NULL) continue;
        row->verdict = STRESS_NOT_FINITE;
        snprintf(row->message, sizeof row->message, "%s of particle %zu is out of its range", bad,
                 i);
        return false;
    }
    return true;
}

/* after every step: the guards. A result other than OK ends the run. */
static sphpa_result stress_step(sphpa_sim *sim, void *user, sphpa_error *err) {
    stress_world *w = (stress_world *)user;
    stress_row *row = w->row;
    row->steps += 1.0;
    if (!(row->dt_least > 0.0) || sim->dt_free < row->dt_least) row->dt_least = sim->dt_free;
    if (sim->stats.steps % STRESS_LOOK == 1 && !stress_sound(sim, row))
        return sphpa_error_set(err, SPHPA_STOPPED, "not finite");
    if ((double)sim->stats.steps < w->most_steps && stress_seconds(w) < w->limit) return SPHPA_OK;
    row->verdict = STRESS_TOO_SLOW;
    const char *which = sim->stats.limit[sim->stats.limit_last].name;
    snprintf(row->message, sizeof row->message,
             "too slow: dt fell to %.2g of the first by the limit \"%s\"; t = %.3g of %.3g s after "
             "%.0f steps and %.0f s", sim->dt / sim->dt_first, which, sim->time, row->t_end,
             row->steps, stress_seconds(w));
    return sphpa_error_set(err, SPHPA_STOPPED, "too slow");
}

/* Makes the simulation from w's particles, scene and options; false: it could not, row says why. */
static bool stress_begin(stress_world *w, stress_row *row) {
    sphpa_error err;
    err.message[0] = '\0';
    sphpa_result result = sphpa_sim_create(&w->sim, &w->scene, &w->p, &w->options, &err);
    if (stress_stopped(row, result, &err)) return false;
    w->row = row;
    w->n = w->sim.p.n;
    w->start = sphpa_sim_totals(&w->sim);
    return true;
}

/* the larger one, and NaN where there is one: fmax would lose it */
static double stress_worse(double a, double b) { return a >= b ? a : b >= a ? b : (double)NAN; }

/* Of mass relative to it; of momentum over sqrt(2 M E), what the mass would have if all of the
   energy were in its motion; of energy relative to it. */
static void stress_drifts(const stress_world *w, stress_row *row) {
    sphpa_totals now = sphpa_sim_totals(&w->sim);
    const sphpa_totals *was = &w->start;
    double off = 0.0, scale = sqrt(2.0 * was->mass * was->energy);
    for (int a = 0; a < 3; a++)
        off += (now.momentum[a] - was->momentum[a]) * (now.momentum[a] - was->momentum[a]);
    row->mass = stress_worse(row->mass, fabs(now.mass / was->mass - 1.0));
    row->momentum = stress_worse(row->momentum, sqrt(off) / scale);
    row->energy = stress_worse(row->energy, fabs(now.energy / was->energy - 1.0));
    row->below = w->sim.stats.u_deficit / was->energy;
}

/* to t_end; true: it got there, and what it has there is sound. Fields are those of t_end. */
static bool stress_go(stress_world *w, stress_row *row, double t_end) {
    sphpa_error err;
    sphpa_run run;
    memset(&run, 0, sizeof run);
    err.message[0] = '\0';
    run.t_end = row->t_end = t_end;
    run.user = w;
    run.step = stress_step;
    row->verdict = STRESS_SURVIVED;
    sphpa_result result = sphpa_sim_run(&w->sim, &run, &err);
    if (result == SPHPA_OK) result = sphpa_sim_refresh(&w->sim, &err);
    row->t = w->sim.time;
    row->dt_first = w->sim.dt_first;
    row->seconds = stress_seconds(w);
    if (row->verdict != STRESS_SURVIVED) return false;
    if (stress_stopped(row, result, &err)) return false;
    if (!stress_sound(&w->sim, row)) return false;
    stress_drifts(w, row);
    if (w->sim.p.n != w->n) {
        row->verdict = STRESS_WRONG;
        snprintf(row->message, sizeof row->message, "%zu of %zu particles are left", w->sim.p.n,
                 w->n);
        return false;
    }
    return true;
}

/* the last word on a row that reached its end */
static void stress_judge(const stress_case *c, stress_row *row) {
    if (row->verdict == STRESS_STOPPED && c->must_say == NULL) row->verdict = STRESS_GAVE_UP;
    if (row->verdict == STRESS_STOPPED && strstr(row->message, c->must_say) == NULL)
        row->verdict = STRESS_UNCLEAR; /* what is to be cured it does not say */
    if (row->verdict != STRESS_SURVIVED) return;
    if (c->must_say != NULL) {
        row->verdict = STRESS_WRONG;
        snprintf(row->message, sizeof row->message, "went on with what makes no sense");
    } else if (!(row->mass <= STRESS_MASS && row->momentum <= STRESS_DRIFT &&
                 row->energy <= STRESS_DRIFT)) {
        row->verdict = STRESS_DRIFTS;
        snprintf(row->message, sizeof row->message,
                 "mass, momentum, energy drift by %.1e, %.1e, %.1e; %g is allowed", row->mass,
                 row->momentum, row->energy, STRESS_DRIFT);
    } else if (!(row->below <= STRESS_BELOW)) {
        row->verdict = STRESS_WRONG;
        snprintf(row->message, sizeof row->message, "u is below zero by %.2g of all energy; %g is "
                 "allowed", row->below, STRESS_BELOW);
    } else if (c->allowed > 0.0 && !(row->error <= c->allowed)) {
        row->verdict = STRESS_WRONG;
        snprintf(row->message, sizeof row->message, "%s off by %.3g; %g is allowed", c->error_of,
                 row->error, c->allowed);
    }
}

#endif
