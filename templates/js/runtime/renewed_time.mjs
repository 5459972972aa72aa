import { refresh } from "./model.mjs";

/** The coefficients that are functions of the time. */
export function refreshAt(row, t, dw, out) {
  refresh(row, t, out);
}
