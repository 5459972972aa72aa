/** Coefficient k of the product of two Taylor series, whose coefficients are the entries of a and b. */
export function taylorProduct(a, b, k) {
  let sum = 0;
  for (let j = 0; j <= k; j++) sum += a[j] * b[k - j];
  return sum;
}
