/** Names of the fields of a solver that a step changes. */
// #state saved

/** Return copies of the fields of a solver that a step changes. */
export function savedState(solver) {
  const copies = SAVED.map((name) => [name, solver[name].slice ? solver[name].slice() : solver[name]]);
  return Object.fromEntries(copies);
}

/** Restore the fields of a solver that a step changes, from copies. */
export function restoreState(solver, copies) {
  for (const [name, value] of Object.entries(copies)) {
    if (value.slice) solver[name].set(value);
    else solver[name] = value;
  }
}
