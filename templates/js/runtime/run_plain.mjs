import { SCHEDULE } from "./model.mjs";

/** The flows of one step. */
export function flowsOfRun() {
  return SCHEDULE;
}
