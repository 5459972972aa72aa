#ifndef PHI_FILE_LATTICE_PREDICTOR_H
#define PHI_FILE_LATTICE_PREDICTOR_H
/* Predictor of the solution y of an implicit stage: backward differences of the last values of y - x, from which the
   starting value of the iteration is extrapolated. */
typedef struct {
    int count, order; /* number of stored differences, and number of differences whose sum is the prediction */
    double *difference[PHI_DIFFERENCES][PHI_DIM];
} phi_predictor;
#endif
