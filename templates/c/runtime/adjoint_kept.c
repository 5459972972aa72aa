#ifndef PHI_FILE_ADJOINT_KEPT
#define PHI_FILE_ADJOINT_KEPT
#include <string.h>

#include "adjoint_abreast.c"
#include "model.h"

/* Of explicit stages the points where they begin are kept, of implicit ones those that they have solved for: so few that no
   step is made again. */
enum { PHI_POINT = PHI_DIM * PHI_LANES }; /* numbers of a point in all lanes */

/* Make a step, of as many as remain, and leave the points of its stages; the end of what was left. NULL where too few
   members are left to go on. */
static double *phi_pull_step(phi_group *group, size_t remaining, double *trail)
{
#if PHI_GROUPS
    if (phi_group_step(group, remaining) < PHI_FEWEST) return NULL;
    PHI_EACH_STAGE {
        memcpy(trail, phi_group_past(group PHI_AND_STAGE, 0), PHI_POINT * sizeof *trail);
        trail += PHI_POINT;
    }
#else
    (void)remaining;
    PHI_EACH_STAGE
        for (int k = 0; k < group->packs; ++k) {
            memcpy(trail, group->pack[k].x, PHI_POINT * sizeof *trail);
            trail += PHI_POINT;
            phi_stage_lanes(PHI_OF(group->coef[k], stage), 1, &group->pack[k]);
        }
#endif
    return trail;
}

/* Make all steps, and leave their points. 0 where that would have to go on with too few members. */
static int phi_pull_forth(phi_group *group, int count, const phi_pulled *all, size_t first)
{
    double *trail = all->trail;
    for (size_t done = 0; done < all->steps;) {
        trail = phi_pull_step(group, all->steps - done, trail);
        if (trail == NULL) return 0;
        phi_pull_rows(group, count, all, first, ++done);
    }
    return 1;
}

#include "adjoint_kept_explicit.c"
#include "adjoint_kept_implicit.c"

/* Pull the cotangents of rows back through all steps. */
static void phi_pull_back(phi_group *group, int count, const phi_pulled *all, size_t first, phi_back_group *bar)
{
#if PHI_GROUPS
    phi_traced g;
    const double *point = all->trail + all->steps * PHI_ALL_STAGES(PHI_POINT);
#else
    phi_lanes y[PHI_DIM];
    const double *point = all->trail + all->steps * (size_t)group->packs * PHI_ALL_STAGES(PHI_POINT);
#endif
    for (size_t end = all->steps; end > 0; --end) {
        phi_pull_joined(bar, count, all, first, end);
        PHI_EACH_STAGE_BACK {
#if PHI_GROUPS
            point -= PHI_POINT;
            memcpy(g.y, point, sizeof g.y);
            g.coef = PHI_OF(group->coef, stage);
            phi_pull_stage(&g, bar->x[0], PHI_OF(bar->coef[0], stage));
#else
            for (int k = group->packs - 1; k >= 0; --k) {
                point -= PHI_POINT;
                memcpy(y, point, sizeof y);
                phi_pull_stage(PHI_OF(group->coef[k], stage), y, bar->x[k], PHI_OF(bar->coef[k], stage));
            }
#endif
        }
    }
}
#endif
