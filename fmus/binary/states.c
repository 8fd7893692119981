/* The states of an instance. What the host holds is an entry of a list, so that what is not one of them is found out. */

#include "instance.h"

#include <stdlib.h>
#include <string.h>

void free_state(Instance *self, State *state)
{
    State **link = &self->states;
    while (*link != state)
        link = &(*link)->next;
    *link = state->next;
    slave_release(state->bytes);
    slave_release(state->content);
    free(state);
}

static State *known(Instance *self, const void *state)
{
    State *entry = self->states;
    while (entry != NULL && entry != state)
        entry = entry->next;
    if (entry == NULL)
        refused(self, "The state is not one of this instance, or was freed.");
    return entry;
}

/* Keeps a state and hands it out; one that was given to be replaced is freed. */
static int kept(Instance *self, void *content, void **state)
{
    State *const entry = malloc(sizeof *entry);
    if (entry == NULL) {
        slave_release(content);
        return refused(self, "Out of memory.");
    }
    for (State *old = self->states; old != NULL; old = old->next)
        if (old == *state) {
            free_state(self, old);
            break;
        }
    *entry = (State){content, NULL, self->states};
    self->states = entry;
    *state = entry;
    return judged(self, 1);
}

int save_state(void *component, void **state)
{
    Instance *const self = begun(component);
    void *content = NULL;
    if (self == NULL)
        return ERROR;
    if (state == NULL)
        return refused(self, "There is no place for a state at a null pointer.");
    return slave_state(&self->slave, &content) ? kept(self, content, state) : ERROR;
}

int restore_state(void *component, void *state)
{
    Instance *const self = begun(component);
    State *const entry = self != NULL ? known(self, state) : NULL;
    if (entry == NULL)
        return ERROR;
    self->discarded = 0;
    return judged(self, slave_restore(&self->slave, entry->content));
}

int give_back_state(void *component, void **state)
{
    Instance *const self = begun(component);
    if (self == NULL)
        return ERROR;
    if (state == NULL || *state == NULL) /* nothing to free, by the standard */
        return OK;
    State *const entry = known(self, *state);
    if (entry == NULL)
        return ERROR;
    free_state(self, entry);
    *state = NULL;
    return OK;
}

/* The serialised form of a state; NULL where there is none. */
static const char *serialised(Instance *self, State *entry, size_t *size)
{
    if (entry->bytes == NULL && !slave_serialise(&self->slave, entry->content, &entry->bytes))
        return NULL;
    return slave_bytes(entry->bytes, size);
}

int state_size(void *component, void *state, size_t *size)
{
    Instance *const self = begun(component);
    State *const entry = self != NULL ? known(self, state) : NULL;
    if (entry == NULL)
        return ERROR;
    if (size == NULL)
        return refused(self, "There is no place for a size at a null pointer.");
    return judged(self, serialised(self, entry, size) != NULL);
}

int serialise_state(void *component, void *state, char bytes[], size_t size)
{
    Instance *const self = begun(component);
    State *const entry = self != NULL ? known(self, state) : NULL;
    size_t needed = 0;
    if (entry == NULL)
        return ERROR;
    const char *const content = serialised(self, entry, &needed);
    if (content == NULL)
        return ERROR;
    if (bytes == NULL || size < needed)
        return refused(self, "The state takes %zu bytes, and %zu were given.", needed, bytes == NULL ? 0 : size);
    memcpy(bytes, content, needed);
    slave_release(entry->bytes);
    entry->bytes = NULL;
    return judged(self, 1);
}

int read_state(void *component, const char bytes[], size_t size, void **state)
{
    Instance *const self = begun(component);
    void *content = NULL;
    if (self == NULL)
        return ERROR;
    if (bytes == NULL || state == NULL)
        return refused(self, "There are no bytes, or no place for a state, at a null pointer.");
    return slave_read(&self->slave, bytes, size, &content) ? kept(self, content, state) : ERROR;
}
