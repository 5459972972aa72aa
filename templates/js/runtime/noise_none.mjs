/** Size of the increment of the state by noise: 0, since there is no noise. */
export function sizeOfNoise() {
  return 0;
}
