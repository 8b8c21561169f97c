/* sphpa.h: smoothed particle hydrodynamics of impacts into porous bodies, of gases and of solids.
   One header, C11 or C++11, no dependencies but the C library (files: HDF5, if you ask for them).

       #define SPHPA_IMPLEMENTATION   // in one C file, before the include
       #include "sphpa.h"
       #include <stdio.h>

       int main(void) {               // how far does pumice crush at 1000 kg/m3?
           sphpa_crush curve = sphpa_crush_pumice();
           sphpa_palpha_solution s;
           if (sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, sphpa_tillotson_find("pumice"), &curve,
                                  1000.0, 1e4, curve.alpha0, NULL, &s) == SPHPA_OK)
               printf("P = %.4g Pa, alpha = %.6f\n", s.P, s.alpha);
           return 0;
       }

   Build: cc -O2 prog.c -lm (add -fopenmp for threads). A whole simulation: examples/sod.c.

   CONTENTS (search for the tag; once among the declarations, once in the implementation)
   >>base        results and errors, random numbers, symmetric tensors, the clock
   >>kernel      smoothing kernels in 1-D, 2-D and 3-D: B-splines, Wendland functions, Gaussian
   >>eos         equations of state: ideal gas, Murnaghan, Tillotson; the material table
   >>porosity    crush curves; P-alpha by bisection, Newton, safe Newton, crush space; batches
   >>strength    Hooke, Jaumann, von Mises, Drucker-Prager, Lundborg/Collins on one stress state
   >>damage      Weibull flaws, Grady-Kipp growth, compaction damage of one state
   >>riemann     the exact Riemann solver of ideal gases
   -- the material line: above it pure functions of single states, without memory or particles --
   >>tree        octree along a Hilbert curve: neighbours, lists of groups, friends of friends
   >>particles   a structure of arrays made from one table of fields
   >>sph         scenes, modules and passes; the step, its limits, statistics and timings
   >>gas         a gas by density summation with grad-h terms
   >>solid       elastic solids: continuity, tensor momentum, Hooke and Jaumann on particles
   >>pores       P-alpha on particles
   >>plastic     yield on particles
   >>cracks      flaws and damage on particles
   >>setup       lattices, spheres, boxes, bodies
   >>fragments   the mass spectrum of what friends of friends finds
   >>snapshot    HDF5 snapshots and checkpoints

   MACROS (define before the include)
   SPHPA_IMPLEMENTATION            every section but snapshot, in one C file of a program
   SPHPA_<TAG>_IMPLEMENTATION      one section and those it needs, the tag in capitals, such as
                                   SPHPA_POROSITY_IMPLEMENTATION; SNAPSHOT needs HDF5 and is never
                                   implied
   SPHPA_STATIC                    every function static; in the same file as an IMPLEMENTATION
   SPHPA_FLOAT                     particles' state in float (positions, rho, u, alpha stay double)
   SPHPA_MALLOC, _REALLOC, _FREE   the allocator, all three or none; must allow threads
   SPHPA_ASSERT(x)                 cheap checks; default assert
   SPHPA_VALIDATE_ARRAYS           checks of whole arrays as well, for test builds
   SPHPA_USE_OMP_SIMD              use omp simd pragmas without OpenMP (with -fopenmp-simd)
   SPHPA_NO_VECTORS                pair loops without GNU C's vectors, one particle at a time

   CONVENTIONS
   SI units. rho bulk density, u specific internal energy, h smoothing length (support 2h unless the
   kernel says otherwise), P pressure, alpha distention, S bulk deviator, D damage; stresses are
   positive in tension, P in compression. A zeroed struct is "none" or "the default". What can fail
   returns a sphpa_result; outputs are untouched on an error unless the comment says so. Names that
   end in an underscore are private.

   LICENCE see the end of this file. */

/* ================================================================================================
   What was asked for and what that needs, as switches of 0 or 1: the only place where one
   section's switch looks at another's. From the last section up, so that one pass closes the list.
   ============================================================================================== */
#if defined(SPHPA_SNAPSHOT_IMPLEMENTATION)
#define SPHPA_WANT_SNAPSHOT_ 1
#else
#define SPHPA_WANT_SNAPSHOT_ 0
#endif
#if defined(SPHPA_FRAGMENTS_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION)
#define SPHPA_WANT_FRAGMENTS_ 1
#else
#define SPHPA_WANT_FRAGMENTS_ 0
#endif
#if defined(SPHPA_SETUP_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION)
#define SPHPA_WANT_SETUP_ 1
#else
#define SPHPA_WANT_SETUP_ 0
#endif
#if defined(SPHPA_CRACKS_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION)
#define SPHPA_WANT_CRACKS_ 1
#else
#define SPHPA_WANT_CRACKS_ 0
#endif
#if defined(SPHPA_PLASTIC_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION)
#define SPHPA_WANT_PLASTIC_ 1
#else
#define SPHPA_WANT_PLASTIC_ 0
#endif
#if defined(SPHPA_PORES_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION)
#define SPHPA_WANT_PORES_ 1
#else
#define SPHPA_WANT_PORES_ 0
#endif
#if defined(SPHPA_SOLID_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION) || \
    SPHPA_WANT_PORES_ || SPHPA_WANT_PLASTIC_ || SPHPA_WANT_CRACKS_
#define SPHPA_WANT_SOLID_ 1
#else
#define SPHPA_WANT_SOLID_ 0
#endif
#if defined(SPHPA_GAS_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION)
#define SPHPA_WANT_GAS_ 1
#else
#define SPHPA_WANT_GAS_ 0
#endif
#if defined(SPHPA_SPH_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION) || SPHPA_WANT_GAS_ || \
    SPHPA_WANT_SOLID_ || SPHPA_WANT_SNAPSHOT_
#define SPHPA_WANT_SPH_ 1
#else
#define SPHPA_WANT_SPH_ 0
#endif
#if defined(SPHPA_PARTICLES_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION) || \
    SPHPA_WANT_SPH_ || SPHPA_WANT_SETUP_ || SPHPA_WANT_FRAGMENTS_
#define SPHPA_WANT_PARTICLES_ 1
#else
#define SPHPA_WANT_PARTICLES_ 0
#endif
#if defined(SPHPA_TREE_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION) || SPHPA_WANT_SPH_ || \
    SPHPA_WANT_FRAGMENTS_
#define SPHPA_WANT_TREE_ 1
#else
#define SPHPA_WANT_TREE_ 0
#endif
#if defined(SPHPA_RIEMANN_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION)
#define SPHPA_WANT_RIEMANN_ 1
#else
#define SPHPA_WANT_RIEMANN_ 0
#endif
#if defined(SPHPA_DAMAGE_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION) || SPHPA_WANT_CRACKS_
#define SPHPA_WANT_DAMAGE_ 1
#else
#define SPHPA_WANT_DAMAGE_ 0
#endif
#if defined(SPHPA_STRENGTH_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION) || \
    SPHPA_WANT_SOLID_ || SPHPA_WANT_PLASTIC_
#define SPHPA_WANT_STRENGTH_ 1
#else
#define SPHPA_WANT_STRENGTH_ 0
#endif
#if defined(SPHPA_POROSITY_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION) || SPHPA_WANT_PORES_
#define SPHPA_WANT_POROSITY_ 1
#else
#define SPHPA_WANT_POROSITY_ 0
#endif
#if defined(SPHPA_EOS_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION) || \
    SPHPA_WANT_POROSITY_ || SPHPA_WANT_RIEMANN_ || SPHPA_WANT_GAS_ || SPHPA_WANT_SOLID_
#define SPHPA_WANT_EOS_ 1
#else
#define SPHPA_WANT_EOS_ 0
#endif
#if defined(SPHPA_KERNEL_IMPLEMENTATION) || defined(SPHPA_IMPLEMENTATION) || SPHPA_WANT_SPH_
#define SPHPA_WANT_KERNEL_ 1
#else
#define SPHPA_WANT_KERNEL_ 0
#endif
#if defined(SPHPA_BASE_IMPLEMENTATION) || SPHPA_WANT_KERNEL_ || SPHPA_WANT_EOS_ || \
    SPHPA_WANT_STRENGTH_ || SPHPA_WANT_DAMAGE_ || SPHPA_WANT_TREE_ || SPHPA_WANT_PARTICLES_
#define SPHPA_WANT_BASE_ 1
#else
#define SPHPA_WANT_BASE_ 0
#endif

#if defined(SPHPA_STATIC) && !defined(SPHPA_H) && !SPHPA_WANT_BASE_
#error "sphpa: SPHPA_STATIC without an IMPLEMENTATION macro; define one before the first include"
#endif

/* linkage: SPHPA_DEF of each section is SPHPA_LINK_(its switch) */
#define SPHPA_LINK_(wanted) SPHPA_LINK_PASTE_(wanted)
#define SPHPA_LINK_PASTE_(wanted) SPHPA_LINK_##wanted##_
#define SPHPA_LINK_0_ extern
#undef SPHPA_LINK_1_
#ifdef SPHPA_STATIC
#define SPHPA_LINK_1_ static SPHPA_UNUSED_
#else
#define SPHPA_LINK_1_ extern
#endif

#ifndef SPHPA_H
#define SPHPA_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SPHPA_VERSION "0.1.0"

#if defined(SPHPA_FLOAT) && defined(SPHPA_DOUBLE)
#error "sphpa: SPHPA_FLOAT and SPHPA_DOUBLE are both defined; define one, or none for double"
#endif

#if !defined(__cplusplus) && (!defined(__STDC_VERSION__) || __STDC_VERSION__ < 201112L)
#error "sphpa: needs C11 (cc -std=c11) or C++11"
#endif

#ifdef __cplusplus
#define SPHPA_EXTERN_C_BEGIN_ extern "C" {
#define SPHPA_EXTERN_C_END_ }
#else
#define SPHPA_EXTERN_C_BEGIN_
#define SPHPA_EXTERN_C_END_
#endif

#if defined(__GNUC__) || defined(__clang__)
#define SPHPA_UNUSED_ __attribute__((unused))
#define SPHPA_FORCE_INLINE_ static inline __attribute__((unused, always_inline))
#define SPHPA_NO_INLINE_ static __attribute__((unused, noinline))
#define SPHPA_PRINTF_(text, first) __attribute__((__format__(__printf__, text, first)))
#define SPHPA_RESTRICT __restrict__
#else
#define SPHPA_UNUSED_
#define SPHPA_FORCE_INLINE_ static inline
#define SPHPA_NO_INLINE_ static
#define SPHPA_PRINTF_(text, first)
#define SPHPA_RESTRICT
#endif

/* the working precision of particle state; a literal in such code is SPHPA_R(0.5) */
#ifdef SPHPA_FLOAT
typedef float sphpa_real;
#define SPHPA_R(x) ((sphpa_real)(x))
#else
typedef double sphpa_real;
#define SPHPA_R(x) (x)
#endif

/* Float and double builds do not link together: in a float build every function that touches state
   has another name. The material line and the tree are the same in both. */
#ifdef SPHPA_FLOAT
#define sphpa_field_describe sphpa_field_describe_f32
#define sphpa_particles_create sphpa_particles_create_f32
#define sphpa_particles_free sphpa_particles_free_f32
#define sphpa_particles_reserve sphpa_particles_reserve_f32
#define sphpa_particles_add sphpa_particles_add_f32
#define sphpa_particles_append sphpa_particles_append_f32
#define sphpa_particles_permute sphpa_particles_permute_f32
#define sphpa_particles_data sphpa_particles_data_f32
#define sphpa_particles_column sphpa_particles_column_f32
#define sphpa_particles_bytes_each sphpa_particles_bytes_each_f32
#define sphpa_particles_check sphpa_particles_check_f32
#define sphpa_scene_add sphpa_scene_add_f32
#define sphpa_sim_create sphpa_sim_create_f32
#define sphpa_sim_free sphpa_sim_free_f32
#define sphpa_sim_step sphpa_sim_step_f32
#define sphpa_sim_refresh sphpa_sim_refresh_f32
#define sphpa_sim_settle sphpa_sim_settle_f32
#define sphpa_sim_run sphpa_sim_run_f32
#define sphpa_sim_totals sphpa_sim_totals_f32
#define sphpa_sim_report sphpa_sim_report_f32
#define sphpa_gas sphpa_gas_f32
#define sphpa_solid sphpa_solid_f32
#define sphpa_pores sphpa_pores_f32
#define sphpa_plastic sphpa_plastic_f32
#define sphpa_cracks sphpa_cracks_f32
#define sphpa_make_begin sphpa_make_begin_f32
#define sphpa_make_sphere sphpa_make_sphere_f32
#define sphpa_make_box sphpa_make_box_f32
#define sphpa_make_shape sphpa_make_shape_f32
#define sphpa_make_gap sphpa_make_gap_f32
#define sphpa_make_shift sphpa_make_shift_f32
#define sphpa_make_kick sphpa_make_kick_f32
#define sphpa_fragment_find sphpa_fragment_find_f32
#define sphpa_fragment_free sphpa_fragment_free_f32
#define sphpa_fragment_cumulative sphpa_fragment_cumulative_f32
#define sphpa_fragment_largest sphpa_fragment_largest_f32
#define sphpa_snapshot_write sphpa_snapshot_write_f32
#define sphpa_snapshot_read sphpa_snapshot_read_f32
#define sphpa_checkpoint_write sphpa_checkpoint_write_f32
#define sphpa_checkpoint_read sphpa_checkpoint_read_f32
#define sphpa_checkpoint_blob sphpa_checkpoint_blob_f32
#define sphpa_series_write sphpa_series_write_f32
#endif

SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>base   results and errors, random numbers, symmetric tensors, the clock
   ------------------------------------------------------------------------------------------------
   References: O'Neill 2014 (PCG); Steele, Lea & Flood 2014 (OOPSLA; splitmix64); Golub & Van Loan
   1996, section 8.4 (Jacobi).
   Needs: nothing. Read next: >>kernel, >>eos.
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_BASE_)

/* ---- results and errors ---------------------------------------------------------------------- */

/* One list: name, message, what to do. Ordered from harmless to grave: a call that processes many
   states returns the gravest code that it met. */
#define SPHPA_RESULTS(X)                                                                           \
    X(OK, "success", "nothing to do")                                                              \
    X(STOPPED, "the run was asked to stop", "resume it from the checkpoint")                       \
    X(ERROR_NOT_CONVERGED, "the iteration did not converge",                                       \
      "use the default solver (crush space), loosen the tolerance or allow more iterations")       \
    X(ERROR_ALPHA, "alpha_old lies outside [1, alpha0]",                                           \
      "pass the distention of the last accepted state, between 1 and the curve's alpha0")          \
    X(ERROR_NEGATIVE, "a density, energy, mass or length is negative or zero",                     \
      "pass rho > 0, u >= 0, m > 0 and h > 0 in SI units")                                         \
    X(ERROR_NOT_FINITE, "a value is NaN or infinite", "check where the value comes from")          \
    X(ERROR_CURVE, "the crush curve is not a falling curve from alpha0 to 1",                      \
      "need 0 <= Pe < Ps, Pe <= Pt <= Ps and 1 <= alpha_t <= alpha_e <= alpha0")                   \
    X(ERROR_MATERIAL, "a material's parameters make no sense",                                     \
      "need rho0 > 0, A > 0, E0 > 0 and u_cv > u_iv >= 0")                                         \
    X(ERROR_RANGE, "an argument is out of its range", "see the function's comment for the range")  \
    X(ERROR_UNKNOWN, "no such name", "see the list of names in the message or in --help")          \
    X(ERROR_PARSE, "the text could not be read", "correct the line or the option named")           \
    X(ERROR_EMPTY, "there are no particles", "add at least one particle before this call")         \
    X(ERROR_COINCIDENT, "two particles lie on one point",                                          \
      "move or remove one of them, or check that bodies do not overlap")                           \
    X(ERROR_OUTSIDE, "a particle lies outside the periodic box",                                   \
      "move it into the box or make the box larger")                                               \
    X(ERROR_MISSING, "something this call needs was not set up",                                   \
      "add the module, the field or the option that the message names")                            \
    X(ERROR_FILE, "a file could not be opened, read or written",                                   \
      "check the path, the permissions and the free space")                                        \
    X(ERROR_FORMAT, "the file is truncated or not of the expected kind",                           \
      "give a file that this program wrote")                                                       \
    X(ERROR_STATE, "the state of the simulation went bad",                                         \
      "resume from the last checkpoint with a smaller time step")                                  \
    X(ERROR_MEMORY, "out of memory", "use fewer particles or free some memory")

#define SPHPA_RESULT_ENUM_(name, message, hint) SPHPA_##name,
typedef enum sphpa_result { SPHPA_RESULTS(SPHPA_RESULT_ENUM_) SPHPA_RESULT_COUNT } sphpa_result;
#undef SPHPA_RESULT_ENUM_

/* What went wrong, in words, with the value and the cure. Every function that takes one accepts
   NULL. The text is set only on failure. */
typedef struct sphpa_error {
    char message[512];   /* one or two lines, no newline at the end */
    sphpa_result result; /* the code that the function returned */
} sphpa_error;

/* "out of memory", ... and what to do about it; never NULL, also for codes that do not exist. */
SPHPA_DEF const char *sphpa_result_message(sphpa_result result);
SPHPA_DEF const char *sphpa_result_hint(sphpa_result result);

/* Writes the message (printf style) into *err unless err is NULL; returns result. */
SPHPA_DEF sphpa_result sphpa_error_set(sphpa_error *err, sphpa_result result, const char *format,
                                       ...) SPHPA_PRINTF_(3, 4);

/* ---- random numbers ---------------------------------------------------------------------------*/

/* PCG-XSH-RR 64/32 (O'Neill 2014): the only source of randomness in the toolkit. Seed and stream
   may be any numbers, such as 1, 2, 3: they are mixed (splitmix64, Steele, Lea & Flood 2014), so
   that streams that differ in one bit are as independent as any. */
typedef struct sphpa_rng {
    uint64_t state; /* advances by one multiplication a draw */
    uint64_t inc;   /* selects the stream; odd */
} sphpa_rng;

SPHPA_DEF sphpa_rng sphpa_rng_seed(uint64_t seed, uint64_t stream); /* the same, the same draws */
SPHPA_DEF uint32_t sphpa_rng_u32(sphpa_rng *rng);                   /* all 2^32 values */
SPHPA_DEF uint32_t sphpa_rng_below(sphpa_rng *rng, uint32_t bound); /* unbiased, in [0, bound) */
SPHPA_DEF double sphpa_rng_uniform(sphpa_rng *rng);                 /* in [0, 1), 53 bits */
SPHPA_DEF double sphpa_rng_normal(sphpa_rng *rng);                  /* mean 0, variance 1 */

/* ---- tensors --------------------------------------------------------------------------------- */

/* A symmetric 3x3 tensor; the order of the components is that of the files. */
typedef struct sphpa_sym3 {
    double xx, yy, zz, xy, yz, xz;
} sphpa_sym3;

/* Eigenvalues, largest first, and unit eigenvectors: vectors[k] belongs to values[k] and the three
   are right-handed; vectors may be NULL. Cyclic Jacobi: error a few eps |S| in every value, also
   where eigenvalues coincide. */
SPHPA_DEF void sphpa_sym3_eigen(const sphpa_sym3 *S, double values[3], double vectors[3][3]);

/* ---- time ------------------------------------------------------------------------------------ */
SPHPA_DEF double sphpa_wall_clock(void); /* [s] since some moment; only differences mean anything */

/* ================================================================================================
   >>kernel   smoothing kernels in 1-D, 2-D and 3-D: B-splines, Wendland functions, Gaussian
   ------------------------------------------------------------------------------------------------
   With q = r/h, d the dimension and s the normalisation, integral of W over space = 1 [m^-d]:
     (1) W(r, h)  = f(q)/h^d,            f(q) = s w(q)
     (2) dW/dr    = f'(q)/h^(d+1),       d2W/dr2 = f''(q)/h^(d+2)
     (3) dW/dh    = -(d f(q) + q f'(q))/h^(d+1), equation (1) differentiated
   x+ = max(0, x); the supports are in units of h:
     kernel     support  w(q)                                            s in 1-D, 2-D, 3-D
     cubic         2     (2-q)+^3/4 - (1-q)+^3                   2/3    10/(7 pi)     1/pi
     quartic      5/2    (5/2-q)+^4 - 5(3/2-q)+^4 + 10(1/2-q)+^4 1/24   96/(1199 pi)  1/(20 pi)
     quintic       3     (3-q)+^5 - 6(2-q)+^5 + 15(1-q)+^5       1/120  7/(478 pi)    1/(120 pi)
     wendland-c2   2     (1-q/2)+^4 (1 + 2q)                            7/(4 pi)      21/(16 pi)
     wendland-c4   2     (1-q/2)+^6 (1 + 3q + 35/12 q^2)                9/(4 pi)     495/(256 pi)
     wendland-c6   2     (1-q/2)+^8 (1 + 4q + 25/4 q^2 + 4q^3)         39/(14 pi)   1365/(512 pi)
     in 1-D: c2    2     (1-q/2)+^3 (1 + 3/2 q)                  5/8
             c4    2     (1-q/2)+^5 (1 + 5/2 q + 2 q^2)          3/4
             c6    2     (1-q/2)+^7 (1 + 7/2 q + 19/4 q^2 + 21/8 q^3)  55/64
     gaussian      3     exp(-q^2), 0 from q = 3 on              pi^(-d/2)
   The cut Gaussian is not normalised again, so (1) and (3) stay exact inside the support: its
   integral falls short of 1 by 2.2e-5, 1.2e-4, 4.4e-4 in 1-D, 2-D, 3-D.
   References: Schoenberg 1946; Monaghan and Lattanzio 1985 (cubic); Price 2012
   (splines); Wendland 1995; Dehnen and Aly 2012, table 1 (Wendland; there H = 2h is the unit).
   Needs: base. Read next: >>sph (the sums over neighbours that use it).
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_KERNEL_)

typedef enum sphpa_kernel {
    SPHPA_KERNEL_CUBIC = 0,
    SPHPA_KERNEL_QUARTIC,
    SPHPA_KERNEL_QUINTIC,
    SPHPA_KERNEL_WENDLAND_C2,
    SPHPA_KERNEL_WENDLAND_C4,
    SPHPA_KERNEL_WENDLAND_C6,
    SPHPA_KERNEL_GAUSSIAN,
    SPHPA_KERNEL_COUNT
} sphpa_kernel;

/* One value at distance r >= 0 [m] for smoothing length h > 0 [m] in dim = 1, 2 or 3 dimensions;
   0 where r >= support*h. Equations (1) to (3). NaN for an unknown kernel, another dim, r < 0 or
   NaN, and h <= 0, infinite or NaN. */
SPHPA_DEF double sphpa_kernel_w(sphpa_kernel k, int dim, double r, double h);     /* [m^-d] */
SPHPA_DEF double sphpa_kernel_dw(sphpa_kernel k, int dim, double r, double h);    /* dW/dr, <= 0 */
SPHPA_DEF double sphpa_kernel_d2w(sphpa_kernel k, int dim, double r, double h);   /* d2W/dr2 */
SPHPA_DEF double sphpa_kernel_dw_dh(sphpa_kernel k, int dim, double r, double h); /* dW/dh at r */

/* The radius of the support in units of h: 2, 2.5 or 3; NaN for an unknown kernel. */
SPHPA_DEF double sphpa_kernel_support(sphpa_kernel k);

/* "cubic", "quartic", "quintic", "wendland-c2", "wendland-c4", "wendland-c6", "gaussian"; for
   anything else "unknown", never NULL. */
SPHPA_DEF const char *sphpa_kernel_name(sphpa_kernel k);

/* The kernel of that name, in the spelling above. SPHPA_ERROR_UNKNOWN (also for NULL) with a
   message that lists the names; *out then stays as it was. */
SPHPA_DEF sphpa_result sphpa_kernel_find(const char *name, sphpa_kernel *out, sphpa_error *err);

/* The hot loop's call: f[i] = f(q[i]) and df[i] = f'(q[i]) of equations (1) and (2), for n values
   0 <= q = r/h < 1e50, so that W = f/h^dim and dW/dr = df/h^(dim+1). f or df may be NULL. 0 from
   the support on; a NaN in q gives NaN; an unknown kernel or dim fills both with NaN. The arrays
   must not overlap. Without branches or calls in the loops (but for the Gaussian's exp), so they
   vectorise. The scalar functions evaluate the same expressions. */
SPHPA_DEF void sphpa_kernel_shape_batch(sphpa_kernel k, int dim, size_t n,
                                        const double *SPHPA_RESTRICT q, double *SPHPA_RESTRICT f,
                                        double *SPHPA_RESTRICT df);

/* ================================================================================================
   >>eos   equations of state: Tillotson, Murnaghan, ideal gas; the material table
   ------------------------------------------------------------------------------------------------
   rho [kg/m3] density of the material without pores, u [J/kg] specific internal energy, P [Pa].
   Tillotson: eta = rho/rho0, mu = eta - 1, z = 1/eta - 1, w = 1 + u/(E0 eta^2);
     compressed, eta >= 1, or cold, u <= u_iv:                  P = Pc                         (1)
       Pc = (a + b/w) rho u + A mu + B mu^2                                                    (2)
     vapour, eta < 1 and u >= u_cv:                             P = Pe
       Pe = a rho u + [b rho u/w + A mu exp(-beta z)] exp(-alpha z^2)                          (3)
     hybrid, eta < 1 and u_iv < u < u_cv:
       P = ((u - u_iv) Pe + (u_cv - u) Pc)/(u_cv - u_iv)                                       (4)
   Derivatives, at constant u and at constant rho, with X the bracket of (3), Ea = exp(-alpha z^2),
   z' = dz/drho = -rho0/rho^2:
     dPc/drho = a u + b u (3w - 2)/w^2 + (A + 2 B mu)/rho0,     dPc/du = a rho + b rho/w^2     (5)
     dPe/drho = a u + Ea [b u (3w - 2)/w^2 + A exp(-beta z)(1/rho0 - beta mu z')
                          - 2 alpha z z' X],                    dPe/du = a rho + Ea b rho/w^2  (6)
     hybrid: both are the blend (4) of (5) and (6); dP/du has + (Pe - Pc)/(u_cv - u_iv) besides (7)
   Sound speed, in every regime (blending those of Pe and Pc instead is wrong in the hybrid one):
     c^2 = dP/drho + (P/rho^2) dP/du, at least c2_floor A/rho0                                 (8)
   P is continuous everywhere, dP/drho too: at eta = 1 both Pe and Pc are (a + b/w) rho u and have
   one slope. dP/du jumps by (Pe - Pc)/(u_cv - u_iv) at u_iv and u_cv. Where zero_B_expanded is on,
   B = 0 in (2) and (5) for eta < 1: still as smooth, as B enters with mu^2.
   Cut-offs, where P < 0 only (a cut-off of P > 0 at low eta would destroy porous shocks):
     P >= -tensile_limit; P >= 0 where eta < eta_cut                                           (9)
   Where one acts, P is a constant and both derivatives are 0; c stays that of (8) without the
   cut-off, so that a torn material does not lengthen the time step at the moment it tears.
   Murnaghan: P = K/n ((rho/rho0)^n - 1), c^2 = dP/drho = K/rho0 (rho/rho0)^(n-1), floored   (10)
   Ideal gas: P = (gamma - 1) rho u, c^2 = gamma (gamma - 1) u                               (11)
   References: Tillotson 1962 (General Atomic GA-3216); Benz & Asphaug 1999 (Icarus 142: flaws of
   basalt and ice); Jutzi, Michel, Hiraoka, Nakamura & Benz 2009 (Icarus 201: pumice); Saito et al.
   2008 (B = 0 in expansion); Murnaghan 1944 (PNAS 30).
   Needs: base. Read next: >>porosity (the same equations behind a crush curve).
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_EOS_)

/* What an equation of state returns at one (rho, u). */
typedef struct sphpa_eos_point {
    double P;       /* [Pa] pressure */
    double dP_drho; /* [m2/s2] at constant u */
    double dP_du;   /* [kg/m3] at constant rho */
    double c;       /* [m/s] adiabatic sound speed, floored as the material says */
} sphpa_eos_point;

/* Any equation of state: a function and its parameters. */
typedef sphpa_result (*sphpa_eos_eval)(const void *material, double rho, double u,
                                       sphpa_eos_point *out);
typedef struct sphpa_eos {
    const void *material; /* handed to eval unchanged */
    sphpa_eos_eval eval;  /* never NULL in a usable sphpa_eos */
    double rho0;          /* [kg/m3] reference density; 0 for a gas */
    double K;             /* [Pa] bulk modulus at (rho0, 0); 0 for a gas */
} sphpa_eos;

/* Tillotson 1962, eqs. (1) to (9). Options at 0 are the plain published form with a floor under
   c^2. A zeroed struct is no material: sphpa_tillotson_eval refuses it. */
typedef struct sphpa_tillotson {
    double rho0;          /* [kg/m3] reference density */
    double A, B;          /* [Pa] bulk modulus and its quadratic companion, eq. (2) */
    double E0;            /* [J/kg] energy scale of w */
    double u_iv, u_cv;    /* [J/kg] incipient and complete vaporisation */
    double a, b;          /* [1] a: gamma - 1 of the thin vapour; a + b: that of the cold solid */
    double alpha, beta;   /* [1] decay of the vapour's cold terms (not the distention) */
    double c2_floor;      /* [1] floor of c^2 as a share of A/rho0; 0 means 0.01 */
    double tensile_limit; /* [Pa] P >= -tensile_limit; 0 means no limit */
    double eta_cut;       /* [1] P = max(P, 0) where rho/rho0 < eta_cut; 0 means no cut-off */
    int zero_B_expanded;  /* not 0: B = 0 where rho < rho0 (Saito 2008); needed where B > A */
} sphpa_tillotson;

typedef struct sphpa_ideal {
    double gamma; /* [1] ratio of specific heats, > 1 */
} sphpa_ideal;

typedef struct sphpa_murnaghan {
    double rho0;     /* [kg/m3] reference density */
    double K;        /* [Pa] bulk modulus at rho0 */
    double n;        /* [1] its derivative dK/dP, > 0 */
    double c2_floor; /* [1] floor of c^2 as a share of K/rho0; 0 means 0.01 */
} sphpa_murnaghan;

/* Pressure, exact derivatives and sound speed at rho > 0 [kg/m3], u >= 0 [J/kg]; eqs. (11), (10),
   and (1) to (9). *out is untouched on an error: ERROR_NEGATIVE (rho <= 0 or u < 0),
   ERROR_NOT_FINITE (rho or u is NaN or infinite), ERROR_MATERIAL (parameters; sphpa_tillotson_check
   says which), ERROR_MISSING (a NULL pointer), ERROR_RANGE (a result overflows: never for the
   table's materials with rho in [1e-10, 1e6] and u <= 1e14). */
SPHPA_DEF sphpa_result sphpa_ideal_eval(const sphpa_ideal *gas, double rho, double u,
                                        sphpa_eos_point *out);
SPHPA_DEF sphpa_result sphpa_murnaghan_eval(const sphpa_murnaghan *mat, double rho, double u,
                                            sphpa_eos_point *out);
SPHPA_DEF sphpa_result sphpa_tillotson_eval(const sphpa_tillotson *mat, double rho, double u,
                                            sphpa_eos_point *out);

/* OK, or ERROR_MATERIAL with the field, its value and its range in *err (which may be NULL). */
SPHPA_DEF sphpa_result sphpa_tillotson_check(const sphpa_tillotson *mat, sphpa_error *err);

/* The same behind one type; the struct that is passed must outlive the result. */
SPHPA_DEF sphpa_eos sphpa_ideal_eos(const sphpa_ideal *gas);
SPHPA_DEF sphpa_eos sphpa_murnaghan_eos(const sphpa_murnaghan *mat);
SPHPA_DEF sphpa_eos sphpa_tillotson_eos(const sphpa_tillotson *mat);

/* A row of the material table: the equation of state and the strength of the matrix (the solid
   between the pores). 0 in a strength column means unknown, unless the field says otherwise. */
typedef struct sphpa_material {
    char name[32];       /* "basalt", ... */
    sphpa_tillotson eos; /* of the matrix */
    double G;            /* [Pa] shear modulus */
    double Y;            /* [Pa] yield strength (von Mises) */
    double u_melt;       /* [J/kg] energy at which Y vanishes; 0: no softening */
    double weibull_k;    /* [m^-3] flaws weaker than strain eps: k eps^m in a cubic metre */
    double weibull_m;    /* [1] */
} sphpa_material;

/* The table: basalt, pumice (its matrix), nylon, granite, iron, aluminium, ice, water. Rows are
   constants; copy one to change it. */
SPHPA_DEF size_t sphpa_material_count(void);
SPHPA_DEF const sphpa_material *sphpa_material_at(size_t index);         /* NULL past the end */
SPHPA_DEF const sphpa_material *sphpa_material_find(const char *name);   /* NULL if unknown */
SPHPA_DEF const sphpa_tillotson *sphpa_tillotson_find(const char *name); /* NULL if unknown */

/* Reads a material from a text file of `key = value` lines; # starts a comment. The keys are the
   names of the fields above (name, rho0, A, B, E0, u_iv, u_cv, a, b, alpha, beta, c2_floor,
   tensile_limit, eta_cut, zero_B_expanded, G, Y, u_melt, weibull_k, weibull_m), in SI units, with a
   decimal point whatever the locale; alpha and beta are Tillotson's, for a material has no
   distention: that comes with the crush curve. `like = basalt`, on any line, takes what the file
   leaves out from a row of the table; without it name and the ten parameters rho0 to beta are
   required.
   *out is untouched on an error; *err (may be NULL) gets file, line, value and cure: ERROR_FILE
   (cannot be read), ERROR_PARSE (no such line, number or name, or a key twice), ERROR_UNKNOWN (key
   or material), ERROR_MISSING (required keys), ERROR_MATERIAL (parameters that make no sense). */
SPHPA_DEF sphpa_result sphpa_material_read(const char *path, sphpa_material *out,
                                           sphpa_error *err);

/* ================================================================================================
   >>porosity   the P-alpha model: crush curves, four solvers of the implicit step, exact shocks
   ------------------------------------------------------------------------------------------------
   alpha = rho_s/rho >= 1   [1] distention: density of the matrix over density of the bulk
   phi   = 1 - 1/alpha      [1] porosity
   (1) P(rho, u, alpha) = Peos(alpha rho, u)/alpha            [Pa] pressure of the bulk
   (2) quadratic curve, Pe < P < Ps, t = (Ps - P)/(Ps - Pe):
         alpha = 1 + (alpha0 - 1) t^2;   alpha0 below Pe, 1 above Ps
   (3) two exponents, q = (Pt - P)/(Pt - Pe), the first term only below Pt:
         alpha = 1 + (alpha_e - alpha_t) q^n1 + (alpha_t - 1) t^n2
   (4) the step: the largest alpha with F = alpha - min(curve(P(rho, u, alpha)), alpha_old) = 0
         F' = 1 - curve'(P) (rho dPeos/drho_s - P)/alpha
       F(1) <= 0 <= F(alpha_old): a bracket always exists. Pores close and never open.
   (5) elastic branch: FLAT alpha = const below the curve, or HERRMANN, reversible:
         dalpha/dP = (alpha^2/K0)(1 - 1/hh^2), hh = 1 + (alpha-1)(c_e-c_s)/(c_s(alpha0-1)),
         K0 = rho0 c_s^2, started from (P, alpha) = (0, alpha0) and, after crushing down to the
         point (Py, alpha_y) of the curve, from that point: unloading and reloading follow one line,
         which ends on the curve where it left it (Herrmann 1969). In tension the line stops at
         P = 0: pores do not open further. Since (5) does not hold P, the line is a quadrature,
         P = Py + Phi(alpha) - Phi(alpha_y), in closed form.
   (6) crushing wave, c^2 = (alpha dPeos/drho_s + dPeos/du P/rho^2)
                            / (alpha + alpha' (P - rho dPeos/drho_s)),  alpha' = dalpha/dP
   (7) evolution form, dalpha/dt = (du/dt dPeos/du + alpha drho/dt dPeos/drho_s) alpha'
                            / (alpha + alpha' (P - rho dPeos/drho_s))
   References: Herrmann 1969 (J. Appl. Phys. 40, 2490); Carroll & Holt 1972 (J. Appl. Phys. 43,
   1626); Jutzi, Benz & Michel 2008 (Icarus 198, 242), (2)-(7) and the porous aluminium;
   Jutzi, Michel, Hiraoka, Nakamura & Benz 2009 (Icarus 201, 802), the pumice.
   Needs: base, eos. Read next: >>strength, >>damage, then >>pores (the same on particles).
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_POROSITY_)

/* ---- crush curves ---------------------------------------------------------------------------- */

typedef enum sphpa_crush_kind {
    SPHPA_CRUSH_QUADRATIC = 0, /* eq. 2 */
    SPHPA_CRUSH_TWO_EXPONENT,  /* eq. 3 */
    SPHPA_CRUSH_USER           /* a function of yours between Pe and Ps */
} sphpa_crush_kind;

typedef enum sphpa_crush_elastic {
    SPHPA_CRUSH_FLAT = 0, /* alpha does not move below the curve */
    SPHPA_CRUSH_HERRMANN  /* eq. 5; call sphpa_crush_prepare before the first solve */
} sphpa_crush_elastic;

/* alpha at a pressure P in [Pe, Ps]: never rising, from alpha0 at Pe to 1 at Ps; *dalpha_dP [1/Pa]
   (never NULL) is its derivative. */
typedef double (*sphpa_crush_function)(const void *user, double P, double *dalpha_dP);

/* A crush curve. Fill it with a maker below, or by hand from zero; alpha0 = 1 is a dense material,
   whose other fields are not looked at. */
typedef struct sphpa_crush {
    double alpha0;  /* [1] distention at rest, >= 1 */
    double Pe;      /* [Pa] pores begin to close */
    double Pt;      /* [Pa] TWO_EXPONENT: the first term ends, Pe <= Pt <= Ps */
    double Ps;      /* [Pa] pores are closed */
    double alpha_e; /* [1] TWO_EXPONENT: the fit's distention at Pe; 0 means alpha0 */
    double alpha_t; /* [1] TWO_EXPONENT: distention the second term starts from */
    double n1, n2;  /* [1] TWO_EXPONENT: exponents, >= 1 */
    double c_e;     /* [m/s] HERRMANN: bulk sound speed at alpha0; 0: unknown, c_s/2 is taken */
    sphpa_crush_kind kind;
    sphpa_crush_elastic elastic;
    int rescale; /* not 0: alpha_e < alpha0 is allowed, both terms grow by (alpha0-1)/(alpha_e-1) */
    sphpa_crush_function function; /* USER: the curve */
    const void *user;              /* USER: handed to it unchanged */
    double c_s;     /* [m/s] HERRMANN: matrix sound speed; written by sphpa_crush_prepare */
    double K0;      /* [Pa] HERRMANN: rho0 c_s^2; written by sphpa_crush_prepare */
    double alpha_y; /* [1] HERRMANN: alpha(Pe) on eq. 5; written by sphpa_crush_prepare */
} sphpa_crush;

SPHPA_DEF sphpa_crush sphpa_crush_quadratic(double alpha0, double Pe, double Ps);
/* "fitted for porous pumice": two exponents, alpha0 4.64 (with rho0 2327: bulk 501.5 kg/m3) */
SPHPA_DEF sphpa_crush sphpa_crush_pumice(void);
/* Jutzi et al. 2008, section 5.1: alpha0 1.275, quadratic, c_e 4110 m/s (set elastic yourself) */
SPHPA_DEF sphpa_crush sphpa_crush_porous_aluminium(void);

/* Is this a falling curve from alpha0 to 1? SPHPA_ERROR_CURVE or _NOT_FINITE with the values. A
   USER function is looked at in its two ends only. */
SPHPA_DEF sphpa_result sphpa_crush_check(const sphpa_crush *curve, sphpa_error *err);

/* HERRMANN: writes c_s, K0 and alpha_y from the matrix (rho0 [kg/m3], c_s [m/s] = sqrt(A/rho0)).
   FLAT: only checks. On an error the curve is left as it was. */
SPHPA_DEF sphpa_result sphpa_crush_prepare(sphpa_crush *curve, double rho0, double c_s,
                                           sphpa_error *err);

/* alpha of virgin material loaded to P, its elastic branch included; dalpha_dP [1/Pa] may be NULL.
   At a kink the derivative is that of the crushing side. NaN for a curve that fails its check. */
SPHPA_DEF double sphpa_crush_alpha(const sphpa_crush *curve, double P, double *dalpha_dP);

/* The pressure [Pa] at which material that was crushed to alpha begins to crush again: the inverse
   of the curve; Pe where alpha is that of virgin material, Ps (or Pt if alpha_t = 1) at alpha 1. */
SPHPA_DEF double sphpa_crush_yield(const sphpa_crush *curve, double alpha);

/* The distention at P = 0 of material crushed to alpha_old: the top of a step's bracket. FLAT:
   alpha_old; HERRMANN: the foot of the elastic line. */
SPHPA_DEF double sphpa_crush_rest(const sphpa_crush *curve, double alpha_old);

/* ---- the implicit step ----------------------------------------------------------------------- */

typedef enum sphpa_palpha_solver {
    SPHPA_PALPHA_CRUSH_SPACE = 0, /* linearised matrix meets the exact curve; the fast one */
    SPHPA_PALPHA_BISECTION,       /* halves [1, alpha_old] */
    SPHPA_PALPHA_NEWTON,          /* plain; cycles for ever next to Pe: for teaching */
    SPHPA_PALPHA_SAFE_NEWTON,     /* Newton inside a bracket, bisection where it leaves it */
    SPHPA_PALPHA_SOLVER_COUNT
} sphpa_palpha_solver;

/* "crush-space", "bisection", "newton", "safe-newton"; NULL past the end */
SPHPA_DEF const char *sphpa_palpha_solver_name(sphpa_palpha_solver solver);

typedef struct sphpa_palpha_options {
    double tol;         /* [1] on alpha; 0 means 1e-12 (above 1e-7 damage rings) */
    int max_iterations; /* NEWTON and SAFE_NEWTON; 0 means 100. The others are bounded anyway */
} sphpa_palpha_options;

typedef struct sphpa_palpha_solution {
    double alpha;    /* [1] */
    double P;        /* [Pa] of the bulk, eq. 1 */
    double c;        /* [m/s] for the time step: the matrix's adiabatic speed, floored, no shear;
                        with the default tol to 1e-7 */
    double residual; /* [1] F(alpha), eq. 4 */
    int evaluations; /* of the equation of state, every one */
    int iterations;  /* of the solver's loop */
    int fell_back;   /* not 0: the fast method gave up and bisection finished */
} sphpa_palpha_solution;

/* Totals of a batch, and arrays of n of the caller's, each NULL if unwanted. */
typedef struct sphpa_palpha_stats {
    size_t failed;         /* states whose status is not SPHPA_OK */
    size_t first_failed;   /* index of the first of them; n if none failed */
    size_t evaluations;    /* of the equation of state, all states together */
    size_t fell_back;      /* states finished by bisection */
    int evaluations_max;   /* the most that one state took */
    double *c;             /* [m/s] in: array of n or NULL */
    double *residual;      /* [1] in: array of n or NULL */
    unsigned char *status; /* sphpa_result of each state; in: array of n or NULL */
} sphpa_palpha_stats;

/* Solves eq. 4 for one state: rho [kg/m3] of the bulk > 0, u [J/kg] >= 0, alpha_old in [1, alpha0]
   (4 ulp outside are clamped). FLAT: alpha <= alpha_old. HERRMANN: alpha_old is the least alpha
   that was reached, alpha may come back above it; commit min(alpha_old, alpha) with either.
   All evaluate alpha_old first, the others alpha = 1 next. CRUSH_SPACE then steps along the curve,
   not along alpha: the matrix is made a parabola in alpha (with its exact second derivative), and
   where that meets the curve is the next place to evaluate: third order, without a kink. It stops
   when what the last two steps left over shows that a further one would move alpha by less than tol:
   after two or three evaluations as a rule, 40 at most (120 without a second derivative, or on a
   caller's curve). Where several roots exist it returns the largest: where P may fall with alpha (of
   the table's materials in hot, expanded ice, or with B kept above A) it looks through places so
   dense that the polynomials through values and two derivatives tell where P is above the curve's;
   the others may meet any root.
   Errors: _MISSING (NULL, unprepared HERRMANN), _CURVE, _MATERIAL, _RANGE (tol, solver),
   _NEGATIVE, _NOT_FINITE, _ALPHA: *out untouched. _NOT_CONVERGED: *out holds the best value. */
SPHPA_DEF sphpa_result sphpa_palpha_solve(sphpa_palpha_solver solver, const sphpa_tillotson *mat,
                                          const sphpa_crush *curve, double rho, double u,
                                          double alpha_old, const sphpa_palpha_options *opt,
                                          sphpa_palpha_solution *out);

/* The same with any equation of state; errors of its eval are passed on. */
SPHPA_DEF sphpa_result sphpa_palpha_solve_eos(sphpa_palpha_solver solver, const sphpa_eos *eos,
                                              const sphpa_crush *curve, double rho, double u,
                                              double alpha_old, const sphpa_palpha_options *opt,
                                              sphpa_palpha_solution *out);

/* n states; rho, u, alpha_old, alpha, P are arrays of n; alpha may be alpha_old itself (FLAT). What
   sphpa_palpha_solve gives: to the tolerance for CRUSH_SPACE, which solves states side by side in
   SIMD (FLAT curves, quadratic or of whole exponents up to 18; where the compiler has -O3
   -fno-math-errno -fno-trapping-math), or what a rounding makes of an ill state; bit for bit for the
   others. A state's answer does not depend on those beside it, nor on the
   number of threads (OpenMP: for 4096 states or more). Every state is processed; the result is the
   gravest of them. A failed state's alpha and P stay untouched unless it is _NOT_CONVERGED. stats
   may be NULL. An error of the curve, material or options is returned before any state is touched. */
SPHPA_DEF sphpa_result sphpa_palpha_solve_batch(sphpa_palpha_solver solver,
                                                const sphpa_tillotson *mat,
                                                const sphpa_crush *curve, size_t n,
                                                const double *rho, const double *u,
                                                const double *alpha_old,
                                                const sphpa_palpha_options *opt, double *alpha,
                                                double *P, sphpa_palpha_stats *stats);

/* ---- around the step ------------------------------------------------------------------------- */

/* The speed [m/s] of a crushing wave at a state on the curve (eq. 6); elastic waves are faster. */
SPHPA_DEF sphpa_result sphpa_palpha_loading_c(const sphpa_tillotson *mat, const sphpa_crush *curve,
                                              double rho, double u, double alpha, double *c);

/* dalpha/dt [1/s] of eq. 7, which other codes integrate and which drifts off the curve: for
   comparison. drho_dt [kg/m3/s], du_dt [W/kg]. 0 below the curve and on unloading. */
SPHPA_DEF sphpa_result sphpa_palpha_rate(const sphpa_tillotson *mat, const sphpa_crush *curve,
                                         double rho, double u, double alpha, double drho_dt,
                                         double du_dt, double *dalpha_dt);

/* dalpha/drho [m3/kg] along the adiabatic loading path, du = P/rho^2 drho; 0 below the curve. */
SPHPA_DEF sphpa_result sphpa_palpha_dalpha_drho(const sphpa_tillotson *mat,
                                                const sphpa_crush *curve, double rho, double u,
                                                double alpha, double *dalpha_drho);

/* The share f in [0, 1] of the bulk's strain that the matrix feels in a step from (rho_0, alpha_0)
   to (rho_1, alpha_1): f = ln(rho_s1/rho_s0)/ln(rho_1/rho_0); 1 on unloading, where nothing moves
   and where alpha_1 = 1 = alpha_0. Jutzi et al. 2008: 1 + dalpha/drho rho/alpha. */
SPHPA_DEF double sphpa_palpha_strain_share(double rho_0, double alpha_0, double rho_1,
                                           double alpha_1);

/* What a piston drives into porous material at rest with P = 0: an elastic precursor and, behind
   it, the crushing shock. Laboratory frame; the state ahead is (rho0/alpha0, 0, 0). */
typedef struct sphpa_palpha_shock {
    double precursor_speed; /* [m/s] of the elastic wave; 0 if there is none */
    double precursor_v;     /* [m/s] particle speed behind it */
    double precursor_P;     /* [Pa] */
    double precursor_rho;   /* [kg/m3] bulk */
    double precursor_u;     /* [J/kg] */
    double precursor_alpha; /* [1] */
    double speed;           /* [m/s] of the main shock; 0 if the piston is too slow to crush */
    double v;               /* [m/s] particle speed behind the last wave: the piston's */
    double P;               /* [Pa] there */
    double rho;             /* [kg/m3] there, bulk */
    double u;               /* [J/kg] there */
    double alpha;           /* [1] there */
    int waves;              /* 2: precursor and shock; 1: one of them only */
} sphpa_palpha_shock;

/* Exact from the jump conditions and eq. 4 (solved from the elastic state). piston_speed [m/s] > 0.
   A shock that outruns the precursor swallows it: then it runs into the material at rest. */
SPHPA_DEF sphpa_result sphpa_palpha_hugoniot(const sphpa_tillotson *mat, const sphpa_crush *curve,
                                             double piston_speed, sphpa_palpha_shock *out);

/* ================================================================================================
   >>strength   elastic stress and yield of one stress state
   ------------------------------------------------------------------------------------------------
   S [Pa] is the deviator of the bulk (porous) material, tension positive; L = grad v [1/s] is row
   major, L[3a+b] = dv_a/dx_b; alpha = rho_s/rho is the distention, f in [0,1] the share of the
   strain rate that the matrix feels, G [Pa] the matrix's shear modulus, P [Pa] the matrix's
   pressure, compression positive. The last term of (1) is S *= alpha_old/alpha, the caller's.
     (1) dS/dt = 2 G (f/alpha) (e - tr(e)/3 I) + (W S - S W) - (S/alpha) dalpha/dt
         e = (L + L^T)/2, W = (L - L^T)/2
     (2) Hooke:   S += 2 G (f/alpha) dt (e - tr(e)/3 I)
     (3) Jaumann: S <- Q S Q^T, Q = (I - W dt/2)^-1 (I + W dt/2): a rotation about the axis of W
         by 2 atan(|w| dt/2), w the axial vector: second order in dt, |S| exact
     (4) J2 = S:S/2
   Yield strength Y(P, u, D) of the matrix; where the bulk deviator exceeds Y/alpha it is scaled
   back radially:
     (5) von Mises       sqrt(3 J2) <= Y/alpha, Y = Y0
     (6) Drucker-Prager  sqrt(J2)   <= Y/alpha, Y = max(0, k_c + 3 a_phi P)
         matched in triaxial compression: a_phi = 2 sin(phi)/(sqrt3 (3 - sin phi)),
                                          k_c = 6 c cos(phi)/(sqrt3 (3 - sin phi))
         matched in plane strain:         a_phi = tan(phi)/sqrt(9 + 12 tan^2 phi),
                                          k_c = 3 c/sqrt(9 + 12 tan^2 phi)
     (7) Collins         sqrt(J2)   <= Y/alpha, Y = (1-D) Yi + D Yd
         Yi = Y0 + mu_i P/(1 + mu_i P/(Ym - Y0)) intact (Lundborg), Yd = min(mu_d P, Yi) damaged;
         P < 0: Yi = max(0, Y0 + mu_i P), the tangent of Yi at P = 0, and Yd = 0
     (8) all three are multiplied by max(0, 1 - u/u_melt) where u_melt > 0
   References: Jaumann 1911; Benz and Asphaug 1994 (Hooke, von Mises, softening);
   Drucker and Prager 1952; Bui et al. 2008 (plane strain); Lundborg 1968; Collins et al. 2004
   (its thermal softening is another function; (8) is the one of Benz and Asphaug); Jutzi et al.
   2008 (f and alpha).
   Needs: base. Read next: >>damage (where D comes from), >>solid and >>plastic (on particles).
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_STRENGTH_)

/* Equation (2). stiffness_dt = 2 G (f/alpha) dt [Pa s]. Always the 3-D deviator: plane strain and
   uniaxial strain are zeros in L. Adds no trace beyond rounding. */
SPHPA_DEF void sphpa_hooke_advance(sphpa_sym3 *S, double stiffness_dt, const double L[9]);

/* Equation (3), dt [s]. Trace, J2 and J3 are kept to rounding whatever |W| dt is, as long as it is
   finite; S stays bitwise as it is where W dt = 0. The angle is short of |w| dt by
   (|w| dt)^3/12 + O(5). */
SPHPA_DEF void sphpa_jaumann_rotate(sphpa_sym3 *S, const double L[9], double dt);

/* Equation (4) [Pa^2]; infinite where |S| > 1e154 Pa (the limits below do not mind). */
SPHPA_DEF double sphpa_strength_j2(const sphpa_sym3 *S);

typedef enum sphpa_yield_kind {
    SPHPA_YIELD_NONE = 0,       /* elastic for ever */
    SPHPA_YIELD_VON_MISES,      /* (5): Y0 */
    SPHPA_YIELD_DRUCKER_PRAGER, /* (6): a_phi, k_c */
    SPHPA_YIELD_COLLINS         /* (7): Y0, Ym, mu_i, mu_d; carries D itself, so do not multiply S
                                   by (1 - D) as well */
} sphpa_yield_kind;

/* A yield surface; zeroed it is none. Each kind reads the members that its line above names. */
typedef struct sphpa_yield {
    double Y0;             /* [Pa] yield strength in tension (von Mises), cohesion (Collins) */
    double Ym;             /* [Pa] what Yi tends to as P grows, >= Y0 (Collins) */
    double mu_i, mu_d;     /* [1] friction of intact and damaged rock, dYi/dP at 0 and dYd/dP */
    double a_phi;          /* [1] Drucker-Prager slope, of sqrt(J2) against -I1 = 3 P */
    double k_c;            /* [Pa] Drucker-Prager sqrt(J2) at P = 0 */
    double u_melt;         /* [J/kg] Y falls linearly to 0 there; 0: no softening */
    sphpa_yield_kind kind; /* which surface */
} sphpa_yield;

/* Which test of Mohr-Coulomb the Drucker-Prager cone reproduces. */
typedef enum sphpa_yield_match {
    SPHPA_YIELD_TRIAXIAL = 0, /* 3-D: triaxial compression, the cone around the hexagon */
    SPHPA_YIELD_PLANE_STRAIN  /* 2-D: plane strain with associated flow */
} sphpa_yield_match;

/* Drucker-Prager from friction angle phi [rad], 0 <= phi < pi/2, and cohesion c [Pa], >= 0: fills
   *out (u_melt = 0). SPHPA_ERROR_RANGE or _NOT_FINITE with a message; *out then stays as it was. */
SPHPA_DEF sphpa_result sphpa_yield_drucker_prager(double phi, double cohesion,
                                                  sphpa_yield_match match, sphpa_yield *out,
                                                  sphpa_error *err);

/* Are the parameters usable? SPHPA_ERROR_NOT_FINITE, _RANGE (kind, or a number) or _MISSING (NULL),
   the message names the member. Call it once at setup; the functions below do not check. */
SPHPA_DEF sphpa_result sphpa_yield_check(const sphpa_yield *y, sphpa_error *err);

/* Y [Pa] of the matrix, equations (5) to (8): P its pressure [Pa], P_bulk*alpha in P-alpha; u
   [J/kg], below 0 taken as 0; D in [0,1], clamped. Infinite for SPHPA_YIELD_NONE, NaN where an
   argument it depends on is NaN. */
SPHPA_DEF double sphpa_yield_strength(const sphpa_yield *y, double P, double u, double D);

/* Scales the bulk deviator S back onto the surface if it lies outside: von Mises by
   (Y/alpha)/sqrt(3 J2), the others by (Y/alpha)/sqrt(J2). P is the matrix's pressure (see above),
   alpha >= 1. Returns the factor in [0,1]; 1 means bitwise untouched. No overflow at any finite S.
   A NaN or infinity in S, a NaN in Y, alpha <= 0 or NaN: S untouched, returns NaN. */
SPHPA_DEF double sphpa_yield_limit(const sphpa_yield *y, double P, double u, double D, double alpha,
                                   sphpa_sym3 *S);

/* ================================================================================================
   >>damage   Weibull flaws, growth of tensile damage, compaction damage of one state
   ------------------------------------------------------------------------------------------------
   A brittle solid is sown with flaws. One opens when the local tensile strain reaches its
   threshold; open flaws run as cracks, and the damage D (0 sound, 1 broken) takes tension and
   shear away.
   (1) n(eps) = k eps^m              flaws per volume [m^-3] with a threshold below eps [1]
   (2) eps_j = (j/(k V))^(1/m)       threshold of flaw j = 1, 2, ... of a body of solid volume V
   (3) n_act = (eps/eps_min)^m_eff   open flaws of a particle that has N, rounded down;
                                     m_eff = ln N/ln(eps_max/eps_min)
   (4) eps = alpha sigma_max/E       strain of the matrix; E = 9KG/(3K + G), sigma_max [Pa] the
                                     largest principal stress of the bulk's undamaged S - P I
   (5) c_g = 0.4 sqrt((K + 4G/3)/rho_s)   crack speed [m/s]; rho_s = alpha rho, the matrix
   (6) dD13/dt = q c_g/R_s           D13 = D_tensile^(1/3); R_s [m] the kernel's support radius;
                                     q = n_act^(1/3) (default), n_act, or n_act/N
   (7) D13 <= (n_act/N)^(1/3)        and D13 never falls
   (8) D_por^(1/3) = ((X + d)^(1/3) - d^(1/3))/((1 + d)^(1/3) - d^(1/3)), d = 0.01,
       X = 1 - (alpha - 1)/(alpha0 - 1): damage by compaction
   (9) D = min(1, D13^3 + D_por)     acts on stress, once: forces and energy use (1-D) S and, in
                                     tension, (1-D) P; what is stored stays undamaged
   At a constant strain rate, (3), (6) and sigma = E eps (1-D) give a strength that grows as the
   rate to the power 3/(m+3) with the default q (Grady & Kipp's law), 1/(m+1) with the others; with
   (7) only over a few times the rate, between a strength of the flaws alone and one that grows as
   the rate.
   A NaN that goes in comes out (never as 0 or as "no limit"), so a check of the state finds it.
   References: Weibull 1939 (1); Grady & Kipp 1980 (6); Benz & Asphaug 1994, Icarus 107, and 1995,
   CPC 87 (2 to 7); Jutzi, Benz & Michel 2008, Icarus 198 (8, 9).
   Needs: base. Read next: >>cracks (the same on particles: owns lists, commits n_act and D13).
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_DAMAGE_)

/* ---- flaws: who has which -------------------------------------------------------------------- */

/* Weibull's parameters and the body that they fill. */
typedef struct sphpa_flaw_params {
    double k;      /* [m^-3] basalt 4e35 (Benz & Asphaug 1999), ice 1.4e38 */
    double m;      /* [1] basalt 9, ice 9.6 */
    double volume; /* [m3] of the SOLID of the body, without its pores: sum of mass/(alpha rho) */
} sphpa_flaw_params;

/* The flaws of one particle, compressed (eq. 3). Zeroed: no flaws, cannot crack in tension. */
typedef struct sphpa_flaws {
    double eps_min;  /* [1] smallest threshold */
    double exponent; /* [1] m_eff; 0: all flaws open at eps_min (so it is with one flaw) */
    uint32_t count;  /* [1] N */
} sphpa_flaws;

/* OK, or what is wrong with a body of n particles: MISSING (params NULL), NOT_FINITE, NEGATIVE (k,
   m or volume not above 0), EMPTY (n = 0), RANGE (n > 2^32 - 1, or k, m or volume so extreme that a
   threshold leaves the range of doubles). */
SPHPA_DEF sphpa_result sphpa_flaw_check(const sphpa_flaw_params *params, size_t n,
                                        sphpa_error *err);

/* Threshold [1] of flaw j (eq. 2), j > 0 and real, through logarithms; NaN for bad arguments. */
SPHPA_DEF double sphpa_flaw_threshold(const sphpa_flaw_params *params, double j);

/* k V eps^m: how many flaws of the whole body have a threshold below eps; 0 for eps <= 0. */
SPHPA_DEF double sphpa_flaw_count(const sphpa_flaw_params *params, double eps);

/* Is told of each flaw j = 1, 2, ... in rising order of eps, so that appending keeps every
   particle's list sorted. Returns how many flaws `particle` had before this one, or
   SPHPA_FLAW_QUIT to end the walk. */
#define SPHPA_FLAW_QUIT 0xffffffffu
typedef uint32_t (*sphpa_flaw_visit)(void *user, size_t particle, double eps, size_t j);

/* Flaw after flaw to a random particle of n until each has one (Benz & Asphaug 1994): about
   n (ln n + 0.5772) calls of visit. *total (may be NULL) receives their number. Errors: those of
   sphpa_flaw_check; MISSING (rng or visit NULL); STOPPED (visit returned SPHPA_FLAW_QUIT);
   NOT_CONVERGED after n (ln n + 64) flaws: visit miscounts, for the odds of bad luck are e^-64. */
SPHPA_DEF sphpa_result sphpa_flaw_assign(const sphpa_flaw_params *params, size_t n, sphpa_rng *rng,
                                         sphpa_flaw_visit visit, void *user, size_t *total);

/* The same without a walk over all flaws, for large n. In the time t = j/n flaws reach each
   particle as a Poisson process of rate 1, independent of the other particles, and the last
   particle gets its first at a time T with P(T <= t) = (1 - e^-t)^n, mean about ln n + 0.5772.
   Draw T once per body here (NaN where n = 0 or rng is NULL) ... */
SPHPA_DEF double sphpa_flaw_stopping_time(size_t n, sphpa_rng *rng);

/* ... and each particle's flaws up to T = stop here: the first arrival exponential, given that it
   is before T (so there is at least one flaw), the others at exponential intervals; compressed.
   Give each particle a stream of its own, sphpa_rng_seed(seed, id), and the result depends neither
   on order nor on threads. It differs from the walk in two ways, both of weight 1/n: j is Poisson,
   so the threshold of the body's weakest flaw varies; and no particle has its only flaw right at T.
   Errors: those of sphpa_flaw_check; MISSING (rng or out NULL); RANGE (stop not in (0, 1000]). */
SPHPA_DEF sphpa_result sphpa_flaw_sample(const sphpa_flaw_params *params, size_t n, sphpa_rng *rng,
                                         double stop, sphpa_flaws *out);

/* Compresses `count` thresholds, sorted upwards, all > 0 and finite. The result is "no flaws" (its
   count is 0) where count = 0, eps is NULL or the first or the last threshold is not so. */
SPHPA_DEF sphpa_flaws sphpa_flaws_compress(const double *eps, size_t count);

/* Open flaws at strain eps, a whole number: a flaw is open or it is not. From the sorted list: how
   many thresholds are <= eps. Compressed: 0 below eps_min, then eq. 3 rounded down and kept in
   [1, N], which meets the list at eps_min and eps_max. In between a body's sum exceeds k V eps^m by
   up to 12 to 23 % (10^3 to 10^6 particles), the mean cube root by up to 3 to 6 %; without the
   rounding it would be 45 to 56 % and 13 to 16 %. Both NaN where eps is NaN. n_act of a particle
   never falls: the caller keeps the largest and commits it once a step. */
SPHPA_DEF double sphpa_flaws_active(const sphpa_flaws *flaws, double eps);
SPHPA_DEF double sphpa_flaws_active_list(double eps, const double *thresholds, size_t count);

/* ---- growth ---------------------------------------------------------------------------------- */

/* q of eq. 6; codes differ. */
typedef enum sphpa_damage_rule {
    SPHPA_DAMAGE_CBRT = 0, /* n_act^(1/3): cracks that share the particle's volume (the default) */
    SPHPA_DAMAGE_LINEAR,   /* n_act */
    SPHPA_DAMAGE_FRACTION  /* n_act/N */
} sphpa_damage_rule;

#define SPHPA_DAMAGE_STEP 0.15 /* [1] the growth of D13 that one step may bring */

/* Young's modulus 9KG/(3K + G) [Pa]; NaN unless K > 0 and G > 0. */
SPHPA_DEF double sphpa_damage_young(double K, double G);

/* Local tensile strain [1] of the matrix, eq. 4; negative: compression in all directions. S and P
   [Pa] of the bulk and undamaged, K and G [Pa] of the matrix. NaN unless K, G > 0, alpha >= 1. */
SPHPA_DEF double sphpa_damage_strain(const sphpa_sym3 *S, double P, double alpha, double K,
                                     double G);

/* An upper bound of sphpa_damage_strain without eigenvalues, sigma_max <= tr S/3 - P +
   2 sqrt(J2/3). Where it is below a particle's eps_min no flaw opens and the strain itself is not
   needed. NaN as above. */
SPHPA_DEF double sphpa_damage_strain_bound(const sphpa_sym3 *S, double P, double alpha, double K,
                                           double G);

/* Crack speed [m/s], eq. 5; rho_s = alpha rho [kg/m3]. NaN unless K > 0, G >= 0 and rho_s > 0. */
SPHPA_DEF double sphpa_damage_crack_speed(double K, double G, double rho_s);

/* The cap (n_act/n_tot)^(1/3) of D13, eq. 7, at most 1; 0 where there are no flaws. */
SPHPA_DEF double sphpa_damage_cap(double n_act, double n_tot);

/* dD13/dt [1/s], eq. 6, before the cap; c_g >= 0 [m/s], R_s > 0 [m], otherwise NaN. */
SPHPA_DEF double sphpa_damage_rate(double n_act, double n_tot, double c_g, double R_s,
                                   sphpa_damage_rule rule);

/* D13 after a finite dt >= 0 [s], exact for constant n_act:
   max(D13_start, min(cap, D13_start + rate dt)). Pure: try as often as you like from the step's
   start and commit the last. */
SPHPA_DEF double sphpa_damage_advance(double D13_start, double n_act, double n_tot, double c_g,
                                      double R_s, double dt, sphpa_damage_rule rule);

/* The step [s] in which D13 grows by max_growth (0 means SPHPA_DAMAGE_STEP) at constant n_act;
   INFINITY where the rate is 0 or the cap leaves no room for that much growth. */
SPHPA_DEF double sphpa_damage_dt(double D13, double n_act, double n_tot, double c_g, double R_s,
                                 sphpa_damage_rule rule, double max_growth);

/* ---- compaction and total -------------------------------------------------------------------- */

/* D_por, eq. 8 (the damage itself, not its cube root): 0 at alpha0, 1 at alpha = 1, alpha clamped
   to [1, alpha0]; 0 where alpha0 <= 1 (no pores). */
SPHPA_DEF double sphpa_damage_compaction(double alpha, double alpha0);

/* D = min(1, D13^3 + D_por), eq. 9; it takes D13, the cube root that is integrated. */
SPHPA_DEF double sphpa_damage_total(double D13, double D_por);

/* ================================================================================================
   >>riemann   the exact Riemann problem of an ideal gas
   ------------------------------------------------------------------------------------------------
   Two states (rho [kg/m3], v [m/s], P [Pa]) meet at x = 0, t = 0; K is l or r, g is gamma.
   c_K = sqrt(g P_K/rho_K). The pressure P between the outer waves is the zero of
     F(P) = f(P, l) + f(P, r) + v_r - v_l                                                      (1)
     f(P, K) = (P - P_K) sqrt(A_K/(P + B_K)),            P > P_K: shock                        (2)
       A_K = 2/((g + 1) rho_K), B_K = P_K (g - 1)/(g + 1)
     f(P, K) = 2 c_K/(g - 1) [(P/P_K)^z - 1],            P <= P_K: rarefaction, z = (g-1)/(2g) (3)
   F rises and is concave. The speed of the contact between the waves:
     v = (v_l + v_r)/2 + (f(P, r) - f(P, l))/2                                                 (4)
   Two rarefactions (F(min P_K) >= 0) have a closed form:
     P = [(c_l + c_r - (g - 1)(v_r - v_l)/2)/(c_l/P_l^z + c_r/P_r^z)]^(1/z)                    (5)
   Behind a shock, and behind a rarefaction:
     rho = rho_K (P + h P_K)/(h P + P_K), h = (g - 1)/(g + 1);   rho = rho_K (P/P_K)^(1/g)     (6)
   Speeds, left wave (the right one is its mirror image): shock v_l - Q/rho_l, mass flux
     Q = sqrt((P + B_l)/A_l); rarefaction from v_l - c_l (head) to v - c (tail)                (7)
   Vacuum opens where v_r - v_l >= 2 (c_l + c_r)/(g - 1); its edges move at v_l + 2 c_l/(g - 1)
   and v_r - 2 c_r/(g - 1)                                                                     (8)
   References: Toro 2009, Riemann Solvers and Numerical Methods for Fluid Dynamics, 3rd ed.,
   chapter 4: (1) to (4) his 4.5 to 4.9, (5) his 4.46, (6) and (7) section 4.5, (8) section 4.6.
   Needs: eos. Read next: >>gas.
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_RIEMANN_)

/* One side of a Riemann problem. rho = P = 0 is vacuum; P = 0 with rho > 0 is a cold gas. */
typedef struct sphpa_riemann_state {
    double rho; /* [kg/m3] */
    double v;   /* [m/s] velocity along the line between the two */
    double P;   /* [Pa] */
} sphpa_riemann_state;

/* What is between the two outer waves, and where those are: head_l <= tail_l <= v <= tail_r <=
   head_r; head = tail for a shock. */
typedef struct sphpa_riemann_star {
    double P;              /* [Pa] 0 with vacuum */
    double v;              /* [m/s] of the contact; with vacuum: half way between its edges */
    double rho_l, rho_r;   /* [kg/m3] left and right of the contact; 0 with vacuum */
    double head_l, tail_l; /* [m/s] edges of the left wave; tail_l is the vacuum's left edge */
    double tail_r, head_r; /* [m/s] edges of the right wave; tail_r is the vacuum's right edge */
    int iterations;        /* of the root finder; 0 where a closed form did */
    int vacuum;            /* not 0: nothing between tail_l and tail_r (one of them may be the
                              edge of a side that was vacuum from the start) */
} sphpa_riemann_star;

/* Solves (1) to (8); P is good to about 1e-14 of itself unless vacuum is near, where the problem
   itself is that sensitive. *star is untouched on an error: ERROR_RANGE (gamma is not above 1, or
   a result overflows), ERROR_NEGATIVE (rho or P < 0, or rho = 0 < P), ERROR_NOT_FINITE,
   ERROR_MISSING (NULL), ERROR_NOT_CONVERGED (no case is known). */
SPHPA_DEF sphpa_result sphpa_riemann_exact(double gamma, const sphpa_riemann_state *left,
                                           const sphpa_riemann_state *right,
                                           sphpa_riemann_star *star);

/* The solution on the ray x/t [m/s]; Toro 2009, section 4.5. In vacuum rho = P = 0 and v = x/t,
   which is what the fans tend to. star is what sphpa_riemann_exact made of the same arguments. A
   point on a shock gets the state behind it, one on the contact that right of it. Errors as
   above. */
SPHPA_DEF sphpa_result sphpa_riemann_sample(double gamma, const sphpa_riemann_state *left,
                                            const sphpa_riemann_state *right,
                                            const sphpa_riemann_star *star, double x_over_t,
                                            sphpa_riemann_state *out);

/* ================================================================================================
   >>tree   octree along a Hilbert curve: neighbours, lists of groups, friends of friends
   ------------------------------------------------------------------------------------------------
   Particle i with support s_i [m] (the radius where its kernel ends) is a neighbour of j if
       r_ij^2 < max(s_i, s_j)^2,   r_ij = |x_i - x_j| of the nearest image [m]                  (1)
   strictly: a pair at exactly the support is not listed, and (1) is symmetric to the last bit.
   The nearest image along a periodic axis of length L:
       dx -> dx - L if dx > L/2,  dx + L if dx < -L/2,  dx otherwise                            (2)
   which is dx - L round(dx/L) for two points of one box, and exactly odd in dx.
   Lists with a skin [1] keep their worth while particles move (Verlet 1967):
       r_ij^2 < ((1 + skin) max(s_i, s_j))^2                                                    (3)
   holds every pair of (1) while supports do not grow and nobody has moved more than skin s / 2.
   A list may be that of several sorted particles in a row, who see much the same (Pall & Hess
   2013): then one neighbour at a time meets all of them at once, in the lanes of a vector.
   Friends of friends: i and j are linked if r_ij^2 < ((l_i + l_j)/2)^2, and groups are the
   connected components of the links.                                                           (4)
   Particles are sorted along a Hilbert curve, so that those in a row are close together; a node is
   a range of them with the tight box and the largest support of what is in it, and splits at the
   next three key bits that differ.
   References: Hilbert 1891, Math. Ann. 38, 459; Skilling 2004, AIP Conf. Proc. 707, 381 (the order
   in 3-D). Barnes & Hut 1986, Nature 324, 446 (the octree). Warren & Salmon 1993, Supercomputing '93 (keys). Hernquist & Katz 1989, ApJS 70, 419
   (trees for SPH). Verlet 1967, Phys. Rev. 159, 98 (lists). Pall & Hess 2013, CPC 184, 2641 (lists
   of groups). Davis et al. 1985, ApJ 292, 371 (friends of friends). Tarjan 1975, J. ACM 22, 215
   (disjoint sets).
   Needs: base. Read next: particles.
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_TREE_)

/* A box, any axis of which may wrap. A zeroed one is open. */
typedef struct sphpa_box {
    double low[3], high[3]; /* [m] corners; used only on axes that wrap */
    int periodic[3];        /* not 0: this axis wraps */
} sphpa_box;

/* A range of the sorted particles. */
typedef struct sphpa_tree_node {
    double low[3], high[3]; /* [m] tight box of the particles; 0 on axes beyond dim */
    double support;         /* [m] largest support inside */
    uint32_t first, count;  /* sorted particles first .. first + count - 1 */
    uint32_t child;         /* first child, the others follow it; later than this node */
    uint32_t children;      /* 0: a leaf; else 2 to 8 */
} sphpa_tree_node;

/* The tree. A zeroed struct is an empty one; buffers are kept from one build to the next. */
typedef struct sphpa_tree {
    size_t n;      /* particles; 0: empty */
    int dim;       /* 1, 2 or 3 */
    int leaf_size; /* the caller's wish: most particles in a leaf; 0 means 32 */
    sphpa_box box; /* where periodic: the periodic box; elsewhere: the particles' bounding box */
    double *pos;   /* (n,4) sorted: x, y, z, support [m]; 0 on axes beyond dim */
    uint32_t *order;        /* (n) order[k]: index in the caller's arrays of sorted particle k */
    uint32_t *rank;         /* (n) rank[i]: place in the sorted order of the caller's particle i */
    sphpa_tree_node *nodes; /* (node_count) nodes[0] is the root */
    size_t node_count;
    uint32_t *leaves; /* (leaf_count) nodes that are leaves, in the order of their particles */
    size_t leaf_count;
    size_t pos_capacity, order_capacity, rank_capacity, node_capacity, leaf_capacity;
    uint64_t *scratch;       /* keys and indices of the sort, two sets */
    size_t scratch_capacity;
} sphpa_tree;

/* Sorts and builds. x (n,3) [m], row-major in every dimension: columns beyond dim are ignored;
   support (n) [m], > 0; periodic NULL: open. The arrays may be freed afterwards. At an error the
   tree is as it was, but for lack of memory, which leaves it empty (buffers kept).
   ERROR_MISSING a NULL argument; ERROR_RANGE dim not 1, 2, 3, a leaf_size not in 0..4096, more than
   2^32 - 2 particles, a periodic box without extent, a support above half of it (a particle would
   see another one twice), lengths beyond 1e-150..1e150 m; ERROR_EMPTY n = 0; ERROR_NOT_FINITE,
   ERROR_NEGATIVE (support), ERROR_OUTSIDE with the index and the value; ERROR_MEMORY.
   Particles on one point are legal here: sphpa_tree_coincident finds them. */
SPHPA_DEF sphpa_result sphpa_tree_build(sphpa_tree *tree, int dim, size_t n, const double *x,
                                        const double *support, const sphpa_box *periodic,
                                        sphpa_error *err);
SPHPA_DEF void sphpa_tree_free(sphpa_tree *tree);          /* leaves an empty tree; NULL is fine */
SPHPA_DEF size_t sphpa_tree_bytes(const sphpa_tree *tree); /* memory that the tree holds */

/* What a single query finds. Zero it before the first call; free it with sphpa_tree_list_free. */
typedef struct sphpa_tree_list {
    size_t count;    /* entries */
    uint32_t *index; /* (count) indices in the caller's arrays, in the tree's order */
    size_t capacity;
} sphpa_tree_list;

/* Neighbours by (1) of the caller's particle i, without i itself. ERROR_EMPTY, ERROR_RANGE (i),
   ERROR_MEMORY (the list is then empty; else as it was). Any number of threads may query a tree. */
SPHPA_DEF sphpa_result sphpa_tree_neighbours(const sphpa_tree *tree, size_t i,
                                             sphpa_tree_list *list);

/* Particles with |x - x_j| < radius [m] of the nearest image, whatever their support.
   ERROR_EMPTY, ERROR_NOT_FINITE, ERROR_NEGATIVE (radius <= 0), ERROR_OUTSIDE (x not in the periodic
   box), ERROR_RANGE (radius above half of it), ERROR_MEMORY. */
SPHPA_DEF sphpa_result sphpa_tree_query(const sphpa_tree *tree, const double x[3], double radius,
                                        sphpa_tree_list *list);
SPHPA_DEF void sphpa_tree_list_free(sphpa_tree_list *list);

/* One pair of particles at the same point (nearest image): OK and *i, *j untouched if there is
   none, else ERROR_COINCIDENT and *i < *j in the caller's arrays; which pair is fixed by the order
   of the tree. i and j may be NULL. */
SPHPA_DEF sphpa_result sphpa_tree_coincident(const sphpa_tree *tree, size_t *i, size_t *j);

/* The lists of SPHPA_TREE_CHUNK sorted particles that follow each other, in one buffer. */
#define SPHPA_TREE_CHUNK_SHIFT 9
#define SPHPA_TREE_CHUNK ((size_t)1 << SPHPA_TREE_CHUNK_SHIFT)
typedef struct sphpa_tree_chunk {
    uint32_t *index; /* (used) the chunk's lists, one after another */
    size_t used, capacity;
} sphpa_tree_chunk;

/* Who is near, in SORTED indices, for each group of sorted particles that follow each other. A
   zeroed struct holds no lists; buffers are reused. */
typedef struct sphpa_tree_lists {
    size_t n;                 /* particles */
    size_t group;             /* particles of a group; the last one may have fewer */
    size_t groups;            /* n/group, rounded up */
    size_t entries;           /* sum of the counts */
    double skin;              /* [1] as built */
    uint32_t *first;          /* (groups) where the list of a group begins in its chunk */
    uint32_t *count;          /* (groups) its length */
    sphpa_tree_chunk *chunks; /* (chunk_count) particle k is in chunk k >> SPHPA_TREE_CHUNK_SHIFT */
    size_t chunk_count;       /* in use; buffers of others are kept for a larger build */
    size_t first_capacity, count_capacity, chunk_capacity;
} sphpa_tree_lists;

/* An entry of a list: a sorted particle, and which of its images it is that is near. */
#define SPHPA_TREE_ENTRY_BITS 27
#define SPHPA_TREE_ENTRY_INDEX(entry) ((entry) & (((uint32_t)1 << SPHPA_TREE_ENTRY_BITS) - 1u))
#define SPHPA_TREE_ENTRY_IMAGE(entry) ((entry) >> SPHPA_TREE_ENTRY_BITS)
#define SPHPA_TREE_IMAGES 27

/* [m] what image 0 to 26 of a particle adds to its position; image 0 is the particle itself. */
SPHPA_DEF void sphpa_tree_image_shift(const sphpa_box *box, uint32_t image, double shift[3]);

/* Lists for every group of `group` (1, 2, 4, 8 or 16) sorted particles all particles, or images of
   some, with (3) to at least one of the group: the group's own particles are among them, and
   nobody comes twice as the same image. The same lists, in the same order, for any number of
   threads. skin >= 0 [1]. An OpenMP build allocates from several threads at once, so SPHPA_MALLOC
   must allow that. ERROR_MISSING, ERROR_EMPTY (tree), ERROR_NOT_FINITE, ERROR_NEGATIVE (skin),
   ERROR_RANGE ((1 + skin) support above half the periodic box, group, more than 2^27 particles),
   ERROR_MEMORY (the lists are then empty, buffers kept). */
SPHPA_DEF sphpa_result sphpa_tree_lists_build(const sphpa_tree *tree, double skin, size_t group,
                                              sphpa_tree_lists *lists, sphpa_error *err);
SPHPA_DEF void sphpa_tree_lists_free(sphpa_tree_lists *lists);
SPHPA_DEF size_t sphpa_tree_lists_bytes(const sphpa_tree_lists *lists);

/* The list of group g (sorted particles g*group ..): *count entries; valid until the next build. */
SPHPA_DEF const uint32_t *sphpa_tree_list_of(const sphpa_tree_lists *lists, size_t g,
                                             size_t *count);

/* Friends of friends by (4). link (n) [m], >= 0, and mask (n; NULL: all), both in the caller's
   order; where mask is 0 the particle belongs to nobody and its link is not read. labels (n,
   caller's order): the group, or -1 where masked out. Groups (a lone particle is one) are numbered
   from 0 by falling count, equal counts by their smallest index; *groups (may be NULL) is how many.
   ERROR_MISSING, ERROR_EMPTY (tree), ERROR_NOT_FINITE, ERROR_NEGATIVE, ERROR_RANGE (a link above
   half the periodic box, more than 2^31 - 1 particles), ERROR_MEMORY; outputs stay untouched. */
SPHPA_DEF sphpa_result sphpa_tree_friends(const sphpa_tree *tree, const double *link,
                                          const unsigned char *mask, int32_t *labels,
                                          size_t *groups, sphpa_error *err);

/* For the implementation half of other sections (always inline, private):
     const uint32_t *sphpa_tree_list_of_(lists, g, &count)   with uint32_t count
     double sphpa_tree_dx_(&box, axis, dx)   equation (2); dx = x_i - x_j, |dx| < 1.5 L */

/* ================================================================================================
   >>particles   a structure of arrays made from one table of fields
   ------------------------------------------------------------------------------------------------
   One row of SPHPA_FIELDS is one field: member of sphpa_fields, memory, sorting, integration,
   snapshot and restart all follow from it. A field that nobody asked for is NULL and costs nothing.
   A state field that some pass advances also has a copy of its value at the start of the step, in
   `start`. Columns of a user's own are treated like the table's.
   Needs: base. Read next: >>sph (passes name the fields they read and write).
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_PARTICLES_)

/* name, type, components, name in files, exponents of length mass time, role, at a split, at a
   merge, meaning [unit]. (rho, u and alpha are double in every build: an implicit solve for alpha
   needs them; a float near 4.64 rounds by 2.4e-7.) Vectors have three components in every
   dimension, unused ones are 0. L is row-major, L[3a+b] = dv_a/dx_b; S is xx yy zz xy yz xz. */
#define SPHPA_FIELDS(X)                                                                            \
    X(x, double, 3, "Coordinates", 1, 0, 0, STATE, COPY, BY_MASS, "position [m]")                  \
    X(v, sphpa_real, 3, "Velocities", 1, 0, -1, STATE, COPY, BY_MASS, "velocity [m/s]")            \
    X(m, sphpa_real, 1, "Masses", 0, 1, 0, CONSTANT, SHARE, SUM, "mass [kg]")                      \
    X(h, sphpa_real, 1, "SmoothingLengths", 1, 0, 0, STATE, RESET, RESET, "smoothing length [m]")  \
    X(rho, double, 1, "Densities", -3, 1, 0, STATE, INTERPOLATE, BY_MASS, "bulk density [kg/m3]")  \
    X(u, double, 1, "InternalEnergies", 2, 0, -2, STATE, COPY, BY_MASS,                            \
      "specific internal energy [J/kg]")                                                           \
    X(P, sphpa_real, 1, "Pressures", -1, 1, -2, DERIVED, RESET, RESET,                             \
      "pressure, undamaged: where negative, 1 - D of it acts [Pa]")                                \
    X(c, sphpa_real, 1, "SoundSpeeds", 1, 0, -1, DERIVED, RESET, RESET,                            \
      "fastest signal in the material at rest [m/s]")                                              \
    X(c_visc, sphpa_real, 1, "ViscousSpeeds", 1, 0, -1, DERIVED, RESET, RESET,                     \
      "wave speed that the viscosity goes by, where it is not c [m/s]")                            \
    X(id, int64_t, 1, "ParticleIDs", 0, 0, 0, CONSTANT, RESET, RESET, "number, never reused [1]")  \
    X(material, int32_t, 1, "MaterialIDs", 0, 0, 0, CONSTANT, COPY, COPY,                          \
      "place in the scene's list of materials [1]")                                                \
    X(body, int32_t, 1, "BodyIDs", 0, 0, 0, CONSTANT, COPY, COPY, "number of the body [1]")        \
    X(a, sphpa_real, 3, "Accelerations", 1, 0, -2, RATE, COPY, BY_MASS, "dv/dt [m/s2]")            \
    X(du, sphpa_real, 1, "InternalEnergyRates", 2, 0, -3, RATE, COPY, BY_MASS, "du/dt [W/kg]")     \
    X(mu_max, sphpa_real, 1, "ViscousSignals", 1, 0, -1, DERIVED, RESET, RESET,                    \
      "largest |mu| of the viscosity's pairs [m/s]")                                               \
    X(omega, sphpa_real, 1, "GradHTerms", 0, 0, 0, DERIVED, RESET, RESET,                          \
      "grad-h factor Omega of the density sum [1]")                                                \
    X(div_v, sphpa_real, 1, "VelocityDivergences", 0, 0, -1, DERIVED, RESET, RESET,                \
      "divergence of v, from all neighbours [1/s]")                                                \
    X(balsara, sphpa_real, 1, "BalsaraFactors", 0, 0, 0, DERIVED, RESET, RESET,                    \
      "|div| / (|div| + |curl|) of v [1]")                                                         \
    X(L, sphpa_real, 9, "VelocityGradients", 0, 0, -1, DERIVED, RESET, RESET,                      \
      "velocity gradient that strains the solid [1/s]")                                            \
    X(C, sphpa_real, 6, "CorrectionMatrices", 0, 0, 0, DERIVED, RESET, RESET,                      \
      "correction of the kernel's gradient [1]")                                                   \
    X(cut, uint32_t, 1, "CutNeighbours", 0, 0, 0, DERIVED, RESET, RESET,                           \
      "neighbours that do not strain the solid: foreign or broken [1]")                            \
    X(h0, sphpa_real, 1, "InitialSmoothingLengths", 1, 0, 0, CONSTANT, RESET, RESET,               \
      "smoothing length at the start [m]")                                                         \
    X(rho_h0, sphpa_real, 1, "InitialDensities", -3, 1, 0, CONSTANT, RESET, RESET,                 \
      "density at the start, that goes with the smoothing length there [kg/m3]")                   \
    X(S, sphpa_real, 6, "DeviatoricStresses", -1, 1, -2, STATE, INTERPOLATE, BY_MASS,              \
      "bulk deviator, undamaged [Pa]")                                                             \
    X(alpha, double, 1, "Distentions", 0, 0, 0, STATE, COPY, BY_MASS, "distention [1]")            \
    X(alpha_min, double, 1, "LeastDistentions", 0, 0, 0, STATE, COPY, BY_MASS,                     \
      "least distention so far, where alpha may come back [1]")                                    \
    X(D, sphpa_real, 1, "Damages", 0, 0, 0, DERIVED, COPY, BY_MASS,                                \
      "total damage, tension and compaction [1]")                                                  \
    X(D13, sphpa_real, 1, "TensileDamageCubeRoots", 0, 0, 0, STATE, COPY, BY_MASS,                 \
      "cube root of the tensile damage [1]")                                                       \
    X(flaw_min, double, 1, "FlawThresholds", 0, 0, 0, CONSTANT, COPY, COPY,                        \
      "strain that activates the weakest flaw [1]")                                                \
    X(flaw_exponent, sphpa_real, 1, "FlawExponents", 0, 0, 0, CONSTANT, COPY, COPY,                \
      "effective Weibull exponent of the particle's flaws [1]")                                    \
    X(flaw_count, uint32_t, 1, "FlawCounts", 0, 0, 0, CONSTANT, COPY, COPY, "number of flaws [1]") \
    X(flaw_first, uint32_t, 1, "FlawFirsts", 0, 0, 0, CONSTANT, COPY, COPY,                        \
      "first of them in the pool, where all are kept [1]")                                         \
    X(n_act, sphpa_real, 1, "ActiveFlaws", 0, 0, 0, STATE, COPY, COPY, "active flaws so far [1]")

#define SPHPA_FIELD_ENUM_(name, ...) SPHPA_FIELD_##name,
typedef enum sphpa_field { SPHPA_FIELDS(SPHPA_FIELD_ENUM_) SPHPA_FIELD_COUNT } sphpa_field;
#undef SPHPA_FIELD_ENUM_

/* A set of fields: SPHPA_F(rho) | SPHPA_F(u) */
typedef uint64_t sphpa_mask;
#define SPHPA_F(name) ((sphpa_mask)1 << SPHPA_FIELD_##name)

typedef enum sphpa_type {
    SPHPA_TYPE_double = 0,
    SPHPA_TYPE_sphpa_real,
    SPHPA_TYPE_int64_t,
    SPHPA_TYPE_int32_t,
    SPHPA_TYPE_uint32_t
} sphpa_type;

typedef enum sphpa_role {
    SPHPA_ROLE_STATE = 0, /* carried from step to step */
    SPHPA_ROLE_RATE,      /* of a state field; kept, for the next step's predictor uses it */
    SPHPA_ROLE_DERIVED,   /* computed anew from the state */
    SPHPA_ROLE_CONSTANT   /* set once */
} sphpa_role;

/* What the daughters of a split inherit, and what a merged particle gets. */
typedef enum sphpa_rule {
    SPHPA_RULE_COPY = 0,    /* the parent's; the heavier one's */
    SPHPA_RULE_SHARE,       /* a daughter's share of it */
    SPHPA_RULE_SUM,         /* the sum */
    SPHPA_RULE_BY_MASS,     /* the mean, weighted by mass */
    SPHPA_RULE_INTERPOLATE, /* from the neighbours, by the kernel */
    SPHPA_RULE_RESET        /* set by whoever splits or merges */
} sphpa_rule;

/* One row of the table, or a user's column. */
typedef struct sphpa_field_info {
    const char *name;      /* "rho" */
    const char *file_name; /* "Densities" */
    const char *meaning;   /* with its unit */
    sphpa_type type;
    int components;
    int length, mass, time; /* exponents of the unit */
    sphpa_role role;
    sphpa_rule split, merge;
    size_t bytes; /* of one particle: components times the size of the type */
} sphpa_field_info;

/* One pointer a field, NULL if it is not there; arrays of (n, components). */
#define SPHPA_FIELD_MEMBER_(name, type, ...) type *name;
typedef struct sphpa_fields {
    SPHPA_FIELDS(SPHPA_FIELD_MEMBER_)
} sphpa_fields;

/* A column of the user's own: doubles, handled like a field of the table. Zeroed except for the
   name it is one number a particle, without unit, a state. */
typedef struct sphpa_column {
    char name[40];          /* also its name in files */
    int components;         /* 1 to 9; 0 means 1 */
    int length, mass, time; /* exponents of the unit */
    sphpa_role role;        /* a state also has a copy at the start of the step */
    sphpa_rule split, merge;
    double *data;  /* (n, components), set by the toolkit */
    double *start; /* (n, components), at the start of the step; NULL unless it is a state */
} sphpa_column;

#define SPHPA_COLUMNS_MAX 16

/* The particles: p->rho[i], p->v[3*i + 1], p->start.u[i]. A zeroed struct is an empty set. */
typedef struct sphpa_particles {
    size_t n;        /* particles in use */
    size_t capacity; /* particles there is room for */
    int dim;         /* 1, 2 or 3 */
    int columns;     /* columns in use */
    sphpa_mask fields;       /* what is allocated */
    sphpa_mask start_fields; /* what has a copy at the start of the step */
    int64_t next_id;         /* ids below it are taken */
    SPHPA_FIELDS(SPHPA_FIELD_MEMBER_)
    sphpa_fields start; /* values at the start of the step */
    sphpa_column column[SPHPA_COLUMNS_MAX];
    void *block; /* all of it, one aligned piece of memory */
} sphpa_particles;
#undef SPHPA_FIELD_MEMBER_

/* Row `field` of the table; all members NULL or 0 if there is no such row. */
SPHPA_DEF sphpa_field_info sphpa_field_describe(sphpa_field field);

/* What every set of particles has: x v m h rho u id material body. */
#define SPHPA_BASIC_FIELDS                                                                         \
    (SPHPA_F(x) | SPHPA_F(v) | SPHPA_F(m) | SPHPA_F(h) | SPHPA_F(rho) | SPHPA_F(u) |               \
     SPHPA_F(id) | SPHPA_F(material) | SPHPA_F(body))

/* An empty set with room for `capacity` particles: the basic fields and `fields`; `start_fields`
   have copies. columns may be NULL when column_count is 0; their pointers are ignored. All memory
   is set to 0. ERROR_RANGE (dim, components, too many columns, a name twice or that of a field),
   ERROR_MEMORY. */
SPHPA_DEF sphpa_result sphpa_particles_create(sphpa_particles *p, int dim, size_t capacity,
                                              sphpa_mask fields, sphpa_mask start_fields,
                                              const sphpa_column *columns, int column_count,
                                              sphpa_error *err);
SPHPA_DEF void sphpa_particles_free(sphpa_particles *p); /* leaves a zeroed struct */

/* Room for at least `capacity`; pointers change. On ERROR_MEMORY everything is as it was. */
SPHPA_DEF sphpa_result sphpa_particles_reserve(sphpa_particles *p, size_t capacity,
                                               sphpa_error *err);

/* Adds `count` particles at the end, all fields 0, ids given, and tells the first one's index (first
   may be NULL).
   ERROR_MISSING (a set that was never created), ERROR_MEMORY: all is then as it was. */
SPHPA_DEF sphpa_result sphpa_particles_add(sphpa_particles *p, size_t count, size_t *first,
                                           sphpa_error *err);

/* Copies what both sets have, columns of the same name and components too, appended to `to`; ids
   are kept. */
SPHPA_DEF sphpa_result sphpa_particles_append(sphpa_particles *to, const sphpa_particles *from,
                                              sphpa_error *err);

/* The k-th becomes what order[k] was, in every field, copy and column; order is a permutation. */
SPHPA_DEF sphpa_result sphpa_particles_permute(sphpa_particles *p, const uint32_t *order,
                                               sphpa_error *err);

/* The data of a field as bytes, or NULL; start != 0: the copy at the start of the step. */
SPHPA_DEF void *sphpa_particles_data(const sphpa_particles *p, sphpa_field field, int start);

/* (n, components) doubles of a user's column, NULL if there is none of that name. */
SPHPA_DEF double *sphpa_particles_column(const sphpa_particles *p, const char *name);

/* Bytes of one particle, copies and columns included. */
SPHPA_DEF size_t sphpa_particles_bytes_each(const sphpa_particles *p);

/* The first thing that is wrong with the state, as an error with index, value and cure: NaN or
   infinite x, v, rho, u; m, h or rho not positive; alpha below 1. (u of a running simulation may
   be a little below 0, see >>sph; sphpa_sim_create refuses it.) */
SPHPA_DEF sphpa_result sphpa_particles_check(const sphpa_particles *p, sphpa_error *err);

/* ================================================================================================
   >>sph   scenes, modules and passes; the step, its limits, statistics and timings
   ------------------------------------------------------------------------------------------------
   A scene is a list of modules; a module is a few passes; a pass is a function over particles or
   over the neighbours of each particle that names the fields it reads and writes. The fields of a
   simulation are the union of what its passes name.

   One step from t to t + dt (midpoint rule; n: start, *: middle, n+1: end):
     (1)  x* = x + dt/2 v          v* = v + dt/2 a          u* = u + dt/2 du
     (2)  evaluate all passes at *: a, and everything that a depends on
     (3)  v(n+1) = v + dt a        vbar = (v + v(n+1))/2    x(n+1) = x + dt vbar = x* + dt/2 v(n+1)
     (4)  du from the same pair forces with vbar            u(n+1) = u + dt du
     (5)  commit: passes marked so run once more with the whole step, from the start's values
   In (1), PREDICTOR_CORRECTOR takes a and du of the step before: one evaluation a step. For forces
   that depend on x alone it is the leapfrog (drift-kick-drift). RK2 evaluates at n first. Both are
   of second order, and (4) makes the total energy exact to rounding (Owen 2014, compatible
   differencing). With no viscosity at all PREDICTOR_CORRECTOR is weakly unstable where P depends on
   u: a wave of omega grows by about (omega dt)^4/8 of itself a step. A pass that advances a field
   of its own (S, alpha, rho of a solid) starts from p->start at every evaluation and goes
   sim->dt_stage ahead, so a trial never compounds.

   References: Monaghan 2005 (Rep. Prog. Phys. 68), eqs. 5.1-5.6 (step limits); Owen 2014
   (Int. J. Numer. Meth. Fluids 75), eqs. 12-15.
   Needs: kernel, tree, particles. Read next: >>gas, or >>solid.
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_SPH_)

struct sphpa_sim;

/* Fixes the order within an evaluation, whatever the order of adding. */
typedef enum sphpa_stage {
    SPHPA_STAGE_DENSITY = 0, /* density and h from the positions */
    SPHPA_STAGE_GRADIENTS,   /* velocity gradient, correction, switches */
    SPHPA_STAGE_PRESSURE,
    SPHPA_STAGE_STRESS,
    SPHPA_STAGE_YIELD,
    SPHPA_STAGE_DAMAGE,
    SPHPA_STAGE_FORCES, /* the acceleration */
    SPHPA_STAGE_ENERGY, /* du from the pair forces and the time-centred velocity */
    SPHPA_STAGE_COMMIT, /* once a step, at its accepted end */
    SPHPA_STAGE_RESIZE, /* once a step: the only place where particles come and go */
    SPHPA_STAGE_LIMIT,  /* once a step: how long the next may be */
    SPHPA_STAGE_COUNT
} sphpa_stage;

typedef enum sphpa_pass_kind {
    SPHPA_PASS_PARTICLE = 0, /* particle(), over blocks of particles, in parallel */
    SPHPA_PASS_PAIR,         /* pair(), over each particle's neighbours, in parallel */
    SPHPA_PASS_REDUCE        /* limit(): a time for each particle, of which the least is taken */
} sphpa_pass_kind;

/* What a PAIR pass gets: one particle and its neighbours. All arrays have `count` elements. */
typedef struct sphpa_neighbours {
    size_t i;            /* the particle, the only one that may be written */
    size_t count;        /* neighbours: closer than the larger of both supports */
    const uint32_t *j;   /* their indices */
    const double *dx, *dy, *dz; /* [m] x_i - x_j, nearest image */
    const double *r;     /* [m] distance */
    const double *h;     /* [m] smoothing length of j */
    const char *records; /* what pack() wrote; j's is at records + j * record_bytes */
    double *scratch[4];  /* for the pass to use */
} sphpa_neighbours;

/* What a PAIR pass gets that takes a few particles at once, in the lanes of a vector, and so runs
   several times as fast: how that is done stands at "lanes" in the implementation. */
typedef struct sphpa_group {
    size_t first, count;   /* the particles first .. first + count - 1, the only ones to write */
    const uint32_t *list;  /* (entries) of >>tree: all that is near one of them, themselves too */
    size_t entries;
    const uint32_t *far;   /* (far_entries) the same with the skin: for a pass that changes h */
    size_t far_entries;
    const double (*centre)[3]; /* [m] by image: x_j - centre[image] is relative to the group */
    const char *records;   /* what pack() wrote; j's is at records + j * record_bytes */
} sphpa_group;

/* A pass. Zeroed members mean none. Particle i writes only i. In FORCES add to p->a, in ENERGY to
   p->du; both are 0 when these stages begin. PAIR passes that follow each other in one stage share
   a traversal when none reads what an earlier one writes or writes what an earlier one reads: so
   name the fields truly. */
typedef struct sphpa_pass {
    const char *name;     /* shown in the report; unique in a scene */
    const char *replaces; /* the pass of this name is dropped when this one is there */
    sphpa_stage stage;
    sphpa_pass_kind kind;
    sphpa_mask reads, writes; /* all are allocated */
    sphpa_mask uses;          /* read where another pass has them; not allocated for this one */
    sphpa_mask advances;      /* these also have a copy of the start of the step in p->start, as v
                                 and u always do */
    int at_commit; /* GRADIENTS to DAMAGE, not 0: runs again at the step's end, dt_stage = dt */
    int unfiltered; /* with pair, not 0: gets every listed particle, also beyond the supports */
    size_t record_bytes;      /* of one packed record; 0: the pass reads the fields themselves */
    /* fills records[i], i in [first, last), before the pairs are visited */
    void (*pack)(const struct sphpa_sim *sim, const void *params, size_t first, size_t last,
                 void *records);
    /* the same where an earlier pass's pack(), of this function and these parameters, has left its
       records, and since then no field changed but a, mu_max, div_v and du: writes what follows
       them. Columns are not looked at: a pack() that reads one has no repack(). */
    void (*repack)(const struct sphpa_sim *sim, const void *params, size_t first, size_t last,
                   void *records);
    /* particles [first, last); on failure *bad is the particle that failed */
    sphpa_result (*particle)(struct sphpa_sim *sim, void *params, size_t first, size_t last,
                             size_t *bad);
    /* a PAIR pass has one of these two; records begin with the position, by sphpa_sim_position */
    void (*pair)(struct sphpa_sim *sim, void *params, const sphpa_neighbours *near);
    void (*group)(struct sphpa_sim *sim, void *params, const sphpa_group *near);
    /* [s] the longest step that particle i allows; infinity: no limit */
    double (*limit)(const struct sphpa_sim *sim, const void *params, size_t i);
} sphpa_pass;

#define SPHPA_MODULE_PASSES 12
#define SPHPA_MODULE_COLUMNS 4
#define SPHPA_SCENE_MODULES 12
#define SPHPA_SCENE_PASSES 48

/* Hands a named block of bytes to a checkpoint (writing) or gets it back (reading: *data is new
   memory that the module then owns). */
typedef sphpa_result (*sphpa_keep_fn)(void *user, const char *name, void **data, size_t *bytes,
                                      sphpa_error *err);

/* A module: what sphpa_gas(), sphpa_solid(), ... return, and what a user writes. */
typedef struct sphpa_module {
    const char *name;
    void *params; /* handed to the passes; must outlive the simulation */
    /* after the fields are allocated and filled, before the first evaluation; may be NULL */
    sphpa_result (*setup)(struct sphpa_sim *sim, void *params, sphpa_error *err);
    /* after the setup, and after a restart has brought other particles: can the module work with
       every one of them? may be NULL */
    sphpa_result (*check)(const struct sphpa_sim *sim, const void *params, sphpa_error *err);
    void (*teardown)(struct sphpa_sim *sim, void *params); /* may be NULL */
    /* exchanges what a restart needs beyond the fields; may be NULL */
    sphpa_result (*keep)(struct sphpa_sim *sim, void *params, sphpa_keep_fn exchange, void *user,
                         sphpa_error *err);
    int passes, columns;
    sphpa_pass pass[SPHPA_MODULE_PASSES];
    sphpa_column column[SPHPA_MODULE_COLUMNS];
} sphpa_module;

typedef struct sphpa_scene {
    int modules;
    sphpa_module module[SPHPA_SCENE_MODULES];
    sphpa_error error; /* of the first module that could not be added */
} sphpa_scene;

/* ERROR_RANGE when the scene is full or has a module of that name, or the module more passes or
   columns than it can hold; sphpa_sim_create of that scene fails with the reason. */
SPHPA_DEF sphpa_result sphpa_scene_add(sphpa_scene *scene, sphpa_module module);

typedef enum sphpa_integrator {
    SPHPA_PREDICTOR_CORRECTOR = 0, /* one evaluation a step */
    SPHPA_RK2                      /* two */
} sphpa_integrator;

/* Everything has a default at 0. */
typedef struct sphpa_sim_options {
    double cfl;       /* [1] of the Courant limit; 0 means 0.3 */
    double force_cfl; /* [1] of the limit sqrt(h/|a|); 0 means 0.2 */
    double flight;    /* [1] of the limit h over the speed against the flow of all, which keeps
                         bodies from flying through each other (gas, solid); 0 means 0.5 */
    double dt_max;    /* [s] no step is longer; 0 means no such limit */
    double dt_min;    /* [s] a shorter step is an error; 0 means 1e-6 of the first step */
    double dt_growth; /* [1] a step to the one before, at most; 0 means 1.25 */
    double dt_fixed;  /* [s] every step has this length, limits and floor ignored; 0 means no */
    double skin;      /* [1] neighbours listed beyond the support, as a share of it; 0 means 0.2;
                         where a support fills half a periodic box, less */
    sphpa_box box;    /* axes that are periodic; zeroed means open */
    sphpa_kernel kernel;
    sphpa_integrator integrator;
} sphpa_sim_options;

/* Sums over all particles, in blocks of fixed size: the same bits for any number of threads. */
typedef struct sphpa_totals {
    double mass;        /* [kg] */
    double momentum[3]; /* [kg m/s] */
    double angular[3];  /* [kg m2/s] about the centre of mass; means nothing in a periodic box */
    double kinetic;     /* [J] */
    double internal;    /* [J] */
    double energy;      /* [J] kinetic and internal */
} sphpa_totals;

/* Time of one pass or of a part of the toolkit. That of passes that share a traversal is told by
   the first of them. */
typedef struct sphpa_timing {
    const char *name;
    double seconds; /* wall clock, all calls together */
    uint64_t calls;
} sphpa_timing;

/* How often a limit was the one that set the step. */
typedef struct sphpa_limit_count {
    const char *name;
    uint64_t steps;
} sphpa_limit_count;

enum {
    SPHPA_TIME_TREE_BUILD = 0,
    SPHPA_TIME_TREE_SORT,
    SPHPA_TIME_LISTS,
    SPHPA_TIME_INTEGRATE,
    SPHPA_TIME_PASSES, /* the passes' own follow */
    SPHPA_TIMINGS = SPHPA_TIME_PASSES + SPHPA_SCENE_PASSES,
    SPHPA_LIMITS = SPHPA_SCENE_PASSES + 4
};

typedef struct sphpa_stats {
    uint64_t steps, evaluations, rebuilds; /* rebuilds: of tree and lists */
    double neighbours_mean; /* within the supports, when the lists were last built */
    /* u may fall a little below 0: it is kept so, for the energy's sake, and equations of state are
       asked at max(u, 0). At the end of the last step: */
    double u_deficit; /* [J] sum of m max(-u, 0) */
    double u_least;   /* [J/kg] the smallest u */
    uint64_t u_below; /* particles with u < 0 */
    int64_t u_id;     /* id of the one with the smallest u */
    int64_t limit_id; /* id of the one that set the last step */
    int limit_last;         /* its place in limit[] */
    int timings, limits;    /* in use */
    sphpa_timing timing[SPHPA_TIMINGS];
    sphpa_limit_count limit[SPHPA_LIMITS];
} sphpa_stats;

/* A simulation. Read what you like; write particles' fields only between steps. */
typedef struct sphpa_sim {
    double time;        /* [s] */
    double dt;          /* [s] of the step under way or the last one */
    double dt_next;     /* [s] of the next one */
    double dt_first;    /* [s] of the first one */
    double dt_free;     /* [s] the last one, had no output time cut it */
    double dt_stage;    /* [s] how far after the start of the step this evaluation is */
    int committing;     /* not 0 while step (5) runs */
    int started;        /* a and du are there for the predictor */
    sphpa_particles p; /* sim->p.rho[i], sim->p.v[3*i]; body tells whose; the order changes */
    sphpa_sim_options options; /* defaults filled in */
    sphpa_scene scene;
    sphpa_stats stats;
    int passes; /* those in use, in the order of the stages */
    const sphpa_pass *pass[SPHPA_SCENE_PASSES];
    void *pass_params[SPHPA_SCENE_PASSES];
    sphpa_tree tree;
    sphpa_tree_lists lists;
    struct sphpa_work *work; /* private */
} sphpa_sim;

/* Unites the passes' fields, allocates, copies the initial particles (all that both have), checks
   them, and runs the modules' setups. `initial` stays the caller's. Columns are the modules'. The
   scene is copied, parameters are not. Errors: no particles, a bad state, two particles on one
   point, one outside a periodic box, passes that clash, no memory; *sim is then zeroed. */
SPHPA_DEF sphpa_result sphpa_sim_create(sphpa_sim *sim, const sphpa_scene *scene,
                                        const sphpa_particles *initial,
                                        const sphpa_sim_options *options, sphpa_error *err);
SPHPA_DEF void sphpa_sim_free(sphpa_sim *sim);

/* One step, no longer than dt_limit (infinity: as long as the limits allow). ERROR_STATE: a value
   went bad or the step fell below its floor; the message tells which particle and its fields. */
SPHPA_DEF sphpa_result sphpa_sim_step(sphpa_sim *sim, double dt_limit, sphpa_error *err);

/* Derived fields at the present state, for output: all but what FORCES and ENERGY write (a, du,
   mu_max, and a gas's div_v). Density, gradients and pressure are those of
   the positions now, not of the middle of the last step. They are there until the next step,
   settle or checkpoint, which goes on from the ones before: a refresh changes no more than the
   order of the particles. What is integrated stays as it was, to the bit. */
SPHPA_DEF sphpa_result sphpa_sim_refresh(sphpa_sim *sim, sphpa_error *err);

/* Sorts the particles and forgets tree and lists: a run that goes on from here and one that is
   restarted from the arrays as they are now make the same steps, bit by bit. */
SPHPA_DEF sphpa_result sphpa_sim_settle(sphpa_sim *sim, sphpa_error *err);

/* Steps until t_end, landing on every output time. */
typedef struct sphpa_run {
    double t_end;  /* [s] */
    double every;  /* [s] between outputs; 0: at the end only */
    void *user;    /* handed to the callbacks */
    /* at the start (unless resumed), every `every` and at the end; refresh was called before */
    sphpa_result (*output)(sphpa_sim *sim, void *user, sphpa_error *err);
    /* after every step; anything but OK ends the run with that result */
    sphpa_result (*step)(sphpa_sim *sim, void *user, sphpa_error *err);
    const volatile int *stop; /* not 0: ends after the step under way, with SPHPA_STOPPED */
    int resumed;              /* not 0: no output at the start */
} sphpa_run;
SPHPA_DEF sphpa_result sphpa_sim_run(sphpa_sim *sim, const sphpa_run *run, sphpa_error *err);

SPHPA_DEF sphpa_totals sphpa_sim_totals(const sphpa_sim *sim);

/* A text of time per pass and its share, bytes per field, limits and neighbours. Writes at most
   `size` bytes with the final NUL and returns the length that the whole text has. */
SPHPA_DEF size_t sphpa_sim_report(const sphpa_sim *sim, char *text, size_t size);

/* Monaghan's viscosity of a pair: Pi = f (-a c mu + b mu^2)/rho, with pair means of c, rho and h
   and mu = h v.x/(r^2 + 0.01 h^2) where v.x < 0, else 0. */
typedef struct sphpa_viscosity {
    double a;    /* [1] linear; 0 means 1, negative means none */
    double b;    /* [1] quadratic; 0 means 2, negative means none */
    int balsara; /* not 0: times the pair's mean of |div|/(|div| + |curl| + 1e-4 c/h) */
} sphpa_viscosity;

/* ================================================================================================
   >>gas   an ideal (or any) gas by density summation with grad-h terms
   ------------------------------------------------------------------------------------------------
   W_i = W(r_ij, h_i), x_ij = x_i - x_j, v_ij = v_i - v_j, d the dimension:
     (1) rho_i = sum_j m_j W_i(j included: j = i),  h_i = eta (m_i/rho_i)^(1/d), solved together
     (2) Omega_i = 1 + h_i/(d rho_i) sum_j m_j dW_i/dh
     (3) dv_i/dt = - sum_j m_j [ P_i/(Omega_i rho_i^2) grad W_i + P_j/(Omega_j rho_j^2) grad W_j
                                 + Pi_ij (grad W_i + grad W_j)/2 ]
     (4) du_i/dt = sum_j m_j [ P_i/(Omega_i rho_i^2) v_ij.grad W_i + Pi_ij/2 v_ij.(grad W_i +
                   grad W_j)/2 ], with the time-centred v: each pair's work and heat cancel
     (5) conduction (off by default): du_i/dt += sum_j m_j k sqrt(|P_i - P_j|/rho) (u_i - u_j)/rho
         times the gradient's component along the pair, rho the pair's mean
     (6) Balsara's factor |div|/(|div| + |curl| + 1e-4 c_i/h_i) from sum_j m_j (v_j - v_i) . grad
         W_i/rho_i and the same with a cross product, without Omega (the field div_v has 1/Omega_i)
   References: Springel & Hernquist 2002, eqs. 12-14; Price 2012 (J. Comput. Phys. 231), eqs. 10,
   30, 35, and 102 for the viscosity; Balsara 1995, eq. 12; Price 2008, eq. 34 (conduction).
   Needs: sph, eos. Read next: examples/sod.c.
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_GAS_)

typedef struct sphpa_gas_params {
    const sphpa_eos *eos; /* (materials) by the particles' material */
    int materials;
    double eta;   /* [1] h in units of the particles' spacing; 0 means 1.2 */
    double h_max; /* [m] h never exceeds it: a lone particle stays alone; 0: no bound */
    double h_tol; /* [1] a change of h by less ends the search for it: rho is then as good as about
                     ten times its square, Omega as itself; 0 means 3e-4 */
    double conduction; /* [1] k of (5); 0: off. Set it before sphpa_gas() */
    sphpa_viscosity viscosity;
} sphpa_gas_params;

/* Density, pressure, forces, energy, and Balsara's switch if viscosity.balsara is set when this is
   called. The parameters must outlive the simulation. Its setup: ERROR_MISSING (no equation of
   state), ERROR_NOT_FINITE and _RANGE (a parameter, a particle's material). */
SPHPA_DEF sphpa_module sphpa_gas(sphpa_gas_params *params);

/* ================================================================================================
   >>solid   elastic solids: continuity, tensor momentum, Hooke and Jaumann on particles
   ------------------------------------------------------------------------------------------------
   v_ij = v_i - v_j, x_ij = x_i - x_j, tension positive: sigma = S - P I, damaged
   sigma' = (1-D) S - (P < 0 ? (1-D) P : P) I. grad W is the mean of both particles' kernels.
     (1) C_i = M_i^-1, M_i = sum_j w_ij (x_j - x_i) outer grad W; blended into I/s_i, s_i = max(1,
         tr M_i/dim), where det(s_i C_i) goes from 5 to 8 (half a spacing behind a flat surface it is
         2 in 2-D and 3 in 3-D, on it and in corners 4 and more) or neighbours from 10 to 6 (2-D: 5
         to 3); the identity without `correction`. w_ij =
         m_j/(rho_i^p rho_j^(1-p)), p = 1/2 with the correction; without it p = 1, but 0 for
         another body's particles
     (2) L_i = [sum_j w_ij (v_j - v_i) outer grad W] C_i; for the continuity from all neighbours,
         but a particle that is not under pressure is not stretched by another body that leaves, nor
         a whole one by a broken one; for the stress of an undamaged particle from the undamaged
         ones of its own body. Where C is blended
         L = W + [.. - W M] C with W the rigid rotation of the neighbours: no false strain
     (3) rho = rho_n exp(-dt div v)    h = h0 (rho_h0/rho)^(1/dim), in [h_min, h_max] h0; h0 and
         rho_h0 are those at the start
     (4) dS/dt = 2 G (edot - tr edot/3 I) + W S - S W, the rotation exact
     (5) dv_i/dt = sum_j m_j (T_ij + T_ji - Pi I + f^n (R_i + R_j)) . grad W,
         m_j T_ij = w_ij sigma'_i C_i/rho_i,
         between different bodies (unless `bodies_stick`) and between a broken particle, D = 1, and
         one that is not (unless `any_neighbour`) -max(P, 0) I instead of sigma' C; a particle with
         such neighbours has C of the others, for what is not pressure
     (6) du_i/dt = - sum_j m_j v_ij . (T_ij + (-Pi I + f^n (R_i + R_j))/2) . grad W with the
         time-centred v: with the weights of (2) the heat is that of the particle's own stress,
         sigma':L/rho, also across a jump of rho, and the sum over a pair is the work of (5), so
         total energy is kept to rounding
     (7) R = -eps max(1, n.C n) sigma'/rho^2 in the principal directions n under tension, for it
         must keep up with sigma' C (our addition); f = W(r)/W(spacing)
   With one grad W for both particles linear momentum is exact; with C angular momentum is not.
   Why w_ij and not the volume m_j/rho_j: (2) must add up to the density that the particles have
   when a steep front has passed. With p = 0 a fourfold jump over three particles ends 20 % too
   dense, and P 40 % too high. Without C, p = 1 makes (3) the rate of the sum of m_j W where h does
   not change. With C any weights are exact for linear v; across a jump p = 0 errs one way, p = 1
   the other.
   Why I/s and not I: a particle much thinner than its neighbours counts each of them many times
   (M >> 1); with I it is stretched by as much, gets thinner still, and never comes back.
   References: Benz & Asphaug 1995 (CPC 87); Bonet & Lok 1999 (CMAME 180; correction); Monaghan
   2000 (JCP 159; artificial stress); Owen 2014 (compatible energy).
   Needs: sph, eos, strength. Read next: >>pores, >>plastic, >>cracks.
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_SOLID_)

typedef struct sphpa_solid_material {
    sphpa_eos eos; /* its K is the bulk modulus where one is needed */
    double G;      /* [Pa] shear modulus; 0: a fluid */
    double h_max;  /* [1] of (3), for this material; 0: that of the scene. Give more to what boils
                      away, or its particles lose each other and keep their pressure */
    int damage_in_yield; /* not 0: S is not multiplied by 1 - D, for its yield surface knows D */
} sphpa_solid_material;

/* Zeroed members are the defaults. */
typedef struct sphpa_solid_params {
    const sphpa_solid_material *material; /* (materials), by the particles' material */
    int materials;
    int correction;      /* not 0: kernel-gradient correction (1) */
    int any_neighbour;   /* not 0: L of (2) from all neighbours, also broken and foreign ones */
    int bodies_stick;    /* not 0: tension and shear act between different bodies */
    double artificial_stress;   /* [1] eps of (7); 0: none; 0.2 to 0.3 where bodies are stretched */
    double artificial_exponent; /* [1] n of (5); 0 means 4 */
    double spacing;  /* [1] of the particles in units of h, for (7); 0 means 1/1.2 */
    double h_min, h_max; /* [1] of (3); 0 means 0.6 and 1.5 */
    double rho_step; /* [1] largest relative change of rho in a step; 0 means 0.05 */
    double u_step;   /* [1] largest change of u in a step, relative to u + u_floor; 0 means 0.1 */
    double u_floor;  /* [J/kg] 0 means 0.01 K/rho0 of the material */
    sphpa_viscosity viscosity;
} sphpa_solid_params;

/* The module; *params and what it points to must outlive the simulation. Bodies feel each other
   through the kernel, at about its support. The default viscosity heats also where bodies bounce:
   set its a and b to -1 for a purely elastic one. At creation: ERROR_MISSING (no materials),
   ERROR_MATERIAL (no equation of state, G < 0, h_max below h_min), ERROR_NOT_FINITE and _RANGE (a
   parameter, a particle's material). */
SPHPA_DEF sphpa_module sphpa_solid(sphpa_solid_params *params);

/* ================================================================================================
   >>pores   P-alpha on particles
   ------------------------------------------------------------------------------------------------
   Replaces the pressure and the stress of >>solid: P and alpha solve the implicit problem of
   >>porosity from the alpha at the start of the step, whichever trial of it is under way; alpha is
   committed once a step. The bulk deviator follows
     dS/dt = (f/alpha) 2 G (edot - tr edot/3 I) + W S - S W - (S/alpha) dalpha/dt
   with f = clamp(ln(rho_s1/rho_s0)/ln(rho_1/rho_0), 0, 1) of the step itself while the deviator
   loads (S:edot >= 0), and 1 while it unloads. The dissipation is (1 - f) S:edot, so this is what
   keeps it from being negative: with f < 1 both ways (as published) a stress that is built up stiff
   and released soft gives back more than it took, and ringing pumice feeds on that.
   FLAT curves carry alpha alone; HERRMANN ones also the least alpha so far, where the elastic line
   starts. c, for the time step, is the matrix's, c^2 = c_s^2 + 4G/(3 rho_s), for elastic waves and
   releases travel at it. The viscosity goes by it as well, but where pores close by
     (1) c_visc = c_crush^(1-q) c^q,  q = ((alpha0 - alpha)/(alpha0 - 1))^3
   c_crush is the speed along the crush curve, many times slower while a weak front opens; with c
   that front would be spread over dozens of particles. With c_crush alone a front that nearly
   closes the pores is so thin that P overshoots, which closes them for good (pumice, 300 m/s: rho
   +5 %). q is small in the one and near 1 in the other; its power was found by pistons of 30 to
   1000 m/s against their Hugoniots (`porous_piston`): 2 widens weak fronts, 4 overshoots at 200.
   References: Jutzi, Benz & Michel 2008 (Icarus 198), sections 2.2 and 2.3.
   Needs: solid, porosity. Read next: >>plastic, >>cracks (which read alpha where it is there).
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_PORES_)

/* What the pores did so far, counted at the accepted ends of the steps. */
typedef struct sphpa_pores_stats {
    uint64_t solves, evaluations, fell_back; /* of every trial and commit */
    uint64_t loading;    /* particles' steps that ended on the curve */
    uint64_t grew;       /* particles' steps in which alpha grew: must stay 0 (FLAT) */
    double distance_max; /* largest |alpha - curve(P)|/(alpha0 - 1) of a loading particle */
} sphpa_pores_stats;

/* Zeroed members are the defaults. Particles start with alpha between 1 and the curve's alpha0. */
typedef struct sphpa_pores_params {
    const sphpa_solid_params *solid;      /* the scene's own */
    const sphpa_crush *crush;             /* (materials); alpha0 <= 1: a dense material; HERRMANN
                                             curves need sphpa_crush_prepare first */
    const sphpa_tillotson *const *matrix; /* (materials); NULL for a dense material */
    sphpa_palpha_options options;
    sphpa_pores_stats stats;
    sphpa_palpha_solver solver;
} sphpa_pores_params;

/* Set solid and crush before this call: the fields follow from them. Errors at sphpa_sim_create:
   _MISSING (a member, sphpa_solid() in the scene, an unprepared HERRMANN), _CURVE, _MATERIAL (also
   two different rho0), _ALPHA (outside [1, alpha0], forgotten), _RANGE (solver, tol, material). */
SPHPA_DEF sphpa_module sphpa_pores(sphpa_pores_params *params);

/* ================================================================================================
   >>plastic   yield on particles
   ------------------------------------------------------------------------------------------------
   After the elastic trial the bulk deviator is scaled back to the surface: S *= min(1, Y/(alpha
   sqrt(3 J2))) for von Mises, Y/(alpha sqrt(J2)) for the others, Y of >>strength at the matrix's
   pressure alpha P. alpha and D count where they are there.
   References: see >>strength; Jutzi et al. 2008 for 1/alpha.
   Needs: solid, strength. Read next: >>cracks.
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_PLASTIC_)

typedef struct sphpa_plastic_params {
    const sphpa_yield *yield; /* (materials), by the particles' material */
    int materials;
} sphpa_plastic_params;

SPHPA_DEF sphpa_module sphpa_plastic(sphpa_plastic_params *params);

/* ================================================================================================
   >>cracks   flaws and damage on particles
   ------------------------------------------------------------------------------------------------
   At setup the particles of each body share Weibull's flaws of the body's solid volume. In a step
   the local strain of the undamaged stress opens flaws, the cracks grow from the D13 at the step's
   start, and D = min(1, D13^3 + D_por), D_por of alpha where there are pores; n_act and D13 are
   committed once a step. >>solid applies D to the forces, once.
   References: see >>damage; Benz & Asphaug 1994, 1995; Jutzi et al. 2008, section 2.3 (D_por).
   Needs: solid, damage. Read next: >>fragments.
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_CRACKS_)

typedef struct sphpa_cracks_material {
    double k, m;   /* [m^-3] [1] Weibull's; k = 0: no flaws, no tensile damage */
    double alpha0; /* [1] of D_por; at most 1 (or 0): no compaction damage */
} sphpa_cracks_material;

/* Zeroed members are the defaults. */
typedef struct sphpa_cracks_params {
    const sphpa_solid_params *solid; /* the scene's own: K and G */
    const sphpa_cracks_material *material; /* (materials) */
    uint64_t seed;       /* of the flaws */
    int sampled;         /* not 0: drawn particle by particle, the walk over all flaws left out */
    int keep_all;        /* not 0: every flaw is kept, instead of two numbers a particle */
    double growth;       /* [1] of D13 in a step, at most; 0 means 0.15 */
    double *pool;        /* (pool_count) all thresholds, with keep_all; the module's */
    size_t pool_count;
    sphpa_damage_rule rule;
} sphpa_cracks_params;

SPHPA_DEF sphpa_module sphpa_cracks(sphpa_cracks_params *params);

/* ================================================================================================
   >>setup   lattices, spheres, boxes and bodies: the particles that a simulation starts with
   ------------------------------------------------------------------------------------------------
   A body of bulk density rho [kg/m3] and exact volume V [m^dim] that holds n points of a lattice:
       m = rho V / n [kg m^(dim-3)],   h = eta (V/n)^(1/dim) [m]                                (1)
   so that its mass is rho V to rounding, whatever the surface cuts off. In 2-D, V is an area and m
   the mass of one metre of depth; in 1-D, V is a length and m the mass of one square metre.
   Lattices and the volume of a cell that one particle fills, d being the distance of nearest
   neighbours ("spacing"):
       cubic      1-D d        2-D d^2               3-D d^3            2 dim neighbours        (2)
       hexagonal  1-D d        2-D sqrt(3)/2 d^2     3-D d^3/sqrt(2)    2, 6, 12 neighbours     (3)
   (3) is the triangular lattice and the hexagonal close packing: layers A B A B ... along z, in a
   right-angled cell of edges d, sqrt(3) d, sqrt(8/3) d with four points (two in 2-D).
   A turned lattice is rotated by a unit quaternion of four normal draws, which is uniform on SO(3),
   and moved by a uniform share of a cell.                                                      (4)
   A spinning body moves with v_i = v + spin x (x_i - xbar), xbar its centre of mass.           (5)
   References: Conway & Sloane 1999, Sphere Packings, Lattices and Groups, sec. 1.3 (packings);
   Shoemake 1992, Graphics Gems III, p. 124 (uniform rotations); Benz & Asphaug 1995, CPC 87,
   253 (why not an axis-aligned lattice: it cracks along its axes).
   Needs: particles. Read next: >>sph (sphpa_sim_create takes the set that is made here).
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_SETUP_)

typedef enum sphpa_lattice {
    SPHPA_LATTICE_CUBIC = 0,
    SPHPA_LATTICE_HEXAGONAL /* triangular in 2-D, hexagonal close packed in 3-D, cubic in 1-D */
} sphpa_lattice;

/* What a body is made of and how finely. Set rho, and spacing or count; the rest may be 0. */
typedef struct sphpa_body {
    double rho;     /* [kg/m3] bulk density (pores included), > 0 */
    double u;       /* [J/kg] specific internal energy, >= 0 */
    double alpha;   /* [1] distention, >= 1; 0 means 1 */
    double v[3];    /* [m/s] velocity; 0 on axes beyond the dimension */
    double spin[3]; /* [1/s] angular velocity about its centre of mass; in 2-D only spin[2] */
    double spacing; /* [m] distance of nearest neighbours; 0: follows from count */
    size_t count;   /* particles wanted, met as closely as the lattice allows; 0: from spacing */
    double eta;     /* [1] h = eta (volume of a particle)^(1/dim); 0 means 1.2 */
    double apart;   /* [1] see Bodies must not overlap, below; 0 means 0.3, negative: no check */
    uint64_t seed;  /* of the turned lattice (4); 0: not turned, symmetric about the centre */
    int32_t material; /* written to every particle: place in the scene's list of materials */
    int32_t body;     /* written to every particle: number of the body */
    sphpa_lattice lattice;
} sphpa_body;

/* An empty set with the basic fields and alpha. *p must not own anything (zeroed or freed).
   ERROR_RANGE (dim not 1, 2, 3), ERROR_MEMORY. */
SPHPA_DEF sphpa_result sphpa_make_begin(sphpa_particles *p, int dim, sphpa_error *err);

/* The makers add one body to *p and set x v m h rho u material body, and alpha where the set has
   it. A zeroed *p becomes a set for three dimensions (sphpa_make_begin for others). Positions on
   axes beyond the set's dimension are ignored and 0 in the set.

   Bodies must not overlap: ERROR_COINCIDENT, with the distance and the shift that cures it, if one
   of the particles that were there before lies inside the new body, or is closer to one of its
   particles than `apart` times the smaller (m/rho)^(1/dim) of the two. (A small body inside one
   of much coarser particles passes when it keeps that distance.)

   On any error *p is as it was. ERROR_MISSING (a NULL argument, neither spacing nor count, alpha
   above 1 and a set without that field), ERROR_NOT_FINITE, ERROR_NEGATIVE, ERROR_ALPHA (below 1),
   ERROR_RANGE (both spacing and count, an unknown lattice, an edge below half a spacing, v or
   spin on an axis that the dimension lacks, more than 2^31 - 1 particles), ERROR_EMPTY (the spacing
   is so large that no particle falls inside), ERROR_COINCIDENT, ERROR_MEMORY. */

/* A sphere, in 2-D a disc. Not turned, the lattice has a centre of symmetry in the sphere's centre,
   so the centre of mass is exact; counts then come in shells, while a turned lattice meets nearly
   every count exactly. In 1-D it is the box of that segment. */
SPHPA_DEF sphpa_result sphpa_make_sphere(sphpa_particles *p, const double centre[3], double radius,
                                         const sphpa_body *body, sphpa_error *err);

/* A box. Not turned, each edge holds a whole number of the lattice's right-angled cells, as near
   to the spacing as it gets, so the lattice is stretched a little along each axis and a periodic
   box of these corners tiles without a seam. A turned lattice is cut off at the faces. */
SPHPA_DEF sphpa_result sphpa_make_box(sphpa_particles *p, const double low[3],
                                      const double high[3], const sphpa_body *body,
                                      sphpa_error *err);

/* Not 0: the point x [m] belongs to the body. Called once or a few times for every point of the
   lattice within the corners, by one thread. */
typedef int (*sphpa_make_inside)(const double x[3], void *user);

/* A shape of the caller's own within the corners low and high [m]. volume [m^dim] is its exact
   volume; 0 means not known: then m = rho times the volume of the lattice's cell, and the mass
   is as good as the count of the cells. A symmetric lattice is centred between the corners. */
SPHPA_DEF sphpa_result sphpa_make_shape(sphpa_particles *p, sphpa_make_inside inside, void *user,
                                        const double low[3], const double high[3], double volume,
                                        const sphpa_body *body, sphpa_error *err);

/* The smallest distance [m] of a particle of body_a to one of body_b, of open space (periodic
   images are not looked at). ERROR_MISSING (a NULL argument), ERROR_RANGE (body_a = body_b),
   ERROR_EMPTY (no particles of one of them), ERROR_NOT_FINITE (a position), ERROR_MEMORY; *gap is
   then as it was. */
SPHPA_DEF sphpa_result sphpa_make_gap(const sphpa_particles *p, int32_t body_a, int32_t body_b,
                                      double *gap, sphpa_error *err);

/* Moves every particle of a body by dx [m], or adds v [m/s] to its velocity. Components beyond the
   dimension must be 0. ERROR_MISSING, ERROR_NOT_FINITE, ERROR_RANGE, ERROR_EMPTY (no such body). */
SPHPA_DEF sphpa_result sphpa_make_shift(sphpa_particles *p, int32_t body, const double dx[3],
                                        sphpa_error *err);
SPHPA_DEF sphpa_result sphpa_make_kick(sphpa_particles *p, int32_t body, const double v[3],
                                       sphpa_error *err);

/* ================================================================================================
   >>fragments   the mass spectrum of what friends of friends finds
   ------------------------------------------------------------------------------------------------
   Every particle has a linking length l_i = link support h_i [m], in which support h_i is the
   radius where its kernel ends. Two particles that are whole (D < damage_below) are linked if
       r_ij < (l_i + l_j)/2, strictly, of the nearest image                                     (1)
   and a fragment is what hangs together by links; one particle alone is a fragment too. Particles
   with D >= damage_below are dust: they belong to none and bridge nothing.
   Of a fragment with members i, all sums in the order of the ids:
       M = sum m_i   X = sum m_i x_i / M   V = sum m_i v_i / M   U = sum m_i u_i                (2)
       J = sum m_i (x_i - X) x (v_i - V)                                                        (3)
   The cumulative spectrum is N(>= M), the number of fragments of mass M or more.               (4)
   References: Davis et al. 1985, ApJ 292, 371 (friends of friends); Benz & Asphaug 1994, Icarus
   107, 98 (fragments of an SPH impact); Jutzi et al. 2009, Icarus 201, 802 (spectrum of pumice);
   Bai & Breen 2008, J. Graphics Tools 13, 53 (centre of mass in a periodic box).
   Needs: tree, particles. Read next: >>snapshot.
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_FRAGMENTS_)

/* Everything has a default at 0. */
typedef struct sphpa_fragment_options {
    double link;         /* [1] linking length in units of the kernel's support; 0 means 1 */
    double support;      /* [1] where the kernel ends, in units of h; 0 means 2 */
    double damage_below; /* [1] D of this and more is dust; 0 means 0.9; negative or above 1: no
                            dust. A set without D has none. */
    int one_body;        /* not 0: only the particles of `body` take part */
    int32_t body;        /* read where one_body is set */
} sphpa_fragment_options;

typedef struct sphpa_fragment {
    double mass;        /* [kg] */
    double centre[3];   /* [m] centre of mass; inside the box where it is periodic */
    double velocity[3]; /* [m/s] of the centre of mass */
    double angular[3];  /* [kg m2/s] angular momentum about the centre of mass, eq. 3 */
    double internal;    /* [J] internal energy */
    int64_t id;         /* smallest id of its particles */
    size_t count;       /* particles */
} sphpa_fragment;

#define SPHPA_FRAGMENT_DUST (-1)  /* label of a particle that is too damaged */
#define SPHPA_FRAGMENT_OTHER (-2) /* label of a particle that does not take part */

/* What was found. Zero it before the first call; free it with sphpa_fragment_free. */
typedef struct sphpa_fragments {
    size_t n;             /* labels: as many as there were particles */
    size_t count;         /* fragments */
    int32_t *label;       /* (n) place in list of each particle's fragment, or one of the above */
    sphpa_fragment *list; /* (count) by falling mass, equal masses by their smallest id */
    double mass;          /* [kg] of all that took part: fragments and dust */
    double dust;          /* [kg] mass of the dust */
    double dust_momentum[3]; /* [kg m/s] */
    size_t dust_count;       /* particles */
    sphpa_fragment_options options; /* as used, defaults filled in */
} sphpa_fragments;

/* Finds the fragments of the present state; periodic NULL: open space; options NULL: defaults. What
   *out held is freed on success; on any error *out is as it was. The answer, sums included, does
   not depend on the order of the particles, and labels follow them. On a periodic axis a fragment's
   centre and J are those of the images nearest to its centre, so they mean nothing where it spans
   more than half of the box.
   ERROR_MISSING (p or out NULL), ERROR_EMPTY (no particles, or none of the body), ERROR_NOT_FINITE
   (an option, x, v, m, h, u or D), ERROR_NEGATIVE (link, support, h or m), ERROR_RANGE (a linking
   length above half of the box), ERROR_OUTSIDE (a particle outside of it), ERROR_MEMORY. All
   damaged is no error: count is 0. */
SPHPA_DEF sphpa_result sphpa_fragment_find(const sphpa_particles *p, const sphpa_box *periodic,
                                           const sphpa_fragment_options *options,
                                           sphpa_fragments *out, sphpa_error *err);
SPHPA_DEF void sphpa_fragment_free(sphpa_fragments *fragments); /* leaves a zeroed struct */

/* The cumulative spectrum (4): mass[k] [kg] falls, number[k] is how many fragments have that mass
   or more; one entry for each mass that occurs. The arrays (NULL if unwanted) need room for
   fragments->count. Returns the number of entries. */
SPHPA_DEF size_t sphpa_fragment_cumulative(const sphpa_fragments *fragments, double *mass,
                                           size_t *number);

/* The largest fragment's share [1] of `total` [kg]; total 0 means all that took part. 0 if there is
   no fragment. An impact's target: find with one_body, or divide by the target's mass. */
SPHPA_DEF double sphpa_fragment_largest(const sphpa_fragments *fragments, double total);

/* ================================================================================================
   >>snapshot   HDF5 snapshots that other tools open as they are, and checkpoints to resume from
   ------------------------------------------------------------------------------------------------
   A snapshot stores each field once, under /PartType0, with SWIFT's names and in SI. /VTKHDF (read
   by ParaView and VTK) and the singular names (read by yt) are hard links to the same datasets:
     (1) value in SI = value in the file (U_L/100)^l (U_M/1000)^m (U_t)^t,
   U_L [cm], U_M [g], U_t [s] from /Units, exponents l, m, t from the dataset's attributes. Files of
   this program have U_L = 100, U_M = 1000, U_t = 1: every factor is 1.
   A checkpoint is a snapshot with all fields, and with what else a run needs under /sphpa. The run
   that wrote it and the run that resumes from it make the same steps, bit by bit.
   A file is made in memory (that takes as much memory as the file is long), written beside its
   final name as NAME.part with synchronous writes, then renamed: under the final name there is
   the old file or the new one, both whole, also after a crash or on a full disk.
   References: the SWIFT snapshot format (Schaller et al. 2024, MNRAS 530, 2378); the VTKHDF file
   format 1.0; HDF5 1.8 or later.
   Needs: sph; the HDF5 library. Read next: examples/read_snapshot.py.
   ============================================================================================== */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(SPHPA_WANT_SNAPSHOT_)

/* One setting of the scene, as text: {"Gas:viscosity_a", "1.0"}. */
typedef struct sphpa_setting {
    const char *key;   /* "Section:key"; each key once */
    const char *value; /* NULL counts as "" */
} sphpa_setting;

/* A block of the program's own, kept in a checkpoint: gauges, counters, names of files, ... */
typedef struct sphpa_blob {
    const char *name; /* unique; no '/' */
    const void *data; /* copied as it is: a file goes back to the same program and machine */
    size_t bytes;
} sphpa_blob;

/* What a file says beside the fields. Zeroed, or a NULL pointer to it, is fine. */
typedef struct sphpa_snapshot_info {
    const char *run;    /* name of the run; NULL: "sphpa" */
    const char *scheme; /* what is solved, in words; NULL: "sphpa" */
    const char *cflags; /* the compiler's flags; NULL: "unknown" */
    const sphpa_setting *settings; /* (settings_count) end up in /Parameters */
    int settings_count;
    const sphpa_blob *blobs; /* (blobs_count) used by sphpa_checkpoint_write alone */
    int blobs_count;
} sphpa_snapshot_info;

/* Writes the particles as they are (call sphpa_sim_refresh before for derived fields of this
   moment). All state and constant fields, columns, and derived ones of up to three components are
   written; rates and derived tensors are not. Positions beyond dim are 0. Use the extension .hdf:
   ParaView knows it. ERROR_FILE (no such directory, no permission, disk full: nothing is left, an
   older file stays), ERROR_RANGE (a setting or column that cannot be a name), ERROR_MEMORY. */
SPHPA_DEF sphpa_result sphpa_snapshot_write(const sphpa_sim *sim, const char *path,
                                            const sphpa_snapshot_info *info, sphpa_error *err);

/* Reads a snapshot as the start of a scene: one that this program wrote (columns included), or any
   file with SWIFT's layout in one piece; without /Units it is taken as SI. Needs Coordinates,
   Velocities, Masses, SmoothingLengths, Densities, InternalEnergies; takes along every other state
   and constant field of the table that is there. Without ParticleIDs they are numbered from 0. time
   [s] may be NULL. *out is a new set, to be freed by the caller; untouched on an error: ERROR_FILE
   (cannot be opened), ERROR_FORMAT (truncated, no HDF5, no such layout, a dataset is missing or has
   another shape, a cosmological run), ERROR_EMPTY, ERROR_MEMORY, those of sphpa_particles_check. */
SPHPA_DEF sphpa_result sphpa_snapshot_read(const char *path, sphpa_particles *out, double *time,
                                           sphpa_error *err);

/* Settles the simulation (sphpa_sim_settle: particles are sorted, so indices change) and writes all
   that a run needs to go on: every field, the clock, counts, what modules keep, and info's blobs.
   A state with NaN or the like is refused, so that a good checkpoint is not replaced by a bad one.
   Errors: as sphpa_snapshot_write, and those of sphpa_sim_settle and sphpa_particles_check. */
SPHPA_DEF sphpa_result sphpa_checkpoint_write(sphpa_sim *sim, const char *path,
                                              const sphpa_snapshot_info *info, sphpa_error *err);

/* Puts a simulation where the checkpoint was. *sim was created with the same scene, kernel,
   integrator and box, from any particles; they are replaced. Options that set the length of the
   step (cfl, dt_max, ..) stay those of *sim: smaller ones count from the first step on. On an error
   *sim is unchanged and usable: ERROR_FILE (cannot be opened), ERROR_FORMAT (truncated, no
   checkpoint, another version, precision or scene: the message says what differs), ERROR_MEMORY,
   those of sphpa_particles_check. */
SPHPA_DEF sphpa_result sphpa_checkpoint_read(sphpa_sim *sim, const char *path, sphpa_error *err);

/* Copies the blob `name` of a checkpoint to data, which has room for exactly `bytes`. ERROR_FILE,
   ERROR_FORMAT (no checkpoint, another length), ERROR_MISSING (no such blob); data is then
   untouched. */
SPHPA_DEF sphpa_result sphpa_checkpoint_blob(const char *path, const char *name, void *data,
                                             size_t bytes, sphpa_error *err);

/* The list of a run's snapshots for ParaView: path is NAME.hdf.series, names (count) are relative
   to its directory, times (count) [s] finite. Write it anew after each output. ERROR_FILE,
   ERROR_NOT_FINITE, ERROR_MEMORY. */
SPHPA_DEF sphpa_result sphpa_series_write(const char *path, const char *const *names,
                                          const double *times, size_t count, sphpa_error *err);

SPHPA_EXTERN_C_END_

#endif /* SPHPA_H */

/* from here on: the implementation, what is wanted of it */
#undef SPHPA_DEF
#define SPHPA_DEF SPHPA_LINK_(1)

#if SPHPA_WANT_BASE_ && !defined(SPHPA_BASE_DONE_)
#define SPHPA_BASE_DONE_
/* ================================================================================================
   >>base   implementation
   ============================================================================================== */
#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#ifdef _OPENMP
#include <omp.h>
#endif

SPHPA_EXTERN_C_BEGIN_

#define SPHPA_PRIVATE_ static SPHPA_UNUSED_
#define SPHPA_PI_ 3.14159265358979323846264338327950288

/* the allocator hook: define all three, or none */
#if !defined(SPHPA_MALLOC) && !defined(SPHPA_REALLOC) && !defined(SPHPA_FREE)
#define SPHPA_MALLOC(bytes) malloc(bytes)
#define SPHPA_REALLOC(pointer, bytes) realloc(pointer, bytes)
#define SPHPA_FREE(pointer) free(pointer)
#elif !defined(SPHPA_MALLOC) || !defined(SPHPA_REALLOC) || !defined(SPHPA_FREE)
#error "sphpa.h: define SPHPA_MALLOC, SPHPA_REALLOC and SPHPA_FREE, all three or none"
#endif

/* SPHPA_ASSERT: cheap, always on; SPHPA_VALIDATE: whole arrays, in test builds only */
#ifndef SPHPA_ASSERT
#include <assert.h>
#define SPHPA_ASSERT(condition) assert(condition)
#endif
#ifndef SPHPA_VALIDATE
#ifdef SPHPA_VALIDATE_ARRAYS
#define SPHPA_VALIDATE(condition) SPHPA_ASSERT(condition)
#else
#define SPHPA_VALIDATE(condition) ((void)0)
#endif
#endif

#define SPHPA_PRAGMA_(text) _Pragma(#text)
#ifdef _OPENMP
#define SPHPA_OMP(directive) SPHPA_PRAGMA_(omp directive)
#else
#define SPHPA_OMP(directive)
#endif
#if defined(_OPENMP) || defined(SPHPA_USE_OMP_SIMD)
#define SPHPA_SIMD SPHPA_PRAGMA_(omp simd)
#else
#define SPHPA_SIMD
#endif

typedef struct sphpa_result_text_ {
    const char *message, *hint;
} sphpa_result_text_;

SPHPA_PRIVATE_ sphpa_result_text_ sphpa_result_text_of_(sphpa_result result) {
#define SPHPA_RESULT_TEXT_(name, message, hint) {message, hint},
    static const sphpa_result_text_ table[] = {SPHPA_RESULTS(SPHPA_RESULT_TEXT_)};
#undef SPHPA_RESULT_TEXT_
    static const sphpa_result_text_ unknown = {"unknown result code", "check the value"};
    int code = (int)result;
    return code >= 0 && code < (int)SPHPA_RESULT_COUNT ? table[code] : unknown;
}

SPHPA_DEF const char *sphpa_result_message(sphpa_result result) {
    return sphpa_result_text_of_(result).message;
}

SPHPA_DEF const char *sphpa_result_hint(sphpa_result result) {
    return sphpa_result_text_of_(result).hint;
}

SPHPA_DEF sphpa_result sphpa_error_set(sphpa_error *err, sphpa_result result, const char *format,
                                       ...) {
    if (err != NULL) {
        va_list args;
        va_start(args, format);
        vsnprintf(err->message, sizeof err->message, format, args);
        va_end(args);
        err->result = result;
    }
    return result;
}

/* count * size bytes, or NULL when that overflows or there is no memory; never 0 bytes */
SPHPA_PRIVATE_ void *sphpa_alloc_(size_t count, size_t size) {
    if (size != 0 && count > ((size_t)-1) / size) return NULL;
    size_t bytes = count * size;
    return SPHPA_MALLOC(bytes > 0 ? bytes : 1);
}

/* makes room for `need` elements; keeps the old block when it fails */
SPHPA_PRIVATE_ bool sphpa_grow_(void **block, size_t *capacity, size_t need, size_t size) {
    if (need <= *capacity) return true;
    size_t room = *capacity + *capacity / 2 + 16;
    if (room < need) room = need;
    if (room > ((size_t)-1) / size) return false;
    void *grown = SPHPA_REALLOC(*block, room * size);
    if (grown == NULL) return false;
    *block = grown;
    *capacity = room;
    return true;
}

SPHPA_PRIVATE_ bool sphpa_finite_(double a) { return a - a == 0.0; }
SPHPA_FORCE_INLINE_ double sphpa_min_(double a, double b) { return a < b ? a : b; }
SPHPA_FORCE_INLINE_ double sphpa_max_(double a, double b) { return a > b ? a : b; }
SPHPA_FORCE_INLINE_ double sphpa_clamp_(double a, double low, double high) {
    return a < low ? low : (a > high ? high : a);
}

/* 2^k for a double k that is a whole number in [-1022, 1023]: adding 1.5 2^52 + 1023 leaves the
   biased exponent in the lowest bits of the significand; the shift drops all the others. */
SPHPA_FORCE_INLINE_ double sphpa_exp2_whole_(double k) {
    double shifted = k + (6755399441055744.0 + 1023.0), power;
    uint64_t bits;
    memcpy(&bits, &shifted, sizeof bits);
    bits <<= 52;
    memcpy(&power, &bits, sizeof power);
    return power;
}

/* exp(x) for x <= 0: at most 1.1 ulp off, also where the result is subnormal; 0 below -745.14; NaN
   for NaN. No table, no branch, no call: a compiler that may vectorise does so, and lane and scalar
   return the same bits (libm's exp would do neither). x = k ln2 + r with |r| <= ln2/2 (Cody & Waite
   1980: ln2 in two parts, the first of 32 bits, so that k ln2_high is exact), exp(r) = 1 + r +
   r^2 p(r), p minimax of degree 9 (Remez; relative error of exp(r) 3.7e-18), and 2^k in two
   factors, so that the only rounding of a subnormal result is that of the last product. */
SPHPA_FORCE_INLINE_ double sphpa_exp_(double x) {
    const double magic = 6755399441055744.0; /* 1.5 2^52: adding it rounds to a whole number */
    x = x < -746.0 ? -746.0 : x;
    double k = (x * 1.44269504088896340736 + magic) - magic;
    double r = (x - k * 6.93147180369123816490e-01) - k * 1.90821492927058770002e-10;
    double r2 = r * r, r4 = r2 * r2;
    double p03 = (0.5000000000000011 + 0.16666666666666413 * r) +
                 (0.041666666666530155 + 0.008333333333494465 * r) * r2;
    double p47 = (0.0013888888943630188 + 0.00019841269506571267 * r) +
                 (2.4801493098816138e-05 + 2.75575863808365e-06 * r) * r2;
    double p89 = 2.763024841408471e-07 + 2.500005928835836e-08 * r;
    double e = 1.0 + (r + r2 * (p03 + r4 * (p47 + r4 * p89)));
    double half = (0.5 * k + magic) - magic;
    return e * sphpa_exp2_whole_(half) * sphpa_exp2_whole_(k - half);
}

/* one bit of x changes about half of the result's: the output of splitmix64 from the state x */
SPHPA_PRIVATE_ uint64_t sphpa_mix_(uint64_t x) {
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

/* An LCG's streams are one sequence, shifted: what is near in seed or stream would stay near, and
   increments that differ in the highest bit alone give every other draw alike. So both are
   mixed. */
SPHPA_DEF sphpa_rng sphpa_rng_seed(uint64_t seed, uint64_t stream) {
    sphpa_rng rng;
    uint64_t mixed = sphpa_mix_(stream);
    rng.inc = (mixed << 1) | 1u;
    rng.state = sphpa_mix_(seed ^ mixed);
    return rng;
}

SPHPA_DEF uint32_t sphpa_rng_u32(sphpa_rng *rng) {
    uint64_t old = rng->state;
    rng->state = old * 6364136223846793005u + rng->inc;
    uint32_t mixed = (uint32_t)(((old >> 18) ^ old) >> 27);
    uint32_t turn = (uint32_t)(old >> 59);
    return (mixed >> turn) | (mixed << ((32u - turn) & 31u));
}

SPHPA_DEF uint32_t sphpa_rng_below(sphpa_rng *rng, uint32_t bound) {
    if (bound < 2) return 0;
    uint32_t threshold = (0u - bound) % bound; /* 2^32 mod bound: draws below it would be biased */
    for (;;) {
        uint32_t draw = sphpa_rng_u32(rng);
        if (draw >= threshold) return draw % bound;
    }
}

SPHPA_DEF double sphpa_rng_uniform(sphpa_rng *rng) {
    uint64_t high = sphpa_rng_u32(rng) >> 5, low = sphpa_rng_u32(rng) >> 6;
    return ((double)high * 67108864.0 + (double)low) / 9007199254740992.0;
}

SPHPA_DEF double sphpa_rng_normal(sphpa_rng *rng) { /* Box and Muller 1958, one of the pair */
    double radius = sqrt(-2.0 * log(1.0 - sphpa_rng_uniform(rng)));
    return radius * cos(2.0 * SPHPA_PI_ * sphpa_rng_uniform(rng));
}

/* one Jacobi rotation that clears A[p][q]; V gathers the rotations, a column a vector */
SPHPA_PRIVATE_ void sphpa_jacobi_rotate_(double A[3][3], double V[3][3], int p, int q) {
    if (A[p][q] == 0.0) return;
    double theta = (A[q][q] - A[p][p]) / (2.0 * A[p][q]);
    double t = fabs(theta) > 1e150 ? 0.5 / theta
                                   : (theta < 0.0 ? -1.0 : 1.0) /
                                         (fabs(theta) + sqrt(theta * theta + 1.0));
    double c = 1.0 / sqrt(t * t + 1.0), s = t * c, apq = A[p][q];
    int r = 3 - p - q;
    double arp = A[r][p], arq = A[r][q];
    A[p][p] -= t * apq;
    A[q][q] += t * apq;
    A[p][q] = A[q][p] = 0.0;
    A[r][p] = A[p][r] = c * arp - s * arq;
    A[r][q] = A[q][r] = s * arp + c * arq;
    for (int k = 0; k < 3; k++) {
        double vp = V[k][p], vq = V[k][q];
        V[k][p] = c * vp - s * vq;
        V[k][q] = s * vp + c * vq;
    }
}

SPHPA_DEF void sphpa_sym3_eigen(const sphpa_sym3 *S, double values[3], double vectors[3][3]) {
    double A[3][3] = {{S->xx, S->xy, S->xz}, {S->xy, S->yy, S->yz}, {S->xz, S->yz, S->zz}};
    double V[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    for (int sweep = 0; sweep < 12; sweep++) {
        double off = fabs(A[0][1]) + fabs(A[0][2]) + fabs(A[1][2]);
        double diagonal = fabs(A[0][0]) + fabs(A[1][1]) + fabs(A[2][2]);
        if (off <= 1e-18 * diagonal) break; /* NaN goes on, into every value */
        sphpa_jacobi_rotate_(A, V, 0, 1);
        sphpa_jacobi_rotate_(A, V, 0, 2);
        sphpa_jacobi_rotate_(A, V, 1, 2);
    }
    int order[3] = {0, 1, 2};
    for (int pass = 0; pass < 2; pass++)
        for (int k = 0; k < 2 - pass; k++)
            if (A[order[k]][order[k]] < A[order[k + 1]][order[k + 1]]) {
                int other = order[k];
                order[k] = order[k + 1];
                order[k + 1] = other;
            }
    for (int k = 0; k < 3; k++) values[k] = A[order[k]][order[k]];
    if (vectors == NULL) return;
    for (int k = 0; k < 2; k++)
        for (int r = 0; r < 3; r++) vectors[k][r] = V[r][order[k]];
    for (int r = 0; r < 3; r++) { /* right-handed whatever the sorting did */
        int a = (r + 1) % 3, b = (r + 2) % 3;
        vectors[2][r] = vectors[0][a] * vectors[1][b] - vectors[0][b] * vectors[1][a];
    }
}

SPHPA_DEF double sphpa_wall_clock(void) {
    struct timespec now;
    if (timespec_get(&now, TIME_UTC) != TIME_UTC) return (double)clock() / (double)CLOCKS_PER_SEC;
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

SPHPA_EXTERN_C_END_
#endif /* >>base */

#if SPHPA_WANT_KERNEL_ && !defined(SPHPA_KERNEL_DONE_)
#define SPHPA_KERNEL_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>kernel   implementation
   ============================================================================================== */

/* Each shape has w(q), its first and its second derivative, without the normalisation. The
   truncated powers keep the outer edge exact (no cancellation as q nears the support); near q = 0
   they would cancel in W', so the innermost piece of a spline is written out and blended in there:
   W' <= 0 everywhere, and W'/r is good for any r. A ?: would do for both, but without
   -fno-trapping-math gcc keeps it as a branch and does not vectorise the loop around it. */

/* x+, exactly; keeps a NaN */
SPHPA_FORCE_INLINE_ double sphpa_kernel_plus_(double x) { return 0.5 * (x + fabs(x)); }

/* inner where q < knot, outer elsewhere, exactly */
SPHPA_FORCE_INLINE_ double sphpa_kernel_blend_(double q, double knot, double inner, double outer) {
    double inside = 0.5 - copysign(0.5, q - knot); /* 1 or 0 */
    return inside * inner + (1.0 - inside) * outer;
}

SPHPA_FORCE_INLINE_ double sphpa_kernel_cubic_w_(double q) {
    double a = sphpa_kernel_plus_(2.0 - q), b = sphpa_kernel_plus_(1.0 - q);
    return 0.25 * (a * a * a) - b * b * b;
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_cubic_d1_(double q) {
    double a = sphpa_kernel_plus_(2.0 - q);
    double inner = q * (2.25 * q - 3.0), outer = -0.75 * (a * a);
    return sphpa_kernel_blend_(q, 1.0, inner, outer);
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_cubic_d2_(double q) {
    double a = sphpa_kernel_plus_(2.0 - q), b = sphpa_kernel_plus_(1.0 - q);
    return 1.5 * a - 6.0 * b;
}

SPHPA_FORCE_INLINE_ double sphpa_kernel_quartic_w_(double q) {
    double a = sphpa_kernel_plus_(2.5 - q), b = sphpa_kernel_plus_(1.5 - q),
           c = sphpa_kernel_plus_(0.5 - q);
    double aa = a * a, bb = b * b, cc = c * c;
    return aa * aa - 5.0 * (bb * bb) + 10.0 * (cc * cc);
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_quartic_d1_(double q) {
    double a = sphpa_kernel_plus_(2.5 - q), b = sphpa_kernel_plus_(1.5 - q);
    double inner = q * (24.0 * (q * q) - 30.0), outer = 20.0 * (b * b * b) - 4.0 * (a * a * a);
    return sphpa_kernel_blend_(q, 0.5, inner, outer);
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_quartic_d2_(double q) {
    double a = sphpa_kernel_plus_(2.5 - q), b = sphpa_kernel_plus_(1.5 - q),
           c = sphpa_kernel_plus_(0.5 - q);
    return 12.0 * (a * a) - 60.0 * (b * b) + 120.0 * (c * c);
}

SPHPA_FORCE_INLINE_ double sphpa_kernel_quintic_w_(double q) {
    double a = sphpa_kernel_plus_(3.0 - q), b = sphpa_kernel_plus_(2.0 - q),
           c = sphpa_kernel_plus_(1.0 - q);
    double aa = a * a, bb = b * b, cc = c * c;
    return aa * aa * a - 6.0 * (bb * bb * b) + 15.0 * (cc * cc * c);
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_quintic_d1_(double q) {
    double a = sphpa_kernel_plus_(3.0 - q), b = sphpa_kernel_plus_(2.0 - q);
    double aa = a * a, bb = b * b, qq = q * q;
    double inner = q * (qq * (120.0 - 50.0 * q) - 120.0);
    double outer = 30.0 * (bb * bb) - 5.0 * (aa * aa);
    return sphpa_kernel_blend_(q, 1.0, inner, outer);
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_quintic_d2_(double q) {
    double a = sphpa_kernel_plus_(3.0 - q), b = sphpa_kernel_plus_(2.0 - q),
           c = sphpa_kernel_plus_(1.0 - q);
    return 20.0 * (a * a * a) - 120.0 * (b * b * b) + 300.0 * (c * c * c);
}

/* Wendland: t = (1 - q/2)+, and m = min(q, 2) from it, so that the polynomial stays bounded; only
   the leading factor of W' is q itself, whose last bits m has lost where q is small */

SPHPA_FORCE_INLINE_ double sphpa_kernel_c2_w_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t, tt = t * t;
    return tt * tt * (1.0 + 2.0 * m);
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_c2_d1_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q);
    return -5.0 * q * (t * t * t);
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_c2_d2_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t;
    return t * t * (10.0 * m - 5.0);
}

SPHPA_FORCE_INLINE_ double sphpa_kernel_c4_w_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t, tt = t * t;
    return tt * tt * tt * (1.0 + m * (3.0 + (35.0 / 12.0) * m));
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_c4_d1_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t, tt = t * t;
    return -q * (tt * tt * t) * (14.0 / 3.0 + (35.0 / 3.0) * m);
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_c4_d2_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t, tt = t * t;
    return tt * tt * (m * ((245.0 / 6.0) * m - 28.0 / 3.0) - 14.0 / 3.0);
}

SPHPA_FORCE_INLINE_ double sphpa_kernel_c6_w_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t, tt = t * t, t4 = tt * tt;
    return t4 * t4 * (1.0 + m * (4.0 + m * (6.25 + 4.0 * m)));
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_c6_d1_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t, tt = t * t;
    return -q * (tt * tt * tt * t) * (5.5 + m * (19.25 + 22.0 * m));
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_c6_d2_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t, tt = t * t;
    return tt * tt * tt * (m * (m * (110.0 * m + 20.625) - 16.5) - 5.5);
}

/* the family of one dimension */
SPHPA_FORCE_INLINE_ double sphpa_kernel_line2_w_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t;
    return t * t * t * (1.0 + 1.5 * m);
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_line2_d1_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q);
    return -3.0 * q * (t * t);
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_line2_d2_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t;
    return t * (4.5 * m - 3.0);
}

SPHPA_FORCE_INLINE_ double sphpa_kernel_line4_w_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t, tt = t * t;
    return tt * tt * t * (1.0 + m * (2.5 + 2.0 * m));
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_line4_d1_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t, tt = t * t;
    return -q * (tt * tt) * (3.5 + 7.0 * m);
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_line4_d2_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t;
    return t * t * t * (m * (21.0 * m - 5.25) - 3.5);
}

SPHPA_FORCE_INLINE_ double sphpa_kernel_line6_w_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t, tt = t * t;
    return tt * tt * tt * t * (1.0 + m * (3.5 + m * (4.75 + 2.625 * m)));
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_line6_d1_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t, tt = t * t;
    return -q * (tt * tt * tt) * (4.5 + m * (13.5 + 13.125 * m));
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_line6_d2_(double q) {
    double t = sphpa_kernel_plus_(1.0 - 0.5 * q), m = 2.0 - 2.0 * t, tt = t * t;
    return tt * tt * t * (m * (m * (59.0625 * m + 14.625) - 11.25) - 4.5);
}

SPHPA_FORCE_INLINE_ double sphpa_kernel_gaussian_w_(double q) {
    return q >= 3.0 ? 0.0 : sphpa_exp_(-(q * q));
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_gaussian_d1_(double q) {
    return q >= 3.0 ? 0.0 : -2.0 * q * sphpa_exp_(-(q * q));
}
SPHPA_FORCE_INLINE_ double sphpa_kernel_gaussian_d2_(double q) {
    return q >= 3.0 ? 0.0 : (4.0 * (q * q) - 2.0) * sphpa_exp_(-(q * q));
}

/* case, shape: the numbers of sphpa_kernel, then the Wendland kernels of one dimension */
#define SPHPA_KERNEL_SHAPES_(X)                                                                    \
    X(0, cubic) X(1, quartic) X(2, quintic) X(3, c2) X(4, c4) X(5, c6) X(6, gaussian) X(7, line2)  \
    X(8, line4) X(9, line6)

SPHPA_PRIVATE_ bool sphpa_kernel_known_(sphpa_kernel k) {
    return (int)k >= 0 && (int)k < (int)SPHPA_KERNEL_COUNT;
}

SPHPA_PRIVATE_ int sphpa_kernel_shape_(sphpa_kernel k, int dim) {
    bool wendland = k == SPHPA_KERNEL_WENDLAND_C2 || k == SPHPA_KERNEL_WENDLAND_C4 ||
                    k == SPHPA_KERNEL_WENDLAND_C6;
    return dim == 1 && wendland ? (int)k + 4 : (int)k;
}

/* s of the table in the public half; k and dim are valid */
SPHPA_PRIVATE_ double sphpa_kernel_norm_(sphpa_kernel k, int dim) {
    static const double norm[7][3] = {
        {2.0 / 3.0, 10.0 / (7.0 * SPHPA_PI_), 1.0 / SPHPA_PI_},
        {1.0 / 24.0, 96.0 / (1199.0 * SPHPA_PI_), 1.0 / (20.0 * SPHPA_PI_)},
        {1.0 / 120.0, 7.0 / (478.0 * SPHPA_PI_), 1.0 / (120.0 * SPHPA_PI_)},
        {5.0 / 8.0, 7.0 / (4.0 * SPHPA_PI_), 21.0 / (16.0 * SPHPA_PI_)},
        {3.0 / 4.0, 9.0 / (4.0 * SPHPA_PI_), 495.0 / (256.0 * SPHPA_PI_)},
        {55.0 / 64.0, 39.0 / (14.0 * SPHPA_PI_), 1365.0 / (512.0 * SPHPA_PI_)},
        {0.56418958354775628695, 1.0 / SPHPA_PI_, 0.17958712212516656169}};
    return norm[(int)k][dim - 1];
}

/* the shape or its first or second derivative, not normalised */
SPHPA_PRIVATE_ double sphpa_kernel_value_(int shape, int order, double q) {
    switch (shape) {
#define SPHPA_KERNEL_CASE_(number, name)                                                           \
    case number:                                                                                   \
        return order == 0   ? sphpa_kernel_##name##_w_(q)                                          \
               : order == 1 ? sphpa_kernel_##name##_d1_(q)                                         \
                            : sphpa_kernel_##name##_d2_(q);
        SPHPA_KERNEL_SHAPES_(SPHPA_KERNEL_CASE_)
#undef SPHPA_KERNEL_CASE_
    default: return (double)NAN;
    }
}

SPHPA_PRIVATE_ bool sphpa_kernel_valid_(sphpa_kernel k, int dim, double r, double h) {
    return sphpa_kernel_known_(k) && dim >= 1 && dim <= 3 && r >= 0.0 && h > 0.0 &&
           sphpa_finite_(h);
}

/* h^n */
SPHPA_PRIVATE_ double sphpa_kernel_power_(double h, int n) {
    double power = h;
    for (int i = 1; i < n; i++) power *= h;
    return power;
}

/* equations (1) and (2), the derivative of that order */
SPHPA_PRIVATE_ double sphpa_kernel_scaled_(sphpa_kernel k, int dim, double r, double h,
                                           int order) {
    if (!sphpa_kernel_valid_(k, dim, r, h)) return (double)NAN;
    double q = r / h;
    if (q >= sphpa_kernel_support(k)) return 0.0;
    double value = sphpa_kernel_value_(sphpa_kernel_shape_(k, dim), order, q);
    return sphpa_kernel_norm_(k, dim) * value / sphpa_kernel_power_(h, dim + order);
}

SPHPA_DEF double sphpa_kernel_w(sphpa_kernel k, int dim, double r, double h) {
    return sphpa_kernel_scaled_(k, dim, r, h, 0);
}

SPHPA_DEF double sphpa_kernel_dw(sphpa_kernel k, int dim, double r, double h) {
    return sphpa_kernel_scaled_(k, dim, r, h, 1);
}

SPHPA_DEF double sphpa_kernel_d2w(sphpa_kernel k, int dim, double r, double h) {
    return sphpa_kernel_scaled_(k, dim, r, h, 2);
}

SPHPA_DEF double sphpa_kernel_dw_dh(sphpa_kernel k, int dim, double r, double h) {
    if (!sphpa_kernel_valid_(k, dim, r, h)) return (double)NAN;
    double q = r / h;
    if (q >= sphpa_kernel_support(k)) return 0.0;
    int shape = sphpa_kernel_shape_(k, dim);
    double sum = (double)dim * sphpa_kernel_value_(shape, 0, q) +
                 q * sphpa_kernel_value_(shape, 1, q);
    return -sphpa_kernel_norm_(k, dim) * sum / sphpa_kernel_power_(h, dim + 1); /* (3) */
}

SPHPA_DEF double sphpa_kernel_support(sphpa_kernel k) {
    static const double support[7] = {2.0, 2.5, 3.0, 2.0, 2.0, 2.0, 3.0};
    return sphpa_kernel_known_(k) ? support[(int)k] : (double)NAN;
}

SPHPA_DEF const char *sphpa_kernel_name(sphpa_kernel k) {
    static const char *const names[7] = {"cubic",       "quartic",     "quintic", "wendland-c2",
                                         "wendland-c4", "wendland-c6", "gaussian"};
    return sphpa_kernel_known_(k) ? names[(int)k] : "unknown";
}

SPHPA_DEF sphpa_result sphpa_kernel_find(const char *name, sphpa_kernel *out, sphpa_error *err) {
    for (int k = 0; name != NULL && k < (int)SPHPA_KERNEL_COUNT; k++)
        if (strcmp(name, sphpa_kernel_name((sphpa_kernel)k)) == 0) {
            *out = (sphpa_kernel)k;
            return SPHPA_OK;
        }
    return sphpa_error_set(err, SPHPA_ERROR_UNKNOWN,
                           "no kernel is called \"%.40s\"; the kernels are cubic, quartic, "
                           "quintic, wendland-c2, wendland-c4, wendland-c6 and gaussian",
                           name != NULL ? name : "(null)");
}

SPHPA_PRIVATE_ void sphpa_kernel_batch_w_(int shape, double norm, size_t n,
                                          const double *SPHPA_RESTRICT q,
                                          double *SPHPA_RESTRICT f) {
    switch (shape) {
#define SPHPA_KERNEL_CASE_(number, name)                                                           \
    case number:                                                                                   \
        for (size_t i = 0; i < n; i++) f[i] = norm * sphpa_kernel_##name##_w_(q[i]);               \
        break;
        SPHPA_KERNEL_SHAPES_(SPHPA_KERNEL_CASE_)
#undef SPHPA_KERNEL_CASE_
    default: break;
    }
}

SPHPA_PRIVATE_ void sphpa_kernel_batch_d1_(int shape, double norm, size_t n,
                                           const double *SPHPA_RESTRICT q,
                                           double *SPHPA_RESTRICT df) {
    switch (shape) {
#define SPHPA_KERNEL_CASE_(number, name)                                                           \
    case number:                                                                                   \
        for (size_t i = 0; i < n; i++) df[i] = norm * sphpa_kernel_##name##_d1_(q[i]);             \
        break;
        SPHPA_KERNEL_SHAPES_(SPHPA_KERNEL_CASE_)
#undef SPHPA_KERNEL_CASE_
    default: break;
    }
}
#undef SPHPA_KERNEL_SHAPES_

SPHPA_DEF void sphpa_kernel_shape_batch(sphpa_kernel k, int dim, size_t n,
                                        const double *SPHPA_RESTRICT q, double *SPHPA_RESTRICT f,
                                        double *SPHPA_RESTRICT df) {
    if (!sphpa_kernel_known_(k) || dim < 1 || dim > 3) {
        for (size_t i = 0; f != NULL && i < n; i++) f[i] = (double)NAN;
        for (size_t i = 0; df != NULL && i < n; i++) df[i] = (double)NAN;
        return;
    }
    int shape = sphpa_kernel_shape_(k, dim);
    double norm = sphpa_kernel_norm_(k, dim);
    if (f != NULL) sphpa_kernel_batch_w_(shape, norm, n, q, f);
    if (df != NULL) sphpa_kernel_batch_d1_(shape, norm, n, q, df);
}

SPHPA_EXTERN_C_END_
#endif /* >>kernel */

#if SPHPA_WANT_EOS_ && !defined(SPHPA_EOS_DONE_)
#define SPHPA_EOS_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>eos   implementation
   ============================================================================================== */

/* ---- Tillotson ------------------------------------------------------------------------------- */

/* Pressure and derivatives of one branch, before any cut-off. Who does not ask for the second
   derivative does not pay for it: all of this is inlined. */
typedef struct sphpa_tillotson_branch_ {
    double P, dP_drho, dP_du;
    double d2P_drho2, d2P_drho_du;
} sphpa_tillotson_branch_;

/* 1/w and 1/(w rho), written so that neither u >> E0 eta^2 nor eta -> 0 overflows; 0 for 0/0 */
SPHPA_FORCE_INLINE_ double sphpa_tillotson_inverse_w_(const sphpa_tillotson *mat, double u,
                                                      double eta, double *over_rho) {
    double q = mat->E0 * eta, sum = q * eta + u, inv = 1.0 / (sum > 1e-300 ? sum : 1e-300);
    *over_rho = q * inv * (1.0 / mat->rho0);
    return q * eta * inv;
}

/* eqs. (2), (5): the compressed state, and the cold one of any density */
SPHPA_FORCE_INLINE_ sphpa_tillotson_branch_ sphpa_tillotson_cold_(const sphpa_tillotson *mat,
                                                                  double rho, double u) {
    double inv_rho0 = 1.0 / mat->rho0, eta = rho * inv_rho0, mu = (rho - mat->rho0) * inv_rho0;
    double f_rho, f = sphpa_tillotson_inverse_w_(mat, u, eta, &f_rho), bf = mat->b * f;
    double B = mat->zero_B_expanded != 0 && rho < mat->rho0 ? 0.0 : mat->B;
    sphpa_tillotson_branch_ out;
    out.P = (mat->a + bf) * rho * u + (mat->A + B * mu) * mu;
    out.dP_drho = (mat->a + bf * (3.0 - 2.0 * f)) * u + (mat->A + 2.0 * B * mu) * inv_rho0;
    out.dP_du = rho * (mat->a + bf * f);
    out.d2P_drho2 = 2.0 * (mat->b * f_rho * u * (1.0 - f) * (3.0 - 4.0 * f) +
                           B * inv_rho0 * inv_rho0);
    out.d2P_drho_du = mat->a + bf * f * (5.0 - 4.0 * f);
    return out;
}

/* eqs. (3), (6): the vapour, rho < rho0. Without a branch: where the exponential of the cold terms
   is 0 to the last bit, z is not looked at, lest it overflows; 1e-140 keeps 1/rho^2 finite. */
SPHPA_FORCE_INLINE_ sphpa_tillotson_branch_ sphpa_tillotson_vapour_(const sphpa_tillotson *mat,
                                                                    double rho, double u) {
    double inv_rho0 = 1.0 / mat->rho0, inv_rho = 1.0 / (rho > 1e-140 ? rho : 1e-140);
    double far = (mat->rho0 - rho) * inv_rho, decay = mat->alpha * far * far;
    double z = decay > 700.0 ? 0.0 : far, mu = (rho - mat->rho0) * inv_rho0;
    double f_rho, f = sphpa_tillotson_inverse_w_(mat, u, rho * inv_rho0, &f_rho);
    double E = sphpa_exp_(decay > 700.0 ? -800.0 : -decay), A = mat->A * sphpa_exp_(-mat->beta * z);
    double dz = -(1.0 + z) * inv_rho, l = -2.0 * mat->alpha * z * dz; /* l: slope of ln E */
    double bf = mat->b * f, k = mat->beta * dz;
    double X = bf * rho * u + A * mu;
    double dX = bf * (3.0 - 2.0 * f) * u + A * (inv_rho0 - k * mu);
    double d2X = 2.0 * mat->b * f_rho * u * (1.0 - f) * (3.0 - 4.0 * f) +
                 A * (k * (k + 2.0 * inv_rho) * mu - 2.0 * k * inv_rho0);
    double d2l = 2.0 * mat->alpha * dz * inv_rho * (1.0 + 3.0 * z);
    sphpa_tillotson_branch_ out;
    out.P = mat->a * rho * u + E * X;
    out.dP_drho = mat->a * u + E * (dX + l * X);
    out.dP_du = mat->a * rho + E * (bf * f * rho);
    out.d2P_drho2 = E * (d2X + 2.0 * l * dX + (l * l + d2l) * X);
    out.d2P_drho_du = mat->a + E * (bf * f * (5.0 - 4.0 * f + l * rho));
    return out;
}

/* The blend (4), for u_iv < u < u_cv and rho < rho0. */
SPHPA_FORCE_INLINE_ sphpa_tillotson_branch_ sphpa_tillotson_blend_(
    const sphpa_tillotson *mat, double u, const sphpa_tillotson_branch_ *vapour,
    const sphpa_tillotson_branch_ *cold) {
    double slope = 1.0 / (mat->u_cv - mat->u_iv);
    double t = (u - mat->u_iv) * slope, s = (mat->u_cv - u) * slope;
    sphpa_tillotson_branch_ out;
    out.P = t * vapour->P + s * cold->P;
    out.dP_drho = t * vapour->dP_drho + s * cold->dP_drho;
    out.dP_du = t * vapour->dP_du + s * cold->dP_du + (vapour->P - cold->P) * slope;
    out.d2P_drho2 = t * vapour->d2P_drho2 + s * cold->d2P_drho2;
    out.d2P_drho_du = t * vapour->d2P_drho_du + s * cold->d2P_drho_du +
                      (vapour->dP_drho - cold->dP_drho) * slope;
    return out;
}

/* eqs. (1) to (7) without the cut-offs: what the sound speed is made of */
SPHPA_FORCE_INLINE_ sphpa_tillotson_branch_ sphpa_tillotson_uncut_(const sphpa_tillotson *mat,
                                                                   double rho, double u) {
    if (rho >= mat->rho0 || u <= mat->u_iv) return sphpa_tillotson_cold_(mat, rho, u);
    sphpa_tillotson_branch_ vapour = sphpa_tillotson_vapour_(mat, rho, u);
    if (u >= mat->u_cv) return vapour;
    sphpa_tillotson_branch_ cold = sphpa_tillotson_cold_(mat, rho, u);
    return sphpa_tillotson_blend_(mat, u, &vapour, &cold);
}

/* eq. (9): the least pressure that the cut-offs leave */
SPHPA_FORCE_INLINE_ double sphpa_tillotson_least_(const sphpa_tillotson *mat, double rho) {
    if (rho < mat->eta_cut * mat->rho0) return 0.0;
    return mat->tensile_limit > 0.0 ? -mat->tensile_limit : -DBL_MAX;
}

/* where a cut-off holds the pressure it is a constant, so all slopes are 0 */
SPHPA_FORCE_INLINE_ void sphpa_tillotson_cut_(const sphpa_tillotson *mat, double rho,
                                              sphpa_tillotson_branch_ *state) {
    double least = sphpa_tillotson_least_(mat, rho);
    if (state->P >= least) return;
    state->P = least;
    state->dP_drho = 0.0;
    state->dP_du = 0.0;
    state->d2P_drho2 = state->d2P_drho_du = 0.0;
}

/* Pressure and derivatives, cut-offs applied; no checks and no sound speed: for solvers that
   evaluate many times a state. rho > 0, u >= 0, a material that passed sphpa_tillotson_check. */
SPHPA_FORCE_INLINE_ void sphpa_tillotson_core_(const sphpa_tillotson *mat, double rho, double u,
                                               double *P, double *dP_drho, double *dP_du) {
    sphpa_tillotson_branch_ state = sphpa_tillotson_uncut_(mat, rho, u);
    sphpa_tillotson_cut_(mat, rho, &state);
    *P = state.P;
    *dP_drho = state.dP_drho;
    *dP_du = state.dP_du;
}

/* OK, or what is wrong with a (rho, u) */
SPHPA_FORCE_INLINE_ sphpa_result sphpa_eos_check_state_(double rho, double u) {
    if (rho > 0.0 && u >= 0.0 && rho <= DBL_MAX && u <= DBL_MAX) return SPHPA_OK;
    if (!sphpa_finite_(rho) || !sphpa_finite_(u)) return SPHPA_ERROR_NOT_FINITE;
    return SPHPA_ERROR_NEGATIVE;
}

/* *out = *point, unless something in it overflowed */
SPHPA_FORCE_INLINE_ sphpa_result sphpa_eos_deliver_(const sphpa_eos_point *point,
                                                    sphpa_eos_point *out) {
    if (!sphpa_finite_(point->P + point->dP_drho + point->dP_du + point->c))
        return SPHPA_ERROR_RANGE;
    *out = *point;
    return SPHPA_OK;
}

SPHPA_DEF sphpa_result sphpa_tillotson_eval(const sphpa_tillotson *mat, double rho, double u,
                                            sphpa_eos_point *out) {
    if (mat == NULL || out == NULL) return SPHPA_ERROR_MISSING;
    sphpa_result result = sphpa_eos_check_state_(rho, u);
    if (result != SPHPA_OK) return result;
    if (!(mat->rho0 > 0.0 && mat->A > 0.0 && mat->E0 > 0.0 && mat->u_iv >= 0.0 &&
          mat->u_cv > mat->u_iv))
        return SPHPA_ERROR_MATERIAL;
    sphpa_tillotson_branch_ state = sphpa_tillotson_uncut_(mat, rho, u);
    double inv_rho = 1.0 / rho;
    double c2 = state.dP_drho + (state.P * inv_rho) * (state.dP_du * inv_rho); /* eq. (8) */
    double floor2 = (mat->c2_floor > 0.0 ? mat->c2_floor : 0.01) * mat->A / mat->rho0;
    sphpa_tillotson_cut_(mat, rho, &state);
    sphpa_eos_point point;
    point.P = state.P;
    point.dP_drho = state.dP_drho;
    point.dP_du = state.dP_du;
    point.c = sqrt(c2 < floor2 ? floor2 : c2);
    return sphpa_eos_deliver_(&point, out);
}

/* One test of sphpa_tillotson_check: the field's name and value, and the range it must be in. */
typedef struct sphpa_eos_rule_ {
    const char *name;
    double value, low, high; /* low <= value <= high */
    int open;                /* not 0: low itself is not allowed */
    const char *range;
} sphpa_eos_rule_;

SPHPA_PRIVATE_ sphpa_result sphpa_eos_check_rules_(const sphpa_eos_rule_ *rules, size_t count,
                                                   const char *what, sphpa_error *err) {
    for (size_t i = 0; i < count; i++) {
        const sphpa_eos_rule_ *rule = &rules[i];
        bool low_ok = rule->open != 0 ? rule->value > rule->low : rule->value >= rule->low;
        if (low_ok && rule->value <= rule->high) continue; /* NaN fails both */
        return sphpa_error_set(err, SPHPA_ERROR_MATERIAL, "%s: %s is %g; it must be %s", what,
                               rule->name, rule->value, rule->range);
    }
    return SPHPA_OK;
}

SPHPA_DEF sphpa_result sphpa_tillotson_check(const sphpa_tillotson *mat, sphpa_error *err) {
    if (mat == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                               "Tillotson: no material (NULL); a name that sphpa_tillotson_find "
                               "does not know gives that");
    const double big = DBL_MAX;
    const char *positive = "positive and finite", *not_negative = "finite and not negative";
    const sphpa_eos_rule_ rules[] = {
        {"rho0", mat->rho0, 0.0, big, 1, positive},
        {"A", mat->A, 0.0, big, 1, positive},
        {"B", mat->B, -big, big, 0, "finite"},
        {"E0", mat->E0, 0.0, big, 1, positive},
        {"u_iv", mat->u_iv, 0.0, big, 0, not_negative},
        {"u_cv", mat->u_cv, mat->u_iv, big, 1, "finite and above u_iv"},
        {"a", mat->a, 0.0, big, 0, not_negative},
        {"b", mat->b, 0.0, big, 0, not_negative},
        {"alpha", mat->alpha, 0.0, big, 0, not_negative},
        {"beta", mat->beta, 0.0, big, 0, not_negative},
        {"c2_floor", mat->c2_floor, 0.0, 1.0, 0, "in [0, 1] (0 means 0.01)"},
        {"tensile_limit", mat->tensile_limit, 0.0, big, 0, "finite and not negative (0: none)"},
        {"eta_cut", mat->eta_cut, 0.0, 1.0, 0, "in [0, 1] (0: no cut-off)"},
    };
    return sphpa_eos_check_rules_(rules, sizeof rules / sizeof rules[0], "Tillotson", err);
}

/* ---- ideal gas and Murnaghan ----------------------------------------------------------------- */

SPHPA_DEF sphpa_result sphpa_ideal_eval(const sphpa_ideal *gas, double rho, double u,
                                        sphpa_eos_point *out) {
    if (gas == NULL || out == NULL) return SPHPA_ERROR_MISSING;
    sphpa_result result = sphpa_eos_check_state_(rho, u);
    if (result != SPHPA_OK) return result;
    if (!(gas->gamma > 1.0 && gas->gamma <= DBL_MAX)) return SPHPA_ERROR_MATERIAL;
    double g1 = gas->gamma - 1.0;
    sphpa_eos_point point;
    point.P = g1 * rho * u;
    point.dP_drho = g1 * u;
    point.dP_du = g1 * rho;
    point.c = sqrt(gas->gamma * g1 * u);
    return sphpa_eos_deliver_(&point, out);
}

SPHPA_DEF sphpa_result sphpa_murnaghan_eval(const sphpa_murnaghan *mat, double rho, double u,
                                            sphpa_eos_point *out) {
    if (mat == NULL || out == NULL) return SPHPA_ERROR_MISSING;
    sphpa_result result = sphpa_eos_check_state_(rho, u);
    if (result != SPHPA_OK) return result;
    if (!(mat->rho0 > 0.0 && mat->K > 0.0 && mat->n > 0.0 && mat->c2_floor >= 0.0))
        return SPHPA_ERROR_MATERIAL;
    /* expm1 and log1p: no digits are lost next to rho0, where solids live */
    double log_eta = fabs(rho - mat->rho0) < 0.5 * mat->rho0
                         ? log1p((rho - mat->rho0) / mat->rho0)
                         : log(rho / mat->rho0);
    double floor2 = (mat->c2_floor > 0.0 ? mat->c2_floor : 0.01) * mat->K / mat->rho0;
    sphpa_eos_point point;
    point.P = mat->K / mat->n * expm1(mat->n * log_eta);
    point.dP_drho = mat->K / mat->rho0 * exp((mat->n - 1.0) * log_eta);
    point.dP_du = 0.0;
    point.c = sqrt(point.dP_drho < floor2 ? floor2 : point.dP_drho);
    return sphpa_eos_deliver_(&point, out);
}

/* ---- any equation of state ------------------------------------------------------------------- */

SPHPA_PRIVATE_ sphpa_result sphpa_ideal_eval_any_(const void *material, double rho, double u,
                                                  sphpa_eos_point *out) {
    return sphpa_ideal_eval((const sphpa_ideal *)material, rho, u, out);
}

SPHPA_PRIVATE_ sphpa_result sphpa_murnaghan_eval_any_(const void *material, double rho, double u,
                                                      sphpa_eos_point *out) {
    return sphpa_murnaghan_eval((const sphpa_murnaghan *)material, rho, u, out);
}

SPHPA_PRIVATE_ sphpa_result sphpa_tillotson_eval_any_(const void *material, double rho, double u,
                                                      sphpa_eos_point *out) {
    return sphpa_tillotson_eval((const sphpa_tillotson *)material, rho, u, out);
}

SPHPA_PRIVATE_ sphpa_eos sphpa_eos_make_(const void *material, sphpa_eos_eval eval, double rho0,
                                         double K) {
    sphpa_eos eos;
    eos.material = material;
    eos.eval = eval;
    eos.rho0 = rho0;
    eos.K = K;
    return eos;
}

SPHPA_DEF sphpa_eos sphpa_ideal_eos(const sphpa_ideal *gas) {
    return sphpa_eos_make_(gas, sphpa_ideal_eval_any_, 0.0, 0.0);
}

SPHPA_DEF sphpa_eos sphpa_murnaghan_eos(const sphpa_murnaghan *mat) {
    double rho0 = mat != NULL ? mat->rho0 : 0.0, K = mat != NULL ? mat->K : 0.0;
    return sphpa_eos_make_(mat, sphpa_murnaghan_eval_any_, rho0, K);
}

SPHPA_DEF sphpa_eos sphpa_tillotson_eos(const sphpa_tillotson *mat) {
    double rho0 = mat != NULL ? mat->rho0 : 0.0, K = mat != NULL ? mat->A : 0.0;
    return sphpa_eos_make_(mat, sphpa_tillotson_eval_any_, rho0, K);
}

/* ---- the material table ---------------------------------------------------------------------- */

/* A row: name, {rho0, A, B, E0, u_iv, u_cv, a, b, alpha, beta, c2_floor, tensile_limit, eta_cut,
   zero_B_expanded}, G, Y, u_melt, weibull_k, weibull_m. 0 in the strength columns: unknown. All
   Tillotson parameters are those carried by the codes Spheral, miluphcuda and SWIFT. */
SPHPA_PRIVATE_ const sphpa_material *sphpa_material_table_(size_t *count) {
    static const sphpa_material table[] = {
        /* the codes' values; flaws: Benz & Asphaug 1999 */
        {"basalt",
         {2700.0, 2.67e10, 2.67e10, 4.87e8, 4.72e6, 1.82e7, 0.5, 1.5, 5.0, 5.0, 0.0, 0.0, 0.0, 0},
         22.7e9, 3.5e9, 3.4e6, 4e35, 9.0},
        /* the matrix of pumice: basalt's values at pumice's grain density. ASSUMPTION: its strength
           is basalt's; no source gives it, nor its flaws */
        {"pumice",
         {2327.0, 2.67e10, 2.67e10, 4.87e8, 4.72e6, 1.82e7, 0.5, 1.5, 5.0, 5.0, 0.0, 0.0, 0.0, 0},
         22.7e9, 3.5e9, 3.4e6, 0.0, 0.0},
        /* the codes' values; strength: lucite's. B = 0 in expansion because B > A: with B, torn
           nylon would push. It has no flaws here, so a scene should give it a
           tensile limit (no value is known) */
        {"nylon",
         {1185.0, 1.01e10, 3.38e10, 7.0e6, 2.0e6, 2.4e6, 0.6, 2.0, 10.0, 5.0, 0.0, 0.0, 0.0, 1},
         7.3e7, 1.0e7, 0.0, 0.0, 0.0},
        /* the codes' values; its strength is unknown */
        {"granite",
         {2680.0, 1.8e10, 1.8e10, 1.6e7, 3.5e6, 1.8e7, 0.5, 1.3, 5.0, 5.0, 0.0, 0.0, 0.0, 0},
         0.0, 0.0, 0.0, 0.0, 0.0},
        /* the codes' values */
        {"iron",
         {7800.0, 1.28e11, 1.05e11, 9.5e6, 2.4e6, 8.67e6, 0.5, 1.5, 5.0, 5.0, 0.0, 0.0, 0.0, 0},
         8.2e10, 3.5e8, 0.0, 0.0, 0.0},
        /* the codes' values; strength: the alloy 6061 */
        {"aluminium",
         {2700.0, 7.52e10, 6.5e10, 5.0e6, 3.0e6, 1.39e7, 0.5, 1.63, 5.0, 5.0, 0.0, 0.0, 0.0, 0},
         26.9e9, 2.76e8, 0.0, 0.0, 0.0},
        /* the codes' values; flaws: Benz & Asphaug 1999. B = 0 in expansion: with it the cold
           branch softens (dP/drho < 0) below eta = 1/2; above u_iv this does not help */
        {"ice",
         {917.0, 9.47e9, 9.47e9, 1.0e7, 7.73e5, 3.04e6, 0.3, 0.1, 10.0, 5.0, 0.0, 0.0, 0.0, 1},
         2.8e9, 1.0e9, 0.0, 1.4e38, 9.6},
        /* the codes' values; no strength. B = 0 in expansion: B > A */
        {"water",
         {998.0, 2.18e9, 1.325e10, 7.0e6, 4.19e5, 2.69e6, 0.7, 0.15, 10.0, 5.0, 0.0, 0.0, 0.0, 1},
         0.0, 0.0, 0.0, 0.0, 0.0},
    };
    *count = sizeof table / sizeof table[0];
    return table;
}

SPHPA_DEF size_t sphpa_material_count(void) {
    size_t count;
    (void)sphpa_material_table_(&count);
    return count;
}

SPHPA_DEF const sphpa_material *sphpa_material_at(size_t index) {
    size_t count;
    const sphpa_material *table = sphpa_material_table_(&count);
    return index < count ? &table[index] : NULL;
}

SPHPA_DEF const sphpa_material *sphpa_material_find(const char *name) {
    size_t count;
    const sphpa_material *table = sphpa_material_table_(&count);
    for (size_t i = 0; name != NULL && i < count; i++)
        if (strcmp(table[i].name, name) == 0) return &table[i];
    return NULL;
}

SPHPA_DEF const sphpa_tillotson *sphpa_tillotson_find(const char *name) {
    const sphpa_material *row = sphpa_material_find(name);
    return row != NULL ? &row->eos : NULL;
}

/* ---- a material from a text file ------------------------------------------------------------- */

/* What a line may set. The order is that of the list in the messages. */
typedef enum sphpa_material_kind_ {
    SPHPA_MATERIAL_TEXT_,   /* like, name */
    SPHPA_MATERIAL_NUMBER_, /* a double */
    SPHPA_MATERIAL_SWITCH_  /* 0 or 1, an int */
} sphpa_material_kind_;

typedef struct sphpa_material_key_ {
    const char *name;
    size_t offset; /* in sphpa_material */
    sphpa_material_kind_ kind;
    int required; /* not 0: must be given where there is no `like` */
} sphpa_material_key_;

enum { SPHPA_MATERIAL_KEYS_ = 21, SPHPA_MATERIAL_LINE_ = 256 };

/* one file being read */
typedef struct sphpa_material_reader_ {
    const char *path;
    FILE *file;
    sphpa_error *err;
    const sphpa_material *base;               /* the row of `like`, or NULL */
    sphpa_material mat;                       /* what was read so far */
    int set_on_line[SPHPA_MATERIAL_KEYS_];    /* 0: not yet */
    char text[SPHPA_MATERIAL_LINE_];
    int line;
} sphpa_material_reader_;

SPHPA_PRIVATE_ const sphpa_material_key_ *sphpa_material_keys_(void) {
#define SPHPA_EOS_KEY_(field, required)                                                            \
    {#field, offsetof(sphpa_material, eos.field), SPHPA_MATERIAL_NUMBER_, required}
#define SPHPA_MATERIAL_KEY_(field)                                                                 \
    {#field, offsetof(sphpa_material, field), SPHPA_MATERIAL_NUMBER_, 0}
    static const sphpa_material_key_ keys[SPHPA_MATERIAL_KEYS_] = {
        {"like", 0, SPHPA_MATERIAL_TEXT_, 0},
        {"name", offsetof(sphpa_material, name), SPHPA_MATERIAL_TEXT_, 1},
        SPHPA_EOS_KEY_(rho0, 1),
        SPHPA_EOS_KEY_(A, 1),
        SPHPA_EOS_KEY_(B, 1),
        SPHPA_EOS_KEY_(E0, 1),
        SPHPA_EOS_KEY_(u_iv, 1),
        SPHPA_EOS_KEY_(u_cv, 1),
        SPHPA_EOS_KEY_(a, 1),
        SPHPA_EOS_KEY_(b, 1),
        SPHPA_EOS_KEY_(alpha, 1),
        SPHPA_EOS_KEY_(beta, 1),
        SPHPA_EOS_KEY_(c2_floor, 0),
        SPHPA_EOS_KEY_(tensile_limit, 0),
        SPHPA_EOS_KEY_(eta_cut, 0),
        {"zero_B_expanded", offsetof(sphpa_material, eos.zero_B_expanded), SPHPA_MATERIAL_SWITCH_,
         0},
        SPHPA_MATERIAL_KEY_(G),
        SPHPA_MATERIAL_KEY_(Y),
        SPHPA_MATERIAL_KEY_(u_melt),
        SPHPA_MATERIAL_KEY_(weibull_k),
        SPHPA_MATERIAL_KEY_(weibull_m),
    };
#undef SPHPA_EOS_KEY_
#undef SPHPA_MATERIAL_KEY_
    return keys;
}

/* appends to a list of names, as far as there is room */
SPHPA_PRIVATE_ void sphpa_eos_list_(char *list, size_t size, const char *name) {
    size_t used = strlen(list);
    snprintf(list + used, size - used, "%s%.31s", used > 0 ? ", " : "", name);
}

SPHPA_PRIVATE_ bool sphpa_eos_blank_(char c) {
    return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\v' || c == '\f';
}

/* cuts the blanks off both ends, in place */
SPHPA_PRIVATE_ char *sphpa_eos_trim_(char *text) {
    while (sphpa_eos_blank_(*text)) text++;
    size_t length = strlen(text);
    while (length > 0 && sphpa_eos_blank_(text[length - 1])) length--;
    text[length] = '\0';
    return text;
}

/* how many decimal digits text starts with */
SPHPA_PRIVATE_ size_t sphpa_eos_digits_(const char *text) {
    size_t count = 0;
    while (text[count] >= '0' && text[count] <= '9') count++;
    return count;
}

/* [+-] digits [. digits] [e [+-] digits] and nothing else, whatever the program's locale is: strtod
   gets the locale's own decimal point, which printf shows. No hex, inf or nan. */
SPHPA_PRIVATE_ bool sphpa_eos_number_(const char *text, double *value) {
    size_t at = text[0] == '+' || text[0] == '-' ? 1 : 0;
    size_t whole = sphpa_eos_digits_(text + at), point = at + whole, fraction = 0;
    bool has_point = text[point] == '.';
    if (has_point) fraction = sphpa_eos_digits_(text + point + 1);
    if (whole + fraction == 0) return false;
    size_t end = point + (has_point ? 1 + fraction : 0);
    if (text[end] == 'e' || text[end] == 'E') {
        end += text[end + 1] == '+' || text[end + 1] == '-' ? 2 : 1;
        size_t exponent = sphpa_eos_digits_(text + end);
        if (exponent == 0) return false;
        end += exponent;
    }
    if (text[end] != '\0') return false;
    char local[SPHPA_MATERIAL_LINE_ + 16], half[16];
    snprintf(half, sizeof half, "%.1f", 0.5);         /* "0.5", or "0,5", ... */
    half[strlen(half) - 1] = '\0';                    /* leaves the zero and the point */
    snprintf(local, sizeof local, "%.*s%s%s", (int)point, text, has_point ? half + 1 : "",
             text + point + (has_point ? 1 : 0));
    char *stop;
    double number = strtod(local, &stop);
    if (*stop != '\0' || !sphpa_finite_(number)) return false;
    *value = number;
    return true;
}

SPHPA_PRIVATE_ sphpa_result sphpa_material_unknown_key_(const sphpa_material_reader_ *reader,
                                                        const char *name) {
    char list[256] = "";
    for (int k = 0; k < SPHPA_MATERIAL_KEYS_; k++)
        sphpa_eos_list_(list, sizeof list, sphpa_material_keys_()[k].name);
    return sphpa_error_set(reader->err, SPHPA_ERROR_UNKNOWN,
                           "%.120s:%d: unknown key \"%.32s\"; the keys are %s", reader->path,
                           reader->line, name, list);
}

/* `name = text` and `like = text` */
SPHPA_PRIVATE_ sphpa_result sphpa_material_set_text_(sphpa_material_reader_ *reader, bool is_like,
                                                     const char *value) {
    const size_t room = sizeof reader->mat.name;
    if (is_like) {
        reader->base = sphpa_material_find(value);
        if (reader->base != NULL) return SPHPA_OK;
        char list[256] = "";
        for (size_t i = 0; i < sphpa_material_count(); i++)
            sphpa_eos_list_(list, sizeof list, sphpa_material_at(i)->name);
        return sphpa_error_set(reader->err, SPHPA_ERROR_UNKNOWN,
                               "%.120s:%d: like = %.40s: no such material; the table has %s",
                               reader->path, reader->line, value, list);
    }
    if (strlen(value) >= room)
        return sphpa_error_set(reader->err, SPHPA_ERROR_PARSE,
                               "%.120s:%d: the name \"%.60s\" has %d characters; use at most %d",
                               reader->path, reader->line, value, (int)strlen(value),
                               (int)room - 1);
    memset(reader->mat.name, 0, room);
    memcpy(reader->mat.name, value, strlen(value));
    return SPHPA_OK;
}

/* stores one value where its key says */
SPHPA_PRIVATE_ sphpa_result sphpa_material_set_(sphpa_material_reader_ *reader, int k,
                                                const char *value) {
    const sphpa_material_key_ *key = &sphpa_material_keys_()[k];
    if (reader->set_on_line[k] > 0)
        return sphpa_error_set(reader->err, SPHPA_ERROR_PARSE,
                               "%.120s:%d: %s is given again (%.40s); it was set on line %d: "
                               "delete one of the two",
                               reader->path, reader->line, key->name, value,
                               reader->set_on_line[k]);
    reader->set_on_line[k] = reader->line;
    if (*value == '\0')
        return sphpa_error_set(reader->err, SPHPA_ERROR_PARSE,
                               "%.120s:%d: %s has no value; write it as \"%s = value\"",
                               reader->path, reader->line, key->name, key->name);
    if (key->kind == SPHPA_MATERIAL_TEXT_)
        return sphpa_material_set_text_(reader, strcmp(key->name, "like") == 0, value);
    double number;
    if (!sphpa_eos_number_(value, &number))
        return sphpa_error_set(reader->err, SPHPA_ERROR_PARSE,
                               "%.120s:%d: %s = %.60s is not a finite decimal number; write it "
                               "like 2700, 0.5 or 2.67e10, in SI units",
                               reader->path, reader->line, key->name, value);
    if (key->kind == SPHPA_MATERIAL_SWITCH_ && number != 0.0 && number != 1.0)
        return sphpa_error_set(reader->err, SPHPA_ERROR_PARSE,
                               "%.120s:%d: %s = %.60s; it is a switch: write 0 or 1",
                               reader->path, reader->line, key->name, value);
    int on = number != 0.0 ? 1 : 0;
    char *field = (char *)&reader->mat + key->offset;
    if (key->kind == SPHPA_MATERIAL_SWITCH_) memcpy(field, &on, sizeof on);
    else memcpy(field, &number, sizeof number);
    return SPHPA_OK;
}

/* one line: nothing, a comment, or key = value */
SPHPA_PRIVATE_ sphpa_result sphpa_material_line_(sphpa_material_reader_ *reader) {
    size_t length = strlen(reader->text);
    bool cut = length + 1 == sizeof reader->text && reader->text[length - 1] != '\n';
    if (cut)
        return sphpa_error_set(reader->err, SPHPA_ERROR_PARSE,
                               "%.120s:%d: the line is longer than %d characters; shorten it "
                               "(is this a text file?)",
                               reader->path, reader->line, SPHPA_MATERIAL_LINE_ - 2);
    char *comment = strchr(reader->text, '#');
    if (comment != NULL) *comment = '\0';
    char *name = sphpa_eos_trim_(reader->text);
    if (*name == '\0') return SPHPA_OK;
    char *equals = strchr(name, '=');
    if (equals == NULL)
        return sphpa_error_set(reader->err, SPHPA_ERROR_PARSE,
                               "%.120s:%d: \"%.60s\" has no equals sign; write \"key = value\"",
                               reader->path, reader->line, name);
    *equals = '\0';
    char *value = sphpa_eos_trim_(equals + 1);
    name = sphpa_eos_trim_(name);
    for (int k = 0; k < SPHPA_MATERIAL_KEYS_; k++)
        if (strcmp(sphpa_material_keys_()[k].name, name) == 0)
            return sphpa_material_set_(reader, k, value);
    return sphpa_material_unknown_key_(reader, name);
}

/* fills what the file left out from the row of `like`, or says what is missing */
SPHPA_PRIVATE_ sphpa_result sphpa_material_complete_(sphpa_material_reader_ *reader) {
    const sphpa_material_key_ *keys = sphpa_material_keys_();
    if (reader->base != NULL) {
        sphpa_material given = reader->mat;
        reader->mat = *reader->base;
        for (int k = 1; k < SPHPA_MATERIAL_KEYS_; k++) { /* 0 is like */
            size_t size = keys[k].kind == SPHPA_MATERIAL_NUMBER_   ? sizeof(double)
                          : keys[k].kind == SPHPA_MATERIAL_SWITCH_ ? sizeof(int)
                                                                   : sizeof given.name;
            if (reader->set_on_line[k] > 0)
                memcpy((char *)&reader->mat + keys[k].offset,
                       (const char *)&given + keys[k].offset, size);
        }
        return SPHPA_OK;
    }
    char list[256] = "";
    for (int k = 0; k < SPHPA_MATERIAL_KEYS_; k++)
        if (keys[k].required != 0 && reader->set_on_line[k] == 0)
            sphpa_eos_list_(list, sizeof list, keys[k].name);
    if (list[0] == '\0') return SPHPA_OK;
    return sphpa_error_set(reader->err, SPHPA_ERROR_MISSING,
                           "%.120s:%d: the file ends without %s; add these keys, or \"like = "
                           "basalt\" to start from a row of the table",
                           reader->path, reader->line, list);
}

/* the line that set a field a check complained about; the last line if none did */
SPHPA_PRIVATE_ int sphpa_material_line_of_(const sphpa_material_reader_ *reader,
                                           const char *message) {
    for (int k = 0; k < SPHPA_MATERIAL_KEYS_; k++) {
        char start[64];
        snprintf(start, sizeof start, ": %s is ", sphpa_material_keys_()[k].name);
        if (strstr(message, start) != NULL && reader->set_on_line[k] > 0)
            return reader->set_on_line[k];
    }
    return reader->line;
}

SPHPA_PRIVATE_ sphpa_result sphpa_material_verify_(const sphpa_material_reader_ *reader) {
    const sphpa_material *mat = &reader->mat;
    const char *range = "finite and not negative (0: unknown)";
    const sphpa_eos_rule_ rules[] = {
        {"G", mat->G, 0.0, DBL_MAX, 0, range},
        {"Y", mat->Y, 0.0, DBL_MAX, 0, range},
        {"u_melt", mat->u_melt, 0.0, DBL_MAX, 0, "finite and not negative (0: no softening)"},
        {"weibull_k", mat->weibull_k, 0.0, DBL_MAX, 0, range},
        {"weibull_m", mat->weibull_m, 0.0, DBL_MAX, 0, range},
    };
    sphpa_error why;
    sphpa_result result = sphpa_tillotson_check(&mat->eos, &why);
    if (result == SPHPA_OK)
        result = sphpa_eos_check_rules_(rules, sizeof rules / sizeof rules[0], "strength", &why);
    if (result == SPHPA_OK) return SPHPA_OK;
    return sphpa_error_set(reader->err, result, "%.120s:%d: %.300s", reader->path,
                           sphpa_material_line_of_(reader, why.message), why.message);
}

SPHPA_DEF sphpa_result sphpa_material_read(const char *path, sphpa_material *out,
                                           sphpa_error *err) {
    if (path == NULL || out == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                               "sphpa_material_read: path or out is NULL; pass both");
    sphpa_material_reader_ reader;
    memset(&reader, 0, sizeof reader);
    reader.path = path;
    reader.err = err;
    reader.file = fopen(path, "r");
    if (reader.file == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_FILE,
                               "%.200s: cannot open this material file; check the path and the "
                               "permissions",
                               path);
    sphpa_result result = SPHPA_OK;
    while (result == SPHPA_OK &&
           fgets(reader.text, (int)sizeof reader.text, reader.file) != NULL) {
        reader.line++;
        result = sphpa_material_line_(&reader);
    }
    if (result == SPHPA_OK && ferror(reader.file))
        result = sphpa_error_set(err, SPHPA_ERROR_FILE,
                                 "%.200s:%d: reading failed after this line; check that it is a "
                                 "plain file",
                                 path, reader.line);
    fclose(reader.file);
    if (result == SPHPA_OK) result = sphpa_material_complete_(&reader);
    if (result == SPHPA_OK) result = sphpa_material_verify_(&reader);
    if (result == SPHPA_OK) *out = reader.mat;
    return result;
}

SPHPA_EXTERN_C_END_
#endif /* >>eos */

#if SPHPA_WANT_POROSITY_ && !defined(SPHPA_POROSITY_DONE_)
#define SPHPA_POROSITY_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>porosity   implementation
   ============================================================================================== */

/* ---- crush curves ---------------------------------------------------------------------------- */

/* How a curve is evaluated; a constant argument where it has to be fast. */
typedef enum sphpa_crush_way_ {
    SPHPA_CRUSH_SQUARE_, /* 1 + k2 t^2 and FLAT: the quadratic curve */
    SPHPA_CRUSH_POWERS_, /* 1 + k1 q^n1 + k2 t^n2 and FLAT, whole exponents up to 64 */
    SPHPA_CRUSH_LANES_,  /* the same without a branch, for loops that the compiler vectorises */
    SPHPA_CRUSH_ANY_     /* anything */
} sphpa_crush_way_;

/* A curve boiled down for evaluation, alpha = 1 + k1 q^n1 + k2 t^n2 with t = (Ps - P)/R and q =
   (Pt - P)/Rt (0 above Pt); the quadratic curve is k1 = 0, n2 = 2. A place on it is s, which is t
   where k1 = 0, else q, negative above Pt: so none of the two terms loses digits however near Pt is
   to Pe. t = t0 + c s; P = P0 - Rt s for s > 0 and P0 - R c s else. */
typedef struct sphpa_crush_shape_ {
    double alpha0, top;     /* distention at rest, and where the curve begins (at Pe) */
    double Pe, Pt, Ps, end; /* end: alpha = 1 from here on (Pt where k2 = 0) */
    double R, inv_R, Rt;    /* Ps - Pe, Pt - Pe */
    double t0, c, P0, s_end; /* s_end: all closed; Pe is at s = 1 */
    double alpha_knee, slope_knee; /* at Pt; dalpha/ds above it */
    double k1, k2, n1, n2, inv_n1, inv_n2, n_most;
    int m1, m2; /* n1 - 1, n2 - 1 where these are small whole numbers, else -1 */
    sphpa_crush_way_ way;
    bool herrmann, dense;          /* dense: alpha0 = 1 */
    sphpa_crush_function function; /* NULL unless USER */
    const void *user;
    double scale; /* USER: amplitude of the caller's curve */
    double K0, k; /* HERRMANN: rho0 c_s^2, and hh = 1 + k (alpha - 1) */
} sphpa_crush_shape_;

SPHPA_DEF sphpa_crush sphpa_crush_quadratic(double alpha0, double Pe, double Ps) {
    sphpa_crush curve;
    memset(&curve, 0, sizeof curve);
    curve.alpha0 = alpha0;
    curve.Pe = Pe;
    curve.Ps = Ps;
    return curve;
}

SPHPA_DEF sphpa_crush sphpa_crush_pumice(void) {
    sphpa_crush curve = sphpa_crush_quadratic(4.64, 1.0e6, 2.13e8);
    curve.kind = SPHPA_CRUSH_TWO_EXPONENT;
    curve.Pt = 6.80e7;
    curve.alpha_e = 4.64;
    curve.alpha_t = 1.90;
    curve.n1 = 12.0;
    curve.n2 = 3.0;
    return curve;
}

SPHPA_DEF sphpa_crush sphpa_crush_porous_aluminium(void) {
    sphpa_crush curve = sphpa_crush_quadratic(1.275, 8.0e7, 7.0e8);
    curve.c_e = 4110.0;
    return curve;
}

/* the fit's own alpha_e */
SPHPA_FORCE_INLINE_ double sphpa_crush_alpha_e_(const sphpa_crush *curve) {
    return curve->alpha_e == 0.0 ? curve->alpha0 : curve->alpha_e; /* NaN stays NaN */
}

SPHPA_PRIVATE_ sphpa_result sphpa_crush_check_two_exponent_(const sphpa_crush *curve,
                                                            sphpa_error *err) {
    double alpha_e = sphpa_crush_alpha_e_(curve), alpha_t = curve->alpha_t;
    if (!sphpa_finite_(curve->Pt + curve->n1 + curve->n2 + alpha_e + alpha_t))
        return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                               "crush curve: Pt %g, alpha_e %g, alpha_t %g, n1 %g or n2 %g is not "
                               "finite",
                               curve->Pt, alpha_e, alpha_t, curve->n1, curve->n2);
    if (!(curve->Pe <= curve->Pt && curve->Pt <= curve->Ps))
        return sphpa_error_set(err, SPHPA_ERROR_CURVE,
                               "crush curve: Pt %g Pa is not between Pe %g and Ps %g Pa",
                               curve->Pt, curve->Pe, curve->Ps);
    if (!(alpha_t >= 1.0 && alpha_t <= alpha_e && alpha_e <= curve->alpha0))
        return sphpa_error_set(err, SPHPA_ERROR_CURVE,
                               "crush curve: need 1 <= alpha_t <= alpha_e <= alpha0, but alpha_t "
                               "is %g, alpha_e %g, alpha0 %g",
                               alpha_t, alpha_e, curve->alpha0);
    if (!(curve->n1 >= 1.0 && curve->n2 >= 1.0))
        return sphpa_error_set(err, SPHPA_ERROR_CURVE,
                               "crush curve: the exponents n1 %g and n2 %g must be at least 1",
                               curve->n1, curve->n2);
    if (alpha_e < curve->alpha0 && (curve->rescale == 0 || !(alpha_e > 1.0)))
        return sphpa_error_set(err, SPHPA_ERROR_CURVE,
                               "crush curve: alpha_e %.17g is below alpha0 %.17g, so alpha would "
                               "jump at Pe; make them equal or set rescale",
                               alpha_e, curve->alpha0);
    if (curve->Pt <= curve->Pe && alpha_t < alpha_e)
        return sphpa_error_set(err, SPHPA_ERROR_CURVE,
                               "crush curve: Pt = Pe = %g Pa, so alpha would jump from alpha_e %g "
                               "to alpha_t %g; raise Pt",
                               curve->Pe, alpha_e, alpha_t);
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_crush_check_user_(const sphpa_crush *curve, sphpa_error *err) {
    if (curve->function == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                               "crush curve: kind is USER but function is NULL");
    double slope = 0.0, near = 1e-9 * curve->alpha0;
    double first = curve->function(curve->user, curve->Pe, &slope);
    double last = curve->function(curve->user, curve->Ps, &slope);
    if (!(fabs(first - curve->alpha0) <= near && fabs(last - 1.0) <= near))
        return sphpa_error_set(err, SPHPA_ERROR_CURVE,
                               "crush curve: the function must fall from alpha0 %g at Pe to 1 at "
                               "Ps; it gives %.12g and %.12g",
                               curve->alpha0, first, last);
    return SPHPA_OK;
}

/* what every solve asks again; message or not, the tests are the same */
SPHPA_PRIVATE_ sphpa_result sphpa_crush_check_fields_(const sphpa_crush *curve, sphpa_error *err) {
    if (!sphpa_finite_(curve->alpha0) || curve->alpha0 < 1.0)
        return sphpa_error_set(
            err, sphpa_finite_(curve->alpha0) ? SPHPA_ERROR_CURVE : SPHPA_ERROR_NOT_FINITE,
            "crush curve: alpha0 is %g; it must be at least 1 (1 is a dense material)",
            curve->alpha0);
    if (!(curve->alpha0 > 1.0)) return SPHPA_OK;
    if (!sphpa_finite_(curve->Pe) || !sphpa_finite_(curve->Ps))
        return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                               "crush curve: Pe %g or Ps %g is not finite", curve->Pe, curve->Ps);
    if (!(curve->Pe >= 0.0 && curve->Pe < curve->Ps))
        return sphpa_error_set(err, SPHPA_ERROR_CURVE,
                               "crush curve: need 0 <= Pe < Ps, but Pe is %g and Ps %g Pa%s",
                               curve->Pe, curve->Ps,
                               curve->Pe > curve->Ps ? " (the curve is upside down)" : "");
    if (curve->elastic != SPHPA_CRUSH_FLAT && curve->elastic != SPHPA_CRUSH_HERRMANN)
        return sphpa_error_set(err, SPHPA_ERROR_CURVE, "crush curve: no elastic branch %d",
                               (int)curve->elastic);
    if (curve->elastic == SPHPA_CRUSH_HERRMANN && !sphpa_finite_(curve->c_e))
        return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                               "crush curve: c_e %g is not finite; 0 takes c_s/2", curve->c_e);
    if (curve->kind == SPHPA_CRUSH_QUADRATIC) return SPHPA_OK;
    if (curve->kind == SPHPA_CRUSH_TWO_EXPONENT)
        return sphpa_crush_check_two_exponent_(curve, err);
    if (curve->kind != SPHPA_CRUSH_USER)
        return sphpa_error_set(err, SPHPA_ERROR_CURVE, "crush curve: no kind %d",
                               (int)curve->kind);
    if (curve->function == NULL) return sphpa_crush_check_user_(curve, err);
    return SPHPA_OK;
}

SPHPA_DEF sphpa_result sphpa_crush_check(const sphpa_crush *curve, sphpa_error *err) {
    if (curve == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING, "crush curve: the pointer is NULL");
    sphpa_result result = sphpa_crush_check_fields_(curve, err);
    if (result != SPHPA_OK || !(curve->alpha0 > 1.0)) return result;
    if (curve->kind == SPHPA_CRUSH_USER) return sphpa_crush_check_user_(curve, err);
    return SPHPA_OK;
}

/* x^n with three derivatives, for x >= 0 and n >= 1; m = n - 1 if that is a small whole number, as it
   is known to be if `whole` */
typedef struct sphpa_crush_power_ {
    double value, d1, d2, d3;
} sphpa_crush_power_;

SPHPA_NO_INLINE_ double sphpa_crush_pow_(double x, double y) { return pow(x, y); }

SPHPA_FORCE_INLINE_ sphpa_crush_power_ sphpa_crush_power_of_(double x, double n, int m,
                                                             bool whole) {
    double y = 1.0, square = x, slope = n * (n - 1.0); /* y: x^(m-2), then up */
    sphpa_crush_power_ out;
    out.d2 = out.d3 = 0.0;
    if (m > 1) {
        for (int bits = m - 2; bits != 0; bits >>= 1) {
            if (bits & 1) y *= square;
            square *= square;
        }
        out.d3 = slope * (n - 2.0) * y;
        y *= x;
    }
    if (m > 0) {
        out.d2 = slope * y;
        y *= x;
    } else if (m < 0 && !whole) {
        y = sphpa_crush_pow_(x, n - 1.0);
        if (x > 0.0) out.d2 = slope * y / x;
    }
    out.d1 = n * y;
    out.value = x * y;
    return out;
}

/* for whole exponents up to 18, without a branch that depends on x */
enum { SPHPA_CRUSH_LANE_MOST_ = 17 };

SPHPA_FORCE_INLINE_ sphpa_crush_power_ sphpa_crush_power_lane_(double x, double n, int m) {
    double x2 = x * x, x4 = x2 * x2, x8 = x4 * x4;
    int bits = m > 1 ? m - 2 : 0; /* below 16; of the call, not of the lane */
    double y = ((bits & 1 ? x : 1.0) * (bits & 2 ? x2 : 1.0)) *
               ((bits & 4 ? x4 : 1.0) * (bits & 8 ? x8 : 1.0));
    sphpa_crush_power_ out;
    out.d3 = n * (n - 1.0) * (n - 2.0) * y; /* m is 1 or 0: a factor is 0 */
    y = m > 1 ? y * x : 1.0;
    out.d2 = n * (n - 1.0) * y;
    y = m > 0 ? y * x : 1.0;
    out.d1 = n * y;
    out.value = x * y;
    return out;
}

SPHPA_FORCE_INLINE_ int sphpa_crush_whole_(double n) {
    return n >= 1.0 && n <= 64.0 && n - floor(n) <= 0.0 ? (int)n - 1 : -1;
}

SPHPA_PRIVATE_ void sphpa_crush_shape_line_(const sphpa_crush *curve, sphpa_crush_shape_ *shape) {
    double c_s = curve->c_s, c_e = curve->c_e > 0.0 ? curve->c_e : 0.5 * c_s;
    shape->k = (c_e - c_s) / (c_s * (curve->alpha0 - 1.0));
    shape->K0 = curve->K0;
}

SPHPA_PRIVATE_ void sphpa_crush_shape_powers_(const sphpa_crush *curve, sphpa_crush_shape_ *shape) {
    double alpha_e = sphpa_crush_alpha_e_(curve), rise = shape->top - 1.0;
    double grow = curve->rescale != 0 && alpha_e > 1.0 ? rise / (alpha_e - 1.0) : 1.0;
    shape->Pt = curve->Pt;
    shape->n1 = curve->n1;
    shape->n2 = curve->n2;
    shape->n_most = sphpa_max_(shape->n1, shape->n2);
    shape->m1 = sphpa_crush_whole_(shape->n1);
    shape->m2 = sphpa_crush_whole_(shape->n2);
    shape->inv_n1 = 1.0 / shape->n1;
    shape->inv_n2 = 1.0 / shape->n2;
    shape->k2 = sphpa_min_(grow * (curve->alpha_t - 1.0), rise);
    shape->k1 = curve->Pt > curve->Pe ? rise - shape->k2 : 0.0;
    if (!(shape->k2 > 0.0)) shape->end = curve->Pt;
    if (shape->k1 > 0.0) {
        shape->Rt = curve->Pt - curve->Pe;
        shape->t0 = (curve->Ps - curve->Pt) * shape->inv_R;
        shape->c = sphpa_max_(shape->Rt * shape->inv_R, 1e-25); /* below it t does not move */
        shape->P0 = curve->Pt;
        shape->s_end = -shape->t0 / shape->c;
        sphpa_crush_power_ at = sphpa_crush_power_of_(shape->t0, shape->n2, shape->m2, false);
        shape->alpha_knee = 1.0 + shape->k2 * at.value;
        shape->slope_knee = shape->k2 * shape->c * at.d1;
    }
    if (shape->k1 > 0.0 || shape->m2 != 1)
        shape->way = shape->m1 >= 0 && shape->m2 >= 0 ? SPHPA_CRUSH_POWERS_ : SPHPA_CRUSH_ANY_;
}

/* of a curve that passed sphpa_crush_check_fields_ */
SPHPA_FORCE_INLINE_ void sphpa_crush_shape_of_(const sphpa_crush *curve,
                                               sphpa_crush_shape_ *shape) {
    shape->alpha0 = shape->top = curve->alpha0;
    shape->dense = !(curve->alpha0 > 1.0);
    shape->herrmann = curve->elastic == SPHPA_CRUSH_HERRMANN;
    shape->way = SPHPA_CRUSH_SQUARE_;
    shape->function = NULL;
    shape->Pe = shape->Pt = curve->Pe;
    shape->Ps = shape->end = curve->Ps;
    shape->R = curve->Ps - curve->Pe;
    shape->inv_R = 1.0 / shape->R;
    shape->Rt = shape->R;
    shape->P0 = shape->Ps;
    shape->t0 = shape->s_end = 0.0;
    shape->c = shape->alpha_knee = 1.0;
    shape->slope_knee = 0.0;
    shape->k1 = 0.0;
    shape->k2 = shape->top - 1.0;
    shape->n1 = shape->n2 = shape->n_most = 2.0;
    shape->inv_n1 = shape->inv_n2 = 0.5;
    shape->m1 = shape->m2 = 1;
    if (shape->dense) return;
    if (shape->herrmann) {
        sphpa_crush_shape_line_(curve, shape);
        shape->top = curve->alpha_y > 0.0 ? curve->alpha_y : curve->alpha0;
        shape->k2 = shape->top - 1.0;
    }
    if (curve->kind == SPHPA_CRUSH_TWO_EXPONENT) sphpa_crush_shape_powers_(curve, shape);
    if (curve->kind == SPHPA_CRUSH_USER) {
        shape->function = curve->function;
        shape->user = curve->user;
        shape->scale = (shape->top - 1.0) / (shape->alpha0 - 1.0);
        shape->way = SPHPA_CRUSH_ANY_;
    }
    if (shape->herrmann) shape->way = SPHPA_CRUSH_ANY_;
}

SPHPA_NO_INLINE_ double sphpa_crush_curve_user_(const sphpa_crush_shape_ *shape, double P,
                                                double *slope) {
    double alpha = shape->function(shape->user, P, slope);
    *slope *= shape->scale;
    return sphpa_clamp_(1.0 + shape->scale * (alpha - 1.0), 1.0, shape->top);
}

/* eqs. 2 and 3, without a branch */
SPHPA_FORCE_INLINE_ double sphpa_crush_curve_lane_(const sphpa_crush_shape_ *shape,
                                                   sphpa_crush_way_ way, double P) {
    double p = sphpa_clamp_(P, shape->Pe, shape->Ps), t = (shape->Ps - p) * shape->inv_R, alpha;
    if (way == SPHPA_CRUSH_SQUARE_) {
        alpha = 1.0 + shape->k2 * (t * t);
    } else {
        double q = sphpa_max_(shape->Pt - p, 0.0) / shape->Rt;
        alpha = shape->k2 * sphpa_crush_power_lane_(t, shape->n2, shape->m2).value +
                shape->k1 * sphpa_crush_power_lane_(q, shape->n1, shape->m1).value + 1.0;
    }
    alpha = P < shape->Pe ? shape->top : sphpa_min_(alpha, shape->top);
    return P > shape->Ps ? 1.0 : alpha;
}

/* eqs. 2 and 3, with the flat continuation on both sides; *slope is that of the crushing side */
SPHPA_FORCE_INLINE_ double sphpa_crush_curve_(const sphpa_crush_shape_ *shape, sphpa_crush_way_ way,
                                              double P, double *slope) {
    double t = (shape->Ps - P) * shape->inv_R;
    *slope = 0.0;
    if (P < shape->Pe) return shape->top;
    if (P > shape->Ps) return 1.0;
    if (way == SPHPA_CRUSH_SQUARE_) {
        *slope = -2.0 * shape->k2 * t * shape->inv_R;
        return sphpa_min_(1.0 + shape->k2 * (t * t), shape->top);
    }
    if (way == SPHPA_CRUSH_ANY_ && shape->function != NULL)
        return sphpa_crush_curve_user_(shape, P, slope);
    bool whole = way == SPHPA_CRUSH_POWERS_;
    sphpa_crush_power_ second = sphpa_crush_power_of_(t, shape->n2, shape->m2, whole);
    double alpha = shape->k2 * second.value, fall = shape->k2 * second.d1;
    if (P < shape->Pt && shape->k1 > 0.0) {
        double q = (shape->Pt - P) / shape->Rt;
        sphpa_crush_power_ first = sphpa_crush_power_of_(q, shape->n1, shape->m1, whole);
        if (!whole && q > 0.5) /* what 1 - q has lost of its digits, by a high power */
            first.value += first.d1 * ((1.0 - q) - (P - shape->Pe) / shape->Rt);
        alpha += shape->k1 * first.value;
        fall += shape->k1 * first.d1 * (shape->R / shape->Rt);
    }
    *slope = -fall * shape->inv_R;
    return sphpa_min_(1.0 + alpha, shape->top);
}

/* ---- Herrmann's elastic lines ---------------------------------------------------------------- */

/* eq. 5, dalpha/dP of the line through alpha */
SPHPA_PRIVATE_ double sphpa_crush_line_slope_(const sphpa_crush_shape_ *shape, double alpha) {
    double y = shape->k * (alpha - 1.0), hh = 1.0 + y;
    return alpha * alpha / shape->K0 * (y * (2.0 + y)) / (hh * hh);
}

/* log(1 + a) - b, for a > -1 and a - b = rest, to the last digits where a is small: log(1 + a) - a by
   its series in a/(2 + a) */
SPHPA_PRIVATE_ double sphpa_crush_log1p_less_(double a, double b, double rest) {
    double r = a / (2.0 + a), r2 = r * r, sum = 0.0;
    if (fabs(r) > 0.1) return log1p(a) - b;
    for (int k = 17; k >= 3; k -= 2) sum = 1.0 / k + r2 * sum;
    return rest + (2.0 * r * r2 * sum - a * r);
}

/* The integral of dP/dalpha of eq. 5 from alpha = from to `to` by Gauss's rule of 12 places: to the
   last digits where alpha - 1 does not double, for its poles are that far away. */
SPHPA_PRIVATE_ double sphpa_crush_gauss_(const sphpa_crush_shape_ *shape, double from, double to) {
    static const double place[6] = {0.12523340851146891547, 0.36783149899818019375,
                                    0.58731795428661744730, 0.76990267419430468704,
                                    0.90411725637047485668, 0.98156063424671925069};
    static const double weight[6] = {0.24914704581340278500, 0.23349253653835480876,
                                     0.20316742672306592175, 0.16007832854334622633,
                                     0.10693932599531843096, 0.04717533638651182719};
    double half = 0.5 * (to - from), middle = from + half, sum = 0.0;
    for (int i = 0; i < 6; i++) {
        double step = half * place[i];
        sum += weight[i] * (1.0 / sphpa_crush_line_slope_(shape, middle - step) +
                            1.0 / sphpa_crush_line_slope_(shape, middle + step));
    }
    return half * sum;
}

/* Phi(to) - Phi(from), Phi the integral of dP/dalpha of eq. 5, for from > 1; with x = alpha - 1
     dP/dalpha = K0/alpha^2 [1 + (1/x - k/(2 + k x))/(2 k)].
   In one piece, term by term, for Phi itself is of the size of K0/k; but over a short way, where
   these terms nearly cancel, by Gauss in steps that double alpha - 1. +infinity at alpha = 1, which
   no line reaches. */
SPHPA_PRIVATE_ double sphpa_crush_phi_(const sphpa_crush_shape_ *shape, double from, double to) {
    double d = to - from, x = from - 1.0, k = shape->k, c = 2.0 - k;
    if (!(to > 1.0)) return HUGE_VAL;
    if (to - 1.0 <= 16.0 * x && x <= 16.0 * (to - 1.0)) {
        double sum = 0.0;
        for (double next; from < to || from > to; from = next) {
            x = from - 1.0;
            next = to > from ? sphpa_min_(to, from + x) : sphpa_max_(to, from - 0.5 * x);
            sum += sphpa_crush_gauss_(shape, from, next);
        }
        return sum;
    }
    double over = d / (from * to); /* of 1/alpha^2 */
    double logs = log1p(k * d / (2.0 + k * x)) - log1p(d / from);
    double one = sphpa_crush_log1p_less_(d / (x * to), over, over / x); /* of 1/(x alpha^2) */
    double two = k / c * over + (k / c) * (k / c) * logs; /* of k/((2 + k x) alpha^2) */
    return shape->K0 * (over + (one - two) / (2.0 * k));
}

/* dPhi/dalpha, and the second derivative */
SPHPA_PRIVATE_ double sphpa_crush_phi_slopes_(const sphpa_crush_shape_ *shape, double alpha,
                                              double *second) {
    double x = alpha - 1.0, k = shape->k, y = k * x;
    double first = 1.0 / sphpa_crush_line_slope_(shape, alpha);
    *second = first * (2.0 * k / (1.0 + y) - 2.0 / alpha - 1.0 / x - k / (2.0 + y));
    return first;
}

/* the alpha in [low, high] with Phi(alpha) - Phi(from) = rise: Newton in a bracket; Phi falls */
SPHPA_PRIVATE_ double sphpa_crush_line_solve_(const sphpa_crush_shape_ *shape, double from,
                                              double rise, double low, double high) {
    if (!(low > 1.0) || !(sphpa_crush_phi_(shape, from, low) > rise)) return low;
    if (!(sphpa_crush_phi_(shape, from, high) < rise)) return high;
    double alpha = low;
    for (int k = 0; k < 100; k++) {
        double miss = sphpa_crush_phi_(shape, from, alpha) - rise;
        if (miss > 0.0) low = alpha;
        else high = alpha;
        double next = alpha - miss * sphpa_crush_line_slope_(shape, alpha);
        if (!(next >= low && next <= high)) next = 0.5 * (low + high);
        if (fabs(next - alpha) <= 2.0 * DBL_EPSILON * alpha) return next;
        alpha = next;
    }
    return alpha;
}

/* ---- the curve as a path --------------------------------------------------------------------- */

/* alpha at a place s of the curve, and its derivatives by s. Of a caller's curve the second and third
   are not known: 0. */
typedef struct sphpa_crush_place_ {
    double alpha, d1, d2, d3;
} sphpa_crush_place_;

SPHPA_FORCE_INLINE_ double sphpa_crush_fall_(const sphpa_crush_shape_ *shape, sphpa_crush_way_ way,
                                             double s) { /* -dP/ds */
    return way == SPHPA_CRUSH_SQUARE_ ? shape->R : s > 0.0 ? shape->Rt : shape->R * shape->c;
}

SPHPA_FORCE_INLINE_ double sphpa_crush_P_(const sphpa_crush_shape_ *shape, sphpa_crush_way_ way,
                                          double s) {
    return shape->P0 - sphpa_crush_fall_(shape, way, s) * s;
}

SPHPA_NO_INLINE_ sphpa_crush_place_ sphpa_crush_at_user_(const sphpa_crush_shape_ *shape,
                                                         double s) {
    sphpa_crush_place_ out;
    double slope;
    out.alpha = sphpa_crush_curve_(shape, SPHPA_CRUSH_ANY_, shape->Ps - shape->R * s, &slope);
    out.d1 = -shape->R * slope;
    out.d2 = out.d3 = 0.0;
    return out;
}

SPHPA_FORCE_INLINE_ sphpa_crush_place_ sphpa_crush_at_(const sphpa_crush_shape_ *shape,
                                                       sphpa_crush_way_ way, double s) {
    sphpa_crush_place_ out;
    if (way == SPHPA_CRUSH_SQUARE_) {
        out.d2 = 2.0 * shape->k2;
        out.d1 = out.d2 * s;
        out.d3 = 0.0;
        out.alpha = 1.0 + shape->k2 * (s * s);
        return out;
    }
    if (way == SPHPA_CRUSH_ANY_ && shape->function != NULL) return sphpa_crush_at_user_(shape, s);
    bool whole = way == SPHPA_CRUSH_POWERS_, lanes = way == SPHPA_CRUSH_LANES_;
    double c = shape->c, t = sphpa_max_(shape->t0 + c * s, 0.0), k1 = s > 0.0 ? shape->k1 : 0.0;
    sphpa_crush_power_ second = lanes
                                    ? sphpa_crush_power_lane_(t, shape->n2, shape->m2)
                                    : sphpa_crush_power_of_(t, shape->n2, shape->m2, whole);
    out.alpha = shape->k2 * second.value;
    out.d1 = shape->k2 * c * second.d1;
    out.d2 = shape->k2 * c * c * second.d2;
    out.d3 = shape->k2 * c * c * c * second.d3;
    if (lanes || k1 > 0.0) {
        sphpa_crush_power_ first =
            lanes ? sphpa_crush_power_lane_(sphpa_max_(s, 0.0), shape->n1, shape->m1)
                  : sphpa_crush_power_of_(s, shape->n1, shape->m1, whole);
        out.alpha += k1 * first.value;
        out.d1 += k1 * first.d1;
        out.d2 += k1 * first.d2;
        out.d3 += k1 * first.d3;
    }
    out.alpha += 1.0;
    return out;
}

/* x^inv_n within 2 %, for x in (0, 1]: log2 is read off the bits of x, straight between two powers
   of 2, and 2^y = 2^j 2^f with a parabola for |f| <= 1/2. A place to start from, without a call. */
SPHPA_FORCE_INLINE_ double sphpa_crush_root_(double x, double inv_n) {
    const double magic = 6755399441055744.0, two52 = 4503599627370496.0;
    uint64_t bits, whole = 0x4330000000000000u; /* the bits of 2^52 */
    double number;
    x = x > 1e-300 ? x : 1e-300;
    memcpy(&bits, &x, sizeof bits);
    bits = (bits >> 20) | whole;
    memcpy(&number, &bits, sizeof number);
    double y = ((number - two52) * (1.0 / 4294967296.0) - (1023.0 - 0.043)) * inv_n;
    double j = (y + magic) - magic, f = y - j;
    return sphpa_exp2_whole_(j) * (1.0 + f * (0.6931 + 0.2402 * f));
}

/* x/line + (x/power)^n = 1, within 6 % or so: x is below `line` and below `power`; where the line is
   the looser one, Halley from `power`, which needs no power: it is 1 there. */
SPHPA_FORCE_INLINE_ double sphpa_crush_sum_root_(double line, double power, double n) {
    double u = power / line, slope = u + n, square = slope * slope;
    double bottom = sphpa_max_(2.0 * square - u * (n * (n - 1.0)), square);
    return u < 1.25 ? sphpa_min_(line, power - power * (2.0 * u * slope / bottom)) : line;
}

/* An s near where the line of slope D >= 0 through (alpha, P) meets the curve. D times what alpha is
   above the curve and what P is above it add up to 0: with M1 = D (alpha - alpha(Pt)) + Pt - P it is
     D k1 q^n1 + (Rt + D slope) q + .. = M1 below Pt, if M1 > 0, else D k2 t^n2 + R t = M above,
   slope that of the second term at the knee, from which it bends up; exact for the quadratic curve,
   written without cancellation. */
SPHPA_FORCE_INLINE_ double sphpa_crush_meet_(const sphpa_crush_shape_ *shape, sphpa_crush_way_ way,
                                             double D, double alpha, double P) {
    double k1 = D * shape->k1, k2 = D * shape->k2, R = shape->R;
    double M = D * (alpha - 1.0) + (shape->Ps - P);
    if (way == SPHPA_CRUSH_SQUARE_)
        return M > 0.0 ? sphpa_min_(1.0, 2.0 * M / (R + sqrt(R * R + 4.0 * k2 * M))) : 0.0;
    double M1 = D * (alpha - shape->alpha_knee) + (shape->Pt - P), none = k1 > 0.0 ? 0.0 : 1.0;
    bool lanes = way == SPHPA_CRUSH_LANES_, below = k1 > 0.0 && M1 > 0.0;
    double q = 1.0, t = 1.0;
    if (lanes || below) {
        double line = sphpa_max_(M1, 0.0) / (shape->Rt + D * shape->slope_knee);
        double power = sphpa_crush_root_(sphpa_min_(M1 / (k1 + none), 1.0), shape->inv_n1);
        q = sphpa_min_(1.0, sphpa_crush_sum_root_(line, power, shape->n1));
    }
    if (lanes || !below) {
        double power = sphpa_crush_root_(sphpa_min_(M / k2, 1.0), shape->inv_n2);
        t = sphpa_crush_sum_root_(sphpa_max_(M, 0.0) / R, power, shape->n2);
        t = sphpa_min_(t, shape->k1 > 0.0 ? shape->t0 : 1.0);
        t = M > 0.0 ? (t - shape->t0) / shape->c : shape->s_end;
    }
    return below ? q : t;
}

/* the inverse of a curve, about */
SPHPA_FORCE_INLINE_ double sphpa_crush_place_of_(const sphpa_crush_shape_ *shape,
                                                 sphpa_crush_way_ way, double alpha) {
    double x = alpha - 1.0, over = alpha - shape->alpha_knee;
    if (way == SPHPA_CRUSH_SQUARE_) return sphpa_min_(1.0, sqrt(x / shape->k2));
    if (shape->k1 > 0.0 && over > 0.0)
        return shape->k1 > over ? sphpa_crush_root_(over / shape->k1, shape->inv_n1) : 1.0;
    double t = shape->k2 > x ? sphpa_crush_root_(x / shape->k2, shape->inv_n2) : 1.0;
    return (sphpa_min_(t, shape->k1 > 0.0 ? shape->t0 : 1.0) - shape->t0) / shape->c;
}

/* The step towards H = 0 where H rises, of third order: Halley's, or where the parabola bends so much
   that he would stay behind (H1 nearly 0) Euler's, to the parabola's zero itself; Newton's where it
   turns away from the root. */
SPHPA_FORCE_INLINE_ double sphpa_crush_halley_(double H, double H1, double H2) {
    double square = H1 * H1, bend = H * H2, bottom = 2.0 * square - bend;
    if (bottom > 3.0 * square && H1 >= 0.0) return -2.0 * H / (H1 + sqrt(square - 2.0 * bend));
    bottom = bottom > square ? bottom : 2.0 * square;
    return -2.0 * H * H1 / bottom;
}

/* The step of fourth order (Householder's), where neither H2 nor H3 bends H much; else Halley's */
SPHPA_FORCE_INLINE_ double sphpa_crush_step_(double H, double H1, double H2, double H3) {
    double square = H1 * H1, x = H * H2, y = H * H * H3, bottom = H1 * (square - x) + (1.0 / 6.0) * y;
    bool plain = fabs(x) < 0.25 * square && fabs(y) < 0.5 * square * H1;
    return plain ? -H * (square - 0.5 * x) / bottom : sphpa_crush_halley_(H, H1, H2);
}

/* Halley's without a branch, kept between two thirds of Newton's step and twice his */
SPHPA_FORCE_INLINE_ double sphpa_crush_halley_lane_(double H, double H1, double H2) {
    double square = H1 * H1, bottom = sphpa_min_(2.0 * square - H * H2, 3.0 * square);
    bottom = bottom > square ? bottom : 2.0 * square;
    return -2.0 * H * H1 / bottom;
}

/* sphpa_crush_step_ without a branch */
SPHPA_FORCE_INLINE_ double sphpa_crush_step_lane_(double H, double H1, double H2, double H3) {
    double square = H1 * H1, x = H * H2, y = H * H * H3, third = 2.0 * square - x;
    third = third < 3.0 * square ? third : 3.0 * square;
    third = third > square ? third : 2.0 * square;
    double plain = fabs(x) < 0.25 * square ? 1.0 : 0.0;
    plain = fabs(y) < 0.5 * square * H1 ? plain : 0.0;
    double top = plain > 0.0 ? square - 0.5 * x : 2.0 * H1;
    return -H * top / (plain > 0.0 ? H1 * (square - x) + (1.0 / 6.0) * y : third);
}

/* the least s with this alpha, in [1, top]: Halley in a bracket; a caller's curve may be a staircase:
   halves */
SPHPA_PRIVATE_ double sphpa_crush_invert_(const sphpa_crush_shape_ *shape, double alpha) {
    bool halve = shape->function != NULL;
    bool square = !halve && !(shape->k1 > 0.0) && shape->m2 == 1;
    double low = shape->s_end, high = 1.0, s = 0.5;
    if (square) return sphpa_crush_place_of_(shape, SPHPA_CRUSH_SQUARE_, alpha);
    if (!halve) s = sphpa_crush_place_of_(shape, SPHPA_CRUSH_POWERS_, alpha);
    for (int k = 0; k < 100; k++) {
        sphpa_crush_place_ place = sphpa_crush_at_(shape, SPHPA_CRUSH_ANY_, s);
        if (place.alpha >= alpha) high = s;
        else low = s;
        double next = s + sphpa_crush_halley_(place.alpha - alpha, place.d1, place.d2);
        if (fabs(next - s) <= DBL_EPSILON * fabs(s) && !halve) return next;
        if (!(next > low && next < high) || halve || k > 40) next = 0.5 * (low + high);
        if (!(next > low && next < high)) break;
        s = next;
    }
    return high;
}

/* the P at which material crushed to alpha crushes on */
SPHPA_PRIVATE_ double sphpa_crush_yield_(const sphpa_crush_shape_ *shape, double alpha) {
    if (alpha >= shape->top) return shape->Pe;
    if (alpha <= 1.0) return shape->end;
    return sphpa_crush_P_(shape, SPHPA_CRUSH_ANY_, sphpa_crush_invert_(shape, alpha));
}

/* The line of alpha_old: its upper end (Py, alpha_y) on the curve, its foot at P = 0. */
typedef struct sphpa_crush_line_ {
    double alpha_y, Py, rest;
} sphpa_crush_line_;

SPHPA_PRIVATE_ sphpa_crush_line_ sphpa_crush_line_of_(const sphpa_crush_shape_ *shape,
                                                      double alpha_old) {
    sphpa_crush_line_ line;
    line.alpha_y = line.rest = alpha_old;
    line.Py = 0.0;
    if (!shape->herrmann || shape->dense || !(alpha_old > 1.0)) return line;
    line.alpha_y = sphpa_min_(alpha_old, shape->top);
    line.Py = sphpa_crush_yield_(shape, line.alpha_y);
    line.rest = alpha_old >= shape->top
                    ? shape->alpha0
                    : sphpa_crush_line_solve_(shape, line.alpha_y, -line.Py, line.alpha_y,
                                              shape->alpha0);
    return line;
}

SPHPA_DEF double sphpa_crush_alpha(const sphpa_crush *curve, double P, double *dalpha_dP) {
    double slope = 0.0, alpha = 1.0;
    if (curve == NULL || sphpa_crush_check_fields_(curve, NULL) != SPHPA_OK || P != P) {
        alpha = slope = (double)NAN;
    } else if (curve->alpha0 > 1.0) {
        sphpa_crush_shape_ shape;
        sphpa_crush_shape_of_(curve, &shape);
        alpha = sphpa_crush_curve_(&shape, shape.way, P, &slope);
        if (shape.herrmann && P < shape.Pe) {
            alpha = shape.alpha0;
            if (P > 0.0) alpha = sphpa_crush_line_solve_(&shape, alpha, P, shape.top, alpha);
            slope = P >= 0.0 ? sphpa_crush_line_slope_(&shape, alpha) : 0.0;
        }
    }
    if (dalpha_dP != NULL) *dalpha_dP = slope;
    return alpha;
}

SPHPA_DEF double sphpa_crush_yield(const sphpa_crush *curve, double alpha) {
    if (curve == NULL || sphpa_crush_check_fields_(curve, NULL) != SPHPA_OK || alpha != alpha)
        return (double)NAN;
    sphpa_crush_shape_ shape;
    sphpa_crush_shape_of_(curve, &shape);
    return shape.dense ? 0.0 : sphpa_crush_yield_(&shape, alpha);
}

SPHPA_DEF double sphpa_crush_rest(const sphpa_crush *curve, double alpha_old) {
    if (curve == NULL || sphpa_crush_check_fields_(curve, NULL) != SPHPA_OK) return (double)NAN;
    sphpa_crush_shape_ shape;
    sphpa_crush_shape_of_(curve, &shape);
    return sphpa_crush_line_of_(&shape, alpha_old).rest;
}

SPHPA_DEF sphpa_result sphpa_crush_prepare(sphpa_crush *curve, double rho0, double c_s,
                                           sphpa_error *err) {
    sphpa_result result = sphpa_crush_check(curve, err);
    if (result != SPHPA_OK) return result;
    if (curve->elastic != SPHPA_CRUSH_HERRMANN || !(curve->alpha0 > 1.0)) return SPHPA_OK;
    if (!sphpa_finite_(rho0) || !sphpa_finite_(c_s))
        return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                               "crush curve: rho0 %g or c_s %g is not finite", rho0, c_s);
    if (!(rho0 > 0.0 && c_s > 0.0))
        return sphpa_error_set(err, SPHPA_ERROR_NEGATIVE,
                               "crush curve: rho0 %g and c_s %g must be positive", rho0, c_s);
    if (!(curve->c_e >= 0.0 && curve->c_e < c_s))
        return sphpa_error_set(err, SPHPA_ERROR_CURVE,
                               "crush curve: c_e %g must be in (0, c_s = %g), or 0 for c_s/2; "
                               "where they are equal use the FLAT branch",
                               curve->c_e, c_s);
    sphpa_crush ready = *curve;
    ready.c_s = c_s;
    ready.K0 = rho0 * c_s * c_s;
    ready.alpha_y = curve->alpha0;
    sphpa_crush_shape_ shape;
    sphpa_crush_shape_of_(&ready, &shape);
    ready.alpha_y =
        sphpa_crush_line_solve_(&shape, ready.alpha0, ready.Pe,
                                1.0 + 1e-9 * (ready.alpha0 - 1.0), ready.alpha0);
    if (curve->kind == SPHPA_CRUSH_TWO_EXPONENT && curve->rescale == 0 &&
        ready.alpha_y < curve->alpha_t)
        return sphpa_error_set(err, SPHPA_ERROR_CURVE,
                               "crush curve: the elastic branch reaches Pe at alpha %g, below "
                               "alpha_t %g; raise c_e or set rescale",
                               ready.alpha_y, curve->alpha_t);
    *curve = ready;
    return SPHPA_OK;
}

/* has a HERRMANN curve what sphpa_crush_prepare writes? */
SPHPA_PRIVATE_ bool sphpa_crush_prepared_(const sphpa_crush *curve) {
    if (curve->elastic != SPHPA_CRUSH_HERRMANN || !(curve->alpha0 > 1.0)) return true;
    return curve->alpha_y > 1.0 && curve->alpha_y <= curve->alpha0 && curve->K0 > 0.0 &&
           curve->K0 <= DBL_MAX && curve->c_s > 0.0 && curve->c_s <= DBL_MAX &&
           curve->c_e >= 0.0 && curve->c_e < curve->c_s;
}

/* ---- one evaluation -------------------------------------------------------------------------- */

/* The matrix at rho_s: pressure and its derivatives without cut-offs. d2 is NaN where it is not
   known; c is negative where it follows from the others. */
typedef struct sphpa_palpha_matrix_ {
    double P, d1, d2, dP_du, d2u, c; /* d2u: d2P/(drho du) */
} sphpa_palpha_matrix_;

/* the equation of state behind a solve: a constant argument of every solver's body */
typedef sphpa_result (*sphpa_palpha_eval_)(const void *material, double rho_s, double u,
                                           sphpa_palpha_matrix_ *out);

SPHPA_FORCE_INLINE_ sphpa_result sphpa_palpha_eval_tillotson_(const void *material, double rho_s,
                                                              double u,
                                                              sphpa_palpha_matrix_ *out) {
    const sphpa_tillotson *mat = (const sphpa_tillotson *)material;
    sphpa_tillotson_branch_ state = sphpa_tillotson_uncut_(mat, rho_s, u);
    out->P = state.P;
    out->d1 = state.dP_drho;
    out->d2 = state.d2P_drho2;
    out->dP_du = state.dP_du;
    out->d2u = state.d2P_drho_du;
    out->c = -1.0;
    return SPHPA_OK;
}

SPHPA_FORCE_INLINE_ sphpa_result sphpa_palpha_eval_any_(const void *material, double rho_s,
                                                        double u, sphpa_palpha_matrix_ *out) {
    const sphpa_eos *eos = (const sphpa_eos *)material;
    sphpa_eos_point point;
    sphpa_result result = eos->eval(eos->material, rho_s, u, &point);
    if (result != SPHPA_OK) return result;
    out->P = point.P;
    out->d1 = point.dP_drho;
    out->d2 = (double)NAN;
    out->dP_du = point.dP_du;
    out->d2u = 0.0;
    out->c = point.c;
    return SPHPA_OK;
}

/* One solve: what is given, and what is counted. */
typedef struct sphpa_palpha_task_ {
    const sphpa_crush_shape_ *shape;
    const void *material;
    double rho, u, tol;
    double alpha_y, Py; /* alpha_old on the curve; HERRMANN: the upper end of its line */
    double cap;         /* top of the bracket: F(cap) >= 0 */
    int max_iterations, evaluations, iterations, fell_back;
    double kink, floor2; /* alpha where the matrix is at rho0; floor of its c^2 */
    bool on_line;  /* HERRMANN: the path is the elastic line, not the curve */
    bool foot;     /* HERRMANN: the line is at P = 0 at cap, so P next to it is told from there */
    double rising; /* known: rho_s dPeos/drho_s >= Peos for every alpha from here up */
    sphpa_result result;
} sphpa_palpha_task_;

/* A trial alpha: the matrix there, the bulk's P, and F of eq. 4. */
typedef struct sphpa_palpha_point_ {
    sphpa_palpha_matrix_ matrix;
    double alpha, P, F, slope; /* slope: dalpha/dP of what P asks for */
} sphpa_palpha_point_;

SPHPA_NO_INLINE_ double sphpa_palpha_target_line_(const sphpa_palpha_task_ *task, double P,
                                                  double *slope) {
    if (P <= 0.0) return task->cap;
    bool foot = task->foot && P < 0.5 * task->Py;
    double alpha = sphpa_crush_line_solve_(task->shape, foot ? task->cap : task->alpha_y,
                                           foot ? P : P - task->Py, task->alpha_y, task->cap);
    *slope = sphpa_crush_line_slope_(task->shape, alpha);
    return alpha;
}

/* alpha that P asks for: min(curve, alpha_old), or the elastic line */
SPHPA_FORCE_INLINE_ double sphpa_palpha_target_(const sphpa_palpha_task_ *task,
                                                sphpa_crush_way_ way, double P, double *slope) {
    *slope = 0.0;
    if (way == SPHPA_CRUSH_ANY_ && task->shape->herrmann && P <= task->Py)
        return sphpa_palpha_target_line_(task, P, slope);
    double alpha = sphpa_crush_curve_(task->shape, way, P, slope);
    if (alpha < task->alpha_y) return alpha;
    *slope = 0.0;
    return task->alpha_y;
}

/* the matrix at alpha; false and task->result when the equation of state fails */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_matrix_at_(sphpa_palpha_eval_ eval, sphpa_palpha_task_ *task,
                                                 double alpha, sphpa_palpha_point_ *point) {
    task->evaluations++;
    task->result = eval(task->material, alpha * task->rho, task->u, &point->matrix);
    if (task->result == SPHPA_OK && !sphpa_finite_(point->matrix.P))
        task->result = SPHPA_ERROR_NOT_FINITE;
    point->alpha = alpha;
    return task->result == SPHPA_OK;
}

/* eq. 1, 4 where the matrix has been evaluated */
SPHPA_FORCE_INLINE_ void sphpa_palpha_meet_curve_(const sphpa_palpha_task_ *task,
                                                  sphpa_crush_way_ way,
                                                  sphpa_palpha_point_ *point) {
    point->P = point->matrix.P / point->alpha;
    point->F = point->alpha - sphpa_palpha_target_(task, way, point->P, &point->slope);
}

/* the same at alpha */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_at_(sphpa_palpha_eval_ eval, sphpa_crush_way_ way,
                                          sphpa_palpha_task_ *task, double alpha,
                                          sphpa_palpha_point_ *point) {
    if (!sphpa_palpha_matrix_at_(eval, task, alpha, point)) return false;
    sphpa_palpha_meet_curve_(task, way, point);
    return true;
}

/*[slope-of-F]*/
/* F' of eq. 4 */
SPHPA_FORCE_INLINE_ double sphpa_palpha_dF_(const sphpa_palpha_task_ *task,
                                            const sphpa_palpha_point_ *point) {
    return 1.0 - point->slope * (task->rho * point->matrix.d1 - point->P) / point->alpha;
}
/*[/]*/

/* a step of this size or less is none: the tolerance, or what rounding leaves of it */
SPHPA_FORCE_INLINE_ double sphpa_palpha_small_(const sphpa_palpha_task_ *task, double alpha) {
    return sphpa_max_(task->tol, 4.0 * DBL_EPSILON * alpha);
}

/* ---- GASPHiA's solvers ----------------------------------------------------------------------- */

/* Both ends first: a state that does not crush keeps its alpha to the last bit, one that closes all
   pores is 1. True: *point is the answer, or the evaluation failed. */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_ends_(sphpa_palpha_eval_ eval, sphpa_crush_way_ way,
                                            sphpa_palpha_task_ *task,
                                            sphpa_palpha_point_ *point) {
    sphpa_palpha_point_ closed;
    if (!sphpa_palpha_at_(eval, way, task, task->cap, point) || point->F <= 0.0) return true;
    if (!sphpa_palpha_at_(eval, way, task, 1.0, &closed)) return true;
    if (!(closed.F >= 0.0)) return false;
    *point = closed;
    return true;
}

/* Halves [a, b], F(a) < 0 < F(b), until b - a <= tol. */
SPHPA_FORCE_INLINE_ void sphpa_palpha_bisect_(sphpa_palpha_eval_ eval, sphpa_crush_way_ way,
                                              sphpa_palpha_task_ *task,
                                              sphpa_palpha_point_ *point) {
    double a = 1.0, b = task->cap;
    while (b - a > sphpa_palpha_small_(task, b)) {
        sphpa_palpha_point_ middle;
        task->iterations++;
        if (!sphpa_palpha_at_(eval, way, task, 0.5 * (a + b), &middle)) return;
        if (middle.F >= 0.0) b = middle.alpha;
        if (middle.F <= 0.0) a = middle.alpha;
    }
    (void)sphpa_palpha_at_(eval, way, task, 0.5 * (a + b), point);
}

/* Newton from alpha_old. The derivative of F jumps at Pe, at Ps and at alpha_old, so next to these
   the iteration may hop between two points for ever. The best point is kept for the caller. */
SPHPA_FORCE_INLINE_ void sphpa_palpha_newton_(sphpa_palpha_eval_ eval, sphpa_crush_way_ way,
                                              sphpa_palpha_task_ *task,
                                              sphpa_palpha_point_ *point) {
    sphpa_palpha_point_ trial = *point; /* alpha_old */
    double alpha = trial.alpha;
    for (int k = 0; k < task->max_iterations; k++) {
        task->iterations++;
        if (k > 0 && !sphpa_palpha_at_(eval, way, task, alpha, &trial)) return;
        if (k > 0 && fabs(trial.F) <= fabs(point->F)) *point = trial;
        double step = trial.F == 0.0 ? 0.0 : trial.F / sphpa_palpha_dF_(task, &trial);
        if (fabs(step) <= sphpa_palpha_small_(task, trial.alpha)) {
            *point = trial;
            return;
        }
        /* F' < 1 is possible in expansion: what leaves [1, alpha_old] is put back on its edge */
        alpha = sphpa_clamp_(trial.alpha - step, 1.0, task->cap);
    }
    task->result = SPHPA_ERROR_NOT_CONVERGED;
}

/* Newton that keeps [a, b] around the root: (1) [a, b] = [1, alpha_old], start at alpha_old;
   (2) F > 0: b = alpha, F < 0: a = alpha; (3) Newton's step; (4) outside (a, b) take the middle;
   (5) not converged within the allowed iterations: bisection.
   Converged is a bracket no wider than the tolerance. A short step is not enough: where the curve
   touches alpha = 1 with a high power Newton creeps. So no step is shorter than half the tolerance,
   which is past the root once Newton has come near and brings the bracket's far end up (Brent). */
SPHPA_FORCE_INLINE_ void sphpa_palpha_safe_newton_(sphpa_palpha_eval_ eval, sphpa_crush_way_ way,
                                                   sphpa_palpha_task_ *task,
                                                   sphpa_palpha_point_ *point) {
    double a = 1.0, b = task->cap;
    sphpa_palpha_point_ last = *point;
    for (int k = 0; k < task->max_iterations; k++) {
        task->iterations++;
        if (point->F == 0.0) return;
        if (point->F > 0.0) b = point->alpha;
        else a = point->alpha;
        double small = sphpa_palpha_small_(task, point->alpha);
        if (b - a <= small) {
            bool ends = (last.F > 0.0) != (point->F > 0.0); /* the two are a and b */
            if (ends && fabs(last.F) < fabs(point->F)) *point = last;
            return;
        }
        last = *point;
        double step = -point->F / sphpa_palpha_dF_(task, point);
        if (fabs(step) < 0.5 * small) step = copysign(0.5 * small, step);
        double next = point->alpha + step;
        if (!(next > a && next < b)) next = 0.5 * (a + b);
        if (!sphpa_palpha_at_(eval, way, task, next, point)) return;
    }
    task->fell_back = 1;
    sphpa_palpha_bisect_(eval, way, task, point);
}

/* ---- the crush-space solver ------------------------------------------------------------------ */

/* A place s on the path that (alpha, P) may take: the curve, or Herrmann's line from its upper end
   down to P = 0, s = alpha - alpha_y. P falls and alpha rises with s. */
typedef struct sphpa_palpha_place_ {
    double s, alpha, alpha1, alpha2, alpha3; /* 1, 2, 3: derivatives by s */
    double P, P1, P2;
} sphpa_palpha_place_;

SPHPA_NO_INLINE_ sphpa_palpha_place_ sphpa_palpha_path_line_(const sphpa_palpha_task_ *task,
                                                             double s) {
    sphpa_palpha_place_ out;
    out.s = s;
    out.alpha = task->alpha_y + s;
    out.alpha1 = 1.0;
    out.alpha2 = out.alpha3 = 0.0;
    bool foot = task->foot && s > 0.5 * (task->cap - task->alpha_y);
    out.P = foot ? sphpa_crush_phi_(task->shape, task->cap, out.alpha)
                 : task->Py + sphpa_crush_phi_(task->shape, task->alpha_y, out.alpha);
    out.P1 = sphpa_crush_phi_slopes_(task->shape, out.alpha, &out.P2);
    return out;
}

SPHPA_FORCE_INLINE_ sphpa_palpha_place_ sphpa_palpha_on_curve_(const sphpa_crush_shape_ *shape,
                                                               sphpa_crush_way_ way, double s) {
    sphpa_crush_place_ place = sphpa_crush_at_(shape, way, s);
    sphpa_palpha_place_ out;
    out.s = s;
    out.alpha = place.alpha;
    out.alpha1 = place.d1;
    out.alpha2 = place.d2;
    out.alpha3 = place.d3;
    out.P1 = -sphpa_crush_fall_(shape, way, s);
    out.P = shape->P0 + out.P1 * s;
    out.P2 = 0.0;
    return out;
}

SPHPA_FORCE_INLINE_ sphpa_palpha_place_ sphpa_palpha_path_(const sphpa_palpha_task_ *task,
                                                           sphpa_crush_way_ way, double s) {
    if (way == SPHPA_CRUSH_ANY_ && task->on_line) return sphpa_palpha_path_line_(task, s);
    return sphpa_palpha_on_curve_(task->shape, way, s);
}

/* Peos as a function of alpha, made a parabola. */
typedef struct sphpa_palpha_parabola_ {
    double alpha, Y, Y1, Y2;
} sphpa_palpha_parabola_;

/* H(s) = Peos(alpha rho, u) - alpha P along the path has the sign of F, and no kink where F has one.
   Its value and derivatives (H3: where the curve's is known), and the step to H = 0. */
typedef struct sphpa_palpha_step_ {
    double H, H1, H2, H3, ds;
} sphpa_palpha_step_;

SPHPA_FORCE_INLINE_ sphpa_palpha_step_ sphpa_palpha_slopes_(const sphpa_palpha_parabola_ *matrix,
                                                            const sphpa_palpha_place_ *at) {
    double d = at->alpha - matrix->alpha, fall = matrix->Y1 + d * matrix->Y2 - at->P;
    sphpa_palpha_step_ out;
    out.H = matrix->Y + d * (matrix->Y1 + 0.5 * d * matrix->Y2) - at->alpha * at->P;
    out.H1 = at->alpha1 * fall - at->alpha * at->P1;
    double bend = at->alpha1 * matrix->Y2;
    out.H2 = at->alpha2 * fall + at->alpha1 * (bend - 2.0 * at->P1) - at->alpha * at->P2;
    out.H3 = at->alpha3 * fall + 3.0 * at->alpha2 * (bend - at->P1);
    out.ds = 0.0;
    return out;
}

SPHPA_FORCE_INLINE_ sphpa_palpha_step_ sphpa_palpha_step_of_(sphpa_crush_way_ way,
                                                             const sphpa_palpha_parabola_ *matrix,
                                                             const sphpa_palpha_place_ *at) {
    sphpa_palpha_step_ out = sphpa_palpha_slopes_(matrix, at);
    out.ds = way == SPHPA_CRUSH_ANY_ ? sphpa_crush_halley_(out.H, out.H1, out.H2)
                                     : sphpa_crush_step_(out.H, out.H1, out.H2, out.H3);
    return out;
}

/* Y around a point; where the equation of state gives no second derivative, that of the parabola
   through `before` as well (NULL, or the same place: none) */
SPHPA_FORCE_INLINE_ sphpa_palpha_parabola_ sphpa_palpha_parabola_of_(
    const sphpa_palpha_task_ *task, const sphpa_palpha_point_ *point,
    const sphpa_palpha_parabola_ *before) {
    sphpa_palpha_parabola_ out;
    out.alpha = point->alpha;
    out.Y = point->matrix.P;
    out.Y1 = task->rho * point->matrix.d1;
    out.Y2 = task->rho * task->rho * point->matrix.d2;
    if (sphpa_finite_(out.Y2)) return out;
    double d = before != NULL ? before->alpha - out.alpha : 0.0;
    out.Y2 = d != 0.0 ? 2.0 * ((before->Y - out.Y) / d - out.Y1) / d : 0.0;
    if (!sphpa_finite_(out.Y2)) out.Y2 = 0.0;
    return out;
}

/* Where does the matrix, seen from alpha_old, meet the path? By its tangent first, then by its
   parabola. Cold rock is so nearly a parabola that this is the answer to nine digits. */
SPHPA_FORCE_INLINE_ double sphpa_palpha_guess_(const sphpa_palpha_task_ *task,
                                               sphpa_crush_way_ way, double P,
                                               const sphpa_palpha_parabola_ *matrix) {
    const sphpa_crush_shape_ *shape = task->shape;
    bool closed = way != SPHPA_CRUSH_ANY_ || shape->function == NULL;
    double D = (matrix->Y1 - P) / matrix->alpha, end = shape->s_end, s;
    if (closed && D > 0.0) {
        s = sphpa_crush_meet_(shape, way, D, matrix->alpha, P);
    } else {
        s = ((shape->Ps - P) * shape->inv_R - shape->t0) / shape->c;
    }
    if (!(s > end)) return end;
    for (int k = 0; k < (way == SPHPA_CRUSH_ANY_ ? 3 : 1); k++) {
        sphpa_palpha_place_ at = sphpa_palpha_path_(task, way, s);
        double ds = sphpa_palpha_step_of_(way, matrix, &at).ds;
        if (!(fabs(ds) < 1.0 - end)) break;
        s = sphpa_clamp_(s + ds, end, 1.0);
        if (fabs(ds) <= 3e-4 * fabs(s)) break;
    }
    return s;
}

/* The answer is at `to` on the path, a small step from *point: everything along the parabola. P is
   the path's or the matrix's, whichever a last error in alpha moves less; the matrix's where the two
   have not met: at alpha 1, or in a bracket narrower than the tolerance. */
SPHPA_FORCE_INLINE_ void sphpa_palpha_settle_(const sphpa_palpha_task_ *task, sphpa_crush_way_ way,
                                              const sphpa_palpha_parabola_ *matrix,
                                              const sphpa_palpha_place_ *to, bool met,
                                              sphpa_palpha_point_ *point) {
    double alpha = sphpa_clamp_(to->alpha, 1.0, task->cap), d = alpha - point->alpha;
    double Y = matrix->Y + d * (matrix->Y1 + 0.5 * d * matrix->Y2), P = Y / alpha;
    bool on_line = way == SPHPA_CRUSH_ANY_ && task->on_line; /* Py + Phi is rougher than Y */
    bool stiff = !on_line && fabs(to->alpha1 * (matrix->Y1 - P)) > -to->P1 * alpha;
    point->matrix.P = Y;
    point->matrix.d1 += d * task->rho * point->matrix.d2;
    point->matrix.dP_du += d * task->rho * point->matrix.d2u;
    point->alpha = alpha;
    point->F = alpha - sphpa_palpha_target_(task, way, P, &point->slope);
    point->P = stiff && met ? to->P : P;
}

/* A high power makes much of the last digit of s. F has all of them where Pe is well below Pt: a
   step of Newton by F, no longer than such digits are. */
SPHPA_NO_INLINE_ void sphpa_palpha_refine_(const sphpa_palpha_task_ *task,
                                           sphpa_palpha_point_ *point) {
    const sphpa_crush_shape_ *shape = task->shape;
    double P = point->matrix.P / point->alpha;
    if (!(shape->Rt > 0.1 * shape->Pt) || !(P > (shape->herrmann ? task->Py : shape->Pe))) return;
    point->F = point->alpha - sphpa_palpha_target_(task, SPHPA_CRUSH_ANY_, P, &point->slope);
    double dF = sphpa_palpha_dF_(task, point), move = -point->F / dF;
    if (!(point->slope < 0.0) || !(dF > 0.05)) return;
    if (!(fabs(move) <= 1000.0 * DBL_EPSILON * point->alpha)) return;
    double alpha = sphpa_clamp_(point->alpha + move, 1.0, task->cap);
    double rise = task->rho * point->matrix.d1 * (alpha - point->alpha);
    point->matrix.P += rise;
    point->P += (rise - point->P * (alpha - point->alpha)) / alpha;
    point->alpha = alpha;
    point->F = alpha - sphpa_palpha_target_(task, SPHPA_CRUSH_ANY_, point->matrix.P / alpha,
                                            &point->slope);
}

/* Is there nothing left to gain where the last step moves alpha by `move`, the one before moved it
   by `last`? The parabola's error is d3 move^3/6, with the third derivative d3 that its second one
   has shown between the two; and what `last` left over shows how fast it grows with the move. P has
   to be that of alpha, too, to within the tolerance or rounding. */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_last_(double Y2_change, const sphpa_palpha_parabola_ *matrix,
                                            const sphpa_palpha_step_ *step, double P,
                                            double alpha1, double move, double last,
                                            double small) {
    double size = fabs(move), before = fabs(last), cube = size * size * size;
    double slope = step->H1 + step->H2 * step->ds; /* there, as alpha1 is */
    double exact = small * fabs(matrix->Y1 - P) + 8.0 * DBL_EPSILON * fabs(matrix->Y);
    double allowed = sphpa_min_(small * slope, exact * alpha1); /* error of H, by alpha1 */
    return (slope > 0.0) & (100.0 * size * cube * slope <= allowed * (before * before * before)) &
           (10.0 * fabs(Y2_change) * cube * alpha1 <= allowed * before);
}

/* Is the step of fourth order from `at` good enough? With b = H2 ds/(2 H1), c = H3 ds^2/(6 H1) and d =
   H4 ds^3/(24 H1) its error is b^3 - 2 b c + d of the move; a curve's fourth derivative is at most
   n^3/r^3 times the first, r the way to where its power is 0. */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_step_good_(const sphpa_crush_shape_ *shape,
                                                 sphpa_crush_way_ way,
                                                 const sphpa_palpha_parabola_ *matrix,
                                                 const sphpa_palpha_step_ *step,
                                                 const sphpa_palpha_place_ *at, double small,
                                                 double move) {
    double ds = fabs(step->ds), h = step->H1, size = fabs(move);
    double b = fabs(step->H2) * ds, c = fabs(step->H3) * (ds * ds), Y2 = fabs(matrix->Y2);
    double d = 3.0 * at->alpha2 * at->alpha2 * Y2, r = 1.0, n = 0.0;
    if (way != SPHPA_CRUSH_SQUARE_) {
        d += 4.0 * at->alpha3 * (at->alpha1 * Y2 - at->P1);
        r = at->s > 0.0 ? at->s : at->s - shape->s_end;
        n = shape->n_most * ds;
    }
    d *= ds * ds * ds;
    return (4.0 * (b * b * b + h * (b * c + h * d)) * size <= small * h * h * h) &
           (4.0 * n * n * n * size <= small * r * r * r);
}

/* Where the parabola at hand meets the path: *to, where the step from `at` has led if its own error is
   small, or a second one from there, which has to be a thousand times shorter: what it
   leaves over is its cube by the square of the first. */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_meets_(const sphpa_palpha_task_ *task, sphpa_crush_way_ way,
                                             const sphpa_palpha_parabola_ *matrix,
                                             const sphpa_palpha_step_ *step,
                                             const sphpa_palpha_place_ *at, double move,
                                             double small, sphpa_palpha_place_ *to) {
    if (way != SPHPA_CRUSH_ANY_ && (at->s > 0.0) == (to->s > 0.0) &&
        sphpa_palpha_step_good_(task->shape, way, matrix, step, at, small, move))
        return true;
    sphpa_palpha_step_ more = sphpa_palpha_step_of_(way, matrix, to);
    sphpa_palpha_place_ there = sphpa_palpha_path_(task, way, to->s + more.ds);
    bool side = at->s > 0.0; /* no knee between the three */
    bool knee = side != (to->s > 0.0) || side != (there.s > 0.0);
    if (way != SPHPA_CRUSH_SQUARE_ && knee) return false;
    double again = fabs(there.alpha - to->alpha);
    if (!(again <= 1e-3 * fabs(move)) || again * again * again > small * move * move) return false;
    if (!(there.s >= task->shape->s_end)) return false;
    *to = there;
    return true;
}

/* Where the root is. */
typedef struct sphpa_palpha_bracket_ {
    double lo, hi, H_lo, H_hi; /* H(lo) <= 0 < H(hi); infinite: not known */
    double alpha_lo, alpha_hi; /* there */
    bool lo_known;             /* else lo is where all pores are closed, and was not evaluated */
    double promised;           /* its width, if the root was where the last step had it; or 0 */
    double moved, width, wider; /* the last move; widths one and two evaluations ago */
} sphpa_palpha_bracket_;

/* High powers bend so much that Halley alone stays behind: on to where the parabola meets the path,
   inside the bracket. No evaluation is needed for that. */
SPHPA_FORCE_INLINE_ void sphpa_palpha_polish_(const sphpa_palpha_task_ *task, sphpa_crush_way_ way,
                                              const sphpa_palpha_parabola_ *matrix,
                                              const sphpa_palpha_bracket_ *in,
                                              sphpa_palpha_place_ *to) {
    for (int k = 0; k < 8; k++) {
        sphpa_palpha_step_ more = sphpa_palpha_step_of_(way, matrix, to);
        double next = to->s + more.ds;
        if (!(next > in->lo && next < in->hi)) return;
        *to = sphpa_palpha_path_(task, way, next);
        if (!(fabs(more.H2 * more.ds) > 0.25 * more.H1)) return;
    }
}

/* no kink of the matrix between two alphas */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_smooth_(const sphpa_palpha_task_ *task, double a, double b) {
    return (a < task->kink) == (b < task->kink);
}

/* The middle of the bracket: the knee of the curve, or half way in s; on Herrmann's line, which
   falls like the logarithm of alpha - 1, half way in that. */
SPHPA_FORCE_INLINE_ double sphpa_palpha_middle_(const sphpa_palpha_task_ *task,
                                                sphpa_crush_way_ way,
                                                const sphpa_palpha_bracket_ *in) {
    if (way == SPHPA_CRUSH_ANY_ && task->on_line) {
        double x = sqrt((in->alpha_lo - 1.0) * (in->alpha_hi - 1.0)), s = x - (task->alpha_y - 1.0);
        if (s > in->lo && s < in->hi) return s;
    }
    return in->lo < 0.0 && in->hi > 0.0 ? 0.0 : 0.5 * (in->lo + in->hi);
}

/* Where to go on: where the step leads (*inside), if it stays inside. One that leaves the bracket
   by little says that the root is at its end: back from there by as much as it left it, and no less
   than half the tolerance. Where that was not so once, H is rough: no more of it. Else by the
   tangent (later by the secant), or half way; and so where steps neither get shorter nor halve the
   bracket in two. */
SPHPA_FORCE_INLINE_ double sphpa_palpha_next_(const sphpa_palpha_task_ *task,
                                              sphpa_crush_way_ way, sphpa_palpha_bracket_ *in,
                                              int k, const sphpa_palpha_place_ *at,
                                              const sphpa_palpha_step_ *step, double small,
                                              bool *inside) {
    double next = at->s + step->ds, end = step->H > 0.0 ? in->lo : in->hi;
    double width = in->hi - in->lo;
    bool gains = k < 3 || width <= 0.5 * in->wider || fabs(step->ds) <= 0.1 * in->moved;
    in->wider = in->width;
    in->width = width;
    *inside = next > in->lo && next < in->hi;
    if (*inside && gains) return next;
    if (next <= in->lo && !in->lo_known) return in->lo;
    double beyond = sphpa_max_(fabs(next - end), DBL_EPSILON * fabs(end));
    beyond = sphpa_max_(beyond, 0.5 * small / at->alpha1);
    if (width > 2.0 * in->promised) in->promised = 0.0;
    if (in->promised > 0.0 && beyond < 0.25 * width && !*inside) {
        double back = end - copysign(beyond, step->ds);
        in->promised = beyond;
        if (back > in->lo && back < in->hi) return back;
    }
    *inside = false;
    if (k < 8) next = at->s - step->H / step->H1;
    else next = in->lo - width * (in->H_lo / (in->H_hi - in->H_lo)); /* rounding has bent H */
    if (next > in->lo && next < in->hi && k % 2 != 0) return next;
    return sphpa_palpha_middle_(task, way, in);
}

/* the rounding of alpha P: P0 - R c s is no better than P0, Py + Phi than Py */
SPHPA_FORCE_INLINE_ double sphpa_palpha_noise_(const sphpa_palpha_task_ *task, sphpa_crush_way_ way,
                                               const sphpa_palpha_place_ *at) {
    bool line = way == SPHPA_CRUSH_ANY_ && task->on_line;
    return 2.0 * DBL_EPSILON * at->alpha * (line ? (task->foot ? fabs(at->P) : task->Py)
                                             : task->shape->P0 - at->P1 * fabs(at->s));
}

/* The most evaluations of a solve: none has been seen to need as many; three times that where the
   second derivative is not known, or a caller's curve may be a staircase. */
enum { SPHPA_PALPHA_MOST_ = 40 };

/* H at a place: the new end of the bracket */
SPHPA_FORCE_INLINE_ void sphpa_palpha_narrow_(sphpa_palpha_bracket_ *in,
                                              const sphpa_palpha_place_ *at, double H) {
    if (H > 0.0) {
        in->hi = at->s;
        in->H_hi = H;
        in->alpha_hi = sphpa_min_(in->alpha_hi, at->alpha);
    } else {
        in->lo = at->s;
        in->H_lo = H;
        in->alpha_lo = at->alpha;
        in->lo_known = true;
    }
}

/* the upper end of the path at hand */
SPHPA_FORCE_INLINE_ double sphpa_palpha_highest_(const sphpa_palpha_task_ *task,
                                                 sphpa_crush_way_ way) {
    return way == SPHPA_CRUSH_ANY_ && !task->on_line ? task->alpha_y : task->cap;
}

/* Has the bracket, or the step, come to what doubles can tell? Then *to is the answer; where the
   two ends have met in alpha, but not in H, *met is false. */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_rough_(const sphpa_palpha_task_ *task, sphpa_crush_way_ way,
                                             const sphpa_palpha_bracket_ *in,
                                             const sphpa_palpha_step_ *step,
                                             const sphpa_palpha_place_ *at, double small,
                                             bool *met, sphpa_palpha_place_ *to) {
    const double eps = DBL_EPSILON, alpha = at->alpha;
    double move = step->ds * (at->alpha1 + 0.5 * step->ds * at->alpha2);
    bool fine = fabs(step->ds) <= 2.0 * eps * fabs(at->s); /* less than s can say */
    if (fabs(step->H) <= sphpa_palpha_noise_(task, way, at) &&
        !(alpha > sphpa_palpha_highest_(task, way))) {
        if (fine) to->alpha += move;
        return true;
    }
    *met = (step->H < 0.0 || at->s > in->lo) &&
           in->alpha_hi - in->alpha_lo > sphpa_max_(small, 8.0 * eps * alpha);
    if (!*met) return true;
    fine = fine || in->hi - in->lo <= 2.0 * eps * fabs(at->s);
    if (way != SPHPA_CRUSH_ANY_ && fabs(step->ds) <= 1e-7 && fabs(move) <= small)
        fine = fine || (at->s > 0.0) == (at->s + step->ds > 0.0); /* of the knee */
    if (fine) to->alpha += move;
    return fine;
}

/* The answer is at `to`. */
SPHPA_FORCE_INLINE_ void sphpa_palpha_finish_(sphpa_palpha_eval_ eval, sphpa_crush_way_ way,
                                              sphpa_palpha_task_ *task,
                                              const sphpa_palpha_place_ *to, bool met, bool rough,
                                              sphpa_palpha_parabola_ *matrix,
                                              sphpa_palpha_point_ *point) {
    double alpha = sphpa_clamp_(to->alpha, 1.0, task->cap);
    if (!met && fabs(alpha - point->alpha) > sphpa_palpha_small_(task, alpha)) { /* too far back */
        if (!sphpa_palpha_matrix_at_(eval, task, alpha, point)) return;
        *matrix = sphpa_palpha_parabola_of_(task, point, matrix);
    }
    sphpa_palpha_settle_(task, way, matrix, to, met, point);
    bool high = to->alpha1 * to->s > 4.0 * to->alpha;
    if (way != SPHPA_CRUSH_SQUARE_ && rough && high && !task->on_line)
        sphpa_palpha_refine_(task, point);
}

/* F >= 0 at the lower end: all pores are closed */
SPHPA_FORCE_INLINE_ void sphpa_palpha_closed_(sphpa_palpha_point_ *point) {
    point->P = point->matrix.P / point->alpha;
    point->F = point->slope = 0.0;
}

/* the place on the path with this alpha */
SPHPA_NO_INLINE_ double sphpa_palpha_where_(const sphpa_palpha_task_ *task, double alpha) {
    if (task->on_line) return alpha - task->alpha_y;
    return alpha >= task->shape->top ? 1.0 : sphpa_crush_invert_(task->shape, alpha);
}

/* Steps along the path inside the bracket, from s; *point has been evaluated near by. */
SPHPA_FORCE_INLINE_ void sphpa_palpha_close_in_(sphpa_palpha_eval_ eval, sphpa_crush_way_ way,
                                                sphpa_palpha_task_ *task,
                                                sphpa_palpha_bracket_ in, double s,
                                                sphpa_palpha_point_ *point,
                                                sphpa_palpha_parabola_ matrix) {
    sphpa_palpha_place_ at = sphpa_palpha_path_(task, way, s), to;
    double highest = sphpa_palpha_highest_(task, way);
    if (at.alpha > highest) { /* a guess too high: nothing is known of P there */
        in.hi = sphpa_palpha_where_(task, highest);
        at = sphpa_palpha_path_(task, way, in.hi);
    }
    double last = at.alpha - point->alpha;
    bool smooth = sphpa_palpha_smooth_(task, point->alpha, at.alpha), inside, met = true;
    bool exact = task->shape->function == NULL && sphpa_finite_(point->matrix.d2), rough = false;
    int most = exact ? SPHPA_PALPHA_MOST_ : 3 * SPHPA_PALPHA_MOST_;
    for (int k = 0;; k++) {
        task->iterations++;
        if (!sphpa_palpha_matrix_at_(eval, task, at.alpha, point)) return;
        if (at.s <= task->shape->s_end && !task->on_line && point->matrix.P >= task->shape->end) {
            sphpa_palpha_closed_(point);
            return;
        }
        double before = matrix.Y2;
        matrix = sphpa_palpha_parabola_of_(task, point, &matrix);
        sphpa_palpha_step_ step = sphpa_palpha_step_of_(way, &matrix, &at);
        double small = sphpa_palpha_small_(task, at.alpha);
        to = at;
        /* at the upper end H is positive, as F is; rounding may hide it */
        sphpa_palpha_narrow_(&in, &at, at.alpha > highest ? fabs(step.H) + DBL_MIN : step.H);
        rough = sphpa_palpha_rough_(task, way, &in, &step, &at, small, &met, &to);
        if (rough) break;
        last = sphpa_min_(fabs(last), 0.5 * at.alpha); /* a longer one saw more than one bend */
        s = sphpa_palpha_next_(task, way, &in, k, &at, &step, small, &inside);
        in.moved = fabs(s - at.s);
        to = sphpa_palpha_path_(task, way, s);
        if (way != SPHPA_CRUSH_SQUARE_ && inside && fabs(step.H2 * step.ds) > 0.25 * step.H1)
            sphpa_palpha_polish_(task, way, &matrix, &in, &to);
        double move = to.alpha - at.alpha;
        if (to.alpha > highest + small) inside = false;
        if (inside && fabs(move) <= small && (at.s > 0.0) == (to.s > 0.0) &&
            (way == SPHPA_CRUSH_SQUARE_ || fabs(step.H * at.alpha1) <= small * step.H1))
            break; /* an odd curve may bend so much that Halley hardly moves: Newton has to agree */
        smooth = smooth && inside && sphpa_palpha_smooth_(task, at.alpha, to.alpha);
        if (way != SPHPA_CRUSH_ANY_ && exact && smooth &&
            sphpa_palpha_last_(matrix.Y2 - before, &matrix, &step, at.P, to.alpha1, move, last,
                               small) &&
            sphpa_palpha_meets_(task, way, &matrix, &step, &at, move, small, &to))
            break;
        smooth = inside && sphpa_palpha_smooth_(task, at.alpha, to.alpha);
        task->fell_back = k >= 8;
        if (task->evaluations >= most - 1) task->result = SPHPA_ERROR_NOT_CONVERGED;
        if (task->evaluations >= most - 1) break; /* one is left for the end */
        last = move;
        at = to;
    }
    sphpa_palpha_finish_(eval, way, task, &to, met, rough, &matrix, point);
}

/* ---- where F may have several zeros ---------------------------------------------------------- */

/* H and two derivatives at a place of the path. */
typedef struct sphpa_palpha_knot_ {
    sphpa_palpha_place_ at;
    sphpa_palpha_parabola_ matrix;
    sphpa_palpha_step_ step;
} sphpa_palpha_knot_;

/* What the polynomials through two knots say of H between them: the lowest place of that of fifth
   degree (values and two derivatives; of third degree without the second ones), in how far the next
   lower degree disagrees, and whether it falls anywhere. */
typedef struct sphpa_palpha_span_ {
    double lowest, at, doubt;
    bool falls;
} sphpa_palpha_span_;

SPHPA_PRIVATE_ sphpa_palpha_span_ sphpa_palpha_span_of_(const sphpa_palpha_step_ *lo,
                                                        const sphpa_palpha_step_ *hi, double h,
                                                        bool third) {
    double rise = hi->H - lo->H, a = h * lo->H1, b = h * hi->H1;
    double c2 = 3.0 * rise - 2.0 * a - b, c3 = a + b - 2.0 * rise; /* H0 + a x + c2 x^2 + c3 x^3 */
    double e0 = 0.5 * (h * h * lo->H2 - 2.0 * c2);
    double e1 = 0.5 * (h * h * hi->H2 - 2.0 * c2 - 6.0 * c3);
    double H[19]; /* one beyond each end, by the slopes there */
    sphpa_palpha_span_ out;
    out.lowest = sphpa_min_(lo->H, hi->H);
    out.at = 0.5;
    out.doubt = 0.0;
    out.falls = a < 0.0 || b < 0.0;
    for (int k = 0; k <= 16; k++) {
        double x = k / 16.0, y = 1.0 - x, bump = x * x * y * y;
        double cubic = lo->H + x * (a + x * (c2 + x * c3)), line = lo->H + x * rise;
        double more = bump * (e0 * y + e1 * x);
        H[k + 1] = third ? cubic + more : cubic;
        out.doubt = sphpa_max_(out.doubt, fabs(third ? more : cubic - line));
        if (k > 0 && H[k + 1] < H[k]) out.falls = true;
    }
    H[0] = H[2] - a / 8.0;
    H[18] = H[16] + b / 8.0;
    for (int k = 1; k <= 17; k++) { /* a low place is between: on the parabola through three */
        double D1 = 0.5 * (H[k + 1] - H[k - 1]), D2 = H[k + 1] - 2.0 * H[k] + H[k - 1];
        double low = H[k] - 0.5 * D1 * D1 / D2;
        if (!(D2 > fabs(D1)) || !(low < out.lowest)) continue;
        out.lowest = low;
        out.at = sphpa_clamp_((k - 1 - D1 / D2) / 16.0, 0.0, 1.0);
    }
    bool promise = lo->H > 0.0 && hi->H > 0.0 && out.lowest < 0.0; /* of zeros: right there */
    if (!promise) out.at = sphpa_clamp_(out.at, 0.25, 0.75);
    return out;
}

/* evaluates H at s */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_knot_at_(sphpa_palpha_eval_ eval, sphpa_palpha_task_ *task,
                                               double s, sphpa_palpha_point_ *point,
                                               sphpa_palpha_knot_ *knot) {
    knot->at = sphpa_palpha_path_(task, SPHPA_CRUSH_ANY_, s);
    if (!sphpa_palpha_matrix_at_(eval, task, knot->at.alpha, point)) return false;
    knot->matrix = sphpa_palpha_parabola_of_(task, point, NULL);
    knot->step = sphpa_palpha_step_of_(SPHPA_CRUSH_ANY_, &knot->matrix, &knot->at);
    return true;
}

/* The first places to look at between lo and top, from lo up: quarters of each smooth piece. */
enum { SPHPA_PALPHA_PLACES_ = 8, SPHPA_PALPHA_SCAN_ = 23 };

SPHPA_PRIVATE_ int sphpa_palpha_places_(const sphpa_palpha_task_ *task, double lo, double top,
                                        sphpa_palpha_knot_ *pile) {
    bool knee = !task->on_line && task->shape->k1 > 0.0 && lo < 0.0 && top > 0.0;
    double first = knee ? 0.0 : top;
    int count = 0;
    for (int k = 0; k < 4; k++) pile[count++].at.s = lo + 0.25 * k * (first - lo);
    for (int k = 0; k < 4 && knee; k++) pile[count++].at.s = 0.25 * k * top;
    for (int k = 0; k < count; k++) pile[k].at.alpha = 0.0; /* not evaluated yet */
    return count;
}

/* what is known between two knots; at the knee the slopes are those of the side that looks upwards */
SPHPA_PRIVATE_ sphpa_palpha_span_ sphpa_palpha_between_(const sphpa_palpha_task_ *task,
                                                        const sphpa_palpha_knot_ *below,
                                                        const sphpa_palpha_knot_ *above,
                                                        bool third) {
    double s = below->at.s;
    sphpa_palpha_step_ up = below->step;
    if (!(s > 0.0 || s < 0.0) && !task->on_line) {
        if (task->shape->n1 < 2.0) third = false; /* infinite there */
        sphpa_palpha_place_ at = sphpa_palpha_path_(task, SPHPA_CRUSH_ANY_, DBL_MIN);
        up = sphpa_palpha_step_of_(SPHPA_CRUSH_ANY_, &below->matrix, &at);
    }
    return sphpa_palpha_span_of_(&up, &above->step, above->at.s - s, third);
}

/* H(below) <= 0 < H(above): the bracket, and *s where to go on in it: Halley from the nearer end */
SPHPA_PRIVATE_ bool sphpa_palpha_found_(const sphpa_palpha_knot_ *below,
                                        const sphpa_palpha_knot_ *above,
                                        sphpa_palpha_bracket_ *in, double *s,
                                        sphpa_palpha_point_ *point) {
    const sphpa_palpha_knot_ *near = -below->step.H < above->step.H ? below : above;
    in->lo = below->at.s;
    in->hi = above->at.s;
    in->alpha_lo = below->at.alpha;
    in->alpha_hi = above->at.alpha;
    in->lo_known = true;
    in->H_lo = below->step.H;
    in->H_hi = above->step.H;
    in->promised = in->moved = in->width = in->wider = HUGE_VAL;
    *s = near->at.s + near->step.ds;
    if (!(*s > in->lo && *s < in->hi)) *s = 0.5 * (in->lo + in->hi);
    point->alpha = near->at.alpha;
    return true;
}

/* Narrows the bracket to the highest zero of H: down the path from `above`, where H > 0, through
   knots that split it so often that the polynomials between them leave no doubt of where H is
   positive. Of a pair of zeros one may be missed where H is so nearly 0 between them that 23
   evaluations do not tell. False: an evaluation failed, or H > 0 down to the lower end. */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_scan_(sphpa_palpha_eval_ eval, sphpa_palpha_task_ *task,
                                            sphpa_palpha_knot_ above, sphpa_palpha_bracket_ *in,
                                            double *s, sphpa_palpha_point_ *point) {
    sphpa_palpha_knot_ pile[SPHPA_PALPHA_PLACES_ + SPHPA_PALPHA_SCAN_];
    bool third = task->shape->function == NULL && sphpa_finite_(point->matrix.d2);
    double top;
    if (task->rising < above.at.alpha) { /* above it there is one zero at most */
        double rising = sphpa_palpha_where_(task, sphpa_max_(task->rising, in->alpha_lo));
        if (!sphpa_palpha_knot_at_(eval, task, sphpa_max_(rising, in->lo), point, &pile[0]))
            return false;
        if (pile[0].step.H <= 0.0) return sphpa_palpha_found_(&pile[0], &above, in, s, point);
        above = pile[0];
    }
    top = above.at.s;
    for (int depth = sphpa_palpha_places_(task, in->lo, top, pile); depth > 0;) {
        sphpa_palpha_knot_ *below = &pile[depth - 1];
        if (!(below->at.alpha > 0.0) &&
            !sphpa_palpha_knot_at_(eval, task, below->at.s, point, below))
            return false;
        sphpa_palpha_span_ span = sphpa_palpha_between_(task, below, &above, third);
        double h = above.at.s - below->at.s, x = 0.5;
        bool zero = below->step.H <= 0.0, enough = task->evaluations >= SPHPA_PALPHA_SCAN_;
        bool clear = !span.falls && span.doubt <= 0.02 * (above.step.H - below->step.H);
        if (!zero) clear = clear || span.lowest > 3.0 * span.doubt;
        double narrow = 1e-9 * (above.at.s > 0.0 ? top : -in->lo);
        if (!clear && !enough && h > narrow) { /* look between them */
            if (span.at > 0.0 && span.at < 1.0) x = span.at;
            if (!sphpa_palpha_knot_at_(eval, task, below->at.s + x * h, point, &pile[depth]))
                return false;
            depth++;
            continue;
        }
        if (zero) return sphpa_palpha_found_(below, &above, in, s, point);
        above = *below;
        depth--;
    }
    return false;
}

/* out of line, once an equation of state: few states come here */
SPHPA_NO_INLINE_ bool sphpa_palpha_scan_tillotson_(sphpa_palpha_task_ *task,
                                                   sphpa_palpha_knot_ above,
                                                   sphpa_palpha_bracket_ *in, double *s,
                                                   sphpa_palpha_point_ *point) {
    return sphpa_palpha_scan_(sphpa_palpha_eval_tillotson_, task, above, in, s, point);
}

SPHPA_NO_INLINE_ bool sphpa_palpha_scan_any_(sphpa_palpha_task_ *task, sphpa_palpha_knot_ above,
                                             sphpa_palpha_bracket_ *in, double *s,
                                             sphpa_palpha_point_ *point) {
    return sphpa_palpha_scan_(sphpa_palpha_eval_any_, task, above, in, s, point);
}

SPHPA_FORCE_INLINE_ bool sphpa_palpha_search_(sphpa_palpha_eval_ eval, sphpa_palpha_task_ *task,
                                              sphpa_palpha_knot_ above, sphpa_palpha_bracket_ *in,
                                              double *s, sphpa_palpha_point_ *point) {
    return eval == sphpa_palpha_eval_tillotson_
               ? sphpa_palpha_scan_tillotson_(task, above, in, s, point)
               : sphpa_palpha_scan_any_(task, above, in, s, point);
}

/* HERRMANN, F(alpha_old at rest) > 0: is the root on the elastic line? Its lower end tells, where P
   rises with alpha; else the line is searched first. False: go on with the curve, or it failed. */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_line_(sphpa_palpha_eval_ eval, sphpa_palpha_task_ *task,
                                         sphpa_palpha_bracket_ *in, double *s,
                                         sphpa_palpha_point_ *point) {
    sphpa_palpha_knot_ foot, end;
    task->on_line = true;
    foot.at = sphpa_palpha_path_(task, SPHPA_CRUSH_ANY_, task->cap - task->alpha_y);
    foot.matrix = sphpa_palpha_parabola_of_(task, point, NULL);
    foot.step = sphpa_palpha_step_of_(SPHPA_CRUSH_ANY_, &foot.matrix, &foot.at);
    in->lo = 0.0;
    in->alpha_lo = task->alpha_y;
    if (task->rising > task->alpha_y) {
        if (sphpa_palpha_search_(eval, task, foot, in, s, point)) return true;
    } else if (sphpa_palpha_knot_at_(eval, task, 0.0, point, &end) && end.step.H <= 0.0) {
        return sphpa_palpha_found_(&end, &foot, in, s, point);
    }
    task->on_line = false;
    return false;
}

/* F(alpha_old) > 0: the bracket, and *s where to begin. False: *point is the answer, or it failed. */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_locate_(sphpa_palpha_eval_ eval, sphpa_crush_way_ way,
                                              sphpa_palpha_task_ *task, sphpa_palpha_bracket_ *in,
                                              double *s, sphpa_palpha_point_ *point) {
    if (way == SPHPA_CRUSH_ANY_ && task->shape->herrmann) {
        if (sphpa_palpha_line_(eval, task, in, s, point)) return true;
        if (task->result != SPHPA_OK) return false;
        if (!sphpa_palpha_at_(eval, way, task, task->alpha_y, point)) return false;
    }
    sphpa_palpha_parabola_ matrix = sphpa_palpha_parabola_of_(task, point, NULL);
    in->lo = task->shape->s_end;
    in->hi = 1.0;
    in->alpha_lo = 1.0;
    in->alpha_hi = task->alpha_y;
    in->lo_known = false;
    in->H_hi = HUGE_VAL;
    in->H_lo = -HUGE_VAL;
    in->promised = in->moved = in->width = in->wider = HUGE_VAL;
    if (!(task->rising > 1.0)) {
        *s = sphpa_palpha_guess_(task, way, point->P, &matrix);
        return true;
    }
    sphpa_palpha_knot_ top;
    top.at = sphpa_palpha_path_(task, SPHPA_CRUSH_ANY_, sphpa_palpha_where_(task, task->alpha_y));
    top.matrix = matrix;
    top.step = sphpa_palpha_step_of_(SPHPA_CRUSH_ANY_, &matrix, &top.at);
    if (sphpa_palpha_search_(eval, task, top, in, s, point)) return true;
    if (task->result == SPHPA_OK)
        (void)sphpa_palpha_at_(eval, SPHPA_CRUSH_ANY_, task, 1.0, point);
    return false;
}

/* *point: the matrix at task->cap has been evaluated */
SPHPA_FORCE_INLINE_ void sphpa_palpha_crush_space_(sphpa_palpha_eval_ eval, sphpa_crush_way_ way,
                                                   sphpa_palpha_task_ *task,
                                                   sphpa_palpha_point_ *point) {
    sphpa_palpha_bracket_ in;
    double s;
    sphpa_palpha_meet_curve_(task, way, point);
    if (point->F <= 0.0) return;
    if (!sphpa_palpha_locate_(eval, way, task, &in, &s, point)) return;
    sphpa_palpha_close_in_(eval, way, task, in, s, point,
                           sphpa_palpha_parabola_of_(task, point, NULL));
}

/* ---- calls ----------------------------------------------------------------------------------- */

/* Where P of eq. 1 never falls with alpha: D = rho_s dPeos/drho_s - Peos >= 0. In the vapour, with
   z = rho0/rho_s - 1, y = 1 + z, f = 1/w = E0/(E0 + u y^2),
     D = exp(-alpha z^2) 2 alpha z [b rho0 u f (1 + (1 - f)/(alpha z y)) - A g],
     g = (beta/(2 alpha) + z - 1/(2 alpha z)) exp(-beta z).
   So D >= 0 everywhere if u (b rho0 E0 - A y^2 g) >= A E0 g there; most: g and y^2 g are at most
   that, term by term. The hybrid state blends D with the cold one, A + B (eta^2 - 1) and a thermal
   part >= 0; and exp(-alpha z^2) 2 alpha z g <= max (2 r - 1) exp(-r) < 0.4463. alpha or beta 0:
   infinite, nothing is known. */
typedef struct sphpa_palpha_hump_ {
    double g, y2g;
} sphpa_palpha_hump_;

SPHPA_FORCE_INLINE_ sphpa_palpha_hump_ sphpa_palpha_hump_of_(const sphpa_tillotson *mat) {
    double x = 1.0 / mat->beta, k = mat->beta * mat->beta / mat->alpha;
    sphpa_palpha_hump_ most;
    most.g = (0.3679 + 0.0379 * k) * x;
    most.y2g = (0.3679 + x * (1.0828 + x * 1.3444) + k * (0.0379 + x * (0.1354 + x * 0.1546))) * x;
    return most;
}

SPHPA_FORCE_INLINE_ bool sphpa_palpha_vapour_rises_(const sphpa_tillotson *mat,
                                                    const sphpa_palpha_hump_ *most, double eta,
                                                    double u) {
    double gain = u * (mat->b * mat->rho0 * mat->E0 - mat->A * most->y2g);
    double need = mat->A * mat->E0 * most->g;
    if (gain >= need) return true;
    if (!(u < mat->u_cv && need <= DBL_MAX)) return false;
    double cold = mat->zero_B_expanded != 0 ? mat->A : mat->A - mat->B * (1.0 - eta * eta);
    double lost = 0.4463 * mat->A * (gain > 0.0 ? 1.0 - gain / need : 1.0);
    return (mat->u_cv - u) * cold >= (u - mat->u_iv) * lost;
}

/* Is the vapour thinner than the hump from `eta` down? There y^2 g falls with z, and g is below (beta/
   (2 alpha) + z) exp(-beta z). */
SPHPA_NO_INLINE_ bool sphpa_palpha_vapour_thin_(const sphpa_tillotson *mat, double eta, double u) {
    double z = 1.0 / eta - 1.0, y = 1.0 + z, c = 0.5 * mat->beta / mat->alpha;
    if (!(z > 0.0 && 2.0 / y + 1.0 / (z + c) <= mat->beta)) return false;
    double lost = mat->A * (mat->E0 + u * y * y) * (c + z) * sphpa_exp_(-mat->beta * z);
    return mat->b * mat->rho0 * mat->E0 * u >= lost;
}

/* The alpha from which up P of eq. 1 never falls with alpha, as far as `top`; 0: for every alpha in
   [1, top]. Cold: where A + B (eta^2 - 1) >= 0. Vapour that may fall: up to z1, where g = 0. A cut-off
   only acts below Pe, where F does not see P. */
SPHPA_PRIVATE_ double sphpa_palpha_rising_(const sphpa_tillotson *mat, double rho, double u,
                                           double top) {
    double eta = rho / mat->rho0, from = 0.0;
    if (mat->B < 0.0) return HUGE_VAL; /* it falls somewhere above */
    if (eta >= 1.0) return 0.0;
    if (u < mat->u_cv && mat->B > mat->A && mat->zero_B_expanded == 0) {
        double lost = mat->B - mat->A;
        if (mat->B * eta * eta < lost) from = sqrt(lost / mat->B);
    }
    if (u > mat->u_iv) {
        sphpa_palpha_hump_ most = sphpa_palpha_hump_of_(mat);
        if (!sphpa_palpha_vapour_rises_(mat, &most, eta, u) &&
            !sphpa_palpha_vapour_thin_(mat, eta * top, u)) {
            double beta = mat->beta, z1 = 2.0 / (beta + sqrt(beta * beta + 8.0 * mat->alpha));
            from = sphpa_max_(from, 1.0 / (1.0 + z1));
        }
    }
    return from > eta ? from / eta : 0.0;
}

SPHPA_PRIVATE_ double sphpa_palpha_rising_any_(const sphpa_eos *eos) {
    if (eos->eval == sphpa_ideal_eval_any_) return 0.0;
    if (eos->eval == sphpa_murnaghan_eval_any_ &&
        ((const sphpa_murnaghan *)eos->material)->n >= 1.0)
        return 0.0;
    return HUGE_VAL;
}

/* the same ranges as sphpa_tillotson_check, without the words; every solve asks, so in few
   instructions: what is not finite spoils the sum */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_material_ok_(const sphpa_tillotson *mat) {
    double sum = (mat->rho0 + mat->A + mat->B + mat->E0) + (mat->u_cv + mat->a + mat->b) +
                 (mat->alpha + mat->beta + mat->tensile_limit);
    double least = sphpa_min_(sphpa_min_(sphpa_min_(mat->u_iv, mat->a), sphpa_min_(mat->b, mat->alpha)),
                              sphpa_min_(sphpa_min_(mat->beta, mat->tensile_limit),
                                         sphpa_min_(mat->c2_floor, mat->eta_cut)));
    return sphpa_finite_(sum) && least >= 0.0 && mat->rho0 > 0.0 && mat->A > 0.0 &&
           mat->E0 > 0.0 && mat->u_iv >= 0.0 && mat->u_cv > mat->u_iv && mat->c2_floor >= 0.0 &&
           mat->c2_floor <= 1.0 && mat->eta_cut >= 0.0 && mat->eta_cut <= 1.0;
}

/* what a call brings besides states; shape and options once a batch */
typedef struct sphpa_palpha_call_ {
    sphpa_crush_shape_ shape;
    double alpha0, Pe, tol;
    bool flat; /* no elastic line */
    int max_iterations;
    sphpa_palpha_solver solver;
} sphpa_palpha_call_;

SPHPA_PRIVATE_ sphpa_result sphpa_palpha_open_(sphpa_palpha_solver solver, const sphpa_crush *curve,
                                               const sphpa_palpha_options *opt,
                                               sphpa_palpha_call_ *call) {
    if (curve == NULL) return SPHPA_ERROR_MISSING;
    if ((int)solver < 0 || (int)solver >= (int)SPHPA_PALPHA_SOLVER_COUNT) return SPHPA_ERROR_RANGE;
    sphpa_result result = sphpa_crush_check_fields_(curve, NULL);
    if (result != SPHPA_OK) return result;
    if (!sphpa_crush_prepared_(curve)) return SPHPA_ERROR_MISSING;
    call->solver = solver;
    call->alpha0 = curve->alpha0;
    call->Pe = curve->Pe;
    call->flat = curve->elastic == SPHPA_CRUSH_FLAT;
    call->tol = 1e-12;
    call->max_iterations = 100;
    if (opt != NULL) {
        if (!sphpa_finite_(opt->tol)) return SPHPA_ERROR_NOT_FINITE;
        if (opt->tol < 0.0 || opt->max_iterations < 0) return SPHPA_ERROR_RANGE;
        if (opt->tol > 0.0) call->tol = opt->tol;
        if (opt->max_iterations > 0) call->max_iterations = opt->max_iterations;
    }
    return SPHPA_OK;
}

SPHPA_FORCE_INLINE_ sphpa_result sphpa_palpha_check_(double alpha0, double rho, double u,
                                                     double alpha_old) {
    if (!sphpa_finite_(rho) || !sphpa_finite_(u) || !sphpa_finite_(alpha_old))
        return SPHPA_ERROR_NOT_FINITE;
    if (!(rho > 0.0) || u < 0.0) return SPHPA_ERROR_NEGATIVE;
    if (alpha_old < 1.0 - 4.0 * DBL_EPSILON || alpha_old > alpha0 + 4.0 * DBL_EPSILON * alpha0)
        return SPHPA_ERROR_ALPHA;
    return SPHPA_OK;
}

/* a state that passed sphpa_palpha_check_; clamps alpha_old's last 4 ulp */
SPHPA_FORCE_INLINE_ void sphpa_palpha_begin_(const sphpa_palpha_call_ *call, const void *material,
                                             double rho, double u, double alpha_old,
                                             sphpa_palpha_task_ *task) {
    double alpha0 = call->alpha0;
    task->shape = &call->shape;
    task->evaluations = task->iterations = task->fell_back = 0;
    task->rising = HUGE_VAL;
    task->result = SPHPA_OK;
    task->material = material;
    task->rho = rho;
    task->u = u;
    task->tol = call->tol;
    task->max_iterations = call->max_iterations;
    task->alpha_y = task->cap = sphpa_clamp_(alpha_old, 1.0, alpha0);
    task->kink = HUGE_VAL;
    task->floor2 = 0.0;
    task->on_line = task->foot = false;
    if (call->shape.herrmann) {
        sphpa_crush_line_ line = sphpa_crush_line_of_(&call->shape, task->alpha_y);
        task->alpha_y = line.alpha_y;
        task->Py = line.Py;
        task->cap = line.rest;
        double at_cap = line.Py + sphpa_crush_phi_(&call->shape, line.alpha_y, line.rest);
        task->foot = line.rest < alpha0 || fabs(at_cap) <= DBL_EPSILON * line.Py;
    }
}

/* The density where Tillotson's P has a kink: none below u_iv, unless B ends there. */
SPHPA_FORCE_INLINE_ double sphpa_palpha_kink_(const sphpa_tillotson *mat, bool hot) {
    return hot || mat->zero_B_expanded != 0 ? mat->rho0 : 0.0;
}

SPHPA_FORCE_INLINE_ double sphpa_palpha_floor2_(const sphpa_tillotson *mat) {
    return (mat->c2_floor > 0.0 ? mat->c2_floor : 0.01) * mat->A / mat->rho0;
}

#define SPHPA_PALPHA_THIN_ 1e-280 /* [kg/m3] */

/* the adiabatic speed in the matrix, floored */
SPHPA_FORCE_INLINE_ double sphpa_palpha_c_(const sphpa_palpha_matrix_ *matrix, double rho_s,
                                           double floor2) {
    double inv_rho = 1.0 / rho_s;
    if (matrix->c >= 0.0) return matrix->c;
    return sqrt(sphpa_max_(matrix->d1 + (matrix->P * inv_rho) * (matrix->dP_du * inv_rho), floor2));
}

/* The same next to the least number, where P and dP/du lose their digits: all that is left there is
   a gas, whose speed does not depend on its density. */
SPHPA_NO_INLINE_ double sphpa_palpha_c_thin_(sphpa_palpha_eval_ eval,
                                             const sphpa_palpha_task_ *task,
                                             const sphpa_palpha_matrix_ *matrix) {
    sphpa_palpha_matrix_ denser = *matrix;
    if (matrix->c < 0.0) (void)eval(task->material, SPHPA_PALPHA_THIN_, task->u, &denser);
    return sphpa_palpha_c_(&denser, SPHPA_PALPHA_THIN_, task->floor2);
}

/* *point is the answer */
SPHPA_FORCE_INLINE_ sphpa_result sphpa_palpha_answer_(sphpa_palpha_eval_ eval,
                                                      const sphpa_palpha_task_ *task,
                                                      const sphpa_palpha_point_ *point,
                                                      sphpa_palpha_solution *out) {
    if (task->result != SPHPA_OK && task->result != SPHPA_ERROR_NOT_CONVERGED) return task->result;
    out->alpha = point->alpha;
    out->P = point->P;
    double rho_s = point->alpha * task->rho;
    out->c = rho_s < SPHPA_PALPHA_THIN_ ? sphpa_palpha_c_thin_(eval, task, &point->matrix)
                                        : sphpa_palpha_c_(&point->matrix, rho_s, task->floor2);
    out->residual = point->F;
    out->evaluations = task->evaluations;
    out->iterations = task->iterations;
    out->fell_back = task->fell_back;
    return task->result;
}

SPHPA_FORCE_INLINE_ sphpa_result sphpa_palpha_run_(sphpa_palpha_eval_ eval,
                                                   sphpa_palpha_solver solver,
                                                   sphpa_crush_way_ way, sphpa_palpha_task_ *task,
                                                   sphpa_palpha_solution *out) {
    sphpa_palpha_point_ point;
    if (!(task->cap > 1.0)) (void)sphpa_palpha_at_(eval, way, task, 1.0, &point);
    else if (solver == SPHPA_PALPHA_CRUSH_SPACE) {
        if (sphpa_palpha_matrix_at_(eval, task, task->cap, &point))
            sphpa_palpha_crush_space_(eval, way, task, &point);
    } else if (sphpa_palpha_ends_(eval, way, task, &point)) (void)0;
    else if (solver == SPHPA_PALPHA_BISECTION) sphpa_palpha_bisect_(eval, way, task, &point);
    else if (solver == SPHPA_PALPHA_NEWTON) sphpa_palpha_newton_(eval, way, task, &point);
    else sphpa_palpha_safe_newton_(eval, way, task, &point);
    return sphpa_palpha_answer_(eval, task, &point, out);
}

/* The fast solver once for each way of a curve, the others for the quadratic one and for any;
   Tillotson's equations inlined. */
SPHPA_NO_INLINE_ sphpa_result sphpa_palpha_run_crush_space_(sphpa_palpha_task_ *task,
                                                            sphpa_palpha_point_ *point,
                                                            sphpa_palpha_solution *out) {
    const sphpa_palpha_eval_ eval = sphpa_palpha_eval_tillotson_;
    if (!(task->cap > 1.0)) {
        point->P = point->matrix.P;
        point->F = 0.0;
    } else if (task->shape->way == SPHPA_CRUSH_SQUARE_) {
        sphpa_palpha_crush_space_(eval, SPHPA_CRUSH_SQUARE_, task, point);
    } else if (task->shape->way == SPHPA_CRUSH_POWERS_) {
        sphpa_palpha_crush_space_(eval, SPHPA_CRUSH_POWERS_, task, point);
    } else {
        sphpa_palpha_crush_space_(eval, SPHPA_CRUSH_ANY_, task, point);
    }
    return sphpa_palpha_answer_(eval, task, point, out);
}

#define SPHPA_PALPHA_INSTANCE_(name, solver)                                                       \
    SPHPA_NO_INLINE_ sphpa_result name(sphpa_palpha_task_ *task, sphpa_palpha_solution *out) {     \
        sphpa_crush_way_ way = task->shape->way;                                                   \
        if (way == SPHPA_CRUSH_SQUARE_)                                                            \
            return sphpa_palpha_run_(sphpa_palpha_eval_tillotson_, solver, SPHPA_CRUSH_SQUARE_,    \
                                     task, out);                                                   \
        return sphpa_palpha_run_(sphpa_palpha_eval_tillotson_, solver, way, task, out);            \
    }
SPHPA_PALPHA_INSTANCE_(sphpa_palpha_run_bisection_, SPHPA_PALPHA_BISECTION)
SPHPA_PALPHA_INSTANCE_(sphpa_palpha_run_newton_, SPHPA_PALPHA_NEWTON)
SPHPA_PALPHA_INSTANCE_(sphpa_palpha_run_safe_newton_, SPHPA_PALPHA_SAFE_NEWTON)
#undef SPHPA_PALPHA_INSTANCE_

/* a cut-off; the pores do not see it: P < Pe either way */
SPHPA_FORCE_INLINE_ double sphpa_palpha_cut_(const sphpa_tillotson *mat, double rho, double alpha,
                                             double P) {
    double least = sphpa_tillotson_least_(mat, alpha * rho) / alpha;
    return P < least ? least : P;
}

/* Most states of a run end here: alpha_old is evaluated, and P there is below Pe, or there are no
   pores. No curve is needed for that. False: the matrix there is in *point. */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_elastic_(const sphpa_tillotson *mat, double Pe, double alpha,
                                               double rho, double u, sphpa_palpha_point_ *point,
                                               sphpa_palpha_solution *out) {
    double rho_s = alpha * rho;
    (void)sphpa_palpha_eval_tillotson_(mat, rho_s, u, &point->matrix);
    double P = point->matrix.P / alpha;
    point->alpha = alpha;
    if ((!(P < Pe) && alpha > 1.0) || rho_s < SPHPA_PALPHA_THIN_ || !(fabs(P) <= DBL_MAX))
        return false;
    out->alpha = alpha;
    out->P = P < 0.0 ? sphpa_palpha_cut_(mat, rho, alpha, P) : P;
    out->c = sphpa_palpha_c_(&point->matrix, rho_s, sphpa_palpha_floor2_(mat));
    out->residual = 0.0;
    out->evaluations = 1;
    out->iterations = out->fell_back = 0;
    return true;
}

/* One state of a call, on which `spent` evaluations have been spent. make: where the call's shape has
   yet to be made of the curve, if it is needed; NULL: it is there. */
typedef struct sphpa_palpha_given_ {
    const sphpa_palpha_call_ *call;
    const sphpa_tillotson *mat;
    const sphpa_crush *curve;
    sphpa_crush_shape_ *make;
    double rho, u, alpha_old;
    int spent;
} sphpa_palpha_given_;

SPHPA_FORCE_INLINE_ void sphpa_palpha_task_of_(const sphpa_palpha_given_ *given,
                                               sphpa_palpha_task_ *task) {
    const sphpa_tillotson *mat = given->mat;
    if (given->make != NULL) sphpa_crush_shape_of_(given->curve, given->make);
    sphpa_palpha_begin_(given->call, mat, given->rho, given->u, given->alpha_old, task);
    task->kink = sphpa_palpha_kink_(mat, given->u > mat->u_iv) / given->rho;
    task->floor2 = sphpa_palpha_floor2_(mat);
    task->evaluations = given->spent;
}

SPHPA_NO_INLINE_ sphpa_result sphpa_palpha_crush_(const sphpa_palpha_given_ *given,
                                                  sphpa_palpha_point_ *point,
                                                  sphpa_palpha_solution *out) {
    sphpa_palpha_task_ task;
    sphpa_palpha_task_of_(given, &task);
    if (!given->call->flat) { /* else alpha_old has been evaluated */
        if (!sphpa_palpha_matrix_at_(sphpa_palpha_eval_tillotson_, &task, task.cap, point))
            return task.result;
    } else {
        task.evaluations++;
        if (!sphpa_finite_(point->matrix.P)) return SPHPA_ERROR_NOT_FINITE;
    }
    task.rising = sphpa_palpha_rising_(given->mat, task.rho, task.u, task.cap);
    return sphpa_palpha_run_crush_space_(&task, point, out);
}

SPHPA_NO_INLINE_ sphpa_result sphpa_palpha_teach_(const sphpa_palpha_given_ *given,
                                                  sphpa_palpha_solution *out) {
    sphpa_palpha_task_ task;
    sphpa_palpha_task_of_(given, &task);
    if (given->call->solver == SPHPA_PALPHA_BISECTION)
        return sphpa_palpha_run_bisection_(&task, out);
    if (given->call->solver == SPHPA_PALPHA_NEWTON) return sphpa_palpha_run_newton_(&task, out);
    return sphpa_palpha_run_safe_newton_(&task, out);
}

SPHPA_FORCE_INLINE_ sphpa_result sphpa_palpha_one_(const sphpa_palpha_given_ *given, bool fast,
                                                   sphpa_palpha_solution *out) {
    const sphpa_palpha_call_ *call = given->call;
    const sphpa_tillotson *mat = given->mat;
    double rho = given->rho, u = given->u, alpha_old = given->alpha_old;
    sphpa_result result = sphpa_palpha_check_(call->alpha0, rho, u, alpha_old);
    if (result != SPHPA_OK) return result;
    if (fast) {
        sphpa_palpha_point_ point;
        double cap = sphpa_clamp_(alpha_old, 1.0, call->alpha0);
        if (call->flat && sphpa_palpha_elastic_(mat, call->Pe, cap, rho, u, &point, out))
            return SPHPA_OK;
        result = sphpa_palpha_crush_(given, &point, out);
    } else {
        result = sphpa_palpha_teach_(given, out);
    }
    if (result != SPHPA_OK && result != SPHPA_ERROR_NOT_CONVERGED) return result;
    if (out->P < 0.0) out->P = sphpa_palpha_cut_(mat, rho, out->alpha, out->P);
    return result;
}

SPHPA_DEF const char *sphpa_palpha_solver_name(sphpa_palpha_solver solver) {
    static const char *const names[] = {"crush-space", "bisection", "newton", "safe-newton"};
    int k = (int)solver;
    return k >= 0 && k < (int)SPHPA_PALPHA_SOLVER_COUNT ? names[k] : NULL;
}

SPHPA_FORCE_INLINE_ sphpa_result sphpa_palpha_solve_by_(sphpa_palpha_solver solver, bool fast,
                                                        const sphpa_tillotson *mat,
                                                        const sphpa_crush *curve,
                                                        const double *state,
                                                        const sphpa_palpha_options *opt,
                                                        sphpa_palpha_solution *out) {
    sphpa_palpha_call_ call;
    if (mat == NULL || out == NULL) return SPHPA_ERROR_MISSING;
    sphpa_result result = sphpa_palpha_open_(solver, curve, opt, &call);
    if (result != SPHPA_OK) return result;
    if (!sphpa_palpha_material_ok_(mat)) return SPHPA_ERROR_MATERIAL;
    sphpa_palpha_given_ given = {&call, mat, curve, &call.shape, state[0], state[1], state[2], 0};
    return sphpa_palpha_one_(&given, fast, out);
}

/* two functions, so that a program which names its solver holds no other */
SPHPA_NO_INLINE_ sphpa_result sphpa_palpha_solve_fast_(const sphpa_tillotson *mat,
                                                       const sphpa_crush *curve,
                                                       const double *state,
                                                       const sphpa_palpha_options *opt,
                                                       sphpa_palpha_solution *out) {
    return sphpa_palpha_solve_by_(SPHPA_PALPHA_CRUSH_SPACE, true, mat, curve, state, opt, out);
}

SPHPA_NO_INLINE_ sphpa_result sphpa_palpha_solve_teach_(sphpa_palpha_solver solver,
                                                        const sphpa_tillotson *mat,
                                                        const sphpa_crush *curve,
                                                        const double *state,
                                                        const sphpa_palpha_options *opt,
                                                        sphpa_palpha_solution *out) {
    return sphpa_palpha_solve_by_(solver, false, mat, curve, state, opt, out);
}

SPHPA_DEF sphpa_result sphpa_palpha_solve(sphpa_palpha_solver solver, const sphpa_tillotson *mat,
                                          const sphpa_crush *curve, double rho, double u,
                                          double alpha_old, const sphpa_palpha_options *opt,
                                          sphpa_palpha_solution *out) {
    double state[3];
    state[0] = rho;
    state[1] = u;
    state[2] = alpha_old;
    if (solver == SPHPA_PALPHA_CRUSH_SPACE)
        return sphpa_palpha_solve_fast_(mat, curve, state, opt, out);
    return sphpa_palpha_solve_teach_(solver, mat, curve, state, opt, out);
}

SPHPA_DEF sphpa_result sphpa_palpha_solve_eos(sphpa_palpha_solver solver, const sphpa_eos *eos,
                                              const sphpa_crush *curve, double rho, double u,
                                              double alpha_old, const sphpa_palpha_options *opt,
                                              sphpa_palpha_solution *out) {
    sphpa_palpha_call_ call;
    sphpa_palpha_task_ task;
    if (eos == NULL || eos->eval == NULL || out == NULL) return SPHPA_ERROR_MISSING;
    if (eos->eval == sphpa_tillotson_eval_any_)
        return sphpa_palpha_solve(solver, (const sphpa_tillotson *)eos->material, curve, rho, u,
                                  alpha_old, opt, out);
    sphpa_result result = sphpa_palpha_open_(solver, curve, opt, &call);
    if (result != SPHPA_OK) return result;
    result = sphpa_palpha_check_(call.alpha0, rho, u, alpha_old);
    if (result != SPHPA_OK) return result;
    sphpa_crush_shape_of_(curve, &call.shape);
    sphpa_palpha_begin_(&call, eos, rho, u, alpha_old, &task);
    if (solver == SPHPA_PALPHA_CRUSH_SPACE && eos->material != NULL)
        task.rising = sphpa_palpha_rising_any_(eos);
    return sphpa_palpha_run_(sphpa_palpha_eval_any_, solver, SPHPA_CRUSH_ANY_, &task, out);
}

/* ---- many states at once --------------------------------------------------------------------- */

/* States side by side, for loops that the compiler turns into SIMD: FLAT, a closed curve, P known to
   rise with alpha. Whatever is not plain (a step out of the bracket that does not come to rest, a
   value that is not finite) is left to the scalar solver. */
enum { SPHPA_LANES_ = 128, SPHPA_LANES_ROUNDS_ = 6 };

typedef struct sphpa_palpha_lanes_ {
    size_t n, id[SPHPA_LANES_]; /* id: in the batch */
    double rho[SPHPA_LANES_], u[SPHPA_LANES_], cap[SPHPA_LANES_], inv_rho[SPHPA_LANES_];
    double s[SPHPA_LANES_], lo[SPHPA_LANES_], hi[SPHPA_LANES_];   /* place, and bracket */
    double from[SPHPA_LANES_], Y1[SPHPA_LANES_], Y2[SPHPA_LANES_]; /* alpha a step before, Y there */
    double alpha[SPHPA_LANES_], P[SPHPA_LANES_], c[SPHPA_LANES_]; /* the answer, if it is one */
    double done[SPHPA_LANES_];                                    /* 1: it is; else 0 */
} sphpa_palpha_lanes_;

/* What all lanes share; copies, which no store in the loop can touch. */
typedef struct sphpa_palpha_common_ {
    sphpa_tillotson mat;
    sphpa_crush_shape_ shape;
    double tol, floor2;
} sphpa_palpha_common_;

/* Tillotson without a branch: `hot` lanes have u > u_iv, the others never leave the cold branch */
SPHPA_FORCE_INLINE_ sphpa_tillotson_branch_ sphpa_palpha_lane_eos_(const sphpa_tillotson *mat,
                                                                   bool hot, double rho_s,
                                                                   double u) {
    sphpa_tillotson_branch_ cold = sphpa_tillotson_cold_(mat, rho_s, u), out;
    if (!hot) return cold;
    double expanded = sphpa_min_(rho_s, mat->rho0); /* above rho0 it is not looked at */
    sphpa_tillotson_branch_ vapour = sphpa_tillotson_vapour_(mat, expanded, u);
    sphpa_tillotson_branch_ blend =
        sphpa_tillotson_blend_(mat, sphpa_min_(u, mat->u_cv), &vapour, &cold);
    bool dense = rho_s >= mat->rho0, gas = u >= mat->u_cv;
    out.P = dense ? cold.P : gas ? vapour.P : blend.P;
    out.dP_drho = dense ? cold.dP_drho : gas ? vapour.dP_drho : blend.dP_drho;
    out.dP_du = dense ? cold.dP_du : gas ? vapour.dP_du : blend.dP_du;
    out.d2P_drho2 = dense ? cold.d2P_drho2 : gas ? vapour.d2P_drho2 : blend.d2P_drho2;
    out.d2P_drho_du = dense ? cold.d2P_drho_du : gas ? vapour.d2P_drho_du : blend.d2P_drho_du;
    return out;
}

SPHPA_FORCE_INLINE_ double sphpa_palpha_lane_c_(const sphpa_palpha_common_ *common, double P,
                                                double d1, double dP_du, double inv_rho_s) {
    double c2 = d1 + (P * inv_rho_s) * (dP_du * inv_rho_s);
    return sqrt(sphpa_max_(c2, common->floor2));
}

SPHPA_FORCE_INLINE_ sphpa_palpha_parabola_ sphpa_palpha_lane_parabola_(
    const sphpa_tillotson_branch_ *eos, double rho, double alpha) {
    sphpa_palpha_parabola_ out;
    out.alpha = alpha;
    out.Y = eos->P;
    out.Y1 = rho * eos->dP_drho;
    out.Y2 = rho * rho * eos->d2P_drho2;
    return out;
}

/* yes and no of a lane are 1 and 0: compilers make masks of these, but not of every bool */
SPHPA_FORCE_INLINE_ double sphpa_palpha_and_(double yes, bool also) { return also ? yes : 0.0; }
SPHPA_FORCE_INLINE_ double sphpa_palpha_or_(double yes, bool or_else) { return or_else ? 1.0 : yes; }

/* Lane i at alpha_old: the answer if that is elastic. */
SPHPA_FORCE_INLINE_ void sphpa_palpha_lane_end_(const sphpa_palpha_common_ *common, bool hot,
                                                sphpa_crush_way_ way, sphpa_palpha_lanes_ *x,
                                                size_t i) {
    const sphpa_tillotson *mat = &common->mat;
    double rho = x->rho[i], cap = x->cap[i], rho_s = cap * rho, inv_s = 1.0 / rho_s;
    sphpa_tillotson_branch_ eos = sphpa_palpha_lane_eos_(mat, hot, rho_s, x->u[i]);
    sphpa_palpha_parabola_ matrix = sphpa_palpha_lane_parabola_(&eos, rho, cap);
    double inv = rho * inv_s, P = eos.P / cap; /* divided, as the scalar solver does */
    double least = mat->tensile_limit > 0.0 ? -mat->tensile_limit : -DBL_MAX;
    least = rho_s < mat->eta_cut * mat->rho0 ? 0.0 : least;
    x->done[i] = sphpa_palpha_and_(
        cap <= sphpa_crush_curve_lane_(&common->shape, way, P) ? 1.0 : 0.0, fabs(P) <= DBL_MAX);
    x->alpha[i] = cap;
    x->P[i] = sphpa_max_(eos.P, least) * inv;
    x->c[i] = sphpa_palpha_lane_c_(common, eos.P, eos.dP_drho, eos.dP_du, inv_s);
    x->inv_rho[i] = cap * inv_s;
    x->s[i] = P; /* for the guess */
    x->Y1[i] = matrix.Y1;
    x->Y2[i] = matrix.Y2;
}

/* a step of the parabola towards the path, without an evaluation */
SPHPA_FORCE_INLINE_ double sphpa_palpha_lane_model_(const sphpa_crush_shape_ *shape,
                                                    sphpa_crush_way_ way,
                                                    const sphpa_palpha_parabola_ *matrix, double s) {
    sphpa_palpha_place_ at = sphpa_palpha_on_curve_(shape, way, s);
    sphpa_palpha_step_ step = sphpa_palpha_slopes_(matrix, &at);
    double end = shape->s_end, ds;
    if (way == SPHPA_CRUSH_SQUARE_) ds = sphpa_crush_halley_lane_(step.H, step.H1, step.H2);
    else ds = sphpa_crush_step_lane_(step.H, step.H1, step.H2, step.H3);
    double moved = fabs(ds) < 1.0 - end ? sphpa_clamp_(s + ds, end, 1.0) : s;
    return s > end ? moved : s;
}

/* The first place of lane i, as sphpa_palpha_guess_ has it. */
SPHPA_FORCE_INLINE_ void sphpa_palpha_lane_guess_(const sphpa_palpha_common_ *common,
                                                  sphpa_crush_way_ way, sphpa_palpha_lanes_ *x,
                                                  size_t i) {
    const sphpa_crush_shape_ *shape = &common->shape;
    double P = x->s[i], cap = x->cap[i], end = shape->s_end;
    sphpa_palpha_parabola_ matrix;
    matrix.alpha = cap;
    matrix.Y = P * cap;
    matrix.Y1 = x->Y1[i];
    matrix.Y2 = x->Y2[i];
    double D = (matrix.Y1 - P) / cap, gas = ((shape->Ps - P) * shape->inv_R - shape->t0) / shape->c;
    double s = sphpa_crush_meet_(shape, way, sphpa_max_(D, 0.0), cap, P);
    s = sphpa_max_(D > 0.0 ? s : gas, end);
    s = sphpa_palpha_lane_model_(shape, way, &matrix, s);
    x->s[i] = s;
    x->lo[i] = end;
    x->hi[i] = 1.0;
    x->from[i] = cap;
}

/* The answer at `to` on the path, along the parabola around at->alpha; see sphpa_palpha_settle_ */
SPHPA_FORCE_INLINE_ void sphpa_palpha_lane_settle_(const sphpa_palpha_common_ *common,
                                                   const sphpa_palpha_parabola_ *matrix,
                                                   const sphpa_tillotson_branch_ *eos,
                                                   const sphpa_palpha_place_ *to, double met,
                                                   sphpa_palpha_lanes_ *x, size_t i) {
    double alpha = sphpa_clamp_(to->alpha, 1.0, x->cap[i]), inv = 1.0 / alpha;
    double rho = x->rho[i], d = alpha - matrix->alpha, d_rho = d * rho;
    double Y = matrix->Y + d * (matrix->Y1 + 0.5 * d * matrix->Y2), P = Y * inv;
    met = fabs(to->alpha1 * (matrix->Y1 - P)) > -to->P1 * alpha ? met : 0.0;
    x->alpha[i] = alpha;
    x->P[i] = met > 0.0 ? to->P : P;
    x->c[i] = sphpa_palpha_lane_c_(common, Y, eos->dP_drho + d_rho * eos->d2P_drho2,
                                   eos->dP_du + d_rho * eos->d2P_drho_du, inv * x->inv_rho[i]);
}

/* The step of lane i from `at`: the bracket, and where it leads; yes if inside. */
SPHPA_FORCE_INLINE_ double sphpa_palpha_lane_next_(const sphpa_crush_shape_ *shape,
                                                   const sphpa_palpha_step_ *step, double alpha,
                                                   sphpa_palpha_lanes_ *x, size_t i,
                                                   double *next) {
    double s = x->s[i], lo = x->lo[i], hi = x->hi[i], end = shape->s_end;
    double known = sphpa_palpha_or_(sphpa_palpha_and_(step->H <= 0.0 ? 1.0 : 0.0, s <= end), lo > end);
    double above = sphpa_palpha_or_(step->H > 0.0 ? 1.0 : 0.0, alpha > x->cap[i]);
    hi = above > 0.0 ? s : hi;
    lo = above > 0.0 ? lo : s;
    double far = s + step->ds, middle = hi > 0.0 ? 0.0 : 0.5 * (lo + hi);
    double inside = sphpa_palpha_and_(far >= lo ? 1.0 : 0.0, far <= hi);
    middle = lo < 0.0 ? middle : 0.5 * (lo + hi); /* 0: the knee */
    middle = sphpa_palpha_and_(1.0 - known, far <= lo) > 0.0 ? lo : middle;
    *next = inside > 0.0 ? far : middle;
    x->lo[i] = lo;
    x->hi[i] = hi;
    return inside;
}

/* yes if a move of lane i from `at` to `to` is its last: the smooth end of sphpa_palpha_close_in_ */
SPHPA_FORCE_INLINE_ double sphpa_palpha_lane_last_(const sphpa_palpha_common_ *common, bool hot,
                                                   const sphpa_palpha_parabola_ *matrix,
                                                   const sphpa_palpha_step_ *step,
                                                   const sphpa_palpha_place_ *to, double P,
                                                   double small, const sphpa_palpha_lanes_ *x,
                                                   size_t i) {
    double at = matrix->alpha, from = x->from[i], size = fabs(to->alpha - at);
    double before = sphpa_min_(fabs(at - from), 0.5 * at), cube = size * size * size;
    double slope = step->H1 + step->H2 * step->ds, rho = x->rho[i];
    double kink = sphpa_palpha_kink_(&common->mat, hot);
    double low = sphpa_min_(sphpa_min_(from, at), to->alpha);
    double high = sphpa_max_(sphpa_max_(from, at), to->alpha);
    double change = fabs(matrix->Y2 - x->Y2[i]) * to->alpha1;
    double exact = small * fabs(matrix->Y1 - P) + 8.0 * DBL_EPSILON * fabs(matrix->Y);
    double allowed = sphpa_min_(small * slope, exact * to->alpha1);
    double yes = 100.0 * size * cube * slope <= allowed * (before * before * before) ? 1.0 : 0.0;
    yes = sphpa_palpha_and_(yes, 10.0 * change * cube <= allowed * before);
    return sphpa_palpha_and_(high * rho < kink ? 1.0 : low * rho >= kink ? 1.0 : 0.0, yes > 0.0);
}

/* One round of sphpa_palpha_close_in_ for lane i. */
SPHPA_FORCE_INLINE_ void sphpa_palpha_lane_round_(const sphpa_palpha_common_ *common, bool hot,
                                                  sphpa_crush_way_ way, sphpa_palpha_lanes_ *x,
                                                  size_t i) {
    const sphpa_crush_shape_ *shape = &common->shape;
    double rho = x->rho[i], s = x->s[i], next;
    sphpa_palpha_place_ at = sphpa_palpha_on_curve_(shape, way, s), to;
    sphpa_tillotson_branch_ eos = sphpa_palpha_lane_eos_(&common->mat, hot, at.alpha * rho, x->u[i]);
    sphpa_palpha_parabola_ matrix = sphpa_palpha_lane_parabola_(&eos, rho, at.alpha);
    sphpa_palpha_step_ step = sphpa_palpha_slopes_(&matrix, &at);
    step.ds = sphpa_crush_step_lane_(step.H, step.H1, step.H2, step.H3);
    double small = sphpa_max_(common->tol, 4.0 * DBL_EPSILON * at.alpha);
    double closed = sphpa_palpha_and_(step.H > 0.0 ? 1.0 : 0.0, s <= shape->s_end);
    double inside = sphpa_palpha_lane_next_(shape, &step, at.alpha, x, i, &next);
    to = sphpa_palpha_on_curve_(shape, way, next);
    double last = sphpa_palpha_lane_last_(common, hot, &matrix, &step, &to, at.P, small, x, i);
    last = sphpa_palpha_and_(last, sphpa_palpha_step_good_(shape, way, &matrix, &step, &at, small,
                                                           to.alpha - at.alpha));
    last = sphpa_palpha_and_(sphpa_palpha_and_(last, inside > 0.0), to.alpha <= x->cap[i] + small);
    if (way != SPHPA_CRUSH_SQUARE_) { /* no knee between */
        last = sphpa_palpha_and_(last, sphpa_min_(s, next) > 0.0 || sphpa_max_(s, next) <= 0.0);
    }
    to.alpha = closed > 0.0 ? at.alpha : to.alpha;
    sphpa_palpha_lane_settle_(common, &matrix, &eos, &to, last, x, i);
    x->done[i] = sphpa_palpha_and_(sphpa_max_(closed, last),
                                   fabs(matrix.Y) + fabs(matrix.Y1) <= DBL_MAX);
    x->s[i] = to.s;
    x->from[i] = at.alpha;
    x->Y2[i] = matrix.Y2;
}

/* The loops, once for each kind of lanes. The copy keeps the stores from touching what is shared. To
   become SIMD they need -O3 and, for the square roots, -fno-math-errno; no pragma asks for it, since
   where that is missing clang would warn. */
#define SPHPA_PALPHA_LOOPS_(name, hot, way)                                                        \
    SPHPA_NO_INLINE_ void sphpa_palpha_ends_##name##_(const sphpa_palpha_common_ *shared,          \
                                                      sphpa_palpha_lanes_ *x) {                    \
        const sphpa_palpha_common_ common = *shared;                                               \
        const size_t n = (x->n + 3) & ~(size_t)3;                                                  \
        for (size_t i = 0; i < n; i++) sphpa_palpha_lane_end_(&common, hot, way, x, i);            \
    }                                                                                              \
    SPHPA_NO_INLINE_ void sphpa_palpha_round_##name##_(const sphpa_palpha_common_ *shared,         \
                                                       sphpa_palpha_lanes_ *x) {                   \
        const sphpa_palpha_common_ common = *shared;                                               \
        const size_t n = (x->n + 3) & ~(size_t)3;                                                  \
        for (size_t i = 0; i < n; i++) sphpa_palpha_lane_round_(&common, hot, way, x, i);          \
    }
SPHPA_PALPHA_LOOPS_(cold_square, false, SPHPA_CRUSH_SQUARE_)
SPHPA_PALPHA_LOOPS_(cold_powers, false, SPHPA_CRUSH_LANES_)
SPHPA_PALPHA_LOOPS_(hot_square, true, SPHPA_CRUSH_SQUARE_)
SPHPA_PALPHA_LOOPS_(hot_powers, true, SPHPA_CRUSH_LANES_)
#undef SPHPA_PALPHA_LOOPS_

#define SPHPA_PALPHA_LOOPS_(name, way)                                                             \
    SPHPA_NO_INLINE_ void sphpa_palpha_guesses_##name##_(const sphpa_palpha_common_ *shared,       \
                                                         sphpa_palpha_lanes_ *x) {                 \
        const sphpa_palpha_common_ common = *shared;                                               \
        const size_t n = (x->n + 3) & ~(size_t)3;                                                  \
        for (size_t i = 0; i < n; i++) sphpa_palpha_lane_guess_(&common, way, x, i);               \
    }
SPHPA_PALPHA_LOOPS_(square, SPHPA_CRUSH_SQUARE_)
SPHPA_PALPHA_LOOPS_(powers, SPHPA_CRUSH_LANES_)
#undef SPHPA_PALPHA_LOOPS_

/* One batch: what is given, and where the answers go. */
typedef struct sphpa_palpha_batch_ {
    const sphpa_palpha_call_ *call;
    sphpa_palpha_common_ common;
    const double *rho, *u, *alpha_old;
    double *alpha, *P;
    bool lanes, cold_rises; /* lanes can be used; P rises with alpha wherever u <= u_iv */
} sphpa_palpha_batch_;

/* The states of a block that are left to the scalar solver, and the evaluations that lanes have spent
   on them. */
typedef struct sphpa_palpha_block_ {
    size_t n, id[SPHPA_LANES_];
    int spent[SPHPA_LANES_];
} sphpa_palpha_block_;

SPHPA_PRIVATE_ void sphpa_palpha_stats_clear_(sphpa_palpha_stats *stats, size_t n) {
    stats->failed = stats->evaluations = stats->fell_back = 0;
    stats->first_failed = n;
    stats->evaluations_max = 0;
}

/* the scalar solver for state i, with what lanes have spent on it already */
SPHPA_PRIVATE_ sphpa_result sphpa_palpha_batch_one_(const sphpa_palpha_batch_ *batch, size_t i,
                                                    int spent, sphpa_palpha_stats *stats) {
    sphpa_palpha_solution state;
    sphpa_palpha_given_ given = {batch->call,   &batch->common.mat,  NULL, NULL, batch->rho[i],
                                 batch->u[i], batch->alpha_old[i], spent};
    sphpa_result result = sphpa_palpha_one_(&given, batch->call->solver == SPHPA_PALPHA_CRUSH_SPACE,
                                            &state);
    if (stats->status != NULL) stats->status[i] = (unsigned char)result;
    if (result != SPHPA_OK) {
        stats->failed++;
        if (i < stats->first_failed) stats->first_failed = i;
        if (result != SPHPA_ERROR_NOT_CONVERGED) return result;
    }
    batch->alpha[i] = state.alpha;
    batch->P[i] = state.P;
    if (stats->c != NULL) stats->c[i] = state.c;
    if (stats->residual != NULL) stats->residual[i] = state.residual;
    stats->evaluations += (size_t)state.evaluations;
    if (state.evaluations > stats->evaluations_max) stats->evaluations_max = state.evaluations;
    if (state.fell_back != 0) stats->fell_back++;
    return result;
}

/* copies a lane */
SPHPA_FORCE_INLINE_ void sphpa_palpha_lane_move_(sphpa_palpha_lanes_ *x, size_t to, size_t from) {
    x->id[to] = x->id[from];
    x->rho[to] = x->rho[from];
    x->u[to] = x->u[from];
    x->cap[to] = x->cap[from];
    x->inv_rho[to] = x->inv_rho[from];
    x->s[to] = x->s[from];
    x->lo[to] = x->lo[from];
    x->hi[to] = x->hi[from];
    x->from[to] = x->from[from];
    x->Y1[to] = x->Y1[from];
    x->Y2[to] = x->Y2[from];
}

/* The loops run over whole vectors: up to three copies of the last lane behind it, which nobody asks
   for. */
SPHPA_FORCE_INLINE_ void sphpa_palpha_lanes_fill_(sphpa_palpha_lanes_ *x) {
    for (size_t i = x->n; i > 0 && i % 4 != 0; i++) sphpa_palpha_lane_move_(x, i, x->n - 1);
}

/* lane k's answer to its state; alpha may lie on top of alpha_old */
SPHPA_FORCE_INLINE_ void sphpa_palpha_batch_take_(const sphpa_palpha_batch_ *batch,
                                                  const sphpa_palpha_lanes_ *x, size_t k,
                                                  sphpa_palpha_stats *stats) {
    size_t i = x->id[k];
    batch->alpha[i] = x->alpha[k];
    batch->P[i] = x->P[k];
    if (stats->c != NULL) stats->c[i] = x->c[k];
    if (stats->status != NULL) stats->status[i] = (unsigned char)SPHPA_OK;
    if (stats->residual == NULL) return;
    double slope, on = sphpa_crush_curve_(&batch->common.shape, SPHPA_CRUSH_ANY_, x->P[k], &slope);
    stats->residual[i] = x->alpha[k] - sphpa_min_(on, x->cap[k]);
}

/* takes the answers of the lanes that are done and closes the ranks */
SPHPA_PRIVATE_ void sphpa_palpha_batch_gather_(const sphpa_palpha_batch_ *batch,
                                               sphpa_palpha_lanes_ *x, int spent,
                                               sphpa_palpha_stats *stats) {
    size_t left = 0;
    for (size_t k = 0; k < x->n; k++) {
        if (x->done[k] > 0.0) {
            sphpa_palpha_batch_take_(batch, x, k, stats);
            continue;
        }
        if (left < k) sphpa_palpha_lane_move_(x, left, k);
        left++;
    }
    stats->evaluations += (size_t)spent * (x->n - left);
    if (left < x->n && spent > stats->evaluations_max) stats->evaluations_max = spent;
    x->n = left;
    sphpa_palpha_lanes_fill_(x);
}

/* All rounds of one kind of lanes; what does not come to rest is left to the scalar solver. */
SPHPA_PRIVATE_ void sphpa_palpha_batch_lanes_(const sphpa_palpha_batch_ *batch, bool hot,
                                              sphpa_palpha_lanes_ *x, sphpa_palpha_block_ *block,
                                              sphpa_palpha_stats *stats) {
    const sphpa_palpha_common_ *common = &batch->common;
    bool square = common->shape.way == SPHPA_CRUSH_SQUARE_;
    int spent = 1;
    if (x->n == 0) return;
    for (size_t i = x->n; i % 4 != 0; i++) { /* whole vectors, here too */
        x->rho[i] = x->rho[x->n - 1];
        x->u[i] = x->u[x->n - 1];
        x->cap[i] = x->cap[x->n - 1];
    }
    if (hot && square) sphpa_palpha_ends_hot_square_(common, x);
    else if (hot) sphpa_palpha_ends_hot_powers_(common, x);
    else if (square) sphpa_palpha_ends_cold_square_(common, x);
    else sphpa_palpha_ends_cold_powers_(common, x);
    sphpa_palpha_batch_gather_(batch, x, spent, stats);
    if (square) sphpa_palpha_guesses_square_(common, x);
    else sphpa_palpha_guesses_powers_(common, x);
    for (; spent <= SPHPA_LANES_ROUNDS_ && x->n > 0; spent++) {
        if (hot && square) sphpa_palpha_round_hot_square_(common, x);
        else if (hot) sphpa_palpha_round_hot_powers_(common, x);
        else if (square) sphpa_palpha_round_cold_square_(common, x);
        else sphpa_palpha_round_cold_powers_(common, x);
        sphpa_palpha_batch_gather_(batch, x, spent + 1, stats);
    }
    for (size_t i = 0; i < x->n; i++) {
        block->spent[block->n] = spent;
        block->id[block->n++] = x->id[i];
    }
}

/* May state i go by lane? Everything that begin_ would mind, and all that lanes leave out. */
SPHPA_FORCE_INLINE_ bool sphpa_palpha_batch_plain_(const sphpa_palpha_batch_ *batch, double rho,
                                                   double u, double alpha_old) {
    const sphpa_tillotson *mat = &batch->common.mat;
    bool range = (rho > 1e-100) & (rho < 1e100) & (u >= 0.0) & (u < 1e100) & (alpha_old > 1.0) &
                 (alpha_old <= batch->common.shape.alpha0);
    if (!range || !batch->lanes) return false;
    return (batch->cold_rises && u <= mat->u_iv) || sphpa_palpha_rising_(mat, rho, u, alpha_old) <= 1.0;
}

/* The states [first, first + n), n at most SPHPA_LANES_. Those that are left to the scalar solver come
   last: no one has written to their alpha, which may lie on top of their alpha_old. */
SPHPA_PRIVATE_ sphpa_result sphpa_palpha_batch_block_(const sphpa_palpha_batch_ *batch,
                                                      size_t first, size_t n,
                                                      sphpa_palpha_stats *stats) {
    sphpa_palpha_lanes_ lanes[2]; /* cold, hot */
    sphpa_palpha_block_ block;
    sphpa_result worst = SPHPA_OK;
    block.n = lanes[0].n = lanes[1].n = 0;
    for (size_t i = first; i < first + n; i++) {
        double rho = batch->rho[i], u = batch->u[i], alpha_old = batch->alpha_old[i];
        if (!sphpa_palpha_batch_plain_(batch, rho, u, alpha_old)) {
            block.spent[block.n] = 0;
            block.id[block.n++] = i;
            continue;
        }
        sphpa_palpha_lanes_ *x = &lanes[u > batch->common.mat.u_iv];
        x->id[x->n] = i;
        x->rho[x->n] = rho;
        x->u[x->n] = u;
        x->cap[x->n++] = alpha_old;
    }
    sphpa_palpha_batch_lanes_(batch, false, &lanes[0], &block, stats);
    sphpa_palpha_batch_lanes_(batch, true, &lanes[1], &block, stats);
    for (size_t k = 0; k < block.n; k++) {
        sphpa_result result = sphpa_palpha_batch_one_(batch, block.id[k], block.spent[k], stats);
        if (result > worst) worst = result;
    }
    return worst;
}

/* adds up what the blocks have counted; the arrays are the caller's */
SPHPA_PRIVATE_ void sphpa_palpha_stats_add_(sphpa_palpha_stats *stats,
                                            const sphpa_palpha_stats *block) {
    stats->failed += block->failed;
    stats->evaluations += block->evaluations;
    stats->fell_back += block->fell_back;
    if (block->first_failed < stats->first_failed) stats->first_failed = block->first_failed;
    if (block->evaluations_max > stats->evaluations_max)
        stats->evaluations_max = block->evaluations_max;
}

SPHPA_PRIVATE_ sphpa_result sphpa_palpha_batch_run_(const sphpa_palpha_batch_ *batch, size_t n,
                                                    sphpa_palpha_stats *stats) {
    sphpa_result worst = SPHPA_OK;
    long long blocks = (long long)((n + SPHPA_LANES_ - 1) / SPHPA_LANES_);
    sphpa_palpha_stats_clear_(stats, n);
    SPHPA_OMP(parallel for schedule(static) if(blocks >= 32))
    for (long long b = 0; b < blocks; b++) {
        size_t first = (size_t)b * SPHPA_LANES_;
        size_t count = n - first, most = SPHPA_LANES_;
        if (count > most) count = most;
        sphpa_palpha_stats mine = *stats;
        sphpa_palpha_stats_clear_(&mine, n);
        sphpa_result result = sphpa_palpha_batch_block_(batch, first, count, &mine);
        SPHPA_OMP(critical(sphpa_palpha_stats))
        {
            sphpa_palpha_stats_add_(stats, &mine);
            if (result > worst) worst = result;
        }
    }
    return worst;
}

SPHPA_DEF sphpa_result sphpa_palpha_solve_batch(sphpa_palpha_solver solver,
                                                const sphpa_tillotson *mat,
                                                const sphpa_crush *curve, size_t n,
                                                const double *rho, const double *u,
                                                const double *alpha_old,
                                                const sphpa_palpha_options *opt, double *alpha,
                                                double *P, sphpa_palpha_stats *stats) {
    sphpa_palpha_call_ call;
    sphpa_palpha_batch_ batch;
    sphpa_palpha_stats own;
    if (mat == NULL) return SPHPA_ERROR_MISSING;
    if (n > 0 && (rho == NULL || u == NULL || alpha_old == NULL || alpha == NULL || P == NULL))
        return SPHPA_ERROR_MISSING;
    sphpa_result result = sphpa_palpha_open_(solver, curve, opt, &call);
    if (result != SPHPA_OK) return result;
    if (!sphpa_palpha_material_ok_(mat)) return SPHPA_ERROR_MATERIAL;
    sphpa_crush_shape_of_(curve, &call.shape);
    memset(&own, 0, sizeof own);
    batch.call = &call;
    batch.common.mat = *mat;
    batch.common.shape = call.shape;
    batch.common.tol = call.tol;
    batch.common.floor2 = sphpa_palpha_floor2_(mat);
    batch.rho = rho;
    batch.u = u;
    batch.alpha_old = alpha_old;
    batch.alpha = alpha;
    batch.P = P;
    batch.lanes = solver == SPHPA_PALPHA_CRUSH_SPACE && !call.shape.dense &&
                  call.shape.way != SPHPA_CRUSH_ANY_ && call.shape.m1 <= SPHPA_CRUSH_LANE_MOST_ &&
                  call.shape.m2 <= SPHPA_CRUSH_LANE_MOST_;
    batch.cold_rises = mat->B >= 0.0 && (mat->B <= mat->A || mat->zero_B_expanded != 0);
    return sphpa_palpha_batch_run_(&batch, n, stats != NULL ? stats : &own);
}

/* ---- around the step ------------------------------------------------------------------------- */

/* The differential form at one state: alpha' and what eqs. 6 and 7 make of it. */
typedef struct sphpa_palpha_slope_ {
    double P, dP_drho, dP_du;
    double dalpha_dP; /* 0 where pores neither close nor spring */
    double bottom;    /* alpha + alpha' (P - rho dPeos/drho_s) */
    bool elastic;     /* below the curve */
} sphpa_palpha_slope_;

/* on_curve: the caller says that the state is on the curve; else it must be within a millionth */
SPHPA_PRIVATE_ sphpa_result sphpa_palpha_slope_at_(const sphpa_tillotson *mat,
                                                   const sphpa_crush *curve, double rho, double u,
                                                   double alpha, bool on_curve,
                                                   sphpa_palpha_slope_ *out) {
    sphpa_palpha_call_ call;
    sphpa_eos_point point;
    if (mat == NULL) return SPHPA_ERROR_MISSING;
    sphpa_result result = sphpa_palpha_open_(SPHPA_PALPHA_CRUSH_SPACE, curve, NULL, &call);
    if (result != SPHPA_OK) return result;
    result = sphpa_palpha_check_(call.alpha0, rho, u, alpha);
    if (result != SPHPA_OK) return result;
    sphpa_crush_shape_of_(curve, &call.shape);
    result = sphpa_tillotson_eval(mat, alpha * rho, u, &point);
    if (result != SPHPA_OK) return result;
    const sphpa_crush_shape_ *shape = &call.shape;
    out->P = point.P / alpha;
    out->dP_drho = point.dP_drho;
    out->dP_du = point.dP_du;
    out->dalpha_dP = 0.0;
    out->elastic = true;
    if (!shape->dense && alpha > 1.0) {
        double slope, on = sphpa_crush_curve_(shape, shape->way, out->P, &slope);
        out->elastic = out->P < shape->Pe ||
                       (!on_curve && on > alpha + 1e-6 * (shape->alpha0 - 1.0));
        if (!out->elastic) out->dalpha_dP = slope;
        else if (shape->herrmann && out->P >= 0.0)
            out->dalpha_dP = sphpa_crush_line_slope_(shape, alpha);
    }
    out->bottom = alpha + out->dalpha_dP * (out->P - rho * out->dP_drho);
    return SPHPA_OK;
}

SPHPA_DEF sphpa_result sphpa_palpha_loading_c(const sphpa_tillotson *mat, const sphpa_crush *curve,
                                              double rho, double u, double alpha, double *c) {
    sphpa_palpha_slope_ at;
    if (c == NULL) return SPHPA_ERROR_MISSING;
    sphpa_result result = sphpa_palpha_slope_at_(mat, curve, rho, u, alpha, true, &at);
    if (result != SPHPA_OK) return result;
    double c2 = (alpha * at.dP_drho + at.dP_du * at.P / (rho * rho)) / at.bottom;
    if (!(c2 >= 0.0)) return SPHPA_ERROR_RANGE;
    *c = sqrt(c2);
    return SPHPA_OK;
}

SPHPA_DEF sphpa_result sphpa_palpha_rate(const sphpa_tillotson *mat, const sphpa_crush *curve,
                                         double rho, double u, double alpha, double drho_dt,
                                         double du_dt, double *dalpha_dt) {
    sphpa_palpha_slope_ at;
    if (dalpha_dt == NULL) return SPHPA_ERROR_MISSING;
    if (!sphpa_finite_(drho_dt) || !sphpa_finite_(du_dt)) return SPHPA_ERROR_NOT_FINITE;
    sphpa_result result = sphpa_palpha_slope_at_(mat, curve, rho, u, alpha, false, &at);
    if (result != SPHPA_OK) return result;
    double rate = (du_dt * at.dP_du + alpha * drho_dt * at.dP_drho) * at.dalpha_dP / at.bottom;
    *dalpha_dt = at.elastic ? rate : sphpa_min_(rate, 0.0);
    return SPHPA_OK;
}

SPHPA_DEF sphpa_result sphpa_palpha_dalpha_drho(const sphpa_tillotson *mat,
                                                const sphpa_crush *curve, double rho, double u,
                                                double alpha, double *dalpha_drho) {
    sphpa_palpha_slope_ at;
    if (dalpha_drho == NULL) return SPHPA_ERROR_MISSING;
    sphpa_result result = sphpa_palpha_slope_at_(mat, curve, rho, u, alpha, false, &at);
    if (result != SPHPA_OK) return result;
    *dalpha_drho =
        (at.P / (rho * rho) * at.dP_du + alpha * at.dP_drho) * at.dalpha_dP / at.bottom;
    return SPHPA_OK;
}

SPHPA_DEF double sphpa_palpha_strain_share(double rho_0, double alpha_0, double rho_1,
                                           double alpha_1) {
    double bulk = log(rho_1 / rho_0);
    if (fabs(bulk) < 1e-12 || !(alpha_1 < alpha_0)) return 1.0;
    return sphpa_clamp_((bulk + log(alpha_1 / alpha_0)) / bulk, 0.0, 1.0);
}

/* ---- the exact piston ------------------------------------------------------------------------ */

typedef struct sphpa_palpha_side_ {
    double rho, u, P, v, alpha;
} sphpa_palpha_side_;

/* The shock that raises the particle speed by dv > 0: with x = 1 - rho1/rho2 its speed past the
   material ahead is W = dv/x, and Rankine-Hugoniot gives P2 = P1 + rho1 dv^2/x and
   u2 = u1 + P1 x/rho1 + dv^2/2. P(rho2, u2) of eqs. 1, 4 rises with x and P2 falls: halve. */
SPHPA_PRIVATE_ sphpa_result sphpa_palpha_shock_(const sphpa_palpha_call_ *call,
                                                const sphpa_tillotson *mat,
                                                const sphpa_palpha_side_ *ahead, double dv,
                                                sphpa_palpha_side_ *behind, double *W) {
    sphpa_palpha_solution state;
    double low = 0.0, high = 1.0;
    for (int k = 0; k < 1100; k++) {
        double x = 0.5 * (low + high);
        if (!(x > low && x < high)) break;
        double P = ahead->P + ahead->rho * dv * dv / x;
        behind->rho = ahead->rho / (1.0 - x);
        behind->u = ahead->u + ahead->P * x / ahead->rho + 0.5 * dv * dv;
        sphpa_palpha_given_ given = {call, mat, NULL, NULL, behind->rho, behind->u,
                                     call->shape.alpha0, 0};
        sphpa_result result = sphpa_palpha_one_(&given, true, &state);
        if (result != SPHPA_OK) return result;
        behind->P = state.P;
        behind->alpha = state.alpha;
        *W = dv / x;
        if (state.P < P) low = x;
        else high = x;
    }
    behind->v = ahead->v + dv;
    return SPHPA_OK;
}

/* The elastic wave at whose back the pores are about to close: the Hugoniot state with P = Pe. */
SPHPA_PRIVATE_ sphpa_result sphpa_palpha_precursor_(const sphpa_palpha_call_ *call,
                                                    const sphpa_tillotson *mat,
                                                    const sphpa_palpha_side_ *rest,
                                                    sphpa_palpha_side_ *out, double *speed) {
    double alpha = call->shape.top, Pe = call->shape.Pe, low = 0.0, high = 1.0;
    *out = *rest;
    *speed = 0.0;
    if (!(Pe > 0.0)) return SPHPA_OK;
    for (int k = 0; k < 1100; k++) {
        double x = 0.5 * (low + high);
        sphpa_eos_point point;
        if (!(x > low && x < high)) break;
        out->rho = rest->rho / (1.0 - x);
        out->u = 0.5 * Pe * x / rest->rho;
        sphpa_result result = sphpa_tillotson_eval(mat, alpha * out->rho, out->u, &point);
        if (result != SPHPA_OK) return result;
        if (point.P < alpha * Pe) low = x;
        else high = x;
    }
    out->P = Pe;
    out->alpha = alpha;
    out->v = sqrt(Pe * (1.0 / rest->rho - 1.0 / out->rho));
    *speed = Pe / (rest->rho * out->v);
    return SPHPA_OK;
}

SPHPA_PRIVATE_ void sphpa_palpha_shock_write_(const sphpa_palpha_side_ *elastic, double precursor,
                                              const sphpa_palpha_side_ *last, double speed,
                                              sphpa_palpha_shock *out) {
    out->precursor_speed = precursor;
    out->precursor_v = elastic->v;
    out->precursor_P = elastic->P;
    out->precursor_rho = elastic->rho;
    out->precursor_u = elastic->u;
    out->precursor_alpha = elastic->alpha;
    out->speed = speed;
    out->v = last->v;
    out->P = last->P;
    out->rho = last->rho;
    out->u = last->u;
    out->alpha = last->alpha;
    out->waves = (precursor > 0.0) + (speed > 0.0);
}

SPHPA_DEF sphpa_result sphpa_palpha_hugoniot(const sphpa_tillotson *mat, const sphpa_crush *curve,
                                             double piston_speed, sphpa_palpha_shock *out) {
    sphpa_palpha_call_ call;
    sphpa_palpha_options opt;
    sphpa_palpha_side_ rest, elastic, last;
    double precursor, W = 0.0;
    memset(&opt, 0, sizeof opt);
    opt.tol = 1e-15;
    if (mat == NULL || out == NULL) return SPHPA_ERROR_MISSING;
    if (!sphpa_finite_(piston_speed)) return SPHPA_ERROR_NOT_FINITE;
    if (!(piston_speed > 0.0)) return SPHPA_ERROR_NEGATIVE;
    sphpa_result result = sphpa_palpha_open_(SPHPA_PALPHA_CRUSH_SPACE, curve, &opt, &call);
    if (result != SPHPA_OK) return result;
    if (!sphpa_palpha_material_ok_(mat)) return SPHPA_ERROR_MATERIAL;
    sphpa_crush_shape_of_(curve, &call.shape);
    memset(&rest, 0, sizeof rest);
    rest.alpha = call.shape.alpha0;
    rest.rho = mat->rho0 / rest.alpha;
    result = sphpa_palpha_precursor_(&call, mat, &rest, &elastic, &precursor);
    if (result != SPHPA_OK) return result;
    if (precursor > 0.0 && piston_speed <= elastic.v) { /* too slow to close a pore */
        result = sphpa_palpha_shock_(&call, mat, &rest, piston_speed, &last, &W);
        if (result == SPHPA_OK) sphpa_palpha_shock_write_(&last, W, &last, 0.0, out);
        return result;
    }
    double dv = piston_speed - elastic.v;
    result = sphpa_palpha_shock_(&call, mat, &elastic, dv, &last, &W);
    if (result != SPHPA_OK) return result;
    if (precursor > 0.0 && elastic.v + W >= precursor) { /* one shock swallows the precursor */
        result = sphpa_palpha_shock_(&call, mat, &rest, piston_speed, &last, &W);
        if (result != SPHPA_OK) return result;
        elastic = rest;
        precursor = 0.0;
    }
    sphpa_palpha_shock_write_(&elastic, precursor, &last, elastic.v + W, out);
    return SPHPA_OK;
}

SPHPA_EXTERN_C_END_
#endif /* >>porosity */

#if SPHPA_WANT_STRENGTH_ && !defined(SPHPA_STRENGTH_DONE_)
#define SPHPA_STRENGTH_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>strength   implementation
   ============================================================================================== */

SPHPA_DEF void sphpa_hooke_advance(sphpa_sym3 *S, double stiffness_dt, const double L[9]) {
    double third = stiffness_dt / 3.0, half = 0.5 * stiffness_dt;
    S->xx += third * (2.0 * L[0] - L[4] - L[8]); /* not L - tr/3: exactly 0 for pure dilation */
    S->yy += third * (2.0 * L[4] - L[8] - L[0]);
    S->zz += third * (2.0 * L[8] - L[0] - L[4]);
    S->xy += half * (L[1] + L[3]);
    S->yz += half * (L[5] + L[7]);
    S->xz += half * (L[2] + L[6]);
}

/* With a the axial vector of W dt/2, (I - A)^-1 (I + A) = I + B, B = 2 (A + A^2)/(1 + a.a), the
   rotation of the unit quaternion (1, a)/sqrt(1 + a.a). Divided by its largest entry first, so that
   a.a does not overflow. The change B S + S B^T + B S B^T is added to S as a whole: the rounding of
   B is relative to the angle, so many small steps do not let |S| drift. */
SPHPA_DEF void sphpa_jaumann_rotate(sphpa_sym3 *S, const double L[9], double dt) {
    double x = 0.25 * (L[7] - L[5]) * dt, y = 0.25 * (L[2] - L[6]) * dt,
           z = 0.25 * (L[3] - L[1]) * dt, w = 1.0;
    if (x == 0.0 && y == 0.0 && z == 0.0) return;
    double largest = sphpa_max_(sphpa_max_(1.0, fabs(x)), sphpa_max_(fabs(y), fabs(z)));
    x /= largest;
    y /= largest;
    z /= largest;
    w /= largest;
    double s = 2.0 / (w * w + x * x + y * y + z * z);
    double B[3][3] = {{-s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)},
                      {s * (x * y + z * w), -s * (x * x + z * z), s * (y * z - x * w)},
                      {s * (x * z - y * w), s * (y * z + x * w), -s * (x * x + y * y)}};
    double T[3][3]; /* B S */
    for (int a = 0; a < 3; a++) {
        T[a][0] = B[a][0] * S->xx + B[a][1] * S->xy + B[a][2] * S->xz;
        T[a][1] = B[a][0] * S->xy + B[a][1] * S->yy + B[a][2] * S->yz;
        T[a][2] = B[a][0] * S->xz + B[a][1] * S->yz + B[a][2] * S->zz;
    }
    S->xx += 2.0 * T[0][0] + (T[0][0] * B[0][0] + T[0][1] * B[0][1] + T[0][2] * B[0][2]);
    S->yy += 2.0 * T[1][1] + (T[1][0] * B[1][0] + T[1][1] * B[1][1] + T[1][2] * B[1][2]);
    S->zz += 2.0 * T[2][2] + (T[2][0] * B[2][0] + T[2][1] * B[2][1] + T[2][2] * B[2][2]);
    S->xy += T[0][1] + T[1][0] + (T[0][0] * B[1][0] + T[0][1] * B[1][1] + T[0][2] * B[1][2]);
    S->yz += T[1][2] + T[2][1] + (T[1][0] * B[2][0] + T[1][1] * B[2][1] + T[1][2] * B[2][2]);
    S->xz += T[0][2] + T[2][0] + (T[0][0] * B[2][0] + T[0][1] * B[2][1] + T[0][2] * B[2][2]);
}

SPHPA_DEF double sphpa_strength_j2(const sphpa_sym3 *S) {
    double normal = S->xx * S->xx + S->yy * S->yy + S->zz * S->zz;
    double shear = S->xy * S->xy + S->yz * S->yz + S->xz * S->xz;
    return 0.5 * normal + shear;
}

SPHPA_DEF sphpa_result sphpa_yield_drucker_prager(double phi, double cohesion,
                                                  sphpa_yield_match match, sphpa_yield *out,
                                                  sphpa_error *err) {
    if (!sphpa_finite_(phi) || !sphpa_finite_(cohesion))
        return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                               "Drucker-Prager: phi = %g, cohesion = %g; pass finite numbers", phi,
                               cohesion);
    if (!(phi >= 0.0 && phi < 0.5 * SPHPA_PI_))
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "Drucker-Prager: phi = %g rad lies outside [0, pi/2); is it in "
                               "degrees? Multiply by pi/180",
                               phi);
    if (!(cohesion >= 0.0))
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "Drucker-Prager: cohesion = %g Pa; pass 0 or more", cohesion);
    if (match != SPHPA_YIELD_TRIAXIAL && match != SPHPA_YIELD_PLANE_STRAIN)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "Drucker-Prager: match = %d; pass SPHPA_YIELD_TRIAXIAL or "
                               "SPHPA_YIELD_PLANE_STRAIN",
                               (int)match);
    memset(out, 0, sizeof *out);
    out->kind = SPHPA_YIELD_DRUCKER_PRAGER;
    if (match == SPHPA_YIELD_TRIAXIAL) {
        double below = sqrt(3.0) * (3.0 - sin(phi));
        out->a_phi = 2.0 * sin(phi) / below;
        out->k_c = 6.0 * cohesion * cos(phi) / below;
    } else {
        double slope = tan(phi), below = sqrt(9.0 + 12.0 * slope * slope);
        out->a_phi = slope / below;
        out->k_c = 3.0 * cohesion / below;
    }
    return SPHPA_OK;
}

/* one member: finite and not below `low` */
SPHPA_PRIVATE_ sphpa_result sphpa_yield_member_(const char *name, double value, double low,
                                                sphpa_error *err) {
    if (!sphpa_finite_(value))
        return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE, "yield: %s = %g; pass a finite number",
                               name, value);
    if (value < low)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE, "yield: %s = %g; pass %g or more", name,
                               value, low);
    return SPHPA_OK;
}

SPHPA_DEF sphpa_result sphpa_yield_check(const sphpa_yield *y, sphpa_error *err) {
    if (y == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING, "yield: no surface was passed (NULL)");
    sphpa_result result = SPHPA_OK;
    switch ((int)y->kind) {
    case SPHPA_YIELD_NONE: return SPHPA_OK;
    case SPHPA_YIELD_VON_MISES: result = sphpa_yield_member_("Y0", y->Y0, 0.0, err); break;
    case SPHPA_YIELD_DRUCKER_PRAGER:
        result = sphpa_yield_member_("a_phi", y->a_phi, 0.0, err);
        if (result == SPHPA_OK) result = sphpa_yield_member_("k_c", y->k_c, 0.0, err);
        break;
    case SPHPA_YIELD_COLLINS:
        result = sphpa_yield_member_("Y0", y->Y0, 0.0, err);
        if (result == SPHPA_OK) result = sphpa_yield_member_("Ym (at least Y0)", y->Ym, y->Y0, err);
        if (result == SPHPA_OK) result = sphpa_yield_member_("mu_i", y->mu_i, 0.0, err);
        if (result == SPHPA_OK) result = sphpa_yield_member_("mu_d", y->mu_d, 0.0, err);
        break;
    default:
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "yield: kind = %d is none of NONE, VON_MISES, DRUCKER_PRAGER, "
                               "COLLINS (0 to 3)",
                               (int)y->kind);
    }
    if (result != SPHPA_OK) return result;
    return sphpa_yield_member_("u_melt (0: no softening)", y->u_melt, 0.0, err);
}

/* equation (7), D in [0,1]; the hyperbola as room/(1 + room/load): no overflow, no 0/0 */
SPHPA_PRIVATE_ double sphpa_yield_collins_(const sphpa_yield *y, double P, double D) {
    if (P != P) return P;
    if (P < 0.0) return (1.0 - D) * sphpa_max_(0.0, y->Y0 + y->mu_i * P);
    double room = y->Ym - y->Y0, load = y->mu_i * P;
    double Yi = load > 0.0 ? y->Y0 + room / (1.0 + room / load) : y->Y0;
    double Yd = sphpa_min_(y->mu_d * P, Yi);
    return (1.0 - D) * Yi + D * Yd;
}

SPHPA_DEF double sphpa_yield_strength(const sphpa_yield *y, double P, double u, double D) {
    double Y;
    switch ((int)y->kind) {
    case SPHPA_YIELD_VON_MISES: Y = y->Y0; break;
    case SPHPA_YIELD_DRUCKER_PRAGER: Y = sphpa_max_(0.0, y->k_c + 3.0 * y->a_phi * P); break;
    case SPHPA_YIELD_COLLINS: Y = sphpa_yield_collins_(y, P, sphpa_clamp_(D, 0.0, 1.0)); break;
    default: return HUGE_VAL;
    }
    if (y->u_melt > 0.0) Y *= sphpa_clamp_(1.0 - u / y->u_melt, 0.0, 1.0); /* (8) */
    return Y;
}

SPHPA_DEF double sphpa_yield_limit(const sphpa_yield *y, double P, double u, double D, double alpha,
                                   sphpa_sym3 *S) {
    if (y->kind == SPHPA_YIELD_NONE) return 1.0;
    double limit = sphpa_yield_strength(y, P, u, D) / alpha;
    double finite = 0.0 * S->xx + 0.0 * S->yy + 0.0 * S->zz + 0.0 * S->xy + 0.0 * S->yz +
                    0.0 * S->xz; /* NaN where a component is not finite */
    if (!(alpha > 0.0) || limit != limit || finite != 0.0) return (double)NAN;
    double size = sphpa_max_(sphpa_max_(fabs(S->xx), fabs(S->yy)), fabs(S->zz));
    size = sphpa_max_(sphpa_max_(size, fabs(S->xy)), sphpa_max_(fabs(S->yz), fabs(S->xz)));
    if (size == 0.0) return 1.0;
    /* J2 of S/size lies in [1/2, 9/2]: neither overflow nor 0/0 */
    sphpa_sym3 T = {S->xx / size, S->yy / size, S->zz / size,
                    S->xy / size, S->yz / size, S->xz / size};
    double j2 = sphpa_strength_j2(&T);
    double measure = sqrt(y->kind == SPHPA_YIELD_VON_MISES ? 3.0 * j2 : j2);
    double factor = limit / size / measure;
    if (!(factor < 1.0)) return 1.0;
    double scale = limit / measure; /* not factor * size: factor may underflow */
    S->xx = T.xx * scale;
    S->yy = T.yy * scale;
    S->zz = T.zz * scale;
    S->xy = T.xy * scale;
    S->yz = T.yz * scale;
    S->xz = T.xz * scale;
    return factor;
}

SPHPA_EXTERN_C_END_
#endif /* >>strength */

#if SPHPA_WANT_DAMAGE_ && !defined(SPHPA_DAMAGE_DONE_)
#define SPHPA_DAMAGE_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>damage   implementation
   ============================================================================================== */

#define SPHPA_FLAW_STOP_MAX_ 1000.0 /* [1] T of 2^32 particles is below 60 for all practical odds */

/* ---- flaws ----------------------------------------------------------------------------------- */

SPHPA_PRIVATE_ bool sphpa_flaw_usable_(const sphpa_flaw_params *params) {
    return params != NULL && params->k > 0.0 && params->m > 0.0 && params->volume > 0.0;
}

/* eq. 2; logarithms one by one, for k V alone may leave the range of doubles */
SPHPA_PRIVATE_ double sphpa_flaw_threshold_(const sphpa_flaw_params *params, double j) {
    return exp((log(j) - log(params->k) - log(params->volume)) / params->m);
}

SPHPA_PRIVATE_ sphpa_result sphpa_flaw_check_value_(const char *name, const char *unit,
                                                    double value, sphpa_error *err) {
    if (!sphpa_finite_(value))
        return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                               "Weibull flaws: %s is %g; give a finite number", name, value);
    if (!(value > 0.0))
        return sphpa_error_set(err, SPHPA_ERROR_NEGATIVE,
                               "Weibull flaws: %s = %g%s; give a value above 0", name, value,
                               unit);
    return SPHPA_OK;
}

SPHPA_DEF sphpa_result sphpa_flaw_check(const sphpa_flaw_params *params, size_t n,
                                        sphpa_error *err) {
    if (params == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                               "Weibull flaws: no parameters; give k, m and the solid's volume");
    sphpa_result result = sphpa_flaw_check_value_("k", " m^-3", params->k, err);
    if (result == SPHPA_OK) result = sphpa_flaw_check_value_("m", "", params->m, err);
    if (result == SPHPA_OK)
        result = sphpa_flaw_check_value_("the solid's volume", " m^3", params->volume, err);
    if (result != SPHPA_OK) return result;
    if (n == 0)
        return sphpa_error_set(err, SPHPA_ERROR_EMPTY,
                               "Weibull flaws: no particles; give at least one");
    if ((uint64_t)n > 0xffffffffu)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "Weibull flaws: %.0f particles; at most 2^32 - 1 are possible",
                               (double)n);
    /* j from far below the first to the longest walk (n t, t <= 1000) */
    double low = sphpa_flaw_threshold_(params, 1e-20);
    double high = sphpa_flaw_threshold_(params, (double)n * SPHPA_FLAW_STOP_MAX_);
    if (!(low >= DBL_MIN) || !(high <= DBL_MAX))
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "Weibull flaws: k = %g m^-3, m = %g and %g m^3 of solid give "
                               "thresholds from %g to %g; check the units",
                               params->k, params->m, params->volume, low, high);
    return SPHPA_OK;
}

SPHPA_DEF double sphpa_flaw_threshold(const sphpa_flaw_params *params, double j) {
    if (!sphpa_flaw_usable_(params) || !(j > 0.0)) return (double)NAN;
    return sphpa_flaw_threshold_(params, j);
}

SPHPA_DEF double sphpa_flaw_count(const sphpa_flaw_params *params, double eps) {
    if (!sphpa_flaw_usable_(params)) return (double)NAN;
    if (eps <= 0.0) return 0.0;
    return exp(params->m * log(eps) + log(params->k) + log(params->volume)); /* eq. 1 times V */
}

SPHPA_DEF sphpa_result sphpa_flaw_assign(const sphpa_flaw_params *params, size_t n, sphpa_rng *rng,
                                         sphpa_flaw_visit visit, void *user, size_t *total) {
    sphpa_result result = sphpa_flaw_check(params, n, NULL);
    if (result != SPHPA_OK) return result;
    if (rng == NULL || visit == NULL) return SPHPA_ERROR_MISSING;
    /* Erdos & Renyi 1961: more than n (ln n + c) draws are needed with odds of 1 - exp(-e^-c) */
    double limit = (double)n * (log((double)n) + 64.0);
    size_t j = 0;
    for (size_t without = n; without > 0;) {
        if ((double)j >= limit) return SPHPA_ERROR_NOT_CONVERGED;
        j++;
        size_t particle = sphpa_rng_below(rng, (uint32_t)n);
        uint32_t had = visit(user, particle, sphpa_flaw_threshold_(params, (double)j), j);
        if (had == SPHPA_FLAW_QUIT) return SPHPA_STOPPED;
        if (had == 0) without--;
    }
    if (total != NULL) *total = j;
    return SPHPA_OK;
}

SPHPA_DEF double sphpa_flaw_stopping_time(size_t n, sphpa_rng *rng) {
    if (n == 0 || rng == NULL) return (double)NAN;
    double odds = sphpa_rng_uniform(rng);
    if (odds <= 0.0) odds = 0.5 * DBL_EPSILON;
    return -log(-expm1(log(odds) / (double)n)); /* (1 - e^-T)^n = odds */
}

/* eq. 3 from the ends of the list; equal ends are a jump, which exponent 0 stands for */
SPHPA_PRIVATE_ sphpa_flaws sphpa_flaws_make_(double eps_min, double eps_max, uint32_t count) {
    sphpa_flaws flaws;
    flaws.eps_min = eps_min;
    flaws.count = count;
    flaws.exponent = 0.0;
    if (count > 1 && eps_max > eps_min)
        flaws.exponent = log((double)count) / log(eps_max / eps_min);
    return flaws;
}

SPHPA_DEF sphpa_result sphpa_flaw_sample(const sphpa_flaw_params *params, size_t n, sphpa_rng *rng,
                                         double stop, sphpa_flaws *out) {
    sphpa_result result = sphpa_flaw_check(params, n, NULL);
    if (result != SPHPA_OK) return result;
    if (rng == NULL || out == NULL) return SPHPA_ERROR_MISSING;
    if (!(stop > 0.0 && stop <= SPHPA_FLAW_STOP_MAX_)) return SPHPA_ERROR_RANGE;
    /* P(first <= t | first <= stop) = (1 - e^-t)/(1 - e^-stop); 1 - U is never 0, so first > 0 */
    double odds = 1.0 - sphpa_rng_uniform(rng);
    double first = sphpa_min_(-log1p(odds * expm1(-stop)), stop);
    double last = first, t = first;
    uint32_t count = 0;
    while (t <= stop) {
        count++;
        last = t;
        t -= log(1.0 - sphpa_rng_uniform(rng));
    }
    *out = sphpa_flaws_make_(sphpa_flaw_threshold_(params, first * (double)n),
                             sphpa_flaw_threshold_(params, last * (double)n), count);
    return SPHPA_OK;
}

SPHPA_DEF sphpa_flaws sphpa_flaws_compress(const double *eps, size_t count) {
    bool good = eps != NULL && count > 0 && (uint64_t)count <= 0xffffffffu && eps[0] > 0.0 &&
                eps[count - 1] >= eps[0] && eps[count - 1] <= DBL_MAX;
    if (!good) return sphpa_flaws_make_(0.0, 0.0, 0);
    return sphpa_flaws_make_(eps[0], eps[count - 1], (uint32_t)count);
}

SPHPA_DEF double sphpa_flaws_active(const sphpa_flaws *flaws, double eps) {
    if (eps != eps) return eps;
    if (flaws->count == 0 || eps < flaws->eps_min) return 0.0;
    double all = (double)flaws->count;
    if (flaws->exponent == 0.0) return all;
    double open = pow(eps / flaws->eps_min, flaws->exponent); /* eq. 3 */
    open = floor(open * (1.0 + 1e-12)); /* a whole number that pow misses by rounding counts */
    return sphpa_clamp_(open, 1.0, all);
}

SPHPA_DEF double sphpa_flaws_active_list(double eps, const double *thresholds, size_t count) {
    if (eps != eps) return eps;
    size_t open = 0, end = count; /* all below `open` are <= eps, all from `end` on are above */
    while (open < end) {
        size_t middle = open + (end - open) / 2;
        if (thresholds[middle] <= eps) open = middle + 1;
        else end = middle;
    }
    return (double)open;
}

/* ---- growth ---------------------------------------------------------------------------------- */

SPHPA_DEF double sphpa_damage_young(double K, double G) {
    if (!(K > 0.0 && G > 0.0)) return (double)NAN;
    return 9.0 * K * (G / (3.0 * K + G));
}

SPHPA_DEF double sphpa_damage_strain(const sphpa_sym3 *S, double P, double alpha, double K,
                                     double G) {
    if (!(alpha >= 1.0)) return (double)NAN;
    double values[3];
    sphpa_sym3_eigen(S, values, NULL);
    /* 0, or NaN if any component is not finite: a NaN off the diagonal stops the eigenvalue search
       without a trace */
    double poison = 0.0 * (S->xx + S->yy + S->zz + S->xy + S->yz + S->xz);
    return alpha * (values[0] - P + poison) / sphpa_damage_young(K, G); /* eq. 4 */
}

SPHPA_DEF double sphpa_damage_strain_bound(const sphpa_sym3 *S, double P, double alpha, double K,
                                           double G) {
    if (!(alpha >= 1.0)) return (double)NAN;
    double mean = (S->xx + S->yy + S->zz) / 3.0;
    double x = S->xx - mean, y = S->yy - mean, z = S->zz - mean;
    double J2 = 0.5 * (x * x + y * y + z * z) + S->xy * S->xy + S->yz * S->yz + S->xz * S->xz;
    /* the largest root of q^3 - J2 q - J3 is 2 sqrt(J2/3) cos(..); the last term covers rounding,
       of these lines and of the eigenvalues, and underflow of J2 */
    double reach = 2.0 * sqrt(J2 / 3.0);
    double slack = 64.0 * DBL_EPSILON * (reach + fabs(mean) + fabs(P)) + 1e-150;
    return alpha * (mean - P + reach + slack) / sphpa_damage_young(K, G);
}

SPHPA_DEF double sphpa_damage_crack_speed(double K, double G, double rho_s) {
    if (!(K > 0.0 && G >= 0.0 && rho_s > 0.0)) return (double)NAN;
    return 0.4 * sqrt((K + 4.0 / 3.0 * G) / rho_s); /* eq. 5 */
}

SPHPA_DEF double sphpa_damage_cap(double n_act, double n_tot) {
    if (n_act != n_act || n_tot != n_tot) return n_act + n_tot;
    if (n_act <= 0.0 || n_tot <= 0.0) return 0.0;
    return n_act >= n_tot ? 1.0 : cbrt(n_act / n_tot); /* eq. 7 */
}

SPHPA_DEF double sphpa_damage_rate(double n_act, double n_tot, double c_g, double R_s,
                                   sphpa_damage_rule rule) {
    if (!(c_g >= 0.0 && R_s > 0.0)) return (double)NAN;
    if (n_act != n_act || n_tot != n_tot) return n_act + n_tot;
    if (n_act <= 0.0 || n_tot <= 0.0) return 0.0;
    double q = (double)NAN;
    switch (rule) {
    case SPHPA_DAMAGE_CBRT: q = cbrt(n_act); break;
    case SPHPA_DAMAGE_LINEAR: q = n_act; break;
    case SPHPA_DAMAGE_FRACTION: q = n_act / n_tot; break;
    }
    return q * c_g / R_s; /* eq. 6 */
}

SPHPA_DEF double sphpa_damage_advance(double D13_start, double n_act, double n_tot, double c_g,
                                      double R_s, double dt, sphpa_damage_rule rule) {
    double rate = sphpa_damage_rate(n_act, n_tot, c_g, R_s, rule);
    double grown = D13_start + rate * dt;
    if (grown != grown || !(dt >= 0.0)) return (double)NAN;
    /* eq. 7; a D13 above the cap (a merged particle's, say) stays where it is */
    return sphpa_max_(D13_start, sphpa_min_(sphpa_damage_cap(n_act, n_tot), grown));
}

SPHPA_DEF double sphpa_damage_dt(double D13, double n_act, double n_tot, double c_g, double R_s,
                                 sphpa_damage_rule rule, double max_growth) {
    double growth = max_growth == 0.0 ? SPHPA_DAMAGE_STEP : max_growth;
    double rate = sphpa_damage_rate(n_act, n_tot, c_g, R_s, rule);
    double room = sphpa_damage_cap(n_act, n_tot) - D13;
    if (room != room || rate != rate || !(growth > 0.0)) return (double)NAN;
    return room <= growth || rate == 0.0 ? (double)INFINITY : growth / rate;
}

/* ---- compaction and total -------------------------------------------------------------------- */

/* (X + d)^(1/3) - d^(1/3), as a quotient so that nothing cancels where X is small */
SPHPA_PRIVATE_ double sphpa_damage_compaction_rise_(double X, double d) {
    double a = cbrt(X + d), b = cbrt(d);
    return X / (a * a + a * b + b * b);
}

SPHPA_DEF double sphpa_damage_compaction(double alpha, double alpha0) {
    const double d = 0.01; /* Jutzi, Benz & Michel 2008: keeps the slope at alpha0 finite */
    if (alpha != alpha || alpha0 != alpha0) return alpha + alpha0;
    if (alpha0 <= 1.0 || alpha >= alpha0) return 0.0;
    double X = alpha <= 1.0 ? 1.0 : (alpha0 - alpha) / (alpha0 - 1.0);
    double root = sphpa_damage_compaction_rise_(X, d) / sphpa_damage_compaction_rise_(1.0, d);
    return root * root * root; /* eq. 8 */
}

SPHPA_DEF double sphpa_damage_total(double D13, double D_por) {
    return sphpa_min_(1.0, D13 * D13 * D13 + D_por); /* eq. 9; min_ hands on a NaN */
}

SPHPA_EXTERN_C_END_
#endif /* >>damage */

#if SPHPA_WANT_RIEMANN_ && !defined(SPHPA_RIEMANN_DONE_)
#define SPHPA_RIEMANN_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>riemann   implementation
   ============================================================================================== */

/* one side, with what every formula needs of it */
typedef struct sphpa_riemann_side_ {
    double rho, v, P, c;
    double A, B; /* eq. (2) */
} sphpa_riemann_side_;

SPHPA_PRIVATE_ sphpa_result sphpa_riemann_check_(double gamma, const sphpa_riemann_state *state) {
    if (!sphpa_finite_(gamma) || !sphpa_finite_(state->rho) || !sphpa_finite_(state->v) ||
        !sphpa_finite_(state->P))
        return SPHPA_ERROR_NOT_FINITE;
    if (gamma <= 1.0) return SPHPA_ERROR_RANGE;
    if (state->rho < 0.0 || state->P < 0.0) return SPHPA_ERROR_NEGATIVE;
    if (state->rho == 0.0 && state->P > 0.0) return SPHPA_ERROR_NEGATIVE;
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_riemann_side_ sphpa_riemann_side_of_(double gamma,
                                                          const sphpa_riemann_state *state) {
    sphpa_riemann_side_ side;
    side.rho = state->rho;
    side.v = state->v;
    side.P = state->P;
    side.c = state->rho > 0.0 ? sqrt(gamma * (state->P / state->rho)) : 0.0;
    side.A = state->rho > 0.0 ? 2.0 / ((gamma + 1.0) * state->rho) : 0.0;
    side.B = state->P * ((gamma - 1.0) / (gamma + 1.0));
    return side;
}

/* eqs. (2) and (3): the velocity that the wave to pressure P adds, and its slope (may be NULL);
   expm1 and log1p keep the digits of a weak wave */
SPHPA_PRIVATE_ double sphpa_riemann_jump_(double gamma, const sphpa_riemann_side_ *side, double P,
                                          double *slope) {
    if (P > side->P) {
        double root = sqrt(side->A / (P + side->B)), step = P - side->P;
        if (slope != NULL) *slope = root * (1.0 - 0.5 * step / (P + side->B));
        return step * root;
    }
    if (slope != NULL) *slope = 0.0;
    if (side->P == 0.0) return 0.0;
    double ratio = P / side->P, z = 0.5 * (gamma - 1.0) / gamma;
    double power = z * (ratio < 0.5 ? log(ratio) : log1p((P - side->P) / side->P));
    if (slope != NULL) *slope = side->c / (gamma * P) * exp(power);
    return 2.0 * side->c / (gamma - 1.0) * expm1(power);
}

/* eq. (5), the zero of F if both waves were rarefactions. That is exact where they are; elsewhere
   it lies above the zero, since a shock's f rises more steeply. */
SPHPA_PRIVATE_ double sphpa_riemann_two_fans_(double gamma, const sphpa_riemann_side_ *l,
                                              const sphpa_riemann_side_ *r) {
    const sphpa_riemann_side_ *high = l->P >= r->P ? l : r, *low = l->P >= r->P ? r : l;
    double z = 0.5 * (gamma - 1.0) / gamma;
    double push = (l->c + r->c) - 0.5 * (gamma - 1.0) * (r->v - l->v);
    double weight = high->c;
    if (low->P > 0.0) weight += low->c * pow(high->P / low->P, z); /* tends to 0 with P */
    return push > 0.0 ? high->P * pow(push / weight, 1.0 / z) : 0.0;
}

/* Newton on F within [low, high], F(low) <= 0 <= F(high), high = DBL_MAX if not known. From the
   left of the zero of a concave F it climbs without overshooting; a step from the right that
   leaves the bracket becomes the geometric mean of its ends. */
SPHPA_PRIVATE_ sphpa_result sphpa_riemann_root_(double gamma, const sphpa_riemann_side_ *l,
                                                const sphpa_riemann_side_ *r, double low,
                                                double high, double start, double *root,
                                                int *iterations) {
    double P = start, dv = r->v - l->v;
    for (int n = 1; n <= 400; n++) {
        double slope_l, slope_r;
        double f_l = sphpa_riemann_jump_(gamma, l, P, &slope_l);
        double f_r = sphpa_riemann_jump_(gamma, r, P, &slope_r);
        double F = (f_l + f_r) + dv;
        double noise = 4.0 * DBL_EPSILON * (fabs(f_l) + fabs(f_r) + fabs(dv));
        double next = P - F / (slope_l + slope_r);
        if (F <= 0.0) low = P;
        if (F >= 0.0) high = P;
        bool inside = next >= low && next <= high; /* false for NaN */
        bool settled = inside && fabs(next - P) <= 2.0 * DBL_EPSILON * P;
        if (settled || (inside && fabs(F) <= noise) || high - low <= 2.0 * DBL_EPSILON * low) {
            *root = inside ? next : P;
            *iterations = n;
            return SPHPA_OK;
        }
        if (!inside) next = low > 0.0 ? sqrt(low) * sqrt(high) : 0.0625 * high;
        P = next;
    }
    return SPHPA_ERROR_NOT_CONVERGED;
}

/* the pressure between the waves; not for vacuum */
SPHPA_PRIVATE_ sphpa_result sphpa_riemann_pressure_(double gamma, const sphpa_riemann_side_ *l,
                                                    const sphpa_riemann_side_ *r, double *P,
                                                    int *iterations) {
    double least = sphpa_min_(l->P, r->P), most = sphpa_max_(l->P, r->P), dv = r->v - l->v;
    double F_least = (sphpa_riemann_jump_(gamma, l, least, NULL) +
                      sphpa_riemann_jump_(gamma, r, least, NULL)) + dv;
    double F_most = (sphpa_riemann_jump_(gamma, l, most, NULL) +
                     sphpa_riemann_jump_(gamma, r, most, NULL)) + dv;
    *iterations = 0;
    if (F_least == 0.0 || F_most == 0.0) { /* identical states, or one wave that is missing */
        *P = F_least == 0.0 ? least : most;
        return SPHPA_OK;
    }
    double fans = sphpa_riemann_two_fans_(gamma, l, r);
    if (F_least > 0.0) {
        *P = sphpa_min_(fans, least);
        if (*P < 0.5 * most) return SPHPA_OK;
        /* weak waves: the power 1/z blurs (5) by 1/z ulp, F does not; one Newton step mends it */
        double slope_l, slope_r, f_l = sphpa_riemann_jump_(gamma, l, *P, &slope_l);
        double F = (f_l + sphpa_riemann_jump_(gamma, r, *P, &slope_r)) + dv;
        *P = sphpa_min_(*P - F / (slope_l + slope_r), least);
        return SPHPA_OK;
    }
    if (F_most > 0.0)
        return sphpa_riemann_root_(gamma, l, r, least, most, sphpa_clamp_(fans, least, most), P,
                                   iterations);
    /* two shocks: f(P, K) <= sqrt(A_K P) bounds the zero from below */
    double bound = dv / (sqrt(l->A) + sqrt(r->A));
    double start = sphpa_max_(most, bound * bound);
    return sphpa_riemann_root_(gamma, l, r, start, DBL_MAX, start, P, iterations);
}

/* Eqs. (6), (7) of the left wave. The right one is the same in a mirror: velocities change sign,
   which is what makes mirrored problems give mirrored bits. */
SPHPA_PRIVATE_ void sphpa_riemann_wave_(double gamma, const sphpa_riemann_side_ *side, double P,
                                        double v, double *rho, double *head, double *tail) {
    double h = (gamma - 1.0) / (gamma + 1.0);
    if (P > side->P) {
        *rho = side->rho * ((P + h * side->P) / (h * P + side->P));
        *head = *tail = side->v - sqrt((P + side->B) / side->A) / side->rho;
        return;
    }
    double power = side->P > 0.0 ? pow(P / side->P, 0.5 * (gamma - 1.0) / gamma) : 1.0;
    *rho = side->P > 0.0 ? side->rho * pow(P / side->P, 1.0 / gamma) : side->rho;
    *head = side->v - side->c;
    *tail = sphpa_max_(*head, v - side->c * power);
}

/* eq. (8); a side that is vacuum has no wave: its two speeds are those of the other's edge */
SPHPA_PRIVATE_ void sphpa_riemann_vacuum_(double gamma, const sphpa_riemann_side_ *l,
                                          const sphpa_riemann_side_ *r, sphpa_riemann_star *star) {
    double reach = 2.0 / (gamma - 1.0);
    star->head_l = l->v - l->c;
    star->tail_l = l->v + reach * l->c;
    star->tail_r = r->v - reach * r->c;
    star->head_r = r->v + r->c;
    if (l->rho == 0.0 && r->rho == 0.0) star->tail_l = star->head_r = star->tail_r = star->head_l;
    else if (l->rho == 0.0) star->head_l = star->tail_l = star->tail_r;
    else if (r->rho == 0.0) star->tail_r = star->head_r = star->tail_l;
    star->v = 0.5 * (star->tail_l + star->tail_r);
    star->vacuum = 1;
}

SPHPA_DEF sphpa_result sphpa_riemann_exact(double gamma, const sphpa_riemann_state *left,
                                           const sphpa_riemann_state *right,
                                           sphpa_riemann_star *star) {
    if (left == NULL || right == NULL || star == NULL) return SPHPA_ERROR_MISSING;
    sphpa_result result = sphpa_riemann_check_(gamma, left);
    if (result == SPHPA_OK) result = sphpa_riemann_check_(gamma, right);
    if (result != SPHPA_OK) return result;
    sphpa_riemann_side_ l = sphpa_riemann_side_of_(gamma, left);
    sphpa_riemann_side_ r = sphpa_riemann_side_of_(gamma, right);
    sphpa_riemann_star found;
    memset(&found, 0, sizeof found);
    if (left->rho == 0.0 || right->rho == 0.0 || r.v - l.v >= 2.0 / (gamma - 1.0) * (l.c + r.c)) {
        sphpa_riemann_vacuum_(gamma, &l, &r, &found);
    } else {
        result = sphpa_riemann_pressure_(gamma, &l, &r, &found.P, &found.iterations);
        if (result != SPHPA_OK) return result;
        double f_l = sphpa_riemann_jump_(gamma, &l, found.P, NULL);
        double f_r = sphpa_riemann_jump_(gamma, &r, found.P, NULL);
        found.v = 0.5 * (l.v + r.v) + 0.5 * (f_r - f_l); /* eq. (4) */
        sphpa_riemann_wave_(gamma, &l, found.P, found.v, &found.rho_l, &found.head_l,
                            &found.tail_l);
        r.v = -r.v;
        sphpa_riemann_wave_(gamma, &r, found.P, -found.v, &found.rho_r, &found.head_r,
                            &found.tail_r);
        found.head_r = -found.head_r;
        found.tail_r = -found.tail_r;
    }
    if (!sphpa_finite_(found.P + found.v + found.rho_l + found.rho_r) ||
        !sphpa_finite_(found.head_l + found.tail_l + found.tail_r + found.head_r))
        return SPHPA_ERROR_RANGE;
    *star = found;
    return SPHPA_OK;
}

/* The left half of the solution, ray s between -infinity and the contact (or within vacuum). */
SPHPA_PRIVATE_ sphpa_riemann_state sphpa_riemann_sample_left_(double gamma,
                                                              const sphpa_riemann_state *left,
                                                              double P, double v, double rho,
                                                              double head, double tail, double s) {
    sphpa_riemann_state out;
    out.rho = rho;
    out.v = v;
    out.P = P;
    if (s < head) return *left;
    if (P > left->P || s >= tail) return out;
    sphpa_riemann_side_ side = sphpa_riemann_side_of_(gamma, left); /* inside the fan */
    double share = 2.0 / (gamma + 1.0);
    double c = share * (side.c + 0.5 * (gamma - 1.0) * (side.v - s)); /* Toro 4.56 */
    double power = pow(sphpa_max_(c, 0.0) / side.c, 2.0 / (gamma - 1.0));
    out.rho = side.rho * power;
    out.v = share * (side.c + 0.5 * (gamma - 1.0) * side.v + s);
    out.P = side.P * pow(sphpa_max_(c, 0.0) / side.c, 2.0 * gamma / (gamma - 1.0));
    return out;
}

SPHPA_DEF sphpa_result sphpa_riemann_sample(double gamma, const sphpa_riemann_state *left,
                                            const sphpa_riemann_state *right,
                                            const sphpa_riemann_star *star, double x_over_t,
                                            sphpa_riemann_state *out) {
    if (left == NULL || right == NULL || star == NULL || out == NULL) return SPHPA_ERROR_MISSING;
    sphpa_result result = sphpa_riemann_check_(gamma, left);
    if (result == SPHPA_OK) result = sphpa_riemann_check_(gamma, right);
    if (result != SPHPA_OK) return result;
    if (!sphpa_finite_(x_over_t)) return SPHPA_ERROR_NOT_FINITE;
    sphpa_riemann_state found, mirror = *right;
    bool nothing = star->vacuum != 0 && ((x_over_t >= star->tail_l && x_over_t <= star->tail_r) ||
                                         (left->rho == 0.0 && x_over_t <= star->tail_r) ||
                                         (right->rho == 0.0 && x_over_t >= star->tail_l));
    if (nothing) {
        found.rho = 0.0;
        found.v = x_over_t;
        found.P = 0.0;
    } else if (x_over_t < star->v) {
        found = sphpa_riemann_sample_left_(gamma, left, star->P, star->v, star->rho_l,
                                           star->head_l, star->tail_l, x_over_t);
    } else {
        mirror.v = -right->v;
        found = sphpa_riemann_sample_left_(gamma, &mirror, star->P, -star->v, star->rho_r,
                                           -star->head_r, -star->tail_r, -x_over_t);
        found.v = -found.v;
    }
    *out = found;
    return SPHPA_OK;
}

SPHPA_EXTERN_C_END_
#endif /* >>riemann */

#if SPHPA_WANT_TREE_ && !defined(SPHPA_TREE_DONE_)
#define SPHPA_TREE_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>tree   implementation
   ============================================================================================== */
#define SPHPA_TREE_LEAF_ 32     /* default leaf_size: measured best for the lists in 3-D */
#define SPHPA_TREE_ROUNDS_ 3    /* 3 sets of 21 bits an axis resolve more than a double holds */
#define SPHPA_TREE_STACK_ 512   /* 7 siblings wait at each of 21 levels of 3 rounds: 441 + 8 */
#define SPHPA_TREE_LANES_ 16    /* candidates tested at once; a fixed count vectorises at -O2 */
#define SPHPA_TREE_SERIAL_ 16384 /* up to so many particles, starting threads costs more */
#define SPHPA_TREE_BIG_ 1e150   /* [m] lengths up to this and down to its inverse square safely */
#define SPHPA_TREE_ROUND_ 1e-14 /* boxes are pruned with this much room for fused multiply-adds */

/* ---- nearest images -------------------------------------------------------------------------- */

/* L and L/2 of each axis; an open one has L = 0 and a half that no dx exceeds */
typedef struct sphpa_tree_period_ {
    double length[3], half[3];
} sphpa_tree_period_;

SPHPA_PRIVATE_ sphpa_tree_period_ sphpa_tree_period_of_(const sphpa_box *box) {
    sphpa_tree_period_ period;
    for (int a = 0; a < 3; a++) {
        bool wraps = box->periodic[a] != 0;
        period.length[a] = wraps ? box->high[a] - box->low[a] : 0.0;
        period.half[a] = wraps ? 0.5 * period.length[a] : DBL_MAX;
    }
    return period;
}

/* equation (2); two selects and no branch, so that it vectorises, and odd in dx to the last bit */
SPHPA_FORCE_INLINE_ double sphpa_tree_image_(double dx, double length, double half) {
    return dx - ((dx > half ? length : 0.0) - (dx < -half ? length : 0.0));
}

SPHPA_FORCE_INLINE_ double sphpa_tree_dx_(const sphpa_box *box, int axis, double dx) {
    if (box->periodic[axis] == 0) return dx;
    double length = box->high[axis] - box->low[axis];
    return sphpa_tree_image_(dx, length, 0.5 * length);
}

/* least |dx| of all dx in [low, high] */
SPHPA_FORCE_INLINE_ double sphpa_tree_gap_(double low, double high) {
    double gap = low > -high ? low : -high;
    return gap > 0.0 ? gap : 0.0;
}

/* the same over the images. Rounding is monotone, so no pair is nearer than its gap says. */
SPHPA_FORCE_INLINE_ double sphpa_tree_gap_image_(double low, double high, double length) {
    double here = sphpa_tree_gap_(low, high);
    double left = sphpa_tree_gap_(low - length, high - length);
    double right = sphpa_tree_gap_(low + length, high + length);
    return sphpa_min_(here, sphpa_min_(left, right));
}

SPHPA_FORCE_INLINE_ double sphpa_tree_r2_(const double *p, const double *q,
                                          const sphpa_tree_period_ *period) {
    double dx = sphpa_tree_image_(p[0] - q[0], period->length[0], period->half[0]);
    double dy = sphpa_tree_image_(p[1] - q[1], period->length[1], period->half[1]);
    double dz = sphpa_tree_image_(p[2] - q[2], period->length[2], period->half[2]);
    return dx * dx + dy * dy + dz * dz;
}

/* ---- keys and sorting ------------------------------------------------------------------------ */

/* The Hilbert curve's turns: of a cell's 2^dim parts, by their axes' bits (x first), the place along
   the curve in the lowest dim bits, and above them how the curve is turned inside. */
SPHPA_PRIVATE_ uint64_t sphpa_tree_hilbert2_(const uint64_t cell[3]) {
    static const uint8_t turn[4][4] = {
        {4, 1, 11, 2}, {0, 15, 5, 6}, {10, 9, 3, 12}, {14, 7, 13, 8},
    };
    uint64_t key = 0;
    unsigned state = 0;
    for (int bit = 30; bit >= 0; bit--) {
        unsigned next = turn[state][((cell[0] >> bit) & 1u) << 1 | ((cell[1] >> bit) & 1u)];
        key = key << 2 | (next & 3u);
        state = next >> 2;
    }
    return key;
}

SPHPA_PRIVATE_ uint64_t sphpa_tree_hilbert3_(const uint64_t cell[3]) {
    static const uint8_t turn[24][8] = {
        {8, 17, 27, 2, 39, 46, 52, 5}, {56, 71, 73, 86, 91, 20, 10, 13},
        {48, 1, 103, 110, 115, 18, 12, 21}, {126, 129, 29, 26, 79, 80, 140, 3},
        {148, 43, 37, 34, 127, 128, 78, 81}, {156, 45, 35, 42, 31, 6, 160, 105},
        {72, 87, 139, 4, 57, 70, 50, 53}, {0, 171, 111, 76, 49, 58, 102, 61},
        {180, 143, 83, 184, 69, 54, 66, 97}, {16, 123, 9, 74, 47, 60, 38, 77},
        {132, 95, 85, 14, 67, 144, 82, 33}, {142, 55, 185, 96, 93, 116, 90, 11},
        {188, 107, 175, 176, 101, 98, 62, 65}, {164, 109, 119, 22, 99, 106, 152, 41},
        {174, 177, 63, 64, 117, 114, 92, 19}, {30, 125, 161, 122, 7, 172, 104, 75},
        {130, 25, 133, 166, 179, 136, 84, 191}, {94, 15, 141, 28, 145, 32, 138, 51},
        {146, 155, 149, 36, 137, 24, 190, 167}, {154, 157, 147, 44, 169, 182, 120, 135},
        {162, 165, 121, 134, 187, 108, 168, 183}, {118, 173, 23, 124, 153, 170, 40, 59},
        {178, 113, 131, 88, 181, 158, 68, 151}, {186, 163, 89, 112, 189, 100, 150, 159},
    };
    uint64_t key = 0;
    unsigned state = 0;
    for (int bit = 20; bit >= 0; bit--) {
        unsigned next = turn[state][((cell[0] >> bit) & 1u) << 2 | ((cell[1] >> bit) & 1u) << 1 |
                                    ((cell[2] >> bit) & 1u)];
        key = key << 3 | (next & 7u);
        state = next >> 3;
    }
    return key;
}

/* cubic cells: one scale for all axes */
typedef struct sphpa_tree_frame_ {
    double low[3], scale;
    uint64_t last; /* the last cell of an axis */
    int dim;
} sphpa_tree_frame_;

/* a box so small that 1/extent overflows is one cell, like a point: all keys are equal */
SPHPA_PRIVATE_ void sphpa_tree_frame_make_(sphpa_tree_frame_ *frame, int dim, const double low[3],
                                           const double high[3]) {
    double extent = 0.0;
    for (int a = 0; a < dim; a++) extent = sphpa_max_(extent, high[a] - low[a]);
    uint64_t cells = (uint64_t)1 << (dim == 3 ? 21 : dim == 2 ? 31 : 62);
    for (int a = 0; a < 3; a++) frame->low[a] = low[a];
    frame->last = cells - 1;
    frame->dim = dim;
    frame->scale = extent > 1e-280 ? (double)cells / extent : 0.0;
}

SPHPA_PRIVATE_ uint64_t sphpa_tree_key_(const sphpa_tree_frame_ *frame, const double *x) {
    uint64_t cell[3] = {0, 0, 0};
    for (int a = 0; a < frame->dim; a++) {
        cell[a] = (uint64_t)((x[a] - frame->low[a]) * frame->scale);
        if (cell[a] > frame->last) cell[a] = frame->last; /* x at the upper face */
    }
    if (frame->dim == 1) return cell[0];
    return frame->dim == 2 ? sphpa_tree_hilbert2_(cell) : sphpa_tree_hilbert3_(cell);
}

/* keys with what travels along, and room for as much again */
typedef struct sphpa_tree_sort_ {
    uint64_t *key, *key_spare;
    uint32_t *index, *index_spare;
} sphpa_tree_sort_;

SPHPA_PRIVATE_ void sphpa_tree_insertion_sort_(uint64_t *key, uint32_t *index, size_t n) {
    for (size_t k = 1; k < n; k++) {
        uint64_t moved = key[k];
        uint32_t its = index[k];
        size_t to = k;
        for (; to > 0 && key[to - 1] > moved; to--) {
            key[to] = key[to - 1];
            index[to] = index[to - 1];
        }
        key[to] = moved;
        index[to] = its;
    }
}

enum { SPHPA_TREE_BINS_ = 2048, SPHPA_TREE_PARTS_ = 8 };

/* how often each value of a digit comes in [first, end) */
SPHPA_PRIVATE_ void sphpa_tree_tally_(const uint64_t *key, size_t first, size_t end, int shift,
                                      uint32_t bins[SPHPA_TREE_BINS_]) {
    memset(bins, 0, SPHPA_TREE_BINS_ * sizeof *bins);
    for (size_t k = first; k < end; k++) bins[(key[k] >> shift) & (SPHPA_TREE_BINS_ - 1)]++;
}

/* counts become places: by value, then by part. false: all keys have one value */
SPHPA_PRIVATE_ bool sphpa_tree_places_(uint32_t (*bins)[SPHPA_TREE_BINS_], size_t n) {
    uint32_t sum = 0;
    for (int b = 0; b < SPHPA_TREE_BINS_; b++) {
        uint32_t before = sum;
        for (int part = 0; part < SPHPA_TREE_PARTS_; part++) {
            uint32_t count = bins[part][b];
            bins[part][b] = sum;
            sum += count;
        }
        if (sum - before == n) return false;
    }
    return true;
}

/* stable: six passes of 11 bits; a digit that all keys share is skipped. Parts of the keys are
   tallied and moved side by side, the sorted order is the same. Sorted into key, index. */
SPHPA_PRIVATE_ void sphpa_tree_radix_sort_(const sphpa_tree_sort_ *sort, size_t n) {
    uint32_t bins[SPHPA_TREE_PARTS_][SPHPA_TREE_BINS_];
    uint64_t *from = sort->key, *to = sort->key_spare;
    uint32_t *from_index = sort->index, *to_index = sort->index_spare;
    for (int shift = 0; shift < 66; shift += 11) {
        SPHPA_OMP(parallel for schedule(static) if (n > SPHPA_TREE_SERIAL_))
        for (int part = 0; part < SPHPA_TREE_PARTS_; part++)
            sphpa_tree_tally_(from, n * (size_t)part / SPHPA_TREE_PARTS_,
                              n * (size_t)(part + 1) / SPHPA_TREE_PARTS_, shift, bins[part]);
        if (!sphpa_tree_places_(bins, n)) continue;
        SPHPA_OMP(parallel for schedule(static) if (n > SPHPA_TREE_SERIAL_))
        for (int part = 0; part < SPHPA_TREE_PARTS_; part++) {
            size_t end = n * (size_t)(part + 1) / SPHPA_TREE_PARTS_;
            for (size_t k = n * (size_t)part / SPHPA_TREE_PARTS_; k < end; k++) {
                uint32_t at = bins[part][(from[k] >> shift) & (SPHPA_TREE_BINS_ - 1)]++;
                to[at] = from[k];
                to_index[at] = from_index[k];
            }
        }
        uint64_t *other = from;
        uint32_t *other_index = from_index;
        from = to, to = other;
        from_index = to_index, to_index = other_index;
    }
    if (from == sort->key) return;
    memcpy(sort->key, from, n * sizeof *from);
    memcpy(sort->index, from_index, n * sizeof *from_index);
}

SPHPA_PRIVATE_ void sphpa_tree_sort_keys_(const sphpa_tree_sort_ *sort, size_t n) {
    if (n <= 64)
        sphpa_tree_insertion_sort_(sort->key, sort->index, n);
    else
        sphpa_tree_radix_sort_(sort, n);
}

/* ---- building -------------------------------------------------------------------------------- */

SPHPA_PRIVATE_ bool sphpa_tree_grow_u32_(uint32_t **block, size_t *capacity, size_t need) {
    void *grown = *block;
    bool done = sphpa_grow_(&grown, capacity, need, sizeof(uint32_t));
    *block = (uint32_t *)grown;
    return done;
}

SPHPA_PRIVATE_ bool sphpa_tree_grow_nodes_(sphpa_tree *tree, size_t need) {
    void *grown = tree->nodes;
    bool done = sphpa_grow_(&grown, &tree->node_capacity, need, sizeof(sphpa_tree_node));
    tree->nodes = (sphpa_tree_node *)grown;
    return done;
}

/* room for n particles; nodes grow as they come */
SPHPA_PRIVATE_ bool sphpa_tree_reserve_(sphpa_tree *tree, size_t n) {
    void *pos = tree->pos, *scratch = tree->scratch;
    bool done = sphpa_grow_(&pos, &tree->pos_capacity, n, 4 * sizeof(double));
    done = done && sphpa_grow_(&scratch, &tree->scratch_capacity, n, 3 * sizeof(uint64_t));
    tree->pos = (double *)pos;
    tree->scratch = (uint64_t *)scratch;
    return done && sphpa_tree_grow_u32_(&tree->order, &tree->order_capacity, n) &&
           sphpa_tree_grow_u32_(&tree->rank, &tree->rank_capacity, n);
}

SPHPA_PRIVATE_ sphpa_result sphpa_tree_check_box_(int dim, const sphpa_box *box, sphpa_error *err) {
    for (int a = 0; a < dim && box != NULL; a++) {
        if (box->periodic[a] == 0) continue;
        if (!sphpa_finite_(box->low[a]) || !sphpa_finite_(box->high[a]))
            return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                                   "sphpa_tree_build: the periodic box spans %g to %g m on axis "
                                   "%d; give finite corners",
                                   box->low[a], box->high[a], a);
        if (!(box->high[a] > box->low[a]))
            return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                   "sphpa_tree_build: the periodic box spans %g to %g m on axis "
                                   "%d; need low < high",
                                   box->low[a], box->high[a], a);
    }
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_tree_check_arguments_(const sphpa_tree *tree, int dim, size_t n,
                                                        const double *x, const double *support,
                                                        const sphpa_box *box, sphpa_error *err) {
    if (tree == NULL) return sphpa_error_set(err, SPHPA_ERROR_MISSING, "sphpa_tree_build: no tree");
    if (dim < 1 || dim > 3)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "sphpa_tree_build: dim is %d; need 1, 2 or 3", dim);
    if (tree->leaf_size < 0 || tree->leaf_size > 4096)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "sphpa_tree_build: leaf_size is %d; need 1 to 4096, or 0 for %d",
                               tree->leaf_size, SPHPA_TREE_LEAF_);
    if (n == 0)
        return sphpa_error_set(err, SPHPA_ERROR_EMPTY,
                               "sphpa_tree_build: n is 0; add at least one particle");
    if ((uint64_t)n > (uint64_t)UINT32_MAX - 1u)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "sphpa_tree_build: %zu particles; at most 2^32 - 2 can be indexed",
                               n);
    if (x == NULL || support == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING, "sphpa_tree_build: %s is NULL",
                               x == NULL ? "x" : "support");
    return sphpa_tree_check_box_(dim, box, err);
}

/* one coordinate of one particle */
SPHPA_PRIVATE_ sphpa_result sphpa_tree_check_axis_(int a, size_t i, double x, double support,
                                                   const sphpa_box *box, sphpa_error *err) {
    if (!sphpa_finite_(x))
        return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                               "sphpa_tree_build: x[%zu][%d] is %g; check where it comes from", i,
                               a, x);
    if (fabs(x) > SPHPA_TREE_BIG_)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "sphpa_tree_build: x[%zu][%d] is %g m; squares overflow above %g m",
                               i, a, x, SPHPA_TREE_BIG_);
    if (box == NULL || box->periodic[a] == 0) return SPHPA_OK;
    double low = box->low[a], high = box->high[a];
    if (x < low || x > high)
        return sphpa_error_set(err, SPHPA_ERROR_OUTSIDE,
                               "sphpa_tree_build: x[%zu][%d] is %.17g m, outside the periodic box "
                               "%.17g to %.17g m; wrap it into the box or make the box larger",
                               i, a, x, low, high);
    if (support > 0.5 * (high - low))
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "sphpa_tree_build: support[%zu] is %g m, more than half of the "
                               "periodic box (%g m on axis %d); use a smaller smoothing length, "
                               "more particles or a larger box",
                               i, support, high - low, a);
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_tree_check_particle_(int dim, size_t i, const double *x,
                                                       double support, const sphpa_box *box,
                                                       sphpa_error *err) {
    if (!sphpa_finite_(support))
        return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                               "sphpa_tree_build: support[%zu] is %g; check where it comes from", i,
                               support);
    if (!(support > 0.0))
        return sphpa_error_set(err, SPHPA_ERROR_NEGATIVE,
                               "sphpa_tree_build: support[%zu] is %g m; need support > 0", i,
                               support);
    if (support < 1.0 / SPHPA_TREE_BIG_ || support > SPHPA_TREE_BIG_)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "sphpa_tree_build: support[%zu] is %g m; squares need %g to %g m", i,
                               support, 1.0 / SPHPA_TREE_BIG_, SPHPA_TREE_BIG_);
    for (int a = 0; a < dim; a++) {
        sphpa_result result = sphpa_tree_check_axis_(a, i, x[a], support, box, err);
        if (result != SPHPA_OK) return result;
    }
    return SPHPA_OK;
}

/* the first that is wrong with one of them, of the first of them */
SPHPA_PRIVATE_ sphpa_result sphpa_tree_check_particles_(int dim, size_t n, const double *x,
                                                        const double *support, const sphpa_box *box,
                                                        sphpa_error *err) {
    int wrong = 0;
    SPHPA_OMP(parallel for schedule(static) reduction(| : wrong) if (n > SPHPA_TREE_SERIAL_))
    for (size_t i = 0; i < n; i++) {
        sphpa_result result =
            sphpa_tree_check_particle_(dim, i, x + 3 * i, support[i], box, NULL);
        wrong |= result != SPHPA_OK ? 1 : 0;
    }
    sphpa_result result = SPHPA_OK;
    for (size_t i = 0; i < n && wrong && result == SPHPA_OK; i++)
        result = sphpa_tree_check_particle_(dim, i, x + 3 * i, support[i], box, err);
    return result;
}

/* the bounding box of the particles, but the periodic box on the axes that wrap */
SPHPA_PRIVATE_ sphpa_box sphpa_tree_bounds_(int dim, size_t n, const double *x,
                                            const sphpa_box *periodic) {
    sphpa_box box;
    memset(&box, 0, sizeof box);
    for (int a = 0; a < dim; a++) box.low[a] = box.high[a] = x[a];
    for (int a = 0; a < dim; a++) {
        double low = box.low[a], high = box.high[a];
        SPHPA_OMP(parallel for schedule(static) reduction(min : low) reduction(max : high)
                      if (n > SPHPA_TREE_SERIAL_))
        for (size_t i = 1; i < n; i++) {
            low = sphpa_min_(low, x[3 * i + (size_t)a]);
            high = sphpa_max_(high, x[3 * i + (size_t)a]);
        }
        box.low[a] = low;
        box.high[a] = high;
    }
    for (int a = 0; a < dim && periodic != NULL; a++) {
        if (periodic->periodic[a] == 0) continue;
        box.low[a] = periodic->low[a];
        box.high[a] = periodic->high[a];
        box.periodic[a] = 1;
    }
    return box;
}

SPHPA_PRIVATE_ sphpa_tree_sort_ sphpa_tree_sort_of_(const sphpa_tree *tree, size_t n) {
    sphpa_tree_sort_ sort;
    sort.key = tree->scratch;
    sort.key_spare = tree->scratch + n;
    sort.index = (uint32_t *)(void *)(tree->scratch + 2 * n);
    sort.index_spare = sort.index + n;
    return sort;
}

/* sorts the caller's particles into pos, order and rank; sort.key keeps the sorted keys */
SPHPA_PRIVATE_ void sphpa_tree_place_(sphpa_tree *tree, const sphpa_tree_sort_ *sort,
                                      const double *x, const double *support) {
    sphpa_tree_frame_ frame;
    size_t n = tree->n, dim = (size_t)tree->dim;
    sphpa_tree_frame_make_(&frame, tree->dim, tree->box.low, tree->box.high);
    SPHPA_OMP(parallel for schedule(static) if (n > SPHPA_TREE_SERIAL_))
    for (size_t i = 0; i < n; i++) {
        sort->key[i] = sphpa_tree_key_(&frame, x + 3 * i);
        sort->index[i] = (uint32_t)i;
    }
    sphpa_tree_sort_keys_(sort, n);
    SPHPA_OMP(parallel for schedule(static) if (n > SPHPA_TREE_SERIAL_))
    for (size_t k = 0; k < n; k++) {
        size_t i = sort->index[k];
        for (size_t a = 0; a < 3; a++) tree->pos[4 * k + a] = a < dim ? x[3 * i + a] : 0.0;
        tree->pos[4 * k + 3] = support[i];
        tree->order[k] = (uint32_t)i;
    }
}

/* the tight box and the largest support of a range of sorted particles */
SPHPA_PRIVATE_ void sphpa_tree_tighten_(const sphpa_tree *tree, sphpa_tree_node *node) {
    const double *p = tree->pos + 4 * (size_t)node->first;
    for (int a = 0; a < 3; a++) node->low[a] = node->high[a] = p[a];
    node->support = p[3];
    for (uint32_t k = 1; k < node->count; k++) {
        p += 4;
        for (int a = 0; a < 3; a++) {
            node->low[a] = sphpa_min_(node->low[a], p[a]);
            node->high[a] = sphpa_max_(node->high[a], p[a]);
        }
        node->support = sphpa_max_(node->support, p[3]);
    }
}

/* New keys for a node whose keys are all equal, over its own tight box (a dense clump in a huge
   box); sorts its particles by them. The keys stay equal if it is a point. */
SPHPA_PRIVATE_ void sphpa_tree_rekey_(sphpa_tree *tree, const sphpa_tree_sort_ *all,
                                      sphpa_tree_node *node) {
    sphpa_tree_frame_ frame;
    size_t first = node->first, count = node->count;
    double *pos = tree->pos + 4 * first;
    uint32_t *order = tree->order + first;
    sphpa_tree_sort_ sort;
    sphpa_tree_tighten_(tree, node);
    sphpa_tree_frame_make_(&frame, tree->dim, node->low, node->high);
    sort.key = all->key + first;
    sort.key_spare = all->key_spare + first;
    sort.index = all->index + first;
    sort.index_spare = all->index_spare + first;
    for (size_t k = 0; k < count; k++) {
        sort.key[k] = sphpa_tree_key_(&frame, pos + 4 * k);
        sort.index[k] = (uint32_t)k;
    }
    sphpa_tree_sort_keys_(&sort, count);
    double *column = (double *)(void *)sort.key_spare; /* one column at a time: no further memory */
    for (size_t a = 0; a < 4; a++) {
        for (size_t k = 0; k < count; k++) column[k] = pos[4 * k + a];
        for (size_t k = 0; k < count; k++) pos[4 * k + a] = column[sort.index[k]];
    }
    memcpy(sort.index_spare, order, count * sizeof *order);
    for (size_t k = 0; k < count; k++) order[k] = sort.index_spare[sort.index[k]];
}

/* first k in [first, end) whose key has the bit; the bits above it are equal in the range */
SPHPA_PRIVATE_ uint32_t sphpa_tree_bisect_(const uint64_t *key, uint32_t first, uint32_t end,
                                           int bit) {
    while (first < end) {
        uint32_t middle = first + (end - first) / 2;
        if ((key[middle] >> bit) & 1u)
            end = middle;
        else
            first = middle + 1;
    }
    return first;
}

/* Cuts [edge[0], edge[1]) at up to three bits, the highest that differs and the next two, but cuts
   no piece that fits a leaf: so leaves are at least about half full. Returns the pieces, 2 to 8. */
SPHPA_PRIVATE_ int sphpa_tree_cut_(const uint64_t *key, uint32_t leaf, uint32_t edge[9]) {
    uint64_t differ = key[edge[0]] ^ key[edge[1] - 1];
    int bit = 63, pieces = 1;
    while (((differ >> bit) & 1u) == 0) bit--;
    for (int level = 0; level < 3 && bit >= 0; level++, bit--) {
        uint32_t cut[9] = {0, 0, 0, 0, 0, 0, 0, 0, 0};
        int now = 0;
        for (int s = 0; s < pieces; s++) {
            cut[now++] = edge[s];
            if (level > 0 && edge[s + 1] - edge[s] <= leaf) continue;
            uint32_t middle = sphpa_tree_bisect_(key, edge[s], edge[s + 1], bit);
            if (middle > edge[s] && middle < edge[s + 1]) cut[now++] = middle;
        }
        cut[now] = edge[pieces];
        memcpy(edge, cut, sizeof cut);
        pieces = now;
    }
    return pieces;
}

/* appends the children of nodes[at]; *pieces is 0 if it is to be a leaf */
SPHPA_PRIVATE_ bool sphpa_tree_split_(sphpa_tree *tree, const sphpa_tree_sort_ *sort, uint32_t at,
                                      uint32_t leaf, int *round, int *pieces) {
    uint32_t edge[9] = {0, 0, 0, 0, 0, 0, 0, 0, 0};
    sphpa_tree_node *node = tree->nodes + at;
    edge[0] = node->first;
    edge[1] = node->first + node->count;
    *pieces = 0;
    if (node->count <= leaf) return true;
    if (sort->key[edge[0]] == sort->key[edge[1] - 1]) {
        if (++*round >= SPHPA_TREE_ROUNDS_) return true;
        sphpa_tree_rekey_(tree, sort, node);
        if (sort->key[edge[0]] == sort->key[edge[1] - 1]) return true;
    }
    *pieces = sphpa_tree_cut_(sort->key, leaf, edge);
    size_t child = tree->node_count;
    if (!sphpa_tree_grow_nodes_(tree, child + (size_t)*pieces)) return false;
    tree->nodes[at].child = (uint32_t)child;
    tree->nodes[at].children = (uint32_t)*pieces;
    tree->node_count += (size_t)*pieces;
    for (int c = 0; c < *pieces; c++) {
        sphpa_tree_node *born = tree->nodes + child + c;
        memset(born, 0, sizeof *born);
        born->first = edge[c];
        born->count = edge[c + 1] - edge[c];
    }
    return true;
}

/* all nodes from the root, first child first, so leaves come in the order of their particles */
SPHPA_PRIVATE_ bool sphpa_tree_grow_from_root_(sphpa_tree *tree, const sphpa_tree_sort_ *sort) {
    uint32_t stack[SPHPA_TREE_STACK_];
    int rounds[SPHPA_TREE_STACK_], top = 1, pieces = 0;
    uint32_t leaf = tree->leaf_size > 0 ? (uint32_t)tree->leaf_size : SPHPA_TREE_LEAF_;
    if (!sphpa_tree_grow_nodes_(tree, tree->n / leaf + 8)) return false;
    memset(tree->nodes, 0, sizeof *tree->nodes);
    tree->nodes[0].count = (uint32_t)tree->n;
    tree->node_count = 1;
    tree->leaf_count = 0;
    stack[0] = 0;
    rounds[0] = 0;
    while (top > 0) {
        uint32_t at = stack[--top];
        int round = rounds[top];
        if (!sphpa_tree_split_(tree, sort, at, leaf, &round, &pieces)) return false;
        if (pieces == 0) {
            if (!sphpa_tree_grow_u32_(&tree->leaves, &tree->leaf_capacity, tree->leaf_count + 1))
                return false;
            tree->leaves[tree->leaf_count++] = at;
        }
        SPHPA_ASSERT(top + pieces <= SPHPA_TREE_STACK_);
        for (int c = pieces; c-- > 0; top++) {
            stack[top] = tree->nodes[at].child + (uint32_t)c;
            rounds[top] = round;
        }
    }
    return true;
}

/* boxes and supports from the leaves up: children come later than their parents */
SPHPA_PRIVATE_ void sphpa_tree_tighten_all_(sphpa_tree *tree) {
    SPHPA_OMP(parallel for schedule(static) if (tree->n > SPHPA_TREE_SERIAL_))
    for (size_t l = 0; l < tree->leaf_count; l++)
        sphpa_tree_tighten_(tree, tree->nodes + tree->leaves[l]);
    for (size_t at = tree->node_count; at-- > 0;) {
        sphpa_tree_node *node = tree->nodes + at;
        for (uint32_t c = 0; c < node->children; c++) {
            const sphpa_tree_node *child = tree->nodes + node->child + c;
            for (int a = 0; a < 3; a++) {
                node->low[a] = c == 0 ? child->low[a] : sphpa_min_(node->low[a], child->low[a]);
                node->high[a] = c == 0 ? child->high[a] : sphpa_max_(node->high[a], child->high[a]);
            }
            node->support = sphpa_max_(c == 0 ? 0.0 : node->support, child->support);
        }
    }
}

SPHPA_PRIVATE_ sphpa_result sphpa_tree_no_memory_(sphpa_error *err, const char *who, size_t n) {
    return sphpa_error_set(err, SPHPA_ERROR_MEMORY,
                           "%s: out of memory for %zu particles; use fewer or free some memory",
                           who, n);
}

SPHPA_DEF sphpa_result sphpa_tree_build(sphpa_tree *tree, int dim, size_t n, const double *x,
                                        const double *support, const sphpa_box *periodic,
                                        sphpa_error *err) {
    sphpa_result result = sphpa_tree_check_arguments_(tree, dim, n, x, support, periodic, err);
    if (result == SPHPA_OK) result = sphpa_tree_check_particles_(dim, n, x, support, periodic, err);
    if (result != SPHPA_OK) return result;
    if (!sphpa_tree_reserve_(tree, n)) {
        tree->n = 0;
        return sphpa_tree_no_memory_(err, "sphpa_tree_build", n);
    }
    tree->n = n;
    tree->dim = dim;
    tree->box = sphpa_tree_bounds_(dim, n, x, periodic);
    sphpa_tree_sort_ sort = sphpa_tree_sort_of_(tree, n);
    sphpa_tree_place_(tree, &sort, x, support);
    if (!sphpa_tree_grow_from_root_(tree, &sort)) {
        tree->n = 0;
        return sphpa_tree_no_memory_(err, "sphpa_tree_build", n);
    }
    SPHPA_OMP(parallel for schedule(static) if (n > SPHPA_TREE_SERIAL_))
    for (size_t k = 0; k < n; k++) tree->rank[tree->order[k]] = (uint32_t)k;
    sphpa_tree_tighten_all_(tree);
    return SPHPA_OK;
}

SPHPA_DEF void sphpa_tree_free(sphpa_tree *tree) {
    if (tree == NULL) return;
    SPHPA_FREE(tree->pos);
    SPHPA_FREE(tree->order);
    SPHPA_FREE(tree->rank);
    SPHPA_FREE(tree->nodes);
    SPHPA_FREE(tree->leaves);
    SPHPA_FREE(tree->scratch);
    memset(tree, 0, sizeof *tree);
}

SPHPA_DEF size_t sphpa_tree_bytes(const sphpa_tree *tree) {
    if (tree == NULL) return 0;
    return tree->pos_capacity * 4 * sizeof(double) + tree->scratch_capacity * 3 * sizeof(uint64_t) +
           (tree->order_capacity + tree->rank_capacity + tree->leaf_capacity) * sizeof(uint32_t) +
           tree->node_capacity * sizeof(sphpa_tree_node);
}

/* ---- walking --------------------------------------------------------------------------------- */

/* how far apart a box and a node may be and still hold a pair */
enum {
    SPHPA_TREE_REACH_MAX_,  /* own reach, or factor times the node's support: (1), (3) */
    SPHPA_TREE_REACH_OWN_,  /* own reach */
    SPHPA_TREE_REACH_MEAN_  /* half of own reach and the node's in reach[]: (4) */
};

typedef struct sphpa_tree_walk_ {
    const sphpa_tree *tree;
    const double *reach; /* (node_count), for the mean */
    double low[3], high[3], own, factor;
    sphpa_tree_period_ period;
    bool wrap;     /* an image may be in reach */
    uint32_t from; /* nodes that end before this particle are left out */
    int top;
    uint32_t stack[SPHPA_TREE_STACK_];
} sphpa_tree_walk_;

SPHPA_PRIVATE_ void sphpa_tree_walk_init_(sphpa_tree_walk_ *walk, const sphpa_tree *tree,
                                          double factor) {
    walk->tree = tree;
    walk->reach = NULL;
    walk->factor = factor;
    walk->period = sphpa_tree_period_of_(&tree->box);
    walk->top = 0;
    walk->from = 0;
    walk->own = 0.0;
    walk->wrap = false;
}

/* own: the reach of the box low..high; nearest images are not looked at */
SPHPA_PRIVATE_ void sphpa_tree_walk_aim_(sphpa_tree_walk_ *walk, const double low[3],
                                         const double high[3], double own, uint32_t from) {
    for (int a = 0; a < 3; a++) {
        walk->low[a] = low[a];
        walk->high[a] = high[a];
    }
    walk->wrap = false;
    walk->own = own;
    walk->from = from;
    walk->stack[0] = 0;
    walk->top = 1;
}

/* the same with nearest images; widest: no pair of the box is farther apart than this */
SPHPA_PRIVATE_ void sphpa_tree_walk_start_(sphpa_tree_walk_ *walk, const double low[3],
                                           const double high[3], double own, double widest,
                                           uint32_t from) {
    const sphpa_box *box = &walk->tree->box;
    sphpa_tree_walk_aim_(walk, low, high, own, from);
    for (int a = 0; a < 3; a++) {
        double length = walk->period.length[a];
        double room = widest + SPHPA_TREE_ROUND_ * (widest + length);
        bool inside = low[a] - box->low[a] > room && box->high[a] - high[a] > room;
        walk->wrap = walk->wrap || (length > 0.0 && !inside);
    }
}

SPHPA_FORCE_INLINE_ bool sphpa_tree_near_(const sphpa_tree_walk_ *walk, uint32_t at, int mode,
                                          bool wrap) {
    const sphpa_tree_node *node = walk->tree->nodes + at;
    double reach = walk->own, sum = 0.0;
    if (mode == SPHPA_TREE_REACH_MAX_) reach = sphpa_max_(reach, walk->factor * node->support);
    if (mode == SPHPA_TREE_REACH_MEAN_) {
        if (walk->reach[at] < 0.0) return false;
        reach = 0.5 * (reach + walk->reach[at]);
    }
    for (int a = 0; a < 3; a++) {
        double low = node->low[a] - walk->high[a], high = node->high[a] - walk->low[a];
        double gap = wrap ? sphpa_tree_gap_image_(low, high, walk->period.length[a])
                          : sphpa_tree_gap_(low, high);
        sum += gap * gap;
    }
    return sum <= reach * reach * (1.0 + SPHPA_TREE_ROUND_);
}

/* the next leaf in reach, in the order of the particles, or NULL */
SPHPA_FORCE_INLINE_ const sphpa_tree_node *sphpa_tree_next_in_(sphpa_tree_walk_ *walk, int mode,
                                                               bool wrap) {
    while (walk->top > 0) {
        uint32_t at = walk->stack[--walk->top];
        const sphpa_tree_node *node = walk->tree->nodes + at;
        if (node->first + node->count <= walk->from) continue;
        if (!sphpa_tree_near_(walk, at, mode, wrap)) continue;
        if (node->children == 0) return node;
        for (uint32_t c = node->children; c-- > 0;) walk->stack[walk->top++] = node->child + c;
    }
    return NULL;
}

SPHPA_FORCE_INLINE_ const sphpa_tree_node *sphpa_tree_next_(sphpa_tree_walk_ *walk, int mode) {
    return walk->wrap ? sphpa_tree_next_in_(walk, mode, true)
                      : sphpa_tree_next_in_(walk, mode, false);
}

/* ---- single queries -------------------------------------------------------------------------- */

/* appends the caller's indices of all but `self` that (1) allows, or (gather) nearer than own */
SPHPA_FORCE_INLINE_ sphpa_result sphpa_tree_collect_(const sphpa_tree *tree, const double *p,
                                                     double own, uint32_t self, int mode,
                                                     sphpa_tree_list *list) {
    sphpa_tree_walk_ walk;
    sphpa_tree_walk_init_(&walk, tree, 1.0);
    double widest = mode == SPHPA_TREE_REACH_MAX_ ? tree->nodes[0].support : own;
    sphpa_tree_walk_start_(&walk, p, p, own, widest, 0);
    size_t count = 0;
    const sphpa_tree_node *leaf;
    while ((leaf = sphpa_tree_next_(&walk, mode)) != NULL) {
        if (!sphpa_tree_grow_u32_(&list->index, &list->capacity, count + leaf->count)) {
            list->count = 0;
            return SPHPA_ERROR_MEMORY;
        }
        for (uint32_t j = leaf->first; j < leaf->first + leaf->count; j++) {
            const double *q = tree->pos + 4 * (size_t)j;
            double s = mode == SPHPA_TREE_REACH_MAX_ ? sphpa_max_(own, q[3]) : own;
            if (j != self && sphpa_tree_r2_(p, q, &walk.period) < s * s)
                list->index[count++] = tree->order[j];
        }
    }
    list->count = count;
    return SPHPA_OK;
}

SPHPA_DEF sphpa_result sphpa_tree_neighbours(const sphpa_tree *tree, size_t i,
                                             sphpa_tree_list *list) {
    if (tree == NULL || list == NULL) return SPHPA_ERROR_MISSING;
    if (tree->n == 0) return SPHPA_ERROR_EMPTY;
    if (i >= tree->n) return SPHPA_ERROR_RANGE;
    uint32_t k = tree->rank[i];
    const double *p = tree->pos + 4 * (size_t)k;
    return sphpa_tree_collect_(tree, p, p[3], k, SPHPA_TREE_REACH_MAX_, list);
}

SPHPA_DEF sphpa_result sphpa_tree_query(const sphpa_tree *tree, const double x[3], double radius,
                                        sphpa_tree_list *list) {
    if (tree == NULL || x == NULL || list == NULL) return SPHPA_ERROR_MISSING;
    if (tree->n == 0) return SPHPA_ERROR_EMPTY;
    if (!sphpa_finite_(radius)) return SPHPA_ERROR_NOT_FINITE;
    if (!(radius > 0.0)) return SPHPA_ERROR_NEGATIVE;
    double p[3] = {0.0, 0.0, 0.0};
    for (int a = 0; a < tree->dim; a++) {
        const sphpa_box *box = &tree->box;
        if (!sphpa_finite_(x[a])) return SPHPA_ERROR_NOT_FINITE;
        p[a] = x[a];
        if (box->periodic[a] == 0) continue;
        if (x[a] < box->low[a] || x[a] > box->high[a]) return SPHPA_ERROR_OUTSIDE;
        if (radius > 0.5 * (box->high[a] - box->low[a])) return SPHPA_ERROR_RANGE;
    }
    return sphpa_tree_collect_(tree, p, radius, UINT32_MAX, SPHPA_TREE_REACH_OWN_, list);
}

SPHPA_DEF void sphpa_tree_list_free(sphpa_tree_list *list) {
    if (list == NULL) return;
    SPHPA_FREE(list->index);
    memset(list, 0, sizeof *list);
}

/* the first particle after k in the leaf on the point of k, or n: not squares, which underflow */
SPHPA_PRIVATE_ size_t sphpa_tree_twin_(const sphpa_tree *tree, const sphpa_tree_period_ *period,
                                       const sphpa_tree_node *leaf, size_t k) {
    const double *p = tree->pos + 4 * k;
    size_t end = (size_t)leaf->first + leaf->count;
    for (size_t j = leaf->first > k ? leaf->first : k + 1; j < end; j++) {
        const double *q = tree->pos + 4 * j;
        bool same = true;
        for (int a = 0; a < 3; a++)
            same = same &&
                   sphpa_tree_image_(p[a] - q[a], period->length[a], period->half[a]) == 0.0;
        if (same) return j;
    }
    return tree->n;
}

SPHPA_DEF sphpa_result sphpa_tree_coincident(const sphpa_tree *tree, size_t *i, size_t *j) {
    if (tree == NULL) return SPHPA_ERROR_MISSING;
    if (tree->n == 0) return SPHPA_ERROR_EMPTY;
    sphpa_tree_walk_ walk;
    sphpa_tree_walk_init_(&walk, tree, 1.0);
    for (size_t l = 0; l < tree->leaf_count; l++) {
        const sphpa_tree_node *own = tree->nodes + tree->leaves[l], *leaf;
        sphpa_tree_walk_start_(&walk, own->low, own->high, 0.0, 0.0, own->first);
        while ((leaf = sphpa_tree_next_(&walk, SPHPA_TREE_REACH_OWN_)) != NULL)
            for (size_t k = own->first; k < (size_t)own->first + own->count; k++) {
                size_t twin = sphpa_tree_twin_(tree, &walk.period, leaf, k);
                if (twin == tree->n) continue;
                size_t a = tree->order[k], b = tree->order[twin];
                if (i != NULL) *i = a < b ? a : b;
                if (j != NULL) *j = a < b ? b : a;
                return SPHPA_ERROR_COINCIDENT;
            }
    }
    return SPHPA_OK;
}

/* ---- all lists at once ----------------------------------------------------------------------- */

#define SPHPA_TREE_TILE_ 32 /* sorted particles that share their candidates */

SPHPA_DEF void sphpa_tree_image_shift(const sphpa_box *box, uint32_t image, double shift[3]) {
    for (int a = 0; a < 3; a++, image /= 3) {
        double length = box->periodic[a] != 0 ? box->high[a] - box->low[a] : 0.0;
        shift[a] = image % 3 == 1 ? length : image % 3 == 2 ? -length : 0.0;
    }
}

/* What one thread works in. Candidates are kept in float, relative to their tile and in units of
   the longest reach: twice as many fit a vector, and what float leaves in doubt double decides. */
typedef struct sphpa_tree_bench_ {
    sphpa_tree_walk_ walk;
    double centre[3], per; /* [m] [1/m] of the tile's unit */
    float doubt;           /* r^2 - s^2 nearer to 0 than this may have the wrong sign */
    float *x, *y, *z, *s2; /* (capacity) candidates of a tile; s2: (1 + skin)^2 s^2 */
    uint32_t *index;       /* (index_capacity) their entries */
    uint32_t *ranges;       /* (2 leaf_count) first and end of runs of candidates */
    uint32_t *list;         /* (list_capacity) the chunk's lists until they are complete */
    size_t capacity, index_capacity, list_capacity, used;
} sphpa_tree_bench_;

SPHPA_PRIVATE_ bool sphpa_tree_bench_init_(sphpa_tree_bench_ *bench, const sphpa_tree *tree,
                                           double factor) {
    sphpa_tree_walk_init_(&bench->walk, tree, factor);
    bench->x = bench->y = bench->z = bench->s2 = NULL;
    bench->index = bench->list = NULL;
    bench->capacity = bench->index_capacity = bench->list_capacity = bench->used = 0;
    bench->ranges = (uint32_t *)sphpa_alloc_(tree->leaf_count, 2 * sizeof(uint32_t));
    return bench->ranges != NULL;
}

SPHPA_PRIVATE_ void sphpa_tree_bench_free_(sphpa_tree_bench_ *bench) {
    SPHPA_FREE(bench->x);
    SPHPA_FREE(bench->index);
    SPHPA_FREE(bench->ranges);
    SPHPA_FREE(bench->list);
}

/* the unit of a tile: coordinates of candidates are below 1 + its extent */
SPHPA_PRIVATE_ void sphpa_tree_bench_aim_(sphpa_tree_bench_ *bench, const sphpa_tree_node *tile) {
    double extent = 0.0, reach = bench->walk.factor * bench->walk.tree->nodes[0].support;
    for (int a = 0; a < 3; a++) {
        bench->centre[a] = 0.5 * (tile->low[a] + tile->high[a]);
        extent = sphpa_max_(extent, tile->high[a] - tile->low[a]);
    }
    bench->per = 1.0 / reach;
    bench->doubt = (float)sphpa_min_(2e-6 * (1.0 + extent * bench->per), 1e30);
}

/* room for count candidates and the padding of the last block; `used` of them are kept */
SPHPA_PRIVATE_ bool sphpa_tree_bench_reserve_(sphpa_tree_bench_ *bench, size_t used, size_t count) {
    size_t need = count + SPHPA_TREE_LANES_, before = bench->capacity;
    void *block = bench->x;
    bool done = sphpa_grow_(&block, &bench->capacity, need, 4 * sizeof(float));
    bench->x = (float *)block;
    if (!done) return false;
    for (size_t c = 4; c-- > 1 && bench->capacity > before;) /* columns move apart */
        memmove(bench->x + c * bench->capacity, bench->x + c * before, used * sizeof(float));
    bench->y = bench->x + bench->capacity;
    bench->z = bench->y + bench->capacity;
    bench->s2 = bench->z + bench->capacity;
    return sphpa_tree_grow_u32_(&bench->index, &bench->index_capacity, need);
}

/* Runs of particles in reach of what the walk is aimed at, ascending; leaves that follow each other
   are joined. Returns the runs; *total counts particles. */
SPHPA_PRIVATE_ size_t sphpa_tree_runs_(sphpa_tree_bench_ *bench, size_t *total) {
    const sphpa_tree_node *leaf;
    size_t runs = 0;
    *total = 0;
    while ((leaf = sphpa_tree_next_in_(&bench->walk, SPHPA_TREE_REACH_MAX_, false)) != NULL) {
        if (runs > 0 && bench->ranges[2 * runs - 1] == leaf->first)
            runs--;
        else
            bench->ranges[2 * runs] = leaf->first;
        bench->ranges[2 * runs + 1] = leaf->first + leaf->count;
        runs++;
        *total += leaf->count;
    }
    return runs;
}

/* Copies the particles of the runs that are in reach of the walk's box behind the m that are there:
   the rounded box holds half of what the leaves hold. Branch-free: what is not kept is overwritten
   by the next one. */
SPHPA_PRIVATE_ size_t sphpa_tree_gather_(const sphpa_tree_bench_ *bench, size_t runs, size_t m,
                                         uint32_t image, const double shift[3]) {
    const sphpa_tree_walk_ *walk = &bench->walk;
    float *SPHPA_RESTRICT x = bench->x, *SPHPA_RESTRICT y = bench->y;
    float *SPHPA_RESTRICT z = bench->z, *SPHPA_RESTRICT s2 = bench->s2;
    uint32_t *SPHPA_RESTRICT index = bench->index;
    double own = walk->own * walk->own, per = bench->per, off[3];
    for (int a = 0; a < 3; a++) off[a] = shift[a] - bench->centre[a];
    for (size_t r = 0; r < runs; r++)
        for (uint32_t j = bench->ranges[2 * r]; j < bench->ranges[2 * r + 1]; j++) {
            const double *q = walk->tree->pos + 4 * (size_t)j;
            double s = walk->factor * q[3], sum = 0.0;
            for (int a = 0; a < 3; a++) {
                double gap = sphpa_tree_gap_(q[a] - walk->high[a], q[a] - walk->low[a]);
                sum += gap * gap;
            }
            x[m] = (float)(per * (q[0] + off[0]));
            y[m] = (float)(per * (q[1] + off[1]));
            z[m] = (float)(per * (q[2] + off[2]));
            s2[m] = (float)((per * s) * (per * s));
            index[m] = (image << SPHPA_TREE_ENTRY_BITS) | j;
            m += sum <= sphpa_max_(own, s * s) * (1.0 + SPHPA_TREE_ROUND_) ? 1u : 0u;
        }
    return m;
}

/* the images of particles that may be in reach of a tile: bit d of axis a's mask for digit d of
   their numbers; reach: no pair of the tile is farther apart */
SPHPA_PRIVATE_ void sphpa_tree_images_(const sphpa_tree *tree, const sphpa_tree_node *tile,
                                       double reach, unsigned digits[3]) {
    for (int a = 0; a < 3; a++) {
        const sphpa_box *box = &tree->box;
        digits[a] = 1u;
        if (box->periodic[a] == 0) continue;
        double room = reach + SPHPA_TREE_ROUND_ * (reach + box->high[a] - box->low[a]);
        if (tile->high[a] + room >= box->high[a]) digits[a] |= 2u;
        if (tile->low[a] - room <= box->low[a]) digits[a] |= 4u;
    }
}

/* all candidates of the tile, image by image; false: no memory */
SPHPA_PRIVATE_ bool sphpa_tree_candidates_(sphpa_tree_bench_ *bench, const sphpa_tree_node *tile,
                                           size_t *count) {
    const sphpa_tree *tree = bench->walk.tree;
    double factor = bench->walk.factor, shift[3], low[3], high[3];
    unsigned digits[3];
    size_t m = 0, total;
    sphpa_tree_images_(tree, tile, factor * tree->nodes[0].support, digits);
    for (uint32_t image = 0; image < SPHPA_TREE_IMAGES; image++) {
        if (!((digits[0] >> (image % 3)) & (digits[1] >> (image / 3 % 3)) &
              (digits[2] >> (image / 9)) & 1u))
            continue;
        sphpa_tree_image_shift(&tree->box, image, shift);
        for (int a = 0; a < 3; a++) {
            low[a] = tile->low[a] - shift[a];
            high[a] = tile->high[a] - shift[a];
        }
        sphpa_tree_walk_aim_(&bench->walk, low, high, factor * tile->support, 0);
        size_t runs = sphpa_tree_runs_(bench, &total);
        if (!sphpa_tree_bench_reserve_(bench, m, m + total)) return false;
        m = sphpa_tree_gather_(bench, runs, m, image, shift);
    }
    for (size_t l = 0; l < SPHPA_TREE_LANES_; l++) { /* the last block computes on these in vain */
        bench->x[m + l] = bench->x[0];
        bench->y[m + l] = bench->y[0];
        bench->z[m + l] = bench->z[0];
        bench->s2[m + l] = bench->s2[0];
        bench->index[m + l] = 0;
    }
    *count = m;
    return true;
}

/* whether the entry is near, by (3), to one of the particles first .. end - 1 */
SPHPA_PRIVATE_ bool sphpa_tree_exact_(const sphpa_tree_bench_ *bench, uint32_t entry, size_t first,
                                      size_t end) {
    const sphpa_tree *tree = bench->walk.tree;
    const double *q = tree->pos + 4 * (size_t)SPHPA_TREE_ENTRY_INDEX(entry);
    double shift[3];
    sphpa_tree_image_shift(&tree->box, SPHPA_TREE_ENTRY_IMAGE(entry), shift);
    for (size_t k = first; k < end; k++) {
        const double *p = tree->pos + 4 * k;
        double s = bench->walk.factor * sphpa_max_(p[3], q[3]);
        double dx = p[0] - (q[0] + shift[0]), dy = p[1] - (q[1] + shift[1]);
        double dz = p[2] - (q[2] + shift[2]);
        if (dx * dx + dy * dy + dz * dz < s * s) return true;
    }
    return false;
}

/* out to d[SPHPA_TREE_LANES_]: the least r^2 - s^2 of some candidates with particles of the group */
SPHPA_FORCE_INLINE_ void sphpa_tree_least_(const sphpa_tree_bench_ *bench, size_t b,
                                           const float (*own)[4], size_t count, float *d) {
    const float *SPHPA_RESTRICT x = bench->x + b, *SPHPA_RESTRICT y = bench->y + b;
    const float *SPHPA_RESTRICT z = bench->z + b, *SPHPA_RESTRICT s2 = bench->s2 + b;
    for (int l = 0; l < SPHPA_TREE_LANES_; l++) d[l] = 1e30f;
    for (size_t k = 0; k < count; k++) {
        float px = own[k][0], py = own[k][1], pz = own[k][2], ps = own[k][3];
        SPHPA_SIMD
        for (int l = 0; l < SPHPA_TREE_LANES_; l++) {
            float dx = px - x[l], dy = py - y[l], dz = pz - z[l], theirs = s2[l];
            float far = dx * dx + dy * dy + dz * dz - (ps > theirs ? ps : theirs);
            d[l] = far < d[l] ? far : d[l];
        }
    }
}

/* the candidates that are near, by (3), to one of the group's particles first .. end - 1, to out;
   returns how many */
SPHPA_PRIVATE_ size_t sphpa_tree_select_(const sphpa_tree_bench_ *bench, size_t m, size_t first,
                                         size_t end, uint32_t *SPHPA_RESTRICT out) {
    const double *pos = bench->walk.tree->pos;
    float own[16][4], doubt = bench->doubt;
    size_t count = 0;
    for (size_t k = first; k < end; k++) {
        double s = bench->per * bench->walk.factor * pos[4 * k + 3];
        for (size_t a = 0; a < 3; a++)
            own[k - first][a] = (float)(bench->per * (pos[4 * k + a] - bench->centre[a]));
        own[k - first][3] = (float)(s * s);
    }
    for (size_t b = 0; b < m; b += SPHPA_TREE_LANES_) {
        float d[SPHPA_TREE_LANES_];
        sphpa_tree_least_(bench, b, (const float (*)[4])own, end - first, d);
        size_t lanes = m - b < SPHPA_TREE_LANES_ ? m - b : SPHPA_TREE_LANES_;
        for (size_t l = 0; l < lanes; l++) {
            bool near = d[l] < 0.0f;
            if (!(fabsf(d[l]) > doubt)) near = sphpa_tree_exact_(bench, bench->index[b + l], first, end);
            out[count] = bench->index[b + l];
            count += near ? 1u : 0u;
        }
    }
    return count;
}

/* the lists of the groups of the tile's particles, appended to the thread's own */
SPHPA_PRIVATE_ bool sphpa_tree_list_tile_(sphpa_tree_bench_ *bench, size_t first, size_t end,
                                          sphpa_tree_lists *lists) {
    sphpa_tree_node tile;
    size_t m;
    tile.first = (uint32_t)first;
    tile.count = (uint32_t)(end - first);
    sphpa_tree_tighten_(bench->walk.tree, &tile);
    sphpa_tree_bench_aim_(bench, &tile);
    if (!sphpa_tree_candidates_(bench, &tile, &m)) return false;
    for (size_t k = first; k < end; k += lists->group) {
        if (!sphpa_tree_grow_u32_(&bench->list, &bench->list_capacity, bench->used + m + 1))
            return false;
        size_t last = k + lists->group < end ? k + lists->group : end, g = k / lists->group;
        size_t count = sphpa_tree_select_(bench, m, k, last, bench->list + bench->used);
        if (bench->used > UINT32_MAX) return false;
        lists->first[g] = (uint32_t)bench->used;
        lists->count[g] = (uint32_t)count;
        bench->used += count;
    }
    return true;
}

/* The lists are made in the thread's buffer and then copied to one that fits: growing a buffer a
   chunk would cost half as much memory again. */
SPHPA_PRIVATE_ bool sphpa_tree_list_chunk_(sphpa_tree_bench_ *bench, size_t c,
                                           sphpa_tree_lists *lists) {
    sphpa_tree_chunk *chunk = lists->chunks + c;
    size_t first = c << SPHPA_TREE_CHUNK_SHIFT, end = first + SPHPA_TREE_CHUNK;
    if (end > lists->n) end = lists->n;
    bench->used = 0;
    for (; first < end; first += SPHPA_TREE_TILE_) {
        size_t last = first + SPHPA_TREE_TILE_ < end ? first + SPHPA_TREE_TILE_ : end;
        if (!sphpa_tree_list_tile_(bench, first, last, lists)) return false;
    }
    if (chunk->capacity < bench->used) {
        SPHPA_FREE(chunk->index);
        chunk->capacity = 0;
        chunk->index = (uint32_t *)sphpa_alloc_(bench->used + bench->used / 16, sizeof(uint32_t));
        if (chunk->index == NULL) return false;
        chunk->capacity = bench->used + bench->used / 16;
    }
    if (bench->used > 0) memcpy(chunk->index, bench->list, bench->used * sizeof(uint32_t));
    chunk->used = bench->used;
    return true;
}

SPHPA_PRIVATE_ bool sphpa_tree_list_all_(const sphpa_tree *tree, double factor,
                                         sphpa_tree_lists *lists) {
    int failed = 0;
    SPHPA_OMP(parallel if (lists->chunk_count > 2))
    {
        sphpa_tree_bench_ bench;
        bool ready = sphpa_tree_bench_init_(&bench, tree, factor);
        SPHPA_OMP(for schedule(dynamic))
        for (size_t c = 0; c < lists->chunk_count; c++)
            if (!ready || !sphpa_tree_list_chunk_(&bench, c, lists)) {
                SPHPA_OMP(atomic write)
                failed = 1;
            }
        sphpa_tree_bench_free_(&bench);
    }
    return failed == 0;
}

SPHPA_PRIVATE_ bool sphpa_tree_lists_reserve_(sphpa_tree_lists *lists, size_t n) {
    size_t before = lists->chunk_capacity;
    size_t chunks = (n + SPHPA_TREE_CHUNK - 1) >> SPHPA_TREE_CHUNK_SHIFT;
    void *block = lists->chunks;
    bool done = sphpa_grow_(&block, &lists->chunk_capacity, chunks, sizeof(sphpa_tree_chunk));
    lists->chunks = (sphpa_tree_chunk *)block;
    if (lists->chunk_capacity > before)
        memset(lists->chunks + before, 0,
               (lists->chunk_capacity - before) * sizeof(sphpa_tree_chunk));
    return done && sphpa_tree_grow_u32_(&lists->first, &lists->first_capacity, lists->groups) &&
           sphpa_tree_grow_u32_(&lists->count, &lists->count_capacity, lists->groups);
}

SPHPA_PRIVATE_ sphpa_result sphpa_tree_check_skin_(const sphpa_tree *tree, double skin,
                                                   sphpa_error *err) {
    if (!sphpa_finite_(skin))
        return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                               "sphpa_tree_lists_build: skin is %g; use 0 to 1", skin);
    if (skin < 0.0)
        return sphpa_error_set(err, SPHPA_ERROR_NEGATIVE,
                               "sphpa_tree_lists_build: skin is %g; need skin >= 0", skin);
    double reach = (1.0 + skin) * tree->nodes[0].support;
    if (reach > SPHPA_TREE_BIG_)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "sphpa_tree_lists_build: (1 + %g) times the support %g m is above "
                               "%g m; use a smaller skin",
                               skin, tree->nodes[0].support, SPHPA_TREE_BIG_);
    for (int a = 0; a < tree->dim; a++) {
        double length = tree->box.high[a] - tree->box.low[a];
        if (tree->box.periodic[a] != 0 && reach > 0.5 * length)
            return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                   "sphpa_tree_lists_build: (1 + %g) times the largest support "
                                   "%g m is more than half of the periodic box (%g m on axis %d); "
                                   "use a smaller skin or a larger box",
                                   skin, tree->nodes[0].support, length, a);
    }
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_tree_check_lists_(const sphpa_tree *tree, double skin,
                                                    size_t group, const sphpa_tree_lists *lists,
                                                    sphpa_error *err) {
    if (tree == NULL || lists == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING, "sphpa_tree_lists_build: no %s",
                               tree == NULL ? "tree" : "lists");
    if (tree->n == 0)
        return sphpa_error_set(err, SPHPA_ERROR_EMPTY,
                               "sphpa_tree_lists_build: the tree is empty; build it first");
    if (group < 1 || group > 16 || (group & (group - 1)) != 0)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "sphpa_tree_lists_build: groups of %zu; give 1, 2, 4, 8 or 16",
                               group);
    if (tree->n > (size_t)1 << SPHPA_TREE_ENTRY_BITS)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "sphpa_tree_lists_build: %zu particles; at most 2^%d can be listed",
                               tree->n, SPHPA_TREE_ENTRY_BITS);
    return sphpa_tree_check_skin_(tree, skin, err);
}

SPHPA_DEF sphpa_result sphpa_tree_lists_build(const sphpa_tree *tree, double skin, size_t group,
                                              sphpa_tree_lists *lists, sphpa_error *err) {
    sphpa_result result = sphpa_tree_check_lists_(tree, skin, group, lists, err);
    if (result != SPHPA_OK) return result;
    lists->n = lists->entries = lists->chunk_count = 0;
    lists->group = group;
    lists->groups = (tree->n + group - 1) / group;
    if (!sphpa_tree_lists_reserve_(lists, tree->n))
        return sphpa_tree_no_memory_(err, "sphpa_tree_lists_build", tree->n);
    lists->n = tree->n;
    lists->chunk_count = (tree->n + SPHPA_TREE_CHUNK - 1) >> SPHPA_TREE_CHUNK_SHIFT;
    if (!sphpa_tree_list_all_(tree, 1.0 + skin, lists)) {
        lists->n = lists->chunk_count = 0;
        return sphpa_tree_no_memory_(err, "sphpa_tree_lists_build", tree->n);
    }
    for (size_t c = 0; c < lists->chunk_count; c++) lists->entries += lists->chunks[c].used;
    lists->skin = skin;
    return SPHPA_OK;
}

SPHPA_DEF void sphpa_tree_lists_free(sphpa_tree_lists *lists) {
    if (lists == NULL) return;
    for (size_t c = 0; c < lists->chunk_capacity; c++) SPHPA_FREE(lists->chunks[c].index);
    SPHPA_FREE(lists->chunks);
    SPHPA_FREE(lists->first);
    SPHPA_FREE(lists->count);
    memset(lists, 0, sizeof *lists);
}

SPHPA_DEF size_t sphpa_tree_lists_bytes(const sphpa_tree_lists *lists) {
    if (lists == NULL) return 0;
    size_t bytes = (lists->first_capacity + lists->count_capacity) * sizeof(uint32_t) +
                   lists->chunk_capacity * sizeof(sphpa_tree_chunk);
    for (size_t c = 0; c < lists->chunk_capacity; c++)
        bytes += lists->chunks[c].capacity * sizeof(uint32_t);
    return bytes;
}

SPHPA_FORCE_INLINE_ const uint32_t *sphpa_tree_list_of_(const sphpa_tree_lists *lists, size_t g,
                                                        uint32_t *count) {
    *count = lists->count[g];
    return lists->chunks[(g * lists->group) >> SPHPA_TREE_CHUNK_SHIFT].index + lists->first[g];
}

SPHPA_DEF const uint32_t *sphpa_tree_list_of(const sphpa_tree_lists *lists, size_t g,
                                             size_t *count) {
    uint32_t length = 0;
    const uint32_t *list = sphpa_tree_list_of_(lists, g, &length);
    *count = length;
    return list;
}

/* ---- friends of friends ---------------------------------------------------------------------- */

typedef struct sphpa_tree_group_ {
    uint32_t count, smallest, root; /* members, smallest caller's index, first sorted particle */
} sphpa_tree_group_;

typedef struct sphpa_tree_friends_ {
    double *link;       /* (n) sorted; -1 where masked out */
    double *node_link;  /* (node_count) the largest below; -1 where all are masked out */
    uint32_t *parent;   /* (n) disjoint sets of sorted particles; a root is its own parent */
    uint32_t *group_of; /* (n) by root: where its group is */
    sphpa_tree_group_ *groups; /* (n) */
} sphpa_tree_friends_;

SPHPA_PRIVATE_ uint32_t sphpa_tree_root_(uint32_t *parent, uint32_t k) { /* Tarjan 1975, halving */
    while (parent[k] != k) {
        parent[k] = parent[parent[k]];
        k = parent[k];
    }
    return k;
}

SPHPA_PRIVATE_ sphpa_result sphpa_tree_check_link_(const sphpa_tree *tree, const double *link,
                                                   const unsigned char *mask, sphpa_error *err) {
    double half = SPHPA_TREE_BIG_;
    sphpa_tree_period_ period = sphpa_tree_period_of_(&tree->box);
    for (int a = 0; a < 3; a++) half = sphpa_min_(half, period.half[a]);
    for (size_t i = 0; i < tree->n; i++) {
        if (mask != NULL && mask[i] == 0) continue;
        if (!sphpa_finite_(link[i]))
            return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                                   "sphpa_tree_friends: link[%zu] is %g; check where it comes from",
                                   i, link[i]);
        if (link[i] < 0.0)
            return sphpa_error_set(err, SPHPA_ERROR_NEGATIVE,
                                   "sphpa_tree_friends: link[%zu] is %g m; need link >= 0", i,
                                   link[i]);
        if (link[i] > half)
            return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                   "sphpa_tree_friends: link[%zu] is %g m; need at most %g m, half "
                                   "of the periodic box; use a shorter link",
                                   i, link[i], half);
    }
    return SPHPA_OK;
}

SPHPA_PRIVATE_ bool sphpa_tree_friends_init_(sphpa_tree_friends_ *work, const sphpa_tree *tree,
                                             const double *link, const unsigned char *mask) {
    work->link = (double *)sphpa_alloc_(tree->n, sizeof(double));
    work->node_link = (double *)sphpa_alloc_(tree->node_count, sizeof(double));
    work->parent = (uint32_t *)sphpa_alloc_(tree->n, sizeof(uint32_t));
    work->group_of = (uint32_t *)sphpa_alloc_(tree->n, sizeof(uint32_t));
    work->groups = (sphpa_tree_group_ *)sphpa_alloc_(tree->n, sizeof(sphpa_tree_group_));
    if (work->link == NULL || work->node_link == NULL || work->parent == NULL ||
        work->group_of == NULL || work->groups == NULL)
        return false;
    for (size_t k = 0; k < tree->n; k++) {
        size_t i = tree->order[k];
        work->link[k] = mask == NULL || mask[i] != 0 ? link[i] : -1.0;
        work->parent[k] = (uint32_t)k;
    }
    for (size_t at = tree->node_count; at-- > 0;) {
        const sphpa_tree_node *node = tree->nodes + at;
        double largest = -1.0;
        for (uint32_t k = 0; k < node->count && node->children == 0; k++)
            largest = sphpa_max_(largest, work->link[node->first + k]);
        for (uint32_t c = 0; c < node->children; c++)
            largest = sphpa_max_(largest, work->node_link[node->child + c]);
        work->node_link[at] = largest;
    }
    return true;
}

SPHPA_PRIVATE_ void sphpa_tree_friends_free_(sphpa_tree_friends_ *work) {
    SPHPA_FREE(work->link);
    SPHPA_FREE(work->node_link);
    SPHPA_FREE(work->parent);
    SPHPA_FREE(work->group_of);
    SPHPA_FREE(work->groups);
}

/* joins sorted particle k with its friends among the later particles of the leaf */
SPHPA_PRIVATE_ void sphpa_tree_join_(const sphpa_tree *tree, const sphpa_tree_period_ *period,
                                     const sphpa_tree_node *leaf, uint32_t k,
                                     sphpa_tree_friends_ *work) {
    const double *p = tree->pos + 4 * (size_t)k;
    uint32_t root = sphpa_tree_root_(work->parent, k), end = leaf->first + leaf->count;
    for (uint32_t j = leaf->first > k ? leaf->first : k + 1; j < end; j++) {
        if (work->link[j] < 0.0) continue;
        double reach = 0.5 * (work->link[k] + work->link[j]);
        if (!(sphpa_tree_r2_(p, tree->pos + 4 * (size_t)j, period) < reach * reach)) continue;
        uint32_t other = sphpa_tree_root_(work->parent, j);
        uint32_t low = root < other ? root : other, high = root < other ? other : root;
        work->parent[high] = low; /* the smaller index is the root, whatever the order of joins */
        root = low;
    }
}

SPHPA_PRIVATE_ void sphpa_tree_friends_join_(const sphpa_tree *tree, sphpa_tree_friends_ *work) {
    sphpa_tree_walk_ walk;
    sphpa_tree_walk_init_(&walk, tree, 1.0);
    walk.reach = work->node_link;
    for (size_t l = 0; l < tree->leaf_count; l++) {
        const sphpa_tree_node *own = tree->nodes + tree->leaves[l], *leaf;
        double longest = work->node_link[tree->leaves[l]];
        if (longest < 0.0) continue;
        sphpa_tree_walk_start_(&walk, own->low, own->high, longest, work->node_link[0],
                               own->first);
        while ((leaf = sphpa_tree_next_(&walk, SPHPA_TREE_REACH_MEAN_)) != NULL)
            for (uint32_t k = own->first; k < own->first + own->count; k++)
                if (work->link[k] >= 0.0) sphpa_tree_join_(tree, &walk.period, leaf, k, work);
    }
}

SPHPA_PRIVATE_ int sphpa_tree_group_compare_(const void *a, const void *b) {
    const sphpa_tree_group_ *p = (const sphpa_tree_group_ *)a, *q = (const sphpa_tree_group_ *)b;
    if (p->count != q->count) return p->count > q->count ? -1 : 1;
    return p->smallest < q->smallest ? -1 : p->smallest > q->smallest ? 1 : 0;
}

SPHPA_PRIVATE_ size_t sphpa_tree_friends_label_(const sphpa_tree *tree, sphpa_tree_friends_ *work,
                                                int32_t *labels) {
    size_t groups = 0;
    for (uint32_t k = 0; k < tree->n; k++) { /* a root comes before its members */
        if (work->link[k] < 0.0) continue;
        uint32_t root = sphpa_tree_root_(work->parent, k), i = tree->order[k];
        if (root == k) {
            work->group_of[k] = (uint32_t)groups;
            work->groups[groups].count = 0;
            work->groups[groups].smallest = i;
            work->groups[groups++].root = k;
        }
        sphpa_tree_group_ *group = work->groups + work->group_of[root];
        group->count++;
        if (i < group->smallest) group->smallest = i;
    }
    qsort(work->groups, groups, sizeof *work->groups, sphpa_tree_group_compare_);
    for (size_t g = 0; g < groups; g++) work->group_of[work->groups[g].root] = (uint32_t)g;
    for (uint32_t k = 0; k < tree->n; k++)
        labels[tree->order[k]] =
            work->link[k] < 0.0
                ? -1
                : (int32_t)work->group_of[sphpa_tree_root_(work->parent, k)];
    return groups;
}

SPHPA_DEF sphpa_result sphpa_tree_friends(const sphpa_tree *tree, const double *link,
                                          const unsigned char *mask, int32_t *labels,
                                          size_t *groups, sphpa_error *err) {
    if (tree == NULL || link == NULL || labels == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING, "sphpa_tree_friends: no %s",
                               tree == NULL ? "tree" : link == NULL ? "link" : "labels");
    if (tree->n == 0)
        return sphpa_error_set(err, SPHPA_ERROR_EMPTY,
                               "sphpa_tree_friends: the tree is empty; build it first");
    if (tree->n > (size_t)INT32_MAX)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "sphpa_tree_friends: %zu particles; at most 2^31 - 1", tree->n);
    sphpa_result result = sphpa_tree_check_link_(tree, link, mask, err);
    if (result != SPHPA_OK) return result;
    sphpa_tree_friends_ work;
    if (sphpa_tree_friends_init_(&work, tree, link, mask)) {
        sphpa_tree_friends_join_(tree, &work);
        size_t found = sphpa_tree_friends_label_(tree, &work, labels);
        if (groups != NULL) *groups = found;
    } else {
        result = sphpa_tree_no_memory_(err, "sphpa_tree_friends", tree->n);
    }
    sphpa_tree_friends_free_(&work);
    return result;
}

SPHPA_EXTERN_C_END_
#endif /* >>tree */

#if SPHPA_WANT_PARTICLES_ && !defined(SPHPA_PARTICLES_DONE_)
#define SPHPA_PARTICLES_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>particles   implementation
   ============================================================================================== */

#define SPHPA_ALIGN_ 64 /* of every array: a cache line, and the widest vector */

SPHPA_DEF sphpa_field_info sphpa_field_describe(sphpa_field field) {
    sphpa_field_info info;
    memset(&info, 0, sizeof info);
#define SPHPA_ROW_(id_, type_, n_, file_, l_, m_, t_, role_, split_, merge_, meaning_)             \
    case SPHPA_FIELD_##id_:                                                                        \
        info.name = #id_;                                                                          \
        info.file_name = file_;                                                                    \
        info.meaning = meaning_;                                                                   \
        info.type = SPHPA_TYPE_##type_;                                                            \
        info.components = n_;                                                                      \
        info.length = l_;                                                                          \
        info.mass = m_;                                                                            \
        info.time = t_;                                                                            \
        info.role = SPHPA_ROLE_##role_;                                                            \
        info.split = SPHPA_RULE_##split_;                                                          \
        info.merge = SPHPA_RULE_##merge_;                                                          \
        info.bytes = (size_t)n_ * sizeof(type_);                                                   \
        break;
    switch (field) {
        SPHPA_FIELDS(SPHPA_ROW_)
    case SPHPA_FIELD_COUNT:
    default: break;
    }
#undef SPHPA_ROW_
    return info;
}

SPHPA_PRIVATE_ bool sphpa_has_(sphpa_mask mask, int field) { return ((mask >> field) & 1u) != 0; }

SPHPA_DEF void *sphpa_particles_data(const sphpa_particles *p, sphpa_field field, int start) {
#define SPHPA_DATA_(name, ...)                                                                     \
    case SPHPA_FIELD_##name: return start ? (void *)p->start.name : (void *)p->name;
    switch (field) {
        SPHPA_FIELDS(SPHPA_DATA_)
    case SPHPA_FIELD_COUNT:
    default: return NULL;
    }
#undef SPHPA_DATA_
}

SPHPA_PRIVATE_ void sphpa_particles_point_(sphpa_particles *p, int field, int start, void *to) {
#define SPHPA_POINT_(name, type, ...)                                                              \
    case SPHPA_FIELD_##name: *(start ? &p->start.name : &p->name) = (type *)to; break;
    switch ((sphpa_field)field) {
        SPHPA_FIELDS(SPHPA_POINT_)
    case SPHPA_FIELD_COUNT:
    default: break;
    }
#undef SPHPA_POINT_
}

/* One array among all those of a set: a field, the copy of one, or a column. */
typedef struct sphpa_array_ {
    void *data;
    size_t bytes; /* of one particle; 0: there is no such array */
} sphpa_array_;

enum { SPHPA_ARRAYS_ = 2 * (int)SPHPA_FIELD_COUNT + 2 * SPHPA_COLUMNS_MAX };

/* every loop over all arrays runs over k in [0, SPHPA_ARRAYS_) */
SPHPA_PRIVATE_ sphpa_array_ sphpa_particles_array_(const sphpa_particles *p, int k) {
    sphpa_array_ array = {NULL, 0};
    int fields = (int)SPHPA_FIELD_COUNT;
    if (k < 2 * fields) {
        int start = k >= fields, field = k - start * fields;
        if (!sphpa_has_(start ? p->start_fields : p->fields, field)) return array;
        array.data = sphpa_particles_data(p, (sphpa_field)field, start);
        array.bytes = sphpa_field_describe((sphpa_field)field).bytes;
        return array;
    }
    int start = k - 2 * fields >= SPHPA_COLUMNS_MAX;
    int index = k - 2 * fields - start * SPHPA_COLUMNS_MAX;
    if (index >= p->columns) return array;
    const sphpa_column *column = &p->column[index];
    if (start && column->role != SPHPA_ROLE_STATE) return array;
    array.data = start ? column->start : column->data;
    array.bytes = (size_t)column->components * sizeof(double);
    return array;
}

SPHPA_PRIVATE_ void sphpa_particles_set_array_(sphpa_particles *p, int k, void *to) {
    int fields = (int)SPHPA_FIELD_COUNT;
    if (k < 2 * fields) {
        sphpa_particles_point_(p, k % fields, k >= fields, to);
        return;
    }
    int index = k - 2 * fields;
    if (index < SPHPA_COLUMNS_MAX) p->column[index].data = (double *)to;
    else p->column[index - SPHPA_COLUMNS_MAX].start = (double *)to;
}

SPHPA_PRIVATE_ size_t sphpa_align_up_(size_t bytes) {
    return (bytes + SPHPA_ALIGN_ - 1) / SPHPA_ALIGN_ * SPHPA_ALIGN_;
}

/* A fresh block for `capacity` particles, filled with the old one's first n and with zeros. */
SPHPA_PRIVATE_ sphpa_result sphpa_particles_place_(sphpa_particles *p, size_t capacity,
                                                   sphpa_error *err) {
    size_t each = sphpa_particles_bytes_each(p), slack = (size_t)(SPHPA_ARRAYS_ + 1) * SPHPA_ALIGN_;
    if (each != 0 && capacity > (((size_t)-1) - slack) / each)
        return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "%zu particles of %zu bytes do not fit",
                               capacity, each);
    size_t bytes = capacity * each + slack;
    char *block = (char *)SPHPA_MALLOC(bytes);
    if (block == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MEMORY,
                               "no memory for %zu particles of %zu bytes (%.3g GB); use fewer",
                               capacity, each, (double)bytes * 1e-9);
    memset(block, 0, bytes);
    size_t skew = (size_t)((uintptr_t)block % SPHPA_ALIGN_);
    char *next = block + (skew ? SPHPA_ALIGN_ - skew : 0);
    for (int k = 0; k < SPHPA_ARRAYS_; k++) {
        sphpa_array_ array = sphpa_particles_array_(p, k);
        if (array.bytes == 0) continue;
        if (array.data != NULL) memcpy(next, array.data, p->n * array.bytes);
        sphpa_particles_set_array_(p, k, next);
        next += sphpa_align_up_(capacity * array.bytes);
    }
    SPHPA_FREE(p->block);
    p->block = block;
    p->capacity = capacity;
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_particles_columns_(sphpa_particles *p,
                                                     const sphpa_column *columns, int count,
                                                     sphpa_error *err) {
    if (count < 0 || count > SPHPA_COLUMNS_MAX)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE, "%d columns; the limit is %d", count,
                               SPHPA_COLUMNS_MAX);
    for (int k = 0; k < count; k++) {
        sphpa_column column = columns[k];
        column.data = column.start = NULL;
        column.name[sizeof column.name - 1] = '\0';
        if (column.components == 0) column.components = 1;
        if (column.components < 1 || column.components > 9 || column.name[0] == '\0')
            return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                   "column %d (\"%.40s\") has %d components; give a name and 1 "
                                   "to 9", k, column.name, columns[k].components);
        for (int field = 0; field < (int)SPHPA_FIELD_COUNT; field++) {
            sphpa_field_info info = sphpa_field_describe((sphpa_field)field);
            if (strcmp(info.name, column.name) == 0 || strcmp(info.file_name, column.name) == 0)
                return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                       "column \"%.40s\" has the name of a field; rename it",
                                       column.name);
        }
        for (int other = 0; other < k; other++)
            if (strcmp(p->column[other].name, column.name) == 0)
                return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                       "two columns are named \"%.40s\"; rename one", column.name);
        p->column[k] = column;
    }
    p->columns = count;
    return SPHPA_OK;
}

SPHPA_DEF sphpa_result sphpa_particles_create(sphpa_particles *p, int dim, size_t capacity,
                                              sphpa_mask fields, sphpa_mask start_fields,
                                              const sphpa_column *columns, int column_count,
                                              sphpa_error *err) {
    memset(p, 0, sizeof *p);
    if (dim < 1 || dim > 3)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE, "dimension %d; it must be 1, 2 or 3", dim);
    p->dim = dim;
    p->fields = fields | SPHPA_BASIC_FIELDS | start_fields;
    p->start_fields = start_fields;
    sphpa_result result = sphpa_particles_columns_(p, columns, column_count, err);
    if (result == SPHPA_OK) result = sphpa_particles_place_(p, capacity, err);
    if (result != SPHPA_OK) memset(p, 0, sizeof *p);
    return result;
}

SPHPA_DEF void sphpa_particles_free(sphpa_particles *p) {
    if (p == NULL) return;
    SPHPA_FREE(p->block);
    memset(p, 0, sizeof *p);
}

SPHPA_DEF sphpa_result sphpa_particles_reserve(sphpa_particles *p, size_t capacity,
                                               sphpa_error *err) {
    return capacity <= p->capacity ? SPHPA_OK : sphpa_particles_place_(p, capacity, err);
}

SPHPA_DEF sphpa_result sphpa_particles_add(sphpa_particles *p, size_t count, size_t *first,
                                           sphpa_error *err) {
    if (p->id == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                               "the set has no fields; call sphpa_particles_create first");
    if (count > ((size_t)-1) / 2 - p->n)
        return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "%zu particles do not fit", count);
    if (count > p->capacity - p->n) {
        size_t need = p->n + count, room = p->capacity + p->capacity / 2;
        sphpa_result result = sphpa_particles_place_(p, need > room ? need : room, err);
        if (result != SPHPA_OK) return result;
    }
    if (first != NULL) *first = p->n;
    for (int k = 0; k < SPHPA_ARRAYS_; k++) { /* where particles were removed there is old data */
        sphpa_array_ array = sphpa_particles_array_(p, k);
        if (array.bytes != 0)
            memset((char *)array.data + p->n * array.bytes, 0, count * array.bytes);
    }
    for (size_t k = 0; k < count; k++) p->id[p->n + k] = p->next_id++;
    p->n += count;
    return SPHPA_OK;
}

SPHPA_DEF sphpa_result sphpa_particles_append(sphpa_particles *to, const sphpa_particles *from,
                                              sphpa_error *err) {
    size_t first = 0;
    int64_t next_id = to->next_id;
    sphpa_result result = sphpa_particles_add(to, from->n, &first, err);
    if (result != SPHPA_OK) return result;
    for (int k = 0; k < 2 * (int)SPHPA_FIELD_COUNT; k++) {
        sphpa_array_ have = sphpa_particles_array_(from, k), want = sphpa_particles_array_(to, k);
        if (have.bytes == 0 || want.bytes == 0) continue;
        memcpy((char *)want.data + first * want.bytes, have.data, from->n * have.bytes);
    }
    for (int k = 0; k < to->columns; k++) {
        sphpa_column *column = &to->column[k];
        size_t width = (size_t)column->components;
        for (int other = 0; other < from->columns; other++) {
            const sphpa_column *have = &from->column[other];
            if (strcmp(have->name, column->name) != 0 || have->components != column->components)
                continue;
            memcpy(column->data + first * width, have->data, from->n * width * sizeof(double));
        }
    }
    to->next_id = next_id > from->next_id ? next_id : from->next_id;
    return SPHPA_OK;
}

/* memcpy and memset to 0 by all threads */
#define SPHPA_COPY_BLOCK_ ((size_t)1 << 16)
SPHPA_PRIVATE_ void sphpa_copy_(void *to, const void *from, size_t bytes) {
    size_t blocks = (bytes + SPHPA_COPY_BLOCK_ - 1) / SPHPA_COPY_BLOCK_;
    SPHPA_OMP(parallel for schedule(static) if (blocks > 16))
    for (size_t b = 0; b < blocks; b++) {
        size_t at = b * SPHPA_COPY_BLOCK_, left = bytes - at;
        memcpy((char *)to + at, (const char *)from + at,
               left < SPHPA_COPY_BLOCK_ ? left : SPHPA_COPY_BLOCK_);
    }
}

SPHPA_PRIVATE_ void sphpa_clear_(void *to, size_t bytes) {
    size_t blocks = (bytes + SPHPA_COPY_BLOCK_ - 1) / SPHPA_COPY_BLOCK_;
    SPHPA_OMP(parallel for schedule(static) if (blocks > 16))
    for (size_t b = 0; b < blocks; b++) {
        size_t at = b * SPHPA_COPY_BLOCK_, left = bytes - at;
        memset((char *)to + at, 0, left < SPHPA_COPY_BLOCK_ ? left : SPHPA_COPY_BLOCK_);
    }
}

SPHPA_FORCE_INLINE_ void sphpa_gather_body_(char *to, const char *from, const uint32_t *order,
                                            size_t n, size_t bytes) {
    SPHPA_OMP(parallel for schedule(static) if (n > 16384))
    for (size_t k = 0; k < n; k++) memcpy(to + bytes * k, from + bytes * order[k], bytes);
}

SPHPA_PRIVATE_ void sphpa_gather_(char *to, const char *from, const uint32_t *order, size_t n,
                                  size_t bytes) {
    switch (bytes) { /* the common widths as constants, so that the copy is inline */
    case 4: sphpa_gather_body_(to, from, order, n, 4); break;
    case 8: sphpa_gather_body_(to, from, order, n, 8); break;
    case 24: sphpa_gather_body_(to, from, order, n, 24); break;
    case 48: sphpa_gather_body_(to, from, order, n, 48); break;
    default: sphpa_gather_body_(to, from, order, n, bytes);
    }
}

SPHPA_DEF sphpa_result sphpa_particles_permute(sphpa_particles *p, const uint32_t *order,
                                               sphpa_error *err) {
    size_t widest = 0;
    for (int k = 0; k < SPHPA_ARRAYS_; k++) {
        sphpa_array_ array = sphpa_particles_array_(p, k);
        if (array.bytes > widest) widest = array.bytes;
    }
    char *scratch = (char *)sphpa_alloc_(p->n, widest);
    if (scratch == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "no memory to sort %zu particles", p->n);
    for (int k = 0; k < SPHPA_ARRAYS_; k++) {
        sphpa_array_ array = sphpa_particles_array_(p, k);
        if (array.bytes == 0) continue;
        sphpa_gather_(scratch, (const char *)array.data, order, p->n, array.bytes);
        sphpa_copy_(array.data, scratch, p->n * array.bytes);
    }
    SPHPA_FREE(scratch);
    return SPHPA_OK;
}

SPHPA_DEF double *sphpa_particles_column(const sphpa_particles *p, const char *name) {
    for (int k = 0; k < p->columns; k++)
        if (strcmp(p->column[k].name, name) == 0) return p->column[k].data;
    return NULL;
}

SPHPA_DEF size_t sphpa_particles_bytes_each(const sphpa_particles *p) {
    size_t bytes = 0;
    for (int k = 0; k < SPHPA_ARRAYS_; k++) bytes += sphpa_particles_array_(p, k).bytes;
    return bytes;
}

SPHPA_PRIVATE_ sphpa_result sphpa_particle_check_(const sphpa_particles *p, size_t i,
                                                  sphpa_error *err) {
    const char *name = NULL, *cure = "check the initial state or reduce the time step";
    double value = 0.0;
    sphpa_result result = SPHPA_ERROR_NOT_FINITE;
    for (int a = 0; a < 3 && name == NULL; a++) {
        if (!sphpa_finite_(p->x[3 * i + (size_t)a])) name = "x", value = p->x[3 * i + (size_t)a];
        else if (!sphpa_finite_((double)p->v[3 * i + (size_t)a]))
            name = "v", value = (double)p->v[3 * i + (size_t)a];
    }
    const double positive[3] = {(double)p->m[i], (double)p->h[i], p->rho[i]};
    static const char *const names[3] = {"m", "h", "rho"};
    for (int k = 0; k < 3 && name == NULL; k++)
        if (!(positive[k] > 0.0) || !sphpa_finite_(positive[k])) {
            name = names[k], value = positive[k], cure = "it must be positive and finite";
            if (sphpa_finite_(value)) result = SPHPA_ERROR_NEGATIVE;
        }
    if (name == NULL && !sphpa_finite_(p->u[i])) name = "u", value = p->u[i];
    if (name == NULL && p->alpha != NULL &&
        (!(p->alpha[i] >= 1.0) || !sphpa_finite_(p->alpha[i]))) {
        name = "alpha", value = p->alpha[i], cure = "the distention is finite and at least 1";
        if (sphpa_finite_(value)) result = SPHPA_ERROR_ALPHA;
    }
    if (name == NULL) return SPHPA_OK;
    return sphpa_error_set(err, result,
                           "particle %zu (id %lld) at (%.6g, %.6g, %.6g): %s = %g; %s", i,
                           (long long)p->id[i], p->x[3 * i], p->x[3 * i + 1], p->x[3 * i + 2], name,
                           value, cure);
}

SPHPA_DEF sphpa_result sphpa_particles_check(const sphpa_particles *p, sphpa_error *err) {
    for (size_t i = 0; i < p->n; i++) {
        sphpa_result result = sphpa_particle_check_(p, i, err);
        if (result != SPHPA_OK) return result;
    }
    return SPHPA_OK;
}

SPHPA_EXTERN_C_END_
#endif /* >>particles */

#if SPHPA_WANT_SPH_ && !defined(SPHPA_SPH_DONE_)
#define SPHPA_SPH_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>sph   implementation
   ============================================================================================== */

#ifdef SPHPA_FLOAT
#define SPHPA_SQRT_(x) sqrtf(x)
#define SPHPA_TINY_ 1e-37f
#define SPHPA_SHORTEST_ 1e-16f /* [m] h, for its powers in pair sums */
#define SPHPA_LONGEST_ 1e16f
#define SPHPA_SUM_ROUNDING_ 5e-7 /* what a sum over neighbours cannot tell apart */
#else
#define SPHPA_SQRT_(x) sqrt(x)
#define SPHPA_TINY_ 1e-300
#define SPHPA_SHORTEST_ 1e-50
#define SPHPA_LONGEST_ 1e50
#define SPHPA_SUM_ROUNDING_ 1e-15
#endif
#define SPHPA_BLOCK_ 256 /* particles a block: the unit of parallel loops and of sums */
#define SPHPA_FEW_ 4     /* so few blocks are done by one thread: starting more costs more */
#define SPHPA_LIGHT_ 64  /* the same, where a particle takes a few nanoseconds */
#define SPHPA_SLACK_ 1.005 /* h may grow so far before lists without skin are made again */

/* ---- lanes ----------------------------------------------------------------------------------- */

/* Pair loops put SPHPA_LANES_ particles that follow each other in the tree's order, a group, into
   the lanes of a vector and take their common list (see >>tree) one neighbour after the other:

       sphpa_lanes_ x[3], d[3], sum = sphpa_lanes_of_(0);
       sphpa_lanes_own_x_(near, x);
       for (size_t k = 0; k < near->entries; k++) {
           const my_record *j = ... records[SPHPA_TREE_ENTRY_INDEX(near->list[k])];
           sphpa_lanes_apart_(near, near->list[k], j->x, x, d);      d = x_i - x_j
           sum += j->m * something of d;                             one number against all lanes
       }

   A neighbour's numbers are read once for all lanes, nothing is gathered, and no sum crosses lanes.
   Not every lane's particle is within reach of every entry: kernels are 0 beyond their support, and
   what is no sum needs a mask. Lanes beyond `count` repeat the last particle; do not write them.
   Vectors are those of GNU C; where there are none, or with SPHPA_NO_VECTORS, a group is one
   particle. Fused multiply-adds come with -ffp-contract=fast, the default of gnu11. */
#if defined(SPHPA_NO_VECTORS) || !(defined(__GNUC__) || defined(__clang__))
#define SPHPA_VECTOR_BYTES_ 0
#elif defined(__AVX__)
#define SPHPA_VECTOR_BYTES_ 32
#elif defined(__SSE2__) || defined(__ARM_NEON) || defined(__ALTIVEC__)
#define SPHPA_VECTOR_BYTES_ 16
#else
#define SPHPA_VECTOR_BYTES_ 0
#endif

#if SPHPA_VECTOR_BYTES_ > 0
#ifdef SPHPA_FLOAT
typedef int32_t sphpa_lane_bits_;
#else
typedef int64_t sphpa_lane_bits_;
#endif
typedef sphpa_real sphpa_lanes_ __attribute__((vector_size(SPHPA_VECTOR_BYTES_)));
typedef sphpa_lane_bits_ sphpa_mask_ __attribute__((vector_size(SPHPA_VECTOR_BYTES_)));
#define SPHPA_LANES_ ((size_t)SPHPA_VECTOR_BYTES_ / sizeof(sphpa_real))
#define SPHPA_LANE_(v, l) ((v)[l])
/* a where the mask is set, else 0 */
#define SPHPA_LANES_IF_(mask, a) ((sphpa_lanes_)((sphpa_mask_)(mask) & (sphpa_mask_)(a)))
#else
typedef sphpa_real sphpa_lanes_;
typedef int sphpa_lane_bits_;
typedef int sphpa_mask_;
#define SPHPA_LANES_ ((size_t)1)
#define SPHPA_LANE_(v, l) (*((void)(l), &(v)))
#define SPHPA_LANES_IF_(mask, a) ((mask) ? (a) : SPHPA_R(0.0))
#endif

SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_lanes_of_(sphpa_real a) {
#if SPHPA_VECTOR_BYTES_ > 0
    sphpa_lanes_ zero = {0};
    return zero + a;
#else
    return a;
#endif
}

/* a where the mask is set, b elsewhere */
SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_lanes_pick_(sphpa_mask_ mask, sphpa_lanes_ a,
                                                   sphpa_lanes_ b) {
#if SPHPA_VECTOR_BYTES_ > 0
    return (sphpa_lanes_)((mask & (sphpa_mask_)a) | (~mask & (sphpa_mask_)b));
#else
    return mask ? a : b;
#endif
}

/* whether the mask is set in any lane */
SPHPA_FORCE_INLINE_ bool sphpa_lanes_any_(sphpa_mask_ mask) {
#if SPHPA_VECTOR_BYTES_ == 32 && defined(SPHPA_FLOAT)
    return __builtin_ia32_movmskps256((sphpa_lanes_)mask) != 0;
#elif SPHPA_VECTOR_BYTES_ == 32
    return __builtin_ia32_movmskpd256((sphpa_lanes_)mask) != 0;
#elif SPHPA_VECTOR_BYTES_ == 16 && defined(__SSE2__) && defined(SPHPA_FLOAT)
    return __builtin_ia32_movmskps((sphpa_lanes_)mask) != 0;
#elif SPHPA_VECTOR_BYTES_ == 16 && defined(__SSE2__)
    return __builtin_ia32_movmskpd((sphpa_lanes_)mask) != 0;
#else
    sphpa_lane_bits_ any = 0;
    for (size_t l = 0; l < SPHPA_LANES_; l++) any |= SPHPA_LANE_(mask, l);
    return any != 0;
#endif
}

/* gcc 12 makes a compare and a blend of a maximum, and takes a vector apart for a root */
#if SPHPA_VECTOR_BYTES_ == 32 && defined(__GNUC__) && !defined(__clang__)
#ifdef SPHPA_FLOAT
#define SPHPA_LANES_MAX_(a, b) __builtin_ia32_maxps256(a, b)
#define SPHPA_LANES_SQRT_(a) __builtin_ia32_sqrtps256(a)
#else
#define SPHPA_LANES_MAX_(a, b) __builtin_ia32_maxpd256(a, b)
#define SPHPA_LANES_SQRT_(a) __builtin_ia32_sqrtpd256(a)
#endif
#elif SPHPA_VECTOR_BYTES_ == 16 && defined(__SSE2__) && defined(__GNUC__) && !defined(__clang__)
#ifdef SPHPA_FLOAT
#define SPHPA_LANES_MAX_(a, b) __builtin_ia32_maxps(a, b)
#define SPHPA_LANES_SQRT_(a) __builtin_ia32_sqrtps(a)
#else
#define SPHPA_LANES_MAX_(a, b) __builtin_ia32_maxpd(a, b)
#define SPHPA_LANES_SQRT_(a) __builtin_ia32_sqrtpd(a)
#endif
#else
#define SPHPA_LANES_MAX_(a, b) sphpa_lanes_pick_((sphpa_mask_)((a) > (b)), a, b)
#define SPHPA_LANES_SQRT_(a) sphpa_lanes_sqrt_by_one_(a)
#endif

SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_lanes_sqrt_by_one_(sphpa_lanes_ a) {
    sphpa_real t[SPHPA_LANES_];
    memcpy(t, &a, sizeof a);
    for (size_t l = 0; l < SPHPA_LANES_; l++) t[l] = SPHPA_SQRT_(t[l]);
    memcpy(&a, t, sizeof a);
    return a;
}

SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_lanes_sqrt_(sphpa_lanes_ a) { return SPHPA_LANES_SQRT_(a); }

/* b where one of them is NaN */
SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_lanes_max_(sphpa_lanes_ a, sphpa_lanes_ b) {
    return SPHPA_LANES_MAX_(a, b);
}

/* max(a, 0); 0 for NaN */
SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_lanes_above_(sphpa_lanes_ a) {
    return sphpa_lanes_max_(a, sphpa_lanes_of_(SPHPA_R(0.0)));
}

/* Ahead of a wave numbers fall off to nothing, in float soon below 1e-38, where each operation on
   them costs a hundred others. Within pair loops they are 0 (x86 only; elsewhere they cost less or
   nothing). Returns what sphpa_denormals_back_ restores. */
SPHPA_PRIVATE_ unsigned sphpa_denormals_off_(void) {
#if SPHPA_VECTOR_BYTES_ > 0 && defined(__SSE2__)
    unsigned before = __builtin_ia32_stmxcsr();
    __builtin_ia32_ldmxcsr(before | 0x8040u); /* flush to zero, denormals are zero */
    return before;
#else
    return 0;
#endif
}

SPHPA_PRIVATE_ void sphpa_denormals_back_(unsigned before) {
#if SPHPA_VECTOR_BYTES_ > 0 && defined(__SSE2__)
    __builtin_ia32_ldmxcsr(before);
#else
    (void)before;
#endif
}

/* lane l's particle */
SPHPA_FORCE_INLINE_ size_t sphpa_lanes_particle_(const sphpa_group *near, size_t l) {
    return near->first + (l < near->count ? l : near->count - 1);
}

/* lanes that have a particle of their own */
SPHPA_FORCE_INLINE_ size_t sphpa_lanes_used_(const sphpa_group *near) {
    return near->count < SPHPA_LANES_ ? near->count : SPHPA_LANES_;
}

/* the group's own numbers: at(i) is the address of particle i's, `stride` bytes apart */
SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_lanes_load_(const sphpa_group *near, const void *base,
                                                   size_t stride) {
    sphpa_lanes_ a = sphpa_lanes_of_(SPHPA_R(0.0));
    for (size_t l = 0; l < SPHPA_LANES_; l++) {
        const char *at = (const char *)base + sphpa_lanes_particle_(near, l) * stride;
        SPHPA_LANE_(a, l) = *(const sphpa_real *)(const void *)at;
    }
    return a;
}

/* the group's own positions, relative to its centre; records begin with x */
SPHPA_FORCE_INLINE_ void sphpa_lanes_own_x_(const sphpa_group *near, size_t stride,
                                            sphpa_lanes_ x[3]) {
    for (int a = 0; a < 3; a++) {
        sphpa_lanes_ own = sphpa_lanes_of_(SPHPA_R(0.0));
        for (size_t l = 0; l < SPHPA_LANES_; l++) {
            const char *at = near->records + sphpa_lanes_particle_(near, l) * stride;
            const double *from = (const double *)(const void *)at;
            SPHPA_LANE_(own, l) = (sphpa_real)(from[a] - near->centre[0][a]);
        }
        x[a] = own;
    }
}

/* d = x_i - x_j of all lanes; returns r^2 */
SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_lanes_apart_(const sphpa_group *near, uint32_t entry,
                                                    const double xj[3], const sphpa_lanes_ x[3],
                                                    sphpa_lanes_ d[3]) {
    const double *centre = near->centre[SPHPA_TREE_ENTRY_IMAGE(entry)];
    for (int a = 0; a < 3; a++) d[a] = x[a] - (sphpa_real)(xj[a] - centre[a]);
    return d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
}

/* 1/r, 0 where r = 0; so small an addition is lost in any other r^2 */
SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_lanes_per_r_(sphpa_lanes_ r, sphpa_lanes_ r2) {
    return r / (r2 + SPHPA_TINY_);
}

/* w(q) and w'(q) of the kernels (see >>kernel), not normalised; 0 beyond the support. W' loses
   digits where q is small, to the last one of its largest value: there it counts for nothing. */
SPHPA_FORCE_INLINE_ void sphpa_lanes_cubic_(sphpa_lanes_ q, sphpa_lanes_ *w, sphpa_lanes_ *dw) {
    sphpa_lanes_ a = sphpa_lanes_above_(SPHPA_R(2.0) - q), b = sphpa_lanes_above_(SPHPA_R(1.0) - q);
    sphpa_lanes_ aa = a * a, bb = b * b;
    *w = SPHPA_R(0.25) * (aa * a) - bb * b;
    *dw = SPHPA_R(3.0) * bb - SPHPA_R(0.75) * aa;
}

SPHPA_PRIVATE_ void sphpa_lanes_quartic_(sphpa_lanes_ q, sphpa_lanes_ *w, sphpa_lanes_ *dw) {
    sphpa_lanes_ a = sphpa_lanes_above_(SPHPA_R(2.5) - q), b = sphpa_lanes_above_(SPHPA_R(1.5) - q);
    sphpa_lanes_ c = sphpa_lanes_above_(SPHPA_R(0.5) - q), aa = a * a, bb = b * b, cc = c * c;
    *w = aa * aa - SPHPA_R(5.0) * (bb * bb) + SPHPA_R(10.0) * (cc * cc);
    *dw = SPHPA_R(20.0) * (bb * b) - SPHPA_R(4.0) * (aa * a) - SPHPA_R(40.0) * (cc * c);
}

SPHPA_PRIVATE_ void sphpa_lanes_quintic_(sphpa_lanes_ q, sphpa_lanes_ *w, sphpa_lanes_ *dw) {
    sphpa_lanes_ a = sphpa_lanes_above_(SPHPA_R(3.0) - q), b = sphpa_lanes_above_(SPHPA_R(2.0) - q);
    sphpa_lanes_ c = sphpa_lanes_above_(SPHPA_R(1.0) - q);
    sphpa_lanes_ a4 = (a * a) * (a * a), b4 = (b * b) * (b * b), c4 = (c * c) * (c * c);
    *w = a4 * a - SPHPA_R(6.0) * (b4 * b) + SPHPA_R(15.0) * (c4 * c);
    *dw = SPHPA_R(30.0) * b4 - SPHPA_R(5.0) * a4 - SPHPA_R(75.0) * c4;
}

/* Wendland's: t = (1 - q/2)+ to some power times a polynomial of m = min(q, 2), which stays bounded;
   order 2, 4, 6: C2, C4, C6 in 2-D and 3-D; 12, 14, 16: those of 1-D */
SPHPA_PRIVATE_ void sphpa_lanes_wendland_(int order, sphpa_lanes_ q, sphpa_lanes_ *w,
                                          sphpa_lanes_ *dw) {
    sphpa_lanes_ one = sphpa_lanes_of_(SPHPA_R(1.0)), t = sphpa_lanes_above_(one - q * SPHPA_R(0.5));
    sphpa_lanes_ m = SPHPA_R(2.0) - SPHPA_R(2.0) * t, tt = t * t, t4 = tt * tt;
    switch (order) {
    case 2:
        *w = t4 * (one + SPHPA_R(2.0) * m);
        *dw = SPHPA_R(-5.0) * q * (tt * t);
        break;
    case 4:
        *w = t4 * tt * (one + m * (SPHPA_R(3.0) + SPHPA_R(35.0 / 12.0) * m));
        *dw = -q * (t4 * t) * (SPHPA_R(14.0 / 3.0) + SPHPA_R(35.0 / 3.0) * m);
        break;
    case 6:
        *w = t4 * t4 * (one + m * (SPHPA_R(4.0) + m * (SPHPA_R(6.25) + SPHPA_R(4.0) * m)));
        *dw = -q * (t4 * tt * t) * (SPHPA_R(5.5) + m * (SPHPA_R(19.25) + SPHPA_R(22.0) * m));
        break;
    case 12:
        *w = tt * t * (one + SPHPA_R(1.5) * m);
        *dw = SPHPA_R(-3.0) * q * tt;
        break;
    case 14:
        *w = t4 * t * (one + m * (SPHPA_R(2.5) + SPHPA_R(2.0) * m));
        *dw = -q * t4 * (SPHPA_R(3.5) + SPHPA_R(7.0) * m);
        break;
    default:
        *w = t4 * tt * t * (one + m * (SPHPA_R(3.5) + m * (SPHPA_R(4.75) + SPHPA_R(2.625) * m)));
        *dw = -q * (t4 * tt) * (SPHPA_R(4.5) + m * (SPHPA_R(13.5) + SPHPA_R(13.125) * m));
        break;
    }
}

SPHPA_PRIVATE_ void sphpa_lanes_gaussian_(sphpa_lanes_ q, sphpa_lanes_ *w, sphpa_lanes_ *dw) {
    sphpa_lanes_ f = q;
    for (size_t l = 0; l < SPHPA_LANES_; l++) {
        double at = (double)SPHPA_LANE_(q, l);
        SPHPA_LANE_(f, l) = (sphpa_real)(at < 3.0 ? sphpa_exp_(-(at * at)) : 0.0);
    }
    *w = f;
    *dw = SPHPA_R(-2.0) * q * f;
}

/* all but the cubic spline, by the numbers of SPHPA_KERNEL_SHAPES_ */
SPHPA_NO_INLINE_ void sphpa_lanes_shape_(int shape, const sphpa_lanes_ *q, sphpa_lanes_ *w,
                                         sphpa_lanes_ *dw) {
    static const int order[10] = {0, 0, 0, 2, 4, 6, 0, 12, 14, 16};
    if (shape == 1) sphpa_lanes_quartic_(*q, w, dw);
    else if (shape == 2) sphpa_lanes_quintic_(*q, w, dw);
    else if (shape == 6) sphpa_lanes_gaussian_(*q, w, dw);
    else sphpa_lanes_wendland_(order[shape], *q, w, dw);
}

/* shape 0 is the cubic spline: let the compiler know it where it counts */
SPHPA_FORCE_INLINE_ void sphpa_lanes_kernel_(int shape, sphpa_lanes_ q, sphpa_lanes_ *w,
                                             sphpa_lanes_ *dw) {
    if (shape == 0) sphpa_lanes_cubic_(q, w, dw);
    else sphpa_lanes_shape_(shape, &q, w, dw);
}

/* what a group's loop knows of the kernel: W = norm w(q)/h^dim, dW/dr = norm w'(q)/h^(dim+1) */
typedef struct sphpa_shape_ {
    int shape, dim;
    double norm;
} sphpa_shape_;

SPHPA_PRIVATE_ sphpa_shape_ sphpa_shape_of_(const sphpa_sim *sim) {
    sphpa_shape_ shape;
    shape.dim = sim->p.dim;
    shape.shape = sphpa_kernel_shape_(sim->options.kernel, shape.dim);
    shape.norm = sphpa_kernel_norm_(sim->options.kernel, shape.dim);
    return shape;
}

/* Arrays of one thread for the neighbours of one particle. */
typedef struct sphpa_pair_buffer_ {
    size_t capacity;
    double *numbers; /* dx dy dz r h and four of scratch, each of capacity */
    uint32_t *j;
    uint64_t pairs, targets; /* statistics of one traversal */
    char apart[64];          /* keeps two threads' buffers on different cache lines */
} sphpa_pair_buffer_;

/* The lists without their skin, as they are made by one traversal for all that follow until
   positions change or an h outgrows them. */
typedef struct sphpa_narrow_ {
    bool hold;             /* made for these positions */
    uint32_t *list;        /* (capacity) chunk after chunk, each with room for its whole lists */
    uint32_t *first, *count; /* (groups) where a list begins in its chunk's; its length, as the
                                index of an entry whose image is that of the last listed one */
    size_t *chunk;         /* (chunks) where a chunk's lists begin */
    size_t capacity, first_capacity, count_capacity, chunk_capacity;
} sphpa_narrow_;

struct sphpa_work {
    double flow_x[3], flow_v[3], flow_H; /* [m] [m/s] [1/s] see sphpa_sim_flow_ */
    int threads;
    sphpa_pair_buffer_ *buffer; /* (threads) */
    size_t longest;             /* most neighbours in a list */
    double *point;              /* (n,4) x y z h, as the traversal found them that laid them out */
    sphpa_narrow_ narrow;
    double shift[SPHPA_TREE_IMAGES][3]; /* [m] of the images */
    double *support;            /* (n) for the tree */
    double moved_max;           /* [m] farthest that a particle moved since the lists were built */
    bool lists_valid, moved; /* moved: moved_max is of other positions */
    bool unsure;             /* a pass wrote x or h since it was asked whether the lists hold */
    int set_up;         /* modules whose setup was called */
    char *records;      /* packed records of the passes that share a traversal */
    size_t records_bytes;
    const sphpa_pass *packed; /* whose records come first there; NULL: of other positions */
    const void *packed_params;
    sphpa_mask touched; /* fields that passes wrote since */
    char *kept;         /* what the next step predicts with, while a refresh shows other values */
    size_t kept_bytes, kept_n; /* kept_n: particles; 0: nothing is kept */
    double *block_sum;  /* (blocks, 12) partial sums and minima */
    size_t *block_bad;  /* (blocks) particle that failed */
    unsigned char *block_result;
    size_t n_capacity, block_capacity;
};

SPHPA_PRIVATE_ size_t sphpa_blocks_(size_t n) { return (n + SPHPA_BLOCK_ - 1) / SPHPA_BLOCK_; }

SPHPA_PRIVATE_ size_t sphpa_block_end_(size_t block, size_t n) {
    size_t end = (block + 1) * SPHPA_BLOCK_;
    return end < n ? end : n;
}

/* ---- scenes ---------------------------------------------------------------------------------- */

SPHPA_DEF sphpa_result sphpa_scene_add(sphpa_scene *scene, sphpa_module module) {
    const char *why = NULL;
    if (module.name == NULL) why = "it has no name";
    else if (scene->modules >= SPHPA_SCENE_MODULES) why = "the scene is full; drop a module";
    else if (module.passes < 0 || module.passes > SPHPA_MODULE_PASSES)
        why = "its number of passes is out of range; split the module in two";
    else if (module.columns < 0 || module.columns > SPHPA_MODULE_COLUMNS)
        why = "its number of columns is out of range; split the module in two";
    for (int k = 0; why == NULL && k < scene->modules; k++)
        if (strcmp(scene->module[k].name, module.name) == 0)
            why = "the scene has one of that name; add it once, or give it another name";
    if (why == NULL) {
        scene->module[scene->modules++] = module;
        return SPHPA_OK;
    }
    sphpa_error *err = scene->error.result == SPHPA_OK ? &scene->error : NULL;
    return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                           "module \"%.40s\" (%d passes, %d columns): %s",
                           module.name != NULL ? module.name : "(null)", module.passes,
                           module.columns, why);
}

/* how many passes replace the one of that name */
SPHPA_PRIVATE_ int sphpa_pass_replaced_(const sphpa_scene *scene, const char *name) {
    int count = 0;
    for (int m = 0; m < scene->modules; m++)
        for (int k = 0; k < scene->module[m].passes; k++) {
            const char *replaces = scene->module[m].pass[k].replaces;
            if (replaces != NULL && strcmp(replaces, name) == 0) count++;
        }
    return count;
}

SPHPA_PRIVATE_ sphpa_result sphpa_pass_check_(const sphpa_sim *sim, const sphpa_pass *pass,
                                              sphpa_error *err) {
    if (pass->name == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE, "a pass has no name; give it one");
    bool function = (pass->kind == SPHPA_PASS_PARTICLE && pass->particle != NULL) ||
                    (pass->kind == SPHPA_PASS_PAIR &&
                     (pass->pair != NULL) != (pass->group != NULL)) ||
                    (pass->kind == SPHPA_PASS_REDUCE && pass->limit != NULL);
    bool limits = pass->kind == SPHPA_PASS_REDUCE, at_limit = pass->stage == SPHPA_STAGE_LIMIT;
    bool resizes = pass->stage == SPHPA_STAGE_RESIZE && pass->kind != SPHPA_PASS_PARTICLE;
    bool commits = pass->at_commit && ((int)pass->stage < (int)SPHPA_STAGE_GRADIENTS ||
                                       (int)pass->stage > (int)SPHPA_STAGE_DAMAGE);
    if (!function || limits != at_limit || resizes || commits || (int)pass->stage < 0 ||
        pass->stage >= SPHPA_STAGE_COUNT || (pass->record_bytes > 0) != (pass->pack != NULL))
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "pass \"%s\": its kind (%d), stage (%d) and functions do not go "
                               "together; see sphpa_pass",
                               pass->name, (int)pass->kind, (int)pass->stage);
    if (pass->replaces != NULL && strcmp(pass->replaces, pass->name) == 0)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "pass \"%s\" replaces itself; give it another name",
                               pass->name);
    if (sphpa_pass_replaced_(&sim->scene, pass->name) > 1)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "pass \"%s\" is replaced by two passes; remove one of their modules",
                               pass->name);
    for (int k = 0; k < sim->passes; k++)
        if (strcmp(sim->pass[k]->name, pass->name) == 0)
            return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                   "two passes are named \"%s\"; rename one", pass->name);
    if (sim->passes >= SPHPA_SCENE_PASSES)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE, "more than %d passes", SPHPA_SCENE_PASSES);
    return SPHPA_OK;
}

/* the pass of that name, or the one that replaces it; NULL if there is none */
SPHPA_PRIVATE_ const sphpa_pass *sphpa_pass_find_(const sphpa_scene *scene, const char *name,
                                                  bool replacing, void **params) {
    for (int m = 0; m < scene->modules; m++)
        for (int k = 0; k < scene->module[m].passes; k++) {
            const sphpa_pass *pass = &scene->module[m].pass[k];
            const char *has = replacing ? pass->replaces : pass->name;
            if (has == NULL || strcmp(has, name) != 0) continue;
            *params = scene->module[m].params;
            return pass;
        }
    return NULL;
}

/* whether a pass comes back to itself by what it replaces, what that replaces, and so on */
SPHPA_PRIVATE_ bool sphpa_pass_circular_(const sphpa_scene *scene, const sphpa_pass *pass) {
    const sphpa_pass *next = pass;
    void *params = NULL;
    for (int chain = 0; chain < SPHPA_SCENE_PASSES && next->replaces != NULL; chain++) {
        next = sphpa_pass_find_(scene, next->replaces, false, &params);
        if (next == NULL) return false;
        if (next == pass) return chain > 0; /* itself alone: another mistake */
    }
    return false;
}

/* puts a pass, or what replaces it, at the end; one that replaces another of its stage waits for
   that one's place, so that the order of adding does not matter */
SPHPA_PRIVATE_ sphpa_result sphpa_sim_place_pass_(sphpa_sim *sim, const sphpa_pass *pass,
                                                  void *params, sphpa_error *err) {
    const sphpa_scene *scene = &sim->scene;
    void *other_params = NULL;
    const sphpa_pass *other = NULL;
    if (pass->name != NULL && sphpa_pass_circular_(scene, pass))
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "pass \"%s\" replaces \"%s\" and is replaced by it in turn; remove "
                               "one of their modules", pass->name, pass->replaces);
    if (pass->replaces != NULL)
        other = sphpa_pass_find_(scene, pass->replaces, false, &other_params);
    if (other != NULL && other != pass && other->stage == pass->stage) return SPHPA_OK;
    sphpa_result result = sphpa_pass_check_(sim, pass, err);
    if (result != SPHPA_OK) return result;
    for (int chain = 0; chain < SPHPA_SCENE_PASSES; chain++) {
        other = sphpa_pass_find_(scene, pass->name, true, &other_params);
        if (other == NULL) break;
        if (other->stage != pass->stage) return SPHPA_OK;
        result = sphpa_pass_check_(sim, other, err);
        if (result != SPHPA_OK) return result;
        pass = other;
        params = other_params;
    }
    sim->pass_params[sim->passes] = params;
    sim->pass[sim->passes++] = pass;
    return SPHPA_OK;
}

/* orders the passes by stage; those of one stage stay in the order of adding */
SPHPA_PRIVATE_ sphpa_result sphpa_sim_order_passes_(sphpa_sim *sim, sphpa_error *err) {
    sim->passes = 0;
    for (int stage = 0; stage < (int)SPHPA_STAGE_COUNT; stage++)
        for (int m = 0; m < sim->scene.modules; m++) {
            const sphpa_module *module = &sim->scene.module[m];
            for (int k = 0; k < module->passes; k++) {
                const sphpa_pass *pass = &module->pass[k];
                if ((int)pass->stage != stage && (int)pass->stage >= 0 &&
                    pass->stage < SPHPA_STAGE_COUNT)
                    continue;
                sphpa_result result = sphpa_sim_place_pass_(sim, pass, module->params, err);
                if (result != SPHPA_OK) return result;
            }
        }
    return SPHPA_OK;
}

/* ---- memory of the traversals ---------------------------------------------------------------- */

SPHPA_PRIVATE_ int sphpa_threads_(void) {
#ifdef _OPENMP
    return omp_get_max_threads();
#else
    return 1;
#endif
}

SPHPA_PRIVATE_ int sphpa_thread_(void) {
#ifdef _OPENMP
    return omp_get_thread_num();
#else
    return 0;
#endif
}

/* every thread's buffer holds the longest list; between builds of the lists nothing grows */
SPHPA_PRIVATE_ bool sphpa_work_buffers_(struct sphpa_work *work, size_t longest) {
    work->longest = longest;
    for (int t = 0; t < work->threads; t++) {
        sphpa_pair_buffer_ *buffer = &work->buffer[t];
        if (longest <= buffer->capacity) continue;
        size_t room = (longest + longest / 4 + 23) / 8 * 8;
        double *numbers = (double *)sphpa_alloc_(room, 9 * sizeof(double));
        uint32_t *j = (uint32_t *)sphpa_alloc_(room, sizeof(uint32_t));
        if (numbers == NULL || j == NULL) {
            SPHPA_FREE(numbers);
            SPHPA_FREE(j);
            return false;
        }
        SPHPA_FREE(buffer->numbers);
        SPHPA_FREE(buffer->j);
        buffer->numbers = numbers;
        buffer->j = j;
        buffer->capacity = room;
    }
    return true;
}

SPHPA_PRIVATE_ bool sphpa_work_reserve_(struct sphpa_work *work, size_t n) {
    size_t blocks = sphpa_blocks_(n);
    if (n > work->n_capacity) {
        size_t point = work->n_capacity, support = work->n_capacity;
        if (!sphpa_grow_((void **)&work->point, &point, n, 4 * sizeof(double))) return false;
        if (!sphpa_grow_((void **)&work->support, &support, n, sizeof(double))) return false;
        work->n_capacity = point < support ? point : support;
    }
    if (blocks > work->block_capacity) {
        size_t a = work->block_capacity, b = a, c = a;
        if (!sphpa_grow_((void **)&work->block_sum, &a, blocks, 12 * sizeof(double))) return false;
        if (!sphpa_grow_((void **)&work->block_bad, &b, blocks, sizeof(size_t))) return false;
        if (!sphpa_grow_((void **)&work->block_result, &c, blocks, 1)) return false;
        work->block_capacity = blocks;
    }
    int threads = sphpa_threads_();
    if (threads > work->threads) {
        size_t bytes = (size_t)threads * sizeof(sphpa_pair_buffer_);
        sphpa_pair_buffer_ *grown = (sphpa_pair_buffer_ *)SPHPA_REALLOC(work->buffer, bytes);
        if (grown == NULL) return false;
        work->buffer = grown;
        memset(grown + work->threads, 0,
               (size_t)(threads - work->threads) * sizeof(sphpa_pair_buffer_));
        work->threads = threads;
    }
    return sphpa_work_buffers_(work, work->longest); /* also of threads that are new */
}

/* room for the lists without their skin */
SPHPA_PRIVATE_ bool sphpa_narrow_reserve_(sphpa_narrow_ *narrow, const sphpa_tree_lists *lists) {
    narrow->hold = false;
    if (lists->entries > narrow->capacity) { /* what it holds need not be kept */
        SPHPA_FREE(narrow->list);
        narrow->list = NULL;
        narrow->capacity = 0;
    }
    if (!sphpa_grow_((void **)&narrow->list, &narrow->capacity, lists->entries, sizeof(uint32_t)) ||
        !sphpa_grow_((void **)&narrow->first, &narrow->first_capacity, lists->groups,
                     sizeof(uint32_t)) ||
        !sphpa_grow_((void **)&narrow->count, &narrow->count_capacity, lists->groups,
                     sizeof(uint32_t)) ||
        !sphpa_grow_((void **)&narrow->chunk, &narrow->chunk_capacity, lists->chunk_count,
                     sizeof(size_t)))
        return false;
    size_t at = 0;
    for (size_t c = 0; c < lists->chunk_count; at += lists->chunks[c++].used)
        narrow->chunk[c] = at;
    return true;
}

SPHPA_PRIVATE_ void sphpa_work_free_(struct sphpa_work *work) {
    if (work == NULL) return;
    for (int t = 0; t < work->threads; t++) {
        SPHPA_FREE(work->buffer[t].numbers);
        SPHPA_FREE(work->buffer[t].j);
    }
    SPHPA_FREE(work->buffer);
    SPHPA_FREE(work->narrow.list);
    SPHPA_FREE(work->narrow.first);
    SPHPA_FREE(work->narrow.count);
    SPHPA_FREE(work->narrow.chunk);
    SPHPA_FREE(work->point);
    SPHPA_FREE(work->support);
    SPHPA_FREE(work->records);
    SPHPA_FREE(work->kept);
    SPHPA_FREE(work->block_sum);
    SPHPA_FREE(work->block_bad);
    SPHPA_FREE(work->block_result);
    SPHPA_FREE(work);
}

SPHPA_PRIVATE_ void sphpa_sim_time_(sphpa_sim *sim, int slot, double since) {
    sim->stats.timing[slot].seconds += sphpa_wall_clock() - since;
    sim->stats.timing[slot].calls++;
}

/* ---- states that went bad -------------------------------------------------------------------- */

/* "particle 12 (id 7): ... and its fields" */
SPHPA_PRIVATE_ sphpa_result sphpa_sim_bad_(const sphpa_sim *sim, size_t i, const char *where,
                                           sphpa_result why, sphpa_error *err) {
    const sphpa_particles *p = &sim->p;
    return sphpa_error_set(
        err, SPHPA_ERROR_STATE,
        "%s: %s at t = %.6e s, step %llu, dt = %.3e s: particle %zu (id %lld) at (%.6g, %.6g, "
        "%.6g), v (%.4g, %.4g, %.4g), rho = %.6g, u = %.6g, h = %.4g, P = %.4g, alpha = %.9g; %s",
        where, sphpa_result_message(why), sim->time, (unsigned long long)sim->stats.steps, sim->dt,
        i, (long long)p->id[i], p->x[3 * i], p->x[3 * i + 1], p->x[3 * i + 2],
        (double)p->v[3 * i], (double)p->v[3 * i + 1], (double)p->v[3 * i + 2], p->rho[i], p->u[i],
        (double)p->h[i], p->P ? (double)p->P[i] : 0.0, p->alpha ? p->alpha[i] : 1.0,
        why == SPHPA_ERROR_NOT_CONVERGED
            ? sphpa_result_hint(why)
            : "try a smaller cfl, from the last checkpoint where there is one");
}

/* the first particle whose state makes no sense, or n */
SPHPA_PRIVATE_ size_t sphpa_sim_first_bad_(const sphpa_sim *sim) {
    struct sphpa_work *work = sim->work;
    long blocks = (long)sphpa_blocks_(sim->p.n);
    SPHPA_OMP(parallel for schedule(static) if (blocks > SPHPA_LIGHT_))
    for (long block = 0; block < blocks; block++) {
        size_t i = (size_t)block * SPHPA_BLOCK_, end = sphpa_block_end_((size_t)block, sim->p.n);
        while (i < end && sphpa_particle_check_(&sim->p, i, NULL) == SPHPA_OK) i++;
        work->block_bad[block] = i < end ? i : sim->p.n;
    }
    for (long block = 0; block < blocks; block++)
        if (work->block_bad[block] < sim->p.n) return work->block_bad[block];
    return sim->p.n;
}

/* OK, or ERROR_STATE with what is wrong with that particle and its fields */
SPHPA_PRIVATE_ sphpa_result sphpa_sim_check_(const sphpa_sim *sim, const char *where,
                                             sphpa_error *err) {
    size_t bad = sphpa_sim_first_bad_(sim);
    if (bad == sim->p.n) return SPHPA_OK;
    return sphpa_sim_bad_(sim, bad, where, sphpa_particle_check_(&sim->p, bad, NULL), err);
}

/* ---- neighbours ------------------------------------------------------------------------------ */

/* [m] how far a particle is from where it was when the lists were built */
SPHPA_PRIVATE_ double sphpa_sim_moved_(const sphpa_sim *sim, size_t i) {
    double sum = 0.0;
    for (int a = 0; a < sim->p.dim; a++) {
        double dx = sim->p.x[3 * i + (size_t)a] - sim->tree.pos[4 * i + (size_t)a];
        dx = sphpa_tree_dx_(&sim->tree.box, a, dx);
        sum += dx * dx;
    }
    return sqrt(sum);
}

/* [m] everything closer than this to particle i is in its list (see >>tree, equation 3) */
SPHPA_PRIVATE_ double sphpa_sim_reach_(const sphpa_sim *sim, size_t i) {
    return (1.0 + sim->lists.skin) * sim->tree.pos[4 * i + 3] - sphpa_sim_moved_(sim, i) -
           sim->work->moved_max;
}

/* moved_max */
SPHPA_PRIVATE_ void sphpa_sim_movement_(sphpa_sim *sim) {
    struct sphpa_work *work = sim->work;
    long blocks = (long)sphpa_blocks_(sim->p.n);
    SPHPA_OMP(parallel for schedule(static) if (blocks > SPHPA_LIGHT_))
    for (long block = 0; block < blocks; block++) {
        double most = 0.0;
        size_t end = sphpa_block_end_((size_t)block, sim->p.n);
        for (size_t i = (size_t)block * SPHPA_BLOCK_; i < end; i++)
            most = sphpa_max_(most, sphpa_sim_moved_(sim, i));
        work->block_sum[block] = most;
    }
    work->moved_max = 0.0;
    for (long block = 0; block < blocks; block++)
        work->moved_max = sphpa_max_(work->moved_max, work->block_sum[block]);
}

/* whether the lists still hold every pair within the supports */
SPHPA_PRIVATE_ bool sphpa_sim_lists_hold_(sphpa_sim *sim) {
    struct sphpa_work *work = sim->work;
    if (!work->lists_valid) return false;
    if (work->moved) sphpa_sim_movement_(sim);
    work->moved = work->unsure = false;
    long blocks = (long)sphpa_blocks_(sim->p.n);
    double support = sphpa_kernel_support(sim->options.kernel);
    SPHPA_OMP(parallel for schedule(static) if (blocks > SPHPA_LIGHT_))
    for (long block = 0; block < blocks; block++) {
        bool hold = true;
        size_t end = sphpa_block_end_((size_t)block, sim->p.n);
        for (size_t i = (size_t)block * SPHPA_BLOCK_; i < end; i++)
            hold = hold && support * (double)sim->p.h[i] <= sphpa_sim_reach_(sim, i);
        work->block_result[block] = hold ? 1 : 0;
    }
    for (long block = 0; block < blocks; block++)
        if (!work->block_result[block]) return false;
    return true;
}

/* the group that begins with particle `first`, with its listed neighbours */
SPHPA_FORCE_INLINE_ void sphpa_group_at_(const sphpa_sim *sim, size_t first, sphpa_group *group) {
    uint32_t count = 0;
    size_t left = sim->lists.n - first;
    group->first = first;
    group->count = left < SPHPA_LANES_ ? left : SPHPA_LANES_;
    group->list = group->far = sphpa_tree_list_of_(&sim->lists, first / SPHPA_LANES_, &count);
    group->entries = group->far_entries = count;
}

/* x [m]: where its first particle is; last: the last entry of its list, whose images come in order */
SPHPA_FORCE_INLINE_ void sphpa_group_centre_(const sphpa_sim *sim, const double x[3], uint32_t last,
                                             double centre[SPHPA_TREE_IMAGES][3],
                                             sphpa_group *group) {
    for (uint32_t image = 0; image <= SPHPA_TREE_ENTRY_IMAGE(last); image++)
        for (int a = 0; a < 3; a++) centre[image][a] = x[a] - sim->work->shift[image][a];
    group->centre = (const double (*)[3])centre;
}

/* pairs of one chunk of new lists that are within the supports */
SPHPA_PRIVATE_ double sphpa_count_chunk_(const sphpa_sim *sim, size_t chunk) {
    double centre[SPHPA_TREE_IMAGES][3], sum = 0.0;
    size_t end = (chunk + 1) * SPHPA_TREE_CHUNK, stride = 4 * sizeof(double);
    if (end > sim->lists.n) end = sim->lists.n;
    for (size_t i = chunk * SPHPA_TREE_CHUNK; i < end; i += SPHPA_LANES_) {
        sphpa_group near;
        sphpa_lanes_ x[3], d[3], count = sphpa_lanes_of_(SPHPA_R(0.0)), own = count;
        sphpa_group_at_(sim, i, &near);
        sphpa_group_centre_(sim, sim->tree.pos + 4 * i, near.far[near.far_entries - 1], centre,
                            &near);
        near.records = (const char *)sim->tree.pos;
        sphpa_lanes_own_x_(&near, stride, x);
        for (size_t l = 0; l < SPHPA_LANES_; l++)
            SPHPA_LANE_(own, l) =
                (sphpa_real)sim->tree.pos[4 * sphpa_lanes_particle_(&near, l) + 3];
        for (size_t k = 0; k < near.entries; k++) {
            const double *xj = sim->tree.pos + 4 * (size_t)SPHPA_TREE_ENTRY_INDEX(near.list[k]);
            sphpa_lanes_ r2 = sphpa_lanes_apart_(&near, near.list[k], xj, x, d);
            sphpa_lanes_ s = sphpa_lanes_max_(own, sphpa_lanes_of_((sphpa_real)xj[3]));
            count += SPHPA_LANES_IF_(r2 < s * s, sphpa_lanes_of_(SPHPA_R(1.0)));
        }
        for (size_t l = 0; l < near.count; l++) sum += (double)SPHPA_LANE_(count, l) - 1.0;
    }
    return sum;
}

/* neighbours_mean of new lists */
SPHPA_PRIVATE_ void sphpa_sim_count_(sphpa_sim *sim) {
    long chunks = (long)sim->lists.chunk_count;
    double sum = 0.0;
    SPHPA_OMP(parallel for schedule(dynamic, 1) if (chunks > 2))
    for (long c = 0; c < chunks; c++)
        sim->work->block_sum[c] = sphpa_count_chunk_(sim, (size_t)c); /* fewer than blocks */
    for (long c = 0; c < chunks; c++) sum += sim->work->block_sum[c];
    sim->stats.neighbours_mean = sum / (double)sim->p.n;
}

SPHPA_PRIVATE_ sphpa_result sphpa_sim_build_tree_(sphpa_sim *sim, sphpa_error *err) {
    double start = sphpa_wall_clock(), support = sphpa_kernel_support(sim->options.kernel);
    struct sphpa_work *work = sim->work;
    if (!sphpa_work_reserve_(work, sim->p.n))
        return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "no memory for the neighbours of %zu "
                               "particles", sim->p.n);
    for (size_t i = 0; i < sim->p.n; i++) work->support[i] = support * (double)sim->p.h[i];
    const sphpa_box *box = &sim->options.box;
    bool periodic = box->periodic[0] || box->periodic[1] || box->periodic[2];
    work->lists_valid = false;
    sphpa_result result = sphpa_tree_build(&sim->tree, sim->p.dim, sim->p.n, sim->p.x,
                                           work->support, periodic ? box : NULL, err);
    sphpa_sim_time_(sim, SPHPA_TIME_TREE_BUILD, start);
    return result;
}

/* [1] the skin that is asked for, or what a periodic box has room for */
SPHPA_PRIVATE_ double sphpa_sim_skin_(const sphpa_sim *sim) {
    const sphpa_box *box = &sim->tree.box;
    double skin = sim->options.skin;
    for (int a = 0; a < sim->p.dim; a++) {
        double half = 0.5 * (box->high[a] - box->low[a]) * (1.0 - 1e-12);
        if (box->periodic[a]) skin = sphpa_min_(skin, half / sim->tree.nodes[0].support - 1.0);
    }
    return sphpa_max_(skin, 0.0);
}

/* why there is no tree or are no lists, in the words of a simulation */
SPHPA_PRIVATE_ sphpa_result sphpa_sim_unlisted_(const sphpa_sim *sim, sphpa_result result,
                                                sphpa_error *err) {
    size_t who = 0;
    if (result != SPHPA_ERROR_RANGE || sim->p.n > (size_t)1 << SPHPA_TREE_ENTRY_BITS) return result;
    for (size_t i = 0; i < sim->p.n; i++)
        if (sim->p.h[i] > sim->p.h[who]) who = i;
    return sphpa_sim_bad_(sim, who, "the support of this particle reaches over half the periodic "
                          "box (bound h by h_max, or take more particles or a longer box)",
                          SPHPA_ERROR_STATE, err);
}

/* tree, particles in its order, and lists */
SPHPA_PRIVATE_ sphpa_result sphpa_sim_rebuild_(sphpa_sim *sim, sphpa_error *err) {
    sphpa_result result = sphpa_sim_build_tree_(sim, err);
    if (result != SPHPA_OK) return sphpa_sim_unlisted_(sim, result, err);
    double start = sphpa_wall_clock();
    bool sorted = true;
    for (size_t k = 0; k < sim->p.n && sorted; k++) sorted = sim->tree.order[k] == k;
    if (!sorted) result = sphpa_particles_permute(&sim->p, sim->tree.order, err);
    if (result != SPHPA_OK) return result;
    sphpa_sim_time_(sim, SPHPA_TIME_TREE_SORT, start);
    start = sphpa_wall_clock();
    result = sphpa_tree_lists_build(&sim->tree, sphpa_sim_skin_(sim), SPHPA_LANES_, &sim->lists,
                                    err);
    if (result != SPHPA_OK) return sphpa_sim_unlisted_(sim, result, err);
    size_t longest = 0;
    for (size_t g = 0; g < sim->lists.groups; g++)
        if (sim->lists.count[g] > longest) longest = sim->lists.count[g];
    if (!sphpa_work_buffers_(sim->work, longest) ||
        !sphpa_narrow_reserve_(&sim->work->narrow, &sim->lists))
        return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "no memory for %zu neighbours", longest);
    for (uint32_t image = 0; image < SPHPA_TREE_IMAGES; image++)
        sphpa_tree_image_shift(&sim->tree.box, image, sim->work->shift[image]);
    sphpa_sim_count_(sim);
    sim->work->lists_valid = true;
    sim->work->moved_max = 0.0;
    sim->stats.rebuilds++;
    sphpa_sim_time_(sim, SPHPA_TIME_LISTS, start);
    return SPHPA_OK;
}

/* positions into the periodic box, however many boxes away (NaN stays, for the check to find) */
SPHPA_PRIVATE_ void sphpa_sim_wrap_(sphpa_sim *sim) {
    const sphpa_box *box = &sim->options.box;
    for (int a = 0; a < sim->p.dim; a++) {
        if (!box->periodic[a]) continue;
        double low = box->low[a], high = box->high[a], length = high - low;
        long n = (long)sim->p.n;
        SPHPA_OMP(parallel for schedule(static) if (n > SPHPA_LIGHT_ * SPHPA_BLOCK_))
        for (long i = 0; i < n; i++) {
            double *x = &sim->p.x[3 * i + a];
            if (*x >= low && *x <= high) continue;
            *x = sphpa_clamp_(*x - length * floor((*x - low) / length), low, high);
        }
    }
}

SPHPA_PRIVATE_ bool sphpa_sim_inside_(const sphpa_sim *sim, size_t i) {
    const sphpa_box *box = &sim->options.box;
    for (int a = 0; a < sim->p.dim; a++) {
        double x = sim->p.x[3 * i + (size_t)a];
        if (box->periodic[a] && !(x >= box->low[a] && x <= box->high[a])) return false;
    }
    return true;
}

SPHPA_PRIVATE_ sphpa_result sphpa_sim_neighbours_(sphpa_sim *sim, sphpa_error *err) {
    double since = sphpa_wall_clock();
    sim->work->moved = true;
    sim->work->narrow.hold = false;
    sim->work->packed = NULL;
    bool hold = sphpa_sim_lists_hold_(sim);
    sim->stats.timing[SPHPA_TIME_LISTS].seconds += sphpa_wall_clock() - since;
    if (hold) return SPHPA_OK;
    sphpa_result result = sphpa_sim_rebuild_(sim, err);
    if (result == SPHPA_OK || !sim->started) return result;
    sphpa_result state = sphpa_sim_check_(sim, "neighbours", err); /* whose fault it was */
    if (state != SPHPA_OK) return state;
    if (result != SPHPA_ERROR_OUTSIDE) return result;
    size_t i = 0;
    while (i + 1 < sim->p.n && sphpa_sim_inside_(sim, i)) i++;
    return sphpa_sim_bad_(sim, i, "neighbours", result, err);
}

/* ---- traversals ------------------------------------------------------------------------------ */

/* [m] where particle i is, not put back into a periodic box since the lists were built: images of
   the lists stay good */
SPHPA_FORCE_INLINE_ void sphpa_sim_position_(const sphpa_sim *sim, size_t i, double x[3]) {
    const sphpa_box *box = &sim->options.box;
    for (int a = 0; a < 3; a++) {
        x[a] = a < sim->p.dim ? sim->p.x[3 * i + (size_t)a] : 0.0;
        if (a >= sim->p.dim || !box->periodic[a]) continue;
        double was = sim->tree.pos[4 * i + (size_t)a];
        x[a] = was + sphpa_tree_dx_(&sim->tree.box, a, x[a] - was);
    }
}

/* particle i's neighbours within the supports, or all that are listed, into the buffer */
SPHPA_PRIVATE_ void sphpa_filter_(const sphpa_sim *sim, const sphpa_group *group, size_t i,
                                  sphpa_pair_buffer_ *buffer, sphpa_neighbours *near, bool all) {
    const double *point = sim->work->point, *own = point + 4 * i;
    double *dx = buffer->numbers, *dy = dx + buffer->capacity, *dz = dy + buffer->capacity;
    double *r = dz + buffer->capacity, *h = r + buffer->capacity;
    double reach = sphpa_kernel_support(sim->options.kernel);
    const uint32_t *list = all ? group->far : group->list;
    size_t n = 0, entries = all ? group->far_entries : group->entries;
    for (size_t k = 0; k < entries; k++) {
        uint32_t j = SPHPA_TREE_ENTRY_INDEX(list[k]);
        const double *other = point + 4 * (size_t)j;
        const double *shift = sim->work->shift[SPHPA_TREE_ENTRY_IMAGE(list[k])];
        dx[n] = own[0] - other[0] - shift[0];
        dy[n] = own[1] - other[1] - shift[1];
        dz[n] = own[2] - other[2] - shift[2];
        double support = reach * sphpa_max_(own[3], other[3]);
        r[n] = dx[n] * dx[n] + dy[n] * dy[n] + dz[n] * dz[n];
        h[n] = other[3];
        buffer->j[n] = j;
        n += j != i && (all || r[n] < support * support) ? 1u : 0u;
    }
    for (size_t k = 0; k < n; k++) r[k] = sqrt(r[k]);
    near->i = i;
    near->count = n;
    near->j = buffer->j;
    near->dx = dx;
    near->dy = dy;
    near->dz = dz;
    near->r = r;
    near->h = h;
    for (int s = 0; s < 4; s++) near->scratch[s] = h + (size_t)(s + 1) * buffer->capacity;
}

/* which pass's records lie where; 0 bytes where a pass has none */
typedef struct sphpa_shared_ {
    int first, last; /* passes [first, last) */
    bool one_by_one; /* some of them take one particle at a time */
    size_t offset[SPHPA_SCENE_PASSES];
} sphpa_shared_;

/* whether pass k's records are there but for what follows a */
SPHPA_PRIVATE_ bool sphpa_sim_repacks_(const sphpa_sim *sim, int k) {
    const struct sphpa_work *work = sim->work;
    const sphpa_mask follows = SPHPA_F(a) | SPHPA_F(mu_max) | SPHPA_F(div_v) | SPHPA_F(du);
    return sim->pass[k]->repack != NULL && work->packed != NULL &&
           work->packed->pack == sim->pass[k]->pack && work->packed_params == sim->pass_params[k] &&
           (work->touched & ~follows) == 0;
}

SPHPA_PRIVATE_ sphpa_result sphpa_shared_pack_(sphpa_sim *sim, sphpa_shared_ *shared,
                                              sphpa_error *err) {
    struct sphpa_work *work = sim->work;
    size_t bytes = 0, n = sim->p.n;
    for (int k = shared->first; k < shared->last; k++) {
        shared->offset[k] = bytes;
        bytes += (n * sim->pass[k]->record_bytes + 63) / 64 * 64;
    }
    if (bytes + 64 > work->records_bytes) {
        SPHPA_FREE(work->records);
        work->packed = NULL;
        work->records_bytes = 0;
        work->records = (char *)SPHPA_MALLOC(bytes + 64);
        if (work->records == NULL)
            return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "no memory for %zu bytes of records",
                                   bytes);
        work->records_bytes = bytes + 64;
    }
    size_t skew = (size_t)((uintptr_t)work->records % 64);
    for (int k = shared->first; k < shared->last; k++) {
        shared->offset[k] += skew ? 64 - skew : 0;
        const sphpa_pass *pass = sim->pass[k];
        if (pass->pack == NULL) continue;
        char *records = work->records + shared->offset[k];
        bool again = k == shared->first && sphpa_sim_repacks_(sim, k);
        long blocks = (long)sphpa_blocks_(n);
        SPHPA_OMP(parallel for schedule(static) if (blocks > SPHPA_FEW_))
        for (long block = 0; block < blocks; block++)
            (again ? pass->repack : pass->pack)(sim, sim->pass_params[k],
                                                (size_t)block * SPHPA_BLOCK_,
                                                sphpa_block_end_((size_t)block, n), records);
    }
    work->packed = sim->pass[shared->first];
    work->packed_params = sim->pass_params[shared->first];
    work->touched = 0;
    return SPHPA_OK;
}

/* [m] the largest h of particle i that the lists without their skin allow for */
SPHPA_FORCE_INLINE_ double sphpa_narrow_h_(const sphpa_sim *sim, size_t i) {
    return SPHPA_SLACK_ * sim->work->point[4 * i + 3];
}

/* What is within the larger support of a pair, SPHPA_SLACK_ allowed, for one of the group at least.
   Entries that are left out add nothing to any sum; one that is NaN is kept, to be noticed. */
SPHPA_PRIVATE_ uint32_t sphpa_narrow_group_(const sphpa_sim *sim, const sphpa_group *group,
                                            uint32_t *list) {
    sphpa_lanes_ x[3], d[3], own = sphpa_lanes_of_(SPHPA_R(0.0));
    sphpa_group points = *group;
    const double *point = sim->work->point;
    double reach = SPHPA_SLACK_ * sphpa_kernel_support(sim->options.kernel);
    uint32_t n = 0;
    points.records = (const char *)point;
    sphpa_lanes_own_x_(&points, 4 * sizeof *point, x);
    for (size_t l = 0; l < SPHPA_LANES_; l++)
        SPHPA_LANE_(own, l) =
            (sphpa_real)(reach * point[4 * sphpa_lanes_particle_(group, l) + 3]);
    for (size_t k = 0; k < group->far_entries; k++) {
        uint32_t entry = group->far[k];
        const double *j = point + 4 * (size_t)SPHPA_TREE_ENTRY_INDEX(entry);
        sphpa_lanes_ r2 = sphpa_lanes_apart_(group, entry, j, x, d);
        sphpa_lanes_ s = sphpa_lanes_max_(own, sphpa_lanes_of_((sphpa_real)(reach * j[3])));
        list[n] = entry;
        n += sphpa_lanes_any_((sphpa_mask_)(r2 <= s * s) | (sphpa_mask_)(r2 != r2)) ? 1u : 0u;
    }
    return n;
}

/* the lists without their skin, of this group; made here where this traversal makes them */
SPHPA_FORCE_INLINE_ void sphpa_narrow_at_(const sphpa_sim *sim, size_t chunk, size_t *used,
                                          double centre[SPHPA_TREE_IMAGES][3],
                                          sphpa_group *group) {
    sphpa_narrow_ *narrow = &sim->work->narrow;
    const double *x = sim->work->point + 4 * group->first;
    size_t g = group->first / SPHPA_LANES_;
    uint32_t *list = narrow->list + narrow->chunk[chunk];
    uint32_t last = narrow->hold ? narrow->count[g] : group->far[group->far_entries - 1];
    sphpa_group_centre_(sim, x, last, centre, group);
    if (!narrow->hold) {
        uint32_t count = sphpa_narrow_group_(sim, group, list + *used);
        narrow->first[g] = (uint32_t)*used;
        narrow->count[g] = count | (last - SPHPA_TREE_ENTRY_INDEX(last)); /* with last's image */
        *used += count;
    }
    group->list = list + narrow->first[g];
    group->entries = SPHPA_TREE_ENTRY_INDEX(narrow->count[g]);
}

/* Whether points and lists without skin are those of these positions and supports. same: h must not
   have changed at all. */
SPHPA_PRIVATE_ bool sphpa_narrow_holds_(sphpa_sim *sim, bool same) {
    struct sphpa_work *work = sim->work;
    if (!work->narrow.hold) return false;
    long blocks = (long)sphpa_blocks_(sim->p.n);
    double most = same ? 1.0 : SPHPA_SLACK_;
    SPHPA_OMP(parallel for schedule(static) if (blocks > SPHPA_LIGHT_))
    for (long block = 0; block < blocks; block++) {
        bool hold = true;
        size_t end = sphpa_block_end_((size_t)block, sim->p.n);
        for (size_t i = (size_t)block * SPHPA_BLOCK_; i < end; i++) {
            double h = (double)sim->p.h[i], was = work->point[4 * i + 3];
            hold = hold && h <= most * was && (!same || h >= was);
        }
        work->block_result[block] = hold ? 1 : 0;
    }
    for (long block = 0; block < blocks; block++)
        if (!work->block_result[block]) return false;
    return true;
}

SPHPA_PRIVATE_ void sphpa_narrow_begin_(sphpa_sim *sim, bool same) {
    struct sphpa_work *work = sim->work;
    long n = (long)sim->p.n;
    work->narrow.hold = sphpa_narrow_holds_(sim, same);
    SPHPA_OMP(parallel for schedule(static) if (n > SPHPA_LIGHT_ * SPHPA_BLOCK_))
    for (long i = 0; i < (work->narrow.hold ? 0 : n); i++) {
        sphpa_sim_position_(sim, (size_t)i, work->point + 4 * i);
        work->point[4 * i + 3] = (double)sim->p.h[i];
    }
}

/* one group of particles: every pass that takes them together, then those that take one by one */
SPHPA_PRIVATE_ void sphpa_shared_group_(sphpa_sim *sim, const sphpa_shared_ *shared,
                                        sphpa_group *group, sphpa_pair_buffer_ *buffer) {
    sphpa_neighbours near;
    for (int k = shared->first; k < shared->last; k++) {
        if (sim->pass[k]->group == NULL) continue;
        group->records = sim->work->records + shared->offset[k];
        sim->pass[k]->group(sim, sim->pass_params[k], group);
    }
    for (size_t i = group->first; i < group->first + group->count && shared->one_by_one; i++) {
        int filtered = -1; /* neither way so far */
        for (int k = shared->first; k < shared->last; k++) {
            const sphpa_pass *pass = sim->pass[k];
            int all = pass->unfiltered != 0;
            if (pass->pair == NULL) continue;
            if (filtered != all) sphpa_filter_(sim, group, i, buffer, &near, all != 0);
            filtered = all;
            near.records = sim->work->records + shared->offset[k];
            pass->pair(sim, sim->pass_params[k], &near);
            if (!all) buffer->pairs += near.count, buffer->targets++;
        }
    }
}

/* one chunk of the lists, group by group */
SPHPA_PRIVATE_ void sphpa_shared_chunk_(sphpa_sim *sim, const sphpa_shared_ *shared, size_t chunk) {
    sphpa_pair_buffer_ *buffer = &sim->work->buffer[sphpa_thread_()];
    double centre[SPHPA_TREE_IMAGES][3];
    sphpa_group group;
    size_t end = (chunk + 1) * SPHPA_TREE_CHUNK, used = 0;
    if (end > sim->p.n) end = sim->p.n;
    unsigned before = sphpa_denormals_off_();
    for (size_t i = chunk * SPHPA_TREE_CHUNK; i < end; i += SPHPA_LANES_) {
        sphpa_group_at_(sim, i, &group);
        sphpa_narrow_at_(sim, chunk, &used, centre, &group);
        sphpa_shared_group_(sim, shared, &group, buffer);
    }
    sphpa_denormals_back_(before);
}

SPHPA_PRIVATE_ sphpa_result sphpa_sim_traverse_(sphpa_sim *sim, int first, int last,
                                                sphpa_error *err) {
    struct sphpa_work *work = sim->work;
    sphpa_shared_ shared;
    shared.first = first;
    shared.last = last;
    shared.one_by_one = false;
    for (int k = first; k < last; k++)
        shared.one_by_one = shared.one_by_one || sim->pass[k]->pair != NULL;
    sphpa_result result = SPHPA_OK;
    if (work->unsure && work->moved) sphpa_sim_wrap_(sim);
    if (work->unsure && !sphpa_sim_lists_hold_(sim)) result = sphpa_sim_neighbours_(sim, err);
    if (result == SPHPA_OK) result = sphpa_shared_pack_(sim, &shared, err);
    if (result != SPHPA_OK) return result;
    sphpa_narrow_begin_(sim, shared.one_by_one);
    for (int t = 0; t < work->threads; t++) work->buffer[t].pairs = work->buffer[t].targets = 0;
    long chunks = (long)((sim->p.n + SPHPA_TREE_CHUNK - 1) / SPHPA_TREE_CHUNK);
    SPHPA_OMP(parallel for schedule(dynamic, 1) if (chunks > 2))
    for (long chunk = 0; chunk < chunks; chunk++) sphpa_shared_chunk_(sim, &shared, (size_t)chunk);
    work->narrow.hold = true;
    uint64_t pairs = 0, targets = 0;
    for (int t = 0; t < work->threads; t++)
        pairs += work->buffer[t].pairs, targets += work->buffer[t].targets;
    if (targets > 0) sim->stats.neighbours_mean = (double)pairs / (double)targets;
    return SPHPA_OK;
}

/* PAIR passes from `first` on that may share a traversal: none reads what an earlier one writes,
   nor writes what an earlier one reads (of neighbours whose turn is still to come) */
SPHPA_PRIVATE_ int sphpa_sim_group_end_(const sphpa_sim *sim, int first) {
    sphpa_mask written = 0, read = 0;
    const sphpa_pass *one = sim->pass[first];
    int k = first;
    for (; k < sim->passes; k++) {
        const sphpa_pass *pass = sim->pass[k];
        sphpa_mask writes = pass->writes | pass->advances;
        if (pass->kind != SPHPA_PASS_PAIR || pass->stage != one->stage) break;
        if ((pass->at_commit != 0) != (one->at_commit != 0)) break;
        sphpa_mask reads = pass->reads | pass->uses;
        if ((reads & written) != 0 || (k > first && (writes & read) != 0)) break;
        written |= writes;
        read |= reads;
    }
    return k;
}

SPHPA_PRIVATE_ sphpa_result sphpa_sim_particle_pass_(sphpa_sim *sim, int k, sphpa_error *err) {
    struct sphpa_work *work = sim->work;
    const sphpa_pass *pass = sim->pass[k];
    void *params = sim->pass_params[k];
    if (pass->stage == SPHPA_STAGE_RESIZE) { /* may change n: one call, one thread */
        size_t bad = 0;
        sphpa_result result = pass->particle(sim, params, 0, sim->p.n, &bad);
        return result == SPHPA_OK ? result : sphpa_sim_bad_(sim, bad, pass->name, result, err);
    }
    long blocks = (long)sphpa_blocks_(sim->p.n);
    SPHPA_OMP(parallel for schedule(dynamic, 4) if (blocks > SPHPA_FEW_))
    for (long block = 0; block < blocks; block++) {
        size_t first = (size_t)block * SPHPA_BLOCK_;
        work->block_bad[block] = first;
        work->block_result[block] = (unsigned char)pass->particle(
            sim, params, first, sphpa_block_end_((size_t)block, sim->p.n), &work->block_bad[block]);
    }
    for (long block = 0; block < blocks; block++)
        if (work->block_result[block] != (unsigned char)SPHPA_OK)
            return sphpa_sim_bad_(sim, work->block_bad[block], pass->name,
                                  (sphpa_result)work->block_result[block], err);
    return SPHPA_OK;
}

/* all passes of one stage, traversals shared where the masks allow; commit: only those marked */
SPHPA_PRIVATE_ sphpa_result sphpa_sim_stage_(sphpa_sim *sim, sphpa_stage stage, bool commit,
                                             sphpa_error *err) {
    for (int k = 0; k < sim->passes;) {
        const sphpa_pass *pass = sim->pass[k];
        bool pairs = pass->kind == SPHPA_PASS_PAIR;
        int end = pairs ? sphpa_sim_group_end_(sim, k) : k + 1;
        if (pass->stage == stage && (!commit || pass->at_commit)) {
            double since = sphpa_wall_clock();
            sphpa_result result = pairs ? sphpa_sim_traverse_(sim, k, end, err)
                                        : sphpa_sim_particle_pass_(sim, k, err);
            if (result != SPHPA_OK) return result;
            sphpa_sim_time_(sim, SPHPA_TIME_PASSES + k, since);
            for (int other = k; other < end; other++) {
                sphpa_mask wrote = sim->pass[other]->writes | sim->pass[other]->advances;
                sim->work->touched |= wrote;
                if (wrote & (SPHPA_F(x) | SPHPA_F(h))) sim->work->unsure = true;
                if ((wrote & SPHPA_F(x)) == 0) continue; /* it moved them */
                sim->work->narrow.hold = false;
                sim->work->moved = true;
            }
            for (int other = k + 1; other < end; other++) /* their time is in the first one's */
                sim->stats.timing[SPHPA_TIME_PASSES + other].calls++;
        }
        k = end;
    }
    return SPHPA_OK;
}

SPHPA_PRIVATE_ bool sphpa_sim_has_stage_(const sphpa_sim *sim, sphpa_stage stage) {
    for (int k = 0; k < sim->passes; k++)
        if (sim->pass[k]->stage == stage) return true;
    return false;
}

/* A density went bad: because particles lie on one point, or what else is wrong with the first one
   whose state is bad; OK: none is. */
SPHPA_PRIVATE_ sphpa_result sphpa_sim_density_check_(sphpa_sim *sim, sphpa_error *err) {
    size_t bad = sphpa_sim_first_bad_(sim), i = 0, j = 0;
    if (bad == sim->p.n) return SPHPA_OK;
    sphpa_result why = sphpa_particle_check_(&sim->p, bad, NULL);
    char where[200] = "density";
    if (!(sim->p.rho[bad] == sim->p.rho[bad]))
        snprintf(where, sizeof where, "no smoothing length fits the density of particle %zu: %s",
                 bad, "too many particles within a small part of its h, or too small an eta");
    for (size_t k = 0; k < sim->p.n; k++) /* a support that a tree can be built with */
        if (!(sim->p.h[k] > (sphpa_real)1e-30)) sim->p.h[k] = (sphpa_real)1e-30;
    if (sphpa_sim_build_tree_(sim, NULL) == SPHPA_OK &&
        sphpa_tree_coincident(&sim->tree, &i, &j) != SPHPA_OK) {
        snprintf(where, sizeof where, "density: particles %zu and %zu (ids %lld, %lld) came to lie "
                 "on one point", i, j, (long long)sim->p.id[i], (long long)sim->p.id[j]);
        bad = i;
        why = SPHPA_ERROR_STATE;
    }
    return sphpa_sim_bad_(sim, bad, where, why, err);
}

/* density sums change h; where one outgrows its list, new lists and once more */
SPHPA_PRIVATE_ sphpa_result sphpa_sim_density_(sphpa_sim *sim, sphpa_error *err) {
    sphpa_result result = sphpa_sim_neighbours_(sim, err);
    if (result != SPHPA_OK || !sphpa_sim_has_stage_(sim, SPHPA_STAGE_DENSITY)) return result;
    for (int round = 0; round < 60; round++) {
        result = sphpa_sim_stage_(sim, SPHPA_STAGE_DENSITY, false, err);
        if (result == SPHPA_OK) result = sphpa_sim_density_check_(sim, err);
        if (result != SPHPA_OK || sphpa_sim_lists_hold_(sim)) return result;
        result = sphpa_sim_rebuild_(sim, err);
        if (result != SPHPA_OK) return result;
    }
    size_t who = 0;
    for (size_t i = 0; i < sim->p.n; i++)
        if (sim->p.h[i] > sim->p.h[who]) who = i;
    return sphpa_error_set(err, SPHPA_ERROR_STATE,
                           "the smoothing length of particle %zu (id %lld) at (%.6g, %.6g, %.6g) "
                           "keeps growing (%g m) at t = %.6e s: it has too few neighbours; bound h "
                           "(h_max) or add particles", who, (long long)sim->p.id[who],
                           sim->p.x[3 * who], sim->p.x[3 * who + 1], sim->p.x[3 * who + 2],
                           (double)sim->p.h[who], sim->time);
}

SPHPA_PRIVATE_ sphpa_result sphpa_sim_evaluate_(sphpa_sim *sim, double dt_stage, sphpa_error *err) {
    sim->dt_stage = dt_stage;
    sim->stats.evaluations++;
    sphpa_result result = sphpa_sim_density_(sim, err);
    if (result != SPHPA_OK) return result;
    sphpa_clear_(sim->p.a, sim->p.n * 3 * sizeof(sphpa_real));
    if (sim->p.mu_max != NULL) sphpa_clear_(sim->p.mu_max, sim->p.n * sizeof(sphpa_real));
    for (int stage = SPHPA_STAGE_GRADIENTS; stage <= (int)SPHPA_STAGE_FORCES; stage++) {
        result = sphpa_sim_stage_(sim, (sphpa_stage)stage, false, err);
        if (result != SPHPA_OK) return result;
    }
    return SPHPA_OK;
}

/* ---- integration ----------------------------------------------------------------------------- */

/* saves what the step starts from, or brings it back */
SPHPA_PRIVATE_ void sphpa_sim_copy_start_(sphpa_sim *sim, bool back) {
    int fields = (int)SPHPA_FIELD_COUNT;
    for (int k = 0; k < SPHPA_ARRAYS_; k++) { /* a field or a column; its copy is further on */
        bool field = k < fields, column = k >= 2 * fields && k < 2 * fields + SPHPA_COLUMNS_MAX;
        if (!field && !column) continue;
        sphpa_array_ now = sphpa_particles_array_(&sim->p, k);
        sphpa_array_ start =
            sphpa_particles_array_(&sim->p, k + (field ? fields : SPHPA_COLUMNS_MAX));
        if (start.bytes == 0) continue;
        if (back) sphpa_copy_(now.data, start.data, sim->p.n * start.bytes);
        else sphpa_copy_(start.data, now.data, sim->p.n * start.bytes);
    }
}

/* velocity at the middle of the kick that this evaluation's force gives: equation (3) */
SPHPA_FORCE_INLINE_ double sphpa_sim_mean_v_(const sphpa_sim *sim, size_t k) {
    return (double)sim->p.start.v[k] + 0.5 * sim->dt * (double)sim->p.a[k];
}

/* where h comes from a density sum: a guess of the next one, by the divergence of this evaluation,
   that saves the sum from iterating */
SPHPA_PRIVATE_ void sphpa_sim_stretch_(sphpa_sim *sim, double dt) {
    sphpa_particles *p = &sim->p;
    if (p->div_v == NULL || !sphpa_sim_has_stage_(sim, SPHPA_STAGE_DENSITY)) return;
    long n = (long)p->n;
    double each = dt / p->dim;
    SPHPA_OMP(parallel for schedule(static) if (n > SPHPA_LIGHT_ * SPHPA_BLOCK_))
    for (long i = 0; i < n; i++) {
        double grow = sphpa_clamp_(each * (double)p->div_v[i], -0.2, 0.2);
        p->h[i] = (sphpa_real)((double)p->h[i] * (1.0 + grow));
    }
}

SPHPA_PRIVATE_ void sphpa_sim_predict_(sphpa_sim *sim) {
    sphpa_particles *p = &sim->p;
    double half = 0.5 * sim->dt;
    long n = (long)p->n;
    SPHPA_OMP(parallel for schedule(static) if (n > SPHPA_LIGHT_ * SPHPA_BLOCK_))
    for (long i = 0; i < n; i++) {
        for (long k = 3 * i; k < 3 * i + 3; k++) {
            p->x[k] += half * (double)p->start.v[k];
            p->v[k] = (sphpa_real)((double)p->start.v[k] + half * (double)p->a[k]);
        }
        p->u[i] = p->start.u[i] + half * (double)p->du[i];
    }
    sphpa_sim_stretch_(sim, half);
    sphpa_sim_wrap_(sim);
}

SPHPA_PRIVATE_ sphpa_result sphpa_sim_energy_(sphpa_sim *sim, sphpa_error *err) {
    sphpa_clear_(sim->p.du, sim->p.n * sizeof(sphpa_real));
    return sphpa_sim_stage_(sim, SPHPA_STAGE_ENERGY, false, err);
}

/* equations (3) and (4) for [first, last); the first particle whose state is no longer finite, or
   last; below: [J] what u lacks to 0, in how many particles, the smallest u and whose it is */
SPHPA_PRIVATE_ size_t sphpa_sim_finish_block_(sphpa_sim *sim, size_t first, size_t last,
                                              double below[4]) {
    sphpa_particles *p = &sim->p;
    size_t bad = last;
    below[0] = below[1] = 0.0;
    below[2] = HUGE_VAL, below[3] = (double)first;
    for (size_t i = last; i-- > first;) {
        double sane = 0.0;
        for (size_t k = 3 * i; k < 3 * i + 3; k++) {
            p->v[k] = (sphpa_real)((double)p->start.v[k] + sim->dt * (double)p->a[k]);
            p->x[k] += 0.5 * sim->dt * (double)p->v[k]; /* dt vbar, less what * has already */
            sane += p->x[k] + (double)p->v[k];
        }
        p->u[i] = p->start.u[i] + sim->dt * (double)p->du[i];
        if (p->u[i] < 0.0) below[0] -= (double)p->m[i] * p->u[i], below[1] += 1.0;
        if (p->u[i] <= below[2]) below[2] = p->u[i], below[3] = (double)i;
        if (!sphpa_finite_(sane + p->u[i])) bad = i;
    }
    return bad;
}

SPHPA_PRIVATE_ size_t sphpa_sim_finish_(sphpa_sim *sim) {
    struct sphpa_work *work = sim->work;
    size_t n = sim->p.n;
    long blocks = (long)sphpa_blocks_(n);
    SPHPA_OMP(parallel for schedule(static) if (blocks > SPHPA_LIGHT_))
    for (long block = 0; block < blocks; block++) {
        size_t end = sphpa_block_end_((size_t)block, n);
        size_t bad = sphpa_sim_finish_block_(sim, (size_t)block * SPHPA_BLOCK_, end,
                                             &work->block_sum[4 * block]);
        work->block_bad[block] = bad < end ? bad : n;
    }
    size_t bad = n;
    sphpa_stats *stats = &sim->stats;
    stats->u_deficit = 0.0;
    stats->u_least = HUGE_VAL;
    stats->u_below = 0;
    for (long block = 0; block < blocks; block++) {
        const double *below = &work->block_sum[4 * block];
        stats->u_deficit += below[0];
        stats->u_below += (uint64_t)below[1];
        if (below[2] < stats->u_least)
            stats->u_least = below[2], stats->u_id = sim->p.id[(size_t)below[3]];
        if (work->block_bad[block] < bad) bad = work->block_bad[block];
    }
    sphpa_sim_stretch_(sim, 0.5 * sim->dt);
    sphpa_sim_wrap_(sim);
    return bad;
}

SPHPA_PRIVATE_ sphpa_result sphpa_sim_commit_(sphpa_sim *sim, sphpa_error *err) {
    sim->committing = 1;
    sim->dt_stage = sim->dt;
    sphpa_result result = SPHPA_OK;
    bool pairs = false; /* they look at the positions of the end: are the lists still good there? */
    for (int k = 0; k < sim->passes; k++)
        pairs = pairs || (sim->pass[k]->kind == SPHPA_PASS_PAIR &&
                          (sim->pass[k]->at_commit || sim->pass[k]->stage == SPHPA_STAGE_COMMIT));
    if (pairs) result = sphpa_sim_neighbours_(sim, err);
    for (int stage = SPHPA_STAGE_GRADIENTS; stage <= (int)SPHPA_STAGE_DAMAGE; stage++)
        if (result == SPHPA_OK) result = sphpa_sim_stage_(sim, (sphpa_stage)stage, true, err);
    if (result == SPHPA_OK) result = sphpa_sim_stage_(sim, SPHPA_STAGE_COMMIT, false, err);
    sim->committing = 0;
    if (result != SPHPA_OK || !sphpa_sim_has_stage_(sim, SPHPA_STAGE_RESIZE)) return result;
    size_t n = sim->p.n;
    int64_t next_id = sim->p.next_id;
    result = sphpa_sim_stage_(sim, SPHPA_STAGE_RESIZE, false, err);
    if (sim->p.n != n || sim->p.next_id != next_id) sim->work->lists_valid = false;
    if (result == SPHPA_OK && !sphpa_work_reserve_(sim->work, sim->p.n))
        result = sphpa_error_set(err, SPHPA_ERROR_MEMORY, "no memory for %zu particles", sim->p.n);
    return result;
}

/* a < b, where NaN counts as less than anything, so that it is not overlooked */
SPHPA_FORCE_INLINE_ bool sphpa_sooner_(double a, double b) { return b == b && !(a >= b); }

/* Sums of a block: m, m x, m v, m x.x, m x.v. */
SPHPA_PRIVATE_ void sphpa_sim_flow_of_block_(const sphpa_particles *p, size_t first, size_t last,
                                             double sum[9]) {
    for (int k = 0; k < 9; k++) sum[k] = 0.0;
    for (size_t i = first; i < last; i++) {
        double m = (double)p->m[i];
        sum[0] += m;
        for (size_t a = 0; a < 3; a++) {
            double x = p->x[3 * i + a], v = (double)p->v[3 * i + a];
            sum[1 + a] += m * x;
            sum[4 + a] += m * v;
            sum[7] += m * x * x;
            sum[8] += m * x * v;
        }
    }
}

/* The flow that brings nothing together: V of the centre of mass X, and an expansion H (x - X),
   H >= 0 by least squares (0 in a periodic box, where x means nothing). In blocks of fixed size. */
SPHPA_PRIVATE_ void sphpa_sim_flow_(sphpa_sim *sim) {
    struct sphpa_work *work = sim->work;
    const int *wraps = sim->options.box.periodic;
    long blocks = (long)sphpa_blocks_(sim->p.n);
    SPHPA_OMP(parallel for schedule(static) if (blocks > SPHPA_LIGHT_))
    for (long block = 0; block < blocks; block++)
        sphpa_sim_flow_of_block_(&sim->p, (size_t)block * SPHPA_BLOCK_,
                                 sphpa_block_end_((size_t)block, sim->p.n),
                                 &work->block_sum[12 * block]);
    double all[9] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    for (long block = 0; block < blocks; block++)
        for (int k = 0; k < 9; k++) all[k] += work->block_sum[12 * block + k];
    double xx = all[7], xv = all[8];
    for (int a = 0; a < 3; a++) {
        work->flow_x[a] = all[1 + a] / all[0];
        work->flow_v[a] = all[4 + a] / all[0];
        xx -= work->flow_x[a] * all[1 + a];
        xv -= work->flow_x[a] * all[4 + a];
    }
    work->flow_H = wraps[0] || wraps[1] || wraps[2] || !(xx > 0.0) ? 0.0 : sphpa_max_(xv / xx, 0.0);
}

/* the least of one limit over all particles and whose it is; ties go to the lower index */
SPHPA_PRIVATE_ double sphpa_sim_least_(sphpa_sim *sim, const sphpa_pass *pass, const void *params,
                                       size_t *who) {
    struct sphpa_work *work = sim->work;
    long blocks = (long)sphpa_blocks_(sim->p.n);
    SPHPA_OMP(parallel for schedule(static) if (blocks > SPHPA_LIGHT_))
    for (long block = 0; block < blocks; block++) {
        double least = HUGE_VAL;
        size_t end = sphpa_block_end_((size_t)block, sim->p.n), at = end - 1;
        for (size_t i = (size_t)block * SPHPA_BLOCK_; i < end; i++) {
            double dt;
            if (pass != NULL) dt = pass->limit(sim, params, i);
            else {
                const sphpa_real *a = sim->p.a + 3 * i;
                double size = sqrt((double)a[0] * (double)a[0] + (double)a[1] * (double)a[1] +
                                   (double)a[2] * (double)a[2]);
                dt = sim->options.force_cfl * sqrt((double)sim->p.h[i] / (size + 1e-300));
            }
            if (sphpa_sooner_(dt, least)) least = dt, at = i;
        }
        work->block_sum[block] = least;
        work->block_bad[block] = at;
    }
    double least = HUGE_VAL;
    for (long block = 0; block < blocks; block++)
        if (sphpa_sooner_(work->block_sum[block], least))
            least = work->block_sum[block], *who = work->block_bad[block];
    return least;
}

enum { SPHPA_LIMIT_OUTPUT_ = 0, SPHPA_LIMIT_GROWTH_, SPHPA_LIMIT_MAX_, SPHPA_LIMIT_FORCE_ };

/* dt_next from all limits, and which one it was */
SPHPA_PRIVATE_ sphpa_result sphpa_sim_limit_(sphpa_sim *sim, sphpa_error *err) {
    const sphpa_sim_options *options = &sim->options;
    sphpa_stats *stats = &sim->stats;
    size_t who = 0, candidate = 0;
    double least = sphpa_sim_least_(sim, NULL, NULL, &who);
    int which = SPHPA_LIMIT_FORCE_, slot = SPHPA_LIMIT_FORCE_ + 1;
    sphpa_sim_flow_(sim);
    for (int k = 0; k < sim->passes; k++) {
        if (sim->pass[k]->stage != SPHPA_STAGE_LIMIT) continue;
        double since = sphpa_wall_clock();
        double dt = sphpa_sim_least_(sim, sim->pass[k], sim->pass_params[k], &candidate);
        sphpa_sim_time_(sim, SPHPA_TIME_PASSES + k, since);
        if (sphpa_sooner_(dt, least)) least = dt, which = slot, who = candidate;
        slot++;
    }
    if (options->dt_max > 0.0 && options->dt_max < least)
        least = options->dt_max, which = SPHPA_LIMIT_MAX_;
    if (sim->dt_free > 0.0 && options->dt_growth * sim->dt_free < least)
        least = options->dt_growth * sim->dt_free, which = SPHPA_LIMIT_GROWTH_;
    if (options->dt_fixed > 0.0) least = options->dt_fixed, which = SPHPA_LIMIT_MAX_;
    stats->limit_last = which;
    stats->limit_id = sim->p.id[who];
    if (!(least > 0.0) || (least == HUGE_VAL)) {
        char where[120];
        snprintf(where, sizeof where, "no usable time step, %g s by the limit \"%.60s\"", least,
                 stats->limit[which].name);
        return sphpa_sim_bad_(sim, who, where, SPHPA_ERROR_STATE, err);
    }
    sim->dt_next = least;
    return SPHPA_OK;
}

SPHPA_PRIVATE_ double sphpa_sim_floor_(const sphpa_sim *sim) {
    if (sim->options.dt_min > 0.0) return sim->options.dt_min;
    return sim->options.dt_fixed > 0.0 ? 0.0 : 1e-6 * sim->dt_first;
}

/* rates and limits at the start, so that the first step has a predictor and a length */
SPHPA_PRIVATE_ sphpa_result sphpa_sim_start_(sphpa_sim *sim, sphpa_error *err) {
    sim->dt = 0.0;
    sphpa_sim_copy_start_(sim, false);
    sphpa_result result = sphpa_sim_evaluate_(sim, 0.0, err);
    if (result == SPHPA_OK) result = sphpa_sim_energy_(sim, err);
    if (result == SPHPA_OK) result = sphpa_sim_limit_(sim, err);
    if (result != SPHPA_OK) return result;
    sim->started = 1;
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_sim_advance_(sphpa_sim *sim, sphpa_error *err) {
    double dt = sim->dt, since = sphpa_wall_clock();
    sphpa_sim_copy_start_(sim, false);
    sphpa_result result = SPHPA_OK;
    if (sim->options.integrator == SPHPA_RK2) {
        sim->dt = 0.0;
        result = sphpa_sim_evaluate_(sim, 0.0, err);
        if (result == SPHPA_OK) result = sphpa_sim_energy_(sim, err);
        if (result != SPHPA_OK) return result;
        sim->dt = dt;
        since = sphpa_wall_clock();
    }
    sphpa_sim_predict_(sim);
    sphpa_sim_time_(sim, SPHPA_TIME_INTEGRATE, since);
    result = sphpa_sim_evaluate_(sim, 0.5 * dt, err);
    if (result == SPHPA_OK) result = sphpa_sim_energy_(sim, err);
    if (result != SPHPA_OK) return result;
    since = sphpa_wall_clock();
    size_t bad = sphpa_sim_finish_(sim);
    sphpa_sim_time_(sim, SPHPA_TIME_INTEGRATE, since);
    if (bad < sim->p.n) return sphpa_sim_bad_(sim, bad, "step", SPHPA_ERROR_NOT_FINITE, err);
    return sphpa_sim_commit_(sim, err);
}

/* whether array k (see sphpa_particles_array_) is one that the passes of a refresh compute and that
   no copy of the start brings back */
SPHPA_PRIVATE_ bool sphpa_sim_shown_(const sphpa_sim *sim, int k) {
    int fields = (int)SPHPA_FIELD_COUNT, column = k - 2 * fields;
    if (column >= 0)
        return column < sim->p.columns && sim->p.column[column].role == SPHPA_ROLE_DERIVED;
    if (k >= fields || sphpa_has_(sim->p.start_fields, k)) return false;
    for (int pass = 0; pass < sim->passes; pass++)
        if ((int)sim->pass[pass]->stage >= (int)SPHPA_STAGE_DENSITY &&
            (int)sim->pass[pass]->stage <= (int)SPHPA_STAGE_DAMAGE &&
            sphpa_has_(sim->pass[pass]->writes, k))
            return true;
    return false;
}

/* all that is shown into work->kept, or back from there; the ids come first */
SPHPA_PRIVATE_ void sphpa_sim_keep_shown_(sphpa_sim *sim, bool back) {
    size_t ids = sim->p.n * sizeof(int64_t);
    char *at = sim->work->kept + ids;
    if (!back) memcpy(sim->work->kept, sim->p.id, ids);
    for (int k = 0; k < SPHPA_ARRAYS_; k++) {
        if (!sphpa_sim_shown_(sim, k)) continue;
        sphpa_array_ array = sphpa_particles_array_(&sim->p, k);
        size_t bytes = sim->p.n * array.bytes;
        if (bytes == 0) continue;
        if (back) memcpy(array.data, at, bytes);
        else memcpy(at, array.data, bytes);
        at += bytes;
    }
    sim->work->kept_n = back ? 0 : sim->p.n;
}

/* An output must not change the run: what a refresh put in place of the values that the next step
   predicts with goes back before anything else happens, unless someone moved the particles. */
SPHPA_PRIVATE_ void sphpa_sim_unrefresh_(sphpa_sim *sim) {
    size_t n = sim->work->kept_n;
    if (n > 0 && n == sim->p.n && memcmp(sim->work->kept, sim->p.id, n * sizeof(int64_t)) == 0)
        sphpa_sim_keep_shown_(sim, true);
    sim->work->kept_n = 0;
}

SPHPA_PRIVATE_ sphpa_result sphpa_sim_keep_(sphpa_sim *sim, sphpa_error *err) {
    struct sphpa_work *work = sim->work;
    size_t each = sizeof(int64_t);
    for (int k = 0; k < SPHPA_ARRAYS_; k++)
        if (sphpa_sim_shown_(sim, k)) each += sphpa_particles_array_(&sim->p, k).bytes;
    if (!sphpa_grow_((void **)&work->kept, &work->kept_bytes, sim->p.n * each + 1, 1))
        return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "no memory to refresh %zu particles",
                               sim->p.n);
    sphpa_sim_keep_shown_(sim, false);
    return SPHPA_OK;
}

SPHPA_DEF sphpa_result sphpa_sim_step(sphpa_sim *sim, double dt_limit, sphpa_error *err) {
    sphpa_sim_unrefresh_(sim);
    if (!(dt_limit > 0.0))
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "a step of at most %g s; it must be positive", dt_limit);
    if (!sphpa_work_reserve_(sim->work, sim->p.n))
        return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "no memory for %zu particles", sim->p.n);
    sphpa_result result = sim->started ? SPHPA_OK : sphpa_sim_start_(sim, err);
    if (result != SPHPA_OK) return result;
    bool cut = dt_limit < sim->dt_next;
    if (!cut && sim->dt_next < sphpa_sim_floor_(sim)) {
        size_t who = sim->p.n - 1;
        char where[200];
        while (who > 0 && sim->p.id[who] != sim->stats.limit_id) who--;
        snprintf(where, sizeof where,
                 "the next step, %.3g s by the limit \"%.60s\", is below its floor of %.3g s (set "
                 "dt_min lower if the scene needs such steps)", sim->dt_next,
                 sim->stats.limit[sim->stats.limit_last].name, sphpa_sim_floor_(sim));
        return sphpa_sim_bad_(sim, who, where, SPHPA_ERROR_STATE, err);
    }
    sim->dt_free = sim->dt_next;
    sim->dt = cut ? dt_limit : sim->dt_next;
    if (!(sim->dt_first > 0.0)) sim->dt_first = sim->dt;
    sim->stats.limit[cut ? SPHPA_LIMIT_OUTPUT_ : sim->stats.limit_last].steps++;
    result = sphpa_sim_advance_(sim, err);
    if (result == SPHPA_OK) result = sphpa_sim_check_(sim, "end of the step", err);
    if (result != SPHPA_OK) return result;
    sim->time += sim->dt;
    sim->stats.steps++;
    return sphpa_sim_limit_(sim, err);
}

SPHPA_DEF sphpa_result sphpa_sim_refresh(sphpa_sim *sim, sphpa_error *err) {
    sphpa_sim_unrefresh_(sim);
    if (!sphpa_work_reserve_(sim->work, sim->p.n))
        return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "no memory for %zu particles", sim->p.n);
    double dt = sim->dt;
    sphpa_sim_copy_start_(sim, false);
    sim->dt = sim->dt_stage = 0.0;
    sphpa_result result = sphpa_sim_neighbours_(sim, err);
    if (result == SPHPA_OK) result = sphpa_sim_keep_(sim, err);
    if (result == SPHPA_OK) result = sphpa_sim_density_(sim, err);
    for (int stage = SPHPA_STAGE_GRADIENTS; stage <= (int)SPHPA_STAGE_DAMAGE; stage++)
        if (result == SPHPA_OK) result = sphpa_sim_stage_(sim, (sphpa_stage)stage, false, err);
    sphpa_sim_copy_start_(sim, true); /* to the bit, whatever a solver made of a step of 0 */
    sim->dt = dt;
    return result;
}

SPHPA_DEF sphpa_result sphpa_sim_settle(sphpa_sim *sim, sphpa_error *err) {
    sphpa_sim_unrefresh_(sim);
    sphpa_result result = sphpa_sim_build_tree_(sim, err);
    return result == SPHPA_OK ? sphpa_particles_permute(&sim->p, sim->tree.order, err) : result;
}

SPHPA_PRIVATE_ sphpa_result sphpa_run_output_(sphpa_sim *sim, const sphpa_run *run,
                                              sphpa_error *err) {
    if (run->output == NULL) return SPHPA_OK;
    sphpa_result result = sphpa_sim_refresh(sim, err);
    return result == SPHPA_OK ? run->output(sim, run->user, err) : result;
}

SPHPA_DEF sphpa_result sphpa_sim_run(sphpa_sim *sim, const sphpa_run *run, sphpa_error *err) {
    if (!sphpa_finite_(run->t_end) || !(run->every >= 0.0))
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "t_end = %g s, output every %g s; give finite, positive times",
                               run->t_end, run->every);
    sphpa_result result = run->resumed ? SPHPA_OK : sphpa_run_output_(sim, run, err);
    while (result == SPHPA_OK && sim->time < run->t_end) {
        double every = run->every > 0.0 ? run->every : run->t_end, next = run->t_end;
        if (run->every > 0.0) next = every * (floor(sim->time / every + 1e-9) + 1.0);
        if (next > run->t_end * (1.0 - 1e-12)) next = run->t_end;
        double left = next - sim->time; /* no sliver at the end: two halves instead */
        double dt = sim->dt_next, same = 1e-12 * every; /* [s] times so close are one */
        bool two = sim->started && left > dt + same && left < 2.0 * dt;
        result = sphpa_sim_step(sim, two ? 0.5 * left : left, err);
        if (result != SPHPA_OK) return result;
        bool due = next - sim->time <= same;
        if (due) sim->time = next;
        if (run->step != NULL) result = run->step(sim, run->user, err);
        if (result == SPHPA_OK && due) result = sphpa_run_output_(sim, run, err);
        if (result == SPHPA_OK && run->stop != NULL && *run->stop && sim->time < run->t_end)
            return sphpa_error_set(err, SPHPA_STOPPED, "stopped at t = %.9e s", sim->time);
    }
    return result;
}

/* ---- creation -------------------------------------------------------------------------------- */

/* A parameter whose 0 means a default, or none. */
typedef struct sphpa_number_ {
    const char *name;
    double value;
} sphpa_number_;

/* each must be finite, and not negative; `who` begins the message */
SPHPA_PRIVATE_ sphpa_result sphpa_numbers_check_(const char *who, const sphpa_number_ *all,
                                                 int count, sphpa_error *err) {
    for (int k = 0; k < count; k++)
        if (!(all[k].value >= 0.0 && sphpa_finite_(all[k].value)))
            return sphpa_error_set(
                err, sphpa_finite_(all[k].value) ? SPHPA_ERROR_RANGE : SPHPA_ERROR_NOT_FINITE,
                "%s: %s = %g; give a positive number, or 0 for the default", who, all[k].name,
                all[k].value);
    return SPHPA_OK;
}

/* every particle's material is one of those there are */
SPHPA_PRIVATE_ sphpa_result sphpa_materials_check_(const sphpa_sim *sim, const char *module,
                                                   int materials, sphpa_error *err) {
    for (size_t i = 0; i < sim->p.n; i++)
        if (sim->p.material[i] < 0 || sim->p.material[i] >= materials)
            return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                   "%s: particle %zu has material %d of %d, which are 0 to %d; set "
                                   "its material, or give more", module, i,
                                   (int)sim->p.material[i], materials, materials - 1);
    return SPHPA_OK;
}

/* what is 0 becomes the default */
SPHPA_PRIVATE_ sphpa_result sphpa_sim_defaults_(sphpa_sim_options *options, sphpa_error *err) {
    const sphpa_number_ all[8] = {
        {"cfl", options->cfl},       {"force_cfl", options->force_cfl},
        {"flight", options->flight},
        {"dt_max", options->dt_max}, {"dt_min", options->dt_min},
        {"skin", options->skin},     {"dt_growth", options->dt_growth},
        {"dt_fixed", options->dt_fixed}};
    sphpa_result result = sphpa_numbers_check_("option", all, 8, err);
    if (result != SPHPA_OK) return result;
    if ((int)options->kernel < 0 || options->kernel >= SPHPA_KERNEL_COUNT)
        return sphpa_error_set(err, SPHPA_ERROR_UNKNOWN, "kernel %d; there are 0 to %d",
                               (int)options->kernel, (int)SPHPA_KERNEL_COUNT - 1);
    if (options->integrator != SPHPA_PREDICTOR_CORRECTOR && options->integrator != SPHPA_RK2)
        return sphpa_error_set(err, SPHPA_ERROR_UNKNOWN, "integrator %d; there are 0 and 1",
                               (int)options->integrator);
    if (options->cfl == 0.0) options->cfl = 0.3;
    if (options->force_cfl == 0.0) options->force_cfl = 0.2;
    if (options->flight == 0.0) options->flight = 0.5;
    if (options->dt_growth == 0.0) options->dt_growth = 1.25;
    if (options->skin == 0.0) options->skin = 0.2;
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_sim_allocate_(sphpa_sim *sim, const sphpa_particles *initial,
                                                sphpa_error *err) {
    sphpa_mask fields = SPHPA_BASIC_FIELDS | SPHPA_F(a) | SPHPA_F(du);
    sphpa_mask start = SPHPA_F(v) | SPHPA_F(u);
    for (int k = 0; k < sim->passes; k++) {
        fields |= sim->pass[k]->reads | sim->pass[k]->writes | sim->pass[k]->advances;
        start |= sim->pass[k]->advances;
    }
    sphpa_column columns[SPHPA_COLUMNS_MAX];
    int count = 0;
    for (int m = 0; m < sim->scene.modules; m++)
        for (int k = 0; k < sim->scene.module[m].columns; k++) {
            if (count >= SPHPA_COLUMNS_MAX)
                return sphpa_error_set(err, SPHPA_ERROR_RANGE, "more than %d columns",
                                       SPHPA_COLUMNS_MAX);
            columns[count++] = sim->scene.module[m].column[k];
        }
    sphpa_result result = sphpa_particles_create(&sim->p, initial->dim, initial->n, fields, start,
                                                 columns, count, err);
    if (result == SPHPA_OK) result = sphpa_particles_append(&sim->p, initial, err);
    if (result == SPHPA_OK && sim->p.alpha != NULL && initial->alpha == NULL)
        for (size_t i = 0; i < sim->p.n; i++) sim->p.alpha[i] = 1.0;
    for (size_t i = 0; i < initial->n && initial->alpha != NULL && sim->p.alpha == NULL; i++)
        if (initial->alpha[i] > 1.0 && result == SPHPA_OK)
            result = sphpa_error_set(err, SPHPA_ERROR_ALPHA,
                                     "particle %zu has alpha = %g, but no module of the scene "
                                     "knows pores; add sphpa_pores(), or make it with alpha = 1",
                                     i, initial->alpha[i]);
    return result;
}

SPHPA_PRIVATE_ void sphpa_sim_name_timings_(sphpa_sim *sim) {
    sphpa_stats *stats = &sim->stats;
    static const char *const parts[] = {"tree build", "tree sort", "neighbour lists", "integrate"};
    static const char *const limits[] = {"output time", "growth", "dt_max", "force"};
    for (int k = 0; k < SPHPA_TIME_PASSES; k++) stats->timing[k].name = parts[k];
    for (int k = 0; k < sim->passes; k++)
        stats->timing[SPHPA_TIME_PASSES + k].name = sim->pass[k]->name;
    stats->timings = SPHPA_TIME_PASSES + sim->passes;
    for (int k = 0; k <= SPHPA_LIMIT_FORCE_; k++) stats->limit[k].name = limits[k];
    stats->limits = SPHPA_LIMIT_FORCE_ + 1;
    for (int k = 0; k < sim->passes; k++)
        if (sim->pass[k]->stage == SPHPA_STAGE_LIMIT)
            stats->limit[stats->limits++].name = sim->pass[k]->name;
}

SPHPA_PRIVATE_ sphpa_result sphpa_sim_check_points_(sphpa_sim *sim, sphpa_error *err) {
    sphpa_result result = sphpa_particles_check(&sim->p, err);
    for (size_t i = 0; i < sim->p.n && result == SPHPA_OK; i++)
        if (sim->p.u[i] < 0.0)
            result = sphpa_error_set(err, SPHPA_ERROR_NEGATIVE,
                                     "particle %zu (id %lld): u = %g J/kg; start with u >= 0", i,
                                     (long long)sim->p.id[i], sim->p.u[i]);
    for (size_t i = 0; i < sim->p.n && result == SPHPA_OK; i++)
        if (!(sim->p.h[i] >= SPHPA_SHORTEST_ && sim->p.h[i] <= SPHPA_LONGEST_))
            result = sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                     "particle %zu (id %lld): h = %g m; pair sums hold powers of it "
                                     "from %g to %g m, in double from 1e-50 to 1e50 m", i,
                                     (long long)sim->p.id[i], (double)sim->p.h[i],
                                     (double)SPHPA_SHORTEST_, (double)SPHPA_LONGEST_);
    if (result == SPHPA_OK) result = sphpa_sim_build_tree_(sim, err);
    if (result != SPHPA_OK) return result;
    const sphpa_box *box = &sim->options.box;
    for (size_t k = 0; k < sim->p.n; k++)
        for (int a = 0; a < sim->p.dim; a++)
            if (box->periodic[a] &&
                sim->work->support[k] > 0.5 * (box->high[a] - box->low[a]))
                return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                       "particle %zu: its support of %g m reaches over half the "
                                       "periodic box (axis %d, %g m); more particles or a longer "
                                       "box", k, sim->work->support[k], a,
                                       box->high[a] - box->low[a]);
    size_t i = 0, j = 0;
    if (sphpa_tree_coincident(&sim->tree, &i, &j) == SPHPA_OK) return SPHPA_OK;
    const double *x = sim->p.x + 3 * i;
    return sphpa_error_set(err, SPHPA_ERROR_COINCIDENT,
                           "particles %zu and %zu both lie at (%.9g, %.9g, %.9g); remove one or "
                           "move it, and check that bodies do not overlap",
                           i, j, x[0], x[1], x[2]);
}

SPHPA_PRIVATE_ sphpa_result sphpa_sim_fill_(sphpa_sim *sim, const sphpa_particles *initial,
                                            sphpa_error *err) {
    sphpa_result result = sphpa_sim_order_passes_(sim, err);
    if (result == SPHPA_OK) result = sphpa_sim_allocate_(sim, initial, err);
    if (result != SPHPA_OK) return result;
    sphpa_sim_name_timings_(sim);
    sim->work = (struct sphpa_work *)sphpa_alloc_(1, sizeof(struct sphpa_work));
    if (sim->work == NULL) return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "out of memory");
    memset(sim->work, 0, sizeof(struct sphpa_work));
    result = sphpa_sim_check_points_(sim, err);
    for (int m = 0; m < sim->scene.modules && result == SPHPA_OK; m++) {
        const sphpa_module *module = &sim->scene.module[m];
        sim->work->set_up = m + 1;
        if (module->setup != NULL) result = module->setup(sim, module->params, err);
        if (result == SPHPA_OK && module->check != NULL)
            result = module->check(sim, module->params, err);
    }
    return result;
}

SPHPA_DEF sphpa_result sphpa_sim_create(sphpa_sim *sim, const sphpa_scene *scene,
                                        const sphpa_particles *initial,
                                        const sphpa_sim_options *options, sphpa_error *err) {
    memset(sim, 0, sizeof *sim);
    if (initial == NULL || initial->n == 0)
        return sphpa_error_set(err, SPHPA_ERROR_EMPTY,
                               "0 particles; make at least one body before the simulation");
    if (scene != NULL && scene->error.result != SPHPA_OK) {
        if (err != NULL) *err = scene->error;
        return scene->error.result;
    }
    if (scene == NULL || scene->modules == 0)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                               "the scene has no modules; add one, such as sphpa_gas(&gas)");
    sim->scene = *scene;
    if (options != NULL) sim->options = *options;
    sphpa_result result = sphpa_sim_defaults_(&sim->options, err);
    if (result == SPHPA_OK) result = sphpa_sim_fill_(sim, initial, err);
    if (result != SPHPA_OK) sphpa_sim_free(sim);
    return result;
}

SPHPA_DEF void sphpa_sim_free(sphpa_sim *sim) {
    if (sim == NULL) return;
    if (sim->work != NULL)
        for (int m = 0; m < sim->work->set_up; m++)
            if (sim->scene.module[m].teardown != NULL)
                sim->scene.module[m].teardown(sim, sim->scene.module[m].params);
    sphpa_particles_free(&sim->p);
    sphpa_tree_free(&sim->tree);
    sphpa_tree_lists_free(&sim->lists);
    sphpa_work_free_(sim->work);
    memset(sim, 0, sizeof *sim);
}

/* ---- what came of it ------------------------------------------------------------------------- */

/* sum: mass, and mass times position */
SPHPA_PRIVATE_ void sphpa_centre_of_block_(const sphpa_particles *p, size_t first, size_t last,
                                           double sum[4]) {
    for (int k = 0; k < 4; k++) sum[k] = 0.0;
    for (size_t i = first; i < last; i++) {
        double m = (double)p->m[i];
        sum[0] += m;
        for (size_t a = 0; a < 3; a++) sum[1 + a] += m * p->x[3 * i + a];
    }
}

/* sum: momentum, angular momentum about the centre, kinetic and internal energy */
SPHPA_PRIVATE_ void sphpa_totals_of_block_(const sphpa_particles *p, size_t first, size_t last,
                                           const double centre[3], double sum[8]) {
    for (int k = 0; k < 8; k++) sum[k] = 0.0;
    for (size_t i = first; i < last; i++) {
        double m = (double)p->m[i], x[3], v[3];
        for (size_t a = 0; a < 3; a++) {
            x[a] = p->x[3 * i + a] - centre[a];
            v[a] = (double)p->v[3 * i + a];
        }
        for (int a = 0; a < 3; a++) {
            int b = (a + 1) % 3, c = (a + 2) % 3;
            sum[a] += m * v[a];
            sum[3 + a] += m * (x[b] * v[c] - x[c] * v[b]);
        }
        sum[6] += 0.5 * m * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
        sum[7] += m * p->u[i];
    }
}

SPHPA_DEF sphpa_totals sphpa_sim_totals(const sphpa_sim *sim) {
    double centre[4] = {0.0, 0.0, 0.0, 0.0}, all[8] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    double part[8];
    size_t blocks = sphpa_blocks_(sim->p.n);
    for (size_t block = 0; block < blocks; block++) {
        sphpa_centre_of_block_(&sim->p, block * SPHPA_BLOCK_, sphpa_block_end_(block, sim->p.n),
                               part);
        for (int k = 0; k < 4; k++) centre[k] += part[k];
    }
    for (int a = 1; a < 4 && centre[0] > 0.0; a++) centre[a] /= centre[0];
    for (size_t block = 0; block < blocks; block++) {
        sphpa_totals_of_block_(&sim->p, block * SPHPA_BLOCK_, sphpa_block_end_(block, sim->p.n),
                               centre + 1, part);
        for (int k = 0; k < 8; k++) all[k] += part[k];
    }
    sphpa_totals totals;
    totals.mass = centre[0];
    for (int a = 0; a < 3; a++) totals.momentum[a] = all[a], totals.angular[a] = all[3 + a];
    totals.kinetic = all[6];
    totals.internal = all[7];
    totals.energy = all[6] + all[7];
    return totals;
}

/* a text that grows, and how long it would be */
typedef struct sphpa_text_ {
    char *text;
    size_t size, length;
} sphpa_text_;

SPHPA_PRIVATE_ void sphpa_text_add_(sphpa_text_ *out, const char *format, ...) SPHPA_PRINTF_(2, 3);
SPHPA_PRIVATE_ void sphpa_text_add_(sphpa_text_ *out, const char *format, ...) {
    va_list args;
    va_start(args, format);
    size_t left = out->length < out->size ? out->size - out->length : 0;
    int n = vsnprintf(left > 0 ? out->text + out->length : NULL, left, format, args);
    va_end(args);
    if (n > 0) out->length += (size_t)n;
}

SPHPA_PRIVATE_ void sphpa_report_fields_(const sphpa_sim *sim, sphpa_text_ *out) {
    sphpa_text_add_(out, "# bytes per particle, field by field (+ the copy at the step's start)\n");
    for (int k = 0; k < (int)SPHPA_FIELD_COUNT; k++) {
        sphpa_field_info info = sphpa_field_describe((sphpa_field)k);
        size_t start = sphpa_has_(sim->p.start_fields, k) ? info.bytes : 0;
        if (!sphpa_has_(sim->p.fields, k)) continue;
        if (start) sphpa_text_add_(out, "%-14s %4zu + %zu\n", info.name, info.bytes, start);
        else sphpa_text_add_(out, "%-14s %4zu\n", info.name, info.bytes);
    }
    for (int k = 0; k < sim->p.columns; k++)
        sphpa_text_add_(out, "%-14s %4zu (column)\n", sim->p.column[k].name,
                        (size_t)sim->p.column[k].components * sizeof(double));
    double n = (double)sim->p.n;
    const struct sphpa_work *work = sim->work;
    const sphpa_narrow_ *narrow = &work->narrow;
    size_t lists = sphpa_tree_lists_bytes(&sim->lists) +
                   (narrow->capacity + narrow->first_capacity + narrow->count_capacity) *
                       sizeof(uint32_t);
    sphpa_text_add_(out, "%-14s %4zu\n", "all fields", sphpa_particles_bytes_each(&sim->p));
    sphpa_text_add_(out, "%-14s %4.0f (scratch)\n", "tree",
                    (double)sphpa_tree_bytes(&sim->tree) / n);
    sphpa_text_add_(out, "%-14s %4.0f (scratch)\n", "lists", (double)lists / n);
    sphpa_text_add_(out, "%-14s %4.0f (scratch)\n", "pair records",
                    (double)work->records_bytes / n + 40.0);
    if (work->kept_bytes > 0)
        sphpa_text_add_(out, "%-14s %4.0f (scratch)\n", "kept by output",
                        (double)work->kept_bytes / n);
}

SPHPA_DEF size_t sphpa_sim_report(const sphpa_sim *sim, char *text, size_t size) {
    sphpa_text_ out = {text, text != NULL ? size : 0, 0};
    const sphpa_stats *stats = &sim->stats;
    double total = 0.0, steps = stats->steps > 0 ? (double)stats->steps : 1.0;
    for (int k = 0; k < stats->timings; k++) total += stats->timing[k].seconds;
    sphpa_text_add_(&out, "# %llu steps, %llu evaluations, %llu rebuilds of tree and lists, "
                    "%.1f neighbours\n", (unsigned long long)stats->steps,
                    (unsigned long long)stats->evaluations, (unsigned long long)stats->rebuilds,
                    stats->neighbours_mean);
    sphpa_text_add_(&out, "# part                    ms a step   share\n");
    for (int k = 0; k < stats->timings; k++) {
        const sphpa_timing *timing = &stats->timing[k];
        if (timing->calls == 0) continue;
        if (k > SPHPA_TIME_PASSES && timing->seconds <= 0.0) {
            sphpa_text_add_(&out, "%-24s in the line above: one traversal\n", timing->name);
            continue;
        }
        sphpa_text_add_(&out, "%-24s %10.4f  %5.1f %%\n", timing->name,
                        1e3 * timing->seconds / steps, 100.0 * timing->seconds / (total + 1e-300));
    }
    sphpa_text_add_(&out, "# what set the step\n");
    for (int k = 0; k < stats->limits; k++)
        if (stats->limit[k].steps > 0)
            sphpa_text_add_(&out, "%-24s %10llu  %5.1f %%\n", stats->limit[k].name,
                            (unsigned long long)stats->limit[k].steps,
                            100.0 * (double)stats->limit[k].steps / steps);
    sphpa_report_fields_(sim, &out);
    if (out.size > 0) text[out.length < size ? out.length : size - 1] = '\0';
    return out.length;
}

/* ---- what pair passes of several sections share ---------------------------------------------- */

/* grad_i W of both particles' kernels: own[k] (dx, dy, dz) with h of i, other[k] (dx, dy, dz) with
   h of j; they live in scratch[0] and scratch[3] */
SPHPA_PRIVATE_ void sphpa_pair_gradients_(const sphpa_sim *sim, const sphpa_neighbours *near,
                                          double **own, double **other) {
    double *gi = near->scratch[0], *gj = near->scratch[3];
    double *q = near->scratch[1], *df = near->scratch[2];
    double h = (double)sim->p.h[near->i], per_h = 1.0 / h, tiny = 1e-9 * h;
    int dim = sim->p.dim;
    size_t n = near->count;
    for (size_t k = 0; k < n; k++) q[k] = near->r[k] * per_h;
    sphpa_kernel_shape_batch(sim->options.kernel, dim, n, q, NULL, df);
    double scale = per_h * per_h * (dim > 1 ? per_h : 1.0) * (dim > 2 ? per_h : 1.0);
    for (size_t k = 0; k < n; k++) gi[k] = scale * df[k] / sphpa_max_(near->r[k], tiny);
    for (size_t k = 0; k < n; k++) q[k] = near->r[k] / near->h[k];
    sphpa_kernel_shape_batch(sim->options.kernel, dim, n, q, NULL, df);
    for (size_t k = 0; k < n; k++) {
        double per = 1.0 / near->h[k];
        double factor = per * per * (dim > 1 ? per : 1.0) * (dim > 2 ? per : 1.0);
        gj[k] = factor * df[k] / sphpa_max_(near->r[k], tiny);
    }
    *own = gi;
    *other = gj;
}

SPHPA_PRIVATE_ double sphpa_viscosity_a_(const sphpa_viscosity *v) {
    return v->a < 0.0 ? 0.0 : (v->a == 0.0 ? 1.0 : v->a);
}

SPHPA_PRIVATE_ double sphpa_viscosity_b_(const sphpa_viscosity *v) {
    return v->b < 0.0 ? 0.0 : (v->b == 0.0 ? 2.0 : v->b);
}

SPHPA_PRIVATE_ sphpa_result sphpa_viscosity_check_(const char *who, const sphpa_viscosity *v,
                                                   sphpa_error *err) {
    if (sphpa_finite_(v->a) && sphpa_finite_(v->b)) return SPHPA_OK;
    return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                           "%s: viscosity a = %g, b = %g; give finite numbers: 0 is the default, "
                           "negative none", who, v->a, v->b);
}

/* What the viscosity asks of a particle: halves, so that a pair's mean is a sum. */
typedef struct sphpa_viscous_ {
    sphpa_real h, rho, ac, f; /* h/2; rho/2; a c/2; Balsara's factor/2 */
} sphpa_viscous_;

typedef struct sphpa_viscous_lanes_ {
    sphpa_lanes_ h, rho, ac, f;
    sphpa_real b;
} sphpa_viscous_lanes_;

SPHPA_PRIVATE_ void sphpa_viscous_pack_(const sphpa_particles *p, double a, size_t i, double c,
                                        sphpa_viscous_ *out) {
    out->h = SPHPA_R(0.5) * p->h[i];
    out->rho = (sphpa_real)(0.5 * p->rho[i]);
    out->ac = (sphpa_real)(0.5 * a * c);
    out->f = p->balsara != NULL ? SPHPA_R(0.5) * p->balsara[i] : SPHPA_R(0.5);
}

/* at: the first record's */
SPHPA_FORCE_INLINE_ void sphpa_viscous_own_(const sphpa_viscosity *v, const sphpa_group *near,
                                            const sphpa_viscous_ *at, size_t stride,
                                            sphpa_viscous_lanes_ *own) {
    own->h = sphpa_lanes_load_(near, &at->h, stride);
    own->rho = sphpa_lanes_load_(near, &at->rho, stride);
    own->ac = sphpa_lanes_load_(near, &at->ac, stride);
    own->f = sphpa_lanes_load_(near, &at->f, stride);
    own->b = (sphpa_real)sphpa_viscosity_b_(v);
}

/* -Pi of all lanes with one neighbour and *mu = -mu, from v.x; both are 0 where the pair recedes */
SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_viscous_pi_(const sphpa_viscous_lanes_ *i,
                                                   const sphpa_viscous_ *j, sphpa_lanes_ vx,
                                                   sphpa_lanes_ r2, sphpa_lanes_ *mu) {
    sphpa_lanes_ h = i->h + j->h, rho = i->rho + j->rho;
    sphpa_lanes_ mu_rho = h * sphpa_lanes_above_(-vx) / ((SPHPA_R(0.01) * (h * h) + r2) * rho);
    *mu = mu_rho * rho;
    return -((i->f + j->f) * mu_rho * (i->b * *mu + (i->ac + j->ac)));
}

/* [s] Courant's limit with the viscosity's share (Monaghan 2005, eq. 5.2) */
SPHPA_PRIVATE_ double sphpa_courant_(const sphpa_sim *sim, const sphpa_viscosity *v, size_t i) {
    double a = sphpa_viscosity_a_(v), b = sphpa_viscosity_b_(v), c = (double)sim->p.c[i];
    double mu = sim->p.mu_max != NULL ? (double)sim->p.mu_max[i] : 0.0;
    return sim->options.cfl * (double)sim->p.h[i] / (c + 1.2 * (a * c + b * mu) + 1e-300);
}

/* [s] the step in which a particle moves by a share of h against the flow of all: what comes
   from beyond its support must be met before it is flown through, and no other limit knows of it */
SPHPA_PRIVATE_ double sphpa_flight_(const sphpa_sim *sim, const void *params, size_t i) {
    const struct sphpa_work *work = sim->work;
    double w2 = 0.0;
    (void)params;
    for (size_t a = 0; a < 3; a++) {
        double w = (double)sim->p.v[3 * i + a] - work->flow_v[a] -
                   work->flow_H * (sim->p.x[3 * i + a] - work->flow_x[a]);
        w2 += w * w;
    }
    return sim->options.flight * (double)sim->p.h[i] / (sqrt(w2) + 1e-300);
}

/* the next pass of a module under construction: a PARTICLE pass until told otherwise */
SPHPA_PRIVATE_ sphpa_pass *sphpa_module_pass_(sphpa_module *module, const char *name,
                                              sphpa_stage stage, sphpa_mask reads,
                                              sphpa_mask writes) {
    SPHPA_ASSERT(module->passes < SPHPA_MODULE_PASSES);
    sphpa_pass *pass = &module->pass[module->passes++];
    pass->name = name;
    pass->stage = stage;
    pass->reads = reads;
    pass->writes = writes;
    return pass;
}

SPHPA_EXTERN_C_END_
#endif /* >>sph */

#if SPHPA_WANT_GAS_ && !defined(SPHPA_GAS_DONE_)
#define SPHPA_GAS_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>gas   implementation
   ============================================================================================== */

SPHPA_PRIVATE_ double sphpa_gas_eta_(const sphpa_gas_params *gas) {
    return gas->eta > 0.0 ? gas->eta : 1.2;
}

/* ---- density --------------------------------------------------------------------------------- */

typedef struct sphpa_gas_point_ {
    double x[3];
    sphpa_real m;
} sphpa_gas_point_;

SPHPA_PRIVATE_ void sphpa_gas_pack_points_(const sphpa_sim *sim, const void *params, size_t first,
                                           size_t last, void *records) {
    (void)params;
    for (size_t i = first; i < last; i++) {
        sphpa_gas_point_ *point = (sphpa_gas_point_ *)records + i;
        sphpa_sim_position_(sim, i, point->x);
        point->m = sim->p.m[i];
    }
}

/* sum m w(q) and sum m q w'(q) over all that is listed, each lane with its own h */
SPHPA_FORCE_INLINE_ void sphpa_gas_sums_(const sphpa_group *near, int shape,
                                         const sphpa_lanes_ x[3], sphpa_lanes_ per_h,
                                         sphpa_lanes_ *sum, sphpa_lanes_ *slope) {
    const sphpa_gas_point_ *points = (const sphpa_gas_point_ *)(const void *)near->records;
    sphpa_lanes_ d[3], w, dw, sum_w = sphpa_lanes_of_(SPHPA_R(0.0)), sum_dw = sum_w;
    for (size_t k = 0; k < near->entries; k++) {
        const sphpa_gas_point_ *j = points + SPHPA_TREE_ENTRY_INDEX(near->list[k]);
        sphpa_lanes_ r2 = sphpa_lanes_apart_(near, near->list[k], j->x, x, d);
        sphpa_lanes_ q = sphpa_lanes_sqrt_(r2) * per_h;
        sphpa_lanes_kernel_(shape, q, &w, &dw);
        sum_w += w * j->m;
        sum_dw += q * dw * j->m;
    }
    *sum = sum_w;
    *slope = sum_dw;
}

SPHPA_NO_INLINE_ void sphpa_gas_sums_any_(const sphpa_group *near, int shape,
                                          const sphpa_lanes_ x[3], const sphpa_lanes_ *per_h,
                                          sphpa_lanes_ *sum, sphpa_lanes_ *slope) {
    if (shape == 0) sphpa_gas_sums_(near, 0, x, *per_h, sum, slope);
    else sphpa_gas_sums_(near, shape, x, *per_h, sum, slope);
}

/* One lane's search for the root of (1). */
typedef struct sphpa_gas_root_ {
    double m, h, low, high; /* bounds of h that close in */
    double near, reach;     /* up to here its list is complete, without its skin and with it */
    double rho, drho_dh;
    bool done;
} sphpa_gas_root_;

/* Newton in h, kept between bounds; a last change that is small enough is made without a new sum,
   the density follows by its derivative. The Gaussian ends in a jump: where rho leaps over the root
   as h grows past a neighbour, the bounds close on the jump, and h stays there. */
SPHPA_PRIVATE_ void sphpa_gas_root_step_(const sphpa_gas_params *gas, int dim,
                                         sphpa_gas_root_ *root) {
    double eta = sphpa_gas_eta_(gas), h_max = gas->h_max > 0.0 ? gas->h_max : HUGE_VAL;
    double tol = sphpa_max_(gas->h_tol > 0.0 ? gas->h_tol : 3e-4, SPHPA_SUM_ROUNDING_);
    double h = root->h, x = eta / h;
    double want = root->m * sphpa_kernel_power_(x, dim);
    double F = want - root->rho, dF = -dim * want / h - root->drho_dh, change = -F / dF;
    if (fabs(change) <= tol * h) {
        change = sphpa_min_(change, h_max - h);
        root->h += change;
        root->rho += root->drho_dh * change;
        root->done = true;
        return;
    }
    if (F > 0.0) root->low = h;
    else root->high = h;
    root->done = root->high - root->low <= 1e-14 * h;
    if (root->done) return;
    double next = dF < 0.0 ? h + change : (F > 0.0 ? 1.2 * h : 0.8 * h);
    next = sphpa_clamp_(next, 0.8 * h, 1.25 * h);
    if (!(next > root->low && next < root->high))
        next = root->high < HUGE_VAL ? 0.5 * (root->low + root->high) : 1.25 * h;
    next = sphpa_min_(next, h_max);
    root->done = next == h; /* at h_max */
    root->h = next;
    if (next <= root->reach) return;
    root->h *= 1.0 + 1e-6; /* its list is too short: told by h, so that new ones are made */
    root->done = true;
}

SPHPA_PRIVATE_ void sphpa_gas_root_begin_(const sphpa_sim *sim, const sphpa_gas_params *gas,
                                          size_t i, sphpa_gas_root_ *root) {
    double h = (double)sim->p.h[i];
    root->m = (double)sim->p.m[i];
    root->h = gas->h_max > 0.0 ? sphpa_min_(h, gas->h_max) : h;
    root->low = root->rho = root->drho_dh = 0.0;
    root->high = HUGE_VAL;
    root->near = sphpa_narrow_h_(sim, i);
    root->reach = sphpa_sim_reach_(sim, i) / sphpa_kernel_support(sim->options.kernel);
    root->done = false;
}

SPHPA_PRIVATE_ void sphpa_gas_root_end_(sphpa_sim *sim, const sphpa_gas_params *gas, size_t i,
                                        const sphpa_gas_root_ *root) {
    double h_max = gas->h_max > 0.0 ? gas->h_max : HUGE_VAL;
    sim->p.h[i] = (sphpa_real)root->h;
    sim->p.rho[i] = root->done ? root->rho : (double)NAN; /* which stops the simulation */
    sim->p.omega[i] = (sphpa_real)(
        root->h < h_max ? 1.0 + root->h * root->drho_dh / (sim->p.dim * root->rho) : 1.0);
}

/* Equations (1) and (2). All lanes are summed as long as one of them is not done. */
SPHPA_PRIVATE_ void sphpa_gas_density_(sphpa_sim *sim, void *params, const sphpa_group *near) {
    const sphpa_gas_params *gas = (const sphpa_gas_params *)params;
    sphpa_shape_ shape = sphpa_shape_of_(sim);
    sphpa_group all = *near;
    all.list = near->far;
    all.entries = near->far_entries;
    sphpa_gas_root_ root[SPHPA_LANES_];
    sphpa_lanes_ x[3], sum, slope, per_h = sphpa_lanes_of_(SPHPA_R(0.0));
    sphpa_lanes_own_x_(near, sizeof(sphpa_gas_point_), x);
    for (size_t l = 0; l < SPHPA_LANES_; l++)
        sphpa_gas_root_begin_(sim, gas, sphpa_lanes_particle_(near, l), &root[l]);
    bool done = false;
    for (int step = 0; step < 200 && !done; step++) {
        bool beyond = false; /* of what the list holds without its skin */
        for (size_t l = 0; l < SPHPA_LANES_; l++) {
            SPHPA_LANE_(per_h, l) = (sphpa_real)(1.0 / root[l].h);
            beyond = beyond || root[l].h > root[l].near;
        }
        sphpa_gas_sums_any_(beyond ? &all : near, shape.shape, x, &per_h, &sum, &slope);
        done = true;
        for (size_t l = 0; l < sphpa_lanes_used_(near); l++) {
            if (root[l].done) continue;
            double per = (double)SPHPA_LANE_(per_h, l), w = (double)SPHPA_LANE_(sum, l);
            double norm = shape.norm * sphpa_kernel_power_(per, shape.dim);
            root[l].rho = norm * w;
            root[l].drho_dh = -norm * per * (shape.dim * w + (double)SPHPA_LANE_(slope, l));
            sphpa_gas_root_step_(gas, shape.dim, &root[l]);
            done = done && root[l].done;
        }
    }
    for (size_t l = 0; l < sphpa_lanes_used_(near); l++)
        sphpa_gas_root_end_(sim, gas, near->first + l, &root[l]);
}

/* ---- Balsara's switch ------------------------------------------------------------------------ */

typedef struct sphpa_gas_flow_ {
    double x[3];
    sphpa_real v[3], m, per_h;
} sphpa_gas_flow_;

SPHPA_PRIVATE_ void sphpa_gas_pack_flow_(const sphpa_sim *sim, const void *params, size_t first,
                                         size_t last, void *records) {
    (void)params;
    for (size_t i = first; i < last; i++) {
        sphpa_gas_flow_ *flow = (sphpa_gas_flow_ *)records + i;
        sphpa_sim_position_(sim, i, flow->x);
        for (size_t a = 0; a < 3; a++) flow->v[a] = sim->p.v[3 * i + a];
        flow->m = sim->p.m[i];
        flow->per_h = (sphpa_real)(1.0 / (double)sim->p.h[i]);
    }
}

/* sum m w'(q)/r of v_ji . x_ij and of v_ji cross x_ij, that is div and curl of v but for a factor */
SPHPA_FORCE_INLINE_ void sphpa_gas_curl_(const sphpa_group *near, int shape, sphpa_lanes_ sum[4]) {
    const sphpa_gas_flow_ *flows = (const sphpa_gas_flow_ *)(const void *)near->records;
    sphpa_lanes_ x[3], v[3], d[3], w, dw;
    sphpa_lanes_own_x_(near, sizeof *flows, x);
    for (int a = 0; a < 3; a++) v[a] = sphpa_lanes_load_(near, &flows->v[a], sizeof *flows);
    sphpa_lanes_ per_h = sphpa_lanes_load_(near, &flows->per_h, sizeof *flows);
    for (int a = 0; a < 4; a++) sum[a] = sphpa_lanes_of_(SPHPA_R(0.0));
    for (size_t k = 0; k < near->entries; k++) {
        const sphpa_gas_flow_ *j = flows + SPHPA_TREE_ENTRY_INDEX(near->list[k]);
        sphpa_lanes_ r2 = sphpa_lanes_apart_(near, near->list[k], j->x, x, d);
        sphpa_lanes_ r = sphpa_lanes_sqrt_(r2);
        sphpa_lanes_kernel_(shape, r * per_h, &w, &dw);
        sphpa_lanes_ g = dw * sphpa_lanes_per_r_(r, r2) * j->m;
        sphpa_lanes_ vx = j->v[0] - v[0], vy = j->v[1] - v[1], vz = j->v[2] - v[2];
        sum[0] += g * (vx * d[0] + vy * d[1] + vz * d[2]);
        sum[1] += g * (vz * d[1] - vy * d[2]);
        sum[2] += g * (vx * d[2] - vz * d[0]);
        sum[3] += g * (vy * d[0] - vx * d[1]);
    }
}

SPHPA_PRIVATE_ void sphpa_gas_switch_(sphpa_sim *sim, void *params, const sphpa_group *near) {
    sphpa_shape_ shape = sphpa_shape_of_(sim);
    sphpa_lanes_ sum[4];
    (void)params;
    if (shape.shape == 0) sphpa_gas_curl_(near, 0, sum);
    else sphpa_gas_curl_(near, shape.shape, sum);
    for (size_t l = 0; l < sphpa_lanes_used_(near); l++) {
        size_t i = near->first + l;
        double h = (double)sim->p.h[i], part[4];
        double scale = shape.norm / (sphpa_kernel_power_(h, shape.dim + 1) * sim->p.rho[i]);
        for (int a = 0; a < 4; a++) part[a] = scale * (double)SPHPA_LANE_(sum[a], l);
        double curl = sqrt(part[1] * part[1] + part[2] * part[2] + part[3] * part[3]);
        double noise = 1e-4 * (double)sim->p.c[i] / h, div = fabs(part[0]);
        sim->p.balsara[i] = (sphpa_real)(div / (div + curl + noise + 1e-300));
    }
}

/* ---- pressure, forces and energy ------------------------------------------------------------- */

SPHPA_PRIVATE_ sphpa_result sphpa_gas_pressure_(sphpa_sim *sim, void *params, size_t first,
                                                size_t last, size_t *bad) {
    const sphpa_gas_params *gas = (const sphpa_gas_params *)params;
    for (size_t i = first; i < last; i++) {
        sphpa_eos_point point;
        const sphpa_eos *eos = &gas->eos[sim->p.material[i]];
        double u = sphpa_max_(sim->p.u[i], 0.0);
        sphpa_result result = eos->eval(eos->material, sim->p.rho[i], u, &point);
        if (result != SPHPA_OK) {
            *bad = i;
            return result;
        }
        sim->p.P[i] = (sphpa_real)point.P;
        sim->p.c[i] = (sphpa_real)point.c;
    }
    return SPHPA_OK;
}

/* What the pairs need of a neighbour, in one place. */
typedef struct sphpa_gas_record_ {
    double x[3];
    sphpa_real v[3], mean_v[3]; /* [m/s] of this evaluation, and of the middle of its kick */
    sphpa_real m, force;        /* [kg]; P/(Omega rho^2) [m5/(kg s2)] */
    sphpa_real per_h, scale;    /* norm/h^(dim+1): dW/dr = scale w'(q) */
    sphpa_viscous_ viscous;
} sphpa_gas_record_;

SPHPA_PRIVATE_ void sphpa_gas_pack_(const sphpa_sim *sim, const void *params, size_t first,
                                    size_t last, void *records) {
    const sphpa_particles *p = &sim->p;
    sphpa_shape_ shape = sphpa_shape_of_(sim);
    double a = sphpa_viscosity_a_(&((const sphpa_gas_params *)params)->viscosity);
    for (size_t i = first; i < last; i++) {
        sphpa_gas_record_ *record = (sphpa_gas_record_ *)records + i;
        double per_h = 1.0 / (double)p->h[i];
        sphpa_sim_position_(sim, i, record->x);
        for (size_t k = 0; k < 3; k++) {
            record->v[k] = p->v[3 * i + k];
            record->mean_v[k] = (sphpa_real)sphpa_sim_mean_v_(sim, 3 * i + k);
        }
        record->m = p->m[i];
        record->force =
            (sphpa_real)((double)p->P[i] / ((double)p->omega[i] * p->rho[i] * p->rho[i]));
        sphpa_viscous_pack_(p, a, i, (double)p->c[i], &record->viscous);
        record->per_h = (sphpa_real)per_h;
        record->scale = (sphpa_real)(shape.norm * sphpa_kernel_power_(per_h, shape.dim + 1));
    }
}

/* the velocity of the middle of the kick is all in them that follows a */
SPHPA_PRIVATE_ void sphpa_gas_repack_(const sphpa_sim *sim, const void *params, size_t first,
                                      size_t last, void *records) {
    sphpa_gas_record_ *record = (sphpa_gas_record_ *)records;
    (void)params;
    for (size_t i = first; i < last; i++)
        for (size_t k = 0; k < 3; k++)
            record[i].mean_v[k] = (sphpa_real)sphpa_sim_mean_v_(sim, 3 * i + k);
}

/* The lanes' own numbers, and the pair at hand: what forces and energy have in common. */
typedef struct sphpa_gas_pair_ {
    sphpa_lanes_ x[3], v[3], force, per_h, scale;
    sphpa_viscous_lanes_ viscous;
    sphpa_lanes_ d[3], vx, gi, gj; /* x_ij; v_ij.x_ij; m_j (dW/dr)/r with h of i and of j */
    sphpa_lanes_ pi, mu;           /* -Pi_ij and -mu; 0 where the pair recedes */
} sphpa_gas_pair_;

SPHPA_FORCE_INLINE_ void sphpa_gas_own_(const sphpa_gas_params *gas, const sphpa_group *near,
                                        sphpa_gas_pair_ *i) {
    const sphpa_gas_record_ *records = (const sphpa_gas_record_ *)(const void *)near->records;
    sphpa_lanes_own_x_(near, sizeof *records, i->x);
    for (int a = 0; a < 3; a++) i->v[a] = sphpa_lanes_load_(near, &records->v[a], sizeof *records);
    i->force = sphpa_lanes_load_(near, &records->force, sizeof *records);
    i->per_h = sphpa_lanes_load_(near, &records->per_h, sizeof *records);
    i->scale = sphpa_lanes_load_(near, &records->scale, sizeof *records);
    sphpa_viscous_own_(&gas->viscosity, near, &records->viscous, sizeof *records, &i->viscous);
}

/* the same numbers in the forces and in the energy, so that they balance */
SPHPA_FORCE_INLINE_ void sphpa_gas_meet_(const sphpa_group *near, int shape, uint32_t entry,
                                         const sphpa_gas_record_ *j, sphpa_gas_pair_ *i) {
    sphpa_lanes_ w, dw, r2 = sphpa_lanes_apart_(near, entry, j->x, i->x, i->d);
    sphpa_lanes_ r = sphpa_lanes_sqrt_(r2), per_r = j->m * sphpa_lanes_per_r_(r, r2);
    sphpa_lanes_kernel_(shape, r * i->per_h, &w, &dw);
    i->gi = i->scale * dw * per_r;
    sphpa_lanes_kernel_(shape, r * j->per_h, &w, &dw);
    i->gj = j->scale * dw * per_r;
    i->vx = (i->v[0] - j->v[0]) * i->d[0] + (i->v[1] - j->v[1]) * i->d[1] +
            (i->v[2] - j->v[2]) * i->d[2];
    i->pi = sphpa_viscous_pi_(&i->viscous, &j->viscous, i->vx, r2, &i->mu);
}

/* lane by lane: the acceleration, but for its sign, sum m_j v_ij . grad W_i, and the largest |mu| */
typedef struct sphpa_gas_pushed_ {
    sphpa_real a[3][SPHPA_LANES_], flow[SPHPA_LANES_], mu_max[SPHPA_LANES_];
} sphpa_gas_pushed_;

SPHPA_FORCE_INLINE_ void sphpa_gas_push_(const sphpa_gas_params *gas, const sphpa_group *near,
                                         int shape, sphpa_gas_pushed_ *out) {
    const sphpa_gas_record_ *records = (const sphpa_gas_record_ *)(const void *)near->records;
    sphpa_gas_pair_ i;
    sphpa_lanes_ zero = sphpa_lanes_of_(SPHPA_R(0.0)), most = zero, flow = zero;
    sphpa_lanes_ sx = zero, sy = zero, sz = zero;
    sphpa_gas_own_(gas, near, &i);
    for (size_t k = 0; k < near->entries; k++) {
        const sphpa_gas_record_ *j = records + SPHPA_TREE_ENTRY_INDEX(near->list[k]);
        sphpa_gas_meet_(near, shape, near->list[k], j, &i);
        sphpa_lanes_ both = i.gi + i.gj, pi = SPHPA_R(0.5) * i.pi;
        sphpa_lanes_ g = i.force * i.gi + j->force * i.gj - pi * both;
        sx += g * i.d[0];
        sy += g * i.d[1];
        sz += g * i.d[2];
        flow += i.gi * i.vx;
        most = sphpa_lanes_max_(most, SPHPA_LANES_IF_(both < SPHPA_R(0.0), i.mu));
    }
    memcpy(out->a[0], &sx, sizeof sx);
    memcpy(out->a[1], &sy, sizeof sy);
    memcpy(out->a[2], &sz, sizeof sz);
    memcpy(out->flow, &flow, sizeof flow);
    memcpy(out->mu_max, &most, sizeof most);
}

SPHPA_PRIVATE_ void sphpa_gas_forces_(sphpa_sim *sim, void *params, const sphpa_group *near) {
    const sphpa_gas_params *gas = (const sphpa_gas_params *)params;
    sphpa_shape_ shape = sphpa_shape_of_(sim);
    sphpa_gas_pushed_ out;
    if (shape.shape == 0) sphpa_gas_push_(gas, near, 0, &out);
    else sphpa_gas_push_(gas, near, shape.shape, &out);
    for (size_t l = 0; l < sphpa_lanes_used_(near); l++) {
        size_t i = near->first + l;
        for (size_t a = 0; a < 3; a++) sim->p.a[3 * i + a] -= out.a[a][l];
        sim->p.mu_max[i] = out.mu_max[l];
        sim->p.div_v[i] =
            (sphpa_real)(-(double)out.flow[l] / ((double)sim->p.omega[i] * sim->p.rho[i]));
    }
}

/* the work of the pair forces on the way of the time-centred velocities */
SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_gas_work_(const sphpa_gas_params *gas,
                                                 const sphpa_group *near, int shape) {
    const sphpa_gas_record_ *records = (const sphpa_gas_record_ *)(const void *)near->records;
    sphpa_gas_pair_ i;
    sphpa_lanes_ v[3], sum = sphpa_lanes_of_(SPHPA_R(0.0));
    sphpa_gas_own_(gas, near, &i);
    for (int a = 0; a < 3; a++)
        v[a] = sphpa_lanes_load_(near, &records->mean_v[a], sizeof *records);
    for (size_t k = 0; k < near->entries; k++) {
        const sphpa_gas_record_ *j = records + SPHPA_TREE_ENTRY_INDEX(near->list[k]);
        sphpa_gas_meet_(near, shape, near->list[k], j, &i);
        sphpa_lanes_ vx = (v[0] - j->mean_v[0]) * i.d[0] + (v[1] - j->mean_v[1]) * i.d[1] +
                          (v[2] - j->mean_v[2]) * i.d[2];
        sum += vx * (i.force * i.gi - SPHPA_R(0.25) * i.pi * (i.gi + i.gj));
    }
    return sum;
}

SPHPA_PRIVATE_ void sphpa_gas_energy_(sphpa_sim *sim, void *params, const sphpa_group *near) {
    const sphpa_gas_params *gas = (const sphpa_gas_params *)params;
    sphpa_shape_ shape = sphpa_shape_of_(sim);
    sphpa_lanes_ sum;
    if (shape.shape == 0) sum = sphpa_gas_work_(gas, near, 0);
    else sum = sphpa_gas_work_(gas, near, shape.shape);
    for (size_t l = 0; l < sphpa_lanes_used_(near); l++)
        sim->p.du[near->first + l] += SPHPA_LANE_(sum, l);
}

/* (5), for those who want it: neighbours one by one; both partners see the same numbers */
SPHPA_PRIVATE_ void sphpa_gas_conduct_(sphpa_sim *sim, void *params, const sphpa_neighbours *near) {
    const sphpa_gas_params *gas = (const sphpa_gas_params *)params;
    const sphpa_particles *p = &sim->p;
    double *gi, *gj, sum = 0.0;
    size_t i = near->i;
    sphpa_pair_gradients_(sim, near, &gi, &gj);
    for (size_t k = 0; k < near->count; k++) {
        size_t j = near->j[k];
        double rho = 0.5 * (p->rho[i] + p->rho[j]);
        double speed = sqrt(fabs((double)p->P[i] - (double)p->P[j]) / rho);
        sum += (double)p->m[j] * speed * (p->u[i] - p->u[j]) / rho * 0.5 * (gi[k] + gj[k]) *
               near->r[k];
    }
    sim->p.du[i] = (sphpa_real)((double)sim->p.du[i] + gas->conduction * sum);
}

SPHPA_PRIVATE_ double sphpa_gas_courant_(const sphpa_sim *sim, const void *params, size_t i) {
    return sphpa_courant_(sim, &((const sphpa_gas_params *)params)->viscosity, i);
}

SPHPA_PRIVATE_ sphpa_result sphpa_gas_setup_(sphpa_sim *sim, void *params, sphpa_error *err) {
    const sphpa_gas_params *gas = (const sphpa_gas_params *)params;
    bool eos = gas->eos != NULL && gas->materials > 0;
    for (int k = 0; k < gas->materials && eos; k++) eos = gas->eos[k].eval != NULL;
    if (!eos)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                               "gas: no equation of state; set eos and materials");
    const sphpa_number_ all[4] = {{"eta", gas->eta},
                                  {"h_max", gas->h_max},
                                  {"h_tol", gas->h_tol},
                                  {"conduction", gas->conduction}};
    sphpa_result result = sphpa_numbers_check_("gas", all, 4, err);
    double self = sphpa_kernel_w(sim->options.kernel, sim->p.dim, 0.0, 1.0);
    double eta = sphpa_gas_eta_(gas), least = pow(self, 1.0 / sim->p.dim);
    if (result == SPHPA_OK && !(eta > least)) /* W(0) alone is denser than (1) allows */
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "gas: eta = %g; a particle's own kernel asks for more than %.3g "
                               "with this kernel in %d-D, give 1.2 or so", eta, least, sim->p.dim);
    return result == SPHPA_OK ? sphpa_viscosity_check_("gas", &gas->viscosity, err) : result;
}

SPHPA_PRIVATE_ sphpa_result sphpa_gas_check_all_(const sphpa_sim *sim, const void *params,
                                                 sphpa_error *err) {
    return sphpa_materials_check_(sim, "gas", ((const sphpa_gas_params *)params)->materials, err);
}

SPHPA_PRIVATE_ sphpa_pass *sphpa_gas_group_(
    sphpa_module *module, const char *name, sphpa_stage stage, sphpa_mask reads, sphpa_mask writes,
    void (*group)(sphpa_sim *, void *, const sphpa_group *),
    void (*pack)(const sphpa_sim *, const void *, size_t, size_t, void *), size_t bytes) {
    sphpa_pass *pass = sphpa_module_pass_(module, name, stage, reads, writes);
    pass->kind = SPHPA_PASS_PAIR;
    pass->group = group;
    pass->pack = pack;
    pass->record_bytes = bytes;
    return pass;
}

SPHPA_DEF sphpa_module sphpa_gas(sphpa_gas_params *params) {
    sphpa_module module;
    memset(&module, 0, sizeof module);
    module.name = "gas";
    module.params = params;
    module.setup = sphpa_gas_setup_;
    module.check = sphpa_gas_check_all_;
    sphpa_mask shape = SPHPA_F(x) | SPHPA_F(m) | SPHPA_F(h), flow = SPHPA_F(v) | SPHPA_F(rho);
    sphpa_mask all = shape | flow | SPHPA_F(u) | SPHPA_F(P) | SPHPA_F(c) | SPHPA_F(omega);
    sphpa_gas_group_(&module, "gas density", SPHPA_STAGE_DENSITY, shape,
                     SPHPA_F(h) | SPHPA_F(rho) | SPHPA_F(omega), sphpa_gas_density_,
                     sphpa_gas_pack_points_, sizeof(sphpa_gas_point_));
    if (params->viscosity.balsara) /* after the pressure, for it reads c */
        sphpa_gas_group_(&module, "gas balsara", SPHPA_STAGE_STRESS, shape | flow | SPHPA_F(c),
                         SPHPA_F(balsara), sphpa_gas_switch_, sphpa_gas_pack_flow_,
                         sizeof(sphpa_gas_flow_));
    sphpa_pass *pressure = sphpa_module_pass_(&module, "gas pressure", SPHPA_STAGE_PRESSURE,
                                              SPHPA_F(rho) | SPHPA_F(u), SPHPA_F(P) | SPHPA_F(c));
    pressure->particle = sphpa_gas_pressure_;
    sphpa_gas_group_(&module, "gas forces", SPHPA_STAGE_FORCES, all,
                     SPHPA_F(a) | SPHPA_F(mu_max) | SPHPA_F(div_v), sphpa_gas_forces_,
                     sphpa_gas_pack_, sizeof(sphpa_gas_record_));
    sphpa_gas_group_(&module, "gas energy", SPHPA_STAGE_ENERGY, all | SPHPA_F(a), SPHPA_F(du),
                     sphpa_gas_energy_, sphpa_gas_pack_, sizeof(sphpa_gas_record_))
        ->repack = sphpa_gas_repack_;
    if (params->conduction > 0.0) {
        sphpa_pass *conduction = sphpa_module_pass_(&module, "gas conduction", SPHPA_STAGE_ENERGY,
                                                    all | SPHPA_F(a), SPHPA_F(du));
        conduction->kind = SPHPA_PASS_PAIR;
        conduction->pair = sphpa_gas_conduct_;
    }
    sphpa_pass *courant = sphpa_module_pass_(&module, "courant", SPHPA_STAGE_LIMIT,
                                             SPHPA_F(h) | SPHPA_F(c) | SPHPA_F(mu_max), 0);
    courant->kind = SPHPA_PASS_REDUCE;
    courant->limit = sphpa_gas_courant_;
    sphpa_pass *flight = sphpa_module_pass_(&module, "flight", SPHPA_STAGE_LIMIT,
                                            SPHPA_F(h) | SPHPA_F(v), 0);
    flight->kind = SPHPA_PASS_REDUCE;
    flight->limit = sphpa_flight_;
    return module;
}

SPHPA_EXTERN_C_END_
#endif /* >>gas */

#if SPHPA_WANT_SOLID_ && !defined(SPHPA_SOLID_DONE_)
#define SPHPA_SOLID_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>solid   implementation
   ============================================================================================== */

SPHPA_PRIVATE_ const sphpa_solid_material *sphpa_solid_material_(const sphpa_solid_params *solid,
                                                                 const sphpa_sim *sim, size_t i) {
    return &solid->material[sim->p.material[i]];
}

/* [1] the largest h of a particle in units of its h0 */
SPHPA_PRIVATE_ double sphpa_solid_h_min_(const sphpa_solid_params *solid) {
    return solid->h_min > 0.0 ? solid->h_min : 0.6;
}

SPHPA_PRIVATE_ double sphpa_solid_h_max_(const sphpa_solid_params *solid,
                                         const sphpa_solid_material *material) {
    return material->h_max > 0.0 ? material->h_max : solid->h_max > 0.0 ? solid->h_max : 1.5;
}

/* ---- gradients: equations (1) and (2) -------------------------------------------------------- */

/* What a neighbour's gradients ask of a particle. */
typedef struct sphpa_solid_point_ {
    double x[3];
    sphpa_real v[3];         /* [m/s] */
    sphpa_real per_h, scale; /* half of norm/h^(dim+1) */
    sphpa_real volume, part; /* [m^dim] m/rho; m rho^(p-1), p of (2) */
    sphpa_real root;         /* rho^p */
    sphpa_real body, broken; /* 1: D = 1, else 0 */
    sphpa_real relaxed;      /* 1: not under pressure, else 0 */
} sphpa_solid_point_;

/* all but the velocity */
SPHPA_FORCE_INLINE_ void sphpa_solid_point_of_(const sphpa_sim *sim,
                                               const sphpa_solid_params *solid,
                                               const sphpa_shape_ *shape, size_t i, double rho,
                                               sphpa_solid_point_ *point) {
    const sphpa_particles *p = &sim->p;
    double per_h = 1.0 / (double)p->h[i], root = solid->correction ? sqrt(rho) : rho;
    double volume = (double)p->m[i] / rho;
    sphpa_sim_position_(sim, i, point->x);
    point->per_h = (sphpa_real)per_h;
    point->scale = (sphpa_real)(0.5 * shape->norm * sphpa_kernel_power_(per_h, shape->dim + 1));
    point->volume = (sphpa_real)volume;
    point->part = (sphpa_real)(volume * root);
    point->root = (sphpa_real)root;
    point->body = (sphpa_real)p->body[i];
    point->broken = p->D != NULL && p->D[i] >= SPHPA_R(1.0) ? SPHPA_R(1.0) : SPHPA_R(0.0);
    point->relaxed = p->P[i] > SPHPA_R(0.0) ? SPHPA_R(0.0) : SPHPA_R(1.0);
}

SPHPA_PRIVATE_ void sphpa_solid_pack_points_(const sphpa_sim *sim, const void *params, size_t first,
                                             size_t last, void *records) {
    const sphpa_particles *p = &sim->p;
    sphpa_shape_ shape = sphpa_shape_of_(sim);
    for (size_t i = first; i < last; i++) {
        sphpa_solid_point_ *point = (sphpa_solid_point_ *)records + i;
        for (size_t a = 0; a < 3; a++) point->v[a] = p->v[3 * i + a];
        /* rho of this evaluation, by the last rate: the density itself waits for the gradient, and
           C goes into forces with the density that is yet to come */
        sphpa_solid_point_of_(sim, (const sphpa_solid_params *)params, &shape, i,
                              p->start.rho[i] * exp(-sim->dt_stage * (double)p->div_v[i]), point);
    }
}

/* Raw sums over neighbours: w (v_j - v_i) outer grad W and w (x_j - x_i) outer grad W, of (2). */
typedef struct sphpa_solid_sums_ {
    double v[9], x[6], count; /* x: xx yy zz xy yz xz */
} sphpa_solid_sums_;

/* What a particle's rates are made of: sums over all neighbours that count, and over those of them
   that do not strain the solid. */
typedef struct sphpa_solid_rates_ {
    sphpa_solid_sums_ all, left_out;
} sphpa_solid_rates_;

/* The same sums of all lanes. */
typedef struct sphpa_solid_lane_sums_ {
    sphpa_lanes_ v[9], x[6], count;
} sphpa_solid_lane_sums_;

SPHPA_FORCE_INLINE_ void sphpa_solid_zero_(sphpa_solid_lane_sums_ *sums) {
    sphpa_lanes_ zero = sphpa_lanes_of_(SPHPA_R(0.0));
    for (int k = 0; k < 9; k++) sums->v[k] = zero;
    for (int k = 0; k < 6; k++) sums->x[k] = zero;
    sums->count = zero;
}

/* g: the weight; d = x_i - x_j; v = v_j - v_i. What asks for C alone is left out without it. */
SPHPA_FORCE_INLINE_ void sphpa_solid_sum_(sphpa_solid_lane_sums_ *sums, bool corrected,
                                          sphpa_lanes_ g, const sphpa_lanes_ d[3],
                                          const sphpa_lanes_ v[3]) {
    sphpa_lanes_ gx = g * d[0], gy = g * d[1], gz = g * d[2];
    for (int a = 0; a < 3; a++) {
        sums->v[3 * a] += v[a] * gx;
        sums->v[3 * a + 1] += v[a] * gy;
        sums->v[3 * a + 2] += v[a] * gz;
    }
    if (!corrected) return;
    sums->x[0] -= d[0] * gx, sums->x[1] -= d[1] * gy, sums->x[2] -= d[2] * gz;
    sums->x[3] -= d[0] * gy, sums->x[4] -= d[1] * gz, sums->x[5] -= d[0] * gz;
    sums->count += SPHPA_LANES_IF_(g < SPHPA_R(0.0), sphpa_lanes_of_(SPHPA_R(1.0)));
}

/* lane l's sums, with the weight's 1/root of its particle */
SPHPA_PRIVATE_ void sphpa_solid_lane_(const sphpa_solid_lane_sums_ *lanes, size_t l, double per,
                                      sphpa_solid_sums_ *sums) {
    const sphpa_real *from = (const sphpa_real *)(const void *)lanes;
    for (size_t k = 0; k < 9; k++) sums->v[k] = per * (double)from[k * SPHPA_LANES_ + l];
    for (size_t k = 0; k < 6; k++) sums->x[k] = per * (double)from[(9 + k) * SPHPA_LANES_ + l];
    sums->count = (double)from[15 * SPHPA_LANES_ + l];
}

/* The lanes' own numbers in a loop over pairs. */
typedef struct sphpa_solid_own_ {
    sphpa_lanes_ x[3], v[3], per_h, scale;
    sphpa_lanes_ root, body, broken;   /* these where not all is of one kind */
    sphpa_mask_ choosy, relaxed;       /* not strained by all; not under pressure */
    bool by_volume, stick, any;        /* weights of (2) between bodies; of the parameters */
} sphpa_solid_own_;

SPHPA_FORCE_INLINE_ void sphpa_solid_own_of_(const sphpa_solid_params *solid,
                                             const sphpa_group *near,
                                             const sphpa_solid_point_ *points, size_t stride,
                                             bool mixed, sphpa_solid_own_ *own) {
    sphpa_lanes_own_x_(near, stride, own->x);
    for (int a = 0; a < 3; a++) own->v[a] = sphpa_lanes_load_(near, &points->v[a], stride);
    own->per_h = sphpa_lanes_load_(near, &points->per_h, stride);
    own->scale = sphpa_lanes_load_(near, &points->scale, stride);
    own->by_volume = !solid->correction;
    own->stick = solid->bodies_stick != 0;
    own->any = solid->any_neighbour != 0;
    if (!mixed) return;
    own->root = sphpa_lanes_load_(near, &points->root, stride);
    own->body = sphpa_lanes_load_(near, &points->body, stride);
    own->broken = sphpa_lanes_load_(near, &points->broken, stride);
    sphpa_lanes_ whole = sphpa_lanes_of_(own->any ? SPHPA_R(-1.0) : SPHPA_R(0.5));
    own->choosy = (sphpa_mask_)(own->broken < whole);
    own->relaxed = (sphpa_mask_)(sphpa_lanes_load_(near, &points->relaxed, stride) > SPHPA_R(0.5));
}

/* whether all of the group and all near it are whole, or all broken, and of one body: then pairs
   need not be told apart */
SPHPA_PRIVATE_ bool sphpa_solid_mixed_(const sphpa_group *near, size_t stride) {
    const char *records = near->records;
    const sphpa_solid_point_ *first =
        (const sphpa_solid_point_ *)(const void *)(records + near->first * stride);
    sphpa_real body = first->body, broken = first->broken;
    for (size_t k = 0; k < near->entries; k++) { /* the group itself is in the list */
        size_t at = SPHPA_TREE_ENTRY_INDEX(near->list[k]) * stride;
        const sphpa_solid_point_ *j = (const sphpa_solid_point_ *)(const void *)(records + at);
        if (j->body != body || j->broken != broken) return true;
    }
    return false;
}

/* (dW/dr)/r of both, the mean */
SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_solid_slope_(const sphpa_solid_own_ *i,
                                                    const sphpa_solid_point_ *j, int shape,
                                                    sphpa_lanes_ r, sphpa_lanes_ r2) {
    sphpa_lanes_ w, own, other;
    sphpa_lanes_kernel_(shape, r * i->per_h, &w, &own);
    sphpa_lanes_kernel_(shape, r * j->per_h, &w, &other);
    return (i->scale * own + j->scale * other) * sphpa_lanes_per_r_(r, r2);
}

/* Neighbour j's part in the sums of all lanes; g: (dW/dr)/r. Who counts, and for what, is decided
   here alone: see (2). What asks whether pairs are of a kind is left out where all are (mixed). */
SPHPA_FORCE_INLINE_ void sphpa_solid_gather_(const sphpa_solid_own_ *i, const sphpa_solid_point_ *j,
                                             bool corrected, bool mixed, sphpa_lanes_ g,
                                             const sphpa_lanes_ d[3], const sphpa_lanes_ v[3],
                                             sphpa_solid_lane_sums_ *all,
                                             sphpa_solid_lane_sums_ *left_out) {
    if (!mixed) {
        sphpa_solid_sum_(all, corrected, g * j->part, d, v);
        return;
    }
    sphpa_lanes_ vx = v[0] * d[0] + v[1] * d[1] + v[2] * d[2], part = sphpa_lanes_of_(j->part);
    sphpa_mask_ foreign = (sphpa_mask_)(i->body != j->body);
    sphpa_mask_ gone = (sphpa_mask_)(sphpa_lanes_of_(j->broken) > SPHPA_R(0.5));
    sphpa_mask_ out = i->choosy & (gone | foreign);
    sphpa_mask_ loose = i->choosy & gone;
    if (!i->stick) loose = loose | foreign;
    sphpa_mask_ leaves = i->relaxed & loose & (sphpa_mask_)(vx < SPHPA_R(0.0));
    if (i->by_volume) part = sphpa_lanes_pick_(foreign, j->volume * i->root, part);
    g = g * part;
    g = g - SPHPA_LANES_IF_(leaves, g); /* it leaves, and pulls at nothing */
    sphpa_solid_sum_(all, corrected, g, d, v);
    sphpa_solid_sum_(left_out, true, SPHPA_LANES_IF_(out, g), d, v);
}

SPHPA_PRIVATE_ double sphpa_ramp_(double a, double zero, double one) {
    return sphpa_clamp_((a - zero) / (one - zero), 0.0, 1.0);
}

/* C of (1) from the sum M: its inverse, blended and not switched, for a switch flickers; *share is
   that of the inverse */
SPHPA_PRIVATE_ sphpa_sym3 sphpa_solid_correction_(const double x[6], double count, int dim,
                                                  double *share) {
    static const double few[4] = {0.0, 0.0, 3.0, 6.0}, enough[4] = {1.0, 1.0, 5.0, 10.0};
    double xx = x[0], yy = dim > 1 ? x[1] : 1.0, zz = dim > 2 ? x[2] : 1.0;
    double xy = x[3], yz = x[4], xz = x[5];
    double a = yy * zz - yz * yz, b = xz * yz - xy * zz, c = xy * yz - xz * yy;
    double det = xx * a + xy * b + xz * c;
    double s = sphpa_max_(1.0, (x[0] + x[1] + x[2]) / dim); /* beyond dim x is 0 */
    double volume = sphpa_kernel_power_(s, dim);
    sphpa_sym3 C = {1.0 / s, 1.0 / s, 1.0 / s, 0.0, 0.0, 0.0};
    *share = 0.0;
    if (!(det > 0.05 * volume)) return C; /* det(s C) > 20: far outside of what is blended in */
    *share = sphpa_ramp_(volume / det, 8.0, 5.0) * sphpa_ramp_(count, few[dim], enough[dim]);
    double per = *share / det, rest = (1.0 - *share) / s;
    C.xx = per * a + rest;
    C.yy = per * (xx * zz - xz * xz) + rest;
    C.zz = per * (xx * yy - xy * xy) + rest;
    C.xy = per * b;
    C.yz = per * (xy * xz - xx * yz);
    C.xz = per * c;
    return C;
}

/* L = A C, row-major */
SPHPA_FORCE_INLINE_ void sphpa_solid_times_(const double A[9], const sphpa_sym3 *C, double L[9]) {
    for (int r = 0; r < 3; r++) {
        double x = A[3 * r], y = A[3 * r + 1], z = A[3 * r + 2];
        L[3 * r] = x * C->xx + y * C->xy + z * C->xz;
        L[3 * r + 1] = x * C->xy + y * C->yy + z * C->yz;
        L[3 * r + 2] = x * C->xz + y * C->yz + z * C->zz;
    }
}

/* w of the rigid rotation that the sums tell of: A = [w] M gives (tr M - M) w = 2 axial(A), which
   has an answer where M has no inverse; 0 where all neighbours are in line */
SPHPA_PRIVATE_ void sphpa_solid_spin_(const double A[9], const double M[6], double w[3]) {
    double xx = M[1] + M[2], yy = M[2] + M[0], zz = M[0] + M[1], trace = M[0] + M[1] + M[2];
    double xy = -M[3], yz = -M[4], xz = -M[5];
    double p = A[7] - A[5], q = A[2] - A[6], r = A[3] - A[1];
    double a = yy * zz - yz * yz, b = xz * yz - xy * zz, c = xy * yz - xz * yy;
    double det = xx * a + xy * b + xz * c;
    w[0] = w[1] = w[2] = 0.0;
    if (!(det > 1e-6 * trace * trace * trace)) return;
    w[0] = (a * p + b * q + c * r) / det;
    w[1] = (b * p + (xx * zz - xz * xz) * q + (xy * xz - xx * yz) * r) / det;
    w[2] = (c * p + (xy * xz - xx * yz) * q + (xx * yy - xy * xy) * r) / det;
}

/* L of (2). Where the inverse is not used whole, the rotation is taken out first and put back: a
   body that turns rigidly is not strained, however few neighbours a particle has. */
SPHPA_PRIVATE_ sphpa_sym3 sphpa_solid_gradient_(const sphpa_solid_sums_ *sums, int dim,
                                                bool correction, double L[9]) {
    sphpa_sym3 C = {1.0, 1.0, 1.0, 0.0, 0.0, 0.0};
    double share = 1.0, w[3];
    if (correction) C = sphpa_solid_correction_(sums->x, sums->count, dim, &share);
    if (share == 1.0 || dim < 2) {
        sphpa_solid_times_(sums->v, &C, L);
        return C;
    }
    sphpa_solid_spin_(sums->v, sums->x, w);
    const double *M = sums->x, turn[9] = {0.0, -w[2], w[1], w[2], 0.0, -w[0], -w[1], w[0], 0.0};
    sphpa_sym3 moment = {M[0], M[1], M[2], M[3], M[4], M[5]};
    double left[9];
    sphpa_solid_times_(turn, &moment, left);
    for (int k = 0; k < 9; k++) left[k] = sums->v[k] - left[k];
    sphpa_solid_times_(left, &C, L);
    for (int k = 0; k < 9; k++) L[k] += turn[k];
    return C;
}

/* L and div v from the sums; with the velocities of the evaluation (not time-centred) also what the
   forces go by, C and Balsara's factor */
SPHPA_PRIVATE_ void sphpa_solid_store_(sphpa_sim *sim, const sphpa_solid_params *solid, size_t i,
                                       const sphpa_solid_rates_ *rates, bool centred) {
    const sphpa_solid_sums_ *all = &rates->all, *left_out = &rates->left_out;
    double L[9];
    sphpa_sym3 C = sphpa_solid_gradient_(all, sim->p.dim, solid->correction != 0, L);
    sim->p.div_v[i] = (sphpa_real)(L[0] + L[4] + L[8]);
    if (sim->p.balsara != NULL && !centred) {
        double div = fabs(L[0] + L[4] + L[8]), x = L[7] - L[5], y = L[2] - L[6], z = L[3] - L[1];
        double noise = 1e-4 * (double)sim->p.c[i] / (double)sim->p.h[i];
        sim->p.balsara[i] =
            (sphpa_real)(div / (div + sqrt(x * x + y * y + z * z) + noise + 1e-300));
    }
    if (left_out->count > 0.0) { /* the gradient that strains the solid leaves some out */
        sphpa_solid_sums_ own = *all;
        for (int k = 0; k < 9; k++) own.v[k] -= left_out->v[k];
        for (int k = 0; k < 6; k++) own.x[k] -= left_out->x[k];
        own.count -= left_out->count;
        C = sphpa_solid_gradient_(&own, sim->p.dim, solid->correction != 0, L);
    }
    for (size_t k = 0; k < 9; k++) sim->p.L[9 * i + k] = (sphpa_real)L[k];
    if (!centred) sim->p.cut[i] = (uint32_t)left_out->count;
    if (sim->p.C != NULL && !centred) { /* the one of L, so that stress works on what strains it */
        const double c[6] = {C.xx, C.yy, C.zz, C.xy, C.yz, C.xz};
        for (size_t k = 0; k < 6; k++) sim->p.C[6 * i + k] = (sphpa_real)c[k];
    }
}

SPHPA_FORCE_INLINE_ void sphpa_solid_gradients_in_(const sphpa_solid_params *solid,
                                                   const sphpa_group *near, int shape,
                                                   bool corrected, bool mixed,
                                                   sphpa_solid_lane_sums_ out[2]) {
    const sphpa_solid_point_ *points = (const sphpa_solid_point_ *)(const void *)near->records;
    sphpa_solid_own_ i;
    sphpa_solid_lane_sums_ all, left_out;
    sphpa_lanes_ d[3], v[3];
    sphpa_solid_zero_(&all);
    sphpa_solid_zero_(&left_out);
    sphpa_solid_own_of_(solid, near, points, sizeof *points, mixed, &i);
    for (size_t k = 0; k < near->entries; k++) {
        const sphpa_solid_point_ *j = points + SPHPA_TREE_ENTRY_INDEX(near->list[k]);
        sphpa_lanes_ r2 = sphpa_lanes_apart_(near, near->list[k], j->x, i.x, d);
        sphpa_lanes_ g = sphpa_solid_slope_(&i, j, shape, sphpa_lanes_sqrt_(r2), r2);
        for (int a = 0; a < 3; a++) v[a] = j->v[a] - i.v[a];
        sphpa_solid_gather_(&i, j, corrected, mixed, g, d, v, &all, &left_out);
    }
    out[0] = all;
    out[1] = left_out;
}

SPHPA_PRIVATE_ void sphpa_solid_gradients_(sphpa_sim *sim, void *params, const sphpa_group *near) {
    const sphpa_solid_params *solid = (const sphpa_solid_params *)params;
    const sphpa_solid_point_ *points = (const sphpa_solid_point_ *)(const void *)near->records;
    sphpa_shape_ shape = sphpa_shape_of_(sim);
    sphpa_solid_lane_sums_ sums[2];
    bool mixed = sphpa_solid_mixed_(near, sizeof *points);
    if (shape.shape != 0)
        sphpa_solid_gradients_in_(solid, near, shape.shape, true, true, sums);
    else if (mixed) sphpa_solid_gradients_in_(solid, near, 0, true, true, sums);
    else if (solid->correction) sphpa_solid_gradients_in_(solid, near, 0, true, false, sums);
    else sphpa_solid_gradients_in_(solid, near, 0, false, false, sums);
    for (size_t l = 0; l < sphpa_lanes_used_(near); l++) {
        sphpa_solid_rates_ rates;
        double per = 1.0 / (double)points[near->first + l].root;
        sphpa_solid_lane_(&sums[0], l, per, &rates.all);
        sphpa_solid_lane_(&sums[1], l, per, &rates.left_out);
        sphpa_solid_store_(sim, solid, near->first + l, &rates, false);
    }
}

/* ---- the state of a particle: equations (3) and (4) ------------------------------------------ */

SPHPA_PRIVATE_ sphpa_result sphpa_solid_density_(sphpa_sim *sim, void *params, size_t first,
                                                 size_t last, size_t *bad) {
    const sphpa_solid_params *solid = (const sphpa_solid_params *)params;
    sphpa_particles *p = &sim->p;
    double least = sphpa_solid_h_min_(solid);
    for (size_t i = first; i < last; i++) {
        double most = sphpa_solid_h_max_(solid, sphpa_solid_material_(solid, sim, i));
        double h0 = (double)p->h0[i];
        p->rho[i] = p->start.rho[i] * exp(-sim->dt_stage * (double)p->div_v[i]);
        if (!(p->rho[i] > 0.0) || !sphpa_finite_(p->rho[i])) {
            *bad = i;
            return SPHPA_ERROR_NOT_FINITE;
        }
        if (!sim->committing) continue; /* one h for all passes of an evaluation */
        double h = h0 * pow((double)p->rho_h0[i] / p->rho[i], 1.0 / p->dim);
        p->h[i] = (sphpa_real)sphpa_clamp_(h, least * h0, most * h0);
    }
    return SPHPA_OK;
}

/* c_l, the speed of a longitudinal wave, for the time step and the viscosity */
SPHPA_FORCE_INLINE_ double sphpa_solid_wave_(double c, double G, double rho_s) {
    return sqrt(c * c + 4.0 / 3.0 * G / rho_s);
}

/* P and c of one particle without pores */
SPHPA_PRIVATE_ sphpa_result sphpa_solid_dense_(sphpa_sim *sim, const sphpa_solid_params *solid,
                                               size_t i) {
    const sphpa_solid_material *material = sphpa_solid_material_(solid, sim, i);
    sphpa_eos_point point;
    sphpa_result result =
        material->eos.eval(material->eos.material, sim->p.rho[i], sphpa_max_(sim->p.u[i], 0.0),
                           &point);
    if (result != SPHPA_OK) return result;
    sim->p.P[i] = (sphpa_real)point.P;
    sim->p.c[i] = (sphpa_real)sphpa_solid_wave_(point.c, material->G, sim->p.rho[i]);
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_solid_pressure_(sphpa_sim *sim, void *params, size_t first,
                                                  size_t last, size_t *bad) {
    for (size_t i = first; i < last; i++) {
        sphpa_result result = sphpa_solid_dense_(sim, (const sphpa_solid_params *)params, i);
        *bad = i;
        if (result != SPHPA_OK) return result;
    }
    return SPHPA_OK;
}

SPHPA_FORCE_INLINE_ sphpa_sym3 sphpa_sym3_load_(const sphpa_real *from) {
    sphpa_sym3 S;
    S.xx = (double)from[0], S.yy = (double)from[1], S.zz = (double)from[2];
    S.xy = (double)from[3], S.yz = (double)from[4], S.xz = (double)from[5];
    return S;
}

SPHPA_FORCE_INLINE_ void sphpa_sym3_store_(const sphpa_sym3 *S, sphpa_real *to) {
    to[0] = (sphpa_real)S->xx, to[1] = (sphpa_real)S->yy, to[2] = (sphpa_real)S->zz;
    to[3] = (sphpa_real)S->xy, to[4] = (sphpa_real)S->yz, to[5] = (sphpa_real)S->xz;
}

/* S from the start of the step, first times `factor`, then strained with `share` of the bulk's
   rate, half of it before and half after the turn, which makes (4) second order: equation (4), and
   with pores that of >>pores */
SPHPA_FORCE_INLINE_ void sphpa_solid_advance_stress_(sphpa_sim *sim, size_t i, double G,
                                                     double factor, double share) {
    sphpa_sym3 S = sphpa_sym3_load_(sim->p.start.S + 6 * i);
    double L[9];
    for (size_t k = 0; k < 9; k++) L[k] = (double)sim->p.L[9 * i + k];
    S.xx *= factor, S.yy *= factor, S.zz *= factor, S.xy *= factor, S.yz *= factor, S.xz *= factor;
    sphpa_hooke_advance(&S, G * share * sim->dt_stage, L);
    sphpa_jaumann_rotate(&S, L, sim->dt_stage);
    sphpa_hooke_advance(&S, G * share * sim->dt_stage, L);
    sphpa_sym3_store_(&S, sim->p.S + 6 * i);
}

SPHPA_PRIVATE_ sphpa_result sphpa_solid_stress_(sphpa_sim *sim, void *params, size_t first,
                                                size_t last, size_t *bad) {
    const sphpa_solid_params *solid = (const sphpa_solid_params *)params;
    (void)bad;
    for (size_t i = first; i < last; i++) {
        double G = sphpa_solid_material_(solid, sim, i)->G;
        if (G > 0.0) sphpa_solid_advance_stress_(sim, i, G, 1.0, 1.0);
    }
    return SPHPA_OK;
}

/* ---- forces and energy: equations (5) to (7) ------------------------------------------------- */

typedef struct sphpa_solid_record_ {
    sphpa_solid_point_ point; /* its v is that of the middle of the kick */
    sphpa_real v[3];          /* [m/s] of this evaluation */
    sphpa_real m, T[9];       /* [kg]; sigma' C/rho^(1+p), p of (2) */
    sphpa_real push;          /* max(P, 0)/rho^(1+p), all that passes between bodies */
    sphpa_real share;         /* rho^(p-1), that T of a neighbour is multiplied by */
    sphpa_viscous_ viscous;
    sphpa_real R[6];          /* artificial stress over rho^2 */
} sphpa_solid_record_;

/* R of (7): the tensile principal stresses, turned round and scaled */
SPHPA_PRIVATE_ void sphpa_solid_artificial_(const sphpa_sym3 *sigma, const sphpa_sym3 *C,
                                            double scale, sphpa_real R[6]) {
    double value[3], axis[3][3];
    static const int row[6] = {0, 1, 2, 0, 1, 0}, column[6] = {0, 1, 2, 1, 2, 2};
    sphpa_sym3_eigen(sigma, value, axis);
    for (int e = 0; e < 3; e++) { /* as much larger as C makes the stress along this axis */
        const double *n = axis[e];
        double along = C->xx * n[0] * n[0] + C->yy * n[1] * n[1] + C->zz * n[2] * n[2] +
                       2.0 * (C->xy * n[0] * n[1] + C->yz * n[1] * n[2] + C->xz * n[0] * n[2]);
        value[e] *= sphpa_max_(1.0, along);
    }
    for (int k = 0; k < 6; k++) {
        double sum = 0.0;
        for (int e = 0; e < 3; e++)
            if (value[e] > 0.0) sum -= scale * value[e] * axis[e][row[k]] * axis[e][column[k]];
        R[k] = (sphpa_real)sum;
    }
}

SPHPA_PRIVATE_ void sphpa_solid_pack_one_(const sphpa_sim *sim, const sphpa_solid_params *solid,
                                          const sphpa_shape_ *shape, size_t i,
                                          sphpa_solid_record_ *record) {
    const sphpa_particles *p = &sim->p;
    double rho = p->rho[i], P = (double)p->P[i], root = solid->correction ? sqrt(rho) : rho;
    sphpa_solid_point_of_(sim, solid, shape, i, rho, &record->point);
    double per = 1.0 / (rho * root), push = sphpa_max_(P, 0.0) * per, T[9];
    double whole = p->D != NULL ? 1.0 - (double)p->D[i] : 1.0;
    sphpa_sym3 sigma = sphpa_sym3_load_(p->S + 6 * i), C = {1.0, 1.0, 1.0, 0.0, 0.0, 0.0};
    double shear = sphpa_solid_material_(solid, sim, i)->damage_in_yield ? 1.0 : whole;
    double pressure = P < 0.0 ? whole * P : P;
    sigma.xx = shear * sigma.xx - pressure;
    sigma.yy = shear * sigma.yy - pressure;
    sigma.zz = shear * sigma.zz - pressure;
    sigma.xy *= shear, sigma.yz *= shear, sigma.xz *= shear;
    if (p->C != NULL) C = sphpa_sym3_load_(p->C + 6 * i);
    for (int k = 0; k < 6; k++) record->R[k] = SPHPA_R(0.0);
    if (solid->artificial_stress > 0.0)
        sphpa_solid_artificial_(&sigma, &C, solid->artificial_stress / (rho * rho), record->R);
    /* C of a particle at a cut knows one side only; pressure acts across, and goes without it */
    double across = p->cut[i] > 0 ? push : 0.0;
    const double A[9] = {per * sigma.xx + across, per * sigma.xy, per * sigma.xz,
                         per * sigma.xy, per * sigma.yy + across, per * sigma.yz,
                         per * sigma.xz, per * sigma.yz, per * sigma.zz + across};
    sphpa_solid_times_(A, &C, T);
    for (size_t a = 0; a < 9; a++)
        record->T[a] = (sphpa_real)(a % 4 == 0 ? T[a] - across : T[a]);
    for (size_t a = 0; a < 3; a++) {
        record->v[a] = p->v[3 * i + a];
        record->point.v[a] = (sphpa_real)sphpa_sim_mean_v_(sim, 3 * i + a);
    }
    record->m = p->m[i];
    record->push = (sphpa_real)push;
    record->share = (sphpa_real)(root / rho);
    sphpa_viscous_pack_(p, sphpa_viscosity_a_(&solid->viscosity), i,
                        (double)(p->c_visc != NULL ? p->c_visc[i] : p->c[i]), &record->viscous);
}

/* the velocity of the middle of the kick is all in them that follows a */
SPHPA_PRIVATE_ void sphpa_solid_repack_(const sphpa_sim *sim, const void *params, size_t first,
                                        size_t last, void *records) {
    sphpa_solid_record_ *record = (sphpa_solid_record_ *)records;
    (void)params;
    for (size_t i = first; i < last; i++)
        for (size_t a = 0; a < 3; a++)
            record[i].point.v[a] = (sphpa_real)sphpa_sim_mean_v_(sim, 3 * i + a);
}

SPHPA_PRIVATE_ void sphpa_solid_pack_(const sphpa_sim *sim, const void *params, size_t first,
                                      size_t last, void *records) {
    sphpa_shape_ shape = sphpa_shape_of_(sim);
    for (size_t i = first; i < last; i++)
        sphpa_solid_pack_one_(sim, (const sphpa_solid_params *)params, &shape, i,
                              (sphpa_solid_record_ *)records + i);
}

/* Constants of (7): f^n = (per_W norm w(q))^n with the pair's mean h; n = 0: none. */
typedef struct sphpa_solid_stretch_ {
    double per_W, exponent;
} sphpa_solid_stretch_;

SPHPA_PRIVATE_ sphpa_solid_stretch_ sphpa_solid_stretch_of_(const sphpa_sim *sim,
                                                            const sphpa_solid_params *solid) {
    sphpa_solid_stretch_ stretch = {0.0, 0.0};
    if (!(solid->artificial_stress > 0.0)) return stretch;
    sphpa_shape_ shape = sphpa_shape_of_(sim);
    double spacing = solid->spacing > 0.0 ? solid->spacing : 1.0 / 1.2;
    stretch.exponent = solid->artificial_exponent > 0.0 ? solid->artificial_exponent : 4.0;
    stretch.per_W =
        shape.norm / sphpa_kernel_w(sim->options.kernel, sim->p.dim, spacing, 1.0);
    return stretch;
}

SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_solid_near_(const sphpa_solid_stretch_ *stretch, int shape,
                                                   sphpa_lanes_ r, sphpa_lanes_ h) {
    sphpa_lanes_ f, df;
    sphpa_lanes_kernel_(shape, r / h, &f, &df);
    f = f * (sphpa_real)stretch->per_W;
    if (stretch->exponent == 4.0) return (f * f) * (f * f);
    for (size_t l = 0; l < SPHPA_LANES_; l++)
        SPHPA_LANE_(f, l) = (sphpa_real)pow((double)SPHPA_LANE_(f, l), stretch->exponent);
    return f;
}

/* What forces and energy have in common: the lanes' own numbers, and the pair at hand. */
typedef struct sphpa_solid_pair_ {
    sphpa_solid_own_ own;
    sphpa_lanes_ v[3], own_R[6];
    sphpa_viscous_lanes_ viscous;
    sphpa_solid_stretch_ stretch;
    sphpa_lanes_ d[3], g;     /* x_ij, (dW/dr)/r */
    sphpa_lanes_ pi, mu;      /* -Pi and -mu of the viscosity */
    sphpa_lanes_ R[3];        /* f^n (R_i + R_j) x_ij, where pairs are told apart */
    sphpa_mask_ foreign, joined;
} sphpa_solid_pair_;

SPHPA_FORCE_INLINE_ void sphpa_solid_pair_begin_(const sphpa_solid_params *solid,
                                                 const sphpa_group *near, bool mixed,
                                                 sphpa_solid_pair_ *i) {
    const sphpa_solid_record_ *records = (const sphpa_solid_record_ *)(const void *)near->records;
    size_t stride = sizeof *records;
    sphpa_solid_own_of_(solid, near, &records->point, stride, mixed, &i->own);
    for (int a = 0; a < 3; a++) i->v[a] = sphpa_lanes_load_(near, &records->v[a], stride);
    for (int a = 0; a < 6 && mixed; a++)
        i->own_R[a] = sphpa_lanes_load_(near, &records->R[a], stride);
    sphpa_viscous_own_(&solid->viscosity, near, &records->viscous, stride, &i->viscous);
}

/* Tension and shear pass between two particles of one body that are both whole or both broken: what
   a whole one is not strained by (2) it must not work on either, or debris feeds on its stress. */
SPHPA_FORCE_INLINE_ void sphpa_solid_join_(sphpa_solid_pair_ *i, const sphpa_solid_point_ *j) {
    i->foreign = (sphpa_mask_)(i->own.body != j->body);
    sphpa_mask_ one = (sphpa_mask_)(i->own.body == j->body);
    sphpa_mask_ alike = (sphpa_mask_)(i->own.broken == j->broken);
    sphpa_mask_ all = (sphpa_mask_)(i->own.body == i->own.body);
    i->joined = (i->own.stick ? all : one) & (i->own.any ? all : alike);
}

/* the same numbers in the forces and in the energy, so that they balance; artificial stress only
   where pairs are told apart */
SPHPA_FORCE_INLINE_ void sphpa_solid_meet_(const sphpa_group *near, int shape, bool mixed,
                                           uint32_t entry, const sphpa_solid_record_ *j,
                                           sphpa_solid_pair_ *i) {
    sphpa_lanes_ r2 = sphpa_lanes_apart_(near, entry, j->point.x, i->own.x, i->d);
    sphpa_lanes_ r = sphpa_lanes_sqrt_(r2);
    const sphpa_lanes_ *d = i->d;
    i->g = sphpa_solid_slope_(&i->own, &j->point, shape, r, r2);
    sphpa_lanes_ vx =
        (i->v[0] - j->v[0]) * d[0] + (i->v[1] - j->v[1]) * d[1] + (i->v[2] - j->v[2]) * d[2];
    i->pi = sphpa_viscous_pi_(&i->viscous, &j->viscous, vx, r2, &i->mu);
    if (!mixed) return;
    sphpa_solid_join_(i, &j->point);
    for (int a = 0; a < 3; a++) i->R[a] = sphpa_lanes_of_(SPHPA_R(0.0));
    if (!(i->stretch.exponent > 0.0)) return;
    sphpa_lanes_ R[6], h = i->viscous.h + j->viscous.h;
    sphpa_lanes_ close = SPHPA_LANES_IF_(i->joined, sphpa_solid_near_(&i->stretch, shape, r, h));
    for (int c = 0; c < 6; c++) R[c] = close * (i->own_R[c] + j->R[c]);
    i->R[0] = R[0] * d[0] + R[3] * d[1] + R[5] * d[2];
    i->R[1] = R[3] * d[0] + R[1] * d[1] + R[4] * d[2];
    i->R[2] = R[5] * d[0] + R[4] * d[1] + R[2] * d[2];
}

/* by what T_a of a pair's particle a is multiplied: its neighbour b's share */
SPHPA_FORCE_INLINE_ sphpa_lanes_ sphpa_solid_share_(const sphpa_solid_pair_ *i, bool mixed,
                                                    sphpa_lanes_ rho_a, sphpa_lanes_ rho_b,
                                                    sphpa_lanes_ share_b) {
    if (!mixed || !i->own.by_volume) return share_b;
    return sphpa_lanes_pick_(i->foreign, rho_a / rho_b, share_b);
}

/* what the forces of a group come to, lane by lane */
typedef struct sphpa_solid_pushed_ {
    sphpa_real own[3][SPHPA_LANES_], pushed[3][SPHPA_LANES_]; /* sums that T and -push multiply */
    sphpa_real rest[3][SPHPA_LANES_], mu_max[SPHPA_LANES_];
} sphpa_solid_pushed_;

/* Equation (5). What i itself adds is T_i of a sum of vectors: T_i waits for the end. */
SPHPA_FORCE_INLINE_ void sphpa_solid_push_(const sphpa_solid_params *solid,
                                           const sphpa_solid_stretch_ *stretch,
                                           const sphpa_group *near, int shape, bool mixed,
                                           sphpa_solid_pushed_ *out) {
    const sphpa_solid_record_ *records = (const sphpa_solid_record_ *)(const void *)near->records;
    sphpa_solid_pair_ i;
    sphpa_lanes_ zero = sphpa_lanes_of_(SPHPA_R(0.0)), most = zero;
    sphpa_lanes_ own[3] = {zero, zero, zero}, pushed[3] = {zero, zero, zero};
    sphpa_lanes_ rest[3] = {zero, zero, zero};
    i.stretch = *stretch;
    sphpa_solid_pair_begin_(solid, near, mixed, &i);
    sphpa_lanes_ share_i = sphpa_lanes_load_(near, &records->share, sizeof *records);
    for (size_t k = 0; k < near->entries; k++) {
        const sphpa_solid_record_ *j = records + SPHPA_TREE_ENTRY_INDEX(near->list[k]);
        sphpa_solid_meet_(near, shape, mixed, near->list[k], j, &i);
        sphpa_lanes_ g = i.g * j->m, rho = sphpa_lanes_of_(j->viscous.rho);
        sphpa_lanes_ mine = g * sphpa_solid_share_(&i, mixed, i.viscous.rho, rho,
                                                   sphpa_lanes_of_(j->share));
        sphpa_lanes_ theirs = g * sphpa_solid_share_(&i, mixed, rho, i.viscous.rho, share_i);
        sphpa_lanes_ pi = g * i.pi;
        for (int a = 0; a < 3; a++) {
            sphpa_lanes_ t = j->T[3 * a] * i.d[0] + j->T[3 * a + 1] * i.d[1] +
                             j->T[3 * a + 2] * i.d[2];
            sphpa_lanes_ part = mine * i.d[a];
            if (mixed) {
                t = sphpa_lanes_pick_(i.joined, t, -(j->push * i.d[a]));
                own[a] += SPHPA_LANES_IF_(i.joined, part);
                pushed[a] += part - SPHPA_LANES_IF_(i.joined, part);
                rest[a] += g * i.R[a];
            } else own[a] += part;
            rest[a] += pi * i.d[a];
            rest[a] += theirs * t;
        }
        most = sphpa_lanes_max_(most, SPHPA_LANES_IF_(i.g < SPHPA_R(0.0), i.mu));
    }
    memcpy(out->own, own, sizeof own);
    memcpy(out->pushed, pushed, sizeof pushed);
    memcpy(out->rest, rest, sizeof rest);
    memcpy(out->mu_max, &most, sizeof most);
}

SPHPA_PRIVATE_ void sphpa_solid_forces_(sphpa_sim *sim, void *params, const sphpa_group *near) {
    const sphpa_solid_params *solid = (const sphpa_solid_params *)params;
    const sphpa_solid_record_ *records = (const sphpa_solid_record_ *)(const void *)near->records;
    sphpa_shape_ shape = sphpa_shape_of_(sim);
    sphpa_solid_stretch_ stretch = sphpa_solid_stretch_of_(sim, solid);
    sphpa_solid_pushed_ out;
    bool mixed = stretch.exponent > 0.0 || sphpa_solid_mixed_(near, sizeof *records);
    if (shape.shape != 0) {
        mixed = true;
        sphpa_solid_push_(solid, &stretch, near, shape.shape, true, &out);
    } else if (mixed) sphpa_solid_push_(solid, &stretch, near, 0, true, &out);
    else sphpa_solid_push_(solid, &stretch, near, 0, false, &out);
    for (size_t l = 0; l < sphpa_lanes_used_(near); l++) {
        size_t i = near->first + l;
        const sphpa_solid_record_ *own = &records[i];
        for (size_t a = 0; a < 3; a++) {
            const sphpa_real *T = own->T + 3 * a;
            sphpa_real sum = T[0] * out.own[0][l] + T[1] * out.own[1][l] + T[2] * out.own[2][l];
            if (mixed) sum -= own->push * out.pushed[a][l];
            sim->p.a[3 * i + a] += sum + out.rest[a][l];
        }
        sim->p.mu_max[i] = out.mu_max[l];
    }
}

/* sums of (2) with the time-centred velocities, and the heat that is not T : L of the particle */
typedef struct sphpa_solid_heated_ {
    sphpa_solid_lane_sums_ all, left_out;
    sphpa_real work[SPHPA_LANES_];
} sphpa_solid_heated_;

/* Equation (6): where all pairs are joined the heat of i's stress is T_i : sum w_ij v outer grad W,
   a sum that (2) needs anyway; where they are not, it is made pair by pair. */
SPHPA_FORCE_INLINE_ void sphpa_solid_heat_(const sphpa_solid_params *solid,
                                           const sphpa_solid_stretch_ *stretch,
                                           const sphpa_group *near, int shape, bool corrected,
                                           bool mixed, sphpa_solid_heated_ *out) {
    const sphpa_solid_record_ *records = (const sphpa_solid_record_ *)(const void *)near->records;
    sphpa_solid_pair_ i;
    sphpa_solid_lane_sums_ all, left_out;
    sphpa_lanes_ work = sphpa_lanes_of_(SPHPA_R(0.0)), v[3], T[9], push = work;
    sphpa_solid_zero_(&all);
    sphpa_solid_zero_(&left_out);
    i.stretch = *stretch;
    sphpa_solid_pair_begin_(solid, near, mixed, &i);
    for (int a = 0; a < 9; a++) T[a] = sphpa_lanes_load_(near, &records->T[a], sizeof *records);
    if (mixed) push = sphpa_lanes_load_(near, &records->push, sizeof *records);
    for (size_t k = 0; k < near->entries; k++) {
        const sphpa_solid_record_ *j = records + SPHPA_TREE_ENTRY_INDEX(near->list[k]);
        sphpa_solid_meet_(near, shape, mixed, near->list[k], j, &i);
        sphpa_lanes_ g = i.g * j->m, sum = sphpa_lanes_of_(SPHPA_R(0.0));
        for (int a = 0; a < 3; a++) v[a] = j->point.v[a] - i.own.v[a];
        if (mixed) {
            sphpa_lanes_ mine = sphpa_solid_share_(&i, true, i.viscous.rho,
                                                   sphpa_lanes_of_(j->viscous.rho),
                                                   sphpa_lanes_of_(j->share));
            for (int a = 0; a < 3; a++) {
                sphpa_lanes_ t =
                    T[3 * a] * i.d[0] + T[3 * a + 1] * i.d[1] + T[3 * a + 2] * i.d[2];
                t = sphpa_lanes_pick_(i.joined, t, -(push * i.d[a]));
                sum += v[a] * (mine * t + SPHPA_R(0.5) * i.R[a]);
            }
        }
        sum += SPHPA_R(0.5) * i.pi * (v[0] * i.d[0] + v[1] * i.d[1] + v[2] * i.d[2]);
        work += g * sum;
        sphpa_solid_gather_(&i.own, &j->point, corrected, mixed, i.g, i.d, v, &all, &left_out);
    }
    if (!mixed)
        for (int a = 0; a < 9; a++) work += T[a] * all.v[a];
    out->all = all;
    out->left_out = left_out;
    memcpy(out->work, &work, sizeof work);
}

/* equation (6), and (2) once more with the time-centred velocities: the rates that the end of the
   step is made with. Were rho and S advanced with the predicted v, whose acceleration lags by a
   step, elastic waves would grow by (omega dt)^4/4 a step. C is summed anew: that of the gradients'
   pass goes with the densities that the last rates foretold. */
SPHPA_PRIVATE_ void sphpa_solid_energy_(sphpa_sim *sim, void *params, const sphpa_group *near) {
    const sphpa_solid_params *solid = (const sphpa_solid_params *)params;
    const sphpa_solid_record_ *records = (const sphpa_solid_record_ *)(const void *)near->records;
    sphpa_shape_ shape = sphpa_shape_of_(sim);
    sphpa_solid_stretch_ stretch = sphpa_solid_stretch_of_(sim, solid);
    sphpa_solid_heated_ out;
    if (shape.shape != 0)
        sphpa_solid_heat_(solid, &stretch, near, shape.shape, true, true, &out);
    else if (stretch.exponent > 0.0 || sphpa_solid_mixed_(near, sizeof *records))
        sphpa_solid_heat_(solid, &stretch, near, 0, true, true, &out);
    else if (solid->correction) sphpa_solid_heat_(solid, &stretch, near, 0, true, false, &out);
    else sphpa_solid_heat_(solid, &stretch, near, 0, false, false, &out);
    for (size_t l = 0; l < sphpa_lanes_used_(near); l++) {
        sphpa_solid_rates_ rates;
        size_t i = near->first + l;
        double per = 1.0 / (double)records[i].point.root;
        sphpa_solid_lane_(&out.all, l, per, &rates.all);
        sphpa_solid_lane_(&out.left_out, l, per, &rates.left_out);
        sim->p.du[i] += out.work[l];
        sphpa_solid_store_(sim, solid, i, &rates, true);
    }
}

/* ---- limits and the module ------------------------------------------------------------------- */

SPHPA_PRIVATE_ double sphpa_solid_courant_(const sphpa_sim *sim, const void *params, size_t i) {
    return sphpa_courant_(sim, &((const sphpa_solid_params *)params)->viscosity, i);
}

SPHPA_PRIVATE_ double sphpa_solid_rho_limit_(const sphpa_sim *sim, const void *params, size_t i) {
    double step = ((const sphpa_solid_params *)params)->rho_step;
    return (step > 0.0 ? step : 0.05) / (fabs((double)sim->p.div_v[i]) + 1e-300);
}

SPHPA_PRIVATE_ double sphpa_solid_u_limit_(const sphpa_sim *sim, const void *params, size_t i) {
    const sphpa_solid_params *solid = (const sphpa_solid_params *)params;
    const sphpa_eos *eos = &sphpa_solid_material_(solid, sim, i)->eos;
    double rho0 = eos->rho0 > 0.0 ? eos->rho0 : sim->p.rho[i];
    double low = solid->u_floor > 0.0 ? solid->u_floor : 0.01 * eos->K / rho0;
    double step = solid->u_step > 0.0 ? solid->u_step : 0.1;
    return step * (sphpa_max_(sim->p.u[i], 0.0) + low) / (fabs((double)sim->p.du[i]) + 1e-300);
}

SPHPA_PRIVATE_ sphpa_result sphpa_solid_check_material_(const sphpa_solid_params *solid, int k,
                                                        sphpa_error *err) {
    const sphpa_solid_material *material = &solid->material[k];
    double least = sphpa_solid_h_min_(solid), most = sphpa_solid_h_max_(solid, material);
    if (material->eos.eval == NULL || !(material->G >= 0.0 && sphpa_finite_(material->G)))
        return sphpa_error_set(err, SPHPA_ERROR_MATERIAL,
                               "solid: material %d has G = %g Pa and %s equation of state; give a "
                               "finite G >= 0 and one", k, material->G,
                               material->eos.eval == NULL ? "no" : "an");
    if (!(material->h_max >= 0.0 && sphpa_finite_(material->h_max) && most >= least))
        return sphpa_error_set(err, SPHPA_ERROR_MATERIAL,
                               "solid: material %d has h_max = %g, so h is kept between %g and %g "
                               "times its first; give a finite h_max above h_min, or 0 for the "
                               "scene's", k, material->h_max, least, most);
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_solid_check_(const sphpa_solid_params *solid, sphpa_error *err) {
    const sphpa_number_ all[8] = {{"artificial_stress", solid->artificial_stress},
                                  {"artificial_exponent", solid->artificial_exponent},
                                  {"spacing", solid->spacing},
                                  {"h_min", solid->h_min},
                                  {"h_max", solid->h_max},
                                  {"rho_step", solid->rho_step},
                                  {"u_step", solid->u_step},
                                  {"u_floor", solid->u_floor}};
    if (solid->material == NULL || solid->materials < 1)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                               "solid: no materials; set material and materials");
    sphpa_result result = sphpa_numbers_check_("solid", all, 8, err);
    if (result == SPHPA_OK) result = sphpa_viscosity_check_("solid", &solid->viscosity, err);
    for (int k = 0; k < solid->materials && result == SPHPA_OK; k++)
        result = sphpa_solid_check_material_(solid, k, err);
    return result;
}

SPHPA_PRIVATE_ sphpa_result sphpa_solid_setup_(sphpa_sim *sim, void *params, sphpa_error *err) {
    sphpa_result result = sphpa_solid_check_((const sphpa_solid_params *)params, err);
    if (result != SPHPA_OK) return result;
    for (size_t i = 0; i < sim->p.n; i++) {
        if (sim->p.h0[i] > (sphpa_real)0 && sim->p.rho_h0[i] > (sphpa_real)0) continue;
        sim->p.h0[i] = sim->p.h[i];
        sim->p.rho_h0[i] = (sphpa_real)sim->p.rho[i];
    }
    return SPHPA_OK;
}

/* the scene's solid that a module goes with, with materials: `wanted`, or NULL for any; NULL and an
   error where there is none */
SPHPA_PRIVATE_ const sphpa_solid_params *sphpa_solid_of_scene_(const sphpa_sim *sim,
                                                               const char *module,
                                                               const sphpa_solid_params *wanted,
                                                               sphpa_error *err) {
    for (int m = 0; m < sim->scene.modules; m++) {
        const sphpa_module *other = &sim->scene.module[m];
        const sphpa_solid_params *solid = (const sphpa_solid_params *)other->params;
        bool same = wanted == NULL ? strcmp(other->name, "solid") == 0 : solid == wanted;
        if (same && solid->material != NULL) return solid;
    }
    (void)sphpa_error_set(err, SPHPA_ERROR_MISSING,
                          "%s: the scene has no sphpa_solid()%s; add it, with its materials",
                          module, wanted == NULL ? "" : " of these solid parameters");
    return NULL;
}

SPHPA_PRIVATE_ sphpa_result sphpa_solid_check_all_(const sphpa_sim *sim, const void *params,
                                                   sphpa_error *err) {
    return sphpa_materials_check_(sim, "solid", ((const sphpa_solid_params *)params)->materials,
                                  err);
}

SPHPA_PRIVATE_ void sphpa_solid_limits_(sphpa_module *module) {
    static const char *const name[4] = {"courant", "density change", "energy change", "flight"};
    double (*const limit[4])(const sphpa_sim *, const void *, size_t) = {
        sphpa_solid_courant_, sphpa_solid_rho_limit_, sphpa_solid_u_limit_, sphpa_flight_};
    const sphpa_mask reads[4] = {SPHPA_F(h) | SPHPA_F(c) | SPHPA_F(mu_max), SPHPA_F(div_v),
                                 SPHPA_F(u) | SPHPA_F(du), SPHPA_F(h) | SPHPA_F(v)};
    for (int k = 0; k < 4; k++) {
        sphpa_pass *pass = sphpa_module_pass_(module, name[k], SPHPA_STAGE_LIMIT, reads[k], 0);
        pass->kind = SPHPA_PASS_REDUCE;
        pass->limit = limit[k];
    }
}

SPHPA_PRIVATE_ void sphpa_solid_gradient_pass_(sphpa_module *module,
                                               const sphpa_solid_params *solid) {
    sphpa_mask flow = SPHPA_F(x) | SPHPA_F(m) | SPHPA_F(h) | SPHPA_F(v) | SPHPA_F(rho);
    sphpa_mask corrected = solid->correction ? SPHPA_F(C) : 0;
    sphpa_mask balsara = solid->viscosity.balsara ? SPHPA_F(balsara) : 0;
    sphpa_pass *gradients = sphpa_module_pass_(
        module, "solid gradients", SPHPA_STAGE_GRADIENTS,
        flow | SPHPA_F(body) | SPHPA_F(c) | SPHPA_F(P),
        SPHPA_F(L) | SPHPA_F(div_v) | SPHPA_F(cut) | corrected | balsara);
    gradients->kind = SPHPA_PASS_PAIR;
    gradients->uses = SPHPA_F(D);
    gradients->record_bytes = sizeof(sphpa_solid_point_);
    gradients->pack = sphpa_solid_pack_points_;
    gradients->group = sphpa_solid_gradients_;
}

SPHPA_PRIVATE_ void sphpa_solid_force_passes_(sphpa_module *module,
                                              const sphpa_solid_params *solid) {
    sphpa_mask flow = SPHPA_F(x) | SPHPA_F(m) | SPHPA_F(h) | SPHPA_F(v) | SPHPA_F(rho);
    sphpa_mask corrected = solid->correction ? SPHPA_F(C) : 0;
    sphpa_mask balsara = solid->viscosity.balsara ? SPHPA_F(balsara) : 0;
    sphpa_mask all = flow | corrected | balsara | SPHPA_F(P) | SPHPA_F(S) | SPHPA_F(c) |
                     SPHPA_F(cut) |
                     SPHPA_F(body);
    sphpa_pass *forces = sphpa_module_pass_(module, "solid forces", SPHPA_STAGE_FORCES, all,
                                            SPHPA_F(a) | SPHPA_F(mu_max));
    sphpa_pass *energy = sphpa_module_pass_(module, "solid energy", SPHPA_STAGE_ENERGY,
                                            all | SPHPA_F(a),
                                            SPHPA_F(du) | SPHPA_F(L) | SPHPA_F(div_v));
    forces->kind = energy->kind = SPHPA_PASS_PAIR;
    forces->uses = energy->uses = SPHPA_F(D) | SPHPA_F(c_visc);
    forces->record_bytes = energy->record_bytes = sizeof(sphpa_solid_record_);
    forces->pack = energy->pack = sphpa_solid_pack_;
    energy->repack = sphpa_solid_repack_;
    forces->group = sphpa_solid_forces_;
    energy->group = sphpa_solid_energy_;
}

SPHPA_DEF sphpa_module sphpa_solid(sphpa_solid_params *params) {
    sphpa_module module;
    memset(&module, 0, sizeof module);
    module.name = "solid";
    module.params = params;
    module.setup = sphpa_solid_setup_;
    module.check = sphpa_solid_check_all_;
    sphpa_solid_gradient_pass_(&module, params);
    sphpa_pass *density = sphpa_module_pass_(&module, "solid density", SPHPA_STAGE_GRADIENTS,
                                             SPHPA_F(div_v) | SPHPA_F(h0) | SPHPA_F(rho_h0),
                                             SPHPA_F(h));
    density->advances = SPHPA_F(rho);
    density->particle = sphpa_solid_density_;
    sphpa_pass *pressure = sphpa_module_pass_(&module, "solid pressure", SPHPA_STAGE_PRESSURE,
                                              SPHPA_F(rho) | SPHPA_F(u), SPHPA_F(P) | SPHPA_F(c));
    pressure->particle = sphpa_solid_pressure_;
    sphpa_pass *stress = sphpa_module_pass_(&module, "solid stress", SPHPA_STAGE_STRESS,
                                            SPHPA_F(L), 0);
    stress->advances = SPHPA_F(S);
    stress->particle = sphpa_solid_stress_;
    density->at_commit = pressure->at_commit = stress->at_commit = 1;
    sphpa_solid_force_passes_(&module, params);
    sphpa_solid_limits_(&module);
    return module;
}

SPHPA_EXTERN_C_END_
#endif /* >>solid */

#if SPHPA_WANT_PORES_ && !defined(SPHPA_PORES_DONE_)
#define SPHPA_PORES_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>pores   implementation
   ============================================================================================== */

/* States of one material, side by side for the batch; a block of particles at most. */
typedef struct sphpa_pores_batch_ {
    size_t n, index[SPHPA_BLOCK_];
    double rho[SPHPA_BLOCK_], u[SPHPA_BLOCK_], before[SPHPA_BLOCK_];
    double alpha[SPHPA_BLOCK_], P[SPHPA_BLOCK_], c[SPHPA_BLOCK_];
} sphpa_pores_batch_;

SPHPA_PRIVATE_ bool sphpa_pores_porous_(const sphpa_pores_params *pores, int material) {
    return pores->crush[material].alpha0 > 1.0;
}

/* how far a loading particle is from its curve, and whether alpha grew; at commits only */
SPHPA_PRIVATE_ void sphpa_pores_watch_(const sphpa_crush *crush, const sphpa_pores_batch_ *batch,
                                       sphpa_pores_stats *seen) {
    for (size_t k = 0; k < batch->n; k++) {
        double alpha = batch->alpha[k];
        if (alpha > batch->before[k] && crush->elastic == SPHPA_CRUSH_FLAT) seen->grew++;
        if (!(alpha < batch->before[k])) continue;
        double distance = fabs(alpha - sphpa_crush_alpha(crush, batch->P[k], NULL));
        seen->loading++;
        seen->distance_max = sphpa_max_(seen->distance_max, distance / (crush->alpha0 - 1.0));
    }
}

SPHPA_PRIVATE_ void sphpa_pores_gather_(const sphpa_sim *sim, const double *before, int material,
                                        size_t first, size_t last, sphpa_pores_batch_ *batch) {
    batch->n = 0;
    for (size_t i = first; i < last; i++) {
        if (sim->p.material[i] != material) continue;
        batch->index[batch->n] = i;
        batch->rho[batch->n] = sim->p.rho[i];
        batch->u[batch->n] = sphpa_max_(sim->p.u[i], 0.0);
        batch->before[batch->n++] = before[i];
    }
}

/* c_visc of (1) of state k of the batch; where no time passes there is no telling what loads, and
   the one before stays */
SPHPA_PRIVATE_ void sphpa_pores_smooth_(sphpa_sim *sim, const sphpa_pores_params *pores,
                                        int material, const sphpa_pores_batch_ *batch, size_t k) {
    const sphpa_crush *crush = &pores->crush[material];
    size_t i = batch->index[k];
    double alpha = batch->alpha[k], elastic = (double)sim->p.c[i], crushing = 0.0;
    if (!(sim->dt_stage > 0.0) && sim->p.c_visc[i] > (sphpa_real)0) return;
    sim->p.c_visc[i] = sim->p.c[i];
    if (!(alpha < batch->before[k]) ||
        sphpa_palpha_loading_c(pores->matrix[material], crush, batch->rho[k], batch->u[k], alpha,
                               &crushing) != SPHPA_OK ||
        !(crushing < elastic))
        return;
    double closed = sphpa_clamp_((crush->alpha0 - alpha) / (crush->alpha0 - 1.0), 0.0, 1.0);
    double share = closed * closed * closed;
    sim->p.c_visc[i] = (sphpa_real)(crushing * pow(elastic / crushing, share));
}

/* one material of one block; where it is carried also the least alpha (HERRMANN) */
SPHPA_PRIVATE_ sphpa_result sphpa_pores_solve_(sphpa_sim *sim, const sphpa_pores_params *pores,
                                               int material, sphpa_pores_batch_ *batch,
                                               sphpa_pores_stats *seen, size_t *bad) {
    const sphpa_tillotson *matrix = pores->matrix[material];
    double G = pores->solid->material[material].G;
    sphpa_palpha_stats stats;
    memset(&stats, 0, sizeof stats);
    stats.c = batch->c;
    sphpa_result result = sphpa_palpha_solve_batch(
        pores->solver, matrix, &pores->crush[material], batch->n, batch->rho, batch->u,
        batch->before, &pores->options, batch->alpha, batch->P, &stats);
    seen->solves += batch->n;
    seen->evaluations += stats.evaluations;
    seen->fell_back += stats.fell_back;
    if (result != SPHPA_OK) {
        *bad = batch->index[stats.first_failed < batch->n ? stats.first_failed : 0];
        return result;
    }
    for (size_t k = 0; k < batch->n; k++) {
        size_t i = batch->index[k];
        double alpha = batch->alpha[k];
        sim->p.alpha[i] = alpha;
        if (sim->p.alpha_min != NULL) sim->p.alpha_min[i] = sphpa_min_(alpha, batch->before[k]);
        sim->p.P[i] = (sphpa_real)batch->P[k];
        sim->p.c[i] = (sphpa_real)sphpa_solid_wave_(batch->c[k], G, alpha * batch->rho[k]);
        sphpa_pores_smooth_(sim, pores, material, batch, k);
    }
    return SPHPA_OK;
}

SPHPA_PRIVATE_ void sphpa_pores_count_(sphpa_pores_stats *stats, const sphpa_pores_stats *seen) {
    SPHPA_OMP(critical(sphpa_pores_stats))
    {
        stats->solves += seen->solves;
        stats->evaluations += seen->evaluations;
        stats->fell_back += seen->fell_back;
        stats->loading += seen->loading;
        stats->grew += seen->grew;
        stats->distance_max = sphpa_max_(stats->distance_max, seen->distance_max);
    }
}

SPHPA_PRIVATE_ sphpa_result sphpa_pores_pressure_(sphpa_sim *sim, void *params, size_t first,
                                                  size_t last, size_t *bad) {
    sphpa_pores_params *pores = (sphpa_pores_params *)params;
    const double *before = sim->p.alpha_min != NULL ? sim->p.start.alpha_min : sim->p.start.alpha;
    sphpa_pores_batch_ batch;
    sphpa_pores_stats seen;
    memset(&seen, 0, sizeof seen);
    for (int material = 0; material < pores->solid->materials; material++) {
        if (!sphpa_pores_porous_(pores, material)) continue;
        sphpa_pores_gather_(sim, before, material, first, last, &batch);
        if (batch.n == 0) continue;
        sphpa_result result = sphpa_pores_solve_(sim, pores, material, &batch, &seen, bad);
        if (result != SPHPA_OK) return result;
        if (sim->committing) sphpa_pores_watch_(&pores->crush[material], &batch, &seen);
    }
    for (size_t i = first; i < last; i++) { /* dense materials, as without pores */
        if (sphpa_pores_porous_(pores, sim->p.material[i])) continue;
        sphpa_result result = sphpa_solid_dense_(sim, pores->solid, i);
        *bad = i;
        if (result != SPHPA_OK) return result;
        sim->p.c_visc[i] = sim->p.c[i];
    }
    sphpa_pores_count_(&pores->stats, &seen);
    return SPHPA_OK;
}

/* S:edot [Pa/s] with the stress of the step's start: below 0 the deviator unloads */
SPHPA_PRIVATE_ double sphpa_pores_power_(const sphpa_sim *sim, size_t i) {
    sphpa_sym3 S = sphpa_sym3_load_(sim->p.start.S + 6 * i);
    const sphpa_real *L = sim->p.L + 9 * i;
    return S.xx * (double)L[0] + S.yy * (double)L[4] + S.zz * (double)L[8] +
           S.xy * (double)(L[1] + L[3]) + S.yz * (double)(L[5] + L[7]) +
           S.xz * (double)(L[2] + L[6]);
}

SPHPA_PRIVATE_ sphpa_result sphpa_pores_stress_(sphpa_sim *sim, void *params, size_t first,
                                                size_t last, size_t *bad) {
    const sphpa_pores_params *pores = (const sphpa_pores_params *)params;
    const sphpa_particles *p = &sim->p;
    (void)bad;
    for (size_t i = first; i < last; i++) {
        double G = sphpa_solid_material_(pores->solid, sim, i)->G;
        double before = p->start.alpha[i], alpha = p->alpha[i];
        if (!(G > 0.0)) continue;
        double f = 1.0;
        if (sphpa_pores_power_(sim, i) >= 0.0)
            f = sphpa_palpha_strain_share(p->start.rho[i], before, p->rho[i], alpha);
        sphpa_solid_advance_stress_(sim, i, G, before / alpha, f / alpha);
    }
    return SPHPA_OK;
}

/* a curve, its matrix, the options: all that the solver would refuse, before the first step */
SPHPA_PRIVATE_ sphpa_result sphpa_pores_check_material_(const sphpa_pores_params *pores, int k,
                                                        sphpa_error *err) {
    const sphpa_tillotson *matrix = pores->matrix[k];
    const sphpa_crush *crush = &pores->crush[k];
    sphpa_result result = sphpa_crush_check(crush, err);
    if (result != SPHPA_OK) return result;
    if (matrix == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                               "pores: material %d has a crush curve but no matrix; set matrix[%d] "
                               "(sphpa_tillotson_find gives NULL for a name it does not know)", k,
                               k);
    result = sphpa_tillotson_check(matrix, err);
    if (result != SPHPA_OK) return result;
    double rho0 = pores->solid->material[k].eos.rho0;
    if (fabs(rho0 - matrix->rho0) > 1e-9 * matrix->rho0)
        return sphpa_error_set(err, SPHPA_ERROR_MATERIAL,
                               "pores: material %d has rho0 = %g kg/m3 in solid and %g in its "
                               "matrix; give both the same equation of state",
                               k, rho0, matrix->rho0);
    if (crush->elastic == SPHPA_CRUSH_HERRMANN && !(crush->K0 > 0.0))
        return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                               "pores: the HERRMANN curve of material %d is not prepared; call "
                               "sphpa_crush_prepare with the matrix's rho0 and sound speed", k);
    result = sphpa_palpha_solve_batch(pores->solver, matrix, crush, 0, NULL, NULL, NULL,
                                      &pores->options, NULL, NULL, NULL);
    return result == SPHPA_OK
               ? result
               : sphpa_error_set(err, result,
                                 "pores: solver %d, tol = %g, max_iterations = %d: %s; zeros are "
                                 "the defaults", (int)pores->solver, pores->options.tol,
                                 pores->options.max_iterations, sphpa_result_message(result));
}

/* three times the matrix's density at rest: rho is likely the matrix's where the bulk's is due */
SPHPA_PRIVATE_ sphpa_result sphpa_pores_check_rho_(const sphpa_sim *sim,
                                                   const sphpa_pores_params *pores, int k,
                                                   sphpa_error *err) {
    double rho0 = pores->matrix[k]->rho0;
    for (size_t i = 0; i < sim->p.n; i++) {
        double alpha = sim->p.alpha[i], rho = sim->p.rho[i];
        if (sim->p.material[i] != k || sim->p.u[i] > 0.0 || !(alpha * rho > 3.0 * rho0)) continue;
        return sphpa_error_set(err, SPHPA_ERROR_ALPHA,
                               "pores: particle %zu has rho = %g and alpha = %g, a matrix of %g "
                               "kg/m3 where %g is its density at rest; rho is the bulk's (here %g)",
                               i, rho, alpha, alpha * rho, rho0, rho0 / alpha);
    }
    return SPHPA_OK;
}

/* material k at rest, below the matrix's density and without a single pore: alpha was forgotten */
SPHPA_PRIVATE_ sphpa_result sphpa_pores_check_alpha_(const sphpa_sim *sim,
                                                     const sphpa_pores_params *pores, int k,
                                                     sphpa_error *err) {
    size_t count = 0;
    double rho0 = pores->matrix[k]->rho0, most = 0.0;
    for (size_t i = 0; i < sim->p.n; i++) {
        if (sim->p.material[i] != k) continue;
        most = sphpa_max_(most, sim->p.rho[i]);
        count++;
        if (sim->p.alpha[i] > 1.0 || sim->p.u[i] > 0.0 || most > 0.9 * rho0) return SPHPA_OK;
    }
    if (count == 0) return SPHPA_OK;
    return sphpa_error_set(err, SPHPA_ERROR_ALPHA,
                           "pores: all %zu particles of material %d have alpha = 1, but rho = %g "
                           "kg/m3 at most where the matrix has %g; give them alpha (here %g) when "
                           "you make them", count, k, most, rho0, rho0 / most);
}

SPHPA_PRIVATE_ sphpa_result sphpa_pores_check_particle_(const sphpa_sim *sim,
                                                        const sphpa_pores_params *pores, size_t i,
                                                        sphpa_error *err) {
    double most = sphpa_max_(pores->crush[sim->p.material[i]].alpha0, 1.0);
    if (sim->p.alpha[i] > most * (1.0 + 4.0 * DBL_EPSILON))
        return sphpa_error_set(err, SPHPA_ERROR_ALPHA,
                               "pores: particle %zu has alpha = %.9g, above alpha0 = %.9g of its "
                               "material; start between 1 and alpha0", i, sim->p.alpha[i], most);
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_pores_setup_(sphpa_sim *sim, void *params, sphpa_error *err) {
    sphpa_pores_params *pores = (sphpa_pores_params *)params;
    memset(&pores->stats, 0, sizeof pores->stats);
    if (pores->solid == NULL || pores->crush == NULL || pores->matrix == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING, "pores: set solid, crush and matrix");
    if (sphpa_solid_of_scene_(sim, "pores", pores->solid, err) == NULL) return SPHPA_ERROR_MISSING;
    for (int k = 0; k < pores->solid->materials; k++) {
        if (!sphpa_pores_porous_(pores, k)) continue;
        sphpa_result result = sphpa_pores_check_material_(pores, k, err);
        if (result == SPHPA_OK) result = sphpa_pores_check_alpha_(sim, pores, k, err);
        if (result == SPHPA_OK) result = sphpa_pores_check_rho_(sim, pores, k, err);
        if (result != SPHPA_OK) return result;
    }
    if (sim->p.alpha_min != NULL) /* those of a restart stay */
        for (size_t i = 0; i < sim->p.n; i++)
            if (!(sim->p.alpha_min[i] >= 1.0)) sim->p.alpha_min[i] = sim->p.alpha[i];
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_pores_check_all_(const sphpa_sim *sim, const void *params,
                                                   sphpa_error *err) {
    const sphpa_pores_params *pores = (const sphpa_pores_params *)params;
    sphpa_result result = sphpa_materials_check_(sim, "pores", pores->solid->materials, err);
    for (size_t i = 0; i < sim->p.n && result == SPHPA_OK; i++)
        result = sphpa_pores_check_particle_(sim, pores, i, err);
    return result;
}

/* what the pores did before a restart */
SPHPA_PRIVATE_ sphpa_result sphpa_pores_keep_(sphpa_sim *sim, void *params, sphpa_keep_fn exchange,
                                              void *user, sphpa_error *err) {
    sphpa_pores_params *pores = (sphpa_pores_params *)params;
    size_t bytes = sizeof pores->stats;
    void *data = &pores->stats;
    (void)sim;
    sphpa_result result = exchange(user, "pores stats", &data, &bytes, err);
    if (result != SPHPA_OK || data == (void *)&pores->stats) return result;
    if (bytes == sizeof pores->stats) memcpy(&pores->stats, data, bytes);
    else result = sphpa_error_set(err, SPHPA_ERROR_FORMAT, "pores: %zu bytes of counts, not %zu",
                                  bytes, sizeof pores->stats);
    SPHPA_FREE(data);
    return result;
}

SPHPA_DEF sphpa_module sphpa_pores(sphpa_pores_params *params) {
    sphpa_module module;
    memset(&module, 0, sizeof module);
    module.name = "pores";
    module.params = params;
    module.setup = sphpa_pores_setup_;
    module.check = sphpa_pores_check_all_;
    module.keep = sphpa_pores_keep_;
    sphpa_mask advances = SPHPA_F(alpha);
    bool whole = params->solid != NULL && params->crush != NULL; /* setup complains if not */
    for (int k = 0; whole && k < params->solid->materials; k++)
        if (sphpa_pores_porous_(params, k) && params->crush[k].elastic == SPHPA_CRUSH_HERRMANN)
            advances |= SPHPA_F(alpha_min);
    sphpa_pass *pressure = sphpa_module_pass_(&module, "pores pressure", SPHPA_STAGE_PRESSURE,
                                              SPHPA_F(rho) | SPHPA_F(u),
                                              SPHPA_F(P) | SPHPA_F(c) | SPHPA_F(c_visc));
    pressure->replaces = "solid pressure";
    pressure->advances = advances;
    pressure->particle = sphpa_pores_pressure_;
    sphpa_pass *stress = sphpa_module_pass_(&module, "pores stress", SPHPA_STAGE_STRESS,
                                            SPHPA_F(L) | SPHPA_F(alpha) | SPHPA_F(rho), 0);
    stress->replaces = "solid stress";
    stress->advances = SPHPA_F(S) | SPHPA_F(rho);
    stress->particle = sphpa_pores_stress_;
    pressure->at_commit = stress->at_commit = 1;
    return module;
}

SPHPA_EXTERN_C_END_
#endif /* >>pores */

#if SPHPA_WANT_PLASTIC_ && !defined(SPHPA_PLASTIC_DONE_)
#define SPHPA_PLASTIC_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>plastic   implementation
   ============================================================================================== */

SPHPA_PRIVATE_ sphpa_result sphpa_plastic_yield_(sphpa_sim *sim, void *params, size_t first,
                                                 size_t last, size_t *bad) {
    const sphpa_plastic_params *plastic = (const sphpa_plastic_params *)params;
    const sphpa_particles *p = &sim->p;
    for (size_t i = first; i < last; i++) {
        const sphpa_yield *yield = &plastic->yield[p->material[i]];
        if (yield->kind == SPHPA_YIELD_NONE) continue;
        double alpha = p->alpha != NULL ? p->alpha[i] : 1.0;
        double D = p->D != NULL ? (double)p->D[i] : 0.0;
        sphpa_sym3 S = sphpa_sym3_load_(p->S + 6 * i);
        double factor = sphpa_yield_limit(yield, alpha * (double)p->P[i], p->u[i], D, alpha, &S);
        if (!(factor <= 1.0)) {
            *bad = i;
            return SPHPA_ERROR_NOT_FINITE;
        }
        if (factor < 1.0) sphpa_sym3_store_(&S, sim->p.S + 6 * i);
    }
    return SPHPA_OK;
}

/* D must weaken the deviator once: in the surface, or in the forces */
SPHPA_PRIVATE_ sphpa_result sphpa_plastic_check_damage_(const sphpa_plastic_params *plastic,
                                                        const sphpa_solid_params *solid,
                                                        sphpa_error *err) {
    int materials = solid->materials < plastic->materials ? solid->materials : plastic->materials;
    for (int k = 0; k < materials; k++) {
        int knows = plastic->yield[k].kind == SPHPA_YIELD_COLLINS;
        if (knows == (solid->material[k].damage_in_yield != 0)) continue;
        return sphpa_error_set(err, SPHPA_ERROR_MATERIAL,
                               knows ? "plastic: the COLLINS surface of material %d knows D "
                                       "already; set damage_in_yield = 1 in its "
                                       "sphpa_solid_material, or D weakens it twice"
                                     : "plastic: the surface of material %d does not know D; set "
                                       "damage_in_yield = 0 in its sphpa_solid_material, or D does "
                                       "not weaken it at all", k);
    }
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_plastic_setup_(sphpa_sim *sim, void *params, sphpa_error *err) {
    const sphpa_plastic_params *plastic = (const sphpa_plastic_params *)params;
    if (plastic->yield == NULL || plastic->materials < 1)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING, "plastic: set yield and materials");
    const sphpa_solid_params *solid = sphpa_solid_of_scene_(sim, "plastic", NULL, err);
    if (solid == NULL) return SPHPA_ERROR_MISSING;
    for (int k = 0; k < plastic->materials; k++) {
        sphpa_result result = sphpa_yield_check(&plastic->yield[k], err);
        if (result != SPHPA_OK) return result;
    }
    return sim->p.D != NULL ? sphpa_plastic_check_damage_(plastic, solid, err) : SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_plastic_check_all_(const sphpa_sim *sim, const void *params,
                                                     sphpa_error *err) {
    return sphpa_materials_check_(sim, "plastic",
                                  ((const sphpa_plastic_params *)params)->materials, err);
}

SPHPA_DEF sphpa_module sphpa_plastic(sphpa_plastic_params *params) {
    sphpa_module module;
    memset(&module, 0, sizeof module);
    module.name = "plastic";
    module.params = params;
    module.setup = sphpa_plastic_setup_;
    module.check = sphpa_plastic_check_all_;
    sphpa_pass *yield = sphpa_module_pass_(&module, "plastic yield", SPHPA_STAGE_YIELD,
                                           SPHPA_F(P) | SPHPA_F(u), SPHPA_F(S));
    yield->uses = SPHPA_F(alpha) | SPHPA_F(D);
    yield->particle = sphpa_plastic_yield_;
    yield->at_commit = 1;
    return module;
}

SPHPA_EXTERN_C_END_
#endif /* >>plastic */

#if SPHPA_WANT_CRACKS_ && !defined(SPHPA_CRACKS_DONE_)
#define SPHPA_CRACKS_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>cracks   implementation
   ============================================================================================== */

/* ---- flaws at setup -------------------------------------------------------------------------- */

/* The particles of one body that get flaws, and the pool while it is filled. */
typedef struct sphpa_cracks_walk_ {
    sphpa_particles *p;
    const size_t *index; /* (n) particles of the body */
    double *pool;        /* NULL while only counting */
} sphpa_cracks_walk_;

SPHPA_PRIVATE_ uint32_t sphpa_cracks_visit_(void *user, size_t particle, double eps, size_t j) {
    sphpa_cracks_walk_ *walk = (sphpa_cracks_walk_ *)user;
    size_t i = walk->index[particle];
    uint32_t before = walk->p->flaw_count[i]++;
    (void)j;
    if (walk->pool != NULL) walk->pool[walk->p->flaw_first[i] + before] = eps;
    return before;
}

/* the walk twice: once to count, once to fill the pool behind what is there already */
SPHPA_PRIVATE_ sphpa_result sphpa_cracks_walk_body_(sphpa_sim *sim, sphpa_cracks_params *cracks,
                                                    const sphpa_flaw_params *flaws,
                                                    const size_t *index, size_t n,
                                                    uint64_t stream) {
    sphpa_particles *p = &sim->p;
    sphpa_cracks_walk_ walk = {p, index, NULL};
    sphpa_rng rng = sphpa_rng_seed(cracks->seed, stream), again = rng;
    size_t total = 0, capacity = cracks->pool_count, first = cracks->pool_count;
    sphpa_result result = sphpa_flaw_assign(flaws, n, &rng, sphpa_cracks_visit_, &walk, &total);
    if (result != SPHPA_OK) return result;
    if (first + total > UINT32_MAX) return SPHPA_ERROR_RANGE;
    if (!sphpa_grow_((void **)&cracks->pool, &capacity, first + total, sizeof(double)))
        return SPHPA_ERROR_MEMORY;
    cracks->pool_count = first + total;
    for (size_t k = 0; k < n; k++) {
        p->flaw_first[index[k]] = (uint32_t)first;
        first += p->flaw_count[index[k]];
        p->flaw_count[index[k]] = 0;
    }
    walk.pool = cracks->pool;
    result = sphpa_flaw_assign(flaws, n, &again, sphpa_cracks_visit_, &walk, &total);
    for (size_t k = 0; k < n && result == SPHPA_OK; k++) {
        size_t i = index[k];
        sphpa_flaws few = sphpa_flaws_compress(cracks->pool + p->flaw_first[i], p->flaw_count[i]);
        p->flaw_min[i] = few.eps_min;
        p->flaw_exponent[i] = (sphpa_real)few.exponent;
    }
    return result;
}

SPHPA_PRIVATE_ sphpa_result sphpa_cracks_sample_body_(sphpa_sim *sim, sphpa_cracks_params *cracks,
                                                      const sphpa_flaw_params *flaws,
                                                      const size_t *index, size_t n,
                                                      uint64_t stream) {
    sphpa_rng rng = sphpa_rng_seed(cracks->seed, stream);
    double stop = sphpa_flaw_stopping_time(n, &rng);
    for (size_t k = 0; k < n; k++) {
        size_t i = index[k];
        sphpa_flaws few;
        uint64_t particle = (uint64_t)sim->p.id[i] | (uint64_t)1 << 62; /* no body's stream */
        sphpa_rng own = sphpa_rng_seed(cracks->seed, particle);
        sphpa_result result = sphpa_flaw_sample(flaws, n, &own, stop, &few);
        if (result != SPHPA_OK) return result;
        sim->p.flaw_min[i] = few.eps_min;
        sim->p.flaw_exponent[i] = (sphpa_real)few.exponent;
        sim->p.flaw_count[i] = few.count;
    }
    return SPHPA_OK;
}

/* A particle and its number: flaws go by numbers, so that the order in memory does not matter. */
typedef struct sphpa_cracks_place_ {
    int64_t id;
    size_t i;
} sphpa_cracks_place_;

SPHPA_PRIVATE_ int sphpa_cracks_compare_(const void *a, const void *b) {
    const sphpa_cracks_place_ *x = (const sphpa_cracks_place_ *)a;
    const sphpa_cracks_place_ *y = (const sphpa_cracks_place_ *)b;
    return x->id != y->id ? (x->id > y->id) - (x->id < y->id) : (x->i > y->i) * 2 - 1;
}

/* all particles by rising id; false: no memory */
SPHPA_PRIVATE_ bool sphpa_cracks_order_(const sphpa_particles *p, size_t *order) {
    sphpa_cracks_place_ *place = (sphpa_cracks_place_ *)sphpa_alloc_(p->n, sizeof *place);
    if (place == NULL) return false;
    for (size_t i = 0; i < p->n; i++) place[i].id = p->id[i], place[i].i = i;
    qsort(place, p->n, sizeof *place, sphpa_cracks_compare_);
    for (size_t k = 0; k < p->n; k++) order[k] = place[k].i;
    SPHPA_FREE(place);
    return true;
}

/* flaws of the particles of one body and material, taken from `order` into `index` */
SPHPA_PRIVATE_ sphpa_result sphpa_cracks_body_(sphpa_sim *sim, sphpa_cracks_params *cracks,
                                               int32_t body, int material, const size_t *order,
                                               size_t *index, sphpa_error *err) {
    const sphpa_particles *p = &sim->p;
    size_t n = 0;
    sphpa_flaw_params flaws;
    flaws.k = cracks->material[material].k;
    flaws.m = cracks->material[material].m;
    flaws.volume = 0.0;
    for (size_t k = 0; k < p->n; k++) {
        size_t i = order[k];
        if (p->body[i] != body || p->material[i] != material) continue;
        index[n++] = i;
        flaws.volume += (double)p->m[i] / (p->rho[i] * (p->alpha != NULL ? p->alpha[i] : 1.0));
    }
    if (n == 0 || flaws.k == 0.0) return SPHPA_OK;
    sphpa_result result = sphpa_flaw_check(&flaws, n, err);
    if (result != SPHPA_OK) return result;
    uint64_t stream = (uint64_t)(uint32_t)body | (uint64_t)material << 32;
    result = cracks->sampled
                 ? sphpa_cracks_sample_body_(sim, cracks, &flaws, index, n, stream)
                 : sphpa_cracks_walk_body_(sim, cracks, &flaws, index, n, stream);
    if (result != SPHPA_OK)
        return sphpa_error_set(err, result, "cracks: flaws of body %d, %zu particles: %s",
                               (int)body, n, sphpa_result_message(result));
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_cracks_flaws_(sphpa_sim *sim, sphpa_cracks_params *cracks,
                                                sphpa_error *err) {
    int32_t low = sim->p.body[0], high = low;
    for (size_t i = 0; i < sim->p.n; i++) {
        if (sim->p.body[i] < low) low = sim->p.body[i];
        if (sim->p.body[i] > high) high = sim->p.body[i];
    }
    if ((int64_t)high - (int64_t)low > 4096)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE, "cracks: bodies numbered from %d to %d; "
                               "number them one after another", (int)low, (int)high);
    size_t *order = (size_t *)sphpa_alloc_(sim->p.n, 2 * sizeof(size_t));
    if (order == NULL || !sphpa_cracks_order_(&sim->p, order)) {
        SPHPA_FREE(order);
        return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "cracks: out of memory");
    }
    for (size_t i = 0; i < sim->p.n; i++) { /* a snapshot may have brought others */
        sim->p.flaw_count[i] = sim->p.flaw_first[i] = 0;
        sim->p.flaw_min[i] = 0.0;
        sim->p.flaw_exponent[i] = (sphpa_real)0;
    }
    sphpa_result result = SPHPA_OK;
    for (int64_t body = low; body <= high && result == SPHPA_OK; body++)
        for (int k = 0; k < cracks->solid->materials && result == SPHPA_OK; k++)
            result = sphpa_cracks_body_(sim, cracks, (int32_t)body, k, order, order + sim->p.n,
                                        err);
    SPHPA_FREE(order);
    if (!cracks->keep_all || result != SPHPA_OK) {
        SPHPA_FREE(cracks->pool);
        cracks->pool = NULL;
        cracks->pool_count = 0;
    }
    return result;
}

SPHPA_PRIVATE_ sphpa_result sphpa_cracks_setup_(sphpa_sim *sim, void *params, sphpa_error *err) {
    sphpa_cracks_params *cracks = (sphpa_cracks_params *)params;
    cracks->pool = NULL;
    cracks->pool_count = 0;
    if (cracks->solid == NULL || cracks->material == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING, "cracks: set solid and material");
    if (sphpa_solid_of_scene_(sim, "cracks", cracks->solid, err) == NULL)
        return SPHPA_ERROR_MISSING;
    if (cracks->keep_all && cracks->sampled)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "cracks: keep_all and sampled exclude each other; choose one");
    const sphpa_number_ growth = {"growth", cracks->growth};
    sphpa_result result = sphpa_numbers_check_("cracks", &growth, 1, err);
    if (result != SPHPA_OK) return result;
    for (int k = 0; k < cracks->solid->materials; k++) {
        const sphpa_solid_material *solid = &cracks->solid->material[k];
        if (!sphpa_finite_(cracks->material[k].alpha0))
            return sphpa_error_set(err, SPHPA_ERROR_MATERIAL,
                                   "cracks: material %d has alpha0 = %g; give a finite one, or 0 "
                                   "for no damage by compaction", k, cracks->material[k].alpha0);
        if (cracks->material[k].k != 0.0 && !(solid->eos.K > 0.0 && solid->G > 0.0))
            return sphpa_error_set(err, SPHPA_ERROR_MATERIAL,
                                   "cracks: material %d has flaws but K = %g and G = %g Pa; give "
                                   "both or set its k to 0",
                                   k, solid->eos.K, solid->G);
    }
    return sphpa_cracks_flaws_(sim, cracks, err);
}

SPHPA_PRIVATE_ void sphpa_cracks_teardown_(sphpa_sim *sim, void *params) {
    sphpa_cracks_params *cracks = (sphpa_cracks_params *)params;
    (void)sim;
    SPHPA_FREE(cracks->pool);
    cracks->pool = NULL;
    cracks->pool_count = 0;
}

SPHPA_PRIVATE_ sphpa_result sphpa_cracks_keep_(sphpa_sim *sim, void *params, sphpa_keep_fn exchange,
                                               void *user, sphpa_error *err) {
    sphpa_cracks_params *cracks = (sphpa_cracks_params *)params;
    if (!cracks->keep_all) return SPHPA_OK;
    size_t bytes = cracks->pool_count * sizeof(double);
    void *data = cracks->pool;
    sphpa_result result = exchange(user, "cracks flaws", &data, &bytes, err);
    if (result != SPHPA_OK || data == (void *)cracks->pool) return result;
    SPHPA_FREE(cracks->pool);
    cracks->pool = (double *)data;
    cracks->pool_count = bytes / sizeof(double);
    for (size_t i = 0; i < sim->p.n; i++) /* none may point beyond the end */
        if ((uint64_t)sim->p.flaw_first[i] + sim->p.flaw_count[i] > cracks->pool_count)
            return sphpa_error_set(err, SPHPA_ERROR_FORMAT,
                                   "cracks: particle %zu has flaws %llu to %llu of %zu; the file "
                                   "is damaged, give an earlier checkpoint", i,
                                   (unsigned long long)sim->p.flaw_first[i],
                                   (unsigned long long)sim->p.flaw_first[i] +
                                       sim->p.flaw_count[i], cracks->pool_count);
    return SPHPA_OK;
}

/* ---- growth in a step ------------------------------------------------------------------------ */

/* flaws open at the present strain; cheap where the stress cannot open any */
SPHPA_PRIVATE_ double sphpa_cracks_active_(const sphpa_sim *sim, const sphpa_cracks_params *cracks,
                                           const sphpa_solid_material *solid, size_t i,
                                           double alpha) {
    const sphpa_particles *p = &sim->p;
    sphpa_sym3 S = sphpa_sym3_load_(p->S + 6 * i);
    double P = (double)p->P[i];
    if (sphpa_damage_strain_bound(&S, P, alpha, solid->eos.K, solid->G) < p->flaw_min[i])
        return 0.0;
    double eps = sphpa_damage_strain(&S, P, alpha, solid->eos.K, solid->G);
    if (cracks->keep_all)
        return sphpa_flaws_active_list(eps, cracks->pool + p->flaw_first[i], p->flaw_count[i]);
    sphpa_flaws flaws;
    flaws.eps_min = p->flaw_min[i];
    flaws.exponent = (double)p->flaw_exponent[i];
    flaws.count = p->flaw_count[i];
    return sphpa_flaws_active(&flaws, eps);
}

SPHPA_PRIVATE_ double sphpa_cracks_speed_(const sphpa_sim *sim, const sphpa_solid_material *solid,
                                          size_t i, double alpha) {
    return sphpa_damage_crack_speed(solid->eos.K, solid->G, alpha * sim->p.rho[i]);
}

SPHPA_PRIVATE_ double sphpa_cracks_radius_(const sphpa_sim *sim, size_t i) {
    return sphpa_kernel_support(sim->options.kernel) * (double)sim->p.h[i];
}

SPHPA_PRIVATE_ sphpa_result sphpa_cracks_grow_(sphpa_sim *sim, void *params, size_t first,
                                               size_t last, size_t *bad) {
    const sphpa_cracks_params *cracks = (const sphpa_cracks_params *)params;
    sphpa_particles *p = &sim->p;
    for (size_t i = first; i < last; i++) {
        int material = p->material[i];
        const sphpa_solid_material *solid = &cracks->solid->material[material];
        double alpha = p->alpha != NULL ? p->alpha[i] : 1.0, D13 = (double)p->start.D13[i];
        if (p->flaw_count[i] > 0) {
            double active = sphpa_max_((double)p->start.n_act[i],
                                       sphpa_cracks_active_(sim, cracks, solid, i, alpha));
            D13 = sphpa_damage_advance(D13, active, p->flaw_count[i],
                                       sphpa_cracks_speed_(sim, solid, i, alpha),
                                       sphpa_cracks_radius_(sim, i), sim->dt_stage, cracks->rule);
            p->n_act[i] = (sphpa_real)active;
            p->D13[i] = (sphpa_real)D13;
        }
        double least = p->alpha_min != NULL ? p->alpha_min[i] : alpha; /* pores may spring back */
        double compaction = sphpa_damage_compaction(least, cracks->material[material].alpha0);
        double D = sphpa_damage_total(D13, compaction);
        if (!(D >= 0.0 && D <= 1.0)) {
            *bad = i;
            return SPHPA_ERROR_NOT_FINITE;
        }
        p->D[i] = (sphpa_real)D;
    }
    return SPHPA_OK;
}

SPHPA_PRIVATE_ double sphpa_cracks_limit_(const sphpa_sim *sim, const void *params, size_t i) {
    const sphpa_cracks_params *cracks = (const sphpa_cracks_params *)params;
    const sphpa_particles *p = &sim->p;
    if (p->flaw_count[i] == 0 || !(p->n_act[i] > (sphpa_real)0)) return HUGE_VAL;
    const sphpa_solid_material *solid = &cracks->solid->material[p->material[i]];
    double alpha = p->alpha != NULL ? p->alpha[i] : 1.0;
    return sphpa_damage_dt((double)p->D13[i], (double)p->n_act[i], p->flaw_count[i],
                           sphpa_cracks_speed_(sim, solid, i, alpha),
                           sphpa_cracks_radius_(sim, i), cracks->rule, cracks->growth);
}

SPHPA_DEF sphpa_module sphpa_cracks(sphpa_cracks_params *params) {
    sphpa_module module;
    memset(&module, 0, sizeof module);
    module.name = "cracks";
    module.params = params;
    module.setup = sphpa_cracks_setup_;
    module.teardown = sphpa_cracks_teardown_;
    module.keep = sphpa_cracks_keep_;
    sphpa_mask flaws = SPHPA_F(flaw_min) | SPHPA_F(flaw_exponent) | SPHPA_F(flaw_count) |
                       SPHPA_F(flaw_first);
    sphpa_pass *grow = sphpa_module_pass_(&module, "cracks growth", SPHPA_STAGE_DAMAGE,
                                          flaws | SPHPA_F(S) | SPHPA_F(P) | SPHPA_F(rho) |
                                              SPHPA_F(h),
                                          SPHPA_F(D));
    grow->advances = SPHPA_F(D13) | SPHPA_F(n_act);
    grow->uses = SPHPA_F(alpha) | SPHPA_F(alpha_min);
    grow->particle = sphpa_cracks_grow_;
    grow->at_commit = 1;
    sphpa_pass *limit = sphpa_module_pass_(&module, "damage growth", SPHPA_STAGE_LIMIT,
                                           flaws | SPHPA_F(D13) | SPHPA_F(n_act), 0);
    limit->kind = SPHPA_PASS_REDUCE;
    limit->uses = SPHPA_F(alpha);
    limit->limit = sphpa_cracks_limit_;
    return module;
}

SPHPA_EXTERN_C_END_
#endif /* >>cracks */

#if SPHPA_WANT_SETUP_ && !defined(SPHPA_SETUP_DONE_)
#define SPHPA_SETUP_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>setup   implementation
   ============================================================================================== */

#define SPHPA_MAKE_MOST_ 2147483647.0  /* particles of one body */
#define SPHPA_MAKE_WALK_ 2e10          /* lattice points that may be looked at */
#define SPHPA_MAKE_STREAM_ 0x7475726eu /* of the random numbers: "turn" */

/* The right-angled cell of a lattice. Edges and places beyond the dimension are 0. */
typedef struct sphpa_make_cell_ {
    int points;         /* in the cell */
    double edge[3];     /* [1] in spacings */
    double at[4][3];    /* [1] where the points are, in edges, 0 to 1 */
    double symmetry[3]; /* [1] a centre of symmetry; half an edge from one is another */
    double volume;      /* [1] of one particle, in spacing^dim: eqs. 2 and 3 */
} sphpa_make_cell_;

/* A body under way. */
typedef struct sphpa_make_job_ {
    const char *maker;
    const sphpa_body *body;
    int dim;
    bool ball, stretched;      /* a ball of `radius`; a box that the cells are stretched to */
    double radius;             /* [m] */
    double centre[3], half[3]; /* [m] of the corners */
    double volume;             /* [m^dim]; 0: not known */
    sphpa_make_inside inside;  /* NULL: all of the ball or box */
    void *user;
    sphpa_make_cell_ cell;
    double turn[3][3]; /* [1] the lattice's axes are its columns */
    double origin[3];  /* [1] the place in the cell that is at the centre */
    double spacing;    /* [m] */
    int64_t cells[3];  /* of a stretched box */
    size_t n;          /* particles */
    double *x;         /* (n,3) [m] */
    double size;       /* [m] (V/n)^(1/dim), eq. 1 */
} sphpa_make_job_;

/* ---- the lattice --------------------------------------------------------------------------- */

SPHPA_PRIVATE_ void sphpa_make_place_(sphpa_make_cell_ *cell, double x, double y, double z) {
    double *at = cell->at[cell->points++];
    at[0] = x;
    at[1] = y;
    at[2] = z;
}

SPHPA_PRIVATE_ sphpa_make_cell_ sphpa_make_cell_of_(sphpa_lattice lattice, int dim) {
    sphpa_make_cell_ cell;
    memset(&cell, 0, sizeof cell);
    cell.volume = 1.0;
    cell.edge[0] = 1.0;
    if (dim == 1 || lattice == SPHPA_LATTICE_CUBIC) { /* points in the middle of the cells */
        for (int a = 1; a < dim; a++) cell.edge[a] = 1.0;
        sphpa_make_place_(&cell, 0.5, dim > 1 ? 0.5 : 0.0, dim > 2 ? 0.5 : 0.0);
        return cell;
    }
    cell.edge[1] = sqrt(3.0);
    if (dim == 2) {
        cell.volume = 0.5 * sqrt(3.0);
        cell.symmetry[0] = cell.symmetry[1] = 0.5;
        sphpa_make_place_(&cell, 0.25, 0.25, 0.0);
        sphpa_make_place_(&cell, 0.75, 0.75, 0.0);
        return cell;
    }
    cell.volume = sqrt(0.5);
    cell.edge[2] = sqrt(8.0 / 3.0);
    cell.symmetry[0] = cell.symmetry[1] = 0.25; /* between a layer A and its B, where six meet */
    cell.symmetry[2] = 0.5;
    sphpa_make_place_(&cell, 0.25, 1.0 / 12.0, 0.25); /* layer A */
    sphpa_make_place_(&cell, 0.75, 7.0 / 12.0, 0.25);
    sphpa_make_place_(&cell, 0.25, 5.0 / 12.0, 0.75); /* layer B: a third of sqrt(3) d along y */
    sphpa_make_place_(&cell, 0.75, 11.0 / 12.0, 0.75);
    return cell;
}

/* eq. 4; in 2-D the angle is uniform. Every entry comes from the seed alone. */
SPHPA_PRIVATE_ void sphpa_make_turn_(int dim, uint64_t seed, double turn[3][3], double shift[3]) {
    memset(turn, 0, 9 * sizeof(double));
    for (int a = 0; a < 3; a++) turn[a][a] = 1.0, shift[a] = 0.0;
    if (seed == 0 || dim < 2) return;
    sphpa_rng rng = sphpa_rng_seed(seed, SPHPA_MAKE_STREAM_);
    for (int a = 0; a < dim; a++) shift[a] = sphpa_rng_uniform(&rng);
    if (dim == 2) {
        double angle = 2.0 * SPHPA_PI_ * sphpa_rng_uniform(&rng);
        turn[0][0] = turn[1][1] = cos(angle);
        turn[1][0] = sin(angle);
        turn[0][1] = -turn[1][0];
        return;
    }
    double q[4], norm2;
    do {
        norm2 = 0.0;
        for (int k = 0; k < 4; k++) q[k] = sphpa_rng_normal(&rng), norm2 += q[k] * q[k];
    } while (norm2 < 1e-12);
    double s = 2.0 / norm2;
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;
        turn[a][a] = 1.0 - s * (q[1 + b] * q[1 + b] + q[1 + c] * q[1 + c]);
        turn[a][b] = s * (q[1 + a] * q[1 + b] - q[0] * q[1 + c]);
        turn[b][a] = s * (q[1 + a] * q[1 + b] + q[0] * q[1 + c]);
    }
}

/* Is the point, given from the body's centre and in space, part of the body? */
SPHPA_PRIVATE_ bool sphpa_make_holds_(const sphpa_make_job_ *job, const double from[3],
                                      const double x[3]) {
    if (job->ball) {
        double r2 = from[0] * from[0] + from[1] * from[1] + from[2] * from[2];
        return r2 < job->radius * job->radius;
    }
    for (int a = 0; a < job->dim; a++)
        if (!(fabs(from[a]) < job->half[a])) return false;
    return job->inside == NULL || job->inside(x, job->user) != 0;
}

/* the cells along each axis of the lattice that can touch the body; returns how many points */
SPHPA_PRIVATE_ double sphpa_make_range_(const sphpa_make_job_ *job, double spacing, double first[3],
                                        double last[3]) {
    double points = (double)job->cell.points;
    for (int a = 0; a < 3; a++) {
        first[a] = last[a] = 0.0;
        if (a >= job->dim) continue;
        double reach = job->ball ? job->radius : 0.0;
        for (int b = 0; b < job->dim && !job->ball; b++)
            reach += fabs(job->turn[b][a]) * job->half[b];
        reach /= spacing * job->cell.edge[a];
        first[a] = floor(job->origin[a] - reach) - 1.0;
        last[a] = ceil(job->origin[a] + reach);
        points *= last[a] - first[a] + 1.0;
    }
    return points;
}

/* Walks the lattice through the body, always in the same order; x (n,3) may be NULL. */
SPHPA_PRIVATE_ size_t sphpa_make_walk_(const sphpa_make_job_ *job, double spacing, double *x) {
    double first[3], last[3], k[3], local[3], from[3], to[3];
    size_t n = 0;
    (void)sphpa_make_range_(job, spacing, first, last);
    for (k[2] = first[2]; k[2] <= last[2]; k[2] += 1.0)
        for (k[1] = first[1]; k[1] <= last[1]; k[1] += 1.0)
            for (k[0] = first[0]; k[0] <= last[0]; k[0] += 1.0)
                for (int c = 0; c < job->cell.points; c++) {
                    for (int a = 0; a < 3; a++)
                        local[a] = spacing * job->cell.edge[a] *
                                   (k[a] + job->cell.at[c][a] - job->origin[a]);
                    for (int a = 0; a < 3; a++) {
                        from[a] = job->turn[a][0] * local[0] + job->turn[a][1] * local[1] +
                                  job->turn[a][2] * local[2];
                        to[a] = job->centre[a] + from[a];
                    }
                    if (!sphpa_make_holds_(job, from, to)) continue;
                    if (x != NULL) memcpy(x + 3 * n, to, sizeof to);
                    n++;
                }
    return n;
}

/* cells along each edge of a box that is filled exactly, at least one; returns the particles */
SPHPA_PRIVATE_ double sphpa_make_cells_(const sphpa_make_job_ *job, double spacing,
                                        double cells[3]) {
    double n = (double)job->cell.points;
    for (int a = 0; a < 3; a++) {
        cells[a] = 1.0;
        if (a >= job->dim) continue;
        cells[a] = sphpa_max_(1.0, floor(2.0 * job->half[a] / (spacing * job->cell.edge[a]) + 0.5));
        n *= cells[a];
    }
    return n;
}

/* the points of a stretched box, from the centre so that both halves are alike */
SPHPA_PRIVATE_ void sphpa_make_fill_(const sphpa_make_job_ *job, double *x) {
    int64_t k[3];
    for (k[2] = 0; k[2] < job->cells[2]; k[2]++)
        for (k[1] = 0; k[1] < job->cells[1]; k[1]++)
            for (k[0] = 0; k[0] < job->cells[0]; k[0]++)
                for (int c = 0; c < job->cell.points; c++, x += 3)
                    for (int a = 0; a < 3; a++) {
                        double cells = (double)job->cells[a];
                        double place = 2.0 * ((double)k[a] + job->cell.at[c][a]) - cells;
                        x[a] = a < job->dim ? job->centre[a] + job->half[a] * (place / cells) : 0.0;
                    }
}

/* ---- spacing from a wanted count ----------------------------------------------------------- */

typedef struct sphpa_make_fit_ {
    double spacing, n;
    int phase;
} sphpa_make_fit_;

/* how many particles that spacing gives; negative: too much to walk through */
SPHPA_PRIVATE_ double sphpa_make_count_(const sphpa_make_job_ *job, double spacing) {
    double first[3], last[3];
    if (job->stretched) return sphpa_make_cells_(job, spacing, first);
    if (!(sphpa_make_range_(job, spacing, first, last) <= SPHPA_MAKE_WALK_)) return -1.0;
    return (double)sphpa_make_walk_(job, spacing, NULL);
}

/* Closes in on the count: powers of the ratio first, then halving. The number falls with the
   spacing (strictly so for a ball or box), so what is met on either side of the jump is best. */
SPHPA_PRIVATE_ bool sphpa_make_search_(const sphpa_make_job_ *job, double start, int phase,
                                       sphpa_make_fit_ *best) {
    double wish = (double)job->body->count, many = 0.0, few = 0.0, d = start;
    for (int k = 0; k < 120; k++) {
        double first[3], last[3], n = sphpa_make_count_(job, d);
        if (n < 0.0) return false;
        if (n == 0.0 && sphpa_make_range_(job, d, first, last) > 1e6 + 1e3 * wish) return true;
        if (n > 0.0 && (best->n <= 0.0 || fabs(n - wish) < fabs(best->n - wish))) {
            best->n = n;
            best->spacing = d;
            best->phase = phase;
        }
        if (n == wish) return true;
        if (n > wish) many = d;
        else few = d;
        double guess =
            n > 0.0 ? d * sphpa_clamp_(pow(n / wish, 1.0 / job->dim), 0.3, 3.0) : 0.5 * d;
        bool inside = (many <= 0.0 || guess > many) && (few <= 0.0 || guess < few);
        if (many > 0.0 && few > 0.0) {
            if (few - many < 1e-4 * few / wish && few - many < 1e-6 * few) return true;
            if (!inside || k > 6) guess = 0.5 * (many + few);
        } else if (!inside || guess == d) {
            guess = n > wish ? 1.1 * d : 0.9 * d;
        }
        d = guess;
    }
    return true;
}

/* bit a of the phase: the centre lies half an edge further along axis a */
SPHPA_PRIVATE_ void sphpa_make_phase_(sphpa_make_job_ *job, const double shift[3], int phase) {
    for (int a = 0; a < 3; a++)
        job->origin[a] =
            a < job->dim ? job->cell.symmetry[a] + shift[a] + 0.5 * ((phase >> a) & 1) : 0.0;
}

SPHPA_PRIVATE_ sphpa_result sphpa_make_too_many_(const sphpa_make_job_ *job, double n, double most,
                                                 sphpa_error *err) {
    return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                           "%s: about %.3g %s; the limit is %.3g; use a larger spacing than %g m "
                           "or a smaller count",
                           job->maker, n,
                           most < SPHPA_MAKE_WALK_ ? "particles" : "lattice points to look at",
                           most, job->spacing);
}

/* sets spacing, origin, turn and n */
SPHPA_PRIVATE_ sphpa_result sphpa_make_settle_(sphpa_make_job_ *job, sphpa_error *err) {
    const sphpa_body *body = job->body;
    double shift[3], room = job->volume > 0.0 ? job->volume : 1.0;
    for (int a = 0; a < job->dim && !(job->volume > 0.0); a++) room *= 2.0 * job->half[a];
    sphpa_make_turn_(job->dim, body->seed, job->turn, shift);
    sphpa_make_phase_(job, shift, 0);
    sphpa_make_fit_ best = {body->spacing, 0.0, 0};
    if (body->count > 0) {
        double wish = (double)body->count;
        best.spacing = pow(room / (wish * job->cell.volume), 1.0 / job->dim);
    }
    job->spacing = best.spacing;
    double about = room / (job->cell.volume * pow(job->spacing, job->dim));
    double first[3], last[3];
    if (job->volume > 0.0 && !(about <= SPHPA_MAKE_MOST_))
        return sphpa_make_too_many_(job, about, SPHPA_MAKE_MOST_, err);
    about = job->stretched ? 0.0 : sphpa_make_range_(job, job->spacing, first, last);
    if (!(about <= SPHPA_MAKE_WALK_))
        return sphpa_make_too_many_(job, about, SPHPA_MAKE_WALK_, err);
    int phases = body->seed != 0 || job->stretched ? 1 : 1 << job->dim;
    for (int phase = 0; body->count > 0 && phase < phases; phase++) {
        sphpa_make_phase_(job, shift, phase);
        if (!sphpa_make_search_(job, job->spacing, phase, &best) && best.n <= 0.0)
            return sphpa_make_too_many_(job, SPHPA_MAKE_WALK_, SPHPA_MAKE_WALK_, err);
        if (best.n > 0.0 && fabs(best.n - (double)body->count) <= 0.001 * (double)body->count)
            break;
    }
    sphpa_make_phase_(job, shift, best.phase);
    job->spacing = best.spacing;
    double n = sphpa_make_count_(job, job->spacing);
    if (!(n <= SPHPA_MAKE_MOST_)) return sphpa_make_too_many_(job, n, SPHPA_MAKE_MOST_, err);
    job->n = (size_t)n;
    for (int a = 0; a < job->dim; a++)
        if (!(1e3 * DBL_EPSILON * (fabs(job->centre[a]) + job->half[a]) < job->spacing))
            return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                   "%s: doubles near %g m do not resolve a spacing of %g m; place "
                                   "the body nearer to the origin",
                                   job->maker, job->centre[a], job->spacing);
    if (job->n > 0) return SPHPA_OK;
    return sphpa_error_set(err, SPHPA_ERROR_EMPTY,
                           "%s: no point of a lattice of spacing %g m falls into the body (%g m "
                           "wide); use a smaller spacing, or corners that fit a shape more closely",
                           job->maker, job->spacing, 2.0 * job->half[0]);
}

/* ---- what is asked for --------------------------------------------------------------------- */

SPHPA_PRIVATE_ sphpa_result sphpa_make_bad_(sphpa_error *err, const char *maker, const char *name,
                                            double value, const char *cure) {
    sphpa_result result = sphpa_finite_(value) ? SPHPA_ERROR_NEGATIVE : SPHPA_ERROR_NOT_FINITE;
    return sphpa_error_set(err, result, "%s: %s is %g; %s", maker, name, value, cure);
}

/* components beyond the dimension must be 0, all must be finite */
SPHPA_PRIVATE_ sphpa_result sphpa_make_vector_(sphpa_error *err, const char *maker,
                                               const char *name, const double v[3], int first,
                                               int end, int dim) {
    for (int a = 0; a < 3; a++) {
        if (!sphpa_finite_(v[a]))
            return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE, "%s: %s[%d] is %g; give a number",
                                   maker, name, a, v[a]);
        if ((a < first || a >= end) && v[a] != 0.0)
            return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                   "%s: %s[%d] is %g, but the set has %d dimension%s; set it to 0",
                                   maker, name, a, v[a], dim, dim == 1 ? "" : "s");
    }
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_make_check_fineness_(const char *maker, const sphpa_body *body,
                                                       sphpa_error *err) {
    if (body->spacing != 0.0 && (!(body->spacing > 0.0) || !sphpa_finite_(body->spacing)))
        return sphpa_make_bad_(err, maker, "spacing", body->spacing,
                               "give a positive length, or 0 and a count");
    if (body->spacing != 0.0 && body->count != 0)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "%s: both spacing (%g m) and count (%zu) are given; set one to 0",
                               maker, body->spacing, body->count);
    if (body->spacing == 0.0 && body->count == 0)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                               "%s: neither spacing nor count is given; set one of them", maker);
    if ((double)body->count > SPHPA_MAKE_MOST_)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE, "%s: count is %zu; the limit is %.0f", maker,
                               body->count, SPHPA_MAKE_MOST_);
    if (body->lattice != SPHPA_LATTICE_CUBIC && body->lattice != SPHPA_LATTICE_HEXAGONAL)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "%s: lattice %d is unknown; use SPHPA_LATTICE_CUBIC or _HEXAGONAL",
                               maker, (int)body->lattice);
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_make_check_body_(const char *maker, const sphpa_particles *p,
                                                   int dim, const sphpa_body *body,
                                                   sphpa_error *err) {
    if (!(body->rho > 0.0) || !sphpa_finite_(body->rho))
        return sphpa_make_bad_(err, maker, "rho", body->rho, "give a positive density");
    if (!(body->u >= 0.0) || !sphpa_finite_(body->u))
        return sphpa_make_bad_(err, maker, "u", body->u, "give an energy of 0 or more");
    if (!(body->eta >= 0.0) || !sphpa_finite_(body->eta))
        return sphpa_make_bad_(err, maker, "eta", body->eta, "give about 1.2, or 0 for that");
    if (!sphpa_finite_(body->apart))
        return sphpa_make_bad_(err, maker, "apart", body->apart, "give 0 for the default");
    if (body->alpha != 0.0 && (!(body->alpha >= 1.0) || !sphpa_finite_(body->alpha)))
        return sphpa_error_set(
            err, sphpa_finite_(body->alpha) ? SPHPA_ERROR_ALPHA : SPHPA_ERROR_NOT_FINITE,
            "%s: alpha is %g; the distention is at least 1 (0 means 1)", maker, body->alpha);
    if (body->alpha > 1.0 && p->dim != 0 && p->alpha == NULL)
        return sphpa_error_set(
            err, SPHPA_ERROR_MISSING,
            "%s: alpha is %g, but the set has no field for it; make the set with "
            "sphpa_make_begin or with SPHPA_F(alpha)",
            maker, body->alpha);
    sphpa_result result = sphpa_make_vector_(err, maker, "v", body->v, 0, dim, dim);
    if (result == SPHPA_OK)
        result = sphpa_make_vector_(err, maker, "spin", body->spin, dim == 2 ? 2 : 0,
                                    dim == 1 ? 0 : 3, dim);
    return result == SPHPA_OK ? sphpa_make_check_fineness_(maker, body, err) : result;
}

/* ---- nearest particles --------------------------------------------------------------------- */

/* Some of the particles of a set, sorted into equal cells. */
typedef struct sphpa_make_grid_ {
    const double *x; /* (.,3) [m] of the set */
    int dim;
    double low[3], high[3]; /* [m] */
    double edge;            /* [m] of a cell */
    size_t size[3];         /* cells along each axis */
    size_t count;           /* particles */
    size_t *first;          /* (cells + 1) where a cell's particles begin */
    size_t *item;           /* (count) indices in the set; ascending in each cell */
} sphpa_make_grid_;

SPHPA_PRIVATE_ size_t sphpa_make_cell_at_(const sphpa_make_grid_ *grid, double x, int a) {
    double k = floor((x - grid->low[a]) / grid->edge);
    return k <= 0.0 ? 0 : k >= (double)(grid->size[a] - 1) ? grid->size[a] - 1 : (size_t)k;
}

SPHPA_PRIVATE_ size_t sphpa_make_cell_index_(const sphpa_make_grid_ *grid, const double *x) {
    size_t at = 0;
    for (int a = grid->dim; a-- > 0;) at = at * grid->size[a] + sphpa_make_cell_at_(grid, x[a], a);
    return at;
}

/* cells of about `edge`, larger if there would be many more of them than particles */
SPHPA_PRIVATE_ size_t sphpa_make_grid_shape_(sphpa_make_grid_ *grid, double edge) {
    double widest = 0.0, cells, most = 2.0 * (double)grid->count + 64.0;
    for (int a = 0; a < grid->dim; a++) widest = sphpa_max_(widest, grid->high[a] - grid->low[a]);
    grid->edge = sphpa_max_(edge, widest / 1024.0);
    if (!(grid->edge > 0.0)) grid->edge = 1.0;
    for (;;) {
        cells = 1.0;
        for (int a = 0; a < grid->dim; a++)
            cells *= floor((grid->high[a] - grid->low[a]) / grid->edge) + 1.0;
        if (cells <= most) break;
        grid->edge *= 1.25;
    }
    for (int a = 0; a < 3; a++)
        grid->size[a] =
            a < grid->dim ? (size_t)((grid->high[a] - grid->low[a]) / grid->edge) + 1 : 1;
    return (size_t)cells;
}

/* Sorts item[], which is filled. Takes it over: frees it also when it fails. */
SPHPA_PRIVATE_ bool sphpa_make_grid_build_(sphpa_make_grid_ *grid, double edge) {
    for (int a = 0; a < 3; a++) {
        grid->low[a] = HUGE_VAL;
        grid->high[a] = -HUGE_VAL;
        for (size_t k = 0; k < grid->count; k++) {
            double x = grid->x[3 * grid->item[k] + (size_t)a];
            grid->low[a] = sphpa_min_(grid->low[a], x);
            grid->high[a] = sphpa_max_(grid->high[a], x);
        }
    }
    size_t cells = sphpa_make_grid_shape_(grid, edge);
    size_t *sorted = (size_t *)sphpa_alloc_(grid->count, sizeof(size_t));
    grid->first = (size_t *)sphpa_alloc_(cells + 2, sizeof(size_t));
    if (sorted != NULL && grid->first != NULL) {
        size_t *next = grid->first + 1; /* counts, then starts, then ends = the next one's start */
        memset(grid->first, 0, (cells + 2) * sizeof(size_t));
        for (size_t k = 0; k < grid->count; k++)
            next[sphpa_make_cell_index_(grid, grid->x + 3 * grid->item[k]) + 1]++;
        for (size_t c = 1; c <= cells; c++) next[c] += next[c - 1];
        for (size_t k = 0; k < grid->count; k++)
            sorted[next[sphpa_make_cell_index_(grid, grid->x + 3 * grid->item[k])]++] =
                grid->item[k];
    }
    SPHPA_FREE(grid->item);
    grid->item = sorted;
    return sorted != NULL && grid->first != NULL;
}

SPHPA_PRIVATE_ void sphpa_make_grid_free_(sphpa_make_grid_ *grid) {
    SPHPA_FREE(grid->first);
    SPHPA_FREE(grid->item);
}

SPHPA_PRIVATE_ double sphpa_make_distance_(const double *x, const double *y, int dim) {
    double d2 = 0.0;
    for (int a = 0; a < dim; a++) d2 += (x[a] - y[a]) * (x[a] - y[a]);
    return sqrt(d2);
}

/* size of a particle, the edge of the cube that it fills */
SPHPA_PRIVATE_ double sphpa_make_size_(const sphpa_particles *p, size_t i) {
    return pow((double)p->m[i] / p->rho[i], 1.0 / p->dim);
}

/* The nearest one closer than `reach` and, where `p` is given, closer than `apart` times its own
   size: *distance and true, or false. */
SPHPA_PRIVATE_ bool sphpa_make_nearest_(const sphpa_make_grid_ *grid, const double *x, double reach,
                                        const sphpa_particles *p, double apart, size_t *which,
                                        double *distance) {
    size_t from[3] = {0, 0, 0}, to[3] = {0, 0, 0}, c[3];
    bool found = false;
    for (int a = 0; a < grid->dim; a++) {
        if (x[a] + reach < grid->low[a] || x[a] - reach > grid->high[a]) return false;
        from[a] = sphpa_make_cell_at_(grid, x[a] - reach, a);
        to[a] = sphpa_make_cell_at_(grid, x[a] + reach, a);
    }
    for (c[2] = from[2]; c[2] <= to[2]; c[2]++)
        for (c[1] = from[1]; c[1] <= to[1]; c[1]++) {
            size_t row = (c[2] * grid->size[1] + c[1]) * grid->size[0];
            size_t end = grid->first[row + to[0] + 1];
            for (size_t k = grid->first[row + from[0]]; k < end; k++) {
                double d = sphpa_make_distance_(x, grid->x + 3 * grid->item[k], grid->dim);
                if (!(d < reach)) continue;
                if (p != NULL && !(d < apart * sphpa_make_size_(p, grid->item[k]))) continue;
                reach = d;
                *which = grid->item[k];
                found = true;
            }
        }
    if (found) *distance = reach;
    return found;
}

/* ---- bodies must not overlap --------------------------------------------------------------- */

/* how deep the point lies below the body's surface [m]; of a shape, below its corners' box */
SPHPA_PRIVATE_ double sphpa_make_depth_(const sphpa_make_job_ *job, const double from[3]) {
    double depth = HUGE_VAL;
    if (job->ball)
        return job->radius - sqrt(from[0] * from[0] + from[1] * from[1] + from[2] * from[2]);
    for (int a = 0; a < job->dim; a++) depth = sphpa_min_(depth, job->half[a] - fabs(from[a]));
    return depth;
}

/* older particles inside the new body: the deepest one is told */
SPHPA_PRIVATE_ sphpa_result sphpa_make_check_inside_(const sphpa_make_job_ *job,
                                                     const sphpa_particles *p, sphpa_error *err) {
    double deepest = 0.0;
    size_t which = 0;
    for (size_t i = 0; i < p->n; i++) {
        double from[3] = {0.0, 0.0, 0.0};
        for (int a = 0; a < job->dim; a++) from[a] = p->x[3 * i + (size_t)a] - job->centre[a];
        if (!sphpa_make_holds_(job, from, p->x + 3 * i)) continue;
        double depth = sphpa_make_depth_(job, from);
        if (!(depth > deepest)) continue;
        deepest = depth;
        which = i;
    }
    if (!(deepest > 0.0)) return SPHPA_OK;
    return sphpa_error_set(err, SPHPA_ERROR_COINCIDENT,
                           "%s: body %d would hold particle %zu of body %d, at (%.6g, %.6g, %.6g), "
                           "%.6g m below its surface; move it away by more than that, or set "
                           "apart < 0 if they may overlap",
                           job->maker, (int)job->body->body, which, (int)p->body[which],
                           p->x[3 * which], p->x[3 * which + 1], p->x[3 * which + 2], deepest);
}

/* the older particles within `reach` of the new body's box, in a grid; count 0: none */
SPHPA_PRIVATE_ bool sphpa_make_older_(const sphpa_make_job_ *job, const sphpa_particles *p,
                                      double reach, sphpa_make_grid_ *grid) {
    memset(grid, 0, sizeof *grid);
    grid->x = p->x;
    grid->dim = job->dim;
    for (int pass = 0; pass < 2; pass++) {
        if (pass == 1) {
            if (grid->count == 0) return true;
            grid->item = (size_t *)sphpa_alloc_(grid->count, sizeof(size_t));
            if (grid->item == NULL) return false;
        }
        grid->count = 0;
        for (size_t i = 0; i < p->n; i++) {
            bool close = true;
            for (int a = 0; a < job->dim && close; a++)
                close = fabs(p->x[3 * i + (size_t)a] - job->centre[a]) <= job->half[a] + reach;
            if (!close) continue;
            if (pass == 1) grid->item[grid->count] = i;
            grid->count++;
        }
    }
    return sphpa_make_grid_build_(grid, reach);
}

SPHPA_PRIVATE_ sphpa_result sphpa_make_no_memory_(const char *maker, size_t n, sphpa_error *err) {
    return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "%s: no memory for %zu particles; use fewer",
                           maker, n);
}

SPHPA_PRIVATE_ sphpa_result sphpa_make_check_apart_(const sphpa_make_job_ *job,
                                                    const sphpa_particles *p, sphpa_error *err) {
    double apart = job->body->apart == 0.0 ? 0.3 : job->body->apart, closest = HUGE_VAL;
    if (apart < 0.0 || p->n == 0) return SPHPA_OK;
    sphpa_result result = sphpa_make_check_inside_(job, p, err);
    if (result != SPHPA_OK) return result;
    sphpa_make_grid_ grid;
    double reach = apart * job->size;
    if (!sphpa_make_older_(job, p, reach, &grid)) {
        sphpa_make_grid_free_(&grid);
        return sphpa_make_no_memory_(job->maker, p->n, err);
    }
    size_t which = 0, near = 0;
    const double *mine = NULL;
    for (size_t k = 0; k < job->n && grid.count > 0; k++) {
        double d, limit = sphpa_min_(reach, closest);
        if (!sphpa_make_nearest_(&grid, job->x + 3 * k, limit, p, apart, &near, &d)) continue;
        closest = d;
        which = near;
        mine = job->x + 3 * k;
    }
    sphpa_make_grid_free_(&grid);
    if (mine == NULL) return SPHPA_OK;
    double need = apart * sphpa_min_(job->size, sphpa_make_size_(p, which));
    return sphpa_error_set(err, SPHPA_ERROR_COINCIDENT,
                           "%s: body %d at (%.6g, %.6g, %.6g) is %.6g m from particle %zu of body "
                           "%d, nearer than %.6g m; move it away by %.6g m, or set apart < 0",
                           job->maker, (int)job->body->body, mine[0], mine[1], mine[2], closest,
                           which, (int)p->body[which], need, need - closest);
}

/* ---- bodies -------------------------------------------------------------------------------- */

SPHPA_DEF sphpa_result sphpa_make_begin(sphpa_particles *p, int dim, sphpa_error *err) {
    if (p == NULL) return sphpa_error_set(err, SPHPA_ERROR_MISSING, "sphpa_make_begin: p is NULL");
    return sphpa_particles_create(p, dim, 0, SPHPA_F(alpha), 0, NULL, 0, err);
}

/* writes the fields of particles first .. first + n - 1 */
SPHPA_PRIVATE_ void sphpa_make_write_(const sphpa_make_job_ *job, sphpa_particles *p,
                                      size_t first) {
    const sphpa_body *body = job->body;
    double mean[3] = {0.0, 0.0, 0.0}, eta = body->eta == 0.0 ? 1.2 : body->eta;
    for (size_t k = 0; k < job->n; k++) /* from the centre, so that nothing cancels */
        for (int a = 0; a < job->dim; a++) mean[a] += job->x[3 * k + (size_t)a] - job->centre[a];
    for (int a = 0; a < 3; a++) mean[a] = job->centre[a] + mean[a] / (double)job->n;
    double mass = body->rho * job->volume / (double)job->n; /* eq. 1 */
    for (size_t k = 0; k < job->n; k++) {
        size_t i = first + k;
        const double *x = job->x + 3 * k;
        memcpy(p->x + 3 * i, x, 3 * sizeof(double));
        for (int a = 0; a < 3; a++) { /* eq. 5 */
            int b = (a + 1) % 3, c = (a + 2) % 3;
            double turned = body->spin[b] * (x[c] - mean[c]) - body->spin[c] * (x[b] - mean[b]);
            p->v[3 * i + (size_t)a] = (sphpa_real)(body->v[a] + turned);
        }
        p->m[i] = (sphpa_real)mass;
        p->h[i] = (sphpa_real)(eta * job->size);
        p->rho[i] = body->rho;
        p->u[i] = body->u;
        p->material[i] = body->material;
        p->body[i] = body->body;
        if (p->alpha != NULL) p->alpha[i] = body->alpha == 0.0 ? 1.0 : body->alpha;
    }
}

/* mass and h must be numbers that sphpa_real can hold */
SPHPA_PRIVATE_ sphpa_result sphpa_make_check_mass_(sphpa_make_job_ *job, sphpa_error *err) {
    double n = (double)job->n;
    if (!(job->volume > 0.0)) job->volume = n * job->cell.volume * pow(job->spacing, job->dim);
    job->size = pow(job->volume / n, 1.0 / job->dim);
    double mass = job->body->rho * job->volume / n;
    if ((sphpa_real)mass > 0 && sphpa_finite_((double)(sphpa_real)mass)) return SPHPA_OK;
    return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                           "%s: particles of %g kg (rho %g kg/m3, volume %g) are no number of this "
                           "build; use other units of length or SPHPA_DOUBLE",
                           job->maker, mass, job->body->rho, job->volume);
}

/* everything after the checks of the arguments */
SPHPA_PRIVATE_ sphpa_result sphpa_make_add_(sphpa_make_job_ *job, sphpa_particles *p,
                                            sphpa_error *err) {
    sphpa_result result = sphpa_make_check_mass_(job, err);
    if (result != SPHPA_OK) return result;
    job->x = (double *)sphpa_alloc_(3 * job->n, sizeof(double));
    if (job->x == NULL) return sphpa_make_no_memory_(job->maker, job->n, err);
    if (job->stretched) sphpa_make_fill_(job, job->x);
    else (void)sphpa_make_walk_(job, job->spacing, job->x);
    result = sphpa_make_check_apart_(job, p, err);
    sphpa_particles fresh; /* filled in place of a zeroed set, so that a failure leaves it zeroed */
    memset(&fresh, 0, sizeof fresh);
    size_t first = 0;
    if (result == SPHPA_OK && p->dim == 0) result = sphpa_make_begin(&fresh, job->dim, err);
    sphpa_particles *to = p->dim == 0 ? &fresh : p;
    if (result == SPHPA_OK) result = sphpa_particles_add(to, job->n, &first, err);
    if (result == SPHPA_OK) {
        sphpa_make_write_(job, to, first);
        if (to == &fresh) *p = fresh;
    } else {
        sphpa_particles_free(&fresh);
    }
    SPHPA_FREE(job->x);
    return result;
}

SPHPA_PRIVATE_ sphpa_result sphpa_make_job_start_(sphpa_make_job_ *job, const char *maker,
                                                  const sphpa_particles *p, const void *place,
                                                  const sphpa_body *body, sphpa_error *err) {
    memset(job, 0, sizeof *job);
    if (p == NULL || place == NULL || body == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING, "%s: no %s; pass its address", maker,
                               p == NULL ? "set of particles" : body == NULL ? "body" : "place");
    if (p->dim < 0 || p->dim > 3)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "%s: the set has dimension %d; begin it with sphpa_make_begin",
                               maker, p->dim);
    job->maker = maker;
    job->body = body;
    job->dim = p->dim == 0 ? 3 : p->dim;
    sphpa_result result = sphpa_make_check_body_(maker, p, job->dim, body, err);
    if (result == SPHPA_OK) job->cell = sphpa_make_cell_of_(body->lattice, job->dim);
    return result;
}

/* centre and half edges from corners; *volume of the box */
SPHPA_PRIVATE_ sphpa_result sphpa_make_corners_(sphpa_make_job_ *job, const double low[3],
                                                const double high[3], double *volume,
                                                sphpa_error *err) {
    *volume = 1.0;
    for (int a = 0; a < job->dim; a++) {
        double edge = high[a] - low[a];
        if (!(edge > 0.0) || !sphpa_finite_(edge))
            return sphpa_error_set(
                err, sphpa_finite_(edge) ? SPHPA_ERROR_NEGATIVE : SPHPA_ERROR_NOT_FINITE,
                "%s: the corners on axis %d are %g and %g m; need low < high, both finite",
                job->maker, a, low[a], high[a]);
        job->half[a] = 0.5 * edge;
        job->centre[a] = low[a] + 0.5 * edge;
        *volume *= edge;
    }
    return SPHPA_OK;
}

/* a box that is filled exactly: whole cells along every edge */
SPHPA_PRIVATE_ sphpa_result sphpa_make_stretch_(sphpa_make_job_ *job, sphpa_error *err) {
    double cells[3];
    (void)sphpa_make_cells_(job, job->spacing, cells);
    for (int a = 0; a < 3; a++) {
        job->cells[a] = (int64_t)cells[a];
        if (a >= job->dim) continue;
        double edge = 2.0 * job->half[a], cell = job->spacing * job->cell.edge[a];
        if (edge < 0.5 * cell * (1.0 - 1e-12))
            return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                   "%s: the edge on axis %d is %g m, less than half of the "
                                   "lattice's cell of %g m; use a smaller spacing than %g m",
                                   job->maker, a, edge, cell, job->spacing);
    }
    return SPHPA_OK;
}

SPHPA_PRIVATE_ sphpa_result sphpa_make_finish_(sphpa_make_job_ *job, sphpa_particles *p,
                                               sphpa_error *err) {
    sphpa_result result = sphpa_make_settle_(job, err);
    if (result == SPHPA_OK && job->stretched) result = sphpa_make_stretch_(job, err);
    return result == SPHPA_OK ? sphpa_make_add_(job, p, err) : result;
}

SPHPA_DEF sphpa_result sphpa_make_sphere(sphpa_particles *p, const double centre[3], double radius,
                                         const sphpa_body *body, sphpa_error *err) {
    sphpa_make_job_ job;
    sphpa_result result = sphpa_make_job_start_(&job, "sphpa_make_sphere", p, centre, body, err);
    if (result != SPHPA_OK) return result;
    if (!(radius > 0.0) || !sphpa_finite_(radius))
        return sphpa_make_bad_(err, job.maker, "radius", radius, "give a positive length in m");
    for (int a = 0; a < job.dim; a++) {
        if (!sphpa_finite_(centre[a]))
            return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                                   "%s: centre[%d] is %g; give a number", job.maker, a, centre[a]);
        job.centre[a] = centre[a];
        job.half[a] = radius;
    }
    job.radius = radius;
    job.ball = job.dim > 1;
    job.stretched = !job.ball;
    job.volume = job.dim == 1   ? 2.0 * radius
                 : job.dim == 2 ? SPHPA_PI_ * radius * radius
                                : 4.0 / 3.0 * SPHPA_PI_ * radius * radius * radius;
    return sphpa_make_finish_(&job, p, err);
}

SPHPA_DEF sphpa_result sphpa_make_box(sphpa_particles *p, const double low[3], const double high[3],
                                      const sphpa_body *body, sphpa_error *err) {
    sphpa_make_job_ job;
    sphpa_result result =
        sphpa_make_job_start_(&job, "sphpa_make_box", p, low == NULL ? low : high, body, err);
    if (result == SPHPA_OK) result = sphpa_make_corners_(&job, low, high, &job.volume, err);
    if (result != SPHPA_OK) return result;
    job.stretched = body->seed == 0 || job.dim == 1;
    return sphpa_make_finish_(&job, p, err);
}

SPHPA_DEF sphpa_result sphpa_make_shape(sphpa_particles *p, sphpa_make_inside inside, void *user,
                                        const double low[3], const double high[3], double volume,
                                        const sphpa_body *body, sphpa_error *err) {
    sphpa_make_job_ job;
    double box;
    if (inside == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING,
                               "sphpa_make_shape: no function that tells what is inside");
    sphpa_result result =
        sphpa_make_job_start_(&job, "sphpa_make_shape", p, low == NULL ? low : high, body, err);
    if (result == SPHPA_OK) result = sphpa_make_corners_(&job, low, high, &box, err);
    if (result != SPHPA_OK) return result;
    if (!(volume >= 0.0) || !sphpa_finite_(volume))
        return sphpa_make_bad_(err, job.maker, "volume", volume, "give it in m3, or 0");
    if (volume > box * (1.0 + 1e-12))
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "%s: the volume %g is more than that between the corners, %g",
                               job.maker, volume, box);
    job.volume = volume;
    job.inside = inside;
    job.user = user;
    return sphpa_make_finish_(&job, p, err);
}

/* ---- bodies that are there ----------------------------------------------------------------- */

SPHPA_PRIVATE_ sphpa_result sphpa_make_no_body_(const char *what, int32_t body, sphpa_error *err) {
    return sphpa_error_set(err, SPHPA_ERROR_EMPTY,
                           "%s: no particle of body %d; make it first, or check its number", what,
                           (int)body);
}

/* a close pair to start from: each the nearest to the other, a few times over */
SPHPA_PRIVATE_ double sphpa_make_close_pair_(const sphpa_particles *p, const int32_t body[2],
                                             const size_t start) {
    size_t at = start;
    double best = HUGE_VAL;
    for (int k = 0; k < 6; k++) {
        double nearest = HUGE_VAL;
        size_t next = at;
        for (size_t i = 0; i < p->n; i++) {
            if (p->body[i] != body[(k + 1) % 2]) continue;
            double d = sphpa_make_distance_(p->x + 3 * i, p->x + 3 * at, p->dim);
            if (d < nearest) nearest = d, next = i;
        }
        if (!(nearest < best)) break;
        best = nearest;
        at = next;
    }
    return best;
}

/* every particle of body_b against the grid of body_a's, looking no further than the best so far */
SPHPA_PRIVATE_ double sphpa_make_gap_of_(const sphpa_particles *p, const sphpa_make_grid_ *grid,
                                         int32_t body_b, double best) {
    double middle[3] = {0.0, 0.0, 0.0}, radius = 0.0;
    for (int a = 0; a < p->dim; a++) middle[a] = 0.5 * (grid->low[a] + grid->high[a]);
    for (size_t k = 0; k < grid->count; k++)
        radius = sphpa_max_(radius, sphpa_make_distance_(p->x + 3 * grid->item[k], middle, p->dim));
    for (size_t i = 0; i < p->n; i++) {
        if (p->body[i] != body_b) continue;
        double d, far = sphpa_make_distance_(p->x + 3 * i, middle, p->dim);
        size_t which;
        if (far * (1.0 - 1e-12) - radius > best) continue;
        if (sphpa_make_nearest_(grid, p->x + 3 * i, best, NULL, 0.0, &which, &d)) best = d;
    }
    return best;
}

SPHPA_DEF sphpa_result sphpa_make_gap(const sphpa_particles *p, int32_t body_a, int32_t body_b,
                                      double *gap, sphpa_error *err) {
    static const char what[] = "sphpa_make_gap";
    if (p == NULL || gap == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING, "%s: no %s", what,
                               p == NULL ? "set of particles" : "place for the result");
    if (body_a == body_b)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE, "%s: body %d twice; name two bodies", what,
                               (int)body_a);
    sphpa_make_grid_ grid;
    memset(&grid, 0, sizeof grid);
    size_t others = 0, first = 0;
    for (size_t i = 0; i < p->n; i++) {
        if (p->body[i] != body_a && p->body[i] != body_b) continue;
        for (int a = 0; a < p->dim; a++)
            if (!sphpa_finite_(p->x[3 * i + (size_t)a]))
                return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                                       "%s: coordinate %d of particle %zu is %g", what, a, i,
                                       p->x[3 * i + (size_t)a]);
        if (p->body[i] == body_b) others++;
        else if (grid.count++ == 0) first = i;
    }
    if (grid.count == 0 || others == 0)
        return sphpa_make_no_body_(what, grid.count == 0 ? body_a : body_b, err);
    grid.x = p->x;
    grid.dim = p->dim;
    grid.item = (size_t *)sphpa_alloc_(grid.count, sizeof(size_t));
    if (grid.item == NULL) return sphpa_make_no_memory_(what, grid.count, err);
    size_t filled = 0;
    for (size_t i = 0; i < p->n; i++)
        if (p->body[i] == body_a) grid.item[filled++] = i;
    bool built = sphpa_make_grid_build_(&grid, 0.0);
    const int32_t bodies[2] = {body_a, body_b};
    if (built)
        *gap = sphpa_make_gap_of_(p, &grid, body_b, sphpa_make_close_pair_(p, bodies, first));
    sphpa_make_grid_free_(&grid);
    return built ? SPHPA_OK : sphpa_make_no_memory_(what, filled, err);
}

SPHPA_PRIVATE_ sphpa_result sphpa_make_check_move_(const char *what, const sphpa_particles *p,
                                                   int32_t body, const char *name,
                                                   const double by[3], sphpa_error *err) {
    if (p == NULL || by == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING, "%s: no %s", what,
                               p == NULL ? "set of particles" : name);
    int dim = p->dim == 0 ? 3 : p->dim;
    sphpa_result result = sphpa_make_vector_(err, what, name, by, 0, dim, dim);
    if (result != SPHPA_OK) return result;
    for (size_t i = 0; i < p->n; i++)
        if (p->body[i] == body) return SPHPA_OK;
    return sphpa_make_no_body_(what, body, err);
}

SPHPA_DEF sphpa_result sphpa_make_shift(sphpa_particles *p, int32_t body, const double dx[3],
                                        sphpa_error *err) {
    sphpa_result result = sphpa_make_check_move_("sphpa_make_shift", p, body, "dx", dx, err);
    if (result != SPHPA_OK) return result;
    for (size_t i = 0; i < p->n; i++) {
        if (p->body[i] != body) continue;
        for (size_t a = 0; a < 3; a++) p->x[3 * i + a] += dx[a];
    }
    return SPHPA_OK;
}

SPHPA_DEF sphpa_result sphpa_make_kick(sphpa_particles *p, int32_t body, const double v[3],
                                       sphpa_error *err) {
    sphpa_result result = sphpa_make_check_move_("sphpa_make_kick", p, body, "v", v, err);
    if (result != SPHPA_OK) return result;
    for (size_t i = 0; i < p->n; i++)
        for (size_t a = 0; a < 3 && p->body[i] == body; a++)
            p->v[3 * i + a] = (sphpa_real)((double)p->v[3 * i + a] + v[a]);
    return SPHPA_OK;
}

SPHPA_EXTERN_C_END_
#endif /* >>setup */

#if SPHPA_WANT_FRAGMENTS_ && !defined(SPHPA_FRAGMENTS_DONE_)
#define SPHPA_FRAGMENTS_DONE_
SPHPA_EXTERN_C_BEGIN_

/* ================================================================================================
   >>fragments   implementation
   ============================================================================================== */

typedef struct sphpa_fragment_key_ {
    int64_t id;
    size_t index;
} sphpa_fragment_key_;

typedef struct sphpa_fragment_place_ {
    sphpa_fragment fragment;
    size_t group; /* as friends of friends numbered it */
} sphpa_fragment_place_;

/* What one search needs; all of it is freed at its end. */
typedef struct sphpa_fragment_work_ {
    double *link;                 /* (n) [m] */
    unsigned char *mask;          /* (n) 1: whole */
    sphpa_fragment_key_ *key;     /* (n) sorted by id */
    sphpa_fragment_place_ *place; /* (groups) */
    double *wrap;                 /* (groups,6) sums of cos and sin along the periodic axes */
    int32_t *rank;                /* (groups) place in the list of each group */
    sphpa_tree tree;
} sphpa_fragment_work_;

SPHPA_PRIVATE_ void sphpa_fragment_work_free_(sphpa_fragment_work_ *work) {
    SPHPA_FREE(work->link);
    SPHPA_FREE(work->mask);
    SPHPA_FREE(work->key);
    SPHPA_FREE(work->place);
    SPHPA_FREE(work->wrap);
    SPHPA_FREE(work->rank);
    sphpa_tree_free(&work->tree);
}

SPHPA_DEF void sphpa_fragment_free(sphpa_fragments *fragments) {
    if (fragments == NULL) return;
    SPHPA_FREE(fragments->label);
    SPHPA_FREE(fragments->list);
    memset(fragments, 0, sizeof *fragments);
}

SPHPA_PRIVATE_ sphpa_result sphpa_fragment_no_memory_(size_t n, sphpa_error *err) {
    return sphpa_error_set(err, SPHPA_ERROR_MEMORY,
                           "sphpa_fragment_find: no memory for %zu particles; free some", n);
}

/* fills in the defaults */
SPHPA_PRIVATE_ sphpa_result sphpa_fragment_options_(const sphpa_fragment_options *from,
                                                    sphpa_fragment_options *to, sphpa_error *err) {
    memset(to, 0, sizeof *to);
    if (from != NULL) *to = *from;
    if (to->link == 0.0) to->link = 1.0;
    if (to->support == 0.0) to->support = 2.0;
    if (to->damage_below == 0.0) to->damage_below = 0.9;
    const double value[3] = {to->link, to->support, to->damage_below};
    static const char *const name[3] = {"link", "support", "damage_below"};
    for (int k = 0; k < 3; k++) {
        if (!sphpa_finite_(value[k]))
            return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                                   "sphpa_fragment_find: %s is %g; give a number, 0 for the "
                                   "default",
                                   name[k], value[k]);
        if (k < 2 && value[k] < 0.0)
            return sphpa_error_set(err, SPHPA_ERROR_NEGATIVE,
                                   "sphpa_fragment_find: %s is %g; give a positive number, 0 for "
                                   "the default",
                                   name[k], value[k]);
    }
    return SPHPA_OK;
}

SPHPA_PRIVATE_ bool sphpa_fragment_is_dust_(const sphpa_particles *p, size_t i,
                                            const sphpa_fragment_options *options) {
    if (p->D == NULL || options->damage_below < 0.0 || options->damage_below > 1.0) return false;
    return !((double)p->D[i] < options->damage_below);
}

SPHPA_PRIVATE_ bool sphpa_fragment_takes_part_(const sphpa_particles *p, size_t i,
                                               const sphpa_fragment_options *options) {
    return !options->one_body || p->body[i] == options->body;
}

SPHPA_PRIVATE_ sphpa_result sphpa_fragment_bad_(const sphpa_particles *p, size_t i,
                                                const char *name, double value, sphpa_error *err) {
    return sphpa_error_set(err,
                           sphpa_finite_(value) ? SPHPA_ERROR_NEGATIVE : SPHPA_ERROR_NOT_FINITE,
                           "sphpa_fragment_find: %s of particle %zu (id %lld) is %g; %s", name, i,
                           (long long)p->id[i], value,
                           sphpa_finite_(value) ? "it must be positive"
                                                : "check where the value comes from");
}

SPHPA_PRIVATE_ sphpa_result sphpa_fragment_check_(const sphpa_particles *p, size_t i, double link,
                                                  sphpa_error *err) {
    const double positive[3] = {(double)p->m[i], (double)p->h[i], link};
    static const char *const names[3] = {"m", "h", "the linking length"};
    for (int k = 0; k < 3; k++)
        if (!(positive[k] > 0.0) || !sphpa_finite_(positive[k]))
            return sphpa_fragment_bad_(p, i, names[k], positive[k], err);
    for (size_t a = 0; a < 3; a++)
        if (!sphpa_finite_((double)p->v[3 * i + a]))
            return sphpa_fragment_bad_(p, i, "v", (double)p->v[3 * i + a], err);
    if (!sphpa_finite_(p->u[i])) return sphpa_fragment_bad_(p, i, "u", p->u[i], err);
    if (p->D == NULL || sphpa_finite_((double)p->D[i])) return SPHPA_OK;
    return sphpa_fragment_bad_(p, i, "D", (double)p->D[i], err);
}

/* linking lengths and who may be linked */
SPHPA_PRIVATE_ sphpa_result sphpa_fragment_links_(const sphpa_particles *p,
                                                  const sphpa_box *periodic,
                                                  const sphpa_fragment_options *options,
                                                  sphpa_fragment_work_ *work, sphpa_error *err) {
    double half = HUGE_VAL;
    size_t taking_part = 0;
    for (int a = 0; periodic != NULL && a < p->dim; a++)
        if (periodic->periodic[a] && periodic->high[a] > periodic->low[a]) /* else the tree says */
            half = sphpa_min_(half, 0.5 * (periodic->high[a] - periodic->low[a]));
    for (size_t i = 0; i < p->n; i++) {
        double link = options->link * options->support * (double)p->h[i];
        bool part = sphpa_fragment_takes_part_(p, i, options);
        sphpa_result result = sphpa_fragment_check_(p, i, link, err);
        if (result != SPHPA_OK) return result;
        taking_part += part;
        work->mask[i] = part && !sphpa_fragment_is_dust_(p, i, options);
        if (work->mask[i] && link > half)
            return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                   "sphpa_fragment_find: the linking length of particle %zu, %g m, "
                                   "is above half of the periodic box, %g m; use a smaller link",
                                   i, link, half);
        work->link[i] = sphpa_min_(link, half); /* the tree wants no more, also of those left out */
    }
    if (taking_part > 0) return SPHPA_OK;
    return sphpa_error_set(err, SPHPA_ERROR_EMPTY,
                           "sphpa_fragment_find: no particle of body %d; check its number",
                           (int)options->body);
}

SPHPA_PRIVATE_ int sphpa_fragment_compare_key_(const void *a, const void *b) {
    const sphpa_fragment_key_ *p = (const sphpa_fragment_key_ *)a;
    const sphpa_fragment_key_ *q = (const sphpa_fragment_key_ *)b;
    if (p->id != q->id) return p->id < q->id ? -1 : 1;
    return p->index < q->index ? -1 : p->index > q->index ? 1 : 0;
}

SPHPA_PRIVATE_ int sphpa_fragment_compare_(const void *a, const void *b) {
    const sphpa_fragment *p = &((const sphpa_fragment_place_ *)a)->fragment;
    const sphpa_fragment *q = &((const sphpa_fragment_place_ *)b)->fragment;
    if (p->mass != q->mass) return p->mass > q->mass ? -1 : 1;
    return p->id < q->id ? -1 : p->id > q->id ? 1 : 0;
}

/* the period of an axis, or 0 */
SPHPA_PRIVATE_ double sphpa_fragment_period_(const sphpa_box *periodic, int dim, int axis) {
    if (periodic == NULL || axis >= dim || !periodic->periodic[axis]) return 0.0;
    return periodic->high[axis] - periodic->low[axis];
}

/* the nearest image of dx */
SPHPA_PRIVATE_ double sphpa_fragment_nearest_(double dx, double period) {
    return period > 0.0 ? dx - period * floor(dx / period + 0.5) : dx;
}

/* eq. 2: sums over the members by rising id; centre holds sum of m (x - x of the smallest id) */
SPHPA_PRIVATE_ void sphpa_fragment_sum_(const sphpa_particles *p, const sphpa_box *periodic,
                                        const int32_t *label, sphpa_fragment_work_ *work,
                                        size_t *start) {
    for (size_t k = 0; k < p->n; k++) {
        size_t i = work->key[k].index;
        if (label[i] < 0) continue;
        size_t group = (size_t)label[i];
        sphpa_fragment *fragment = &work->place[group].fragment;
        double m = (double)p->m[i];
        if (fragment->count++ == 0) {
            fragment->id = p->id[i];
            start[group] = i;
        }
        fragment->mass += m;
        fragment->internal += m * p->u[i];
        for (size_t a = 0; a < 3; a++) {
            double period = sphpa_fragment_period_(periodic, p->dim, (int)a);
            double dx = p->x[3 * i + a] - p->x[3 * start[group] + a];
            fragment->velocity[a] += m * (double)p->v[3 * i + a];
            fragment->centre[a] += m * dx;
            if (!(period > 0.0)) continue;
            work->wrap[6 * group + a] += m * cos(2.0 * SPHPA_PI_ * dx / period);
            work->wrap[6 * group + 3 + a] += m * sin(2.0 * SPHPA_PI_ * dx / period);
        }
    }
}

/* The centres from these sums. Along a periodic axis the mean direction on the circle (Bai & Breen
   2008) tells where the fragment is, and the mean of the images nearest to that is the centre. */
SPHPA_PRIVATE_ void sphpa_fragment_centre_(const sphpa_particles *p, size_t groups,
                                           const sphpa_box *periodic, sphpa_fragment_work_ *work,
                                           const size_t *start) {
    for (size_t g = 0; g < groups; g++) {
        sphpa_fragment *fragment = &work->place[g].fragment;
        for (size_t a = 0; a < 3; a++) {
            double period = sphpa_fragment_period_(periodic, p->dim, (int)a);
            fragment->velocity[a] /= fragment->mass;
            fragment->centre[a] =
                p->x[3 * start[g] + a] +
                (period > 0.0 ? period / (2.0 * SPHPA_PI_) *
                                    atan2(work->wrap[6 * g + 3 + a], work->wrap[6 * g + a])
                              : fragment->centre[a] / fragment->mass);
        }
    }
}

/* one step of: centre of the images that are nearest to the centre; into the box at the end */
SPHPA_PRIVATE_ void sphpa_fragment_recentre_(const sphpa_particles *p, size_t groups,
                                             const sphpa_box *periodic, const int32_t *label,
                                             sphpa_fragment_work_ *work, bool last) {
    memset(work->wrap, 0, 6 * groups * sizeof(double));
    for (size_t k = 0; k < p->n; k++) {
        size_t i = work->key[k].index;
        if (label[i] < 0) continue;
        size_t g = (size_t)label[i];
        for (size_t a = 0; a < 3; a++)
            work->wrap[6 * g + a] +=
                (double)p->m[i] *
                sphpa_fragment_nearest_(p->x[3 * i + a] - work->place[g].fragment.centre[a],
                                        sphpa_fragment_period_(periodic, p->dim, (int)a));
    }
    for (size_t g = 0; g < groups; g++) {
        sphpa_fragment *fragment = &work->place[g].fragment;
        for (size_t a = 0; a < 3; a++) {
            double period = sphpa_fragment_period_(periodic, p->dim, (int)a);
            if (!(period > 0.0)) continue;
            double x = fragment->centre[a] + work->wrap[6 * g + a] / fragment->mass;
            if (last) x -= period * floor((x - periodic->low[a]) / period);
            if (last && !(x < periodic->high[a])) x = periodic->low[a];
            fragment->centre[a] = x;
        }
    }
}

/* eq. 3 */
SPHPA_PRIVATE_ void sphpa_fragment_turn_(const sphpa_particles *p, const sphpa_box *periodic,
                                         const int32_t *label, sphpa_fragment_work_ *work) {
    for (size_t k = 0; k < p->n; k++) {
        size_t i = work->key[k].index;
        if (label[i] < 0) continue;
        sphpa_fragment *fragment = &work->place[label[i]].fragment;
        double dx[3], dv[3], m = (double)p->m[i];
        for (size_t a = 0; a < 3; a++) {
            dx[a] = sphpa_fragment_nearest_(p->x[3 * i + a] - fragment->centre[a],
                                            sphpa_fragment_period_(periodic, p->dim, (int)a));
            dv[a] = (double)p->v[3 * i + a] - fragment->velocity[a];
        }
        for (int a = 0; a < 3; a++) {
            int b = (a + 1) % 3, c = (a + 2) % 3;
            fragment->angular[a] += m * (dx[b] * dv[c] - dx[c] * dv[b]);
        }
    }
}

/* everything that is known of the groups */
SPHPA_PRIVATE_ bool sphpa_fragment_measure_(const sphpa_particles *p, const sphpa_box *periodic,
                                            size_t groups, const int32_t *label,
                                            sphpa_fragment_work_ *work) {
    size_t *start = (size_t *)sphpa_alloc_(groups, sizeof(size_t));
    work->place = (sphpa_fragment_place_ *)sphpa_alloc_(groups, sizeof *work->place);
    work->wrap = (double *)sphpa_alloc_(6 * groups, sizeof(double));
    if (start == NULL || work->place == NULL || work->wrap == NULL) {
        SPHPA_FREE(start);
        return false;
    }
    memset(work->place, 0, groups * sizeof *work->place);
    memset(work->wrap, 0, 6 * groups * sizeof(double));
    for (size_t g = 0; g < groups; g++) work->place[g].group = g;
    sphpa_fragment_sum_(p, periodic, label, work, start);
    sphpa_fragment_centre_(p, groups, periodic, work, start);
    SPHPA_FREE(start);
    bool wraps = false;
    for (int a = 0; a < p->dim; a++) wraps |= sphpa_fragment_period_(periodic, p->dim, a) > 0.0;
    for (int step = 0; wraps && step < 3; step++)
        sphpa_fragment_recentre_(p, groups, periodic, label, work, step == 2);
    sphpa_fragment_turn_(p, periodic, label, work);
    return true;
}

/* Sorts the fragments, renames the labels, and sums what did not end up in one. */
SPHPA_PRIVATE_ bool sphpa_fragment_collect_(const sphpa_particles *p, size_t groups,
                                            sphpa_fragment_work_ *work, sphpa_fragments *out) {
    out->list = (sphpa_fragment *)sphpa_alloc_(groups, sizeof *out->list);
    work->rank = (int32_t *)sphpa_alloc_(groups, sizeof(int32_t));
    if (out->list == NULL || work->rank == NULL) return false;
    qsort(work->place, groups, sizeof *work->place, sphpa_fragment_compare_);
    out->count = groups;
    for (size_t g = 0; g < groups; g++) {
        out->list[g] = work->place[g].fragment;
        out->mass += out->list[g].mass;
        work->rank[work->place[g].group] = (int32_t)g;
    }
    for (size_t k = 0; k < p->n; k++) {
        size_t i = work->key[k].index;
        if (out->label[i] >= 0) {
            out->label[i] = work->rank[out->label[i]];
        } else if (sphpa_fragment_takes_part_(p, i, &out->options)) {
            out->label[i] = SPHPA_FRAGMENT_DUST;
            out->dust += (double)p->m[i];
            out->dust_count++;
            for (size_t a = 0; a < 3; a++)
                out->dust_momentum[a] += (double)p->m[i] * (double)p->v[3 * i + a];
        } else {
            out->label[i] = SPHPA_FRAGMENT_OTHER;
        }
    }
    out->mass += out->dust;
    return true;
}

SPHPA_PRIVATE_ sphpa_result sphpa_fragment_search_(const sphpa_particles *p,
                                                   const sphpa_box *periodic,
                                                   sphpa_fragment_work_ *work, sphpa_fragments *out,
                                                   sphpa_error *err) {
    size_t groups = 0;
    work->link = (double *)sphpa_alloc_(p->n, sizeof(double));
    work->mask = (unsigned char *)sphpa_alloc_(p->n, 1);
    work->key = (sphpa_fragment_key_ *)sphpa_alloc_(p->n, sizeof *work->key);
    out->label = (int32_t *)sphpa_alloc_(p->n, sizeof(int32_t));
    if (work->link == NULL || work->mask == NULL || work->key == NULL || out->label == NULL)
        return sphpa_fragment_no_memory_(p->n, err);
    out->n = p->n;
    sphpa_result result = sphpa_fragment_links_(p, periodic, &out->options, work, err);
    if (result == SPHPA_OK)
        result = sphpa_tree_build(&work->tree, p->dim, p->n, p->x, work->link, periodic, err);
    if (result == SPHPA_OK)
        result = sphpa_tree_friends(&work->tree, work->link, work->mask, out->label, &groups, err);
    if (result != SPHPA_OK) return result;
    for (size_t i = 0; i < p->n; i++) {
        work->key[i].id = p->id[i];
        work->key[i].index = i;
    }
    qsort(work->key, p->n, sizeof *work->key, sphpa_fragment_compare_key_);
    if (sphpa_fragment_measure_(p, periodic, groups, out->label, work) &&
        sphpa_fragment_collect_(p, groups, work, out))
        return SPHPA_OK;
    return sphpa_fragment_no_memory_(p->n, err);
}

SPHPA_DEF sphpa_result sphpa_fragment_find(const sphpa_particles *p, const sphpa_box *periodic,
                                           const sphpa_fragment_options *options,
                                           sphpa_fragments *out, sphpa_error *err) {
    if (p == NULL || out == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MISSING, "sphpa_fragment_find: no %s",
                               p == NULL ? "set of particles" : "place for the result");
    if (p->n == 0)
        return sphpa_error_set(err, SPHPA_ERROR_EMPTY,
                               "sphpa_fragment_find: the set has no particles; add some");
    sphpa_fragments found;
    sphpa_fragment_work_ work;
    memset(&found, 0, sizeof found);
    memset(&work, 0, sizeof work);
    sphpa_result result = sphpa_fragment_options_(options, &found.options, err);
    if (result == SPHPA_OK) result = sphpa_fragment_search_(p, periodic, &work, &found, err);
    sphpa_fragment_work_free_(&work);
    if (result == SPHPA_OK) {
        sphpa_fragment_free(out);
        *out = found;
    } else {
        sphpa_fragment_free(&found);
    }
    return result;
}

SPHPA_DEF size_t sphpa_fragment_cumulative(const sphpa_fragments *fragments, double *mass,
                                           size_t *number) {
    size_t entries = 0, count = fragments == NULL ? 0 : fragments->count;
    for (size_t k = 0; k < count; k++) {
        double m = fragments->list[k].mass;
        if (k + 1 < count && fragments->list[k + 1].mass == m) continue;
        if (mass != NULL) mass[entries] = m;
        if (number != NULL) number[entries] = k + 1;
        entries++;
    }
    return entries;
}

SPHPA_DEF double sphpa_fragment_largest(const sphpa_fragments *fragments, double total) {
    if (fragments == NULL || fragments->count == 0) return 0.0;
    return fragments->list[0].mass / (total == 0.0 ? fragments->mass : total);
}

SPHPA_EXTERN_C_END_
#endif /* >>fragments */

#if SPHPA_WANT_SNAPSHOT_ && !defined(SPHPA_SNAPSHOT_DONE_)
#define SPHPA_SNAPSHOT_DONE_
/* ================================================================================================
   >>snapshot   implementation
   ============================================================================================== */

#include <errno.h>
#include <hdf5.h>
#if defined(__unix__) || defined(__APPLE__)
#include <fcntl.h>
#include <unistd.h>
#endif

SPHPA_EXTERN_C_BEGIN_

enum { SPHPA_CHECKPOINT_FORMAT_ = 3 }; /* what lies under /sphpa, and how */

/* ---- whole files ----------------------------------------------------------------------------- */

/* Creates or overwrites `path`; synchronous, as fsync is not declared in strict C11. *opened tells
   whether there is now something to remove. errno says why it failed. */
SPHPA_PRIVATE_ bool sphpa_file_spill_(const char *path, const char *data, size_t bytes,
                                      bool *opened) {
#if defined(__unix__) || defined(__APPLE__)
    int flags = O_WRONLY | O_CREAT | O_TRUNC;
#ifdef O_SYNC
    flags |= O_SYNC;
#endif
    int file = open(path, flags, 0666);
    *opened = file >= 0;
    if (file < 0) return false;
    size_t done = 0, most = (size_t)1 << 28; /* one call writes at most 2 GB on some systems */
    while (done < bytes) {
        ssize_t part = write(file, data + done, bytes - done < most ? bytes - done : most);
        if (part < 0 && errno == EINTR) continue;
        if (part <= 0) {
            int why = part == 0 ? ENOSPC : errno;
            close(file);
            errno = why;
            return false;
        }
        done += (size_t)part;
    }
    return close(file) == 0;
#else
    FILE *file = fopen(path, "wb");
    *opened = file != NULL;
    if (file == NULL) return false;
    bool written = fwrite(data, 1, bytes, file) == bytes && fflush(file) == 0;
    return (fclose(file) == 0) && written;
#endif
}

/* The file `path` gets this content, or stays as it was. */
SPHPA_PRIVATE_ sphpa_result sphpa_file_replace_(const char *path, const void *data, size_t bytes,
                                                sphpa_error *err) {
    size_t length = strlen(path);
    char *part = (char *)sphpa_alloc_(length + 6, 1);
    if (part == NULL) return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "out of memory");
    memcpy(part, path, length);
    memcpy(part + length, ".part", 6);
    bool opened = false;
    errno = 0;
    bool done = sphpa_file_spill_(part, (const char *)data, bytes, &opened);
#ifdef _WIN32
    if (done) (void)remove(path); /* rename does not replace there */
#endif
    done = done && rename(part, path) == 0;
    int why = errno;
    if (!done && opened) (void)remove(part);
    SPHPA_FREE(part);
    if (done) return SPHPA_OK;
    return sphpa_error_set(err, SPHPA_ERROR_FILE,
                           "%s: cannot write %zu bytes: %s; check that the directory exists and "
                           "may be written and that the disk has room (an older file is untouched)",
                           path, bytes, why != 0 ? strerror(why) : "no reason given");
}

SPHPA_PRIVATE_ void sphpa_series_string_(sphpa_text_ *out, const char *text) {
    sphpa_text_add_(out, "\"");
    for (; *text != '\0'; text++) {
        unsigned char c = (unsigned char)*text;
        if (c == '"' || c == '\\') sphpa_text_add_(out, "\\%c", c);
        else if (c < 32) sphpa_text_add_(out, "\\u%04x", (unsigned)c);
        else sphpa_text_add_(out, "%c", c);
    }
    sphpa_text_add_(out, "\"");
}

/* a number with a decimal point whatever the locale: of what is no digit, sign or e the first byte
   becomes the point and the others go */
SPHPA_PRIVATE_ void sphpa_series_number_(sphpa_text_ *out, double value) {
    char text[64], plain[64];
    size_t n = 0, odd = 0;
    snprintf(text, sizeof text, "%.17g", value);
    for (const char *c = text; *c != '\0'; c++)
        if (strchr("0123456789+-eE", *c) != NULL) plain[n++] = *c;
        else if (odd++ == 0) plain[n++] = '.';
    plain[n] = '\0';
    sphpa_text_add_(out, "%s", plain);
}

SPHPA_PRIVATE_ void sphpa_series_text_(sphpa_text_ *out, const char *const *names,
                                       const double *times, size_t count) {
    sphpa_text_add_(out, "{\n  \"file-series-version\": \"1.0\",\n  \"files\": [");
    for (size_t k = 0; k < count; k++) {
        sphpa_text_add_(out, "%s\n    { \"name\": ", k > 0 ? "," : "");
        sphpa_series_string_(out, names[k]);
        sphpa_text_add_(out, ", \"time\": ");
        sphpa_series_number_(out, times[k]);
        sphpa_text_add_(out, " }");
    }
    sphpa_text_add_(out, "\n  ]\n}\n");
}

SPHPA_DEF sphpa_result sphpa_series_write(const char *path, const char *const *names,
                                          const double *times, size_t count, sphpa_error *err) {
    for (size_t k = 0; k < count; k++)
        if (!sphpa_finite_(times[k]))
            return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                                   "%s: time %zu (of \"%.100s\") is %g; give finite times", path, k,
                                   names[k], times[k]);
    sphpa_text_ out = {NULL, 0, 0};
    sphpa_series_text_(&out, names, times, count); /* how long it gets */
    size_t bytes = out.length;
    out.text = (char *)sphpa_alloc_(bytes + 1, 1);
    if (out.text == NULL) return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "out of memory");
    out.size = bytes + 1;
    out.length = 0;
    sphpa_series_text_(&out, names, times, count);
    sphpa_result result = sphpa_file_replace_(path, out.text, bytes, err);
    SPHPA_FREE(out.text);
    return result;
}

/* ---- HDF5 with a memory for the first failure ------------------------------------------------ */

/* After the first failure every call does nothing, so only the end asks how it went. */
typedef struct sphpa_h5_ {
    const char *path;
    hid_t file;
    bool reading;
    sphpa_result result;
    sphpa_error *err;
    H5E_auto2_t print; /* the program's own error printer, put back at the end */
    void *print_data;
    bool silenced;
} sphpa_h5_;

SPHPA_PRIVATE_ void sphpa_h5_silence_(sphpa_h5_ *h5) {
    (void)H5open();
    h5->silenced = H5Eget_auto2(H5E_DEFAULT, &h5->print, &h5->print_data) >= 0;
    (void)H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
}

SPHPA_PRIVATE_ void sphpa_h5_unsilence_(sphpa_h5_ *h5) {
    (void)H5Eclear2(H5E_DEFAULT);
    if (h5->silenced) (void)H5Eset_auto2(H5E_DEFAULT, h5->print, h5->print_data);
}

SPHPA_PRIVATE_ herr_t sphpa_h5_innermost_(unsigned depth, const H5E_error2_t *error, void *text) {
    if (depth == 0 && error->desc != NULL) snprintf((char *)text, 160, "%s", error->desc);
    return 0;
}

SPHPA_PRIVATE_ void sphpa_h5_fail_(sphpa_h5_ *h5, sphpa_result result, const char *format, ...)
    SPHPA_PRINTF_(3, 4);
SPHPA_PRIVATE_ void sphpa_h5_fail_(sphpa_h5_ *h5, sphpa_result result, const char *format, ...) {
    if (h5->result != SPHPA_OK) return;
    char text[400];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    h5->result = sphpa_error_set(h5->err, result, "%s: %s", h5->path, text);
}

/* a call of the library on `what` gave up: with the library's own reason */
SPHPA_PRIVATE_ void sphpa_h5_broken_(sphpa_h5_ *h5, const char *what) {
    char why[160] = "no reason given";
    (void)H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, sphpa_h5_innermost_, why);
    if (h5->reading)
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT,
                       "cannot read \"%.80s\" (HDF5: %s); the file is damaged, give another one",
                       what, why);
    else
        sphpa_h5_fail_(h5, SPHPA_ERROR_MEMORY,
                       "cannot put \"%.80s\" into the file (HDF5: %s); rename it if it is yours, "
                       "else free some memory", what, why);
}

SPHPA_PRIVATE_ hid_t sphpa_h5_type_(sphpa_type type) {
    switch (type) {
    case SPHPA_TYPE_double: return H5T_NATIVE_DOUBLE;
    case SPHPA_TYPE_sphpa_real:
        return sizeof(sphpa_real) == sizeof(double) ? H5T_NATIVE_DOUBLE : H5T_NATIVE_FLOAT;
    case SPHPA_TYPE_int64_t: return H5T_NATIVE_INT64;
    case SPHPA_TYPE_int32_t: return H5T_NATIVE_INT32;
    case SPHPA_TYPE_uint32_t: return H5T_NATIVE_UINT32;
    default: return -1;
    }
}

/* a group made (writing) or opened (reading); -1 after a failure */
SPHPA_PRIVATE_ hid_t sphpa_h5_group_(sphpa_h5_ *h5, const char *path) {
    if (h5->result != SPHPA_OK) return -1;
    hid_t group = h5->reading
                      ? H5Gopen2(h5->file, path, H5P_DEFAULT)
                      : H5Gcreate2(h5->file, path, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    if (group < 0) sphpa_h5_broken_(h5, path);
    return group;
}

SPHPA_PRIVATE_ void sphpa_h5_group_end_(hid_t group) {
    if (group >= 0) (void)H5Gclose(group);
}

SPHPA_PRIVATE_ void sphpa_h5_put_(sphpa_h5_ *h5, hid_t at, const char *name, hid_t type,
                                  hid_t space, const void *data) {
    hid_t attribute = H5Acreate2(at, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    if (attribute < 0 || H5Awrite(attribute, type, data) < 0) sphpa_h5_broken_(h5, name);
    if (attribute >= 0) (void)H5Aclose(attribute);
}

SPHPA_PRIVATE_ void sphpa_h5_get_(sphpa_h5_ *h5, hid_t at, const char *name, hid_t type, size_t n,
                                  void *data) {
    if (H5Aexists(at, name) <= 0) {
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "the attribute \"%s\" is missing; give a file that "
                       "this program wrote", name);
        return;
    }
    hid_t attribute = H5Aopen(at, name, H5P_DEFAULT);
    hid_t space = attribute >= 0 ? H5Aget_space(attribute) : -1;
    hssize_t have = space >= 0 ? H5Sget_simple_extent_npoints(space) : -1;
    if (have >= 0 && have != (hssize_t)n)
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "the attribute \"%s\" has %lld numbers, not %zu; "
                       "give a file that this program wrote", name, (long long)have, n);
    else if (have < 0 || H5Aread(attribute, type, data) < 0) sphpa_h5_broken_(h5, name);
    if (space >= 0) (void)H5Sclose(space);
    if (attribute >= 0) (void)H5Aclose(attribute);
}

/* an attribute of n numbers, from data or into it, as the file is written or read */
SPHPA_PRIVATE_ void sphpa_h5_numbers_(sphpa_h5_ *h5, hid_t at, const char *name, hid_t type,
                                      size_t n, void *data) {
    if (h5->result != SPHPA_OK) return;
    if (h5->reading) {
        sphpa_h5_get_(h5, at, name, type, n, data);
        return;
    }
    hsize_t dims = (hsize_t)n;
    hid_t space = H5Screate_simple(1, &dims, NULL);
    sphpa_h5_put_(h5, at, name, type, space, data);
    if (space >= 0) (void)H5Sclose(space);
}

SPHPA_PRIVATE_ void sphpa_h5_double_(sphpa_h5_ *h5, hid_t at, const char *name, double value) {
    sphpa_h5_numbers_(h5, at, name, H5T_NATIVE_DOUBLE, 1, &value);
}

SPHPA_PRIVATE_ void sphpa_h5_int_(sphpa_h5_ *h5, hid_t at, const char *name, int value) {
    int32_t number = (int32_t)value;
    sphpa_h5_numbers_(h5, at, name, H5T_NATIVE_INT32, 1, &number);
}

/* exactly as long as the text: with the final NUL counted VTK does not know the file's type */
SPHPA_PRIVATE_ void sphpa_h5_string_(sphpa_h5_ *h5, hid_t at, const char *name, const char *text) {
    if (h5->result != SPHPA_OK) return;
    size_t length = text != NULL ? strlen(text) : 0;
    hid_t type = H5Tcopy(H5T_C_S1), space = H5Screate(H5S_SCALAR);
    if (H5Tset_size(type, length > 0 ? length : 1) < 0 || H5Tset_strpad(type, H5T_STR_NULLPAD) < 0)
        sphpa_h5_broken_(h5, name);
    else sphpa_h5_put_(h5, at, name, type, space, length > 0 ? text : "");
    if (space >= 0) (void)H5Sclose(space);
    if (type >= 0) (void)H5Tclose(type);
}

/* a string attribute as new memory; NULL if there is none, or no memory, which is an error */
SPHPA_PRIVATE_ char *sphpa_h5_text_(sphpa_h5_ *h5, hid_t at, const char *name) {
    if (H5Aexists(at, name) <= 0) return NULL;
    hid_t attribute = H5Aopen(at, name, H5P_DEFAULT);
    hid_t type = attribute >= 0 ? H5Aget_type(attribute) : -1;
    char *text = NULL;
    if (type >= 0 && H5Tget_class(type) == H5T_STRING && H5Tis_variable_str(type) == 0 &&
        H5Aget_storage_size(attribute) == H5Tget_size(type)) {
        size_t length = H5Tget_size(type);
        text = (char *)sphpa_alloc_(length + 1, 1);
        if (text != NULL) memset(text, 0, length + 1);
        else sphpa_h5_fail_(h5, SPHPA_ERROR_MEMORY, "out of memory for %zu bytes", length + 1);
        if (text != NULL && H5Aread(attribute, type, text) < 0) text[0] = '\0';
    }
    if (type >= 0) (void)H5Tclose(type);
    if (attribute >= 0) (void)H5Aclose(attribute);
    return text;
}

/* (n) or (n, components) numbers as one dataset; the exponents of its unit if it is a field */
SPHPA_PRIVATE_ void sphpa_h5_dataset_(sphpa_h5_ *h5, hid_t at, const char *name, hid_t type,
                                      size_t n, int components, const void *data) {
    if (h5->result != SPHPA_OK) return;
    hsize_t dims[2] = {(hsize_t)n, (hsize_t)components};
    hid_t space = H5Screate_simple(components > 1 ? 2 : 1, dims, NULL);
    hid_t set = H5Dcreate2(at, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    if (set < 0 || H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0)
        sphpa_h5_broken_(h5, name);
    if (set >= 0) (void)H5Dclose(set);
    if (space >= 0) (void)H5Sclose(space);
}

/* the k-th member's name, in alphabetical order; empty at the end */
SPHPA_PRIVATE_ void sphpa_h5_member_(hid_t group, size_t k, char *name, size_t size) {
    H5G_info_t info;
    name[0] = '\0';
    if (H5Gget_info(group, &info) < 0 || k >= (size_t)info.nlinks) return;
    if (H5Lget_name_by_idx(group, ".", H5_INDEX_NAME, H5_ITER_INC, (hsize_t)k, name, size,
                           H5P_DEFAULT) < 0)
        name[0] = '\0';
}

/* ---- one row of the file: a field of the table or a column ----------------------------------- */

typedef struct sphpa_row_ {
    const char *name, *meaning;
    sphpa_type type;
    int components, length, mass, time;
    sphpa_role role;
    void *data;
    const sphpa_column *column; /* NULL: a field */
} sphpa_row_;

enum { SPHPA_ROWS_ = (int)SPHPA_FIELD_COUNT + SPHPA_COLUMNS_MAX };

/* every loop over all rows runs over k in [0, SPHPA_ROWS_); false: these particles lack it */
SPHPA_PRIVATE_ bool sphpa_row_of_(const sphpa_particles *p, int k, sphpa_row_ *row) {
    memset(row, 0, sizeof *row);
    int index = k - (int)SPHPA_FIELD_COUNT;
    if (index >= p->columns || (index < 0 && !sphpa_has_(p->fields, k))) return false;
    if (index < 0) {
        sphpa_field_info info = sphpa_field_describe((sphpa_field)k);
        row->name = info.file_name;
        row->meaning = info.meaning;
        row->type = info.type;
        row->components = info.components;
        row->length = info.length;
        row->mass = info.mass;
        row->time = info.time;
        row->role = info.role;
        row->data = sphpa_particles_data(p, (sphpa_field)k, 0);
        return true;
    }
    const sphpa_column *column = &p->column[index];
    row->name = column->name;
    row->meaning = "a column of the scene's own";
    row->type = SPHPA_TYPE_double;
    row->components = column->components;
    row->length = column->length;
    row->mass = column->mass;
    row->time = column->time;
    row->role = column->role;
    row->data = column->data;
    row->column = column;
    return true;
}

/* rates and derived tensors are of use to a restart alone */
SPHPA_PRIVATE_ bool sphpa_row_shown_(const sphpa_row_ *row) {
    if (row->role == SPHPA_ROLE_DERIVED) return row->components <= 3;
    return row->role != SPHPA_ROLE_RATE;
}

/* "Density" of "Densities": yt, and SWIFT in former days; NULL if there is none */
SPHPA_PRIVATE_ const char *sphpa_row_alias_(const char *name) {
    static const char *const alias[][2] = {{"SmoothingLengths", "SmoothingLength"},
                                           {"Densities", "Density"},
                                           {"InternalEnergies", "InternalEnergy"},
                                           {"Pressures", "Pressure"}};
    for (size_t k = 0; k < sizeof alias / sizeof alias[0]; k++)
        if (strcmp(alias[k][0], name) == 0) return alias[k][1];
    return NULL;
}

/* exponents of the unit; those of charge and temperature and of cosmology are always 0 */
SPHPA_PRIVATE_ void sphpa_h5_describe_(sphpa_h5_ *h5, hid_t group, const sphpa_row_ *row) {
    if (h5->result != SPHPA_OK) return;
    hid_t set = H5Dopen2(group, row->name, H5P_DEFAULT);
    if (set < 0) sphpa_h5_broken_(h5, row->name);
    sphpa_h5_double_(h5, set, "U_L exponent", (double)row->length);
    sphpa_h5_double_(h5, set, "U_M exponent", (double)row->mass);
    sphpa_h5_double_(h5, set, "U_t exponent", (double)row->time);
    sphpa_h5_double_(h5, set, "U_I exponent", 0.0);
    sphpa_h5_double_(h5, set, "U_T exponent", 0.0);
    sphpa_h5_double_(h5, set, "a-scale exponent", 0.0);
    sphpa_h5_double_(h5, set, "h-scale exponent", 0.0);
    sphpa_h5_string_(h5, set, "Description", row->meaning);
    if (row->column != NULL) {
        int32_t rules[3] = {(int32_t)row->column->role, (int32_t)row->column->split,
                            (int32_t)row->column->merge};
        sphpa_h5_numbers_(h5, set, "sphpa column", H5T_NATIVE_INT32, 3, rules);
    }
    if (set >= 0) (void)H5Dclose(set);
}

SPHPA_PRIVATE_ void sphpa_h5_link_(sphpa_h5_ *h5, hid_t from, const char *name, hid_t to,
                                   const char *as) {
    if (h5->result == SPHPA_OK &&
        H5Lcreate_hard(from, name, to, as, H5P_DEFAULT, H5P_DEFAULT) < 0)
        sphpa_h5_broken_(h5, as);
}

/* positions of a 1-D or 2-D scene with zeros beyond dim, as new memory */
SPHPA_PRIVATE_ double *sphpa_flat_positions_(const sphpa_particles *p) {
    double *x = (double *)sphpa_alloc_(p->n, 3 * sizeof(double));
    if (x == NULL) return NULL;
    for (size_t k = 0; k < 3 * p->n; k++) x[k] = (int)(k % 3) < p->dim ? p->x[k] : 0.0;
    return x;
}

SPHPA_PRIVATE_ void sphpa_h5_row_(sphpa_h5_ *h5, hid_t group, const sphpa_particles *p, int k,
                                  const sphpa_row_ *row, bool restart) {
    if (row->column != NULL && (strchr(row->name, '/') != NULL || row->name[0] == '.')) {
        sphpa_h5_fail_(h5, SPHPA_ERROR_RANGE, "a column is named \"%.40s\", which cannot be a name "
                       "in a file; rename it without '/' and '.'", row->name);
        return;
    }
    double *flat = NULL;
    if (k == SPHPA_FIELD_x && p->dim < 3 && !restart) {
        flat = sphpa_flat_positions_(p);
        if (flat == NULL) sphpa_h5_fail_(h5, SPHPA_ERROR_MEMORY, "out of memory");
    }
    sphpa_h5_dataset_(h5, group, row->name, sphpa_h5_type_(row->type), p->n, row->components,
                      flat != NULL ? flat : row->data);
    SPHPA_FREE(flat);
    sphpa_h5_describe_(h5, group, row);
    const char *alias = row->column == NULL ? sphpa_row_alias_(row->name) : NULL;
    if (alias != NULL) sphpa_h5_link_(h5, group, row->name, group, alias);
}

/* ---- the layout ------------------------------------------------------------------------------ */

/* [m] side lengths of the box: of the periodic one, else of a box from the origin or around the
   particles, whichever is longer (yt looks for particles between 0 and this) */
SPHPA_PRIVATE_ void sphpa_box_size_(const sphpa_sim *sim, double size[3]) {
    const sphpa_particles *p = &sim->p;
    double most = 0.0, support = sphpa_kernel_support(sim->options.kernel);
    for (int a = 0; a < p->dim; a++) {
        double low = 0.0, high = 0.0;
        for (size_t i = 0; i < p->n; i++) {
            double x = p->x[3 * i + (size_t)a], reach = support * (double)p->h[i];
            low = sphpa_min_(low, x - reach);
            high = sphpa_max_(high, x + reach);
        }
        size[a] = high - low;
        if (sim->options.box.periodic[a])
            size[a] = sim->options.box.high[a] - sim->options.box.low[a];
        most = sphpa_max_(most, size[a]);
    }
    for (int a = p->dim; a < 3; a++) size[a] = most;
}

/* all axes that the scene has wrap: the only periodic box that other tools know */
SPHPA_PRIVATE_ bool sphpa_box_wraps_(const sphpa_sim *sim) {
    for (int a = 0; a < sim->p.dim; a++)
        if (!sim->options.box.periodic[a]) return false;
    return true;
}

SPHPA_PRIVATE_ void sphpa_h5_header_(sphpa_h5_ *h5, const sphpa_sim *sim,
                                     const sphpa_snapshot_info *info) {
    hid_t header = sphpa_h5_group_(h5, "/Header");
    int64_t here[7] = {(int64_t)sim->p.n, 0, 0, 0, 0, 0, 0};
    uint32_t total[7] = {(uint32_t)((uint64_t)sim->p.n & 0xffffffffu), 0, 0, 0, 0, 0, 0};
    uint32_t high[7] = {(uint32_t)((uint64_t)sim->p.n >> 32), 0, 0, 0, 0, 0, 0};
    int32_t types[7] = {1, 0, 0, 0, 0, 0, 0};
    double size[3], masses[7] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    char date[40] = "unknown";
    time_t now = time(NULL);
    struct tm *utc = gmtime(&now);
    if (utc != NULL) (void)strftime(date, sizeof date, "%H:%M:%S %Y-%m-%d UTC", utc);
    sphpa_box_size_(sim, size);
    sphpa_h5_string_(h5, header, "Code", "SWIFT"); /* yt tests exactly this */
    sphpa_h5_numbers_(h5, header, "BoxSize", H5T_NATIVE_DOUBLE, 3, size);
    sphpa_h5_int_(h5, header, "Dimension", sim->p.dim);
    sphpa_h5_double_(h5, header, "Time", sim->time);
    sphpa_h5_double_(h5, header, "Redshift", 0.0);
    sphpa_h5_double_(h5, header, "Scale-factor", 1.0);
    sphpa_h5_numbers_(h5, header, "NumPart_ThisFile", H5T_NATIVE_INT64, 7, here);
    sphpa_h5_numbers_(h5, header, "NumPart_Total", H5T_NATIVE_UINT32, 7, total);
    sphpa_h5_numbers_(h5, header, "NumPart_Total_HighWord", H5T_NATIVE_UINT32, 7, high);
    sphpa_h5_numbers_(h5, header, "MassTable", H5T_NATIVE_DOUBLE, 7, masses);
    sphpa_h5_int_(h5, header, "NumFilesPerSnapshot", 1);
    sphpa_h5_int_(h5, header, "ThisFile", 0);
    sphpa_h5_string_(h5, header, "OutputType", "FullVolume");
    sphpa_h5_string_(h5, header, "RunName", info->run != NULL ? info->run : "sphpa");
    sphpa_h5_numbers_(h5, header, "CanHaveTypes", H5T_NATIVE_INT32, 7, types);
    sphpa_h5_string_(h5, header, "SnapshotDate", date);
    sphpa_h5_group_end_(header);
}

SPHPA_PRIVATE_ void sphpa_h5_units_(sphpa_h5_ *h5, const char *path) {
    hid_t units = sphpa_h5_group_(h5, path);
    sphpa_h5_double_(h5, units, "Unit mass in cgs (U_M)", 1e3);
    sphpa_h5_double_(h5, units, "Unit length in cgs (U_L)", 1e2);
    sphpa_h5_double_(h5, units, "Unit time in cgs (U_t)", 1.0);
    sphpa_h5_double_(h5, units, "Unit current in cgs (U_I)", 1.0);
    sphpa_h5_double_(h5, units, "Unit temperature in cgs (U_T)", 1.0);
    sphpa_h5_group_end_(units);
}

SPHPA_PRIVATE_ void sphpa_h5_code_(sphpa_h5_ *h5, const sphpa_snapshot_info *info) {
    hid_t code = sphpa_h5_group_(h5, "/Code");
#if defined(__clang__)
    const char *compiler = "clang " __clang_version__;
#elif defined(__GNUC__)
    const char *compiler = "gcc " __VERSION__;
#else
    const char *compiler = "unknown";
#endif
#ifdef _OPENMP
    const char *threads = "OpenMP";
#else
    const char *threads = "one thread";
#endif
    char build[40];
    snprintf(build, sizeof build, "%s, %s", sizeof(sphpa_real) == 4 ? "float" : "double", threads);
    sphpa_h5_string_(h5, code, "Code", "sphpa");
    sphpa_h5_string_(h5, code, "Code Version", SPHPA_VERSION);
    sphpa_h5_string_(h5, code, "Compiler Name", compiler);
    sphpa_h5_string_(h5, code, "CFLAGS", info->cflags != NULL ? info->cflags : "unknown");
    sphpa_h5_string_(h5, code, "sphpa build", build);
    sphpa_h5_group_end_(code);
}

/* groups of SWIFT's that yt and swiftsimio insist on */
SPHPA_PRIVATE_ void sphpa_h5_scene_(sphpa_h5_ *h5, const sphpa_sim *sim,
                                    const sphpa_snapshot_info *info) {
    hid_t group = sphpa_h5_group_(h5, "/Policy");
    sphpa_h5_int_(h5, group, "cosmological integration", 0);
    sphpa_h5_group_end_(group);
    group = sphpa_h5_group_(h5, "/Cosmology");
    sphpa_h5_int_(h5, group, "Cosmological run", 0);
    sphpa_h5_group_end_(group);
    group = sphpa_h5_group_(h5, "/RuntimePars");
    sphpa_h5_int_(h5, group, "PeriodicBoundariesOn", sphpa_box_wraps_(sim) ? 1 : 0);
    sphpa_h5_group_end_(group);
    group = sphpa_h5_group_(h5, "/HydroScheme");
    sphpa_h5_string_(h5, group, "Kernel function", sphpa_kernel_name(sim->options.kernel));
    sphpa_h5_int_(h5, group, "Dimension", sim->p.dim);
    sphpa_h5_string_(h5, group, "Scheme", info->scheme != NULL ? info->scheme : "sphpa");
    sphpa_h5_group_end_(group);
    sphpa_h5_group_end_(sphpa_h5_group_(h5, "/SubgridScheme"));
    group = sphpa_h5_group_(h5, "/Parameters");
    sphpa_h5_string_(h5, group, "InitialConditions:periodic", sphpa_box_wraps_(sim) ? "1" : "0");
    for (int k = 0; k < info->settings_count && h5->result == SPHPA_OK; k++) {
        const sphpa_setting *setting = &info->settings[k];
        if (setting->key == NULL || setting->key[0] == '\0' || H5Aexists(group, setting->key) > 0)
            sphpa_h5_fail_(h5, SPHPA_ERROR_RANGE, "setting %d (\"%.80s\") has no key or is there "
                           "twice; give each a key of its own", k,
                           setting->key != NULL ? setting->key : "");
        else sphpa_h5_string_(h5, group, setting->key, setting->value);
    }
    sphpa_h5_group_end_(group);
}

/* one poly-vertex cell that names all particles; data are links to what /PartType0 has */
SPHPA_PRIVATE_ void sphpa_h5_vtk_(sphpa_h5_ *h5, const sphpa_particles *p, hid_t fields,
                                  bool restart) {
    int64_t n = (int64_t)p->n, one = 1, version[2] = {1, 0}, offsets[2] = {0, 0};
    unsigned char poly_vertex = 2;
    int64_t *place = (int64_t *)sphpa_alloc_(p->n, sizeof(int64_t));
    if (place == NULL) sphpa_h5_fail_(h5, SPHPA_ERROR_MEMORY, "out of memory");
    else
        for (size_t i = 0; i < p->n; i++) place[i] = (int64_t)i;
    offsets[1] = n;
    hid_t vtk = sphpa_h5_group_(h5, "/VTKHDF");
    sphpa_h5_numbers_(h5, vtk, "Version", H5T_NATIVE_INT64, 2, version);
    sphpa_h5_string_(h5, vtk, "Type", "UnstructuredGrid");
    sphpa_h5_dataset_(h5, vtk, "NumberOfPoints", H5T_NATIVE_INT64, 1, 1, &n);
    sphpa_h5_dataset_(h5, vtk, "NumberOfCells", H5T_NATIVE_INT64, 1, 1, &one);
    sphpa_h5_dataset_(h5, vtk, "NumberOfConnectivityIds", H5T_NATIVE_INT64, 1, 1, &n);
    sphpa_h5_dataset_(h5, vtk, "Types", H5T_NATIVE_UINT8, 1, 1, &poly_vertex);
    sphpa_h5_dataset_(h5, vtk, "Offsets", H5T_NATIVE_INT64, 2, 1, offsets);
    sphpa_h5_dataset_(h5, vtk, "Connectivity", H5T_NATIVE_INT64, p->n, 1, place);
    SPHPA_FREE(place);
    hid_t data = sphpa_h5_group_(h5, "/VTKHDF/PointData");
    for (int k = 0; k < SPHPA_ROWS_; k++) {
        sphpa_row_ row;
        if (!sphpa_row_of_(p, k, &row) || !(restart || sphpa_row_shown_(&row))) continue;
        if (k == SPHPA_FIELD_x) sphpa_h5_link_(h5, fields, row.name, vtk, "Points");
        else sphpa_h5_link_(h5, fields, row.name, data, row.name);
    }
    sphpa_h5_group_end_(data);
    sphpa_h5_group_end_(vtk);
}

SPHPA_PRIVATE_ void sphpa_h5_layout_(sphpa_h5_ *h5, const sphpa_sim *sim,
                                     const sphpa_snapshot_info *info, bool restart) {
    sphpa_h5_header_(h5, sim, info);
    sphpa_h5_units_(h5, "/Units");
    sphpa_h5_units_(h5, "/InternalCodeUnits");
    sphpa_h5_scene_(h5, sim, info);
    sphpa_h5_code_(h5, info);
    hid_t fields = sphpa_h5_group_(h5, "/PartType0");
    for (int k = 0; k < SPHPA_ROWS_; k++) {
        sphpa_row_ row;
        if (sphpa_row_of_(&sim->p, k, &row) && (restart || sphpa_row_shown_(&row)))
            sphpa_h5_row_(h5, fields, &sim->p, k, &row, restart);
    }
    sphpa_h5_vtk_(h5, &sim->p, fields, restart);
    sphpa_h5_group_end_(fields);
    if (h5->result == SPHPA_OK &&
        H5Lcreate_soft("/PartType0", h5->file, "/GasParticles", H5P_DEFAULT, H5P_DEFAULT) < 0)
        sphpa_h5_broken_(h5, "/GasParticles");
}

/* ---- what a restart needs beyond the fields -------------------------------------------------- */

/* Named blocks of bytes: what modules keep, before and after the file. */
typedef struct sphpa_kept_block_ {
    char *name; /* "module.name" */
    void *data;
    size_t bytes;
} sphpa_kept_block_;

typedef struct sphpa_kept_ {
    sphpa_kept_block_ *block;
    size_t count, capacity;
    const char *module; /* whose turn it is */
} sphpa_kept_;

SPHPA_PRIVATE_ void sphpa_kept_free_(sphpa_kept_ *kept) {
    for (size_t k = 0; k < kept->count; k++) {
        SPHPA_FREE(kept->block[k].name);
        SPHPA_FREE(kept->block[k].data);
    }
    SPHPA_FREE(kept->block);
    memset(kept, 0, sizeof *kept);
}

/* a new block of that name with room for `bytes`, or NULL */
SPHPA_PRIVATE_ sphpa_kept_block_ *sphpa_kept_add_(sphpa_kept_ *kept, const char *name,
                                                  size_t bytes) {
    if (!sphpa_grow_((void **)&kept->block, &kept->capacity, kept->count + 1,
                     sizeof(sphpa_kept_block_)))
        return NULL;
    sphpa_kept_block_ *block = &kept->block[kept->count];
    size_t length = strlen(name) + 1;
    block->name = (char *)sphpa_alloc_(length, 1);
    block->data = sphpa_alloc_(bytes, 1);
    if (block->name == NULL || block->data == NULL) {
        SPHPA_FREE(block->name);
        SPHPA_FREE(block->data);
        return NULL;
    }
    memcpy(block->name, name, length);
    block->bytes = bytes;
    kept->count++;
    return block;
}

SPHPA_PRIVATE_ sphpa_kept_block_ *sphpa_kept_find_(const sphpa_kept_ *kept, const char *name) {
    for (size_t k = 0; k < kept->count; k++)
        if (strcmp(kept->block[k].name, name) == 0) return &kept->block[k];
    return NULL;
}

SPHPA_PRIVATE_ bool sphpa_kept_name_(const char *module, const char *name, char *full,
                                     size_t size) {
    int length = snprintf(full, size, "%s.%s", module, name);
    return length > 0 && (size_t)length < size && strchr(full, '/') == NULL;
}

/* sphpa_keep_fn: a module hands over a block */
SPHPA_PRIVATE_ sphpa_result sphpa_kept_take_(void *user, const char *name, void **data,
                                             size_t *bytes, sphpa_error *err) {
    sphpa_kept_ *kept = (sphpa_kept_ *)user;
    char full[128];
    if (!sphpa_kept_name_(kept->module, name, full, sizeof full) ||
        sphpa_kept_find_(kept, full) != NULL)
        return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                               "module \"%.40s\" keeps \"%.60s\": the name is too long, has a '/' "
                               "or is there twice; rename it", kept->module, name);
    sphpa_kept_block_ *block = sphpa_kept_add_(kept, full, *bytes);
    if (block == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "no memory for the %zu bytes of \"%s\"",
                               *bytes, full);
    if (*bytes > 0) memcpy(block->data, *data, *bytes);
    return SPHPA_OK;
}

/* sphpa_keep_fn: a module gets a block back */
SPHPA_PRIVATE_ sphpa_result sphpa_kept_give_(void *user, const char *name, void **data,
                                             size_t *bytes, sphpa_error *err) {
    sphpa_kept_ *kept = (sphpa_kept_ *)user;
    char full[128];
    sphpa_kept_block_ *block = NULL;
    if (sphpa_kept_name_(kept->module, name, full, sizeof full))
        block = sphpa_kept_find_(kept, full);
    if (block == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_FORMAT,
                               "the checkpoint has no block \"%s\", which the module needs; resume "
                               "with the program that wrote it", full);
    void *copy = sphpa_alloc_(block->bytes, 1);
    if (copy == NULL)
        return sphpa_error_set(err, SPHPA_ERROR_MEMORY, "no memory for the %zu bytes of \"%s\"",
                               block->bytes, full);
    memcpy(copy, block->data, block->bytes);
    *data = copy;
    *bytes = block->bytes;
    return SPHPA_OK;
}

/* the scene's first modules hand over or get back what they keep; *done: how many were asked */
SPHPA_PRIVATE_ sphpa_result sphpa_kept_exchange_(sphpa_sim *sim, sphpa_keep_fn exchange,
                                                 sphpa_kept_ *kept, int modules, int *done,
                                                 sphpa_error *err) {
    sphpa_result result = SPHPA_OK;
    for (*done = 0; *done < modules && result == SPHPA_OK; ++*done) {
        const sphpa_module *module = &sim->scene.module[*done];
        kept->module = module->name;
        if (module->keep != NULL) result = module->keep(sim, module->params, exchange, kept, err);
    }
    return result;
}

SPHPA_PRIVATE_ void sphpa_h5_write_blocks_(sphpa_h5_ *h5, const char *path,
                                           const sphpa_kept_ *kept) {
    hid_t group = sphpa_h5_group_(h5, path);
    for (size_t k = 0; k < kept->count; k++)
        sphpa_h5_dataset_(h5, group, kept->block[k].name, H5T_NATIVE_UINT8, kept->block[k].bytes, 1,
                          kept->block[k].data);
    sphpa_h5_group_end_(group);
}

/* bytes of a dataset, or -1 if it is none of ours */
SPHPA_PRIVATE_ long long sphpa_h5_block_bytes_(hid_t set) {
    hid_t space = set >= 0 ? H5Dget_space(set) : -1, type = set >= 0 ? H5Dget_type(set) : -1;
    long long bytes = -1;
    if (space >= 0 && type >= 0 && H5Tget_size(type) == 1 &&
        H5Sget_simple_extent_ndims(space) == 1)
        bytes = (long long)H5Sget_simple_extent_npoints(space);
    if (space >= 0) (void)H5Sclose(space);
    if (type >= 0) (void)H5Tclose(type);
    return bytes;
}

SPHPA_PRIVATE_ void sphpa_h5_read_blocks_(sphpa_h5_ *h5, const char *path, sphpa_kept_ *kept) {
    hid_t group = sphpa_h5_group_(h5, path);
    for (size_t k = 0; group >= 0 && h5->result == SPHPA_OK; k++) {
        char name[160];
        sphpa_h5_member_(group, k, name, sizeof name);
        if (name[0] == '\0') break;
        hid_t set = H5Dopen2(group, name, H5P_DEFAULT);
        long long bytes = sphpa_h5_block_bytes_(set);
        sphpa_kept_block_ *block = bytes < 0 ? NULL : sphpa_kept_add_(kept, name, (size_t)bytes);
        if (bytes >= 0 && block == NULL)
            sphpa_h5_fail_(h5, SPHPA_ERROR_MEMORY, "no memory for the %lld bytes of \"%s\"", bytes,
                           name);
        else if (bytes < 0 || H5Dread(set, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT,
                                      block->data) < 0)
            sphpa_h5_broken_(h5, name);
        if (set >= 0) (void)H5Dclose(set);
    }
    sphpa_h5_group_end_(group);
}

/* The clock, the counts and the options, in types of fixed size. */
typedef struct sphpa_restart_ {
    int32_t format, real_bytes, dim, started, kernel, integrator, limit_last, timings, limits;
    int32_t periodic[3];
    int64_t n, next_id, ids[2]; /* ids: limit_id, u_id */
    uint64_t counts[4];         /* steps, evaluations, rebuilds, u_below */
    double clock[5];            /* [s] time, dt, dt_next, dt_first, dt_free */
    double means[3];            /* neighbours_mean, u_deficit, u_least */
    double low[3], high[3];     /* [m] of the periodic box */
    double control[8]; /* cfl, force_cfl, dt_max, dt_min, dt_growth, dt_fixed, skin, flight */
    double seconds[SPHPA_TIMINGS];
    uint64_t calls[SPHPA_TIMINGS], limit_steps[SPHPA_LIMITS];
} sphpa_restart_;

SPHPA_PRIVATE_ void sphpa_restart_of_(const sphpa_sim *sim, sphpa_restart_ *r) {
    const sphpa_sim_options *o = &sim->options;
    const sphpa_stats *s = &sim->stats;
    memset(r, 0, sizeof *r);
    r->format = SPHPA_CHECKPOINT_FORMAT_;
    r->real_bytes = (int32_t)sizeof(sphpa_real);
    r->dim = sim->p.dim;
    r->started = sim->started;
    r->kernel = (int32_t)o->kernel;
    r->integrator = (int32_t)o->integrator;
    r->limit_last = s->limit_last;
    r->timings = s->timings;
    r->limits = s->limits;
    r->n = (int64_t)sim->p.n;
    r->next_id = sim->p.next_id;
    r->ids[0] = s->limit_id;
    r->ids[1] = s->u_id;
    uint64_t counts[4] = {s->steps, s->evaluations, s->rebuilds, s->u_below};
    double clock[5] = {sim->time, sim->dt, sim->dt_next, sim->dt_first, sim->dt_free};
    double control[8] = {o->cfl,       o->force_cfl, o->dt_max, o->dt_min,
                         o->dt_growth, o->dt_fixed,  o->skin,   o->flight};
    memcpy(r->counts, counts, sizeof counts);
    memcpy(r->clock, clock, sizeof clock);
    memcpy(r->control, control, sizeof control);
    r->means[0] = s->neighbours_mean;
    r->means[1] = s->u_deficit;
    r->means[2] = s->u_least;
    for (int a = 0; a < 3; a++) {
        r->periodic[a] = o->box.periodic[a] != 0;
        r->low[a] = o->box.low[a];
        r->high[a] = o->box.high[a];
    }
    for (int k = 0; k < s->timings; k++)
        r->seconds[k] = s->timing[k].seconds, r->calls[k] = s->timing[k].calls;
    for (int k = 0; k < s->limits; k++) r->limit_steps[k] = s->limit[k].steps;
}

/* into /sphpa or from there: one list for both ways; the format, kind and names come first */
SPHPA_PRIVATE_ void sphpa_h5_restart_(sphpa_h5_ *h5, hid_t at, sphpa_restart_ *r) {
    const hid_t real = H5T_NATIVE_DOUBLE, i32 = H5T_NATIVE_INT32, i64 = H5T_NATIVE_INT64;
    const hid_t u64 = H5T_NATIVE_UINT64;
    sphpa_h5_numbers_(h5, at, "bytes of sphpa_real", i32, 1, &r->real_bytes);
    sphpa_h5_numbers_(h5, at, "dimension", i32, 1, &r->dim);
    sphpa_h5_numbers_(h5, at, "kernel", i32, 1, &r->kernel);
    sphpa_h5_numbers_(h5, at, "integrator", i32, 1, &r->integrator);
    sphpa_h5_numbers_(h5, at, "particles", i64, 1, &r->n);
    sphpa_h5_numbers_(h5, at, "next id", i64, 1, &r->next_id);
    sphpa_h5_numbers_(h5, at, "started", i32, 1, &r->started);
    sphpa_h5_numbers_(h5, at, "time, dt, next, first, free", real, 5, r->clock);
    sphpa_h5_numbers_(h5, at, "steps, evaluations, rebuilds, u below 0", u64, 4, r->counts);
    sphpa_h5_numbers_(h5, at, "neighbours, deficit of u, least u", real, 3, r->means);
    sphpa_h5_numbers_(h5, at, "cfl, force_cfl, dt_max, dt_min, dt_growth, dt_fixed, skin, flight",
                      real, 8, r->control);
    sphpa_h5_numbers_(h5, at, "last limit", i32, 1, &r->limit_last);
    sphpa_h5_numbers_(h5, at, "ids of the last limit, of the least u", i64, 2, r->ids);
    sphpa_h5_numbers_(h5, at, "seconds", real, (size_t)r->timings, r->seconds);
    sphpa_h5_numbers_(h5, at, "calls", u64, (size_t)r->timings, r->calls);
    sphpa_h5_numbers_(h5, at, "steps by limit", u64, (size_t)r->limits, r->limit_steps);
}

/* the names of the passes in their order: what a scene is, for a restart */
SPHPA_PRIVATE_ void sphpa_pass_names_(const sphpa_sim *sim, sphpa_text_ *out) {
    for (int k = 0; k < sim->passes; k++)
        sphpa_text_add_(out, "%s%s", k > 0 ? "\n" : "", sim->pass[k]->name);
}

enum { SPHPA_PASS_NAMES_ = 128 * SPHPA_SCENE_PASSES };

/* /sphpa: the periodic box always; in a checkpoint all that a restart needs */
SPHPA_PRIVATE_ void sphpa_h5_own_(sphpa_h5_ *h5, const sphpa_sim *sim,
                                  const sphpa_snapshot_info *info, const sphpa_kept_ *kept) {
    sphpa_restart_ restart;
    sphpa_restart_of_(sim, &restart);
    hid_t own = sphpa_h5_group_(h5, "/sphpa");
    sphpa_h5_int_(h5, own, "format", SPHPA_CHECKPOINT_FORMAT_);
    sphpa_h5_string_(h5, own, "kind", kept != NULL ? "checkpoint" : "snapshot");
    sphpa_h5_numbers_(h5, own, "periodic", H5T_NATIVE_INT32, 3, restart.periodic);
    sphpa_h5_numbers_(h5, own, "low", H5T_NATIVE_DOUBLE, 3, restart.low);
    sphpa_h5_numbers_(h5, own, "high", H5T_NATIVE_DOUBLE, 3, restart.high);
    if (kept != NULL) {
        char names[SPHPA_PASS_NAMES_];
        sphpa_text_ text = {names, sizeof names, 0};
        sphpa_pass_names_(sim, &text);
        sphpa_h5_string_(h5, own, "passes", names);
        sphpa_h5_restart_(h5, own, &restart);
        sphpa_h5_write_blocks_(h5, "/sphpa/Kept", kept);
        hid_t blobs = sphpa_h5_group_(h5, "/sphpa/Blobs");
        for (int k = 0; k < info->blobs_count; k++)
            sphpa_h5_dataset_(h5, blobs, info->blobs[k].name, H5T_NATIVE_UINT8,
                              info->blobs[k].bytes, 1, info->blobs[k].data);
        sphpa_h5_group_end_(blobs);
    }
    sphpa_h5_group_end_(own);
}

/* ---- writing --------------------------------------------------------------------------------- */

/* The file as HDF5 builds it in memory, put on the disk by us: so a full disk is an error of
   write() and not of the library, which could then not close its file. */
SPHPA_PRIVATE_ void sphpa_h5_save_(sphpa_h5_ *h5) {
    if (h5->result != SPHPA_OK) return;
    void *handle = NULL; /* of a file in memory: where the pointer to its bytes is */
    ssize_t bytes = -1;
    if (H5Fflush(h5->file, H5F_SCOPE_GLOBAL) >= 0) bytes = H5Fget_file_image(h5->file, NULL, 0);
    if (bytes <= 0 || H5Fget_vfd_handle(h5->file, H5P_DEFAULT, &handle) < 0 || handle == NULL) {
        sphpa_h5_broken_(h5, "the whole file");
        return;
    }
    h5->result = sphpa_file_replace_(h5->path, *(void **)handle, (size_t)bytes, h5->err);
}

/* kept NULL: a snapshot; else a checkpoint */
SPHPA_PRIVATE_ sphpa_result sphpa_h5_write_(const sphpa_sim *sim, const char *path,
                                            const sphpa_snapshot_info *info,
                                            const sphpa_kept_ *kept, sphpa_error *err) {
    sphpa_snapshot_info nothing;
    memset(&nothing, 0, sizeof nothing);
    if (info == NULL) info = &nothing;
    sphpa_h5_ h5;
    memset(&h5, 0, sizeof h5);
    h5.path = path;
    h5.err = err;
    sphpa_h5_silence_(&h5);
    hid_t in_memory = H5Pcreate(H5P_FILE_ACCESS);
    h5.file = -1;
    if (in_memory >= 0 && H5Pset_fapl_core(in_memory, (size_t)1 << 20, 0) >= 0)
        h5.file = H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, in_memory);
    if (h5.file < 0) sphpa_h5_broken_(&h5, "the file itself");
    sphpa_h5_layout_(&h5, sim, info, kept != NULL);
    sphpa_h5_own_(&h5, sim, info, kept);
    sphpa_h5_save_(&h5);
    if (h5.file >= 0) (void)H5Fclose(h5.file);
    if (in_memory >= 0) (void)H5Pclose(in_memory);
    sphpa_h5_unsilence_(&h5);
    return h5.result;
}

SPHPA_DEF sphpa_result sphpa_snapshot_write(const sphpa_sim *sim, const char *path,
                                            const sphpa_snapshot_info *info, sphpa_error *err) {
    return sphpa_h5_write_(sim, path, info, NULL, err);
}

/* NaN where particles_check does not look; infinity is a value (no flaw, no limit) */
SPHPA_PRIVATE_ sphpa_result sphpa_rows_check_(const sphpa_particles *p, sphpa_error *err) {
    sphpa_result result = sphpa_particles_check(p, err);
    for (int k = 0; k < SPHPA_ROWS_ && result == SPHPA_OK; k++) {
        sphpa_row_ row;
        if (!sphpa_row_of_(p, k, &row)) continue;
        bool real = row.type == SPHPA_TYPE_sphpa_real, wide = row.type == SPHPA_TYPE_double;
        size_t width = (size_t)row.components;
        for (size_t j = 0; (real || wide) && j < p->n * width; j++) {
            double value = real ? (double)((const sphpa_real *)row.data)[j]
                                : ((const double *)row.data)[j];
            if (value != value)
                return sphpa_error_set(err, SPHPA_ERROR_NOT_FINITE,
                                       "particle %zu (id %lld): %s is NaN; go back to an earlier "
                                       "checkpoint", j / width, (long long)p->id[j / width],
                                       row.name);
        }
    }
    return result;
}

SPHPA_DEF sphpa_result sphpa_checkpoint_write(sphpa_sim *sim, const char *path,
                                              const sphpa_snapshot_info *info, sphpa_error *err) {
    for (int k = 0; info != NULL && k < info->blobs_count; k++) {
        const char *name = info->blobs[k].name;
        if (name == NULL || name[0] == '\0' || name[0] == '.' || strchr(name, '/') != NULL)
            return sphpa_error_set(err, SPHPA_ERROR_RANGE,
                                   "blob %d is named \"%.60s\"; give it a name without '/' and '.'",
                                   k, name != NULL ? name : "");
    }
    sphpa_result result = sphpa_rows_check_(&sim->p, err);
    if (result == SPHPA_OK) result = sphpa_sim_settle(sim, err);
    if (result != SPHPA_OK) return result;
    sphpa_kept_ kept;
    int done = 0;
    memset(&kept, 0, sizeof kept);
    result = sphpa_kept_exchange_(sim, sphpa_kept_take_, &kept, sim->scene.modules, &done, err);
    if (result == SPHPA_OK) result = sphpa_h5_write_(sim, path, info, &kept, err);
    sphpa_kept_free_(&kept);
    return result;
}

/* ---- reading --------------------------------------------------------------------------------- */

SPHPA_PRIVATE_ void sphpa_h5_open_(sphpa_h5_ *h5, const char *path, sphpa_error *err) {
    memset(h5, 0, sizeof *h5);
    h5->path = path;
    h5->err = err;
    h5->reading = true;
    h5->file = -1;
    sphpa_h5_silence_(h5);
    errno = 0;
    FILE *plain = fopen(path, "rb");
    if (plain == NULL) {
        sphpa_h5_fail_(h5, SPHPA_ERROR_FILE, "cannot open it: %s; check the path",
                       errno != 0 ? strerror(errno) : "no reason given");
        return;
    }
    (void)fclose(plain);
    if (H5Fis_hdf5(path) <= 0) {
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT,
                       "not an HDF5 file; give one that this program wrote (*.hdf)");
        return;
    }
    h5->file = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    if (h5->file < 0) sphpa_h5_broken_(h5, "the file itself");
}

SPHPA_PRIVATE_ sphpa_result sphpa_h5_close_(sphpa_h5_ *h5) {
    if (h5->file >= 0) (void)H5Fclose(h5->file);
    sphpa_h5_unsilence_(h5);
    return h5->result;
}

/* whether there is a group or dataset of that name */
SPHPA_PRIVATE_ bool sphpa_h5_has_(hid_t at, const char *name) {
    return H5Lexists(at, name, H5P_DEFAULT) > 0 && H5Oexists_by_name(at, name, H5P_DEFAULT) > 0;
}

/* shape of a dataset of numbers: rows, and components in each; 0 components: it is none */
SPHPA_PRIVATE_ int sphpa_h5_shape_(hid_t set, size_t *rows) {
    hsize_t dims[2] = {0, 1};
    hid_t space = set >= 0 ? H5Dget_space(set) : -1;
    int rank = space >= 0 ? H5Sget_simple_extent_ndims(space) : 0;
    bool fits = (rank == 1 || rank == 2) && H5Sget_simple_extent_dims(space, dims, NULL) == rank &&
                dims[1] >= 1 && dims[1] <= 9;
    if (space >= 0) (void)H5Sclose(space);
    *rows = (size_t)dims[0];
    return fits ? (int)dims[1] : 0;
}

/* whether a dataset's numbers go into that type; strict: bit by bit */
SPHPA_PRIVATE_ bool sphpa_h5_fits_(hid_t set, hid_t type, bool strict) {
    hid_t have = H5Dget_type(set);
    bool fits = have >= 0 && H5Tget_class(have) == H5Tget_class(type) &&
                (!strict || H5Tequal(have, type) > 0);
    if (have >= 0) (void)H5Tclose(have);
    return fits;
}

/* a field or column of n particles into row->data */
SPHPA_PRIVATE_ void sphpa_h5_read_row_(sphpa_h5_ *h5, hid_t group, const sphpa_row_ *row,
                                       const char *name, size_t n, bool strict) {
    if (h5->result != SPHPA_OK) return;
    hid_t set = H5Dopen2(group, name, H5P_DEFAULT), type = sphpa_h5_type_(row->type);
    size_t rows = 0;
    int components = sphpa_h5_shape_(set, &rows);
    if (set < 0) sphpa_h5_broken_(h5, name);
    else if (components != row->components || rows != n)
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT,
                       "\"%.60s\" has %zu rows of %d numbers, not %zu of %d; give a whole file",
                       name, rows, components, n, row->components);
    else if (!sphpa_h5_fits_(set, type, strict))
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT,
                       "\"%.60s\" holds numbers of another type; give a file that this program "
                       "wrote", name);
    else if (H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, row->data) < 0)
        sphpa_h5_broken_(h5, name);
    if (set >= 0) (void)H5Dclose(set);
}

/* one number of an attribute, or `otherwise` */
SPHPA_PRIVATE_ double sphpa_h5_number_or_(hid_t at, const char *name, double otherwise) {
    double value[64];
    if (at < 0 || H5Aexists(at, name) <= 0) return otherwise;
    hid_t attribute = H5Aopen(at, name, H5P_DEFAULT);
    hid_t space = attribute >= 0 ? H5Aget_space(attribute) : -1;
    hssize_t count = space >= 0 ? H5Sget_simple_extent_npoints(space) : 0;
    bool read = count >= 1 && count <= 64 && H5Aread(attribute, H5T_NATIVE_DOUBLE, value) >= 0;
    if (space >= 0) (void)H5Sclose(space);
    if (attribute >= 0) (void)H5Aclose(attribute);
    return read ? value[0] : otherwise;
}

/* ---- a snapshot as the start of a scene ------------------------------------------------------ */

/* What of a file is read, and in which units. */
typedef struct sphpa_source_ {
    hid_t fields;     /* /PartType0 */
    int dim, columns;
    size_t n;
    double time;                  /* [s] */
    double length, mass, seconds; /* [m] [kg] [s] the file's units, equation (1) */
    sphpa_mask mask;
    sphpa_column column[SPHPA_COLUMNS_MAX];
} sphpa_source_;

SPHPA_PRIVATE_ void sphpa_source_header_(sphpa_h5_ *h5, sphpa_source_ *source) {
    if (h5->result != SPHPA_OK) return;
    bool has_units = sphpa_h5_has_(h5->file, "Units");
    hid_t header = sphpa_h5_has_(h5->file, "Header") ? sphpa_h5_group_(h5, "/Header") : -1;
    hid_t units = has_units ? sphpa_h5_group_(h5, "/Units") : -1;
    double dim = sphpa_h5_number_or_(header, "Dimension", 3.0);
    double files = sphpa_h5_number_or_(header, "NumFilesPerSnapshot", 1.0);
    double scale = sphpa_h5_number_or_(header, "Scale-factor", 1.0);
    source->length = 1e-2 * sphpa_h5_number_or_(units, "Unit length in cgs (U_L)", 1e2);
    source->mass = 1e-3 * sphpa_h5_number_or_(units, "Unit mass in cgs (U_M)", 1e3);
    source->seconds = sphpa_h5_number_or_(units, "Unit time in cgs (U_t)", 1.0);
    source->time = source->seconds * sphpa_h5_number_or_(header, "Time", 0.0);
    source->dim = dim >= 1.0 && dim <= 3.0 ? (int)dim : 0;
    if (source->dim == 0)
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "/Header says Dimension = %g, not 1, 2 or 3", dim);
    if (files > 1.0)
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "one of %g files of a snapshot; join them into one",
                       files);
    if (scale < 1.0 || scale > 1.0)
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "a cosmological snapshot (Scale-factor = %g); only "
                       "physical units can be read, convert it", scale);
    if (!(source->length > 0.0 && source->mass > 0.0 && source->seconds > 0.0))
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "/Units says %g m, %g kg, %g s; they must be "
                       "positive", source->length, source->mass, source->seconds);
    sphpa_h5_group_end_(header);
    sphpa_h5_group_end_(units);
}

/* the dataset of a field, maybe under its singular name; NULL if the file lacks it */
SPHPA_PRIVATE_ const char *sphpa_source_name_(hid_t fields, const char *name) {
    const char *alias = sphpa_row_alias_(name);
    if (sphpa_h5_has_(fields, name)) return name;
    return alias != NULL && sphpa_h5_has_(fields, alias) ? alias : NULL;
}

/* which fields of the table are there; the physical ones of every set of particles must be */
SPHPA_PRIVATE_ void sphpa_source_fields_(sphpa_h5_ *h5, sphpa_source_ *source) {
    if (h5->result != SPHPA_OK) return;
    for (int k = 0; k < (int)SPHPA_FIELD_COUNT; k++) {
        sphpa_field_info info = sphpa_field_describe((sphpa_field)k);
        bool number = info.type == SPHPA_TYPE_double || info.type == SPHPA_TYPE_sphpa_real;
        bool carried = info.role == SPHPA_ROLE_STATE || info.role == SPHPA_ROLE_CONSTANT;
        const char *name = carried ? sphpa_source_name_(source->fields, info.file_name) : NULL;
        if (name != NULL) source->mask |= (sphpa_mask)1 << k;
        else if (number && sphpa_has_(SPHPA_BASIC_FIELDS, k))
            sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "/PartType0/%s is missing; add it to the file, "
                           "or give another one", info.file_name);
    }
    hid_t set = -1;
    if (h5->result == SPHPA_OK) {
        sphpa_field_info x = sphpa_field_describe(SPHPA_FIELD_x);
        set = H5Dopen2(source->fields, x.file_name, H5P_DEFAULT);
        (void)sphpa_h5_shape_(set, &source->n);
        if (source->n == 0)
            sphpa_h5_fail_(h5, SPHPA_ERROR_EMPTY, "no particles in /PartType0; give another file");
    }
    if (set >= 0) (void)H5Dclose(set);
}

/* columns of a scene's own, as this program marks them */
SPHPA_PRIVATE_ void sphpa_source_columns_(sphpa_h5_ *h5, sphpa_source_ *source) {
    for (size_t k = 0; h5->result == SPHPA_OK; k++) {
        char name[160];
        sphpa_h5_member_(source->fields, k, name, sizeof name);
        if (name[0] == '\0') return;
        hid_t set = H5Dopen2(source->fields, name, H5P_DEFAULT);
        size_t rows = 0;
        int components = sphpa_h5_shape_(set, &rows);
        int32_t rules[3] = {0, 0, 0};
        bool ours = set >= 0 && components > 0 && H5Aexists(set, "sphpa column") > 0 &&
                    strlen(name) < sizeof source->column[0].name;
        if (ours && source->columns < SPHPA_COLUMNS_MAX) {
            sphpa_column *column = &source->column[source->columns++];
            sphpa_h5_get_(h5, set, "sphpa column", H5T_NATIVE_INT32, 3, rules);
            memcpy(column->name, name, strlen(name) + 1);
            column->components = components;
            column->length = (int)sphpa_h5_number_or_(set, "U_L exponent", 0.0);
            column->mass = (int)sphpa_h5_number_or_(set, "U_M exponent", 0.0);
            column->time = (int)sphpa_h5_number_or_(set, "U_t exponent", 0.0);
            column->role = (sphpa_role)rules[0];
            column->split = (sphpa_rule)rules[1];
            column->merge = (sphpa_rule)rules[2];
        }
        if (set >= 0) (void)H5Dclose(set);
    }
}

/* equation (1), with the exponents that the file gives, else with the table's */
SPHPA_PRIVATE_ void sphpa_source_to_si_(const sphpa_source_ *source, const sphpa_row_ *row,
                                        const char *name) {
    hid_t set = H5Dopen2(source->fields, name, H5P_DEFAULT);
    double length = sphpa_h5_number_or_(set, "U_L exponent", (double)row->length);
    double mass = sphpa_h5_number_or_(set, "U_M exponent", (double)row->mass);
    double time = sphpa_h5_number_or_(set, "U_t exponent", (double)row->time);
    if (set >= 0) (void)H5Dclose(set);
    double factor = pow(source->length, length) * pow(source->mass, mass) *
                    pow(source->seconds, time);
    size_t count = source->n * (size_t)row->components;
    if (row->type == SPHPA_TYPE_double)
        for (size_t k = 0; k < count; k++) ((double *)row->data)[k] *= factor;
    else if (row->type == SPHPA_TYPE_sphpa_real)
        for (size_t k = 0; k < count; k++)
            ((sphpa_real *)row->data)[k] =
                (sphpa_real)((double)((sphpa_real *)row->data)[k] * factor);
}

SPHPA_PRIVATE_ void sphpa_source_read_(sphpa_h5_ *h5, const sphpa_source_ *source,
                                       sphpa_particles *p) {
    for (int k = 0; k < SPHPA_ROWS_ && h5->result == SPHPA_OK; k++) {
        sphpa_row_ row;
        if (!sphpa_row_of_(p, k, &row)) continue;
        const char *name = row.name;
        if (row.column == NULL) name = sphpa_source_name_(source->fields, row.name);
        if (name == NULL) continue; /* ids, materials, bodies: as they were made */
        sphpa_h5_read_row_(h5, source->fields, &row, name, source->n, false);
        if (h5->result == SPHPA_OK) sphpa_source_to_si_(source, &row, name);
    }
    if (h5->result != SPHPA_OK) return;
    p->next_id = 0;
    for (size_t i = 0; i < p->n; i++) {
        for (int a = p->dim; a < 3; a++) p->x[3 * i + (size_t)a] = 0.0;
        if (p->id[i] < 0 || p->id[i] == INT64_MAX)
            sphpa_h5_fail_(h5, SPHPA_ERROR_RANGE, "particle %zu has the id %lld; ids are from 0 to "
                           "%lld", i, (long long)p->id[i], (long long)(INT64_MAX - 1));
        if (p->id[i] >= p->next_id && p->id[i] < INT64_MAX) p->next_id = p->id[i] + 1;
    }
}

SPHPA_DEF sphpa_result sphpa_snapshot_read(const char *path, sphpa_particles *out, double *time,
                                           sphpa_error *err) {
    sphpa_h5_ h5;
    sphpa_source_ source;
    sphpa_particles p;
    memset(&source, 0, sizeof source);
    memset(&p, 0, sizeof p);
    source.fields = -1;
    sphpa_h5_open_(&h5, path, err);
    if (h5.result == SPHPA_OK && !sphpa_h5_has_(h5.file, "PartType0"))
        sphpa_h5_fail_(&h5, SPHPA_ERROR_FORMAT, "an HDF5 file, but no snapshot: it has no group "
                       "/PartType0; give a snapshot of this program or of SWIFT");
    if (h5.result == SPHPA_OK) source.fields = sphpa_h5_group_(&h5, "/PartType0");
    sphpa_source_header_(&h5, &source);
    sphpa_source_fields_(&h5, &source);
    sphpa_source_columns_(&h5, &source);
    if (h5.result == SPHPA_OK)
        h5.result = sphpa_particles_create(&p, source.dim, source.n, source.mask, 0, source.column,
                                           source.columns, err);
    if (h5.result == SPHPA_OK) h5.result = sphpa_particles_add(&p, source.n, NULL, err);
    sphpa_source_read_(&h5, &source, &p);
    if (h5.result == SPHPA_OK) h5.result = sphpa_particles_check(&p, err);
    sphpa_h5_group_end_(source.fields);
    if (sphpa_h5_close_(&h5) != SPHPA_OK) {
        sphpa_particles_free(&p);
        return h5.result;
    }
    *out = p;
    if (time != NULL) *time = source.time;
    return SPHPA_OK;
}

/* ---- resuming -------------------------------------------------------------------------------- */

/* that it is a checkpoint of this format; returns /sphpa or -1 */
SPHPA_PRIVATE_ hid_t sphpa_checkpoint_open_(sphpa_h5_ *h5, const char *path, sphpa_error *err) {
    sphpa_h5_open_(h5, path, err);
    if (h5->result != SPHPA_OK) return -1;
    hid_t own = sphpa_h5_has_(h5->file, "sphpa") ? sphpa_h5_group_(h5, "/sphpa") : -1;
    if (own < 0) {
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "an HDF5 file, but no checkpoint: it has no group "
                       "/sphpa; give a checkpoint that this program wrote");
        return -1;
    }
    char *kind = sphpa_h5_text_(h5, own, "kind");
    double format = sphpa_h5_number_or_(own, "format", 0.0);
    if (kind == NULL || strcmp(kind, "checkpoint") != 0)
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "a %.40s, not a checkpoint: it lacks what a restart "
                       "needs; give a checkpoint, or start a new run from it",
                       kind != NULL ? kind : "file of another kind");
    else if ((int)format != SPHPA_CHECKPOINT_FORMAT_)
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "written in format %d, but this program reads "
                       "format %d; resume with the version that wrote it", (int)format,
                       SPHPA_CHECKPOINT_FORMAT_);
    SPHPA_FREE(kind);
    return own;
}

/* the file's passes against the scene's, by name and place */
SPHPA_PRIVATE_ void sphpa_h5_same_passes_(sphpa_h5_ *h5, hid_t own, const sphpa_sim *sim) {
    if (h5->result != SPHPA_OK) return;
    char *names = sphpa_h5_text_(h5, own, "passes"), *theirs = names;
    for (int k = 0; k <= sim->passes && h5->result == SPHPA_OK; k++) {
        char *end = theirs != NULL ? strchr(theirs, '\n') : NULL;
        if (end != NULL) *end = '\0';
        const char *there = theirs != NULL ? theirs : "none";
        const char *here = k < sim->passes ? sim->pass[k]->name : "none";
        if (strcmp(there, here) != 0)
            sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT,
                           "of another scene: its pass %d is \"%.60s\", here it is \"%.60s\"; "
                           "resume with the modules and options that wrote it", k, there, here);
        theirs = end != NULL ? end + 1 : NULL;
    }
    SPHPA_FREE(names);
}

SPHPA_PRIVATE_ void sphpa_h5_same_box_(sphpa_h5_ *h5, hid_t own, const sphpa_box *box) {
    int32_t periodic[3] = {0, 0, 0};
    double low[3] = {0.0, 0.0, 0.0}, high[3] = {0.0, 0.0, 0.0};
    sphpa_h5_numbers_(h5, own, "periodic", H5T_NATIVE_INT32, 3, periodic);
    sphpa_h5_numbers_(h5, own, "low", H5T_NATIVE_DOUBLE, 3, low);
    sphpa_h5_numbers_(h5, own, "high", H5T_NATIVE_DOUBLE, 3, high);
    for (int a = 0; a < 3; a++) {
        bool wraps = box->periodic[a] != 0, same = (periodic[a] != 0) == wraps;
        if (same && wraps)
            same = memcmp(&low[a], &box->low[a], sizeof(double)) == 0 &&
                   memcmp(&high[a], &box->high[a], sizeof(double)) == 0;
        if (!same)
            sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT,
                           "of another box: axis %d is %s [%.9g, %.9g] m, here %s [%.9g, %.9g] m; "
                           "resume with the same box", a, periodic[a] ? "periodic" : "open", low[a],
                           high[a], wraps ? "periodic" : "open", box->low[a], box->high[a]);
    }
}

SPHPA_PRIVATE_ void sphpa_h5_same_number_(sphpa_h5_ *h5, const char *what, int64_t there,
                                          int64_t here) {
    if (there != here)
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "its %s is %lld, here it is %lld; resume with the "
                       "options that wrote it", what, (long long)there, (long long)here);
}

/* reads the numbers into *r; *here is what the simulation has */
SPHPA_PRIVATE_ void sphpa_h5_same_scene_(sphpa_h5_ *h5, hid_t own, const sphpa_sim *sim,
                                         sphpa_restart_ *r) {
    sphpa_restart_ here;
    sphpa_restart_of_(sim, &here);
    *r = here; /* with the lengths of the lists */
    sphpa_h5_same_passes_(h5, own, sim);
    sphpa_h5_restart_(h5, own, r);
    sphpa_h5_same_number_(h5, "dimension", r->dim, here.dim);
    sphpa_h5_same_number_(h5, "number of bytes of sphpa_real (4: REAL=float)", r->real_bytes,
                          here.real_bytes);
    if (h5->result == SPHPA_OK && r->kernel != here.kernel)
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "its kernel is \"%s\", here it is \"%s\"; resume "
                       "with the options that wrote it", sphpa_kernel_name((sphpa_kernel)r->kernel),
                       sphpa_kernel_name(sim->options.kernel));
    sphpa_h5_same_number_(h5, "integrator (0: predictor-corrector, 1: RK2)", r->integrator,
                          here.integrator);
    sphpa_h5_same_box_(h5, own, &sim->options.box);
    bool sane = r->n >= 0 && r->limit_last >= 0 && r->limit_last < here.limits;
    for (int k = 0; k < 5; k++) sane = sane && sphpa_finite_(r->clock[k]);
    if (!sane)
        sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "its clock is not that of a run (t = %g s, next "
                       "step %g s, %lld particles); give an earlier checkpoint", r->clock[0],
                       r->clock[2], (long long)r->n);
}

/* whether the scene has a dataset of that name, or its singular */
SPHPA_PRIVATE_ bool sphpa_row_known_(const sphpa_particles *p, const char *name) {
    for (int k = 0; k < SPHPA_ROWS_; k++) {
        sphpa_row_ row;
        if (!sphpa_row_of_(p, k, &row)) continue;
        const char *alias = row.column == NULL ? sphpa_row_alias_(row.name) : NULL;
        if (strcmp(row.name, name) == 0 || (alias != NULL && strcmp(alias, name) == 0)) return true;
    }
    return false;
}

/* every field of the scene from the file, and no field more in the file */
SPHPA_PRIVATE_ void sphpa_h5_read_rows_(sphpa_h5_ *h5, const sphpa_particles *p) {
    hid_t fields = sphpa_h5_group_(h5, "/PartType0");
    for (int k = 0; k < SPHPA_ROWS_ && h5->result == SPHPA_OK; k++) {
        sphpa_row_ row;
        if (!sphpa_row_of_(p, k, &row)) continue;
        if (!sphpa_h5_has_(fields, row.name))
            sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "it lacks the field \"%s\", which this scene "
                           "has; resume with the modules and options that wrote it", row.name);
        else sphpa_h5_read_row_(h5, fields, &row, row.name, p->n, true);
    }
    for (size_t k = 0; h5->result == SPHPA_OK; k++) {
        char name[160];
        sphpa_h5_member_(fields, k, name, sizeof name);
        if (name[0] == '\0') break;
        if (!sphpa_row_known_(p, name))
            sphpa_h5_fail_(h5, SPHPA_ERROR_FORMAT, "it has the field \"%s\", which this scene "
                           "lacks; resume with the modules and options that wrote it", name);
    }
    sphpa_h5_group_end_(fields);
}

/* [s] the next step under options that may have become stricter */
SPHPA_PRIVATE_ double sphpa_restart_dt_(const sphpa_restart_ *r, const sphpa_sim_options *options) {
    double dt = r->clock[2], share = 1.0;
    if (options->dt_fixed > 0.0) return options->dt_fixed;
    if (r->control[0] > 0.0) share = sphpa_min_(share, options->cfl / r->control[0]);
    if (r->control[1] > 0.0) share = sphpa_min_(share, options->force_cfl / r->control[1]);
    dt *= share;
    return options->dt_max > 0.0 ? sphpa_min_(dt, options->dt_max) : dt;
}

SPHPA_PRIVATE_ void sphpa_restart_apply_(const sphpa_restart_ *r, sphpa_sim *sim) {
    sphpa_stats *s = &sim->stats;
    sim->time = r->clock[0];
    sim->dt = r->clock[1];
    sim->dt_next = sphpa_restart_dt_(r, &sim->options);
    sim->dt_first = r->clock[3];
    sim->dt_free = r->clock[4];
    sim->started = r->started;
    s->steps = r->counts[0];
    s->evaluations = r->counts[1];
    s->rebuilds = r->counts[2];
    s->u_below = r->counts[3];
    s->neighbours_mean = r->means[0];
    s->u_deficit = r->means[1];
    s->u_least = r->means[2];
    s->limit_last = r->limit_last;
    s->limit_id = r->ids[0];
    s->u_id = r->ids[1];
    for (int k = 0; k < s->timings; k++)
        s->timing[k].seconds = r->seconds[k], s->timing[k].calls = r->calls[k];
    for (int k = 0; k < s->limits; k++) s->limit[k].steps = r->limit_steps[k];
}

/* the particles' and the modules' turn; on a failure both get their own back */
SPHPA_PRIVATE_ sphpa_result sphpa_checkpoint_swap_(sphpa_sim *sim, sphpa_particles *fresh,
                                                   sphpa_kept_ *kept, sphpa_error *err) {
    sphpa_kept_ before;
    int done = 0, ignored = 0;
    memset(&before, 0, sizeof before);
    sphpa_result result =
        sphpa_kept_exchange_(sim, sphpa_kept_take_, &before, sim->scene.modules, &done, err);
    if (result == SPHPA_OK) {
        sphpa_particles own = sim->p;
        sim->p = *fresh;
        result = sphpa_kept_exchange_(sim, sphpa_kept_give_, kept, sim->scene.modules, &done, err);
        for (int m = 0; m < sim->scene.modules && result == SPHPA_OK; m++)
            if (sim->scene.module[m].check != NULL)
                result = sim->scene.module[m].check(sim, sim->scene.module[m].params, err);
        if (result != SPHPA_OK) {
            sim->p = own;
            (void)sphpa_kept_exchange_(sim, sphpa_kept_give_, &before, done, &ignored, NULL);
        } else *fresh = own; /* to be freed */
    }
    sphpa_kept_free_(&before);
    return result;
}

SPHPA_DEF sphpa_result sphpa_checkpoint_read(sphpa_sim *sim, const char *path, sphpa_error *err) {
    sphpa_h5_ h5;
    sphpa_restart_ restart;
    sphpa_particles fresh;
    sphpa_kept_ kept;
    memset(&fresh, 0, sizeof fresh);
    memset(&kept, 0, sizeof kept);
    hid_t own = sphpa_checkpoint_open_(&h5, path, err);
    sphpa_h5_same_scene_(&h5, own, sim, &restart);
    if (h5.result == SPHPA_OK)
        h5.result = sphpa_particles_create(&fresh, sim->p.dim, (size_t)restart.n, sim->p.fields,
                                           sim->p.start_fields, sim->p.column, sim->p.columns, err);
    if (h5.result == SPHPA_OK)
        h5.result = sphpa_particles_add(&fresh, (size_t)restart.n, NULL, err);
    sphpa_h5_read_rows_(&h5, &fresh);
    if (h5.result == SPHPA_OK) h5.result = sphpa_rows_check_(&fresh, err);
    if (h5.result == SPHPA_OK) sphpa_h5_read_blocks_(&h5, "/sphpa/Kept", &kept);
    sphpa_h5_group_end_(own);
    sphpa_result result = sphpa_h5_close_(&h5);
    fresh.next_id = restart.next_id;
    if (result == SPHPA_OK) result = sphpa_checkpoint_swap_(sim, &fresh, &kept, err);
    if (result == SPHPA_OK) {
        sphpa_restart_apply_(&restart, sim);
        sim->work->lists_valid = false;
        sim->work->kept_n = 0;
    }
    sphpa_particles_free(&fresh);
    sphpa_kept_free_(&kept);
    return result;
}

SPHPA_DEF sphpa_result sphpa_checkpoint_blob(const char *path, const char *name, void *data,
                                             size_t bytes, sphpa_error *err) {
    sphpa_h5_ h5;
    hid_t own = sphpa_checkpoint_open_(&h5, path, err), set = -1;
    hid_t blobs = h5.result == SPHPA_OK ? sphpa_h5_group_(&h5, "/sphpa/Blobs") : -1;
    if (blobs >= 0 && (strchr(name, '/') != NULL || !sphpa_h5_has_(blobs, name)))
        sphpa_h5_fail_(&h5, SPHPA_ERROR_MISSING, "it holds no blob \"%.60s\"; resume with the "
                       "program that wrote it", name);
    if (h5.result == SPHPA_OK) set = H5Dopen2(blobs, name, H5P_DEFAULT);
    long long have = set >= 0 ? sphpa_h5_block_bytes_(set) : -1;
    if (h5.result == SPHPA_OK && have != (long long)bytes)
        sphpa_h5_fail_(&h5, SPHPA_ERROR_FORMAT, "its blob \"%.60s\" has %lld bytes, not %zu; "
                       "resume with the program that wrote it", name, have, bytes);
    if (h5.result == SPHPA_OK &&
        H5Dread(set, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0)
        sphpa_h5_broken_(&h5, name);
    if (set >= 0) (void)H5Dclose(set);
    sphpa_h5_group_end_(blobs);
    sphpa_h5_group_end_(own);
    return sphpa_h5_close_(&h5);
}

SPHPA_EXTERN_C_END_
#endif /* >>snapshot */

/* the next include starts afresh */
#undef SPHPA_WANT_BASE_
#undef SPHPA_WANT_KERNEL_
#undef SPHPA_WANT_EOS_
#undef SPHPA_WANT_POROSITY_
#undef SPHPA_WANT_STRENGTH_
#undef SPHPA_WANT_DAMAGE_
#undef SPHPA_WANT_RIEMANN_
#undef SPHPA_WANT_TREE_
#undef SPHPA_WANT_PARTICLES_
#undef SPHPA_WANT_SPH_
#undef SPHPA_WANT_GAS_
#undef SPHPA_WANT_SOLID_
#undef SPHPA_WANT_PORES_
#undef SPHPA_WANT_PLASTIC_
#undef SPHPA_WANT_CRACKS_
#undef SPHPA_WANT_SETUP_
#undef SPHPA_WANT_FRAGMENTS_
#undef SPHPA_WANT_SNAPSHOT_

/*
This software is available under 2 licenses -- choose whichever you prefer.
------------------------------------------------------------------------------
ALTERNATIVE A - MIT License
Copyright (c) 2026 the sphpa authors
Permission is hereby granted, free of charge, to any person obtaining a copy of
this software and associated documentation files (the "Software"), to deal in
the Software without restriction, including without limitation the rights to
use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies
of the Software, and to permit persons to whom the Software is furnished to do
so, subject to the following conditions:
The above copyright notice and this permission notice shall be included in all
copies or substantial portions of the Software.
THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR
IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY,
FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE
AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER
LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,
OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE
SOFTWARE.
------------------------------------------------------------------------------
ALTERNATIVE B - Public Domain (www.unlicense.org)
This is free and unencumbered software released into the public domain.
Anyone is free to copy, modify, publish, use, compile, sell, or distribute this
software, either in source code form or as a compiled binary, for any purpose,
commercial or non-commercial, and by any means.
In jurisdictions that recognize copyright laws, the author or authors of this
software dedicate any and all copyright interest in the software to the public
domain. We make this dedication for the benefit of the public at large and to
the detriment of our heirs and successors. We intend this dedication to be an
overt act of relinquishment in perpetuity of all present and future rights to
this software under copyright law.
THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR
IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY,
FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE
AUTHORS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN
ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION
WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.
*/
