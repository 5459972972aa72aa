#ifndef PHI_FILE_ADJOINT_GROUPS
#define PHI_FILE_ADJOINT_GROUPS
#include <string.h>

#include "adjoint_batches.c"
#include "adjoint_segments.c"
#include "adjoint_stored.c"
#include "model.h"

#include "adjoint_groups_parameters.c"

/* Copy the derivatives of one member from its lane. Returns 0 if a value is not finite. */
static int phi_pull_end(const phi_back_group *bar, int m, const phi_pulled *all, size_t at PHI_AND_GAUGE(const phi_group *group))
{
    const int k = m / PHI_LANES, lane = m % PHI_LANES;
    phi_cotangent member_bar;
    for (int i = 0; i < PHI_DIM; ++i) member_bar.x[i] = bar->x[k][i][lane];
    if (!phi_finite(member_bar.x, PHI_DIM)) return 0;
    PHI_EACH_STAGE {
        double *coef = PHI_OF(member_bar.coef, stage);
        for (int c = 0; c < PHI_COEFFICIENTS; ++c) coef[c] = PHI_OF(bar->coef[k], stage)[c][lane];
        if (!phi_finite(coef, PHI_COEFFICIENTS)) return 0;
    }
    memcpy(all->x0_bar + at * PHI_DIM, member_bar.x, sizeof member_bar.x);
    phi_pull_parameters(all, &member_bar, at PHI_AND_GAUGE(group->gauge[m]));
    PHI_NO_GROUP(group)
    if (all->status != NULL) all->status[at] = PHI_OK;
    return 1;
}

/* Make the forward and the reverse pass of one batch, whose first member has the number `first`. Members whose lane
   fails, or that vectorised code cannot treat, are computed again one by one. Returns the first status that is not OK.
   */
PHI_APART static phi_status phi_pull_group(const phi_pulled *all, size_t first)
{
    phi_group group;
    phi_back_group bar;
    phi_status result = PHI_OK;
    int good[PHI_BACK_GROUP];
    const int count = all->members - first < PHI_BACK_GROUP ? (int)(all->members - first) : PHI_BACK_GROUP;
    int together = count > 2; /* measured: one or two members are faster one at a time */
    memset(&group, 0, sizeof group);
    memset(bar.x, 0, sizeof bar.x);
    memset(bar.coef, 0, sizeof bar.coef);
    PHI_COUNT_PACKS(group, count)
    for (int m = 0; m < count; ++m) good[m] = together && phi_pull_join(&group, m, all, first);
    together = together && phi_pull_forth(&group, count, all, first PHI_AND_STARTS_OF_BATCHES);
    for (int m = 0; m < count; ++m) {
        double x[PHI_DIM];
        phi_pull_state(&group, m, x);
        good[m] = good[m] && together && group.active[m] && phi_finite(x, PHI_DIM);
    }
    if (together) phi_pull_back(&group, count, all, first, &bar);
    for (int m = 0; m < count; ++m) {
        if (good[m] && phi_pull_end(&bar, m, all, first + (size_t)m PHI_AND_GAUGE(&group))) continue;
        const phi_status status = phi_pull_member(all, first + (size_t)m);
        if (result == PHI_OK) result = status;
    }
    return result;
}
#endif
