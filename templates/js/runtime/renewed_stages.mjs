import { refreshAt } from "./renewed_time.mjs";
import { MIDDLES, PREPARED } from "./model.mjs";

/** Compute the coefficients of the next step that depend on the time or on the noise. */
export function renew({ coef, t, h, dw }) {
  coef.forEach((row, stage) => refreshAt(row, t + MIDDLES[stage] * h, dw, row.subarray(PREPARED)));
}
