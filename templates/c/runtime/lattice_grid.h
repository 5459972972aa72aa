#ifndef PHI_FILE_LATTICE_GRID_H
#define PHI_FILE_LATTICE_GRID_H
/* Return the number of bytes that phi_init needs as memory for these sizes, 0 for sizes that are not admissible. */
size_t phi_work_size(const size_t sizes[PHI_AXES]);

/* Initialise *s with the state x0[field][site], where the site index of the last axis varies fastest. work is memory of
   phi_work_size(sizes) bytes, aligned as by malloc; the caller frees it after the last use of *s. params may be NULL for
   the defaults; its arrays are copied. Returns PHI_BAD_ARGUMENT if sizes are not admissible, if x0 or a parameter is not
   finite, or if a parameter that must be positive is not. */
phi_status phi_init(phi_solver *s, const phi_params *params, PHI_SIZES, const double *x0, void *work);
#endif
