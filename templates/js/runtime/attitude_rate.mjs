import { moveUniformly } from "./attitude_rate_position.mjs";
import { ELEMENT } from "./model.mjs";

/** The group element of a motion for the time t with the constant rotation rate turning. */
export function uniformMotion(turning, t) {
  const element = new Float64Array(ELEMENT);
  const [a, b, c] = turning;
  const speed = Math.sqrt(a * a + (b * b + c * c));
  const scale = speed > 0 ? Math.sin(0.5 * t * speed) / speed : 0;
  element.set([Math.cos(0.5 * t * speed), scale * a, scale * b, scale * c]);
  moveUniformly(element, turning, t, speed, scale);
  return element;
}
