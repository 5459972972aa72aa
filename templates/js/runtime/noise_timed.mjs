import { noiseFields, refresh } from "./model.mjs";

/** Compute the vector fields of the sources of noise at x and the time t. */
export function noiseFieldsAt(params, t, x, out) {
  noiseFields(params, t, x, out);
}

/** Compute the coefficients that depend on the increments dw of the noise and on the time t. */
export function refreshAt(row, t, dw, out) {
  refresh(row, t, dw, out);
}
