import { TINY } from "./linear.mjs";
import { CLOSE_CALL, DEGREE, FIRST_REACH, GRIDS, MESH, SAMPLES } from "./gauge_search.mjs";
import { REACH_OF_GRID, SAMPLE_LENGTH, SWEEPS } from "./gauge_search.mjs";
import { DIM, GAUGE, guide, products, vectorField } from "./model.mjs";

// ---- The choice of the gauge: the factors of Casimirs in H - sum of gauge[c] C_c ----

/** The vector field at a point, divided by the sum of its |components|; 0 at equilibria. */
function direction(params, at) {
  const slope = new Float64Array(DIM);
  vectorField(params, at, slope);
  const speed = total(slope) + TINY;
  return slope.map((value) => value / speed);
}

/** The sum of the magnitudes of values. */
function total(values) {
  return values.reduce((sum, value) => sum + Math.abs(value), 0);
}

/**
 * Return states on a short piece of the trajectory from x, by a Runge-Kutta method. Its steps have equal
 * lengths in phase space, so the piece has the same length for slow and fast motions.
 */
function sampled(params, x) {
  const states = [Float64Array.from(x)];
  const length = SAMPLE_LENGTH * total(states[0]);
  while (states.length < SAMPLES) {
    const y = states[states.length - 1];
    const first = direction(params, y);
    const middle = direction(params, y.map((value, i) => value + 0.5 * length * first[i]));
    states.push(y.map((value, i) => value + length * middle[i]));
  }
  return states;
}

/**
 * The sum of |pi grad S_3|^2 over the samples. h^3 pi grad S_3 is the leading error of a step of order 2. At
 * higher orders, too, a small |pi grad S_3| usually means a small error.
 */
function gaugeError(params, gauge, samples) {
  const error = new Float64Array(DIM);
  let sum = 0;
  for (const state of samples) {
    guide(params, gauge, state, error);
    for (const part of error) sum += part * part;
  }
  return sum;
}

/**
 * Value of the error if gauge[c] is increased by t * width (see leastOnLine). The error is a polynomial in t
 * of degree DEGREE, given by its forward differences.
 */
function errorOnLine(difference, t) {
  let error = difference[DEGREE];
  for (let k = DEGREE - 1; k >= 0; k--) error = difference[k] + ((t + DEGREE / 2 - k) / (k + 1)) * error;
  return error;
}

/**
 * Return the change of gauge[c] that minimises the error, as a multiple of `width`. The minimum is searched
 * for on a grid, and then on finer grids around the best point.
 */
function leastOnLine(params, gauge, c, width, samples) {
  const errors = [];
  for (let j = 0; j <= DEGREE; j++) {
    const nearby = Float64Array.from(gauge);
    nearby[c] = gauge[c] + (j - DEGREE / 2) * width;
    errors.push(gaugeError(params, nearby, samples));
  }
  const size = errors.reduce((sum, error) => sum + error, 0);
  for (let order = 1; order <= DEGREE; order++) {
    for (let j = DEGREE; j >= order; j--) errors[j] -= errors[j - 1];
  }
  let best = 0;
  let least = errorOnLine(errors, best);
  for (let grid = 0, mesh = MESH; grid < GRIDS; grid++, mesh *= MESH) {
    const reach = grid === 0 ? FIRST_REACH : REACH_OF_GRID;
    const centre = best;
    for (let j = -reach; j <= reach; j++) {
      const t = centre + j * mesh;
      const error = errorOnLine(errors, t);
      if (!(error < least - CLOSE_CALL * size)) continue;
      least = error;
      best = t;
    }
  }
  return best;
}

/**
 * Return the gauge: factors of the Casimirs C_c that minimise gaugeError on a short piece of the trajectory
 * from x. The search starts from the factors with the least |grad H - gauge[c] grad C_c|, and then optimises
 * one factor after the other. If the resulting error is not finite, all factors are 0.
 *
 * @param {Parameters} params
 * @param {ArrayLike<number>} x
 * @returns {Float64Array}
 */
export function chooseGauge(params, x) {
  const samples = sampled(params, x);
  const sums = new Float64Array(1 + 2 * GAUGE.length);
  const out = new Float64Array(sums.length);
  for (const state of samples) {
    products(params, state, out);
    for (let i = 0; i < sums.length; i++) sums[i] += out[i];
  }
  const norms = GAUGE.map((_, c) => (sums[2 + 2 * c] > 0 ? sums[2 + 2 * c] : Infinity));
  const gauge = Float64Array.from(norms, (norm, c) => sums[1 + 2 * c] / norm);
  const widths = norms.map((norm) => Math.sqrt(sums[0] / norm));
  for (let sweep = 0, moving = true; sweep < SWEEPS && moving; sweep++) {
    moving = false;
    for (let c = 0; c < gauge.length; c++) {
      const best = leastOnLine(params, gauge, c, widths[c], samples);
      gauge[c] += best * widths[c];
      moving = moving || best !== 0;
    }
  }
  return Number.isFinite(gaugeError(params, gauge, samples)) ? gauge : new Float64Array(gauge.length);
}
