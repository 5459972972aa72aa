import { applyFlow } from "./flow_alone.mjs";
import { DIM, FLOWS, TANGENTS } from "./model.mjs";
import { flowsOfRun } from "./run_plain.mjs";
import { identity, multiplied } from "./tangent.mjs";

// ---- The derivative of a step of flows ----

/**
 * The derivative of a step, which is the product of the derivatives of its flows, and the increment of the
 * step as `change`.
 */
export function differentiateStage(solver, stage, at) {
  const y = Float64Array.from(at.x);
  const displacement = Float64Array.from(at.carry);
  const increment = new Float64Array(DIM);
  const slope = new Float64Array(DIM * DIM);
  const derivative = identity();
  for (const [part, row] of flowsOfRun()) {
    TANGENTS[part](solver.coef[0][row], y, slope);
    applyFlow(FLOWS[part], solver.coef[0][row], y, increment);
    const product = multiplied(slope, derivative);
    for (let k = 0; k < DIM * DIM; k++) derivative[k] += product[k];
    for (let i = 0; i < DIM; i++) {
      displacement[i] += increment[i];
      y[i] = at.x[i] + displacement[i];
    }
  }
  return { status: "OK", change: displacement.map((value, i) => value - at.carry[i]), derivative };
}
