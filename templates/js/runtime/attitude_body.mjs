import { elementProduct } from "./attitude_quaternions.mjs";

/** Compute the product first · later: later rotations, in body coordinates, are factors on the right. */
export function multiplyAfter(first, later, product) {
  elementProduct(first, later, product);
}
