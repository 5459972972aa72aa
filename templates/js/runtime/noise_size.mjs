import { noiseFieldsAt } from "./noise_autonomous.mjs";
import { DIM, SOURCES } from "./model.mjs";

const fields = new Float64Array(SOURCES.length * DIM);

/** Size of the increment of the state by noise in a step: the sum of |dw| |field| over all sources. */
export function sizeOfNoise({ params, t, x, dw }) {
  noiseFieldsAt(params, t, x, fields);
  return fields.reduce((sum, field, k) => sum + Math.abs(dw[Math.floor(k / DIM)] * field), 0);
}
