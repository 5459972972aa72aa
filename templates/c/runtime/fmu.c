#ifndef PHI_FILE_FMU
#define PHI_FILE_FMU
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "solver.h"
#include "fmu_model.h"

/* ---- The model between communication points ---- */

/* A communication point counts as a grid point of whole steps if it is within this fraction of a step: sums of rounded
   step sizes are not exact multiples of them. */
static const double phi_fmu_slack = 1e-9;
/* Most whole steps in a communication step: the number fits a size_t on every machine. */
static const double phi_fmu_most_steps = 1e9;

typedef enum { PHI_INSTANTIATED, PHI_INITIALISING, PHI_STEPPING, PHI_AT_EVENT, PHI_TERMINATED } phi_fmu_mode;

/* Complete state of an FMU, without pointers: a copy is an FMU state. */
typedef struct {
    phi_solver grid; /* state on the grid of whole steps, at the communication point or before */
    phi_solver now;  /* state at the communication point */
    double origin;   /* time of the environment minus that of the solver */
    double time;     /* time of the communication point */
    double stop;     /* no communication step may end after this time; infinity if the environment names none */
    double step;     /* size of a whole step */
    int32_t seed;    /* seed of the random numbers */
    int32_t mode;    /* a phi_fmu_mode */
    int32_t changed; /* whether parameters or inputs have been set since the last step */
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

/* Set the times of the start and, if there is one, of the end. Returns false, with *f unchanged, if they are not
   allowed. */
static bool phi_fmu_experiment(phi_fmu_state *f, double start, bool has_stop, double stop)
{
    if (!isfinite(start) || (has_stop && !(stop >= start))) return false;
    f->time = start;
    f->stop = has_stop ? stop : HUGE_VAL;
    return true;
}

/* Time of the environment for the state of a solver. */
static double phi_fmu_time(const phi_fmu_state *f, const phi_solver *s)
{
#if PHI_MONITOR
    return f->origin + (double)phi_solver_time(s);
#else
    return f->origin + (double)s->t;
#endif
}

/* Initialise at f->time with the values that have been set. */
static phi_status phi_fmu_start(phi_fmu_state *f)
{
    phi_solver fresh;
#if PHI_TIMED
    phi_status status = phi_init_at(&fresh, &f->now.params, f->now.x, (phi_real)f->time);
    f->origin = 0.0;
#else
    phi_status status = phi_init(&fresh, &f->now.params, f->now.x);
    f->origin = f->time;
#endif
#if PHI_NOISE
    if (status == PHI_OK) status = phi_set_noise(&fresh, (uint64_t)f->seed, 0, 0);
#endif
#if PHI_POSITION
    if (status == PHI_OK) status = phi_set_attitude(&fresh, f->now.attitude, f->now.position);
#elif PHI_ATTITUDE
    if (status == PHI_OK) status = phi_set_attitude(&fresh, f->now.attitude);
#endif
    if (status != PHI_OK) return status;
    f->grid = fresh;
    f->now = fresh;
    f->changed = 0;
    return PHI_OK;
}

/* Continue from the communication point with newly set parameters: the grid of whole steps starts here. */
static phi_status phi_fmu_restart(phi_fmu_state *f)
{
    phi_solver trial; /* checks the parameters */
#if PHI_TIMED
    const phi_status status = phi_init_at(&trial, &f->now.params, f->now.x, f->now.t);
#elif PHI_GAUGE && !PHI_MONITOR
    const phi_status status = phi_init_gauge(&trial, &f->now.params, f->now.x, f->now.gauge);
#else
    const phi_status status = phi_init(&trial, &f->now.params, f->now.x);
#endif
    if (status != PHI_OK) return status;
#if PHI_MONITOR
    memcpy(f->now.gauge, trial.gauge, sizeof f->now.gauge); /* e = -H, with the new parameters */
#endif
    f->now.h = (phi_real)NAN; /* so that the next step computes the coefficients */
#if PHI_TIMED
    f->now.t = (phi_real)f->time;
#else
    f->origin += f->time - phi_fmu_time(f, &f->now);
#endif
    f->grid = f->now;
    f->changed = 0;
    return PHI_OK;
}

/* Largest distance from the target at which a time counts as the target. */
static double phi_fmu_tolerance(const phi_fmu_state *f, double target)
{
    const double roundoff = (sizeof(phi_real) == sizeof(double) ? 1e-15 : 5e-7) * fmax(fabs(target), fabs(f->origin));
    return fmax(phi_fmu_slack * f->step, roundoff);
}

#if PHI_MONITOR
/* Make one whole step, in tau, if it ends at the target or before it; `advanced` reports whether a step was made. */
static phi_status phi_fmu_whole_step(phi_fmu_state *f, double target, bool *advanced)
{
    phi_solver next = f->grid;
    const phi_status status = phi_step(&next, (phi_real)f->step);
    *advanced = status == PHI_OK && phi_fmu_time(f, &next) <= target + phi_fmu_tolerance(f, target);
    if (!*advanced) return PHI_OK; /* a step that fails may lead beyond the target: then part of it is tried */
    if (!(phi_fmu_time(f, &next) > phi_fmu_time(f, &f->grid))) return PHI_NO_CONVERGENCE; /* the time does not advance */
    f->grid = next;
    return PHI_OK;
}

/* Move the output state to the target, by part of a step beyond the grid: Newton's iteration finds the part from
   dt/dtau. */
static phi_status phi_fmu_part(phi_fmu_state *f, double target)
{
    double part = 0.0;
    f->now = f->grid;
    for (int k = 0; k < 50; ++k) {
        const double missing = target - phi_fmu_time(f, &f->now);
        if (fabs(missing) <= phi_fmu_tolerance(f, target)) return PHI_OK;
        part = fmin(fmax(part + missing / (double)phi_monitor(&f->now.params, f->now.x), 0.0), f->step);
        f->now = f->grid;
        const phi_status status = phi_step(&f->now, (phi_real)part);
        if (status != PHI_OK) return status;
    }
    return PHI_NO_CONVERGENCE;
}

/* Make all whole steps that end at the target or before it. */
static phi_status phi_fmu_whole_steps(phi_fmu_state *f, double target)
{
    bool advanced = true;
    for (double count = 0.0; count <= phi_fmu_most_steps; ++count) {
        const phi_status status = phi_fmu_whole_step(f, target, &advanced);
        if (status != PHI_OK || !advanced) return status;
    }
    return PHI_BAD_ARGUMENT;
}

#else
/* Number of whole steps that end at the target or before it; negative if there are too many. */
static double phi_fmu_ahead(const phi_fmu_state *f, double target)
{
    const double count = floor((target - phi_fmu_time(f, &f->grid) + phi_fmu_tolerance(f, target)) / f->step);
    return count >= 0.0 && count <= phi_fmu_most_steps ? count : -1.0;
}

/* Make one whole step, if it ends at the target or before it; `advanced` reports whether a step was made. */
static phi_status phi_fmu_whole_step(phi_fmu_state *f, double target, bool *advanced)
{
    const double count = phi_fmu_ahead(f, target);
    *advanced = count >= 1.0;
    if (count < 0.0) return PHI_BAD_ARGUMENT;
    return *advanced ? phi_step(&f->grid, (phi_real)f->step) : PHI_OK;
}

/* Make all whole steps that end at the target or before it. */
static phi_status phi_fmu_whole_steps(phi_fmu_state *f, double target)
{
    const double count = phi_fmu_ahead(f, target);
    return count < 0.0 ? PHI_BAD_ARGUMENT : phi_integrate(&f->grid, (phi_real)f->step, (size_t)count);
}

/* Move the output state to the target, by part of a step beyond the grid. */
static phi_status phi_fmu_part(phi_fmu_state *f, double target)
{
    const double part = target - phi_fmu_time(f, &f->grid);
    f->now = f->grid;
    if (fabs(part) <= phi_fmu_tolerance(f, target)) return PHI_OK;
#if PHI_NOISE
    return PHI_BAD_ARGUMENT; /* increments of the noise belong to whole steps */
#else
    return phi_step(&f->now, (phi_real)part);
#endif
}

#endif
/* ---- Variables ---- */

/* Read a variable of the model. Returns false if no variable has this number. */
static bool phi_fmu_get(const phi_fmu_state *f, uint32_t variable, double *value)
{
    const phi_solver *s = &f->now;
    phi_real out[PHI_FMU_MOST];
    if (variable == PHI_FMU_TIME) *value = f->time;
    else if (variable < PHI_FMU_PARAMETER) *value = (double)s->x[variable - PHI_FMU_STATE];
    else if (variable < PHI_FMU_STEP) {
        phi_params params = s->params;
        *value = (double)*phi_fmu_parameter(&params, variable - PHI_FMU_PARAMETER);
    } else if (variable == PHI_FMU_STEP) *value = f->step;
#if PHI_ATTITUDE
    else if (variable >= PHI_FMU_ATTITUDE && variable < PHI_FMU_POSITION)
        *value = (double)s->attitude[variable - PHI_FMU_ATTITUDE];
#endif
#if PHI_POSITION
    else if (variable >= PHI_FMU_POSITION && variable < PHI_FMU_ENERGY)
        *value = (double)s->position[variable - PHI_FMU_POSITION];
#endif
    else if (variable == PHI_FMU_ENERGY)
#if PHI_TIMED
        *value = (double)phi_hamiltonian(&s->params, (phi_real)f->time, s->x);
#else
        *value = (double)phi_hamiltonian(&s->params, s->x);
#endif
    else if (variable >= PHI_FMU_CASIMIR && variable < PHI_FMU_OBSERVABLE) {
        phi_casimirs(&s->params, s->x, out);
        *value = (double)out[variable - PHI_FMU_CASIMIR];
    }
#if PHI_OBSERVED
    else if (variable >= PHI_FMU_OBSERVABLE && variable < PHI_FMU_END) {
#if PHI_TIMED
        phi_observables(&s->params, (phi_real)f->time, s->x, out);
#else
        phi_observables(&s->params, s->x, out);
#endif
        *value = (double)out[variable - PHI_FMU_OBSERVABLE];
    }
#endif
    else return false;
    return true;
}

/* Set a variable: parameters at any time, initial values before the start. Returns false if that is not allowed. */
static bool phi_fmu_set(phi_fmu_state *f, uint32_t variable, double value)
{
    const bool before = f->mode <= PHI_INITIALISING;
    if (!isfinite(value) || f->mode == PHI_TERMINATED) return false;
    if (variable >= PHI_FMU_PARAMETER && variable < PHI_FMU_STEP) {
        phi_real *parameter = phi_fmu_parameter(&f->now.params, variable - PHI_FMU_PARAMETER);
        f->changed |= *parameter < (phi_real)value || *parameter > (phi_real)value;
        *parameter = (phi_real)value;
        return true;
    }
    if (!before) return false;
    if (variable >= PHI_FMU_STATE && variable < PHI_FMU_PARAMETER) f->now.x[variable - PHI_FMU_STATE] = (phi_real)value;
    else if (variable == PHI_FMU_STEP && value > 0.0) f->step = value;
#if PHI_ATTITUDE
    else if (variable >= PHI_FMU_ATTITUDE && variable < PHI_FMU_POSITION)
        f->now.attitude[variable - PHI_FMU_ATTITUDE] = (phi_real)value;
#endif
#if PHI_POSITION
    else if (variable >= PHI_FMU_POSITION && variable < PHI_FMU_ENERGY)
        f->now.position[variable - PHI_FMU_POSITION] = (phi_real)value;
#endif
    else return false;
    return true;
}

/* The seed is the only integer variable, and exists with noise only. */
static bool phi_fmu_is_whole(uint32_t variable)
{
#if PHI_NOISE
    return variable == PHI_FMU_SEED;
#else
    (void)variable;
    return false;
#endif
}

/* Read an integer variable. Returns false if no variable has this number. */
static bool phi_fmu_get_whole(const phi_fmu_state *f, uint32_t variable, int32_t *value)
{
    if (!phi_fmu_is_whole(variable)) return false;
    *value = f->seed;
    return true;
}

/* Set an integer variable before the start. Returns false if that is not allowed. */
static bool phi_fmu_set_whole(phi_fmu_state *f, uint32_t variable, int32_t value)
{
    if (!phi_fmu_is_whole(variable) || value < 0 || f->mode > PHI_INITIALISING) return false;
    f->seed = value;
    return true;
}

/* ---- States as bytes ---- */

enum { PHI_FMU_TOKEN = sizeof phi_token, PHI_FMU_BYTES = PHI_FMU_TOKEN + sizeof(uint64_t) + sizeof(phi_fmu_state) };

/* The checksum FNV-1a. */
static uint64_t phi_fmu_checksum(const unsigned char *bytes, size_t count)
{
    uint64_t sum = 14695981039346656037u;
    for (size_t k = 0; k < count; ++k) sum = (sum ^ bytes[k]) * 1099511628211u;
    return sum;
}

/* Serialised state: token of the FMU, checksum, state. It can be read on machines of the same kind only. */
static void phi_fmu_write(const phi_fmu_state *f, unsigned char *bytes)
{
    const uint64_t sum = phi_fmu_checksum((const unsigned char *)f, sizeof *f);
    memcpy(bytes, phi_token, PHI_FMU_TOKEN);
    memcpy(bytes + PHI_FMU_TOKEN, &sum, sizeof sum);
    memcpy(bytes + PHI_FMU_TOKEN + sizeof sum, f, sizeof *f);
}

/* Restore a serialised state. Returns false if the bytes are not a state of this FMU. */
static bool phi_fmu_read(phi_fmu_state *f, const unsigned char *bytes, size_t count)
{
    uint64_t sum;
    if (bytes == NULL || count != PHI_FMU_BYTES || memcmp(bytes, phi_token, PHI_FMU_TOKEN) != 0) return false;
    memcpy(&sum, bytes + PHI_FMU_TOKEN, sizeof sum);
    if (sum != phi_fmu_checksum(bytes + PHI_FMU_TOKEN + sizeof sum, sizeof *f)) return false;
    memcpy(f, bytes + PHI_FMU_TOKEN + sizeof sum, sizeof *f);
    return true;
}

/* ---- Instances ---- */

/* Report the reason of a failed call to the environment. */
typedef void (*phi_fmu_logger)(void *instance, const char *message);

typedef struct {
    phi_fmu_state state;
    char *name;
    void *environment;
    phi_fmu_logger log;
    void (*callback)(void); /* logger of the environment */
    void (*update)(void);   /* callback for whole steps, or NULL */
    bool logging, may_return_early;
} phi_fmu;

static void phi_fmu_say(phi_fmu *instance, const char *message)
{
    if (instance->logging && instance->callback != NULL) instance->log(instance, message);
}

/* Allocate an instance. Returns NULL without memory, or if the token is that of another FMU. */
static phi_fmu *phi_fmu_instantiate(const char *name, const char *token)
{
    phi_fmu *instance;
    if (token == NULL || strcmp(token, phi_token) != 0) return NULL;
    instance = (phi_fmu *)calloc(1, sizeof *instance);
    if (instance == NULL) return NULL;
    name = name == NULL ? "" : name;
    instance->name = (char *)calloc(strlen(name) + 1, 1);
    if (instance->name == NULL) {
        free(instance);
        return NULL;
    }
    memcpy(instance->name, name, strlen(name));
    phi_fmu_reset(&instance->state);
    return instance;
}

static void phi_fmu_free(phi_fmu *instance)
{
    if (instance != NULL) free(instance->name);
    free(instance);
}

/* Whether a communication step may start at this time with this size: both finite, the time is the present
   communication point, and the step ends at the stop time or before it. */
static bool phi_fmu_may_step(const phi_fmu_state *f, double from, double size)
{
    if (f->mode != PHI_STEPPING || !isfinite(from) || !(size >= 0.0) || !isfinite(size)) return false;
    const double tolerance = phi_fmu_tolerance(f, fmax(fabs(from), fabs(from + size)));
    return fabs(from - f->time) <= tolerance && from + size <= f->stop + tolerance;
}

/* Callback for a completed whole step; returns whether the environment ends the communication step here. */
typedef bool (*phi_fmu_listener)(phi_fmu *instance, double time);

/* Make a communication step. If it fails, the state is unchanged. */
static phi_status phi_fmu_do_step(phi_fmu *instance, double target, phi_fmu_listener listener)
{
    phi_fmu_state *f = &instance->state;
    const phi_fmu_state before = *f;
    phi_status status = f->changed ? phi_fmu_restart(f) : PHI_OK;
    bool ends = false;
    if (status == PHI_OK && listener == NULL) status = phi_fmu_whole_steps(f, target);
    for (bool advanced = listener != NULL; advanced && !ends && status == PHI_OK;) {
        status = phi_fmu_whole_step(f, target, &advanced);
        if (status != PHI_OK || !advanced) break;
        f->now = f->grid;
        f->time = phi_fmu_time(f, &f->grid);
        ends = f->time < target - phi_fmu_tolerance(f, target) && listener(instance, f->time);
    }
    if (status == PHI_OK && !ends) {
        status = phi_fmu_part(f, target);
        f->time = target;
    }
    if (status != PHI_OK) {
        *f = before;
        phi_fmu_say(instance, phi_status_string(status));
    }
    return status;
}
#include "fmu3.c"
#include "fmu2.c"
#endif
