/**
 * Divide the quaternion 1 + q by its length; q is overwritten. If its real part is negative, its sign is
 * changed first, which leaves its rotation unchanged. Otherwise later corrections of the length would have
 * the wrong sign.
 */
export function shorten(q) {
  if (q[0] < -1) {
    q[0] = -2 - q[0];
    for (let i = 1; i < 4; i++) q[i] = -q[i];
  }
  const excess = q[0] * (2 + q[0]) + q[1] * q[1] + (q[2] * q[2] + q[3] * q[3]);
  const length = Math.sqrt(1 + excess);
  q[0] = (q[0] - excess / (1 + length)) / length;
  for (let i = 1; i < 4; i++) q[i] /= length;
}
