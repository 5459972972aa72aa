/* Ensembles in packs against single trajectories, from inside the generated file.
   Compile with -DNAME=… -DSOURCE="…" -DSTEP=…, -DULPS=…, -DSTATE="…" (initial values separated by commas), and -DFAR=…,
   for a factor of the step at which functions of flows leave the polynomials that are used near 0. */
#include <float.h>
#include <stdio.h>
#include <stdlib.h>

#include SOURCE

#define GLUE2(a, b) a##_##b
#define GLUE(a, b) GLUE2(a, b)
#define F(name) GLUE(NAME, name)
#define DIM F(DIM)
#define MOST 77

#define EXPECT(condition) \
    do { \
        if (!(condition)) { \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
            exit(1); \
        } \
    } while (0)

static const double start[DIM] = { STATE };
static double x[DIM * MOST];
static unsigned char status[MOST];

/* Members of different states, in order; no two of them are close. */
static void member(int m, double x0[DIM])
{
    for (int i = 0; i < DIM; ++i) x0[i] = start[i] * (1.0 + 1e-3 * m);
}

static void fill(int members)
{
    double x0[DIM];
    for (int m = 0; m < members; ++m) {
        member(m, x0);
        for (int i = 0; i < DIM; ++i) x[i * members + m] = x0[i];
        status[m] = 99;
    }
}

/* Member m is where steps from x0 lead, as far as they do, up to units of the last place of its largest coordinate. */
static void expect_own_steps(
    int members, int m, const F(params) *params, const double x0[DIM], double h, int steps, double ulps)
{
    F(solver) s;
    double size = 0.0;
    F(status) expected = F(init)(&s, params, x0);
    for (int k = 0; k < steps && expected == F(OK); ++k) expected = F(step)(&s, h);
    EXPECT(status[m] == expected);
    for (int i = 0; i < DIM; ++i) size = fmax(size, fabs(s.x[i]));
    for (int i = 0; i < DIM; ++i) EXPECT(fabs(s.x[i] - x[i * members + m]) <= ulps * DBL_EPSILON * size);
}

static void expect_steps(int members, int m, const double x0[DIM], double h, int steps, double ulps)
{
    expect_own_steps(members, m, NULL, x0, h, steps, ulps);
}

static void members_equal_steps(int members, double h, int steps, double ulps)
{
    double x0[DIM];
    fill(members);
    EXPECT(F(ensemble)(NULL, x, (size_t)members, h, (size_t)steps, status) == F(OK));
    for (int m = 0; m < members; ++m) {
        member(m, x0);
        expect_steps(members, m, x0, h, steps, ulps);
    }
}

/* A member that has no state, and one whose first step leaves the numbers, keep theirs and do not disturb the others,
   though these may go the longer way with it, by other versions of the functions. */
static void failures_stay_alone(int members, int steps)
{
    double x0[DIM];
    const int bad = members / 3, large = members / 2;
    fill(members);
    x[bad] = (double)NAN;
    for (int i = 0; i < DIM; ++i) x[i * members + large] = i % 2 ? -1e308 : 1e308;
    EXPECT(F(ensemble)(NULL, x, (size_t)members, STEP, (size_t)steps, status) == F(BAD_ARGUMENT));
    EXPECT(status[bad] == F(BAD_ARGUMENT));
    EXPECT(isnan(x[bad]));
    for (int m = 0; m < members; ++m) {
        if (m == bad) continue;
        member(m, x0);
        for (int i = 0; i < DIM && m == large; ++i) x0[i] = i % 2 ? -1e308 : 1e308;
        expect_steps(members, m, x0, STEP, steps, ULPS + (FAR > 1 ? 4 : 0));
    }
}

/* Members with parameters and steps of their own, bit by bit on their own ways; one of them has no step. */
static void members_have_their_own(int members, int steps, int stride, double ulps)
{
    static F(params) params[MOST];
    static double frames[DIM * MOST], h[MOST];
    const int bad = members - 1;
    double x0[DIM], values[sizeof *params / sizeof(double) + 1];
    fill(members);
    for (int m = 0; m < members; ++m) {
        params[m] = F(default_params);
        memcpy(values, &params[m], sizeof *params);
        for (int k = 0; k < (int)(sizeof *params / sizeof(double)); ++k) values[k] *= 1.0 + 1e-3 * m;
        memcpy(&params[m], values, sizeof *params);
        h[m] = m == bad ? (double)NAN : STEP * (1.0 - 1e-3 * m);
    }
    const F(status) worst = F(ensemble_each)(params, x, (size_t)members, h, (size_t)steps, (size_t)stride, frames, status);
    EXPECT(worst == F(BAD_ARGUMENT) && status[bad] == worst && isnan(frames[bad]));
    for (int m = 0; m < members - 1; ++m) {
        member(m, x0);
        expect_own_steps(members, m, &params[m], x0, h[m], steps, ulps);
        x[m] = frames[m];
        for (int i = 1; i < DIM; ++i) x[i * members + m] = frames[i * members + m];
        expect_own_steps(members, m, &params[m], x0, h[m], stride, ulps);
    }
}

static F(group) group;
static F(members) all;

static void begin(double h, size_t steps)
{
    static double step;
    step = h;
    fill(F(GROUP));
    all = (F(members)){ .x = x, .members = F(GROUP), .steps = steps, .h = &step, .status = status };
    memset(&group, 0, sizeof group);
    group.packs = F(PACK_COUNT);
    for (int m = 0; m < F(GROUP); ++m) EXPECT(F(group_join)(&group, m, &all, 0) == F(OK));
}

/* The packs go through all steps: what ends well is not done by single steps. Members that do not fit the polynomials
   near 0 are not left to single steps either. */
static void groups_make_all_steps(double h)
{
    begin(h, 40);
    EXPECT(F(group_steps)(&group, 30) == F(GROUP));
    EXPECT(F(group_steps)(&group, 10) == F(GROUP));
    for (int m = 0; m < F(GROUP); ++m) EXPECT(group.steps_left[m] == 0);
#if FAR > 1
    EXPECT(group.full_range == (h != STEP));
#endif
}

/* A member that leaves the group makes the rest of its steps from where it was, with what rounding took from there. */
static void those_who_leave_go_on(void)
{
    double x0[DIM];
    const int m = F(LANES) + 3;
    begin(STEP, 70);
    EXPECT(F(group_steps)(&group, 40) == F(GROUP));
    EXPECT(group.steps_left[m] == 30);
    EXPECT(F(group_end)(&group, m, &all, 0, F(OK)) == F(OK));
    member(m, x0);
    expect_steps(F(GROUP), m, x0, STEP, 70, ULPS);
}

int main(void)
{
    const int counts[] = { 1, 2, 7, 8, 19, MOST };
    for (int k = 0; k < 6; ++k) members_equal_steps(counts[k], STEP, 70, ULPS);
    members_equal_steps(19, -STEP, 32, ULPS);
    members_equal_steps(19, FAR * STEP, 1, 100);
    members_equal_steps(9, STEP, 0, 0.0);
    failures_stay_alone(MOST, 40);
    members_have_their_own(MOST, 70, 41, ULPS);
    groups_make_all_steps(STEP);
    groups_make_all_steps(FAR * STEP);
    those_who_leave_go_on();
    EXPECT(F(ensemble)(NULL, NULL, 3, STEP, 1, NULL) == F(BAD_ARGUMENT));
    EXPECT(F(ensemble)(NULL, x, 0, STEP, 1, NULL) == F(OK));
    fill(9);
    EXPECT(F(ensemble)(NULL, x, 9, (double)NAN, 1, status) == F(BAD_ARGUMENT));
    EXPECT(status[8] == F(BAD_ARGUMENT));
    return 0;
}
