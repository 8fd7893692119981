/* A wheel on a shaft, J w' = torque - c w, as an FMI 2.0 co-simulation FMU that keeps no states.
 *
 * Like many exported FMUs it insists on steps that begin where the last one ended. Value references: 0 torque,
 * 1 speed, 2 J, 3 c, 4 start speed, 5 steps (Integer), 6 trouble (Integer: the step of that number is not completed).
 */
#include "fmi2.h"

#include <math.h>
#include <stdlib.h>

typedef struct {
    double real[5];
    int integer[2]; /* steps, trouble */
    double time;
    int number; /* of steps tried, refused ones included */
    const callbacks_type *callbacks;
} wheel;

static int refused(wheel *w, int status, const char *why) {
    w->callbacks->logger(w->callbacks->environment, "wheel", status, "logAll", "%s", why);
    return status;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const categories[]) { return 0; }

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                             const callbacks_type *callbacks, int visible, int logging) {
    wheel *w = calloc(1, sizeof(wheel));
    w->callbacks = callbacks;
    w->real[2] = 1.0;
    return w;
}
EXPORT void fmi2FreeInstance(void *c) { free(c); }
EXPORT int fmi2SetupExperiment(void *c, int given, double tolerance, double start, int defined, double stop) {
    ((wheel *)c)->time = start;
    return 0;
}
EXPORT int fmi2EnterInitializationMode(void *c) { return 0; }
EXPORT int fmi2ExitInitializationMode(void *c) {
    wheel *w = c;
    w->real[1] = w->real[4];
    return 0;
}
EXPORT int fmi2Terminate(void *c) { return 0; }
EXPORT int fmi2Reset(void *c) { return 0; }

EXPORT int fmi2GetReal(void *c, const unsigned r[], size_t n, double v[]) {
    for (size_t i = 0; i < n; i++) v[i] = ((wheel *)c)->real[r[i]];
    return 0;
}
EXPORT int fmi2SetReal(void *c, const unsigned r[], size_t n, const double v[]) {
    for (size_t i = 0; i < n; i++) ((wheel *)c)->real[r[i]] = v[i];
    return 0;
}
EXPORT int fmi2GetInteger(void *c, const unsigned r[], size_t n, int v[]) {
    for (size_t i = 0; i < n; i++) v[i] = ((wheel *)c)->integer[r[i] - 5];
    return 0;
}
EXPORT int fmi2SetInteger(void *c, const unsigned r[], size_t n, const int v[]) {
    for (size_t i = 0; i < n; i++) ((wheel *)c)->integer[r[i] - 5] = v[i];
    return 0;
}

EXPORT int fmi2DoStep(void *c, double t, double dt, int no_rollback) {
    wheel *w = c;
    if (fabs(t - w->time) > 1e-9 * dt) return refused(w, 3, "the step does not begin where the last one ended");
    w->number++;
    if (w->integer[1] == w->number) return refused(w, 2, "the step was not completed");
    if (w->integer[1] == -w->number) return refused(w, 4, "the wheel is off");
    double torque = w->real[0], J = w->real[2], drag = w->real[3];
    double a = drag > 0.0 ? -expm1(-drag * dt / J) / drag : dt / J; /* exact while the torque stays */
    w->real[1] += a * (torque - drag * w->real[1]);
    w->time = t + dt;
    w->integer[0]++;
    return 0;
}
EXPORT int fmi2CancelStep(void *c) { return 3; }
