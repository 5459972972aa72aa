#ifndef PHI_FILE_LATTICE_BY_HAND_H
#define PHI_FILE_LATTICE_BY_HAND_H
/* Caller-driven stepping, for lattices distributed over several memories. A plane is all sites with the same index of the
   first axis. A step consists of the stages 0 ... phi_stages() - 1; each is a sweep over all planes. Without noise, there
   is one more stage, number phi_stages(): the last stage of a step merged with the first of the next step. phi_integrate
   merges them too. A stage may be computed in parts, in any order; the result has the same bits as phi_step. Before a
   part is computed, all planes that it reads must have completed the earlier stages. */
typedef struct {
    size_t behind, ahead;        /* number of planes that are read before the first updated one, and after the last */
    unsigned long read, changed; /* bit k of `read`: field k is read beyond the updated planes; bit k of `changed`: field k is updated */
} phi_stage;

size_t phi_stages(void);
phi_status phi_describe(size_t number, phi_stage *about); /* writes to *about what stage `number` reads and updates */

/* phi_begin computes the coefficients for a step size; call it before the first stage. phi_sweep makes a stage for the
   planes `from` ... `to` - 1. With full_range = 1, it uses functions for arguments of any size; with full_range = 0, it
   uses faster functions, which give NaN if an argument is too large. */
phi_status phi_begin(phi_solver *s, double h);
phi_status phi_sweep(phi_solver *s, size_t number, int full_range, size_t from, size_t to);

/* Read or write the values x[plane][site] of field number `field` on the planes `from` ... `to` - 1. Fields and planes
   are counted from 0. phi_holds returns 1 if all fields are finite on these planes. */
phi_status phi_planes(const phi_solver *s, size_t field, size_t from, size_t to, double *x);
phi_status phi_put_planes(phi_solver *s, size_t field, size_t from, size_t to, const double *x);
int phi_holds(const phi_solver *s, size_t from, size_t to);
#endif
