import { finite } from "./errors.mjs";
import { energy, vectorField } from "./model.mjs";

/** Compute the Hamiltonian at x and the time t. */
export function energyAt(params, t, x, out) {
  energy(params, t, x, out);
}

/** Compute the vector field dx/dt at x and the time t. */
export function vectorFieldAt(params, t, x, out) {
  vectorField(params, t, x, out);
}

/** Set the time of the initial state to the option t0, 0 by default. */
export function takeTime(solver, options) {
  [solver.t] = finite([options.t0 ?? 0], 1, "t0");
}
