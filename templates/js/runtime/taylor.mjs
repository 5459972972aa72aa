// ---- Coefficients of Taylor series ----

// #if TAYLOR_PRODUCT
/** Coefficient k of the product of two series. */
export function taylorProduct(a, b, k) {
  let sum = 0;
  for (let j = 0; j <= k; j++) sum += a[j] * b[k - j];
  return sum;
}

// #endif
// #if TAYLOR_CHAIN
/** Coefficient k >= 1 of the series of f(a), where d is that of f'(a): f(a)' = f'(a) a'. */
export function taylorChain(a, d, k) {
  let sum = 0;
  for (let j = 1; j <= k; j++) sum += j * a[j] * d[k - j];
  return sum / k;
}

// #endif
// #if TAYLOR_POWER
/** Coefficient k >= 1 of the series of b = a^r, times a[0]: a b' = r a' b. */
export function taylorPower(a, b, r, k) {
  let sum = 0;
  for (let j = 1; j <= k; j++) sum += ((r + 1) * j - k) * a[j] * b[k - j];
  return sum / k;
}

// #endif
