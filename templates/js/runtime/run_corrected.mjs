import { BEGIN, END, SCHEDULE } from "./model.mjs";

/** The flows of a run of one step, with the correctors before and after it. */
export function flowsOfRun() {
  return [...BEGIN, ...SCHEDULE, ...END];
}
