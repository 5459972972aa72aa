import { beginAttitude, currentElement, elementOf } from "./attitude.mjs";
import { multiplyAfter } from "./attitude_body.mjs";
import { uniformMotion } from "./attitude_rate.mjs";
import { rateOf } from "./attitude_rate_plain.mjs";
import { ATTITUDE, ELEMENT, TURNING } from "./model.mjs";

/**
 * Compute the rate of the gauge rotation, after x or the attitude has been set. This rotation is uniform: it
 * is due to the multiples of Casimirs that are subtracted from H.
 */
export function takeTurningRate(solver) {
  solver.turningRate = new Float64Array(TURNING);
  rateOf(solver, solver.turningRate);
  solver.attitudeFrom = solver.t;
}

/** The initial group element of the attitude times the gauge rotation since then. */
export function firstOf({ firstElement, turningRate, t, attitudeFrom }) {
  const both = new Float64Array(ELEMENT);
  multiplyAfter(firstElement, uniformMotion(turningRate, t - attitudeFrom), both);
  return both;
}

/** Restart the attitude at its present value, after x has been set. */
export function restartAttitude(solver) {
  const element = currentElement(solver);
  beginAttitude(solver, elementOf(solver.steps, element.subarray(0, ATTITUDE), element.subarray(ATTITUDE)));
}
