import { noiseFieldsAt } from "./noise_autonomous.mjs";
import { DIM, SOURCES } from "./model.mjs";

const fields = new Float64Array(SOURCES.length * DIM);

/** Contribution of noise to the size of the increment of the state in a step: the sum of |dw| |field|. */
export function sizeOfNoise({ params, t, x, dw }) {
  noiseFieldsAt(params, t, x, fields);
  return fields.reduce((sum, field, k) => sum + Math.abs(dw[Math.floor(k / DIM)] * field), 0);
}
