/* Integrate by one of `methods`, in `chunks` chunks of `chunk` steps each; the state after each chunk is written to
   out. The run ends early after `limit` seconds. `seconds` is the CPU time, including the start of the solver. */
int measure_run(int method, const double *start, double h, long chunk, long chunks, double limit, double *out,
              double *seconds, double *evaluations)
{
    STATE x[DIM];
    for (int i = 0; i < DIM; ++i) x[i] = start[i];
    reset();
    const double began = cpu_time(), started = wall_time();
    int status = OK;
    for (long c = 0; c < chunks && status == OK; ++c) {
        methods[method](x, h, chunk);
        for (int i = 0; i < DIM; ++i) {
            out[c * DIM + i] = (double)x[i];
            if (!(fabs(x[i]) < 1e9)) status = NOT_FINITE;
        }
        if (gauss.failed) status = NO_CONVERGENCE;
        else if (status == OK && c + 1 < chunks && wall_time() - started > limit) status = TOO_SLOW;
    }
    *seconds = cpu_time() - began;
    *evaluations = (double)gauss.evaluations;
    return status;
}
