import { linearised } from "./krylov.mjs";
import { CARRIED, CARRIED_SHRINKING, NEARLY_CARRIED } from "./lattice_tangent_policy.mjs";
import { MOST_SWEEPS, follow, side, slope } from "./model.mjs";
import { allFinite } from "./sites.mjs";
import { usual } from "./sweeps.mjs";

// ---- Tangent vectors of the series ----

/**
 * Multiply a tangent vector v by the derivative of a stage with solution y, in place. The change dy of y
 * solves dy = S dy + side, where S is the derivative of a sweep by y, and side the derivative of a sweep
 * along v. Then the change of the increment due to dy is added to v. Returns false on failure.
 */
export function carry(coef, x, y, v, sites) {
  const sizes = usual(y);
  const count = y.length / sizes.length;
  const usually = (k) => sizes[Math.floor(k / count)];
  const length = (w) => Math.sqrt(w.reduce((sum, part, k) => sum + (part / usually(k)) ** 2, 0));
  const [right, image] = [new Float64Array(y.length), new Float64Array(y.length)];
  side(coef, x, y, v, sites, right);
  const size = length(right);
  if (!Number.isFinite(size)) return false;
  const solution = Float64Array.from(right);
  let before = Infinity;
  for (let correction = 0; correction < MOST_SWEEPS; correction++) {
    slope(coef, x, y, solution, sites, image);
    const left = right.map((part, k) => part + image[k] - solution[k]);
    const rest = length(left);
    if (rest <= CARRIED * size || (rest > CARRIED_SHRINKING * before && rest <= NEARLY_CARRIED * size)) {
      follow(coef, y, solution, sites, image);
      for (let k = 0; k < v.length; k++) v[k] += image[k];
      return allFinite(v);
    }
    const change = linearised(coef, x, y, left, sizes, sites);
    if (change === null) return false;
    for (let k = 0; k < solution.length; k++) solution[k] += change[k];
    before = rest;
  }
  return false;
}
