#ifndef PHI_FILE_BLOCKS_MEASUREMENTS_H
#define PHI_FILE_BLOCKS_MEASUREMENTS_H
#include <limits.h>

/* Measurements that decide whether the next steps are solved together, as a block in SIMD registers, or one by one. They
   affect the speed only. */
typedef struct {
    double evaluations_per_stage;      /* running mean of the evaluations in a stage of a single step */
    int single_steps;                  /* number of single steps to make before the next block */
    int last_single_steps;             /* value of single_steps after the last failed block, halved by each successful block */
    int use_recurrences;               /* 1 if recurrences predict blocks, 0 if Runge-Kutta steps do */
    int passes_without_recurrences;    /* iterations that the latest block without recurrences took */
    size_t steps_without_recurrences;  /* steps to wait before recurrences are tried again */
    size_t recurrences_from_step;      /* number of the step from which recurrences are tried again */
} phi_block_measurements;
#endif
