/** Shift the predictors of all stages by the change of the state of a solver to x. */
export function shiftHistory(solver, x) {
  for (const history of solver.history) history.shift(solver.x, x);
}
