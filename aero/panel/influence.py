"""Influence of panels and wake strips on points: matrices of doublets, potentials of sources, velocities.

A panel further from a point than `far` times its size acts by its multipoles about its centre: area and second moments
of area, and the first moments that a warped panel has; nearer ones act exactly, as two flat triangles. What multipoles
lack falls with the cube of the distance: at 5 sizes, the default, up to 1e-4 (source) and 2.5e-4 (doublet) of a flat
convex panel's largest potential there, 1e-3 where it is warped by a tenth of its size. Errors of neighbours cancel, and
the potentials of a closed body change by less than 1e-5 of the largest.

`mirrored` gives the influence of the image in the plane y = 0, whose strengths are those of the panels. `threads`: by
default as many as KITECOSIM_THREADS says, or the process has cores. `kernel`: "compiled" or "numpy", by default the
first where it is there. A matrix that is used again (`out`, filled with zeros) saves the system fresh memory, which may
cost more than the influence itself.
"""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from interface.vectors import cross

from .exact import (
    FOUR_PI,
    doublet_velocities,
    pair_potentials,
    source_velocities,
    strip_potentials,
    strip_velocities,
)
from .geometry import PanelGeometry
from .kernels import call, compiled

__all__ = [
    "FAR",
    "PanelGeometry",
    "doublet_matrix",
    "induced_velocity",
    "influence",
    "memory_needed",
    "source_potential",
    "thread_count",
    "wake_matrix",
    "wake_velocity",
]

FAR = 5.0  # distance in panel sizes beyond which multipoles stand for a panel
PAIRS = 16384  # pairs of point and panel that are worked on at a time: their arrays stay in cache


def doublet_matrix(geometry, points, mirrored=False, out=None, own=False, far=FAR, threads=None, kernel=None):
    """Potentials of unit doublets on m panels at p points: (p,m), added to `out` when given.

    With `own` the points are the centres of the panels, seen from inside: 1/2 from a flat panel itself.
    """
    return _influence(geometry, points, None, mirrored, own, _out(geometry, points, out), far, threads, kernel)[0]


def source_potential(geometry, points, strengths, mirrored=False, far=FAR, threads=None, kernel=None):
    """Potential [m^2/s] at p points of source densities [m/s]: (p,) for `strengths` (m,), (p,k) for (m,k).

    No matrix is stored.
    """
    return _influence(geometry, points, strengths, mirrored, False, None, far, threads, kernel)[1]


def influence(geometry, points, strengths, mirrored=False, out=None, own=False, far=FAR, threads=None, kernel=None):
    """`doublet_matrix` and `source_potential` in one pass, which takes little longer than the first alone."""
    return _influence(geometry, points, strengths, mirrored, own, _out(geometry, points, out), far, threads, kernel)


def _out(geometry, points, out):
    """The matrix to add to: `out` (p,m), float64 with whole rows, or zeros."""
    shape = len(points), len(geometry.area)
    if out is None:
        return np.zeros(shape)
    if out.shape != shape or out.dtype != np.float64 or not out.flags.c_contiguous:
        raise ValueError(f"The matrix to add to must be of 64-bit numbers, C-contiguous and of shape {shape}.")
    return out


def _influence(geometry, points, strengths, mirrored, own, out, far, threads, kernel):
    points = _points(points, mirrored)
    if own and (mirrored or len(points) != len(geometry.area)):
        raise ValueError("Only the unmirrored centres of the panels themselves are their own points.")
    columns = potential = None
    if strengths is not None:
        columns = np.ascontiguousarray(strengths, dtype=float).reshape(len(geometry.area), -1)
        potential = np.empty((len(points), columns.shape[1]))
    library, threads = compiled(kernel), thread_count(threads)
    values = np.ascontiguousarray(geometry.own) if own else None
    if library is None:
        _influence_in_numpy(geometry, points, far, values, columns, out, potential, threads)
    else:
        count = 0 if columns is None else columns.shape[1]
        tables = np.ascontiguousarray(geometry.near), np.ascontiguousarray(geometry.far), values
        panels = len(geometry.area), points, len(points), far, columns, count
        call(library, "panel_potentials", *tables, *panels, out, potential, threads)
    return out, potential[:, 0] if potential is not None and np.ndim(strengths) == 1 else potential


def _influence_in_numpy(geometry, points, far, own, strengths, out, potential, threads):
    near, multipoles = np.ascontiguousarray(geometry.near.T), np.ascontiguousarray(geometry.far.T)

    def rows(part):
        doublets, sources = _block(near, multipoles, points[part], out is not None, strengths is not None, far)
        if own is not None:
            index = np.arange(len(points))[part]
            doublets[index - index[0], index] = own[index]
        if out is not None:
            out[part] += doublets
        if strengths is not None:
            potential[part] = np.einsum("pm,mk->pk", sources, strengths)

    _over_rows(rows, len(points), len(geometry.area), threads)


def _points(points, mirrored):
    points = np.ascontiguousarray(points, dtype=float)
    return points * np.array([1.0, -1.0, 1.0]) if mirrored else points


def thread_count(threads=None):
    """Threads to use: as given, or KITECOSIM_THREADS, or one for each core of this process."""
    given = threads or os.environ.get("KITECOSIM_THREADS")
    if given is not None and not (str(given).isdecimal() and int(given) > 0):
        raise ValueError(f"KITECOSIM_THREADS takes a number of threads of at least 1, not {given!r}.")
    if given is not None:
        return int(given)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _over_rows(work, rows, columns, threads):
    """`work` on slices of all rows, which are the same for any number of threads."""
    step = max(1, PAIRS // max(columns, 1))
    parts = [slice(start, min(start + step, rows)) for start in range(0, rows, step)]
    count = min(threads, len(parts))
    if count <= 1:
        for part in parts:
            work(part)
        return
    with ThreadPoolExecutor(count) as pool:
        list(pool.map(work, parts))


def _block(near, multipoles, points, doublet, source, far):
    """Potentials of unit doublets and of unit sources of all panels at some points, (p,m) each; empty if not asked."""
    f = multipoles[:, None, :]
    x, y, z = (points[:, k, None] - f[k] for k in range(3))
    square = x * x + y * y + z * z
    rows, columns = np.nonzero(square < far * far * f[21])
    square[rows, columns] = 1.0  # finite; exact values take their place
    inverse = np.divide(1.0, square, out=square)
    root, second = np.sqrt(inverse), _quadratic(f[7:13], x, y, z)
    second *= inverse
    sources = doublets = np.empty((0, 0))
    if source:
        sources = _corrected(second, 1.5, 0.5 * f[13], inverse)
        sources *= root
        sources *= f[6] / -FOUR_PI
    if doublet:
        doublets = _corrected(second, 7.5, 1.5 * f[13], inverse)
        doublets *= x * f[3] + y * f[4] + z * f[5]
        first = _quadratic(f[14:20], x, y, z)
        first *= 3.0 * inverse
        first -= f[20]
        doublets += first
        doublets *= inverse
        doublets *= root
        doublets /= -FOUR_PI
    for start in range(0, len(rows), PAIRS // 4):
        i, j = rows[start : start + PAIRS // 4], columns[start : start + PAIRS // 4]
        exact = pair_potentials(near[:, j], points[i].T, doublet, source)
        if doublet:
            doublets[i, j] = exact[0]
        if source:
            sources[i, j] = exact[1]
    return doublets, sources


def _corrected(second, factor, trace, inverse):
    """1 + (factor second - trace) inverse, a new array."""
    found = factor * second
    found -= trace
    found *= inverse
    found += 1.0
    return found


def _quadratic(t, x, y, z):
    """x.T x with the symmetric tensors t (6,m) as they are stored."""
    along_x, along_y, along_z = t[0] * x, t[1] * y, z * z
    along_x += 2.0 * t[3] * y
    along_x += 2.0 * t[4] * z
    along_x *= x
    along_y += 2.0 * t[5] * z
    along_y *= y
    along_z *= t[2]
    along_x += along_y
    along_x += along_z
    return along_x


def _strips(a, b, direction):
    """Table (w,16) of strips: a, b, direction, normal a - b x direction (3 each), length of the normal, nothing (3)."""
    a, b = np.asarray(a, dtype=float).reshape(-1, 3), np.asarray(b, dtype=float).reshape(-1, 3)
    table = np.zeros((len(a), 16))
    table[:, :3], table[:, 3:6], table[:, 6:9] = a, b, direction
    table[:, 9:12] = cross(a - b, table[:, 6:9])
    table[:, 12] = np.linalg.norm(table[:, 9:12], axis=1)
    return table


def wake_matrix(a, b, direction, points, mirrored=False, threads=None, kernel=None):
    """Potentials of unit doublets on w semi-infinite wake strips at p points: (p,w).

    The strips leave their trailing edges from `a` (w,3) to `b` (w,3) m along the unit vector `direction` (3,), or (w,3)
    one each; their corners are b, a, a + L d, b + L d, counter-clockwise seen from where their normal points.
    """
    points, strips = _points(points, mirrored), _strips(a, b, direction)
    out = np.empty((len(points), len(strips)))
    library, threads = compiled(kernel), thread_count(threads)
    if library is not None:
        call(library, "strip_potentials", strips, len(strips), points, len(points), out, threads)
        return out
    columns = np.ascontiguousarray(strips.T)[:, None, :]

    def rows(part):
        out[part] = strip_potentials(columns, points[part].T[:, :, None])

    _over_rows(rows, len(points), len(strips), threads)
    return out


def induced_velocity(geometry, points, sources, doublets, mirrored=False, core=0.0, threads=None, kernel=None):
    """Velocity (p,3) [m/s] at points off the panels of source densities (m,) [m/s] and doublets (m,) [m^2/s], exact.

    With a `core` m the velocity of a doublet panel falls to zero within about this distance of its edges; without, it
    is singular there, and zero on the edges themselves.
    """
    points, out = _points(points, mirrored), np.empty((len(points), 3))
    sources, doublets = (np.ascontiguousarray(s, dtype=float) for s in (sources, doublets))
    library, threads, count = compiled(kernel), thread_count(threads), len(geometry.area)
    if library is not None:
        tables = np.ascontiguousarray(geometry.near), sources, doublets
        call(library, "panel_velocities", *tables, count, points, len(points), core, out, threads)
        return _points(out, mirrored)
    near = np.ascontiguousarray(geometry.near.T)[:, None, :]

    def rows(part):
        at = points[part].T[:, :, None]
        out[part] = np.einsum("kpm,m->pk", doublet_velocities(near, at, core), doublets)
        out[part] += np.einsum("kpm,m->pk", source_velocities(near, at), sources)

    _over_rows(rows, len(points), 4 * count, threads)
    return _points(out, mirrored)


def wake_velocity(a, b, direction, strengths, points, mirrored=False, core=0.0, threads=None, kernel=None):
    """Velocity (p,3) [m/s] at points of doublets (w,) [m^2/s] on semi-infinite wake strips; see `wake_matrix`."""
    points, strips, out = _points(points, mirrored), _strips(a, b, direction), np.empty((len(points), 3))
    strengths = np.ascontiguousarray(strengths, dtype=float)
    library, threads, count = compiled(kernel), thread_count(threads), len(strips)
    if library is not None:
        call(library, "strip_velocities", strips, strengths, count, points, len(points), core, out, threads)
        return _points(out, mirrored)
    columns = np.ascontiguousarray(strips.T)[:, None, :]

    def rows(part):
        velocities = strip_velocities(columns, points[part].T[:, :, None], core)
        out[part] = np.einsum("kpm,m->pk", velocities, strengths)

    _over_rows(rows, len(points), 4 * count, threads)
    return _points(out, mirrored)


def memory_needed(panels):
    """Bytes that a run with this many panels in the matrix holds at its peak: operator in float64, factor in float32,
    and panels, strips and work beside them. A half model counts its own panels only.
    """
    return 12 * panels**2 + 4000 * panels + 2 * 10**8
