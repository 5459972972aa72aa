import { COEFFICIENTS, FRACTIONS } from "./model.mjs";

/** Return a table of coefficients for each stage. */
export function emptyTables() {
  return FRACTIONS.map(() => new Float64Array(COEFFICIENTS));
}
