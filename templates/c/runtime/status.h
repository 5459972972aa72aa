#ifndef PHI_FILE_STATUS_H
#define PHI_FILE_STATUS_H
/* How a step ends; phi_status_string says it in words. */
#if PHI_ASKED
typedef enum { PHI_OK = 0, PHI_NO_CONVERGENCE, PHI_SINGULAR, PHI_NOT_FINITE, PHI_BAD_ARGUMENT, PHI_STOPPED } phi_status;
#else
typedef enum { PHI_OK = 0, PHI_NO_CONVERGENCE, PHI_SINGULAR, PHI_NOT_FINITE, PHI_BAD_ARGUMENT } phi_status;
#endif
#endif
