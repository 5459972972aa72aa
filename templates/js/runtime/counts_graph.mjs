/** The numbers of sites and of bonds. */
export function countsOf(sites) {
  return { sites: sites.count, bonds: sites.bondCount };
}
