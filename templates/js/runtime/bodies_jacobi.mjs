import { BODY_AXES, MASS } from "./model.mjs";
import { fieldOf } from "./bodies.mjs";

/** The central masses of the Kepler motions: for each body, the sum of the masses up to its own. */
export function innerMasses(m) {
  let sum = 0;
  return m.map((mass) => (sum += mass));
}

/** Make positions and velocities relative to the centre of mass of all bodies before each body. */
export function relativeFrom(q, v, sites) {
  for (const y of [q, v]) {
    let centre = y[0];
    for (let i = 1; i < y.length; i++) {
      y[i] -= centre;
      centre += sites.params[MASS][i] / sites.inner[i] * y[i];
    }
    y[0] = centre;
  }
}

/** Transform relative positions and velocities to those of the bodies. */
export function bodiesFrom(q, v, sites) {
  for (const y of [q, v]) {
    let centre = y[0];
    for (let i = y.length - 1; i > 0; i--) {
      centre -= sites.params[MASS][i] / sites.inner[i] * y[i];
      y[i] += centre;
    }
    y[0] = centre;
  }
}

/**
 * Transform a state, or a tangent vector, for sums over pairs of bodies: positions relative to the first
 * body.
 */
export function placed(x, sites) {
  const m = sites.params[MASS], from = x.slice();
  for (const [position] of BODY_AXES) {
    const q = fieldOf(from, position, sites);
    let centre = 0;
    q[0] = 0;
    for (let i = 1; i < q.length; i++) {
      const relative = q[i];
      q[i] += centre;
      centre += m[i] / sites.inner[i] * relative;
    }
  }
  return from;
}

/**
 * Make the acceleration of each body relative to the centre of mass of all bodies before it. Accelerations
 * are in sites.sums.
 */
export function joinSums(x, sites, first) {
  const m = sites.params[MASS];
  BODY_AXES.forEach((_, axis) => {
    const pull = fieldOf(sites.sums, first + axis, sites);
    let sum = m[0] * pull[0];
    for (let i = 1; i < pull.length; i++) {
      const before = sum / sites.inner[i - 1];
      sum += m[i] * pull[i];
      pull[i] -= before;
    }
  });
}
