import { refreshAt } from "./renewed_time.mjs";
import { MIDDLES, PREPARED } from "./model.mjs";

/** Compute the coefficients of the next step that are functions of the time or of the noise. */
export function renew({ coef, t, h, dw }) {
  coef.forEach((row, stage) => refreshAt(row, t + MIDDLES[stage] * h, dw, row.subarray(PREPARED)));
}
