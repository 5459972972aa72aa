/** Append a position in space, by default the origin, to the numbers of an attitude. */
export function addPosition(numbers, position) {
  numbers.push(...(position ?? [0, 0, 0]));
}
