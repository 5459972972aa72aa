import { energy, vectorField } from "./model.mjs";

/** Compute the Hamiltonian at x; it does not depend on the time t. */
export function energyAt(params, t, x, out) {
  energy(params, x, out);
}

/** Compute the vector field dx/dt at x; it does not depend on the time t. */
export function vectorFieldAt(params, t, x, out) {
  vectorField(params, x, out);
}
