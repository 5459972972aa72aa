import { refresh } from "./model.mjs";

/** The coefficients that depend on the time. */
export function refreshAt(row, t, dw, out) {
  refresh(row, t, out);
}
