import { DRAWS } from "./model.mjs";

/** Steps of -h recompute those of h in the opposite order: the last increments of a step come first. */
export function orderDraws(dw, h) {
  if (h < 0) dw.set([...dw.subarray(DRAWS / 2), ...dw.subarray(0, DRAWS / 2)]);
}
