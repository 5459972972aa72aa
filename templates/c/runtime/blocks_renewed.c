#ifndef PHI_FILE_BLOCKS_RENEWED
#define PHI_FILE_BLOCKS_RENEWED
#include <math.h>
#include <string.h>
#include "blocks.c"

/* Compute coefficients that depend on the times of the next steps, which differ from lane to lane. */
static void phi_renew_lanes(const phi_solver *s, phi_table *table)
{
    const double done = (double)(s->steps - s->steps_before_h);
    double now[(int)PHI_COEFFICIENTS - PHI_PREPARED];
    PHI_EACH_STAGE {
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double t = s->t_before_h + (done + lane) * s->h;
            phi_at_time(PHI_OF(s->coef, stage), t + PHI_OF(phi_middles, stage) * s->h, now);
            for (int k = PHI_PREPARED; k < PHI_COEFFICIENTS; ++k)
                PHI_OF(table->coef, stage)[k][lane] = now[k - PHI_PREPARED];
        }
    }
}
#endif
