import { matrixProduct } from "./attitude_matrices.mjs";

/** Compute the change of an element under multiplication by a factor, given minus 1. */
export function turnAdds(element, factor, added) {
  matrixProduct(element, factor, added);
}
