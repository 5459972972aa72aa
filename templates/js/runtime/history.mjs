/** Clear the predictor of a stage. */
export function clearHistory(solver, stage) {
  solver.history[stage].clear();
}
