/* H minus |x|^2/2 times the middle inverse moment, a Casimir, is a sum of two squares: two kinds of rotations. */
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
