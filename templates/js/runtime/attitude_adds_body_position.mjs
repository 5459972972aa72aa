import { rotationAdds } from "./attitude_screws.mjs";

/** Compute what a factor, given less 1, adds to the position of an element. */
export function addPositions(element, factor, added) {
  rotationAdds(element[0], element, factor).forEach((change, i) => {
    added[4 + i] = change + factor[4 + i];
  });
}
