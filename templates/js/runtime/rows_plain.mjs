import { prepare } from "./model.mjs";

/** Compute the coefficients of a flow or stage. */
export function prepareRow(params, time, h, row) {
  prepare(params, time * h, row);
}
