/* Vector fields of rings of N sites; arrays have 8 halo entries before the first site and after the last. */
#if defined(XXZ) /* S' = dH/dS x S with H = sum of x x' + y y' + DELTA z z' over neighbours: so(3), sign plus */
enum { FIELDS = 3 };
INLINE void field(double (*restrict s)[N + 16], double (*restrict out)[N + 16])
{
    for (int i = 8; i < 8 + N; ++i) {
        const double a = s[0][i - 1] + s[0][i + 1], b = s[1][i - 1] + s[1][i + 1];
        const double c = DELTA * (s[2][i - 1] + s[2][i + 1]);
        out[0][i] = s[2][i] * b - s[1][i] * c;
        out[1][i] = s[0][i] * c - s[2][i] * a;
        out[2][i] = s[1][i] * a - s[0][i] * b;
    }
}
#elif defined(FPUT)
enum { FIELDS = 2 };
INLINE void field(double (*restrict s)[N + 16], double (*restrict out)[N + 16])
{
    for (int i = 8; i < 8 + N; ++i) {
        const double r = s[0][i + 1] - s[0][i], l = s[0][i] - s[0][i - 1];
        out[0][i] = s[1][i];
        out[1][i] = r * (1.0 + r * (ALPHA + BETA * r)) - l * (1.0 + l * (ALPHA + BETA * l));
    }
}
#elif defined(DNLS)
enum { FIELDS = 2 };
INLINE void field(double (*restrict s)[N + 16], double (*restrict out)[N + 16])
{
    for (int i = 8; i < 8 + N; ++i) {
        const double q = s[0][i], p = s[1][i], w = 0.5 * BETA * (q * q + p * p);
        out[0][i] = w * p - (s[1][i - 1] + s[1][i + 1]);
        out[1][i] = (s[0][i - 1] + s[0][i + 1]) - w * q;
    }
}
#endif
