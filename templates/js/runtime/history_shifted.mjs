/** Shift the predictors of all stages with the state, to x. */
export function shiftHistory(solver, x) {
  for (const history of solver.history) history.shift(solver.x, x);
}
