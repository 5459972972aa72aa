/* H = p^2/2 + V: both flows are elementary, and V follows the angle exactly. This is the leapfrog method. */
INLINE void splitting_step(double x[3], double h)
{
    x[1] -= 0.5 * h * sin(x[0]);
    const double before = cos(x[0]);
    x[0] += h * x[1];
    x[2] += before - cos(x[0]);
    x[1] -= 0.5 * h * sin(x[0]);
}
