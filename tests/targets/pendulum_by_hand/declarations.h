/* A pendulum, H = p^2/2 - g cos q, as a hand-written model for the runtime in templates/c/runtime. One of PHI_NEWTON, PHI_PATH,
   PHI_EXPLICIT, PHI_SPLITTING and PHI_GAUSS is given, and others that are wanted; of these switches, generated files have no traces. */
#ifndef DECLARATIONS_H
#define DECLARATIONS_H
#include <stddef.h>
#include <stdint.h>

#define PHI_DIM 2
#define PHI_CASIMIRS 0

#ifndef PHI_NEWTON
#define PHI_NEWTON 0
#endif
#ifndef PHI_PATH
#define PHI_PATH 0
#endif
#ifndef PHI_EXPLICIT
#define PHI_EXPLICIT 0
#endif
#ifndef PHI_SPLITTING
#define PHI_SPLITTING 0
#endif
#ifndef PHI_GAUSS
#define PHI_GAUSS 0
#endif
#define PHI_STAGED 0
#define PHI_FRAMED 0
#define PHI_REDUCED 0
#define PHI_LIFTED 0
enum { PHI_NODES = 1, PHI_WIDTH = 1, PHI_UNKNOWNS = 2, PHI_DIFFERENCES = 9 };
#ifndef PHI_COMPOSED
#define PHI_COMPOSED 0
#endif
#ifndef PHI_FAST
#define PHI_FAST 0
#endif
#ifndef PHI_TANGENT
#define PHI_TANGENT 0
#endif
#ifndef PHI_ADJOINT
#define PHI_ADJOINT 0
#endif
#ifndef PHI_ATTITUDE
#define PHI_ATTITUDE 0
#endif
#ifndef PHI_MATRICES
#define PHI_MATRICES 0
#endif
#ifndef PHI_SPATIAL
#define PHI_SPATIAL 0
#endif
#define PHI_POSITION (PHI_ATTITUDE && !PHI_MATRICES)
#define PHI_EXPONENTIAL PHI_MATRICES
#define PHI_TURNED_BY_COVECTOR PHI_MATRICES
#define PHI_NORMALISE PHI_ATTITUDE
#define PHI_RATE_OF_GAUGE PHI_ATTITUDE
#ifndef PHI_NOISE
#define PHI_NOISE 0
#endif
#define PHI_IMPLICIT (PHI_NEWTON || PHI_PATH)
#define PHI_PREDICTED ((PHI_IMPLICIT || PHI_GAUSS) && !PHI_NOISE)
#define PHI_PARAMETERS 1
#define PHI_KICKS 0
#ifndef PHI_GAUGE
#define PHI_GAUGE 0
#endif
#define PHI_GAUGE_SEARCH (PHI_GAUGE && PHI_FAST)
#define PHI_KICKED 1
#define PHI_ENSEMBLE 1
#define PHI_EACH (PHI_FAST || PHI_TANGENT)
#define PHI_RELATIVE 0
#define PHI_MODIFIED 0
#define PHI_ADVANCE 1
#define PHI_UNROLLED 0
#define PHI_RECURRENCES (!PHI_GAUSS && PHI_FAST && PHI_PREDICTED)
#define PHI_BLOCKS PHI_RECURRENCES
#define PHI_GROUPS PHI_BLOCKS
#define PHI_TRACED (PHI_IMPLICIT && PHI_ADJOINT && PHI_FAST)
#define PHI_NARROW 0
#define PHI_ALONG 0
#define PHI_PACKS (PHI_FAST && !PHI_IMPLICIT)
#define PHI_FAR 0
#define PHI_BATCHED ((PHI_PACKS || PHI_GROUPS) && PHI_ADJOINT)
#define PHI_SPARSE 0
#define PHI_SWEPT 0
#define PHI_CENTRED 0
#define PHI_INVERSE_UNROLLED 0
#define PHI_CALLS_EXP 1
#define PHI_CALLS_EXPM1 1
#define PHI_CALLS_LOG 1
#define PHI_CALLS_SIN 1
#define PHI_CALLS_COS 1
#define PHI_TAYLOR_PRODUCT 0
#define PHI_TAYLOR_CHAIN 0
#define PHI_TAYLOR_POWER 0

typedef struct {
    double g;
} phi_params;

extern const phi_params phi_default_params;

double phi_hamiltonian(const phi_params *params, const double x[2]);
void phi_casimirs(const phi_params *params, const double x[2], double out[]);
void phi_vector_field(const phi_params *params, const double x[2], double out[2]);

#if PHI_COMPOSED
enum { PHI_STAGES = 3 };
#endif
enum { PHI_COEFFICIENTS = PHI_SPLITTING ? 4 : 2, PHI_TRAIL = (PHI_SPLITTING || PHI_COMPOSED ? 3 : PHI_GAUSS ? 2 : 1) * PHI_DIM };
enum { PHI_TRAIL_EACH = PHI_TRAIL * (PHI_SPLITTING || !PHI_BATCHED ? 1 : PHI_EXPLICIT ? 32 : 8) };
enum { PHI_GAUGES = 2 };
#if PHI_MATRICES
enum { PHI_ATTITUDE_SIZE = 9, PHI_ELEMENT = 9, PHI_COVECTOR = 4, PHI_RATE = 4, PHI_ROWS_OF_ATTITUDE = 3 };
#else
enum { PHI_ATTITUDE_SIZE = 4, PHI_ELEMENT = 7, PHI_RATE = 6 };
#endif
#if PHI_NOISE
#include <stdint.h>
#define PHI_BOUND 6.0
enum { PHI_SOURCES = 1, PHI_DRAWS = 2, PHI_PARTS = 2 };
#endif
enum { PHI_REMEMBERED = 111, PHI_WINDOW = 40, PHI_AHEAD = PHI_BLOCKS ? 8 : 1 };
#endif
