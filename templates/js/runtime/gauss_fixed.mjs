/** Store the increment of a stage. */
export function storeIncrement(coef, end, increment, to) {
  to.set(increment);
}
