#ifndef PHI_FILE_HISTORY_DIFFERENCES_H
#define PHI_FILE_HISTORY_DIFFERENCES_H
/* Predictor, which affects the speed only: the last solution and backward differences, for extrapolation. */
typedef struct {
    int count, order; /* number of stored entries, and number of entries whose sum is the prediction */
    double difference[PHI_DIFFERENCES][PHI_DIM]; /* the last solution, then its differences */
} phi_history;
#endif
