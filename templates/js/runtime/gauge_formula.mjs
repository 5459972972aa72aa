import { GAUGE, products } from "./model.mjs";

// ---- The choice of the gauge: multiples of Casimirs subtracted from H ----

/**
 * For each Casimir C the multiple c that minimises |grad H - c grad C| at the initial state; zero where it is
 * not finite.
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
