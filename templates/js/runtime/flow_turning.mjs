import { turnBy } from "./attitude.mjs";
import { shorten } from "./attitude_lengthened.mjs";
import { ELEMENT } from "./model.mjs";

/** The product of the rotations of all flows in the present step, minus the identity. */
let elementOfStep = new Float64Array(ELEMENT);
let elementAfter = new Float64Array(ELEMENT);

/** Start the product of rotations of a step with the identity. */
export function beginElement() {
  elementOfStep.fill(0);
}

/** Compute the increment of the state by a flow, and multiply elementOfStep by the rotation of the flow. */
export function applyFlow(flow, row, at, change) {
  flow(row, at, elementOfStep, change, elementAfter);
  [elementOfStep, elementAfter] = [elementAfter, elementOfStep];
}

/** Multiply the attitude by the product of the rotations of a step. */
export function turnByFlows(solver) {
  shorten(elementOfStep);
  turnBy(solver, elementOfStep);
}
