import { OBSERVABLES } from "./model.mjs";

/** Members of Solver: the names of observables. */
export class Constants {
  static OBSERVABLES = OBSERVABLES;
}
