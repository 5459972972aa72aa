import { StepError } from "./errors.mjs";
import { NONNEGATIVE } from "./model.mjs";

/** Throw StepError for a negative value of a parameter that must not be negative. */
export function expectNonnegative(name, value) {
  if (value < 0 && NONNEGATIVE.includes(name)) {
    throw new StepError("BAD_ARGUMENT", 0, `the parameter ${name} is ${value}, which is negative`);
  }
}
