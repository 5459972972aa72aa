#ifndef PHI_FILE_DEVICE_HISTORY_H
#define PHI_FILE_DEVICE_HISTORY_H
/* Predictor: the last solution and its backward differences, to extrapolate the next one. For speed only. */
typedef struct {
    int count, order; /* number of differences that are known, and of those that the extrapolation sums */
    PHI_SHARED double *difference; /* the solution, then differences, each of PHI_DIM numbers; in shared memory */
} phi_history;

/* Doubles of shared memory for the predictors of one work item. */
enum { PHI_LENT = PHI_ALL_STAGES(PHI_DIFFERENCES * PHI_DIM) };
#endif
