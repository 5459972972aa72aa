import { MULTIPLES, prepare } from "./model.mjs";

/** Compute the coefficients of flow k, which depend on h squared too. */
export function prepareRow(params, time, h, row, k) {
  prepare(params, time * h, [MULTIPLES[k] * (h * h)], row);
}
