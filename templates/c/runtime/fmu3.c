#ifndef PHI_FILE_FMU3
#define PHI_FILE_FMU3

/* ---- FMI 3.0 ---- */

#ifndef fmi3Functions_h /* the headers of the standard may be included before this file */
typedef void *fmi3Instance, *fmi3InstanceEnvironment, *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean, fmi3Clock;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum { fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent } fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
    fmi3String message);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment environment);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment environment, fmi3Float64 time,
    fmi3Boolean setRequested, fmi3Boolean getAllowed, fmi3Boolean stepFinished, fmi3Boolean canReturnEarly,
    fmi3Boolean *earlyReturnRequested, fmi3Float64 *earlyReturnTime);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);
#endif

/* Exported names: plain in a library, with a prefix if several FMUs are linked into one program. */
#if defined(FMI3_FUNCTION_PREFIX) && !defined(FMI3_OVERRIDE_FUNCTION_PREFIX)
#define FMI3_PASTED(prefix, name) prefix##fmi3##name
#define FMI3_PREFIXED(prefix, name) FMI3_PASTED(prefix, name)
#define FMI3_NAME(name) FMI3_PREFIXED(FMI3_FUNCTION_PREFIX, name)
#else
#define FMI3_NAME(name) fmi3##name
#endif
#ifdef _WIN32
#define FMI3_SHARED __declspec(dllexport)
#elif defined(__GNUC__)
#define FMI3_SHARED __attribute__((visibility("default")))
#else
#define FMI3_SHARED
#endif
#define FMI3_STATUS(name) FMI3_SHARED fmi3Status FMI3_NAME(name)

FMI3_SHARED const char *FMI3_NAME(GetVersion)(void) { return "3.0"; }

static void phi_fmi3_log(void *of, const char *message)
{
    phi_fmu *instance = (phi_fmu *)of;
    const fmi3LogMessageCallback log = (fmi3LogMessageCallback)instance->callback;
    log(instance->environment, fmi3Error, "logStatusError", message);
}

static fmi3Status phi_fmi3_refuse(fmi3Instance of, const char *message)
{
    if (of != NULL) phi_fmu_say((phi_fmu *)of, message);
    return fmi3Error;
}

static phi_fmu_state *phi_fmi3_state(fmi3Instance of) { return &((phi_fmu *)of)->state; }

/* Refuse a call in any other mode than the one in which it is allowed. */
static fmi3Status phi_fmi3_expect(fmi3Instance of, phi_fmu_mode mode)
{
    if (of != NULL && phi_fmi3_state(of)->mode == (int32_t)mode) return fmi3OK;
    return phi_fmi3_refuse(of, "this call is not allowed in the mode of the FMU");
}

/* Change from one mode to the next. */
static fmi3Status phi_fmi3_enter(fmi3Instance of, phi_fmu_mode from, phi_fmu_mode to)
{
    if (phi_fmi3_expect(of, from) != fmi3OK) return fmi3Error;
    phi_fmi3_state(of)->mode = (int32_t)to;
    return fmi3OK;
}

FMI3_STATUS(SetDebugLogging)(fmi3Instance of, fmi3Boolean on, size_t count, const fmi3String categories[])
{
    (void)count;
    (void)categories;
    if (of == NULL) return fmi3Error;
    ((phi_fmu *)of)->logging = on;
    return fmi3OK;
}

FMI3_SHARED fmi3Instance FMI3_NAME(InstantiateCoSimulation)(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[],
    size_t count, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3IntermediateUpdateCallback update)
{
    phi_fmu *instance = phi_fmu_instantiate(name, token);
    (void)resources;
    (void)visible;
    (void)events;
    (void)required;
    (void)count;
    if (instance == NULL) {
        if (log != NULL) log(environment, fmi3Error, "logStatusError", "wrong instantiation token, or no memory");
        return NULL;
    }
    instance->environment = environment;
    instance->log = phi_fmi3_log;
    instance->callback = (void (*)(void))log;
    instance->update = (void (*)(void))update;
    instance->logging = logging;
    instance->may_return_early = early;
    return instance;
}

FMI3_SHARED fmi3Instance FMI3_NAME(InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    (void)name;
    (void)token;
    (void)resources;
    (void)visible;
    (void)logging;
    if (log != NULL) log(environment, fmi3Error, "logStatusError", "this FMU is for co-simulation");
    return NULL;
}

FMI3_SHARED fmi3Instance FMI3_NAME(InstantiateScheduledExecution)(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    (void)clock;
    (void)lock;
    (void)unlock;
    return FMI3_NAME(InstantiateModelExchange)(name, token, resources, visible, logging, environment, log);
}

FMI3_SHARED void FMI3_NAME(FreeInstance)(fmi3Instance of) { phi_fmu_free((phi_fmu *)of); }

FMI3_STATUS(EnterInitializationMode)(fmi3Instance of, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
    fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop)
{
    (void)has_tolerance;
    (void)tolerance;
    if (phi_fmi3_expect(of, PHI_INSTANTIATED) != fmi3OK) return fmi3Error;
    if (!phi_fmu_experiment(phi_fmi3_state(of), start, has_stop, stop))
        return phi_fmi3_refuse(of, "the start time is not finite, or the stop time lies before it");
    return phi_fmi3_enter(of, PHI_INSTANTIATED, PHI_INITIALISING);
}

FMI3_STATUS(ExitInitializationMode)(fmi3Instance of)
{
    if (phi_fmi3_expect(of, PHI_INITIALISING) != fmi3OK) return fmi3Error;
    const phi_status status = phi_fmu_start(phi_fmi3_state(of));
    if (status != PHI_OK) return phi_fmi3_refuse(of, phi_status_string(status)); /* values may be set, and initialisation computed again */
    return phi_fmi3_enter(of, PHI_INITIALISING, PHI_STEPPING);
}

FMI3_STATUS(EnterEventMode)(fmi3Instance of) { return phi_fmi3_enter(of, PHI_STEPPING, PHI_AT_EVENT); }

/* After initialisation with events the mode is already that of steps. */
FMI3_STATUS(EnterStepMode)(fmi3Instance of)
{
    if (of != NULL && phi_fmi3_state(of)->mode == PHI_STEPPING) return fmi3OK;
    return phi_fmi3_enter(of, PHI_AT_EVENT, PHI_STEPPING);
}

FMI3_STATUS(Terminate)(fmi3Instance of)
{
    if (of == NULL) return fmi3Error;
    phi_fmi3_state(of)->mode = PHI_TERMINATED;
    return fmi3OK;
}

FMI3_STATUS(Reset)(fmi3Instance of)
{
    if (of == NULL) return fmi3Error;
    phi_fmu_reset(phi_fmi3_state(of));
    return fmi3OK;
}

FMI3_STATUS(GetFloat64)(fmi3Instance of, const fmi3ValueReference variables[], size_t count,
    fmi3Float64 values[], size_t value_count)
{
    if (of == NULL || count != value_count) return fmi3Error;
    for (size_t k = 0; k < count; ++k)
        if (!phi_fmu_get(phi_fmi3_state(of), variables[k], &values[k])) return phi_fmi3_refuse(of, "no such variable");
    return fmi3OK;
}

FMI3_STATUS(SetFloat64)(fmi3Instance of, const fmi3ValueReference variables[], size_t count,
    const fmi3Float64 values[], size_t value_count)
{
    if (of == NULL || count != value_count) return fmi3Error;
    for (size_t k = 0; k < count; ++k)
        if (!phi_fmu_set(phi_fmi3_state(of), variables[k], values[k]))
            return phi_fmi3_refuse(of, "the variable cannot be set now, or to this value");
    return fmi3OK;
}

FMI3_STATUS(GetInt32)(fmi3Instance of, const fmi3ValueReference variables[], size_t count, fmi3Int32 values[],
    size_t value_count)
{
    if (of == NULL || count != value_count) return fmi3Error;
    for (size_t k = 0; k < count; ++k)
        if (!phi_fmu_get_whole(phi_fmi3_state(of), variables[k], &values[k])) return phi_fmi3_refuse(of, "no such variable");
    return fmi3OK;
}

FMI3_STATUS(SetInt32)(fmi3Instance of, const fmi3ValueReference variables[], size_t count,
    const fmi3Int32 values[], size_t value_count)
{
    if (of == NULL || count != value_count) return fmi3Error;
    for (size_t k = 0; k < count; ++k)
        if (!phi_fmu_set_whole(phi_fmi3_state(of), variables[k], values[k]))
            return phi_fmi3_refuse(of, "the variable cannot be set now, or to this value");
    return fmi3OK;
}

/* Types without variables: calls for 0 variables succeed, all others fail. */
static fmi3Status phi_fmi3_none(fmi3Instance of, size_t count)
{
    return of != NULL && count == 0 ? fmi3OK : phi_fmi3_refuse(of, "no such variable");
}

#define FMI3_NONE(name, type) \
    FMI3_STATUS(name)(fmi3Instance of, const fmi3ValueReference v[], size_t n, type x[], size_t m) \
    { \
        (void)v; \
        (void)x; \
        return phi_fmi3_none(of, n | m); \
    }
FMI3_NONE(GetFloat32, fmi3Float32)
FMI3_NONE(GetInt8, fmi3Int8)
FMI3_NONE(GetUInt8, fmi3UInt8)
FMI3_NONE(GetInt16, fmi3Int16)
FMI3_NONE(GetUInt16, fmi3UInt16)
FMI3_NONE(GetUInt32, fmi3UInt32)
FMI3_NONE(GetInt64, fmi3Int64)
FMI3_NONE(GetUInt64, fmi3UInt64)
FMI3_NONE(GetBoolean, fmi3Boolean)
FMI3_NONE(GetString, fmi3String)
FMI3_NONE(SetFloat32, const fmi3Float32)
FMI3_NONE(SetInt8, const fmi3Int8)
FMI3_NONE(SetUInt8, const fmi3UInt8)
FMI3_NONE(SetInt16, const fmi3Int16)
FMI3_NONE(SetUInt16, const fmi3UInt16)
FMI3_NONE(SetUInt32, const fmi3UInt32)
FMI3_NONE(SetInt64, const fmi3Int64)
FMI3_NONE(SetUInt64, const fmi3UInt64)
FMI3_NONE(SetBoolean, const fmi3Boolean)
FMI3_NONE(SetString, const fmi3String)

/* Functions for model exchange, scheduled execution, clocks, binary variables, arrays and derivatives: always refused. */
#define FMI3_ABSENT(name, arguments) \
    FMI3_STATUS(name) arguments { return fmi3Error; }
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
FMI3_ABSENT(GetBinary, (fmi3Instance of, const fmi3ValueReference v[], size_t n, size_t sizes[], fmi3Binary x[], size_t m))
FMI3_ABSENT(SetBinary, (fmi3Instance of, const fmi3ValueReference v[], size_t n, const size_t sizes[],
    const fmi3Binary x[], size_t m))
FMI3_ABSENT(GetClock, (fmi3Instance of, const fmi3ValueReference v[], size_t n, fmi3Clock x[]))
FMI3_ABSENT(SetClock, (fmi3Instance of, const fmi3ValueReference v[], size_t n, const fmi3Clock x[]))
FMI3_ABSENT(GetNumberOfVariableDependencies, (fmi3Instance of, fmi3ValueReference v, size_t *n))
FMI3_ABSENT(GetVariableDependencies, (fmi3Instance of, fmi3ValueReference v, size_t at[], fmi3ValueReference on[],
    size_t at_on[], fmi3DependencyKind kinds[], size_t n))
FMI3_ABSENT(GetDirectionalDerivative, (fmi3Instance of, const fmi3ValueReference u[], size_t n,
    const fmi3ValueReference v[], size_t m, const fmi3Float64 seed[], size_t k, fmi3Float64 x[], size_t l))
FMI3_ABSENT(GetAdjointDerivative, (fmi3Instance of, const fmi3ValueReference u[], size_t n,
    const fmi3ValueReference v[], size_t m, const fmi3Float64 seed[], size_t k, fmi3Float64 x[], size_t l))
FMI3_ABSENT(EnterConfigurationMode, (fmi3Instance of))
FMI3_ABSENT(ExitConfigurationMode, (fmi3Instance of))
FMI3_ABSENT(GetIntervalDecimal, (fmi3Instance of, const fmi3ValueReference v[], size_t n, fmi3Float64 x[],
    fmi3IntervalQualifier q[]))
FMI3_ABSENT(GetIntervalFraction, (fmi3Instance of, const fmi3ValueReference v[], size_t n, fmi3UInt64 x[],
    fmi3UInt64 y[], fmi3IntervalQualifier q[]))
FMI3_ABSENT(GetShiftDecimal, (fmi3Instance of, const fmi3ValueReference v[], size_t n, fmi3Float64 x[]))
FMI3_ABSENT(GetShiftFraction, (fmi3Instance of, const fmi3ValueReference v[], size_t n, fmi3UInt64 x[], fmi3UInt64 y[]))
FMI3_ABSENT(SetIntervalDecimal, (fmi3Instance of, const fmi3ValueReference v[], size_t n, const fmi3Float64 x[]))
FMI3_ABSENT(SetIntervalFraction, (fmi3Instance of, const fmi3ValueReference v[], size_t n, const fmi3UInt64 x[],
    const fmi3UInt64 y[]))
FMI3_ABSENT(SetShiftDecimal, (fmi3Instance of, const fmi3ValueReference v[], size_t n, const fmi3Float64 x[]))
FMI3_ABSENT(SetShiftFraction, (fmi3Instance of, const fmi3ValueReference v[], size_t n, const fmi3UInt64 x[],
    const fmi3UInt64 y[]))
FMI3_ABSENT(EvaluateDiscreteStates, (fmi3Instance of))
FMI3_ABSENT(GetOutputDerivatives, (fmi3Instance of, const fmi3ValueReference v[], size_t n, const fmi3Int32 orders[],
    fmi3Float64 x[], size_t m))
FMI3_ABSENT(EnterContinuousTimeMode, (fmi3Instance of))
FMI3_ABSENT(CompletedIntegratorStep, (fmi3Instance of, fmi3Boolean no_earlier, fmi3Boolean *event, fmi3Boolean *end))
FMI3_ABSENT(SetTime, (fmi3Instance of, fmi3Float64 time))
FMI3_ABSENT(SetContinuousStates, (fmi3Instance of, const fmi3Float64 x[], size_t n))
FMI3_ABSENT(GetContinuousStateDerivatives, (fmi3Instance of, fmi3Float64 x[], size_t n))
FMI3_ABSENT(GetEventIndicators, (fmi3Instance of, fmi3Float64 x[], size_t n))
FMI3_ABSENT(GetContinuousStates, (fmi3Instance of, fmi3Float64 x[], size_t n))
FMI3_ABSENT(GetNominalsOfContinuousStates, (fmi3Instance of, fmi3Float64 x[], size_t n))
FMI3_ABSENT(GetNumberOfEventIndicators, (fmi3Instance of, size_t *n))
FMI3_ABSENT(GetNumberOfContinuousStates, (fmi3Instance of, size_t *n))
FMI3_ABSENT(ActivateModelPartition, (fmi3Instance of, fmi3ValueReference v, fmi3Float64 time))
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

/* Newly set parameters take effect with the next step; events do nothing else. */
FMI3_STATUS(UpdateDiscreteStates)(fmi3Instance of, fmi3Boolean *again, fmi3Boolean *terminate,
    fmi3Boolean *nominals, fmi3Boolean *states, fmi3Boolean *has_next, fmi3Float64 *next)
{
    if (of == NULL) return fmi3Error;
    *again = *terminate = *nominals = *states = *has_next = false;
    *next = 0.0;
    return fmi3OK;
}

FMI3_STATUS(GetFMUState)(fmi3Instance of, fmi3FMUState *state)
{
    if (of == NULL || state == NULL) return fmi3Error;
    if (*state == NULL) *state = calloc(1, sizeof(phi_fmu_state));
    if (*state == NULL) return phi_fmi3_refuse(of, "no memory");
    memcpy(*state, phi_fmi3_state(of), sizeof(phi_fmu_state));
    return fmi3OK;
}

FMI3_STATUS(SetFMUState)(fmi3Instance of, fmi3FMUState state)
{
    if (of == NULL || state == NULL) return fmi3Error;
    memcpy(phi_fmi3_state(of), state, sizeof(phi_fmu_state));
    return fmi3OK;
}

FMI3_STATUS(FreeFMUState)(fmi3Instance of, fmi3FMUState *state)
{
    if (of == NULL || state == NULL) return fmi3Error;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

FMI3_STATUS(SerializedFMUStateSize)(fmi3Instance of, fmi3FMUState state, size_t *size)
{
    if (of == NULL || state == NULL || size == NULL) return fmi3Error;
    *size = PHI_FMU_BYTES;
    return fmi3OK;
}

FMI3_STATUS(SerializeFMUState)(fmi3Instance of, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    if (of == NULL || state == NULL || bytes == NULL || size < PHI_FMU_BYTES) return fmi3Error;
    phi_fmu_write((const phi_fmu_state *)state, bytes);
    return fmi3OK;
}

FMI3_STATUS(DeserializeFMUState)(fmi3Instance of, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    phi_fmu_state *fresh;
    if (of == NULL || state == NULL) return fmi3Error;
    fresh = (phi_fmu_state *)(*state == NULL ? calloc(1, sizeof *fresh) : *state);
    if (fresh == NULL) return phi_fmi3_refuse(of, "no memory");
    if (!phi_fmu_read(fresh, bytes, size)) {
        if (*state == NULL) free(fresh);
        return phi_fmi3_refuse(of, "the bytes are not those of a state of this FMU");
    }
    *state = fresh;
    return fmi3OK;
}

/* Report a whole step to the environment, which may end the communication step. */
static bool phi_fmi3_listener(phi_fmu *instance, double time)
{
    const fmi3IntermediateUpdateCallback update = (fmi3IntermediateUpdateCallback)instance->update;
    fmi3Boolean requested = false;
    fmi3Float64 until = time;
    update(instance->environment, time, false, true, true, instance->may_return_early, &requested, &until);
    return requested && instance->may_return_early && until <= time;
}

FMI3_STATUS(DoStep)(fmi3Instance of, fmi3Float64 from, fmi3Float64 size, fmi3Boolean no_earlier,
    fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached)
{
    phi_fmu *instance = (phi_fmu *)of;
    phi_status status;
    (void)no_earlier;
    if (instance == NULL || event == NULL || terminate == NULL || early == NULL || reached == NULL) return fmi3Error;
    *event = *terminate = *early = false;
    *reached = instance->state.time;
    if (!phi_fmu_may_step(&instance->state, from, size)) return phi_fmi3_refuse(of, "a step from another time or mode, or beyond the stop time");
    status = phi_fmu_do_step(instance, from + size, instance->update == NULL ? NULL : phi_fmi3_listener);
    *reached = instance->state.time;
    *early = status == PHI_OK && *reached < from + size;
    return status == PHI_OK ? fmi3OK : fmi3Discard;
}
#endif
