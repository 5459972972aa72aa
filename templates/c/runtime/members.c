#ifndef PHI_FILE_MEMBERS
#define PHI_FILE_MEMBERS
#include <math.h>
#include <string.h>

#include "solver.h"
#include "model.h"
#include "blocks.c"
#include "solver.c"

/* ---- Members of an ensemble ---- */
/* Arguments of an ensemble. per_member = 1: member m has the parameters params[m] and the step h[m]; per_member = 0: all
   members have params[0] and h[0]. */
typedef struct {
    double *x;
    size_t members, steps, per_member;
    const phi_params *params; /* NULL for the defaults */
    const double *h;
#include "state_of_members.h"
    size_t stride; /* 0 without frames */
    double *frames; /* NULL for none */
    unsigned char *status; /* NULL for none */
} phi_members;

static phi_members phi_asked(const phi_params *params, double *x, size_t members, const double *h, size_t steps,
    unsigned char *status)
{
    phi_members all;
    memset(&all, 0, sizeof all);
    all.x = x;
    all.members = members;
    all.steps = steps;
    all.params = params;
    all.h = h;
    all.status = status;
    return all;
}

/* Initialise a solver for member m at the state x, with its parameters and all coefficients for its step size. */
static phi_status phi_begin_member(const phi_members *all, size_t m, const double x[PHI_DIM] PHI_AND_GAUGE(const double *gauge), phi_solver *s)
{
    const phi_params *params = all->params != NULL ? all->params + m * all->per_member : NULL;
    const phi_status status = PHI_INIT_OWN(s, params, x, all->t0[m * all->per_member], gauge);
    return status == PHI_OK ? phi_integrate(s, all->h[m * all->per_member], 0) : status;
}

/* Copy the state of member m from the ensemble to x, and initialise a solver for this member. */
static phi_status phi_take_member(const phi_members *all, size_t m, double x[PHI_DIM], phi_solver *s)
{
    for (size_t i = 0; i < PHI_DIM; ++i) x[i] = all->x[i * all->members + m];
    return phi_begin_member(all, m, x PHI_AND_GAUGE_OF(all, m), s);
}

/* Number of steps to the next frame, or to the end. */
static size_t phi_to_frame(const phi_members *all, size_t done)
{
    const size_t left = all->steps - done;
    return all->stride > 0 && all->stride - done % all->stride < left ? all->stride - done % all->stride : left;
}

/* If a frame is due after `done` steps, write x to it, or NaN if x is NULL: the member has failed. */
static void phi_put_frame(const phi_members *all, size_t m, size_t done, const double *x)
{
    for (size_t i = 0; i < PHI_DIM && all->frames != NULL && done % all->stride == 0; ++i)
        all->frames[((done / all->stride - 1) * PHI_DIM + i) * all->members + m] = x != NULL ? x[i] : (double)NAN;
}

#include "members_attitudes.c"

/* Make the remaining steps of member m alone; `done` steps are already made. `status` is the present status. */
static phi_status phi_end_member(const phi_members *all, size_t m, size_t done, phi_solver *s, phi_status status)
{
    while (done < all->steps) {
        const size_t steps = phi_to_frame(all, done);
        if (status == PHI_OK) status = phi_integrate(s, s->h, steps);
        done += steps;
        phi_put_frame(all, m, done, status == PHI_OK ? s->x : NULL);
        phi_put_attitude(all, m, done, status == PHI_OK ? s : NULL);
    }
    return status;
}

/* Write the final state of a member. */
static void phi_put_member(const phi_members *all, size_t m, const double x[PHI_DIM], phi_status status)
{
    for (size_t i = 0; i < PHI_DIM; ++i) all->x[i * all->members + m] = x[i];
    if (all->status != NULL) all->status[m] = (unsigned char)status;
}
#endif
