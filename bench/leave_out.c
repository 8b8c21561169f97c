/* leave_out.c: what does a scene pay for? One source, six programs: with LEAVE_OUT defined to the
   number of a scene in bench_scenes.h there is that scene and the sections of the header that it
   needs; without, there is all of them, and --scene says at run time which one.

   leave_out.sh (make leave-out) builds them, runs them in turn and makes the table. Each prints one
   line: name, bytes of fields and of scratch a particle, nanoseconds a particle and step (the median
   of some windows, user time of one thread). */
#include "../examples/example.h"

#ifdef LEAVE_OUT
#define SCENE_ONLY LEAVE_OUT
#if LEAVE_OUT == 0
#define SPHPA_GAS_IMPLEMENTATION
#elif LEAVE_OUT == 1
#define SPHPA_SOLID_IMPLEMENTATION
#elif LEAVE_OUT == 2
#define SPHPA_PLASTIC_IMPLEMENTATION
#define SPHPA_CRACKS_IMPLEMENTATION
#elif LEAVE_OUT == 4
#define SPHPA_GODUNOV_IMPLEMENTATION
#else
#define SPHPA_PORES_IMPLEMENTATION
#define SPHPA_PLASTIC_IMPLEMENTATION
#define SPHPA_CRACKS_IMPLEMENTATION
#endif
#define SPHPA_SETUP_IMPLEMENTATION
#else
#define SPHPA_IMPLEMENTATION
#endif
#include "sphpa.h"

#include "bench_clock.h"
#include "bench_scenes.h"

enum { LEAVE_OUT_WINDOWS = 3, LEAVE_OUT_STEPS = 24, LEAVE_OUT_WARM_UP = 40 };

/* [s] user time of each window, as a median */
static double leave_out_time(bench_scene *scene) {
    double user[LEAVE_OUT_WINDOWS], spread;
    scene_steps(scene, LEAVE_OUT_WARM_UP);
    for (int w = 0; w < LEAVE_OUT_WINDOWS; w++) {
        double before = bench_user_time();
        scene_steps(scene, LEAVE_OUT_STEPS);
        user[w] = bench_user_time() - before;
    }
    return bench_median(user, LEAVE_OUT_WINDOWS, &spread);
}

int main(int argc, char **argv) {
    long n = 30000;
    int kind = 0;
    const example_option options[] = {
        example_count("particles", &n, 1000, 10000000, "for a gas the next cube, for gsph the next square"),
#ifndef LEAVE_OUT
        example_choice("scene", "gas|elastic|solid|pumice|gsph", &kind, "what is run"),
#endif
    };
    example_parse(argc, argv, "what one kind of scene costs", SPHPA_VERSION, options,
                  (int)(sizeof options / sizeof options[0]));
#ifdef LEAVE_OUT
    kind = LEAVE_OUT;
#endif
#ifdef _OPENMP
    omp_set_num_threads(1);
#endif
    bench_scene *scene = scene_new(kind, n, kind == SCENE_GAS ? 48.0 : kind == SCENE_GSPH ? 64.0 : 65.0, 0.0);
    double seconds = leave_out_time(scene);
    printf("%s %zu %.0f %.0f\n", scene_names[kind], sphpa_particles_bytes_each(&scene->sim.p),
           bench_scratch(&scene->sim),
           1e9 * seconds / ((double)LEAVE_OUT_STEPS * (double)scene->sim.p.n));
    scene_free(scene);
    return 0;
}
