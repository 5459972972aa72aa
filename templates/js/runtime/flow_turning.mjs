import { turnBy } from "./attitude.mjs";
import { shorten } from "./attitude_lengthened.mjs";
import { ELEMENT } from "./model.mjs";

/** The product of the group elements of the flows of a step so far, less the identity. */
let elementOfStep = new Float64Array(ELEMENT);
let elementAfter = new Float64Array(ELEMENT);

/** Begin a step with the identity. */
export function beginElement() {
  elementOfStep.fill(0);
}

/** Compute the increment of the state by a flow, and multiply by its group element. */
export function applyFlow(flow, row, at, change) {
  flow(row, at, elementOfStep, change, elementAfter);
  [elementOfStep, elementAfter] = [elementAfter, elementOfStep];
}

/** Turn the body by the group element of a step. */
export function turnByFlows(solver) {
  shorten(elementOfStep);
  turnBy(solver, elementOfStep);
}
