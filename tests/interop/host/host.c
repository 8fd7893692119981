/* A host in plain C that couples the two FMUs of a kite: no Python, no FMI headers, no library but libdl and pthreads.

   host WIRING [serial|parallel] [now|lazy] [STEPS]

   `serial` steps the flow, passes its loads on, then steps the structure; half-way it saves both states, goes on, comes
   back and goes on again. `parallel` steps both at once, each in a thread of its own, and exchanges afterwards. WIRING
   has a line a fact:

       binary SIDE PATH                  resources SIDE URI                  guid SIDE GUID
       connect SIDE REFERENCE SIDE REFERENCE     an output and the input that it goes to
       watch SIDE REFERENCE                      an output to print
       tune SIDE REFERENCE VALUE                 a tunable parameter, set before the last two steps
       refuse SIDE REFERENCE VALUE               a value that is refused, set after the last step

   SIDE is aero or structural. Printed are lines `step K VALUE...` with hexadecimal floats in the order of `watch`. */

#define _POSIX_C_SOURCE 200809L

#include "host.h"

#include <dlfcn.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int steps = 10;

static void must(int status, const char *what)
{
    if (status != OK) {
        fprintf(stderr, "host: %s returned %d\n", what, status);
        exit(3);
    }
}

static void report(void *environment, const char *instance, int status, const char *category, const char *message, ...)
{
    va_list arguments;
    (void)environment;
    printf("log %s %d %s ", instance, status, category);
    va_start(arguments, message);
    vprintf(message, arguments);
    va_end(arguments);
    printf("\n");
}

static const Callbacks callbacks = {report, calloc, free, NULL, NULL};

/* The FMUs */

/* ISO C has no conversion from a pointer to an object to one to a function; POSIX promises that their bits agree. */
static void find(void *library, const char *name, void *function)
{
    void *const found = dlsym(library, name);
    if (found == NULL)
        fail(name);
    memcpy(function, &found, sizeof found);
}

static void load(Side *side, int mode)
{
    side->library = dlopen(side->binary, mode);
    if (side->library == NULL)
        fail(dlerror());
    Functions *const f = &side->call;
    const struct {
        const char *name;
        void *place;
    } all[] = {
        {"fmi2GetVersion", &f->version}, {"fmi2Instantiate", &f->instantiate}, {"fmi2FreeInstance", &f->free_instance},
        {"fmi2SetupExperiment", &f->setup}, {"fmi2EnterInitializationMode", &f->enter},
        {"fmi2ExitInitializationMode", &f->leave}, {"fmi2GetReal", &f->get}, {"fmi2SetReal", &f->set},
        {"fmi2DoStep", &f->step}, {"fmi2GetFMUstate", &f->get_state}, {"fmi2SetFMUstate", &f->set_state},
        {"fmi2FreeFMUstate", &f->free_state}, {"fmi2SerializedFMUstateSize", &f->state_size},
        {"fmi2SerializeFMUstate", &f->serialise}, {"fmi2DeSerializeFMUstate", &f->deserialise},
        {"fmi2Terminate", &f->terminate}};
    for (size_t i = 0; i < sizeof all / sizeof *all; ++i)
        find(side->library, all[i].name, all[i].place);
    if (strcmp(f->version(), "2.0") != 0)
        fail("the FMU is not of FMI 2.0");
}

static void begin(int side)
{
    Side *const one = &sides[side];
    one->fmu = one->call.instantiate(NAMES[side], 1, one->guid, one->resources, &callbacks, 0, 1);
    if (one->fmu == NULL)
        fail("an FMU cannot be instantiated");
    must(one->call.setup(one->fmu, 0, 0.0, 0.0, 0, 0.0), "fmi2SetupExperiment");
    must(one->call.enter(one->fmu), "fmi2EnterInitializationMode");
}

/* Exchange: what a side sends is got, and set on the other side. */

static void get(int side)
{
    Side *const one = &sides[side];
    must(one->call.get(one->fmu, one->sent, one->count, one->values), "fmi2GetReal");
}

static void pass_on(int side)
{
    const Side *const one = &sides[side], *const other = &sides[SIDES - 1 - side];
    must(other->call.set(other->fmu, one->taken, one->count, one->values), "fmi2SetReal");
}

static void step(int side, int k)
{
    must(sides[side].call.step(sides[side].fmu, (double)k, 1.0, 1), "fmi2DoStep");
}

static void print_step(int k)
{
    printf("step %d", k + 1);
    for (size_t i = 0; i < watches; ++i) {
        double value;
        const Side *const one = &sides[watched[i].side];
        must(one->call.get(one->fmu, &watched[i].reference, 1, &value), "fmi2GetReal");
        printf(" %a", value);
    }
    printf("\n");
}

/* Serial order */

static void serial_step(int k)
{
    if (tuned.given && k == steps - 2)
        must(sides[tuned.side].call.set(sides[tuned.side].fmu, &tuned.reference, 1, &tuned.value), "fmi2SetReal");
    get(STRUCTURAL);
    pass_on(STRUCTURAL);
    step(AERO, k);
    get(AERO);
    pass_on(AERO);
    step(STRUCTURAL, k);
    print_step(k);
}

/* The state of a side as bytes; the state itself is given back at once. */
static char *saved(const Side *side, size_t *size)
{
    void *state = NULL;
    must(side->call.get_state(side->fmu, &state), "fmi2GetFMUstate");
    must(side->call.state_size(side->fmu, state, size), "fmi2SerializedFMUstateSize");
    char *const bytes = malloc(*size);
    if (bytes == NULL)
        fail("out of memory");
    must(side->call.serialise(side->fmu, state, bytes, *size), "fmi2SerializeFMUstate");
    must(side->call.free_state(side->fmu, &state), "fmi2FreeFMUstate");
    return bytes;
}

static void restored(const Side *side, char *bytes, size_t size)
{
    void *state = NULL;
    must(side->call.deserialise(side->fmu, bytes, size, &state), "fmi2DeSerializeFMUstate");
    must(side->call.set_state(side->fmu, state), "fmi2SetFMUstate");
    must(side->call.free_state(side->fmu, &state), "fmi2FreeFMUstate");
    free(bytes);
}

static void serial(void)
{
    char *bytes[SIDES];
    size_t sizes[SIDES];
    int k;

    for (k = 0; k < steps / 2; ++k)
        serial_step(k);
    for (int side = 0; side < SIDES; ++side)
        bytes[side] = saved(&sides[side], &sizes[side]);
    for (; k < steps; ++k)
        serial_step(k);
    printf("restored\n");
    for (int side = 0; side < SIDES; ++side)
        restored(&sides[side], bytes[side], sizes[side]);
    for (k = steps / 2; k < steps; ++k)
        serial_step(k);

    if (!refusal.given)
        return;
    const Side *const one = &sides[refusal.side];
    printf("refused %d\n", one->call.set(one->fmu, &refusal.reference, 1, &refusal.value));
    printf("discarded %d\n", one->call.step(one->fmu, (double)steps, 1.0, 1));
    printf("recovered %d\n", one->call.step(one->fmu, (double)steps, 1.0, 1));
}

/* Parallel order: two threads, and a third that exchanges between their steps */

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t changed = PTHREAD_COND_INITIALIZER;
static int released, finished; /* steps that may be made; steps that were made, of both sides together */

static void *stepping(void *argument)
{
    const int side = *(const int *)argument;
    for (int k = 0; k < steps; ++k) {
        pthread_mutex_lock(&lock);
        while (released <= k)
            pthread_cond_wait(&changed, &lock);
        pthread_mutex_unlock(&lock);
        step(side, k);
        pthread_mutex_lock(&lock);
        ++finished;
        pthread_cond_broadcast(&changed);
        pthread_mutex_unlock(&lock);
    }
    return NULL;
}

static void parallel(void)
{
    pthread_t threads[SIDES];
    int numbers[SIDES];

    for (int side = 0; side < SIDES; ++side) {
        numbers[side] = side;
        if (pthread_create(&threads[side], NULL, stepping, &numbers[side]) != 0)
            fail("a thread cannot be started");
    }
    for (int k = 0; k < steps; ++k) {
        pthread_mutex_lock(&lock);
        released = k + 1;
        pthread_cond_broadcast(&changed);
        while (finished < SIDES * (k + 1))
            pthread_cond_wait(&changed, &lock);
        pthread_mutex_unlock(&lock);
        get(AERO);
        get(STRUCTURAL);
        pass_on(AERO);
        pass_on(STRUCTURAL);
        print_step(k);
    }
    for (int side = 0; side < SIDES; ++side)
        pthread_join(threads[side], NULL);
}

int main(int count, char **arguments)
{
    if (count < 2)
        fail("give the file with the wiring");
    const int together = count > 2 && strcmp(arguments[2], "parallel") == 0;
    steps = count > 4 ? atoi(arguments[4]) : steps;
    const int mode = count > 3 && strcmp(arguments[3], "lazy") == 0 ? RTLD_LAZY : RTLD_NOW;

    read_wiring(arguments[1]);
    for (int side = 0; side < SIDES; ++side)
        load(&sides[side], mode | RTLD_LOCAL);
    for (int side = 0; side < SIDES; ++side)
        begin(side);
    get(STRUCTURAL); /* the loads on the wing as it starts */
    pass_on(STRUCTURAL);
    get(AERO);
    pass_on(AERO);
    for (int side = 0; side < SIDES; ++side)
        must(sides[side].call.leave(sides[side].fmu), "fmi2ExitInitializationMode");
    if (together)
        parallel();
    else
        serial();
    for (int side = 0; side < SIDES; ++side) {
        must(sides[side].call.terminate(sides[side].fmu), "fmi2Terminate");
        sides[side].call.free_instance(sides[side].fmu);
    }
    for (int side = 0; side < SIDES; ++side)
        if (dlclose(sides[side].library) != 0)
            fail("an FMU cannot be unloaded");
    printf("done\n");
    fflush(stdout); /* before anything can go wrong in leaving */
    return 0;
}
