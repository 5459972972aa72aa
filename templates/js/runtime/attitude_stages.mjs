import { turnBy } from "./attitude.mjs";
import { factorBy } from "./attitude_element.mjs";
import { ELEMENT } from "./model.mjs";

const factorOfStage = new Float64Array(ELEMENT);

/** Multiply the attitude of a solver by the attitude increment of a stage with solution y. */
export function turnStage(solver, stage, y) {
  factorBy(solver.coef[stage], y, factorOfStage);
  turnBy(solver, factorOfStage);
}
