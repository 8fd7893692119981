/* Potentials of panels and of wake strips at points. */

#include "kernels.h"

enum { TILE = 16 }; /* panels whose values are kept before they are added to rows of the matrix */

typedef struct {
    const double *near, *far, *own, *strengths;
    double *doublets, *potential, reach;
    long panels, columns;
} Panels;

typedef struct {
    const double *strips;
    double *out;
    long count;
} Strips;

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
            double one = n[45], other = n[46], total = -one * h1 * a1 - other * h2 * a2;
            total += one * d0 * edge_integral(n[38], r0, r1, p01, d0 * d0 + h1 * h1);
            total += one * d1 * edge_integral(n[39], r1, r2, p12, d1 * d1 + h1 * h1);
            total += (one * d2 + other * d3) * edge_integral(n[40], r0, r2, p02, first > second ? first : second);
            total += other * d4 * edge_integral(n[41], r2, r3, p23, d4 * d4 + h2 * h2);
            total += other * d5 * edge_integral(n[42], r0, r3, p03, d5 * d5 + h2 * h2);
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

/* All panels at the points of a block; `sums` (columns, LANES) are for the potentials. */
INLINE void panel_rows(const Panels *t, long first, int lanes, const Points *at, double *sums, int with_doublet,
                       int with_source)
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

FOR_EACH_PROCESSOR static void doublet_rows(const void *t, long first, int lanes, const Points *at, double *sums)
{
    panel_rows(t, first, lanes, at, sums, 1, 0);
}

FOR_EACH_PROCESSOR static void source_rows(const void *t, long first, int lanes, const Points *at, double *sums)
{
    panel_rows(t, first, lanes, at, sums, 0, 1);
}

FOR_EACH_PROCESSOR static void both_rows(const void *t, long first, int lanes, const Points *at, double *sums)
{
    panel_rows(t, first, lanes, at, sums, 1, 1);
}

/* Adds potentials of unit doublets (points, panels) to `doublets` and sets `potential` (points, columns) of the source
   strengths (panels, columns), each where it is given. `own`, where given, are the unit doublets' potentials at the
   point of the panel's own number. 0, or 1 where memory is short. */
EXPORT int panel_potentials(const double *near, const double *far, const double *own, long panels, const double *points,
                            long count, double reach, const double *strengths, long columns, double *doublets,
                            double *potential, long threads)
{
    Panels task = {near, far, own, strengths, doublets, potential, reach, panels, strengths ? columns : 0};
    Rows *rows = !strengths ? doublet_rows : doublets ? both_rows : source_rows;
    return for_all_blocks(rows, &task, points, count, task.columns * LANES, threads);
}

/* Of all strips at the points of a block; see strip_potentials in exact.py. */
FOR_EACH_PROCESSOR static void strip_rows(const void *given, long first, int lanes, const Points *at, double *value)
{
    const Strips *t = given;
    for (long k = 0; k < t->count; k++) {
        const double *s = t->strips + STRIP * k;
        for (int i = 0; i < LANES; i++) {
            double ax = s[0] - at->x[i], ay = s[1] - at->y[i], az = s[2] - at->z[i];
            double bx = s[3] - at->x[i], by = s[4] - at->y[i], bz = s[5] - at->z[i];
            double ra = sqrt(ax * ax + ay * ay + az * az), rb = sqrt(bx * bx + by * by + bz * bz);
            double height = product(s + 9, bx, by, bz), ad = product(s + 6, ax, ay, az);
            double bd = product(s + 6, bx, by, bz), ab = ax * bx + ay * by + az * bz;
            double angle = 2.0 * arctangent(height, ra * rb + ab + ad * rb + bd * ra) / FOUR_PI;
            value[i] = fabs(height) <= SNAP * (ra + rb) * s[12] ? 0.0 : angle;
        }
        for (int i = 0; i < lanes; i++)
            t->out[(first + i) * t->count + k] = value[i];
    }
}

/* Sets potentials of unit doublets on strips (points, strips). 0, or 1 where memory is short. */
EXPORT int strip_potentials(const double *strips, long number, const double *points, long count, double *out,
                            long threads)
{
    Strips task = {strips, out, number};
    return for_all_blocks(strip_rows, &task, points, count, LANES, threads);
}
