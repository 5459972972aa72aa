import { StepError } from "./errors.mjs";
import { endOf, factorsAt, startOf } from "./gauss.mjs";
import { DIM } from "./model.mjs";
import { stageChange } from "./model.mjs";

/** Members of Solver: states within the last step. */
export class Interpolation {
  /**
   * The states at fractions of the last step, 0 at its start and 1 at its end, by the collocation polynomial.
   * They serve to find events, are far less accurate than steps, and lie off the symplectic leaf by their
   * error. To get the state at an event with the accuracy of steps, make a step of size (fraction - 1) h with
   * a copy of the solver. Throws StepError before the first step, and after a change of the state.
   *
   * @param {number[]} fractions
   * @returns {Float64Array[]}
   */
  interpolate(fractions) {
    const [history] = this.history;
    if (!history.stored || history.kicked) {
      throw new StepError("BAD_ARGUMENT", this.steps, "no step leads to this state");
    }
    const start = startOf(this);
    const change = new Float64Array(DIM);
    return fractions.map((fraction) => {
      const factors = factorsAt(fraction);
      const parts = history.increments.map((increment, j) => increment.map((value) => factors[j] * value));
      stageChange(this.coef[0], start, endOf(parts), change);
      return this.x.map((value, i) => value + change[i]);
    });
  }
}
