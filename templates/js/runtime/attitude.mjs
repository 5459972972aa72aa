import { normalise, turnAdds } from "./attitude_quaternions.mjs";
import { elementProduct } from "./attitude_quaternions.mjs"; // or all of them from attitude_matrices.mjs
// #if RATE_OF_GAUGE
import { uniformMotion } from "./attitude_quaternions.mjs";
import { TURNING, rate } from "./model.mjs";
// #endif
import { ATTITUDE, ELEMENT } from "./model.mjs";
// #if MATRICES
import { ROWS } from "./model.mjs";
// #endif
// #if TURNED_BY_COVECTOR
import { COVECTOR } from "./model.mjs";
import { fromCovector } from "./attitude_matrices.mjs";
// #endif
// #if TURNED_IN_STAGES
import { turn } from "./model.mjs";
// #endif
import { StepError } from "./errors.mjs";

// ---- Attitude ----

const adds = new Float64Array(ELEMENT);

/** Multiply the element of a trajectory by a factor, given less 1, in compensated arithmetic. */
export function turnBy({ turned, turnedCarry }, factor) {
  turnAdds(turned, factor, adds);
  for (let i = 0; i < ELEMENT; i++) {
    const more = adds[i] + turnedCarry[i];
    const sum = turned[i] + more;
    const added = sum - turned[i];
    turnedCarry[i] = (turned[i] - (sum - added)) + (more - added);
    turned[i] = sum;
  }
  // #if NORMALISE
  normalise(turned, turnedCarry);
  // #endif
}

// #if TURNED_IN_STAGES
const factorOfStage = new Float64Array(ELEMENT);

// #if TURNED_BY_COVECTOR
const covectorOfStage = new Float64Array(COVECTOR);

// #endif
/** The element of a stage that was solved by y. */
export function turnStage(solver, stage, y) {
  // #if TURNED_BY_COVECTOR
  turn(solver.coef[stage], y, covectorOfStage);
  fromCovector(covectorOfStage, factorOfStage);
  // #else
  turn(solver.coef[stage], y, factorOfStage);
  // #endif
  turnBy(solver, factorOfStage);
}

// #endif
/** The element that turns nothing. */
export function noTurn() {
  const one = new Float64Array(ELEMENT);
  // #if MATRICES
  for (let i = 0; i < ELEMENT; i += ROWS + 1) one[i] = 1;
  // #else
  one[0] = 1;
  // #endif
  return one;
}

/** Begin at an element, where the solver is now. */
export function beginAttitude(solver, first) {
  solver.firstElement = Float64Array.from(first);
  solver.turned = noTurn();
  solver.turnedCarry = new Float64Array(ELEMENT);
  // #if RATE_OF_GAUGE
  solver.turningRate = new Float64Array(TURNING);
  // #if GAUGE
  rate(solver.params, solver.gauge, solver.x, solver.turningRate);
  // #else
  rate(solver.params, solver.x, solver.turningRate);
  // #endif
  solver.attitudeFrom = solver.t;
  // #endif
}

/**
 * The attitude proper: the first, then what the Casimirs that were taken from H have turned it by, then the
 * product of the elements of all steps.
 */
export function currentElement(solver) {
  const found = new Float64Array(ELEMENT);
  let first = solver.firstElement;
  // #if RATE_OF_GAUGE
  const moving = uniformMotion(solver.turningRate, solver.t - solver.attitudeFrom);
  const both = new Float64Array(ELEMENT);
  // #if SPATIAL
  elementProduct(moving, first, both);
  // #else
  elementProduct(first, moving, both);
  // #endif
  first = both;
  // #endif
  // #if SPATIAL
  elementProduct(solver.turned, first, found);
  // #else
  elementProduct(first, solver.turned, found);
  // #endif
  return found;
}

/** The element of an attitude, and of a position, of users. */
export function elementOf(steps, attitude, position) {
  const given = [...(attitude ?? noTurn().subarray(0, ATTITUDE))];
  // #if POSITION
  given.push(...(position ?? [0, 0, 0]));
  // #endif
  if (given.length !== ELEMENT || !given.every(Number.isFinite)) {
    throw new StepError("BAD_ARGUMENT", steps, `${ELEMENT} finite numbers make an attitude`);
  }
  const element = Float64Array.from(given);
  const largest = Math.max(...given.slice(0, ATTITUDE).map(Math.abs));
  if (!(largest > 0)) throw new StepError("BAD_ARGUMENT", steps, "the attitude is 0");
  // #if !MATRICES
  for (let i = 0; i < 4; i++) element[i] /= largest;
  const length = Math.hypot(...element.subarray(0, 4));
  for (let i = 0; i < 4; i++) element[i] /= length;
  // #endif
  return element;
}
