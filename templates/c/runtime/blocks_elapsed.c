#ifndef PHI_FILE_BLOCKS_ELAPSED
#define PHI_FILE_BLOCKS_ELAPSED
#include <math.h>
#include <string.h>
#include "blocks.c"

/* Compute the physical time of the step in each lane, a compensated sum over its stages: `elapsed` is the sum, `lost`
   its compensation term. Returns 0 if the time of a stage does not have the sign of the step. */
static int phi_elapse(const phi_solver *s, phi_table *table, phi_model *model, phi_lanes elapsed, phi_lanes lost)
{
    phi_lanes wrong = { 0.0 };
    memset(elapsed, 0, PHI_LANES * sizeof elapsed[0]);
    memset(lost, 0, PHI_LANES * sizeof lost[0]);
    PHI_EACH_STAGE {
        phi_lanes one[1];
        const double size = PHI_FRACTION(s->h);
        phi_elapsed_lanes(PHI_OF(table->coef, stage), PHI_IN(model, stage, y), one);
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double sum = elapsed[lane] + one[0][lane], added = sum - elapsed[lane];
            wrong[lane] += one[0][lane] * size > 0.0 ? 0.0 : 1.0;
            lost[lane] += (elapsed[lane] - (sum - added)) + (one[0][lane] - added);
            elapsed[lane] = sum;
        }
    }
    return !(phi_largest(wrong) > 0.0);
}

/* Add the physical times of the steps of a block to the time of the solver, in order. */
static void phi_pass_lanes(phi_solver *s, phi_lanes elapsed, phi_lanes lost)
{
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        s->t_carry += lost[lane];
        phi_pass(s, elapsed[lane]);
    }
}
#endif
