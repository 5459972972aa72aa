/** Add the time of a stage or flow to the physical time of a solver, in compensated arithmetic. */
export function pass(solver, time) {
  const sum = solver.t + time;
  const added = sum - solver.t;
  const small = solver.tCarry + ((solver.t - (sum - added)) + (time - added));
  solver.t = sum + small;
  solver.tCarry = small - (solver.t - sum);
}
