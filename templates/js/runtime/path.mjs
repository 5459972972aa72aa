import { startFrom } from "./start_predicted.mjs";
import { advance } from "./algebra.mjs";
import { TINY, solve } from "./linear.mjs";
import { plausible, retried } from "./predictor_checks.mjs";
import { pass } from "./passing.mjs";
import { timeOf } from "./level_stages.mjs";
import { turnStage } from "./attitude_stages.mjs";
import { CONTRACTING, DIFFERENCE, LEAST_SHARE, LONGEST_PATH, MOST_PIECES } from "./path_policy.mjs";
import { NEARLY_SOLVED, NEGLIGIBLE, PATIENCE, ROUNDED_SLOPE, SHRINKING, SOLVED } from "./path_policy.mjs";
import { DIM, FIXED, MAX_ITERATIONS, SERIES, TERMS } from "./model.mjs";
import { generate, pathBegin, pathField, pathOrder } from "./model.mjs";

// ---- The implicit step, along paths dm/dt = pi(m) p ----

const series = Array.from({ length: SERIES }, () => new Float64Array(TERMS + 1));
const fixed = new Float64Array(FIXED);
const slope = new Float64Array(DIM);
const end = new Float64Array(DIM);
const field = new Float64Array(DIM);

/**
 * Whether the slope of the Taylor series of a path at its end m is pi(m) p. If not, the series only seems to
 * have converged: it has gaps between its terms, such as t + t^9, or extends across the kink of an absolute
 * value.
 */
function holds(coef, p) {
  pathField(coef, p, fixed, end, field);
  let scale = 0;
  for (let i = 0; i < DIM; i++) scale += Math.abs(end[i]) + Math.abs(slope[i]);
  for (let i = 0; i < DIM; i++) {
    if (!(Math.abs(field[i] - slope[i]) <= ROUNDED_SLOPE * scale)) return false;
  }
  return true;
}

/**
 * Compute the path dm/dt = pi(m) p, 0 <= t <= 1, from m(0) = `start`, by its Taylor series. `shift` receives
 * m(1) - m(0), and `mean` the mean of m(t) - m(0). Terms are added until they are negligible. Returns false
 * if TERMS do not suffice.
 */
function followPiece(coef, p, start, shift, mean) {
  let norm = 0;
  let small = 0;
  for (let i = 0; i < DIM; i++) {
    series[i][0] = start[i];
    shift[i] = mean[i] = slope[i] = 0;
    norm += Math.abs(start[i]);
  }
  pathBegin(coef, p, series, fixed);
  for (let k = 0; k < TERMS; k++) {
    pathOrder(coef, p, series, fixed, k);
    let negligible = true;
    for (let i = 0; i < DIM; i++) {
      const term = series[i][k + 1];
      shift[i] += term;
      mean[i] += term / (k + 2);
      slope[i] += (k + 1) * term;
      end[i] = start[i] + shift[i];
      const size = Math.abs(start[i]) + Math.abs(shift[i]) + LEAST_SHARE * norm;
      if (!(Math.abs(term) <= NEGLIGIBLE * size)) negligible = false;
    }
    small = negligible ? small + 1 : 0;
    if (small >= 2 && holds(coef, p)) return true;
  }
  return false;
}

const share = new Float64Array(DIM);
const start = new Float64Array(DIM);
const shift = new Float64Array(DIM);
const local = new Float64Array(DIM);

/**
 * Compute the whole path from x, in 1, 2, 4, ... pieces until the series of each piece converges. `change`
 * receives the end of the path minus x, and `mean` the mean of the path minus x. For any p, the end of the
 * path lies on the symplectic leaf of x.
 *
 * @returns {{good: boolean, piecesUsed: number}} good: whether the path is short enough and in the domain;
 *     piecesUsed: number of pieces computed
 */
function followPath(coef, x, p, change, mean) {
  let piecesUsed = 0;
  for (let pieces = 1; pieces <= LONGEST_PATH; pieces *= 2) {
    let good = true;
    for (let i = 0; i < DIM; i++) {
      share[i] = p[i] / pieces;
      change[i] = mean[i] = 0;
    }
    for (let piece = 0; piece < pieces && good; piece++) {
      for (let i = 0; i < DIM; i++) start[i] = x[i] + change[i];
      good = followPiece(coef, share, start, shift, local);
      piecesUsed++;
      for (let i = 0; i < DIM; i++) {
        mean[i] += (change[i] + local[i]) / pieces;
        change[i] += shift[i];
      }
    }
    if (good) return { good, piecesUsed };
  }
  return { good: false, piecesUsed };
}

const mean = new Float64Array(DIM);

/**
 * Compute the residual p - grad S_h(y) of the equation for p, where y is the mean of the path; also the
 * change of x along the path and an approximate Jacobian of the residual. Returns what `followPath` returns.
 */
function findResidual(solver, coef, p, y, residual, change, jacobian) {
  const path = followPath(coef, solver.x, p, change, mean);
  if (!path.good) return path;
  for (let i = 0; i < DIM; i++) y[i] = solver.x[i] + mean[i];
  generate(coef, y, residual, jacobian);
  for (let i = 0; i < DIM; i++) residual[i] = p[i] - residual[i];
  solver.evaluations++;
  return path;
}

const shifted = new Float64Array(DIM);
const elsewhere = new Float64Array(DIM);
const other = new Float64Array(DIM);
const unused = new Float64Array(DIM * DIM);

/**
 * Compute the Jacobian of the residual by differences. It serves for steps so large that iterations with the
 * approximate Jacobian do not converge.
 */
function differentiate(solver, coef, p, residual, jacobian) {
  let norm = TINY;
  let piecesUsed = 0;
  for (let i = 0; i < DIM; i++) norm = Math.max(norm, Math.abs(p[i]));
  for (let j = 0; j < DIM; j++) {
    const q = Float64Array.from(p);
    q[j] += DIFFERENCE * norm;
    const path = findResidual(solver, coef, q, elsewhere, shifted, other, unused);
    piecesUsed += path.piecesUsed;
    if (!path.good) return { good: false, piecesUsed };
    for (let i = 0; i < DIM; i++) jacobian[i * DIM + j] = (shifted[i] - residual[i]) / (q[j] - p[j]);
  }
  return { good: true, piecesUsed };
}

const p = new Float64Array(DIM);
const y = new Float64Array(DIM);
const residual = new Float64Array(DIM);
const change = new Float64Array(DIM);
const jacobian = new Float64Array(DIM * DIM);

/**
 * Solve p = grad S_h(mean of the path from x with covector p), and move x to the end of that path; S_h is the
 * generating function. Returns a status. If the paths of a step need more than MOST_PIECES Taylor
 * expansions, the step is too large for a meaningful solution.
 */
function attempt(solver, stage) {
  const coef = solver.coef[stage];
  const history = solver.history[stage];
  let previous = Infinity;
  let piecesUsed = 0;
  startFrom(history, solver.x, y);
  generate(coef, y, p, jacobian);
  for (let iteration = 0; iteration < MAX_ITERATIONS && piecesUsed <= MOST_PIECES; iteration++) {
    const path = findResidual(solver, coef, p, y, residual, change, jacobian);
    piecesUsed += path.piecesUsed;
    if (!path.good) return "NO_CONVERGENCE";
    let size = 0;
    let norm = TINY;
    for (let i = 0; i < DIM; i++) {
      if (!Number.isFinite(residual[i])) return "NOT_FINITE";
      size = Math.max(size, Math.abs(residual[i]));
      norm = Math.max(norm, Math.abs(p[i]));
    }
    size /= norm;
    // solved, or residuals no longer shrink since they are at rounding level
    if (size <= SOLVED || (previous < NEARLY_SOLVED && size > SHRINKING * previous)) {
      if (!plausible(solver, stage, change)) return "NO_CONVERGENCE";
      // #if MONITOR
      const time = timeOf(solver, stage, y);
      if (Number.isNaN(time)) return "NOT_FINITE";
      // #endif
      if (!advance(solver, change, solver.carry)) return "NOT_FINITE";
      pass(solver, time);
      turnStage(solver, stage, y);
      history.remember(y);
      return "OK";
    }
    if (iteration >= PATIENCE && size > CONTRACTING * previous) {
      const differences = differentiate(solver, coef, p, residual, jacobian);
      piecesUsed += differences.piecesUsed;
      if (!differences.good) return "NO_CONVERGENCE";
    }
    if (!solve(jacobian, residual)) return "SINGULAR";
    for (let i = 0; i < DIM; i++) p[i] -= residual[i];
    previous = size;
  }
  return "NO_CONVERGENCE";
}

/** Make one stage of a step; returns a status. */
export function makeStage(solver, stage) {
  return retried(solver, stage, attempt);
}
