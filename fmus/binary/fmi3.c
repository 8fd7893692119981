/* The functions of an FMI 3.0 co-simulation FMU: those of FMI 2.0 with whole arrays as variables. */

#include "instance.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* The logger of FMI 3.0 takes a text, not a format. */
static void call_logger(Instance *self, int status, const char *category, const char *text)
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

static Instance *new_instance(const char *name, const char *token, const char *resources, bool visible,
                              bool co_simulation, void *environment, Fmi3Logger *logger)
{
    Instance *const self = calloc(1, sizeof *self);
    if (self == NULL)
        return NULL;
    self->logger = logger;
    self->environment = environment;
    self->call_logger = call_logger;
    self->visible = visible;
    self->co_simulation = co_simulation;
    return instantiate(self, name, "instantiationToken=\"", token, resources);
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool events, bool early, const unsigned *intermediate,
                                         size_t intermediates, void *environment, Fmi3Logger *logger, void *update)
{
    (void)logging, (void)events, (void)early, (void)intermediate, (void)intermediates, (void)update;
    return new_instance(name, token, resources, visible, true, environment, logger);
}

EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                          bool logging, void *environment, Fmi3Logger *logger)
{
    (void)logging;
    return new_instance(name, token, resources, visible, false, environment, logger);
}

EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible,
                                               bool logging, void *environment, Fmi3Logger *logger, void *clock,
                                               void *lock, void *unlock)
{
    (void)logging, (void)clock, (void)lock, (void)unlock;
    return new_instance(name, token, resources, visible, false, environment, logger);
}

EXPORT void fmi3FreeInstance(void *instance) { free_instance(instance); }

EXPORT int fmi3SetDebugLogging(void *instance, bool logging, size_t count, const char *const categories[])
{
    return set_debug_logging(instance, logging, count, categories);
}

EXPORT int fmi3EnterInitializationMode(void *instance, bool tolerant, double tolerance, double start, bool stops,
                                       double stop)
{
    Instance *const self = begin_call(instance);
    (void)tolerant, (void)tolerance, (void)stops, (void)stop;
    if (self == NULL)
        return ERROR;
    return setup_experiment(self, start) == OK ? call_method(instance, "enter_initialization_mode") : ERROR;
}

EXPORT int fmi3ExitInitializationMode(void *instance) { return call_method(instance, "exit_initialization_mode"); }
EXPORT int fmi3Terminate(void *instance) { return call_method(instance, "terminate"); }
EXPORT int fmi3Reset(void *instance) { return reset(instance); }

/* Variables */

EXPORT int fmi3GetFloat64(void *instance, const unsigned references[], size_t count, double values[], size_t size)
{
    return access_values(instance, REAL, references, count, NULL, values, size, 1);
}

EXPORT int fmi3SetFloat64(void *instance, const unsigned references[], size_t count, const double values[], size_t size)
{
    return access_values(instance, REAL, references, count, values, NULL, size, 1);
}

EXPORT int fmi3GetInt32(void *instance, const unsigned references[], size_t count, int32_t values[], size_t size)
{
    return access_values(instance, INTEGER, references, count, NULL, values, size, 1);
}

EXPORT int fmi3SetInt32(void *instance, const unsigned references[], size_t count, const int32_t values[], size_t size)
{
    return access_values(instance, INTEGER, references, count, values, NULL, size, 1);
}

/* Booleans are bytes in FMI 3.0, and integers for the slave. */
EXPORT int fmi3GetBoolean(void *instance, const unsigned references[], size_t count, bool values[], size_t size)
{
    int *const integers = values != NULL ? calloc(size + 1, sizeof *integers) : NULL;
    const int status = access_values(instance, BOOLEAN, references, count, NULL, integers, size, 1);
    for (size_t i = 0; status == OK && count > 0 && i < size; ++i)
        values[i] = integers[i] != 0;
    free(integers);
    return status;
}

EXPORT int fmi3SetBoolean(void *instance, const unsigned references[], size_t count, const bool values[], size_t size)
{
    int *const integers = values != NULL ? calloc(size + 1, sizeof *integers) : NULL;
    for (size_t i = 0; integers != NULL && i < size; ++i)
        integers[i] = ((const unsigned char *)values)[i] != 0;
    const int status = access_values(instance, BOOLEAN, references, count, integers, NULL, size, 1);
    free(integers);
    return status;
}

/* FMU states */

EXPORT int fmi3GetFMUState(void *instance, void **state) { return get_fmu_state(instance, state); }
EXPORT int fmi3SetFMUState(void *instance, void *state) { return set_fmu_state(instance, state); }
EXPORT int fmi3FreeFMUState(void *instance, void **state) { return free_fmu_state(instance, state); }

EXPORT int fmi3SerializedFMUStateSize(void *instance, void *state, size_t *size)
{
    return serialized_state_size(instance, state, size);
}

EXPORT int fmi3SerializeFMUState(void *instance, void *state, uint8_t bytes[], size_t size)
{
    return serialize_fmu_state(instance, state, (char *)bytes, size);
}

EXPORT int fmi3DeserializeFMUState(void *instance, const uint8_t bytes[], size_t size, void **state)
{
    return deserialize_fmu_state(instance, (const char *)bytes, size, state);
}

/* Steps */

EXPORT int fmi3DoStep(void *instance, double time, double step, bool no_state_before, bool *event, bool *terminate,
                      bool *early, double *last)
{
    Instance *const self = begin_call(instance);
    if (self == NULL)
        return ERROR;
    (void)no_state_before;
    if (event == NULL || terminate == NULL || early == NULL || last == NULL)
        return log_error(self, "A result of the step has no place at a null pointer.");
    const int status = do_step(instance, time, step);
    *event = *early = *terminate = false;
    *last = self->last_successful_time;
    return status;
}

/* Functions that are not supported: other types, events, derivatives, model exchange, scheduled execution. */

#define NOT_SUPPORTED(name, ...) \
    EXPORT int name(void *instance, __VA_ARGS__) { return not_supported(instance, #name); }
#define TYPE_NOT_SUPPORTED(name, type)                                                     \
    NOT_SUPPORTED(fmi3Get##name, const unsigned r[], size_t n, type values[], size_t size) \
    NOT_SUPPORTED(fmi3Set##name, const unsigned r[], size_t n, const type values[], size_t size)
#define MODE_NOT_SUPPORTED(name) \
    EXPORT int name(void *instance) { return not_supported(instance, #name); }

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
typedef const char *String;
TYPE_NOT_SUPPORTED(Float32, float)
TYPE_NOT_SUPPORTED(Int8, int8_t)
TYPE_NOT_SUPPORTED(UInt8, uint8_t)
TYPE_NOT_SUPPORTED(Int16, int16_t)
TYPE_NOT_SUPPORTED(UInt16, uint16_t)
TYPE_NOT_SUPPORTED(UInt32, uint32_t)
TYPE_NOT_SUPPORTED(Int64, int64_t)
TYPE_NOT_SUPPORTED(UInt64, uint64_t)
TYPE_NOT_SUPPORTED(String, String)
NOT_SUPPORTED(fmi3GetBinary, const unsigned r[], size_t n, size_t sizes[], const uint8_t *values[], size_t size)
NOT_SUPPORTED(fmi3SetBinary, const unsigned r[], size_t n, const size_t sizes[], const uint8_t *const values[], size_t size)
NOT_SUPPORTED(fmi3GetClock, const unsigned r[], size_t n, bool values[])
NOT_SUPPORTED(fmi3SetClock, const unsigned r[], size_t n, const bool values[])
NOT_SUPPORTED(fmi3GetNumberOfVariableDependencies, unsigned r, size_t *n)
NOT_SUPPORTED(fmi3GetVariableDependencies, unsigned r, size_t of[], unsigned on[], size_t elements[], int kinds[],
              size_t n)
NOT_SUPPORTED(fmi3GetDirectionalDerivative, const unsigned u[], size_t nu, const unsigned k[], size_t nk,
              const double seed[], size_t ns, double result[], size_t nr)
NOT_SUPPORTED(fmi3GetAdjointDerivative, const unsigned u[], size_t nu, const unsigned k[], size_t nk,
              const double seed[], size_t ns, double result[], size_t nr)
NOT_SUPPORTED(fmi3GetIntervalDecimal, const unsigned r[], size_t n, double intervals[], int qualifiers[])
NOT_SUPPORTED(fmi3GetIntervalFraction, const unsigned r[], size_t n, uint64_t counters[], uint64_t resolutions[], int q[])
NOT_SUPPORTED(fmi3GetShiftDecimal, const unsigned r[], size_t n, double shifts[])
NOT_SUPPORTED(fmi3GetShiftFraction, const unsigned r[], size_t n, uint64_t counters[], uint64_t resolutions[])
NOT_SUPPORTED(fmi3SetIntervalDecimal, const unsigned r[], size_t n, const double intervals[])
NOT_SUPPORTED(fmi3SetIntervalFraction, const unsigned r[], size_t n, const uint64_t counters[],
              const uint64_t resolutions[])
NOT_SUPPORTED(fmi3SetShiftDecimal, const unsigned r[], size_t n, const double shifts[])
NOT_SUPPORTED(fmi3SetShiftFraction, const unsigned r[], size_t n, const uint64_t counters[], const uint64_t resolutions[])
NOT_SUPPORTED(fmi3UpdateDiscreteStates, bool *update, bool *terminate, bool *nominals, bool *values, bool *defined,
              double *next)
NOT_SUPPORTED(fmi3CompletedIntegratorStep, bool no_state_before, bool *event, bool *terminate)
NOT_SUPPORTED(fmi3SetTime, double time)
NOT_SUPPORTED(fmi3SetContinuousStates, const double states[], size_t n)
NOT_SUPPORTED(fmi3GetContinuousStateDerivatives, double derivatives[], size_t n)
NOT_SUPPORTED(fmi3GetEventIndicators, double indicators[], size_t n)
NOT_SUPPORTED(fmi3GetContinuousStates, double states[], size_t n)
NOT_SUPPORTED(fmi3GetNominalsOfContinuousStates, double nominals[], size_t n)
NOT_SUPPORTED(fmi3GetNumberOfEventIndicators, size_t *n)
NOT_SUPPORTED(fmi3GetNumberOfContinuousStates, size_t *n)
NOT_SUPPORTED(fmi3GetOutputDerivatives, const unsigned r[], size_t n, const int32_t orders[], double values[], size_t size)
NOT_SUPPORTED(fmi3ActivateModelPartition, unsigned clock, double time)
#pragma GCC diagnostic pop
MODE_NOT_SUPPORTED(fmi3EnterEventMode)
MODE_NOT_SUPPORTED(fmi3EnterStepMode)
MODE_NOT_SUPPORTED(fmi3EnterConfigurationMode)
MODE_NOT_SUPPORTED(fmi3ExitConfigurationMode)
MODE_NOT_SUPPORTED(fmi3EvaluateDiscreteStates)
MODE_NOT_SUPPORTED(fmi3EnterContinuousTimeMode)
