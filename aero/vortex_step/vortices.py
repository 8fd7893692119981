"""Velocities induced by straight vortex filaments of unit circulation (Biot-Savart with a finite core), and by the
horseshoe vortices of all strips on the strips' own points.
"""

import numpy as np

from interface.vectors import cross

from .strips import control_fractions

# Core radius as a fraction of the strip width. Only filaments that come closer than about a tenth of a strip notice it;
# 0.05 is the value of Damiani et al. (2019).
CORE_FRACTION = 0.05


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


def trailing_influence(points, strips, wake_direction, core_fraction=CORE_FRACTION):
    """Velocity at `points` (p,3) of the trailing vorticity of each strip's unit circulation, (3, p, n) 1/m.

    Filaments run from the quarter chord along the section chord to the trailing edge, then to infinity along
    `wake_direction` (3,), a unit vector.
    """
    core = core_fraction * _section_width(strips.width)
    leg = segment_velocity(points, strips.bound, strips.trailing_edge, core)
    leg += semi_infinite_velocity(points, strips.trailing_edge, wake_direction, core)
    return leg[:, :, 1:] - leg[:, :, :-1]


def bound_influence(points, strips, wake_direction, core_fraction=CORE_FRACTION):
    """Velocity at `points` (p,3) on the bound vortices of each strip's unit circulation, (3, p, n) 1/m.

    A strip's own straight bound vortex adds nothing on its own line.
    """
    a = segment_velocity(points, strips.bound[:-1], strips.bound[1:], core_fraction * strips.width)
    return a + trailing_influence(points, strips, wake_direction, core_fraction)


def control_influence(strips, wake_direction, rows=slice(None), core_fraction=CORE_FRACTION):
    """Velocity at the control points `rows` of each strip's unit circulation, (3, p, n) 1/m, less its two-dimensional
    part.

    What a strip's own bound vortex would induce if it were infinitely long is in the section polar already, so it
    is taken away and the angle of attack at the control point is the effective one (Damiani et al. 2019).
    """
    points = strips.control[rows]
    core = core_fraction * strips.width
    a = bound_influence(points, strips, wake_direction, core_fraction)
    own = np.arange(len(strips.width))[rows]
    a[:, np.arange(len(own)), own] -= infinite_velocity(points, strips.centre[rows], strips.span[rows], core[rows])
    return a


def wake_influence(strips, wake_direction, rows=slice(None), core_fraction=CORE_FRACTION):
    """Half the velocity far behind the strips `rows` of each strip's unit circulation, (3, p, n) 1/m.

    There the trailing vortices are straight lines without end. By Munk's stagger theorem (1921) the induced drag does
    not depend on how the bound vortices are staggered along the wind, and for those that are not it is lift turned by
    half the far wash: with it the section forces add up to the drag of the Trefftz plane. The velocity at the bound
    vortices themselves has no limit where these are swept or kinked.
    """
    along = control_fractions(strips.width)[:, None]
    edge = strips.trailing_edge
    points = (edge[:-1] + along * (edge[1:] - edge[:-1]))[rows]
    core = core_fraction * _section_width(strips.width)
    line = 0.5 * line_velocity(points, edge, wake_direction, core)
    return line[:, :, 1:] - line[:, :, :-1]


def folded(a, mirror):
    """Influence (3, p, n) on the half `p` when strip j and its `mirror[j]` carry the same circulation: (3, p, p).

    The rows are the last p strips, the half y > 0.
    """
    n = a.shape[2]
    half = np.arange(n - a.shape[1], n)
    image = mirror[half]
    return a[:, :, half] + np.where(image == half, 0.0, a[:, :, image])


def _section_width(width):
    """Mean width (n+1,) of the strips on both sides of each section."""
    return np.concatenate([width[:1], 0.5 * (width[1:] + width[:-1]), width[-1:]])
