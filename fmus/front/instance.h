/* What the functions of FMI 2.0 and 3.0 share: an instance, its messages and its states (fmi2.c). */

#ifndef KITECOSIM_INSTANCE_H
#define KITECOSIM_INSTANCE_H

#include "front.h"

#define EXPORT __attribute__((visibility("default")))

enum { OK, WARNING, DISCARD, ERROR }; /* fmi2Status and fmi3Status, as far as they are used */

typedef void Log(void *environment, const char *instance, int status, const char *category, const char *message, ...);

typedef struct {
    Log *logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} Callbacks;

typedef struct State {
    void *content; /* of Python */
    void *bytes;   /* its serialised form between the calls that ask for its size and for itself */
    struct State *next;
} State;

typedef struct Front {
    Slave slave;
    char *name;
    char *resources;
    int visible;
    Callbacks host; /* of FMI 2.0; a copy, as not every host keeps them */
    void (*logger)(void *, int, const char *, const char *); /* of FMI 3.0 */
    void *environment;
    void (*tell)(struct Front *, int, const char *, const char *);
    int for_co_simulation;
    State *states;
    int logging;
    size_t categories; /* 0: all */
    char **category;
    int worst;         /* status that was logged since the present call began */
    int discarded;     /* whether the last step was */
    double last;       /* end of the last step that was not, or the begin of the one that was */
} Front;

/* An instance that is ready, or NULL after a message. `guid` follows `attribute` in the model description. */
Front *ready(Front *front, const char *name, const char *attribute, const char *guid, const char *resources);

/* The instance behind a pointer of the host, with a clean record; NULL for none, and after the end of Python. */
Front *begun(void *component);

/* Logs a sentence and returns ERROR. */
int refused(Front *front, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* The status of a call: whatever the slave has said of it as an error makes it one. */
int judged(const Front *front, int done);

/* What has the same arguments in both versions. */
int fmi2Terminate(void *component);
int fmi2Reset(void *component);
int fmi2ExitInitializationMode(void *component);
void fmi2FreeInstance(void *component);
int fmi2SetDebugLogging(void *component, int logging, size_t count, const char *const categories[]);
int fmi2GetFMUstate(void *component, void **state);
int fmi2SetFMUstate(void *component, void *state);
int fmi2FreeFMUstate(void *component, void **state);
int fmi2SerializedFMUstateSize(void *component, void *state, size_t *size);
int fmi2SerializeFMUstate(void *component, void *state, char bytes[], size_t size);
int fmi2DeSerializeFMUstate(void *component, const char bytes[], size_t size, void **state);
int fmi2DoStep(void *component, double time, double step, int no_state_before);

#endif
