#ifndef PHI_FILE_BLOCKS_ATTITUDE
#define PHI_FILE_BLOCKS_ATTITUDE
#include <math.h>
#include <string.h>
#include "blocks.c"

/* Copy the attitude increments of a stage from all lanes into the sequence of all increments, in order of time. */
static void phi_take_stage(phi_lanes turns[PHI_ELEMENT] PHI_AND_INT_STAGE, double sequence[][PHI_ELEMENT])
{
    for (int lane = 0; lane < PHI_LANES; ++lane)
        for (int i = 0; i < PHI_ELEMENT; ++i) sequence[PHI_STAGE_OF_LANE][i] = turns[i][lane];
}

#include "blocks_covector.c"
#include "blocks_element.c"

/* Multiply the attitude by the increments of all stages of a solved block, in order of time. */
static void phi_turn_block(phi_solver *s, phi_table *table, phi_model *model)
{
    phi_lanes turns[PHI_ELEMENT];
    double sequence[PHI_ALL_STAGES(PHI_LANES)][PHI_ELEMENT];
    PHI_EACH_STAGE {
        phi_factor_lanes(PHI_OF(table->coef, stage), PHI_IN(model, stage, y), turns);
        phi_take_stage(turns PHI_AND_STAGE, sequence);
    }
    phi_turn_sequence(s, sequence, PHI_ALL_STAGES(PHI_LANES));
}
#endif
