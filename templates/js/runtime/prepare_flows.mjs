import { TIMES, prepareRow } from "./model.mjs";

/** Compute the coefficients of all flows of a step: a row for each time. */
export function prepare(params, h, rows) {
  TIMES.forEach((time, k) => prepareRow(params, time * h, rows[k]));
}
