import { TIMES, prepareRow } from "./model.mjs";

/** Compute the coefficients of all flows of a step, a row for each time; they depend on the energy level. */
export function prepare(params, gauge, h, rows) {
  TIMES.forEach((time, k) => prepareRow(params, gauge, time * h, rows[k]));
}
