import { BEGIN, END, SCHEDULE } from "./model.mjs";

/** The flows of one step, with those of the correctors before and after it. */
export function flowsOfRun() {
  return [...BEGIN, ...SCHEDULE, ...END];
}
