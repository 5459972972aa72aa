import { PROBE_STEP } from "./start_policy.mjs";
import { GAUGE, prepare } from "./model.mjs";

/** Compute the coefficients of a stage of size h. */
export function prepareStage({ params, gauge }, h, table) {
  prepare(params, gauge, h, table);
}

/** Compute the coefficients of a very small step. For admissible parameters they are finite. */
export function prepareProbe(params, table) {
  prepare(params, new Float64Array(GAUGE.length), PROBE_STEP, table);
}
