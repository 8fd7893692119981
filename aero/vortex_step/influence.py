"""Influence of the horseshoe vortices of all strips on the strips' own points."""

import numpy as np

from .strips import control_fractions
from .vortices import infinite_velocity, line_velocity, segment_velocity, semi_infinite_velocity

# Core radius as a fraction of the strip width. Only filaments that come closer than about a tenth of a strip notice it;
# 0.05 is the value of Damiani et al. (2019).
CORE_FRACTION = 0.05


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
