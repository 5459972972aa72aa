import { noiseFieldsAt } from "./noise_autonomous.mjs";
import { DIM, SOURCES } from "./model.mjs";

const fields = new Float64Array(SOURCES.length * DIM);

/** The size of the increments of the state by the noise of a step. */
export function sizeOfNoise({ params, t, x, dw }) {
  noiseFieldsAt(params, t, x, fields);
  return fields.reduce((sum, field, k) => sum + Math.abs(dw[Math.floor(k / DIM)] * field), 0);
}
