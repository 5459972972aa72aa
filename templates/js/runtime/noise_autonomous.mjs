import { noiseFields, refresh } from "./model.mjs";

/** The vector fields of the sources of noise at x and the time t. */
export function noiseFieldsAt(params, t, x, out) {
  noiseFields(params, x, out);
}

/** The coefficients that are functions of the increments dw of the noise, and of the time if H is one. */
export function refreshAt(row, t, dw, out) {
  refresh(row, dw, out);
}
