/* The FMU states of an instance. What the importer holds is an entry of a list, so that an invalid one is recognised. */

#include "instance.h"

#include <stdlib.h>
#include <string.h>

void remove_state(Instance *self, FmuState *state)
{
    FmuState **link = &self->states;
    while (*link != state)
        link = &(*link)->next;
    *link = state->next;
    slave_release_object(state->serialized);
    slave_release_object(state->object);
    free(state);
}

static FmuState *find_state(Instance *self, const void *state)
{
    FmuState *entry = self->states;
    while (entry != NULL && entry != state)
        entry = entry->next;
    if (entry == NULL)
        log_error(self, "The state is not one of this instance, or was freed.");
    return entry;
}

/* Adds a state to the list and returns it in `state`; one that it replaces there is freed. */
static int store_state(Instance *self, void *object, void **state)
{
    FmuState *const entry = malloc(sizeof *entry);
    if (entry == NULL) {
        slave_release_object(object);
        return log_error(self, "Out of memory.");
    }
    for (FmuState *old = self->states; old != NULL; old = old->next)
        if (old == *state) {
            remove_state(self, old);
            break;
        }
    *entry = (FmuState){object, NULL, self->states};
    self->states = entry;
    *state = entry;
    return call_status(self, 1);
}

int get_fmu_state(void *component, void **state)
{
    Instance *const self = begin_call(component);
    void *object = NULL;
    if (self == NULL)
        return ERROR;
    if (state == NULL)
        return log_error(self, "There is no place for a state at a null pointer.");
    return slave_get_state(&self->slave, &object) ? store_state(self, object, state) : ERROR;
}

int set_fmu_state(void *component, void *state)
{
    Instance *const self = begin_call(component);
    FmuState *const entry = self != NULL ? find_state(self, state) : NULL;
    if (entry == NULL)
        return ERROR;
    self->step_failed = 0;
    return call_status(self, slave_set_state(&self->slave, entry->object));
}

int free_fmu_state(void *component, void **state)
{
    Instance *const self = begin_call(component);
    if (self == NULL)
        return ERROR;
    if (state == NULL || *state == NULL) /* by the standard nothing to free */
        return OK;
    FmuState *const entry = find_state(self, *state);
    if (entry == NULL)
        return ERROR;
    remove_state(self, entry);
    *state = NULL;
    return OK;
}

/* The bytes of a state, serialized once until they are copied; NULL if that fails. */
static const char *serialized_bytes(Instance *self, FmuState *entry, size_t *size)
{
    if (entry->serialized == NULL && !slave_serialize(&self->slave, entry->object, &entry->serialized))
        return NULL;
    return slave_bytes_content(entry->serialized, size);
}

int serialized_state_size(void *component, void *state, size_t *size)
{
    Instance *const self = begin_call(component);
    FmuState *const entry = self != NULL ? find_state(self, state) : NULL;
    if (entry == NULL)
        return ERROR;
    if (size == NULL)
        return log_error(self, "There is no place for a size at a null pointer.");
    return call_status(self, serialized_bytes(self, entry, size) != NULL);
}

int serialize_fmu_state(void *component, void *state, char bytes[], size_t size)
{
    Instance *const self = begin_call(component);
    FmuState *const entry = self != NULL ? find_state(self, state) : NULL;
    size_t needed = 0;
    if (entry == NULL)
        return ERROR;
    const char *const content = serialized_bytes(self, entry, &needed);
    if (content == NULL)
        return ERROR;
    if (bytes == NULL || size < needed)
        return log_error(self, "The state takes %zu bytes, and %zu were given.", needed, bytes == NULL ? 0 : size);
    memcpy(bytes, content, needed);
    slave_release_object(entry->serialized);
    entry->serialized = NULL;
    return call_status(self, 1);
}

int deserialize_fmu_state(void *component, const char bytes[], size_t size, void **state)
{
    Instance *const self = begin_call(component);
    void *object = NULL;
    if (self == NULL)
        return ERROR;
    if (bytes == NULL || state == NULL)
        return log_error(self, "There are no bytes, or no place for a state, at a null pointer.");
    return slave_deserialize(&self->slave, bytes, size, &object) ? store_state(self, object, state) : ERROR;
}
