import { quaternionProduct } from "./attitude_quaternions.mjs";
import { addPositions } from "./attitude_adds_body_position.mjs";

/** Compute the change of a group element by multiplication with 1 + factor from the right. */
export function turnAdds(element, factor, added) {
  quaternionProduct(element, factor, added);
  addPositions(element, factor, added);
}
