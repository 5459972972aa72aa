import { rotationAdds } from "./attitude_screws.mjs";

/** Compute what a factor, given less 1, adds to the position of an element. */
export function addPositions(element, factor, added) {
  rotationAdds(1 + factor[0], factor, element).forEach((change, i) => {
    added[4 + i] = change + factor[4 + i];
  });
}
