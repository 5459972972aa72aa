#ifndef PHI_FILE_HISTORY_GAUSS_H
#define PHI_FILE_HISTORY_GAUSS_H
/* Results of the last step, by which the next one predicts the starting values of its iteration. They affect the speed
   only. */
typedef struct {
    int count;   /* 0 before the first step, else 1 */
    int sweeps;  /* sweeps over the stages in the last step */
    double rate; /* factor by which the changes of a sweep shrink from one sweep to the next */
    double moves[PHI_UNKNOWNS][PHI_WIDTH]; /* stages of the last step, in the frame of its start */
} phi_history;
#endif
