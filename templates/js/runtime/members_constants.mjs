import { OBSERVABLES } from "./model.mjs";

/** Members of Solver: their number and names. */
export class Constants {
  static OBSERVABLES = OBSERVABLES;
}
