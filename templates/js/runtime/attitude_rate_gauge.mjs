import { rate } from "./model.mjs";

/** Compute the rate of the gauge rotation at x. */
export function rateOf({ params, gauge, x }, turningRate) {
  rate(params, gauge, x, turningRate);
}
