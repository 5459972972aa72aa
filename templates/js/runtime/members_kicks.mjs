import { finite } from "./errors.mjs";
import { forgetSteps } from "./gauss.mjs";
import { shiftHistory } from "./history_shifted.mjs";
import { takeLevel } from "./level_of_new_state.mjs";
import { restartAttitude } from "./attitude_gauge.mjs";
import { DIM } from "./model.mjs";

/** Members of Solver: changes of the state between steps. */
export class Kicks {
  /**
   * Replace the state by x between steps; the time and the parameters stay the same. If x is not admissible,
   * throws StepError and changes nothing.
   *
   * @param {ArrayLike<number>} x may lie on another symplectic leaf; the Casimirs then change, too
   * @returns {this}
   */
  setState(x) {
    this.#place(finite(x, DIM, "x"), new Float64Array(DIM));
    forgetSteps(this);
    return this;
  }

  /**
   * Add a change, such as an impulse, to the state between steps. If the change or the new state is not
   * admissible, throws StepError and changes nothing.
   *
   * @param {ArrayLike<number>} change
   * @returns {this}
   */
  kick(change) {
    const to = finite(change, DIM, "the change");
    const carry = new Float64Array(DIM);
    to.forEach((by, i) => {
      const sum = this.x[i] + by;
      const added = sum - this.x[i];
      const lost = ((this.x[i] - (sum - added)) + (by - added)) + this.carry[i];
      to[i] = sum + lost;
      carry[i] = lost - (to[i] - sum);
    });
    return this.#place(finite(to, DIM, "the state"), carry);
  }

  /** Replace the state by x, with carry as the compensation term. */
  #place(x, carry) {
    takeLevel(this, x);
    shiftHistory(this, x);
    this.x.set(x);
    this.carry.set(carry);
    restartAttitude(this);
    return this;
  }
}
