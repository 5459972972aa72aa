import { prepare } from "./model.mjs";

/** Compute the coefficients of a flow; late is the derivative of its time along a tangent vector. */
export function prepareRow(params, time, h, row, k, late = 0) {
  prepare(params, time * h, [late], row);
}
