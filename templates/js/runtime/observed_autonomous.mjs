import { observables } from "./model.mjs";

/** Compute the observables at x; they do not depend on the time t. */
export function observablesAt(params, t, x, out) {
  observables(params, x, out);
}
