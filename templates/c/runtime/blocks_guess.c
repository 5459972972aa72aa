#ifndef PHI_FILE_BLOCKS_GUESS
#define PHI_FILE_BLOCKS_GUESS
#include <math.h>
#include <string.h>
#include "blocks.c"

/* y becomes the points whose alpha and beta have these means. */
static void phi_from_means(phi_lanes coef[restrict], phi_model *model)
{
    phi_evaluate_lanes(coef, model->y, model->displacement, model->increment);
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane)
            model->y[i][lane] -= model->displacement[i][lane] + 0.5 * model->increment[i][lane];
    }
}

/* Guesses where no recurrence is known: where alpha and beta have the means of steps by the classical Runge-Kutta
   method, to leading order. */
static void phi_guess_by_march(const phi_solver *s, phi_table *table, phi_model *model)
{
    double x[PHI_DIM], mean[PHI_DIM];
#if PHI_TIMED
    double begin = s->t;
#endif
    memcpy(x, s->x, sizeof x);
#if PHI_COMPOSED
    for (int k = 0; k < (int)PHI_STAGES * PHI_LANES; ++k) {
        const int lane = k / PHI_STAGES;
        const int stage = k % PHI_STAGES;
        const double h = phi_fractions[stage] * s->h;
#else
    const double h = s->h;
    for (int lane = 0; lane < PHI_LANES; ++lane) {
#endif
        for (int i = 0; i < PHI_DIM; ++i) PHI_IN(model, stage, y)[i][lane] = x[i];
#if PHI_TIMED
        phi_runge_kutta(s, begin, h, x, mean);
        begin += h;
#else
        phi_runge_kutta(s, h, x, mean);
#endif
        for (int i = 0; i < PHI_DIM; ++i) PHI_IN(model, stage, y)[i][lane] += 0.5 * h * mean[i];
    }
    PHI_EACH_STAGE phi_from_means(PHI_OF(table->coef, stage), PHI_TO(model, stage));
}
#endif
