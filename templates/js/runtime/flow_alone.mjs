/** Compute the increment of the state by a flow. */
export function applyFlow(flow, row, at, change) {
  flow(row, at, change);
}
