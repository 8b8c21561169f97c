/* verify: every standard problem, how wrong it is and how long it took.

   make verify builds this in double and in float and runs both: the double program runs all
   problems of the table below, the float program those that compare precisions; its rows are
   appended. Rows go to verify.csv, pictures of error against run time are drawn from them. What a
   row is judged by is written where it is made, with its source. */
#include "../examples/example.h"

#include "sphpa.h"

#include "verify_frame.h"

#include "verify_draw.h"
#include "verify_exact.h"

#include "verify_gas.h"
#include "verify_godunov.h"
#include "verify_grid.h"
#include "verify_hybrid.h"
#include "verify_interpolation.h"
#include "verify_solid.h"

/* after verify_solid.h, whose helpers it takes */
#include "verify_fracture.h"

/* name, function, dimensions, in float too?, seconds in full and quick, about */
static const verify_problem problems[] = {
    {"riemann-solver", verify_riemann_solver, 1, 0, 1, 1, "the exact solver against Toro's table"},
    {"sod", verify_sod, 1, 0, 45, 1, "Sod's shock tube: kernels, neighbours, conduction"},
    {"sod-orders", verify_sod_orders, 1, 1, 4, 1, "Sod's tube at rising resolution"},
    {"sod-late", verify_sod_late, 1, 0, 5, 1, "the same at t = 0.2"},
    {"toro2", verify_toro2, 1, 0, 5, 1, "two rarefactions, nearly a vacuum"},
    {"toro3", verify_toro3, 1, 0, 5, 2, "a blast, pressures 1e5 to 1"},
    {"toro4", verify_toro4, 1, 0, 4, 1, "a blast the other way"},
    {"toro5", verify_toro5, 1, 0, 21, 2, "two shocks meet"},
    {"lax", verify_lax, 1, 0, 4, 1, "Lax's tube"},
    {"wall-shock", verify_wall, 1, 0, 48, 4, "cold gas against a wall"},
    {"wall-reflects", verify_edges_wall, 1, 0, 6, 1, "a shock comes back from a wall"},
    {"open-edge", verify_edges_open, 1, 0, 7, 1, "a shock and a pulse of sound leave"},
    {"noh1", verify_noh1, 1, 1, 8, 1, "Noh's planar implosion"},
    {"acoustic-wave", verify_acoustic, 1, 0, 2, 1, "a sound wave, with and without viscosity"},
    {"noh2", verify_noh2, 2, 0, 190, 6, "Noh's cylindrical implosion"},
    {"sedov-exact", verify_sedov_exact, 1, 0, 1, 1, "Sedov's solution against the tabled xi0"},
    {"sedov2", verify_sedov2, 2, 0, 60, 6, "a cylindrical explosion"},
    {"gresho", verify_gresho, 2, 1, 380, 14, "Gresho's vortex: kernels, neighbours, Balsara"},
    {"kelvin-helmholtz", verify_kelvin_helmholtz, 2, 0, 180, 11, "growth of a shear layer's wave"},
    {"square", verify_square, 2, 0, 120, 8, "a dense square at rest"},
    {"godunov-tubes", verify_godunov_riemann, 1, 0, 90, 25, "GSPH, ADKE, MPM: Riemann problems"},
    {"godunov-orders", verify_godunov_orders, 1, 1, 10, 2, "GSPH: Sod's tube at rising resolution"},
    {"godunov-noh1", verify_godunov_noh1, 1, 0, 10, 10, "the same: cold gas against walls"},
    {"godunov-blasts", verify_godunov_blasts, 1, 0, 30, 5, "the same: two colliding blasts"},
    {"godunov-noh2", verify_godunov_noh2, 2, 0, 120, 20, "the same: a cylindrical implosion"},
    {"godunov-sedov2", verify_godunov_sedov2, 2, 0, 120, 20, "the same: a cylindrical explosion"},
    {"godunov-gresho", verify_godunov_gresho, 2, 0, 120, 20, "the same: Gresho's vortex"},
    {"interpolation1", verify_interpolation1, 1, 0, 3, 3, "kernel sums on a line"},
    {"interpolation2", verify_interpolation2, 2, 0, 5, 5, "the same in the plane"},
    {"interpolation3", verify_interpolation3, 3, 0, 25, 0, "the same in space"},
    {"noh3", verify_noh3, 3, 0, 620, 0, "Noh's spherical implosion"},
    {"sedov3", verify_sedov3, 3, 0, 290, 0, "a spherical explosion"},
    {"piston", verify_piston, 1, 0, 230, 18, "porous aluminium, five speeds, two elastic branches"},
    {"elastic-wave", verify_elastic_wave, 2, 1, 25, 2, "longitudinal and shear, 1-D and 2-D"},
    {"rotation", verify_rotation, 2, 1, 115, 11, "a disc turns ten times: momentum, stress"},
    {"rotation-3d", verify_rotation_3d, 3, 0, 210, 0, "a sphere turns ten times"},
    {"rings", verify_rings, 2, 0, 145, 20, "rubber rings bounce, and stay whole"},
    {"rod", verify_rod, 1, 0, 130, 15, "flaws tear a rod: size of fragments, strength over rate"},
    {"basalt", verify_basalt, 3, 0, 360, 0, "the core that an impact leaves of a sphere"},
    {"grid-tubes", verify_grid_tubes, 1, 0, 10, 1, "finite volumes: six tubes, one on the diagonal"},
    {"grid-smooth", verify_grid_smooth, 2, 0, 60, 10, "the same: a wave, a vortex, three slopes"},
    {"grid-sedov", verify_grid_sedov, 2, 0, 40, 5, "the same: along a radius, and in the plane"},
    {"grid-noh", verify_grid_noh, 1, 0, 3, 1, "the same: plane, cylinder, sphere"},
    {"grid-two-blasts", verify_grid_two_blasts, 1, 0, 4, 2, "the same: Woodward and Colella's"},
    {"hybrid-contact", verify_hybrid_contact, 2, 0, 60, 15, "the hybrid: a contact through a region"},
    {"hybrid-sound", verify_hybrid_sound, 2, 0, 300, 13, "the same: sound that comes back from its edges"},
    {"hybrid-tubes", verify_hybrid_tubes, 2, 0, 200, 15, "the same: Sod's and Toro's third through it"},
    {"hybrid-blast", verify_hybrid_blast, 2, 0, 120, 20, "the same: a blast, regions by gradients"},
    {"taylor", verify_taylor, 3, 0, 100, 0, "aluminium rods on a rigid wall: their length"},
};

/* file, title, a panel for each problem, which schemes, kernels and precisions, what over */
static const verify_picture pictures[] = {
    {"kernels.png", "kernels: L1 error against the run's CPU time", "sod-rho,gresho",
     "gas|gas+balsara", NULL, "double", false},
    {"neighbours.png", "neighbour numbers: L1 error against the run's CPU time",
     "sod-rho,acoustic-wave,gresho",
     "gas|gas+eta=1|gas+eta=1.5|gas+eta=2|gas+a=0|gas+a=0+eta=1.5|gas+a=0+eta=2|"
     "gas+balsara+eta=1.6|gas+balsara+eta=2|gas+balsara+eta=2.5",
     "cubic|wendland-c4", "double", false},
    {"balsara.png", "Balsara's switch on and off: L1 error against the run's CPU time",
     "sod-rho,noh2,sedov2-rho,gresho,kelvin-helmholtz,square-moved", "gas|gas+balsara", "cubic",
     "double", false},
    {"correction.png", "the gradient's correction on and off: L1 error against the run's CPU time",
     "wave-1d,rotation-2d-field,rotation-2d-momentum", "solid|solid+correction", "cubic", "double",
     false},
    {"precision.png", "float and double: L1 error against the run's CPU time",
     "sod-rho,noh1,gresho,wave-1d,rotation-2d-field", "gas|solid+correction", "cubic", NULL,
     false},
    {"kernel-sums.png", "sums over settled points: L1 error against the number of neighbours",
     "kernel-sum-2d,kernel-force-2d,kernel-divergence-2d,kernel-sum-3d,kernel-force-3d,"
     "kernel-divergence-3d",
     "settled", NULL, "double", true},
    {"waves.png", "elastic waves: error of v after a period against the run's CPU time",
     "wave-1d,wave-2d,wave-2d-shear", NULL, NULL, NULL, false},
    {"piston.png", "piston into porous aluminium: relative errors against the run's CPU time",
     "piston-100-u,piston-100-speed,piston-458-precursor", NULL, NULL, "double", false},
    {"rotation.png", "rotating disc, ten turns: error of the stress, mean change of J",
     "rotation-2d-field,rotation-2d-momentum", NULL, NULL, NULL, false},
};

enum {
    PROBLEMS = sizeof problems / sizeof problems[0],
    PICTURES = sizeof pictures / sizeof pictures[0]
};

static void list(const verify *v) {
    for (int k = 0; k < PROBLEMS; k++)
        if (verify_wanted(v, k))
            printf("%-18s %d-D %5.0f s  %s%s\n", problems[k].name, problems[k].dim,
                   verify_cost(v, k), problems[k].about,
                   problems[k].compare ? " (double and float)" : "");
}

static void draw(const verify *v) {
    for (int k = 0; k < PICTURES; k++) (void)verify_draw_one(v, &pictures[k]);
    solid_draw(v);
    fracture_draw(v);
}

int main(int argc, char **argv) {
    const char *only = "", *out = "build/verify";
    long threads = 0;
    int quick = 0, quiet = 0, show_list = 0, join = 0, no_pictures = 0;
    const example_option options[] = {
        example_flag("quick", &quick, "one and two dimensions, two resolutions: four minutes"),
        example_text("only", "NAME", &only, "only problems whose name has this in it"),
        example_flag("list", &show_list, "the problems and about how long they take; runs nothing"),
        example_count("threads", &threads, 0, 1024, "0: all"),
        example_text("out", "FOLDER", &out, "for verify.csv and the pictures"),
        example_flag("join", &join, "in double: leave the verdict to the float program; in float: "
                                    "go on from verify.csv"),
        example_flag("no-pictures", &no_pictures, "draw nothing"),
        example_flag("quiet", &quiet, "no progress lines"),
    };
    example_parse(argc, argv, "standard problems: error, time and conserved sums (" VERIFY_REAL ")",
                  SPHPA_VERSION, options, (int)(sizeof options / sizeof options[0]));
    static verify v;
    bool is_float = sizeof(sphpa_real) == 4;
    v.problems = problems;
    v.problem_count = PROBLEMS;
    v.quick = quick;
    v.quiet = quiet;
    v.only = only[0] != '\0' ? only : NULL;
    v.out = out;
    if (show_list) {
        list(&v);
        return 0;
    }
    example_folder(out);
    v.max_threads = example_threads(threads);
    v.rows = (verify_row *)calloc(VERIFY_ROWS_MAX, sizeof *v.rows);
    if (v.rows == NULL) example_fail(1, "out of memory");
    if (join && is_float) verify_read(&v);
    int wanted = 0;
    for (int k = 0; k < PROBLEMS; k++)
        wanted += v.only == NULL || strstr(problems[k].name, v.only) != NULL;
    if (wanted == 0)
        example_fail(2, "--only %s: no problem has that in its name; --list shows them", only);
    verify_run_all(&v);
    verify_write(&v);
    if (join && !is_float) return 0; /* its verdicts are in the file */
    if (!no_pictures) draw(&v);
    int failed = verify_count(&v);
    free(v.rows);
    return failed > 0 || v.row_count == 0 ? 1 : 0;
}
