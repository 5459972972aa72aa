import { collocate, endOf, mixed, stages, startOf } from "./gauss.mjs";
import { History } from "./gauss.mjs";
import { TANGENT_NEARLY_SOLVED, TANGENT_SHRINKING, TANGENT_SOLVED } from "./gauss_tangent_policy.mjs";
import { DIM, MAX_SWEEPS, MIXING, UNKNOWNS, WEIGHTS } from "./model.mjs";
import { stageChange, stageChangeJacobian, stageSlopeJacobian } from "./model.mjs";

// ---- The derivative of a step ----

const WIDE = DIM + UNKNOWNS;

/**
 * The derivatives of the stage increments by coordinate j at the start of the step. They solve linear
 * equations, by fixed-point sweeps. The result is null if the sweeps do not converge.
 */
function variedAlong(solver, slopes, j) {
  const [z, increments] = [stages(), stages()];
  let previous = Infinity;
  for (let sweep = 0; sweep <= MAX_SWEEPS; sweep++) {
    let [change, size] = [0, Number.MIN_VALUE];
    for (let i = 0; i < increments.length; i++) {
      for (let k = 0; k < UNKNOWNS; k++) {
        let sum = slopes[i][k * WIDE + j];
        for (let l = 0; l < UNKNOWNS; l++) sum += slopes[i][k * WIDE + DIM + l] * z[i][l];
        sum *= solver.h * WEIGHTS[i];
        change = Math.max(change, Math.abs(sum - increments[i][k]));
        size = Math.max(size, Math.abs(sum));
        increments[i][k] = sum;
      }
    }
    if (!Number.isFinite(size)) return null;
    mixed(MIXING, increments, z);
    if (change <= TANGENT_SOLVED * size) return increments;
    if (change <= TANGENT_NEARLY_SOLVED * size && change > TANGENT_SHRINKING * previous) return increments;
    previous = change;
  }
  return null;
}

/** The derivative and the increment of the step that the solver has made from the state at. */
export function differentiateStage(solver, stage, at) {
  const twin = { ...at, t: at.t, coef: solver.coef, h: solver.h, evaluations: 0 };
  const start = startOf(twin);
  const increments = { now: stages(), next: stages() };
  const status = collocate(twin, stage, start, new History(), increments);
  if (status !== "OK") return { status };
  const z = stages();
  mixed(MIXING, increments.now, z);
  const slopes = z.map((node) => {
    const jacobian = new Float64Array(UNKNOWNS * WIDE);
    stageSlopeJacobian(solver.coef[stage], start, node, jacobian);
    return jacobian;
  });
  const end = endOf(increments.now);
  const change = new Float64Array(DIM);
  const outer = new Float64Array(DIM * WIDE);
  stageChange(solver.coef[stage], start, end, change);
  stageChangeJacobian(solver.coef[stage], start, end, outer);
  const derivative = new Float64Array(DIM * DIM);
  for (let j = 0; j < DIM; j++) {
    const varied = variedAlong(solver, slopes, j);
    if (!varied) return { status: "NO_CONVERGENCE" };
    const along = endOf(varied);
    for (let i = 0; i < DIM; i++) {
      let sum = outer[i * WIDE + j] + (i === j ? 1 : 0);
      for (let k = 0; k < UNKNOWNS; k++) sum += outer[i * WIDE + DIM + k] * along[k];
      derivative[i * DIM + j] = sum;
    }
  }
  return { status: "OK", change, derivative };
}
