import { StepError } from "./errors.mjs";
import { restoreState, savedState } from "./saving.mjs";
import { tangentOf } from "./tangent.mjs";
import { forgetSteps } from "./gauss.mjs";

/** Members of Solver: the derivative of a step. */
export class Tangent {
  /**
   * Make one step as `step` does, and compute its derivative, exact to round-off.
   * #if GAUGE
   * The gauge is held fixed.
   * #endif
   * Throws StepError; then the state is unchanged.
   *
   * @param {number} h
   * @returns {Float64Array} entry i * DIM + j is the derivative of the new x[i] by the old x[j]
   */
  stepTangent(h) {
    const before = savedState(this);
    const { t, steps } = this;
    const at = { x: Float64Array.from(this.x), carry: Float64Array.from(this.carry), t };
    this.step(h);
    const { status, tangent } = tangentOf(this, at);
    if (status === "OK") return tangent;
    restoreState(this, before);
    forgetSteps(this);
    Object.assign(this, { steps, h: NaN }); // NaN: coefficients are computed anew
    throw new StepError(status, steps);
  }
}
