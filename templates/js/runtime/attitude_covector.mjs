import { fromCovector } from "./attitude_exponential.mjs";
import { COVECTOR, turn } from "./model.mjs";

const covectorOfStage = new Float64Array(COVECTOR);

/** Compute the group element of a stage with solution y, minus the identity: the exponential of a matrix. */
export function factorBy(coef, y, factor) {
  turn(coef, y, covectorOfStage);
  fromCovector(covectorOfStage, factor);
}
