import { rate } from "./model.mjs";

/** Compute the rate of the gauge rotation at x. */
export function rateOf({ params, x }, turningRate) {
  rate(params, x, turningRate);
}
