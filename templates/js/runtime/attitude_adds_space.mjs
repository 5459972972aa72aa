import { quaternionProduct } from "./attitude_quaternions.mjs";
import { addPositions } from "./attitude_adds_space_position.mjs";

/** Compute what a factor, given less 1, adds to an element. */
export function turnAdds(element, factor, added) {
  quaternionProduct(factor, element, added);
  addPositions(element, factor, added);
}
