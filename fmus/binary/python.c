/* Python for an importer that has none: finds an interpreter that has numpy and scipy, opens its library for the whole
   process, and starts it.

   The binary of PythonFMU and the extension modules of numpy link no libpython: they expect its symbols in the process.
   An importer in Python has them. Any other would have to be started with LD_PRELOAD, were it not for this. */

#define _GNU_SOURCE /* RTLD_DEFAULT, pipe2, flock */

#include "slave.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <wchar.h>

#define PYTHON_VARIABLE "KITECOSIM_PYTHON" /* names the interpreter to use */
#define LIMIT_VARIABLE "KITECOSIM_PYTHON_SECONDS" /* how long it may take to answer */
#define LIMIT 60.0                         /* s, for a first start from a slow disk */
#define RESPONSE_SIZE 65536                /* bytes, more than the longest response: a search path */

extern char **environ;

/* Program for an interpreter. It prints the file of its library, its own path, and its search path, a line each; or what it
   lacks, after an exclamation mark. */
static const char QUERY[] =
    "import sys\n"
    "sys.path = [p for p in sys.path if p]\n" /* not the importer's working directory */
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

static void write_message(char *text, size_t size, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, size, format, arguments);
    va_end(arguments);
}

static double seconds_now(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double time_limit(void)
{
    const char *const given = getenv(LIMIT_VARIABLE);
    const double limit = given != NULL ? strtod(given, NULL) : 0.0;
    return limit > 0.0 && limit < 1e6 ? limit : LIMIT;
}

/* Whether there is something to read before the time is up. */
static int is_readable(int file, double end)
{
    struct pollfd waited = {file, POLLIN, 0};
    for (;;) {
        const double left = end - seconds_now();
        const int found = left > 0.0 ? poll(&waited, 1, (int)(1e3 * left) + 1) : 0;
        if (found >= 0 || errno != EINTR)
            return found > 0;
    }
}

/* Waits for the end of a child, which is killed when the time is up. Returns whether it ended by itself. */
static int has_ended(pid_t child, double end)
{
    const struct timespec pause = {0, 10000000}; /* 10 ms */
    pid_t found;
    while ((found = waitpid(child, NULL, WNOHANG)) == 0 || (found < 0 && errno == EINTR)) {
        if (seconds_now() > end) {
            kill(child, SIGKILL);
            while (waitpid(child, NULL, 0) < 0 && errno == EINTR)
                ;
            return 0;
        }
        nanosleep(&pause, NULL);
    }
    return 1; /* its status is of no use: an importer that ignores SIGCHLD gets none */
}

/* Runs `python -c QUERY`; its output, without the last end of line, is the `response`. Returns 0 if it cannot be run, and
   -1 if the time is up before it ends. */
static int query_interpreter(const char *python, char *response)
{
    char *const arguments[] = {(char *)python, "-c", (char *)QUERY, NULL};
    posix_spawn_file_actions_t actions;
    int ends[2];
    const double end = seconds_now() + time_limit();
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
    while (spawned == 0 && length < RESPONSE_SIZE - 1 && is_readable(ends[0], end) &&
           ((count = read(ends[0], response + length, RESPONSE_SIZE - 1 - length)) > 0 || (count < 0 && errno == EINTR)))
        length += count > 0 ? (size_t)count : 0;
    close(ends[0]);
    if (spawned != 0)
        return 0;
    if (!has_ended(child, end))
        return -1;
    while (length > 0 && (response[length - 1] == '\n' || response[length - 1] == '\r'))
        --length;
    response[length] = '\0';
    return length > 0;
}

/* Opens the library, or takes the one that the process has where it is NULL, and starts the interpreter as that program,
   so that it finds its own packages; NULL is as the environment has it. `paths` are lines. */
static int initialize_python(const char *library, const char *program, char *paths, char *reason, size_t size)
{
    void *const handle = dlopen(library, RTLD_NOW | RTLD_GLOBAL);
    if (handle == NULL) {
        write_message(reason, size, "Python's library cannot be opened: %s.", dlerror());
        return 0;
    }
    int (*const is_initialized)(void) = (int (*)(void))dlsym(handle, "Py_IsInitialized");
    void (*const initialize)(int) = (void (*)(int))dlsym(handle, "Py_InitializeEx");
    wchar_t *(*const decode_locale)(const char *, size_t *) =
        (wchar_t * (*)(const char *, size_t *)) dlsym(handle, "Py_DecodeLocale");
    void (*const set_program_name)(const wchar_t *) = (void (*)(const wchar_t *))dlsym(handle, "Py_SetProgramName");
    int (*const run_string)(const char *) = (int (*)(const char *))dlsym(handle, "PyRun_SimpleString");
    void *(*const save_thread)(void) = (void *(*)(void))dlsym(handle, "PyEval_SaveThread");
    if (!is_initialized || !initialize || !decode_locale || !run_string || !save_thread) {
        write_message(reason, size, "%s is not a Python library.",
                      library != NULL ? library : "What has Python's symbols in this process");
        return 0;
    }
    if (is_initialized()) /* by another library, which opened it with RTLD_LOCAL */
        return 1;
    if (set_program_name != NULL && program != NULL) { /* not in later versions, for which the paths below do */
        wchar_t *const wide = decode_locale(program, NULL);
        if (wide != NULL)
            set_program_name(wide); /* kept by Python */
    }
    initialize(0); /* without signal handlers, which are the importer's */
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
        run_string(text);
        free(text);
    }
    save_thread(); /* any thread may call from now on. Python is never finalized: numpy and scipy do not survive that */
    return 1;
}

/* Excludes the other threads of the process, also those in the binaries of other FMUs, until `release_lock`. The lock of a
   file belongs to the open file, not to the process; the file is one that only this process locks. Where it cannot be
   locked, only this FMU is protected. */
static int acquire_lock(void)
{
    pthread_mutex_lock(&lock);
    const int file = open("/proc/self/stat", O_RDONLY | O_CLOEXEC);
    while (file >= 0 && flock(file, LOCK_EX) != 0 && errno == EINTR)
        ;
    return file;
}

static void release_lock(int file)
{
    if (file >= 0)
        close(file);
    pthread_mutex_unlock(&lock);
}

/* Starts the first of the `candidates` that is usable. */
static int start_first_usable(const char *const *candidates, char *reason, size_t size)
{
    char *const response = malloc(RESPONSE_SIZE);
    int done = 0, failed = 0;

    if (response == NULL) {
        write_message(reason, size, "Out of memory.");
        return 0;
    }
    write_message(reason, size, "No Python was found for the FMU:");
    for (; !done && !failed && *candidates != NULL; ++candidates) {
        const size_t length = strlen(reason);
        const int answered = query_interpreter(*candidates, response);
        if (answered < 0) {
            write_message(reason + length, size - length, " %s gives no answer within %g s (%s);", *candidates,
                          time_limit(), LIMIT_VARIABLE);
        } else if (answered == 0) {
            const char *const home = getenv("PYTHONHOME"); /* that of another Python keeps this one from starting */
            write_message(reason + length, size - length, " %s cannot be run%s%s;", *candidates,
                          home != NULL ? " with PYTHONHOME=" : "", home != NULL ? home : "");
        } else if (*response == '!') {
            write_message(reason + length, size - length, " %s %s;", *candidates, response + 1);
        } else {
            char *const program = strchr(response, '\n');
            char *const paths = program != NULL ? strchr(program + 1, '\n') : NULL;
            if (paths == NULL) {
                write_message(reason + length, size - length, " %s gives no answer;", *candidates);
                continue;
            }
            *program = *paths = '\0';
            done = initialize_python(response, program + 1, paths + 1, reason, size);
            failed = !done;
        }
    }
    if (!done && !failed) {
        const size_t length = strlen(reason);
        write_message(reason + length, size - length,
                      " set %s to a Python 3.11 or newer with numpy, scipy and a shared library (see `kitecosim host-env`).",
                      PYTHON_VARIABLE);
    }
    free(response);
    return done;
}

int start_python(char *reason, size_t size)
{
    static const char *const default_candidates[] = {"python3", "python", NULL};
    const char *const chosen[] = {getenv(PYTHON_VARIABLE), NULL};
    const int is_chosen = chosen[0] != NULL && *chosen[0] != '\0';
    char none[] = "";
    const int file = acquire_lock();
    const int loaded = dlsym(RTLD_DEFAULT, "Py_IsInitialized") != NULL; /* an importer in Python, or with its library */
    const int done = loaded ? initialize_python(NULL, NULL, none, reason, size)
                            : start_first_usable(is_chosen ? chosen : default_candidates, reason, size);
    release_lock(file);
    return done;
}
