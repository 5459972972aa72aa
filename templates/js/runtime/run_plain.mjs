import { SCHEDULE } from "./model.mjs";

/** The flows of a run of one step. */
export function flowsOfRun() {
  return SCHEDULE;
}
