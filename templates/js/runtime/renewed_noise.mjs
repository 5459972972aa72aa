import { refreshAt } from "./noise_autonomous.mjs";
import { DRAWS, MOMENTS, PREPARED, SOURCES } from "./model.mjs";

/**
 * Compute the coefficients of the flows of the next step that depend on the noise. The flows of the noise
 * come first and, in reverse order, last.
 */
export function renew(solver) {
  solver.coef[0].forEach((row, k, rows) => {
    const late = k - (rows.length - DRAWS); // in the half of the noise after the flows of H
    const dw = [k < SOURCES.length ? solver.dw[k] : late >= SOURCES.length ? solver.dw[late] : 0];
    refreshAt(row, solver.t + MOMENTS[k] * solver.h, dw, row.subarray(PREPARED));
  });
}
