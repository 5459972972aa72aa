import { turn } from "./model.mjs";

/** The group element of a stage, minus the identity. */
export function factorBy(coef, y, factor) {
  turn(coef, y, factor);
}
