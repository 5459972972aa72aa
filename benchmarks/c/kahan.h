/* Kahan's method for quadratic fields: (I - h/2 f'(x)) (x1 - x) = h f(x), by elimination without pivoting, summed with
   compensation. */
INLINE void kahan_step(double x[DIM], double h)
{
    double f[DIM], J[DIM][DIM];
    field(x, f);
    jacobian(x, J);
#pragma GCC unroll 8
    for (int i = 0; i < DIM; ++i) {
        f[i] *= h;
        for (int j = 0; j < DIM; ++j) J[i][j] *= -0.5 * h;
        J[i][i] += 1.0;
    }
#pragma GCC unroll 8
    for (int k = 0; k < DIM; ++k) {
        const double reciprocal = 1.0 / J[k][k];
#pragma GCC unroll 8
        for (int i = k + 1; i < DIM; ++i) {
            const double factor = J[i][k] * reciprocal;
            for (int j = k + 1; j < DIM; ++j) J[i][j] -= factor * J[k][j];
            f[i] -= factor * f[k];
        }
    }
#pragma GCC unroll 8
    for (int i = DIM - 1; i >= 0; --i) {
        for (int j = i + 1; j < DIM; ++j) f[i] -= J[i][j] * f[j];
        f[i] /= J[i][i];
    }
    for (int i = 0; i < DIM; ++i) {
        const double addend = f[i] + carry[i], old = x[i];
        x[i] = old + addend;
        carry[i] = addend - (x[i] - old);
    }
}

COMPOSE(kahan, kahan_step, whole_step)
COMPOSE(kahan_kl8, kahan_step, kahan_li8)
