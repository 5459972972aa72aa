#ifndef PHI_FILE_BATCHES
#define PHI_FILE_BATCHES
#include <math.h>
#include <string.h>

#include "members.c"
#include "model.h"
#include "solver.c"
#include "lanes.c"

/* ---- SIMD batches of members: explicit steps ---- */
enum {
    PHI_PACK_COUNT = 4, /* batches in a group: while one waits for results, the processor works on the others */
    PHI_GROUP = PHI_PACK_COUNT * PHI_LANES,
    PHI_STRETCH = 32   /* steps between checks for finite values */
};

/* One SIMD batch: a member in each lane. */
typedef struct {
    phi_lanes x[PHI_DIM], carry[PHI_DIM];
#if PHI_SPLITTING
    phi_lanes start[PHI_DIM]; /* x at the start of the step; carry holds the sum of the increments since then */
#endif
} phi_pack;

/* A group of SIMD batches. */
typedef struct {
    phi_pack pack[PHI_PACK_COUNT];
    phi_lanes PHI_OF(coef[PHI_PACK_COUNT], PHI_STAGES)[PHI_COEFFICIENTS];
    int packs;    /* number of batches in use */
    int distinct_coef;      /* whether members have different coefficients */
    int prepared; /* whether coefficients that all members share have been computed */
#if PHI_FULL_RANGE
    int full_range; /* whether an argument is too large for the fast functions, which need small arguments */
#endif
    int active[PHI_GROUP];       /* whether the lane holds a member that has not failed */
    size_t steps_left[PHI_GROUP]; /* number of steps that the member has still to make */
} phi_group;

/* Add `change` to one coordinate within a step, in all lanes. `displacement` is the sum of the changes so far. */
static inline void phi_add_lanes(double x[restrict PHI_LANES], double displacement[restrict PHI_LANES],
    const double start[restrict PHI_LANES], const double change[restrict PHI_LANES])
{
    PHI_EACH_LANE
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        displacement[lane] += change[lane];
        x[lane] = start[lane] + displacement[lane];
    }
}

/* At the end of a step, add the displacement in `carry` to one coordinate, in all lanes; `carry` receives the rounding
   error. */
static inline void phi_settle_lanes(double x[restrict PHI_LANES], double carry[restrict PHI_LANES],
    const double start[restrict PHI_LANES])
{
    PHI_EACH_LANE
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        const double displacement = carry[lane], sum = start[lane] + displacement, added = sum - start[lane];
        carry[lane] = (start[lane] - (sum - added)) + (displacement - added);
        x[lane] = sum;
    }
}

#include "model_lanes.h"

#include "batches_explicit.c"
#include "batches_splitting.c"

#if PHI_FULL_RANGE
/* Make steps of a group with functions that accept arguments of any size. */
PHI_APART static void phi_steps_full_range_lanes(phi_group *group, int steps)
{
    for (int step = 0; step < steps; ++step) {
        phi_begin_lanes(group);
        phi_flows_full_range_lanes(0, 1, group); /* correct for equal coefficients too */
        phi_end_lanes(group);
    }
}

#endif
/* Number of active members with values that are not finite; lost[m] is 1 for these members. */
static int phi_group_lost(const phi_group *group, int lost[PHI_GROUP])
{
    int count = 0;
    for (int m = 0; m < PHI_GROUP; ++m) {
        int finite = 1;
        for (int i = 0; i < PHI_DIM; ++i)
            finite = finite && isfinite(group->pack[m / PHI_LANES].x[i][m % PHI_LANES]);
        lost[m] = group->active[m] && !finite;
        count += lost[m];
    }
    return count;
}

static void phi_pack_copy(phi_pack *to, const phi_pack *from, int lane)
{
    for (int i = 0; i < PHI_DIM; ++i) {
        to->x[i][lane] = from->x[i][lane];
        to->carry[i][lane] = from->carry[i][lane];
    }
}

/* Make some steps of all members, with fast functions, which give NaN if an argument is too large. */
static void phi_group_advance(phi_group *group, int steps)
{
    if (group->distinct_coef) phi_steps_lanes(1, group, steps);
    else phi_steps_lanes(0, group, steps);
}

/* Make some steps of all members. A member whose values are not finite gets its state before these steps, and becomes
   inactive. Returns the number of active members. */
static int phi_group_steps(phi_group *group, int steps)
{
    phi_pack before[PHI_PACK_COUNT];
    int lost[PHI_GROUP], active = 0;
    memcpy(before, group->pack, sizeof before);
#if PHI_FULL_RANGE
    if (!group->full_range) phi_group_advance(group, steps);
    if (group->full_range || phi_group_lost(group, lost) > 0) {
        memcpy(group->pack, before, sizeof before);
        phi_steps_full_range_lanes(group, steps);
        group->full_range = phi_group_lost(group, lost) == 0;
    }
#else
    phi_group_advance(group, steps);
    phi_group_lost(group, lost);
#endif
    for (int m = 0; m < PHI_GROUP; ++m) {
        const int pack = m / PHI_LANES;
        group->active[m] = group->active[m] && !lost[m];
        if (group->active[m]) group->steps_left[m] -= (size_t)steps;
        else phi_pack_copy(&group->pack[pack], &before[pack], m % PHI_LANES);
        active += group->active[m];
    }
    return active;
}

/* Assign a member to a lane, with its coefficients. If all members share their coefficients, the first member sets them. */
static phi_status phi_group_join(phi_group *group, int m, const phi_members *all, size_t first)
{
    phi_solver s;
    double x[PHI_DIM];
    phi_pack *pack = &group->pack[m / PHI_LANES];
    const int lane = m % PHI_LANES;
    const int from = all->per_member ? m : 0, to = all->per_member ? m + 1 : PHI_GROUP;
    phi_status status = PHI_OK;
    if (group->prepared) {
        for (size_t i = 0; i < PHI_DIM; ++i) x[i] = all->x[i * all->members + first + (size_t)m];
        if (!phi_finite(x, PHI_DIM)) status = PHI_BAD_ARGUMENT;
    } else {
        status = phi_take_member(all, first + (size_t)m, x, &s);
    }
    for (int i = 0; i < PHI_DIM; ++i) pack->x[i][lane] = x[i];
    group->steps_left[m] = all->steps;
    group->active[m] = status == PHI_OK;
    if (status != PHI_OK || group->prepared) return status;
    PHI_EACH_STAGE
        for (int k = 0; k < PHI_COEFFICIENTS; ++k)
            for (int j = from; j < to; ++j) PHI_OF(group->coef[j / PHI_LANES], stage)[k][j % PHI_LANES] = PHI_OF(s.coef, stage)[k];
    group->prepared = !all->per_member;
    return PHI_OK;
}

/* Write the states of active members to their frames, if frames are due after `done` steps. */
static void phi_group_frame(const phi_group *group, const phi_members *all, size_t first, size_t done)
{
    double x[PHI_DIM];
    for (int m = 0; m < PHI_GROUP; ++m) {
        for (int i = 0; i < PHI_DIM; ++i) x[i] = group->pack[m / PHI_LANES].x[i][m % PHI_LANES];
        if (group->active[m]) phi_put_frame(all, first + (size_t)m, done, x);
    }
}

/* Write the results of a member. Steps that it did not make in the group are made first, one by one. */
static phi_status phi_group_end(const phi_group *group, int m, const phi_members *all, size_t first,
    phi_status status)
{
    const phi_pack *pack = &group->pack[m / PHI_LANES];
    const size_t done = all->steps - group->steps_left[m];
    phi_solver s;
    double x[PHI_DIM];
    for (int i = 0; i < PHI_DIM; ++i) x[i] = pack->x[i][m % PHI_LANES];
    if (status != PHI_OK) {
        phi_end_member(all, first + (size_t)m, done, NULL, status);
    } else if (done < all->steps) {
        const phi_status begun = phi_begin_member(all, first + (size_t)m, x, &s);
        for (int i = 0; i < PHI_DIM && begun == PHI_OK; ++i) s.carry[i] = pack->carry[i][m % PHI_LANES];
        status = phi_end_member(all, first + (size_t)m, done, &s, begun);
        if (begun == PHI_OK) memcpy(x, s.x, sizeof x);
    }
    phi_put_member(all, first + (size_t)m, x, status);
    return status;
}

/* Integrate one group, which begins with member number `first`. Returns the first status that is not OK. */
PHI_APART static phi_status phi_group_run(const phi_members *all, size_t first)
{
    phi_group group;
    phi_status result = PHI_OK, begun[PHI_GROUP];
    const int count = all->members - first < PHI_GROUP ? (int)(all->members - first) : PHI_GROUP;
    memset(&group, 0, sizeof group);
    group.packs = (count + PHI_LANES - 1) / PHI_LANES;
    group.distinct_coef = (int)all->per_member;
    for (int m = 0; m < count; ++m) begun[m] = phi_group_join(&group, m, all, first);
    int active = count > 1; /* measured: a single member is faster by itself */
    for (size_t done = 0; done < all->steps && active > 0;) {
        const size_t next = phi_to_frame(all, done);
        const int stretch = next < PHI_STRETCH ? (int)next : PHI_STRETCH;
        active = phi_group_steps(&group, stretch);
        done += (size_t)stretch;
        if (all->frames != NULL) phi_group_frame(&group, all, first, done);
    }
    for (int m = 0; m < count; ++m) {
        const phi_status status = phi_group_end(&group, m, all, first, begun[m]);
        if (result == PHI_OK) result = status;
    }
    return result;
}
#endif
