/* A method made of steps of a symmetric method of order 2: NAME composes BASE with the given fractions of a step. */
#define COMPOSE(NAME, BASE, FRACTIONS)                                                                               \
    static void NAME(real x[DIM], double h, long steps)                                                              \
    {                                                                                                                \
        for (long n = 0; n < steps; ++n)                                                                             \
            for (size_t s = 0; s < sizeof FRACTIONS / sizeof *FRACTIONS; ++s) BASE(x, FRACTIONS[s] * h);             \
    }
static const double whole_step[] = { 1.0 };
