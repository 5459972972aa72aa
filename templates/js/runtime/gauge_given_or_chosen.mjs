import { finite } from "./errors.mjs";
import { chooseGauge } from "./gauge.mjs";
import { GAUGE } from "./model.mjs";

/** Read the gauge from the options of a solver, else choose it at the initial state. */
export function takeGauge(solver, { gauge }) {
  solver.gauge = gauge ? finite(gauge, GAUGE.length, "gauge") : chooseGauge(solver.params, solver.x);
}
