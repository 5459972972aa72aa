/* DOP853 with the step size control of its authors (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations
   I). The error estimate combines estimates of order 5 and 3; a step size shrinks at most to a third, and grows at most
   sixfold. */
typedef struct {
    double slope[DIM], h;
    long steps, evaluations;
} controlled;

static void control_start(controlled *c, const double x[DIM], double tolerance)
{
    field(x, c->slope);
    c->h = 0.01 * pow(tolerance, 0.125);
    c->steps = 0;
    c->evaluations = 1;
}

/* The local error of a step divided by the tolerance, which is both the relative and the absolute tolerance. */
INLINE double error_of(const double (*k)[DIM], const double x[DIM], const double y[DIM], double h, double tolerance)
{
    double five = 0.0, three = 0.0;
    for (int i = 0; i < DIM; ++i) {
        double a = 0.0, b = 0.0;
        const double scale = tolerance * (1.0 + fmax(fabs(x[i]), fabs(y[i])));
#pragma GCC unroll 16
        for (int s = 0; s < 12; ++s) {
            if (dop853_e5[s] != 0.0) a += dop853_e5[s] * k[s][i];
            if (dop853_e3[s] != 0.0) b += dop853_e3[s] * k[s][i];
        }
        five += a * a / (scale * scale);
        three += b * b / (scale * scale);
    }
    return five > 0.0 ? h * five / sqrt((five + 0.01 * three) * DIM) : 0.0;
}

/* Make one accepted step, at most up to the time `end`; return the new time, or NaN if steps become too small. */
static double control_step(controlled *c, double x[DIM], double t, double end, double tolerance)
{
    for (int rejected = 0;; rejected = 1) {
        const double h = t + 1.0000001 * c->h > end ? end - t : c->h;
        double k[12][DIM], y[DIM];
        memcpy(k[0], c->slope, sizeof k[0]);
#pragma GCC unroll 16
        for (int s = 1; s <= 12; ++s) {
            const double *w = s < 12 ? dop853_a + s * 12 : dop853_b;
            memcpy(y, x, sizeof y);
#pragma GCC unroll 16
            for (int j = 0; j < (s < 12 ? s : 12); ++j)
                if (w[j] != 0.0)
                    for (int i = 0; i < DIM; ++i) y[i] += h * w[j] * k[j][i];
            if (s < 12) field(y, k[s]);
        }
        const double error = error_of(k, x, y, h, tolerance);
        const double factor = error > 0.0 ? 0.9 * pow(error, -0.125) : 6.0;
        c->evaluations += 11;
        if (!(error < 1.0)) { /* also if the error is not a number */
            c->h = h * (factor > 1.0 / 3.0 ? factor : 1.0 / 3.0);
            if (!(c->h > 1e-14 * (1.0 + t))) return NAN;
            continue;
        }
        memcpy(x, y, sizeof y);
        field(x, c->slope);
        ++c->evaluations;
        ++c->steps;
        if (h == c->h || factor < 1.0) c->h = h * fmin(rejected ? 1.0 : 6.0, factor);
        return h < end - t ? t + h : end;
    }
}

/* Integrate as measure_run of run_peers.h does, but with a tolerance instead of a step size, and with the time `span`
   of a chunk instead of a number of steps. */
int measure_controlled(const double *start, double tolerance, double span, long chunks, double limit, double *out,
                       double *seconds, double *evaluations, double *steps)
{
    double x[DIM];
    controlled c;
    memcpy(x, start, sizeof x);
    const double began = cpu_time(), started = wall_time();
    int status = OK;
    control_start(&c, x, tolerance);
    for (long n = 0; n < chunks && status == OK; ++n) {
        for (double t = 0.0; t < span;) t = control_step(&c, x, t, span, tolerance);
        for (int i = 0; i < DIM; ++i) {
            out[n * DIM + i] = x[i];
            if (!(fabs(x[i]) < 1e9)) status = NOT_FINITE;
        }
        if (wall_time() - started > limit) status = n + 1 < chunks ? TOO_SLOW : OK;
    }
    *seconds = cpu_time() - began;
    *evaluations = (double)c.evaluations;
    *steps = (double)c.steps;
    return status;
}

/* Write the states after all steps up to the time `end`, at most `most` states; return their number. */
long follow_controlled(const double *start, double tolerance, double end, long most, double *out)
{
    double x[DIM], t = 0.0;
    long n = 0;
    controlled c;
    memcpy(x, start, sizeof x);
    control_start(&c, x, tolerance);
    while (t < end && n < most) {
        t = control_step(&c, x, t, end, tolerance);
        memcpy(out + n++ * DIM, x, sizeof x);
    }
    return n;
}
