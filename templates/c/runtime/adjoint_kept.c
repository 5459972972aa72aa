#ifndef PHI_FILE_ADJOINT_KEPT
#define PHI_FILE_ADJOINT_KEPT
#include <string.h>

#include "adjoint_abreast.c"
#include "model.h"

/* The tape holds the starting points of explicit stages, or the solutions of implicit ones, of all steps. So no step is
   repeated. */
enum { PHI_POINT = PHI_DIM * PHI_LANES }; /* doubles on the tape for one point in all lanes */

#include "adjoint_kept_groups.c"
#include "adjoint_kept_packs.c"

/* Make all steps and write the tape. Returns 0 if too few members remain active. */
static int phi_pull_forth(phi_group *group, int count, const phi_pulled *all, size_t first)
{
    double *trail = all->trail;
    for (size_t done = 0; done < all->steps;) {
        trail = phi_pull_step(group, all->steps - done, trail);
        if (trail == NULL) return 0;
        phi_pull_rows(group, count, all, first, ++done);
    }
    return 1;
}

#include "adjoint_kept_explicit.c"
#include "adjoint_kept_implicit.c"

#include "adjoint_kept_back_groups.c"
#include "adjoint_kept_back_packs.c"
#endif
