// What solvers say: one answer for each job, as JSON.

function attempted(work) {
  try {
    return { value: work() };
  } catch (error) {
    return { status: error.status ?? "none", steps: error.steps, name: error.name, message: error.message };
  }
}

/** One step with its derivative; a step that fails leaves all as it was. */
function varied(Solver, job) {
  const solver = new Solver(job.options);
  if (!solver.stepTangent) return null;
  const failure = attempted(() => solver.stepTangent(1e200));
  const untouched = solver.steps === 0 && solver.t === new Solver(job.options).t;
  return { derivative: [...solver.stepTangent(job.h)], x: [...solver.x], t: solver.t, failure, untouched };
}

/** How many values the guess of a step of another size rests on, once that is made. */
function remembered(Solver, job) {
  const solver = new Solver(job.options).integrate(job.h, 3).step(job.h / 2);
  return (solver.history ?? []).map(({ count }) => count);
}

/** How far a step from x with a carry ends from one that begins at their sum, in sizes of the carry. */
function carried(Solver, job) {
  const whole = new Solver(job.options);
  const carry = 1e-6 * Math.max(...whole.x.map(Math.abs));
  const parted = new Solver(job.options);
  parted.carry.fill(carry);
  const { gauge } = whole;
  const summed = new Solver({ ...job.options, gauge, x0: whole.x.map((x) => x + carry) }).step(job.h);
  parted.step(job.h);
  return Math.max(...summed.x.map((x, i) => Math.abs(x - parted.x[i]))) / carry;
}

/** Three members with parameters, steps and times of their own. */
function each(Solver, job, start) {
  const factors = [1, 1.01, 1.02];
  const given = Object.entries(Solver.DEFAULT_PARAMETERS).map(([name, value]) => [name, factors.map((f) => f * value)]);
  const h = Float64Array.from(factors, (f) => job.h / f);
  const options = { params: Object.fromEntries(given), ...(job.timed && { t0: factors.map((f) => f - 1) }) };
  const { x, status } = Solver.ensemble(factors.map(() => start), h, 5, options);
  return { x: x.map((end) => [...end]), status };
}

/** Two members, and one that is refused. */
function many(Solver, job, start) {
  const { params, t0 } = job.options;
  const members = [start, start.map((x) => 1.01 * x), start.map(() => NaN)];
  const { x, status } = Solver.ensemble(members, job.h, job.steps, { params, t0 });
  return { x: x.map((end) => [...end]), status };
}

/** Kicked, and set to where it was; then the same as a solver that starts there, to rounding. */
function moved(Solver, job, monitored) {
  const solver = new Solver(job.options);
  const small = solver.x.map((x) => 1e-3 * x);
  solver.step(job.h).kick(small).step(job.h).setState(solver.x).kick(small);
  const gauge = monitored ? {} : { gauge: solver.gauge };
  const fresh = new Solver({ ...job.options, ...gauge, ...(job.timed && { t0: solver.t }), x0: solver.x });
  const failure = attempted(() => solver.kick(small.map(() => NaN)));
  return { x: [...solver.step(job.h).x], fresh: [...fresh.step(job.h).x], failure, steps: solver.steps };
}

/** Where the first coordinate passes through the value that it has after some steps and a half: the times, and the states. */
function crossings(Solver, job) {
  const solver = new Solver(job.options);
  const level = solver.copy().integrate(job.h, 6).step(job.h / 2).x[0];
  const found = [];
  for (let k = 0; k < 12; k++) {
    const before = solver.copy();
    solver.step(job.h);
    if (!((before.x[0] < level) !== (solver.x[0] < level))) continue;
    let [low, high] = [0, 1];
    for (let middle = 0.5; low < middle && middle < high; middle = (low + high) / 2) {
      const same = (before.copy().step(middle * job.h).x[0] < level) === (before.x[0] < level);
      [low, high] = same ? [middle, high] : [low, middle];
    }
    const there = before.copy().step(high * job.h);
    found.push({ t: there.t, x: [...there.x], attitude: [...(there.attitude ?? [])], steps: there.steps });
  }
  return { level, found };
}

/** Whether a copy of a solver on its way goes on as that does, to rounding, and leaves it alone. */
function copied(Solver, job) {
  const solver = new Solver(job.options).integrate(job.h, 3);
  const state = () => JSON.stringify([solver.x, solver.carry, solver.t, solver.steps, solver.attitude ?? 0]);
  const before = state();
  const twin = solver.copy().integrate(job.h, 2);
  const alone = state() === before;
  solver.integrate(job.h, 2);
  const ends = [solver, twin].map((s) => [...s.x, s.t, s.steps, ...(s.attitude ?? [])]);
  return { alone, ends };
}

async function answer(job) {
  const { Solver, StepError } = await import(job.module);
  const made = attempted(() => new Solver(job.options));
  if (!made.value) return { made, isStepError: made.name === "StepError" };
  const solver = made.value;
  const start = [...solver.x];
  const done = attempted(() => solver.integrate(job.h, job.steps).steps);
  const { NAME, VERSION, SPEC_SHA256, DIM, ORDER, COORDINATES, CASIMIRS, DEFAULT_PARAMETERS } = Solver;
  return {
    done,
    start,
    x: [...solver.x],
    carry: [...solver.carry],
    t: solver.t,
    steps: solver.steps,
    evaluations: solver.evaluations,
    gauge: [...(solver.gauge ?? [])],
    energy: solver.hamiltonian(),
    casimirs: [...solver.casimirs()],
    field: [...solver.vectorField()],
    modified: solver.modifiedHamiltonian?.(job.h, start),
    facts: { NAME, VERSION, SPEC_SHA256, DIM, ORDER, COORDINATES, CASIMIRS, DEFAULT_PARAMETERS },
    exports: typeof StepError,
    remembered: attempted(() => remembered(Solver, job)).value,
    carried: attempted(() => carried(Solver, job)).value,
    growth: Math.abs(solver.hamiltonian() / solver.hamiltonian(start)),
    tangent: varied(Solver, job),
    many: many(Solver, job, start),
    each: each(Solver, job, start),
    copied: attempted(() => copied(Solver, job)).value,
    crossings: attempted(() => crossings(Solver, job)).value,
    moved: attempted(() => moved(Solver, job, "tCarry" in solver)).value,
  };
}

/** The answers to jobs, as JSON in which NaN has its name. */
export async function answers(jobs) {
  const found = [];
  for (const job of jobs) found.push(await answer(job));
  return JSON.stringify(found, (_, value) => (Number.isNaN(value) ? "NaN" : value));
}
