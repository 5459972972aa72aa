#ifndef PHI_FILE_HISTORY_GAUSS_H
#define PHI_FILE_HISTORY_GAUSS_H
/* Results of the last steps, by which the next one predicts the starting values of its iteration. They affect the speed
   only. */
typedef struct {
    int count;     /* steps in moves */
    int latest;    /* place of the last one there */
    int sweeps;    /* number of the first sweep over the stages whose change is looked at */
    int predictor; /* number of the predictor */
#if PHI_STAGED
    int age;       /* steps since all predictors were compared for the first time */
#endif
    double rate;   /* factor by which the changes of a sweep shrink from one sweep to the next */
    double moves[PHI_EARLIER][PHI_UNKNOWNS][PHI_WIDTH]; /* stages of the last steps, as seen from the end of the last one */
#if PHI_FRAMED && PHI_ADJOINT
    double solved[PHI_UNKNOWNS][PHI_WIDTH]; /* those of the last step as seen from its start, for the tape */
#endif
} phi_history;
#endif
