#ifndef PHI_FILE_GAUSS_ALL_UNKNOWNS
#define PHI_FILE_GAUSS_ALL_UNKNOWNS
#if PHI_STAGED
/* Index of unknown number r among the unknowns that sweeps read. Sweeps read all unknowns. */
#define PHI_READ(r) (r)

#endif
/* Predict the unknowns z at the stages of a step by the collocation polynomial of the last step. The size of the step
   is `ratio` times the size of the last step. */
static void phi_predict_at(phi_history *past, double ratio, phi_lanes *z)
{
    double factor[PHI_NODES];
    for (int i = 0; i < PHI_NODES; ++i) {
        phi_factors_at(1.0 + ratio * phi_nodes[i], factor);
        for (int k = 0; k < PHI_UNKNOWNS; ++k)
            for (int j = 0; j < PHI_NODES; ++j) z[k][i] += factor[j] * PHI_LAST_INCREMENTS(past)[k][j];
    }
}
#endif
