import { MULTIPLES, TIMES, prepareRow } from "./model.mjs";

/** The coefficients of all flows of a step, of which some depend on h squared too: a row for each time. */
export function prepare(params, h, rows) {
  TIMES.forEach((time, k) => prepareRow(params, time * h, [MULTIPLES[k] * (h * h)], rows[k]));
}
