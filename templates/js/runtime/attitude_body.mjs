import { elementProduct } from "./attitude_quaternions.mjs";

/** The product of an element and a later one, of rotations in body coordinates. */
export function multiplyAfter(first, later, product) {
  elementProduct(first, later, product);
}
