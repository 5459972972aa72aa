#ifndef PHI_FILE_ADJOINT_MEMBERS
#define PHI_FILE_ADJOINT_MEMBERS
#include "adjoint.c"
#include "model.h"
#include "solver.c"

/* Arguments of phi_pullback_each. each: number of doubles in the output rows of one member of the ensemble. */
typedef struct {
    const phi_params *params;
    const double *x0, *h, *rows_bar;
#include "state_of_pulled.h"
    size_t members, steps, stride, each;
    double *rows, *x0_bar, *tape;
    phi_params *params_bar;
    unsigned char *status;
} phi_pulled;

/* Initialise the solver of one member at its initial state. */
static phi_status phi_pull_begin(const phi_pulled *all, size_t m, phi_solver *s)
{
    const phi_params *params = all->params != NULL ? all->params + m : NULL;
    const double *x0 = all->x0 + m * PHI_DIM;
    return PHI_INIT_OWN(s, params, x0, all->t0[m], all->gauge != NULL ? all->gauge + m * PHI_GAUGES : NULL);
}

#include "adjoint_members_level.c"

/* Make the steps of member m and their reverse pass, outside of batches. */
static phi_status phi_pull_member(const phi_pulled *all, size_t m)
{
    const double *rows_bar = all->rows_bar + m * all->each;
    double *rows = all->rows != NULL ? all->rows + m * all->each : NULL, *bar = all->x0_bar + m * PHI_DIM;
    phi_params *params_bar_of_m = all->params_bar != NULL ? all->params_bar + m : NULL;
    phi_solver s;
    phi_status status = phi_pull_begin(all, m, &s);
    PHI_E_BAR_FROM_ZERO
    if (status == PHI_OK)
        status = phi_pullback(&s, all->h[m], all->steps, all->stride, rows, rows_bar, bar, params_bar_of_m PHI_AND_TO_E_BAR, all->tape);
    if (status == PHI_OK) phi_pull_level(all, m, e_bar);
    if (all->status != NULL) all->status[m] = (unsigned char)status;
    return status;
}
#endif
