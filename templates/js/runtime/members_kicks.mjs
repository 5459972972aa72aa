import { finite } from "./errors.mjs";
import { moveHistory } from "./history_moved.mjs";
import { takeLevel } from "./level_moved.mjs";
import { restartAttitude } from "./attitude_gauge.mjs";
import { DIM } from "./model.mjs";

/** Members of Solver: changes of the state between steps. */
export class Kicks {
  /**
   * Between steps: stand at x, with time, parameters and any gauge as they are. Throws StepError for what
   * is not allowed; then all is as before.
   *
   * @param {ArrayLike<number>} x it may lie off the leaf: the Casimirs are from then on those of x
   * @returns {this}
   */
  setState(x) {
    return this.#place(finite(x, DIM, "x"), new Float64Array(DIM));
  }

  /**
   * Between steps: add a change to the state, as an impulse does; else as setState.
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

  /** Replace the state by x + carry. */
  #place(x, carry) {
    takeLevel(this, x);
    moveHistory(this, x);
    this.x.set(x);
    this.carry.set(carry);
    restartAttitude(this);
    return this;
  }
}
