import { PROBE_STEP } from "./start_policy.mjs";
import { StepError, expectOptions, finite } from "./errors.mjs";
import { march } from "./march.mjs";
import { CASIMIRS, CASIMIR_KINDS, COORDINATES, DEFAULT_PARAMETERS, DIM, NAME, ORDER } from "./model.mjs";
import { AXES, COEFFICIENTS, SPEC_SHA256, TIMES, VERSION } from "./model.mjs";
import { casimirs, energy, vectorField } from "./model.mjs";
import { prepareRow } from "./rows_plain.mjs";
import { takeDraws } from "./philox.mjs";
import { expectFewSteps } from "./site_noise.mjs";
import { renewRows } from "./rows_renewed.mjs";
import { takeTime } from "./sites_timed.mjs";
import { Sites, sumOf } from "./sites.mjs";
import { beginLevel } from "./site_level.mjs";
import { makeStep } from "./flows.mjs";

// ---- The solver ----

/** The options of the constructor. */
// #state lattice_names

/** Compute the coefficients of a step of size h: a row for each entry of TIMES. */
function prepareStep(params, h, rows) {
  TIMES.forEach((time, k) => prepareRow(params, time, h, rows[k], k));
  return rows;
}

/** Return arrays for the coefficients of a step: a row for each entry of TIMES. */
function emptyRows() {
  return TIMES.map(() => new Float64Array(COEFFICIENTS));
}

/** Throw StepError if a coefficient of steps with these parameters is not finite. */
function expectSteps(params) {
  const rows = prepareStep(params, PROBE_STEP, emptyRows());
  if (rows.every((row) => row.every(Number.isFinite))) return;
  throw new StepError("BAD_ARGUMENT", 0, "no step can be made with these parameters");
}

/** A solver of a lattice and the trajectory that it computes. */
export class Solver {
  static NAME = NAME;
  static VERSION = VERSION;
  static SPEC_SHA256 = SPEC_SHA256;
  static DIM = DIM;
  static ORDER = ORDER;
  static AXES = AXES;
  static COORDINATES = COORDINATES;
  static CASIMIRS = CASIMIRS;
  static CASIMIR_KINDS = CASIMIR_KINDS;
  // #members lattice_constants
  // #members lattice_field_constants
  static DEFAULT_PARAMETERS = DEFAULT_PARAMETERS;

  /**
   * The state, to be read only. The values of each coordinate at all sites follow one another, coordinate by
   * coordinate; the last axis varies fastest.
   */
  x;
  // #if TIMED
  /** The time of x. */
  t;
  // #else
  /** Time since the start. */
  t = 0;
  // #endif
  // #if NOISE
  /**
   * The random numbers of a site depend on seed, member, step0 + steps, and the number of the site.
   */
  seed = 0;
  member = 0;
  step0 = 0;
  // #endif
  // #if TANGENT
  /** The tangent vectors that a step multiplies by its derivative. */
  vectors = [];
  // #endif
  /** Number of successful steps since the start. */
  steps = 0;
  /** Size of the last step. */
  h = NaN;
  /** Sizes, parameters, and tables of neighbours. */
  sites;
  /** A row of coefficients for each flow or stage. They depend on parameters and step size. */
  rows = emptyRows();
  /** Copy of the state before the present step, which is restored if the step fails. */
  before;
  /** Predictors of the stages; they are cleared when the step size changes. */
  past = {};
  /** Number of steps and time at the last change of h. The time is #timeBefore + (steps - #stepsBefore) h. */
  #stepsBefore = 0;
  #timeBefore = 0;

  /**
   * Start at x0. Throws StepError for arguments that are not admissible.
   *
   * @param {object} options
   * #state lattice_options
   */
  constructor(options = {}) {
    expectOptions(options, OPTIONS);
    const { x0 } = options;
    const sizes = options.sizes ?? (AXES.length === 1 && x0 ? [x0.length / DIM] : []);
    this.sites = new Sites(sizes, options);
    this.x = finite(x0, DIM * this.sites.count, "x0");
    this.before = Float64Array.from(this.x);
    takeTime(this, options);
    takeDraws(this, options);
    expectFewSteps(this);
    expectSteps(this.params);
    beginLevel(this);
  }

  /** All parameters by name; a parameter with values at sites or bonds is an array. */
  get params() {
    return this.sites.params;
  }

  /** Number of sites along each axis. */
  get sizes() {
    return this.sites.sizes;
  }

  /** The values of a coordinate at all sites: a part of x, to be read only. */
  field(name) {
    const k = COORDINATES.indexOf(name);
    if (k < 0) throw new StepError("BAD_ARGUMENT", this.steps, `there is no field ${name}`);
    return this.x.subarray(k * this.sites.count, (k + 1) * this.sites.count);
  }

  /** Compute the coefficients for a step size, if it has changed. */
  #setStep(h) {
    if (!Number.isFinite(h)) {
      throw new StepError("BAD_ARGUMENT", this.steps, `the step size is ${h}, not finite`);
    }
    if (Object.is(h, this.h)) return;
    prepareStep(this.params, h, this.rows);
    this.past = {};
    this.h = h;
    this.#timeBefore = this.t;
    this.#stepsBefore = this.steps;
  }

  /**
   * Make one step of size h, which may be negative. If the step fails, throws StepError and leaves the state
   * unchanged.
   *
   * @param {number} h
   * @returns {this}
   */
  step(h) {
    this.#setStep(h);
    this.before.set(this.x);
    this.sites.t = this.t;
    renewRows(this, h);
    const status = makeStep(this);
    if (status !== "OK") {
      this.x.set(this.before);
      throw new StepError(status, this.steps);
    }
    this.steps++;
    // #if !MONITOR
    this.t = this.#timeBefore + (this.steps - this.#stepsBefore) * h;
    // #endif
    return this;
  }

  /**
   * Change parameters between steps; the state and the time stay the same. If a value is not admissible,
   * throws StepError and changes nothing.
   *
   * @param {object} changes parameters by name: numbers, or arrays of values at sites or bonds
   * @returns {this}
   */
  setParameters(changes) {
    const before = this.params;
    this.sites.setParameters(changes);
    const changed = { ...this, params: this.params };
    try {
      expectSteps(this.params);
      beginLevel(changed);
    } catch (error) {
      this.sites.setParameters(before);
      throw error;
    }
    // #if MONITOR
    this.level = changed.level;
    // #endif
    this.h = NaN; // then the next step computes the coefficients anew
    return this;
  }

  // #members lattice_tangent
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
    return march(this, h, count);
  }

  /** The density of the Hamiltonian at each site; x and t are the present state and time by default. */
  density(x = this.x, t = this.t) {
    const out = new Float64Array(this.sites.count);
    this.sites.t = t;
    energy(this.params, x, this.sites, out);
    return out;
  }

  /** The Hamiltonian at a state and a time, by default the present ones. */
  hamiltonian(...at) {
    return sumOf(this.density(...at));
  }

  /**
   * The contribution of each site to each Casimir, in the order of CASIMIRS. CASIMIR_KINDS says whether the
   * contribution of each site is a Casimir of its own ("sites"), or the Casimir is their sum or product.
   */
  casimirs(x = this.x) {
    const out = new Float64Array(CASIMIRS.length * this.sites.count);
    casimirs(this.params, x, this.sites, out);
    return out;
  }

  // #members lattice_observed
  // #members lattice_observed_fields
  /** The right-hand side pi(x) grad H, in the order of x; x and t are the present ones by default. */
  vectorField(x = this.x, t = this.t) {
    const out = new Float64Array(x.length);
    this.sites.t = t;
    vectorField(this.params, x, this.sites, out);
    return out;
  }
}
