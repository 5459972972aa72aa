/* The satellite of kepler.h with the time tau, where dt = g dtau and g = r^(3/2). The Hamiltonian is K = g (H -
   ENERGY), whose orbits with K = 0 are the orbits of H. The last coordinate is t. */
enum { DIM = 5 };
#define MEASURED 4

INLINE real root(real a)
{
    double numbers[WIDTH];
    memcpy(numbers, &a, sizeof a);
    for (int l = 0; l < WIDTH; ++l) numbers[l] = sqrt(numbers[l]);
    memcpy(&a, numbers, sizeof a);
    return a;
}

INLINE void field(const real x[DIM], real f[DIM])
{
    const real r2 = x[0] * x[0] + x[1] * x[1], r = root(r2), s = root(r), g = r * s;
    const real i2 = 1.0 / r2, i3 = i2 * (r * i2), w = 1.5 * OBLATENESS * i2 * i3, q2 = x[1] * x[1] * i2;
    const real potential = -r2 * i3 - 0.5 * OBLATENESS * i3 * (1.0 - 3.0 * q2);
    const real excess = 0.5 * (x[2] * x[2] + x[3] * x[3]) + potential - ENERGY;
    const real slope = 1.5 * excess * (s * r * i2);
    f[0] = g * x[2];
    f[1] = g * x[3];
    f[2] = -x[0] * (g * (i3 + w * (1.0 - 5.0 * q2)) + slope);
    f[3] = -x[1] * (g * (i3 + w * (3.0 - 5.0 * q2)) + slope);
    f[4] = g;
}
