#ifndef PHI_FILE_DEVICE_SOLVER_H
#define PHI_FILE_DEVICE_SOLVER_H
#include "history_gauss.h"
#include "history_differences.h"

/* A solver in the memory of one work item. */
typedef struct {
#include "state_members.h"
} phi_solver;
#endif
