/** The time of a solver gains that of a stage. */
export function pass(solver, time) {
  const sum = solver.t + time;
  const added = sum - solver.t;
  const small = solver.tCarry + ((solver.t - (sum - added)) + (time - added));
  solver.t = sum + small;
  solver.tCarry = small - (solver.t - sum);
}
