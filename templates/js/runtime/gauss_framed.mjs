import { nextFrame } from "./model.mjs";

/** Store the increment of a stage in the frame of the end of the step, where the next one starts. */
export function keepMove(coef, end, move, to) {
  nextFrame(coef, end, move, to);
}
