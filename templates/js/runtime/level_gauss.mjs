import { WEIGHTS, elapsed } from "./model.mjs";

const timeOfNode = new Float64Array(1);

/**
 * Physical time that passes in a step with the unknowns z at its stages; NaN unless it has the sign of h.
 */
export function timeOfStep(solver, stage, start, z) {
  let sum = 0;
  WEIGHTS.forEach((b, i) => {
    elapsed(solver.coef[stage], start, z[i], Float64Array.of(solver.h * b), timeOfNode);
    sum += timeOfNode[0];
  });
  return sum * solver.h > 0 ? sum : NaN;
}
