import { matrixProduct } from "./attitude_matrices.mjs";

/** Compute the change of a group element when it is multiplied by 1 + factor from the right. */
export function turnAdds(element, factor, added) {
  matrixProduct(element, factor, added);
}
