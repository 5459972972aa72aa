import { fromCovector } from "./attitude_exponential.mjs";
import { COVECTOR, turn } from "./model.mjs";

const covectorOfStage = new Float64Array(COVECTOR);

/** Compute the attitude increment of a stage with solution y, minus the identity: exp(matrix) - 1. */
export function factorBy(coef, y, factor) {
  turn(coef, y, covectorOfStage);
  fromCovector(covectorOfStage, factor);
}
