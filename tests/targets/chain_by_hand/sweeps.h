#ifndef SWEEPS_H
#define SWEEPS_H
#include "model.h"
#include "rows.c"

static double phi_force(double g, const phi_row *row, ptrdiff_t i)
{
    const double *q = row->x[0] + row->at[0], *before = row->x[0] + row->at[1], *after = row->x[0] + row->at[2];
    const double right = i + 1 < row->s->length ? row->present[0] : 0.0, left = i - 1 >= 0 ? row->present[1] : 0.0;
    return -g * sin(q[i]) + (before[i] - q[i]) + (after[i] - q[i]) + right * (q[i + 1] - q[i]) + left * (q[i - 1] - q[i]);
}

static void phi_sweep_part(const phi_solver *s, int part, const double *coef)
{
    for (size_t unit = 0; unit < phi_units(s); ++unit) {
        const phi_row row = phi_piece_of(s, unit);
        double *q = s->x[0] + row.at[0], *p = s->x[1] + row.at[0];
        for (ptrdiff_t i = row.from; i < row.to; ++i)
            if (part == 1) q[i] += coef[0] * p[i];
            else p[i] += coef[0] * phi_force(s->params.g, &row, i);
        if (part == 1) phi_ends(q, s->length, row.from, row.to);
    }
}

static void phi_energy_row(const phi_row *row, double *restrict out)
{
    const double *q = row->x[0] + row->at[0], *p = row->x[1] + row->at[0], *after = row->x[0] + row->at[2];
    const double g = row->s->params.g;
    for (ptrdiff_t i = row->from; i < row->to; ++i) {
        const double right = i + 1 < row->s->length ? 0.5 * (q[i + 1] - q[i]) * (q[i + 1] - q[i]) : 0.0;
        out[i - row->from] = 0.5 * p[i] * p[i] - g * cos(q[i]) + right + 0.5 * (after[i] - q[i]) * (after[i] - q[i]);
    }
}

static void phi_vector_field_row(const phi_row *row, double *restrict out)
{
    const double *p = row->x[1] + row->at[0];
    for (ptrdiff_t i = row->from; i < row->to; ++i) {
        out[i - row->from] = p[i];
        out[(ptrdiff_t)row->s->sites + i - row->from] = phi_force(row->s->params.g, row, i);
    }
}
#endif
