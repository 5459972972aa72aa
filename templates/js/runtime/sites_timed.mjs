import { finite } from "./errors.mjs";

/** Set the time of the initial state from the options of a solver, 0 by default. */
export function takeTime(solver, options) {
  [solver.t] = finite([options.t0 ?? 0], 1, "t0");
}
