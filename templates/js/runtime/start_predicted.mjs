/** Set y to the value that the predictor gives for the next solution, or to x if it gives none. */
export function startFrom(history, x, y) {
  if (!history.predict(y)) y.set(x);
}
