import { GAUGE, products } from "./model.mjs";

// ---- The choice of the gauge: factors of Casimirs, whose multiples are subtracted from H ----

/**
 * The gauge: for each Casimir C the factor c that minimises |grad H - c grad C| at x. A factor that is not
 * finite becomes 0.
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
