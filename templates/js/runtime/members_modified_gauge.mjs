import { modified } from "./model.mjs";

const number = new Float64Array(1);

/** Members of Solver: the modified Hamiltonian. */
export class Modified {
  /**
   * Value at x of the modified Hamiltonian, whose exact flow is a step of size h up to O(h^MODIFIED_POWER).
   */
  modifiedHamiltonian(h, x = this.x) {
    modified(this.params, this.gauge, h, x, number);
    return number[0];
  }
}
