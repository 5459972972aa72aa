import { StepError } from "./errors.mjs";
import { NEGATIVE, part1, part2 } from "./model.mjs";
import { sumOf } from "./sites.mjs";

// ---- Steps equal in a time tau, for K = log(A + e) - log(-B) in place of H = A + B ----

/** The sum over all sites of the values that the function density computes. */
export function totalOf(density, params, sites, ...at) {
  const values = new Float64Array(sites.count);
  density(params, ...at, sites, values);
  return sumOf(values);
}

/** The value of a part of H. */
function partEnergy(part, { params, sites, x }) {
  return totalOf([part1, part2][part], params, sites, x);
}

/**
 * Set the energy level e = -H(x0), constant along a trajectory, and clear the rounding error of t. Throws
 * StepError unless -B is positive at x0.
 */
export function beginLevel(solver) {
  solver.tCarry = 0;
  const energies = [partEnergy(0, solver), partEnergy(1, solver)];
  solver.level = -(energies[0] + energies[1]);
  if (Number.isFinite(solver.level) && energies[NEGATIVE] < 0) return;
  const energy = energies[NEGATIVE];
  throw new StepError("BAD_ARGUMENT", 0, `the part of H that must be negative is ${energy} at x0`);
}

/**
 * The number by which times are divided: A + e for the part log(A + e) of K, -B for the part -log(-B). The
 * flow of a part of K over a time is the flow of A or B over that time divided by this number.
 */
export function rateOf(part, solver) {
  const energy = partEnergy(part, solver);
  return part === NEGATIVE ? -energy : energy + solver.level;
}
