import { applyFlow } from "./flow_alone.mjs";
import { beginElement, turnByFlows } from "./flow_turning.mjs";
import { pass } from "./passing.mjs";
import { DIM, FLOWS, SCHEDULE } from "./model.mjs";

// ---- The step of a splitting: flows of parts of H, one after the other ----

const at = new Float64Array(DIM);
const displacement = new Float64Array(DIM);
/**
 * Results of a flow: increments of the coordinates and of the time, and a sum that is NaN if a logarithm
 * fails.
 */
const change = new Float64Array(DIM + 2);

/** Make flows, by default those of one step; returns a status. If it fails, the state is unchanged. */
export function makeStage(solver, _, flows = SCHEDULE) {
  const { x, carry } = solver;
  const [rows] = solver.coef;
  at.set(x);
  displacement.set(carry);
  // #if MONITOR
  let time = 0;
  // #endif
  beginElement();
  for (const [part, row] of flows) {
    applyFlow(FLOWS[part], rows[row], at, change);
    // #if MONITOR
    time += change[DIM] + 0 * change[DIM + 1];
    // #endif
    for (let i = 0; i < DIM; i++) {
      displacement[i] += change[i];
      at[i] = x[i] + displacement[i];
    }
  }
  solver.evaluations++;
  if (!at.every(Number.isFinite)) return "NOT_FINITE";
  // #if MONITOR
  if (!(time * solver.h > 0)) return "NOT_FINITE";
  pass(solver, time);
  // #endif
  for (let i = 0; i < DIM; i++) {
    const sum = x[i] + displacement[i];
    const added = sum - x[i];
    carry[i] = (x[i] - (sum - added)) + (displacement[i] - added);
    x[i] = sum;
  }
  turnByFlows(solver);
  return "OK";
}
