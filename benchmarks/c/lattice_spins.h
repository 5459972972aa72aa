/* Hand-written splitting of spins with exchange on a ring or a cube: H = Hx + Hy + Hz. The flow of Hx rotates each spin
   about the x axis, by an angle proportional to the sum of x over its neighbours; all x are constant. Rows have a halo,
   so that loops vectorise. */
#if AXES == 1
enum { ROWS = 1 };
#else
enum { ROWS = N * N };
#endif
enum { HALO = 8, WIDTH = N + 2 * HALO };
static double spins[3][ROWS][WIDTH];

/* Rotate (u, v). Sine and cosine are Taylor polynomials, accurate to round-off for angles up to about one half. */
INLINE void turn(double angle, double *restrict u, double *restrict v)
{
    const double z = angle * angle;
    const double s = angle * (1 + z * (-1. / 6 + z * (1. / 120 + z * (-1. / 5040 + z * (1. / 362880 +
        z * (-1. / 39916800 + z * (1. / 6227020800)))))));
    const double c = 1 + z * (-1. / 2 + z * (1. / 24 + z * (-1. / 720 + z * (1. / 40320 + z * (-1. / 3628800 +
        z * (1. / 479001600 + z * (-1. / 87178291200)))))));
    const double a = *u, b = *v;
    *u = c * a - s * b;
    *v = s * a + c * b;
}

static void flow(double (*restrict f)[WIDTH], double (*restrict u)[WIDTH], double (*restrict v)[WIDTH], double angle)
{
    for (int r = 0; r < ROWS; ++r) {
        f[r][HALO - 1] = f[r][HALO + N - 1];
        f[r][HALO + N] = f[r][HALO];
    }
    for (int r = 0; r < ROWS; ++r) {
        const double *restrict g = f[r];
#if AXES == 1
        for (int i = HALO; i < HALO + N; ++i) turn(angle * (g[i - 1] + g[i + 1]), &u[r][i], &v[r][i]);
#else
        const int k = r / N * N, j = r % N;
        const double *restrict east = f[k + (j + 1) % N], *restrict west = f[k + (j + N - 1) % N];
        const double *restrict up = f[(r + N) % ROWS], *restrict down = f[(r + ROWS - N) % ROWS];
        for (int i = HALO; i < HALO + N; ++i)
            turn(angle * (g[i - 1] + g[i + 1] + east[i] + west[i] + up[i] + down[i]), &u[r][i], &v[r][i]);
#endif
    }
}

enum { X, Y, Z };

/* Apply the flow of the part of H that belongs to an axis, over a time. */
static void part(int axis, double time)
{
    flow(spins[axis], spins[(axis + 1) % 3], spins[(axis + 2) % 3], axis == Z ? DELTA * time : time);
}

/* Make one symmetric step of order 2. If `joined`, the step before has made its first flow. The last flow is merged
   with the first flow of the next step, whose size is `next`; 0 if there is none. */
static void strang(double h, int joined, double next)
{
    if (!joined) part(FIRST, 0.5 * h);
    part(SECOND, 0.5 * h);
    part(THIRD, h);
    part(SECOND, 0.5 * h);
    part(FIRST, 0.5 * (h + next));
}

static void splitting2(double h, long steps)
{
    for (long n = 0; n < steps; ++n) strang(h, n > 0, n + 1 < steps ? h : 0.0);
}

/* Suzuki's composition of order 4, a common choice for code written by hand. */
static void splitting4(double h, long steps)
{
    const double a = h / (4.0 - cbrt(4.0)), b = h - 4.0 * a, sizes[] = { a, a, b, a, a };
    for (long n = 0; n < 5 * steps; ++n) strang(sizes[n % 5], n > 0, n + 1 < 5 * steps ? sizes[(n + 1) % 5] : 0.0);
}
