#ifndef PHI_FILE_LATTICE_FOUND_FLOWS
#define PHI_FILE_LATTICE_FOUND_FLOWS
#include "lattice.h"
#include "model.h"

/* A part of H, and the coefficients of its flow. */
typedef struct {
#include "state_of_flow.h"
} phi_flow;

/* Set *flow to flow `number` of a step; number PHI_FLOWS is the last merged with the first. */
static void phi_find_flow(const phi_solver *s, size_t steps, int number, phi_flow *flow)
{
    flow->part = phi_flow_parts[number];
#if PHI_UNDONE
    flow->go = 0;
#endif
#if PHI_RENEWED
    phi_renew(s, number, steps, flow->own);
    flow->coef = flow->own;
#else
    flow->coef = s->coef + number * PHI_ROW;
    (void)steps;
#endif
}

static void phi_make_flow(const phi_solver *s, size_t steps, int number)
{
    phi_flow flow;
    phi_find_flow(s, steps, number, &flow);
    phi_sweep_part(s, flow.part, flow.coef PHI_AND_FAR(s->far > 0));
}
#endif
