#include "device_language.h"
#include "device_declarations.h"
#include "status.h"

#if defined(__OPENCL_VERSION__) || defined(__CUDACC__) || defined(__HIP__)
#include "device_solver.h"
#include "device_memory.c"
#include "model.h"
#include "device_solver.c"
#include "device_ensemble.c"
#endif
