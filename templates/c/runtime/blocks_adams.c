#ifndef PHI_FILE_BLOCKS_ADAMS
#define PHI_FILE_BLOCKS_ADAMS
#include <math.h>
#include <string.h>
#include "blocks.c"

enum {
    PHI_STRIDES = 2, /* Runge-Kutta steps in place of one step */
    PHI_MEETINGS = 2 /* iterations after which y in a stage nearly satisfies alpha(y) = x; the first stage takes one more */
};

#define PHI_ASTRAY 1e-3 /* largest accepted difference of predicted and corrected x, relative to |x| + |increment|; measured */
#define PHI_FADING 0.4  /* factor by which a stage counts less than the next one in the fit of the prediction error; measured */

/* Record that the next steps do not continue a block, so that the next block computes all slopes anew. */
static void phi_end_march(phi_table *table) { table->marching = 0; }

/* Integrate x from the time t over the time h, by PHI_STRIDES Runge-Kutta steps. */
static void phi_stride(const phi_solver *s, double t, double h, double x[PHI_DIM])
{
    double mean[PHI_DIM];
    (void)t;
    for (int part = 0; part < PHI_STRIDES; ++part)
        phi_runge_kutta(s PHI_AND_T(t + part * h / (double)PHI_STRIDES), h / (double)PHI_STRIDES, x, mean);
}

/* Store the vector field at x as slope number `done` of the table. Slope number PHI_PAST belongs to the present state.
   */
static void phi_note_slope(const phi_solver *s, double slope[PHI_DIM][PHI_SLOPES], int done, const double x[PHI_DIM])
{
    double here[PHI_DIM];
    phi_slope(s PHI_AND_T(s->t + (done - PHI_PAST) * s->h), x, here);
    for (int i = 0; i < PHI_DIM; ++i) slope[i][done] = here[i];
}

/* Make a step of Adams' method of order 9 from x, with a prediction of order 8. Slope number `done`, at x, and the
   slopes before it must be known. The slope at the prediction is stored as the next one. If prediction and result
   differ much, the step is too long for the method: then x is unchanged, and the function returns 0. */
static int phi_adams(const phi_solver *s, double slope[PHI_DIM][PHI_SLOPES], int done, double x[PHI_DIM])
{
    static const double predict[PHI_PAST] = { -36799.0 / 120960.0, 295767.0 / 120960.0, -1041723.0 / 120960.0,
        2102243.0 / 120960.0, -2664477.0 / 120960.0, 2183877.0 / 120960.0, -1152169.0 / 120960.0, 434241.0 / 120960.0 };
    static const double correct[PHI_PAST + 1] = { -33953.0 / 3628800.0, 312874.0 / 3628800.0, -1291214.0 / 3628800.0,
        3146338.0 / 3628800.0, -5033120.0 / 3628800.0, 5595358.0 / 3628800.0, -4604594.0 / 3628800.0, 4467094.0 / 3628800.0,
        1070017.0 / 3628800.0 };
    double predicted[PHI_DIM], corrected[PHI_DIM];
    const int first = done + 1 - PHI_PAST;
    int astray = 0;
    for (int i = 0; i < PHI_DIM; ++i) {
        double sum = 0.0;
        for (int k = 0; k < PHI_PAST; ++k) sum += predict[k] * slope[i][first + k];
        predicted[i] = x[i] + s->h * sum;
    }
    phi_note_slope(s, slope, done + 1, predicted);
    for (int i = 0; i < PHI_DIM; ++i) {
        double sum = 0.0;
        for (int k = 0; k <= PHI_PAST; ++k) sum += correct[k] * slope[i][first + k];
        corrected[i] = x[i] + s->h * sum;
        astray += !(fabs(corrected[i] - predicted[i]) <= PHI_ASTRAY * (fabs(x[i]) + fabs(s->h * slope[i][done + 1])));
    }
    if (astray > 0) return 0;
    memcpy(x, corrected, sizeof corrected);
    return 1;
}

/* Compute the slopes at the starts of PHI_PAST earlier steps of the present size, by integrating backward from the
   present state. */
static void phi_look_back(const phi_solver *s, double slope[PHI_DIM][PHI_SLOPES])
{
    double x[PHI_DIM];
    memcpy(x, s->x, sizeof x);
    for (int k = 0; k < PHI_PAST; ++k) {
        phi_stride(s, s->t - k * s->h, -s->h, x);
        phi_note_slope(s, slope, PHI_PAST - 1 - k, x);
    }
}

/* Predict the states at the starts of all steps of a block, one after the other: by Adams' method while it is accurate
   enough, then by the Runge-Kutta method. */
static void phi_march(const phi_solver *s, phi_table *table, phi_lanes begin[PHI_DIM])
{
    double x[PHI_DIM];
    int by_adams = 1;
    memcpy(x, s->x, sizeof x);
    for (int i = 0; i < PHI_DIM && table->marching; ++i)
        memmove(table->slope[i], table->slope[i] + PHI_LANES, PHI_PAST * sizeof table->slope[i][0]);
    if (!table->marching) phi_look_back(s, table->slope);
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        for (int i = 0; i < PHI_DIM; ++i) begin[i][lane] = x[i];
        phi_note_slope(s, table->slope, PHI_PAST + lane, x);
        by_adams = by_adams && phi_adams(s, table->slope, PHI_PAST + lane, x);
        if (!by_adams) phi_stride(s, s->t + lane * s->h, s->h, x);
    }
    phi_note_slope(s, table->slope, (int)PHI_PAST + PHI_LANES, x);
    table->marching = 1;
}

/* Approximate the increment of the exact motion over one stage by a weighted sum of slopes, for the step in each lane. */
static void phi_travel(const phi_solver *s, phi_table *table, int stage, phi_lanes predicted[PHI_DIM])
{
    for (int i = 0; i < PHI_DIM; ++i) {
        phi_lanes sum = { 0.0 };
        for (int k = 0; k < PHI_KNOTS; ++k) {
            const double part = s->h * phi_travels[stage][k], *from = &table->slope[i][PHI_PAST + 2 - PHI_KNOTS + k];
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) sum[lane] += part * from[lane];
        }
        memcpy(predicted[i], sum, sizeof sum);
    }
}

/* Set the points y of a stage to its start `begin` plus half the increment of the exact motion, minus the expected error
   of this approximation. */
static void phi_begin_stage(phi_model *model, phi_lanes begin[restrict PHI_DIM], phi_lanes predicted[restrict PHI_DIM],
    phi_lanes missed[restrict PHI_DIM], double part)
{
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane)
            model->y[i][lane] = begin[i][lane] + (0.5 * predicted[i][lane] - part * missed[i][lane]);
    }
}

/* Make one fixed-point iteration for the points y of a stage, which solve alpha(y) = begin. */
static void phi_meet(phi_lanes coef[restrict], phi_model *model, phi_lanes begin[restrict PHI_DIM])
{
    phi_evaluate_lanes(coef, model->y, model->displacement, model->increment);
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) model->y[i][lane] = begin[i][lane] - model->displacement[i][lane];
    }
}

/* Predict the solutions of a block if recurrences are not used. The states at the starts of all steps are predicted
   first; then each lane iterates the stages of its step. In a stage, y starts at the start of the stage plus half the
   exact increment. The error of this starting value is of third order in the size of the stage if y is the mean of
   start and end, else of second order. The constant in this error is fitted to the earlier stages of the step. */
static void phi_predict_by_march(const phi_solver *s, phi_table *table, phi_model *model)
{
    phi_lanes begin[PHI_DIM], predicted[PHI_DIM], missed[PHI_DIM];
    double weight = 0.0;
    phi_march(s, table, begin);
    memset(missed, 0, sizeof missed);
    for (int stage = 0; stage < PHI_STAGES; ++stage) {
        phi_model *this_stage = model + stage;
        const double power = PHI_POWER_OF_STAGE(phi_fractions[stage]);
        phi_travel(s, table, stage, predicted);
        phi_begin_stage(this_stage, begin, predicted, missed, stage > 0 ? power / weight : 0.0);
        for (int meeting = stage > 0; meeting <= PHI_MEETINGS; ++meeting) phi_meet(table->coef[stage], this_stage, begin);
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                const double miss = this_stage->displacement[i][lane] + 0.5 * predicted[i][lane];
                missed[i][lane] = PHI_FADING * missed[i][lane] + power * miss;
                begin[i][lane] += this_stage->increment[i][lane];
            }
        }
        weight = PHI_FADING * weight + power * power;
    }
}
#endif
