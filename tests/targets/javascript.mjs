// What solvers say: reads jobs from the file named first, writes one answer for each to stdout, as JSON.

import { readFileSync } from "node:fs";

function attempted(work) {
  try {
    return { value: work() };
  } catch (error) {
    return { status: error.status ?? "none", steps: error.steps, name: error.name, message: error.message };
  }
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
  };
}

const jobs = JSON.parse(readFileSync(process.argv[2], "utf8"));
const answers = [];
for (const job of jobs) answers.push(await answer(job));
process.stdout.write(JSON.stringify(answers, (_, value) => (Number.isNaN(value) ? "NaN" : value)));
