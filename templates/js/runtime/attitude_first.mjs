/** The group element at the start of a trajectory. */
export function firstOf(solver) {
  return solver.firstElement;
}
