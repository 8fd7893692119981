/* Calls of a slave object of Python (fmus/adapter.py). Values pass as memory of the importer, not as lists of objects.

   The functions of Python are looked up in the process, as no library of Python is linked: which one it is shows only
   when the FMU is instantiated. Those used here belong to Python's stable interface; objects are void pointers. */

#define _GNU_SOURCE /* RTLD_DEFAULT */

#include "slave.h"

#include <dlfcn.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>

enum { READ = 0x100, WRITE = 0x200, FILE_INPUT = 257 }; /* PyBUF_READ, PyBUF_WRITE, Py_file_input */
enum { STATUS_ERROR = 3 };

static struct { /* functions of Python, as in SYMBOLS */
    int (*acquire_gil)(void);
    void (*release_gil)(int);
    void *(*call)(void *, const char *, const char *, ...);
    void *(*get_attribute)(void *, const char *);
    void *(*build)(const char *, ...);
    void *(*compile)(const char *, const char *, int);
    void *(*evaluate)(void *, void *, void *);
    void *(*item)(void *, const char *);
    void *(*memory_view)(char *, long, int);
    void *(*list_item)(void *, long);
    long (*list_size)(void *);
    void *(*tuple_item)(void *, long);
    long (*as_long)(void *);
    const char *(*utf8)(void *, long *);
    int (*bytes_content)(void *, char **, long *);
    int (*is_true)(void *);
    void *(*save_thread)(void);
    void (*restore_thread)(void *);
    void *(*thread_state)(void);
    void (*fetch_error)(void **, void **, void **);
    void (*restore_error)(void *, void *, void *);
    void (*normalize_error)(void **, void **, void **);
    void (*clear_error)(void);
    void *(*str)(void *);
    void (*decref)(void *);
    int (*is_initialized)(void);
} py;

/* Their names, in the same order. */
static const char *const SYMBOLS[] = {
    "PyGILState_Ensure", "PyGILState_Release", "PyObject_CallMethod", "PyObject_GetAttrString", "Py_BuildValue",
    "Py_CompileString", "PyEval_EvalCode", "PyDict_GetItemString", "PyMemoryView_FromMemory", "PyList_GetItem",
    "PyList_Size", "PyTuple_GetItem", "PyLong_AsLong", "PyUnicode_AsUTF8AndSize", "PyBytes_AsStringAndSize",
    "PyObject_IsTrue", "PyEval_SaveThread", "PyEval_RestoreThread", "PyGILState_GetThisThreadState", "PyErr_Fetch",
    "PyErr_Restore", "PyErr_NormalizeException", "PyErr_Clear", "PyObject_Str", "Py_DecRef", "Py_IsInitialized"};

_Static_assert(sizeof py / sizeof(void *) == sizeof SYMBOLS / sizeof *SYMBOLS, "every function of Python has its name");

/* Makes the slave of an FMU whose folder of resources need not be in Python's search path. */
static const char MAKE[] =
    "import sys\n"
    "sys.path.insert(0, resources)\n"
    "try:\n"
    "    with open(resources + '/slavemodule.txt', encoding='utf-8') as file:\n"
    "        stem = file.read().strip()\n"
    "    module = __import__(stem)\n"
    "    with open(resources + '/' + stem + '.py', 'rb') as file:\n"
    "        text = file.read()\n"
    "    if getattr(module, '_text', text) != text:\n" /* that of another FMU, before it was changed in this one */
    "        del sys.modules[stem]\n"
    "        module = __import__(stem)\n"
    "    module._text = text\n"
    "    own = [v for v in vars(module).values() if isinstance(v, type) and v.__module__ == module.__name__]\n"
    "    slaves = [v for v in own if hasattr(v, 'do_step')]\n"
    "    if not slaves:\n"
    "        raise ValueError(module.__name__ + '.py has no class with a method do_step.')\n"
    "    made = slaves[-1](instance_name=name, resources=resources, visible=bool(visible))\n"
    "finally:\n"
    "    if resources in sys.path:\n"
    "        sys.path.remove(resources)\n";

static const char *const KIND_NAMES[] = {"real", "integer", "boolean", "string"};
static const size_t VALUE_SIZES[] = {sizeof(double), sizeof(int), sizeof(int), 0};

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static int resolve_python_api(char *reason, size_t size)
{
    int done = 1;
    pthread_mutex_lock(&lock);
    for (size_t i = 0; done && py.is_initialized == NULL && i < sizeof SYMBOLS / sizeof *SYMBOLS; ++i) { /* the last */
        void *const found = dlsym(RTLD_DEFAULT, SYMBOLS[i]);
        memcpy((char *)&py + i * sizeof found, &found, sizeof found);
        done = found != NULL;
        if (!done)
            snprintf(reason, size, "The Python of this process has no %s.", SYMBOLS[i]);
    }
    pthread_mutex_unlock(&lock);
    return done;
}

/* Log messages */

/* Length of a text without the last character, if that is cut off within its bytes of UTF-8. */
static size_t complete_utf8(const char *text, size_t length)
{
    size_t tail = 0;
    while (tail < 3 && tail < length && (text[length - 1 - tail] & 0xC0) == 0x80)
        ++tail;
    const unsigned char first = tail < length ? (unsigned char)text[length - 1 - tail] : 0;
    const size_t wanted = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : first >= 0xC0 ? 2 : 1;
    return tail + 1 < wanted ? length - 1 - tail : length;
}

/* Logs an error of this file, of the start of Python or of an exception; a long text is truncated. */
static void report_error(Slave *slave, const char *text)
{
    char doubled[2000];
    size_t at = 0;
    for (; *text != '\0' && at < sizeof doubled - 2; ++text) {
        doubled[at++] = *text == '\n' ? ' ' : *text;
        if (*text == '%')
            doubled[at++] = '%';
    }
    doubled[complete_utf8(doubled, at)] = '\0';
    slave->on_message(slave->environment, STATUS_ERROR, "logStatusError", doubled);
}

/* Delivers a message with the GIL released: the importer's logger may wait for a lock whose owner waits for Python. */
static void deliver(Slave *slave, int status, const char *category, const char *text)
{
    void *const thread = py.save_thread();
    slave->on_message(slave->environment, status, category, text);
    py.restore_thread(thread);
}

/* Logs the exception that is set, and clears it. */
static void report_exception(Slave *slave)
{
    void *type = NULL, *value = NULL, *trace = NULL;
    py.fetch_error(&type, &value, &trace);
    py.normalize_error(&type, &value, &trace);
    void *const kind = type != NULL ? py.get_attribute(type, "__name__") : NULL;
    void *const words = value != NULL ? py.str(value) : NULL;
    const char *const first = kind != NULL ? py.utf8(kind, NULL) : NULL;
    const char *const rest = words != NULL ? py.utf8(words, NULL) : NULL;
    char text[1000];
    snprintf(text, sizeof text, "%s: %s", first != NULL ? first : "Python", rest != NULL ? rest : "an error without words");
    py.clear_error();
    py.decref(kind); /* null pointers are allowed */
    py.decref(words);
    py.decref(type);
    py.decref(value);
    py.decref(trace);
    void *const thread = py.save_thread(); /* as in deliver() */
    report_error(slave, text);
    py.restore_thread(thread);
}

/* Delivers the pending messages of the slave in their order, and empties its list. No exception may be set. */
static void deliver_messages(Slave *slave)
{
    if (py.list_size(slave->messages) < 1)
        return;
    void *const messages = py.call(slave->object, "drained", NULL);
    for (long i = 0; messages != NULL && i < py.list_size(messages); ++i) {
        void *const message = py.list_item(messages, i); /* borrowed from the list, with its texts */
        const char *const category = py.utf8(py.tuple_item(message, 1), NULL);
        const char *const text = py.utf8(py.tuple_item(message, 2), NULL);
        if (category != NULL && text != NULL)
            deliver(slave, (int)py.as_long(py.tuple_item(message, 0)), category, text);
        else
            py.clear_error();
    }
    if (messages == NULL)
        report_exception(slave);
    py.decref(messages);
}

/* Ends a call with the reference `result`, which goes to `returned`, or is released where that is NULL or an exception
   was raised. Returns whether none was. */
static int end_call(Slave *slave, void *result, void **returned, int gil)
{
    void *type = NULL, *value = NULL, *trace = NULL;
    py.fetch_error(&type, &value, &trace); /* messages that were logged before it come first */
    deliver_messages(slave);
    const int raised = result == NULL || type != NULL;
    if (raised) {
        py.restore_error(type, value, trace);
        report_exception(slave);
    }
    if (!raised && returned != NULL)
        *returned = result;
    else
        py.decref(result);
    py.release_gil(gil);
    return !raised;
}

/* Creation and mode changes */

int slave_create(Slave *slave, const char *name, const char *resources, int visible)
{
    char reason[2000] = "";
    if (!start_python(reason, sizeof reason) || !resolve_python_api(reason, sizeof reason)) {
        report_error(slave, reason);
        return 0;
    }
    const int gil = py.acquire_gil();
    void *const scope = py.build("{s:s,s:s,s:i}", "resources", resources, "name", name, "visible", visible);
    void *const code = scope != NULL ? py.compile(MAKE, "kitecosim", FILE_INPUT) : NULL;
    void *const done = code != NULL ? py.evaluate(code, scope, scope) : NULL;
    if (done != NULL)
        slave->object = py.build("O", py.item(scope, "made")); /* a new reference */
    if (slave->object != NULL)
        slave->messages = py.get_attribute(slave->object, "log_queue");
    if (slave->messages == NULL) {
        report_exception(slave);
        py.decref(slave->object);
        slave->object = NULL;
    } else {
        deliver_messages(slave);
    }
    py.decref(done);
    py.decref(code);
    py.decref(scope);
    py.release_gil(gil);
    return slave->object != NULL;
}

int slave_callable(void)
{
    return py.is_initialized() || py.thread_state() != NULL;
}

void slave_free(Slave *slave)
{
    if (!py.is_initialized()) /* an importer in Python has finalized it, and with it the object */
        return;
    const int gil = py.acquire_gil();
    py.decref(slave->messages);
    py.decref(slave->object);
    slave->messages = slave->object = NULL;
    py.release_gil(gil);
}

int slave_call(Slave *slave, const char *method)
{
    const int gil = py.acquire_gil();
    return end_call(slave, py.call(slave->object, method, NULL), NULL, gil);
}

int slave_setup_experiment(Slave *slave, double start)
{
    const int gil = py.acquire_gil();
    return end_call(slave, py.call(slave->object, "setup_experiment", "(d)", start), NULL, gil);
}

/* Values */

/* Whether so many items make a memory that Python can view; an importer may give any count. */
static int is_viewable(Slave *slave, size_t count, size_t item)
{
    if (item == 0 || count <= LONG_MAX / item)
        return 1;
    report_error(slave, "More values are asked for than there is memory.");
    return 0;
}

static int transfer(Slave *slave, const char *method, Kind kind, const unsigned *references, size_t count, void *values,
                    size_t size, int as_arrays, int flag)
{
    if (!is_viewable(slave, count, sizeof *references) || !is_viewable(slave, size, VALUE_SIZES[kind]))
        return 0;
    const int gil = py.acquire_gil();
    void *const value_references = py.memory_view((char *)references, (long)(count * sizeof *references), READ);
    void *const content = value_references != NULL ? py.memory_view(values, (long)(size * VALUE_SIZES[kind]), flag) : NULL;
    void *const result = content != NULL ? py.call(slave->object, method, "(sOOi)", KIND_NAMES[kind], value_references,
                                                   content, as_arrays)
                                         : NULL;
    py.decref(value_references);
    py.decref(content);
    return end_call(slave, result, NULL, gil);
}

int slave_set(Slave *slave, Kind kind, const unsigned *references, size_t count, const void *values, size_t size,
              int as_arrays)
{
    return transfer(slave, "put", kind, references, count, (void *)values, size, as_arrays, READ);
}

int slave_get(Slave *slave, Kind kind, const unsigned *references, size_t count, void *values, size_t size, int as_arrays)
{
    return transfer(slave, "take", kind, references, count, values, size, as_arrays, WRITE);
}

int slave_do_step(Slave *slave, double time, double step, int *completed)
{
    const int gil = py.acquire_gil();
    void *const result = py.call(slave->object, "do_step", "(dd)", time, step);
    *completed = result != NULL && py.is_true(result) == 1;
    return end_call(slave, result, NULL, gil);
}

/* FMU states */

int slave_get_state(Slave *slave, void **state)
{
    const int gil = py.acquire_gil();
    return end_call(slave, py.call(slave->object, "_get_fmu_state", NULL), state, gil);
}

int slave_set_state(Slave *slave, void *state)
{
    const int gil = py.acquire_gil();
    return end_call(slave, py.call(slave->object, "_set_fmu_state", "(O)", state), NULL, gil);
}

int slave_serialize(Slave *slave, void *state, void **bytes)
{
    const int gil = py.acquire_gil();
    return end_call(slave, py.call(slave->object, "serialize", "(O)", state), bytes, gil);
}

int slave_deserialize(Slave *slave, const char *bytes, size_t size, void **state)
{
    if (!is_viewable(slave, size, 1))
        return 0;
    const int gil = py.acquire_gil();
    void *const content = py.memory_view((char *)bytes, (long)size, READ);
    void *const result = content != NULL ? py.call(slave->object, "deserialize", "(O)", content) : NULL;
    const int is_state = result != NULL && py.is_true(result) == 1; /* else it has logged why there is none */
    py.decref(content);
    return end_call(slave, result, is_state ? state : NULL, gil) && is_state;
}

void slave_release_object(void *object)
{
    if (object == NULL || !py.is_initialized())
        return;
    const int gil = py.acquire_gil();
    py.decref(object);
    py.release_gil(gil);
}

const char *slave_bytes_content(void *bytes, size_t *size)
{
    const int gil = py.acquire_gil();
    char *content = NULL;
    long length = 0;
    if (py.bytes_content(bytes, &content, &length) != 0) {
        py.clear_error();
        content = NULL;
    }
    *size = (size_t)length;
    py.release_gil(gil);
    return content;
}
