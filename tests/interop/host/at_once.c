/* Both FMUs of a pair are loaded, made, stepped and freed in two threads at once: neither may be there before the other.

   Arguments: binary, GUID and resources of each. Prints "done" if all went well. */

#include <dlfcn.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>

#include "host.h"

static void say(void *environment, const char *instance, int status, const char *category, const char *message, ...)
{
    va_list arguments;
    (void)environment, (void)category;
    va_start(arguments, message);
    fprintf(stderr, "%s %d ", instance, status);
    vfprintf(stderr, message, arguments);
    fputs("\n", stderr);
    va_end(arguments);
}

/* A function of a library: ISO C has no way from an object pointer to a function pointer but by its bytes. */
#define FIND(library, function, name) (*(void **)&(function) = dlsym(library, name))

static void *whole_life(void *given)
{
    static const Callbacks callbacks = {say, NULL, NULL, NULL, NULL};
    char **const arguments = given;
    void *const library = dlopen(arguments[0], RTLD_NOW | RTLD_LOCAL);
    Functions f;
    int worst = 0;

    if (library == NULL)
        return NULL;
    FIND(library, f.instantiate, "fmi2Instantiate");
    FIND(library, f.enter, "fmi2EnterInitializationMode");
    FIND(library, f.leave, "fmi2ExitInitializationMode");
    FIND(library, f.step, "fmi2DoStep");
    FIND(library, f.terminate, "fmi2Terminate");
    FIND(library, f.free_instance, "fmi2FreeInstance");
    void *const fmu = f.instantiate("fmu", 1, arguments[1], arguments[2], &callbacks, 0, 0);
    if (fmu == NULL)
        return NULL;
    worst |= f.enter(fmu) | f.leave(fmu);
    for (int k = 0; k < 3; ++k)
        worst |= f.step(fmu, k, 1.0, 0);
    worst |= f.terminate(fmu);
    f.free_instance(fmu);
    dlclose(library);
    return worst == 0 ? given : NULL;
}

int main(int count, char **arguments)
{
    pthread_t threads[2];
    void *ends[2] = {NULL, NULL};

    if (count != 7)
        return 2;
    for (int i = 0; i < 2; ++i)
        pthread_create(&threads[i], NULL, whole_life, arguments + 1 + 3 * i);
    for (int i = 0; i < 2; ++i)
        pthread_join(threads[i], &ends[i]);
    const int done = ends[0] != NULL && ends[1] != NULL;
    puts(done ? "done" : "failed");
    return !done;
}
