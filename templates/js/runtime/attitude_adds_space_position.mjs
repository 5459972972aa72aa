import { rotationAdds } from "./attitude_screws.mjs";

/** Compute the change of the position of an element under multiplication by a factor, given minus 1. */
export function addPositions(element, factor, added) {
  rotationAdds(1 + factor[0], factor, element).forEach((change, i) => {
    added[4 + i] = change + factor[4 + i];
  });
}
