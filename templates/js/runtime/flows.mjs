import { FLOWS } from "./model.mjs";
import { SOURCES } from "./model.mjs";
import { drawAtSites } from "./site_noise.mjs";
import { TANGENTS } from "./model.mjs";
import { TIMES } from "./model.mjs";
import { allFinite } from "./sites.mjs";
import { moveCentre, toCartesian, toRelative } from "./bodies.mjs";

// ---- The step of a splitting: flows of parts of H, one after the other ----

/** Make one step, and return its status. If the step fails, the state is undefined. */
export function makeStep(solver) {
  const { x, rows, sites } = solver;
  toRelative(solver);
  // #if NOISE
  // the flows of the noise begin the step, and end it in reverse order
  const back = sites.flows.length - SOURCES.length;
  let number = 0;
  // #endif
  // #if BY_COLOUR
  for (const [part, row, colour] of sites.flows) {
    // #if TANGENT
    FLOWS[part].forEach((sweep, k) => {
      for (const v of solver.vectors) TANGENTS[part][k](rows[row], x, v, sites, colour);
      sweep(rows[row], x, sites, colour);
    });
    // #else
    for (const sweep of FLOWS[part]) sweep(rows[row], x, sites, colour);
    // #endif
  }
  // #else
  for (const [part, row] of sites.flows) {
    // #if NOISE
    if (number === 0 || number === back) drawAtSites(solver, number === 0 ? 0 : 1);
    number++;
    // #endif
    // #if TANGENT
    FLOWS[part].forEach((sweep, k) => {
      for (const v of solver.vectors) TANGENTS[part][k](rows[row], x, v, sites);
      sweep(rows[row], x, sites);
    });
    // #else
    for (const sweep of FLOWS[part]) sweep(rows[row], x, sites);
    // #endif
    moveCentre(solver, part, TIMES[row] * solver.h);
  }
  // #endif
  toCartesian(solver);
  // #if TANGENT
  if (!solver.vectors.every(allFinite)) return "NOT_FINITE";
  // #endif
  return allFinite(x) ? "OK" : "NOT_FINITE";
}
