import { StepError } from "./errors.mjs";
import { BODY_AXES, MASS, REMAINDER } from "./model.mjs";
import { bodiesFrom, innerMasses, relativeFrom } from "./bodies_jacobi.mjs";

// ---- Relative coordinates of bodies ---- Flows act on relative positions and velocities; the values of the
// first body are those of the centre of mass of all bodies. In Jacobi coordinates, the values of any other
// body are relative to the centre of mass of all bodies before it. In democratic heliocentric coordinates,
// positions are relative to the first body, and velocities to the centre of mass of all bodies.

/** Store in sites: the central masses of the Kepler motions, the total mass, and the last body with mass. */
export function weigh(sites) {
  const m = sites.params[MASS];
  sites.mass = m.reduce((sum, mass) => sum + mass, 0);
  if (!(m[0] > 0) || m.some((mass) => mass < 0) || !Number.isFinite(sites.mass)) {
    const message =
      "masses must not be negative, their sum must be finite, and the first body must have a mass";
    throw new StepError("BAD_ARGUMENT", 0, message);
  }
  expectMasses(m);
  sites.massive = m.findLastIndex((mass) => mass > 0) + 1;
  sites.inner = innerMasses(m);
}

/** Throw StepError for a body without mass, whose velocity does not follow from its momentum. */
export function expectMasses(m) {
  if (!m.every((mass) => mass > 0)) {
    throw new StepError("BAD_ARGUMENT", 0, "bodies with momenta must have masses");
  }
}

/** The values of field k at all sites, as a part of x. */
export function fieldOf(x, k, sites) {
  return x.subarray(k * sites.count, (k + 1) * sites.count);
}

/**
 * List the pairs [positions of all bodies, their velocities or momenta]: one pair for each axis of the state,
 * then one for each axis of each tangent vector.
 */
function axesOf({ x, vectors = [], sites }) {
  return [x, ...vectors].flatMap((y) => BODY_AXES.map((axis) => axis.map((k) => fieldOf(y, k, sites))));
}

/** Transform the state of a solver, and tangent vectors, to relative coordinates. */
export function toRelative(solver) {
  for (const [q, v] of axesOf(solver)) {
    divideByMass(v, solver.sites);
    relativeFrom(q, v, solver.sites);
  }
}

/** Transform the state of a solver, and tangent vectors, from relative to Cartesian coordinates. */
export function toCartesian(solver) {
  for (const [q, v] of axesOf(solver)) {
    bodiesFrom(q, v, solver.sites);
    multiplyByMass(v, solver.sites);
  }
}

/** Transform momenta to velocities. */
export function divideByMass(p, sites) {
  for (let i = 0; i < p.length; i++) p[i] /= sites.params[MASS][i];
}

/** Transform velocities to momenta. */
export function multiplyByMass(v, sites) {
  for (let i = 0; i < v.length; i++) v[i] *= sites.params[MASS][i];
}

/** Move the centre of mass at its constant velocity for a time, unless this part of H does not move it. */
export function moveCentre(solver, part, time) {
  if (part === REMAINDER) return;
  for (const [q, v] of axesOf(solver)) q[0] += time * v[0];
}
