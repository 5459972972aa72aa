import { energy, vectorField } from "./model.mjs";

/** The Hamiltonian at x and the time t. */
export function energyAt(params, t, x, out) {
  energy(params, x, out);
}

/** The vector field dx/dt at x and the time t. */
export function vectorFieldAt(params, t, x, out) {
  vectorField(params, x, out);
}
