import { rotationAdds } from "./attitude_screws.mjs";

/** Compute the change of the position of an element under multiplication by a factor, given minus 1. */
export function addPositions(element, factor, added) {
  rotationAdds(element[0], element, factor).forEach((change, i) => {
    added[4 + i] = change + factor[4 + i];
  });
}
