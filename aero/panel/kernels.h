/* What the kernels share: blocks of points on threads, the integrals that potentials and velocities are made of.

   A thread takes blocks of LANES points, which are the same for any number of threads, and all sums run in the order of
   the panels: results do not depend on how many threads there are. The points of a block are the lanes of vectors. */

#ifndef KERNELS_H
#define KERNELS_H

#include "elementary.h"

#define EXPORT __attribute__((visibility("default")))
/* Compiled once for each set of instructions; all give the same values, as nothing is contracted. */
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define FOR_EACH_PROCESSOR __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define FOR_EACH_PROCESSOR
#endif

enum { LANES = 64, WIDTH = 8, NEAR = 48, FAR = 24, STRIP = 16 }; /* the last three: rows of tables, see geometry.py */

static const double FOUR_PI = 12.566370614359172, TINY = 1e-280, SNAP = 1e-14; /* see exact.py */

typedef struct {
    double x[LANES], y[LANES], z[LANES];
} Points;

/* Does the work of a task for `lanes` points from the first on; `room` is its own. */
typedef void Rows(const void *task, long first, int lanes, const Points *at, double *room);

/* Calls `rows` for all blocks of `points` (count, 3) on up to so many threads, each with room for so many numbers.
   0, or 1 where memory is short. */
int for_all_blocks(Rows *rows, const void *task, const double *points, long count, long numbers, long threads);

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

#endif
