import { rate } from "./model.mjs";

/** The rate of the gauge rotation. */
export function rateOf({ params, gauge, x }, turningRate) {
  rate(params, gauge, x, turningRate);
}
