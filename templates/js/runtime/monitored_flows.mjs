import { FLOWS, NEGATIVE, TIMES } from "./model.mjs";
import { allFinite } from "./sites.mjs";
import { pass } from "./passing.mjs";
import { rateOf } from "./site_level.mjs";
import { prepareRow } from "./rows_plain.mjs";
import { carryVectors } from "./carried_flows.mjs";

// ---- The step of a splitting: flows of parts of K, one after the other ----

/** Make one step; returns a status. If it fails, the state is undefined. */
export function makeStep(solver) {
  const { x, rows, sites, params, h } = solver;
  const [t, tCarry] = [solver.t, solver.tCarry];
  let status = "OK";
  for (const [part, row] of sites.flows) {
    const rate = rateOf(part, solver);
    const time = (TIMES[row] * h) / rate;
    if (!(rate > 0)) {
      status = "NOT_FINITE";
      break;
    }
    carryVectors(solver, part, time, rate);
    prepareRow(params, 1, time, rows[row]);
    for (const sweep of FLOWS[part]) sweep(rows[row], x, sites);
    if (part !== NEGATIVE) pass(solver, time);
  }
  if (!allFinite(x) || !(solver.vectors ?? []).every(allFinite)) status = "NOT_FINITE";
  if (status !== "OK") [solver.t, solver.tCarry] = [t, tCarry];
  return status;
}
