// Comparison of the solver of phigen with RK4. Both start at the same state, and RK4 makes one or several
// steps for each step of the solver. The errors of conserved quantities are measured for both.
const MOST = 400; // largest number of intervals in a History, and of steps in a trail
const MOST_PARTS = 64; // largest number of steps of RK4 for one step of the solver
const ROUNDING = 1e-13; // errors below this are rounding errors, which are not compared
// Bounds for a ratio: the largest error in the second half of a run divided by that in the first half. An
// error is constant if the ratio is at most STEADY, and grows if it is more than GROWING.
const STEADY = 1.2, GROWING = 1.5;

// The largest error in each of several equal intervals of a run. If there are too many intervals,
// neighbouring intervals are joined in pairs.
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

// A step of the classical Runge–Kutta method. field(x, t) returns the derivatives {x, t} of state and time.
function rk4(field, x, t, h) {
  const point = new Float64Array(x.length), sum = new Float64Array(x.length);
  let slope = { x: sum, t: 0 }, time = 0;
  for (const [part, weight] of [[0, 1], [0.5, 2], [0.5, 2], [1, 1]]) {
    for (let i = 0; i < x.length; i++) point[i] = x[i] + part * h * slope.x[i];
    slope = field(point, t + part * h * slope.t);
    for (let i = 0; i < x.length; i++) sum[i] += weight * slope.x[i];
    time += weight * slope.t;
  }
  return { x: sum.map((total, i) => x[i] + (h * total) / 6), t: t + (h * time) / 6 };
}

// The run of one method: its state, its errors, and the reason if the method has failed.
class Runner {
  failed = "";
  steps = 0;
  // One History for each group of quantities.
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

// The runs of both methods, which start at the state of `solver`. RK4 makes `parts` steps for each step of
// the solver. The errors of the groups {name, error(x, t)} are stored, and remember(runner) is called at the
// start and after each step.
class Race {
  constructor(solver, { h, parts = 1, field, groups, remember }) {
    Object.assign(this, { solver, h, field, groups, remember, start: Float64Array.from(solver.x), t0: solver.t });
    this.ours = new Runner(this, (runner) => {
      solver.step(h);
      Object.assign(runner, { x: Float64Array.from(solver.x), t: solver.t });
    });
    this.theirs = new Runner(this, (runner) => {
      for (let k = 0; k < parts; k++) Object.assign(runner, rk4(field, runner.x, runner.t, h / parts));
    });
  }

  step() {
    this.ours.step();
    this.theirs.step();
  }
}

// The time in milliseconds that one step of one method takes; 0 if the step fails. It is the shortest of
// several measurements, each of which takes `round` milliseconds.
function millisecondsOf(runner, round) {
  let least = Infinity;
  try {
    for (let k = 0; k < 5; k++) {
      let count = 0;
      const begin = performance.now();
      while (performance.now() - begin < round) {
        for (let i = 0; i < 8; i++) runner.advance(runner);
        count += 8;
      }
      least = Math.min(least, (performance.now() - begin) / count);
    }
  } catch (error) {
    if (!error.status) throw error;
    return 0;
  }
  return least;
}

// The number of steps of RK4 that take as long as one step of the solver, rounded up, which favours RK4.
function equalWork(race, round = 4) {
  const [ours, theirs] = [race.ours, race.theirs].map((runner) => millisecondsOf(runner, round));
  return ours > 0 && theirs > 0 ? Math.min(MOST_PARTS, Math.max(1, Math.ceil(ours / theirs))) : 1;
}

// The largest error in the first and in the second half of a history.
function halves(history) {
  const { values } = history, middle = values.length >> 1;
  return [values.slice(0, middle), values.slice(middle)].map((part) => Math.max(0, ...part));
}

// The groups of quantities in which RK4 has smaller errors. `ours` and `theirs` are the errors of phigen and
// of RK4 in the first and in the second half of the run.
function groupsOfRk4({ ours, theirs, groups }) {
  if (theirs.failed) return [];
  const errors = groups.map(({ name }, k) => ({ name, ours: halves(ours.histories[k]), theirs: halves(theirs.histories[k]) }));
  return errors.filter((of) => of.theirs[1] < of.ours[1] && of.ours[1] >= ROUNDING);
}

// A text for the reader about the groups of quantities in which RK4 has smaller errors; "" if there are none.
function whereRk4IsCloser(race) {
  const sentences = groupsOfRk4(race).map(({ name, ours: [first, last], theirs: [begin, end] }) => {
    const crossing = last <= STEADY * first && end > GROWING * begin;
    return crossing ? `${name}: RK4 is closer so far, but its error grows while that of phigen does not`
      : `${name}: RK4 is closer with these settings`;
  });
  return sentences.length ? `${sentences.join("; ")}.` : "";
}
