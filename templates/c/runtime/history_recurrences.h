#ifndef PHI_FILE_HISTORY_RECURRENCES_H
#define PHI_FILE_HISTORY_RECURRENCES_H
enum { PHI_STORED_VALUES = 2 * PHI_REMEMBERED };

/* Predictor, which affects the speed only: recent solutions of the implicit equation. They give the starting value of
   the next iteration by extrapolation, or by a linear recurrence that is fitted to the last PHI_REMEMBERED solutions.
   */
typedef struct {
    int count;                       /* number of solutions in the array `past` */
    int extrapolation_order;         /* number of solutions that the extrapolation uses */
    int recurrence_terms;            /* number of solutions that the recurrence uses; 0 if none is fitted */
    int use_recurrence;              /* 1 if the recurrence predicts better than the extrapolation */
    int fits;                        /* number of fits so far */
    int slow_steps;                  /* recent steps that took more than one iteration */
    int slow_steps_allowed;          /* value of slow_steps at which the recurrence is fitted again */
    double past[PHI_STORED_VALUES][PHI_DIM]; /* solutions, the latest last */
    double weight[PHI_WINDOW][PHI_DIM][PHI_AHEAD]; /* factors of the past solutions, the latest first, in predictions of the next PHI_AHEAD solutions */
} phi_history;
#endif
