/* H = p^2/2 + V: the leapfrog method. V is not needed until somebody looks: V + cos(theta) stays. */
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
