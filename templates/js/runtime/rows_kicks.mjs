import { MULTIPLES, prepare } from "./model.mjs";

/** Compute the coefficients of a flow; they depend on h squared too, by factors for its row k. */
export function prepareRow(params, time, h, row, k) {
  prepare(params, time * h, [MULTIPLES[k] * (h * h)], row);
}
