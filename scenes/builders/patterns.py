"""Flat patterns: the unstressed shape that every triangle has by itself, whatever shape the mesh starts from.

A pattern is an array (m,3,2) m, or (m,6,2) of second order: the nodes of each triangle laid out in a plane of its own,
counterclockwise. Fabric has its directions there: an angle is from the first axis of the pattern towards the second.
"""

import numpy as np

from interface.topology import listed

from ..schema import SceneError
from .mesh import SIDES, TriangleMesh

THIN = 1e-9  # area over the square of the longest side, below which a triangle has none
STEEP = 1e-3  # a direction whose share within a triangle is below this stands on it


def flat_pattern(flat_nodes: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The pattern of triangles (m,3|6) whose nodes lie at `flat_nodes` (n,2) m, or (n,3) with z left out, when flat."""
    return flat_nodes[triangles][:, :, :2]


def laid_flat(nodes: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The pattern that triangles (m,3|6) have as they stand at nodes (n,3) m: first corner at the origin, the side 0-1
    along the first axis. Middle nodes are projected on the plane of the corners.
    """
    x = nodes[triangles] - nodes[triangles[:, :1]]
    along, across = _frame(x)
    return np.stack([np.einsum("mak,mk->ma", x, along), np.einsum("mak,mk->ma", x, across)], axis=2)


def _frame(x):
    """Unit vectors (m,3) along the side 0-1 of triangles (m,a,3), and in their planes across it."""
    along = x[:, 1] - x[:, 0]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    across = x[:, 2] - x[:, 0]
    across = across - np.einsum("mk,mk->m", across, along)[:, None] * along
    return along, across / np.linalg.norm(across, axis=1, keepdims=True)


def pattern_of_lengths(lengths: np.ndarray, mesh: TriangleMesh | None = None) -> np.ndarray:
    """The pattern (m,3,2) of triangles with the `lengths` (m,3) m of the sides 0-1, 1-2, 2-0.

    SceneError where three lengths make no triangle; `mesh` has the names of elements for that sentence.
    """
    a, b, c = np.asarray(lengths, dtype=float).T
    with np.errstate(divide="ignore", invalid="ignore"):
        x = 0.5 * (a * a + c * c - b * b) / a
        height2 = c * c - x * x
    longest = np.maximum(np.maximum(a, b), c)
    wrong = np.flatnonzero(~(height2 > (2.0 * THIN * longest) ** 2) | ~(np.minimum(np.minimum(a, b), c) > 0.0))
    if len(wrong):
        label, numbers = ("pattern", 1 + wrong) if mesh is None else (mesh.label, mesh.triangle_numbers[wrong])
        one = wrong[0]
        raise SceneError(
            f"{label}: the pattern of element{listed(numbers)} is no triangle (sides of {a[one]:.4g}, {b[one]:.4g} and "
            f"{c[one]:.4g} m{'' if len(wrong) == 1 else ' of the first'}: each must be shorter than the other two "
            "together); correct the lengths."
        )
    zero = np.zeros_like(a)
    return np.stack([zero, zero, a, zero, x, np.sqrt(height2)], axis=1).reshape(-1, 3, 2)


def pattern_lengths(pattern: np.ndarray) -> np.ndarray:
    """Lengths (m,3) m of the straight sides 0-1, 1-2, 2-0."""
    return np.linalg.norm(pattern[:, [e for _, e in SIDES]] - pattern[:, [s for s, _ in SIDES]], axis=2)


def pattern_areas(pattern: np.ndarray) -> np.ndarray:
    """Areas (m,) m^2 between the corners, negative where they run clockwise."""
    (x1, y1), (x2, y2) = (pattern[:, k].T - pattern[:, 0].T for k in (1, 2))
    return 0.5 * (x1 * y2 - x2 * y1)


def shortened(pattern: np.ndarray, along, across=1.0, angle=0.0) -> np.ndarray:
    """The pattern with lengths times the factor `along` in the direction `angle` rad, and times `across` normal to it.

    Each is a number, or (m,) one a triangle. Factors below one are a shorter cut, which is taut at the start shape.
    ValueError for a factor that is not above zero.
    """
    along, across, angle = (np.broadcast_to(np.asarray(v, dtype=float), len(pattern)) for v in (along, across, angle))
    if not (np.all(along > 0.0) and np.all(across > 0.0)):
        raise ValueError(f"factors of a pattern must be above zero; the least is {min(along.min(), across.min()):g}.")
    c, s = np.cos(angle), np.sin(angle)
    turn = np.stack([c, s, -s, c], axis=1).reshape(-1, 2, 2)  # rows: the direction, and that normal to it
    scale = np.einsum("mki,mk,mkj->mij", turn, np.stack([along, across], axis=1), turn)
    return np.einsum("mij,maj->mai", scale, pattern)


def fibre_angles(mesh: TriangleMesh, pattern: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Angles (m,) rad, in the pattern, of the line that a `direction` (3,) or (m,3) in space leaves on each triangle.

    The line is found on the start shape and goes with the material into the pattern. SceneError where a direction
    stands on its triangle.
    """
    x = mesh.nodes[mesh.corners]
    towards = np.broadcast_to(np.asarray(direction, dtype=float), (len(x), 3))
    towards = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    along, across = _frame(x)
    within = np.stack([np.einsum("mk,mk->m", towards, v) for v in (along, across)], axis=1)
    steep = np.flatnonzero(np.linalg.norm(within, axis=1) < STEEP)
    if len(steep):
        raise SceneError(
            f"{mesh.label}: the fibre direction is normal to {mesh.called(steep)}, so it has no angle there; give "
            "another direction for these."
        )
    now, then = (p[:, 1:3] - p[:, :1] for p in (laid_flat(mesh.nodes, mesh.corners), pattern))
    share = np.linalg.solve(now.transpose(0, 2, 1), within[:, :, None])
    line = np.einsum("mak,ma->mk", then, share[:, :, 0])
    return np.arctan2(line[:, 1], line[:, 0])
