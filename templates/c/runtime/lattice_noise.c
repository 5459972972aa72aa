#ifndef PHI_FILE_LATTICE_NOISE
#define PHI_FILE_LATTICE_NOISE
#include <math.h>

#include "lattice.h"
#include "model.h"
#include "rows.c"
#include "philox.c"

/* ---- Noise ---- */
#if PHI_BY_HAND || !PHI_ONE_ROW
/* Number of site i of a row in the whole lattice, of which this solver may hold some planes only. */
static uint64_t phi_site(const phi_solver *s, size_t row, ptrdiff_t i)
{
#if PHI_BY_HAND && PHI_ONE_ROW
    (void)row;
    return s->planes > 0 ? (s->first_plane + (uint64_t)i) % s->planes : (uint64_t)i;
#elif PHI_BY_HAND
    const uint64_t rows = s->rows / s->sizes[0], plane = row / rows;
    const uint64_t there = s->planes > 0 ? (s->first_plane + plane) % s->planes : plane;
    return (there * rows + row % rows) * (uint64_t)s->length + (uint64_t)i;
#else
    return (uint64_t)row * (uint64_t)s->length + (uint64_t)i;
#endif
}

#endif
/* Draw the increments of the noise in a part of a step: a function of seed, member, step, part and site only. A step of -h
   has them in reverse order, so that it inverts a step of h. */
#if PHI_SHARED || PHI_SERIES
static void phi_draw_pieces(const phi_solver *s, size_t steps, int part, size_t first, size_t end)
#else
static void phi_draw(const phi_solver *s, size_t steps, int part)
#endif
{
    const uint64_t step = s->first_step + steps;
    const uint32_t now = (uint32_t)(s->h < 0.0 ? PHI_PARTS - 1 - part : part) * ((PHI_SOURCES + 1) / 2);
    const double size = copysign(sqrt(fabs(s->h) / (double)PHI_PARTS), s->h);
#if PHI_SHARED || PHI_SERIES
    for (size_t unit = first; unit < end; ++unit) {
#else
    const size_t units = phi_units(s);
#ifdef _OPENMP
#pragma omp parallel for if (s->sites > 4096)
#endif
    for (size_t unit = 0; unit < units; ++unit) {
#endif
        const phi_row row = phi_piece_of(s, unit);
        for (int k = 0; k < PHI_SOURCES; k += 2) {
            double *one = PHI_HERE(s->x[PHI_DRAWN + k]);
            double *other = PHI_HERE(s->x[PHI_DRAWN + (k + 1 < PHI_SOURCES ? k + 1 : k)]);
            for (ptrdiff_t i = row.from; i < row.to; ++i) {
#if PHI_BY_HAND || !PHI_ONE_ROW
                const uint64_t site = phi_site(s, PHI_AXES > 1 ? unit : 0, i);
#else
                const uint64_t site = (uint64_t)i;
#endif
                const uint32_t beside = (uint32_t)(step >> 32) | (now + (uint32_t)k / 2) << 16;
                uint32_t counter[4] = { (uint32_t)step, beside | (uint32_t)(site >> 32) << 24, s->member, (uint32_t)site };
                double pair[2];
                phi_two_normals(s->seed, counter, pair);
                other[i] = size * pair[1];
                one[i] = size * pair[0];
            }
        }
#if PHI_HALO
        for (int k = 0; k < PHI_SOURCES; ++k) phi_ends(PHI_HERE(s->x[PHI_DRAWN + k]), s->length, row.from, row.to);
#endif
    }
}

phi_status phi_set_noise(phi_solver *s, uint64_t seed, uint32_t member, uint64_t step)
{
    if (s == NULL || step >> 48 != 0) return PHI_BAD_ARGUMENT;
    s->seed = seed;
    s->member = member;
    s->first_step = step - s->steps;
    return PHI_OK;
}
#if PHI_BY_HAND

phi_status phi_set_planes(phi_solver *s, size_t first, size_t planes)
{
    if (s == NULL) return PHI_BAD_ARGUMENT;
    s->first_plane = first;
    s->planes = planes;
    return PHI_OK;
}
#endif
#endif
