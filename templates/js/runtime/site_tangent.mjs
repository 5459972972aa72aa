import { linearised } from "./krylov.mjs";
import { CARRIED, CARRIED_SHRINKING, NEARLY_CARRIED } from "./lattice_tangent_policy.mjs";
import { MOST_SWEEPS, follow, side, slope } from "./model.mjs";
import { allFinite } from "./sites.mjs";
import { usual } from "./sweeps.mjs";

// ---- Tangent vectors of the series ----

/**
 * Carry a tangent vector v through a stage, in place: solve dy = S dy + side, and add its increment; returns
 * false on failure.
 */
export function carry(coef, x, y, v, sites) {
  const sizes = usual(y);
  const count = y.length / sizes.length;
  const usually = (k) => sizes[Math.floor(k / count)];
  const length = (w) => Math.sqrt(w.reduce((sum, part, k) => sum + (part / usually(k)) ** 2, 0));
  const [own, moved] = [new Float64Array(y.length), new Float64Array(y.length)];
  side(coef, x, y, v, sites, own);
  const size = length(own);
  if (!Number.isFinite(size)) return false;
  const found = Float64Array.from(own);
  let before = Infinity;
  for (let correction = 0; correction < MOST_SWEEPS; correction++) {
    slope(coef, x, y, found, sites, moved);
    const left = own.map((part, k) => part + moved[k] - found[k]);
    const rest = length(left);
    if (rest <= CARRIED * size || (rest > CARRIED_SHRINKING * before && rest <= NEARLY_CARRIED * size)) {
      follow(coef, y, found, sites, moved);
      for (let k = 0; k < v.length; k++) v[k] += moved[k];
      return allFinite(v);
    }
    const change = linearised(coef, x, y, left, sizes, sites);
    if (change === null) return false;
    for (let k = 0; k < found.length; k++) found[k] += change[k];
    before = rest;
  }
  return false;
}
