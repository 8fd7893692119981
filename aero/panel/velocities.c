/* Velocities of panels and of wake strips at points: gradients of their exact potentials. */

#include "kernels.h"

typedef struct {
    const double *table, *sources, *doublets; /* table: of panels (NEAR numbers each) or of strips (STRIP) */
    double *velocity, core;
    long number;
} Sheets;

/* Adds factor times the gradient of the solid angle by the edge e from a to b; see _segment in exact.py. */
INLINE void segment(double ax, double ay, double az, double bx, double by, double bz, const double *e, double core2,
                    double factor, double *v)
{
    double ra = sqrt(ax * ax + ay * ay + az * az), rb = sqrt(bx * bx + by * by + bz * bz);
    double ab = ax * bx + ay * by + az * bz, both = ra * rb, sum = ra + rb;
    double length2 = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
    double nx = ay * e[2] - az * e[1], ny = az * e[0] - ax * e[2], nz = ax * e[1] - ay * e[0];
    double square = nx * nx + ny * ny + nz * nz, ahead = both + ab, cored = square + core2 * length2;
    double beside = (both - ab) / (square > TINY ? square : TINY), front = 1.0 / (ahead > TINY ? ahead : TINY);
    double f = sum / (both > TINY ? both : TINY) * (ab > 0.0 ? front : beside) * square / (cored > TINY ? cored : TINY);
    f = square > SNAP * SNAP * length2 * sum * sum ? factor * f : 0.0;
    v[0] += f * nx;
    v[1] += f * ny;
    v[2] += f * nz;
}

/* The same of the edge from a along the unit vector d to infinity; see _half_line in exact.py. */
INLINE void half_line(double ax, double ay, double az, const double *d, double core2, double factor, double *v)
{
    double ra = sqrt(ax * ax + ay * ay + az * az), along = ax * d[0] + ay * d[1] + az * d[2];
    double nx = ay * d[2] - az * d[1], ny = az * d[0] - ax * d[2], nz = ax * d[1] - ay * d[0];
    double square = nx * nx + ny * ny + nz * nz, ahead = ra + along, cored = square + core2;
    double beside = (ra - along) / (square > TINY ? square : TINY), front = 1.0 / (ahead > TINY ? ahead : TINY);
    double f = (along > 0.0 ? front : beside) / (ra > TINY ? ra : TINY) * square / (cored > TINY ? cored : TINY);
    f = square > SNAP * SNAP * ra * ra ? factor * f : 0.0;
    v[0] += f * nx;
    v[1] += f * ny;
    v[2] += f * nz;
}

/* Adds the velocity at WIDTH points of one panel's doublet; see doublet_velocities in exact.py. */
INLINE void doublet_velocity(const double *n, const double *x, const double *y, const double *z, double core2,
                             double strength, double (*v)[WIDTH])
{
    double edge[4][3];
    for (int k = 0; k < 12; k++)
        edge[k / 3][k % 3] = n[(k + 3) % 12] - n[k];
    for (int i = 0; i < WIDTH; i++) {
        double x0 = n[0] - x[i], y0 = n[1] - y[i], z0 = n[2] - z[i];
        double x1 = n[3] - x[i], y1 = n[4] - y[i], z1 = n[5] - z[i];
        double x2 = n[6] - x[i], y2 = n[7] - y[i], z2 = n[8] - z[i];
        double x3 = n[9] - x[i], y3 = n[10] - y[i], z3 = n[11] - z[i], sum[3] = {0.0, 0.0, 0.0};
        segment(x0, y0, z0, x1, y1, z1, edge[0], core2, strength, sum);
        segment(x1, y1, z1, x2, y2, z2, edge[1], core2, strength, sum);
        segment(x2, y2, z2, x3, y3, z3, edge[2], core2, strength, sum);
        segment(x3, y3, z3, x0, y0, z0, edge[3], core2, strength, sum);
        v[0][i] += sum[0] / FOUR_PI;
        v[1][i] += sum[1] / FOUR_PI;
        v[2][i] += sum[2] / FOUR_PI;
    }
}

/* Adds the velocity at WIDTH points of one panel's source; see source_velocities in exact.py. */
INLINE void source_velocity(const double *n, const double *x, const double *y, const double *z, double strength,
                            double (*v)[WIDTH])
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
        double d0 = product(n + 20, x0, y0, z0), d1 = product(n + 23, x1, y1, z1);
        double d2 = product(n + 26, x2, y2, z2), d3 = product(n + 29, x0, y0, z0);
        double d4 = product(n + 32, x2, y2, z2), d5 = product(n + 35, x3, y3, z3);
        double first = d2 * d2 + h1 * h1, second = d3 * d3 + h2 * h2;
        double l0 = edge_integral(n[38], r0, r1, p01, d0 * d0 + h1 * h1);
        double l1 = edge_integral(n[39], r1, r2, p12, d1 * d1 + h1 * h1);
        double l2 = edge_integral(n[40], r0, r2, p02, first > second ? first : second);
        double l4 = edge_integral(n[41], r2, r3, p23, d4 * d4 + h2 * h2);
        double l5 = edge_integral(n[42], r0, r3, p03, d5 * d5 + h2 * h2);
        double one = strength * n[45] / FOUR_PI, other = strength * n[46] / FOUR_PI;
        for (int k = 0; k < 3; k++)
            v[k][i] += one * (n[20 + k] * l0 + n[23 + k] * l1 + n[26 + k] * l2 - n[12 + k] * a1) +
                       other * (n[29 + k] * l2 + n[32 + k] * l4 + n[35 + k] * l5 - n[15 + k] * a2);
    }
}

/* Adds the velocity at WIDTH points of one wake strip's doublet; see strip_velocities in exact.py. */
INLINE void strip_velocity(const double *t, const double *x, const double *y, const double *z, double core2,
                           double strength, double (*v)[WIDTH])
{
    double edge[3] = {t[0] - t[3], t[1] - t[4], t[2] - t[5]};
    for (int i = 0; i < WIDTH; i++) {
        double ax = t[0] - x[i], ay = t[1] - y[i], az = t[2] - z[i];
        double bx = t[3] - x[i], by = t[4] - y[i], bz = t[5] - z[i], sum[3] = {0.0, 0.0, 0.0};
        segment(bx, by, bz, ax, ay, az, edge, core2, strength, sum);
        half_line(ax, ay, az, t + 6, core2, strength, sum);
        half_line(bx, by, bz, t + 6, core2, -strength, sum);
        v[0][i] += sum[0] / FOUR_PI;
        v[1][i] += sum[1] / FOUR_PI;
        v[2][i] += sum[2] / FOUR_PI;
    }
}

INLINE void store(const Sheets *t, long first, int lanes, int start, double (*v)[WIDTH])
{
    for (int i = start; i < lanes && i < start + WIDTH; i++)
        for (int k = 0; k < 3; k++)
            t->velocity[3 * (first + i) + k] = v[k][i - start];
}

FOR_EACH_PROCESSOR static void panel_rows(const void *given, long first, int lanes, const Points *at, double *room)
{
    const Sheets *t = given;
    (void)room;
    for (int start = 0; start < lanes; start += WIDTH) {
        const double *x = at->x + start, *y = at->y + start, *z = at->z + start;
        double v[3][WIDTH] = {{0.0}};
        for (long k = 0; k < t->number; k++) {
            doublet_velocity(t->table + NEAR * k, x, y, z, t->core * t->core, t->doublets[k], v);
            source_velocity(t->table + NEAR * k, x, y, z, t->sources[k], v);
        }
        store(t, first, lanes, start, v);
    }
}

FOR_EACH_PROCESSOR static void strip_rows(const void *given, long first, int lanes, const Points *at, double *room)
{
    const Sheets *t = given;
    (void)room;
    for (int start = 0; start < lanes; start += WIDTH) {
        const double *x = at->x + start, *y = at->y + start, *z = at->z + start;
        double v[3][WIDTH] = {{0.0}};
        for (long k = 0; k < t->number; k++)
            strip_velocity(t->table + STRIP * k, x, y, z, t->core * t->core, t->doublets[k], v);
        store(t, first, lanes, start, v);
    }
}

/* Sets velocities (points, 3) of source and doublet strengths of panels. 0, or 1 where memory is short. */
EXPORT int panel_velocities(const double *near, const double *sources, const double *doublets, long panels,
                            const double *points, long count, double core, double *velocity, long threads)
{
    Sheets task = {near, sources, doublets, velocity, core, panels};
    return for_all_blocks(panel_rows, &task, points, count, 0, threads);
}

/* Sets velocities (points, 3) of doublet strengths of strips. 0, or 1 where memory is short. */
EXPORT int strip_velocities(const double *strips, const double *doublets, long number, const double *points, long count,
                            double core, double *velocity, long threads)
{
    Sheets task = {strips, 0, doublets, velocity, core, number};
    return for_all_blocks(strip_rows, &task, points, count, 0, threads);
}
