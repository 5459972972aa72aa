import { prepare } from "./model.mjs";

/**
 * Compute the coefficients of a flow over time * h; `late` is the derivative of this time along a tangent
 * vector.
 */
export function prepareRow(params, time, h, row, k, late = 0) {
  prepare(params, time * h, [late], row);
}
