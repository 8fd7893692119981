/* Blocks of points on threads. */

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "kernels.h"

typedef struct {
    Rows *rows;
    const void *task;
    const double *points;
    long count, numbers;
    atomic_long next;
    atomic_int failed;
} Blocks;

static void *work(void *given)
{
    Blocks *b = given;
    double *room = malloc(sizeof(double) * (size_t)(b->numbers + 1));
    if (!room)
        atomic_store(&b->failed, 1);
    for (long first; room && (first = atomic_fetch_add(&b->next, LANES)) < b->count;) {
        Points at;
        int lanes = b->count - first < LANES ? (int)(b->count - first) : LANES;
        for (int i = 0; i < LANES; i++) {
            const double *p = b->points + 3 * (first + (i < lanes ? i : lanes - 1));
            at.x[i] = p[0];
            at.y[i] = p[1];
            at.z[i] = p[2];
        }
        b->rows(b->task, first, lanes, &at, room);
    }
    free(room);
    return NULL;
}

int for_all_blocks(Rows *rows, const void *task, const double *points, long count, long numbers, long threads)
{
    enum { MOST = 256 };
    pthread_t others[MOST];
    Blocks blocks = {.rows = rows, .task = task, .points = points, .count = count, .numbers = numbers};
    long started = 0, wanted = (count + LANES - 1) / LANES;
    atomic_init(&blocks.next, 0);
    atomic_init(&blocks.failed, 0);
    wanted = (threads < wanted ? threads : wanted) - 1;
    while (started < wanted && started < MOST && !pthread_create(&others[started], NULL, work, &blocks))
        started++;
    work(&blocks);
    while (started > 0)
        pthread_join(others[--started], NULL);
    return atomic_load(&blocks.failed);
}
