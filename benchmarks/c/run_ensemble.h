/* Integrate an ensemble, WIDTH members at a time, one in each SIMD lane. Coordinate i of member m is x[i * members +
   m]; `members` is a multiple of WIDTH. */
int measure_many(int method, double *x, long members, double h, long steps, double *seconds)
{
    const double began = cpu_time();
    for (long m = 0; m < members; m += WIDTH) {
        real block[DIM];
        for (int i = 0; i < DIM; ++i) memcpy(&block[i], x + i * members + m, sizeof block[i]);
        methods[method](block, h, steps);
        for (int i = 0; i < DIM; ++i) memcpy(x + i * members + m, &block[i], sizeof block[i]);
    }
    *seconds = cpu_time() - began;
    return OK;
}
