import { matrixProduct } from "./attitude_matrices.mjs";

/** Compute the change of an element by multiplication by 1 + factor from the right. */
export function turnAdds(element, factor, added) {
  matrixProduct(element, factor, added);
}
