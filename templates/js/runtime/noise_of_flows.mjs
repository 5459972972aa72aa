import { DRAWS } from "./model.mjs";

/**
 * If h < 0, exchange the increments of the first and the second half of the step, so that the step inverts a
 * step of size -h.
 */
export function orderDraws(dw, h) {
  if (h < 0) dw.set([...dw.subarray(DRAWS / 2), ...dw.subarray(0, DRAWS / 2)]);
}
