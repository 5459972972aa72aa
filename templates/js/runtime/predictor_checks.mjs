import { MAX_ENERGY_CHANGE, PLAUSIBLE } from "./plausibility_policy.mjs";
import { DIFFERENCES, REACH } from "./predictor_policy.mjs";
import { energyAt, vectorFieldAt } from "./autonomous.mjs";
import { makePerTau } from "./level.mjs";
import { sizeOfNoise } from "./noise_none.mjs";
import { DIM, FRACTIONS } from "./model.mjs";

// ---- Predictors, and the check of solutions ----

/**
 * Predictor of a stage. It stores the last solution y, and backward differences of earlier solutions. The sum
 * of some of these entries predicts the next solution. Iterations start from the prediction, so a predictor
 * affects the speed only.
 */
export class History {
  /** Number of stored entries: the last solution and its differences. */
  count = 0;
  /** Number of entries whose sum is the prediction. */
  order = 0;
  #difference = Array.from({ length: DIFFERENCES }, () => new Float64Array(DIM));

  /** Clear the predictor. */
  clear() {
    this.count = this.order = 0;
    for (const row of this.#difference) row.fill(0);
  }

  /**
   * The state was changed from `from` to `to`: add this change to the last solution. The differences stay the
   * same.
   *
   * @param {Float64Array} from
   * @param {Float64Array} to
   */
  shift(from, to) {
    for (let i = 0; i < DIM; i++) this.#difference[0][i] += to[i] - from[i];
  }

  /** The last solution. */
  last() {
    return Float64Array.from(this.#difference[0]);
  }

  /**
   * Predict the next solution: the last one plus backward differences.
   *
   * @param {Float64Array} value is overwritten
   * @returns {boolean} false if no solution is known, or if the prediction is too far from the last
   *     solution: the iteration might then find an unrelated solution
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
   * Update the predictor with a solution. The new k-th difference is the error that a prediction of order k
   * would have had. The next prediction has the order with the smallest error.
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
 * Whether an increment is plausible: it is short, or changes the energy little. If a step is too large, its
 * equation may have solutions far away, at another energy, that have nothing to do with the motion.
 *
 * @param {Solver} solver
 * @param {number} stage
 * @param {Float64Array} increment
 * @returns {boolean}
 */
export function plausible(solver, stage, increment) {
  const { params, x } = solver;
  let distance = 0;
  let size = 0;
  for (let i = 0; i < DIM; i++) {
    distance += Math.abs(increment[i]);
    size += Math.abs(x[i]);
  }
  if (distance <= PLAUSIBLE * size) return true;
  vectorFieldAt(params, solver.t, x, speed);
  makePerTau(params, x, speed);
  for (let i = 0; i < DIM; i++) size += Math.abs(FRACTIONS[stage] * solver.h * speed[i]);
  size += sizeOfNoise(solver);
  if (distance <= PLAUSIBLE * size) return true;
  const [before, middle, after] = [0, 0.5, 1].map((part) => {
    for (let i = 0; i < DIM; i++) point[i] = x[i] + part * increment[i];
    energyAt(params, solver.t, point, value);
    return value[0];
  });
  const energy = Math.abs(before) + Math.abs(middle) + Math.abs(after);
  return Math.abs(after - before) <= MAX_ENERGY_CHANGE * energy;
}

/**
 * Make one stage by calling `attempt`. If a prediction makes it fail, call it again without one.
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
