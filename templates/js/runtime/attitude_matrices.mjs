import { ELEMENT, ROWS } from "./model.mjs";

// ---- Attitude: matrices ----

/** Compute the product of two square matrices. */
export function matrixProduct(a, b, product) {
  for (let i = 0; i < ROWS; i++) {
    for (let j = 0; j < ROWS; j++) {
      let sum = 0;
      for (let k = 0; k < ROWS; k++) sum += a[i * ROWS + k] * b[k * ROWS + j];
      product[i * ROWS + j] = sum;
    }
  }
}

/** Compute the product of two group elements. */
export function elementProduct(a, b, product) {
  matrixProduct(a, b, product);
}

/** The identity matrix, row by row. */
export function identityElement() {
  const one = new Float64Array(ELEMENT);
  for (let i = 0; i < ELEMENT; i += ROWS + 1) one[i] = 1;
  return one;
}
