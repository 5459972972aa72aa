import { DIM, FLOWS, MULTIPLES, SCHEDULE, TIMES, prepareRow } from "./model.mjs";

// ---- The step of a splitting: flows of parts of H, one after the other ----

/** The coefficients of all flows of a step: a row for each time. */
export function prepare(params, h, rows) {
  // #if KICKS
  TIMES.forEach((time, k) => prepareRow(params, time * h, [MULTIPLES[k] * (h * h)], rows[k]));
  // #else
  TIMES.forEach((time, k) => prepareRow(params, time * h, rows[k]));
  // #endif
}

const at = new Float64Array(DIM);
const moved = new Float64Array(DIM);
const change = new Float64Array(DIM);

/** One step: a status. If it fails, the state is as before. */
export function makeStage(solver) {
  const { x, carry } = solver;
  const [rows] = solver.coef;
  at.set(x);
  moved.set(carry);
  for (const [part, row] of SCHEDULE) {
    FLOWS[part](rows[row], at, change);
    for (let i = 0; i < DIM; i++) {
      moved[i] += change[i];
      at[i] = x[i] + moved[i];
    }
  }
  solver.evaluations++;
  if (!at.every(Number.isFinite)) return "NOT_FINITE";
  for (let i = 0; i < DIM; i++) {
    const sum = x[i] + moved[i];
    const added = sum - x[i];
    carry[i] = (x[i] - (sum - added)) + (moved[i] - added);
    x[i] = sum;
  }
  return "OK";
}
