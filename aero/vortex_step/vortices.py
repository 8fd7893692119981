"""Velocities induced by straight vortex filaments of unit circulation (Biot-Savart with a finite core)."""

import numpy as np

from interface.vectors import cross


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _from(points, origin):
    """Vectors (3, p, s) from each origin (s,3) to each point (p,3)."""
    return points.T[:, :, None] - origin.T[:, None, :]


def segment_velocity(points, start, end, core):
    """Velocity [1/m per unit circulation] at `points` (p,3) of segments `start` -> `end` (s,3): (3, p, s).

    v = (r1 x r2) r0.(r1/|r1| - r2/|r2|) / (4 pi |r0|^2 h^2), h the distance to the line of the segment
    (Katz and Plotkin 2001, sec. 2.12). h^2 becomes sqrt(h^4 + core^4), the n = 2 core of Vatistas (1991), with the
    radius `core` (s,) m. A point on the line of a segment gets no velocity from it.
    """
    r0 = (end - start).T[:, None, :]
    r1, r2 = _from(points, start), _from(points, end)
    n = cross(r1, r2, axis=0)
    length2 = _dot(r0, r0)
    h2 = _dot(n, n) / length2
    tiny = 1e-12 * np.sqrt(length2)
    along = _dot(r1, r0) / (np.sqrt(_dot(r1, r1)) + tiny) - _dot(r2, r0) / (np.sqrt(_dot(r2, r2)) + tiny)
    return n * (along / (4.0 * np.pi * length2 * np.sqrt(h2 * h2 + core**4)))


def semi_infinite_velocity(points, start, direction, core):
    """Velocity [1/m per unit circulation] at `points` (p,3) of filaments from `start` (s,3) to infinity: (3, p, s).

    v = (d x r) (1 + d.r/|r|) / (4 pi h^2) with the unit `direction` d (3,); core as in `segment_velocity`.
    """
    d = direction[:, None, None]
    r = _from(points, start)
    n = cross(d, r, axis=0)
    h2 = _dot(n, n)
    length = np.sqrt(_dot(r, r))
    factor = 1.0 + _dot(d, r) / np.maximum(length, 1e-300)
    return n * (factor / (4.0 * np.pi * np.sqrt(h2 * h2 + core**4)))


def line_velocity(points, origin, direction, core):
    """Velocity [1/m per unit circulation] at `points` (p,3) of infinite lines through `origin` (s,3): (3, p, s).

    v = d x r / (2 pi h^2) with the unit `direction` d (3,) of all; core as in `segment_velocity`.
    """
    n = cross(direction[:, None, None], _from(points, origin), axis=0)
    h2 = _dot(n, n)
    return n / (2.0 * np.pi * np.sqrt(h2 * h2 + core**4))


def infinite_velocity(points, origin, direction, core):
    """Velocity [1/m per unit circulation] of infinite lines, one a point, all (n,3): (3, n). v = d x r / (2 pi h^2)."""
    r = (points - origin).T
    n = cross(direction.T, r, axis=0)
    h2 = _dot(n, n)
    return n / (2.0 * np.pi * np.sqrt(h2 * h2 + core**4))
