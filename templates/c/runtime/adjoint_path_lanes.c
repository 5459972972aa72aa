#ifndef PHI_FILE_ADJOINT_PATH_LANES
#define PHI_FILE_ADJOINT_PATH_LANES
#include <math.h>
#include <string.h>
#include "adjoint_lanes.c"

#define PHI_BACK_SETTLED 1e-15  /* relative accuracy of the middle of a path, m at half time */
#define PHI_BACK_ACCURACY 1e-17 /* relative accuracy of the derivatives of paths */

#if PHI_ALONG
/* Compute the derivatives of the paths by those coefficients on which pi depends. They are Taylor series, to the same
   order as the derivatives by p. */
static void phi_vary_coefficients(phi_expansion *e)
{
    memset(e->w[0], 0, sizeof e->w[0]);
    memset(e->w_even, 0, sizeof e->w_even);
    memset(e->w_odd, 0, sizeof e->w_odd);
    memset(e->w_mean, 0, sizeof e->w_mean);
    for (int k = 0; k < e->varied; ++k) {
        const double share = 1.0 / (double)(k + 2);
        memset(e->w[k + 1], 0, sizeof e->w[k + 1]);
        phi_vary_along_source(e, k);
        for (int j = 0; j < k; ++j) phi_vary_along_by(e, j, k);
        for (int i = 0; i < PHI_DIM * PHI_USED; ++i) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                const double term = e->w[k + 1][i][lane];
                if (k % 2 == 0) e->w_odd[i][lane] += term;
                else {
                    e->w_even[i][lane] += term;
                    e->w_mean[i][lane] += share * term;
                }
            }
        }
    }
}

#endif
/* Compute how the start of each path, and its change from start to end, depend on the middle of the path and on p:
   derivatives, from the sums of the even and of the odd terms of the series. */
static void phi_ends_of_slopes(phi_expansion *e)
{
    for (int i = 0; i < 2 * PHI_DIM * PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            e->v_even[i][lane] -= e->v_odd[i][lane];
            e->v_odd[i][lane] *= 2.0;
        }
    }
}

/* Compute the paths with mean y and covector p in all lanes, and their derivatives. */
static void phi_trace(phi_traced *g, phi_lanes hessian[restrict PHI_DIM * PHI_DIM])
{
    phi_lanes middle[PHI_DIM];
    phi_expansion *e = &g->e;
    phi_curvature_lanes(g->coef, g->y, e->p, hessian);
    phi_halve(e->p);
    phi_find_middles(g->coef, g->y, middle, e, PHI_BACK_SETTLED);
    phi_extend(g->coef, e, PHI_NEGLIGIBLE);
    memset(g->wrong, 0, sizeof g->wrong);
    phi_check_ends(g->coef, e, g->wrong);
    phi_vary(g->coef, e, PHI_BACK_ACCURACY);
#if PHI_ALONG
    phi_vary_coefficients(e);
#endif
    phi_ends_of_slopes(e);
    for (int lane = 0; lane < PHI_LANES; ++lane)
        if (!isfinite(middle[0][lane]) || !isfinite(e->v_mean[0][lane])) g->wrong[lane] = HUGE_VAL;
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane)
            g->start[i][lane] = e->s[i][0][lane] + (e->even[i][lane] - e->odd[i][lane]);
    }
}

/* Linearise the stages in all lanes. M and N are the derivatives of the mean of a path by its middle and by its covector
   p = grad S_h(y), H is the Hessian of S_h. The derivative of the middle by y is M^-1 (1 - N H), from which the derivatives
   of start and change of the path follow. */
static void phi_linearise_back(phi_traced *g)
{
    phi_lanes hessian[PHI_DIM * PHI_DIM], matrix[PHI_DIM * PHI_DIM], follows[PHI_DIM * PHI_DIM];
    const phi_expansion *e = &g->e;
    phi_trace(g, hessian);
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) {
            phi_lanes *to = &follows[i * PHI_DIM + j];
            for (int lane = 0; lane < PHI_LANES; ++lane) (*to)[lane] = i == j ? 1.0 : 0.0;
            memcpy(matrix[i * PHI_DIM + j], e->v_mean[i * 2 * PHI_DIM + j], sizeof *to);
            for (int k = 0; k < PHI_DIM; ++k) {
                PHI_EACH_LANE
                for (int lane = 0; lane < PHI_LANES; ++lane)
                    (*to)[lane] -= e->v_mean[i * 2 * PHI_DIM + PHI_DIM + k][lane] * hessian[k * PHI_DIM + j][lane];
            }
        }
    phi_solve_lanes(matrix, follows, PHI_DIM, g->wrong);
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) {
            phi_lanes start = { 0.0 }, change = { 0.0 };
            for (int k = 0; k < PHI_DIM; ++k) {
                const int m = i * 2 * PHI_DIM + k, p = m + PHI_DIM, from = k * PHI_DIM + j;
                PHI_EACH_LANE
                for (int lane = 0; lane < PHI_LANES; ++lane) {
                    start[lane] += e->v_even[m][lane] * follows[from][lane] + e->v_even[p][lane] * hessian[from][lane];
                    change[lane] += e->v_odd[m][lane] * follows[from][lane] + e->v_odd[p][lane] * hessian[from][lane];
                }
            }
            memcpy(g->jacobian[j * PHI_DIM + i], start, sizeof start);
            memcpy(g->gain[j * PHI_DIM + i], change, sizeof change);
        }
}

/* Compute the cotangents of the coefficients from the cotangents of ends and starts of paths. Coefficients act through p,
   whose cotangent is computed first, and through the paths. */
static void phi_slopes_back(phi_traced *g, phi_lanes slopes[restrict PHI_COEFFICIENTS])
{
    phi_lanes matrix[PHI_DIM * PHI_DIM], mean[PHI_DIM], covector[PHI_DIM], known = { 0.0 }; /* pivots are not checked again: g->wrong has the result */
    const phi_expansion *e = &g->e;
    for (int i = 0; i < PHI_DIM; ++i) {
        phi_lanes along_m = { 0.0 }, along_p = { 0.0 };
        for (int k = 0; k < PHI_DIM; ++k) {
            const int m = k * 2 * PHI_DIM + i, p = m + PHI_DIM;
            memcpy(matrix[i * PHI_DIM + k], e->v_mean[m], sizeof along_m);
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                along_m[lane] += e->v_odd[m][lane] * g->after[k][lane] - e->v_even[m][lane] * g->change[k][lane];
                along_p[lane] += e->v_odd[p][lane] * g->after[k][lane] - e->v_even[p][lane] * g->change[k][lane];
            }
        }
        memcpy(mean[i], along_m, sizeof along_m);
        memcpy(covector[i], along_p, sizeof along_p);
    }
    phi_solve_lanes(matrix, mean, 1, known);
    for (int i = 0; i < PHI_DIM; ++i)
        for (int k = 0; k < PHI_DIM; ++k) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane)
                covector[i][lane] -= e->v_mean[k * 2 * PHI_DIM + PHI_DIM + i][lane] * mean[k][lane];
        }
    phi_slope_adjoint_lanes(g->coef, g->y, covector, slopes);
#if PHI_ALONG
    for (int u = 0; u < PHI_USED; ++u)
        for (int k = 0; k < PHI_DIM; ++k) {
            const int c = k * PHI_USED + u;
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                const double even = e->w_even[c][lane], odd = e->w_odd[c][lane];
                slopes[phi_back_used[u]][lane] += 2.0 * odd * g->after[k][lane] - (even - odd) * g->change[k][lane]
                    - e->w_mean[c][lane] * mean[k][lane];
            }
        }
#endif
}
#endif
