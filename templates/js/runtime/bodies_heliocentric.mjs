import { BODY_AXES, MASS } from "./model.mjs";
import { fieldOf } from "./bodies.mjs";

/** The central masses of the Kepler motions of all bodies: the mass of the first body. */
export function innerMasses(m) {
  return m.map(() => m[0]);
}

/** The sum of m q over all bodies but the first. */
function momentOf(q, sites) {
  const m = sites.params[MASS];
  let sum = 0;
  for (let i = 1; i < sites.massive; i++) sum += m[i] * q[i];
  return sum;
}

/** Add a value to the coordinate of each body but the first. */
function shiftBodies(q, value) {
  for (let i = 1; i < q.length; i++) q[i] += value;
}

/** Make positions relative to the first body, and velocities relative to the centre of mass. */
export function relativeFrom(q, v, sites) {
  const first = v[0];
  shiftBodies(q, -q[0]);
  shiftBodies(v, -v[0]);
  q[0] += momentOf(q, sites) / sites.mass;
  v[0] += momentOf(v, sites) / sites.mass;
  shiftBodies(v, first - v[0]);
}

/** Transform relative positions and velocities to those of the bodies. */
export function bodiesFrom(q, v, sites) {
  const recoil = momentOf(v, sites) / sites.params[MASS][0];
  q[0] -= momentOf(q, sites) / sites.mass;
  shiftBodies(q, q[0]);
  shiftBodies(v, v[0]);
  v[0] -= recoil;
}

/**
 * Transform a state, or a tangent vector, for sums over pairs of bodies. In these coordinates, it is
 * unchanged.
 */
export function placed(x) {
  return x;
}

/**
 * Store the velocity (sum of m v over all bodies but the first) / m[0] for each axis, after the other sums.
 */
export function joinSums(x, sites, first) {
  BODY_AXES.forEach(([, velocity], axis) => {
    const shift = momentOf(fieldOf(x, velocity, sites), sites) / sites.params[MASS][0];
    fieldOf(sites.sums, first + BODY_AXES.length + axis, sites).fill(shift);
  });
}
