import { BOUND, DRAWS, PARTS } from "./model.mjs";

// ---- Noise ----

/** The upper 32 bits of the product of two numbers of 32 bits. */
function upper(a, b) {
  const [low, high] = [b & 0xffff, b >>> 16];
  const middle = (a >>> 16) * low + Math.floor(((a & 0xffff) * low) / 65536);
  const other = (a & 0xffff) * high + (middle % 65536);
  return (a >>> 16) * high + Math.floor(middle / 65536) + Math.floor(other / 65536);
}

/**
 * Philox4x32-10 of J. Salmon, M. Moraes, R. Dror, D. Shaw, Parallel random numbers: as easy as 1, 2, 3
 * (2011): four random words from a counter of four.
 */
function philox(counter, key) {
  let [a, b, c, d] = counter;
  let [first, second] = key;
  for (let round = 0; round < 10; round++) {
    const [even, odd] = [upper(0xd2511f53, a), upper(0xcd9e8d57, c)];
    const [low, high] = [Math.imul(0xd2511f53, a), Math.imul(0xcd9e8d57, c)];
    [a, b, c, d] = [(odd ^ b ^ first) >>> 0, high >>> 0, (even ^ d ^ second) >>> 0, low >>> 0];
    first = (first + 0x9e3779b9) >>> 0;
    second = (second + 0xbb67ae85) >>> 0;
  }
  return [a, b, c, d];
}

/** A number from 0 up to, but not including, 1, of 53 of the bits of two words. */
function unit(high, low) {
  return ((high >>> 5) * 67108864 + (low >>> 6)) * 2 ** -53;
}

/** The two words of a number of 64 bits. */
function words(number) {
  const bits = BigInt.asUintN(64, BigInt(number));
  return [Number(bits & 0xffffffffn), Number(bits >> 32n)];
}

/** Normal variates of variance 1, in pairs by Box and Muller, cut off at BOUND: all increments of a step. */
function normals(seed, member, step, values) {
  const [low, high] = words(step);
  for (let k = 0; k < DRAWS; k += 2) {
    const [a, b, c, d] = philox([low, high, member, k / 2], words(seed));
    const radius = Math.min(Math.sqrt(-2 * Math.log(unit(a, b) + 2 ** -54)), BOUND);
    const angle = 6.283185307179586 * unit(c, d);
    values[k] = radius * Math.cos(angle);
    if (k + 1 < DRAWS) values[k + 1] = radius * Math.sin(angle);
  }
}

/**
 * The increments of the next step: those given, or random ones.
 *
 * @returns {boolean} false if one is not finite, or some are missing
 */
export function draw(solver, given) {
  const { dw, seed, member, step0, steps, h } = solver;
  if (given) {
    if (given.length !== DRAWS) return false;
    dw.set(given);
  } else {
    normals(seed, member, BigInt(step0) + BigInt(steps), dw);
    const size = Math.sign(h) * Math.sqrt(Math.abs(h) / PARTS); // so that a step of -h undoes one of h
    for (let k = 0; k < DRAWS; k++) dw[k] *= size;
    // #if SPLITTING
    if (h < 0) dw.set([...dw.subarray(DRAWS / 2), ...dw.subarray(0, DRAWS / 2)]); // the last come first
    // #endif
  }
  return dw.every(Number.isFinite);
}
