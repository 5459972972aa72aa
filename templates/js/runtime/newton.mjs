import { startFrom } from "./start_predicted.mjs";
import { advance } from "./algebra.mjs";
import { TINY, solve } from "./linear.mjs";
import { plausible, retried } from "./predictor_checks.mjs";
import { pass } from "./passing.mjs";
import { timeOf } from "./level_stages.mjs";
import { turnStage } from "./attitude_stages.mjs";
import { FLOOR } from "./measure_policy.mjs";
import { NEARLY_SOLVED, SHRINKING } from "./newton_policy.mjs";
import { DIM, MAX_ITERATIONS, TOLERANCE, linearise } from "./model.mjs";

// ---- The implicit step, by Newton's method ----

/**
 * Relative size of a correction of y: the largest |correction_i| / (|y_i| + FLOOR max_j |y_j|). It is NaN or
 * infinite if a component of the correction is.
 */
export function relativeSize(y, correction) {
  let norm = 0;
  let size = 0;
  for (let i = 0; i < DIM; i++) norm = Math.max(norm, Math.abs(y[i]));
  for (let i = 0; i < DIM; i++) {
    const ratio = Math.abs(correction[i]) / (Math.abs(y[i]) + FLOOR * norm + TINY);
    if (!Number.isFinite(ratio)) return ratio;
    size = Math.max(size, ratio);
  }
  return size;
}

const y = new Float64Array(DIM);
const delta = new Float64Array(DIM);
const displacement = new Float64Array(DIM);
const increment = new Float64Array(DIM);
const small = new Float64Array(DIM);
const jacobian = new Float64Array(DIM * DIM);
const incrementJacobian = new Float64Array(DIM * DIM);

/**
 * Solve (y - x) + displacement(y) = 0 for y by Newton's method, and add the increment at y to x. Returns a
 * status. Iterations start from the predicted y. The next correction is about the square of the last one;
 * iterations end when it is expected to be below TOLERANCE. The last correction of y changes the increment.
 * This change is added to first order, without another evaluation.
 */
function attempt(solver, stage) {
  const { x, carry } = solver;
  const history = solver.history[stage];
  let previous = Infinity;
  startFrom(history, x, y);
  for (let iteration = 1; iteration <= MAX_ITERATIONS; iteration++) {
    linearise(solver.coef[stage], y, displacement, increment, jacobian, incrementJacobian);
    solver.evaluations++;
    for (let i = 0; i < DIM; i++) delta[i] = y[i] - x[i] + displacement[i] - carry[i];
    const regular = solve(jacobian, delta);
    const size = relativeSize(y, delta);
    if (!Number.isFinite(size)) return "NOT_FINITE";
    if (!regular) return "SINGULAR";
    for (let i = 0; i < DIM; i++) y[i] -= delta[i];
    const remaining = size * size * Math.max(1, size / (previous * previous));
    const stalled = previous < NEARLY_SOLVED && size > SHRINKING * previous;
    previous = size;
    if (!(remaining <= TOLERANCE || stalled)) continue;
    for (let i = 0; i < DIM; i++) {
      small[i] = 0;
      for (let j = 0; j < DIM; j++) small[i] -= incrementJacobian[i * DIM + j] * delta[j];
      small[i] += carry[i];
    }
    if (!plausible(solver, stage, increment)) return "NO_CONVERGENCE";
    // #if MONITOR
    const time = timeOf(solver, stage, y);
    if (Number.isNaN(time)) return "NOT_FINITE";
    // #endif
    if (!advance(solver, increment, small)) return "NOT_FINITE";
    pass(solver, time);
    turnStage(solver, stage, y);
    history.remember(y);
    return "OK";
  }
  return "NO_CONVERGENCE";
}

/** Make one stage of a step, and return its status. */
export function makeStage(solver, stage) {
  return retried(solver, stage, attempt);
}
