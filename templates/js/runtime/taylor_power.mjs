/** a[0] times coefficient k >= 1 of the series b = a^r, from a b' = r a' b and earlier coefficients. */
export function taylorPower(a, b, r, k) {
  let sum = 0;
  for (let j = 1; j <= k; j++) sum += ((r + 1) * j - k) * a[j] * b[k - j];
  return sum / k;
}
