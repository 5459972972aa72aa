import { observablesAt } from "./observed_autonomous.mjs";
import { OBSERVABLES } from "./model.mjs";

/** Members of Solver: the observables. */
export class Observed {
  /** The observables in the order of OBSERVABLES; x and t are the present state and time by default. */
  observables(x = this.x, t = this.t) {
    const out = new Float64Array(OBSERVABLES.length);
    observablesAt(this.params, t, x, out);
    return out;
  }
}
