import { nextFrame } from "./model.mjs";

/** Store the increment of a stage of the step from start in the frame of its end, where the next one starts. */
export function storeIncrement(coef, start, end, increment, to) {
  nextFrame(coef, start, end, increment, to);
}
