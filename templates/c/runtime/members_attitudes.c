#ifndef PHI_FILE_MEMBERS_ATTITUDES
#define PHI_FILE_MEMBERS_ATTITUDES
#include <math.h>
#include <string.h>
#include "members.c"

/* If a frame is due after `done` steps, write the attitude of a member to it, or NaN if s is NULL. */
static void phi_put_attitude(const phi_members *all, size_t m, size_t done, const phi_solver *s)
{
    double element[PHI_ELEMENT];
    if (all->attitudes == NULL || done % all->stride != 0) return;
    if (s != NULL) phi_attitude(s, element);
    for (size_t i = 0; i < PHI_ELEMENT; ++i)
        all->attitudes[((done / all->stride - 1) * PHI_ELEMENT + i) * all->members + m] = s != NULL ? element[i] : (double)NAN;
}
#endif
