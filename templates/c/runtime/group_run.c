#ifndef PHI_FILE_GROUP_RUN
#define PHI_FILE_GROUP_RUN
#include <string.h>

#include "gauss_members.c"
#include "groups.c"
#include "members.c"
#include "model.h"

/* Write the states of active members to their frames, if frames are due after `done` steps. */
static void phi_group_frame(const phi_group *group, const phi_members *all, size_t first, size_t done)
{
    double x[PHI_DIM];
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        for (int i = 0; i < PHI_DIM; ++i) x[i] = group->x[i][lane];
        if (group->active[lane]) phi_put_frame(all, first + (size_t)lane, done, x);
    }
}

/* Write the results of a member. Steps that it did not make in the group are made first, one by one. */
static phi_status phi_group_end(const phi_group *group, int lane, const phi_members *all, size_t m,
    phi_status status)
{
    phi_solver s;
    double x[PHI_DIM];
    for (int i = 0; i < PHI_DIM; ++i) x[i] = group->x[i][lane];
    if (status != PHI_OK) {
        phi_end_member(all, m, 0, NULL, status);
    } else if (group->steps_left[lane] > 0) {
        const phi_status begun = phi_begin_member(all, m, x PHI_AND_GAUGE(group->gauge[lane]), &s);
        for (int i = 0; i < PHI_DIM && begun == PHI_OK; ++i) s.carry[i] = group->carry[i][lane];
#if PHI_TIMED
        if (begun == PHI_OK) s.steps = all->steps - group->steps_left[lane];
        if (begun == PHI_OK) s.t = s.t_before_h + (double)s.steps * s.h;
#endif
        status = phi_end_member(all, m, all->steps - group->steps_left[lane], &s, begun);
        if (begun == PHI_OK) memcpy(x, s.x, sizeof x);
    }
    phi_put_member(all, m, x, status);
    return status;
}

/* Integrate one group, which begins with member number `first`. Returns the first status that is not OK. */
static phi_status phi_group_run(const phi_members *all, size_t first)
{
    phi_group group;
    phi_status result = PHI_OK, begun[PHI_LANES];
    const int count = all->members - first < PHI_LANES ? (int)(all->members - first) : PHI_LANES;
    size_t left = all->steps;
    memset(&group, 0, sizeof group);
    for (int lane = 0; lane < count; ++lane) begun[lane] = phi_group_join(&group, lane, all, first + (size_t)lane);
    for (int active = count; left > 0 && active >= PHI_FEWEST;) {
        active = phi_group_step(&group, left--);
        if (all->frames != NULL) phi_group_frame(&group, all, first, all->steps - left);
    }
    for (int lane = 0; lane < count; ++lane) {
        if (group.active[lane]) group.steps_left[lane] = left;
        const phi_status status = phi_group_end(&group, lane, all, first + (size_t)lane, begun[lane]);
        if (result == PHI_OK) result = status;
    }
    return result;
}
#endif
