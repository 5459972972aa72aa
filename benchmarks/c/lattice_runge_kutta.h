/* Explicit Runge-Kutta methods of fixed step on a ring of N sites with FIELDS fields, in plain C. Each field is an
   array with a halo, a copy of the opposite end, on both sides. Each stage is one vectorised loop over the sites. */
enum { HALO = 8, WIDTH = N + 2 * HALO };
typedef double state[FIELDS][WIDTH];

static state x, stages[MOST_STAGES], at;

static void ends(state y)
{
    for (int f = 0; f < FIELDS; ++f) {
        y[f][HALO - 1] = y[f][HALO + N - 1];
        y[f][HALO + N] = y[f][HALO];
    }
}

/* Set `to` to x + h sum_j w[j] stages[j]. The weights are constants, so the loop over j unrolls and zeros vanish. */
INLINE void sum_up(state to, int count, const double *w, double h)
{
    for (int f = 0; f < FIELDS; ++f)
        for (int i = HALO; i < HALO + N; ++i) {
            double sum = 0.0;
#pragma GCC unroll 16
            for (int j = 0; j < count; ++j)
                if (w[j] != 0.0) sum += w[j] * stages[j][f][i];
            to[f][i] = x[f][i] + h * sum;
        }
}

INLINE void runge_kutta(int count, const double *a, const double *b, double h, long steps)
{
    for (long n = 0; n < steps; ++n) {
#pragma GCC unroll 16
        for (int s = 0; s < count; ++s) {
            sum_up(at, s, a + s * count, h);
            ends(at);
            field(at, stages[s]);
        }
        sum_up(x, count, b, h);
    }
}

static void rk4(double h, long steps) { runge_kutta(4, rk4_a, rk4_b, h, steps); }
static void dop853(double h, long steps) { runge_kutta(12, dop853_a, dop853_b, h, steps); }
