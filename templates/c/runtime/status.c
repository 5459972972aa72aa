#ifndef PHI_FILE_STATUS
#define PHI_FILE_STATUS
#include "status.h"

const char *phi_status_string(phi_status status)
{
    switch (status) { /* a table of pointers would need relocation when the library is loaded */
    case PHI_OK: return "ok";
    case PHI_NO_CONVERGENCE: return "no convergence: the step is too large";
    case PHI_SINGULAR: return "singular Newton matrix: the step is too large";
    case PHI_NOT_FINITE: return "not finite: overflow, or outside the domain";
    case PHI_BAD_ARGUMENT: return "bad argument: a null pointer, or values that are not allowed";
#if PHI_ASKED
    case PHI_STOPPED: return "stopped, as was asked";
#endif
    default: return "unknown status";
    }
}
#endif
