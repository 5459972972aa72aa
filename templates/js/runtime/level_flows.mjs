import { TIMES, prepareRow } from "./model.mjs";

/** The coefficients of all flows of a step: a row for each time. */
export function prepare(params, gauge, h, rows) {
  TIMES.forEach((time, k) => prepareRow(params, gauge, time * h, rows[k]));
}
