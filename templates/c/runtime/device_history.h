#ifndef PHI_FILE_DEVICE_HISTORY_H
#define PHI_FILE_DEVICE_HISTORY_H
/* Predictor, which affects the speed only: the last solution of the implicit equation and its backward differences,
   from which the next solution is extrapolated. */
typedef struct {
    int count, order; /* number of stored entries, and number of entries whose sum is the prediction */
    PHI_SHARED double *difference; /* in shared memory: the last solution, then its differences; PHI_DIM numbers each */
} phi_history;

/* Number of doubles in shared memory for the predictors of one work item. */
enum { PHI_LENT = PHI_ALL_STAGES(PHI_DIFFERENCES * PHI_DIM) };
#endif
