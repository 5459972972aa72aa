#ifndef PHI_FILE_HISTORY_GAUSS_H
#define PHI_FILE_HISTORY_GAUSS_H
#if PHI_LIFTED
/* Results of the last steps, from which the starting values of the next iteration are predicted. They affect the speed
   only, except frame and frame_carry, which belong to the state. Unknowns are offsets from a state. A sweep iterates all stages
   once. */
#else
/* Results of the last steps, from which the starting values of the next iteration are predicted. They affect the speed
   only. Unknowns are offsets from a state, called their frame. A sweep iterates all stages once. */
#endif
typedef struct {
    int count;     /* number of steps in the array `increments` */
#if PHI_STAGED
    int latest;    /* index of the last step in the array `increments` */
#endif
    int sweeps;    /* number of the first sweep whose change is measured */
#if PHI_STAGED
    int predictor; /* index in phi_prediction of the predictor for the next step */
    int age;       /* steps since the predictors were first compared; they are compared again after every PHI_TRIALS steps */
#endif
    double rate;   /* factor by which the changes of a sweep shrink from one sweep to the next */
    int kicked;    /* whether the state was changed since the last step */
    double h;      /* size of the last step */
#if PHI_LIFTED
    int lifted;    /* whether frame has been computed; after a kick it still belongs to the former state */
    double frame[PHI_LIFT], frame_carry[PHI_LIFT]; /* quaternions F with F* k F = y, where the vectors y are linear functions of x; compensation terms of F */
#endif
#if PHI_STAGED
    double increments[PHI_EARLIER][PHI_UNKNOWNS][PHI_WIDTH]; /* stage increments of the last steps, in the frame at the end of the last step */
#else
    double increments[PHI_UNKNOWNS][PHI_WIDTH]; /* stage increments of the last step, in the frame at its end */
#endif
#if PHI_FRAMED && PHI_ADJOINT
    double solved[PHI_UNKNOWNS][PHI_WIDTH]; /* stage increments of the last step in the frame at its start, for reverse passes */
#endif
} phi_history;
#endif
