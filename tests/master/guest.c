/* A co-simulation FMU of FMI 2.0 whose behaviour is written in by macros: code for a step and for other moments.
 *
 * r, k and b are the Real, Integer (Enumeration too) and Boolean variables by value reference; code of a step sees t and
 * h, and may return a status. SAY(status, text) logs.
 */
#include "fmi2.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#ifndef ENTER
#define ENTER
#endif
#ifndef EXIT
#define EXIT
#endif
#ifndef READ
#define READ
#endif
#ifndef STEP
#define STEP
#endif
#ifndef SAVE
#define SAVE
#endif
#ifndef BEGIN
#define BEGIN
#endif
#ifndef STATUS
#define STATUS 3
#endif
#ifndef ANSWER
#define ANSWER 0
#endif
#ifndef TERMINATED
#define TERMINATED 0
#endif
#ifndef LAST
#define LAST me->time
#endif
#ifndef ENVIRONMENT
#define ENVIRONMENT me->callbacks->environment
#endif
#ifndef SIZE
#define SIZE 64
#endif

typedef struct {
    double r[SIZE];
    int k[SIZE], b[SIZE];
    double time, stop;
    int stops, steps, saves, asked;
    char name[256];
    const callbacks_type *callbacks;
} guest;
#define SAY(status, text) me->callbacks->logger(ENVIRONMENT, me->name, status, "logAll", text)
#define SEE double *r = me->r; int *k = me->k, *b = me->b; (void)r; (void)k; (void)b

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const categories[]) { return 0; }
EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                             const callbacks_type *callbacks, int visible, int logging)
{
    guest *me = calloc(1, sizeof *me);
    me->callbacks = callbacks;
    snprintf(me->name, sizeof me->name, "%s", name);
    SEE;
    BEGIN;
    return me;
}
EXPORT void fmi2FreeInstance(void *c) { free(c); }
EXPORT int fmi2SetupExperiment(void *c, int given, double tolerance, double start, int stops, double stop)
{
    guest *me = c;
    me->time = start, me->stops = stops, me->stop = stop;
    return 0;
}
EXPORT int fmi2EnterInitializationMode(void *c) { guest *me = c; SEE; ENTER; return 0; }
EXPORT int fmi2ExitInitializationMode(void *c) { guest *me = c; SEE; EXIT; return 0; }
EXPORT int fmi2Terminate(void *c) { return 0; }
EXPORT int fmi2Reset(void *c) { return 0; }

#define ACCESS(type, name, array)                                                                \
    EXPORT int fmi2Get##name(void *c, const unsigned v[], size_t n, type x[])                    \
    {                                                                                            \
        guest *me = c; SEE; READ;                                                                \
        for (size_t i = 0; i < n; i++) x[i] = me->array[v[i]];                                   \
        return 0;                                                                                \
    }                                                                                            \
    EXPORT int fmi2Set##name(void *c, const unsigned v[], size_t n, const type x[])              \
    {                                                                                            \
        guest *me = c;                                                                           \
        for (size_t i = 0; i < n; i++) me->array[v[i]] = x[i];                                   \
        return 0;                                                                                \
    }
ACCESS(double, Real, r)
ACCESS(int, Integer, k)
ACCESS(int, Boolean, b)

EXPORT int fmi2DoStep(void *c, double t, double h, int no_rollback)
{
    guest *me = c;
    SEE;
    STEP;
    me->steps++;
    me->time = t + h;
    return 0;
}
EXPORT int fmi2CancelStep(void *c) { return 3; }
EXPORT int fmi2GetFMUstate(void *c, void **state)
{
    guest *me = c;
    SAVE;
    me->saves++;
    if (*state == NULL) *state = malloc(sizeof *me);
    memcpy(*state, me, sizeof *me);
    return 0;
}
EXPORT int fmi2SetFMUstate(void *c, void *state)
{
    int saves = ((guest *)c)->saves;
    memcpy(c, state, sizeof(guest));
    ((guest *)c)->saves = saves;
    return 0;
}
EXPORT int fmi2FreeFMUstate(void *c, void **state) { free(*state); *state = NULL; return 0; }
EXPORT int fmi2GetStatus(void *c, int kind, int *value)
{
    guest *me = c;
    me->asked++;
    return kind == 0 ? (*value = STATUS, ANSWER) : 2;
}
EXPORT int fmi2GetRealStatus(void *c, int kind, double *value)
{
    guest *me = c;
    return kind == 2 ? (*value = LAST, 0) : 2;
}
EXPORT int fmi2GetBooleanStatus(void *c, int kind, int *value)
{
    guest *me = c;
    (void)me;
    return kind == 3 ? (*value = TERMINATED, 0) : 2;
}
