/* The binary of the FMUs on Linux. The functions of FMI 2.0 and 3.0 (fmi2.c, fmi3.c) come down to those of an instance
   (instance.c) and of its states (states.c), and these to an object of Python (slave.c), which is started where the host
   has none (python.c). */

#ifndef KITECOSIM_INSTANCE_H
#define KITECOSIM_INSTANCE_H

#include "slave.h"

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

typedef struct Instance {
    Slave slave;
    char *name;
    char *resources;
    int visible;
    Callbacks host; /* of FMI 2.0; a copy, as not every host keeps them */
    void (*logger)(void *, int, const char *, const char *); /* of FMI 3.0 */
    void *environment;
    void (*tell)(struct Instance *, int, const char *, const char *);
    int for_co_simulation;
    State *states;
    int logging;
    size_t categories; /* 0: all */
    char **category;
    int worst;         /* status that was logged since the present call began */
    int discarded;     /* whether the last step was */
    double last;       /* end of the last step that was not, or the begin of the one that was */
} Instance;

/* An instance that is ready, or NULL after a message. `guid` follows `attribute` in the model description. */
Instance *ready(Instance *self, const char *name, const char *attribute, const char *guid, const char *resources);

/* The instance behind a pointer of the host, with a clean record; NULL for none, and after the end of Python. */
Instance *begun(void *component);

/* Logs a sentence and returns ERROR. */
int refused(Instance *self, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Logs a sentence and returns DISCARD, as the standard has it for a status that cannot be told. */
int untold(Instance *self, const char *sentence);

/* The status of a call: whatever the slave has said of it as an error makes it one. */
int judged(const Instance *self, int done);

/* Sets the start time. */
int set_up(Instance *self, double start);

/* What the functions of both versions come down to; `component` is a pointer of the host. */
int absent(void *component, const char *name);
int log_only(void *component, int logging, size_t count, const char *const categories[]);
void free_instance(void *component);
int called(void *component, const char *method);
int reset(void *component);
int moved(void *component, Kind kind, const unsigned *references, size_t count, const void *given, void *taken,
          size_t size, int whole); /* see slave_put and slave_take */
int stepped(void *component, double time, double step);
int save_state(void *component, void **state);
int restore_state(void *component, void *state);
int give_back_state(void *component, void **state);
int state_size(void *component, void *state, size_t *size);
int serialise_state(void *component, void *state, char bytes[], size_t size);
int read_state(void *component, const char bytes[], size_t size, void **state);

/* Takes a state off the list of the instance and lets go of it. */
void free_state(Instance *self, State *state);

#endif
