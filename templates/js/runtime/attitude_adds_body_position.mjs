import { rotationAdds } from "./attitude_screws.mjs";

/**
 * Compute the change of the position in a group element when it is multiplied by 1 + factor from the right.
 */
export function addPositions(element, factor, added) {
  rotationAdds(element[0], element, factor).forEach((change, i) => {
    added[4 + i] = change + factor[4 + i];
  });
}
