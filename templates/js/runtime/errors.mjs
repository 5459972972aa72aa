// ---- Errors ----

/** The meaning of each status, for error messages. */
const STATUS = {
  NO_CONVERGENCE: "no convergence: the step is too large",
  SINGULAR: "singular Newton matrix: the step is too large",
  NOT_FINITE: "not finite: overflow, or outside the domain",
  BAD_ARGUMENT: "bad argument",
};

/** Error: a step failed, or an argument is not admissible. A failed step leaves the state unchanged. */
export class StepError extends Error {
  /**
   * @param {"NO_CONVERGENCE" | "SINGULAR" | "NOT_FINITE" | "BAD_ARGUMENT"} status
   * @param {number} steps number of successful steps before the failure
   * @param {string} [detail]
   */
  constructor(status, steps, detail = "") {
    super(`step ${steps}: ${STATUS[status]}${detail && `: ${detail}`}`);
    this.name = "StepError";
    this.status = status;
    this.steps = steps;
  }
}

/** Throw StepError if an option is unknown, unless its value is undefined or null. */
export function expectOptions(options, known) {
  const given = Object.keys(options).filter((name) => (options[name] ?? null) !== null);
  const unknown = given.find((name) => !known.includes(name));
  if (unknown === undefined) return;
  throw new StepError("BAD_ARGUMENT", 0, `there is no option ${unknown}; options are ${known.join(", ")}`);
}

/**
 * Return a copy of values. Throws StepError unless the values are `length` finite numbers; the error message
 * calls them `what`.
 */
export function finite(values, length, what) {
  const copy = Float64Array.from(values ?? []);
  if (copy.length === length && copy.every(Number.isFinite)) return copy;
  throw new StepError("BAD_ARGUMENT", 0, `${what} must be ${length} finite numbers`);
}
