/* Splitting of H into its summands x_i - log x_i. The flow of a summand leaves x_i constant, and multiplies the other
   coordinates by exponentials. */
INLINE void flow1(double x[3], double h)
{
    const double t = h * (x[0] - 1.0);
    x[1] *= exponential(-A12 * t);
    x[2] *= exponential(-A13 * t);
}

INLINE void flow2(double x[3], double h)
{
    const double t = h * (x[1] - 1.0);
    x[0] *= exponential(A12 * t);
    x[2] *= exponential(-A23 * t);
}

INLINE void flow3(double x[3], double h)
{
    const double t = h * (x[2] - 1.0);
    x[0] *= exponential(A13 * t);
    x[1] *= exponential(A23 * t);
}

INLINE void flows(double x[3], double h)
{
    flow2(x, 0.5 * h);
    flow3(x, h);
    flow2(x, 0.5 * h);
}
#define OUTER flow1
#define INNER flows
