/** Append a position in space, the origin by default, to the numbers of an attitude. */
export function addPosition(numbers, position) {
  numbers.push(...(position ?? [0, 0, 0]));
}
