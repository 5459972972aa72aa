#ifndef PHI_FILE_HISTORY_GAUSS_H
#define PHI_FILE_HISTORY_GAUSS_H
/* Results of the last steps, by which the next one predicts the starting values of its iteration. They affect the speed
   only, except for a frame, which belongs to the state. */
typedef struct {
    int count;     /* steps in increments */
#if PHI_STAGED
    int latest;    /* index of the last step in increments */
#endif
    int sweeps;    /* number of the first sweep over the stages whose change is measured */
#if PHI_STAGED
    int predictor; /* row of phi_prediction that predicts the next step */
    int age;       /* steps since the predictors were first compared; they are compared again after every PHI_TRIALS steps */
#endif
    double rate;   /* factor by which the changes of a sweep shrink from one sweep to the next */
    int kicked;    /* whether the state was changed since the last step */
    double h;      /* size of the last step */
#if PHI_LIFTED
    int lifted;    /* whether frame has been computed; after a kick it is that of the former state */
    double frame[PHI_LIFT], frame_carry[PHI_LIFT]; /* frames of group elements, and their compensation terms */
#endif
#if PHI_STAGED
    double increments[PHI_EARLIER][PHI_UNKNOWNS][PHI_WIDTH]; /* stage increments of the last steps, in the frame of the end of the last one */
#else
    double increments[PHI_UNKNOWNS][PHI_WIDTH]; /* stage increments of the last step, in the frame of its end */
#endif
#if PHI_FRAMED && PHI_ADJOINT
    double solved[PHI_UNKNOWNS][PHI_WIDTH]; /* stage increments of the last step in the frame of its start, for the tape */
#endif
} phi_history;
#endif
