import { OBSERVED_FIELDS, observedFields } from "./model.mjs";

/** Members of Solver: the observables of sites. */
export class ObservedFields {
  /** The observables of sites in the order of OBSERVED_FIELDS, at x and its time or at given ones. */
  observedFields(x = this.x, t = this.t) {
    const out = new Float64Array(OBSERVED_FIELDS.length * this.sites.count);
    this.sites.t = t;
    observedFields(this.params, x, this.sites, out);
    return out;
  }
}
