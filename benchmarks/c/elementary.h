/* Sine, cosine and exponential: by Taylor series for small arguments, by libm for others. Splittings spend most of
   their time in these functions. */
INLINE void sine_cosine(double t, double *s, double *c)
{
    if (__builtin_expect(fabs(t) > 0.6, 0)) {
        *s = sin(t);
        *c = cos(t);
        return;
    }
    const double z = t * t;
    double odd = -1.0 / 1307674368000.0, even = 1.0 / 20922789888000.0;
    odd = odd * z + 1.0 / 6227020800.0, even = even * z - 1.0 / 87178291200.0;
    odd = odd * z - 1.0 / 39916800.0, even = even * z + 1.0 / 479001600.0;
    odd = odd * z + 1.0 / 362880.0, even = even * z - 1.0 / 3628800.0;
    odd = odd * z - 1.0 / 5040.0, even = even * z + 1.0 / 40320.0;
    odd = odd * z + 1.0 / 120.0, even = even * z - 1.0 / 720.0;
    odd = odd * z - 1.0 / 6.0, even = even * z + 1.0 / 24.0;
    *s = t + t * (z * odd);
    *c = 1.0 + z * (even * z - 0.5);
}

INLINE double exponential(double t)
{
    if (__builtin_expect(fabs(t) > 0.35, 0)) return exp(t);
    const double t2 = t * t, t4 = t2 * t2, t8 = t4 * t4;
    const double b = 0.5 + t * (1.0 / 6.0), c = 1.0 / 24.0 + t * (1.0 / 120.0), d = 1.0 / 720.0 + t * (1.0 / 5040.0);
    const double e = 1.0 / 40320.0 + t * (1.0 / 362880.0), f = 1.0 / 3628800.0 + t * (1.0 / 39916800.0);
    const double rest = t4 * (c + t2 * d) + t8 * (e + t2 * f + t4 * (1.0 / 479001600.0));
    return 1.0 + (t + (t2 * b + rest)); /* 1 is added last, so that rounding errors are small */
}

/* Rotate (a, b) by the angle with the sine s and the cosine c, in the direction from b to a. */
INLINE void turn(double *a, double *b, double s, double c)
{
    const double turned = c * *a + s * *b;
    *b = c * *b - s * *a;
    *a = turned;
}
