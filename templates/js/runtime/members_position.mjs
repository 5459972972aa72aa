import { currentElement } from "./attitude.mjs";
import { ATTITUDE } from "./model.mjs";

/** Members of Solver: the position of a body. */
export class Positions {
  /** The position of the body in space. */
  get position() {
    return currentElement(this).slice(ATTITUDE);
  }
}
