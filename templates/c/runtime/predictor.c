#ifndef PHI_FILE_PREDICTOR
#define PHI_FILE_PREDICTOR
#include <math.h>
#include <string.h>
#include "model.h"
#include "recurrence.c"

/* ---- Predictors ---- */
#include "predictor_policy.h"

#include "predictor_recurrences.c"
#include "predictor_differences.c"
#include "device_predictor.c"

#endif
