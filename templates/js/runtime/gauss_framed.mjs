import { nextFrame } from "./model.mjs";

/** Store the increment of a stage from start in the frame of the end of the step, where the next one starts. */
export function storeIncrement(coef, start, end, increment, to) {
  nextFrame(coef, start, end, increment, to);
}
