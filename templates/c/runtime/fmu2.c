#ifndef PHI_FILE_FMU2
#define PHI_FILE_FMU2

/* ---- FMI 2.0, by the functions of FMI 3.0. Statuses have the same numbers in both versions. ---- */

#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define FMI2_NAME(name) FMI_PREFIXED(FMI2_FUNCTION_PREFIX, fmi2##name)
#else
#define FMI2_NAME(name) fmi2##name
#endif
#define FMI2_STATUS(name) FMI_SHARED fmi2Status FMI2_NAME(name)

FMI_SHARED const char *FMI2_NAME(GetTypesPlatform)(void) { return "default"; }

FMI_SHARED const char *FMI2_NAME(GetVersion)(void) { return "2.0"; }

FMI_SHARED void *FMI2_NAME(Instantiate)(const char *name, fmi2Type type, const char *guid, const char *resources,
    const fmi2CallbackFunctions *functions, int visible, int logging)
{
    phi_fmu_callbacks callbacks = { NULL, NULL, NULL, NULL };
    if (functions != NULL) callbacks.environment = functions->componentEnvironment;
    if (functions != NULL) callbacks.log_2 = functions->logger;
    return phi_fmu_instantiate(name, type == fmi2CoSimulation ? guid : NULL, &callbacks, logging != 0);
}

FMI_SHARED void FMI2_NAME(FreeInstance)(void *of) { free(of); }

/* FMI 2.0 sets the start and stop times by this function, FMI 3.0 by EnterInitializationMode. */
FMI2_STATUS(SetupExperiment)(void *of, int has_tolerance, double tolerance, double start, int has_stop, double stop)
{
    const fmi3Status status =
        FMI3_NAME(EnterInitializationMode)(of, has_tolerance != 0, tolerance, start, has_stop != 0, stop);
    if (status == fmi3OK) phi_fmi3_state(of)->mode = PHI_INSTANTIATED;
    return (fmi2Status)status;
}

FMI2_STATUS(EnterInitializationMode)(void *of) { return (fmi2Status)phi_fmi3_enter(of, PHI_INSTANTIATED, PHI_INITIALISING); }

/* Define a function that calls the function of FMI 3.0 with the same meaning. */
#define FMI2_SAME(name, name3, parameters, arguments) \
    FMI2_STATUS(name) parameters { return (fmi2Status)FMI3_NAME(name3) arguments; }
#define FMI2_VARIABLES void *of, const unsigned v[], size_t n
FMI2_SAME(SetDebugLogging, SetDebugLogging, (void *of, int on, size_t n, const char *const v[]), (of, on != 0, n, v))
FMI2_SAME(ExitInitializationMode, ExitInitializationMode, (void *of), (of))
FMI2_SAME(Terminate, Terminate, (void *of), (of))
FMI2_SAME(Reset, Reset, (void *of), (of))
FMI2_SAME(GetReal, GetFloat64, (FMI2_VARIABLES, double x[]), (of, v, n, x, n))
FMI2_SAME(SetReal, SetFloat64, (FMI2_VARIABLES, const double x[]), (of, v, n, x, n))
FMI2_SAME(GetInteger, GetInt32, (FMI2_VARIABLES, int x[]), (of, v, n, x, n))
FMI2_SAME(SetInteger, SetInt32, (FMI2_VARIABLES, const int x[]), (of, v, n, x, n))
FMI2_SAME(GetFMUstate, GetFMUState, (void *of, void **state), (of, state))
FMI2_SAME(SetFMUstate, SetFMUState, (void *of, void *state), (of, state))
FMI2_SAME(FreeFMUstate, FreeFMUState, (void *of, void **state), (of, state))
FMI2_SAME(SerializedFMUstateSize, SerializedFMUStateSize, (void *of, void *state, size_t *size), (of, state, size))
FMI2_SAME(SerializeFMUstate, SerializeFMUState, (void *of, void *state, char bytes[], size_t size),
    (of, state, (uint8_t *)bytes, size))
FMI2_SAME(DeSerializeFMUstate, DeserializeFMUState, (void *of, const char bytes[], size_t size, void **state),
    (of, (const uint8_t *)bytes, size, state))

/* Functions for derivatives, and for types of which there are no variables: calls for 0 variables succeed, others fail. */
#define FMI2_NONE(name, parameters) \
    FMI2_STATUS(name) parameters { return (fmi2Status)phi_fmi3_none(of, n); }
FMI2_NONE(GetBoolean, (FMI2_VARIABLES, int x[]))
FMI2_NONE(SetBoolean, (FMI2_VARIABLES, const int x[]))
FMI2_NONE(GetString, (FMI2_VARIABLES, const char *x[]))
FMI2_NONE(SetString, (FMI2_VARIABLES, const char *const x[]))
FMI2_NONE(SetRealInputDerivatives, (FMI2_VARIABLES, const int orders[], const double x[]))
FMI2_NONE(GetRealOutputDerivatives, (FMI2_VARIABLES, const int orders[], double x[]))
FMI2_NONE(GetDirectionalDerivative, (FMI2_VARIABLES, const unsigned by[], size_t m, const double seed[], double x[]))

FMI2_STATUS(DoStep)(void *of, double from, double size, int no_earlier)
{
    bool event, terminate, early;
    double reached;
    return (fmi2Status)FMI3_NAME(DoStep)(of, from, size, no_earlier != 0, &event, &terminate, &early, &reached);
}

FMI2_STATUS(CancelStep)(void *of) { return fmi2Error; } /* steps are not asynchronous */

FMI2_STATUS(GetRealStatus)(void *of, const fmi2StatusKind kind, double *value)
{
    if (of == NULL || kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = phi_fmi3_state(of)->time;
    return fmi2OK;
}

FMI2_STATUS(GetBooleanStatus)(void *of, const fmi2StatusKind kind, int *value)
{
    if (of == NULL || kind != fmi2Terminated) return fmi2Discard;
    *value = 0;
    return fmi2OK;
}

/* Statuses of asynchronous steps, which this FMU does not have. */
FMI2_STATUS(GetStatus)(void *of, const fmi2StatusKind kind, fmi2Status *value) { return fmi2Discard; }
FMI2_STATUS(GetIntegerStatus)(void *of, const fmi2StatusKind kind, int *value) { return fmi2Discard; }
FMI2_STATUS(GetStringStatus)(void *of, const fmi2StatusKind kind, const char **value) { return fmi2Discard; }
#endif
