#ifndef PHI_FILE_LANE_FUNCTIONS
#define PHI_FILE_LANE_FUNCTIONS
#include "lane_functions_single.c"
#include "lane_functions_double.c"
#endif
