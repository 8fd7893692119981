/* The functions of an FMI 2.0 co-simulation FMU.

   A null pointer, a state that is not one, a foreign GUID or a block of memory that is too small ends in fmi2Error and a
   logged sentence, not in the end of the process. Values that the slave refuses end so too, and the old ones stay. What
   the host forgot to free is freed with the instance. */

#define _GNU_SOURCE /* dladdr */

#include "instance.h"

#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { DO_STEP_STATUS, PENDING_STATUS, LAST_TIME, TERMINATED }; /* fmi2StatusKind */
enum { CO_SIMULATION = 1 };                                     /* fmi2Type */

/* Logging */

static int wanted(const Front *front, const char *category)
{
    if (!front->logging)
        return 0;
    for (size_t i = 0; i < front->categories; ++i)
        if (strcmp(front->category[i], category) == 0 || strcmp(front->category[i], "logAll") == 0)
            return 1;
    return front->categories == 0;
}

/* A message of a slave, in which per cent signs are doubled. */
static void heard(void *environment, int status, const char *category, const char *text)
{
    Front *const front = environment;
    if (status > front->worst)
        front->worst = status;
    if (wanted(front, category))
        front->tell(front, status, category, text);
}

int refused(Front *front, const char *format, ...)
{
    char text[500];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    heard(front, ERROR, "logStatusError", text);
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

/* Path of a file `up` folders above that of this library; 0 where it is not known or does not fit. */
static int beside(const char *file, int up, char *path, size_t size)
{
    Dl_info where;
    if (dladdr((void *)&heard, &where) == 0 || where.dli_fname == NULL || strlen(where.dli_fname) >= size)
        return 0;
    strcpy(path, where.dli_fname);
    for (int i = 0; i <= up; ++i) {
        char *const slash = strrchr(path, '/');
        if (slash == NULL)
            return 0;
        *slash = '\0';
    }
    const size_t used = strlen(path);
    return (size_t)snprintf(path + used, size - used, "/%s", file) < size - used;
}

static int digit(char c)
{
    static const char digits[] = "0123456789abcdef0123456789ABCDEF";
    const char *const at = c != '\0' ? strchr(digits, c) : NULL;
    return at != NULL ? (int)(at - digits) % 16 : -1;
}

/* The folder that a URI (of FMI 3.0: a path) of the host names, or that of this FMU where there is none. */
static char *resource_folder(const char *uri)
{
    char path[4096];
    if (uri == NULL || *uri == '\0')
        return beside("resources", 2, path, sizeof path) ? strdup(path) : NULL;
    if (strncmp(uri, "file:", 5) != 0) /* in a path a per cent sign is one */
        return strdup(uri);
    const char *from = uri + 5;
    if (strncmp(from, "//", 2) == 0 && (from = strchr(from + 2, '/')) == NULL) /* after an authority, often empty */
        return NULL;
    char *const folder = strdup(from), *to = folder;
    for (; folder != NULL && *from != '\0'; ++to) {
        const int high = *from == '%' ? digit(from[1]) : -1;
        const int low = high >= 0 ? digit(from[2]) : -1;
        const int code = low >= 0 ? 16 * high + low : 0; /* 0: no escape, but a character */
        *to = code != 0 ? (char)code : *from;
        from += code != 0 ? 3 : 1;
    }
    if (folder != NULL)
        *to = '\0';
    return folder;
}

/* Whether the model description has another GUID (of FMI 3.0: instantiation token); an unreadable one has not. */
static int other_guid(const char *attribute, const char *guid)
{
    char path[4096], text[4096];
    if (!beside("modelDescription.xml", 2, path, sizeof path))
        return 0;
    FILE *const file = fopen(path, "rb");
    if (file == NULL)
        return 0;
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    const size_t skip = strlen(attribute), length = strlen(guid);
    const char *const at = strstr(text, attribute);
    return at != NULL && (strncmp(at + skip, guid, length) != 0 || at[skip + length] != '"');
}

/* The status of a call: whatever the slave has said of it as an error makes it one. */
int judged(const Front *front, int done)
{
    return done && front->worst < DISCARD ? OK : ERROR;
}

Front *begun(void *component)
{
    Front *const front = component;
    if (front == NULL || !slave_callable()) /* no message: the host's logger may be a function of Python, too */
        return NULL;
    front->worst = OK;
    return front;
}

/* Life */

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

static void free_front(Front *front)
{
    forget_categories(front);
    free(front->resources);
    free(front->name);
    free(front);
}

/* A front that is ready, or NULL after a message. `guid` follows its attribute in the model description. */
Front *ready(Front *front, const char *name, const char *attribute, const char *guid, const char *resources)
{
    int made = 0;
    front->name = strdup(name != NULL ? name : "");
    front->resources = resource_folder(resources);
    front->logging = 1; /* there are no debug messages; errors and discards are logged until the host turns them off */
    front->slave = (Slave){NULL, NULL, heard, front};
    if (front->name == NULL || *front->name == '\0')
        refused(front, "An instance needs a name that is not empty.");
    else if (!front->for_co_simulation)
        refused(front, "The FMU is for co-simulation only.");
    else if (guid == NULL || other_guid(attribute, guid))
        refused(front, "The %s is not that of the FMU's model description.",
                strncmp(attribute, "guid", 4) == 0 ? "GUID" : "instantiation token");
    else if (front->resources == NULL)
        refused(front, "The folder of the FMU's resources is not known.");
    else
        made = slave_make(&front->slave, front->name, front->resources, front->visible);
    if (made)
        return front;
    free_front(front);
    return NULL;
}

/* The logger of FMI 2.0 takes a printf format, and per cent signs come doubled. */
static void tell(Front *front, int status, const char *category, const char *text)
{
    if (front->host.logger != NULL)
        front->host.logger(front->host.environment, front->name, status, category, text);
}

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                             const Callbacks *callbacks, int visible, int logging)
{
    Front *const front = calloc(1, sizeof *front);
    (void)logging;
    if (front == NULL)
        return NULL;
    if (callbacks != NULL)
        front->host = *callbacks;
    front->tell = tell;
    front->visible = visible != 0;
    front->for_co_simulation = type == CO_SIMULATION;
    return ready(front, name, "guid=\"", guid, resources);
}

static void free_state(Front *front, State *state)
{
    State **link = &front->states;
    while (*link != state)
        link = &(*link)->next;
    *link = state->next;
    slave_release(state->bytes);
    slave_release(state->content);
    free(state);
}

EXPORT void fmi2FreeInstance(void *component)
{
    Front *const front = component;
    if (front == NULL)
        return;
    while (front->states != NULL)
        free_state(front, front->states);
    slave_free(&front->slave);
    free_front(front);
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
    (void)tolerant, (void)tolerance, (void)stops, (void)stop; /* the solvers have tolerances of their own */
    if (front == NULL)
        return ERROR;
    const int status = judged(front, slave_setup(&front->slave, start));
    if (status == OK)
        front->last = start;
    return status;
}

static int called(void *component, const char *method)
{
    Front *const front = begun(component);
    return front == NULL ? ERROR : judged(front, slave_call(&front->slave, method));
}

EXPORT int fmi2EnterInitializationMode(void *component) { return called(component, "enter_initialization_mode"); }
EXPORT int fmi2ExitInitializationMode(void *component) { return called(component, "exit_initialization_mode"); }
EXPORT int fmi2Terminate(void *component) { return called(component, "terminate"); }

EXPORT int fmi2Reset(void *component)
{
    Front *const front = begun(component);
    if (front == NULL)
        return ERROR;
    Slave fresh = {NULL, NULL, heard, front};
    if (!slave_make(&fresh, front->name, front->resources, front->visible))
        return ERROR;
    slave_free(&front->slave);
    front->slave = fresh;
    front->discarded = 0;
    front->last = 0.0;
    return judged(front, 1);
}

/* Variables */

static int moved(void *component, Kind kind, const unsigned *references, size_t count, const void *given, void *taken)
{
    Front *const front = begun(component);
    if (front == NULL)
        return ERROR;
    if (count == 0)
        return OK;
    if (references == NULL || (given == NULL && taken == NULL))
        return refused(front, "There are no value references or no values at a null pointer.");
    for (size_t i = 0; kind == STRING && taken != NULL && i < count; ++i)
        ((const char **)taken)[i] = "";
    if (kind == STRING)
        return refused(front, "There are no String variables.");
    return judged(front, taken != NULL ? slave_take(&front->slave, kind, references, count, taken)
                                       : slave_put(&front->slave, kind, references, count, given));
}

#define VARIABLES(type, name, kind)                                                                      \
    EXPORT int fmi2Get##name(void *component, const unsigned references[], size_t count, type values[])   \
    {                                                                                                     \
        return moved(component, kind, references, count, NULL, (void *)values);                           \
    }                                                                                                     \
    EXPORT int fmi2Set##name(void *component, const unsigned references[], size_t count,                  \
                             const type values[])                                                         \
    {                                                                                                     \
        return moved(component, kind, references, count, (const void *)values, NULL);                     \
    }

typedef const char *String;
VARIABLES(double, Real, REAL)
VARIABLES(int, Integer, INTEGER)
VARIABLES(int, Boolean, BOOLEAN)
VARIABLES(String, String, STRING)

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

/* Keeps a state and hands it out; one that was given to be replaced is freed. */
static int kept(Front *front, void *content, void **state)
{
    State *const entry = malloc(sizeof *entry);
    if (entry == NULL) {
        slave_release(content);
        return refused(front, "Out of memory.");
    }
    for (State *old = front->states; old != NULL; old = old->next)
        if (old == *state) {
            free_state(front, old);
            break;
        }
    *entry = (State){content, NULL, front->states};
    front->states = entry;
    *state = entry;
    return judged(front, 1);
}

EXPORT int fmi2GetFMUstate(void *component, void **state)
{
    Front *const front = begun(component);
    void *content = NULL;
    if (front == NULL)
        return ERROR;
    if (state == NULL)
        return refused(front, "There is no place for a state at a null pointer.");
    return slave_state(&front->slave, &content) ? kept(front, content, state) : ERROR;
}

EXPORT int fmi2SetFMUstate(void *component, void *state)
{
    Front *const front = begun(component);
    State *const entry = front != NULL ? known(front, state) : NULL;
    if (entry == NULL)
        return ERROR;
    front->discarded = 0;
    return judged(front, slave_restore(&front->slave, entry->content));
}

EXPORT int fmi2FreeFMUstate(void *component, void **state)
{
    Front *const front = begun(component);
    if (front == NULL)
        return ERROR;
    if (state == NULL || *state == NULL) /* nothing to free, by the standard */
        return OK;
    State *const entry = known(front, *state);
    if (entry == NULL)
        return ERROR;
    free_state(front, entry);
    *state = NULL;
    return OK;
}

/* The serialised form of a state; NULL where there is none. */
static const char *serialised(Front *front, State *entry, size_t *size)
{
    if (entry->bytes == NULL && !slave_serialise(&front->slave, entry->content, &entry->bytes))
        return NULL;
    return slave_bytes(entry->bytes, size);
}

EXPORT int fmi2SerializedFMUstateSize(void *component, void *state, size_t *size)
{
    Front *const front = begun(component);
    State *const entry = front != NULL ? known(front, state) : NULL;
    if (entry == NULL)
        return ERROR;
    if (size == NULL)
        return refused(front, "There is no place for a size at a null pointer.");
    return judged(front, serialised(front, entry, size) != NULL);
}

EXPORT int fmi2SerializeFMUstate(void *component, void *state, char bytes[], size_t size)
{
    Front *const front = begun(component);
    State *const entry = front != NULL ? known(front, state) : NULL;
    size_t needed = 0;
    if (entry == NULL)
        return ERROR;
    const char *const content = serialised(front, entry, &needed);
    if (content == NULL)
        return ERROR;
    if (bytes == NULL || size < needed)
        return refused(front, "The state takes %zu bytes, and %zu were given.", needed, bytes == NULL ? 0 : size);
    memcpy(bytes, content, needed);
    slave_release(entry->bytes);
    entry->bytes = NULL;
    return judged(front, 1);
}

EXPORT int fmi2DeSerializeFMUstate(void *component, const char bytes[], size_t size, void **state)
{
    Front *const front = begun(component);
    void *content = NULL;
    if (front == NULL)
        return ERROR;
    if (bytes == NULL || state == NULL)
        return refused(front, "There are no bytes, or no place for a state, at a null pointer.");
    return slave_read(&front->slave, bytes, size, &content) ? kept(front, content, state) : ERROR;
}

/* Steps */

EXPORT int fmi2DoStep(void *component, double time, double step, int no_state_before)
{
    Front *const front = begun(component);
    int done = 0;
    (void)no_state_before;
    if (front == NULL)
        return ERROR;
    if (!slave_step(&front->slave, time, step, &done))
        return ERROR;
    front->discarded = !done;
    front->last = done ? time + step : time;
    return done ? OK : DISCARD;
}

/* A status that the slave cannot tell is discarded, by the standard. */
static int untold(Front *front, const char *sentence)
{
    heard(front, DISCARD, "logStatusDiscard", sentence);
    return DISCARD;
}

EXPORT int fmi2GetRealStatus(void *component, int kind, double *value)
{
    Front *const front = begun(component);
    if (front == NULL)
        return ERROR;
    if (kind != LAST_TIME)
        return untold(front, "fmi2GetRealStatus tells the last successful time only.");
    if (value == NULL)
        return refused(front, "There is no place for a status at a null pointer.");
    *value = front->last;
    return OK;
}

EXPORT int fmi2GetBooleanStatus(void *component, int kind, int *value)
{
    Front *const front = begun(component);
    if (front == NULL)
        return ERROR;
    if (kind != TERMINATED)
        return untold(front, "fmi2GetBooleanStatus tells fmi2Terminated only.");
    if (value == NULL)
        return refused(front, "There is no place for a status at a null pointer.");
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
#pragma GCC diagnostic pop

#define UNTOLD(name, type)                                                                      \
    EXPORT int name(void *component, int kind, type *value)                                     \
    {                                                                                           \
        Front *const front = begun(component);                                                  \
        (void)kind, (void)value; /* of a step that goes on meanwhile; here there is none */     \
        return front == NULL ? ERROR : untold(front, #name " has nothing to tell.");            \
    }

UNTOLD(fmi2GetStatus, int)
UNTOLD(fmi2GetIntegerStatus, int)
UNTOLD(fmi2GetStringStatus, const char *)

EXPORT int fmi2CancelStep(void *component) { return absent(component, "fmi2CancelStep"); }
