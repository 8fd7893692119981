/* An FMU of FMI 3.0 with a variable of every type, which takes nothing that the standard does not allow.
 *
 * Value references 48 and 68 are an enumeration, which Int64 carries, as input and as it arrives at the output. Every
 * other output is one more than the input of its type after a step (Boolean: its opposite), y = x + sum of all x so far.
 * A function of another type than the variable has, a count of values that is not that of the arrays, and a get before
 * the initialisation are errors. Step number `trouble` is discarded, asks for the end (-), or ends with fmi3Fatal.
 */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
enum { FLOAT64, FLOAT32, INT8, UINT8, INT16, UINT16, INT32, UINT32, INT64, UINT64, BOOLEAN, KINDS };
enum { X = 0, Y = 20, STEPS = 40, TROUBLE = 41, MATRIX = 6, PLACES = 12 };
typedef void (*logger_type)(void *, int, const char *, const char *);
typedef struct {
    long double value[KINDS + 70][PLACES]; /* by value reference; a long double holds every Int64 and UInt64 */
    double sum[MATRIX], time;
    bool initialised;
    char label[40];
    logger_type logger;
    void *environment;
} model;

/* Inputs have the reference of their kind, outputs 20 more; the matrix is Float64, the others of two entries. */
static int size_of(unsigned reference) { return reference == X || reference == Y ? MATRIX : reference < STEPS ? 2 : 1; }
static int kind_of(unsigned reference)
{
    return reference == STEPS || reference == TROUBLE ? INT32 : reference == 43 ? UINT64 : (int)(reference % 20);
}
static int failed(model *m, int status, const char *why)
{
    m->logger(m->environment, status, "logStatusError", why);
    return status;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool events, bool early, const unsigned *intermediate,
                                         size_t intermediates, void *environment, logger_type logger, void *update)
{
    if (strcmp(token, "signals") != 0 || events || early || intermediates > 0 || update != NULL)
        return NULL;
    model *m = calloc(1, sizeof *m);
    m->logger = logger, m->environment = environment;
    for (int i = 0; i < MATRIX; i++) m->value[X][i] = i + 1;
    return m;
}
EXPORT void fmi3FreeInstance(void *c) { free(c); }
EXPORT int fmi3EnterInitializationMode(void *c, bool given, double tolerance, double start, bool stops, double stop)
{
    model *m = c;
    m->initialised = true, m->time = start;
    return stops && stop <= start ? failed(m, 3, "the stop time is not after the start time") : 0;
}
EXPORT int fmi3ExitInitializationMode(void *c) { return 0; }
EXPORT int fmi3Terminate(void *c) { return 0; }

static int check(model *m, int kind, const unsigned r[], size_t n, size_t size, bool get)
{
    size_t wanted = 0;
    if (get && !m->initialised) return failed(m, 3, "nothing can be got before the initialisation");
    for (size_t i = 0; i < n; i++) {
        if (kind_of(r[i]) != kind) return failed(m, 3, "the variable is of another type");
        wanted += size_of(r[i]);
    }
    return wanted == size ? 0 : failed(m, 3, "there are not as many values as the arrays have: 100 %s");
}
#define ACCESS(name, kind, type)                                                                       \
    EXPORT int fmi3Get##name(void *c, const unsigned r[], size_t n, type values[], size_t size)        \
    {                                                                                                  \
        int status = check(c, kind, r, n, size, true);                                                 \
        for (size_t i = 0; status == 0 && i < n; i++)                                                  \
            for (int k = 0; k < size_of(r[i]); k++) *values++ = (type)((model *)c)->value[r[i]][k];    \
        return status;                                                                                 \
    }                                                                                                  \
    EXPORT int fmi3Set##name(void *c, const unsigned r[], size_t n, const type values[], size_t size)  \
    {                                                                                                  \
        int status = check(c, kind, r, n, size, false);                                                \
        for (size_t i = 0; status == 0 && i < n; i++)                                                  \
            for (int k = 0; k < size_of(r[i]); k++) ((model *)c)->value[r[i]][k] = *values++;          \
        return status;                                                                                 \
    }
ACCESS(Float64, FLOAT64, double)
ACCESS(Float32, FLOAT32, float)
ACCESS(Int8, INT8, int8_t)
ACCESS(UInt8, UINT8, uint8_t)
ACCESS(Int16, INT16, int16_t)
ACCESS(UInt16, UINT16, uint16_t)
ACCESS(Int32, INT32, int32_t)
ACCESS(UInt32, UINT32, uint32_t)
ACCESS(Int64, INT64, int64_t)
ACCESS(UInt64, UINT64, uint64_t)
ACCESS(Boolean, BOOLEAN, bool)
EXPORT int fmi3SetString(void *c, const unsigned r[], size_t n, const char *const values[], size_t size)
{
    model *m = c;
    snprintf(m->label, sizeof m->label, "label %s", values[0]);
    m->logger(m->environment, 0, "logAll", m->label);
    return n == 1 && size == 1 && r[0] == 42 ? 0 : failed(m, 3, "no such text");
}

EXPORT int fmi3DoStep(void *c, double t, double dt, bool no_state_before, bool *event, bool *terminate, bool *early,
                      double *last)
{
    model *m = c;
    int number = (int)++m->value[STEPS][0], trouble = (int)m->value[TROUBLE][0];
    *event = *terminate = *early = false;
    *last = t;
    if (number == trouble) return failed(m, 2, "the step is too large");
    if (number == trouble - 100) return failed(m, 4, "there is no way on");
    for (int kind = FLOAT64; kind < KINDS; kind++)
        for (int k = 0; k < size_of(kind); k++) {
            long double in = m->value[kind][k];
            if (kind == FLOAT64) in += (m->sum[k] = m->sum[k] + (double)in) - 1.0L;
            m->value[kind + 20][k] = kind == BOOLEAN ? in == 0 : in + 1;
        }
    m->value[43][0] = powl(2, 60) + number;
    m->value[68][0] = m->value[48][0];
    *last = m->time = number == -trouble ? t + 0.5 * dt : t + dt;
    *terminate = number == -trouble;
    return 0;
}

EXPORT int fmi3GetFMUState(void *c, void **state)
{
    if (*state == NULL) *state = malloc(sizeof(model));
    memcpy(*state, c, sizeof(model));
    return 0;
}
EXPORT int fmi3SetFMUState(void *c, void *state) { memcpy(c, state, sizeof(model)); return 0; }
EXPORT int fmi3FreeFMUState(void *c, void **state) { free(*state); *state = NULL; return 0; }
EXPORT int fmi3SerializedFMUStateSize(void *c, void *state, size_t *size) { *size = sizeof(model); return 0; }
EXPORT int fmi3SerializeFMUState(void *c, void *state, uint8_t bytes[], size_t size)
{
    memcpy(bytes, state, size);
    return 0;
}
EXPORT int fmi3DeserializeFMUState(void *c, const uint8_t bytes[], size_t size, void **state)
{
    model *m = malloc(sizeof *m), *own = c;
    memcpy(m, bytes, size);
    m->logger = own->logger, m->environment = own->environment;
    *state = m;
    return 0;
}
