#ifndef PHI_FILE_FLOWS
#define PHI_FILE_FLOWS
#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "sweeps.h"

/* ---- The flows ---- */
#if PHI_BY_COLOUR
/* One part of H, of one colour. */
static void phi_sweep_flow(const phi_solver *s, int part, const double *coef, int far)
#else
/* One part of H. */
static void phi_sweep(const phi_solver *s, int part, const double *coef, int far)
#endif
{
    const size_t units = s->rows * phi_pieces(s);
#ifdef _OPENMP
    const size_t threads = (size_t)omp_get_num_threads(), own = (size_t)omp_get_thread_num();
    phi_sweep_rows(s, part, coef, far, units / threads * own + (own < units % threads ? own : units % threads),
        units / threads * (own + 1) + (own + 1 < units % threads ? own + 1 : units % threads));
    if (threads > 1) { /* of one thread, too, a barrier may ask the operating system to wake the others */
#pragma omp barrier
    }
#else
    phi_sweep_rows(s, part, coef, far, 0, units);
#endif
}

#if PHI_BY_COLOUR
/* The first flow, those between it and the last, the last, or those between, backwards. */
static void phi_sweep(const phi_solver *s, int kind, const double *coef, int far)
{
    const int last = s->flows - 1;
    if (kind == 0 || kind == 2) phi_sweep_flow(s, kind == 0 ? 0 : last, coef, far);
    if (kind == 1)
        for (int flow = 1; flow < last; ++flow) phi_sweep_flow(s, flow, coef, far);
    if (kind == 3)
        for (int flow = last - 1; flow > 0; --flow) phi_sweep_flow(s, flow, coef, far);
}

#endif
/* Some steps, joined. */
static void phi_steps(const phi_solver *s, int steps, int far)
{
#ifdef _OPENMP
#if PHI_PAIRS
#pragma omp parallel if (s->sites > 512)
#else
#pragma omp parallel if (s->sites > 4096)
#endif
#endif
    for (int step = 0; step < steps; ++step) {
        const int last = step == steps - 1;
        if (step == 0) phi_sweep(s, phi_flow_parts[0], s->coef + phi_flow_rows[0] * PHI_ROW, far);
        for (int k = 1; k < PHI_FLOWS - 1; ++k)
            phi_sweep(s, phi_flow_parts[k], s->coef + phi_flow_rows[k] * PHI_ROW, far);
        if (PHI_FLOWS > 1)
            phi_sweep(s, phi_flow_parts[0], s->coef + (last ? phi_flow_rows[PHI_FLOWS - 1] : PHI_JOINED) * PHI_ROW, far);
        else if (!last)
            phi_sweep(s, phi_flow_parts[0], s->coef, far);
    }
}

/* Some steps; if they lead to what is not finite, none. */
static phi_status phi_try(phi_solver *s, int steps)
{
    phi_copy(s->before, s->x, s);
#if PHI_NEAR
    phi_steps(s, steps, 0);
    if (phi_holds(s)) return PHI_OK;
    phi_copy(s->x, s->before, s);
#endif
    phi_steps(s, steps, 1);
    if (phi_holds(s)) return PHI_OK;
    phi_copy(s->x, s->before, s);
    return PHI_NOT_FINITE;
}
#endif
