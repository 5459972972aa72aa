#ifndef PHI_FILE_LATTICE_GRID_H
#define PHI_FILE_LATTICE_GRID_H
/* Number of bytes that phi_init needs for these sizes; 0 if they are not admissible. */
size_t phi_work_size(const size_t sizes[PHI_AXES]);

#if PHI_DEFAULTS
/* Initialise *s with the state x0[field][site], the last axis fastest. `work` has phi_work_size(sizes) bytes, aligned
   as by malloc, and must outlive *s. params may be NULL for the defaults; its arrays are copied. Returns
   PHI_BAD_ARGUMENT if sizes are not admissible, a value is not finite, or a parameter that must be positive is not. */
#else
/* Initialise *s with the state x0[field][site], the last axis fastest. `work` has phi_work_size(sizes) bytes, aligned
   as by malloc, and must outlive *s. params must not be NULL, nor those of its arrays that have no default; all arrays
   are copied. Returns PHI_BAD_ARGUMENT if sizes are not admissible, params or a required array is NULL, a value is not
   finite, or a parameter that must be positive is not. */
#endif
#if PHI_BODIES
/* phi_init also returns PHI_BAD_ARGUMENT if a mass is negative, if the first one is 0, or if their sum is not finite. */
#endif
phi_status phi_init(phi_solver *s, const phi_params *params, PHI_SIZES, const double *x0, void *work);
#endif
