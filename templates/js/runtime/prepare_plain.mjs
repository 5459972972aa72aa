import { PROBE_STEP } from "./start_policy.mjs";
import { prepare } from "./model.mjs";

/** Compute the coefficients of a stage of size h. */
export function prepareStage({ params }, h, table) {
  prepare(params, h, table);
}

/** Compute the coefficients of a very small step. For admissible parameters they are finite. */
export function prepareProbe(params, table) {
  prepare(params, PROBE_STEP, table);
}
