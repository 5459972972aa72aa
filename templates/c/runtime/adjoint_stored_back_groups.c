#ifndef PHI_FILE_ADJOINT_STORED_BACK_GROUPS
#define PHI_FILE_ADJOINT_STORED_BACK_GROUPS
#include <string.h>

#include "adjoint_stored.c"

/* Pull the cotangents of all members back through all steps, and add those of output rows. */
static void phi_pull_back(phi_group *group, int count, const phi_pulled *all, size_t first, phi_back_group *bar)
{
    phi_traced g;
    const double *point = all->tape + all->steps * PHI_ALL_STAGES(PHI_POINT);
    for (size_t end = all->steps; end > 0; --end) {
        phi_pull_joined(bar, count, all, first, end);
        PHI_EACH_STAGE_BACK {
            point -= PHI_POINT;
            memcpy(g.y, point, sizeof g.y);
            g.coef = PHI_OF(group->coef, stage);
            phi_pull_stage(&g, bar->x[0], PHI_OF(bar->coef[0], stage));
        }
    }
}
#endif
