/* An instance, whatever the version of FMI: its messages, where its FMU lies, its life, its values and its steps.

   A null pointer, a foreign GUID or a value that the slave refuses ends in an error and a logged sentence, not in the end of
   the process, and the old values stay. What the host forgot to free is freed with the instance. */

#define _GNU_SOURCE /* dladdr */

#include "instance.h"

#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Messages */

static int wanted(const Instance *self, const char *category)
{
    if (!self->logging)
        return 0;
    for (size_t i = 0; i < self->categories; ++i)
        if (strcmp(self->category[i], category) == 0 || strcmp(self->category[i], "logAll") == 0)
            return 1;
    return self->categories == 0;
}

/* A message of a slave, in which per cent signs are doubled. */
static void heard(void *environment, int status, const char *category, const char *text)
{
    Instance *const self = environment;
    if (status > self->worst)
        self->worst = status;
    if (wanted(self, category))
        self->tell(self, status, category, text);
}

int refused(Instance *self, const char *format, ...)
{
    char text[500];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    heard(self, ERROR, "logStatusError", text);
    return ERROR;
}

static void forget_categories(Instance *self)
{
    for (size_t i = 0; i < self->categories; ++i)
        free(self->category[i]);
    free(self->category);
    self->category = NULL;
    self->categories = 0;
}

int untold(Instance *self, const char *sentence)
{
    heard(self, DISCARD, "logStatusDiscard", sentence);
    return DISCARD;
}

int absent(void *component, const char *name)
{
    Instance *const self = begun(component);
    return self == NULL ? ERROR : refused(self, "%s is not supported.", name);
}

int log_only(void *component, int logging, size_t count, const char *const categories[])
{
    Instance *const self = begun(component);
    if (self == NULL)
        return ERROR;
    if (count > 0 && categories == NULL)
        return refused(self, "There are no log categories at a null pointer.");
    forget_categories(self);
    self->logging = logging != 0;
    self->category = calloc(count + 1, sizeof *self->category);
    for (size_t i = 0; self->category != NULL && i < count; ++i) {
        self->category[self->categories] = strdup(categories[i] != NULL ? categories[i] : "");
        self->categories += self->category[self->categories] != NULL;
    }
    return OK;
}

/* Where the FMU lies */

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

/* Life */

int judged(const Instance *self, int done)
{
    return done && self->worst < DISCARD ? OK : ERROR;
}

Instance *begun(void *component)
{
    Instance *const self = component;
    if (self == NULL || !slave_callable()) /* no message: the host's logger may be a function of Python, too */
        return NULL;
    self->worst = OK;
    return self;
}

static void free_parts(Instance *self)
{
    forget_categories(self);
    free(self->resources);
    free(self->name);
    free(self);
}

Instance *ready(Instance *self, const char *name, const char *attribute, const char *guid, const char *resources)
{
    int made = 0;
    self->name = strdup(name != NULL ? name : "");
    self->resources = resource_folder(resources);
    self->logging = 1; /* there are no debug messages; errors and discards are logged until the host turns them off */
    self->slave = (Slave){NULL, NULL, heard, self};
    if (self->name == NULL || *self->name == '\0')
        refused(self, "An instance needs a name that is not empty.");
    else if (!self->for_co_simulation)
        refused(self, "The FMU is for co-simulation only.");
    else if (guid == NULL || other_guid(attribute, guid))
        refused(self, "The %s is not that of the FMU's model description.",
                strncmp(attribute, "guid", 4) == 0 ? "GUID" : "instantiation token");
    else if (self->resources == NULL)
        refused(self, "The folder of the FMU's resources is not known.");
    else
        made = slave_make(&self->slave, self->name, self->resources, self->visible);
    if (made)
        return self;
    free_parts(self);
    return NULL;
}

void free_instance(void *component)
{
    Instance *const self = component;
    if (self == NULL)
        return;
    while (self->states != NULL)
        free_state(self, self->states);
    slave_free(&self->slave);
    free_parts(self);
}

int set_up(Instance *self, double start)
{
    const int status = judged(self, slave_setup(&self->slave, start));
    if (status == OK)
        self->last = start;
    return status;
}

int called(void *component, const char *method)
{
    Instance *const self = begun(component);
    return self == NULL ? ERROR : judged(self, slave_call(&self->slave, method));
}

int reset(void *component)
{
    Instance *const self = begun(component);
    if (self == NULL)
        return ERROR;
    Slave fresh = {NULL, NULL, heard, self};
    if (!slave_make(&fresh, self->name, self->resources, self->visible))
        return ERROR;
    slave_free(&self->slave);
    self->slave = fresh;
    self->discarded = 0;
    self->last = 0.0;
    return judged(self, 1);
}

/* Values and steps */

int moved(void *component, Kind kind, const unsigned *references, size_t count, const void *given, void *taken,
          size_t size, int whole)
{
    Instance *const self = begun(component);
    if (self == NULL)
        return ERROR;
    if (count == 0)
        return OK;
    if (references == NULL || (given == NULL && taken == NULL))
        return refused(self, "There are no value references or no values at a null pointer.");
    for (size_t i = 0; kind == STRING && taken != NULL && i < count; ++i)
        ((const char **)taken)[i] = "";
    if (kind == STRING)
        return refused(self, "There are no String variables.");
    return judged(self, taken != NULL ? slave_take(&self->slave, kind, references, count, taken, size, whole)
                                      : slave_put(&self->slave, kind, references, count, given, size, whole));
}

int stepped(void *component, double time, double step)
{
    Instance *const self = begun(component);
    int done = 0;
    if (self == NULL)
        return ERROR;
    if (!slave_step(&self->slave, time, step, &done))
        return ERROR;
    self->discarded = !done;
    self->last = done ? time + step : time;
    return done ? OK : DISCARD;
}
