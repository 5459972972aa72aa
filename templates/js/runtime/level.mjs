import { StepError } from "./errors.mjs";
import { energy, monitor } from "./model.mjs";

// ---- The physical time of steps that are equal in a time tau ----

const one = new Float64Array(1);

/** The energy level e = -H(x0), a constant of the steps. */
export function chooseGauge(params, x) {
  energy(params, x, one);
  return Float64Array.of(-one[0]);
}

/** The monitor dt/dtau at the state x. */
export function rateAt(params, x) {
  monitor(params, x, one);
  return one[0];
}

/** Throw StepError unless the monitor and the energy level are finite and the physical time increases. */
export function expectPassingTime(solver) {
  const rate = rateAt(solver.params, solver.x);
  if (Number.isFinite(rate) && rate > 0 && Number.isFinite(solver.gauge[0])) return;
  throw new StepError("BAD_ARGUMENT", 0, `the monitor is ${rate} at x0, not positive`);
}

/** Convert a vector field at x from dx/dt to dx/dtau, where t is the physical time. */
export function makePerTau(params, x, field) {
  const rate = rateAt(params, x);
  for (let i = 0; i < field.length; i++) field[i] *= rate;
}
