/* H minus |x|^2/2 times the middle inverse moment, a Casimir, is a sum of two squares: two kinds of rotations. */
INLINE void splitting_step(double x[3], double h)
{
    double s, c;
    sine_cosine(0.5 * h * (INVERSE_1 - INVERSE_2) * x[0], &s, &c);
    turn(&x[1], &x[2], s, c);
    double s3, c3;
    sine_cosine(h * (INVERSE_3 - INVERSE_2) * x[2], &s3, &c3);
    turn(&x[0], &x[1], s3, c3);
    sine_cosine(0.5 * h * (INVERSE_1 - INVERSE_2) * x[0], &s, &c);
    turn(&x[1], &x[2], s, c);
}
