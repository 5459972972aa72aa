// What solvers of lattices say: one answer for each job, as JSON.

function attempted(work) {
  try {
    return { value: work() };
  } catch (error) {
    return { status: error.status ?? "none", steps: error.steps, name: error.name, message: error.message };
  }
}

async function answer({ module, options, h, steps, vectors }) {
  const { Solver } = await import(module);
  if (options.seed !== undefined) options.seed = BigInt(options.seed);
  const made = attempted(() => new Solver(options));
  if (!made.value) return made;
  const solver = made.value;
  if (vectors) {
    const unlike = attempted(() => solver.stepTangent(h, [[1]]));
    return { unlike, carried: solver.stepTangent(h, vectors).map((v) => [...v]), after: [...solver.x] };
  }
  const done = attempted(() => solver.integrate(h, steps).steps);
  const { NAME, AXES, COORDINATES, CASIMIRS, CASIMIR_KINDS, DEFAULT_PARAMETERS } = Solver;
  const seen = { energy: solver.hamiltonian(), density: [...solver.density()], casimirs: [...solver.casimirs()] };
  Object.assign(seen, { t: solver.t, field: [...solver.vectorField()], first: [...solver.field(COORDINATES[0])] });
  const x = [...solver.x];
  const failure = attempted(() => solver.step(1e300).steps);
  return {
    ...seen,
    done,
    x,
    stiff: Boolean(solver.past.stiff),
    failure,
    kept: solver.x.every((v, k) => Object.is(v, x[k])),
    facts: { NAME, AXES, COORDINATES, CASIMIRS, CASIMIR_KINDS, DEFAULT_PARAMETERS },
  };
}

/** The answers to jobs, as JSON in which NaN has its name. */
export async function answers(jobs) {
  const found = [];
  for (const job of jobs) found.push(await answer(job));
  return JSON.stringify(found, (_, value) => (Number.isNaN(value) ? "NaN" : value));
}
