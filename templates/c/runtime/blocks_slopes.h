#ifndef PHI_FILE_BLOCKS_SLOPES_H
#define PHI_FILE_BLOCKS_SLOPES_H
#include "newton_lanes.c"

enum {
    PHI_PAST = 8, /* slopes that a step of Adams' method reads */
    PHI_SLOPES = PHI_PAST + PHI_LANES + 1 /* slopes at the starts of steps: of the last block, of this one, and at its end */
};
#endif
