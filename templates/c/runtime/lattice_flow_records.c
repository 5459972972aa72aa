#ifndef PHI_FILE_LATTICE_FLOW_RECORDS
#define PHI_FILE_LATTICE_FLOW_RECORDS
#include "lattice.h"
#include "model.h"

/* A flow to apply: the part of H, and the coefficients of its flow. */
typedef struct {
#include "state_of_flow.h"
} phi_flow;

/* Set *flow to flow `number` of the step that follows `steps` steps; number PHI_FLOWS is the last flow
   merged with the first flow of the next step. */
static void phi_set_flow(const phi_solver *s, size_t steps, int number, phi_flow *flow)
{
    flow->part = phi_flow_parts[number];
#if PHI_RECOMPUTED
    flow->go = 0;
#endif
#if PHI_RENEWED
    phi_renew(s, number, steps, flow->renewed_coef);
    flow->coef = flow->renewed_coef;
#else
    flow->coef = s->coef + number * PHI_ROW;
    (void)steps;
#endif
}

static void phi_apply_flow(const phi_solver *s, size_t steps, int number)
{
    phi_flow flow;
    phi_set_flow(s, steps, number, &flow);
    phi_sweep_part(s, flow.part, flow.coef PHI_AND_FULL_RANGE(s->full_range > 0));
}
#endif
