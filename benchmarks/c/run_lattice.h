/* Make steps of one of `methods`, from the state y[field][site], which is replaced; return the CPU seconds. The methods
   work on the arrays row(field, r). */
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
