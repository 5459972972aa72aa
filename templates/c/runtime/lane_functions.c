#ifndef PHI_FILE_LANE_FUNCTIONS
#define PHI_FILE_LANE_FUNCTIONS
#if PHI_SINGLE
#include "lane_functions_single.c"
#else
#include "lane_functions_double.c"
#endif
#endif
