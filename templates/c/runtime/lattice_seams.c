#ifndef PHI_FILE_LATTICE_SEAMS
#define PHI_FILE_LATTICE_SEAMS
#include "lattice.h"
#include "model.h"
#include "rows.c"

/* ---- Seams ---- */
/* Find where the boundary seam of each axis begins. A seam has the sites that remain after whole periods of colours. If
   these sites are too few for a seam, the seam also has the last whole periods. */
static void phi_find_seams(phi_solver *s)
{
    for (int a = 0; a < PHI_AXES; ++a) {
        const ptrdiff_t size = (ptrdiff_t)s->sizes[a], period = phi_seams[a][0], left = size % period;
        s->seams[a] = size - left;
        while (left > 0 && size - s->seams[a] < phi_seams[a][1]) s->seams[a] -= period;
        const ptrdiff_t width = left > 0 ? phi_seams[a][2] : 0;
        s->inside[0] = width;
        s->inside[1] = s->seams[a] - width;
    }
}

/* Set the kind of each site: its colour + (number of colours) times the sum of 2^axis over the seams that contain it. */
static void phi_put_kinds(const phi_solver *s)
{
    PHI_EACH_ROW {
        double *row = PHI_ROW_AT(s->kinds);
        ptrdiff_t place[PHI_AXES];
        phi_place(s, r, place);
for (ptrdiff_t i = 0; i < s->length; ++i) {
            int colour = 0, window = 0;
            place[PHI_LAST_AXIS] = i;
            for (int a = 0; a < PHI_AXES; ++a) {
                colour += (int)(place[a] % PHI_COLOUR_COUNT) * phi_colours[a];
                window |= (place[a] >= s->seams[a]) << a;
            }
            row[i] = (double)(window * PHI_COLOUR_COUNT + colour % PHI_COLOUR_COUNT);
        }
        PHI_COPY_ENDS(row, s->length, 0, s->length)
    }
}
#endif
