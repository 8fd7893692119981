"""Exact potentials and velocities of single panels, strips and filaments at single points, in numpy.

Arrays have the pairs of a point and a panel in their last axis.
"""

import numpy as np

from interface.vectors import cross

TINY = 1e-280  # keeps logarithms and quotients at corners finite, where their factors are zero
SNAP = 1e-14  # height over a triangle, as a fraction of the distance to its corners, that is rounding
FOUR_PI = 4.0 * np.pi


def dot(a, b):
    """Scalar products along the first axis."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _angle(height, doubled, scale, empty, a, b, c, ab, bc, ca):
    """Solid angle of a triangle, positive from below: tan(Omega / 2) = a.(b x c) / (abc + (a.b)c + (b.c)a + (c.a)b)
    (van Oosterom and Strackee 1983); a.(b x c) is height times twice the area. Zero from a point in its plane, the mean
    of both sides where that lies on the triangle.
    """
    below = a * b * c + ab * c + bc * a + ca * b
    angle = 2.0 * np.arctan2(height * doubled, np.where(empty > 0.0, 1.0, below))
    return np.where(np.abs(height) <= SNAP * scale, 0.0, angle)


def _edge_integral(length, a, b, ab, distance2):
    """int ds / r along an edge: log((a + b + l) / (a + b - l)), with a + b - l = 2 (a b + a.b) / (a + b + l).

    Between the ends a b + a.b is the square of the edge's distance times l^2 over a b - a.b.
    """
    along = np.where(ab > 0.0, a * b + ab, distance2 * length**2 / np.maximum(a * b - ab, TINY))
    return np.log(np.maximum((a + b + length) ** 2, TINY) / np.maximum(2.0 * along, TINY))


def pair_potentials(near, points, doublet=True, source=True):
    """Potentials (n,) of unit doublet and of unit source density [m] of panels at points, one of each a pair.

    `near` (48,n) as in PanelGeometry, `points` (3,n). The source's is -1/(4 pi) (sum d_k L_k - sum h Omega), of each
    triangle times its share, with the distance d_k of the edges within the plane of a triangle and the height h below
    it (Hess and Smith 1967).
    """
    a = [near[3 * k : 3 * k + 3] - points for k in range(4)]
    r = [np.sqrt(dot(v, v)) for v in a]
    products = {pair: dot(a[pair[0]], a[pair[1]]) for pair in ((0, 1), (1, 2), (0, 2), (2, 3), (0, 3))}
    heights = [dot(a[0], near[12:15]), dot(a[0], near[15:18])]
    angles = []
    for t, (i, j, k) in enumerate(((0, 1, 2), (0, 2, 3))):
        sides = products[i, j], products[j, k], products[i, k]
        angles.append(_angle(heights[t], near[18 + t], r[0] + r[2], near[43 + t], r[i], r[j], r[k], *sides))
    doublets = (angles[0] + angles[1]) / FOUR_PI if doublet else None
    if not source:
        return doublets, None
    one, other = near[45], near[46]
    total = -one * heights[0] * angles[0] - other * heights[1] * angles[1]
    distances = [dot(a[first], near[20 + 3 * k : 23 + 3 * k]) for k, first in enumerate((0, 1, 2, 0, 2, 3))]
    squares = [distances[k] ** 2 + heights[k // 3] ** 2 for k in range(6)]
    squares[2] = np.maximum(squares[2], squares[3])  # the diagonal; a triangle without area knows no distance
    for weight, square, length, (i, j) in (
        (one * distances[0], squares[0], near[38], (0, 1)),
        (one * distances[1], squares[1], near[39], (1, 2)),
        (one * distances[2] + other * distances[3], squares[2], near[40], (0, 2)),
        (other * distances[4], squares[4], near[41], (2, 3)),
        (other * distances[5], squares[5], near[42], (0, 3)),
    ):
        total = total + weight * _edge_integral(length, r[i], r[j], products[i, j], square)
    return doublets, total / -FOUR_PI


def _segment(a, b, ra, rb, edge, core):
    """Gradient (3,n) [1/m] of the solid angle by one straight edge from `a` to `b`, both seen from the points, as far
    off as `ra` and `rb`.

    (a x b)(|a| + |b|) / (|a||b| (|a||b| + a.b)), times c^2 / (c^2 + core^2), c the distance to the line; none on it.
    """
    ab, normal = dot(a, b), cross(a, edge, axis=0)
    square, product = dot(normal, normal), ra * rb
    between = (product - ab) / np.maximum(square, TINY)
    factor = (ra + rb) / np.maximum(product, TINY) * np.where(ab > 0.0, 1.0 / np.maximum(product + ab, TINY), between)
    core2 = core**2 * dot(edge, edge)
    seen = square > SNAP**2 * dot(edge, edge) * (ra + rb) ** 2
    return normal * np.where(seen, factor * square / np.maximum(square + core2, TINY), 0.0)


def _half_line(a, direction, core):
    """Gradient (3,n) [1/m] of the solid angle by the edge from `a` along the unit `direction` to infinity.

    (a x d) / (|a| (|a| + a.d)), otherwise as `_segment`.
    """
    ra, along = np.sqrt(dot(a, a)), dot(a, direction)
    normal = cross(a, direction, axis=0)
    square = dot(normal, normal)
    beside = (ra - along) / np.maximum(square, TINY)
    factor = np.where(along > 0.0, 1.0 / np.maximum(ra + along, TINY), beside) / np.maximum(ra, TINY)
    seen = square > SNAP**2 * ra**2
    return normal * np.where(seen, factor * square / np.maximum(square + core**2, TINY), 0.0)


def doublet_velocities(near, points, core=0.0):
    """Gradients (3,n) [1/m] of the potentials of unit doublets: those of vortex rings along the four edges.

    `near` (48,n), `points` (3,n). `core` m: the velocity falls to zero within about this distance of an edge.
    """
    corners = [near[3 * k : 3 * k + 3] for k in range(4)]
    a = [corner - points for corner in corners]
    r = [np.sqrt(dot(v, v)) for v in a]
    total = np.zeros_like(a[0])
    for k in range(4):
        after = (k + 1) % 4
        total += _segment(a[k], a[after], r[k], r[after], corners[after] - corners[k], core)
    return total / FOUR_PI


def source_velocities(near, points):
    """Gradients (3,n) of the potentials of unit source densities: (sum nu_k L_k - sum n Omega) / (4 pi), of each
    triangle times its share, with the outward normals nu of the edges. `near` (48,n), `points` (3,n).
    """
    a = [near[3 * k : 3 * k + 3] - points for k in range(4)]
    r = [np.sqrt(dot(v, v)) for v in a]
    products = {pair: dot(a[pair[0]], a[pair[1]]) for pair in ((0, 1), (1, 2), (0, 2), (2, 3), (0, 3))}
    total, heights = 0.0, []
    for t, (i, j, k) in enumerate(((0, 1, 2), (0, 2, 3))):
        normal = near[12 + 3 * t : 15 + 3 * t]
        heights.append(dot(a[0], normal))
        sides = products[i, j], products[j, k], products[i, k]
        angle = _angle(heights[t], near[18 + t], r[0] + r[2], near[43 + t], r[i], r[j], r[k], *sides)
        total = total - near[45 + t] * normal * angle
    outward = [near[20 + 3 * k : 23 + 3 * k] for k in range(6)]
    squares = [dot(a[first], outward[k]) ** 2 + heights[k // 3] ** 2 for k, first in enumerate((0, 1, 2, 0, 2, 3))]
    squares[2] = np.maximum(squares[2], squares[3])  # the diagonal; a triangle without area knows no distance
    for weight, square, length, (i, j) in (
        (near[45] * outward[0], squares[0], near[38], (0, 1)),
        (near[45] * outward[1], squares[1], near[39], (1, 2)),
        (near[45] * outward[2] + near[46] * outward[3], squares[2], near[40], (0, 2)),
        (near[46] * outward[4], squares[4], near[41], (2, 3)),
        (near[46] * outward[5], squares[5], near[42], (0, 3)),
    ):
        total = total + weight * _edge_integral(length, r[i], r[j], products[i, j], square)
    return total / FOUR_PI


def strip_velocities(strips, points, core=0.0):
    """Gradients (3,n) [1/m] of the potentials of unit doublets on semi-infinite strips; arguments as there."""
    a, b, direction = strips[:3], strips[3:6], strips[6:9]
    start, end = b - points, a - points
    far = np.sqrt(dot(start, start)), np.sqrt(dot(end, end))
    edges = _half_line(end, direction, core) - _half_line(start, direction, core)
    return (_segment(start, end, *far, a - b, core) + edges) / FOUR_PI


def strip_potentials(strips, points):
    """Potentials (n,) of unit doublets on semi-infinite strips with the corners b, a, a + L d, b + L d, L -> infinity,
    at `points` (3,n), one of each a pair; `strips` (16,n): a, b, unit d, normal a - b x d (3 each) and its length.

    The solid angle of the spherical triangle of b, a and d.
    """
    a, b, direction = strips[:3] - points, strips[3:6] - points, strips[6:9]
    ra, rb = np.sqrt(dot(a, a)), np.sqrt(dot(b, b))
    height = dot(b, strips[9:12])
    below = ra * rb + dot(a, b) + dot(a, direction) * rb + dot(b, direction) * ra
    flat = np.abs(height) <= SNAP * (ra + rb) * strips[12]
    return np.where(flat, 0.0, 2.0 * np.arctan2(height, below)) / FOUR_PI
