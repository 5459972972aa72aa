import { refreshAt } from "./noise_autonomous.mjs";
import { DRAWS, MOMENTS, PREPARED, SOURCES } from "./model.mjs";

/**
 * For the flows of the next step, compute the coefficients that depend on the noise. A step begins with the
 * flows of the noise and ends with them in reverse order.
 */
export function renew(solver) {
  solver.coef[0].forEach((row, k, rows) => {
    const late = k - (rows.length - DRAWS); // index in dw, if flow k of the noise follows those of H
    const dw = [k < SOURCES.length ? solver.dw[k] : late >= SOURCES.length ? solver.dw[late] : 0];
    refreshAt(row, solver.t + MOMENTS[k] * solver.h, dw, row.subarray(PREPARED));
  });
}
