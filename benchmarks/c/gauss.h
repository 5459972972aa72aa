/* Gauss collocation, solved by fixed-point iteration to round-off; with one stage it is the implicit midpoint rule. The
   iteration starts from the collocation polynomial of the previous step, extrapolated. x is a compensated sum. */
static struct {
    int started, failed;
    long evaluations;
    real k[MOST_STAGES][DIM], carry[DIM];
} gauss;

INLINE void gauss_step(int stages, const real *a, const real *b, const real *extrapolation, real x[DIM], real h)
{
    real k[MOST_STAGES][DIM], y[DIM], previous = HUGE_VAL;
    if (!gauss.started) {
        field(x, k[0]);
        for (int s = 1; s < stages; ++s) memcpy(k[s], k[0], sizeof k[0]);
        gauss.started = 1;
    } else
        for (int s = 0; s < stages; ++s)
            for (int i = 0; i < DIM; ++i) {
                k[s][i] = 0;
                for (int j = 0; j < stages; ++j) k[s][i] += extrapolation[s * stages + j] * gauss.k[j][i];
            }
    int converged = 0;
    for (int iteration = 0; iteration < 200 && !converged; ++iteration) {
        real fresh[MOST_STAGES][DIM], change = 0, size = 0;
        for (int s = 0; s < stages; ++s) {
            for (int i = 0; i < DIM; ++i) {
                y[i] = 0;
                for (int j = 0; j < stages; ++j) y[i] += a[s * stages + j] * k[j][i];
                y[i] = x[i] + h * y[i];
            }
            field(y, fresh[s]);
            ++gauss.evaluations;
            for (int i = 0; i < DIM; ++i) {
                const real moved = fabs(fresh[s][i] - k[s][i]), value = fabs(fresh[s][i]);
                change = moved > change ? moved : change;
                size = value > size ? value : size;
            }
        }
        memcpy(k, fresh, (size_t)stages * sizeof k[0]);
        converged = change <= ROUNDING * size || (change >= previous && change < 400 * ROUNDING * size);
        previous = change;
    }
    gauss.failed = !converged;
    memcpy(gauss.k, k, (size_t)stages * sizeof k[0]);
    for (int i = 0; i < DIM; ++i) {
        real sum = 0;
        for (int j = 0; j < stages; ++j) sum += b[j] * k[j][i];
        const real addend = h * sum + gauss.carry[i], old = x[i];
        x[i] = old + addend;
        gauss.carry[i] = addend - (x[i] - old);
    }
}

#define GAUSS(NAME, STAGES)                                                                                          \
    static void NAME(real x[DIM], double h, long steps)                                                              \
    {                                                                                                                \
        for (long n = 0; n < steps && !gauss.failed; ++n)                                                             \
            gauss_step(STAGES, NAME##_a, NAME##_b, NAME##_extrapolation, x, h);         \
    }
