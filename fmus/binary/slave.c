/* Calls of a slave object of Python (fmus/adapter.py). Values pass as memory of the host, not as lists of objects.

   The functions of Python are looked up in the process, as no library of Python is linked: which one it is shows only
   when the FMU is instantiated. Those used here belong to Python's stable interface; objects are void pointers. */

#define _GNU_SOURCE /* RTLD_DEFAULT */

#include "slave.h"

#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>

enum { READ = 0x100, WRITE = 0x200, FILE_INPUT = 257 }; /* PyBUF_READ, PyBUF_WRITE, Py_file_input */
enum { STATUS_ERROR = 3 };

static struct {
    int (*ensure)(void);
    void (*leave)(int);
    void *(*call)(void *, const char *, const char *, ...);
    void *(*attribute)(void *, const char *);
    void *(*build)(const char *, ...);
    void *(*compile)(const char *, const char *, int);
    void *(*evaluate)(void *, void *, void *);
    void *(*item)(void *, const char *);
    void *(*memory)(char *, long, int);
    void *(*list_item)(void *, long);
    long (*list_size)(void *);
    void *(*tuple_item)(void *, long);
    long (*integer)(void *);
    const char *(*text)(void *, long *);
    int (*bytes)(void *, char **, long *);
    int (*truth)(void *);
    void *(*pause)(void);
    void (*resume)(void *);
    void *(*thread)(void);
    void (*fetch)(void **, void **, void **);
    void (*restore)(void *, void *, void *);
    void (*normalise)(void **, void **, void **);
    void (*clear)(void);
    void *(*string)(void *);
    void (*release)(void *);
    int (*running)(void);
} py;

/* In the order of the functions above. */
static const char *const NAMES[] = {
    "PyGILState_Ensure", "PyGILState_Release", "PyObject_CallMethod", "PyObject_GetAttrString", "Py_BuildValue",
    "Py_CompileString", "PyEval_EvalCode", "PyDict_GetItemString", "PyMemoryView_FromMemory", "PyList_GetItem",
    "PyList_Size", "PyTuple_GetItem", "PyLong_AsLong", "PyUnicode_AsUTF8AndSize", "PyBytes_AsStringAndSize",
    "PyObject_IsTrue", "PyEval_SaveThread", "PyEval_RestoreThread", "PyGILState_GetThisThreadState", "PyErr_Fetch",
    "PyErr_Restore", "PyErr_NormalizeException", "PyErr_Clear", "PyObject_Str", "Py_DecRef", "Py_IsInitialized"};

_Static_assert(sizeof py / sizeof(void *) == sizeof NAMES / sizeof *NAMES, "every function of Python has its name");

/* Makes the slave of an FMU whose folder of resources need not be in Python's search path. */
static const char MAKE[] =
    "import sys\n"
    "sys.path.insert(0, resources)\n"
    "try:\n"
    "    with open(resources + '/slavemodule.txt', encoding='utf-8') as file:\n"
    "        module = __import__(file.read().strip())\n"
    "    if hasattr(module, 'slave_class'):\n"
    "        slaves = [module.slave_class(resources)]\n"
    "    else:\n"
    "        own = [v for v in vars(module).values() if isinstance(v, type) and v.__module__ == module.__name__]\n"
    "        slaves = [v for v in own if hasattr(v, 'do_step')]\n"
    "    if not slaves:\n"
    "        raise ValueError(module.__name__ + '.py has no class with a method do_step.')\n"
    "    made = slaves[-1](instance_name=name, resources=resources, visible=bool(visible))\n"
    "finally:\n"
    "    if resources in sys.path:\n"
    "        sys.path.remove(resources)\n";

static const char *const KINDS[] = {"real", "integer", "boolean", "string"};
static const size_t SIZES[] = {sizeof(double), sizeof(int), sizeof(int), 0};

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static int looked_up(char *why, size_t size)
{
    int done = 1;
    pthread_mutex_lock(&lock);
    for (size_t i = 0; done && py.running == NULL && i < sizeof NAMES / sizeof *NAMES; ++i) { /* that is the last */
        void *const found = dlsym(RTLD_DEFAULT, NAMES[i]);
        memcpy((char *)&py + i * sizeof found, &found, sizeof found);
        done = found != NULL;
        if (!done)
            snprintf(why, size, "The Python of this process has no %s.", NAMES[i]);
    }
    pthread_mutex_unlock(&lock);
    return done;
}

/* Messages */

/* Length of a text without the last character, if that is cut off within its bytes of UTF-8. */
static size_t whole(const char *text, size_t length)
{
    size_t tail = 0;
    while (tail < 3 && tail < length && (text[length - 1 - tail] & 0xC0) == 0x80)
        ++tail;
    const unsigned char first = tail < length ? (unsigned char)text[length - 1 - tail] : 0;
    const size_t wanted = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : first >= 0xC0 ? 2 : 1;
    return tail + 1 < wanted ? length - 1 - tail : length;
}

/* Says a sentence of this file, of Python's start or of an exception; a long one is cut. */
static void say(Slave *slave, const char *text)
{
    char doubled[2000];
    size_t at = 0;
    for (; *text != '\0' && at < sizeof doubled - 2; ++text) {
        doubled[at++] = *text == '\n' ? ' ' : *text;
        if (*text == '%')
            doubled[at++] = '%';
    }
    doubled[whole(doubled, at)] = '\0';
    slave->hear(slave->environment, STATUS_ERROR, "logStatusError", doubled);
}

/* Hands a message on. The host may lock something of its own meanwhile that another thread holds while it waits for
   Python: so Python is let go. */
static void hear(Slave *slave, int status, const char *category, const char *text)
{
    void *const thread = py.pause();
    slave->hear(slave->environment, status, category, text);
    py.resume(thread);
}

/* Tells what Python has raised, and forgets it. */
static void say_raised(Slave *slave)
{
    void *type = NULL, *value = NULL, *trace = NULL;
    py.fetch(&type, &value, &trace);
    py.normalise(&type, &value, &trace);
    void *const kind = type != NULL ? py.attribute(type, "__name__") : NULL;
    void *const words = value != NULL ? py.string(value) : NULL;
    const char *const first = kind != NULL ? py.text(kind, NULL) : NULL;
    const char *const rest = words != NULL ? py.text(words, NULL) : NULL;
    char text[1000];
    snprintf(text, sizeof text, "%s: %s", first != NULL ? first : "Python", rest != NULL ? rest : "an error without words");
    py.clear();
    py.release(kind); /* a null pointer is taken */
    py.release(words);
    py.release(type);
    py.release(value);
    py.release(trace);
    void *const thread = py.pause(); /* as in hear() */
    say(slave, text);
    py.resume(thread);
}

/* Hands on what the slave has logged meanwhile, in its order, and empties its list. No exception may be set. */
static void hear_messages(Slave *slave)
{
    if (py.list_size(slave->queue) < 1)
        return;
    void *const messages = py.call(slave->object, "drained", NULL);
    for (long i = 0; messages != NULL && i < py.list_size(messages); ++i) {
        void *const message = py.list_item(messages, i); /* its texts last as long as the list */
        const char *const category = py.text(py.tuple_item(message, 1), NULL);
        const char *const text = py.text(py.tuple_item(message, 2), NULL);
        if (category != NULL && text != NULL)
            hear(slave, (int)py.integer(py.tuple_item(message, 0)), category, text);
        else
            py.clear();
    }
    if (messages == NULL)
        say_raised(slave);
    py.release(messages);
}

/* Ends a call that has given `result`, which is released unless `kept` takes it. */
static int ended(Slave *slave, void *result, void **kept, int gil)
{
    void *type = NULL, *value = NULL, *trace = NULL;
    py.fetch(&type, &value, &trace); /* what was logged comes before what was raised then */
    hear_messages(slave);
    const int raised = result == NULL || type != NULL;
    if (raised) {
        py.restore(type, value, trace);
        say_raised(slave);
    }
    if (!raised && kept != NULL)
        *kept = result;
    else
        py.release(result);
    py.leave(gil);
    return !raised;
}

/* Life */

int slave_make(Slave *slave, const char *name, const char *resources, int visible)
{
    char why[2000] = "";
    if (!start_python(why, sizeof why) || !looked_up(why, sizeof why)) {
        say(slave, why);
        return 0;
    }
    const int gil = py.ensure();
    void *const scope = py.build("{s:s,s:s,s:i}", "resources", resources, "name", name, "visible", visible);
    void *const code = scope != NULL ? py.compile(MAKE, "kitecosim", FILE_INPUT) : NULL;
    void *const done = code != NULL ? py.evaluate(code, scope, scope) : NULL;
    if (done != NULL)
        slave->object = py.build("O", py.item(scope, "made")); /* a reference of its own */
    if (slave->object != NULL)
        slave->queue = py.attribute(slave->object, "log_queue");
    if (slave->queue == NULL) {
        say_raised(slave);
        py.release(slave->object);
        slave->object = NULL;
    } else {
        hear_messages(slave);
    }
    py.release(done);
    py.release(code);
    py.release(scope);
    py.leave(gil);
    return slave->object != NULL;
}

int slave_callable(void)
{
    return py.running() || py.thread() != NULL;
}

void slave_free(Slave *slave)
{
    if (!py.running()) /* a host that is Python has ended, and with it the object */
        return;
    const int gil = py.ensure();
    py.release(slave->queue);
    py.release(slave->object);
    slave->queue = slave->object = NULL;
    py.leave(gil);
}

int slave_call(Slave *slave, const char *method)
{
    const int gil = py.ensure();
    return ended(slave, py.call(slave->object, method, NULL), NULL, gil);
}

int slave_setup(Slave *slave, double start)
{
    const int gil = py.ensure();
    return ended(slave, py.call(slave->object, "setup_experiment", "(d)", start), NULL, gil);
}

/* Values */

static int passed(Slave *slave, const char *method, Kind kind, const unsigned *references, size_t count, void *values,
                 size_t size, int whole, int flag)
{
    const int gil = py.ensure();
    void *const places = py.memory((char *)references, (long)(count * sizeof *references), READ);
    void *const content = places != NULL ? py.memory(values, (long)(size * SIZES[kind]), flag) : NULL;
    void *const done =
        content != NULL ? py.call(slave->object, method, "(sOOi)", KINDS[kind], places, content, whole) : NULL;
    py.release(places);
    py.release(content);
    return ended(slave, done, NULL, gil);
}

int slave_put(Slave *slave, Kind kind, const unsigned *references, size_t count, const void *values, size_t size,
              int whole)
{
    return passed(slave, "put", kind, references, count, (void *)values, size, whole, READ);
}

int slave_take(Slave *slave, Kind kind, const unsigned *references, size_t count, void *values, size_t size, int whole)
{
    return passed(slave, "take", kind, references, count, values, size, whole, WRITE);
}

int slave_step(Slave *slave, double time, double step, int *done)
{
    const int gil = py.ensure();
    void *const result = py.call(slave->object, "do_step", "(dd)", time, step);
    *done = result != NULL && py.truth(result) == 1;
    return ended(slave, result, NULL, gil);
}

/* States */

int slave_state(Slave *slave, void **state)
{
    const int gil = py.ensure();
    return ended(slave, py.call(slave->object, "_get_fmu_state", NULL), state, gil);
}

int slave_restore(Slave *slave, void *state)
{
    const int gil = py.ensure();
    return ended(slave, py.call(slave->object, "_set_fmu_state", "(O)", state), NULL, gil);
}

int slave_serialise(Slave *slave, void *state, void **bytes)
{
    const int gil = py.ensure();
    return ended(slave, py.call(slave->object, "_fmu_state_to_bytes", "(O)", state), bytes, gil);
}

int slave_read(Slave *slave, const char *bytes, size_t size, void **state)
{
    const int gil = py.ensure();
    void *const content = py.memory((char *)bytes, (long)size, READ);
    void *const result =
        content != NULL ? py.call(slave->object, "_fmu_state_from_bytes", "(O)", content) : NULL;
    py.release(content);
    return ended(slave, result, state, gil);
}

void slave_release(void *object)
{
    if (object == NULL || !py.running())
        return;
    const int gil = py.ensure();
    py.release(object);
    py.leave(gil);
}

const char *slave_bytes(void *bytes, size_t *size)
{
    const int gil = py.ensure();
    char *content = NULL;
    long length = 0;
    if (py.bytes(bytes, &content, &length) != 0) {
        py.clear();
        content = NULL;
    }
    *size = (size_t)length;
    py.leave(gil);
    return content;
}
