import { advance } from "./algebra.mjs";
import { DIM, explicit } from "./model.mjs";

// ---- The explicit step ----

const increment = new Float64Array(DIM);

/** Make one stage of a step: add its increment to x. Returns a status. */
export function makeStage(solver, stage) {
  explicit(solver.coef[stage], solver.x, increment);
  solver.evaluations++;
  return advance(solver, increment, solver.carry) ? "OK" : "NOT_FINITE";
}
