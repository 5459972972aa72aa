/* Splitting of the free rigid body. H minus the Casimir |x|^2/2 times the second inverse moment of inertia has the flow
   of H, and is a sum of two squares, whose flows are rotations. */
INLINE void first(double x[3], double h)
{
    double s, c;
    sine_cosine(h * (INVERSE_1 - INVERSE_2) * x[0], &s, &c);
    turn(&x[1], &x[2], s, c);
}

INLINE void third(double x[3], double h)
{
    double s, c;
    sine_cosine(h * (INVERSE_3 - INVERSE_2) * x[2], &s, &c);
    turn(&x[0], &x[1], s, c);
}
#define OUTER first
#define INNER third
