#ifndef PHI_FILE_ADJOINT_STORED_BACK_BATCHES
#define PHI_FILE_ADJOINT_STORED_BACK_BATCHES
#include <string.h>

#include "adjoint_stored.c"

/* Pull the cotangents of all members back through all steps, and add those of output rows. */
static void phi_pull_back(phi_group *group, int count, const phi_pulled *all, size_t first, phi_back_group *bar)
{
    phi_lanes y[PHI_DIM];
    const double *point = all->tape + all->steps * (size_t)group->packs * PHI_ALL_STAGES(PHI_POINT);
    for (size_t end = all->steps; end > 0; --end) {
        phi_pull_joined(bar, count, all, first, end);
        PHI_EACH_STAGE_BACK {
            for (int k = group->packs - 1; k >= 0; --k) {
                point -= PHI_POINT;
                memcpy(y, point, sizeof y);
                phi_pull_stage(PHI_OF(group->coef[k], stage), y, bar->x[k], PHI_OF(bar->coef[k], stage));
            }
        }
    }
}
#endif
