import { COEFFICIENTS, NEGATIVE, TANGENTS, part1Slope, part2Slope } from "./model.mjs";
import { totalOf } from "./site_level.mjs";
import { prepareRow } from "./rows_delayed.mjs";

/**
 * Multiply tangent vectors by the derivative of a flow over the time tau / rate; rate depends on the state.
 */
export function carryVectors({ params, sites, x, vectors }, part, time, rate) {
  const coef = new Float64Array(COEFFICIENTS);
  for (const v of vectors) {
    const slope = totalOf([part1Slope, part2Slope][part], params, sites, x, v);
    prepareRow(params, 1, time, coef, 0, ((part === NEGATIVE ? slope : -slope) * time) / rate);
    for (const sweep of TANGENTS[part]) sweep(coef, x, v, sites);
  }
}
