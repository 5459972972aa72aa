import { refreshAt } from "./renewed_time.mjs";
import { MIDDLES, PREPARED } from "./model.mjs";

/** For each stage of the next step, compute the coefficients that differ from step to step. */
export function renew({ coef, t, h, dw }) {
  coef.forEach((row, stage) => refreshAt(row, t + MIDDLES[stage] * h, dw, row.subarray(PREPARED)));
}
