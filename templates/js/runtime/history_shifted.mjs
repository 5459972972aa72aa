/** Adapt the predictors of all stages when the state of a solver is changed to x. */
export function shiftHistory(solver, x) {
  for (const history of solver.history) history.shift(solver.x, x);
}
