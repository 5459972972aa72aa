import { DIM } from "./model.mjs";

// ---- Compensated sums, linear equations ----

const sums = new Float64Array(DIM);
const rests = new Float64Array(DIM);

/**
 * The state moved by change + small in compensated arithmetic, where small is the carry and what is as
 * small: were that rounded with the change, corrections of one sign would add up to a drift.
 *
 * @param {{x: Float64Array, carry: Float64Array}} state
 * @param {ArrayLike<number>} change
 * @param {ArrayLike<number>} small
 * @returns {boolean} false, and the state as before, if the sum is not finite
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
