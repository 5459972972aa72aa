import { makeOrthogonal } from "./attitude_orthogonal.mjs";
import { matrixProduct } from "./attitude_matrices.mjs";
import { COVECTOR, ELEMENT, exponential } from "./model.mjs";

const smallCovector = new Float64Array(COVECTOR);
const squared = new Float64Array(ELEMENT);

/**
 * Compute exp(P) - 1, where the numbers covector define the matrix P: exp(P/2^k) is squared k times. The
 * last of these numbers bounds the square of the norm of P. Each squaring doubles rounding errors, so
 * orthogonal matrices are made orthogonal again after it.
 */
export function fromCovector(covector, element) {
  let size = covector[COVECTOR - 1];
  let doublings = 0;
  for (; Number.isFinite(size) && size > 0.25; size *= 0.25) doublings++;
  for (let i = 0; i < COVECTOR; i++) smallCovector[i] = covector[i] * 0.5 ** doublings;
  exponential(smallCovector, element);
  for (; doublings > 0; doublings--) {
    matrixProduct(element, element, squared);
    for (let i = 0; i < ELEMENT; i++) element[i] = 2 * element[i] + squared[i];
    makeOrthogonal(element);
  }
}
