import { observables } from "./model.mjs";

/** The observables at x and the time t. */
export function observablesAt(params, t, x, out) {
  observables(params, x, out);
}
