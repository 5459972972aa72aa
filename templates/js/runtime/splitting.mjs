// #if MONITOR
import { pass } from "./level.mjs";
// #endif
// #if ATTITUDE
import { ELEMENT } from "./model.mjs";
import { turnBy } from "./attitude.mjs";
// #if LENGTHENED
import { shorten } from "./attitude_quaternions.mjs";
// #endif
// #endif
import { DIM, FLOWS, MULTIPLES, SCHEDULE, TIMES, prepareRow } from "./model.mjs";

// ---- The step of a splitting: flows of parts of H, one after the other ----

// #if MONITOR
// prepare is that of level.mjs: its flows depend on the gauge.
// #else
/** The coefficients of all flows of a step: a row for each time. */
export function prepare(params, h, rows) {
  // #if KICKS
  TIMES.forEach((time, k) => prepareRow(params, time * h, [MULTIPLES[k] * (h * h)], rows[k]));
  // #else
  TIMES.forEach((time, k) => prepareRow(params, time * h, rows[k]));
  // #endif
}
// #endif

const at = new Float64Array(DIM);
const moved = new Float64Array(DIM);
/** Increments; for a monitor the time that a flow takes, and what is no number where a logarithm has none. */
const change = new Float64Array(DIM + 2);
// #if ATTITUDE
/** The elements of the flows of a step so far, multiplied, less 1. */
let elementOfStep = new Float64Array(ELEMENT);
let elementAfter = new Float64Array(ELEMENT);
// #endif

/** The flows of one step, or those of a corrector: a status. If it fails, the state is as before. */
export function makeStage(solver, _, flows = SCHEDULE) {
  const { x, carry } = solver;
  const [rows] = solver.coef;
  at.set(x);
  moved.set(carry);
  // #if MONITOR
  let time = 0;
  // #endif
  // #if ATTITUDE
  elementOfStep.fill(0);
  // #endif
  for (const [part, row] of flows) {
    // #if ATTITUDE
    FLOWS[part](rows[row], at, elementOfStep, change, elementAfter);
    [elementOfStep, elementAfter] = [elementAfter, elementOfStep];
    // #else
    FLOWS[part](rows[row], at, change);
    // #endif
    // #if MONITOR
    time += change[DIM] + 0 * change[DIM + 1];
    // #endif
    for (let i = 0; i < DIM; i++) {
      moved[i] += change[i];
      at[i] = x[i] + moved[i];
    }
  }
  solver.evaluations++;
  if (!at.every(Number.isFinite)) return "NOT_FINITE";
  // #if MONITOR
  if (!(time * solver.h > 0)) return "NOT_FINITE";
  pass(solver, time);
  // #endif
  for (let i = 0; i < DIM; i++) {
    const sum = x[i] + moved[i];
    const added = sum - x[i];
    carry[i] = (x[i] - (sum - added)) + (moved[i] - added);
    x[i] = sum;
  }
  // #if LENGTHENED
  shorten(elementOfStep);
  // #endif
  // #if ATTITUDE
  turnBy(solver, elementOfStep);
  // #endif
  return "OK";
}
