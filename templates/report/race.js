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

// One method on its way: where it is, its errors, and why it ended if it did.
class Runner {
  failed = "";
  steps = 0;
  // For each group of quantities the largest error.
  histories;

  constructor(race, advance) {
    Object.assign(this, { race, advance, x: race.start, t: race.t0 });
    this.histories = race.groups.map(() => new History());
    race.remember(this);
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
    this.race.remember(this);
  }
}

// Both methods, from where a solver is. Of both the errors of groups {name, error(x, t)} are kept, and remember(runner)
// is called at the start and after each step.
class Race {
  constructor(solver, { h, field, groups, remember }) {
    Object.assign(this, { solver, h, field, groups, remember, start: Float64Array.from(solver.x), t0: solver.t });
    this.ours = new Runner(this, (runner) => {
      solver.step(h);
      Object.assign(runner, { x: Float64Array.from(solver.x), t: solver.t });
    });
    this.theirs = new Runner(this, (runner) => Object.assign(runner, rk4(field, runner.x, runner.t, h)));
  }

  step() {
    this.ours.step();
    this.theirs.step();
  }
}
