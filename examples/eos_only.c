/* The material line alone: P-alpha in a program with no particles. With the header beside it:
       cc -I. examples/eos_only.c -o eos_only -lm
   Porous pumice is squeezed and then released, adiabatically: du = P/rho^2 drho. */
#define SPHPA_POROSITY_IMPLEMENTATION
#include "sphpa.h"

#include <stdio.h>
#include <string.h>

int main(int argc, char **argv) {
    if (argc > 1 && strcmp(argv[1], "--version") == 0) {
        printf("eos_only, sphpa %s\n", SPHPA_VERSION);
        return 0;
    }
    if (argc > 1) {
        printf("%s: takes no arguments; prints how pumice is crushed and released along a path\n",
               argv[0]);
        return strcmp(argv[1], "--help") == 0 ? 0 : 2;
    }
    const sphpa_tillotson *matrix = sphpa_tillotson_find("pumice");
    sphpa_crush curve = sphpa_crush_pumice();
    sphpa_palpha_solution now;
    double rho = matrix->rho0 / curve.alpha0, u = 0.0, alpha = curve.alpha0;
    const int steps = 1200, turn = 1000, every = 100;
    printf("# rho[kg/m3]  u[J/kg]     alpha       P[Pa]         on_the_curve  evaluations\n");
    for (int k = 0; k <= steps; k++) {
        sphpa_result result = sphpa_palpha_solve(SPHPA_PALPHA_CRUSH_SPACE, matrix, &curve, rho, u,
                                                 alpha, NULL, &now);
        if (result != SPHPA_OK) {
            fprintf(stderr, "rho = %g: %s; %s\n", rho, sphpa_result_message(result),
                    sphpa_result_hint(result));
            return 1;
        }
        alpha = now.alpha; /* pores close and never open: the next step starts here */
        double away = alpha - sphpa_crush_alpha(&curve, now.P, NULL);
        if (k % every == 0 || (k > turn && k % 20 == 0 && k < turn + every))
            printf("%11.3f  %9.2f  %10.6f  %12.5e  %12s  %11d\n", rho, u, alpha, now.P,
                   away > -1e-9 ? "yes" : "no", now.evaluations);
        double next = rho * (k < turn ? 1.0014 : 0.99999); /* crush, then let go */
        u += now.P * (1.0 / rho - 1.0 / next);
        rho = next;
    }
    return 0;
}
