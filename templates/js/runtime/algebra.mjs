import { DIM } from "./model.mjs";

// ---- Compensated sums, linear equations ----

const sums = new Float64Array(DIM);
const rests = new Float64Array(DIM);

/**
 * Add `change` + `small` to the state by compensated summation. `small` contains the compensation term, and
 * other terms that are much smaller than `change`.
 *
 * @param {{x: Float64Array, carry: Float64Array}} state
 * @param {ArrayLike<number>} change
 * @param {ArrayLike<number>} small
 * @returns {boolean} false, with the state unchanged, if the sum is not finite
 */
export function advance({ x, carry }, change, small) {
  for (let i = 0; i < DIM; i++) {
    const sum = x[i] + change[i];
    const added = sum - x[i];
    const lost = (x[i] - (sum - added)) + (change[i] - added) + small[i];
    sums[i] = sum + lost;
    rests[i] = lost - (sums[i] - sum);
    if (!Number.isFinite(sums[i])) return false;
  }
  x.set(sums);
  carry.set(rests);
  return true;
}
