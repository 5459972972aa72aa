/** Compute the displacement in element by a rotation rate and a velocity that are constant for the time t. */
export function moveUniformly(element, turning, t, speed, scale) {
  const [a, b, c, u, v, w] = turning;
  const sine = speed > 0 ? Math.sin(t * speed) / speed : t;
  const versine = 2 * scale * scale;
  const rest = speed > 0 ? ((t - sine) / (speed * speed)) * (a * u + b * v + c * w) : 0;
  element[4] = sine * u + versine * (b * w - c * v) + rest * a;
  element[5] = sine * v + versine * (c * u - a * w) + rest * b;
  element[6] = sine * w + versine * (a * v - b * u) + rest * c;
}
