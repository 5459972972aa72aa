import { nextFrame } from "./model.mjs";

/** Store the increment of a stage in the frame of the end of the step, where the next one starts. */
export function storeIncrement(coef, end, increment, to) {
  nextFrame(coef, end, increment, to);
}
