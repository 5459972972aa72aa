import { prepare } from "./model.mjs";

/** Compute the row of coefficients of a flow over time * h. */
export function prepareRow(params, time, h, row) {
  prepare(params, time * h, row);
}
