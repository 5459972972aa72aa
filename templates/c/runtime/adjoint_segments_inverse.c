#ifndef PHI_FILE_ADJOINT_SEGMENTS_INVERSE
#define PHI_FILE_ADJOINT_SEGMENTS_INVERSE
#include <math.h>
#include <string.h>

#include "adjoint_segments.c"

/* The state before each flow is recomputed by the inverse flow, the flow over the negative time. Each segment restarts
   from a stored state, so rounding errors do not accumulate over segments. */
#define PHI_UNLIKE 1e-13 /* largest accepted difference from the stored state at the start of a segment, relative to the state */

/* Restore the stored state at the start of a segment, after all its steps have been recomputed by the inverse flows. If
   the recomputed state of a member differs too much, its derivatives become infinite. */
static void phi_pull_arrive(phi_group *group, const phi_pulled *all, size_t begin, phi_back_group *bar)
{
    for (int k = 0; k < group->packs; ++k) {
        phi_lanes began[PHI_DIM], size = { 0.0 }, wrong = { 0.0 };
        if (begin > 0) memcpy(began, phi_pull_left(group, k, all, begin), sizeof began);
        else memcpy(began, bar->start[k].x, sizeof began);
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) size[lane] += fabs(began[i][lane]);
        }
        for (int i = 0; i < PHI_DIM; ++i) {
            const double *x = group->pack[k].x[i];
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane)
                wrong[lane] += fabs(x[lane] - began[i][lane]) <= PHI_UNLIKE * size[lane] ? 0.0 : HUGE_VAL;
        }
        phi_gain_lanes(bar->x[k][0], wrong);
        memcpy(group->pack[k].x, began, sizeof began);
    }
}

/* Pull the cotangents of all members back through all steps, and add those of output rows. */
static void phi_pull_back(phi_group *group, int count, const phi_pulled *all, size_t first, phi_back_group *bar)
{
    for (size_t end = all->steps; end > 0;) {
        const size_t begin = (end - 1) / PHI_SEGMENT * PHI_SEGMENT;
        for (; end > begin; --end) {
            phi_pull_joined(bar, count, all, first, end);
            for (int flow = PHI_FLOWS - 1; flow >= 0; --flow)
                phi_follow_back_lanes(phi_flow_part[flow], phi_flow_row[flow], group, bar);
        }
        phi_pull_arrive(group, all, begin, bar);
    }
}
#endif
