/* DOP853 in which sums over stages use SIMD vectors of four coordinates. It is faster than runge_kutta.h in 9 to 24
   dimensions, and slower in fewer, since field() reads and writes single numbers. */
enum { PIECES = (DIM + 3) / 4 };
typedef double piece __attribute__((vector_size(32)));

INLINE void combine(int count, const double *w, double h, const piece base[PIECES], const piece (*k)[PIECES],
                    piece y[PIECES])
{
#pragma GCC unroll 8
    for (int i = 0; i < PIECES; ++i) {
        piece even = base[i], odd = { 0.0 };
#pragma GCC unroll 16
        for (int j = 0; j < count; ++j)
            if (w[j] != 0.0) {
                if (j % 2) odd += h * w[j] * k[j][i];
                else even += h * w[j] * k[j][i];
            }
        y[i] = even + odd;
    }
}

static void dop853_vectors(double x[DIM], double h, long steps)
{
    piece k[12][PIECES], y[PIECES], base[PIECES] = { { 0.0 } };
    double numbers[4 * PIECES], slopes[4 * PIECES] = { 0.0 };
    memcpy(base, x, DIM * sizeof *x);
    for (long n = 0; n < steps; ++n) {
#pragma GCC unroll 16
        for (int s = 0; s < 12; ++s) {
            combine(s, dop853_a + s * 12, h, base, k, y);
            memcpy(numbers, y, sizeof numbers);
            field(numbers, slopes);
            memcpy(k[s], slopes, sizeof slopes);
        }
        combine(12, dop853_b, h, base, k, y);
        memcpy(base, y, sizeof base);
    }
    memcpy(x, base, DIM * sizeof *x);
}
