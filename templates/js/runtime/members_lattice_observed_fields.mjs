import { OBSERVED_FIELDS, observedFields } from "./model.mjs";

/** Members of Solver: the observables that have a value at each site. */
export class ObservedFields {
  /** Values at all sites of OBSERVED_FIELDS, in this order; x and t are the present ones by default. */
  observedFields(x = this.x, t = this.t) {
    const out = new Float64Array(OBSERVED_FIELDS.length * this.sites.count);
    this.sites.t = t;
    observedFields(this.params, x, this.sites, out);
    return out;
  }
}
