import { beginAttitude, currentElement, elementOf } from "./attitude.mjs";
import { finite } from "./errors.mjs";
import { ATTITUDE } from "./model.mjs";

/** Members of Solver: the attitude of a body. */
export class Attitudes {
  /**
   * The attitude. It transforms body to space coordinates: a quaternion (w, x, y, z), or a matrix row by row.
   */
  get attitude() {
    return currentElement(this).slice(0, ATTITUDE);
  }

  // #members position
  /**
   * Set the attitude. Throws StepError for values that are not admissible; then nothing changes.
   *
   * @param {ArrayLike<number>} attitude
   * @param {ArrayLike<number>} [position] of a body that has one; the origin by default
   * @returns {this}
   */
  setAttitude(attitude, position) {
    beginAttitude(this, elementOf(this.steps, finite(attitude, ATTITUDE, "the attitude"), position));
    return this;
  }
}
