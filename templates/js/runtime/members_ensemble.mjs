import { StepError, expectOptions } from "./errors.mjs";
import { OPTIONS } from "./model.mjs";
import { Solver } from "./solver.mjs";

/** Members of Solver: runs of many states. */
export class Ensemble {
  /**
   * Make count steps from each of many initial states. A trajectory ends before the first step that fails.
   * #if GAUGE
   * Each state has its own gauge unless options.gauge is given.
   * #endif
   * h and parameters may be arrays with one number for each initial state. Throws StepError if an array has
   * another length.
   *
   * @param {Iterable<ArrayLike<number>>} members initial states
   * @param {number | ArrayLike<number>} h step size
   * @param {number} count number of steps
   * #if NOISE
   * @param {object} [options] as in the constructor, without x0; member is the number of the first
   *   trajectory
   * #else
   * @param {object} [options] as in the constructor, without x0
   * #endif
   * @returns {{x: Float64Array[], status: string[]}} the last state of each trajectory, and its
   *   status: "OK", or the status of the step that failed
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
