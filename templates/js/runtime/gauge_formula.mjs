import { GAUGE, products } from "./model.mjs";

// ---- The choice of the gauge: the factors of Casimirs in H - sum of gauge[c] C_c ----

/**
 * Return the gauge: for each Casimir C the factor g that minimises |grad H - g grad C| at x. Factors that are
 * not finite are replaced by 0.
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
