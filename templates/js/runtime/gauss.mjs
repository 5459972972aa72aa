import { advance } from "./algebra.mjs";
import { MOST_RISING, NEARLY_ROUNDING, ROUNDING, SOLVED, STALLED } from "./gauss_policy.mjs";
import { DIM, MAX_SWEEPS, MIXING, PLACES, PLAIN, POINT, UNKNOWNS, WEIGHTS } from "./model.mjs";
import { stageChange, stageField } from "./model.mjs";
import { turnStage } from "./attitude_stages.mjs";
import { storeIncrement } from "./gauss_framed.mjs";
import { pass } from "./passing.mjs";
import { timeOfStep } from "./level_gauss.mjs";

// ---- The implicit step, by Gauss collocation ----

const NODES = WEIGHTS.length;

/** An array with the unknowns of each stage. */
export function stages() {
  return Array.from({ length: NODES }, () => new Float64Array(UNKNOWNS));
}

/** Predictor, which affects the speed only: results of the last step, the start of the next iteration. */
export class History {
  /** Whether a step is stored, and whether the state was changed since that step. */
  stored = false;
  kicked = false;
  /** Number of sweeps of the last step, and the factor by which changes shrink from sweep to sweep. */
  sweeps = 2;
  rate = 0.5;
  /**
   * Stage increments of the last step, transformed to the unknowns of the next step; size of the last step.
   */
  increments = stages();
  h = NaN;

  /** Clear the predictor. */
  clear() {
    this.stored = false;
  }

  /**
   * Record that the state was changed. The increments of the last step still predict the next step, but no
   * longer lead to x.
   */
  shift() {
    this.kicked = true;
  }

  /** An independent copy. */
  copy() {
    const twin = Object.assign(new History(), this);
    twin.increments = this.increments.map((increment) => Float64Array.from(increment));
    return twin;
  }
}

/** Clear the predictors, after parameters have been changed. */
export function forgetSteps(solver) {
  for (const history of solver.history) history.clear();
}

/**
 * The collocation polynomial at a fraction of a step, minus its value at the end, is the sum of f_j times
 * increment j. Returns the factors f_j: the integrals of the Lagrange polynomials from 1 to the fraction,
 * divided by the weights. They are computed by sums of Legendre polynomials.
 */
export function factorsAt(fraction) {
  const x = 2 * fraction - 1;
  const factors = new Float64Array(NODES).fill(fraction - 1);
  let [below, here] = [1, x];
  let [nodesBelow, nodes] = [PLACES.map(() => 1), PLACES.map((place) => 2 * place - 1)];
  for (let k = 1; k < NODES; k++) {
    const b = k / (k + 1);
    const a = 1 + b;
    const above = a * x * here - b * below;
    const nodesAbove = PLACES.map((place, j) => a * (2 * place - 1) * nodes[j] - b * nodesBelow[j]);
    nodes.forEach((node, j) => {
      factors[j] += 0.5 * node * (above - below);
    });
    [below, here, nodesBelow, nodes] = [here, above, nodes, nodesAbove];
  }
  return factors;
}

const point = new Float64Array(POINT);

/** Data at the start of a step: the coordinates, and the time if H depends on it. */
export function startOf({ x, t }) {
  point.set(x);
  if (POINT > DIM) point[DIM] = t;
  return point;
}

/** Compute the unknowns z of all stages: sums of the stage increments, with weights from the matrix. */
export function mixed(matrix, increments, z) {
  for (let i = 0; i < NODES; i++) {
    z[i].fill(0);
    for (let j = 0; j < NODES; j++) {
      const factor = matrix[i][j];
      for (let k = 0; k < UNKNOWNS; k++) z[i][k] += factor * increments[j][k];
    }
  }
}

const weight = new Float64Array(1);

/** Compute the increments of all stages: h b_j times the vector field at the unknowns z. */
function slopes(solver, stage, start, z, increments) {
  for (let i = 0; i < NODES; i++) {
    weight[0] = solver.h * WEIGHTS[i];
    stageField(solver.coef[stage], start, z[i], weight, increments[i]);
  }
}

/** The smallest normal number: smaller squares count as 0. */
const LEAST_SQUARE = 2 ** -1022;

/**
 * Largest change at any stage, of the first PLAIN unknowns relative to |x|, or to the increments if x = 0.
 */
function changeOf(start, before, after) {
  let norm = LEAST_SQUARE;
  for (let i = 0; i < DIM; i++) norm += start[i] * start[i];
  if (norm === LEAST_SQUARE) {
    for (const increment of after) for (let k = 0; k < PLAIN; k++) norm += increment[k] * increment[k];
  }
  let largest = 0;
  for (let i = 0; i < NODES; i++) {
    let sum = 0;
    for (let k = 0; k < UNKNOWNS; k++) {
      const change = after[i][k] - before[i][k];
      sum += (change * change) / (k < PLAIN ? norm : 1);
    }
    if (!(sum <= largest)) largest = sum;
  }
  return Math.sqrt(largest);
}

/**
 * The predicted unknowns at the stages of a step are sums of the stage increments of the last step, with
 * these weights. The two steps have equal sizes.
 */
const PREDICTION = PLACES.map((place) => factorsAt(1 + place));

const predicted = stages();
const mixedIncrements = stages();

/**
 * Solve the equations of a step for the stage increments, by fixed-point sweeps from the prediction. The
 * increments are stored in increments.now; returns a status.
 */
export function collocate(solver, stage, start, history, increments) {
  let last = Infinity;
  let rising = 0;
  let rises = 0;
  const ratio = history.stored ? solver.h / history.h : NaN;
  if (ratio === 1) {
    mixed(PREDICTION, history.increments, predicted);
  } else {
    if (Math.abs(ratio) <= 1) {
      mixed(PLACES.map((place) => factorsAt(1 + ratio * place)), history.increments, predicted);
    } else {
      for (const row of predicted) row.fill(0);
    }
    history.rate = 0.5;
    history.sweeps = 2;
  }
  slopes(solver, stage, start, predicted, increments.now);
  for (let sweep = 2; sweep <= MAX_SWEEPS; sweep++) {
    mixed(MIXING, increments.now, mixedIncrements);
    slopes(solver, stage, start, mixedIncrements, increments.next);
    solver.evaluations++;
    [increments.now, increments.next] = [increments.next, increments.now];
    if (sweep < history.sweeps) continue;
    const change = changeOf(start, increments.next, increments.now);
    const rate = change / last;
    if (!Number.isFinite(change)) return "NOT_FINITE";
    if (rate > 0 && rate < 1 && change > NEARLY_ROUNDING) history.rate = 0.7 * history.rate + 0.3 * rate;
    const solved = change * history.rate <= SOLVED;
    const slow = rate >= 1 || rate > Math.max(STALLED, 1.5 * history.rate);
    if (rate >= 1 && change <= NEARLY_ROUNDING) rises++;
    if (solved || (slow && change <= ROUNDING) || rises > 1) {
      // early: convergence was reached before the first measured change, or soon after it
      const early = sweep === history.sweeps || rate > 2 * history.rate;
      history.sweeps = Math.max(2, early ? history.sweeps - 1 : sweep - 1);
      return "OK";
    }
    rising = rate >= 1 ? rising + 1 : 0; // changes may grow at first, for as many sweeps as stages
    if (rising >= NODES + MOST_RISING) return "NO_CONVERGENCE";
    last = change;
  }
  return "NO_CONVERGENCE";
}

/** The sum of the increments of all stages. */
export function endOf(increments) {
  const end = new Float64Array(UNKNOWNS);
  for (const increment of increments) for (let k = 0; k < UNKNOWNS; k++) end[k] += increment[k];
  return end;
}

const work = { now: stages(), next: stages() };
const change = new Float64Array(DIM);

function attempt(solver, stage) {
  const history = solver.history[stage];
  const start = startOf(solver);
  const status = collocate(solver, stage, start, history, work);
  if (status !== "OK") return status;
  const end = endOf(work.now);
  stageChange(solver.coef[stage], start, end, change);
  // #if MONITOR
  mixed(MIXING, work.now, mixedIncrements);
  const time = timeOfStep(solver, stage, start, mixedIncrements);
  if (Number.isNaN(time)) return "NOT_FINITE";
  // #endif
  if (!advance(solver, change, solver.carry)) return "NOT_FINITE";
  pass(solver, time);
  for (let i = 0; i < NODES; i++) {
    storeIncrement(solver.coef[stage], start, end, work.now[i], history.increments[i]);
  }
  history.stored = true;
  history.kicked = false;
  history.h = solver.h;
  turnStage(solver, stage, end);
  return "OK";
}

/** Make one step; returns a status. If it fails from the prediction, it is tried again without one. */
export function makeStage(solver, stage) {
  const status = attempt(solver, stage);
  if (status === "OK" || !solver.history[stage].stored) return status;
  solver.history[stage].clear();
  return attempt(solver, stage);
}
