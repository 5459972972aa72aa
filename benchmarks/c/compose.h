/* Composition of a symmetric method BASE of order 2: a step consists of steps of BASE over the fractions FRACTIONS. */
#define COMPOSE(NAME, BASE, FRACTIONS)                                                                               \
    static void NAME(real x[DIM], double h, long steps)                                                              \
    {                                                                                                                \
        for (long n = 0; n < steps; ++n)                                                                             \
            for (size_t s = 0; s < sizeof FRACTIONS / sizeof *FRACTIONS; ++s) BASE(x, FRACTIONS[s] * h);             \
    }

/* Composition of a splitting whose step is the flow OUTER over half of the step, the flow INNER over the step, and
   OUTER over the second half. The last flow of a step and the first flow of the next are merged. */
#define COMPOSE_SPLITTING(NAME, OUTER, INNER, FRACTIONS)                                                             \
    static void NAME(real x[DIM], double h, long steps)                                                              \
    {                                                                                                                \
        enum { COUNT = sizeof FRACTIONS / sizeof *FRACTIONS };                                                       \
        OUTER(x, 0.5 * h * FRACTIONS[0]);                                                                            \
        for (long n = 0; n < steps; ++n)                                                                             \
            for (int s = 0; s < COUNT; ++s) {                                                                        \
                const double next = s + 1 < COUNT ? FRACTIONS[s + 1] : n + 1 < steps ? FRACTIONS[0] : 0.0;           \
                INNER(x, h * FRACTIONS[s]);                                                                          \
                OUTER(x, 0.5 * h * (FRACTIONS[s] + next));                                                           \
            }                                                                                                        \
        RESTORE(x);                                                                                                  \
    }
#ifndef RESTORE
#define RESTORE(x) (void)(x)
#endif
static const double whole_step[] = { 1.0 };
