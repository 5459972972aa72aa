/* A satellite of an oblate planet: H = |p|^2/2 + V(q). */
enum { DIM = 4 };
INLINE void field(const real x[DIM], real f[DIM])
{
    const real r2 = x[0] * x[0] + x[1] * x[1], u = 1.0 / (r2 * sqrt(r2)), w = 1.5 * OBLATENESS * u / r2;
    const real ratio = 5.0 * x[1] * x[1] / r2;
    f[0] = x[2];
    f[1] = x[3];
    f[2] = -x[0] * (u + w * (1.0 - ratio));
    f[3] = -x[1] * (u + w * (3.0 - ratio));
}
