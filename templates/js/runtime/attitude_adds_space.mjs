import { quaternionProduct } from "./attitude_quaternions.mjs";
import { addPositions } from "./attitude_adds_space_position.mjs";

/** Compute the change of a group element by multiplication with 1 + factor from the left. */
export function turnAdds(element, factor, added) {
  quaternionProduct(factor, element, added);
  addPositions(element, factor, added);
}
