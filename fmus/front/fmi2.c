/* The functions of an FMI 2.0 co-simulation FMU, each handed on to PythonFMU's binary beside this one.

   What is added: Python is started where the host has none; a null pointer, a state that is not one, a foreign GUID or
   a block of memory that is too small ends in fmi2Error and a logged sentence, not in the end of the process; a call
   whose failure PythonFMU can only log returns fmi2Error; reasons are logged unless the host turns logging off; what the
   host forgot to free is freed with the instance. */

#define _GNU_SOURCE /* dladdr */

#include "front.h"

#include <dlfcn.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
#define INNER "pythonfmu.so" /* the binary of PythonFMU, in the folder of this one */

enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING };           /* fmi2Status */
enum { DO_STEP_STATUS, PENDING_STATUS, LAST_TIME, TERMINATED }; /* fmi2StatusKind */
enum { CO_SIMULATION = 1 };                                     /* fmi2Type */

typedef void Log(void *environment, const char *instance, int status, const char *category, const char *message, ...);

typedef struct {
    Log *logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} Callbacks;

typedef struct State {
    void *inner;
    struct State *next;
} State;

typedef struct {
    void *inner;         /* the component of PythonFMU */
    char *name;
    const Callbacks *host;
    Callbacks own;       /* what PythonFMU gets */
    State *states;
    int logging;
    size_t categories;   /* 0: all */
    char **category;
    int worst;           /* status that was logged since the present call began */
    int discarded;       /* whether the last step was */
} Front;

/* The functions of PythonFMU's binary; the order of NAMES. */
static const char *const NAMES[] = {
    "fmi2Instantiate", "fmi2FreeInstance", "fmi2SetDebugLogging", "fmi2SetupExperiment", "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode", "fmi2Terminate", "fmi2Reset", "fmi2GetReal", "fmi2GetInteger", "fmi2GetBoolean",
    "fmi2GetString", "fmi2SetReal", "fmi2SetInteger", "fmi2SetBoolean", "fmi2SetString", "fmi2GetFMUstate",
    "fmi2SetFMUstate", "fmi2FreeFMUstate", "fmi2SerializedFMUstateSize", "fmi2SerializeFMUstate",
    "fmi2DeSerializeFMUstate", "fmi2DoStep", "fmi2GetRealStatus"};
enum { INSTANTIATE, FREE, LOGGING, SETUP, ENTER, EXIT, TERMINATE, RESET, GET_REAL, GET_INTEGER, GET_BOOLEAN, GET_STRING,
       SET_REAL, SET_INTEGER, SET_BOOLEAN, SET_STRING, GET_STATE, SET_STATE, FREE_STATE, SIZE, SERIALISE, DESERIALISE,
       STEP, REAL_STATUS, FUNCTIONS };

static void *library;
static void *function[FUNCTIONS];
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

/* Logging */

static int wanted(const Front *front, const char *category)
{
    if (!front->logging)
        return 0;
    for (size_t i = 0; i < front->categories; ++i)
        if (strcmp(front->category[i], category) == 0)
            return 1;
    return front->categories == 0;
}

/* A message as the host gets it: its logger takes a printf format, so that per cent signs stay doubled. */
static void tell(const Callbacks *host, const char *name, int status, const char *category, const char *format)
{
    if (host != NULL && host->logger != NULL)
        host->logger(host->environment, name, status, category, format);
}

/* What PythonFMU logs; it passes a format without arguments. */
static void heard(void *environment, const char *instance, int status, const char *category, const char *format, ...)
{
    Front *const front = environment;
    const char *const kind = category != NULL ? category : "logStatusError";

    (void)instance;
    if (status > front->worst)
        front->worst = status;
    if (wanted(front, kind))
        tell(front->host, front->name, status, kind, format);
}

static int refused(Front *front, const char *format, ...)
{
    char text[500];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    heard(front, front->name, ERROR, "logStatusError", text);
    return ERROR;
}

static void forget_categories(Front *front)
{
    for (size_t i = 0; i < front->categories; ++i)
        free(front->category[i]);
    free(front->category);
    front->category = NULL;
    front->categories = 0;
}

/* The binary of PythonFMU */

/* At the end of the process, before its library is unloaded, or when the host unloads this one: left to itself PythonFMU
   lets go of the interpreter twice, the second time in freed memory. */
static void end(void)
{
    void (*const finish)(void) = (void (*)(void))dlsym(library, "finalizePythonInterpreter");
    if (finish != NULL)
        finish();
    dlclose(library);
    library = NULL;
}

/* Path of a file beside this library, or `up` folders above; 0 where it does not fit. */
static int beside(const char *file, int up, char *path, size_t size)
{
    Dl_info where;
    if (dladdr((void *)&lock, &where) == 0 || where.dli_fname == NULL || strlen(where.dli_fname) >= size)
        return 0;
    strcpy(path, where.dli_fname);
    for (int i = 0; i <= up; ++i) {
        char *const slash = strrchr(path, '/');
        if (slash == NULL)
            return 0;
        *slash = '\0';
    }
    return (size_t)snprintf(path + strlen(path), size - strlen(path), "/%s", file) < size - strlen(path);
}

static int load(char *why, size_t size)
{
    char path[4096];
    int done = 0;

    pthread_mutex_lock(&lock);
    if (library != NULL) {
        done = 1;
    } else if (!front_start_python(why, size)) {
    } else if (!beside(INNER, 0, path, sizeof path)) {
        snprintf(why, size, "The folder of the FMU's binary is not known.");
    } else if ((library = dlopen(path, RTLD_NOW | RTLD_LOCAL)) == NULL) {
        snprintf(why, size, "The FMU's inner binary cannot be opened: %s.", dlerror());
    } else {
        done = 1;
        for (int i = 0; done && i < FUNCTIONS; ++i) {
            function[i] = dlsym(library, NAMES[i]);
            done = function[i] != NULL;
            if (!done)
                snprintf(why, size, "The FMU's inner binary has no %s.", NAMES[i]);
        }
        if (done) {
            atexit(end);
        } else {
            dlclose(library);
            library = NULL;
        }
    }
    pthread_mutex_unlock(&lock);
    return done;
}

/* Whether the model description `up` folders above has another GUID; unreadable ones have not. */
static int other_guid(const char *guid)
{
    char path[4096], text[4096];
    if (!beside("modelDescription.xml", 2, path, sizeof path))
        return 0;
    FILE *const file = fopen(path, "rb");
    if (file == NULL)
        return 0;
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    const char *const at = strstr(text, "guid=\"");
    return at != NULL && (strncmp(at + 6, guid, strlen(guid)) != 0 || at[6 + strlen(guid)] != '"');
}

/* The status of a call that PythonFMU has ended: with fmi2OK where it could only log that it failed. */
static int judged(const Front *front, int status)
{
    return status < DISCARD && front->worst >= DISCARD ? ERROR : status;
}

static Front *begun(void *component)
{
    Front *const front = component;
    if (front != NULL)
        front->worst = OK;
    return front;
}

/* Life */

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

static void discard(Front *front)
{
    forget_categories(front);
    free(front->name);
    free(front);
}

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                             const Callbacks *callbacks, int visible, int logging)
{
    typedef void *Instantiate(const char *, int, const char *, const char *, const Callbacks *, int, int);
    char why[2000] = "", place[4096];
    Front *const front = calloc(1, sizeof *front);

    if (front == NULL)
        return NULL;
    front->name = strdup(name != NULL ? name : "");
    front->host = callbacks;
    front->own = (Callbacks){heard, NULL, NULL, NULL, front};
    front->logging = 1;
    if (callbacks != NULL) {
        front->own.allocate = callbacks->allocate;
        front->own.release = callbacks->release;
        front->own.step_finished = callbacks->step_finished;
    }
    if (front->name == NULL || *front->name == '\0')
        snprintf(why, sizeof why, "An instance needs a name that is not empty.");
    else if (type != CO_SIMULATION)
        snprintf(why, sizeof why, "The FMU is for co-simulation only.");
    else if (guid == NULL || other_guid(guid))
        snprintf(why, sizeof why, "The GUID is not that of the FMU's model description.");
    else if (load(why, sizeof why)) {
        if (resources == NULL && beside("resources", 2, place, sizeof place))
            resources = place;
        if (resources != NULL)
            front->inner = ((Instantiate *)function[INSTANTIATE])(front->name, type, guid, resources, &front->own,
                                                                  visible, 1);
        if (front->inner == NULL && front->worst == OK)
            snprintf(why, sizeof why, "The FMU cannot be instantiated.");
    }
    if (front->inner == NULL) {
        if (*why != '\0') {
            char *sign = why;
            while ((sign = strchr(sign, '%')) != NULL && strlen(why) < sizeof why - 1) {
                memmove(sign + 1, sign, strlen(sign) + 1); /* doubled, as the logger takes a format */
                sign += 2;
            }
            tell(callbacks, front->name, FATAL, "logStatusError", why);
        }
        discard(front);
        return NULL;
    }
    (void)logging; /* debug messages there are none; errors and discards are logged until fmi2SetDebugLogging */
    return front;
}

static void free_state(Front *front, State *state)
{
    typedef int Free(void *, void **);
    State **link = &front->states;
    while (*link != state)
        link = &(*link)->next;
    *link = state->next;
    ((Free *)function[FREE_STATE])(front->inner, &state->inner);
    free(state);
}

EXPORT void fmi2FreeInstance(void *component)
{
    Front *const front = component;
    if (front == NULL)
        return;
    while (front->states != NULL)
        free_state(front, front->states);
    ((void (*)(void *))function[FREE])(front->inner);
    discard(front);
}

EXPORT int fmi2SetDebugLogging(void *component, int logging, size_t count, const char *const categories[])
{
    Front *const front = begun(component);
    if (front == NULL)
        return ERROR;
    if (count > 0 && categories == NULL)
        return refused(front, "There are no log categories at a null pointer.");
    forget_categories(front);
    front->logging = logging != 0;
    front->category = calloc(count + 1, sizeof *front->category);
    for (size_t i = 0; front->category != NULL && i < count; ++i) {
        front->category[front->categories] = strdup(categories[i] != NULL ? categories[i] : "");
        front->categories += front->category[front->categories] != NULL;
    }
    return OK;
}

EXPORT int fmi2SetupExperiment(void *component, int tolerant, double tolerance, double start, int stops, double stop)
{
    Front *const front = begun(component);
    typedef int Setup(void *, int, double, double, int, double);
    return front == NULL ? ERROR
                         : judged(front, ((Setup *)function[SETUP])(front->inner, tolerant, tolerance, start, stops, stop));
}

static int plain(void *component, int which)
{
    Front *const front = begun(component);
    return front == NULL ? ERROR : judged(front, ((int (*)(void *))function[which])(front->inner));
}

EXPORT int fmi2EnterInitializationMode(void *component) { return plain(component, ENTER); }
EXPORT int fmi2ExitInitializationMode(void *component) { return plain(component, EXIT); }
EXPORT int fmi2Terminate(void *component) { return plain(component, TERMINATE); }

EXPORT int fmi2Reset(void *component)
{
    if (component != NULL)
        ((Front *)component)->discarded = 0;
    return plain(component, RESET);
}

/* Variables */

static int moved(void *component, int which, const unsigned *references, size_t count, void *values)
{
    Front *const front = begun(component);
    if (front == NULL)
        return ERROR;
    if (count > 0 && (references == NULL || values == NULL))
        return refused(front, "There are no value references or no values at a null pointer.");
    typedef int Move(void *, const unsigned *, size_t, void *);
    return judged(front, ((Move *)function[which])(front->inner, references, count, values));
}

#define MOVE(name, type, which)                                                                  \
    EXPORT int name(void *component, const unsigned references[], size_t count, type values[])   \
    {                                                                                            \
        return moved(component, which, references, count, (void *)values);                       \
    }

MOVE(fmi2GetReal, double, GET_REAL)
MOVE(fmi2GetInteger, int, GET_INTEGER)
MOVE(fmi2GetBoolean, int, GET_BOOLEAN)
MOVE(fmi2GetString, const char *, GET_STRING)
MOVE(fmi2SetReal, const double, SET_REAL)
MOVE(fmi2SetInteger, const int, SET_INTEGER)
MOVE(fmi2SetBoolean, const int, SET_BOOLEAN)

EXPORT int fmi2SetString(void *component, const unsigned references[], size_t count, const char *const values[])
{
    for (size_t i = 0; component != NULL && values != NULL && i < count; ++i)
        if (values[i] == NULL)
            return refused(begun(component), "A string is a null pointer.");
    return moved(component, SET_STRING, references, count, (void *)values);
}

/* States: what the host holds is an entry of a list, so that what is not one of them is found out. */

static State *known(Front *front, const void *state)
{
    State *entry = front->states;
    while (entry != NULL && entry != state)
        entry = entry->next;
    if (entry == NULL)
        refused(front, "The state is not one of this instance, or was freed.");
    return entry;
}

/* Keeps a state that PythonFMU has made and hands it out; one that was given to be replaced is freed. */
static int kept(Front *front, int status, void *inner, void **state)
{
    State *const entry = status < DISCARD ? malloc(sizeof *entry) : NULL;
    if (entry == NULL)
        return status < DISCARD ? refused(front, "Out of memory.") : status;
    for (State *old = front->states; old != NULL; old = old->next)
        if (old == *state) {
            free_state(front, old);
            break;
        }
    *entry = (State){inner, front->states};
    front->states = entry;
    *state = entry;
    return status;
}

EXPORT int fmi2GetFMUstate(void *component, void **state)
{
    Front *const front = begun(component);
    void *inner = NULL;
    if (front == NULL)
        return ERROR;
    if (state == NULL)
        return refused(front, "There is no place for a state at a null pointer.");
    const int status = ((int (*)(void *, void **))function[GET_STATE])(front->inner, &inner);
    return judged(front, kept(front, status, inner, state));
}

EXPORT int fmi2SetFMUstate(void *component, void *state)
{
    Front *const front = begun(component);
    State *const entry = front != NULL ? known(front, state) : NULL;
    return entry == NULL ? ERROR
                         : judged(front, ((int (*)(void *, void *))function[SET_STATE])(front->inner, entry->inner));
}

EXPORT int fmi2FreeFMUstate(void *component, void **state)
{
    Front *const front = begun(component);
    if (front == NULL)
        return ERROR;
    if (state == NULL || *state == NULL) /* nothing to free, by the standard */
        return OK;
    if (known(front, *state) == NULL)
        return ERROR;
    free_state(front, *state);
    *state = NULL;
    return judged(front, OK);
}

static int size_of(Front *front, const State *entry, size_t *size)
{
    return ((int (*)(void *, void *, size_t *))function[SIZE])(front->inner, entry->inner, size);
}

EXPORT int fmi2SerializedFMUstateSize(void *component, void *state, size_t *size)
{
    Front *const front = begun(component);
    State *const entry = front != NULL ? known(front, state) : NULL;
    if (entry == NULL)
        return ERROR;
    if (size == NULL)
        return refused(front, "There is no place for a size at a null pointer.");
    return judged(front, size_of(front, entry, size));
}

EXPORT int fmi2SerializeFMUstate(void *component, void *state, char bytes[], size_t size)
{
    Front *const front = begun(component);
    State *const entry = front != NULL ? known(front, state) : NULL;
    size_t needed = 0;
    if (entry == NULL)
        return ERROR;
    if (bytes == NULL || size_of(front, entry, &needed) != OK || size < needed)
        return refused(front, "The state takes %zu bytes, and %zu were given.", needed, bytes == NULL ? 0 : size);
    typedef int Serialise(void *, void *, char *, size_t);
    return judged(front, ((Serialise *)function[SERIALISE])(front->inner, entry->inner, bytes, needed));
}

EXPORT int fmi2DeSerializeFMUstate(void *component, const char bytes[], size_t size, void **state)
{
    Front *const front = begun(component);
    void *inner = NULL;
    if (front == NULL)
        return ERROR;
    if (bytes == NULL || state == NULL)
        return refused(front, "There are no bytes, or no place for a state, at a null pointer.");
    typedef int Deserialise(void *, const char *, size_t, void **);
    const int status = ((Deserialise *)function[DESERIALISE])(front->inner, bytes, size, &inner);
    return judged(front, kept(front, status, inner, state));
}

/* Steps */

EXPORT int fmi2DoStep(void *component, double time, double step, int no_state_before)
{
    Front *const front = begun(component);
    if (front == NULL)
        return ERROR;
    typedef int Step(void *, double, double, int);
    const int status = ((Step *)function[STEP])(front->inner, time, step, no_state_before);
    front->discarded = status >= DISCARD;
    return status;
}

EXPORT int fmi2GetRealStatus(void *component, int kind, double *value)
{
    Front *const front = begun(component);
    if (front == NULL)
        return ERROR;
    if (kind != LAST_TIME || value == NULL)
        return refused(front, "fmi2GetRealStatus tells the last successful time only.");
    return ((int (*)(void *, int, double *))function[REAL_STATUS])(front->inner, kind, value);
}

EXPORT int fmi2GetBooleanStatus(void *component, int kind, int *value)
{
    Front *const front = begun(component);
    if (front == NULL)
        return ERROR;
    if (kind != TERMINATED || value == NULL)
        return refused(front, "fmi2GetBooleanStatus tells fmi2Terminated only.");
    *value = front->discarded; /* importers that would else repeat a discarded step for ever end then */
    return OK;
}

/* What there is not */

static int absent(void *component, const char *name)
{
    Front *const front = begun(component);
    return front == NULL ? ERROR : refused(front, "%s is not supported.", name);
}

#define ABSENT(name, ...) \
    EXPORT int name(void *component, __VA_ARGS__) { return absent(component, #name); }

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
ABSENT(fmi2SetRealInputDerivatives, const unsigned r[], size_t n, const int order[], const double value[])
ABSENT(fmi2GetRealOutputDerivatives, const unsigned r[], size_t n, const int order[], double value[])
ABSENT(fmi2GetDirectionalDerivative, const unsigned z[], size_t nz, const unsigned v[], size_t nv, const double dv[],
       double dz[])
ABSENT(fmi2GetStatus, int kind, int *value)
ABSENT(fmi2GetIntegerStatus, int kind, int *value)
ABSENT(fmi2GetStringStatus, int kind, const char **value)
#pragma GCC diagnostic pop

EXPORT int fmi2CancelStep(void *component) { return absent(component, "fmi2CancelStep"); }
