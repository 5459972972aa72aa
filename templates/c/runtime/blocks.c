#ifndef PHI_FILE_BLOCKS
#define PHI_FILE_BLOCKS
#include <limits.h>
#include <math.h>
#include <string.h>

#include "chain.c"
#include "model.h"
#include "newton_lanes.c"
#include "solver.c"

/* ---- Blocks of steps ---- */
#if PHI_COMPOSED && !PHI_PATH
enum {
    PHI_PAST = 8, /* slopes that a step by Adams' method goes on from */
    PHI_SLOPES = PHI_PAST + PHI_LANES + 1 /* those where steps begin: of the last block, of this one, and where it ends */
};

#endif
/* What all blocks share: coefficients, the same in each lane, and the recurrences by which they are foreseen. */
typedef struct {
    int PHI_OF(fits, PHI_STAGES); /* the fit that weight is of; -1 for none */
    phi_lanes PHI_OF(coef, PHI_STAGES)[PHI_COEFFICIENTS], PHI_OF(weight, PHI_STAGES)[PHI_WINDOW][PHI_DIM];
#if PHI_COMPOSED && !PHI_PATH
    int marching; /* whether the last steps were a block, whose slopes these are */
    double slope[PHI_DIM][PHI_SLOPES];
#endif
} phi_table;

/* phi_near for the points of all stages and lanes, seen from one value. */
static int phi_near_lanes(phi_model *model, const double last[PHI_DIM])
{
    phi_lanes most = { 0.0 };
    double size = 0.0;
    for (int i = 0; i < PHI_DIM; ++i) size += fabs(last[i]);
    PHI_EACH_STAGE {
        phi_lanes distance = { 0.0 };
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) distance[lane] += fabs(PHI_IN(model, stage, y)[i][lane] - last[i]);
        }
        phi_keep_largest(most, distance);
    }
    return phi_largest(most) <= PHI_REACH * size;
}

/* Bring the table of a stage up to date: coefficients, and weights that were fitted since. */
static void phi_refresh(const phi_solver *s PHI_AND_INT_STAGE, phi_table *table)
{
    if (PHI_OF(table->fits, stage) == PHI_OF(s->history, stage).fits) return;
    PHI_OF(table->fits, stage) = PHI_OF(s->history, stage).fits;
    for (int k = 0; k < PHI_COEFFICIENTS; ++k)
        for (int lane = 0; lane < PHI_LANES; ++lane) PHI_OF(table->coef, stage)[k][lane] = PHI_OF(s->coef, stage)[k];
    memcpy(PHI_OF(table->weight, stage), PHI_OF(s->history, stage).weight,
        (size_t)PHI_OF(s->history, stage).recurrence_terms * PHI_DIM * sizeof(phi_lanes));
}

#if PHI_RENEWED
/* What depends on the times of the next steps, which differ from lane to lane. */
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
/* Guesses for the next PHI_LANES values of a stage, by its recurrences. */
static void phi_foresee(const phi_history *history, phi_lanes weight[restrict][PHI_DIM],
    phi_lanes y[restrict PHI_DIM])
{
    const int last = history->count - 1;
    for (int i = 0; i < PHI_DIM; ++i) {
        phi_lanes even = { 0.0 }, odd = { 0.0 };
        for (int k = 0; k < history->recurrence_terms; k += 2) {
            const double past = history->past[last - k][i], earlier = history->past[last - 1 - k][i];
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) even[lane] += weight[k][i][lane] * past;
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) odd[lane] += weight[k + 1][i][lane] * earlier;
        }
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) y[i][lane] = even[lane] + odd[lane];
    }
}

/* Add the values of all lanes to the history, one after the other. */
static void phi_record_lanes(phi_history *history, phi_lanes y[restrict PHI_DIM])
{
    phi_make_room(history, PHI_LANES);
    for (int lane = 0; lane < PHI_LANES; ++lane)
        for (int i = 0; i < PHI_DIM; ++i) history->past[history->count + lane][i] = y[i][lane];
    history->count += PHI_LANES;
}

#if PHI_TIMED
/* The slope of the motion at x and the time t. */
static void phi_slope(const phi_solver *s, double t, const double x[PHI_DIM], double slope[PHI_DIM])
{
    phi_vector_field(&s->params, t, x, slope);
#elif PHI_MONITOR
/* The slope of the motion at x, in tau. */
static void phi_slope(const phi_solver *s, const double x[PHI_DIM], double slope[PHI_DIM])
{
    const double rate = phi_monitor(&s->params, x);
    phi_vector_field(&s->params, x, slope);
    for (int i = 0; i < PHI_DIM; ++i) slope[i] *= rate;
#else
/* The slope of the motion at x. */
static void phi_slope(const phi_solver *s, const double x[PHI_DIM], double slope[PHI_DIM])
{
    phi_vector_field(&s->params, x, slope);
#endif
}

#if PHI_TIMED
/* A step of size h by the classical Runge-Kutta method, from the time t. x becomes its end, mean the mean slope. */
static void phi_runge_kutta(const phi_solver *s, double t, double h, double x[PHI_DIM], double mean[PHI_DIM])
#else
/* A step of size h by the classical Runge-Kutta method. x becomes its end, mean the mean slope. */
static void phi_runge_kutta(const phi_solver *s, double h, double x[PHI_DIM], double mean[PHI_DIM])
#endif
{
    static const double reach[4] = { 0.5, 0.5, 1.0, 0.0 }, weight[4] = { 1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0 };
#if PHI_TIMED
    static const double after[4] = { 0.0, 0.5, 0.5, 1.0 };
#endif
    double point[PHI_DIM], slope[PHI_DIM];
    memcpy(point, x, sizeof point);
    memset(mean, 0, PHI_DIM * sizeof mean[0]);
    for (int part = 0; part < 4; ++part) {
        phi_slope(s PHI_AND_T(t + after[part] * h), point, slope);
        for (int i = 0; i < PHI_DIM; ++i) {
            mean[i] += weight[part] * slope[i];
            point[i] = x[i] + h * reach[part] * slope[i];
        }
    }
    for (int i = 0; i < PHI_DIM; ++i) x[i] += h * mean[i];
}

#if PHI_COMPOSED && !PHI_PATH
enum {
    PHI_STRIDES = 2, /* of the Runge-Kutta method in a step: errors that all stages of it share */
    PHI_MEETINGS = 2 /* evaluations of a stage until its point is nearly where alpha(y) = x; the first takes one more */
};

#define PHI_ASTRAY 1e-3 /* how far a prediction may be from its correction, in sizes of the value and of the step */
#define PHI_FADING 0.4  /* how much of what was found out from a stage still counts after the next */

/* A step by the Runge-Kutta method, of one size or the other, from the time t. */
static void phi_stride(const phi_solver *s, double t, double h, double x[PHI_DIM])
{
    double mean[PHI_DIM];
#if PHI_TIMED
    for (int part = 0; part < PHI_STRIDES; ++part)
        phi_runge_kutta(s, t + part * h / (double)PHI_STRIDES, h / (double)PHI_STRIDES, x, mean);
#else
    (void)t;
    for (int part = 0; part < PHI_STRIDES; ++part) phi_runge_kutta(s, h / (double)PHI_STRIDES, x, mean);
#endif
}

/* The slope at x, where so many steps are done, counted from those of the last block. */
static void phi_note_slope(const phi_solver *s, double slope[PHI_DIM][PHI_SLOPES], int done, const double x[PHI_DIM])
{
    double here[PHI_DIM];
    phi_slope(s PHI_AND_T(s->t + (done - PHI_PAST) * s->h), x, here);
    for (int i = 0; i < PHI_DIM; ++i) slope[i][done] = here[i];
}

/* Make a step by Adams' method of order 9, predicted by that of order 8, from x, where so many steps are done. 0, and x as
   before, where the two differ much: the steps are too long for them then. Slopes are known as far as x, and become known
   where the prediction leads. */
static int phi_adams(const phi_solver *s, double slope[PHI_DIM][PHI_SLOPES], int done, double x[PHI_DIM])
{
    static const double predict[PHI_PAST] = { -36799.0 / 120960.0, 295767.0 / 120960.0, -1041723.0 / 120960.0,
        2102243.0 / 120960.0, -2664477.0 / 120960.0, 2183877.0 / 120960.0, -1152169.0 / 120960.0, 434241.0 / 120960.0 };
    static const double correct[PHI_PAST + 1] = { -33953.0 / 3628800.0, 312874.0 / 3628800.0, -1291214.0 / 3628800.0,
        3146338.0 / 3628800.0, -5033120.0 / 3628800.0, 5595358.0 / 3628800.0, -4604594.0 / 3628800.0, 4467094.0 / 3628800.0,
        1070017.0 / 3628800.0 };
    double predicted[PHI_DIM], corrected[PHI_DIM];
    const int first = done + 1 - PHI_PAST;
    int far = 0;
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
        far += !(fabs(corrected[i] - predicted[i]) <= PHI_ASTRAY * (fabs(x[i]) + fabs(s->h * slope[i][done + 1])));
    }
    if (far > 0) return 0;
    memcpy(x, corrected, sizeof corrected);
    return 1;
}

/* The slopes where steps of this size would have come from. */
static void phi_look_back(const phi_solver *s, double slope[PHI_DIM][PHI_SLOPES])
{
    double x[PHI_DIM];
    memcpy(x, s->x, sizeof x);
    for (int k = 0; k < PHI_PAST; ++k) {
        phi_stride(s, s->t - k * s->h, -s->h, x);
        phi_note_slope(s, slope, PHI_PAST - 1 - k, x);
    }
}

/* Where all steps begin, one after the other: by Adams' method, as long as that will do, or else by that of Runge and
   Kutta. */
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

/* What a stage moves by along the exact motion, in all lanes. */
static void phi_travel(const phi_solver *s, phi_table *table, int stage, phi_lanes moved[PHI_DIM])
{
    for (int i = 0; i < PHI_DIM; ++i) {
        phi_lanes sum = { 0.0 };
        for (int k = 0; k < PHI_KNOTS; ++k) {
            const double part = s->h * phi_travels[stage][k], *from = &table->slope[i][PHI_PAST + 2 - PHI_KNOTS + k];
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) sum[lane] += part * from[lane];
        }
        memcpy(moved[i], sum, sizeof sum);
    }
}

/* Begin a stage with half of what the exact motion moves by, less what half of it is thought to miss. */
static void phi_begin_stage(phi_model *model, phi_lanes begin[restrict PHI_DIM], phi_lanes moved[restrict PHI_DIM],
    phi_lanes missed[restrict PHI_DIM], double part)
{
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane)
            model->y[i][lane] = begin[i][lane] + (0.5 * moved[i][lane] - part * missed[i][lane]);
    }
}

/* Bring the points of a stage nearer to where alpha(y) is its begin. */
static void phi_meet(phi_lanes coef[restrict], phi_model *model, phi_lanes begin[restrict PHI_DIM])
{
    phi_evaluate_lanes(coef, model->y, model->displacement, model->increment);
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) model->y[i][lane] = begin[i][lane] - model->displacement[i][lane];
    }
}

/* Guesses where no recurrence is known. From the beginnings of all steps on each lane makes the stages of its own step, by
   iteration. What half of the exact motion misses is of third order in the size of a stage, where y is the mean of its ends,
   and otherwise of second: the factor is fitted to the stages before. */
static void phi_guess_by_march(const phi_solver *s, phi_table *table, phi_model *model)
{
    phi_lanes begin[PHI_DIM], moved[PHI_DIM], missed[PHI_DIM];
    double weight = 0.0;
    phi_march(s, table, begin);
    memset(missed, 0, sizeof missed);
    for (int stage = 0; stage < PHI_STAGES; ++stage) {
        phi_model *this_stage = model + stage;
#if PHI_CENTRED
        const double power = phi_fractions[stage] * phi_fractions[stage] * phi_fractions[stage];
#else
        const double power = phi_fractions[stage] * phi_fractions[stage];
#endif
        phi_travel(s, table, stage, moved);
        phi_begin_stage(this_stage, begin, moved, missed, stage > 0 ? power / weight : 0.0);
        for (int meeting = stage > 0; meeting <= PHI_MEETINGS; ++meeting) phi_meet(table->coef[stage], this_stage, begin);
        for (int i = 0; i < PHI_DIM; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                const double miss = this_stage->displacement[i][lane] + 0.5 * moved[i][lane];
                missed[i][lane] = PHI_FADING * missed[i][lane] + power * miss;
                begin[i][lane] += this_stage->increment[i][lane];
            }
        }
        weight = PHI_FADING * weight + power * power;
    }
}

#else
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
/* Guess the points of all stages and steps, by recurrences or else by a march. 0 if they are not near the state. */
static int phi_guess(phi_solver *s, phi_table *table, phi_model *model)
{
#if PHI_COMPOSED
    if (!s->blocks.use_recurrences) phi_guess_by_march(s, table, model);
#if !PHI_PATH
    else table->marching = 0;
#endif
    for (int stage = 0; stage < PHI_STAGES; ++stage)
        if (s->blocks.use_recurrences) phi_foresee(&s->history[stage], table->weight[stage], model[stage].y);
#else
    if (s->blocks.use_recurrences) phi_foresee(&s->history, table->weight, model->y);
    else phi_guess_by_march(s, table, model);
#endif
    return phi_near_lanes(model, s->x);
}

#if PHI_MONITOR
/* The times that the steps of a block take, by the points of their stages, and what their sums lost. 0 unless those of all
   stages have the sign of the stage. */
static int phi_elapse(const phi_solver *s, phi_table *table, phi_model *model, phi_lanes elapsed, phi_lanes lost)
{
    phi_lanes wrong = { 0.0 };
    memset(elapsed, 0, PHI_LANES * sizeof elapsed[0]);
    memset(lost, 0, PHI_LANES * sizeof lost[0]);
    PHI_EACH_STAGE {
        phi_lanes one[1];
        const double size = PHI_FRACTION(s->h);
        phi_elapsed_lanes(PHI_OF(table->coef, stage), PHI_IN(model, stage, y), one);
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            const double sum = elapsed[lane] + one[0][lane], added = sum - elapsed[lane];
            wrong[lane] += one[0][lane] * size > 0.0 ? 0.0 : 1.0;
            lost[lane] += (elapsed[lane] - (sum - added)) + (one[0][lane] - added);
            elapsed[lane] = sum;
        }
    }
    return !(phi_largest(wrong) > 0.0);
}

#endif
#if PHI_ATTITUDE
/* The elements of a stage in all lanes, each to its place in the sequence. */
static void phi_take_stage(phi_lanes turns[PHI_ELEMENT] PHI_AND_INT_STAGE, double sequence[][PHI_ELEMENT])
{
    for (int lane = 0; lane < PHI_LANES; ++lane)
        for (int i = 0; i < PHI_ELEMENT; ++i) sequence[PHI_STAGE_OF_LANE][i] = turns[i][lane];
}

#if PHI_TURNED_BY_COVECTOR
/* phi_matrix_exponential in all lanes. */
static void phi_matrix_exponential_lanes(phi_lanes p[PHI_COVECTOR], phi_lanes element[PHI_ELEMENT])
{
    const int doublings = phi_doublings(phi_largest(p[PHI_SIZE]));
    if (doublings == 0) {
        phi_exponential_lanes(p, element);
        return;
    }
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        double one[PHI_COVECTOR], made[PHI_ELEMENT];
        for (int i = 0; i < PHI_COVECTOR; ++i) one[i] = p[i][lane];
        phi_matrix_exponential(one, made);
        for (int i = 0; i < PHI_ELEMENT; ++i) element[i][lane] = made[i];
    }
}

#endif
/* The elements of a block that was solved, one after the other. */
static void phi_turn_block(phi_solver *s, phi_table *table, phi_model *model)
{
    phi_lanes turns[PHI_ELEMENT];
    double sequence[PHI_ALL_STAGES(PHI_LANES)][PHI_ELEMENT];
    PHI_EACH_STAGE {
#if PHI_TURNED_BY_COVECTOR
        phi_lanes p[PHI_COVECTOR];
        phi_turn_lanes(PHI_OF(table->coef, stage), PHI_IN(model, stage, y), p);
        phi_matrix_exponential_lanes(p, turns);
#else
        phi_turn_lanes(PHI_OF(table->coef, stage), PHI_IN(model, stage, y), turns);
#endif
        phi_take_stage(turns PHI_AND_STAGE, sequence);
    }
    phi_turn_sequence(s, sequence, PHI_ALL_STAGES(PHI_LANES));
}

#endif
/* PHI_LANES steps at once: guess the points of all, and correct them together until the error that remains is as
   small as after a single step. How many passes that took; 0, and the solver as before, where it takes more than most. */
static int phi_block(phi_solver *s, phi_table *table, int most)
{
    phi_model PHI_OF(model, PHI_STAGES);
    phi_lanes unit[PHI_DIM], size, before, left;
    double x[PHI_DIM], carry[PHI_DIM], previous = HUGE_VAL;
    int passes = 0, solved = 0;
#if PHI_SWEPT
    phi_lanes turn[PHI_DIM * PHI_DIM];
#endif
    if (!phi_guess(s, table, PHI_ADDRESS(model))) return 0;
    for (int lane = 0; lane < PHI_LANES; ++lane) size[lane] = HUGE_VAL;
    while (!solved) {
        const int matrices = previous > PHI_FROZEN;
        PHI_EACH_STAGE phi_update(PHI_OF(table->coef, stage), &PHI_OF(model, stage), matrices);
        memcpy(x, s->x, sizeof x);
        memcpy(carry, s->carry, sizeof carry);
        memcpy(before, size, sizeof before);
#if PHI_COMPOSED
        if (matrices) phi_measure(model, PHI_STAGES, unit);
#else
        if (matrices) phi_measure(&model, unit);
#endif
#if PHI_SWEPT
        if (matrices) phi_turn_residuals(model, turn);
        phi_chain(model, turn, unit, x, carry, size);
#else
        phi_chain(PHI_ADDRESS(model), unit, x, carry, size);
#endif
        s->evaluations += PHI_ALL_STAGES(PHI_LANES);
        phi_leave(size, before, left);
        solved = phi_largest(left) <= PHI_TOLERANCE;
        const double largest = phi_largest(size);
        if ((++passes >= most || !(largest < previous)) && !solved) return 0;
        previous = largest;
    }
    if (!phi_near_lanes(PHI_ADDRESS(model), s->x)) return 0;
    for (int i = 0; i < PHI_DIM; ++i)
        if (!isfinite(x[i])) return 0;
#if PHI_MONITOR
    phi_lanes elapsed, lost;
    if (!phi_elapse(s, table, PHI_ADDRESS(model), elapsed, lost)) return 0;
#endif
    memcpy(s->x, x, sizeof x);
    memcpy(s->carry, carry, sizeof carry);
#if PHI_MONITOR
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        s->t_carry += lost[lane];
        phi_pass(s, elapsed[lane]);
    }
#endif
    s->steps += PHI_LANES;
#if !PHI_MONITOR
    s->t = s->t_before_h + (double)(s->steps - s->steps_before_h) * s->h;
#endif
#if PHI_ATTITUDE
    phi_turn_block(s, table, PHI_ADDRESS(model));
#endif
    PHI_EACH_STAGE {
        phi_history *history = &PHI_OF(s->history, stage);
        phi_record_lanes(history, PHI_OF(model, stage).y);
        history->slow_steps = passes > 1 ? history->slow_steps + PHI_LANES : 0;
        if (history->slow_steps > history->slow_steps_allowed && s->blocks.use_recurrences) phi_fit(history);
    }
    return passes;
}

enum {
    PHI_REPAY_BLOCKS = 4 * PHI_REPAY, /* steps that fits for whole blocks are saved in */
    PHI_MOST_SINGLE_STEPS = 1000,     /* before blocks are tried again */
    PHI_TOO_MANY = 5 * PHI_LANES      /* of these: recurrences are to blame */
};
#define PHI_LATEST 0.125 /* the weight of the latest step in the mean of evaluations */

/* Recurrences are given up for a while, the longer the more often that happens. */
static void phi_give_up(phi_solver *s)
{
    s->blocks.use_recurrences = s->blocks.last_single_steps = s->blocks.single_steps = 0;
    s->blocks.steps_without_recurrences = 2 * s->blocks.steps_without_recurrences + PHI_REPAY_BLOCKS;
    s->blocks.recurrences_from_step = s->steps + s->blocks.steps_without_recurrences;
}

/* How the next block is guessed: by recurrences, fitted as soon as enough steps are to be made, or
   have been, to repay that. */
static void phi_choose_guess(phi_solver *s, size_t steps)
{
    PHI_EACH_STAGE
        if (PHI_OF(s->history, stage).count < PHI_REMEMBERED) {
            s->blocks.use_recurrences = 0;
            return;
        }
    if (s->blocks.use_recurrences || s->steps < s->blocks.recurrences_from_step) return;
    if (steps < PHI_REPAY_BLOCKS && s->steps < PHI_REPAY) return;
#if PHI_COMPOSED
    s->blocks.use_recurrences = 1;
    for (int stage = 0; stage < PHI_STAGES; ++stage)
        s->blocks.use_recurrences = s->blocks.use_recurrences && phi_fit(&s->history[stage]);
#else
    s->blocks.use_recurrences = phi_fit(&s->history);
#endif
    s->blocks.single_steps = PHI_LANES;
    if (!s->blocks.use_recurrences) phi_give_up(s);
}

/* Learn from a block: after one that failed single steps are made, the more the more often that happens. Recurrences
   that fail repeatedly, or need more passes than steps by Runge-Kutta did, are given up. */
static void phi_learn_from(phi_solver *s, int passes)
{
    if (passes > 0) {
        s->blocks.last_single_steps /= 2;
    } else {
        const int longer = 2 * s->blocks.last_single_steps + PHI_LANES;
        s->blocks.last_single_steps = longer > PHI_MOST_SINGLE_STEPS ? PHI_MOST_SINGLE_STEPS : longer;
        s->blocks.single_steps = s->blocks.last_single_steps;
    }
    if (!s->blocks.use_recurrences) {
        s->blocks.passes_without_recurrences = passes > 0 ? passes : INT_MAX;
    } else if (passes > s->blocks.passes_without_recurrences || s->blocks.last_single_steps > PHI_TOO_MANY) {
        phi_give_up(s);
    }
}

/* A single step, and the running mean of the evaluations that a stage of one takes. */
static phi_status phi_single(phi_solver *s)
{
    const size_t before = s->evaluations;
    const phi_status status = phi_single_steps(s, s->h, 1);
    const double evaluations = (double)(s->evaluations - before) PHI_PER_STAGE;
    s->blocks.evaluations_per_stage += PHI_LATEST * (evaluations - s->blocks.evaluations_per_stage);
    return status;
}

/* Blocks of steps where they cost less than single steps, with at most as many passes over a block as PHI_PASSES for each
   evaluation in a single step. The results differ by round-off only. */
phi_status phi_integrate(phi_solver *s, double h, size_t steps)
{
    phi_table table;
    phi_status status = phi_single_steps(s, h, 0); /* makes all that depends on h */
    PHI_EACH_STAGE PHI_OF(table.fits, stage) = -1;
#if PHI_COMPOSED && !PHI_PATH
    table.marching = 0;
#endif
    while (status == PHI_OK && steps > 0) {
        if (steps >= PHI_LANES && s->blocks.single_steps == 0) phi_choose_guess(s, steps);
        if (steps >= PHI_LANES && s->blocks.single_steps == 0) {
            PHI_EACH_STAGE phi_refresh(s PHI_AND_STAGE, &table);
#if PHI_RENEWED
            phi_renew_lanes(s, &table);
#endif
            const int passes = phi_block(s, &table, (int)((double)PHI_PASSES * s->blocks.evaluations_per_stage + 0.5));
            phi_learn_from(s, passes);
            if (passes > 0) steps -= PHI_LANES;
        } else {
            if (s->blocks.single_steps > 0) --s->blocks.single_steps;
            status = phi_single(s);
#if PHI_COMPOSED && !PHI_PATH
            table.marching = 0;
#endif
            if (status == PHI_OK) --steps;
        }
    }
#if PHI_ATTITUDE
    if (s != NULL) phi_read_attitude(s);
#endif
    return status;
}
#endif
