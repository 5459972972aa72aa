import { StepError } from "./errors.mjs";

// ---- Many steps ----

/** Steps of a solver. Throws StepError for a number that is none, and where a step cannot be made. */
export function march(solver, h, count, makeStep = () => solver.step(h)) {
  if (!(Number.isInteger(count) && count >= 0)) {
    throw new StepError("BAD_ARGUMENT", solver.steps, `the number of steps is ${count}`);
  }
  for (let k = 0; k < count; k++) makeStep();
  return solver;
}
