#ifndef PHI_FILE_ADJOINT_GROUPS_PARAMETERS
#define PHI_FILE_ADJOINT_GROUPS_PARAMETERS
#include <string.h>

#include "adjoint_members.c"

#if PHI_MONITOR
/* Add the derivatives of L by the parameters of a member and by its energy level. */
#else
/* Add the derivatives of L by the parameters of a member. */
#endif
static void phi_pull_parameters(const phi_pulled *all, const phi_cotangent *bar, size_t at PHI_AND_GAUGE(const double *gauge))
{
    phi_params *params_bar_of_m = all->params_bar != NULL ? all->params_bar + at : NULL;
    phi_solver s;
    memset(&s, 0, sizeof s);
    s.h = all->h[at];
    s.params = all->params != NULL ? all->params[at] : phi_default_params;
    PHI_COPY_GAUGE(s.gauge, gauge)
    PHI_E_BAR_FROM_ZERO
    phi_add_by_parameters(&s, bar, params_bar_of_m PHI_AND_TO_E_BAR);
    phi_pull_level(all, at, e_bar);
}
#endif
