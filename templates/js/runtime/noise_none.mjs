/** Contribution of noise to the size of an increment of the state: 0, since there is no noise. */
export function sizeOfNoise() {
  return 0;
}
