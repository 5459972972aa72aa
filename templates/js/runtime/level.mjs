import { FRACTIONS, elapsed, energy, monitor } from "./model.mjs";
// #if GAUSS
import { WEIGHTS } from "./model.mjs";
// #endif
// #if SPLITTING
import { TIMES, prepareRow } from "./model.mjs";
// #endif

// ---- Physical time, of steps that are equal in tau ----

const one = new Float64Array(1);

/** e = -H(x0), which a trajectory holds fixed: K = monitor (H + e) is 0 along it. */
export function chooseGauge(params, x) {
  energy(params, x, one);
  return Float64Array.of(-one[0]);
}

/** dt/dtau at a state. */
export function rateAt(params, x) {
  monitor(params, x, one);
  return one[0];
}

// #if IMPLICIT
/** The time that a stage takes, by its point y; NaN unless it has the sign of the stage. */
export function timeOf(solver, stage, y) {
  elapsed(solver.coef[stage], y, one);
  return one[0] * (FRACTIONS[stage] * solver.h) > 0 ? one[0] : NaN;
}

// #endif

// #if GAUSS
/**
 * The time that a step takes, by its start and the unknowns at its stages; NaN unless it has the sign
 * of the step.
 */
export function timeOfStep(solver, stage, start, z) {
  let sum = 0;
  WEIGHTS.forEach((b, i) => {
    elapsed(solver.coef[stage], start, z[i], Float64Array.of(solver.h * b), one);
    sum += one[0];
  });
  return sum * solver.h > 0 ? sum : NaN;
}

// #endif
/** The time of a solver gains that of a stage. */
export function pass(solver, time) {
  const sum = solver.t + time;
  const added = sum - solver.t;
  const small = solver.tCarry + ((solver.t - (sum - added)) + (time - added));
  solver.t = sum + small;
  solver.tCarry = small - (solver.t - sum);
}

// #if SPLITTING
/** The coefficients of all flows of a step: a row for each time. */
export function prepare(params, gauge, h, rows) {
  TIMES.forEach((time, k) => prepareRow(params, gauge, time * h, rows[k]));
}

// #endif
