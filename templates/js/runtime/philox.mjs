import { StepError } from "./errors.mjs";
import { BOUND } from "./model.mjs";

// ---- Random numbers ----

/** The upper 32 bits of the product of two numbers of 32 bits. */
function upper(a, b) {
  const [low, high] = [b & 0xffff, b >>> 16];
  const middle = (a >>> 16) * low + Math.floor(((a & 0xffff) * low) / 65536);
  const other = (a & 0xffff) * high + (middle % 65536);
  return (a >>> 16) * high + Math.floor(middle / 65536) + Math.floor(other / 65536);
}

/**
 * Philox4x32-10 of J. Salmon, M. Moraes, R. Dror, D. Shaw, Parallel random numbers: as easy as 1, 2, 3
 * (2011). Returns four random words, as a function of a counter of four words and a key of two words.
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

/** A number in [0, 1), from 53 bits of two random words of 32 bits. */
function unit(high, low) {
  return ((high >>> 5) * 67108864 + (low >>> 6)) * 2 ** -53;
}

/** The lower and the upper 32 bits of a number of 64 bits. */
export function words(number) {
  const bits = BigInt.asUintN(64, BigInt(number));
  return [Number(bits & 0xffffffffn), Number(bits >> 32n)];
}

/** Return two standard normal variates by the method of Box and Muller, truncated at magnitude BOUND. */
export function twoNormals(counter, key) {
  const [a, b, c, d] = philox(counter, key);
  const radius = Math.min(Math.sqrt(-2 * Math.log(unit(a, b) + 2 ** -54)), BOUND);
  const angle = 6.283185307179586 * unit(c, d);
  return [radius * Math.cos(angle), radius * Math.sin(angle)];
}

/**
 * Return seed, member and step0 from the options of a solver; random numbers depend on them. Throws StepError
 * if a value is not admissible.
 */
export function drawsOf({ seed = 0, member = 0, step0 = 0 }) {
  for (const [name, value] of Object.entries({ seed, member, step0 })) {
    if (!((Number.isInteger(value) || typeof value === "bigint") && value >= 0)) {
      throw new StepError("BAD_ARGUMENT", 0, `${name} is ${value}, not 0, 1, 2, …`);
    }
  }
  return { seed, member, step0 };
}

/** Set seed, member and step0 of a solver from its options. */
export function takeDraws(solver, options) {
  Object.assign(solver, drawsOf(options));
}
