import { FRACTIONS, elapsed } from "./model.mjs";

const timeOfStage = new Float64Array(1);

/** Physical time that passes in a stage with solution y; NaN unless it has the sign of the step. */
export function timeOf(solver, stage, y) {
  elapsed(solver.coef[stage], y, timeOfStage);
  return timeOfStage[0] * (FRACTIONS[stage] * solver.h) > 0 ? timeOfStage[0] : NaN;
}
