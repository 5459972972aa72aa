import { DIM } from "./model.mjs";

/** The smallest normal number. It is added to divisors that may be 0. */
export const TINY = 2.2250738585072014e-308;

/**
 * Solve `matrix` · x = `side` by elimination with partial pivoting. The arguments are overwritten.
 *
 * @param {Float64Array} matrix row by row
 * @param {Float64Array} side is overwritten with the solution
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
