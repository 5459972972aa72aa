import { COEFFICIENTS, TIMES } from "./model.mjs";

/** Return a table of coefficients for the only stage: a row for each time of flows. */
export function emptyTables() {
  return [TIMES.map(() => new Float64Array(COEFFICIENTS))];
}
