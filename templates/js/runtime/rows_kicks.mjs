import { MULTIPLES, prepare } from "./model.mjs";

/** Compute the coefficients, in row k, of a flow over time * h; they also depend on MULTIPLES[k] h^2. */
export function prepareRow(params, time, h, row, k) {
  prepare(params, time * h, [MULTIPLES[k] * (h * h)], row);
}
