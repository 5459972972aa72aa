import { noiseFieldsAt } from "./noise_autonomous.mjs";
import { DIM, SOURCES } from "./model.mjs";

const fields = new Float64Array(SOURCES.length * DIM);

/** Size of the noise in the increments of the state by a step. */
export function sizeOfNoise({ params, t, x, dw }) {
  noiseFieldsAt(params, t, x, fields);
  return fields.reduce((sum, field, k) => sum + Math.abs(dw[Math.floor(k / DIM)] * field), 0);
}
