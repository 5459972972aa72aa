import { rotationAdds } from "./attitude_screws.mjs";

/**
 * Compute the change of the position in a group element when it is multiplied by 1 + factor from the left.
 */
export function addPositions(element, factor, added) {
  rotationAdds(1 + factor[0], factor, element).forEach((change, i) => {
    added[4 + i] = change + factor[4 + i];
  });
}
