/** The group element of the attitude at the start of a trajectory. */
export function firstOf(solver) {
  return solver.firstElement;
}
