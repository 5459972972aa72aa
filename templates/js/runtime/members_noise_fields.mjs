import { noiseFieldsAt } from "./noise_autonomous.mjs";
import { DIM, SOURCES } from "./model.mjs";

/** Members of Solver: the vector fields of the noise. */
export class NoiseFields {
  /** The vector field sigma pi(x) grad g(x) of each source of noise, one after the other. */
  noiseFields(x = this.x, t = this.t) {
    const out = new Float64Array(SOURCES.length * DIM);
    noiseFieldsAt(this.params, t, x, out);
    return out;
  }
}
