#ifndef PHI_FILE_FMU2
#define PHI_FILE_FMU2

/* ---- FMI 2.0 ---- */

#ifndef fmi2Functions_h
typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef void (*fmi2CallbackLogger)(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
    fmi2String category, fmi2String message, ...);
typedef struct {
    fmi2CallbackLogger logger;
    void *(*allocateMemory)(size_t count, size_t size);
    void (*freeMemory)(void *memory);
    void (*stepFinished)(fmi2ComponentEnvironment environment, fmi2Status status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;
#endif

#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define FMI2_PASTED(prefix, name) prefix##fmi2##name
#define FMI2_PREFIXED(prefix, name) FMI2_PASTED(prefix, name)
#define FMI2_NAME(name) FMI2_PREFIXED(FMI2_FUNCTION_PREFIX, name)
#else
#define FMI2_NAME(name) fmi2##name
#endif
#define FMI2_STATUS(name) FMI3_SHARED fmi2Status FMI2_NAME(name)

/* The statuses of both versions have the same numbers. */
static fmi2Status phi_fmi2_status(fmi3Status status) { return (fmi2Status)status; }

static void phi_fmi2_log(void *of, const char *message)
{
    phi_fmu *instance = (phi_fmu *)of;
    const fmi2CallbackLogger log = (fmi2CallbackLogger)instance->callback;
    log(instance->environment, instance->name, fmi2Error, "logStatusError", "%s", message);
}

FMI3_SHARED const char *FMI2_NAME(GetTypesPlatform)(void) { return "default"; }

FMI3_SHARED const char *FMI2_NAME(GetVersion)(void) { return "2.0"; }

FMI2_STATUS(SetDebugLogging)(fmi2Component of, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    return phi_fmi2_status(FMI3_NAME(SetDebugLogging)(of, on != 0, count, categories));
}

FMI3_SHARED fmi2Component FMI2_NAME(Instantiate)(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    phi_fmu *instance = type == fmi2CoSimulation ? phi_fmu_instantiate(name, guid) : NULL;
    (void)resources;
    (void)visible;
    if (instance == NULL) {
        if (functions != NULL && functions->logger != NULL)
            functions->logger(functions->componentEnvironment, name, fmi2Error, "logStatusError",
                "wrong GUID, no memory, or not for co-simulation");
        return NULL;
    }
    instance->log = phi_fmi2_log;
    instance->logging = logging != 0;
    if (functions != NULL) {
        instance->environment = functions->componentEnvironment;
        instance->callback = (void (*)(void))functions->logger;
    }
    return instance;
}

FMI3_SHARED void FMI2_NAME(FreeInstance)(fmi2Component of) { phi_fmu_free((phi_fmu *)of); }

FMI2_STATUS(SetupExperiment)(fmi2Component of, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
    fmi2Boolean has_stop, fmi2Real stop)
{
    (void)has_tolerance;
    (void)tolerance;
    if (of == NULL || phi_fmi3_state(of)->mode != PHI_INSTANTIATED) return fmi2Error;
    return phi_fmu_experiment(phi_fmi3_state(of), start, has_stop != 0, stop) ? fmi2OK : fmi2Error;
}

FMI2_STATUS(EnterInitializationMode)(fmi2Component of)
{
    return phi_fmi2_status(phi_fmi3_enter(of, PHI_INSTANTIATED, PHI_INITIALISING));
}

/* Functions that FMI 3 has under other names. */
#define FMI2_SAME(name, name3, arguments, passed) \
    FMI2_STATUS(name) arguments { return phi_fmi2_status(FMI3_NAME(name3) passed); }
FMI2_SAME(ExitInitializationMode, ExitInitializationMode, (fmi2Component of), (of))
FMI2_SAME(Terminate, Terminate, (fmi2Component of), (of))
FMI2_SAME(Reset, Reset, (fmi2Component of), (of))
FMI2_SAME(GetReal, GetFloat64, (fmi2Component of, const fmi2ValueReference v[], size_t n, fmi2Real x[]), (of, v, n, x, n))
FMI2_SAME(SetReal, SetFloat64, (fmi2Component of, const fmi2ValueReference v[], size_t n, const fmi2Real x[]),
    (of, v, n, x, n))
FMI2_SAME(GetInteger, GetInt32, (fmi2Component of, const fmi2ValueReference v[], size_t n, fmi2Integer x[]),
    (of, v, n, x, n))
FMI2_SAME(SetInteger, SetInt32, (fmi2Component of, const fmi2ValueReference v[], size_t n, const fmi2Integer x[]),
    (of, v, n, x, n))
FMI2_SAME(GetFMUstate, GetFMUState, (fmi2Component of, fmi2FMUstate *state), (of, state))
FMI2_SAME(SetFMUstate, SetFMUState, (fmi2Component of, fmi2FMUstate state), (of, state))
FMI2_SAME(FreeFMUstate, FreeFMUState, (fmi2Component of, fmi2FMUstate *state), (of, state))
FMI2_SAME(SerializedFMUstateSize, SerializedFMUStateSize, (fmi2Component of, fmi2FMUstate state, size_t *size),
    (of, state, size))
FMI2_SAME(SerializeFMUstate, SerializeFMUState, (fmi2Component of, fmi2FMUstate state, fmi2Byte bytes[], size_t size),
    (of, state, (fmi3Byte *)bytes, size))
FMI2_SAME(DeSerializeFMUstate, DeserializeFMUState,
    (fmi2Component of, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state),
    (of, (const fmi3Byte *)bytes, size, state))

/* Types without variables, and derivatives: calls for 0 variables succeed, all others fail. */
#define FMI2_NONE(name, arguments) \
    FMI2_STATUS(name) arguments { return of != NULL && n == 0 ? fmi2OK : fmi2Error; }
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
FMI2_NONE(GetBoolean, (fmi2Component of, const fmi2ValueReference v[], size_t n, fmi2Boolean x[]))
FMI2_NONE(SetBoolean, (fmi2Component of, const fmi2ValueReference v[], size_t n, const fmi2Boolean x[]))
FMI2_NONE(GetString, (fmi2Component of, const fmi2ValueReference v[], size_t n, fmi2String x[]))
FMI2_NONE(SetString, (fmi2Component of, const fmi2ValueReference v[], size_t n, const fmi2String x[]))
FMI2_NONE(SetRealInputDerivatives,
    (fmi2Component of, const fmi2ValueReference v[], size_t n, const fmi2Integer orders[], const fmi2Real x[]))
FMI2_NONE(GetRealOutputDerivatives,
    (fmi2Component of, const fmi2ValueReference v[], size_t n, const fmi2Integer orders[], fmi2Real x[]))
FMI2_NONE(GetDirectionalDerivative, (fmi2Component of, const fmi2ValueReference u[], size_t n,
    const fmi2ValueReference v[], size_t m, const fmi2Real seed[], fmi2Real x[]))
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

FMI2_STATUS(DoStep)(fmi2Component of, fmi2Real from, fmi2Real size, fmi2Boolean no_earlier)
{
    bool event, terminate, early;
    double reached;
    return phi_fmi2_status(FMI3_NAME(DoStep)(of, from, size, no_earlier != 0, &event, &terminate, &early, &reached));
}

FMI2_STATUS(CancelStep)(fmi2Component of)
{
    (void)of;
    return fmi2Error; /* steps are not asynchronous */
}

FMI2_STATUS(GetStatus)(fmi2Component of, const fmi2StatusKind kind, fmi2Status *value)
{
    (void)of;
    (void)kind;
    (void)value;
    return fmi2Discard;
}

FMI2_STATUS(GetRealStatus)(fmi2Component of, const fmi2StatusKind kind, fmi2Real *value)
{
    if (of == NULL || kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = phi_fmi3_state(of)->time;
    return fmi2OK;
}

FMI2_STATUS(GetIntegerStatus)(fmi2Component of, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)of;
    (void)kind;
    (void)value;
    return fmi2Discard;
}

FMI2_STATUS(GetBooleanStatus)(fmi2Component of, const fmi2StatusKind kind, fmi2Boolean *value)
{
    if (of == NULL || kind != fmi2Terminated) return fmi2Discard;
    *value = 0;
    return fmi2OK;
}

FMI2_STATUS(GetStringStatus)(fmi2Component of, const fmi2StatusKind kind, fmi2String *value)
{
    (void)of;
    (void)kind;
    (void)value;
    return fmi2Discard;
}
#endif
