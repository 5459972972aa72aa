/* Leapfrog method for H = p^2/2 + V with the Casimir V + cos(theta). V is computed from theta only at the end of a call. */
INLINE void kick(double x[3], double h)
{
    x[1] -= h * sin(x[0]);
}

INLINE void drift(double x[3], double h)
{
    x[0] += h * x[1];
}

INLINE void potential(double x[3])
{
    x[2] = CASIMIR - cos(x[0]);
}
#define OUTER kick
#define INNER drift
#define RESTORE potential
