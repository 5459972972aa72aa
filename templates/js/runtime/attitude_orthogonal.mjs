import { identityElement } from "./attitude_matrices.mjs";
import { ROWS } from "./model.mjs";

/** Bring a nearly orthogonal matrix G nearer to an orthogonal one: subtract G (G^T G - 1)/2. */
export function normalise(g, carry) {
  for (let i = 0; i < ROWS; i++) {
    for (let j = 0; j < ROWS; j++) {
      let excess = i === j ? -1 : 0;
      for (let k = 0; k < ROWS; k++) excess += g[k * ROWS + i] * g[k * ROWS + j];
      for (let k = 0; k < ROWS; k++) carry[k * ROWS + j] -= 0.5 * (g[k * ROWS + i] * excess);
    }
  }
}

/** Correct a matrix, given minus 1, whose sum with 1 is nearly orthogonal. */
export function makeOrthogonal(element) {
  normalise(identityElement().map((one, i) => one + element[i]), element);
}
