import { turnBy } from "./attitude.mjs";
import { shorten } from "./attitude_lengthened.mjs";
import { ELEMENT } from "./model.mjs";

/** The product of the attitude increments of all flows in the present step, minus the identity. */
let elementOfStep = new Float64Array(ELEMENT);
let elementAfter = new Float64Array(ELEMENT);

/** Set the product of the attitude increments of a step to the identity. */
export function beginElement() {
  elementOfStep.fill(0);
}

/** Compute the increment of the state by a flow, and multiply elementOfStep by its attitude increment. */
export function applyFlow(flow, row, at, change) {
  flow(row, at, elementOfStep, change, elementAfter);
  [elementOfStep, elementAfter] = [elementAfter, elementOfStep];
}

/** Multiply the attitude of a solver by the product of the attitude increments of a step. */
export function turnByFlows(solver) {
  shorten(elementOfStep);
  turnBy(solver, elementOfStep);
}
