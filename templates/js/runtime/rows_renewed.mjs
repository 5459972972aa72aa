import { MOMENTS, PREPARED, refresh } from "./model.mjs";

/** For the next step, of size h, compute the coefficients that depend on the time. */
export function renewRows({ rows, t }, h) {
  rows.forEach((row, k) => refresh(row, t + MOMENTS[k] * h, row.subarray(PREPARED)));
}
