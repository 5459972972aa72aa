import { MOMENTS, PREPARED, refresh } from "./model.mjs";

/** Compute the coefficients of the next step, of size h, that depend on the time. */
export function renewRows({ rows, t }, h) {
  rows.forEach((row, k) => refresh(row, t + MOMENTS[k] * h, row.subarray(PREPARED)));
}
