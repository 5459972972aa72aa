#ifndef PHI_FILE_LATTICE_OBSERVED_FIELDS
#define PHI_FILE_LATTICE_OBSERVED_FIELDS
#include "lattice.h"
#include "model.h"
#include "rows.c"

void phi_observed_fields(const phi_solver *s, double *out)
{
    PHI_EACH_ROW {
        const phi_row row = PHI_WHOLE_ROW;
        phi_observed_fields_row(&row, PHI_VALUES_AT(out));
    }
}
#endif
