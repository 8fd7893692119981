/* The object of Python behind an instance (slave.c), and Python itself, which is started where the importer has none
   (python.c). */

#ifndef KITECOSIM_SLAVE_H
#define KITECOSIM_SLAVE_H

#include <stddef.h>

/* Makes Python callable in this process, unless it is already, and returns 1. Otherwise returns 0 with one sentence
   in `reason`, of at most `size` bytes with its terminating zero. */
int start_python(char *reason, size_t size);

/* Called for every message of a slave: an fmi2Status, a log category, and a text in which per cent signs are doubled. */
typedef void MessageHandler(void *environment, int status, const char *category, const char *text);

/* An instance of a slave class of fmus/adapter.py; `object` and `messages` are Python's. */
typedef struct {
    void *object;
    void *messages; /* its list of pending log messages */
    MessageHandler *on_message;
    void *environment;
} Slave;

/* Type of a variable, as fmus/adapter.py names it. */
typedef enum { REAL, INTEGER, BOOLEAN, STRING } Kind;

/* Those of type int return 1, or 0 if Python raised an exception, which is logged as fmi2Error. Only the first takes a
   slave whose `object` is NULL. The GIL is released while a message is handled. */
int slave_create(Slave *slave, const char *name, const char *resources, int visible);
void slave_free(Slave *slave);
/* Whether existing slaves can still be called: not once Python is finalized, but while it is being finalized, by the
   thread that does so. */
int slave_callable(void);
int slave_call(Slave *slave, const char *method);
int slave_setup_experiment(Slave *slave, double start);
/* Value references are of scalars, as in FMI 2.0, or of whole arrays, `as_arrays`, as in FMI 3.0; `size` values in all. */
int slave_set(Slave *slave, Kind kind, const unsigned *references, size_t count, const void *values, size_t size,
              int as_arrays);
int slave_get(Slave *slave, Kind kind, const unsigned *references, size_t count, void *values, size_t size, int as_arrays);
/* `completed` is 0 where the step is discarded. */
int slave_do_step(Slave *slave, double time, double step, int *completed);

/* FMU states and their bytes: references to objects of Python, to be released. */
int slave_get_state(Slave *slave, void **state);
int slave_set_state(Slave *slave, void *state);
int slave_serialize(Slave *slave, void *state, void **bytes);
int slave_deserialize(Slave *slave, const char *bytes, size_t size, void **state);
void slave_release_object(void *object);
const char *slave_bytes_content(void *bytes, size_t *size);

#endif
