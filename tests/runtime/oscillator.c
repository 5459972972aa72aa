#include "oscillator.h"
#include <math.h>

const oscillator_params oscillator_default_params = {1.0, 1e300};

oscillator_status oscillator_init(oscillator_solver *s, const oscillator_params *params, const double x0[oscillator_DIM])
{
    for (int i = 0; i < oscillator_DIM; i++) {
        if (!isfinite(x0[i])) return oscillator_BAD_ARGUMENT;
        s->x[i] = x0[i];
    }
    s->params = *params;
    s->steps = 0;
    return oscillator_OK;
}

oscillator_status oscillator_step(oscillator_solver *s, double h)
{
    const double omega = s->params.omega, c = cos(omega * h), d = sin(omega * h);
    const double q = c * s->x[0] + d / omega * s->x[1], p = c * s->x[1] - d * omega * s->x[0];
    if (fabs(q) > s->params.limit) return oscillator_NO_CONVERGENCE;
    s->x[0] = q;
    s->x[1] = p;
    s->steps++;
    return oscillator_OK;
}

oscillator_status oscillator_integrate(oscillator_solver *s, double h, size_t steps)
{
    for (size_t i = 0; i < steps; i++) {
        const oscillator_status status = oscillator_step(s, h);
        if (status) return status;
    }
    return oscillator_OK;
}

oscillator_status oscillator_ensemble(const oscillator_params *params, double *x, size_t members, double h, size_t steps,
                                      unsigned char *status)
{
    oscillator_status first = oscillator_OK;
    for (size_t m = 0; m < members; m++) {
        oscillator_solver s;
        const double x0[oscillator_DIM] = {x[m], x[members + m], x[2 * members + m]};
        oscillator_status result = oscillator_init(&s, params, x0);
        if (!result) result = oscillator_integrate(&s, h, steps);
        for (size_t i = 0; i < oscillator_DIM; i++) x[i * members + m] = s.x[i];
        status[m] = (unsigned char)result;
        if (result && !first) first = result;
    }
    return first;
}

double oscillator_hamiltonian(const oscillator_params *params, const double x[oscillator_DIM])
{
    return 0.5 * (x[1] * x[1] + params->omega * params->omega * x[0] * x[0]);
}

void oscillator_casimirs(const oscillator_params *params, const double x[oscillator_DIM], double out[])
{
    (void)params;
    out[0] = x[2];
    out[1] = x[2] * x[2];
}

void oscillator_vector_field(const oscillator_params *params, const double x[oscillator_DIM], double out[oscillator_DIM])
{
    out[0] = x[1];
    out[1] = -params->omega * params->omega * x[0];
    out[2] = 0.0;
}

const char *oscillator_status_string(oscillator_status status) { return status ? "failed" : "ok"; }
size_t oscillator_solver_size(void) { return sizeof(oscillator_solver); }
size_t oscillator_solver_steps_done(const oscillator_solver *s) { return s->steps; }
