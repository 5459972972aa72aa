import { PROBE_STEP } from "./start_policy.mjs";
import { StepError, finite } from "./errors.mjs";
import { march } from "./march.mjs";
import { makeStage } from "./newton.mjs";
// #if HISTORY
import { History } from "./guess.mjs";
// #endif
import { chooseGauge } from "./gauge.mjs";
import { GAUGE } from "./model.mjs";
// #if MONITOR
import { rateAt } from "./level.mjs"; // and chooseGauge, in place of that of gauge.mjs
// #endif
import { CASIMIRS, COORDINATES, DEFAULT_PARAMETERS, DIM, NAME, ORDER } from "./model.mjs";
import { COEFFICIENTS, FRACTIONS, POSITIVE, SPEC_SHA256, VERSION } from "./model.mjs";
import { casimirs, energy, prepare, vectorField } from "./model.mjs";
// #if SPLITTING
import { TIMES } from "./model.mjs";
// #endif
// #if CORRECTED
import { BEGIN, END } from "./model.mjs";
// #endif
// #if RENEWED
import { MIDDLES, MOMENTS, PREPARED, refresh } from "./model.mjs";
// #endif
// #if OBSERVED
import { OBSERVABLES, observables } from "./model.mjs";
// #endif
// #if NOISE
import { DRAWS, SOURCES, noiseFields } from "./model.mjs";
import { draw } from "./noise.mjs";
import { drawsOf } from "./philox.mjs";
// #endif
// #if MODIFIED
import { modified } from "./model.mjs";
// #endif
// #if ATTITUDE
import { ATTITUDE } from "./model.mjs";
import { beginAttitude, currentElement, elementOf } from "./attitude.mjs";
// #endif
// #if TANGENT
import { tangentOf } from "./tangent.mjs";
// #endif

// ---- The solver ----

const number = new Float64Array(1);

/** Return a table of coefficients for each stage. */
function emptyTables() {
  // #if SPLITTING
  return [TIMES.map(() => new Float64Array(COEFFICIENTS))];
  // #else
  return FRACTIONS.map(() => new Float64Array(COEFFICIENTS));
  // #endif
}

/**
 * All parameters: those passed, else defaults. Throws StepError unless they are known and finite, positive if
 * they have to be, and give finite coefficients for a step so short that it has no part in it.
 */
function admitted(given) {
  const params = { ...DEFAULT_PARAMETERS, ...given };
  const unknown = Object.keys(given).filter((name) => !Object.hasOwn(DEFAULT_PARAMETERS, name));
  if (unknown.length) throw new StepError("BAD_ARGUMENT", 0, `there is no parameter ${unknown[0]}`);
  for (const [name, value] of Object.entries(params)) {
    const allowed = Number.isFinite(value) && (value > 0 || !POSITIVE.includes(name));
    if (!allowed) throw new StepError("BAD_ARGUMENT", 0, `the parameter ${name} is ${value}`);
    // #if NONNEGATIVE
    if (value < 0 && NONNEGATIVE.includes(name)) {
      throw new StepError("BAD_ARGUMENT", 0, `the parameter ${name} is ${value}`);
    }
    // #endif
  }
  const [table] = emptyTables();
  // #if GAUGE
  prepare(params, new Float64Array(GAUGE.length), PROBE_STEP, table);
  // #else
  prepare(params, PROBE_STEP, table);
  // #endif
  if (![table].flat().every((row) => row.every(Number.isFinite))) {
    throw new StepError("BAD_ARGUMENT", 0, "no step can be made with these parameters");
  }
  return Object.freeze(params);
}

/** A solver and the trajectory that it computes. */
export class Solver {
  static NAME = NAME;
  static VERSION = VERSION;
  static SPEC_SHA256 = SPEC_SHA256;
  static DIM = DIM;
  static ORDER = ORDER;
  static COORDINATES = COORDINATES;
  static CASIMIRS = CASIMIRS;
  // #if OBSERVED
  static OBSERVABLES = OBSERVABLES;
  // #endif
  static DEFAULT_PARAMETERS = DEFAULT_PARAMETERS;

  /** The state; change it by setState and kick only. */
  x;
  /** Rounding error of x (compensated summation): x + carry is more accurate. */
  carry = new Float64Array(DIM);
  // #if MONITOR
  /** Rounding error of t, the physical time since the start. Steps are equal in tau, not in t. */
  tCarry = 0;
  // #endif
  // #if TIMED
  /** The time of x. */
  t;
  // #else
  /** Time since the start. */
  t = 0;
  // #endif
  // #if NOISE
  /** The random numbers of a step are a function of these three and of the number of steps made before. */
  seed = 0;
  member = 0;
  step0 = 0;
  /** The increments of the noise in the last step. */
  dw = new Float64Array(DRAWS);
  // #endif
  /** Number of successful steps since the start. */
  steps = 0;
  /** Number of evaluations of the generating function, for statistics. */
  evaluations = 0;
  /** Size of the last step. */
  h = NaN;
  /** @type {Readonly<Parameters>} */
  params;
  // #if MONITOR
  /** Energy level e = -H(x0); K = monitor (H + e) is 0 along the trajectory. */
  gauge;
  // #else
  // #if GAUGE
  /** Factors of the Casimirs in GAUGE that are subtracted from H. */
  gauge;
  // #endif
  // #endif
  // #if RENEWED
  /** Coefficients of each stage: functions of parameters and step size, then of the time too. */
  // #else
  /** Coefficients of each stage: functions of parameters and step size. */
  // #endif
  coef = emptyTables();
  // #if HISTORY
  /** Predictor of each stage. */
  history = FRACTIONS.map(() => new History());
  // #endif
  // #if ATTITUDE
  /** The attitude that was set; the product of the rotations of all steps since then; its rounding error. */
  firstElement;
  turned;
  turnedCarry;
  // #if RATE_OF_GAUGE
  /** Gradient of the Casimirs subtracted from H, at which the body rotates too; the time when it was set. */
  turningRate;
  attitudeFrom;
  // #endif
  // #endif
  // #if !MONITOR
  /** Steps and time at the last change of h: the time is a multiple of h from there. */
  #stepsBefore = 0;
  #timeBefore = 0;
  // #endif

  /**
   * Start at x0. Throws StepError for arguments that are not admissible.
   *
   * @param {object} options
   * @param {ArrayLike<number>} options.x0 the coordinates, in the order of COORDINATES
   * @param {Partial<Parameters>} [options.params] parameters that differ from the defaults
   * #if NOISE
   * @param {number | bigint} [options.seed] seed of the random numbers, 64 bits, 0 by default
   * @param {number} [options.member] member of an ensemble, 32 bits, 0 by default
   * @param {number} [options.step0] number of steps made before x0, 0 by default
   * #endif
   * #if TIMED
   * @param {number} [options.t0] the time of x0, 0 by default
   * #endif
   * #if MONITOR
   * @param {ArrayLike<number>} [options.gauge] energy level e: the step is a Poisson map for each e
   * #else
   * #if GAUGE
   * @param {ArrayLike<number>} [options.gauge] multiples of one's own: the step is an exact Poisson map
   *   for each
   * #endif
   * #endif
   * #if ATTITUDE
   * @param {ArrayLike<number>} [options.attitude0] the attitude at x0, a quaternion (w, x, y, z) of any
   *   length, or a matrix row by row; the identity by default
   * #endif
   * #if POSITION
   * @param {ArrayLike<number>} [options.position0] the position, the origin by default
   * #endif
   */
  constructor(options) {
    this.x = finite(options.x0, DIM, "x0");
    this.params = admitted(options.params ?? {});
    // #if TIMED
    [this.t] = finite([options.t0 ?? 0], 1, "t0");
    // #endif
    // #if NOISE
    Object.assign(this, drawsOf(options));
    // #endif
    // #if GAUGE
    const { gauge } = options;
    this.gauge = gauge ? finite(gauge, GAUGE.length, "gauge") : chooseGauge(this.params, this.x);
    // #endif
    // #if MONITOR
    const rate = rateAt(this.params, this.x);
    if (!(Number.isFinite(rate) && rate > 0 && Number.isFinite(this.gauge[0]))) {
      throw new StepError("BAD_ARGUMENT", 0, `the monitor is ${rate} at x0`);
    }
    // #endif
    // #if ATTITUDE
    beginAttitude(this, elementOf(0, options.attitude0, options.position0));
    // #endif
  }

  // #if ATTITUDE
  /**
   * The attitude: a quaternion (w, x, y, z) that rotates body into space coordinates, or a matrix by
   * rows.
   */
  get attitude() {
    return currentElement(this).slice(0, ATTITUDE);
  }

  // #if POSITION
  /** The position of the body in space. */
  get position() {
    return currentElement(this).slice(ATTITUDE);
  }

  // #endif
  /**
   * Set the attitude. Throws StepError for values that are not admissible; then nothing changes.
   *
   * @param {ArrayLike<number>} attitude
   * #if POSITION
   * @param {ArrayLike<number>} [position] the origin by default
   * #endif
   * @returns {this}
   */
  setAttitude(attitude, position) {
    beginAttitude(this, elementOf(this.steps, finite(attitude, ATTITUDE, "the attitude"), position));
    return this;
  }
  // #endif

  /** Compute the coefficients for a step size, if it has changed. */
  #setStep(h) {
    if (!Number.isFinite(h)) throw new StepError("BAD_ARGUMENT", this.steps, `the step is ${h}`);
    if (Object.is(h, this.h)) return;
    FRACTIONS.forEach((fraction, stage) => {
      // #if GAUGE
      prepare(this.params, this.gauge, fraction * h, this.coef[stage]);
      // #else
      prepare(this.params, fraction * h, this.coef[stage]);
      // #endif
      // #if HISTORY
      this.history[stage].clear();
      // #endif
    });
    this.h = h;
    // #if !MONITOR
    this.#timeBefore = this.t;
    this.#stepsBefore = this.steps;
    // #endif
  }

  // #if RENEWED
  // #if NOISE
  /** Compute the coefficients that depend on the increments of the next step. */
  // #else
  /** Compute the coefficients that depend on the time of the next step. */
  // #endif
  #renew() {
    // #if SPLITTING
    // #if NOISE
    this.coef[0].forEach((row, k, rows) => {
      const late = k - (rows.length - DRAWS); // in the half after the flows of H
      const dw = [k < SOURCES.length ? this.dw[k] : late >= SOURCES.length ? this.dw[late] : 0];
      // #if TIMED
      refresh(row, this.t + MOMENTS[k] * this.h, dw, row.subarray(PREPARED));
      // #else
      refresh(row, dw, row.subarray(PREPARED));
      // #endif
    });
    // #else
    this.coef[0].forEach((row, k) => refresh(row, this.t + MOMENTS[k] * this.h, row.subarray(PREPARED)));
    // #endif
    // #else
    this.coef.forEach((coef, stage) => {
      // #if NOISE
      // #if TIMED
      refresh(coef, this.t + MIDDLES[stage] * this.h, this.dw, coef.subarray(PREPARED));
      // #else
      refresh(coef, this.dw, coef.subarray(PREPARED));
      // #endif
      // #else
      refresh(coef, this.t + MIDDLES[stage] * this.h, coef.subarray(PREPARED));
      // #endif
    });
    // #endif
  }

  // #endif
  /**
   * Make one step of size h, of either sign. Throws StepError; then the state is unchanged.
   *
   * @param {number} h
   * #if NOISE
   * @param {ArrayLike<number>} [dw] increments of the noise; random ones by default
   * #endif
   * @returns {this}
   */
  step(h) {
    // #if CORRECTED
    return this.integrate(h, 1);
  }

  /** One step between correctors. Throws StepError; then the state is as before. */
  #stepOfRun(h) {
    // #endif
    this.#setStep(h);
    // #if NOISE
    const [, dw] = arguments;
    if (!draw(this, dw)) throw new StepError("BAD_ARGUMENT", this.steps, `the increments are ${dw}`);
    // #endif
    // #if RENEWED
    this.#renew();
    // #endif
    // #if COMPOSED
    const x = Float64Array.from(this.x);
    const carry = Float64Array.from(this.carry);
    // #if MONITOR
    const { t, tCarry } = this;
    // #endif
    // #if ATTITUDE
    const turned = Float64Array.from(this.turned);
    const turnedCarry = Float64Array.from(this.turnedCarry);
    // #endif
    // #endif
    for (let stage = 0; stage < FRACTIONS.length; stage++) {
      const status = makeStage(this, stage);
      if (status === "OK") continue;
      // #if COMPOSED
      this.x.set(x);
      this.carry.set(carry);
      // #if MONITOR
      Object.assign(this, { t, tCarry });
      // #endif
      // #if ATTITUDE
      Object.assign(this, { turned, turnedCarry });
      // #endif
      // #endif
      throw new StepError(status, this.steps);
    }
    this.steps++;
    // #if !MONITOR
    this.t = this.#timeBefore + (this.steps - this.#stepsBefore) * h;
    // #endif
    return this;
  }

  /**
   * Make count steps. If one fails, throws StepError; x is the state before it, steps counts the
   * successful ones.
   *
   * @param {number} h
   * @param {number} count
   * @returns {this}
   */
  integrate(h, count) {
    this.#setStep(h);
    // #if CORRECTED
    const { steps, t } = this;
    const before = { x: Float64Array.from(this.x), carry: Float64Array.from(this.carry), steps, t };
    const begun = count > 0 ? makeStage(this, 0, BEGIN) : "OK";
    if (begun !== "OK") throw new StepError(begun, this.steps);
    try {
      march(this, h, count, () => this.#stepOfRun(h));
    } finally {
      this.#endRun(before);
    }
    return this;
    // #else
    return march(this, h, count);
    // #endif
  }

  // #if CORRECTED
  /** End a run. StepError where the corrector fails; then, or without a step, the state is as before. */
  #endRun(before) {
    const status = this.steps > before.steps ? makeStage(this, 0, END) : "";
    if (status === "OK") return;
    this.x.set(before.x);
    this.carry.set(before.carry);
    Object.assign(this, { steps: before.steps, t: before.t });
    if (status) throw new StepError(status, this.steps);
  }

  // #endif
  /**
   * Return an independent solver with the same state. Its predictors start anew.
   *
   * @returns {Solver}
   */
  copy() {
    const twin = new Solver({ ...this, x0: this.x });
    const { t, steps, evaluations } = this;
    Object.assign(twin, { t, steps, evaluations });
    // #state copied
    return twin;
  }

  // #if KICKED
  /**
   * Between steps: stand at x, with time, parameters and any gauge as they are. Throws StepError for what
   * is not allowed; then all is as before.
   *
   * @param {ArrayLike<number>} x it may lie off the leaf: the Casimirs are from then on those of x
   * @returns {this}
   */
  setState(x) {
    return this.#place(finite(x, DIM, "x"), new Float64Array(DIM));
  }

  /**
   * Between steps: add a change to the state, as an impulse does; else as setState.
   *
   * @param {ArrayLike<number>} change
   * @returns {this}
   */
  kick(change) {
    const to = finite(change, DIM, "the change");
    const carry = new Float64Array(DIM);
    to.forEach((by, i) => {
      const sum = this.x[i] + by;
      const added = sum - this.x[i];
      const lost = ((this.x[i] - (sum - added)) + (by - added)) + this.carry[i];
      to[i] = sum + lost;
      carry[i] = lost - (to[i] - sum);
    });
    return this.#place(finite(to, DIM, "the state"), carry);
  }

  /** Replace the state by x + carry. */
  #place(x, carry) {
    // #if MONITOR
    const [rate, level] = [rateAt(this.params, x), chooseGauge(this.params, x)];
    if (!(Number.isFinite(rate) && rate > 0 && Number.isFinite(level[0]))) {
      throw new StepError("BAD_ARGUMENT", this.steps, `the monitor is ${rate} there`);
    }
    this.gauge = level;
    if (Number.isFinite(this.h)) {
      FRACTIONS.forEach((fraction, stage) => {
        prepare(this.params, level, fraction * this.h, this.coef[stage]);
      });
    }
    // #endif
    // #if HISTORY
    for (const history of this.history) history.move(this.x, x);
    // #endif
    // #if RATE_OF_GAUGE
    const element = currentElement(this);
    // #endif
    this.x.set(x);
    this.carry.set(carry);
    // #if RATE_OF_GAUGE
    beginAttitude(this, elementOf(this.steps, element.subarray(0, ATTITUDE), element.subarray(ATTITUDE)));
    // #endif
    return this;
  }

  // #endif
  // #if TANGENT
  /**
   * One step as `step` makes it, and its derivative, to round-off, with any gauge held fixed. Throws
   * StepError; then the state is as before.
   *
   * @param {number} h
   * @returns {Float64Array} entry i * DIM + j is the derivative of the new x[i] along the old x[j]
   */
  stepTangent(h) {
    const { t, steps } = this;
    // #if MONITOR
    const { tCarry } = this;
    // #endif
    const before = { x: Float64Array.from(this.x), carry: Float64Array.from(this.carry) };
    const at = { x: Float64Array.from(this.x), carry: Float64Array.from(this.carry) };
    // #if GAUSS
    at.t = t;
    // #endif
    // #if ATTITUDE
    const turned = Float64Array.from(this.turned);
    const turnedCarry = Float64Array.from(this.turnedCarry);
    // #endif
    this.step(h);
    const { status, tangent } = tangentOf(this, at);
    if (status === "OK") return tangent;
    this.x.set(before.x);
    this.carry.set(before.carry);
    // #if ATTITUDE
    Object.assign(this, { turned, turnedCarry });
    // #endif
    // #if MONITOR
    this.tCarry = tCarry;
    // #endif
    Object.assign(this, { t, steps, h: NaN }); // what h prepared counts from the step taken back
    throw new StepError(status, steps);
  }

  // #endif
  // #if ENSEMBLE
  /**
   * Many steps of many states, each of which has its own gauge. One that fails keeps its last good state. h
   * and what is in options may be arrays in place of numbers, with one for each member.
   *
   * @param {Iterable<ArrayLike<number>>} members
   * @param {number | ArrayLike<number>} h
   * @param {number} count
   * #if TIMED
   * @param {{params?: object, t0?: number | ArrayLike<number>}} [options] as in the constructor
   * #else
   * @param {{params?: object}} [options] as in the constructor
   * #endif
   * #if NOISE
   * also seed, step0, and member, that of the first member
   * #endif
   * @returns {{x: Float64Array[], status: string[]}} the last state of each member, and "OK" or a status
   */
  static ensemble(members, h, count, options = {}) {
    const ends = Array.from(members, (x0, m) => {
      const own = (value) => (typeof value === "object" && value !== null ? value[m] : value);
      const given = Object.entries(options.params ?? {}).map(([name, value]) => [name, own(value)]);
      const chosen = { ...options, params: Object.fromEntries(given), t0: own(options.t0), x0 };
      // #if NOISE
      chosen.member = (options.member ?? 0) + m;
      // #endif
      let end = Float64Array.from(x0);
      try {
        const solver = new Solver(chosen);
        end = solver.x;
        solver.integrate(own(h), count);
        return { end, status: "OK" };
      } catch (error) {
        if (!(error instanceof StepError)) throw error;
        return { end, status: error.status };
      }
    });
    return { x: ends.map(({ end }) => end), status: ends.map(({ status }) => status) };
  }

  // #endif
  // #if TIMED
  /** The Hamiltonian, at x and its time or elsewhere. */
  hamiltonian(x = this.x, t = this.t) {
    energy(this.params, t, x, number);
    return number[0];
  }
  // #else
  /** The Hamiltonian, at x or elsewhere. */
  hamiltonian(x = this.x) {
    energy(this.params, x, number);
    return number[0];
  }
  // #endif

  // #if MODIFIED
  /** The Hamiltonian whose flow a step of size h is, up to O(h^MODIFIED_POWER), at x or elsewhere. */
  // #if TIMED
  modifiedHamiltonian(h, x = this.x, t = this.t) {
    modified(this.params, h, t, x, number);
    return number[0];
  }
  // #else
  modifiedHamiltonian(h, x = this.x) {
    // #if GAUGE
    modified(this.params, this.gauge, h, x, number);
    // #else
    modified(this.params, h, x, number);
    // #endif
    return number[0];
  }
  // #endif

  // #endif
  /** The Casimirs, in the order of CASIMIRS. */
  casimirs(x = this.x) {
    const out = new Float64Array(CASIMIRS.length);
    casimirs(this.params, x, out);
    return out;
  }

  // #if OBSERVED
  /** The observables, in the order of OBSERVABLES. */
  // #if TIMED
  observables(x = this.x, t = this.t) {
    const out = new Float64Array(OBSERVABLES.length);
    observables(this.params, t, x, out);
    return out;
  }
  // #else
  observables(x = this.x) {
    const out = new Float64Array(OBSERVABLES.length);
    observables(this.params, x, out);
    return out;
  }
  // #endif

  // #endif
  // #if NOISE
  /** sigma pi(x) grad g(x) of each source of noise, one after the other. */
  // #if TIMED
  noiseFields(x = this.x, t = this.t) {
    const out = new Float64Array(SOURCES.length * DIM);
    noiseFields(this.params, t, x, out);
    return out;
  }
  // #else
  noiseFields(x = this.x) {
    const out = new Float64Array(SOURCES.length * DIM);
    noiseFields(this.params, x, out);
    return out;
  }
  // #endif

  // #endif
  // #if TIMED
  /** The vector field dx/dt at a state and a time. */
  vectorField(x = this.x, t = this.t) {
    const out = new Float64Array(DIM);
    vectorField(this.params, t, x, out);
    return out;
  }
  // #else
  /** The vector field dx/dt at a state. */
  vectorField(x = this.x) {
    const out = new Float64Array(DIM);
    vectorField(this.params, x, out);
    return out;
  }
  // #endif
}
