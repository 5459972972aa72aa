import { DIM, explicit, explicitTangent } from "./model.mjs";

// ---- The derivative of an explicit stage ----

/** The derivative of a stage, 1 + the Jacobian of the increment, and the increment as change. */
export function differentiateStage(solver, stage, at) {
  const change = new Float64Array(DIM);
  const derivative = new Float64Array(DIM * DIM);
  explicit(solver.coef[stage], at.x, change);
  explicitTangent(solver.coef[stage], at.x, derivative);
  for (let i = 0; i < DIM; i++) derivative[i * DIM + i] += 1;
  return { status: "OK", change, derivative };
}
