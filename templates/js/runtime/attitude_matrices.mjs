import { ELEMENT, ROWS } from "./model.mjs";
// #if EXPONENTIAL
import { COVECTOR, exponential } from "./model.mjs";
// #endif

// ---- Attitude: matrices ----

/** The product of two square matrices. */
function matrixProduct(a, b, product) {
  for (let i = 0; i < ROWS; i++) {
    for (let j = 0; j < ROWS; j++) {
      let sum = 0;
      for (let k = 0; k < ROWS; k++) sum += a[i * ROWS + k] * b[k * ROWS + j];
      product[i * ROWS + j] = sum;
    }
  }
}

// #if EXPONENTIAL
const smallCovector = new Float64Array(COVECTOR);
const squared = new Float64Array(ELEMENT);

/** exp(P) - 1 of a covector, which ends with a bound for the square of its size: P/2^k, doubled k times. */
export function fromCovector(covector, element) {
  let size = covector[COVECTOR - 1];
  let doublings = 0;
  for (; Number.isFinite(size) && size > 0.25; size *= 0.25) doublings++;
  for (let i = 0; i < COVECTOR; i++) smallCovector[i] = covector[i] * 0.5 ** doublings;
  exponential(smallCovector, element);
  for (; doublings > 0; doublings--) {
    matrixProduct(element, element, squared);
    for (let i = 0; i < ELEMENT; i++) element[i] = 2 * element[i] + squared[i];
    // #if NORMALISE
    squared.set(element); // rounding doubles as well: what it takes from orthogonality is put back
    for (let i = 0; i < ELEMENT; i += ROWS + 1) squared[i] += 1;
    normalise(squared, element);
    // #endif
  }
}

// #endif
/** The product of two elements. */
export function elementProduct(a, b, product) {
  matrixProduct(a, b, product);
}

/** What a factor, given less 1, adds to an element. */
export function turnAdds(element, factor, added) {
  // #if SPATIAL
  matrixProduct(factor, element, added);
  // #else
  matrixProduct(element, factor, added);
  // #endif
}

// #if NORMALISE
/** Bring a matrix that is nearly orthogonal nearer to that: G (G^T G - 1)/2 is taken from it. */
export function normalise(g, carry) {
  for (let i = 0; i < ROWS; i++) {
    for (let j = 0; j < ROWS; j++) {
      let excess = i === j ? -1 : 0;
      for (let k = 0; k < ROWS; k++) excess += g[k * ROWS + i] * g[k * ROWS + j];
      for (let k = 0; k < ROWS; k++) carry[k * ROWS + j] -= 0.5 * (g[k * ROWS + i] * excess);
    }
  }
}

// #endif
// #if RATE_OF_GAUGE
/** The element of the motion with a constant rate, for some time. */
export function uniformMotion(turning, t) {
  const element = new Float64Array(ELEMENT);
  const covector = turning.map((value) => t * value);
  covector[COVECTOR - 1] *= t;
  fromCovector(covector, element);
  for (let i = 0; i < ELEMENT; i += ROWS + 1) element[i] += 1;
  return element;
}
// #endif
