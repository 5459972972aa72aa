/* Steps by one of `methods` on the lattice whose rows are row(field, r), from and to y[field][site]; CPU seconds. */
double bench_lattice(int method, double *y, double h, long steps)
{
    for (int f = 0; f < FIELDS; ++f)
        for (int r = 0; r < ROWS; ++r) memcpy(row(f, r) + HALO, y + ((long)f * ROWS + r) * N, N * sizeof *y);
    const double began = cpu_time();
    methods[method](h, steps);
    const double seconds = cpu_time() - began;
    for (int f = 0; f < FIELDS; ++f)
        for (int r = 0; r < ROWS; ++r) memcpy(y + ((long)f * ROWS + r) * N, row(f, r) + HALO, N * sizeof *y);
    return seconds;
}
