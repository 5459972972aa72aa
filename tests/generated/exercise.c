/* Every function of a generated solver, its failures included: to be run under sanitizers and valgrind.
   Compile with -DNAME=… -DHEADER="…" -DSTEP=…, -DSTATE="…" (initial values separated by commas). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include HEADER

#define GLUE2(a, b) a##_##b
#define GLUE(a, b) GLUE2(a, b)
#define F(name) GLUE(NAME, name)
#define DIM F(DIM)
#define MEMBERS 17 /* two batches where steps have them, though one member fails */

#define EXPECT(condition) \
    do { \
        if (!(condition)) { \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
            exit(1); \
        } \
    } while (0)

static const double start[DIM] = { STATE };

static void same(const double *a, const double *b) { EXPECT(memcmp(a, b, DIM * sizeof *a) == 0); }

static void observables(const F(params) *params)
{
    double field[DIM], casimirs[F(CASIMIRS) + 1];
    casimirs[F(CASIMIRS)] = 42.0;
    EXPECT(isfinite(F(hamiltonian)(params, start)));
    F(vector_field)(params, start, field);
    for (int i = 0; i < DIM; ++i) EXPECT(isfinite(field[i]));
    F(casimirs)(params, start, casimirs);
    for (int i = 0; i < F(CASIMIRS); ++i) EXPECT(isfinite(casimirs[i]));
    EXPECT(casimirs[F(CASIMIRS)] == 42.0);
}

static void bad_arguments(void)
{
    F(solver) s;
    double bad[DIM];
    memcpy(bad, start, sizeof bad);
    EXPECT(F(init)(NULL, NULL, start) == F(BAD_ARGUMENT));
    EXPECT(F(init)(&s, NULL, NULL) == F(BAD_ARGUMENT));
    bad[DIM - 1] = nan("");
    EXPECT(F(init)(&s, NULL, bad) == F(BAD_ARGUMENT));
    bad[DIM - 1] = HUGE_VAL;
    EXPECT(F(init)(&s, NULL, bad) == F(BAD_ARGUMENT));
    EXPECT(F(step)(NULL, STEP) == F(BAD_ARGUMENT));
    EXPECT(F(init)(&s, NULL, start) == F(OK));
    EXPECT(F(step)(&s, nan("")) == F(BAD_ARGUMENT));
    EXPECT(F(step)(&s, HUGE_VAL) == F(BAD_ARGUMENT));
    EXPECT(F(integrate)(NULL, STEP, 3) == F(BAD_ARGUMENT));
    EXPECT(F(integrate)(&s, nan(""), 5) == F(BAD_ARGUMENT));
    same(s.x, start);
    EXPECT(s.steps == 0);
    EXPECT(F(ensemble)(NULL, NULL, 3, STEP, 1, NULL) == F(BAD_ARGUMENT));
}

/* Steps of no size at all are refused, however few of them. */
static void bad_steps(void)
{
    const double sizes[] = { nan(""), HUGE_VAL, -HUGE_VAL };
    for (int k = 0; k < 3; ++k) {
        F(solver) s;
        double x[2 * DIM];
        unsigned char status[2] = { 99, 99 };
        for (int i = 0; i < DIM; ++i) x[2 * i] = x[2 * i + 1] = start[i];
        EXPECT(F(init)(&s, NULL, start) == F(OK));
        EXPECT(F(step)(&s, sizes[k]) == F(BAD_ARGUMENT));
        EXPECT(F(ensemble)(NULL, x, 0, sizes[k], 0, NULL) == F(BAD_ARGUMENT));
        for (size_t steps = 0; steps < 40; steps += 13) {
            EXPECT(F(integrate)(&s, sizes[k], steps) == F(BAD_ARGUMENT));
            EXPECT(F(integrate)(NULL, STEP, steps) == F(BAD_ARGUMENT));
            EXPECT(F(ensemble)(NULL, x, 2, sizes[k], steps, status) == F(BAD_ARGUMENT));
            EXPECT(status[0] == F(BAD_ARGUMENT) && status[1] == F(BAD_ARGUMENT));
        }
        same(s.x, start);
        EXPECT(s.steps == 0);
        for (int i = 0; i < DIM; ++i) EXPECT(x[2 * i] == start[i] && x[2 * i + 1] == start[i]);
    }
}

/* Parameters that are not finite are refused, and what was there stands. */
static void bad_parameters(void)
{
    F(solver) s, before;
    memset(&s, 42, sizeof s);
    before = s;
    enum { COUNT = sizeof(F(params)) / sizeof(double) };
    for (int k = 0; k < COUNT; ++k) {
        const double values[] = { nan(""), HUGE_VAL, -HUGE_VAL };
        for (int v = 0; v < 3; ++v) {
            union {
                F(params) params;
                double value[COUNT + 1];
            } given = { F(default_params) };
            given.value[k] = values[v];
            EXPECT(F(init)(&s, &given.params, start) == F(BAD_ARGUMENT));
        }
    }
    EXPECT(memcmp(&s, &before, sizeof s) == 0);
}

/* Arguments may be parts of the solver or overlap: what comes out is what comes from separate ones. */
static void aliases(void)
{
    F(solver) s, b;
    F(params) params = F(default_params);
    double field[DIM], casimirs[F(CASIMIRS) + 1], both[DIM + F(CASIMIRS) + 1];
    EXPECT(F(init)(&s, &params, start) == F(OK));
    b = s;
    EXPECT(F(init)(&b, &b.params, b.x) == F(OK));
    EXPECT(memcmp(&b, &s, sizeof s) == 0);
    memcpy(b.carry, start, sizeof start);
    EXPECT(F(init)(&b, &params, b.carry) == F(OK));
    EXPECT(memcmp(&b, &s, sizeof s) == 0);
    F(vector_field)(&params, start, field);
    F(casimirs)(&params, start, casimirs);
    for (int shift = 0; shift < 2; ++shift) {
        memcpy(both, start, sizeof start);
        F(vector_field)(&params, both, both + shift * (F(CASIMIRS) > 0));
        same(both + shift * (F(CASIMIRS) > 0), field);
        memcpy(both, start, sizeof start);
        F(casimirs)(&params, both, both + shift);
        EXPECT(memcmp(both + shift, casimirs, F(CASIMIRS) * sizeof(double)) == 0);
    }
    b = s;
    EXPECT(F(integrate)(&s, STEP, 3) == F(OK));
    EXPECT(F(ensemble)(&b.params, b.x, 1, STEP, 3, NULL) == F(OK));
    same(b.x, s.x);
    b = s;
    EXPECT(F(set_state)(&b, b.x) == F(OK));
    same(b.x, s.x);
    for (int i = 0; i < DIM; ++i) b.x[i] = b.carry[i] = 0x1p-40 * s.x[i];
    EXPECT(F(kick)(&b, b.carry) == F(OK)); /* x + change + carry */
    for (int i = 0; i < DIM; ++i) EXPECT(fabs(b.x[i] - 3.0 * 0x1p-40 * s.x[i]) <= 1e-15 * fabs(b.x[i]));
    b = s;
    F(vector_field)(&b.params, b.x, b.x);
    F(vector_field)(&s.params, s.x, field);
    same(b.x, field);
}

static void steps(void)
{
    F(solver) s, branch;
    EXPECT(F(init)(&s, &F(default_params), start) == F(OK));
    EXPECT(F(integrate)(&s, STEP, 0) == F(OK));
    same(s.x, start);
    EXPECT(F(integrate)(&s, STEP, 50) == F(OK));
    EXPECT(s.steps == 50 && F(solver_steps_done)(&s) == 50);
    branch = s;
    EXPECT(F(integrate)(&s, STEP, 20) == F(OK));
    EXPECT(F(integrate)(&branch, STEP, 20) == F(OK));
    same(s.x, branch.x);
    EXPECT(F(step)(&s, -0.5 * STEP) == F(OK));
    EXPECT(F(step)(&s, 0.0) == F(OK));
    EXPECT(F(step)(&s, -0.0) == F(OK));
    EXPECT(F(step)(&s, 1e-300) == F(OK));
    EXPECT(F(solver_size)() == sizeof s);
}

static void huge_steps(void)
{
    const double factors[] = { 1e1, 1e2, 1e3, 1e6, 1e20, 1e150, 1e300, -1e3, -1e300 };
    for (size_t k = 0; k < sizeof factors / sizeof *factors; ++k) {
        F(solver) s;
        EXPECT(F(init)(&s, NULL, start) == F(OK));
        EXPECT(F(integrate)(&s, STEP, 5) == F(OK));
        double before[DIM];
        const size_t count = s.steps;
        memcpy(before, s.x, sizeof before);
        const F(status) status = F(step)(&s, STEP * factors[k]);
        EXPECT(status <= F(NOT_FINITE));
        for (int i = 0; i < DIM; ++i) EXPECT(isfinite(s.x[i]));
        if (status != F(OK)) {
            same(s.x, before);
            EXPECT(s.steps == count);
            EXPECT(F(integrate)(&s, STEP, 5) == F(OK));
        }
    }
}

static void ensemble(void)
{
    double x[DIM * MEMBERS];
    unsigned char status[MEMBERS];
    for (int i = 0; i < DIM; ++i)
        for (int m = 0; m < MEMBERS; ++m) x[i * MEMBERS + m] = start[i];
    x[2] = nan("");
    memset(status, 255, sizeof status);
    EXPECT(F(ensemble)(NULL, x, 0, STEP, 3, NULL) == F(OK));
    EXPECT(F(ensemble)(NULL, NULL, 0, STEP, 3, NULL) == F(OK));
    EXPECT(F(ensemble)(&F(default_params), x, MEMBERS, STEP, 3, status) == F(BAD_ARGUMENT));
    for (int m = 0; m < MEMBERS; ++m) EXPECT(status[m] == (m == 2 ? F(BAD_ARGUMENT) : F(OK)));
    F(solver) s;
    EXPECT(F(init)(&s, NULL, start) == F(OK));
    EXPECT(F(integrate)(&s, STEP, 3) == F(OK));
    for (int i = 0; i < DIM; ++i) EXPECT(fabs(x[i * MEMBERS + 6] - s.x[i]) <= 1e-14 * (1.0 + fabs(s.x[i])));
    EXPECT(isnan(x[2]));
    EXPECT(F(ensemble)(NULL, x, MEMBERS, STEP, 0, NULL) == F(BAD_ARGUMENT));
}

int main(void)
{
    observables(NULL);
    observables(&F(default_params));
    bad_arguments();
    bad_steps();
    bad_parameters();
    aliases();
    steps();
    huge_steps();
    ensemble();
    for (int k = 0; k < 8; ++k) EXPECT(strlen(F(status_string)((F(status))k)) > 1);
    EXPECT(strlen(F(PHIGEN_VERSION)) > 0 && strlen(F(SPEC_SHA256)) == 64 && F(ORDER) > 0);
    return 0;
}
