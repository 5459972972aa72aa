import { identityElement } from "./attitude_matrices.mjs";
import { ROWS } from "./model.mjs";

/** Subtract G (G^T G - 1)/2 from `carry`: G + `carry` is then nearer to an orthogonal matrix than G. */
export function normalise(g, carry) {
  for (let i = 0; i < ROWS; i++) {
    for (let j = 0; j < ROWS; j++) {
      let excess = i === j ? -1 : 0;
      for (let k = 0; k < ROWS; k++) excess += g[k * ROWS + i] * g[k * ROWS + j];
      for (let k = 0; k < ROWS; k++) carry[k * ROWS + j] -= 0.5 * (g[k * ROWS + i] * excess);
    }
  }
}

/** Correct a matrix so that 1 + element, which is nearly orthogonal, is nearer to an orthogonal matrix. */
export function makeOrthogonal(element) {
  normalise(identityElement().map((one, i) => one + element[i]), element);
}
