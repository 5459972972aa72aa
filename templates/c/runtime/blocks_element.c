#ifndef PHI_FILE_BLOCKS_ELEMENT
#define PHI_FILE_BLOCKS_ELEMENT
#include "blocks.c"

/* Compute the attitude increments of a stage in all lanes, as differences from the identity. */
static void phi_factor_lanes(phi_lanes *coef, phi_lanes *y, phi_lanes turns[PHI_ELEMENT]) { phi_turn_lanes(coef, y, turns); }
#endif
