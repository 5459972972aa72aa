import { StepError, expectOptions } from "./errors.mjs";
import { OPTIONS } from "./model.mjs";
import { Solver } from "./solver.mjs";

/** Members of Solver: runs of many states. */
export class Ensemble {
  /**
   * Integrate many states, each with its own gauge, if there is one. A state that fails keeps its last
   * good value. h and the values of options may be arrays, with a number for each state; throws StepError if
   * they have another length.
   *
   * @param {Iterable<ArrayLike<number>>} members
   * @param {number | ArrayLike<number>} h
   * @param {number} count
   * #if NOISE
   * @param {object} [options] as in the constructor, without x0; member is that of the first state
   * #else
   * @param {object} [options] as in the constructor, without x0
   * #endif
   * @returns {{x: Float64Array[], status: string[]}} last states, and "OK" or a status for each
   */
  static ensemble(members, h, count, options = {}) {
    const starts = Array.from(members);
    expectOptions(options, OPTIONS.filter((name) => name !== "x0"));
    const ends = starts.map((x0, m) => {
      const valueOf = (what, value) => {
        if (typeof value !== "object" || value === null) return value;
        if (value.length === starts.length) return value[m];
        throw new StepError("BAD_ARGUMENT", 0, `${what} must be one number, or ${starts.length}`);
      };
      const size = valueOf("h", h);
      const params = Object.entries(options.params ?? {}).map(([key, value]) => [key, valueOf(key, value)]);
      const chosen = { ...options, params: Object.fromEntries(params), t0: valueOf("t0", options.t0), x0 };
      // #if NOISE
      chosen.member = (options.member ?? 0) + m;
      // #endif
      let end = Float64Array.from(x0);
      try {
        const solver = new Solver(chosen);
        end = solver.x;
        solver.integrate(size, count);
        return { end, status: "OK" };
      } catch (error) {
        if (!(error instanceof StepError)) throw error;
        return { end, status: error.status };
      }
    });
    return { x: ends.map(({ end }) => end), status: ends.map(({ status }) => status) };
  }
}
