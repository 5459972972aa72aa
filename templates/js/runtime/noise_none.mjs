/** The size of the increments of the state by the noise: there is none. */
export function sizeOfNoise() {
  return 0;
}
