/** The numbers of sites and of pairs. */
export function countsOf(sites) {
  return { sites: sites.count, pairs: (sites.count * (sites.count - 1)) / 2 };
}
