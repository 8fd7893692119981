/* An instance, whatever the version of FMI: log messages, the location of the FMU, instantiation and mode changes, values
   and steps.

   A null pointer, the GUID of another FMU or a value that the slave refuses is a logged error, not the end of the process,
   and the old values stay. What the importer did not free is freed with the instance. */

#define _GNU_SOURCE /* dladdr */

#include "instance.h"

#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Log messages */

static int is_logged(const Instance *self, const char *category)
{
    if (!self->logging_on)
        return 0;
    for (size_t i = 0; i < self->category_count; ++i)
        if (strcmp(self->categories[i], category) == 0 || strcmp(self->categories[i], "logAll") == 0)
            return 1;
    return self->category_count == 0;
}

/* Handles a message, in which per cent signs are doubled; a MessageHandler. */
static void log_message(void *environment, int status, const char *category, const char *text)
{
    Instance *const self = environment;
    if (status > self->worst_status)
        self->worst_status = status;
    if (is_logged(self, category))
        self->call_logger(self, status, category, text);
}

int log_error(Instance *self, const char *format, ...)
{
    char text[500];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    log_message(self, ERROR, "logStatusError", text);
    return ERROR;
}

static void free_categories(Instance *self)
{
    for (size_t i = 0; i < self->category_count; ++i)
        free(self->categories[i]);
    free(self->categories);
    self->categories = NULL;
    self->category_count = 0;
}

int log_discard(Instance *self, const char *message)
{
    log_message(self, DISCARD, "logStatusDiscard", message);
    return DISCARD;
}

int not_supported(void *component, const char *function)
{
    Instance *const self = begin_call(component);
    return self == NULL ? ERROR : log_error(self, "%s is not supported.", function);
}

int set_debug_logging(void *component, int logging_on, size_t count, const char *const categories[])
{
    Instance *const self = begin_call(component);
    if (self == NULL)
        return ERROR;
    if (count > 0 && categories == NULL)
        return log_error(self, "There are no log categories at a null pointer.");
    free_categories(self);
    self->logging_on = logging_on != 0;
    self->categories = calloc(count + 1, sizeof *self->categories);
    for (size_t i = 0; self->categories != NULL && i < count; ++i) {
        self->categories[self->category_count] = strdup(categories[i] != NULL ? categories[i] : "");
        self->category_count += self->categories[self->category_count] != NULL;
    }
    return OK;
}

/* Location of the FMU */

/* Path of a file that lies `up` folders above that of this library; 0 where it is not known or too long. */
static int path_in_fmu(const char *file, int up, char *path, size_t size)
{
    Dl_info where;
    if (dladdr((void *)&log_message, &where) == 0 || where.dli_fname == NULL || strlen(where.dli_fname) >= size)
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

static int hex_digit(char c)
{
    static const char digits[] = "0123456789abcdef0123456789ABCDEF";
    const char *const at = c != '\0' ? strchr(digits, c) : NULL;
    return at != NULL ? (int)(at - digits) % 16 : -1;
}

/* The folder that a URI (of FMI 3.0: a path) of the importer names, or that of this FMU where there is none. */
static char *resource_folder(const char *uri)
{
    char path[4096];
    if (uri == NULL || *uri == '\0')
        return path_in_fmu("resources", 2, path, sizeof path) ? strdup(path) : NULL;
    if (strncmp(uri, "file:", 5) != 0) /* a path has no escapes */
        return strdup(uri);
    const char *from = uri + 5;
    if (strncmp(from, "//", 2) == 0 && (from = strchr(from + 2, '/')) == NULL) /* after an authority, often empty */
        return NULL;
    char *const folder = strdup(from), *to = folder;
    for (; folder != NULL && *from != '\0'; ++to) {
        const int high = *from == '%' ? hex_digit(from[1]) : -1;
        const int low = high >= 0 ? hex_digit(from[2]) : -1;
        const int code = low >= 0 ? 16 * high + low : 0; /* 0: no escape */
        *to = code != 0 ? (char)code : *from;
        from += code != 0 ? 3 : 1;
    }
    if (folder != NULL)
        *to = '\0';
    return folder;
}

/* Whether the model description has another GUID (of FMI 3.0: instantiation token); not if it cannot be read. */
static int guid_differs(const char *attribute, const char *guid)
{
    char path[4096], text[4096];
    if (!path_in_fmu("modelDescription.xml", 2, path, sizeof path))
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

/* Instantiation and mode changes */

int call_status(const Instance *self, int succeeded)
{
    return succeeded && self->worst_status < DISCARD ? OK : ERROR;
}

Instance *begin_call(void *component)
{
    Instance *const self = component;
    if (self == NULL || !slave_callable()) /* nothing is logged: the logger may be a function of Python, too */
        return NULL;
    self->worst_status = OK;
    return self;
}

static void free_members(Instance *self)
{
    free_categories(self);
    free(self->resources);
    free(self->name);
    free(self);
}

Instance *instantiate(Instance *self, const char *name, const char *attribute, const char *guid, const char *resources)
{
    int instantiated = 0;
    self->name = strdup(name != NULL ? name : "");
    self->resources = resource_folder(resources);
    self->logging_on = 1; /* there are no debug messages; errors and discards are logged until fmi2SetDebugLogging */
    self->slave = (Slave){NULL, NULL, log_message, self};
    if (self->name == NULL || *self->name == '\0')
        log_error(self, "An instance needs a name that is not empty.");
    else if (!self->co_simulation)
        log_error(self, "The FMU is for co-simulation only.");
    else if (guid == NULL || guid_differs(attribute, guid))
        log_error(self, "The %s is not that of the FMU's model description.",
                  strncmp(attribute, "guid", 4) == 0 ? "GUID" : "instantiation token");
    else if (self->resources == NULL)
        log_error(self, "The folder of the FMU's resources is not known.");
    else
        instantiated = slave_create(&self->slave, self->name, self->resources, self->visible);
    if (instantiated)
        return self;
    free_members(self);
    return NULL;
}

void free_instance(void *component)
{
    Instance *const self = component;
    if (self == NULL)
        return;
    while (self->states != NULL)
        remove_state(self, self->states);
    slave_free(&self->slave);
    free_members(self);
}

int setup_experiment(Instance *self, double start)
{
    const int status = call_status(self, slave_setup_experiment(&self->slave, start));
    if (status == OK)
        self->last_successful_time = start;
    return status;
}

int call_method(void *component, const char *method)
{
    Instance *const self = begin_call(component);
    return self == NULL ? ERROR : call_status(self, slave_call(&self->slave, method));
}

int reset(void *component)
{
    Instance *const self = begin_call(component);
    if (self == NULL)
        return ERROR;
    Slave slave = {NULL, NULL, log_message, self};
    if (!slave_create(&slave, self->name, self->resources, self->visible))
        return ERROR;
    slave_free(&self->slave);
    self->slave = slave;
    self->step_failed = 0;
    self->last_successful_time = 0.0;
    return call_status(self, 1);
}

/* Values and steps */

int access_values(void *component, Kind kind, const unsigned *references, size_t count, const void *source, void *target,
                  size_t size, int as_arrays)
{
    Instance *const self = begin_call(component);
    if (self == NULL)
        return ERROR;
    if (count == 0)
        return OK;
    if (references == NULL || (source == NULL && target == NULL))
        return log_error(self, "There are no value references or no values at a null pointer.");
    for (size_t i = 0; kind == STRING && target != NULL && i < count; ++i)
        ((const char **)target)[i] = "";
    if (kind == STRING)
        return log_error(self, "There are no String variables.");
    return call_status(self, target != NULL ? slave_get(&self->slave, kind, references, count, target, size, as_arrays)
                                            : slave_set(&self->slave, kind, references, count, source, size, as_arrays));
}

int do_step(void *component, double time, double step)
{
    Instance *const self = begin_call(component);
    int completed = 0;
    if (self == NULL)
        return ERROR;
    if (!slave_do_step(&self->slave, time, step, &completed))
        return ERROR;
    self->step_failed = !completed;
    self->last_successful_time = completed ? time + step : time;
    return completed ? OK : DISCARD;
}
