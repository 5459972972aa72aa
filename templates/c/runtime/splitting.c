#ifndef PHI_FILE_SPLITTING
#define PHI_FILE_SPLITTING
#include <math.h>
#include <string.h>
#include "algebra.c"
#include "model.h"

#include "attitude.c"
#include "flows.h"

/* Compute the coefficients of all flows of a step: a row for each duration. */
#if PHI_MONITOR
static void phi_prepare(const phi_params *params, const double gauge[PHI_GAUGES], double h, double *coef)
#else
static void phi_prepare(const phi_params *params, double h, double *coef)
#endif
{
    for (int k = 0; k < PHI_ROWS_OF_FLOWS; ++k) {
#if PHI_KICKS
        const double kick[1] = { phi_multiples[k] * (h * h) };
        phi_prepare_row(params, phi_times[k] * h, kick, coef + k * PHI_ROW);
#elif PHI_MONITOR
        phi_prepare_row(params, gauge, phi_times[k] * h, coef + k * PHI_ROW);
#else
        phi_prepare_row(params, phi_times[k] * h, coef + k * PHI_ROW);
#endif
    }
}

#if PHI_MONITOR
/* Indices of the quantities that flows update besides the coordinates: the physical time, and a sum that becomes NaN
   outside the domain of a logarithm. PHI_ALONG is the number of coordinates and these quantities together. */
enum { PHI_TIME = PHI_DIM, PHI_DOMAIN, PHI_ALONG };

/* Make one step: the exact flows of the parts of the Hamiltonian K, one after the other. If it fails, the state is
   unchanged. */
#if PHI_ADJOINT
static phi_status phi_stages(phi_solver *s, double (*tape)[PHI_DIM])
#else
static phi_status phi_stages(phi_solver *s)
#endif
{
    double x[PHI_ALONG] = { 0.0 }, displacement[PHI_ALONG] = { 0.0 }, start[PHI_ALONG] = { 0.0 };
    PHI_COPY(x, s->x, s->x, PHI_DIM);
    PHI_COPY(start, s->x, s->x, PHI_DIM);
    PHI_COPY(displacement, s->carry, s->carry, PHI_DIM);
#if PHI_ATTITUDE && PHI_ADJOINT
    double element[PHI_ELEMENT] = { 0.0 };
    phi_flows(PHI_COEFFICIENTS_OF(s), x, displacement, start, element, tape);
#elif PHI_ATTITUDE
    double element[PHI_ELEMENT] = { 0.0 };
    phi_flows(PHI_COEFFICIENTS_OF(s), x, displacement, start, element);
#elif PHI_ADJOINT
    phi_flows(PHI_COEFFICIENTS_OF(s), x, displacement, start, tape);
#else
    phi_flows(PHI_COEFFICIENTS_OF(s), x, displacement, start);
#endif
    ++s->evaluations;
    if (!phi_finite(x, PHI_ALONG)) return PHI_NOT_FINITE;
    if (!(displacement[PHI_TIME] * s->h > 0.0)) return PHI_NOT_FINITE;
    phi_settle(s->x, s->carry, displacement);
    phi_pass(s, displacement[PHI_TIME]);
#if PHI_ATTITUDE
    phi_turn_by(s, element);
#endif
    return PHI_OK;
}

#else
/* Make one step: the exact flows of the parts of H, one after the other. If it fails, the state is unchanged. */
#if PHI_ADJOINT
static phi_status phi_stages(phi_solver *s, double (*tape)[PHI_DIM])
#else
static phi_status phi_stages(phi_solver *s)
#endif
{
    double x[PHI_DIM], displacement[PHI_DIM];
    PHI_COPY(x, s->x, x, PHI_DIM);
    PHI_COPY(displacement, s->carry, displacement, PHI_DIM);
#if PHI_ATTITUDE && PHI_ADJOINT
    double element[PHI_ELEMENT] = { 0.0 };
    phi_flows(PHI_COEFFICIENTS_OF(s), x, displacement, s->x, element, tape);
#elif PHI_ATTITUDE
    double element[PHI_ELEMENT] = { 0.0 };
    phi_flows(PHI_COEFFICIENTS_OF(s), x, displacement, s->x, element);
#elif PHI_ADJOINT
    phi_flows(PHI_COEFFICIENTS_OF(s), x, displacement, s->x, tape);
#else
    phi_flows(PHI_COEFFICIENTS_OF(s), x, displacement, s->x);
#endif
    ++s->evaluations;
    if (!phi_finite(x, PHI_DIM)) return PHI_NOT_FINITE;
    phi_settle(s->x, s->carry, displacement);
#if PHI_RATE_OF_GAUGE
    phi_turn_by(s, element, s->aside);
#elif PHI_ATTITUDE
    phi_turn_by(s, element);
#endif
    return PHI_OK;
}

#if PHI_CORRECTED
/* Apply the flows of the corrector before the steps of a run (after = 0) or after them (after = 1). If it fails, the state
   is unchanged. */
static phi_status phi_correct(phi_solver *s, int after PHI_AND_STATES_TAPE)
{
    double x[PHI_DIM], displacement[PHI_DIM];
    PHI_COPY(x, s->x, x, PHI_DIM);
    PHI_COPY(displacement, s->carry, displacement, PHI_DIM);
    phi_corrector(after, PHI_COEFFICIENTS_OF(s), x, displacement, s->x PHI_AND_TAPE);
    if (!phi_finite(x, PHI_DIM)) return PHI_NOT_FINITE;
    phi_settle(s->x, s->carry, displacement);
    return PHI_OK;
}

/* End a run that started at `before`, by the flows of the corrector. Returns the status of the last step or, if it fails,
   of the corrector. If no step succeeded, or if the corrector fails, the state before the run is restored. */
static phi_status phi_end_run(phi_solver *s, const phi_solver *before, phi_status status PHI_AND_STATES_TAPE)
{
    const phi_status corrected = s->steps == before->steps ? PHI_OK : phi_correct(s, 1 PHI_AND_TAPE_AT(-PHI_BEGUN));
    if (s->steps == before->steps || corrected != PHI_OK) *s = *before;
    return status != PHI_OK ? status : corrected;
}

#endif
#endif
#endif
