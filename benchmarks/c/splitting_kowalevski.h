/* Splitting of the Kowalevski top: kicks of P by gravity, and rotations of P and G about the axes of the body. */
INLINE void kick(double x[6], double h)
{
    x[1] += h * x[5];
    x[2] -= h * x[4];
}

INLINE void rotate(double x[6], int a, int b, double angle)
{
    double s, c;
    sine_cosine(angle, &s, &c);
    turn(&x[a], &x[b], s, c);
    turn(&x[3 + a], &x[3 + b], s, c);
}

INLINE void rotations(double x[6], double h)
{
    rotate(x, 1, 2, 0.25 * h * x[0]);
    rotate(x, 2, 0, 0.25 * h * x[1]);
    rotate(x, 0, 1, h * x[2]);
    rotate(x, 2, 0, 0.25 * h * x[1]);
    rotate(x, 1, 2, 0.25 * h * x[0]);
}
#define OUTER kick
#define INNER rotations
