import { modified } from "./model.mjs";

const number = new Float64Array(1);

/** Members of Solver: the modified Hamiltonian. */
export class Modified {
  /**
   * Value at x and the time t of the modified Hamiltonian, whose exact flow is a step of size h up to
   * O(h^MODIFIED_POWER).
   */
  modifiedHamiltonian(h, x = this.x, t = this.t) {
    modified(this.params, h, t, x, number);
    return number[0];
  }
}
