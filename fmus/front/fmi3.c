/* The functions of an FMI 3.0 co-simulation FMU: those of FMI 2.0 with whole arrays as variables. */

#include "instance.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef void Logger(void *environment, int status, const char *category, const char *message);

/* The logger of FMI 3.0 takes a text, not a format. */
static void tell(Front *front, int status, const char *category, const char *text)
{
    char *const plain = front->logger != NULL ? malloc(strlen(text) + 1) : NULL;
    char *to = plain;
    if (plain == NULL)
        return;
    for (; *text != '\0'; ++text) {
        *to++ = *text;
        if (text[0] == '%' && text[1] == '%')
            ++text;
    }
    *to = '\0';
    front->logger(front->environment, status, category, plain);
    free(plain);
}

static Front *made(const char *name, const char *token, const char *resources, bool visible, bool right, void *environment,
                   Logger *logger)
{
    Front *const front = calloc(1, sizeof *front);
    if (front == NULL)
        return NULL;
    front->logger = logger;
    front->environment = environment;
    front->tell = tell;
    front->visible = visible;
    front->for_co_simulation = right;
    return ready(front, name, "instantiationToken=\"", token, resources);
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool events, bool early, const unsigned *intermediate,
                                         size_t intermediates, void *environment, Logger *logger, void *update)
{
    (void)logging, (void)events, (void)early, (void)intermediate, (void)intermediates, (void)update;
    return made(name, token, resources, visible, true, environment, logger);
}

EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                          bool logging, void *environment, Logger *logger)
{
    (void)logging;
    return made(name, token, resources, visible, false, environment, logger);
}

EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible,
                                               bool logging, void *environment, Logger *logger, void *clock, void *lock,
                                               void *unlock)
{
    (void)logging, (void)clock, (void)lock, (void)unlock;
    return made(name, token, resources, visible, false, environment, logger);
}

EXPORT void fmi3FreeInstance(void *instance) { fmi2FreeInstance(instance); }

EXPORT int fmi3SetDebugLogging(void *instance, bool logging, size_t count, const char *const categories[])
{
    return fmi2SetDebugLogging(instance, logging, count, categories);
}

EXPORT int fmi3EnterInitializationMode(void *instance, bool tolerant, double tolerance, double start, bool stops,
                                       double stop)
{
    Front *const front = begun(instance);
    (void)tolerant, (void)tolerance, (void)stops, (void)stop;
    if (front == NULL)
        return ERROR;
    const int status = judged(front, slave_setup(&front->slave, start) && front->worst < DISCARD &&
                                         slave_call(&front->slave, "enter_initialization_mode"));
    if (status == OK)
        front->last = start;
    return status;
}

EXPORT int fmi3ExitInitializationMode(void *instance) { return fmi2ExitInitializationMode(instance); }
EXPORT int fmi3Terminate(void *instance) { return fmi2Terminate(instance); }
EXPORT int fmi3Reset(void *instance) { return fmi2Reset(instance); }

/* Variables */

static int moved(void *instance, Kind kind, const unsigned *references, size_t count, const void *given, void *taken,
                 size_t values)
{
    Front *const front = begun(instance);
    if (front == NULL)
        return ERROR;
    if (count == 0)
        return OK;
    if (references == NULL || (given == NULL && taken == NULL))
        return refused(front, "There are no value references or no values at a null pointer.");
    return judged(front, taken != NULL ? slave_take_arrays(&front->slave, kind, references, count, taken, values)
                                       : slave_put_arrays(&front->slave, kind, references, count, given, values));
}

EXPORT int fmi3GetFloat64(void *instance, const unsigned references[], size_t count, double values[], size_t size)
{
    return moved(instance, REAL, references, count, NULL, values, size);
}

EXPORT int fmi3SetFloat64(void *instance, const unsigned references[], size_t count, const double values[], size_t size)
{
    return moved(instance, REAL, references, count, values, NULL, size);
}

EXPORT int fmi3GetInt32(void *instance, const unsigned references[], size_t count, int32_t values[], size_t size)
{
    return moved(instance, INTEGER, references, count, NULL, values, size);
}

EXPORT int fmi3SetInt32(void *instance, const unsigned references[], size_t count, const int32_t values[], size_t size)
{
    return moved(instance, INTEGER, references, count, values, NULL, size);
}

/* Booleans are bytes in FMI 3.0, and integers for the slave. */
EXPORT int fmi3GetBoolean(void *instance, const unsigned references[], size_t count, bool values[], size_t size)
{
    int *const taken = values != NULL ? calloc(size + 1, sizeof *taken) : NULL;
    const int status = moved(instance, BOOLEAN, references, count, NULL, taken, size);
    for (size_t i = 0; status == OK && count > 0 && i < size; ++i)
        values[i] = taken[i] != 0;
    free(taken);
    return status;
}

EXPORT int fmi3SetBoolean(void *instance, const unsigned references[], size_t count, const bool values[], size_t size)
{
    int *const given = values != NULL ? calloc(size + 1, sizeof *given) : NULL;
    for (size_t i = 0; given != NULL && i < size; ++i)
        given[i] = ((const unsigned char *)values)[i] != 0;
    const int status = moved(instance, BOOLEAN, references, count, given, NULL, size);
    free(given);
    return status;
}

/* States */

EXPORT int fmi3GetFMUState(void *instance, void **state) { return fmi2GetFMUstate(instance, state); }
EXPORT int fmi3SetFMUState(void *instance, void *state) { return fmi2SetFMUstate(instance, state); }
EXPORT int fmi3FreeFMUState(void *instance, void **state) { return fmi2FreeFMUstate(instance, state); }

EXPORT int fmi3SerializedFMUStateSize(void *instance, void *state, size_t *size)
{
    return fmi2SerializedFMUstateSize(instance, state, size);
}

EXPORT int fmi3SerializeFMUState(void *instance, void *state, uint8_t bytes[], size_t size)
{
    return fmi2SerializeFMUstate(instance, state, (char *)bytes, size);
}

EXPORT int fmi3DeserializeFMUState(void *instance, const uint8_t bytes[], size_t size, void **state)
{
    return fmi2DeSerializeFMUstate(instance, (const char *)bytes, size, state);
}

/* Steps */

EXPORT int fmi3DoStep(void *instance, double time, double step, bool no_state_before, bool *event, bool *terminate,
                      bool *early, double *last)
{
    Front *const front = begun(instance);
    if (front == NULL)
        return ERROR;
    if (event == NULL || terminate == NULL || early == NULL || last == NULL)
        return refused(front, "A result of the step has no place at a null pointer.");
    const int status = fmi2DoStep(instance, time, step, no_state_before);
    *event = *early = *terminate = false;
    *last = front->last;
    return status;
}

/* What there is not: other types, events, derivatives, model exchange, scheduled execution. */

#define ABSENT(name, ...)                                                                     \
    EXPORT int name(void *instance, __VA_ARGS__)                                              \
    {                                                                                         \
        Front *const front = begun(instance);                                                 \
        return front == NULL ? ERROR : refused(front, "%s is not supported.", #name);         \
    }
#define NO_TYPE(name, type)                                                                   \
    ABSENT(fmi3Get##name, const unsigned r[], size_t n, type values[], size_t size)           \
    ABSENT(fmi3Set##name, const unsigned r[], size_t n, const type values[], size_t size)
#define NOTHING(name)                                                                         \
    EXPORT int name(void *instance)                                                           \
    {                                                                                         \
        Front *const front = begun(instance);                                                 \
        return front == NULL ? ERROR : refused(front, "%s is not supported.", #name);         \
    }

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
typedef const char *String;
NO_TYPE(Float32, float)
NO_TYPE(Int8, int8_t)
NO_TYPE(UInt8, uint8_t)
NO_TYPE(Int16, int16_t)
NO_TYPE(UInt16, uint16_t)
NO_TYPE(UInt32, uint32_t)
NO_TYPE(Int64, int64_t)
NO_TYPE(UInt64, uint64_t)
NO_TYPE(String, String)
ABSENT(fmi3GetBinary, const unsigned r[], size_t n, size_t sizes[], const uint8_t *values[], size_t size)
ABSENT(fmi3SetBinary, const unsigned r[], size_t n, const size_t sizes[], const uint8_t *const values[], size_t size)
ABSENT(fmi3GetClock, const unsigned r[], size_t n, bool values[])
ABSENT(fmi3SetClock, const unsigned r[], size_t n, const bool values[])
ABSENT(fmi3GetNumberOfVariableDependencies, unsigned r, size_t *n)
ABSENT(fmi3GetVariableDependencies, unsigned r, size_t of[], unsigned on[], size_t elements[], int kinds[], size_t n)
ABSENT(fmi3GetDirectionalDerivative, const unsigned u[], size_t nu, const unsigned k[], size_t nk, const double seed[],
       size_t ns, double result[], size_t nr)
ABSENT(fmi3GetAdjointDerivative, const unsigned u[], size_t nu, const unsigned k[], size_t nk, const double seed[],
       size_t ns, double result[], size_t nr)
ABSENT(fmi3GetIntervalDecimal, const unsigned r[], size_t n, double intervals[], int qualifiers[])
ABSENT(fmi3GetIntervalFraction, const unsigned r[], size_t n, uint64_t counters[], uint64_t resolutions[], int q[])
ABSENT(fmi3GetShiftDecimal, const unsigned r[], size_t n, double shifts[])
ABSENT(fmi3GetShiftFraction, const unsigned r[], size_t n, uint64_t counters[], uint64_t resolutions[])
ABSENT(fmi3SetIntervalDecimal, const unsigned r[], size_t n, const double intervals[])
ABSENT(fmi3SetIntervalFraction, const unsigned r[], size_t n, const uint64_t counters[], const uint64_t resolutions[])
ABSENT(fmi3SetShiftDecimal, const unsigned r[], size_t n, const double shifts[])
ABSENT(fmi3SetShiftFraction, const unsigned r[], size_t n, const uint64_t counters[], const uint64_t resolutions[])
ABSENT(fmi3UpdateDiscreteStates, bool *update, bool *terminate, bool *nominals, bool *values, bool *defined, double *next)
ABSENT(fmi3CompletedIntegratorStep, bool no_state_before, bool *event, bool *terminate)
ABSENT(fmi3SetTime, double time)
ABSENT(fmi3SetContinuousStates, const double states[], size_t n)
ABSENT(fmi3GetContinuousStateDerivatives, double derivatives[], size_t n)
ABSENT(fmi3GetEventIndicators, double indicators[], size_t n)
ABSENT(fmi3GetContinuousStates, double states[], size_t n)
ABSENT(fmi3GetNominalsOfContinuousStates, double nominals[], size_t n)
ABSENT(fmi3GetNumberOfEventIndicators, size_t *n)
ABSENT(fmi3GetNumberOfContinuousStates, size_t *n)
ABSENT(fmi3GetOutputDerivatives, const unsigned r[], size_t n, const int32_t orders[], double values[], size_t size)
ABSENT(fmi3ActivateModelPartition, unsigned clock, double time)
#pragma GCC diagnostic pop
NOTHING(fmi3EnterEventMode)
NOTHING(fmi3EnterStepMode)
NOTHING(fmi3EnterConfigurationMode)
NOTHING(fmi3ExitConfigurationMode)
NOTHING(fmi3EvaluateDiscreteStates)
NOTHING(fmi3EnterContinuousTimeMode)
