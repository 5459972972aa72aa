import { multiplyPositions } from "./attitude_screws.mjs";
import { ELEMENT } from "./model.mjs";

// ---- Attitude: quaternions ----

/** Compute the product of two quaternions. */
export function quaternionProduct(a, b, product) {
  product[0] = a[0] * b[0] - a[1] * b[1] - (a[2] * b[2] + a[3] * b[3]);
  product[1] = a[0] * b[1] + a[1] * b[0] + (a[2] * b[3] - a[3] * b[2]);
  product[2] = a[0] * b[2] + a[2] * b[0] + (a[3] * b[1] - a[1] * b[3]);
  product[3] = a[0] * b[3] + a[3] * b[0] + (a[1] * b[2] - a[2] * b[1]);
}

/** Compute the product of two group elements. */
export function elementProduct(a, b, product) {
  quaternionProduct(a, b, product);
  multiplyPositions(a, b, product);
}

/** Correct `carry` so that the length of q + `carry` is nearer to 1 than that of q. */
export function normalise(q, carry) {
  const excess = 0.5 * (q[0] * q[0] - 1 + q[1] * q[1] + (q[2] * q[2] + q[3] * q[3]));
  for (let i = 0; i < 4; i++) carry[i] -= excess * q[i];
}

/** The identity of the group. */
export function identityElement() {
  const one = new Float64Array(ELEMENT);
  one[0] = 1;
  return one;
}

/** Divide a quaternion by its length. It is divided by the largest magnitude first, which avoids overflow. */
export function makeUnit(element, largest) {
  for (let i = 0; i < 4; i++) element[i] /= largest;
  const length = Math.hypot(...element.subarray(0, 4));
  for (let i = 0; i < 4; i++) element[i] /= length;
}
