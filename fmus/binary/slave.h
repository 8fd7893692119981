/* The object of Python behind an instance (slave.c), and Python itself, which is started where the host has none
   (python.c). */

#ifndef KITECOSIM_SLAVE_H
#define KITECOSIM_SLAVE_H

#include <stddef.h>

/* Makes Python callable in this process, unless it is already, and returns 1. Otherwise returns 0 with one sentence
   in `why`, of at most `size` bytes with its end. */
int start_python(char *why, size_t size);

/* Called for every message of a slave: an fmi2Status, a log category, and a text in which per cent signs are doubled. */
typedef void Hear(void *environment, int status, const char *category, const char *text);

/* An instance of a slave class of fmus/adapter.py; `object` and `queue` are Python's. */
typedef struct {
    void *object;
    void *queue; /* its list of messages */
    Hear *hear;
    void *environment;
} Slave;

/* What a variable is, as fmus/adapter.py names it. */
typedef enum { REAL, INTEGER, BOOLEAN, STRING } Kind;

/* Those of type int return 1, or 0 if Python raised; what it raised is heard as fmi2Error. Only the first takes a slave
   whose `object` is NULL. The GIL is not held while something is heard. */
int slave_make(Slave *slave, const char *name, const char *resources, int visible);
void slave_free(Slave *slave);
/* Whether slaves that were made can still be called: not after Python has ended, but while it ends, by the thread that
   ends it. */
int slave_callable(void);
int slave_call(Slave *slave, const char *method);
int slave_setup(Slave *slave, double start);
/* `references` are scalars, as in FMI 2.0, or `whole` variables, as in FMI 3.0; `size` values in all. */
int slave_put(Slave *slave, Kind kind, const unsigned *references, size_t count, const void *values, size_t size,
              int whole);
int slave_take(Slave *slave, Kind kind, const unsigned *references, size_t count, void *values, size_t size, int whole);
int slave_step(Slave *slave, double time, double step, int *done);

/* States: references to objects of Python, to be given back. */
int slave_state(Slave *slave, void **state);
int slave_restore(Slave *slave, void *state);
int slave_serialise(Slave *slave, void *state, void **bytes);
int slave_read(Slave *slave, const char *bytes, size_t size, void **state);
void slave_release(void *object);
const char *slave_bytes(void *bytes, size_t *size);

#endif
