#ifndef PHI_FILE_ADJOINT_LANES
#define PHI_FILE_ADJOINT_LANES
#include <math.h>
#include <string.h>

#include "adjoint_stage.c"
#include "expansion_lanes.c"
#include "model.h"
#include "model_lanes.h"
#include "solver.c"

/* ---- The transpose of steps in lanes ---- */
/* What stages are linearised around is known before anything is pulled back. So the derivatives of several are computed at
   once, and a cotangent takes a small matrix through each. */
#if PHI_PATH
#define PHI_BACK_SETTLED 1e-15  /* accuracy of middles */
#define PHI_BACK_ACCURACY 1e-17 /* of the derivatives of paths */
#endif

/* Stages that are gone back through at once, linearised: jacobian and gain are the transposes of the derivatives of alpha(y)
   and of the increment. A cotangent after of the end of one becomes after + change, where jacobian change = gain after;
   wrong is infinite where lanes do not suffice. */
typedef struct {
    phi_lanes *coef, y[PHI_DIM], jacobian[PHI_DIM * PHI_DIM], gain[PHI_DIM * PHI_DIM];
    phi_lanes after[PHI_DIM], change[PHI_DIM], wrong;
#if PHI_PATH
    phi_lanes start[PHI_DIM];
    phi_expansion e;
#endif
#if PHI_RENEWED
    double t[PHI_LANES];
#endif
} phi_traced;

/* Solve matrix * solutions = sides, both overwritten, of so many sides in each row, by elimination without pivoting:
   matrices are I + O(h). wrong becomes infinite where a pivot is far from 1. */
static void phi_solve_lanes(phi_lanes *matrix, phi_lanes *sides, int count, phi_lanes wrong)
{
    for (int k = 0; k < PHI_DIM; ++k) {
        phi_lanes reciprocal, factor;
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            reciprocal[lane] = 1.0 / matrix[k * PHI_DIM + k][lane];
            wrong[lane] += fabs(reciprocal[lane]) < PHI_LARGEST_RECIPROCAL ? 0.0 : HUGE_VAL;
        }
        for (int j = k + 1; j < PHI_DIM; ++j) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) matrix[k * PHI_DIM + j][lane] *= reciprocal[lane];
        }
        for (int j = 0; j < count; ++j) {
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) sides[k * count + j][lane] *= reciprocal[lane];
        }
        for (int i = 0; i < PHI_DIM; ++i) {
            if (i == k) continue;
            memcpy(factor, matrix[i * PHI_DIM + k], sizeof factor);
            for (int j = k + 1; j < PHI_DIM; ++j) {
                PHI_EACH_LANE
                for (int lane = 0; lane < PHI_LANES; ++lane)
                    matrix[i * PHI_DIM + j][lane] -= factor[lane] * matrix[k * PHI_DIM + j][lane];
            }
            for (int j = 0; j < count; ++j) {
                PHI_EACH_LANE
                for (int lane = 0; lane < PHI_LANES; ++lane)
                    sides[i * count + j][lane] -= factor[lane] * sides[k * count + j][lane];
            }
        }
    }
}

#if PHI_NEWTON
/* Linearise the stages. */
static void phi_linearise_back(phi_traced *g)
{
    phi_lanes displacement[PHI_DIM], increment[PHI_DIM], jacobian[PHI_DIM * PHI_DIM];
#if PHI_CENTRED
    phi_linearise_lanes(g->coef, g->y, displacement, increment, jacobian);
#else
    phi_lanes slope[PHI_DIM * PHI_DIM];
#if PHI_SPARSE
    memset(jacobian, 0, sizeof jacobian); /* zeros are not stored */
    memset(slope, 0, sizeof slope);
#endif
    phi_linearise_lanes(g->coef, g->y, displacement, increment, jacobian, slope);
#endif
    memset(g->wrong, 0, sizeof g->wrong);
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) {
            const int to = i * PHI_DIM + j, from = j * PHI_DIM + i;
            PHI_EACH_LANE
            for (int lane = 0; lane < PHI_LANES; ++lane) {
                g->jacobian[to][lane] = jacobian[from][lane];
#if PHI_CENTRED
                g->gain[to][lane] = 2.0 * ((i == j ? 1.0 : 0.0) - jacobian[from][lane]); /* y is the mean of the ends */
#else
                g->gain[to][lane] = slope[from][lane];
#endif
            }
        }
}

/* The cotangents of coefficients, from those of ends and of residuals. */
static void phi_slopes_back(phi_traced *g, phi_lanes slopes[restrict PHI_COEFFICIENTS])
{
    phi_lanes minus[PHI_DIM];
    for (int i = 0; i < PHI_DIM; ++i) {
        PHI_EACH_LANE
        for (int lane = 0; lane < PHI_LANES; ++lane) minus[i][lane] = -g->change[i][lane];
    }
    phi_linearise_adjoint_lanes(g->coef, g->y, minus, g->after, slopes);
}

#else
#if PHI_ALONG
/* The derivatives of the paths along the coefficients that pi depends on, by as many orders as those along p. */
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
/* The derivatives of start and change of the paths, along their middles and p: what even and odd terms add up to. */
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

/* Follow the paths with mean y under p, and their derivatives. */
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

/* Linearise the stages. With M and N the derivatives of the mean along middle and p = grad S_h(y), and H the Hessian of
   S_h, the middle follows y by M^-1 (1 - N H). So the derivatives of the start and of the change along y are known. */
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

/* The cotangents of coefficients, from those of ends and starts: of p first, then by p and by the paths. */
static void phi_slopes_back(phi_traced *g, phi_lanes slopes[restrict PHI_COEFFICIENTS])
{
    phi_lanes matrix[PHI_DIM * PHI_DIM], mean[PHI_DIM], covector[PHI_DIM], known = { 0.0 }; /* the pivots are those of before */
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
/* Load a stage of the step that at is before, into a lane. */
static void phi_load(phi_traced *g, int lane, const phi_solver *at PHI_AND_INT_STAGE, const double y[PHI_DIM])
{
    for (int i = 0; i < PHI_DIM; ++i) g->y[i][lane] = y[i];
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) g->coef[k][lane] = PHI_OF(at->coef, stage)[k];
#if PHI_RENEWED
    g->t[lane] = at->t + PHI_OF(phi_middles, stage) * at->h;
#endif
}

/* Pull a cotangent back through a stage that was linearised; where that was not possible, by itself. */
static phi_status phi_through(phi_traced *g, int lane, phi_cotangent *bar, double coef_bar[PHI_COEFFICIENTS])
{
    double change[PHI_DIM] = { 0.0 };
    phi_status status = PHI_OK;
    for (int i = 0; i < PHI_DIM; ++i)
        for (int j = 0; j < PHI_DIM; ++j) change[i] += g->gain[i * PHI_DIM + j][lane] * bar->x[j];
    for (int i = 0; i < PHI_DIM; ++i)
        if (!isfinite(change[i])) g->wrong[lane] = HUGE_VAL;
    const int good = g->wrong[lane] == 0.0;
    for (int i = 0; i < PHI_DIM; ++i) {
        g->after[i][lane] = good ? bar->x[i] : 0.0;
        g->change[i][lane] = good ? change[i] : 0.0;
    }
    if (good) {
        for (int i = 0; i < PHI_DIM; ++i) {
            bar->x[i] += change[i];
#if PHI_PATH
            bar->end[i] = g->start[i][lane];
#endif
        }
    } else {
        double coef[PHI_COEFFICIENTS], y[PHI_DIM];
        for (int k = 0; k < PHI_COEFFICIENTS; ++k) coef[k] = g->coef[k][lane];
        for (int i = 0; i < PHI_DIM; ++i) y[i] = g->y[i][lane];
        status = phi_stage_adjoint(coef, y, bar, coef_bar);
#if PHI_RENEWED
        phi_early(coef, coef_bar, g->t[lane]);
#endif
    }
    return status;
}

/* Add up the cotangents of coefficients of the lanes that were linearised. */
static void phi_gather(phi_traced *g, phi_lanes slopes[PHI_COEFFICIENTS], int lane, double coef_bar[PHI_COEFFICIENTS])
{
    if (g->wrong[lane] != 0.0) return;
#if PHI_RENEWED
    double coef[PHI_COEFFICIENTS], own[PHI_COEFFICIENTS];
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) {
        coef[k] = g->coef[k][lane];
        own[k] = slopes[k][lane];
    }
    phi_early(coef, own, g->t[lane]);
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) coef_bar[k] += own[k];
#else
    for (int k = 0; k < PHI_COEFFICIENTS; ++k) coef_bar[k] += slopes[k][lane];
#endif
}
#endif
