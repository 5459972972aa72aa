#ifndef PHI_FILE_FIRST_FAILURE
#define PHI_FILE_FIRST_FAILURE
#include "model.h"

/* Set *result to the status of member m if this is a failure and no member with a smaller number has failed. *earliest
   is the smallest number of a failed member so far. */
static void phi_report_first(phi_status status, size_t m, size_t *earliest, phi_status *result)
{
    if (status == PHI_OK) return;
#ifdef _OPENMP
#pragma omp critical
#endif
    if (m < *earliest) {
        *earliest = m;
        *result = status;
    }
}
#endif
