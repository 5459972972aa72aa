import { refreshAt } from "./renewed_time.mjs";
import { MOMENTS, PREPARED } from "./model.mjs";

/** For the flows of the next step, compute the coefficients that depend on the time. */
export function renew({ coef: [rows], t, h, dw }) {
  rows.forEach((row, k) => refreshAt(row, t + MOMENTS[k] * h, dw, row.subarray(PREPARED)));
}
