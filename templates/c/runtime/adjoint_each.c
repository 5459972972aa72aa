#ifndef PHI_FILE_ADJOINT_EACH
#define PHI_FILE_ADJOINT_EACH
#include <string.h>

#include "model.h"
#include "adjoint_groups.c"
#include "adjoint_members.c"

size_t phi_trail_size_each(void) { return PHI_TRAIL_EACH; }

phi_status phi_pullback_each(const phi_params *params, const double *x0, size_t members, PHI_OWN_POINTER const double *h,
    size_t steps, size_t stride, double *rows, const double *rows_bar, double *x0_bar, phi_params *params_bar,
    double *trail, unsigned char *status)
{
    phi_status result = PHI_OK;
    const int arguments_complete = x0 != NULL && h != NULL && rows_bar != NULL && x0_bar != NULL && trail != NULL && stride > 0;
    if (members > 0 && !arguments_complete) return PHI_BAD_ARGUMENT;
    PHI_ASK_FOR_OWN
    phi_pulled all;
    memset(&all, 0, sizeof all);
    all.params = params;
    all.x0 = x0;
    all.h = h;
    all.rows_bar = rows_bar;
    PHI_TAKE_OWN
    all.members = members;
    all.steps = steps;
    all.stride = stride;
    all.each = stride > 0 ? (steps + stride - 1) / stride * PHI_DIM : 0;
    all.rows = rows;
    all.x0_bar = x0_bar;
    all.tape = trail;
    all.params_bar = params_bar;
    all.status = status;
    for (size_t m = 0; m < members; m += PHI_BACK_MEMBERS) {
        const phi_status member = PHI_PULL_MEMBERS(&all, m);
        if (result == PHI_OK) result = member;
    }
    return result;
}
#endif
