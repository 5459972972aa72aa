import { StepError } from "./errors.mjs";
import { orderDraws } from "./noise_of_flows.mjs";
import { DRAWS, PARTS } from "./model.mjs";
import { twoNormals, words } from "./philox.mjs";

// ---- Noise ----

/** Compute the random numbers of a step: independent normal variates of mean 0 and variance 1. */
function normals(seed, member, step, values) {
  const [low, high] = words(step);
  for (let k = 0; k < DRAWS; k += 2) {
    const pair = twoNormals([low, high, member, k / 2], words(seed));
    values.set(pair.slice(0, DRAWS - k), k);
  }
}

/**
 * Set the increments of the noise in the next step to `increments`. If this is undefined, they are random.
 *
 * @returns {boolean} false unless `increments` has DRAWS numbers, and all are finite
 */
function draw(solver, increments) {
  const { dw, seed, member, step0, steps, h } = solver;
  if (increments) {
    if (increments.length !== DRAWS) return false;
    dw.set(increments);
  } else {
    normals(seed, member, BigInt(step0) + BigInt(steps), dw);
    const size = Math.sign(h) * Math.sqrt(Math.abs(h) / PARTS); // a step of -h inverts a step of h
    for (let k = 0; k < DRAWS; k++) dw[k] *= size;
    orderDraws(dw, h);
  }
  return dw.every(Number.isFinite);
}

/** Set the increments of the noise in the next step. Throws StepError if `increments` is not admissible. */
export function drawStep(solver, increments) {
  if (draw(solver, increments)) return;
  const message = `${DRAWS} finite increments are needed, not ${increments}`;
  throw new StepError("BAD_ARGUMENT", solver.steps, message);
}
