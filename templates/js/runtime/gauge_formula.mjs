import { GAUGE, products } from "./model.mjs";

// ---- The choice of the gauge: multiples of Casimirs taken from H ----

/**
 * For each Casimir C the multiple by which grad H less it times grad C is smallest at the start; zero where
 * that gives nothing finite.
 *
 * @param {Parameters} params
 * @param {ArrayLike<number>} x
 * @returns {Float64Array}
 */
export function chooseGauge(params, x) {
  const out = new Float64Array(1 + 2 * GAUGE.length);
  products(params, x, out);
  const gauge = GAUGE.map((_, c) => out[1 + 2 * c] / out[2 + 2 * c]);
  return Float64Array.from(gauge, (multiple) => (Number.isFinite(multiple) ? multiple : 0));
}
