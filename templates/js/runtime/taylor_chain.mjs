/** Coefficient k >= 1 of the Taylor series of f(a), from f(a)' = f'(a) a'; a, d: coefficients of a, f'(a). */
export function taylorChain(a, d, k) {
  let sum = 0;
  for (let j = 1; j <= k; j++) sum += j * a[j] * d[k - j];
  return sum / k;
}
