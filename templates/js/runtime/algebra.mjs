import { DIM } from "./model.mjs";

// ---- Compensated sums, linear equations ----

// #if IMPLICIT
/** The smallest normal number: keeps quotients of sizes finite. */
export const TINY = 2.2250738585072014e-308;

// #endif
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

// #if IMPLICIT
/**
 * Solve matrix · solution = side, both overwritten, by elimination with partial pivoting.
 *
 * @param {Float64Array} matrix row by row
 * @param {Float64Array} side becomes the solution
 * @returns {boolean} false if the matrix is singular
 */
export function solve(matrix, side) {
  for (let k = 0; k < DIM; k++) {
    let best = k;
    for (let i = k + 1; i < DIM; i++) {
      if (Math.abs(matrix[i * DIM + k]) > Math.abs(matrix[best * DIM + k])) best = i;
    }
    const pivot = matrix[best * DIM + k];
    if (!(Math.abs(pivot) > 0)) return false;
    if (best !== k) {
      for (let j = k; j < DIM; j++) {
        [matrix[k * DIM + j], matrix[best * DIM + j]] = [matrix[best * DIM + j], matrix[k * DIM + j]];
      }
      [side[k], side[best]] = [side[best], side[k]];
    }
    for (let i = k + 1; i < DIM; i++) {
      const factor = matrix[i * DIM + k] / pivot;
      for (let j = k + 1; j < DIM; j++) matrix[i * DIM + j] -= factor * matrix[k * DIM + j];
      side[i] -= factor * side[k];
    }
  }
  for (let i = DIM - 1; i >= 0; i--) {
    for (let j = i + 1; j < DIM; j++) side[i] -= matrix[i * DIM + j] * side[j];
    side[i] /= matrix[i * DIM + i];
  }
  return true;
}
// #endif
