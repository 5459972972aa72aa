#ifndef PHI_FILE_LATTICE_PIECES
#define PHI_FILE_LATTICE_PIECES
/* Stands before loops over row segments: threads share the iterations. */
#ifdef _OPENMP
#if PHI_PAIRS
#define PHI_EACH_PIECE _Pragma("omp parallel for if (s->sites > 512)")
#else
#define PHI_EACH_PIECE _Pragma("omp parallel for if (s->sites > 4096)")
#endif
#define PHI_ONE_BY_ONE _Pragma("omp critical")
#else
#define PHI_EACH_PIECE
#define PHI_ONE_BY_ONE
#endif
#endif
