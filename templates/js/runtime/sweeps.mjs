import { DIFFERENCES, LEAST_SIZE, NEARLY_SETTLED, PATIENCE, ROUNDING } from "./lattice_sweep_policy.mjs";
import { SETTLED, SLOW } from "./lattice_sweep_policy.mjs";
import { DIM, MOST_SWEEPS, SCHEDULE, increment, relax } from "./model.mjs";
import { allFinite } from "./sites.mjs";
import { byNewton } from "./krylov.mjs";
import { drawAtSites } from "./site_noise.mjs";
import { carry } from "./site_tangent.mjs";

// ---- The step of the series: stages, each with an equation on the whole lattice ----

/** The largest magnitude of values[from] ... values[to - 1]; NaN if one is NaN. */
function most(values, from, to) {
  let largest = 0;
  for (let k = from; k < to; k++) {
    const size = Math.abs(values[k]);
    if (!(size <= largest)) largest = size;
  }
  return largest;
}

/** Size of each field of y: its largest magnitude, plus LEAST_SIZE times the largest of all fields. */
export function usual(y) {
  const count = y.length / DIM;
  const overall = most(y, 0, y.length);
  const largest = (k) => most(y, k * count, (k + 1) * count);
  return Float64Array.from({ length: DIM }, (_, k) => largest(k) + LEAST_SIZE * overall + 1e-300);
}

/** The largest change of a field of y relative to the size of the field. */
export function sizeOf(change, y) {
  const count = y.length / DIM;
  return usual(y).reduce((largest, unitOfField, k) => {
    const size = most(change, k * count, (k + 1) * count) / unitOfField;
    return size <= largest ? largest : size;
  }, 0);
}

/** Whether further sweeps would change y by less than rounding, or changes are small and no longer shrink. */
export function solved(change, before, first) {
  if (change * change <= (before - change) * SETTLED) return true;
  return change >= before && change <= ROUNDING && !first;
}

/** The solution y of a stage by fixed-point sweeps from a prediction; null on failure. */
function bySweeps(coef, x, prediction, sites) {
  let y = prediction;
  let before = 0;
  for (let sweeps = 1; sweeps <= MOST_SWEEPS; sweeps++) {
    const next = new Float64Array(y.length);
    relax(coef, x, y, sites, next);
    if (!allFinite(next)) return null;
    const change = sizeOf(next.map((v, k) => v - y[k]), next);
    y = next;
    if (solved(change, before, sweeps === 1)) return y;
    if (sweeps > PATIENCE && change > Math.max(SLOW * before, NEARLY_SETTLED)) return null;
    before = change;
  }
  return null;
}

/**
 * Update backward differences with a new value. Returns how many of them should be summed for the next
 * prediction.
 */
function remember(differences, value) {
  let order = 1;
  let least = Infinity;
  let following = value;
  for (let k = 0; k < Math.min(differences.length, DIFFERENCES); k++) {
    const last = differences[k];
    differences[k] = following;
    following = following.map((v, i) => v - last[i]);
    const size = most(following, 0, following.length);
    if (size < least) [order, least] = [k + 1, size];
  }
  if (differences.length < DIFFERENCES) differences.push(following);
  return order;
}

/** Make one step, and return its status. If the step fails, the state is undefined. */
export function makeStep(solver) {
  const { x, rows, sites, past } = solver;
  // #if NOISE
  drawAtSites(solver, 0);
  // #endif
  past.stages ??= SCHEDULE.map(() => ({ order: 0, differences: [] }));
  const change = new Float64Array(x.length);
  for (const [stage, [, row]] of SCHEDULE.entries()) {
    const [coef, predictor] = [rows[row], past.stages[stage]];
    // #if TIMED
    sites.t = solver.t + MOMENTS[stage] * solver.h;
    // #endif
    const prediction = Float64Array.from(x);
    for (const difference of predictor.differences.slice(0, predictor.order)) {
      for (let k = 0; k < prediction.length; k++) prediction[k] += difference[k];
    }
    let y = past.stiff ? null : bySweeps(coef, x, prediction, sites);
    if (y === null) { // Newton's method in this stage and all later ones
      past.stiff = true;
      y = byNewton(coef, x, prediction, sites);
    }
    if (y === null) return "NO_CONVERGENCE";
    predictor.order = remember(predictor.differences, y.map((v, k) => v - x[k]));
    // #if TANGENT
    for (const v of solver.vectors) {
      if (!carry(coef, x, y, v, sites)) return "NO_CONVERGENCE";
    }
    // #endif
    increment(coef, y, sites, change);
    for (let k = 0; k < x.length; k++) x[k] += change[k];
    if (!allFinite(x)) return "NOT_FINITE";
  }
  return "OK";
}
