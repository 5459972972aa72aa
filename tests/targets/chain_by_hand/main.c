/* Energy, reversibility, the derivative of H along the field, memory, sizes and failures, by the runtime of lattices. */
#include <stdio.h>
#include <stdlib.h>

#include "lattice.c"

enum { ROWS = 3, LENGTH = 5, SITES = ROWS * LENGTH };

static int failed(const char *what)
{
    printf("%s\n", what);
    return 1;
}

int main(void)
{
    const size_t sizes[PHI_AXES] = { ROWS, LENGTH }, none[PHI_AXES] = { 0, LENGTH }, huge[PHI_AXES] = { (size_t)-1, 2 };
    double x0[PHI_DIM * SITES], x[PHI_DIM * SITES], field[PHI_DIM * SITES];
    for (int k = 0; k < PHI_DIM * SITES; ++k) x0[k] = 0.3 * (k * 7 % 11 - 5);
    if (phi_work_size(none) != 0 || phi_work_size(huge) != 0) return failed("sizes");
    void *work = malloc(phi_work_size(sizes));
    phi_solver s;
    if (work == NULL || phi_init(&s, NULL, sizes, x0, work) != PHI_OK) return failed("init");
    const double energy = phi_hamiltonian(&s);
    phi_state(&s, x);
    if (memcmp(x, x0, sizeof x) != 0) return failed("state");
    phi_vector_field(&s, field);
    if (phi_integrate(&s, 0.01, 1000) != PHI_OK || s.steps != 1000) return failed("integrate");
    if (fabs(phi_hamiltonian(&s) - energy) > 1e-2) return failed("energy");
    if (phi_integrate(&s, -0.01, 1000) != PHI_OK) return failed("back");
    phi_state(&s, x);
    for (int k = 0; k < PHI_DIM * SITES; ++k)
        if (fabs(x[k] - x0[k]) > 1e-11) return failed("reversibility");
    if (phi_step(&s, 1e-6) != PHI_OK) return failed("step");
    phi_state(&s, x);
    for (int k = 0; k < PHI_DIM * SITES; ++k)
        if (fabs((x[k] - x0[k]) / 1e-6 - field[k]) > 1e-4) return failed("field");
    x0[3] = 1e308;
    x0[SITES + 3] = 1e308;
    if (phi_init(&s, NULL, sizes, x0, work) != PHI_OK) return failed("large");
    if (phi_integrate(&s, 1e10, 40) != PHI_NOT_FINITE || s.steps != 0) return failed("not finite");
    phi_state(&s, x);
    if (memcmp(x, x0, sizeof x) != 0) return failed("state before the failing step");
    x0[0] = (double)NAN;
    if (phi_init(&s, NULL, sizes, x0, work) != PHI_BAD_ARGUMENT) return failed("nan");
    puts(phi_status_string(PHI_OK));
    free(work);
    return 0;
}
