#ifndef PHI_FILE_BLOCKS_SLOPES_H
#define PHI_FILE_BLOCKS_SLOPES_H
#include "newton_lanes.c"

enum {
    PHI_PAST = 8, /* vector fields ("slopes") that a step of Adams' method reads */
    PHI_SLOPES = PHI_PAST + PHI_LANES + 1 /* stored slopes: at the starts of PHI_PAST earlier steps, of the steps of a block, and at its end */
};
#endif
