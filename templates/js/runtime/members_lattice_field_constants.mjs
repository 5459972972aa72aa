import { OBSERVED_FIELDS } from "./model.mjs";

/** Members of Solver: the names of observables of sites. */
export class FieldConstants {
  static OBSERVED_FIELDS = OBSERVED_FIELDS;
}
