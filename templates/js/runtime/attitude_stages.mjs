import { turnBy } from "./attitude.mjs";
import { factorBy } from "./attitude_element.mjs";
import { ELEMENT } from "./model.mjs";

const factorOfStage = new Float64Array(ELEMENT);

/** Turn the body by the group element of a stage whose equation is solved by y. */
export function turnStage(solver, stage, y) {
  factorBy(solver.coef[stage], y, factorOfStage);
  turnBy(solver, factorOfStage);
}
