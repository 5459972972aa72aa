import { noiseFieldsAt } from "./noise_autonomous.mjs";
import { DIM, SOURCES } from "./model.mjs";

/** Members of Solver: the vector fields of the noise. */
export class NoiseFields {
  /** For each source of noise with the Hamiltonian g and the amplitude sigma: sigma pi(x) grad g(x). */
  noiseFields(x = this.x, t = this.t) {
    const out = new Float64Array(SOURCES.length * DIM);
    noiseFieldsAt(this.params, t, x, out);
    return out;
  }
}
