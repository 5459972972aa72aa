import { finite } from "./errors.mjs";

/** Members of Solver: the derivative of a step. */
export class Tangent {
  /**
   * Make one step as `step` does, and multiply vectors by its derivative, exact to round-off. Throws
   * StepError; then the state is unchanged.
   *
   * @param {number} h
   * @param {ArrayLike<number>[]} vectors laid out as x
   * @returns {Float64Array[]}
   */
  stepTangent(h, vectors) {
    this.vectors = vectors.map((v) => finite(v, this.x.length, "a tangent vector"));
    try {
      this.step(h);
      return this.vectors;
    } finally {
      this.vectors = [];
    }
  }
}
