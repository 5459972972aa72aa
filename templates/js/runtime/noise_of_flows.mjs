import { DRAWS } from "./model.mjs";

/**
 * Exchange the increments of the first and the second half of a step of size h < 0: it reverses one of -h.
 */
export function orderDraws(dw, h) {
  if (h < 0) dw.set([...dw.subarray(DRAWS / 2), ...dw.subarray(0, DRAWS / 2)]);
}
