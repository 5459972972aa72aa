import { turnBy } from "./attitude.mjs";
import { factorBy } from "./attitude_element.mjs";
import { ELEMENT } from "./model.mjs";

const factorOfStage = new Float64Array(ELEMENT);

/** Multiply the attitude by the group element of a stage; y is the solution of the stage. */
export function turnStage(solver, stage, y) {
  factorBy(solver.coef[stage], y, factorOfStage);
  turnBy(solver, factorOfStage);
}
