/* Explicit Runge-Kutta methods of fixed step. With constant tables all loops unroll and zero entries vanish. */

/* Compensation term of x for compensated sums, which cost DOP853 up to a fifth of its time. */
static real carry[DIM];

INLINE void runge_kutta(int stages, const double *a, const double *b, int compensated, real x[DIM], double h)
{
    real k[MOST_STAGES][DIM], y[DIM];
#pragma GCC unroll 16
    for (int s = 0; s < stages; ++s) {
        for (int i = 0; i < DIM; ++i) y[i] = x[i];
#pragma GCC unroll 16
        for (int j = 0; j < s; ++j)
            if (a[s * stages + j] != 0.0)
                for (int i = 0; i < DIM; ++i) y[i] += h * a[s * stages + j] * k[j][i];
        field(y, k[s]);
    }
    if (compensated) memcpy(y, carry, sizeof y);
    else memcpy(y, x, sizeof y);
#pragma GCC unroll 16
    for (int s = 0; s < stages; ++s)
        if (b[s] != 0.0)
            for (int i = 0; i < DIM; ++i) y[i] += h * b[s] * k[s][i];
    for (int i = 0; i < DIM; ++i) {
        const real old = x[i];
        x[i] = compensated ? old + y[i] : y[i];
        if (compensated) carry[i] = y[i] - (x[i] - old);
    }
}

static void rk4(real x[DIM], double h, long steps)
{
    for (long n = 0; n < steps; ++n) runge_kutta(4, rk4_a, rk4_b, 0, x, h);
}

static void dop853(real x[DIM], double h, long steps)
{
    for (long n = 0; n < steps; ++n) runge_kutta(12, dop853_a, dop853_b, 0, x, h);
}

static void dop853_compensated(real x[DIM], double h, long steps)
{
    for (long n = 0; n < steps; ++n) runge_kutta(12, dop853_a, dop853_b, 1, x, h);
}
