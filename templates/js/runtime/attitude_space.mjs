import { elementProduct } from "./attitude_quaternions.mjs";

/** The product of an element and a later one, of rotations in space coordinates. */
export function multiplyAfter(first, later, product) {
  elementProduct(later, first, product);
}
