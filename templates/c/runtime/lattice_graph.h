#ifndef PHI_FILE_LATTICE_GRAPH_H
#define PHI_FILE_LATTICE_GRAPH_H
/* The bonds of a graph. Bond k connects the sites ends[2 * k] and ends[2 * k + 1], which are counted from 0. */
typedef struct {
    size_t count;
    const size_t *ends;
} phi_bonds;

/* Return the number of bytes that phi_init needs as memory for these sizes and number of bonds, 0 if there are too many. */
size_t phi_work_size(const size_t sizes[PHI_AXES], size_t bonds);

/* Initialise *s with the state x0[field][site]. work is memory of phi_work_size(sizes, bonds->count) bytes, aligned as by
   malloc; the caller frees it after the last use of *s. bonds may be NULL if there are none, params for the defaults; all
   arrays are copied. Returns PHI_BAD_ARGUMENT if sizes are not admissible, if a bond does not connect two different sites,
   if x0 or a parameter is not finite, or if a parameter that must be positive is not. */
phi_status phi_init(phi_solver *s, const phi_params *params, PHI_SIZES, const double *x0, void *work);
#endif
