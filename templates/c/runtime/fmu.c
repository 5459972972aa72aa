#ifndef PHI_FILE_FMU
#define PHI_FILE_FMU
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "solver.h"
#include "fmu_model.h"

/* ---- Types of FMI, unless the headers of the standard are included before. C types are written directly, such as double
   for fmi3Float64 ---- */

#ifndef fmi3Functions_h
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum { fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent } fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;
typedef void (*fmi3LogMessageCallback)(void *environment, fmi3Status status, const char *category, const char *message);
typedef void (*fmi3IntermediateUpdateCallback)(void *environment, double time, bool set_requested, bool get_allowed,
    bool step_finished, bool can_return_early, bool *early_return_requested, double *early_return_time);
#endif
#ifndef fmi2Functions_h
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef void (*fmi2CallbackLogger)(void *environment, const char *instance, fmi2Status status, const char *category,
    const char *message, ...);
typedef struct {
    fmi2CallbackLogger logger;
    void *(*allocateMemory)(size_t count, size_t size);
    void (*freeMemory)(void *memory);
    void (*stepFinished)(void *environment, fmi2Status status);
    void *componentEnvironment;
} fmi2CallbackFunctions;
#endif

/* ---- The model between communication points ---- */

static const double phi_fmu_slack = 1e-9;     /* times that differ by less than this fraction of a step are equal: the environment rounds communication points */
static const double phi_fmu_most_steps = 1e9; /* largest number of whole steps in a communication step; it fits any size_t */

/* Modes of an FMU, as bits, so that a sum of modes says in which of them a call is allowed. */
enum { PHI_INSTANTIATED = 1, PHI_INITIALISING = 2, PHI_STEPPING = 4, PHI_AT_EVENT = 8, PHI_TERMINATED = 16 };

/* Complete state of an FMU. It has no pointers, so a copy of it is an FMU state in the sense of FMI. */
typedef struct {
    phi_solver grid; /* solver after the last whole step, at the communication point or before */
    phi_solver now;  /* solver at the communication point, whose values are the outputs */
    double origin;   /* time of the environment minus that of the solver */
    double time;     /* time of the communication point */
    double stop;     /* no communication step may end after this time; infinity if the environment sets none */
    double step;     /* size of a whole step */
    int32_t seed;    /* seed of the random numbers */
    int32_t mode;    /* one of the modes */
} phi_fmu_state;

static void phi_fmu_reset(phi_fmu_state *f)
{
    memset(f, 0, sizeof *f);
    f->now.params = phi_start_params;
    memcpy(f->now.x, phi_start, sizeof f->now.x);
#if PHI_ATTITUDE
    memcpy(f->now.attitude, phi_start_attitude, sizeof f->now.attitude);
#endif
    f->step = phi_start_step;
    f->stop = HUGE_VAL;
    f->seed = phi_start_seed;
    f->mode = PHI_INSTANTIATED;
}

/* Time of the environment for the state of a solver. */
static double phi_fmu_time(const phi_fmu_state *f, const phi_solver *s) { return f->origin + (double)PHI_TIME_OF(s); }

/* Make the present communication point the start of the following whole steps. */
static void phi_fmu_begin_grid(phi_fmu_state *f)
{
    f->origin += f->time - phi_fmu_time(f, &f->now);
    f->grid = f->now;
}

/* Initialise the solver at the time f->time with the initial values and parameters that the environment has set. */
static phi_status phi_fmu_start(phi_fmu_state *f)
{
    phi_solver fresh;
    phi_status status = PHI_INIT_AT(&fresh, &f->now.params, f->now.x, (phi_real)f->time);
#if PHI_NOISE
    if (status == PHI_OK) status = phi_set_noise(&fresh, (uint64_t)f->seed, 0, 0);
#endif
#if PHI_ATTITUDE
    if (status == PHI_OK) status = phi_set_attitude(&fresh, f->now.attitude PHI_AND_POSITION(f->now.position));
#endif
    if (status != PHI_OK) return status;
    f->now = fresh;
    phi_fmu_begin_grid(f);
    return PHI_OK;
}

/* Times that differ from the target by less than this, by rounding, count as the target. */
static double phi_fmu_tolerance(const phi_fmu_state *f, double target)
{
    const double roundoff = (sizeof(phi_real) == sizeof(double) ? 1e-15 : 5e-7) * fmax(fabs(target), fabs(f->origin));
    return fmax(phi_fmu_slack * f->step, roundoff);
}

/* Make the whole steps that end at the target or before it, but no more than `most`. */
static phi_status phi_fmu_whole_steps(phi_fmu_state *f, double target, double most)
{
#if PHI_MONITOR
    for (double count = 0.0; count < most; ++count) {
        phi_solver next = f->grid;
        if (phi_step(&next, (phi_real)f->step) != PHI_OK) return PHI_OK; /* a part of this step may succeed */
        if (phi_fmu_time(f, &next) > target + phi_fmu_tolerance(f, target)) return PHI_OK;
        if (!(phi_fmu_time(f, &next) > phi_fmu_time(f, &f->grid))) return PHI_NO_CONVERGENCE; /* time does not advance */
        f->grid = next;
    }
    return most < phi_fmu_most_steps ? PHI_OK : PHI_BAD_ARGUMENT;
#else
    const double ahead = target - phi_fmu_time(f, &f->grid) + phi_fmu_tolerance(f, target);
    const double count = floor(ahead / f->step);
    if (!(count >= 0.0 && count <= phi_fmu_most_steps)) return PHI_BAD_ARGUMENT;
    return phi_integrate(&f->grid, (phi_real)f->step, (size_t)fmin(count, most));
#endif
}

/* Advance f->now from the last whole step to the target, by a part of a step. Newton's iteration finds the size of the
   part. It needs dt/dtau where steps are equal in a time tau; else its first result is exact. */
static phi_status phi_fmu_part(phi_fmu_state *f, double target)
{
    double part = 0.0;
    f->now = f->grid;
    for (int k = 0; k < 50; ++k) {
        const double missing = target - phi_fmu_time(f, &f->now);
        if (fabs(missing) <= phi_fmu_tolerance(f, target)) return PHI_OK;
        if (PHI_FMU_SEED != PHI_FMU_ATTITUDE) return PHI_BAD_ARGUMENT; /* noise has increments for whole steps only */
        part = fmin(fmax(part + PHI_IN_TAU(missing, f->now), 0.0), f->step);
        f->now = f->grid;
        const phi_status status = phi_step(&f->now, (phi_real)part);
        if (status != PHI_OK) return status;
    }
    return PHI_NO_CONVERGENCE;
}

/* ---- Variables, by their value references ---- */

static bool phi_fmu_within(uint32_t variable, uint32_t first, uint32_t end) { return variable >= first && variable < end; }

/* Whether a variable is the seed of the noise, the only variable that is a whole number. */
static bool phi_fmu_is_whole(uint32_t variable) { return phi_fmu_within(variable, PHI_FMU_SEED, PHI_FMU_ATTITUDE); }

/* Return the address of a variable that is stored as a number of the solver; NULL for other variables. */
static phi_real *phi_fmu_place(phi_fmu_state *f, uint32_t variable)
{
    if (phi_fmu_within(variable, PHI_FMU_STATE, PHI_FMU_PARAMETER)) return &f->now.x[variable - PHI_FMU_STATE];
    if (phi_fmu_within(variable, PHI_FMU_PARAMETER, PHI_FMU_STEP))
        return (phi_real *)(void *)&f->now.params + (variable - PHI_FMU_PARAMETER);
#if PHI_ATTITUDE
    if (phi_fmu_within(variable, PHI_FMU_ATTITUDE, PHI_FMU_POSITION)) return &f->now.attitude[variable - PHI_FMU_ATTITUDE];
#endif
#if PHI_POSITION
    if (phi_fmu_within(variable, PHI_FMU_POSITION, PHI_FMU_ENERGY)) return &f->now.position[variable - PHI_FMU_POSITION];
#endif
    return NULL;
}

/* Read a variable of the model by its value reference. Returns false if there is no such variable. */
static bool phi_fmu_get(phi_fmu_state *f, uint32_t variable, double *value)
{
    const phi_solver *s = &f->now;
    const phi_real *place = phi_fmu_place(f, variable);
    phi_real out[PHI_FMU_MOST];
    if (place != NULL) *value = (double)*place;
    else if (variable == PHI_FMU_TIME) *value = f->time;
    else if (variable == PHI_FMU_STEP) *value = f->step;
    else if (phi_fmu_is_whole(variable)) *value = f->seed;
    else if (variable == PHI_FMU_ENERGY)
        *value = (double)phi_hamiltonian(&s->params PHI_AND_T((phi_real)f->time), s->x);
    else if (phi_fmu_within(variable, PHI_FMU_CASIMIR, PHI_FMU_OBSERVABLE)) {
        phi_casimirs(&s->params, s->x, out);
        *value = (double)out[variable - PHI_FMU_CASIMIR];
    }
#if PHI_OBSERVED
    else if (phi_fmu_within(variable, PHI_FMU_OBSERVABLE, PHI_FMU_END)) {
        phi_observables(&s->params PHI_AND_T((phi_real)f->time), s->x, out);
        *value = (double)out[variable - PHI_FMU_OBSERVABLE];
    }
#endif
    else return false;
    return true;
}

/* Set a variable: parameters at any time, initial values before the start. Returns false if that is not allowed. */
static bool phi_fmu_set(phi_fmu_state *f, uint32_t variable, double value)
{
    phi_real *place = phi_fmu_place(f, variable);
    const bool parameter = phi_fmu_within(variable, PHI_FMU_PARAMETER, PHI_FMU_STEP);
    const bool allowed = f->mode <= PHI_INITIALISING || (parameter && f->mode != PHI_TERMINATED);
    if (!isfinite(value) || !allowed) return false;
    if (place != NULL) *place = (phi_real)value;
    else if (variable == PHI_FMU_STEP && value > 0.0) f->step = value;
    else if (phi_fmu_is_whole(variable) && value >= 0.0) f->seed = (int32_t)value;
    else return false;
    return true;
}

/* The checksum FNV-1a of the bytes of a state and of the token. */
static uint64_t phi_fmu_checksum(const unsigned char *state)
{
    uint64_t sum = 14695981039346656037u;
    for (size_t k = 0; k < sizeof phi_token; ++k) sum = (sum ^ (unsigned char)phi_token[k]) * 1099511628211u;
    for (size_t k = 0; k < sizeof(phi_fmu_state); ++k) sum = (sum ^ state[k]) * 1099511628211u;
    return sum;
}

/* ---- Instances ---- */

/* Functions of the environment that the FMU may call; NULL for missing ones. */
typedef struct {
    void *environment;        /* the first argument of each function */
    fmi2CallbackLogger log_2; /* logger for FMI 2.0 */
    fmi3LogMessageCallback log_3;
    fmi3IntermediateUpdateCallback update; /* called after whole steps */
} phi_fmu_callbacks;

typedef struct {
    phi_fmu_state state;
    phi_fmu_callbacks callbacks;
    char *name;
    bool logging, may_return_early;
} phi_fmu;

/* Send a message to the logger of the environment; `name` is the name of the instance. */
static void phi_fmu_say(const phi_fmu_callbacks *to, const char *name, const char *message)
{
    if (to->log_2 != NULL) to->log_2(to->environment, name, fmi2Error, "logStatusError", "%s", message);
    if (to->log_3 != NULL) to->log_3(to->environment, fmi3Error, "logStatusError", message);
}

/* Allocate an instance and a copy of its name. Returns NULL without memory, or if the token is that of another FMU. */
static phi_fmu *phi_fmu_instantiate(const char *name, const char *token, const phi_fmu_callbacks *callbacks, bool logging)
{
    const size_t letters = name == NULL ? 0 : strlen(name);
    const bool ours = token != NULL && strcmp(token, phi_token) == 0;
    phi_fmu *instance = ours ? (phi_fmu *)calloc(1, sizeof *instance + letters + 1) : NULL;
    if (instance == NULL) {
        phi_fmu_say(callbacks, name, "wrong instantiation token, no memory, or not for co-simulation");
        return NULL;
    }
    instance->name = (char *)(instance + 1);
    if (letters > 0) memcpy(instance->name, name, letters);
    instance->callbacks = *callbacks;
    instance->logging = logging;
    phi_fmu_reset(&instance->state);
    return instance;
}

/* Whether a communication step of this size may start at the time `from`: it must be the present communication point, and
   the step must end by the stop time. */
static bool phi_fmu_may_step(const phi_fmu_state *f, double from, double size)
{
    if (f->mode != PHI_STEPPING || !isfinite(from) || !(size >= 0.0) || !isfinite(size)) return false;
    const double tolerance = phi_fmu_tolerance(f, fmax(fabs(from), fabs(from + size)));
    return fabs(from - f->time) <= tolerance && from + size <= f->stop + tolerance;
}

/* Report the end of a whole step to the environment; returns whether the environment ends the communication step there. */
static bool phi_fmu_ends(const phi_fmu *instance, double time)
{
    const phi_fmu_callbacks *to = &instance->callbacks;
    bool early = false;
    double until = time;
    to->update(to->environment, time, false, true, true, instance->may_return_early, &early, &until);
    return early && instance->may_return_early && until <= time;
}

/* Make a communication step to the time target. If it fails, the state is unchanged. */
static phi_status phi_fmu_do_step(phi_fmu *instance, double target)
{
    phi_fmu_state *f = &instance->state;
    const phi_fmu_state before = *f;
    const bool reports = instance->callbacks.update != NULL;
    phi_status status = PHI_OK;
    bool ends = false;
#if PHI_PARAMETERS
    if (memcmp(&f->now.params, &f->grid.params, sizeof f->now.params) != 0) {
        status = phi_set_parameters(&f->now, &f->now.params);
        if (status == PHI_OK) phi_fmu_begin_grid(f);
    }
#endif
    if (!reports && status == PHI_OK) status = phi_fmu_whole_steps(f, target, phi_fmu_most_steps);
    while (reports && !ends && status == PHI_OK) {
        const size_t done = f->grid.steps;
        status = phi_fmu_whole_steps(f, target, 1.0);
        if (f->grid.steps == done) break;
        f->now = f->grid;
        f->time = phi_fmu_time(f, &f->grid);
        ends = f->time < target - phi_fmu_tolerance(f, target) && phi_fmu_ends(instance, f->time);
    }
    if (status == PHI_OK && !ends) {
        status = phi_fmu_part(f, target);
        f->time = target;
    }
    if (status != PHI_OK) *f = before;
    return status;
}
#include "fmu3.c"
#include "fmu2.c"
#endif
