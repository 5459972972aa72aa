import { countsOf } from "./counts_graph.mjs";
import { OBSERVABLES, REDUCTIONS, observables } from "./model.mjs";

/** Members of Solver: the observables. */
export class Observed {
  /** The observables in the order of OBSERVABLES; x and t are the present state and time by default. */
  observables(x = this.x, t = this.t) {
    this.sites.t = t;
    return this.#reduced(x);
  }

  #reduced(x) {
    const { count } = this.sites;
    const densities = new Float64Array(OBSERVABLES.length * count);
    observables(this.params, x, this.sites, densities);
    const counts = countsOf(this.sites);
    return Float64Array.from(REDUCTIONS, ([kind, over], k) => {
      const ofObservable = densities.subarray(k * count, (k + 1) * count);
      if (kind === "max") return ofObservable.reduce((most, value) => Math.max(most, value), -Infinity);
      if (kind === "min") return ofObservable.reduce((least, value) => Math.min(least, value), Infinity);
      return kind === "mean" ? sumOf(ofObservable) / counts[over] : sumOf(ofObservable);
    });
  }
}
