// Two solvers from one start, with one step: that of phigen and RK4. What the flow conserves is measured of both.
const MOST = 400; // stretches of time of which a history keeps the largest error, and steps of a trail

// The largest error of each stretch; where there are too many, two become one.
class History {
  values = [];
  last = 0;
  #size = 1;
  #count = 0;
  #largest = 0;

  add(error) {
    this.last = error;
    this.#largest = Math.max(this.#largest, Number.isFinite(error) ? error : Infinity);
    if (++this.#count < this.#size) return;
    this.values.push(this.#largest);
    this.#count = this.#largest = 0;
    if (this.values.length < MOST) return;
    this.values = this.values.flatMap((v, i) => (i % 2 ? [Math.max(v, this.values[i - 1])] : []));
    this.#size *= 2;
  }

  get steps() {
    return this.values.length * this.#size;
  }
}

// The classical method of Runge and Kutta for dx = field(x, t), dt = rate(x).
function rk4(field, x, t, h) {
  const after = (slope, part) => [x.map((v, i) => v + part * h * slope.x[i]), t + part * h * slope.t];
  const a = field(x, t);
  const b = field(...after(a, 0.5));
  const c = field(...after(b, 0.5));
  const d = field(...after(c, 1));
  const mean = (i) => (a.x[i] + 2 * b.x[i] + 2 * c.x[i] + d.x[i]) / 6;
  return { x: x.map((v, i) => v + h * mean(i)), t: t + (h * (a.t + 2 * b.t + 2 * c.t + d.t)) / 6 };
}

// What an error of a quantity is divided by: its value, or its terms where that is nearly 0.
function unitOf(quantity, x) {
  const value = Math.abs(quantity(x));
  let terms = 0;
  x.forEach((v, i) => {
    const moved = [1e-6, -1e-6].map((part) => quantity(x.map((w, j) => (i === j ? w * (1 + part) : w))));
    const term = Math.abs(moved[0] - moved[1]) / 2e-6;
    if (Number.isFinite(term)) terms += term;
  });
  return value > 1e-3 * terms ? value : terms || 1;
}

// One method on its way: where it is, where it has been, its errors, and why it ended if it did.
class Runner {
  failed = "";
  steps = 0;
  trail = [];
  // For each group of quantities the largest error.
  histories;

  constructor(race, advance) {
    Object.assign(this, { race, advance, x: race.start, t: race.t0 });
    this.histories = race.groups.map(() => new History());
    this.#remember();
  }

  step() {
    if (this.failed) return;
    try {
      this.advance(this);
      if (!this.x.every(Number.isFinite)) throw { status: "NOT_FINITE" };
    } catch (error) {
      if (!error.status) throw error;
      this.failed = error.status;
      return;
    }
    this.steps++;
    this.race.groups.forEach((group, k) => this.histories[k].add(group.error(this.x, this.t)));
    this.#remember();
  }

  #remember() {
    const slope = this.race.field(this.x, this.t).x.map((v) => v * this.race.h);
    this.trail.push({ x: this.x, slope });
    if (this.trail.length > MOST) this.trail.shift();
  }
}

// A point between two steps, by the cubic with their slopes.
function between(a, b, s, i) {
  const r = 1 - s;
  return r * r * (1 + 2 * s) * a.x[i] + r * r * s * a.slope[i] + s * s * (3 - 2 * s) * b.x[i] - s * s * r * b.slope[i];
}

// Both methods; throws what the solver throws of a start or of parameters that it does not take.
class Race {
  constructor({ Solver, rateAt }, { h, start, t0, params }, quantities) {
    const solver = new Solver({ x0: start, t0, params });
    Object.assign(this, { solver, h, start: Float64Array.from(start), t0: solver.t });
    this.field = (x, t) => {
      const rate = rateAt ? rateAt(solver.params, x) : 1;
      return { x: solver.vectorField(x, t).map((v) => v * rate), t: rate };
    };
    this.groups = quantities.map(({ name, casimirs }) => {
      const parts = casimirs ? casimirs.map((c) => (x) => solver.casimirs(x)[c]) : [(x) => solver.hamiltonian(x)];
      const [values, units] = [parts.map((part) => part(this.start)), parts.map((part) => unitOf(part, this.start))];
      return { name, error: (x) => Math.max(...parts.map((part, k) => Math.abs(part(x) - values[k]) / units[k])) };
    });
    this.ours = new Runner(this, (runner) => {
      solver.step(h);
      Object.assign(runner, { x: Float64Array.from(solver.x), t: solver.t });
    });
    this.theirs = new Runner(this, (runner) => Object.assign(runner, rk4(this.field, runner.x, runner.t, h)));
  }

  step() {
    this.ours.step();
    this.theirs.step();
  }
}

// Lines of f = 0 over a grid in a plane, as ends [u, v, u, v]; not those along which f only changes its sign at a pole.
function contour(f, [u0, u1], [v0, v1], count) {
  const u = (i) => u0 + ((u1 - u0) * i) / count, v = (j) => v0 + ((v1 - v0) * j) / count;
  const values = Array.from({ length: count + 1 }, (_, i) => Array.from({ length: count + 1 }, (_, j) => f(u(i), v(j))));
  const lines = [];
  for (let i = 0; i < count; i++) {
    for (let j = 0; j < count; j++) {
      const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
      const ends = [];
      corners.forEach(([a, b], k) => {
        const [c, d] = corners[(k + 1) % 4], [p, q] = [values[a][b], values[c][d]];
        if (!(p < 0 !== q < 0 && Number.isFinite(p) && Number.isFinite(q))) return;
        const s = p / (p - q), at = [u(a) + s * (u(c) - u(a)), v(b) + s * (v(d) - v(b))];
        if (Math.abs(f(...at)) <= Math.max(Math.abs(p), Math.abs(q))) ends.push(at);
      });
      for (let k = 0; k + 1 < ends.length; k += 2) lines.push([...ends[k], ...ends[k + 1]]);
    }
  }
  return lines;
}
