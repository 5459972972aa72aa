/* Pendula in a plane, coupled to their neighbours, as a hand-written model for the runtime of lattices:
   H = sum of p^2/2 - g cos q + (q[i+1] - q)^2/2 + (q[j+1] - q)^2/2, periodic along i, with open ends along j. */
#ifndef DECLARATIONS_H
#define DECLARATIONS_H
#include <stddef.h>
#include <stdint.h>

#define PHI_AXES 2
#define PHI_DIM 2
#define PHI_CASIMIRS 0

#define PHI_HALO 1
#define PHI_OPEN 1
#define PHI_OPEN_ROWS 1
#define PHI_COLOURS 0
#define PHI_PAIRS 0
#define PHI_SITE_PARAMETERS 0
#define PHI_KICKS 0
#define PHI_NEAR 0
#define PHI_CALLS_EXP 1
#define PHI_CALLS_EXPM1 1
#define PHI_CALLS_LOG 1
#define PHI_CALLS_SIN 1
#define PHI_CALLS_COS 1

typedef struct {
    double g;
} phi_params, phi_params_bar;

extern const phi_params phi_default_params;

enum { PHI_ARRAYS = 2, PHI_COEFFICIENTS = 4 };
#endif
