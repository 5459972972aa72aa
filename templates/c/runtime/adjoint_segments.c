#ifndef PHI_FILE_ADJOINT_SEGMENTS
#define PHI_FILE_ADJOINT_SEGMENTS
#include <math.h>
#include <string.h>

#include "adjoint_abreast.c"
#include "model.h"

/* Splittings are gone back through segment by segment. The states where segments begin are left in the trail. */
#if PHI_UNDONE
/* On the way back flows are undone: each over -h, with the functions that its transpose reads. What rounding adds is left
   behind where the segment begins. */
#define PHI_UNLIKE 1e-13 /* states are other ones, in sizes of the state */
#else
/* The states before each flow of a segment are made again, and stay near. */
#endif
#include "adjoint_flows_lanes.h"

#if PHI_FAR
/* Whether all values are finite. */
static int phi_pull_finite(const phi_group *group)
{
    phi_lanes sum = { 0.0 };
    for (int k = 0; k < group->packs; ++k)
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) sum[lane] += 0.0 * group->pack[k].x[i][lane];
        }
    return phi_finite(sum, PHI_LANES);
}

/* Make all steps, and leave where segments begin, but for the first. Where values are not finite, begin once more, by ways
   that are for larger arguments of functions. */
#else
/* Make all steps, and leave where segments begin, but for the first. */
#endif
static int phi_pull_forth(phi_group *group, int count, const phi_pulled *all, size_t first, phi_back_group *bar)
{
    double *trail = all->trail;
    memcpy(bar->start, group->pack, sizeof bar->start);
    for (size_t done = 0; done < all->steps;) {
        const size_t to_row = all->stride - done % all->stride, to_segment = PHI_SEGMENT - done % PHI_SEGMENT;
        size_t until = to_row < to_segment ? to_row : to_segment;
        if (all->steps - done < until) until = all->steps - done;
        for (int k = 0; k < group->packs && done > 0 && done % PHI_SEGMENT == 0; ++k) {
            memcpy(trail, group->pack[k].x, sizeof group->pack[k].x);
            memcpy(trail + PHI_DIM * PHI_LANES, group->pack[k].carry, sizeof group->pack[k].carry);
            trail += 2 * PHI_DIM * PHI_LANES;
        }
#if PHI_FAR
        if (group->far) phi_steps_far_lanes(group, (int)until);
        else phi_steps_lanes(1, group, (int)until);
        if (!group->far && !phi_pull_finite(group)) {
            memcpy(group->pack, bar->start, sizeof bar->start);
            trail = all->trail;
            done = 0;
            group->far = 1;
            continue;
        }
#else
        phi_steps_lanes(1, group, (int)until);
#endif
        done += until;
        phi_pull_rows(group, count, all, first, done);
    }
    return 1;
}

/* Where a segment begins: its states, and what adding them has lost. */
static const double *phi_pull_left(const phi_group *group, int k, const phi_pulled *all, size_t begin)
{
    return all->trail + ((begin / PHI_SEGMENT - 1) * (size_t)group->packs + (size_t)k) * 2 * PHI_DIM * PHI_LANES;
}

#if PHI_UNDONE
/* Stand where a segment begins, of which all steps have been undone. Cotangents of members for which that has led to another
   state become infinite. */
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

/* Pull the cotangents of rows back through all steps. */
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
#else
/* Make steps once more, and keep what is needed of the states before each flow. */
static void phi_pull_again(phi_group *group, int steps, phi_back_group *bar)
{
    for (int step = 0; step < steps; ++step) {
        phi_begin_lanes(group);
        for (int flow = 0; flow < PHI_FLOWS; ++flow)
            phi_follow_lanes(phi_flow_part[flow], phi_flow_row[flow], group, bar->kept[step][flow]);
        phi_end_lanes(group);
    }
}

/* Pull the cotangents of rows back through all steps. */
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
                phi_follow_back_lanes(phi_flow_part[flow], phi_flow_row[flow], group, bar->kept[end - begin - 1][flow], bar);
        }
    }
}
#endif
#endif
