#ifndef PHI_FILE_ADJOINT_MEMBERS_LEVEL
#define PHI_FILE_ADJOINT_MEMBERS_LEVEL
#include "adjoint_members.c"

/* Add the derivatives that act through the energy level e of a member to those by its initial state and parameters, unless
   the caller gives e. */
static void phi_pull_level(const phi_pulled *all, size_t m, double e_bar)
{
    const phi_params *params = all->params != NULL ? all->params + m : NULL;
    phi_params unused = phi_default_params, *params_bar_of_m = all->params_bar != NULL ? all->params_bar + m : &unused;
    if (all->gauge == NULL) phi_level_bar(params, all->x0 + m * PHI_DIM, e_bar, all->x0_bar + m * PHI_DIM, params_bar_of_m);
}
#endif
