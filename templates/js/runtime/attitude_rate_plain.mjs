import { rate } from "./model.mjs";

/** Compute the rate of the rotation by the gauge, at x. */
export function rateOf({ params, x }, turningRate) {
  rate(params, x, turningRate);
}
