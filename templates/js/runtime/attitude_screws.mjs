/** The change of the position in element when the quaternion (w, q[1], q[2], q[3]) rotates it. */
export function rotationAdds(w, q, element) {
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

/** Compute the position in the product of two group elements. */
export function multiplyPositions(a, b, product) {
  rotationAdds(a[0], a, b).forEach((change, i) => {
    product[4 + i] = change + a[4 + i] + b[4 + i];
  });
}
