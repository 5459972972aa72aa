/* A solver with the API of generated C, written by hand: the harmonic oscillator (q, p) with the frequency omega, and a
   constant coordinate c. A step fails if |q| would exceed limit. */
#ifndef OSCILLATOR_H
#define OSCILLATOR_H
#include <stddef.h>

#define oscillator_DIM 3
#define oscillator_ORDER 2
#define oscillator_CASIMIRS 2

typedef struct { double omega, limit; } oscillator_params;
extern const oscillator_params oscillator_default_params;

typedef enum {
    oscillator_OK = 0, oscillator_NO_CONVERGENCE, oscillator_SINGULAR, oscillator_NOT_FINITE, oscillator_BAD_ARGUMENT
} oscillator_status;

typedef struct {
    double x[oscillator_DIM];
    oscillator_params params;
    size_t steps;
} oscillator_solver;

oscillator_status oscillator_init(oscillator_solver *s, const oscillator_params *params, const double x0[oscillator_DIM]);
oscillator_status oscillator_step(oscillator_solver *s, double h);
oscillator_status oscillator_integrate(oscillator_solver *s, double h, size_t steps);
oscillator_status oscillator_ensemble(const oscillator_params *params, double *x, size_t members, double h, size_t steps,
                                      unsigned char *status);
double oscillator_hamiltonian(const oscillator_params *params, const double x[oscillator_DIM]);
void oscillator_casimirs(const oscillator_params *params, const double x[oscillator_DIM], double out[]);
void oscillator_vector_field(const oscillator_params *params, const double x[oscillator_DIM], double out[oscillator_DIM]);
const char *oscillator_status_string(oscillator_status status);
size_t oscillator_solver_size(void);
size_t oscillator_solver_steps_done(const oscillator_solver *s);
#endif
