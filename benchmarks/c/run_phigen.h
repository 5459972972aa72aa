/* Integrate by phigen's solver `bench`, with the arguments of measure_run in run_peers.h; `method` is not used. */
int measure_run(int method, const double *start, double h, long chunk, long chunks, double limit, double *out,
              double *seconds, double *evaluations)
{
    static bench_solver solver;
    (void)method;
    const double began = cpu_time(), started = wall_time();
    int status = bench_init(&solver, NULL, start);
    for (long c = 0; c < chunks && status == OK; ++c) {
        status = bench_integrate(&solver, h, (size_t)chunk);
        memcpy(out + c * bench_DIM, solver.x, sizeof solver.x);
        if (status == OK && c + 1 < chunks && wall_time() - started > limit) status = TOO_SLOW;
    }
    *seconds = cpu_time() - began;
    *evaluations = (double)solver.evaluations;
    return status;
}

/* Integrate an ensemble by phigen's solver, and measure the CPU seconds. */
int measure_many(int method, double *x, long members, double h, long steps, double *seconds)
{
    (void)method;
    const double began = cpu_time();
    const int status = bench_ensemble(NULL, x, (size_t)members, h, (size_t)steps, NULL);
    *seconds = cpu_time() - began;
    return status;
}
