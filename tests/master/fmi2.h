/* What the FMUs of FMI 2.0 in this folder share: what they export, and the functions that their host gives them. */
#include <stddef.h>

#define EXPORT __attribute__((visibility("default")))
typedef void (*logger_type)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    logger_type logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} callbacks_type;
