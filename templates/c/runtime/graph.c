#ifndef PHI_FILE_GRAPH
#define PHI_FILE_GRAPH
#include <limits.h>

#include "lattice.h"
#include "model.h"

/* ---- Bonds ---- */
/* Whether the numbers of sites and of ends of bonds fit into int. */
static int phi_few(size_t sites, size_t bonds) { return sites < INT_MAX && bonds < INT_MAX / 2; }

/* Number of bytes for tables of sites and bonds; in memory they follow the rows of fields. */
static size_t phi_graph_size(size_t sites, size_t bonds)
{
#if PHI_BY_COLOUR
    const size_t integers = 4 * sites + 1 + 4 * bonds;
#else
    const size_t integers = 2 * sites + 1 + 4 * bonds;
#endif
#if PHI_BOND_PARAMETERS
    return PHI_BOND_ARRAYS * 2 * bonds * sizeof(double) + integers * sizeof(int);
#else
    return integers * sizeof(int);
#endif
}

/* Whether each bond connects two different sites of the lattice. */
static int phi_connected(const phi_bonds *bonds, size_t sites)
{
    if (!phi_few(sites, bonds != NULL ? bonds->count : 0)) return 0;
    if (bonds == NULL || bonds->ends == NULL) return bonds == NULL || bonds->count == 0;
    for (size_t k = 0; k < bonds->count; ++k) {
        const size_t a = bonds->ends[2 * k], b = bonds->ends[2 * k + 1];
        if (a >= sites || b >= sites || a == b) return 0;
    }
    return 1;
}

/* Give each site the first colour that no earlier neighbour by bonds has. used_by is working memory. */
static void phi_colour(phi_solver *s, int *used_by)
{
    const int sites = (int)s->sites;
    s->colour_count = 2;
    for (int i = 0; i < sites; ++i) used_by[i] = -1;
    for (int i = 0; i < sites; ++i) {
        for (int k = s->bonds[i]; k < s->bonds[i + 1]; ++k)
            if (s->other[k] < i) used_by[s->colours[s->other[k]]] = i;
        int colour = 0;
        while (used_by[colour] == i) ++colour;
        s->colours[i] = colour;
        if (colour >= s->colour_count) s->colour_count = colour + 1;
    }
    s->flows = 0;
    for (size_t part = 0; part < sizeof phi_by_colour; ++part) s->flows += phi_by_colour[part] ? s->colour_count : 1;
}

/* Make the table of bonds: for each site, in order, the bonds that start there, then those that end there. */
static void phi_connect(phi_solver *s, const phi_bonds *bonds, double *memory)
{
    const size_t sites = s->sites, count = bonds != NULL ? bonds->count : 0;
#if PHI_BOND_PARAMETERS
    for (int p = 0; p < PHI_BOND_ARRAYS; ++p) s->at_bonds[p] = memory + (size_t)p * 2 * count;
    memory += PHI_BOND_ARRAYS * 2 * count;
#endif
    s->bonds = (int *)(void *)memory;
    s->middle = s->bonds + sites + 1;
    s->other = s->middle + sites;
    s->number = s->other + 2 * count;
    memset(s->bonds, 0, (2 * sites + 1) * sizeof *s->bonds);
    for (size_t k = 0; k < 2 * count; ++k) ++(k % 2 == 0 ? s->bonds : s->middle)[bonds->ends[k]];
    int end = 0; /* number of ends of bonds at the sites so far */
    for (size_t i = 0; i < sites; ++i) {
        s->bonds[i] = end += s->bonds[i];
        s->middle[i] = end += s->middle[i];
    }
    s->bonds[sites] = end;
    for (size_t k = count; k-- > 0;) { /* in reverse: the entries of a site are placed last to first */
        const size_t a = bonds->ends[2 * k], b = bonds->ends[2 * k + 1];
        const int begins = --s->bonds[a], ends = --s->middle[b];
        s->other[begins] = (int)b;
        s->other[ends] = (int)a;
        s->number[begins] = s->number[ends] = (int)k;
    }
#if PHI_BY_COLOUR
    s->colours = s->number + 2 * count;
    phi_colour(s, s->colours + sites);
#endif
}
#endif
