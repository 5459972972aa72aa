import { MULTIPLES, TIMES, prepareRow } from "./model.mjs";

/** Compute the coefficients of all flows of a step, a row for each time. Some depend on h squared too. */
export function prepare(params, h, rows) {
  TIMES.forEach((time, k) => prepareRow(params, time * h, [MULTIPLES[k] * (h * h)], rows[k]));
}
