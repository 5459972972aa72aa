import { StepError } from "./errors.mjs";
import { BODY_AXES, MASS, REMAINDER } from "./model.mjs";
import { bodiesFrom, innerMasses, relativeFrom } from "./bodies_jacobi.mjs";

// ---- Relative coordinates of bodies ----
// Flows act on a position and a velocity of each body but the first, and at the first on those of the centre
// of mass. Positions are relative to the centre of mass of all bodies before (Jacobi), or to the first body
// (democratic heliocentric); velocities then are those from the centre of mass.

/** Compute the masses that Kepler motions are about, and the number of bodies up to the last with a mass. */
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

/** The values of field k at all sites. */
export function fieldOf(x, k, sites) {
  return x.subarray(k * sites.count, (k + 1) * sites.count);
}

/** The positions and velocities, or momenta, of the state of a solver and of its tangent vectors, by axes. */
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

/** Transform relative coordinates back. */
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

/** Move the centre of mass, which is free, in the flow of a part of H. */
export function moveCentre(solver, part, time) {
  if (part === REMAINDER) return;
  for (const [q, v] of axesOf(solver)) q[0] += time * v[0];
}
