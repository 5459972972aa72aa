#ifndef PHI_FILE_LATTICE_KICKS
#define PHI_FILE_LATTICE_KICKS
#include "lattice.h"
#include "model.h"
#include "rows.c"

#include "lattice_level_of_state.c"

/* Set the state to x + factor * (present state), if all values are finite. */
static phi_status phi_move(phi_solver *s, const double *x, double factor)
{
    if (s == NULL || x == NULL) return PHI_BAD_ARGUMENT;
#if PHI_MONITOR
    phi_copy(s->before, s->x, s);
    s->open = 0;
#endif
    for (int moving = 0; moving < 2; ++moving) /* first check all values, then change them */
        for (size_t r = 0; r < PHI_DIM * s->rows; ++r) {
            double *row = s->x[r / s->rows] + (ptrdiff_t)(r % s->rows) * s->width;
            for (ptrdiff_t i = 0; i < s->length; ++i) {
                const double new_value = factor * row[i] + x[(ptrdiff_t)r * s->length + i];
                if (!isfinite(new_value)) return PHI_BAD_ARGUMENT;
                row[i] = moving ? new_value : row[i];
            }
            PHI_COPY_ENDS(row, s->length, 0, s->length)
        }
    PHI_NOT_OPEN(s)
    phi_clear_carry(s);
#if PHI_MONITOR
    return phi_begin_level(s);
#else
    return PHI_OK;
#endif
}

phi_status phi_set_state(phi_solver *s, const double *x) { return phi_move(s, x, 0.0); }

phi_status phi_kick(phi_solver *s, const double *change) { return phi_move(s, change, 1.0); }
#endif
