/* The binary of the FMUs on Linux. The functions of FMI 2.0 and 3.0 (fmi2.c, fmi3.c) are thin wrappers of those of an
   instance (instance.c) and of its FMU states (states.c), and these call an object of Python (slave.c), which is started
   where the importer has none (python.c).

   Which call is allowed in which state of the instance (FMI 2.0.4, section 4.2.4) is checked by the slave in Python; of
   the states after fmi2DoStep the instance keeps whether it is in stepFailed. Steps are synchronous, so that no status is
   ever pending. */

#ifndef KITECOSIM_INSTANCE_H
#define KITECOSIM_INSTANCE_H

#include "slave.h"

#define EXPORT __attribute__((visibility("default")))

enum { OK, WARNING, DISCARD, ERROR }; /* fmi2Status and fmi3Status, as far as they are used */

typedef void Fmi2Logger(void *component_environment, const char *instance, int status, const char *category,
                        const char *message, ...);
typedef void Fmi3Logger(void *instance_environment, int status, const char *category, const char *message);

typedef struct { /* fmi2CallbackFunctions */
    Fmi2Logger *logger;
    void *(*allocate_memory)(size_t, size_t);
    void (*free_memory)(void *);
    void (*step_finished)(void *, int);
    void *component_environment;
} Callbacks;

typedef struct FmuState {
    void *object;     /* of Python */
    void *serialized; /* its bytes, of Python, between the calls for their size and for themselves */
    struct FmuState *next;
} FmuState;

typedef struct Instance {
    Slave slave;
    char *name;
    char *resources;
    int visible;
    Callbacks callbacks; /* of FMI 2.0; a copy, as not every importer keeps them */
    Fmi3Logger *logger;  /* of FMI 3.0, with its environment */
    void *environment;
    void (*call_logger)(struct Instance *, int status, const char *category, const char *message);
    int co_simulation; /* whether it is instantiated for co-simulation */
    FmuState *states;
    int logging_on;
    size_t category_count; /* 0: all are logged */
    char **categories;
    int worst_status;            /* of the messages since the present call began */
    int step_failed;             /* in state stepFailed: the last step was discarded */
    double last_successful_time; /* end of the last step, or the begin of one that was discarded */
} Instance;

/* Instantiates the slave and returns the instance, or logs an error and returns NULL. `guid` follows `attribute` in the
   model description. */
Instance *instantiate(Instance *self, const char *name, const char *attribute, const char *guid, const char *resources);

/* The instance behind a component, with no message logged yet in this call; NULL for a null pointer, and after Python was
   finalized. */
Instance *begin_call(void *component);

/* Logs a message and returns ERROR. */
int log_error(Instance *self, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Logs a message and returns DISCARD, as the standard has it for a status that is not available. */
int log_discard(Instance *self, const char *message);

/* The status of a call: ERROR if it failed, or if a message of DISCARD or worse was logged in it. */
int call_status(const Instance *self, int succeeded);

/* Sets the start time. */
int setup_experiment(Instance *self, double start);

/* What the functions of both versions share; `component` is a pointer of the importer. */
int not_supported(void *component, const char *function);
int set_debug_logging(void *component, int logging_on, size_t count, const char *const categories[]);
void free_instance(void *component);
int call_method(void *component, const char *method);
int reset(void *component);
/* Gets values to `target`, or sets those of `source` where that is NULL; see slave_set and slave_get. */
int access_values(void *component, Kind kind, const unsigned *references, size_t count, const void *source, void *target,
                  size_t size, int as_arrays);
int do_step(void *component, double time, double step);
int get_fmu_state(void *component, void **state);
int set_fmu_state(void *component, void *state);
int free_fmu_state(void *component, void **state);
int serialized_state_size(void *component, void *state, size_t *size);
int serialize_fmu_state(void *component, void *state, char bytes[], size_t size);
int deserialize_fmu_state(void *component, const char bytes[], size_t size, void **state);

/* Removes a state from the list of the instance and frees it. */
void remove_state(Instance *self, FmuState *state);

#endif
