#ifndef PHI_FILE_LATTICES
#define PHI_FILE_LATTICES
/* What code of lattices says of the row that r is the number of, or that a piece is of. One row has no number and no place. */
#if PHI_ONE_ROW
#define PHI_EACH_ROW
#define PHI_WHOLE_ROW phi_row_of(s)
#define PHI_ROW_AT(first) first
#define PHI_VALUES_AT(first) first
#define PHI_HERE(first) first
#define PHI_SITE(i) i
#define PHI_DOUBLES (size_t)s->width
#define PHI_BEYOND s->width
#define PHI_LAST_AXIS 0
#else
#define PHI_EACH_ROW for (size_t r = 0; r < s->rows; ++r)
#define PHI_WHOLE_ROW phi_piece_of(s, r)
#define PHI_ROW_AT(first) first + (ptrdiff_t)r * s->width
#define PHI_VALUES_AT(first) first + r * (size_t)s->length
#define PHI_HERE(first) first + row.at[0]
#define PHI_SITE(i) row.at[0] + i
#define PHI_DOUBLES s->rows * (size_t)s->width
#define PHI_BEYOND (ptrdiff_t)s->rows * s->width
#define PHI_LAST_AXIS PHI_AXES - 1
#endif

/* What lies beside the sites of a row: nothing, where no site reads of others along it. */
#if PHI_HALO
#define PHI_MEMORY_OF(first) first - PHI_LEAD
#define PHI_FIRST_SITE(memory) memory + PHI_LEAD
#define PHI_LEAST -PHI_LEAD
#define PHI_FIRST_COPY(site) site - PHI_HALO
#define PHI_LEAST_COPY -PHI_HALO
#define PHI_AND_COPIES(sites) sites + PHI_HALO
#define PHI_WITH_COPIES(sites) sites + 2 * PHI_HALO
#else
#define PHI_MEMORY_OF(first) first
#define PHI_FIRST_SITE(memory) memory
#define PHI_LEAST 0
#define PHI_FIRST_COPY(site) site
#define PHI_LEAST_COPY 0
#define PHI_AND_COPIES(sites) sites
#define PHI_WITH_COPIES(sites) sites
#endif

/* Whether arguments of functions may be large, where functions have another form for them. */
#if PHI_NEAR
#define PHI_AND_FAR(far) , far
#define PHI_AND_INT_FAR , int far
#else
#define PHI_AND_FAR(far)
#define PHI_AND_INT_FAR
#endif

/* Each stage has a guess of its own, if there are any. */
#if PHI_GUESSES
#define PHI_AND_GUESS PHI_AND_STAGE
#else
#define PHI_AND_GUESS
#endif
#endif
