/* A solver as FMUs of FMI 3.0 and of FMI 2.0 beside each other: the same loads give the same bits. Then a state of the one,
   taken between steps, goes through bytes into a second instance of it, and a load that is not a number is refused.

   Arguments: of the FMU of FMI 3.0, then of that of FMI 2.0, the binary, the token or GUID, the resources; number of loads,
   the first of which has the value reference 0; value reference of the displacements, and their number. Prints "done" if
   all went well, else what did not. */

#include <dlfcn.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host.h"

enum { STEPS = 3 };

typedef void Hear(void *environment, int status, const char *category, const char *message);

static struct {
    void *(*instantiate)(const char *name, const char *token, const char *resources, bool visible, bool logging,
                         bool events, bool early, const uint32_t intermediate[], size_t count, void *environment,
                         Hear *hear, void *update);
    int (*enter)(void *fmu, bool tolerant, double tolerance, double start, bool stops, double stop);
    int (*leave)(void *fmu);
    int (*set)(void *fmu, const uint32_t references[], size_t count, const double values[], size_t size);
    int (*get)(void *fmu, const uint32_t references[], size_t count, double values[], size_t size);
    int (*step)(void *fmu, double time, double size, bool no_state_before, bool *event, bool *ends, bool *early,
                double *last);
    int (*get_state)(void *fmu, void **state);
    int (*set_state)(void *fmu, void *state);
    int (*free_state)(void *fmu, void **state);
    int (*state_size)(void *fmu, void *state, size_t *size);
    int (*serialise)(void *fmu, void *state, uint8_t bytes[], size_t size);
    int (*deserialise)(void *fmu, const uint8_t bytes[], size_t size, void **state);
    int (*terminate)(void *fmu);
    void (*free_instance)(void *fmu);
} of3;

static Functions of2;
static char heard[1000];
static double loads[MOST], found[STEPS][MOST], other[MOST];
static uint32_t references[MOST];

static void hear(void *environment, int status, const char *category, const char *message)
{
    (void)environment, (void)status, (void)category;
    snprintf(heard, sizeof heard, "%s", message);
}

#define MUST(so)                                          \
    do {                                                  \
        if (!(so)) {                                      \
            printf("not so: %s; heard: %s\n", #so, heard); \
            exit(1);                                      \
        }                                                 \
    } while (0)

/* A function of a library: ISO C has no way from an object pointer to a function pointer but by its bytes. */
#define FIND(library, function, name) MUST((*(void **)&(function) = dlsym(library, name)) != NULL)

static void find(const char *path3, const char *path2)
{
    void *const three = dlopen(path3, RTLD_NOW | RTLD_LOCAL), *const two = dlopen(path2, RTLD_NOW | RTLD_LOCAL);
    MUST(three != NULL && two != NULL);
    FIND(three, of3.instantiate, "fmi3InstantiateCoSimulation");
    FIND(three, of3.enter, "fmi3EnterInitializationMode");
    FIND(three, of3.leave, "fmi3ExitInitializationMode");
    FIND(three, of3.set, "fmi3SetFloat64");
    FIND(three, of3.get, "fmi3GetFloat64");
    FIND(three, of3.step, "fmi3DoStep");
    FIND(three, of3.get_state, "fmi3GetFMUState");
    FIND(three, of3.set_state, "fmi3SetFMUState");
    FIND(three, of3.free_state, "fmi3FreeFMUState");
    FIND(three, of3.state_size, "fmi3SerializedFMUStateSize");
    FIND(three, of3.serialise, "fmi3SerializeFMUState");
    FIND(three, of3.deserialise, "fmi3DeserializeFMUState");
    FIND(three, of3.terminate, "fmi3Terminate");
    FIND(three, of3.free_instance, "fmi3FreeInstance");
    FIND(two, of2.instantiate, "fmi2Instantiate");
    FIND(two, of2.enter, "fmi2EnterInitializationMode");
    FIND(two, of2.leave, "fmi2ExitInitializationMode");
    FIND(two, of2.set, "fmi2SetReal");
    FIND(two, of2.get, "fmi2GetReal");
    FIND(two, of2.step, "fmi2DoStep");
    FIND(two, of2.terminate, "fmi2Terminate");
    FIND(two, of2.free_instance, "fmi2FreeInstance");
}

static void *made(char **arguments)
{
    void *const fmu = of3.instantiate("three", arguments[1], arguments[2], 0, 0, 0, 0, NULL, 0, NULL, hear, NULL);
    MUST(fmu != NULL);
    MUST(of3.enter(fmu, false, 0.0, 0.0, false, 0.0) == OK);
    MUST(of3.leave(fmu) == OK);
    return fmu;
}

/* The status of a step of the one under loads that differ from step to step and from panel to panel. */
static int stepped(void *fmu, int k, size_t count)
{
    const uint32_t first = 0;
    bool event = true, ends = true, early = true;
    double last = -1.0;
    for (size_t i = 0; i < count; ++i)
        loads[i] = 1.0 + 0.1 * k + 0.01 * (double)i;
    MUST(of3.set(fmu, &first, 1, loads, count) == OK);
    const int status = of3.step(fmu, k, 1.0, true, &event, &ends, &early, &last);
    MUST(!event && !ends && !early);
    MUST(last == (status == OK ? k + 1.0 : k));
    return status;
}

int main(int count, char **arguments)
{
    static const Callbacks callbacks = {NULL, NULL, NULL, NULL, NULL};
    const uint32_t first = 0;
    void *state = NULL;
    size_t size = 0;

    MUST(count == 10);
    const size_t taken = strtoul(arguments[7], NULL, 10), given = strtoul(arguments[9], NULL, 10);
    const uint32_t displacement = (uint32_t)strtoul(arguments[8], NULL, 10);
    MUST(0 < taken && taken <= MOST && 0 < given && given <= MOST);
    find(arguments[1], arguments[4]);

    void *const three = made(arguments + 1);
    void *const two = of2.instantiate("two", 1, arguments[5], arguments[6], &callbacks, 0, 0);
    MUST(two != NULL && of2.enter(two) == OK && of2.leave(two) == OK);
    for (int k = 0; k < STEPS; ++k) {
        MUST(stepped(three, k, taken) == OK);
        MUST(of3.get(three, &displacement, 1, found[k], given) == OK);
        for (size_t i = 0; i < taken; ++i)
            references[i] = (uint32_t)i;
        MUST(of2.set(two, references, taken, loads) == OK);
        MUST(of2.step(two, k, 1.0, 1) == OK);
        for (size_t i = 0; i < given; ++i)
            references[i] = displacement + (uint32_t)i;
        MUST(of2.get(two, references, given, other) == OK);
        MUST(memcmp(found[k], other, given * sizeof *other) == 0);
        if (k == 0)
            MUST(of3.get_state(three, &state) == OK);
    }
    MUST(memcmp(found[0], found[1], given * sizeof *other) != 0);

    MUST(of3.state_size(three, state, &size) == OK);
    uint8_t *const bytes = malloc(size);
    MUST(bytes != NULL && of3.serialise(three, state, bytes, size) == OK);
    MUST(of3.free_state(three, &state) == OK && state == NULL);
    void *const again = made(arguments + 1);
    MUST(of3.deserialise(again, bytes, size, &state) == OK);
    free(bytes);
    MUST(of3.set_state(again, state) == OK);
    for (int k = 0; k < STEPS; ++k) { /* first as the state has it */
        MUST(k == 0 || stepped(again, k, taken) == OK);
        MUST(of3.get(again, &displacement, 1, other, given) == OK);
        MUST(memcmp(found[k], other, given * sizeof *other) == 0);
    }

    loads[1] = NAN;
    MUST(of3.set(three, &first, 1, loads, taken) == ERROR);
    MUST(strncmp(heard, "pressure[2] must be finite, not nan; it stays ", 46) == 0);
    MUST(stepped(three, STEPS, taken) == DISCARD);
    MUST(stepped(three, STEPS, taken) == OK);
    MUST(of3.get(three, &displacement, 1, other, given - 1) == ERROR);

    MUST(of3.terminate(three) == OK && of3.terminate(again) == OK && of2.terminate(two) == OK);
    of3.free_instance(three);
    of3.free_instance(again); /* with its state */
    of2.free_instance(two);
    puts("done");
    return 0;
}
