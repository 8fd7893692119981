/* Reads what is coupled with what. */

#include "host.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const NAMES[SIDES] = {"aero", "structural"};
Side sides[SIDES];
Scalar watched[MOST], tuned, refusal;
size_t watches;

void fail(const char *what)
{
    fprintf(stderr, "host: %s\n", what);
    exit(2);
}

static int side_of(const char *name)
{
    for (int side = 0; side < SIDES; ++side)
        if (strcmp(name, NAMES[side]) == 0)
            return side;
    fail("a side is aero or structural");
    return 0;
}

static void copy(char *target, size_t size, const char *text)
{
    if (strlen(text) >= size)
        fail("a text of the wiring is too long");
    strcpy(target, text);
}

void read_wiring(const char *path)
{
    char line[8192], kind[20], from[20], to[20], text[4096];
    unsigned first, second;
    double value;
    FILE *const file = fopen(path, "r");
    if (file == NULL)
        fail("the wiring cannot be read");
    while (fgets(line, sizeof line, file) != NULL) {
        if (sscanf(line, "%19s %19s", kind, from) != 2)
            fail("a line of the wiring is not understood");
        Side *const side = &sides[side_of(from)];
        if (strcmp(kind, "binary") == 0 && sscanf(line, "%*s %*s %4095[^\n]", text) == 1) {
            copy(side->binary, sizeof side->binary, text);
        } else if (strcmp(kind, "resources") == 0 && sscanf(line, "%*s %*s %4095[^\n]", text) == 1) {
            copy(side->resources, sizeof side->resources, text);
        } else if (strcmp(kind, "guid") == 0 && sscanf(line, "%*s %*s %4095[^\n]", text) == 1) {
            copy(side->guid, sizeof side->guid, text);
        } else if (strcmp(kind, "connect") == 0 && side->count < MOST &&
                   sscanf(line, "%*s %*s %u %19s %u", &first, to, &second) == 3 && side_of(to) != side_of(from)) {
            side->sent[side->count] = first;
            side->taken[side->count++] = second;
        } else if (strcmp(kind, "watch") == 0 && watches < MOST && sscanf(line, "%*s %*s %u", &first) == 1) {
            watched[watches].side = side_of(from);
            watched[watches++].reference = first;
        } else if (sscanf(line, "%*s %*s %u %lf", &first, &value) == 2 &&
                   (strcmp(kind, "tune") == 0 || strcmp(kind, "refuse") == 0)) {
            Scalar *const scalar = strcmp(kind, "tune") == 0 ? &tuned : &refusal;
            scalar->given = 1;
            scalar->side = side_of(from);
            scalar->reference = first;
            scalar->value = value;
        } else {
            fail("a line of the wiring is not understood");
        }
    }
    fclose(file);
}
