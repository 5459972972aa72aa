import { relax, slope } from "./model.mjs";
import { allFinite } from "./sites.mjs";
import { sizeOf, solved } from "./sweeps.mjs";

// ---- Newton's method for a stage that sweeps do not solve, its linear equations in Krylov spaces ----

/** Newton's iterations; directions of a Krylov space, and how well it solves. */
const MOST_ITERATIONS = 40;
const DIRECTIONS = 400;
const SOLVED = 1e-6;
/** How far from x a solution is one of the motion, in sizes of x and of what the field says. */
const PLAUSIBLE = 1.5;

const dot = (a, b) => a.reduce((sum, v, k) => sum + v * b[k], 0);
const norm = (a) => Math.sqrt(dot(a, a));
const total = (a) => a.reduce((sum, v) => sum + Math.abs(v), 0);

/** a + factor * b, in place of a. */
function add(a, factor, b) {
  for (let k = 0; k < a.length; k++) a[k] += factor * b[k];
}

/** The solution of matrix(v) = side, to some digits, by GMRES; null where it leads to what is not finite. */
function krylov(matrix, side) {
  const length = norm(side);
  const solution = new Float64Array(side.length);
  if (length === 0) return solution;
  const directions = [side.map((v) => v / length)];
  const [columns, turns, target] = [[], [], [length]];
  for (let count = 0; count < Math.min(DIRECTIONS, side.length); count++) {
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
    if (Math.abs(target[count + 1]) <= SOLVED * length || rest <= 1e-14 * length) break;
    directions.push(next.map((v) => v / rest));
  }
  const weights = [];
  for (let k = columns.length - 1; k >= 0; k--) {
    const known = columns.slice(k + 1).reduce((sum, column, j) => sum + column[k] * weights[k + 1 + j], 0);
    weights[k] = (target[k] - known) / columns[k][k];
    add(solution, weights[k], directions[k]);
  }
  return solution;
}

/** y at the middle of a stage by Newton's method; null where there is none near x. */
export function byNewton(coef, x, guess, sites) {
  const y = Float64Array.from(guess);
  const image = new Float64Array(y.length);
  relax(coef, x, x, sites, image);
  const far = PLAUSIBLE * (total(x) + total(image.map((v, k) => v - x[k])));
  let before = 0;
  for (let iteration = 0; iteration < MOST_ITERATIONS; iteration++) {
    relax(coef, x, y, sites, image);
    const matrix = (v) => {
      const out = new Float64Array(v.length);
      slope(coef, y, v, sites, out);
      return out.map((moved, k) => v[k] - moved);
    };
    const change = allFinite(image) ? krylov(matrix, image.map((v, k) => v - y[k])) : null;
    if (change === null) return null;
    add(y, 1, change);
    if (!allFinite(y)) return null;
    const size = sizeOf(change, y);
    if (solved(size, before, iteration === 0)) return total(y.map((v, k) => v - x[k])) <= far ? y : null;
    before = size;
  }
  return null;
}
