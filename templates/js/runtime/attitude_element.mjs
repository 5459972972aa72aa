import { turn } from "./model.mjs";

/** Compute the attitude increment of a stage with solution y, minus the identity. */
export function factorBy(coef, y, factor) {
  turn(coef, y, factor);
}
