import { TINY, solve } from "./linear.mjs";
import { LONGEST_PATH } from "./path_policy.mjs";
import { TANGENT_NEGLIGIBLE, TANGENT_ROUNDED_SLOPE } from "./path_tangent_policy.mjs";
import { DIM, MAX_ITERATIONS, TANGENT_FIXED, TANGENT_SERIES, TERMS } from "./model.mjs";
import { curvature, tangentBegin, tangentField, tangentOrder } from "./model.mjs";
import { identity, multiplied } from "./tangent.mjs";
import { solvedForAll, tangentSolved } from "./tangent_solve.mjs";

// ---- The derivative of a stage along paths ----

/** Whether the slopes of a path and of its variation at a point m satisfy their differential equations. */
function tangentHolds(coef, p, f, m, slope) {
  const field = new Float64Array(2 * DIM);
  const scale = [0, 0];
  tangentField(coef, p, f, m, field);
  slope.forEach((value, i) => (scale[Math.floor(i / DIM)] += Math.abs(m[i]) + Math.abs(value)));
  return field.every((value, i) => {
    return Math.abs(value - slope[i]) <= TANGENT_ROUNDED_SLOPE * scale[Math.floor(i / DIM)];
  });
}

/**
 * Compute the path dm/dt = pi(m) p, 0 <= t <= 1, with its variation, by Taylor series. `change` receives the
 * end minus the start, and `mean` the mean minus the start.
 *
 * @returns {boolean} false if TERMS terms do not suffice
 */
function varyPiece(coef, p, start, change, mean) {
  const series = Array.from({ length: TANGENT_SERIES }, () => new Float64Array(TERMS + 1));
  const fixed = new Float64Array(TANGENT_FIXED);
  const slope = new Float64Array(2 * DIM);
  const norm = [TINY, TINY];
  let small = 0;
  start.forEach((value, i) => {
    series[i][0] = value;
    norm[Math.floor(i / DIM)] += Math.abs(value);
  });
  change.fill(0);
  mean.fill(0);
  tangentBegin(coef, p, series, fixed);
  for (let k = 0; k < TERMS; k++) {
    tangentOrder(coef, p, series, fixed, k);
    let negligible = true;
    for (let i = 0; i < 2 * DIM; i++) {
      const term = series[i][k + 1];
      change[i] += term;
      mean[i] += term / (k + 2);
      slope[i] += (k + 1) * term;
      const size = norm[Math.floor(i / DIM)] + Math.abs(change[i]);
      if (!(Math.abs(term) <= TANGENT_NEGLIGIBLE * size)) negligible = false;
    }
    small = negligible ? small + 1 : 0;
    const end = start.map((value, i) => value + change[i]);
    if (small >= 2 && tangentHolds(coef, p, fixed, end, slope)) return true;
  }
  return false;
}

/**
 * The end (change) and the mean of the whole path from x with covector p, both minus x. Each is followed by
 * its variation under a variation of x[seed], or of p[seed - DIM] if seed >= DIM.
 *
 * @returns {{change: Float64Array, mean: Float64Array} | null} null if the path cannot be followed
 */
function varyPath(coef, x, p, seed) {
  const start = Float64Array.from({ length: 2 * DIM }, (_, i) => (i < DIM ? x[i] : Number(i - DIM === seed)));
  for (let pieces = 1; pieces <= LONGEST_PATH; pieces *= 2) {
    const q = start.map((_, i) => (i < DIM ? p[i] : Number(i === seed)) / pieces);
    const [change, mean, shift, local] = [0, 0, 0, 0].map(() => new Float64Array(2 * DIM));
    let good = true;
    for (let piece = 0; piece < pieces && good; piece++) {
      good = varyPiece(coef, q, start.map((value, i) => value + change[i]), shift, local);
      for (let i = 0; i < 2 * DIM; i++) {
        mean[i] += (change[i] + local[i]) / pieces;
        change[i] += shift[i];
      }
    }
    if (good) return { change, mean };
  }
  return null;
}

/**
 * The derivative of a stage, end_x + end_p Dp, and the increment of the stage as `change`. The stage follows
 * a path from x whose covector p solves p = grad S_h(mean). So the derivative Dp of p by x solves
 * (1 - H mean_p) Dp = H mean_x, where H is the Hessian of S_h. Here end_x, end_p, mean_x and mean_p are
 * derivatives of end and mean of the path by x and p. p is first refined to rounding level, from the stored
 * mean.
 */
export function differentiateStage(solver, stage, at) {
  const coef = solver.coef[stage];
  const [p, side] = [0, 0].map(() => new Float64Array(DIM));
  const hessian = new Float64Array(DIM * DIM);
  let previous = Infinity;
  curvature(coef, solver.history[stage].last(), p, hessian);
  for (let iteration = 0; ; iteration++) {
    const ends = [identity(), identity().fill(0)];
    const means = [identity(), identity().fill(0)];
    let varied = null;
    for (let seed = 0; seed < 2 * DIM; seed++) {
      varied = varyPath(coef, at.x, p, seed);
      if (!varied) return { status: "NO_CONVERGENCE" };
      const [block, column] = [Math.floor(seed / DIM), seed % DIM];
      for (let i = 0; i < DIM; i++) {
        ends[block][i * DIM + column] += varied.change[DIM + i];
        means[block][i * DIM + column] += varied.mean[DIM + i];
      }
    }
    const y = at.x.map((value, i) => value + varied.mean[i]);
    curvature(coef, y, side, hessian);
    const product = multiplied(hessian, means[1]);
    const jacobian = identity().map((value, k) => value - product[k]);
    for (let i = 0; i < DIM; i++) side[i] = p[i] - side[i];
    if (!solve(Float64Array.from(jacobian), side)) return { status: "SINGULAR" };
    const size = Math.max(...side.map(Math.abs)) / Math.max(TINY, ...p.map(Math.abs));
    if (!Number.isFinite(size)) return { status: "NOT_FINITE" };
    if (tangentSolved(size, previous)) {
      const turn = solvedForAll(jacobian, multiplied(hessian, means[0]));
      if (!turn) return { status: "SINGULAR" };
      const derivative = multiplied(ends[1], turn).map((value, k) => value + ends[0][k]);
      return { status: "OK", change: varied.change.slice(0, DIM), derivative };
    }
    if (iteration === MAX_ITERATIONS) return { status: "NO_CONVERGENCE" };
    for (let i = 0; i < DIM; i++) p[i] -= side[i];
    previous = size;
  }
}
