import { StepError, expectOptions, finite } from "./errors.mjs";
import { march } from "./march.mjs";
import { makeStage } from "./newton.mjs";
import { emptyTables } from "./tables_stages.mjs";
import { prepareProbe, prepareStage } from "./prepare_plain.mjs";
import { restoreState, savedState } from "./saving.mjs";
import { energyAt, vectorFieldAt } from "./autonomous.mjs";
import { BEGIN, CASIMIRS, COORDINATES, DEFAULT_PARAMETERS, DIM, END, FRACTIONS } from "./model.mjs";
import { NAME, ORDER, POSITIVE, SPEC_SHA256, VERSION, casimirs } from "./model.mjs";
import { clearHistory } from "./history.mjs";
import { expectNonnegative } from "./nonnegative.mjs";
import { drawStep } from "./noise.mjs";
import { takeDraws } from "./philox.mjs";
import { takeTime } from "./timed.mjs";
import { takeGauge } from "./gauge_given_or_chosen.mjs";
import { expectPassingTime } from "./level.mjs";
import { takeLevel } from "./level_of_new_state.mjs";
import { beginAttitude, elementOf } from "./attitude.mjs";
import { restartAttitude } from "./attitude_gauge.mjs";
import { forgetSteps } from "./gauss.mjs";
import { renew } from "./renewed_stages.mjs";

// ---- The solver ----

const number = new Float64Array(1);

/** The options of the constructor. */
// #state names

/**
 * Return all parameters: the given ones, and the defaults of the others. Throws StepError for unknown names,
 * for values that are not finite, and for values that are not positive where this is required. The
 * coefficients of a very small step must also be finite.
 */
function admitted(overrides) {
  const params = { ...DEFAULT_PARAMETERS, ...overrides };
  const unknown = Object.keys(overrides).filter((name) => !Object.hasOwn(DEFAULT_PARAMETERS, name));
  if (unknown.length) throw new StepError("BAD_ARGUMENT", 0, `there is no parameter ${unknown[0]}`);
  for (const [name, value] of Object.entries(params)) {
    const allowed = Number.isFinite(value) && (value > 0 || !POSITIVE.includes(name));
    const needed = POSITIVE.includes(name) ? "a finite positive number" : "a finite number";
    if (!allowed) throw new StepError("BAD_ARGUMENT", 0, `the parameter ${name} is ${value}, not ${needed}`);
    expectNonnegative(name, value);
  }
  const [table] = emptyTables();
  prepareProbe(params, table);
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
  // #members constants
  static DEFAULT_PARAMETERS = DEFAULT_PARAMETERS;

  // #state fields
  /** Number of steps and time at the last change of h. The time is #timeBefore + (steps - #stepsBefore) h. */
  #stepsBefore = 0;
  #timeBefore = 0;

  /**
   * Start at x0. Throws StepError for arguments that are not admissible.
   *
   * @param {object} options
   * #state options
   */
  constructor(options = {}) {
    expectOptions(options, OPTIONS);
    this.x = finite(options.x0, DIM, "x0");
    this.params = admitted(options.params ?? {});
    takeTime(this, options);
    takeDraws(this, options);
    takeGauge(this, options);
    expectPassingTime(this);
    beginAttitude(this, elementOf(0, options.attitude0, options.position0));
  }

  // #members attitude
  /** Compute the coefficients for a step size, if it has changed. */
  #setStep(h) {
    if (!Number.isFinite(h)) {
      throw new StepError("BAD_ARGUMENT", this.steps, `the step size is ${h}, not finite`);
    }
    if (Object.is(h, this.h)) return;
    FRACTIONS.forEach((fraction, stage) => {
      prepareStage(this, fraction * h, this.coef[stage]);
      clearHistory(this, stage);
    });
    this.h = h;
    this.#timeBefore = this.t;
    this.#stepsBefore = this.steps;
  }

  /**
   * Make one step of size h, which may be negative. If the step fails, throws StepError and leaves the state
   * unchanged.
   *
   * @param {number} h
   * #state arguments
   * @returns {this}
   */
  step(h) {
    // #if CORRECTED
    return this.integrate(h, 1);
  }

  /** Make one step without correctors. If it fails, throws StepError and leaves the state unchanged. */
  #stepOfRun(h) {
    // #endif
    this.#setStep(h);
    drawStep(this, arguments[1]);
    renew(this);
    const before = FRACTIONS.length > 1 ? savedState(this) : null;
    for (let stage = 0; stage < FRACTIONS.length; stage++) {
      const status = makeStage(this, stage);
      if (status === "OK") continue;
      if (before) restoreState(this, before);
      throw new StepError(status, this.steps);
    }
    this.steps++;
    // #if !MONITOR
    this.t = this.#timeBefore + (this.steps - this.#stepsBefore) * h;
    // #endif
    return this;
  }

  /**
   * Make count steps. If a step fails, throws StepError; x is then the state before this step, and steps the
   * number of successful steps.
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
    const startStatus = count > 0 ? makeStage(this, 0, BEGIN) : "OK";
    if (startStatus !== "OK") throw new StepError(startStatus, this.steps);
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
  /**
   * Apply the corrector at the end of several steps. If no step was made, restore the state before the steps.
   * If the corrector fails, restore this state and throw StepError.
   */
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
   * Return an independent solver with the same state, time and parameters.
   *
   * @returns {Solver}
   */
  copy() {
    const { x: x0, params, gauge, seed, member, step0 } = this; // undefined if there is no such field
    const twin = new Solver({ x0, params, gauge, seed, member, step0 });
    const { t, steps, evaluations } = this;
    Object.assign(twin, { t, steps, evaluations });
    // #state copied
    return twin;
  }

  /**
   * Change parameters between steps; the state and the time stay the same. If a value is not admissible,
   * throws StepError and changes nothing.
   *
   * @param {Partial<Parameters>} changes
   * @returns {this}
   */
  setParameters(changes) {
    const params = admitted({ ...this.params, ...changes });
    takeLevel({ ...this, params, h: NaN }, this.x);
    this.params = params;
    this.h = NaN; // then the next step computes the coefficients anew
    takeLevel(this, this.x);
    forgetSteps(this);
    restartAttitude(this);
    return this;
  }

  // #members kicks
  // #members tangent
  // #members interpolate
  // #members ensemble
  /** The Hamiltonian; x and t are the present state and time by default. */
  hamiltonian(x = this.x, t = this.t) {
    energyAt(this.params, t, x, number);
    return number[0];
  }

  // #members modified_timed
  // #members modified_gauge
  // #members modified
  /** The Casimirs, in the order of CASIMIRS. */
  casimirs(x = this.x) {
    const out = new Float64Array(CASIMIRS.length);
    casimirs(this.params, x, out);
    return out;
  }

  // #members observed
  // #members noise_fields
  /** The vector field dx/dt; x and t are the present state and time by default. */
  vectorField(x = this.x, t = this.t) {
    const out = new Float64Array(DIM);
    vectorFieldAt(this.params, t, x, out);
    return out;
  }
}
