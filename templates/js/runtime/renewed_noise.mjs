import { refreshAt } from "./noise_autonomous.mjs";
import { DRAWS, MOMENTS, PREPARED, SOURCES } from "./model.mjs";

/**
 * Compute the coefficients of the flows of the next step that are functions of the noise. The first flows,
 * and the last in the opposite order, are those of the sources of noise.
 */
export function renew(solver) {
  solver.coef[0].forEach((row, k, rows) => {
    const late = k - (rows.length - DRAWS); // in the half after the flows of H
    const dw = [k < SOURCES.length ? solver.dw[k] : late >= SOURCES.length ? solver.dw[late] : 0];
    refreshAt(row, solver.t + MOMENTS[k] * solver.h, dw, row.subarray(PREPARED));
  });
}
