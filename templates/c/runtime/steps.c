#ifndef PHI_FILE_STEPS
#define PHI_FILE_STEPS
#include "newton.c"
#include "path.c"
#include "gauss.c"
#include "explicit.c"
#include "splitting.c"
#endif
