import { noiseFields, refresh } from "./model.mjs";

/** The vector fields of the sources of noise at x and the time t. */
export function noiseFieldsAt(params, t, x, out) {
  noiseFields(params, x, out);
}

/** The coefficients that depend on the increments dw of the noise, and on the time if H depends on it. */
export function refreshAt(row, t, dw, out) {
  refresh(row, dw, out);
}
