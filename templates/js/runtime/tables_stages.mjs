import { COEFFICIENTS, FRACTIONS } from "./model.mjs";

/** Return an array of coefficients, all 0, for each stage of a step. */
export function emptyTables() {
  return FRACTIONS.map(() => new Float64Array(COEFFICIENTS));
}
