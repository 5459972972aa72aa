import { finite } from "./errors.mjs";
import { chooseGauge } from "./gauge.mjs";
import { GAUGE } from "./model.mjs";

/** Set the gauge of a solver: from its options, or if they have none, chosen at the initial state. */
export function takeGauge(solver, { gauge }) {
  solver.gauge = gauge ? finite(gauge, GAUGE.length, "gauge") : chooseGauge(solver.params, solver.x);
}
