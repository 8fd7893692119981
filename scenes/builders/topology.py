"""What hangs together in a mesh of triangles: edges, neighbours, orientation, volumes, parts, rigid modes.

Functions of arrays. Triangles are (m,3), or (m,6) with their middle nodes behind the corners (`builders.mesh`), of
which only the corners count here unless a docstring says otherwise. Nothing loops over triangles.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from interface.topology import distinct_pairs, in_order, turning

from .mesh import SIDES

# Points and weights of a rule on the triangle that is exact to degree 4 (Dunavant 1985, six points, in closed form):
# the volume under a triangle of second order is of degree 4.
_ROOT = np.sqrt(38.0 - 44.0 * np.sqrt(0.4))
_A, _B = (8.0 - np.sqrt(10.0) + _ROOT) / 18.0, (8.0 - np.sqrt(10.0) - _ROOT) / 18.0
_POINTS = np.array([[_A, _A], [1 - 2 * _A, _A], [_A, 1 - 2 * _A], [_B, _B], [1 - 2 * _B, _B], [_B, 1 - 2 * _B]])
_SPREAD = np.sqrt(213125.0 - 53320.0 * np.sqrt(10.0))
_WEIGHTS = np.repeat([620.0 + _SPREAD, 620.0 - _SPREAD], 3) / 3720.0
RANK = 1e-8  # singular values over the largest, below which a motion counts as held or as none


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of triangles: `ends` (e,2) with the lower node first, `of_triangle` (m,3) the edges of the sides 0-1, 1-2,
    2-0, `forward` (m,3) whether the triangle runs along its side from the lower node, `count` (e,) triangles at each.
    """

    ends: np.ndarray
    of_triangle: np.ndarray
    forward: np.ndarray
    count: np.ndarray


def edges(triangles: np.ndarray) -> Edges:
    """The edges of triangles (m,3|6)."""
    sides = triangles[:, SIDES].reshape(-1, 2)
    ends, _, of = distinct_pairs(np.sort(sides, axis=1))
    forward = (sides[:, 0] < sides[:, 1]).reshape(-1, 3)
    return Edges(ends, of.reshape(-1, 3), forward, np.bincount(of, minlength=len(ends)))


def boundary_edges(triangles: np.ndarray) -> np.ndarray:
    """Open edges (b,2), of one triangle only, each in the sense in which its triangle runs along it."""
    found = edges(triangles)
    return triangles[:, SIDES][found.count[found.of_triangle] == 1]


def neighbours(triangles: np.ndarray) -> np.ndarray:
    """The triangle (m,3) across the sides 0-1, 1-2, 2-0; -1 where there is none, or more than one."""
    across = np.full((len(triangles), 3), -1)
    one, other, (side, back) = _pairs(edges(triangles))
    across[one, side], across[other, back] = other, one
    return across


def _pairs(found):
    """Triangles (p,) on either side of the edges of two, and which of their sides (2,p) these are."""
    flat = found.of_triangle.ravel()
    order = np.argsort(flat, kind="stable")
    order = order[found.count[flat[order]] == 2].reshape(-1, 2)
    return order[:, 0] // 3, order[:, 1] // 3, order.T % 3


def euler_characteristic(triangles: np.ndarray) -> int:
    """Nodes - edges + triangles: 2 of a sphere, 1 of a disc, 0 of a tube with open ends or a torus."""
    return len(np.unique(triangles[:, :3])) - len(edges(triangles).ends) + len(triangles)


def is_closed(triangles: np.ndarray) -> bool:
    """Whether triangles close bodies: every edge is run along once each way. None are not closed."""
    found = edges(triangles)
    along = np.bincount(found.of_triangle.ravel(), found.forward.ravel(), len(found.ends))
    return len(triangles) > 0 and bool(np.all(found.count == 2) and np.all(along == 1))


def connected_nodes(count: int, elements: Sequence[np.ndarray]) -> np.ndarray:
    """Which connected part (count,) each of `count` nodes belongs to; -1 of nodes that no element has.

    `elements` are arrays (e,k) of node indices: the nodes of one element hang together. Parts are numbered as their
    first nodes follow each other.
    """
    rows = np.concatenate([np.zeros(0, dtype=int), *(np.repeat(e[:, 0], e.shape[1] - 1) for e in elements if len(e))])
    columns = np.concatenate([np.zeros(0, dtype=int), *(e[:, 1:].ravel() for e in elements if len(e))])
    graph = sp.coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    label = connected_components(graph, directed=False)[1]
    used = np.zeros(count, dtype=bool)
    for e in elements:
        used[e.ravel()] = True
    part = np.full(count, -1)
    part[used] = in_order(label[used])
    return part


def connected_triangles(triangles: np.ndarray) -> np.ndarray:
    """Which connected part (m,) each triangle belongs to; triangles that share a node hang together."""
    nodes = int(triangles.max(initial=-1)) + 1
    return connected_nodes(nodes, (triangles,))[triangles[:, 0]]


@dataclass(frozen=True, eq=False)
class Orientation:
    """How triangles turn: the `patch` (m,) of each, which ends at open edges and where more than two meet; `flip` (m,)
    those to turn over so that neighbours agree; `orientable` and `closed` (patches,).
    """

    patch: np.ndarray
    flip: np.ndarray
    orientable: np.ndarray
    closed: np.ndarray


def orientation(triangles: np.ndarray) -> Orientation:
    """Which triangles (m,3|6) to turn over, the fewer of each patch, so that neighbours run opposite ways along their
    common edge. Nothing is to be turned in a patch of one side only, such as a Moebius strip.
    """
    found = edges(triangles)
    one, other, (side, back) = _pairs(found)
    agree = found.forward[one, side] != found.forward[other, back]
    turn = turning(len(triangles), one, other, agree)
    wrong = np.any(found.count[found.of_triangle] != 2, axis=1)
    return Orientation(turn.patch, turn.flip, turn.orientable, np.bincount(turn.patch, wrong) == 0)


def outward_flips(nodes: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Triangles to turn over, ascending: so that neighbours agree, and that closed patches point outward."""
    found = orientation(triangles)
    flip = found.flip.copy()
    signed = np.where(flip, -1.0, 1.0) * _cone_volumes(nodes, triangles)
    inward = (np.bincount(found.patch, signed) < 0.0) & found.closed & found.orientable
    return np.flatnonzero(flip ^ inward[found.patch])


def _shape_functions(points):
    """Shape functions (q,6) of the triangle of second order and their derivatives (q,6,2) at points (q,2)."""
    s, t = points.T
    r = 1.0 - s - t
    value = np.stack([r * (2 * r - 1), s * (2 * s - 1), t * (2 * t - 1), 4 * r * s, 4 * s * t, 4 * t * r], axis=1)
    zero = np.zeros_like(s)
    by_s = np.stack([1 - 4 * r, 4 * s - 1, zero, 4 * (r - s), 4 * t, -4 * t], axis=1)
    by_t = np.stack([1 - 4 * r, zero, 4 * t - 1, -4 * s, 4 * s, 4 * (r - t)], axis=1)
    return value, np.stack([by_s, by_t], axis=2)


_N, _DN = _shape_functions(_POINTS)


def area_vectors(nodes: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Area vectors (m,3) m^2 along the normals; of curved triangles of second order the integral of theirs."""
    if triangles.shape[1] == 3:
        x = nodes[triangles]
        return 0.5 * np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    return 0.5 * np.einsum("q,mqk->mk", _WEIGHTS, _normals(nodes, triangles))


def areas(nodes: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Areas (m,) m^2; of curved triangles of second order by a rule of degree 4."""
    if triangles.shape[1] == 3:
        return np.linalg.norm(area_vectors(nodes, triangles), axis=1)
    return 0.5 * np.linalg.norm(_normals(nodes, triangles), axis=2) @ _WEIGHTS


def _normals(nodes, triangles):
    """dx/ds x dx/dt (m,q,3) of triangles of second order at the points of the rule."""
    tangents = np.einsum("qaj,mak->mqjk", _DN, nodes[triangles])
    return np.cross(tangents[:, :, 0], tangents[:, :, 1])


def _cone_volumes(nodes, triangles):
    """Volumes (m,) m^3 between each triangle and the middle of all, 1/3 int x . n dA, exact to either order."""
    used = nodes[np.unique(triangles)]
    x = nodes[triangles] - used.mean(axis=0)
    if triangles.shape[1] == 3:
        return np.einsum("mk,mk->m", x[:, 0], np.cross(x[:, 1], x[:, 2])) / 6.0
    at = np.einsum("qa,mak->mqk", _N, x)
    return np.einsum("q,mqk,mqk->m", _WEIGHTS, at, _normals(nodes, triangles)) / 6.0


def enclosed_volume(nodes: np.ndarray, triangles: np.ndarray) -> float:
    """Volume m^3 that closed triangles enclose, positive where normals point outward; exact to either order.

    Whether they are closed is not asked (`is_closed`): of an open sheet it is the volume of the cone from its middle.
    """
    return float(_cone_volumes(nodes, triangles).sum()) if len(triangles) else 0.0


def open_sides(triangles: np.ndarray) -> np.ndarray:
    """Triangles, ascending, with a side that is not run along once each way."""
    found = edges(triangles)
    along = np.bincount(found.of_triangle.ravel(), found.forward.ravel(), len(found.ends))
    wrong = (found.count != 2) | (along != 1)
    return np.flatnonzero(np.any(wrong[found.of_triangle], axis=1))


@dataclass(frozen=True, eq=False)
class RigidMode:
    """A motion without strain: a translation along the unit vector `direction`, or a turn around it through the point
    `about` (3,) m, with `pitch` m of translation a radian; `about` None of a translation.
    """

    direction: np.ndarray
    about: np.ndarray | None = None
    pitch: float = 0.0

    def __str__(self) -> str:
        """'translation along x' or 'rotation about the axis along z through (0, 0, 1) m'."""
        along = _axis_name(self.direction)
        if self.about is None:
            return f"translation along {along}"
        point = ", ".join(f"{0.0 if abs(v) < 1e-9 else v:.4g}" for v in self.about)
        screw = f" with {self.pitch:.3g} m/rad along it" if self.pitch else ""
        return f"rotation about the axis along {along} through ({point}) m{screw}"


def _axis_name(direction):
    for k, axis in enumerate("xyz"):
        if abs(direction[k]) > 1.0 - 1e-9:
            return axis
    return "({})".format(", ".join(f"{0.0 if abs(v) < 1e-9 else v:.3g}" for v in direction))


def rigid_modes(nodes: np.ndarray, fixed: np.ndarray) -> tuple[RigidMode, ...]:
    """The rigid modes that the supports `fixed` (n,3), true where a node is held along an axis, leave to nodes (n,3) m.

    Translations come first. A motion that moves no node (the spin of nodes on one line) does not count. This is
    geometry: a flat sheet that can give way normal to itself has no rigid mode for that.
    """
    centre = nodes.mean(axis=0)
    arm = nodes - centre
    size = np.sqrt(np.einsum("nk,nk->n", arm, arm).max(initial=0.0)) or 1.0
    motion = np.zeros((len(nodes), 3, 6))
    motion[:, :, :3] = np.eye(3)
    motion[:, :, 3:] = np.cross(np.eye(3)[None], arm[:, None] / size).transpose(0, 2, 1)
    idle = _null_space(motion.reshape(-1, 6))
    free = _null_space(np.concatenate([motion[fixed], idle.T]))
    if not free.shape[1]:
        return ()
    shifts = free @ _null_space(free[3:])
    modes = [RigidMode(d) for d in _axes_of(shifts[:3])]
    turns = free - shifts @ (shifts.T @ free)
    for axis in _axes_of(turns[3:]):
        mode = turns @ np.linalg.lstsq(turns[3:], axis, rcond=RANK)[0]
        shift, spin = mode[:3], mode[3:] / size
        rate = np.linalg.norm(spin)
        pitch = float(shift @ spin / rate**2)
        about = centre + np.cross(spin, shift) / rate**2
        modes.append(RigidMode(spin / rate, about, pitch if abs(pitch) > RANK * size else 0.0))
    return tuple(modes)


def _null_space(matrix):
    """Orthonormal columns that a matrix (r,c) with entries of order one maps to zero."""
    if not len(matrix):
        return np.eye(matrix.shape[1])
    _, s, v = np.linalg.svd(matrix, full_matrices=matrix.shape[0] < matrix.shape[1])
    return v[int(np.sum(s > RANK * max(1.0, s.max()))) :].T


def _axes_of(vectors):
    """Unit vectors that span the columns of vectors (3,k): axes x, y, z where they are among them, then others."""
    u, s, _ = np.linalg.svd(vectors, full_matrices=False)
    u = u[:, s > RANK]
    inside = np.linalg.norm(u, axis=1) > 1.0 - 1e-9
    axes = list(np.eye(3)[inside])
    rest = u.copy()
    for axis in axes:
        rest = rest - np.outer(axis, axis @ rest)
    w, s, _ = np.linalg.svd(rest, full_matrices=False)
    other = w[:, s > 1e-6].T
    largest = np.abs(other).argmax(axis=1)
    sign = np.sign(other[np.arange(len(other)), largest])
    return [*axes, *(other * sign[:, None])]
