/* Influence of panels on points, compiled: the formulas of exact.py and influence.py.

   A thread takes blocks of points, which are the same for any number of threads, and all sums run in the order of the
   panels: results do not depend on how many there are. Within a block the points are the lanes of vectors. */

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "elementary.h"

#define EXPORT __attribute__((visibility("default")))
#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GLIBC__) && !defined(__clang__)
#define FOR_EACH_PROCESSOR __attribute__((target_clones("default", "avx2", "avx512f"), optimize("O3")))
#else
#define FOR_EACH_PROCESSOR
#endif

enum { LANES = 64, TILE = 16, WIDTH = 8, NEAR = 48, FAR = 24 };

static const double FOUR_PI = 12.566370614359172, TINY = 1e-280, SNAP = 1e-14;

typedef struct {
    double x[LANES], y[LANES], z[LANES];
} Points;

typedef struct {
    const double *near, *far, *own, *points, *strengths;
    double *doublets, *potential;
    long panels, count, columns;
    double reach;
    atomic_long next;
    atomic_int failed;
} Task;

/* Twice the arctangent; see _angle in exact.py. */
INLINE double solid_angle(double height, double doubled, double scale, double empty, double a, double b, double c,
                          double ab, double bc, double ca)
{
    double below = a * b * c + ab * c + bc * a + ca * b;
    double angle = 2.0 * arctangent(height * doubled, empty > 0.0 ? 1.0 : below);
    return fabs(height) <= SNAP * scale ? 0.0 : angle;
}

INLINE double edge_integral(double length, double a, double b, double ab, double distance2)
{
    double product = a * b, sum = a + b + length, square = sum * sum;
    double along = product + ab, rest = product - ab;
    double between = distance2 * (length * length) / (rest > TINY ? rest : TINY);
    along = 2.0 * (ab > 0.0 ? along : between);
    return logarithm((square > TINY ? square : TINY) / (along > TINY ? along : TINY));
}

INLINE double product(const double *v, double x, double y, double z)
{
    return v[0] * x + v[1] * y + v[2] * z;
}

/* Potentials of the unit doublet and the unit source of one panel at WIDTH points; see pair_potentials in exact.py. */
INLINE void exact(const double *n, const double *x, const double *y, const double *z, double *doublet, double *source,
                  int with_source)
{
    for (int i = 0; i < WIDTH; i++) {
        double x0 = n[0] - x[i], y0 = n[1] - y[i], z0 = n[2] - z[i];
        double x1 = n[3] - x[i], y1 = n[4] - y[i], z1 = n[5] - z[i];
        double x2 = n[6] - x[i], y2 = n[7] - y[i], z2 = n[8] - z[i];
        double x3 = n[9] - x[i], y3 = n[10] - y[i], z3 = n[11] - z[i];
        double r0 = sqrt(x0 * x0 + y0 * y0 + z0 * z0), r1 = sqrt(x1 * x1 + y1 * y1 + z1 * z1);
        double r2 = sqrt(x2 * x2 + y2 * y2 + z2 * z2), r3 = sqrt(x3 * x3 + y3 * y3 + z3 * z3);
        double p01 = x0 * x1 + y0 * y1 + z0 * z1, p12 = x1 * x2 + y1 * y2 + z1 * z2;
        double p02 = x0 * x2 + y0 * y2 + z0 * z2, p23 = x2 * x3 + y2 * y3 + z2 * z3;
        double p03 = x0 * x3 + y0 * y3 + z0 * z3, scale = r0 + r2;
        double h1 = product(n + 12, x0, y0, z0), h2 = product(n + 15, x0, y0, z0);
        double a1 = solid_angle(h1, n[18], scale, n[43], r0, r1, r2, p01, p12, p02);
        double a2 = solid_angle(h2, n[19], scale, n[44], r0, r2, r3, p02, p23, p03);
        doublet[i] = (a1 + a2) / FOUR_PI;
        if (with_source) {
            double d0 = product(n + 20, x0, y0, z0), d1 = product(n + 23, x1, y1, z1);
            double d2 = product(n + 26, x2, y2, z2), d3 = product(n + 29, x0, y0, z0);
            double d4 = product(n + 32, x2, y2, z2), d5 = product(n + 35, x3, y3, z3);
            double first = d2 * d2 + h1 * h1, second = d3 * d3 + h2 * h2;
            double total = -h1 * a1 - h2 * a2;
            total += d0 * edge_integral(n[38], r0, r1, p01, d0 * d0 + h1 * h1);
            total += d1 * edge_integral(n[39], r1, r2, p12, d1 * d1 + h1 * h1);
            total += (d2 + d3) * edge_integral(n[40], r0, r2, p02, first > second ? first : second);
            total += d4 * edge_integral(n[41], r2, r3, p23, d4 * d4 + h2 * h2);
            total += d5 * edge_integral(n[42], r0, r3, p03, d5 * d5 + h2 * h2);
            source[i] = total / -FOUR_PI;
        }
    }
}

INLINE double quadratic(const double *t, double x, double y, double z)
{
    return x * (t[0] * x + 2.0 * (t[3] * y + t[4] * z)) + y * (t[1] * y + 2.0 * t[5] * z) + t[2] * z * z;
}

/* The same at all LANES points by multipoles; near[i] is set where the point is too close for them. Returns whether one
   is. */
INLINE int multipoles(const double *f, double reach, const Points *at, double *doublet, double *source, int *near,
                      int with_doublet, int with_source)
{
    double limit = reach * reach * f[21];
    int some = 0;
    for (int i = 0; i < LANES; i++) {
        double x = at->x[i] - f[0], y = at->y[i] - f[1], z = at->z[i] - f[2];
        double square = x * x + y * y + z * z;
        int close = square < limit;
        double inverse = 1.0 / (close ? 1.0 : square), root = sqrt(inverse);
        double second = quadratic(f + 7, x, y, z) * inverse;
        near[i] = close;
        some |= close;
        if (with_source)
            source[i] = f[6] * root * (1.0 + (1.5 * second - 0.5 * f[13]) * inverse) / -FOUR_PI;
        if (with_doublet) {
            double along = product(f + 3, x, y, z), first = 3.0 * quadratic(f + 14, x, y, z) * inverse - f[20];
            along = along * (1.0 + (7.5 * second - 1.5 * f[13]) * inverse) + first;
            doublet[i] = along * inverse * root / -FOUR_PI;
        }
    }
    return some;
}

/* Overwrites the values of one panel at the points that are near. */
INLINE void exact_where(const double *n, const int *near, const Points *at, double *doublet, double *source,
                        int with_doublet, int with_source)
{
    int index[LANES + WIDTH], found = 0;
    for (int i = 0; i < LANES; i++) {
        index[found] = i;
        found += near[i];
    }
    for (int i = found; i < found + WIDTH; i++)
        index[i] = index[0];
    for (int start = 0; start < found; start += WIDTH) {
        double x[WIDTH], y[WIDTH], z[WIDTH], d[WIDTH], s[WIDTH];
        for (int i = 0; i < WIDTH; i++) {
            x[i] = at->x[index[start + i]];
            y[i] = at->y[index[start + i]];
            z[i] = at->z[index[start + i]];
        }
        exact(n, x, y, z, d, s, with_source);
        for (int i = 0; i < WIDTH; i++) {
            if (with_doublet)
                doublet[index[start + i]] = d[i];
            if (with_source)
                source[index[start + i]] = s[i];
        }
    }
}

/* All panels at the points first ... first + lanes - 1; sums (columns, LANES) are for the potentials. */
INLINE void rows(Task *t, long first, int lanes, const Points *at, double *sums, int with_doublet, int with_source)
{
    double doublet[TILE][LANES], source[TILE][LANES];
    int near[LANES];
    for (long i = 0; i < t->columns * LANES; i++)
        sums[i] = 0.0;
    for (long start = 0; start < t->panels; start += TILE) {
        int tile = t->panels - start < TILE ? (int)(t->panels - start) : TILE;
        for (int k = 0; k < tile; k++) {
            const double *n = t->near + NEAR * (start + k), *f = t->far + FAR * (start + k);
            if (multipoles(f, t->reach, at, doublet[k], source[k], near, with_doublet, with_source))
                exact_where(n, near, at, doublet[k], source[k], with_doublet, with_source);
            if (with_doublet && t->own && start + k >= first && start + k < first + lanes)
                doublet[k][start + k - first] = t->own[start + k];
            for (long c = 0; with_source && c < t->columns; c++) {
                double strength = t->strengths[(start + k) * t->columns + c];
                for (int i = 0; i < LANES; i++)
                    sums[c * LANES + i] += strength * source[k][i];
            }
        }
        for (int i = 0; with_doublet && i < lanes; i++)
            for (int k = 0; k < tile; k++)
                t->doublets[(first + i) * t->panels + start + k] += doublet[k][i];
    }
    for (int i = 0; i < lanes; i++)
        for (long c = 0; c < t->columns; c++)
            t->potential[(first + i) * t->columns + c] = sums[c * LANES + i];
}

FOR_EACH_PROCESSOR static void doublet_rows(Task *t, long first, int lanes, const Points *at, double *sums)
{
    rows(t, first, lanes, at, sums, 1, 0);
}

FOR_EACH_PROCESSOR static void source_rows(Task *t, long first, int lanes, const Points *at, double *sums)
{
    rows(t, first, lanes, at, sums, 0, 1);
}

FOR_EACH_PROCESSOR static void both_rows(Task *t, long first, int lanes, const Points *at, double *sums)
{
    rows(t, first, lanes, at, sums, 1, 1);
}

static void *work(void *given)
{
    Task *t = given;
    double *sums = malloc(sizeof(double) * LANES * (size_t)(t->columns + 1));
    long first;
    if (!sums)
        atomic_store(&t->failed, 1);
    while (sums && (first = atomic_fetch_add(&t->next, LANES)) < t->count) {
        Points at;
        int lanes = t->count - first < LANES ? (int)(t->count - first) : LANES;
        for (int i = 0; i < LANES; i++) {
            const double *p = t->points + 3 * (first + (i < lanes ? i : lanes - 1));
            at.x[i] = p[0];
            at.y[i] = p[1];
            at.z[i] = p[2];
        }
        if (t->columns && t->doublets)
            both_rows(t, first, lanes, &at, sums);
        else if (t->columns)
            source_rows(t, first, lanes, &at, sums);
        else
            doublet_rows(t, first, lanes, &at, sums);
    }
    free(sums);
    return NULL;
}

/* Runs work on the calling thread and as many others as can be had up to `threads` in all. */
static void on_threads(void *(*work_)(void *), void *task, long threads)
{
    enum { MOST = 256 };
    pthread_t others[MOST];
    long started = 0, wanted = threads - 1 < MOST ? threads - 1 : MOST;
    while (started < wanted && !pthread_create(&others[started], NULL, work_, task))
        started++;
    work_(task);
    while (started > 0)
        pthread_join(others[--started], NULL);
}

/* Adds potentials of unit doublets (points, panels) to `doublets` and sets `potential` (points, columns) of the source
   strengths (panels, columns), each where it is given. `own`, where given, are those of a panel at the point of the same
   number. 0, or 1 where memory is short. */
EXPORT int panel_influence(const double *near, const double *far, const double *own, long panels, const double *points,
                           long count, double reach, const double *strengths, long columns, double *doublets,
                           double *potential, long threads)
{
    Task task = {.near = near, .far = far, .own = own, .points = points, .strengths = strengths, .doublets = doublets,
                 .potential = potential, .panels = panels, .count = count, .columns = strengths ? columns : 0,
                 .reach = reach};
    atomic_init(&task.next, 0);
    atomic_init(&task.failed, 0);
    on_threads(work, &task, threads < (count + LANES - 1) / LANES ? threads : (count + LANES - 1) / LANES);
    return atomic_load(&task.failed);
}
