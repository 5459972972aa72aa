import { MAX_ENERGY_CHANGE, PLAUSIBLE } from "./plausibility_policy.mjs";
import { DIFFERENCES, REACH } from "./predictor_policy.mjs";
import { energyAt, vectorFieldAt } from "./autonomous.mjs";
import { makePerTau } from "./level.mjs";
import { sizeOfNoise } from "./noise_none.mjs";
import { DIM, FRACTIONS } from "./model.mjs";

// ---- Starting guesses, and whether a solution may be right ----

/**
 * The last value of the unknown and its backward differences, which the next is extrapolated by. For
 * speed only.
 */
export class History {
  /** Differences that are known. */
  count = 0;
  /** How many of them the extrapolation adds up. */
  order = 0;
  #difference = Array.from({ length: DIFFERENCES }, () => new Float64Array(DIM));

  /** Forget everything. */
  clear() {
    this.count = this.order = 0;
    for (const row of this.#difference) row.fill(0);
  }

  /**
   * The state has been moved: the last value moves with it, and its differences stay.
   *
   * @param {Float64Array} from
   * @param {Float64Array} to
   */
  move(from, to) {
    for (let i = 0; i < DIM; i++) this.#difference[0][i] += to[i] - from[i];
  }

  /** The last value. */
  last() {
    return Float64Array.from(this.#difference[0]);
  }

  /**
   * The guess for the next value: the sum of the differences.
   *
   * @param {Float64Array} value is overwritten
   * @returns {boolean} false if there is none, or if it is far away, where the equation of a step has
   *   solutions that have nothing to do with the motion
   */
  predict(value) {
    let distance = 0;
    let size = 0;
    for (let i = 0; i < DIM; i++) {
      const last = this.#difference[0][i];
      value[i] = 0;
      for (let k = 0; k < this.order; k++) value[i] += this.#difference[k][i];
      distance += Math.abs(value[i] - last);
      size += Math.abs(last);
    }
    return this.order > 0 && distance <= REACH * size;
  }

  /**
   * Take in a solved value. The guess of order k missed it by its k-th difference: the next is of the
   * best order.
   *
   * @param {Float64Array} value
   */
  remember(value) {
    const next = Float64Array.from(value);
    let least = Infinity;
    for (let k = 0; k <= this.count && k < DIFFERENCES; k++) {
      const row = this.#difference[k];
      let size = 0;
      for (let i = 0; i < DIM; i++) {
        const last = row[i];
        row[i] = next[i];
        size += Math.abs(next[i]);
        next[i] -= last;
      }
      if (k > 0 && size < least) {
        least = size;
        this.order = k;
      }
    }
    if (this.count === 0) this.order = 1;
    if (this.count < DIFFERENCES) this.count++;
  }
}

const speed = new Float64Array(DIM);
const point = new Float64Array(DIM);
const value = new Float64Array(1);

/**
 * Whether an increment is that of the motion. Where the step is too large, the equation may have been
 * solved by a point far away, at another energy, that has nothing to do with it.
 *
 * @param {Solver} solver
 * @param {number} stage
 * @param {Float64Array} increment
 * @returns {boolean}
 */
export function plausible(solver, stage, increment) {
  const { params, x } = solver;
  let moved = 0;
  let size = 0;
  for (let i = 0; i < DIM; i++) {
    moved += Math.abs(increment[i]);
    size += Math.abs(x[i]);
  }
  if (moved <= PLAUSIBLE * size) return true;
  vectorFieldAt(params, solver.t, x, speed);
  makePerTau(params, x, speed);
  for (let i = 0; i < DIM; i++) size += Math.abs(FRACTIONS[stage] * solver.h * speed[i]);
  size += sizeOfNoise(solver);
  if (moved <= PLAUSIBLE * size) return true;
  const [before, middle, after] = [0, 0.5, 1].map((part) => {
    for (let i = 0; i < DIM; i++) point[i] = x[i] + part * increment[i];
    energyAt(params, solver.t, point, value);
    return value[0];
  });
  const energy = Math.abs(before) + Math.abs(middle) + Math.abs(after);
  return Math.abs(after - before) <= MAX_ENERGY_CHANGE * energy;
}

/**
 * One stage. A guess from earlier steps may have misled it: then once more without.
 *
 * @param {Solver} solver
 * @param {number} stage
 * @param {(solver: Solver, stage: number) => string} attempt
 * @returns {string} a status
 */
export function retried(solver, stage, attempt) {
  const history = solver.history[stage];
  const status = attempt(solver, stage);
  if (status === "OK" || history.count === 0) return status;
  history.clear();
  return attempt(solver, stage);
}
