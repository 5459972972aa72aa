/** The group element from which a trajectory started. */
export function firstOf(solver) {
  return solver.firstElement;
}
