/* The binary that an FMU shows to its host: it stands before that of PythonFMU and makes up for what that one lacks. */

#ifndef KITECOSIM_FRONT_H
#define KITECOSIM_FRONT_H

#include <stddef.h>

/* Makes Python callable in this process, unless it is already, and returns 1. Otherwise returns 0 with one sentence
   in `why`, of at most `size` bytes with its end. */
int front_start_python(char *why, size_t size);

#endif
