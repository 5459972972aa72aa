import { nextFrame } from "./model.mjs";

/** Store the increment of a stage in the frame of the end of the step, where the next step starts. */
export function storeIncrement(coef, start, end, increment, to) {
  nextFrame(coef, start, end, increment, to);
}
