#ifndef PHI_FILE_ADJOINT_MEMBERS
#define PHI_FILE_ADJOINT_MEMBERS
#include "adjoint.c"
#include "model.h"
#include "solver.c"

/* What phi_pullback_each was asked for; each is how many numbers the rows of a member have. */
typedef struct {
    const phi_params *params;
    const double *x0, *h, *rows_bar;
#if PHI_TIMED
    const double *t0;
#elif PHI_GAUGE
    const double *gauge;
#endif
    size_t members, steps, stride, each;
    double *rows, *x0_bar, *trail;
    phi_params *params_bar;
    unsigned char *status;
} phi_pulled;

/* Start a member where it begins. */
static phi_status phi_pull_begin(const phi_pulled *all, size_t m, phi_solver *s)
{
    const phi_params *params = all->params != NULL ? all->params + m : NULL;
    const double *x0 = all->x0 + m * PHI_DIM;
    return PHI_INIT_OWN(s, params, x0, all->t0[m], all->gauge != NULL ? all->gauge + m * PHI_GAUGES : NULL);
}

#if PHI_MONITOR
/* Add to what was found for a member what the derivative along e adds, where e follows its start. */
static void phi_pull_level(const phi_pulled *all, size_t m, double e_bar)
{
    const phi_params *params = all->params != NULL ? all->params + m : NULL;
    phi_params unused = phi_default_params, *own_bar = all->params_bar != NULL ? all->params_bar + m : &unused;
    if (all->gauge == NULL) phi_level_bar(params, all->x0 + m * PHI_DIM, e_bar, all->x0_bar + m * PHI_DIM, own_bar);
}

#endif
/* Pull a member back by itself. */
static phi_status phi_pull_member(const phi_pulled *all, size_t m)
{
    const double *rows_bar = all->rows_bar + m * all->each;
    double *rows = all->rows != NULL ? all->rows + m * all->each : NULL, *bar = all->x0_bar + m * PHI_DIM;
    phi_params *own_bar = all->params_bar != NULL ? all->params_bar + m : NULL;
    phi_solver s;
    phi_status status = phi_pull_begin(all, m, &s);
#if PHI_MONITOR
    double e_bar = 0.0;
    if (status == PHI_OK)
        status = phi_pullback(&s, all->h[m], all->steps, all->stride, rows, rows_bar, bar, own_bar, &e_bar, all->trail);
    if (status == PHI_OK) phi_pull_level(all, m, e_bar);
#else
    if (status == PHI_OK)
        status = phi_pullback(&s, all->h[m], all->steps, all->stride, rows, rows_bar, bar, own_bar, all->trail);
#endif
    if (all->status != NULL) all->status[m] = (unsigned char)status;
    return status;
}
#endif
