/* Methods made of steps of a symmetric method of order 2, with the given fractions of a step. */
#define COMPOSE(NAME, BASE, FRACTIONS)                                                                               \
    static void NAME(real x[DIM], double h, long steps)                                                              \
    {                                                                                                                \
        for (long n = 0; n < steps; ++n)                                                                             \
            for (size_t s = 0; s < sizeof FRACTIONS / sizeof *FRACTIONS; ++s) BASE(x, FRACTIONS[s] * h);             \
    }

/* The same for splittings: a step is OUTER for half of it, INNER, and OUTER for the other half, which makes one flow
   with the OUTER of the next. */
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
