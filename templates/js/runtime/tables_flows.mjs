import { COEFFICIENTS, TIMES } from "./model.mjs";

/** Return a table of coefficients, all 0, for the only stage of a step: a row for each of TIMES. */
export function emptyTables() {
  return [TIMES.map(() => new Float64Array(COEFFICIENTS))];
}
