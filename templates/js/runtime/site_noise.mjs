import { StepError } from "./errors.mjs";
import { PARTS, SOURCES } from "./model.mjs";
import { twoNormals, words } from "./philox.mjs";

// ---- Noise at sites ----

/**
 * Compute the increments of the noise at all sites, in a part of the next step. They are a function of seed,
 * member, step, part and site only. A step of -h has them in reverse order, so that it inverts a step of h.
 */
export function drawAtSites(solver, part) {
  const { seed, member, step0, steps, h, sites } = solver;
  const { count, dw } = sites;
  const [low, high] = words(BigInt(step0) + BigInt(steps));
  const key = words(seed);
  const pairs = Math.ceil(SOURCES.length / 2);
  const first = pairs * (h < 0 ? PARTS - 1 - part : part);
  const size = Math.sign(h) * Math.sqrt(Math.abs(h) / PARTS);
  for (let pair = 0; pair < pairs; pair++) {
    const beside = (high | ((first + pair) << 16)) >>> 0;
    for (let site = 0; site < count; site++) {
      const [one, other] = twoNormals([low, beside, member, site], key);
      dw[2 * pair * count + site] = size * one;
      if (2 * pair + 1 < SOURCES.length) dw[(2 * pair + 1) * count + site] = size * other;
    }
  }
}

/** Throw StepError unless step0 fits its field of 48 bits in the counter of the random numbers. */
export function expectFewSteps({ step0 }) {
  if (step0 >= 2 ** 48) throw new StepError("BAD_ARGUMENT", 0, `step0 is ${step0}, not below 2^48`);
}
