/** Shift the predictors of all stages with the state, to x. */
export function moveHistory(solver, x) {
  for (const history of solver.history) history.move(solver.x, x);
}
