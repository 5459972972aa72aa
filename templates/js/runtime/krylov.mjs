import { DIRECTIONS, PLAUSIBLE, SOLVED, USEFUL } from "./lattice_newton_policy.mjs";
import { MOST_SWEEPS, relax, slope } from "./model.mjs";
import { allFinite } from "./sites.mjs";
import { sizeOf, solved, usual } from "./sweeps.mjs";

// ---- Newton's method with Krylov spaces, for stages that fixed-point sweeps do not solve ----

const dot = (a, b) => a.reduce((sum, v, k) => sum + v * b[k], 0);
const norm = (a) => Math.sqrt(dot(a, a));
const total = (a) => a.reduce((sum, v) => sum + Math.abs(v), 0);

/** Add `factor` * b to a. */
function add(a, factor, b) {
  for (let k = 0; k < a.length; k++) a[k] += factor * b[k];
}

/** A solution v of `matrix`(v) = `side` by GMRES without restart; null for a residual over USEFUL |side|. */
function krylov(matrix, side) {
  const length = norm(side);
  const solution = new Float64Array(side.length);
  if (length === 0) return solution;
  const directions = [side.map((v) => v / length)];
  const [columns, turns, target] = [[], [], [length]];
  for (let count = 0; count < DIRECTIONS; count++) {
    const next = matrix(directions[count]);
    if (!allFinite(next)) return null;
    const column = directions.map((direction) => {
      const part = dot(direction, next);
      add(next, -part, direction);
      return part;
    });
    const rest = norm(next);
    turns.forEach(([c, s], k) => {
      [column[k], column[k + 1]] = [c * column[k] + s * column[k + 1], c * column[k + 1] - s * column[k]];
    });
    const radius = Math.hypot(column[count], rest);
    const [c, s] = [column[count] / radius, rest / radius];
    column[count] = radius;
    columns.push(column);
    turns.push([c, s]);
    target.push(-s * target[count]);
    target[count] *= c;
    if (Math.abs(target[count + 1]) <= SOLVED * length || rest === 0) break;
    directions.push(next.map((v) => v / rest));
  }
  if (!(Math.abs(target[columns.length]) <= USEFUL * length)) return null;
  const weights = [];
  for (let k = columns.length - 1; k >= 0; k--) {
    const known = columns.slice(k + 1).reduce((sum, column, j) => sum + column[k] * weights[k + 1 + j], 0);
    weights[k] = (target[k] - known) / columns[k][k];
    add(solution, weights[k], directions[k]);
  }
  return solution;
}

/** The solution v of v - S v = `side`, where S is the derivative of a sweep; null if `krylov` finds none. */
export function linearised(coef, x, y, side, sizes, sites) {
  const count = y.length / sizes.length;
  const unit = (k) => sizes[Math.floor(k / count)];
  const matrix = (scaled) => {
    const out = new Float64Array(scaled.length);
    slope(coef, x, y, scaled.map((v, k) => v * unit(k)), sites, out);
    return out.map((image, k) => scaled[k] - image / unit(k));
  };
  const scaled = krylov(matrix, side.map((v, k) => v / unit(k)));
  return scaled && scaled.map((v, k) => v * unit(k));
}

/** Solution y of a stage by Newton's method from the prediction; null if it finds none near x. */
export function byNewton(coef, x, prediction, sites) {
  const y = Float64Array.from(prediction);
  const image = new Float64Array(y.length);
  relax(coef, x, x, sites, image);
  const far = PLAUSIBLE * (total(x) + total(image.map((v, k) => v - x[k])));
  let before = 0;
  for (let correction = 0; correction < MOST_SWEEPS; correction++) {
    relax(coef, x, y, sites, image);
    if (!allFinite(image)) return null;
    const change = linearised(coef, x, y, image.map((v, k) => v - y[k]), usual(image), sites);
    if (change === null) return null;
    add(y, 1, change);
    if (!allFinite(y)) return null;
    const size = sizeOf(change, y);
    if (solved(size, before, correction === 0)) return total(y.map((v, k) => v - x[k])) <= far ? y : null;
    before = size;
  }
  return null;
}
