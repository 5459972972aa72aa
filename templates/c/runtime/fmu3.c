#ifndef PHI_FILE_FMU3
#define PHI_FILE_FMU3

/* ---- FMI 3.0 ---- */

/* The standard prescribes parameters that this FMU does not need. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

/* Exported functions have plain names in a library, and a prefix if several FMUs are linked into one program. */
#define FMI_JOINED(prefix, name) prefix##name
#define FMI_PREFIXED(prefix, name) FMI_JOINED(prefix, name)
#if defined(FMI3_FUNCTION_PREFIX) && !defined(FMI3_OVERRIDE_FUNCTION_PREFIX)
#define FMI3_NAME(name) FMI_PREFIXED(FMI3_FUNCTION_PREFIX, fmi3##name)
#else
#define FMI3_NAME(name) fmi3##name
#endif
#ifdef _WIN32
#define FMI_SHARED __declspec(dllexport)
#elif defined(__GNUC__)
#define FMI_SHARED __attribute__((visibility("default")))
#else
#define FMI_SHARED
#endif
#define FMI3_STATUS(name) FMI_SHARED fmi3Status FMI3_NAME(name)

FMI_SHARED const char *FMI3_NAME(GetVersion)(void) { return "3.0"; }

/* Return fmi3OK if a condition holds; else report the reason to the environment and return fmi3Error. */
static fmi3Status phi_fmi3_demand(bool condition, void *of, const char *reason)
{
    const phi_fmu *instance = (const phi_fmu *)of;
    if (!condition && of != NULL && instance->logging) phi_fmu_say(&instance->callbacks, instance->name, reason);
    return condition ? fmi3OK : fmi3Error;
}

static phi_fmu_state *phi_fmi3_state(void *of) { return &((phi_fmu *)of)->state; }

/* Change to the mode `to` if the present mode is one of `from`, a sum of modes; else refuse the call. */
static fmi3Status phi_fmi3_enter(void *of, int from, int to)
{
    const bool allowed = of != NULL && (phi_fmi3_state(of)->mode & from) != 0;
    if (allowed) phi_fmi3_state(of)->mode = to;
    return phi_fmi3_demand(allowed, of, "this call is not allowed in the mode of the FMU");
}

FMI3_STATUS(SetDebugLogging)(void *of, bool on, size_t count, const char *const categories[])
{
    if (of != NULL) ((phi_fmu *)of)->logging = on;
    return of != NULL ? fmi3OK : fmi3Error;
}

FMI_SHARED void *FMI3_NAME(InstantiateCoSimulation)(const char *name, const char *token, const char *resources,
    bool visible, bool logging, bool events, bool early, const uint32_t required[], size_t count, void *environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    const phi_fmu_callbacks callbacks = { environment, NULL, log, update };
    phi_fmu *instance = phi_fmu_instantiate(name, token, &callbacks, logging);
    if (instance != NULL) instance->may_return_early = early;
    return instance;
}

/* Define functions that refuse instances for model exchange and for scheduled execution. */
#define FMI3_NO_INSTANCE(kind, parameters) \
    FMI_SHARED void *FMI3_NAME(Instantiate##kind) parameters { return NULL; }
#define FMI3_INSTANCE const char *name, const char *token, const char *resources, bool visible, bool logging
FMI3_NO_INSTANCE(ModelExchange, (FMI3_INSTANCE, void *environment, fmi3LogMessageCallback log))
FMI3_NO_INSTANCE(ScheduledExecution, (FMI3_INSTANCE, void *environment, fmi3LogMessageCallback log,
    void (*clock)(void *environment), void (*lock)(void), void (*unlock)(void)))

FMI_SHARED void FMI3_NAME(FreeInstance)(void *of) { free(of); }

FMI3_STATUS(EnterInitializationMode)(void *of, bool has_tolerance, double tolerance, double start, bool has_stop,
    double stop)
{
    if (!isfinite(start) || (has_stop && !(stop >= start)))
        return phi_fmi3_demand(false, of, "the start time is not finite, or the stop time lies before it");
    if (phi_fmi3_enter(of, PHI_INSTANTIATED, PHI_INITIALISING) != fmi3OK) return fmi3Error;
    phi_fmi3_state(of)->time = start;
    phi_fmi3_state(of)->stop = has_stop ? stop : HUGE_VAL;
    return fmi3OK;
}

/* If this function fails, the environment may set other values and call it again. */
FMI3_STATUS(ExitInitializationMode)(void *of)
{
    if (phi_fmi3_enter(of, PHI_INITIALISING, PHI_INITIALISING) != fmi3OK) return fmi3Error;
    const phi_status status = phi_fmu_start(phi_fmi3_state(of));
    if (status == PHI_OK) return phi_fmi3_enter(of, PHI_INITIALISING, PHI_STEPPING);
    return phi_fmi3_demand(false, of, phi_status_string(status));
}

FMI3_STATUS(EnterEventMode)(void *of) { return phi_fmi3_enter(of, PHI_STEPPING, PHI_AT_EVENT); }

/* After the initialisation, environments with event mode also call this function, although the FMU is already in step
   mode. */
FMI3_STATUS(EnterStepMode)(void *of) { return phi_fmi3_enter(of, PHI_STEPPING | PHI_AT_EVENT, PHI_STEPPING); }

FMI3_STATUS(Terminate)(void *of) { return phi_fmi3_enter(of, ~0, PHI_TERMINATED); }

FMI3_STATUS(Reset)(void *of)
{
    if (of != NULL) phi_fmu_reset(phi_fmi3_state(of));
    return of != NULL ? fmi3OK : fmi3Error;
}

#define FMI3_VARIABLES void *of, const uint32_t v[], size_t n

/* Define the functions that get and set values of one type; `is` says whether variable v[k] has this type. Only Float64 and
   Int32 have variables, but calls for 0 variables succeed for all types. */
#define FMI3_VALUES(type, of_c, is) \
    FMI3_STATUS(Get##type)(FMI3_VARIABLES, of_c x[], size_t m) \
    { \
        double value = 0.0; \
        bool exist = of != NULL && n == m; \
        for (size_t k = 0; exist && k < n; ++k) { \
            exist = (is) && phi_fmu_get(phi_fmi3_state(of), v[k], &value); \
            if (exist) x[k] = (of_c)value; \
        } \
        return phi_fmi3_demand(exist, of, "no such variable"); \
    } \
    FMI3_STATUS(Set##type)(FMI3_VARIABLES, const of_c x[], size_t m) \
    { \
        bool allowed = of != NULL && n == m; \
        for (size_t k = 0; allowed && k < n; ++k) \
            allowed = (is) && phi_fmu_set(phi_fmi3_state(of), v[k], (double)x[k]); \
        return phi_fmi3_demand(allowed, of, "the variable cannot be set now, or to this value"); \
    }
FMI3_VALUES(Float64, double, !phi_fmu_is_whole(v[k]))
FMI3_VALUES(Int32, int32_t, phi_fmu_is_whole(v[k]))
FMI3_VALUES(Float32, float, false)
FMI3_VALUES(Int8, int8_t, false)
FMI3_VALUES(UInt8, uint8_t, false)
FMI3_VALUES(Int16, int16_t, false)
FMI3_VALUES(UInt16, uint16_t, false)
FMI3_VALUES(UInt32, uint32_t, false)
FMI3_VALUES(Int64, int64_t, false)
FMI3_VALUES(UInt64, uint64_t, false)
FMI3_VALUES(Boolean, bool, false)

/* Get or set variables of types that are no numbers; there are none, so only calls for 0 variables succeed. */
static fmi3Status phi_fmi3_none(void *of, size_t n) { return phi_fmi3_demand(of != NULL && n == 0, of, "no such variable"); }

FMI3_STATUS(GetString)(FMI3_VARIABLES, const char *x[], size_t m) { return phi_fmi3_none(of, n | m); }
FMI3_STATUS(SetString)(FMI3_VARIABLES, const char *const x[], size_t m) { return phi_fmi3_none(of, n | m); }

/* Define functions that always fail: for model exchange, scheduled execution, clocks, binary variables and derivatives. */
#define FMI3_ABSENT(name, parameters) \
    FMI3_STATUS(name) parameters { return fmi3Error; }
FMI3_ABSENT(GetBinary, (FMI3_VARIABLES, size_t sizes[], const uint8_t *x[], size_t m))
FMI3_ABSENT(SetBinary, (FMI3_VARIABLES, const size_t sizes[], const uint8_t *const x[], size_t m))
FMI3_ABSENT(GetClock, (FMI3_VARIABLES, bool x[]))
FMI3_ABSENT(SetClock, (FMI3_VARIABLES, const bool x[]))
FMI3_ABSENT(GetNumberOfVariableDependencies, (void *of, uint32_t v, size_t *n))
FMI3_ABSENT(GetVariableDependencies, (void *of, uint32_t v, size_t at[], uint32_t on[], size_t at_on[],
    fmi3DependencyKind kinds[], size_t n))
#define FMI3_BY const uint32_t by[], size_t m, const double seed[], size_t k
FMI3_ABSENT(GetDirectionalDerivative, (FMI3_VARIABLES, FMI3_BY, double x[], size_t l))
FMI3_ABSENT(GetAdjointDerivative, (FMI3_VARIABLES, FMI3_BY, double x[], size_t l))
FMI3_ABSENT(EnterConfigurationMode, (void *of))
FMI3_ABSENT(ExitConfigurationMode, (void *of))
FMI3_ABSENT(GetIntervalDecimal, (FMI3_VARIABLES, double x[], fmi3IntervalQualifier q[]))
FMI3_ABSENT(GetIntervalFraction, (FMI3_VARIABLES, uint64_t x[], uint64_t y[], fmi3IntervalQualifier q[]))
FMI3_ABSENT(GetShiftDecimal, (FMI3_VARIABLES, double x[]))
FMI3_ABSENT(GetShiftFraction, (FMI3_VARIABLES, uint64_t x[], uint64_t y[]))
FMI3_ABSENT(SetIntervalDecimal, (FMI3_VARIABLES, const double x[]))
FMI3_ABSENT(SetIntervalFraction, (FMI3_VARIABLES, const uint64_t x[], const uint64_t y[]))
FMI3_ABSENT(SetShiftDecimal, (FMI3_VARIABLES, const double x[]))
FMI3_ABSENT(SetShiftFraction, (FMI3_VARIABLES, const uint64_t x[], const uint64_t y[]))
FMI3_ABSENT(EvaluateDiscreteStates, (void *of))
FMI3_ABSENT(GetOutputDerivatives, (FMI3_VARIABLES, const int32_t orders[], double x[], size_t m))
FMI3_ABSENT(EnterContinuousTimeMode, (void *of))
FMI3_ABSENT(CompletedIntegratorStep, (void *of, bool no_earlier, bool *event, bool *end))
FMI3_ABSENT(SetTime, (void *of, double time))
FMI3_ABSENT(SetContinuousStates, (void *of, const double x[], size_t n))
FMI3_ABSENT(GetContinuousStateDerivatives, (void *of, double x[], size_t n))
FMI3_ABSENT(GetEventIndicators, (void *of, double x[], size_t n))
FMI3_ABSENT(GetContinuousStates, (void *of, double x[], size_t n))
FMI3_ABSENT(GetNominalsOfContinuousStates, (void *of, double x[], size_t n))
FMI3_ABSENT(GetNumberOfEventIndicators, (void *of, size_t *n))
FMI3_ABSENT(GetNumberOfContinuousStates, (void *of, size_t *n))
FMI3_ABSENT(ActivateModelPartition, (void *of, uint32_t v, double time))

/* New values of parameters take effect with the next step; events do nothing else. */
FMI3_STATUS(UpdateDiscreteStates)(void *of, bool *again, bool *terminate, bool *nominals, bool *states, bool *has_next,
    double *next)
{
    if (of == NULL) return fmi3Error;
    *again = *terminate = *nominals = *states = *has_next = false;
    *next = 0.0;
    return fmi3OK;
}

/* ---- States, also as bytes: these end with a checksum, and can be read on machines of the same kind only ---- */

enum { PHI_FMU_BYTES = sizeof(phi_fmu_state) + sizeof(uint64_t) };

/* Copy a state to *to, which is allocated if it is NULL. */
static fmi3Status phi_fmi3_copy(void *of, const void *state, void **to)
{
    if (*to == NULL) *to = malloc(sizeof(phi_fmu_state));
    if (*to != NULL) memcpy(*to, state, sizeof(phi_fmu_state));
    return phi_fmi3_demand(*to != NULL, of, "no memory");
}

FMI3_STATUS(GetFMUState)(void *of, void **state)
{
    if (of == NULL || state == NULL) return fmi3Error;
    return phi_fmi3_copy(of, phi_fmi3_state(of), state);
}

FMI3_STATUS(SetFMUState)(void *of, void *state)
{
    if (of == NULL || state == NULL) return fmi3Error;
    memcpy(phi_fmi3_state(of), state, sizeof(phi_fmu_state));
    return fmi3OK;
}

FMI3_STATUS(FreeFMUState)(void *of, void **state)
{
    if (of == NULL || state == NULL) return fmi3Error;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

FMI3_STATUS(SerializedFMUStateSize)(void *of, void *state, size_t *size)
{
    if (of == NULL || state == NULL || size == NULL) return fmi3Error;
    *size = PHI_FMU_BYTES;
    return fmi3OK;
}

FMI3_STATUS(SerializeFMUState)(void *of, void *state, uint8_t bytes[], size_t size)
{
    if (of == NULL || state == NULL || bytes == NULL || size < PHI_FMU_BYTES) return fmi3Error;
    const uint64_t checksum = phi_fmu_checksum((const unsigned char *)state);
    memcpy(bytes, state, sizeof(phi_fmu_state));
    memcpy(&bytes[sizeof(phi_fmu_state)], &checksum, sizeof checksum);
    return fmi3OK;
}

/* If this function fails, *state is unchanged. */
FMI3_STATUS(DeserializeFMUState)(void *of, const uint8_t bytes[], size_t size, void **state)
{
    uint64_t checksum = 0;
    if (of == NULL || state == NULL) return fmi3Error;
    const bool complete = bytes != NULL && size == PHI_FMU_BYTES;
    if (complete) memcpy(&checksum, &bytes[sizeof(phi_fmu_state)], sizeof checksum);
    if (!complete || checksum != phi_fmu_checksum(bytes))
        return phi_fmi3_demand(false, of, "the bytes are not those of a state of this FMU");
    return phi_fmi3_copy(of, bytes, state);
}

FMI3_STATUS(DoStep)(void *of, double from, double size, bool no_earlier, bool *event, bool *terminate, bool *early,
    double *reached)
{
    phi_fmu *instance = (phi_fmu *)of;
    if (of == NULL || event == NULL || terminate == NULL || early == NULL || reached == NULL) return fmi3Error;
    *event = *terminate = *early = false;
    *reached = instance->state.time;
    if (!phi_fmu_may_step(&instance->state, from, size))
        return phi_fmi3_demand(false, of, "a step from another time or mode, or beyond the stop time");
    const phi_status status = phi_fmu_do_step(instance, from + size);
    *reached = instance->state.time;
    *early = status == PHI_OK && *reached < from + size;
    return phi_fmi3_demand(status == PHI_OK, of, phi_status_string(status)) == fmi3OK ? fmi3OK : fmi3Discard;
}
#endif
