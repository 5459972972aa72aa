/** Store the increment of a stage. */
export function keepMove(coef, end, move, to) {
  to.set(move);
}
