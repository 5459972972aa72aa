/* Blocks of steps and groups of members against single steps, from inside the generated file.
   Compile with -DNAME=… -DSOURCE="…" -DSTEP=…, -DULPS=…, -DFORESEEN=0 or 1 (whether recurrences foresee the motion),
   -DSTAGES=…, -DGROUPS=0 or 1 (whether there are groups), -DMARCHES (whether by Adams' method), -DTIMED and -DGAUGED (whether
   there is a time, and a gauge), -DSTATE="…" (initial values separated by commas). */
#include <stdio.h>
#include <stdlib.h>

#include SOURCE

#define GLUE2(a, b) a##_##b
#define GLUE(a, b) GLUE2(a, b)
#define F(name) GLUE(NAME, name)
#define DIM F(DIM)
#if STAGES == 1 /* then nothing is an array over stages */
#define OF(array, stage) (array)
#define STAGE(stage)
#else
#define OF(array, stage) (array)[stage]
#define STAGE(stage) , stage
#endif
#define MEMBERS 11
#if TIMED
static const double now[MEMBERS];
#define EACH(params, x, members, ...) F(ensemble_each)(params, x, members, now, __VA_ARGS__)
#elif GAUGED
#define EACH(params, x, members, ...) F(ensemble_each)(params, x, members, NULL, __VA_ARGS__)
#else
#define EACH F(ensemble_each)
#endif

#define EXPECT(condition) \
    do { \
        if (!(condition)) { \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
            exit(1); \
        } \
    } while (0)

static double start[DIM] = { STATE };

static int close_to(const double *a, const double *b, double tolerance)
{
    double size = 0.0, apart = 0.0;
    for (int i = 0; i < DIM; ++i) {
        size = fmax(size, fabs(b[i]));
        apart = fmax(apart, fabs(a[i] - b[i]));
    }
    return apart <= tolerance * size;
}

static void singly(F(solver) *s, int steps)
{
    for (int k = 0; k < steps; ++k) EXPECT(F(step)(s, STEP) == F(OK));
}

static void begin(F(solver) *s, int steps)
{
    EXPECT(F(init)(s, NULL, start) == F(OK));
    singly(s, steps);
}

/* What blocks share, before the first. */
static void prepare(const F(solver) *s, F(table) *table)
{
    memset(table, 0, sizeof *table);
    for (int stage = 0; stage < STAGES; ++stage) OF(table->fits, stage) = -1;
    for (int stage = 0; stage < STAGES; ++stage) F(refresh)(s STAGE(stage), table);
}

/* A block after some single steps, guessed in either way, moves the state as eight single steps do. */
static void block_equals_steps(int steps, int foreseeing)
{
    static F(solver) together, singles, before;
    static F(table) table;
    begin(&together, steps);
    for (int stage = 0; stage < STAGES && foreseeing; ++stage) {
        F(fit)(&OF(together.history, stage));
        EXPECT((OF(together.history, stage).recurrence_terms > 0) == FORESEEN);
        if (!FORESEEN) return;
    }
    together.blocks.use_recurrences = foreseeing;
    prepare(&together, &table);
    singles = before = together;
    if (F(block)(&together, &table, 1) == 0) { /* as a rule one pass is too few for a march by Runge-Kutta */
        EXPECT(memcmp(together.x, before.x, sizeof before.x) == 0);
        EXPECT(memcmp(together.carry, before.carry, sizeof before.carry) == 0);
        EXPECT(together.steps == before.steps);
    }
    together = before;
    prepare(&together, &table);
    const int passes = F(block)(&together, &table, 8);
    singly(&singles, F(LANES));
    EXPECT(passes > 0);
    EXPECT(passes <= (foreseeing ? 3 : 4));
    EXPECT(together.steps == singles.steps);
    EXPECT(close_to(together.x, singles.x, 1e-13));
    for (int stage = 0; stage < STAGES; ++stage) {
        const F(history) *a = &OF(together.history, stage), *b = &OF(singles.history, stage);
        EXPECT(a->count == b->count);
        for (int k = 1; k <= F(LANES); ++k) EXPECT(close_to(a->past[a->count - k], b->past[b->count - k], 1e-9));
    }
}

#if MARCHES && !TIMED
/* The motion over many steps, each by fine ones. */
static void flow(const F(solver) *s, int steps, double x[DIM])
{
    enum { FINE = 8 };
    double mean[DIM];
    for (int k = 0; k < FINE * steps; ++k) F(runge_kutta)(s, s->h / FINE, x, mean);
}

/* Slopes are those of the motion from where the steps of the last block began to where those of this one end, and so are the
   beginnings of steps, and what stages move by; in a first block and in the next, which goes on from it. */
static void march_goes_on(void)
{
    static F(solver) s;
    static F(table) table;
    F(lanes) starts[DIM], moved[DIM];
    double x[DIM], exact[DIM], slope[DIM];
    begin(&s, 30);
    prepare(&s, &table);
    s.h = STEP / 8.0; /* so short that Adams' method is exact to nine digits */
    for (int block = 0; block < 2; ++block) {
        F(march)(&s, &table, starts);
        memcpy(exact, s.x, sizeof exact);
        s.h = -s.h;
        flow(&s, F(PAST), exact);
        s.h = -s.h;
        for (int k = 0; k < F(SLOPES); ++k) {
            F(slope)(&s, exact, slope);
            for (int i = 0; i < DIM; ++i) x[i] = table.slope[i][k];
            EXPECT(close_to(x, slope, 1e-8));
            for (int i = 0; i < DIM && k >= F(PAST) && k < F(PAST) + F(LANES); ++i) x[i] = starts[i][k - F(PAST)];
            EXPECT(k < F(PAST) || k == F(PAST) + F(LANES) || close_to(x, exact, 1e-9));
            flow(&s, 1, exact);
        }
        flow(&s, F(LANES), s.x);
    }
    for (int stage = 0; stage < STAGES; ++stage) {
        F(travel)(&s, &table, stage, moved);
        for (int i = 0; i < DIM; ++i)
            for (int lane = 0; lane < F(LANES); ++lane) starts[i][lane] += moved[i][lane];
    }
    for (int i = 0; i < DIM; ++i) x[i] = starts[i][F(LANES) - 1];
    EXPECT(close_to(x, s.x, 1e-6)); /* by four slopes */
}
#endif

/* The state and what rounding took from it, together: that is below the last place, unless the sum is not compensated. */
static void integrate_equals_steps(int steps)
{
    static F(solver) together, singles;
    double size = 0.0, apart = 0.0;
    begin(&singles, steps);
    EXPECT(F(init)(&together, NULL, start) == F(OK));
    EXPECT(F(integrate)(&together, STEP, (size_t)steps) == F(OK));
    EXPECT(together.steps == singles.steps);
    for (int i = 0; i < DIM; ++i) {
        size = fmax(size, fabs(singles.x[i]));
        apart = fmax(apart, fabs((together.x[i] - singles.x[i]) + (together.carry[i] - singles.carry[i])));
    }
    EXPECT(apart <= ULPS * 0.5 * DBL_EPSILON * size);
}

/* Member m has parameters and a step of its own. */
static void own(int m, F(params) *params, double *h)
{
    double values[sizeof *params / sizeof(double) + 1];
    *params = F(default_params);
    memcpy(values, params, sizeof *params);
    for (int k = 0; k < (int)(sizeof *params / sizeof(double)); ++k) values[k] *= 1.0 + 1e-3 * m;
    memcpy(params, values, sizeof *params);
    *h = STEP * (1.0 - 1e-2 * m);
}

#if GROUPS
static const double step_of_all = STEP;

static int join(F(group) *group, int lane, double x[DIM])
{
    const F(members) all = { .x = x, .members = 1, .h = &step_of_all };
    return F(group_join)(group, lane, &all, 0) == F(OK);
}

/* Members of one group, with extrapolated guesses and then with fitted ones, and one lane empty. */
static void group_equals_steps(int steps)
{
    static F(group) group;
    static F(solver) singles;
    double x[DIM], end[DIM];
    memset(&group, 0, sizeof group);
    for (int lane = 0; lane < F(LANES); ++lane) {
        for (int i = 0; i < DIM; ++i) x[i] = start[i] * (1.0 + 1e-3 * lane);
        if (lane != 3) EXPECT(join(&group, lane, x));
    }
    for (int k = 0; k < steps; ++k) EXPECT(F(group_step)(&group, 1) == F(LANES) - 1);
    for (int lane = 0; lane < F(LANES); ++lane) {
        if (lane == 3) continue;
        for (int i = 0; i < DIM; ++i) x[i] = start[i] * (1.0 + 1e-3 * lane);
        EXPECT(group.steps_left[lane] == 0);
        EXPECT(F(init)(&singles, NULL, x) == F(OK));
        singly(&singles, steps);
        for (int i = 0; i < DIM; ++i) end[i] = group.x[i][lane];
        EXPECT(close_to(end, singles.x, 1e-13));
    }
}

/* Both guesses are near the next values: extrapolation nearer than the last ones are, recurrences nearer still. */
static void group_fits(void)
{
    static F(group) group;
    enum { ROWS = F(REMEMBERED) };
    F(lanes) guess[DIM], rough[DIM], last[DIM];
    double apart = 0.0, moved = 0.0, a[DIM], b[DIM];
    memset(&group, 0, sizeof group);
    for (int lane = 0; lane < F(LANES); ++lane) EXPECT(join(&group, lane, start));
    for (int k = 0; k < ROWS; ++k) F(group_step)(&group, 1);
    F(group_fit)(&group);
    EXPECT((OF(group.recurrence_terms, 0) > 0) == FORESEEN);
    F(group_foresee)(&group STAGE(0), guess);
    F(group_extrapolate)(&group STAGE(0), rough);
    memcpy(last, OF(group.past, 0)[group.latest], sizeof last);
    F(group_step)(&group, 1);
    for (int lane = 0; lane < F(LANES); ++lane) {
        for (int i = 0; i < DIM; ++i) a[i] = guess[i][lane];
        for (int i = 0; i < DIM; ++i) b[i] = OF(group.past, 0)[group.latest][i][lane];
        EXPECT(!FORESEEN || close_to(a, b, 1e-6));
        for (int i = 0; i < DIM; ++i) {
            apart += fabs(rough[i][lane] - b[i]);
            moved += fabs(last[i][lane] - b[i]);
        }
    }
    EXPECT(apart <= 0.3 * moved);
}
/* What is left of a residual is taken from the increment: points off by 1e-6 lead to the same states, but for its square. */
static void increments_are_corrected(void)
{
    static F(group) group;
    static F(model) model;
    F(lanes) unit[DIM], size, x[2][DIM], carry[DIM];
    double a[DIM], b[DIM];
    memset(&group, 0, sizeof group);
    for (int lane = 0; lane < F(LANES); ++lane) EXPECT(join(&group, lane, start));
    F(group_solve)(&group STAGE(0), &model);
    for (int off = 0; off < 2; ++off) {
        for (int i = 0; i < DIM; ++i)
            for (int lane = 0; lane < F(LANES); ++lane) model.y[i][lane] *= 1.0 + 1e-6 * off * (lane - i);
        F(update)(OF(group.coef, 0), &model, 1);
        for (int i = 0; i < DIM; ++i)
            for (int lane = 0; lane < F(LANES); ++lane)
                model.residual[i][lane] = (model.y[i][lane] - group.x[i][lane]) + model.displacement[i][lane];
#if STAGES == 1
        F(measure)(&model, unit);
#else
        F(measure)(&model, 1, unit);
#endif
        F(correct)(&model, unit, size);
        memcpy(x[off], group.x, sizeof x[off]);
        memset(carry, 0, sizeof carry);
        F(group_advance)(x[off], carry, &model);
    }
    for (int lane = 0; lane < F(LANES); ++lane) {
        for (int i = 0; i < DIM; ++i) a[i] = x[0][i][lane];
        for (int i = 0; i < DIM; ++i) b[i] = x[1][i][lane];
        EXPECT(close_to(a, b, 1e-9));
    }
}

/* Guesses far away are not used: there the equation of a step may have solutions that have nothing to do with the motion. */
static void far_guesses_are_not_used(void)
{
    static F(solver) s;
    static F(table) table;
    static F(group) group;
    F(lanes) guess[DIM];
    double value[DIM];
    begin(&s, 30);
    memset(&group, 0, sizeof group);
    for (int lane = 0; lane < F(LANES); ++lane) EXPECT(join(&group, lane, start));
    EXPECT(F(group_step)(&group, 1) == F(LANES));
    for (int stage = 0; stage < STAGES; ++stage) {
        for (int i = 0; i < DIM; ++i) {
            for (int l = 0; l < F(LANES); ++l) OF(s.history, stage).weight[0][i][l] = 1e8;
            for (int lane = 0; lane < F(LANES); ++lane) OF(group.weight, stage)[0][i][lane] = 1e8;
        }
        OF(s.history, stage).recurrence_terms = OF(group.recurrence_terms, stage) = 2;
        OF(s.history, stage).use_recurrence = OF(group.use_recurrences, stage) = 1;
        OF(table.fits, stage) = -1;
    }
    EXPECT(!F(predict)(&OF(s.history, 0), value));
    s.blocks.use_recurrences = 1;
    for (int stage = 0; stage < STAGES; ++stage) F(refresh)(&s STAGE(stage), &table);
    EXPECT(F(block)(&s, &table, 8) == 0);
    F(group_predict)(&group STAGE(0), guess);
    EXPECT(memcmp(guess, group.x, sizeof guess) == 0);
}
#endif

/* The whole ensemble, the last group of which is not full; a member without a state is said to be so. */
static void ensemble_equals_steps(int steps)
{
    static F(solver) singles;
    static double x[DIM * MEMBERS];
    double x0[DIM], end[DIM];
    unsigned char status[MEMBERS];
    for (int m = 0; m < MEMBERS; ++m)
        for (int i = 0; i < DIM; ++i) x[i * MEMBERS + m] = start[i] * (1.0 + 1e-3 * m);
    x[5] = nan("");
    EXPECT(F(ensemble)(NULL, x, MEMBERS, STEP, (size_t)steps, status) == F(BAD_ARGUMENT));
    for (int m = 0; m < MEMBERS; ++m) {
        EXPECT(status[m] == (m == 5 ? F(BAD_ARGUMENT) : F(OK)));
        if (m == 5) continue;
        for (int i = 0; i < DIM; ++i) x0[i] = start[i] * (1.0 + 1e-3 * m);
        EXPECT(F(init)(&singles, NULL, x0) == F(OK));
        singly(&singles, steps);
        for (int i = 0; i < DIM; ++i) end[i] = x[i * MEMBERS + m];
        EXPECT(close_to(end, singles.x, 1e-13));
    }
}

/* The same where each has parameters and a step of its own: its frames are on its own way. */
static void members_have_their_own(int steps, int stride)
{
    static F(solver) singles;
    static double x[DIM * MEMBERS], frames[4 * DIM * MEMBERS];
    F(params) params[MEMBERS];
    double x0[DIM], end[DIM], h[MEMBERS];
    unsigned char status[MEMBERS];
    for (int m = 0; m < MEMBERS; ++m) {
        own(m, &params[m], &h[m]);
        for (int i = 0; i < DIM; ++i) x[i * MEMBERS + m] = start[i];
    }
    x[5] = nan("");
    EXPECT(EACH(params, x, MEMBERS, h, (size_t)steps, (size_t)stride, frames, status) == F(BAD_ARGUMENT));
    for (int m = 0; m < MEMBERS; ++m) {
        EXPECT(status[m] == (m == 5 ? F(BAD_ARGUMENT) : F(OK)));
        EXPECT(isnan(frames[m]) == (m == 5));
        if (m == 5) continue;
        for (int i = 0; i < DIM; ++i) x0[i] = start[i];
        EXPECT(F(init)(&singles, &params[m], x0) == F(OK));
        for (int k = 1; k <= steps; ++k) {
            EXPECT(F(step)(&singles, h[m]) == F(OK));
            if (k % stride != 0) continue;
            for (int i = 0; i < DIM; ++i) end[i] = frames[((k / stride - 1) * DIM + i) * MEMBERS + m];
            EXPECT(close_to(end, singles.x, 1e-13));
        }
        for (int i = 0; i < DIM; ++i) end[i] = x[i * MEMBERS + m];
        EXPECT(close_to(end, singles.x, 1e-13));
    }
}

int main(void)
{
    block_equals_steps(1, 0);
    block_equals_steps(30, 0);
    block_equals_steps(200, 1);
#if MARCHES && !TIMED
    march_goes_on();
#endif
    integrate_equals_steps(1);
    integrate_equals_steps(7);
    integrate_equals_steps(301);
#if GROUPS
    group_equals_steps(150);
    group_fits();
    increments_are_corrected();
    far_guesses_are_not_used();
#endif
    ensemble_equals_steps(40);
    members_have_their_own(40, 13);
    return 0;
}
