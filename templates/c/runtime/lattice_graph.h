#ifndef PHI_FILE_LATTICE_GRAPH_H
#define PHI_FILE_LATTICE_GRAPH_H
/* The bonds of a graph. Bond k connects the sites ends[2 * k] and ends[2 * k + 1], counted from 0. */
typedef struct {
    size_t count;
    const size_t *ends;
} phi_bonds;

/* Bytes that phi_init needs for these sizes and this number of bonds; 0 if they are refused. */
size_t phi_work_size(const size_t sizes[PHI_AXES], size_t bonds);

#if PHI_DEFAULTS
/* Initialise *s with the state x0[field][site]. `work` has phi_work_size(sizes, bonds->count) bytes, aligned as by
   malloc, and must outlive *s. `bonds` may be NULL if there are none, and `params` for the defaults. All arrays are
   copied. Returns PHI_BAD_ARGUMENT if sizes are refused, a bond does not connect two different sites, a value is not
   finite, or a parameter that must be positive is not. */
#else
/* Initialise *s with the state x0[field][site]. `work` has phi_work_size(sizes, bonds->count) bytes, aligned as by
   malloc, and must outlive *s. `bonds` may be NULL if there are none. params must not be NULL, nor those of its arrays
   that have no default. All arrays are copied. Returns PHI_BAD_ARGUMENT if sizes are not admissible, params or a
   required array is NULL, a bond does not connect two different sites, a value is not finite, or a parameter that
   must be positive is not. */
#endif
phi_status phi_init(phi_solver *s, const phi_params *params, PHI_SIZES, const double *x0, void *work);
#endif
