import { elementProduct } from "./attitude_quaternions.mjs";

/** Compute the product later · first: later rotations, in space coordinates, are factors on the left. */
export function multiplyAfter(first, later, product) {
  elementProduct(later, first, product);
}
