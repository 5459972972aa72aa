/* A program that includes the C of an FMU (UNIT) and uses it as an environment of FMI 3 does, to be run with sanitizers.
   It prints "ok", or the line and the text of the first condition that does not hold. */
#include <stdio.h>
#include UNIT

static int reports;

static void hear(void *environment, fmi3Status status, const char *category, const char *message)
{
    (void)environment;
    (void)status;
    if (category != NULL && message != NULL) ++reports;
}

static void update(void *environment, double time, bool set, bool get,
    bool finished, bool can_return, bool *early, double *when)
{
    (void)environment;
    (void)set;
    (void)get;
    (void)finished;
    *early = can_return && time > 0.3;
    *when = time;
}

#define MUST(condition) \
    do { \
        if (!(condition)) { \
            printf("%d: %s\n", __LINE__, #condition); \
            return 1; \
        } \
    } while (0)

int main(void)
{
    bool event, terminate, early;
    double reached, at[2], x[2];
    int32_t seed = 1;
    uint32_t whole[1];
    void *copy = NULL, *read = NULL;
    unsigned char bytes[1 << 15];
    size_t size;
    const uint32_t first[2] = { FMU(STATE), FMU(STATE) + 1 }, parameter[1] = { FMU(PARAMETER) };
    const uint32_t beyond[1] = { FMU(END) };
    void *unit = PREFIXED(InstantiateCoSimulation)("unit", TOKEN, NULL, false, true, true, true, NULL, 0, NULL,
        hear, update);
    MUST(PREFIXED(InstantiateCoSimulation)("u", "other", NULL, false, true, true, true, NULL, 0, NULL, hear, update) == NULL);
    MUST(reports == 1);
    MUST(unit != NULL);
    MUST(PREFIXED(DoStep)(unit, 0.0, 0.1, true, &event, &terminate, &early, &reached) == fmi3Error); /* before initialisation */
    MUST(PREFIXED(EnterInitializationMode)(unit, false, 0.0, 0.0, false, 0.0) == fmi3OK);
    x[0] = -1.0; /* the parameter must be positive: initialisation fails until it has its old value again */
    MUST(PREFIXED(GetFloat64)(unit, parameter, 1, at, 1) == fmi3OK);
    MUST(PREFIXED(SetFloat64)(unit, parameter, 1, x, 1) == fmi3OK);
    MUST(PREFIXED(ExitInitializationMode)(unit) == fmi3Error);
    MUST(PREFIXED(DoStep)(unit, 0.0, 0.1, true, &event, &terminate, &early, &reached) == fmi3Error);
    MUST(PREFIXED(SetFloat64)(unit, parameter, 1, at, 1) == fmi3OK);
    for (whole[0] = 0; whole[0] <= FMU(END); ++whole[0]) { /* without noise, no variable is a seed */
        MUST(PREFIXED(GetInt32)(unit, whole, 1, &seed, 1) == fmi3Error);
        MUST(PREFIXED(SetInt32)(unit, whole, 1, &seed, 1) == fmi3Error);
    }
    MUST(PREFIXED(ExitInitializationMode)(unit) == fmi3OK);
    MUST(PREFIXED(EnterStepMode)(unit) == fmi3OK);
    MUST(PREFIXED(DoStep)(unit, 0.0, 1.0, true, &event, &terminate, &early, &reached) == fmi3OK);
    MUST(early && reached > 0.3 && reached < 0.3 + 2.0 * STEP); /* early return, after a whole number of steps */
    MUST(fabs(reached / STEP - round(reached / STEP)) < 1e-9);
    MUST(PREFIXED(GetFMUState)(unit, &copy) == fmi3OK && PREFIXED(GetFMUState)(unit, &copy) == fmi3OK);
    MUST(PREFIXED(SerializedFMUStateSize)(unit, copy, &size) == fmi3OK && size < sizeof bytes);
    MUST(PREFIXED(SerializeFMUState)(unit, copy, bytes, size) == fmi3OK);
    MUST(PREFIXED(DoStep)(unit, reached, 0.77 * STEP, true, &event, &terminate, &early, &reached) == fmi3OK);
    MUST(PREFIXED(GetFloat64)(unit, first, 2, at, 2) == fmi3OK);
    MUST(PREFIXED(DeserializeFMUState)(unit, bytes, size, &read) == fmi3OK);
    bytes[size - 1] ^= 1;
    MUST(PREFIXED(DeserializeFMUState)(unit, bytes, size, &copy) == fmi3Error); /* copy is unchanged */
    MUST(PREFIXED(DeserializeFMUState)(unit, bytes, size - 1, &copy) == fmi3Error);
    MUST(PREFIXED(SetFMUState)(unit, read) == fmi3OK);
    MUST(PREFIXED(DoStep)(unit, reached - 0.77 * STEP, 0.77 * STEP, true, &event, &terminate, &early, &reached) == fmi3OK);
    MUST(PREFIXED(GetFloat64)(unit, first, 2, x, 2) == fmi3OK && memcmp(at, x, sizeof x) == 0);
    MUST(PREFIXED(GetFloat64)(unit, beyond, 1, x, 1) == fmi3Error);
    MUST(PREFIXED(SetFloat64)(unit, first, 2, at, 2) == fmi3Error); /* not after initialisation */
    x[0] = NAN;
    MUST(PREFIXED(SetFloat64)(unit, parameter, 1, x, 1) == fmi3Error);
    x[0] = -1.0; /* not positive: the next step is discarded and changes nothing */
    MUST(PREFIXED(SetFloat64)(unit, parameter, 1, x, 1) == fmi3OK);
    MUST(PREFIXED(DoStep)(unit, reached, STEP, true, &event, &terminate, &early, &reached) == fmi3Discard);
    MUST(PREFIXED(GetFloat64)(unit, first, 2, x, 2) == fmi3OK && memcmp(at, x, sizeof x) == 0);
    MUST(PREFIXED(FreeFMUState)(unit, &copy) == fmi3OK && copy == NULL && PREFIXED(FreeFMUState)(unit, &read) == fmi3OK);
    MUST(PREFIXED(EnterEventMode)(unit) == fmi3OK && PREFIXED(EnterStepMode)(unit) == fmi3OK);
    MUST(PREFIXED(Terminate)(unit) == fmi3OK);
    x[0] = 7.0;
    MUST(PREFIXED(SetFloat64)(unit, parameter, 1, x, 1) == fmi3Error);
    MUST(PREFIXED(GetFloat64)(unit, parameter, 1, x, 1) == fmi3OK && x[0] < 7.0); /* the refused value is not stored */
    MUST(LAST_TIME(unit, fmi2LastSuccessfulTime, &reached) == fmi2OK && reached > 0.3);
    MUST(PREFIXED(Reset)(unit) == fmi3OK);
    MUST(LAST_TIME(unit, fmi2LastSuccessfulTime, &reached) == fmi2OK && fabs(reached) < 1e-9);
    PREFIXED(FreeInstance)(unit);
    puts("ok");
    return 0;
}
