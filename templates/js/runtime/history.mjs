/** Clear the predictor of a stage, if it has one. */
export function clearHistory(solver, stage) {
  solver.history[stage].clear();
}
