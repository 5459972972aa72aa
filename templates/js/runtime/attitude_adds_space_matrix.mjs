import { matrixProduct } from "./attitude_matrices.mjs";

/** Compute what a factor, given less 1, adds to an element. */
export function turnAdds(element, factor, added) {
  matrixProduct(factor, element, added);
}
