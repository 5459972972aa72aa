import { advance } from "./algebra.mjs";
// #if IMPLICIT
import { solve } from "./algebra.mjs";
import { TANGENT_NEARLY_SOLVED, TANGENT_SHRINKING, TANGENT_SOLVED } from "./tangent_policy.mjs";
// #endif
import { DIM, FRACTIONS } from "./model.mjs";
import { differentiateStage } from "./tangent_newton.mjs";

// ---- The tangent map of a step ----

/** The matrix 1. */
export function identity() {
  return Float64Array.from({ length: DIM * DIM }, (_, k) => (k % (DIM + 1) === 0 ? 1 : 0));
}

/** The product of two matrices. */
export function multiplied(a, b) {
  const product = new Float64Array(DIM * DIM);
  for (let i = 0; i < DIM; i++) {
    for (let j = 0; j < DIM; j++) {
      for (let k = 0; k < DIM; k++) product[i * DIM + j] += a[i * DIM + k] * b[k * DIM + j];
    }
  }
  return product;
}

// #if IMPLICIT
/** Whether a solve has reached the level of rounding, by its last two corrections. */
export function tangentSolved(size, previous) {
  return size <= TANGENT_SOLVED || (size < TANGENT_NEARLY_SOLVED && size > TANGENT_SHRINKING * previous);
}

/**
 * The solution of matrix · solution = sides for all columns of sides.
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

// #endif
/**
 * The derivative of the step that a solver has just made, the product of those of its stages.
 *
 * @param {Solver} solver
 * @param {{x: Float64Array, carry: Float64Array}} at the state before the step; is moved through it
 * @returns {{status: string, tangent: Float64Array}}
 */
export function tangentOf(solver, at) {
  let tangent = identity();
  for (let stage = 0; stage < FRACTIONS.length; stage++) {
    const { status, change, derivative } = differentiateStage(solver, stage, at);
    if (status !== "OK") return { status, tangent };
    if (!advance(at, change, at.carry)) return { status: "NOT_FINITE", tangent };
    tangent = multiplied(derivative, tangent);
  }
  return { status: tangent.every(Number.isFinite) ? "OK" : "NOT_FINITE", tangent };
}
