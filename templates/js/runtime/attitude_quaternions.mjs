// #if RATE_OF_GAUGE
import { ELEMENT } from "./model.mjs";
// #endif

// ---- Attitude: quaternions ----

/** The product of two quaternions. */
function quaternionProduct(a, b, product) {
  product[0] = a[0] * b[0] - a[1] * b[1] - (a[2] * b[2] + a[3] * b[3]);
  product[1] = a[0] * b[1] + a[1] * b[0] + (a[2] * b[3] - a[3] * b[2]);
  product[2] = a[0] * b[2] + a[2] * b[0] + (a[3] * b[1] - a[1] * b[3]);
  product[3] = a[0] * b[3] + a[3] * b[0] + (a[1] * b[2] - a[2] * b[1]);
}

// #if POSITION
/** What rotating the vector at the end of an element by a quaternion, of which one is less, adds to it. */
function rotationAdds(w, q, element) {
  const [v1, v2, v3] = element.subarray(4);
  const x = q[2] * v3 - q[3] * v2;
  const y = q[3] * v1 - q[1] * v3;
  const z = q[1] * v2 - q[2] * v1;
  return [
    2 * (w * x + (q[2] * z - q[3] * y)),
    2 * (w * y + (q[3] * x - q[1] * z)),
    2 * (w * z + (q[1] * y - q[2] * x)),
  ];
}

// #endif
/** The product of two elements. */
export function elementProduct(a, b, product) {
  quaternionProduct(a, b, product);
  // #if POSITION
  rotationAdds(a[0], a, b).forEach((change, i) => {
    product[4 + i] = change + a[4 + i] + b[4 + i];
  });
  // #endif
}

/** What a factor, given less 1, adds to an element. */
export function turnAdds(element, factor, added) {
  // #if SPATIAL
  quaternionProduct(factor, element, added);
  // #else
  quaternionProduct(element, factor, added);
  // #endif
  // #if POSITION
  let rotated;
  // #if SPATIAL
  rotated = rotationAdds(1 + factor[0], factor, element);
  // #else
  rotated = rotationAdds(element[0], element, factor);
  // #endif
  rotated.forEach((change, i) => {
    added[4 + i] = change + factor[4 + i];
  });
  // #endif
}

// #if LENGTHENED
/** Divide a quaternion, given less 1, by its length. */
export function shorten(q) {
  const excess = q[0] * (2 + q[0]) + q[1] * q[1] + (q[2] * q[2] + q[3] * q[3]);
  const length = Math.sqrt(1 + excess);
  q[0] = (q[0] - excess / (1 + length)) / length;
  for (let i = 1; i < 4; i++) q[i] /= length;
}

// #endif
/** Bring the length of a quaternion nearer to 1. */
export function normalise(q, carry) {
  const excess = 0.5 * (q[0] * q[0] - 1 + q[1] * q[1] + (q[2] * q[2] + q[3] * q[3]));
  for (let i = 0; i < 4; i++) carry[i] -= excess * q[i];
}

// #if RATE_OF_GAUGE
/** The element of the motion with a constant rate, for some time. */
export function uniformMotion(turning, t) {
  const element = new Float64Array(ELEMENT);
  const [a, b, c] = turning;
  const speed = Math.sqrt(a * a + (b * b + c * c));
  const scale = speed > 0 ? Math.sin(0.5 * t * speed) / speed : 0;
  element.set([Math.cos(0.5 * t * speed), scale * a, scale * b, scale * c]);
  // #if POSITION
  const [u, v, w] = turning.subarray(3);
  const sine = speed > 0 ? Math.sin(t * speed) / speed : t;
  const versine = 2 * scale * scale;
  const rest = speed > 0 ? ((t - sine) / (speed * speed)) * (a * u + b * v + c * w) : 0;
  element[4] = sine * u + versine * (b * w - c * v) + rest * a;
  element[5] = sine * v + versine * (c * u - a * w) + rest * b;
  element[6] = sine * w + versine * (a * v - b * u) + rest * c;
  // #endif
  return element;
}
// #endif
