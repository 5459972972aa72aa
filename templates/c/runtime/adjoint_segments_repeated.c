#ifndef PHI_FILE_ADJOINT_SEGMENTS_REPEATED
#define PHI_FILE_ADJOINT_SEGMENTS_REPEATED
#include <string.h>

#include "adjoint_segments.c"

/* Repeat the steps of a segment, and write the state before each flow to the tape. */
static void phi_pull_again(phi_group *group, int steps, phi_back_group *bar)
{
    for (int step = 0; step < steps; ++step) {
        phi_begin_lanes(group);
        for (int flow = 0; flow < PHI_FLOWS; ++flow)
            phi_follow_lanes(phi_flow_part[flow], phi_flow_row[flow], group, bar->stored[step][flow]);
        phi_end_lanes(group);
    }
}

/* Pull the cotangents of all members back through all steps, and add those of output rows. */
static void phi_pull_back(phi_group *group, int count, const phi_pulled *all, size_t first, phi_back_group *bar)
{
    for (size_t end = all->steps; end > 0;) {
        const size_t begin = (end - 1) / PHI_SEGMENT * PHI_SEGMENT;
        for (int k = 0; k < group->packs; ++k) {
            group->pack[k] = bar->start[k];
            if (begin == 0) continue;
            const double *left = phi_pull_left(group, k, all, begin);
            memcpy(group->pack[k].x, left, sizeof group->pack[k].x);
            memcpy(group->pack[k].carry, left + PHI_DIM * PHI_LANES, sizeof group->pack[k].carry);
        }
        phi_pull_again(group, (int)(end - begin), bar);
        for (; end > begin; --end) {
            phi_pull_joined(bar, count, all, first, end);
            for (int flow = PHI_FLOWS - 1; flow >= 0; --flow)
                phi_follow_back_lanes(phi_flow_part[flow], phi_flow_row[flow], group, bar->stored[end - begin - 1][flow], bar);
        }
    }
}
#endif
