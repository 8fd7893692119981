"""A mesh of triangles, lines and points with named parts, whether read or generated, and what is made of meshes."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from interface.topology import distinct_pairs, listed

from ..schema import SceneError

SIDES = ((0, 1), (1, 2), (2, 0))  # corners that side 0, 1, 2 of a triangle joins
TURNED = (0, 2, 1, 5, 4, 3)  # the nodes of a triangle that is turned over

Parts = dict[str, np.ndarray]


def _none() -> np.ndarray:
    return np.zeros((0, 2), dtype=int)


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Nodes and elements, arrays of node indices from 0.

    `nodes` (n,3) m. `triangles` (m,3), or (m,6) of second order: corners 0, 1, 2, then the nodes 3 on the side 0-1,
    4 on 1-2 and 5 on 2-0, as Gmsh and VTK have them; all are of one order. The normal is that of the right hand along
    the corners. `lines` (k,2), or (k,3): both ends, then the node between. Parts by name: `triangle_parts` rows of
    triangles, `line_parts` rows of lines, `point_parts` nodes; an element may belong to several. `label` says in
    sentences which mesh this is, `triangle_numbers` (m,) and `line_numbers` (k,) what an element is called there, from
    1; `remarks` what was changed when it was made.
    """

    nodes: np.ndarray
    triangles: np.ndarray
    lines: np.ndarray = field(default_factory=_none)
    triangle_parts: Parts = field(default_factory=dict)
    line_parts: Parts = field(default_factory=dict)
    point_parts: Parts = field(default_factory=dict)
    label: str = "mesh"
    triangle_numbers: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    line_numbers: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Numbers from 1 where there are none."""
        for name, count in (("triangle_numbers", len(self.triangles)), ("line_numbers", len(self.lines))):
            if len(getattr(self, name)) != count:
                object.__setattr__(self, name, 1 + np.arange(count))

    @property
    def corners(self) -> np.ndarray:
        """Corner nodes (m,3) of the triangles."""
        return self.triangles[:, :3]

    @property
    def order(self) -> int:
        """1 of triangles with three nodes, 2 with six."""
        return 2 if self.triangles.shape[1] == 6 else 1

    def triangles_of(self, *names: str) -> np.ndarray:
        """Rows of the triangles in any of the named parts, ascending; SceneError where there is no such part."""
        return self._rows("surface", self.triangle_parts, names)

    def lines_of(self, *names: str) -> np.ndarray:
        """Rows of the lines in any of the named parts, ascending; SceneError where there is no such part."""
        return self._rows("line", self.line_parts, names)

    def nodes_of(self, *names: str) -> np.ndarray:
        """Nodes, ascending, of the named parts, be they of points, lines or triangles; SceneError as above."""
        found = []
        for name in names:
            every = [
                np.ravel(elements[parts[name]])
                for elements, parts in (
                    (np.arange(len(self.nodes)), self.point_parts),
                    (self.lines, self.line_parts),
                    (self.triangles, self.triangle_parts),
                )
                if name in parts
            ]
            if not every:
                known = dict.fromkeys([*self.point_parts, *self.line_parts, *self.triangle_parts])
                self._missing("", name, known)
            found += every
        return _united(found)

    def _rows(self, kind: str, parts: Parts, names: Sequence[str]) -> np.ndarray:
        for name in names:
            if name not in parts:
                self._missing(f"{kind} ", name, parts)
        return _united([parts[name] for name in names])

    def _missing(self, kind: str, name: str, known: Iterable[str]) -> None:
        there = ", ".join(f"'{n}'" for n in known) or "none"
        raise SceneError(
            f"{self.label} has no {kind}group '{name}'; there are: {there} (name it in the mesh, or correct the name)."
        )

    def called(self, rows: np.ndarray, most: int = 5) -> str:
        """'element 7', 'elements 7, 9 and 12' or 'elements 7, 9, ... and 31 more' of rows of triangles."""
        return "element" + listed(self.triangle_numbers[np.asarray(rows)], most)


def _united(rows: Sequence[np.ndarray]) -> np.ndarray:
    return np.unique(np.concatenate([np.zeros(0, dtype=int), *rows]))


def turned(mesh: TriangleMesh, rows: np.ndarray) -> TriangleMesh:
    """The mesh with the triangles `rows` turned over: their normals point to the other side."""
    triangles = mesh.triangles.copy()
    order = TURNED[: triangles.shape[1]]
    triangles[rows] = triangles[rows][:, order]
    return replace(mesh, triangles=triangles)


def mirrored(mesh: TriangleMesh, axis: int) -> TriangleMesh:
    """The mirror image in the plane through the origin across an axis (0, 1, 2), normals mirrored too."""
    nodes = mesh.nodes.copy()
    nodes[:, axis] *= -1.0
    return turned(replace(mesh, nodes=nodes), np.arange(len(mesh.triangles)))


def joined(meshes: Sequence[TriangleMesh], tolerance: float = 0.0) -> TriangleMesh:
    """One mesh of several, with parts of one name united, and nodes no further apart than `tolerance` m made one.

    All meshes must be of one order, else ValueError. Elements are numbered anew, as they follow each other.
    """
    width = max(m.lines.shape[1] for m in meshes)
    if len({m.order for m in meshes}) > 1 or any(len(m.lines) and m.lines.shape[1] != width for m in meshes):
        raise ValueError("elements of first and of second order cannot be joined; make all meshes of one order first.")
    first = meshes[0]
    nodes, rows, lines = (np.cumsum([0, *map(len, counts)])[:-1] for counts in (
        [m.nodes for m in meshes], [m.triangles for m in meshes], [m.lines for m in meshes]
    ))  # fmt: skip
    every = TriangleMesh(
        np.concatenate([m.nodes for m in meshes]),
        np.concatenate([m.triangles + at for m, at in zip(meshes, nodes, strict=True)]),
        np.concatenate([m.lines + at for m, at in zip(meshes, nodes, strict=True) if m.lines.shape[1] == width]),
        _gathered([m.triangle_parts for m in meshes], rows),
        _gathered([m.line_parts for m in meshes], lines),
        _gathered([m.point_parts for m in meshes], nodes),
        first.label,
        remarks=tuple(remark for m in meshes for remark in m.remarks),
    )
    return welded(every, tolerance) if tolerance > 0.0 else every


def _gathered(parts: Sequence[Parts], offsets: np.ndarray) -> Parts:
    names = dict.fromkeys(name for part in parts for name in part)
    return {n: _united([p[n] + at for p, at in zip(parts, offsets, strict=True) if n in p]) for n in names}


def welded(mesh: TriangleMesh, tolerance: float) -> TriangleMesh:
    """The mesh with nodes no further apart than `tolerance` m made one, the first of each; what collapses goes.

    A triangle collapses where two of its corners become one, a line where its ends do, and a line whose nodes another
    one has already is left out: its parts are those of the first then. Nodes of collapsed sides go with them.
    """
    pairs = cKDTree(mesh.nodes).query_pairs(tolerance, output_type="ndarray")
    n = len(mesh.nodes)
    graph = sp.coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    group = connected_components(graph, directed=False)[1]
    first = np.full(group.max(initial=-1) + 1, n)
    np.minimum.at(first, group, np.arange(n))
    to = first[group]
    triangles, lines = to[mesh.triangles], to[mesh.lines]
    whole = np.flatnonzero(np.all(triangles[:, :3] != np.roll(triangles[:, :3], -1, axis=1), axis=1))
    ends = np.sort(lines[:, :2], axis=1)
    _, one, same = distinct_pairs(ends)
    own = one[same]  # the first line of the same ends
    kept = np.flatnonzero((own == np.arange(len(lines))) & (ends[:, 0] != ends[:, 1]))
    return without_nodes(
        replace(
            mesh,
            triangles=triangles[whole],
            lines=lines[kept],
            triangle_parts={k: renumbered(rows, whole, len(triangles)) for k, rows in mesh.triangle_parts.items()},
            line_parts={k: renumbered(own[rows], kept, len(lines)) for k, rows in mesh.line_parts.items()},
            point_parts={k: np.unique(to[rows]) for k, rows in mesh.point_parts.items()},
            triangle_numbers=1 + np.arange(len(whole)),
            line_numbers=1 + np.arange(len(kept)),
        ),
        np.setdiff1d(np.arange(n), _used(triangles[whole], lines[kept], to[loose_nodes(mesh)], mesh.point_parts, to)),
    )


def _used(triangles, lines, loose, parts, to):
    return np.concatenate([triangles.ravel(), lines.ravel(), loose, *(to[rows] for rows in parts.values())])


def renumbered(rows: np.ndarray, kept: np.ndarray, count: int) -> np.ndarray:
    """Where `rows` of `count` stand among the ones that are `kept`; those that are not are left out."""
    place = np.full(count, -1)
    place[kept] = np.arange(len(kept))
    found = place[rows]
    return np.unique(found[found >= 0])


def loose_nodes(mesh: TriangleMesh) -> np.ndarray:
    """Nodes that no triangle and no line has."""
    used = np.zeros(len(mesh.nodes), dtype=bool)
    used[mesh.triangles.ravel()] = True
    used[mesh.lines.ravel()] = True
    return np.flatnonzero(~used)


def without_nodes(mesh: TriangleMesh, dropped: np.ndarray) -> TriangleMesh:
    """The mesh without the nodes `dropped`, which no element may have; points of parts that are dropped go too."""
    kept = np.setdiff1d(np.arange(len(mesh.nodes)), dropped)
    place = np.full(len(mesh.nodes), -1)
    place[kept] = np.arange(len(kept))
    points = {k: renumbered(rows, kept, len(mesh.nodes)) for k, rows in mesh.point_parts.items()}
    return replace(
        mesh,
        nodes=mesh.nodes[kept],
        triangles=place[mesh.triangles],
        lines=place[mesh.lines],
        point_parts={k: rows for k, rows in points.items() if len(rows)},
    )


def quadratic(mesh: TriangleMesh, project: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None):
    """The mesh with triangles of six nodes and lines of three: one new node on every edge, shared by all that have it.

    The new nodes lie half way between the ends, or where `project` puts them: it takes their places (q,3) m and both
    ends (q,2) as nodes of the mesh, and returns places (q,3) m. A mesh of second order comes back as it is.
    """
    if mesh.order == 2:
        return mesh
    m, n = len(mesh.triangles), len(mesh.nodes)
    sides = np.concatenate([mesh.triangles[:, s] for s in SIDES] + [mesh.lines[:, :2]])
    ends, _, edge = distinct_pairs(np.sort(sides, axis=1))
    middle = 0.5 * (mesh.nodes[ends[:, 0]] + mesh.nodes[ends[:, 1]])
    if project is not None:
        middle = project(middle, ends)
    new = n + edge
    return replace(
        mesh,
        nodes=np.concatenate([mesh.nodes, middle]),
        triangles=np.column_stack([mesh.triangles, new[: 3 * m].reshape(3, m).T]),
        lines=np.column_stack([mesh.lines[:, :2], new[3 * m :]]),
    )
