import { prepare } from "./model.mjs";

/** Compute a row of coefficients. */
export function prepareRow(params, time, h, row) {
  prepare(params, time * h, row);
}
