/* FMI 2.0 as far as the host uses it, and what it couples. */

#ifndef HOST_H
#define HOST_H

#include <stddef.h>

typedef void Logger(void *environment, const char *instance, int status, const char *category, const char *message, ...);

typedef struct {
    Logger *log;
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*step_finished)(void *environment, int status);
    void *environment;
} Callbacks;

typedef struct {
    const char *(*version)(void);
    void *(*instantiate)(const char *name, int type, const char *guid, const char *resources, const Callbacks *callbacks,
                         int visible, int logging);
    void (*free_instance)(void *fmu);
    int (*setup)(void *fmu, int tolerant, double tolerance, double start, int stops, double stop);
    int (*enter)(void *fmu);
    int (*leave)(void *fmu);
    int (*get)(void *fmu, const unsigned references[], size_t count, double values[]);
    int (*set)(void *fmu, const unsigned references[], size_t count, const double values[]);
    int (*step)(void *fmu, double time, double size, int no_state_before);
    int (*get_state)(void *fmu, void **state);
    int (*set_state)(void *fmu, void *state);
    int (*free_state)(void *fmu, void **state);
    int (*state_size)(void *fmu, void *state, size_t *size);
    int (*serialise)(void *fmu, void *state, char bytes[], size_t size);
    int (*deserialise)(void *fmu, const char bytes[], size_t size, void **state);
    int (*terminate)(void *fmu);
} Functions;

/* What is coupled */

enum { OK, WARNING, DISCARD, ERROR, FATAL }; /* fmi2Status */
enum { AERO, STRUCTURAL, SIDES };
enum { MOST = 20000 }; /* connections of a side, and values to print */

typedef struct {
    char binary[4096], resources[4096], guid[100];
    void *library, *fmu;
    Functions call;
    unsigned sent[MOST], taken[MOST]; /* sent[i] of this side goes to taken[i] of the other */
    double values[MOST];              /* what was sent last */
    size_t count;
} Side;

typedef struct {
    int given, side;
    unsigned reference;
    double value;
} Scalar;

extern const char *const NAMES[SIDES];
extern Side sides[SIDES];
extern Scalar watched[MOST], tuned, refusal;
extern size_t watches;

/* Ends the program with a sentence. */
void fail(const char *what);

/* Fills all of the above from a file. */
void read_wiring(const char *path);

#endif
