import { quaternionProduct } from "./attitude_quaternions.mjs";
import { addPositions } from "./attitude_adds_space_position.mjs";

/** Compute the change of an element under multiplication by a factor, given minus 1. */
export function turnAdds(element, factor, added) {
  quaternionProduct(factor, element, added);
  addPositions(element, factor, added);
}
