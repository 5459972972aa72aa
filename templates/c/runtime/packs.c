#ifndef PHI_FILE_PACKS
#define PHI_FILE_PACKS
#include <math.h>
#include <string.h>

#include "lanes.c"
#include "model.h"
#include "solver.c"

/* ---- Packs of members ---- */
enum {
    PHI_PACK_COUNT = 4, /* in a group: while one waits for a result, the others are worked at */
    PHI_GROUP = PHI_PACK_COUNT * PHI_LANES,
    PHI_STRETCH = 32   /* steps before the members are looked at: what is not finite stays so */
};

/* Members of an ensemble, one in each lane. */
typedef struct {
    phi_lanes x[PHI_DIM], carry[PHI_DIM];
#if PHI_SPLITTING
    phi_lanes start[PHI_DIM]; /* x where a step began; in it, carry is moved */
#endif
} phi_pack;

#if PHI_SPLITTING
/* phi_add for one coordinate in all lanes. */
static inline void phi_add_lanes(double x[restrict PHI_LANES], double moved[restrict PHI_LANES],
    const double start[restrict PHI_LANES], const double change[restrict PHI_LANES])
{
    PHI_EACH_LANE
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        moved[lane] += change[lane];
        x[lane] = start[lane] + moved[lane];
    }
}

/* phi_settle for one coordinate in all lanes. */
static inline void phi_settle_lanes(double x[restrict PHI_LANES], double carry[restrict PHI_LANES],
    const double start[restrict PHI_LANES])
{
    PHI_EACH_LANE
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        const double moved = carry[lane], sum = start[lane] + moved, added = sum - start[lane];
        carry[lane] = (start[lane] - (sum - added)) + (moved - added);
        x[lane] = sum;
    }
}

#endif
#include "model_lanes.h"

#if PHI_EXPLICIT
/* phi_stage for the members of a pack; the sums are those of phi_advance. */
static inline void phi_stage_lanes(const double *coef, phi_pack *pack)
{
    phi_lanes increment[PHI_DIM];
    phi_explicit_lanes(coef, pack->x, increment);
    for (int i = 0; i < PHI_DIM; ++i) {
        double *x = pack->x[i], *carry = pack->carry[i];
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double change = increment[i][lane], sum = x[lane] + change, added = sum - x[lane];
            const double small = ((x[lane] - (sum - added)) + (change - added)) + carry[lane];
            x[lane] = sum + small;
            carry[lane] = small - (x[lane] - sum);
        }
    }
}

/* Steps of some packs: each stage for all of them. */
static void phi_steps_lanes(const phi_solver *s, phi_pack *pack, int packs, int steps)
{
    for (int step = 0; step < steps; ++step)
        for (int stage = 0; stage < PHI_STAGES; ++stage)
            for (int k = 0; k < packs; ++k) phi_stage_lanes(s->coef[stage], &pack[k]);
}

#else
/* Steps of some packs: as in phi_stages, each flow for all of them. */
static void phi_steps_lanes(const phi_solver *s, phi_pack *pack, int packs, int steps)
{
    for (int step = 0; step < steps; ++step) {
        for (int k = 0; k < packs; ++k) memcpy(pack[k].start, pack[k].x, sizeof pack[k].x);
        phi_flows_lanes(s->coef[0], pack, packs);
        for (int k = 0; k < packs; ++k)
            for (int i = 0; i < PHI_DIM; ++i) phi_settle_lanes(pack[k].x[i], pack[k].carry[i], pack[k].start[i]);
    }
}

#endif
#if PHI_FAR
/* The same where arguments of functions are too large for polynomials. */
static void phi_steps_far_lanes(const phi_solver *s, phi_pack *pack, int packs, int steps)
{
    for (int step = 0; step < steps; ++step) {
        for (int k = 0; k < packs; ++k) memcpy(pack[k].start, pack[k].x, sizeof pack[k].x);
        phi_flows_far_lanes(s->coef[0], pack, packs);
        for (int k = 0; k < packs; ++k)
            for (int i = 0; i < PHI_DIM; ++i) phi_settle_lanes(pack[k].x[i], pack[k].carry[i], pack[k].start[i]);
    }
}

#endif
/* Members of an ensemble, in packs. */
typedef struct {
    phi_solver s; /* parameters and coefficients, the same for all */
    phi_pack pack[PHI_PACK_COUNT];
    int packs; /* in use */
#if PHI_FAR
    int far; /* whether arguments of functions are too large for polynomials */
#endif
    int active[PHI_GROUP];       /* whether there is such a member, and it has not left */
    size_t steps_left[PHI_GROUP]; /* that it has still to make */
} phi_group;

/* How many active members have values that are not finite, and which. */
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

/* Some steps of all members. One whose values are not finite then leaves, with its state before them. How many remain. */
static int phi_group_steps(phi_group *group, int steps)
{
    phi_pack before[PHI_PACK_COUNT];
    int lost[PHI_GROUP], active = 0;
    memcpy(before, group->pack, sizeof before);
#if PHI_FAR
    if (!group->far) phi_steps_lanes(&group->s, group->pack, group->packs, steps);
    if (group->far || phi_group_lost(group, lost) > 0) {
        memcpy(group->pack, before, sizeof before);
        phi_steps_far_lanes(&group->s, group->pack, group->packs, steps);
        group->far = phi_group_lost(group, lost) == 0;
    }
#else
    phi_steps_lanes(&group->s, group->pack, group->packs, steps);
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

/* The end of a member: if it left the group, by its remaining steps, one by one. */
static phi_status phi_group_end(const phi_group *group, int m, double h, double x[PHI_DIM])
{
    const phi_pack *pack = &group->pack[m / PHI_LANES];
    phi_solver s = group->s;
    for (int i = 0; i < PHI_DIM; ++i) {
        s.x[i] = pack->x[i][m % PHI_LANES];
        s.carry[i] = pack->carry[i][m % PHI_LANES];
    }
    const phi_status status = phi_integrate(&s, h, group->steps_left[m]);
    memcpy(x, s.x, sizeof s.x);
    return status;
}

/* The members from first on, as many as a group holds. The first status that is not OK. */
PHI_APART static phi_status phi_group_run(
    const phi_params *params, double *x, size_t members, size_t first, double h, size_t steps,
    unsigned char *status)
{
    phi_group group;
    phi_status worst = PHI_OK, member[PHI_GROUP];
    const int count = members - first < PHI_GROUP ? (int)(members - first) : PHI_GROUP;
    double state[PHI_DIM];
    memset(&group, 0, sizeof group);
    group.packs = (count + PHI_LANES - 1) / PHI_LANES;
    for (int m = 0; m < count; ++m) {
        for (size_t i = 0; i < PHI_DIM; ++i) state[i] = x[i * members + first + (size_t)m];
        for (int i = 0; i < PHI_DIM; ++i) group.pack[m / PHI_LANES].x[i][m % PHI_LANES] = state[i];
        member[m] = phi_init(&group.s, params, state);
        group.active[m] = member[m] == PHI_OK;
        group.steps_left[m] = steps;
    }
    int active = phi_set_step(&group.s, h) == PHI_OK;
    if (count == 1) active = 0; /* one alone is quicker without lanes */
    for (size_t left = steps; left > 0 && active > 0;) {
        const int stretch = left < PHI_STRETCH ? (int)left : PHI_STRETCH;
        active = phi_group_steps(&group, stretch);
        left -= (size_t)stretch;
    }
    for (int m = 0; m < count; ++m) {
        if (member[m] == PHI_OK) {
            member[m] = phi_group_end(&group, m, h, state);
            for (size_t i = 0; i < PHI_DIM; ++i) x[i * members + first + (size_t)m] = state[i];
        }
        if (status != NULL) status[first + (size_t)m] = (unsigned char)member[m];
        if (worst == PHI_OK) worst = member[m];
    }
    return worst;
}
#endif
