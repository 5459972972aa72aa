import { fromCovector } from "./attitude_exponential.mjs";
import { COVECTOR, ELEMENT, ROWS } from "./model.mjs";

/** The group element of a motion for the time t with the constant rate turning, which defines a matrix. */
export function uniformMotion(turning, t) {
  const element = new Float64Array(ELEMENT);
  const covector = turning.map((value) => t * value);
  covector[COVECTOR - 1] *= t;
  fromCovector(covector, element);
  for (let i = 0; i < ELEMENT; i += ROWS + 1) element[i] += 1;
  return element;
}
