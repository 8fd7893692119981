/* The functions of an FMI 3.0 co-simulation FMU: those of FMI 2.0 with whole arrays as variables. */

#include "instance.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef void Logger(void *environment, int status, const char *category, const char *message);

/* The logger of FMI 3.0 takes a text, not a format. */
static void tell(Instance *self, int status, const char *category, const char *text)
{
    char *const plain = self->logger != NULL ? malloc(strlen(text) + 1) : NULL;
    char *to = plain;
    if (plain == NULL)
        return;
    for (; *text != '\0'; ++text) {
        *to++ = *text;
        if (text[0] == '%' && text[1] == '%')
            ++text;
    }
    *to = '\0';
    self->logger(self->environment, status, category, plain);
    free(plain);
}

static Instance *made(const char *name, const char *token, const char *resources, bool visible, bool right,
                      void *environment, Logger *logger)
{
    Instance *const self = calloc(1, sizeof *self);
    if (self == NULL)
        return NULL;
    self->logger = logger;
    self->environment = environment;
    self->tell = tell;
    self->visible = visible;
    self->for_co_simulation = right;
    return ready(self, name, "instantiationToken=\"", token, resources);
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

EXPORT void fmi3FreeInstance(void *instance) { free_instance(instance); }

EXPORT int fmi3SetDebugLogging(void *instance, bool logging, size_t count, const char *const categories[])
{
    return log_only(instance, logging, count, categories);
}

EXPORT int fmi3EnterInitializationMode(void *instance, bool tolerant, double tolerance, double start, bool stops,
                                       double stop)
{
    Instance *const self = begun(instance);
    (void)tolerant, (void)tolerance, (void)stops, (void)stop;
    if (self == NULL)
        return ERROR;
    return set_up(self, start) == OK ? called(instance, "enter_initialization_mode") : ERROR;
}

EXPORT int fmi3ExitInitializationMode(void *instance) { return called(instance, "exit_initialization_mode"); }
EXPORT int fmi3Terminate(void *instance) { return called(instance, "terminate"); }
EXPORT int fmi3Reset(void *instance) { return reset(instance); }

/* Variables */

EXPORT int fmi3GetFloat64(void *instance, const unsigned references[], size_t count, double values[], size_t size)
{
    return moved(instance, REAL, references, count, NULL, values, size, 1);
}

EXPORT int fmi3SetFloat64(void *instance, const unsigned references[], size_t count, const double values[], size_t size)
{
    return moved(instance, REAL, references, count, values, NULL, size, 1);
}

EXPORT int fmi3GetInt32(void *instance, const unsigned references[], size_t count, int32_t values[], size_t size)
{
    return moved(instance, INTEGER, references, count, NULL, values, size, 1);
}

EXPORT int fmi3SetInt32(void *instance, const unsigned references[], size_t count, const int32_t values[], size_t size)
{
    return moved(instance, INTEGER, references, count, values, NULL, size, 1);
}

/* Booleans are bytes in FMI 3.0, and integers for the slave. */
EXPORT int fmi3GetBoolean(void *instance, const unsigned references[], size_t count, bool values[], size_t size)
{
    int *const taken = values != NULL ? calloc(size + 1, sizeof *taken) : NULL;
    const int status = moved(instance, BOOLEAN, references, count, NULL, taken, size, 1);
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
    const int status = moved(instance, BOOLEAN, references, count, given, NULL, size, 1);
    free(given);
    return status;
}

/* States */

EXPORT int fmi3GetFMUState(void *instance, void **state) { return save_state(instance, state); }
EXPORT int fmi3SetFMUState(void *instance, void *state) { return restore_state(instance, state); }
EXPORT int fmi3FreeFMUState(void *instance, void **state) { return give_back_state(instance, state); }

EXPORT int fmi3SerializedFMUStateSize(void *instance, void *state, size_t *size)
{
    return state_size(instance, state, size);
}

EXPORT int fmi3SerializeFMUState(void *instance, void *state, uint8_t bytes[], size_t size)
{
    return serialise_state(instance, state, (char *)bytes, size);
}

EXPORT int fmi3DeserializeFMUState(void *instance, const uint8_t bytes[], size_t size, void **state)
{
    return read_state(instance, (const char *)bytes, size, state);
}

/* Steps */

EXPORT int fmi3DoStep(void *instance, double time, double step, bool no_state_before, bool *event, bool *terminate,
                      bool *early, double *last)
{
    Instance *const self = begun(instance);
    if (self == NULL)
        return ERROR;
    (void)no_state_before;
    if (event == NULL || terminate == NULL || early == NULL || last == NULL)
        return refused(self, "A result of the step has no place at a null pointer.");
    const int status = stepped(instance, time, step);
    *event = *early = *terminate = false;
    *last = self->last;
    return status;
}

/* What there is not: other types, events, derivatives, model exchange, scheduled execution. */

#define ABSENT(name, ...) \
    EXPORT int name(void *instance, __VA_ARGS__) { return absent(instance, #name); }
#define NO_TYPE(name, type)                                                                   \
    ABSENT(fmi3Get##name, const unsigned r[], size_t n, type values[], size_t size)           \
    ABSENT(fmi3Set##name, const unsigned r[], size_t n, const type values[], size_t size)
#define NOTHING(name) \
    EXPORT int name(void *instance) { return absent(instance, #name); }

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
