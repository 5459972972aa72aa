#ifndef PHI_FILE_GAUSS_REDUCED
#define PHI_FILE_GAUSS_REDUCED
#include <string.h>

/* Fixed-point sweeps iterate only some of the unknowns, and read the time integrals of these. All other unknowns
   follow. */
#define PHI_READ(r) phi_iterated[phi_reads[r]] /* the unknown whose integral is value r */

/* Set the factors of each stage that a sweep reads: h times its weight, its time as a fraction of the step, and h. */
static inline void phi_set_factors(double h, phi_lanes factors[PHI_FACTORS])
{
    for (int i = 0; i < PHI_NODES; ++i) factors[0][i] = h * phi_weights[i];
    for (int i = 0; i < PHI_WIDTH; ++i) factors[1][i] = phi_stage_times[i];
    for (int i = 0; i < PHI_WIDTH; ++i) factors[2][i] = h;
}

/* Compute the integrals that the next sweep reads, from the increments `now`. */
static inline void phi_read(phi_lanes *now, phi_lanes *reads)
{
    for (int r = 0; r < PHI_READS; ++r) phi_mix(phi_doubled, now[phi_reads[r]], reads[r]);
}

/* Compute the increments of all unknowns from those of the iterated unknowns and from the values that the last sweep read. */
static void phi_complete_stages(const phi_solver *s, double point[PHI_POINT], phi_lanes *factors, phi_lanes *now, phi_lanes *reads,
    phi_lanes *increments)
{
    phi_lanes z[PHI_UNKNOWNS], offsets[PHI_FOLLOWERS];
    PHI_CLEAR_STAGES(z);
    phi_followers_lanes(s->coef, point, reads, factors + 1, offsets);
    for (int r = 0; r < PHI_ITERATED; ++r) phi_mix(phi_mixing, now[r], z[phi_iterated[r]]);
    for (int r = 0; r < PHI_FOLLOWERS; ++r) memcpy(z[phi_followed[r]], offsets[r], sizeof z[0]);
    phi_slopes(s, point, factors, z, increments);
    for (int r = 0; r < PHI_ITERATED; ++r) memcpy(increments[phi_iterated[r]], now[r], sizeof z[0]);
}

/* Compute the changes of the unknowns that sweeps do not iterate, in a step. They depend on sums of (1 - c_j) times the
   increment of stage j; these factors make the step symplectic. */
static void phi_end_followers(const phi_solver *s, double point[PHI_POINT], phi_lanes *increments, double end[PHI_UNKNOWNS])
{
    double reads[PHI_READS], offsets[PHI_FOLLOWERS], time[2] = { 1.0, s->h };
    for (int r = 0; r < PHI_READS; ++r) {
        const double *increment = increments[PHI_READ(r)];
        phi_lanes rest;
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_WIDTH; ++lane) rest[lane] = (1.0 - phi_stage_times[lane]) * increment[lane];
        reads[r] = phi_total(rest);
    }
    phi_followers(s->coef, point, reads, time, offsets);
    for (int r = 0; r < PHI_FOLLOWERS; ++r) end[phi_followed[r]] = offsets[r];
}
#endif
