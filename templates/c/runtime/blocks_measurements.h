#ifndef PHI_FILE_BLOCKS_MEASUREMENTS_H
#define PHI_FILE_BLOCKS_MEASUREMENTS_H
#include <limits.h>

/* Measurements that decide when several steps are solved together, as a block in SIMD registers, and when one by one. They
   affect the speed only. */
typedef struct {
    double evaluations_per_stage;      /* number of evaluations in single steps */
    int single_steps;                  /* single steps to make before the next block */
    int last_single_steps;             /* single_steps after the last failure, halved by each successful block */
    int use_recurrences;               /* 1 if recurrences predict blocks, 0 if Runge-Kutta steps do */
    int passes_without_recurrences;    /* iterations of the last block predicted by Runge-Kutta steps */
    size_t steps_without_recurrences;  /* steps to wait before recurrences are tried again */
    size_t recurrences_from_step;      /* number of the step from which they are tried again */
} phi_block_measurements;
#endif
