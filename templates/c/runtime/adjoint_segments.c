#ifndef PHI_FILE_ADJOINT_SEGMENTS
#define PHI_FILE_ADJOINT_SEGMENTS
#include <math.h>
#include <string.h>

#include "adjoint_batches.c"
#include "model.h"

/* The reverse pass of splittings divides a run into segments of PHI_SEGMENT steps. The tape holds the states at the starts
   of the segments. */
#include "adjoint_flows_lanes.h"

#include "adjoint_segments_full_range.c"
#include "adjoint_segments_near.c"

/* Make all steps, and write the states at the starts of all segments but the first to the tape. */
static int phi_pull_forth(phi_group *group, int count, const phi_pulled *all, size_t first, phi_back_group *bar)
{
    double *tape = all->tape;
    memcpy(bar->start, group->pack, sizeof bar->start);
    for (size_t done = 0; done < all->steps;) {
        const size_t to_row = all->stride - done % all->stride, to_segment = PHI_SEGMENT - done % PHI_SEGMENT;
        size_t until = to_row < to_segment ? to_row : to_segment;
        if (all->steps - done < until) until = all->steps - done;
        for (int k = 0; k < group->packs && done > 0 && done % PHI_SEGMENT == 0; ++k) {
            memcpy(tape, group->pack[k].x, sizeof group->pack[k].x);
            memcpy(tape + PHI_DIM * PHI_LANES, group->pack[k].carry, sizeof group->pack[k].carry);
            tape += 2 * PHI_DIM * PHI_LANES;
        }
        if (!phi_pull_steps(group, (int)until, bar)) {
            tape = all->tape;
            done = 0;
            continue;
        }
        done += until;
        phi_pull_rows(group, count, all, first, done);
    }
    return 1;
}

/* Where the tape holds batch k at the start of a segment: its states, then its compensation terms. The segment begins
   after `begin` steps. */
static const double *phi_pull_left(const phi_group *group, int k, const phi_pulled *all, size_t begin)
{
    return all->tape + ((begin / PHI_SEGMENT - 1) * (size_t)group->packs + (size_t)k) * 2 * PHI_DIM * PHI_LANES;
}

#include "adjoint_segments_inverse.c"
#include "adjoint_segments_repeated.c"
#endif
