import { quaternionProduct } from "./attitude_quaternions.mjs";
import { addPositions } from "./attitude_adds_body_position.mjs";

/** Compute the change of an element by multiplication by 1 + factor from the right. */
export function turnAdds(element, factor, added) {
  quaternionProduct(element, factor, added);
  addPositions(element, factor, added);
}
