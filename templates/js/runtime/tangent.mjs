import { advance } from "./algebra.mjs";
import { DIM, FRACTIONS } from "./model.mjs";
import { differentiateStage } from "./tangent_newton.mjs";

// ---- The tangent map of a step ----

/** The identity matrix, row by row. */
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

/**
 * The derivative of the step that a solver has just made, row by row: the product of the derivatives of its
 * stages.
 *
 * @param {Solver} solver
 * @param {{x: Float64Array, carry: Float64Array}} at the state before the step; advanced to its end
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
