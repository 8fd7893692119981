/* The functions of an FMI 2.0 co-simulation FMU. */

#include "instance.h"

#include <stdlib.h>

enum { DO_STEP_STATUS, PENDING_STATUS, LAST_SUCCESSFUL_TIME, TERMINATED }; /* fmi2StatusKind */
enum { CO_SIMULATION = 1 };                                                /* fmi2Type */

/* Instantiation and mode changes */

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

/* The logger of FMI 2.0 takes a printf format, and per cent signs come doubled. */
static void call_logger(Instance *self, int status, const char *category, const char *text)
{
    if (self->callbacks.logger != NULL)
        self->callbacks.logger(self->callbacks.component_environment, self->name, status, category, text);
}

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                             const Callbacks *callbacks, int visible, int logging)
{
    Instance *const self = calloc(1, sizeof *self);
    (void)logging;
    if (self == NULL)
        return NULL;
    if (callbacks != NULL)
        self->callbacks = *callbacks;
    self->call_logger = call_logger;
    self->visible = visible != 0;
    self->co_simulation = type == CO_SIMULATION;
    return instantiate(self, name, "guid=\"", guid, resources);
}

EXPORT void fmi2FreeInstance(void *component) { free_instance(component); }

EXPORT int fmi2SetDebugLogging(void *component, int logging, size_t count, const char *const categories[])
{
    return set_debug_logging(component, logging, count, categories);
}

EXPORT int fmi2SetupExperiment(void *component, int tolerant, double tolerance, double start, int stops, double stop)
{
    Instance *const self = begin_call(component);
    (void)tolerant, (void)tolerance, (void)stops, (void)stop; /* the solvers have tolerances of their own */
    return self == NULL ? ERROR : setup_experiment(self, start);
}

EXPORT int fmi2EnterInitializationMode(void *component) { return call_method(component, "enter_initialization_mode"); }
EXPORT int fmi2ExitInitializationMode(void *component) { return call_method(component, "exit_initialization_mode"); }
EXPORT int fmi2Terminate(void *component) { return call_method(component, "terminate"); }
EXPORT int fmi2Reset(void *component) { return reset(component); }

/* Variables */

#define VARIABLES(type, name, kind)                                                                     \
    EXPORT int fmi2Get##name(void *component, const unsigned references[], size_t count, type values[]) \
    {                                                                                                   \
        return access_values(component, kind, references, count, NULL, (void *)values, count, 0);       \
    }                                                                                                   \
    EXPORT int fmi2Set##name(void *component, const unsigned references[], size_t count,                \
                             const type values[])                                                       \
    {                                                                                                   \
        return access_values(component, kind, references, count, (const void *)values, NULL, count, 0); \
    }

typedef const char *String;
VARIABLES(double, Real, REAL)
VARIABLES(int, Integer, INTEGER)
VARIABLES(int, Boolean, BOOLEAN)
VARIABLES(String, String, STRING)

/* FMU states */

EXPORT int fmi2GetFMUstate(void *component, void **state) { return get_fmu_state(component, state); }
EXPORT int fmi2SetFMUstate(void *component, void *state) { return set_fmu_state(component, state); }
EXPORT int fmi2FreeFMUstate(void *component, void **state) { return free_fmu_state(component, state); }

EXPORT int fmi2SerializedFMUstateSize(void *component, void *state, size_t *size)
{
    return serialized_state_size(component, state, size);
}

EXPORT int fmi2SerializeFMUstate(void *component, void *state, char bytes[], size_t size)
{
    return serialize_fmu_state(component, state, bytes, size);
}

EXPORT int fmi2DeSerializeFMUstate(void *component, const char bytes[], size_t size, void **state)
{
    return deserialize_fmu_state(component, bytes, size, state);
}

/* Steps */

EXPORT int fmi2DoStep(void *component, double time, double step, int no_state_before)
{
    (void)no_state_before;
    return do_step(component, time, step);
}

EXPORT int fmi2GetRealStatus(void *component, int kind, double *value)
{
    Instance *const self = begin_call(component);
    if (self == NULL)
        return ERROR;
    if (kind != LAST_SUCCESSFUL_TIME)
        return log_discard(self, "fmi2GetRealStatus tells the last successful time only.");
    if (value == NULL)
        return log_error(self, "There is no place for a status at a null pointer.");
    *value = self->last_successful_time;
    return OK;
}

EXPORT int fmi2GetBooleanStatus(void *component, int kind, int *value)
{
    Instance *const self = begin_call(component);
    if (self == NULL)
        return ERROR;
    if (kind != TERMINATED)
        return log_discard(self, "fmi2GetBooleanStatus tells fmi2Terminated only.");
    if (value == NULL)
        return log_error(self, "There is no place for a status at a null pointer.");
    *value = self->step_failed; /* importers that would otherwise repeat a discarded step for ever end then */
    return OK;
}

/* Functions that are not supported */

#define NOT_SUPPORTED(name, ...) \
    EXPORT int name(void *component, __VA_ARGS__) { return not_supported(component, #name); }

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
NOT_SUPPORTED(fmi2SetRealInputDerivatives, const unsigned r[], size_t n, const int order[], const double value[])
NOT_SUPPORTED(fmi2GetRealOutputDerivatives, const unsigned r[], size_t n, const int order[], double value[])
NOT_SUPPORTED(fmi2GetDirectionalDerivative, const unsigned z[], size_t nz, const unsigned v[], size_t nv,
              const double dv[], double dz[])
#pragma GCC diagnostic pop

/* The status of an asynchronous step, of which there are none. */
#define NO_PENDING_STATUS(name, type)                                                      \
    EXPORT int name(void *component, int kind, type *value)                                \
    {                                                                                      \
        Instance *const self = begin_call(component);                                      \
        (void)kind, (void)value;                                                           \
        return self == NULL ? ERROR : log_discard(self, #name " has nothing to tell.");    \
    }

NO_PENDING_STATUS(fmi2GetStatus, int)
NO_PENDING_STATUS(fmi2GetIntegerStatus, int)
NO_PENDING_STATUS(fmi2GetStringStatus, const char *)

EXPORT int fmi2CancelStep(void *component) { return not_supported(component, "fmi2CancelStep"); }
