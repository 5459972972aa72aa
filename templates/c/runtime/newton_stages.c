#ifndef PHI_FILE_NEWTON_STAGES
#define PHI_FILE_NEWTON_STAGES
#include <math.h>

#include "newton_lanes.c"

/* Set unit, in each lane, to the smallest magnitude of component i of y in all stages. */
static inline void phi_take_least(const phi_model *model, int stages, int i, double unit[restrict PHI_LANES])
{
    for (int stage = 1; stage < stages; ++stage) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double here = fabs(model[stage].y[i][lane]);
            unit[lane] = here < unit[lane] ? here : unit[lane];
        }
    }
}
#endif
