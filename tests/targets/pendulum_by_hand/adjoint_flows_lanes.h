#ifndef ADJOINT_FLOWS_LANES_H
#define ADJOINT_FLOWS_LANES_H
#include "batches.c"

static void phi_follow_lanes(int part, int row, phi_group *group, phi_lanes kept[PHI_BACK_PACKS][2])
{
    for (int k = 0; k < group->packs; ++k) {
        memcpy(kept[k], group->pack[k].x, sizeof group->pack[k].x);
        phi_pack *at = &group->pack[k];
        phi_lanes change, *coef = group->coef[k] + row * PHI_ROW;
        const int kick = part == 2;
        for (int lane = 0; lane < PHI_LANES; ++lane)
            change[lane] = kick ? -coef[1][lane] * sin(at->x[0][lane]) : coef[0][lane] * at->x[1][lane];
        phi_add_lanes(at->x[kick], at->carry[kick], at->start[kick], change);
    }
}

static void phi_follow_back_lanes(int part, int row, phi_group *group, phi_lanes x[PHI_BACK_PACKS][2], phi_back_group *bar)
{
    for (int k = 0; k < group->packs; ++k)
        for (int lane = 0; lane < PHI_LANES; ++lane) {
            double coef[PHI_ROW], at[2], back[2], slopes[PHI_ROW] = { 0.0 };
            for (int i = 0; i < 2; ++i) {
                coef[i] = group->coef[k][row * PHI_ROW + i][lane];
                at[i] = x[k][i][lane];
                back[i] = bar->x[k][i][lane];
            }
            phi_follow_back(part, coef, at, back, slopes);
            for (int i = 0; i < 2; ++i) bar->x[k][i][lane] = back[i];
            for (int i = 0; i < PHI_ROW; ++i) bar->coef[k][row * PHI_ROW + i][lane] += slopes[i];
        }
}
#endif
