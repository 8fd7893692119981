"""Triangles of six nodes, the corners and then the middles of the sides 01, 12, 20: shape functions, integration.

Natural coordinates (r, s) run from node 0 to nodes 1 and 2; the triangle has the area 1/2 in them.
"""

import numpy as np


def t6_functions(points):
    """Quadratic shape functions (p,6) at natural coordinates `points` (p,2)."""
    r, s = np.asarray(points, float).T
    l = 1.0 - r - s
    corners = [l * (2.0 * l - 1.0), r * (2.0 * r - 1.0), s * (2.0 * s - 1.0)]
    return np.stack([*corners, 4.0 * l * r, 4.0 * r * s, 4.0 * s * l], axis=1)


def t6_slopes(points):
    """Their derivatives (p,6,2) by r and s."""
    r, s = np.asarray(points, float).T
    l, zero = 1.0 - r - s, np.zeros_like(r)
    by_r = [1.0 - 4.0 * l, 4.0 * r - 1.0, zero, 4.0 * (l - r), 4.0 * s, -4.0 * s]
    by_s = [1.0 - 4.0 * l, zero, 4.0 * s - 1.0, -4.0 * r, 4.0 * r, 4.0 * (l - s)]
    return np.stack([np.stack(by_r, axis=1), np.stack(by_s, axis=1)], axis=2)


def _symmetric_points(corner, weight):
    """Three points at natural distance `corner` from the sides that meet in a corner, with a weight each."""
    far = 1.0 - 2.0 * corner
    return np.array([[corner, corner], [far, corner], [corner, far]]), np.full(3, weight)


# Points (p,2) and weights (p,), which sum to 1/2, exact for polynomials of degree 2, and of degree 4 (Dunavant 1985).
DEGREE_2 = _symmetric_points(1.0 / 6.0, 1.0 / 6.0)
_OUTER, _INNER = (0.091576213509770743, 0.054975871827660933), (0.44594849091596488, 0.11169079483900573)
_PARTS = zip(_symmetric_points(*_OUTER), _symmetric_points(*_INNER), strict=True)
DEGREE_4 = tuple(np.concatenate(pair) for pair in _PARTS)
