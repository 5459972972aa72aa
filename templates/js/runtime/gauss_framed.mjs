import { nextFrame } from "./model.mjs";

/** Store the increment of a stage, transformed to the unknowns of the next step. */
export function storeIncrement(coef, start, end, increment, to) {
  nextFrame(coef, start, end, increment, to);
}
