/** Set y to x, without a prediction: solutions of steps with noise cannot be predicted. */
export function startFrom(history, x, y) {
  y.set(x);
}
