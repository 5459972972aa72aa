/** Store the increment of a stage. */
export function storeIncrement(coef, start, end, increment, to) {
  to.set(increment);
}
