#ifndef PHI_FILE_HISTORY_DIFFERENCES_H
#define PHI_FILE_HISTORY_DIFFERENCES_H
/* Predictor: the last solution and its backward differences, to extrapolate the next one. For speed only. */
typedef struct {
    int count, order; /* number of differences that are known, and of those that the extrapolation sums */
    double difference[PHI_DIFFERENCES][PHI_DIM]; /* the solution, then differences */
} phi_history;
#endif
