import { observables } from "./model.mjs";

/** Compute the observables at x and the time t. */
export function observablesAt(params, t, x, out) {
  observables(params, t, x, out);
}
