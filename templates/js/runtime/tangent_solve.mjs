import { solve } from "./linear.mjs";
import { TANGENT_NEARLY_SOLVED, TANGENT_SHRINKING, TANGENT_SOLVED } from "./tangent_policy.mjs";
import { DIM } from "./model.mjs";

/** Whether Newton's method has reached rounding level, judged by the sizes of its last two corrections. */
export function tangentSolved(size, previous) {
  return size <= TANGENT_SOLVED || (size < TANGENT_NEARLY_SOLVED && size > TANGENT_SHRINKING * previous);
}

/**
 * The solution X of `matrix` · X = `sides`, for all columns of X; all matrices are stored row by row.
 *
 * @returns {Float64Array | null} null if the matrix is singular
 */
export function solvedForAll(matrix, sides) {
  const solution = new Float64Array(DIM * DIM);
  for (let j = 0; j < DIM; j++) {
    const side = Float64Array.from({ length: DIM }, (_, i) => sides[i * DIM + j]);
    if (!solve(Float64Array.from(matrix), side)) return null;
    for (let i = 0; i < DIM; i++) solution[i * DIM + j] = side[i];
  }
  return solution;
}
