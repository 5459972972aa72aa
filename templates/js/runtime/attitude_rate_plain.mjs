import { rate } from "./model.mjs";

/** The rate of the gauge rotation. */
export function rateOf({ params, x }, turningRate) {
  rate(params, x, turningRate);
}
