#ifndef PHI_FILE_ADJOINT_STORED
#define PHI_FILE_ADJOINT_STORED
#include <string.h>

#include "adjoint_batches.c"
#include "model.h"

#if PHI_EXPLICIT
/* The tape holds the states before all stages of all steps, so no step is repeated. */
#else
/* The tape holds the solutions of the equations of all stages of all steps, so no step is repeated. */
#endif
enum { PHI_POINT = PHI_DIM * PHI_LANES }; /* doubles on the tape for one point in all lanes */

#include "adjoint_stored_groups.c"
#include "adjoint_stored_batches.c"

/* Make all steps and write the tape. Returns 0 if too few members remain active. */
static int phi_pull_forth(phi_group *group, int count, const phi_pulled *all, size_t first)
{
    double *tape = all->tape;
    for (size_t done = 0; done < all->steps;) {
        tape = phi_pull_step(group, all->steps - done, tape);
        if (tape == NULL) return 0;
        phi_pull_rows(group, count, all, first, ++done);
    }
    return 1;
}

#include "adjoint_stored_explicit.c"
#include "adjoint_stored_implicit.c"

#include "adjoint_stored_back_groups.c"
#include "adjoint_stored_back_batches.c"
#endif
