import { StepError } from "./errors.mjs";
import { chooseGauge, rateAt } from "./level.mjs";
import { FRACTIONS, prepare } from "./model.mjs";

/**
 * Set the energy level to -H at a new state x. Throws StepError if the level or the monitor is not admissible
 * at x.
 */
export function takeLevel(solver, x) {
  const [rate, level] = [rateAt(solver.params, x), chooseGauge(solver.params, x)];
  if (!(Number.isFinite(rate) && rate > 0 && Number.isFinite(level[0]))) {
    throw new StepError("BAD_ARGUMENT", solver.steps, `the monitor is ${rate} at this state, not positive`);
  }
  solver.gauge = level;
  if (!Number.isFinite(solver.h)) return;
  FRACTIONS.forEach((fraction, stage) => {
    prepare(solver.params, level, fraction * solver.h, solver.coef[stage]);
  });
}
