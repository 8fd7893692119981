"""What is wrong with a mesh, read or generated: each check raises SceneError in one sentence that names elements."""

from collections.abc import Sequence

import numpy as np

from interface.topology import agreed, listed

from ..schema import SceneError
from .mesh import SIDES, TriangleMesh, loose_nodes, without_nodes
from .patterns import THIN, pattern_areas
from .topology import connected_nodes, edges, enclosed_volume, open_sides, orientation, rigid_modes

# A middle node must lie nearer to the middle of its side than this times the length: at a quarter along the side the
# map of the triangle is singular; an arc of 120 degrees is 0.29 away, the middle of another side of equal length 0.5.
ALONG, AWAY = 0.25, 0.4
FAR = 1e9  # m from the origin
SHOWN = 4  # parts named in a sentence


def check_triangles(mesh: TriangleMesh) -> None:
    """Raises where there are no triangles, a node is no finite point, an element has a node twice, triangles have no
    area or stand twice, or a middle node of second order is off its side or not that of the neighbour.
    """
    if not len(mesh.triangles):
        raise SceneError(f"{mesh.label} has no triangles; a membrane is a surface of triangles: mesh its surfaces.")
    bad = np.flatnonzero(~np.all(np.abs(mesh.nodes) <= FAR, axis=1))
    if len(bad):
        where = agreed(len(bad), "is at no finite place", "are at no finite places")
        raise SceneError(f"{mesh.label}: node{listed(1 + bad)} {where} within {FAR:g} m; correct the coordinates.")
    x = mesh.nodes[mesh.corners]
    area = 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
    longest = np.linalg.norm(x[:, [1, 2, 0]] - x, axis=2).max(axis=1)
    flat = np.flatnonzero(area <= THIN * longest**2)
    if len(flat):
        raise SceneError(
            f"{mesh.label}: {mesh.called(flat)} {_has(flat)} no area (corners on one line or at one point); mend the "
            "mesh there."
        )
    short = np.flatnonzero(np.all(mesh.nodes[mesh.lines[:, 0]] == mesh.nodes[mesh.lines[:, 1]], axis=1))
    if len(short):
        numbers = listed(mesh.line_numbers[short])
        raise SceneError(f"{mesh.label}: line element{numbers} {_has(short)} no length; mend the mesh there.")
    _, first, same = np.unique(np.sort(mesh.corners, axis=1), axis=0, return_index=True, return_inverse=True)
    again = np.flatnonzero(first[same.ravel()] != np.arange(len(mesh.triangles)))
    if len(again):
        one = mesh.triangle_numbers[first[same.ravel()[again[0]]]]
        raise SceneError(
            f"{mesh.label}: {mesh.called(again)} {agreed(len(again), 'stands', 'stand')} on the corners of another "
            f"triangle (the first on those of element {one}); delete one of each."
        )
    if mesh.order == 2:
        _check_middle_nodes(mesh)


def _has(rows):
    return agreed(len(rows), "has", "have")


def _check_middle_nodes(mesh):
    ends, middle = mesh.nodes[mesh.triangles[:, SIDES]], mesh.nodes[mesh.triangles[:, 3:]]
    side = ends[:, :, 1] - ends[:, :, 0]
    length = np.linalg.norm(side, axis=2)
    off = middle - ends.mean(axis=2)
    along = np.abs(np.einsum("msk,msk->ms", off, side)) / length**2
    away = np.linalg.norm(off, axis=2) / length
    to_sides = np.linalg.norm(middle[:, :, None] - ends.mean(axis=2)[:, None], axis=3)
    wrong = (along >= ALONG) | (away > AWAY) | (np.einsum("mss->ms", to_sides) > to_sides.min(axis=2))
    rows = np.flatnonzero(wrong.any(axis=1))
    if len(rows):
        k = int(np.argmax(wrong[rows[0]]))
        raise SceneError(
            f"{mesh.label}: a middle node of {mesh.called(rows)} is off its side (node "
            f"{mesh.triangles[rows[0], 3 + k] + 1}, {away[rows[0], k]:.2g} of the length from the middle); nodes of a "
            "triangle are its corners 1, 2, 3, then the middles of 1-2, 2-3, 3-1, each near the middle."
        )
    found = edges(mesh.triangles)
    own = np.full(len(found.ends), -1)
    own[found.of_triangle] = mesh.triangles[:, 3:]
    differs = np.zeros(len(own), dtype=bool)
    differs[found.of_triangle[own[found.of_triangle] != mesh.triangles[:, 3:]]] = True
    rows = np.flatnonzero(differs[found.of_triangle].any(axis=1))
    if len(rows):
        raise SceneError(
            f"{mesh.label}: {mesh.called(rows)} {_has(rows)} a side with the corners of a neighbour's but another "
            "middle node; merge the two nodes."
        )


def check_no_loose_nodes(mesh: TriangleMesh) -> None:
    """Raises where nodes belong to no element."""
    loose = loose_nodes(mesh)
    if len(loose):
        belongs = agreed(len(loose), "belongs", "belong")
        raise SceneError(
            f"{mesh.label}: node{listed(1 + loose)} of {len(mesh.nodes)} {belongs} to no triangle and no line; delete "
            "such nodes, or drop them by drop_loose_nodes."
        )


def without_loose_nodes(mesh: TriangleMesh) -> TriangleMesh:
    """The mesh without the nodes that no element has."""
    return without_nodes(mesh, loose_nodes(mesh))


def check_connected(mesh: TriangleMesh, others: Sequence[np.ndarray] = ()) -> None:
    """Raises where triangles and lines, with `others` (e,k) elements on the same nodes, do not hang together."""
    part = connected_nodes(len(mesh.nodes), (mesh.triangles, mesh.lines, *others))
    of_triangle, of_line = part[mesh.triangles[:, 0]], part[mesh.lines[:, 0]]
    count = part.max(initial=-1) + 1
    if count < 2:
        return
    triangles, lines = np.bincount(of_triangle, minlength=count), np.bincount(of_line, minlength=count)
    told = []
    for k in np.argsort(-(triangles + lines), kind="stable")[:SHOWN]:
        if triangles[k]:
            first = mesh.triangle_numbers[np.flatnonzero(of_triangle == k)[0]]
            told.append(f"{triangles[k]} {agreed(triangles[k], 'triangle', 'triangles')} with element {first}")
        elif lines[k]:
            first = mesh.line_numbers[np.flatnonzero(of_line == k)[0]]
            told.append(f"{lines[k]} {agreed(lines[k], 'line', 'lines')} with element {first}")
    more = f" and {count - SHOWN} more" if count > SHOWN else ""
    raise SceneError(
        f"{mesh.label} falls into {count} parts that share no node ({'; '.join(told)}{more}); merge the nodes where "
        "they touch (in Gmsh: Coherence), or allow it by parts_may_be_apart."
    )


def check_pressurised(mesh: TriangleMesh, rows: np.ndarray | None = None) -> None:
    """Raises where the triangles `rows`, all by default, cannot be under one pressure: where more than two meet at an
    edge, neighbours have opposite normals, or a surface has one side only.
    """
    rows = np.arange(len(mesh.triangles)) if rows is None else np.asarray(rows)
    triangles = mesh.triangles[rows]
    found = edges(triangles)
    many = np.flatnonzero(found.count > 2)
    if len(many):
        at = rows[np.flatnonzero(found.of_triangle.ravel() == many[0]) // 3]
        a, b = 1 + found.ends[many[0]]
        others = f" and {len(many) - 1} more edges" if len(many) > 1 else ""
        raise SceneError(
            f"{mesh.label}: {found.count[many[0]]} triangles under pressure meet at the edge of nodes {a} and {b} "
            f"({mesh.called(at)}){others}; leave all but two of each out of the group that has the pressure."
        )
    side = orientation(triangles)
    if not np.all(side.orientable):
        at = rows[np.flatnonzero(~side.orientable[side.patch])]
        raise SceneError(
            f"{mesh.label}: the surface under pressure of {mesh.called(at)} has one side only, like a Moebius strip; "
            "cut it open."
        )
    if side.flip.any():
        at = rows[np.flatnonzero(side.flip)]
        raise SceneError(
            f"{mesh.label}: under pressure, {agreed(len(at), 'the normal', 'the normals')} of {mesh.called(at)} "
            f"{agreed(len(at), 'points', 'point')} to the other side than the neighbours'; turn "
            f"{agreed(len(at), 'it', 'them')} over."
        )


def check_closed(mesh: TriangleMesh, rows: np.ndarray | None = None) -> float:
    """The volume m^3 that the triangles `rows`, all by default, enclose; raises where they do not close one, or where
    their normals point inward.
    """
    rows = np.arange(len(mesh.triangles)) if rows is None else np.asarray(rows)
    check_pressurised(mesh, rows)
    triangles = mesh.triangles[rows]
    at = rows[open_sides(triangles)]
    if len(at) or not len(rows):
        what = f"is open at {mesh.called(at)}" if len(at) else "has no triangles"
        raise SceneError(
            f"{mesh.label}: the surface of a closed volume {what}; add what closes it to the group, or merge the nodes "
            "along the gap."
        )
    volume = enclosed_volume(mesh.nodes, triangles)
    if volume < 0.0:
        raise SceneError(
            f"{mesh.label}: the normals of the closed volume of {mesh.called(rows)} point inward; turn them over."
        )
    return volume


def check_pattern(mesh: TriangleMesh, pattern: np.ndarray) -> None:
    """Raises where a pattern (m,3|6,2) has no area or runs clockwise."""
    area = pattern_areas(pattern)
    size = np.linalg.norm(np.ptp(pattern[:, :3], axis=1), axis=1)
    none, inverted = np.abs(area) <= THIN * size**2, area < 0.0
    for wrong, what in ((none, "no area"), (inverted, "its corners clockwise")):
        rows = np.flatnonzero(wrong)
        if len(rows):
            raise SceneError(
                f"{mesh.label}: the pattern of {mesh.called(rows)} has {what}; correct it, or turn the triangle over."
            )


def check_supports(
    mesh: TriangleMesh, fixed: np.ndarray, others: Sequence[np.ndarray] = (), hanging: bool = False
) -> None:
    """Raises where the supports `fixed` (n,3), true where a node is held along an axis, leave rigid modes to a part of
    triangles and lines, with `others` (e,k) elements on the same nodes; where they are `hanging`, translations only:
    their weight turns them to where they come to rest.
    """
    part = connected_nodes(len(mesh.nodes), (mesh.triangles, mesh.lines, *others))
    count = part.max(initial=-1) + 1
    for k in range(count):
        at = np.flatnonzero(part == k)
        modes = rigid_modes(mesh.nodes[at], fixed[at])
        if hanging:
            modes = tuple(mode for mode in modes if mode.about is None)
        if modes:
            which = _first_element(mesh, part, k) if count > 1 else ""
            raise SceneError(
                f"{mesh.label}: the supports leave {len(modes)} rigid {agreed(len(modes), 'mode', 'modes')}{which} "
                f"({'; '.join(map(str, modes))}); hold more nodes or directions."
            )


def _first_element(mesh, part, k):
    for elements, numbers in ((mesh.triangles, mesh.triangle_numbers), (mesh.lines, mesh.line_numbers)):
        rows = np.flatnonzero(part[elements[:, 0]] == k)
        if len(rows):
            return f" to the part with element {numbers[rows[0]]}"
    return ""
