/* The runtime with the pendulum: what holds for each kind of step. */
#include "runtime.c"

#include <float.h>
#include <stdio.h>
#include <stdlib.h>

#define EXPECT(condition) \
    do { \
        if (!(condition)) { \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
            exit(1); \
        } \
    } while (0)

#if PHI_GAUGE
#define PHI_NONE NULL, /* no gauge is given */
#else
#define PHI_NONE
#endif

static const double start[2] = { 1.0, 0.2 }, H = 0.05;

static double apart(const double a[2], const double b[2]) { return fmax(fabs(a[0] - b[0]), fabs(a[1] - b[1])); }

static void refuses_what_is_not_allowed(void)
{
    const double nowhere[2] = { 0.0, (double)NAN };
    const phi_params wrong = { -1.0 };
    phi_solver s;
    EXPECT(phi_init(&s, NULL, nowhere) == PHI_BAD_ARGUMENT);
    EXPECT(phi_init(&s, &wrong, start) == PHI_BAD_ARGUMENT);
    EXPECT(phi_init(NULL, NULL, start) == PHI_BAD_ARGUMENT);
    EXPECT(phi_init(&s, NULL, start) == PHI_OK);
    EXPECT(phi_step(&s, (double)INFINITY) == PHI_BAD_ARGUMENT);
    EXPECT(s.steps == 0 && apart(s.x, start) <= 0.0);
    EXPECT(phi_status_string(PHI_SINGULAR)[0] == 's' && phi_solver_size() == sizeof s);
}

/* Time is counted without an error that adds up, through changes of the step; steps are undone where the method is symmetric. */
static void counts_time(void)
{
    phi_solver s;
    EXPECT(phi_init(&s, NULL, start) == PHI_OK);
    EXPECT(phi_integrate(&s, 0.1, 1000) == PHI_OK);
    EXPECT(fabs(s.t - 100.0) <= 0.0);
    for (int k = 0; k < 20; ++k) EXPECT(phi_step(&s, 0.2) == PHI_OK);
    EXPECT(fabs(s.t - 104.0) <= 1e-13 && s.steps == 1020 && phi_solver_steps_done(&s) == 1020);
    for (int k = 0; k < 20; ++k) EXPECT(phi_step(&s, -0.2) == PHI_OK);
    EXPECT(phi_integrate(&s, -0.1, 1000) == PHI_OK);
    EXPECT(PHI_EXPLICIT || apart(s.x, start) < 1e-11);
}

static void keeps_energy(void)
{
    phi_solver s;
    EXPECT(phi_init(&s, NULL, start) == PHI_OK);
    const double before = phi_hamiltonian(NULL, start);
    for (int k = 0; k < 100; ++k) {
        EXPECT(phi_integrate(&s, H, 100) == PHI_OK);
        EXPECT(fabs(phi_hamiltonian(NULL, s.x) - before) < (PHI_EXPLICIT ? 0.05 : PHI_COMPOSED ? 2e-5 : 1e-3));
    }
}

/* A kick there and back, and a state set to what it is, leave a trajectory that differs by rounding only; time, gauge and
   steps go on. Guesses move along, so that a small kick costs no more evaluations than two steps do; those of Gauss methods begin anew. */
static void is_moved_from_outside(void)
{
    const double there[2] = { 0.01, -0.02 }, back[2] = { -0.01, 0.02 }, nowhere[2] = { 0.0, (double)NAN };
    phi_solver s, kicked;
    EXPECT(phi_init(&s, NULL, start) == PHI_OK);
    EXPECT(phi_integrate(&s, H, 400) == PHI_OK);
    kicked = s;
    EXPECT(phi_kick(&kicked, there) == PHI_OK && fabs(kicked.x[0] - (s.x[0] + 0.01)) <= 1e-15);
    EXPECT(phi_kick(&kicked, back) == PHI_OK && apart(kicked.x, s.x) <= 1e-15);
    EXPECT(phi_set_state(&kicked, kicked.x) == PHI_OK);
    const size_t before = kicked.evaluations;
    EXPECT(phi_step(&kicked, H) == PHI_OK && phi_step(&s, H) == PHI_OK);
    EXPECT(PHI_GAUSS || kicked.evaluations - before <= 2 * PHI_ALL_STAGES(1));
    EXPECT(phi_integrate(&kicked, H, 300) == PHI_OK && phi_integrate(&s, H, 300) == PHI_OK);
    EXPECT(apart(kicked.x, s.x) < 1e-12 && kicked.steps == s.steps && fabs(kicked.t - s.t) <= 0.0);
    EXPECT(phi_kick(&kicked, start) == PHI_OK && phi_integrate(&kicked, H, 100) == PHI_OK);
    EXPECT(phi_init(&s, NULL, kicked.x) == PHI_OK && phi_set_state(&kicked, start) == PHI_OK);
    EXPECT(phi_set_state(&kicked, s.x) == PHI_OK);
    EXPECT(phi_integrate(&kicked, H, 100) == PHI_OK && phi_integrate(&s, H, 100) == PHI_OK);
    EXPECT(apart(kicked.x, s.x) < 1e-12);
    s = kicked;
    EXPECT(phi_kick(&kicked, nowhere) == PHI_BAD_ARGUMENT && phi_set_state(&kicked, nowhere) == PHI_BAD_ARGUMENT);
    EXPECT(phi_kick(NULL, there) == PHI_BAD_ARGUMENT && phi_set_state(&kicked, NULL) == PHI_BAD_ARGUMENT);
    EXPECT(memcmp(&s, &kicked, sizeof s) == 0);
}

/* Blocks, groups and packs are single steps; all kinds of the midpoint rule are one method, whose values are known. */
static void many_are_one(void)
{
    enum { MEMBERS = 41, STEPS = 200 };
    static double x[2 * MEMBERS];
    unsigned char status[MEMBERS];
    phi_solver one, many;
    for (int m = 0; m < MEMBERS; ++m)
        for (int i = 0; i < 2; ++i) x[i * MEMBERS + m] = start[i] * (1.0 + 0.01 * m);
    EXPECT(phi_ensemble(NULL, x, MEMBERS, H, STEPS, status) == PHI_OK);
    for (int m = 0; m < MEMBERS; ++m) {
        const double x0[2] = { start[0] * (1.0 + 0.01 * m), start[1] * (1.0 + 0.01 * m) };
        const double end[2] = { x[m], x[MEMBERS + m] };
        EXPECT(phi_init(&one, NULL, x0) == PHI_OK && phi_init(&many, NULL, x0) == PHI_OK);
        for (int k = 0; k < STEPS; ++k) EXPECT(phi_step(&one, H) == PHI_OK);
        EXPECT(phi_integrate(&many, H, STEPS) == PHI_OK);
        EXPECT(status[m] == PHI_OK && apart(end, one.x) < 2e-13 && apart(many.x, one.x) < 2e-13);
        EXPECT(one.steps == many.steps && fabs(one.t - many.t) <= 0.0);
    }
    EXPECT(phi_init(&one, NULL, start) == PHI_OK && phi_integrate(&one, H, 10) == PHI_OK);
    printf("%.13f %.13f\n", one.x[0], one.x[1]);
}

/* Where no step can be made, the state stays as it is, and the ensemble says which member it was. */
static void failures_change_nothing(void)
{
    const double far[2] = { 1e300, 1e300 };
    double x[4] = { 1.0, 1e300, 0.2, 1e300 };
    unsigned char status[2];
    phi_solver s;
    EXPECT(phi_init(&s, NULL, far) == PHI_OK);
    EXPECT(phi_step(&s, 1e300) != PHI_OK);
    EXPECT(s.steps == 0 && apart(s.x, far) <= 0.0);
    EXPECT(phi_ensemble(NULL, x, 2, 1e300, 3, status) != PHI_OK && status[1] != PHI_OK);
    EXPECT(phi_ensemble(NULL, NULL, 2, H, 1, NULL) == PHI_BAD_ARGUMENT);
}

#if PHI_GAUGE
/* The least error is found to the finest mesh, 1/512 of the widths 2; without a search the first guess is taken, and one's
   own multiples if they are given. */
static void gauge_is_the_best_or_that_given(void)
{
    const double given[2] = { 7.0, -3.0 }, nothing[2] = { 0.0, (double)NAN };
    phi_solver s;
    EXPECT(phi_init(&s, NULL, start) == PHI_OK);
#if PHI_GAUGE_SEARCH
    EXPECT(fabs(s.gauge[0] - 0.25) < 4e-3 && fabs(s.gauge[1] + 1.5) < 4e-3);
#else
    EXPECT(fabs(s.gauge[0] - 0.125) <= 0.0 && fabs(s.gauge[1] - 0.5) <= 0.0);
#endif
    EXPECT(phi_init_gauge(&s, NULL, start, nothing) == PHI_BAD_ARGUMENT);
    EXPECT(phi_init_gauge(&s, NULL, start, given) == PHI_OK && apart(s.gauge, given) <= 0.0);
}

#endif
#if PHI_TANGENT
/* The derivative of a step has determinant 1, and is that of differences. */
static void tangent_is_the_derivative(void)
{
    double tangent[4], ends[2][2];
    phi_solver s;
    EXPECT(phi_init(&s, NULL, start) == PHI_OK && phi_step_tangent(&s, H, tangent) == PHI_OK);
    EXPECT(fabs(tangent[0] * tangent[3] - tangent[1] * tangent[2] - 1.0) < 1e-14);
    for (int j = 0; j < 2; ++j) {
        for (int side = 0; side < 2; ++side) {
            double x[2] = { start[0], start[1] };
            x[j] += side ? 1e-6 : -1e-6;
            EXPECT(phi_init(&s, NULL, x) == PHI_OK && phi_step(&s, H) == PHI_OK);
            memcpy(ends[side], s.x, sizeof s.x);
        }
        for (int i = 0; i < 2; ++i) EXPECT(fabs((ends[1][i] - ends[0][i]) / 2e-6 - tangent[2 * i + j]) < 1e-9);
    }
}

#endif
#if PHI_ADJOINT
enum { RUN = 25, STRIDE = 10 }; /* rows after 10, 20 and 25 steps */
static const double weight[6] = { 0.3, -1.2, 0.7, 0.4, -0.2, 1.1 };

/* The weighted sum of rows. */
static double weighed(const double x0[2], double g)
{
    const phi_params params = { g };
    double sum = 0.0;
    phi_solver s;
    EXPECT(phi_init(&s, &params, x0) == PHI_OK);
    for (int k = 1, row = 0; k <= RUN; ++k) {
        EXPECT(phi_step(&s, H) == PHI_OK);
        if (k % STRIDE != 0 && k != RUN) continue;
        sum += weight[2 * row] * s.x[0] + weight[2 * row + 1] * s.x[1];
        ++row;
    }
    return sum;
}

/* The pull-back of a run, along state and parameters, is that of differences; one step is a run of one. */
static void pullback_is_the_gradient(void)
{
    double rows[6], x0_bar[2], trail[RUN * PHI_TRAIL], bar[2] = { 0.5, -2.0 }, same[2], slope;
    phi_params params_bar = { 0.0 }, own = { 0.0 }, other = { 0.0 };
    phi_solver s, t;
    EXPECT(phi_init(&s, NULL, start) == PHI_OK);
    t = s;
    EXPECT(phi_pullback(&s, H, RUN, STRIDE, rows, weight, x0_bar, &params_bar, trail) == PHI_OK);
    EXPECT(phi_integrate(&t, H, RUN) == PHI_OK && fabs(rows[4] - t.x[0]) < 1e-14 && rows[5] == s.x[1]);
    EXPECT(s.steps == RUN && fabs(s.t - RUN * H) < 1e-14);
    for (int j = 0; j < 3; ++j) {
        double x[2] = { start[0], start[1] }, g = phi_default_params.g, ends[2];
        for (int side = 0; side < 2; ++side) {
            const double by = side ? 1e-6 : -1e-6;
            ends[side] = j < 2 ? weighed((double[2]){ x[0] + (j == 0 ? by : 0.0), x[1] + (j == 1 ? by : 0.0) }, g) : weighed(x, g + by);
        }
        slope = (ends[1] - ends[0]) / 2e-6;
        EXPECT(fabs((j < 2 ? x0_bar[j] : params_bar.g) - slope) < 1e-8);
    }
    t = s;
    EXPECT(phi_pullback(&t, H, 1, 1, NULL, bar, same, &own, trail) == PHI_OK);
    EXPECT(phi_step_adjoint(&s, H, bar, bar, &other) == PHI_OK && bar[0] == same[0] && bar[1] == same[1]);
    EXPECT(own.g == other.g && s.x[0] == t.x[0] && s.steps == RUN + 1);
    const phi_solver before = s;
    EXPECT(phi_step_adjoint(&s, (double)NAN, bar, bar, &other) == PHI_BAD_ARGUMENT);
    EXPECT(memcmp(&s, &before, sizeof s) == 0 && bar[0] == same[0] && own.g == other.g);
    EXPECT(phi_step_adjoint(&s, H, bar, NULL, NULL) == PHI_BAD_ARGUMENT);
}

#endif
#if PHI_ADJOINT && PHI_EACH
/* Members with parameters and steps of their own are pulled back as each is alone. Those that have no state, no step or no
   end cost themselves only: what they were to get stays as it was. */
static void gradients_of_members_are_their_own(void)
{
    enum { MEMBERS = 37, BAD = 3, NO_STEP = 20, LOST = 33, NUMBERS = 6 * MEMBERS };
    static double x[2 * MEMBERS], h[MEMBERS], bars[NUMBERS], rows[NUMBERS], x0_bar[2 * MEMBERS];
    phi_params params[MEMBERS], params_bar[MEMBERS];
    static double trail[RUN * PHI_TRAIL_EACH];
    double own_rows[6], own_bar[2];
    unsigned char status[MEMBERS];
    for (int m = 0; m < MEMBERS; ++m) {
        params[m].g = 1.5 + 0.01 * m;
        params_bar[m].g = 7.0;
        h[m] = m == NO_STEP ? (double)NAN : H * (1.0 + 0.01 * m);
        for (int i = 0; i < 2; ++i) x[2 * m + i] = start[i] * (1.0 - 0.02 * m);
        for (int i = 0; i < 2; ++i) x0_bar[2 * m + i] = 9.0;
        for (int i = 0; i < 6; ++i) bars[6 * m + i] = m == LOST ? 0.0 : weight[i] + 0.1 * m;
    }
    x[2 * BAD] = (double)NAN;
    x[2 * LOST + 1] = DBL_MAX / ((RUN - 0.25) * h[LOST]); /* infinite after the last step, unlike the derivatives */
    EXPECT(phi_pullback_each(params, x, MEMBERS, PHI_NONE h, RUN, STRIDE, rows, bars, x0_bar, params_bar, trail, status) != PHI_OK);
    for (int m = 0; m < MEMBERS; ++m) {
        phi_params own = { 7.0 };
        phi_solver s;
        const int fails = m == BAD || m == NO_STEP || m == LOST;
        EXPECT((status[m] != PHI_OK) == fails);
        EXPECT(!fails || (x0_bar[2 * m] == 9.0 && x0_bar[2 * m + 1] == 9.0 && params_bar[m].g == 7.0));
        if (fails) continue;
        EXPECT(phi_init(&s, &params[m], &x[2 * m]) == PHI_OK);
        EXPECT(phi_pullback(&s, h[m], RUN, STRIDE, own_rows, &bars[6 * m], own_bar, &own, trail) == PHI_OK);
        for (int i = 0; i < 6; ++i) EXPECT(fabs(rows[6 * m + i] - own_rows[i]) < 1e-14);
        EXPECT(apart(&x0_bar[2 * m], own_bar) < 1e-13 && fabs(params_bar[m].g - own.g) < 1e-13);
    }
    EXPECT(phi_pullback_each(params, x, 0, PHI_NONE h, RUN, 0, NULL, NULL, NULL, NULL, NULL, NULL) == PHI_OK);
    EXPECT(phi_pullback_each(params, x, 1, PHI_NONE h, RUN, 0, NULL, bars, x0_bar, NULL, trail, NULL) == PHI_BAD_ARGUMENT);
}

#endif
int main(void)
{
    refuses_what_is_not_allowed();
    counts_time();
    keeps_energy();
    is_moved_from_outside();
    many_are_one();
    failures_change_nothing();
#if PHI_GAUGE
    gauge_is_the_best_or_that_given();
#endif
#if PHI_TANGENT
    tangent_is_the_derivative();
#endif
#if PHI_ADJOINT
    pullback_is_the_gradient();
#endif
#if PHI_ADJOINT && PHI_EACH
    gradients_of_members_are_their_own();
#endif
    return 0;
}
