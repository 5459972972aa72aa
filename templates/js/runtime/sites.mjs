import { StepError, finite } from "./errors.mjs";
import { AT_SITES, AXES, BOUNDS, DEFAULT_PARAMETERS, LEAST, NEAR } from "./model.mjs";
import { OPEN, PERIODS, POSITIVE } from "./model.mjs";
import { COLOURS, COLOUR_WEIGHTS } from "./model.mjs";
import { SEAMS, WANTED } from "./model.mjs";
import { GATHERED } from "./model.mjs";
import { AT_BONDS } from "./model.mjs";
import { SOURCES } from "./model.mjs";
import { SCHEDULE } from "./model.mjs";
import { BY_COLOUR } from "./model.mjs";
import { weigh } from "./bodies.mjs";

// ---- The sites ----

/** The sum of values, by the compensated summation of A. Neumaier. */
export function sumOf(values) {
  let sum = 0, rest = 0;
  for (const value of values) {
    const total = sum + value;
    rest += Math.abs(sum) >= Math.abs(value) ? (sum - total) + value : (value - total) + sum;
    sum = total;
  }
  return sum + rest;
}

/**
 * The sites of a lattice: the parameters, and tables of the neighbours that functions of the system read.
 */
export class Sites {
  /** Initialise from the options of a solver. Throws StepError if a value is not admissible. */
  constructor(sizes, options) {
    const fits = (n, axis) => Number.isInteger(n) && n >= LEAST[axis] && n % PERIODS[axis] === 0;
    if (sizes.length !== AXES.length || !sizes.every(fits)) {
      const asked = AXES.map((axis, k) => `${axis} of ${LEAST[k]} or more, a multiple of ${PERIODS[k]}`);
      throw new StepError("BAD_ARGUMENT", 0, `sizes are [${sizes}]: needed is ${asked.join("; ")}`);
    }
    this.sizes = Object.freeze([...sizes]);
    this.count = sizes.reduce((product, n) => product * n, 1);
    // #if GRAPH
    this.#connect(options.bonds ?? []);
    // #endif
    this.params = this.#admitted(options.params ?? {});
    weigh(this);
    const every = (Kind, value) => Kind.from({ length: this.count }, (_, i) => value(i));
    /** The neighbour of each site, for each offset of NEAR. */
    this.near = NEAR.map((offset) => every(Int32Array, (i) => this.#beside(i, offset)));
    /** For each entry of BOUNDS: 1 at the sites whose terms exist, else 0. */
    this.present = BOUNDS.map((bounds) => every(Float64Array, (i) => this.#holds(i, bounds)));
    // #if COLOURS
    const colours = every(Array, (i) => {
      return this.#place(i).reduce((sum, at, axis) => sum + COLOUR_WEIGHTS[axis] * at, 0) % COLOURS;
    });
    /** The sites of each colour. */
    this.coloured = Array.from({ length: COLOURS }, (_, colour) => {
      return Int32Array.from(colours.flatMap((own, i) => (own === colour ? [i] : [])));
    });
    // #if SEAMS
    this.#colours = colours;
    /** Along each axis the first site of the boundary seam; without a seam, the number of sites. */
    this.seams = SEAMS.map(([period, wide], axis) => {
      const left = sizes[axis] % period;
      return sizes[axis] - (left && left + Math.max(0, Math.ceil((wide - left) / period)) * period);
    });
    const beside = every(Array, (i) => this.#place(i).some((at, axis) => {
      const near = this.seams[axis] < sizes[axis] ? SEAMS[axis][2] : 0;
      return at < near || at >= this.seams[axis] - near;
    }));
    const listed = (wanted) => Int32Array.from(beside.flatMap((own, i) => (wanted(own, i) ? [i] : [])));
    /**
     * `beside` lists the sites in boundary seams or near them. `inside` lists all other sites: by colour, and
     * all.
     */
    this.beside = listed((own) => own);
    this.inside = this.coloured.map((_, colour) => listed((own, i) => !own && colours[i] === colour));
    this.inside.all = listed((own) => !own);
    // #endif
    // #endif
    // #if GATHER
    /** Sums over bonds or pairs, at each site. */
    this.sums = new Float64Array(GATHERED * this.count);
    // #endif
    // #if NOISE
    /** The increments of the noise at all sites in a part of a step, one source after the other. */
    this.dw = new Float64Array(SOURCES.length * this.count);
    // #endif
    // #if SPLIT
    // #if BY_COLOUR
    const flows = BY_COLOUR.flatMap((many, part) => {
      return Array.from({ length: many ? this.colourCount : 1 }, (_, colour) => [part, colour]);
    });
    // #if TIMED
    flows.push(null); // the last flow advances the time only
    // #endif
    const kinds = [flows.slice(0, 1), flows.slice(1, -1), flows.slice(-1), flows.slice(1, -1).reverse()];
    /** The flows of a step, each as [part of H, row of coefficients, colour]. */
    this.flows = SCHEDULE.flatMap(([kind, row]) => kinds[kind].map(([part, colour]) => [part, row, colour]));
    // #else
    /** The flows of a step, each as [part of H, row of coefficients]. */
    this.flows = SCHEDULE;
    // #endif
    // #endif
  }

  /**
   * Return all parameters: the given ones, and the defaults of the others. Throws StepError for unknown
   * names, for values that are not finite, and for values that are not positive where this is required.
   */
  #admitted(overrides) {
    const unknown = Object.keys(overrides).filter((name) => !Object.hasOwn(DEFAULT_PARAMETERS, name));
    if (unknown.length) throw new StepError("BAD_ARGUMENT", 0, `there is no parameter ${unknown[0]}`);
    const params = Object.create(null);
    for (const [name, value] of Object.entries({ ...DEFAULT_PARAMETERS, ...overrides })) {
      let length = AT_SITES.includes(name) ? this.count : undefined; // undefined: a single number
      // #if GRAPH
      if (AT_BONDS.includes(name)) length = this.bondCount;
      // #endif
      // #if ARRAYS
      if (value === null) {
        const missing = `the parameter ${name} must be given: its default is an array`;
        throw new StepError("BAD_ARGUMENT", 0, missing);
      }
      // #endif
      const listed = typeof value === "object" && length !== undefined;
      const values = listed ? finite(value, length, name) : [value];
      if (!values.every((v) => Number.isFinite(v) && (v > 0 || !POSITIVE.includes(name)))) {
        const needed = POSITIVE.includes(name) ? "finite and positive" : "finite";
        throw new StepError("BAD_ARGUMENT", 0, `the parameter ${name} is ${value}, not ${needed}`);
      }
      // #if NONNEGATIVE
      if (NONNEGATIVE.includes(name) && values.some((v) => v < 0)) {
        throw new StepError("BAD_ARGUMENT", 0, `the parameter ${name} is ${value}, which is negative`);
      }
      // #endif
      params[name] = listed ? values : length === undefined ? value : new Float64Array(length).fill(value);
    }
    return Object.freeze(params);
  }

  /** Change parameters. If a value is not admissible, throws StepError and changes nothing. */
  setParameters(changes) {
    const { params } = this;
    this.params = this.#admitted({ ...params, ...changes });
    try {
      weigh(this);
    } catch (error) {
      this.params = params;
      weigh(this);
      throw error;
    }
  }

  /** Position of a site along each axis. */
  #place(site) {
    const place = [];
    for (let axis = AXES.length - 1; axis >= 0; axis--) {
      place.unshift(site % this.sizes[axis]);
      site = Math.floor(site / this.sizes[axis]);
    }
    return place;
  }

  /** The neighbour of a site at an offset. Beyond open ends it is any site, since it has the factor 0. */
  #beside(site, offset) {
    return this.#place(site).reduce((sum, from, axis) => {
      const size = this.sizes[axis];
      const to = from + offset[axis];
      if (!OPEN[axis]) return sum * size + ((to % size) + size) % size;
      const mirrored = Math.abs(to) > size - 1 ? 2 * (size - 1) - Math.abs(to) : Math.abs(to);
      return sum * size + Math.min(size - 1, Math.max(0, mirrored));
    }, 0);
  }

  // #if SEAMS
  #colours;
  #begins = new Map();

  /**
   * An array that is 1 at some sites, else 0. WANTED[number] is a pair of a colour and an offset. A site has
   * 1 if its neighbour at the offset has the colour, and lies in exactly those boundary seams whose bits are
   * set in window.
   */
  begins(number, window) {
    const key = `${number} ${window}`;
    const [colour, offset] = WANTED[number];
    const there = (_, i) => {
      const site = this.#beside(i, offset);
      const within = (sum, at, axis) => sum + (at >= this.seams[axis] ? 2 ** axis : 0);
      const seams = this.#place(site).reduce(within, 0);
      return this.#colours[site] === colour && seams === window ? 1 : 0;
    };
    if (!this.#begins.has(key)) this.#begins.set(key, Float64Array.from({ length: this.count }, there));
    return this.#begins.get(key);
  }

  // #endif
  /** 1 if, along each axis, all neighbours of a site from offset low to offset high exist; else 0. */
  #holds(site, bounds) {
    const place = this.#place(site);
    const inside = ([low, high], axis) => place[axis] + low >= 0 && place[axis] + high < this.sizes[axis];
    return bounds.every(inside) ? 1 : 0;
  }
  // #if GRAPH

  /**
   * Initialise the bonds, each from a site a to a site b, with a colouring of the sites if flows need one.
   */
  #connect(bonds) {
    const known = bonds.length % 2 === 0 && Array.from(bonds).every((end, k) => {
      return Number.isInteger(end) && end >= 0 && end < this.count && end !== bonds[k ^ 1];
    });
    if (!known) throw new StepError("BAD_ARGUMENT", 0, "bonds are pairs of different sites, counted from 0");
    this.bondCount = bonds.length / 2;
    const ends = (side) => Int32Array.from({ length: this.bondCount }, (_, k) => bonds[2 * k + side]);
    this.ends = { a: ends(0), b: ends(1) };
    this.listed = {};
    // #if BY_COLOUR
    const before = Array.from({ length: this.count }, () => []);
    this.ends.a.forEach((a, k) => before[Math.max(a, this.ends.b[k])].push(Math.min(a, this.ends.b[k])));
    /** The colour of each site: the first one that none of its earlier neighbours by bonds has. */
    this.colours = new Int32Array(this.count);
    before.forEach((others, site) => {
      const usedColours = new Set(others.map((other) => this.colours[other]));
      while (usedColours.has(this.colours[site])) this.colours[site]++;
    });
    this.colourCount = this.colours.reduce((most, colour) => Math.max(most, 1 + colour), 2);
    // #endif
  }

  /**
   * Lists `here`, `there` and `bond` over all bonds, seen from their ends a or b, or from both ends (""): the
   * site at the end from which a bond is seen, the site at its opposite end, and the number of the bond. With
   * chosen = "here", only bonds are listed whose site `here` has the colour; with chosen = "there", only
   * bonds whose site `there` has it.
   */
  bonds(end, chosen, colour) {
    const key = `${end} ${chosen} ${chosen && colour}`;
    if (this.listed[key]) return this.listed[key];
    const lists = { here: [], there: [], bond: [] };
    for (const side of end || "ab") {
      const [here, there] = [this.ends[side], this.ends[side === "a" ? "b" : "a"]];
      here.forEach((site, k) => {
        // #if BY_COLOUR
        if (chosen && this.colours[{ here: site, there: there[k] }[chosen]] !== colour) return;
        // #endif
        lists.here.push(site);
        lists.there.push(there[k]);
        lists.bond.push(k);
      });
    }
    const typed = Object.entries(lists).map(([name, list]) => [name, Int32Array.from(list)]);
    this.listed[key] = Object.fromEntries(typed);
    return this.listed[key];
  }
  // #endif
}

/** Whether all numbers are finite. */
export function allFinite(values) {
  let zero = 0;
  for (let k = 0; k < values.length; k++) zero += 0 * values[k];
  return zero === 0;
}
