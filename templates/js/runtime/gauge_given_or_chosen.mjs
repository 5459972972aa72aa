import { finite } from "./errors.mjs";
import { chooseGauge } from "./gauge.mjs";
import { GAUGE } from "./model.mjs";

/** Set the gauge of a solver to the one in its options, or choose a gauge for the initial state. */
export function takeGauge(solver, { gauge }) {
  solver.gauge = gauge ? finite(gauge, GAUGE.length, "gauge") : chooseGauge(solver.params, solver.x);
}
