import { FLOWS } from "./model.mjs";
import { allFinite } from "./sites.mjs";

// ---- The step of a splitting: flows of parts of H, one after the other ----

/** One step: a status. If it fails, the state is of no use. */
export function makeStep(solver) {
  const { x, rows, sites } = solver;
  // #if BY_COLOUR
  for (const [part, row, colour] of sites.flows) {
    for (const sweep of FLOWS[part]) sweep(rows[row], x, sites, colour);
  }
  // #else
  for (const [part, row] of sites.flows) {
    for (const sweep of FLOWS[part]) sweep(rows[row], x, sites);
  }
  // #endif
  return allFinite(x) ? "OK" : "NOT_FINITE";
}
