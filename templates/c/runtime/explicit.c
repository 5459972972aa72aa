#ifndef PHI_FILE_EXPLICIT
#define PHI_FILE_EXPLICIT
#include <math.h>
#include <string.h>

#include "algebra.c"
#include "model.h"

#include "explicit_stage.c"
#endif
