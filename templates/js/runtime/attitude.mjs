import { StepError } from "./errors.mjs";
import { identityElement, makeUnit, normalise } from "./attitude_quaternions.mjs"; // or matrices
import { turnAdds } from "./attitude_adds_body.mjs";
import { multiplyAfter } from "./attitude_body.mjs";
import { firstOf } from "./attitude_first.mjs";
import { takeTurningRate } from "./attitude_gauge.mjs";
import { addPosition } from "./attitude_position.mjs";
import { ATTITUDE, ELEMENT } from "./model.mjs";

// ---- Attitude ----

const adds = new Float64Array(ELEMENT);

/** Multiply the attitude of a solver by the attitude increment 1 + factor, in compensated arithmetic. */
export function turnBy({ turned, turnedCarry }, factor) {
  turnAdds(turned, factor, adds);
  for (let i = 0; i < ELEMENT; i++) {
    const more = adds[i] + turnedCarry[i];
    const sum = turned[i] + more;
    const added = sum - turned[i];
    turnedCarry[i] = (turned[i] - (sum - added)) + (more - added);
    turned[i] = sum;
  }
  normalise(turned, turnedCarry);
}

/** Make the group element `first` the attitude at the present state of the solver. */
export function beginAttitude(solver, first) {
  solver.firstElement = Float64Array.from(first);
  solver.turned = identityElement();
  solver.turnedCarry = new Float64Array(ELEMENT);
  takeTurningRate(solver);
}

/** The group element of the attitude: the initial element times the increments of all steps. */
export function currentElement(solver) {
  const element = new Float64Array(ELEMENT);
  multiplyAfter(firstOf(solver), solver.turned, element);
  return element;
}

/** The group element that combines an attitude and, if the body has one, its position. Throws StepError. */
export function elementOf(steps, attitude, position) {
  const elements = [...(attitude ?? identityElement().subarray(0, ATTITUDE))];
  addPosition(elements, position);
  if (elements.length !== ELEMENT || !elements.every(Number.isFinite)) {
    throw new StepError("BAD_ARGUMENT", steps, `${ELEMENT} finite numbers make an attitude`);
  }
  const element = Float64Array.from(elements);
  const largest = Math.max(...elements.slice(0, ATTITUDE).map(Math.abs));
  if (!(largest > 0)) throw new StepError("BAD_ARGUMENT", steps, "the attitude is 0");
  makeUnit(element, largest);
  return element;
}
