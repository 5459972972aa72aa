import { solve } from "./linear.mjs";
import { DIM, MAX_ITERATIONS, linearise } from "./model.mjs";
import { relativeSize } from "./newton.mjs";
import { identity, multiplied } from "./tangent.mjs";
import { solvedForAll, tangentSolved } from "./tangent_solve.mjs";

// ---- The derivative of an implicit stage ----

/**
 * The derivative of a stage, 1 + incrementJacobian Dy, and the increment of the stage as `change`. The
 * derivative Dy of y by x is jacobian^-1, by the equation alpha(y) = x of the stage. The solution y is first
 * refined to rounding level, starting from the stored value.
 */
export function differentiateStage(solver, stage, at) {
  const y = solver.history[stage].last();
  const [side, displacement, change] = [0, 0, 0].map(() => new Float64Array(DIM));
  const [jacobian, slope] = [0, 0].map(() => new Float64Array(DIM * DIM));
  let previous = Infinity;
  for (let iteration = 0; ; iteration++) {
    linearise(solver.coef[stage], y, displacement, change, jacobian, slope);
    for (let i = 0; i < DIM; i++) side[i] = y[i] - at.x[i] + displacement[i] - at.carry[i];
    if (!solve(Float64Array.from(jacobian), side)) return { status: "SINGULAR" };
    const size = relativeSize(y, side);
    if (!Number.isFinite(size)) return { status: "NOT_FINITE" };
    if (tangentSolved(size, previous)) break;
    if (iteration === MAX_ITERATIONS) return { status: "NO_CONVERGENCE" };
    for (let i = 0; i < DIM; i++) y[i] -= side[i];
    previous = size;
  }
  const inverse = solvedForAll(jacobian, identity());
  if (!inverse) return { status: "SINGULAR" };
  const derivative = multiplied(slope, inverse);
  for (let i = 0; i < DIM; i++) derivative[i * DIM + i] += 1;
  return { status: "OK", change, derivative };
}
