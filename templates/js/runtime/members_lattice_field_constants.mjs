import { OBSERVED_FIELDS } from "./model.mjs";

/** Members of Solver: the names of observables that have a value at each site. */
export class FieldConstants {
  static OBSERVED_FIELDS = OBSERVED_FIELDS;
}
