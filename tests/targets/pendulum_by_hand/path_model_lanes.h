#ifndef PATH_MODEL_LANES_H
#define PATH_MODEL_LANES_H
#include "model_lanes.h"

static void phi_follow(phi_lanes coef[], phi_expansion *e, int k)
{
    (void)coef;
    for (int i = 2; i < 4; ++i) memset(e->s[i][k], 0, sizeof e->s[i][k]);
}

static void phi_follow_slopes(phi_lanes coef[], phi_expansion *e, int k)
{
    (void)coef;
    for (int i = 0; i < 2; ++i) memset(e->slope[i][k], 0, sizeof e->slope[i][k]);
}

static void phi_vary_by(phi_expansion *e, int j, int k) { (void)e, (void)j, (void)k; }

static void phi_vary_source(phi_expansion *e, int k)
{
    for (int lane = 0; lane < PHI_LANES; ++lane) {
        e->v[k + 1][3][lane] += 0.5 / (k + 1) * e->slope[0][k][lane];
        e->v[k + 1][6][lane] += 0.5 / (k + 1) * e->slope[1][k][lane];
    }
}
#endif
