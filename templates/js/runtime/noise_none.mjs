/** Size of the noise in the increments of the state: 0. */
export function sizeOfNoise() {
  return 0;
}
