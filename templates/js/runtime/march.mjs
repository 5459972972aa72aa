import { StepError } from "./errors.mjs";

// ---- Many steps ----

/** Make `count` steps of a solver. Throws StepError if a step fails, or if `count` is not an integer >= 0. */
export function march(solver, h, count, makeStep = () => solver.step(h)) {
  if (!(Number.isInteger(count) && count >= 0)) {
    throw new StepError("BAD_ARGUMENT", solver.steps, `the number of steps is ${count}, not 0, 1, 2, …`);
  }
  for (let k = 0; k < count; k++) makeStep();
  return solver;
}
