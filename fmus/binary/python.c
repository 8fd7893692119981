/* Python for a host that has none: finds an interpreter that has numpy and scipy, opens its library for the whole
   process, and starts it.

   The binary of PythonFMU and the extension modules of numpy link no libpython: they expect its symbols in the process.
   A host that is Python has them. Any other would have to be started with LD_PRELOAD, were it not for this. */

#define _GNU_SOURCE /* RTLD_DEFAULT, pipe2, flock */

#include "slave.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>
#include <wchar.h>

#define VARIABLE "KITECOSIM_PYTHON" /* names the interpreter to take */
#define ANSWER 65536                /* bytes, more than the longest answer: a search path */

extern char **environ;

/* Asked of an interpreter: the file of its library, its own path, and its search path, a line each; or what it lacks,
   after an exclamation mark. */
static const char QUESTION[] =
    "import sys\n"
    "sys.path = [p for p in sys.path if p]\n" /* not the host's working directory */
    "import importlib.util, os, sysconfig\n"
    "lacks = [m for m in ('numpy', 'scipy') if importlib.util.find_spec(m) is None]\n"
    "get = sysconfig.get_config_var\n"
    "name = get('INSTSONAME') or get('LDLIBRARY') or ''\n"
    "home = get('LIBDIR') or ''\n"
    "places = [home, os.path.join(home, get('MULTIARCH') or ''), os.path.join(sys.base_prefix, 'lib')]\n"
    "found = [p for p in (os.path.join(d, name) for d in places) if '.so' in name and os.path.isfile(p)]\n"
    "if sys.version_info < (3, 11): print('!is Python %d.%d, and 3.11 is the oldest that will do' % sys.version_info[:2])\n"
    "elif lacks: print('!has no ' + ' and no '.join(lacks))\n"
    "elif not found: print('!has no shared library (libpython%d.%d.so)' % sys.version_info[:2])\n"
    "else: sys.stdout.buffer.write(b'\\n'.join(map(os.fsencode, [found[0], sys.executable] + sys.path)))\n";

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static void say(char *why, size_t size, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(why, size, format, arguments);
    va_end(arguments);
}

/* Runs `python -c QUESTION`; its output, without the last end of line, in `answer`. Returns 0 where it cannot be run. */
static int ask(const char *python, char *answer)
{
    char *const arguments[] = {(char *)python, "-c", (char *)QUESTION, NULL};
    posix_spawn_file_actions_t actions;
    int ends[2], status = -1;
    size_t length = 0;
    ssize_t count;
    pid_t child;

    if (pipe2(ends, O_CLOEXEC) != 0)
        return 0;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&actions, ends[1], 1);
    posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", O_WRONLY, 0);
    const int spawned = posix_spawnp(&child, python, &actions, NULL, arguments, environ);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    while (spawned == 0 && length < ANSWER - 1 &&
           ((count = read(ends[0], answer + length, ANSWER - 1 - length)) > 0 || (count < 0 && errno == EINTR)))
        length += count > 0 ? (size_t)count : 0;
    close(ends[0]);
    if (spawned != 0)
        return 0;
    while (waitpid(child, &status, 0) < 0 && errno == EINTR)
        ;
    while (length > 0 && (answer[length - 1] == '\n' || answer[length - 1] == '\r'))
        --length;
    answer[length] = '\0';
    return length > 0; /* the status is of no use: a host that ignores SIGCHLD gets none */
}

/* Opens the library, or takes the one that the process has where it is NULL, and starts the interpreter as that program,
   so that it finds its own packages; NULL is as the environment has it. `paths` are lines. */
static int start(const char *library, const char *program, char *paths, char *why, size_t size)
{
    void *const opened = dlopen(library, RTLD_NOW | RTLD_GLOBAL);
    if (opened == NULL) {
        say(why, size, "Python's library cannot be opened: %s.", dlerror());
        return 0;
    }
    int (*const running)(void) = (int (*)(void))dlsym(opened, "Py_IsInitialized");
    void (*const initialise)(int) = (void (*)(int))dlsym(opened, "Py_InitializeEx");
    wchar_t *(*const decode)(const char *, size_t *) =
        (wchar_t * (*)(const char *, size_t *)) dlsym(opened, "Py_DecodeLocale");
    void (*const name)(const wchar_t *) = (void (*)(const wchar_t *))dlsym(opened, "Py_SetProgramName");
    int (*const run)(const char *) = (int (*)(const char *))dlsym(opened, "PyRun_SimpleString");
    void *(*const release)(void) = (void *(*)(void))dlsym(opened, "PyEval_SaveThread");
    if (!running || !initialise || !decode || !run || !release) {
        say(why, size, "%s is not a Python library.", library != NULL ? library : "What has Python's symbols in this process");
        return 0;
    }
    if (running()) /* by somebody who had opened it for himself alone */
        return 1;
    if (name != NULL && program != NULL) { /* gone in later versions; then the paths below do */
        wchar_t *const wide = decode(program, NULL);
        if (wide != NULL)
            name(wide); /* kept by Python */
    }
    initialise(0); /* the host keeps its signal handlers */
    char *rest = NULL;
    for (char *path = strtok_r(paths, "\n", &rest); path != NULL; path = strtok_r(NULL, "\n", &rest)) {
        /* hexadecimal, so that no character of a path means anything to Python */
        char *const text = malloc(2 * strlen(path) + 200);
        if (text == NULL)
            break;
        int at = sprintf(text, "import sys, os\np = os.fsdecode(bytes.fromhex('");
        for (const unsigned char *c = (const unsigned char *)path; *c; ++c)
            at += sprintf(text + at, "%02x", *c);
        sprintf(text + at, "'))\np in sys.path or sys.path.append(p)\ndel p\n");
        run(text);
        free(text);
    }
    release(); /* any thread may call from now on. It is never finalised: numpy and scipy do not survive that */
    return 1;
}

/* Shuts out the other threads of the process, those in the binaries of other FMUs too, and opens again by `unlock`. The
   lock of a file belongs to the opening, not to the process; the file is one that only this process locks. Where it
   cannot be had, only this FMU is guarded. */
static int locked(void)
{
    pthread_mutex_lock(&lock);
    const int file = open("/proc/self/stat", O_RDONLY | O_CLOEXEC);
    while (file >= 0 && flock(file, LOCK_EX) != 0 && errno == EINTR)
        ;
    return file;
}

static void unlock(int file)
{
    if (file >= 0)
        close(file);
    pthread_mutex_unlock(&lock);
}

/* Starts the first of `candidates` that will do. */
static int found(const char *const *candidates, char *why, size_t size)
{
    char *const answer = malloc(ANSWER);
    int done = 0, failed = 0;

    if (answer == NULL) {
        say(why, size, "Out of memory.");
        return 0;
    }
    say(why, size, "No Python was found for the FMU:");
    for (; !done && !failed && *candidates != NULL; ++candidates) {
        const size_t length = strlen(why);
        if (!ask(*candidates, answer)) {
            const char *const home = getenv("PYTHONHOME"); /* of another Python, it stops this one */
            say(why + length, size - length, " %s cannot be run%s%s;", *candidates, home != NULL ? " with PYTHONHOME=" : "",
                home != NULL ? home : "");
        } else if (*answer == '!') {
            say(why + length, size - length, " %s %s;", *candidates, answer + 1);
        } else {
            char *const program = strchr(answer, '\n');
            char *const paths = program != NULL ? strchr(program + 1, '\n') : NULL;
            if (paths == NULL) {
                say(why + length, size - length, " %s gives no answer;", *candidates);
                continue;
            }
            *program = *paths = '\0';
            done = start(answer, program + 1, paths + 1, why, size);
            failed = !done;
        }
    }
    if (!done && !failed) {
        const size_t length = strlen(why);
        say(why + length, size - length,
            " set %s to a Python 3.11 or newer with numpy, scipy and a shared library (see `kitecosim host-env`).",
            VARIABLE);
    }
    free(answer);
    return done;
}

int start_python(char *why, size_t size)
{
    static const char *const usual[] = {"python3", "python", NULL};
    const char *const chosen[] = {getenv(VARIABLE), NULL};
    char none[] = "";
    const int file = locked();
    const int there = dlsym(RTLD_DEFAULT, "Py_IsInitialized") != NULL; /* a host that is Python, or was given its library */
    const int done = there ? start(NULL, NULL, none, why, size)
                           : found(chosen[0] != NULL && *chosen[0] != '\0' ? chosen : usual, why, size);
    unlock(file);
    return done;
}
