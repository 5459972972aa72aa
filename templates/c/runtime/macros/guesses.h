#ifndef PHI_FILE_GUESSES
#define PHI_FILE_GUESSES
/* Each stage of a lattice has a guess of its own, if there are any. */
#if PHI_GUESSES
#define PHI_AND_GUESS PHI_AND_STAGE
#else
#define PHI_AND_GUESS
#endif
#endif
