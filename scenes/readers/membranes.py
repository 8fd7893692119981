"""The membranes of a scene: mesh, fabrics, supports, pressures and cables of [membranes], checked and put together with
the nodes of the tables.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from interface.topology import agreed
from structural.elements.membranes import Membranes, flat_patterns
from structural.materials.membranes import LinearMembrane

from ..builders.mesh import TriangleMesh, quadratic
from ..builders.mesh_checks import check_closed, check_pattern, check_pressurised, check_supports
from ..builders.parafoils import panels_across
from ..builders.patterns import fibre_angles, laid_flat, pattern_lengths, pattern_of_lengths, shortened
from ..builders.topology import boundary_edges
from ..builders.wings import ClosedSurface
from ..members import MembraneMesh, MembranePressure, MembraneSupport
from ..schema import CableInput, Choices, FabricInput, MembranesInput, SceneError
from .elements import Element
from .membrane_shapes import made_mesh
from .meshes import check_size, read_mesh
from .tables import positive, read_table, whole

ISOTROPIC = ("stiffness", "modulus", "thickness", "poisson")
ORTHOTROPIC = ("stiffness_warp", "stiffness_weft", "shear_stiffness", "poisson_warp")
ONLY_FILE = ("unit", "groups", "drop_loose_nodes", "parts_may_be_apart")
ONLY_SHAPE = ("size", "profiles", "attachments", "panel_shortening")
IN_PLANE = 1e-9  # of the extent of the mesh, within which an edge lies in a plane of symmetry


@dataclass(frozen=True, eq=False)
class Placed:
    """Nodes of tables and mesh together: `labels`, `nodes` (n,3) m, `fixed` (n,3), the `membranes`, and the `cables`
    with where they are declared.
    """

    labels: tuple[str, ...]
    nodes: np.ndarray
    fixed: np.ndarray
    membranes: MembraneMesh
    cables: tuple[tuple[Element, str], ...]


def read_membranes(
    folder: Path,
    given: MembranesInput,
    choices: Choices,
    labels: tuple[str, ...],
    nodes: np.ndarray,
    fixed: np.ndarray,
    alone: bool,
    dead: bool,
    surface: ClosedSurface | None = None,
) -> Placed:
    """The membranes of a scene on the nodes of its tables (`labels`, `nodes` (n,3) m, `fixed` (n,3)) and their own.

    `alone`: nothing but membranes and their cables holds the nodes of the mesh, so that supports must leave no rigid
    mode; `dead`: loads of a direction of their own let it turn about its supports to where it is at rest. `surface` is
    that of [body], whose skin they may be. SceneError in one sentence for whatever is wrong.
    """
    where = f"{folder.name}/scene.toml: [membranes"
    mesh = _mesh(folder, given, choices, surface)
    place = _tied(where, given.tie, mesh, labels, nodes)
    more = np.flatnonzero(place >= len(nodes))
    labels = (*labels, *_labels(mesh, more, labels))
    nodes = np.concatenate([nodes, mesh.nodes[more]])
    fixed = np.concatenate([fixed, np.zeros((len(more), 3), dtype=bool)])
    supports = []
    for name, axes in given.supports.items():
        at, held = place[mesh.nodes_of(name)], np.array([axis in axes for axis in "xyz"])
        fixed[at] |= held
        supports.append(MembraneSupport(name, at, held))
    cables = tuple(found for name, cable in given.cables.items() for found in _cables(where, name, cable, mesh, place))
    group, fabric = _group(folder, given, choices, mesh, place, surface)
    if alone:
        check_supports(mesh, fixed[place], hanging=dead)
    pressures = tuple(_pressures(where, given, mesh, place, fixed[place]))
    seams = {name: place[sides] for name, sides in _seams(mesh).items()}
    names = tuple(element.name for element, _ in cables)
    skin = None if surface is None else place[: len(surface.nodes)]
    return Placed(
        labels,
        nodes,
        fixed,
        MembraneMesh(group, tuple(given.fabrics), fabric, tuple(supports), pressures, seams, names, mesh.remarks, skin),
        cables,
    )


# Mesh and nodes


def _mesh(folder: Path, given: MembranesInput, choices: Choices, surface: ClosedSurface | None) -> TriangleMesh:
    """The mesh of a file or of a shape, of the wanted order."""
    where, order = f"{folder.name}/scene.toml: [membranes]", choices.order or given.order
    if (given.mesh is None) == (given.shape is None):
        what = "has neither a mesh nor a shape" if given.mesh is None else "has a mesh and a shape"
        raise SceneError(f"{where} {what}; name a file in 'mesh', or one of the shapes in 'shape'.")
    odd = [key for key in (ONLY_FILE if given.mesh is None else ONLY_SHAPE) if getattr(given, key)]
    if given.unit == "m" and odd[:1] == ["unit"]:
        odd = odd[1:]  # it says that a shape is meant to be that large
    if odd:
        raise SceneError(f"{where} {odd[0]} means nothing to a {'shape' if given.mesh is None else 'file'}; drop it.")
    if given.mesh is None:
        made = made_mesh(folder, given, choices, order, surface)
        check_size(made.label, made.nodes[np.unique(made.triangles)], given.unit, "give sizes and profiles in m")
        return made
    if choices.cells:
        raise SceneError(f"{folder.name}/scene.toml: [settings.cells] means nothing to a mesh from a file; remove it.")
    file = given.unit, given.groups, given.drop_loose_nodes, given.parts_may_be_apart
    mesh = read_mesh(folder / given.mesh, *file)
    if order < mesh.order:
        raise SceneError(
            f"{mesh.label} has triangles of order {mesh.order}, and [membranes] order is 1; say order = 2."
        )
    return quadratic(mesh) if order == 2 else mesh


def _tied(where: str, tie: float, mesh: TriangleMesh, labels: Sequence[str], nodes: np.ndarray) -> np.ndarray:
    """Where the nodes of the mesh stand in the structure (m,): at a node of the table that is as near as `tie` m, or
    behind all of these.
    """
    place = np.full(len(mesh.nodes), -1)
    near = cKDTree(mesh.nodes).query_ball_point(nodes, tie) if len(nodes) else []
    for node, found in enumerate(near):
        if len(found) > 1:
            raise SceneError(
                f"{where}] tie of {tie:g} m joins node '{labels[node]}' to {len(found)} nodes of {mesh.label}; make it "
                "smaller."
            )
        if found and place[found[0]] >= 0:
            raise SceneError(
                f"{where}] tie of {tie:g} m joins the nodes '{labels[place[found[0]]]}' and '{labels[node]}' to one "
                f"node of {mesh.label}; make it smaller, or one node of the two."
            )
        if found:
            place[found[0]] = node
    own = place < 0
    place[own] = len(nodes) + np.arange(np.count_nonzero(own))
    return place


def _labels(mesh: TriangleMesh, own: np.ndarray, taken: Sequence[str]) -> list[str]:
    """Labels of the nodes `own` of the mesh: the name of the point that they are, or their number."""
    known = set(taken)
    points: dict[int, str] = {}
    for name, rows in mesh.point_parts.items():
        if len(rows) == 1 and " " not in name and name not in known:
            points.setdefault(int(rows[0]), name)
    found = [points.get(n, f"mesh_{n + 1}") for n in own.tolist()]
    twice = known & set(found)
    if twice:
        raise SceneError(f"the node '{min(twice)}' has the name of a node of {mesh.label}; rename it.")
    return found


# Fabrics


def _group(
    folder: Path,
    given: MembranesInput,
    choices: Choices,
    mesh: TriangleMesh,
    place: np.ndarray,
    surface: ClosedSurface | None = None,
) -> tuple[Membranes, np.ndarray]:
    """The elements, and the number (e,) of the fabric that each is of."""
    where = f"{folder.name}/scene.toml: [membranes"
    if not given.fabrics:
        raise SceneError(f"{where}] has no fabric; add a table [membranes.fabrics.NAME].")
    fabrics, of = list(given.fabrics.values()), _fabric_of(where, given, mesh)
    e1, e2, nu, g = np.array([_constants(f"{where}.fabrics.{name}]", f) for name, f in given.fabrics.items()])[of].T
    wrinkling = given.wrinkling if choices.wrinkling is None else choices.wrinkling == "on"
    law = LinearMembrane(e1, e2, nu, g, wrinkling)
    pattern, angle = _pattern(folder, given, mesh), np.zeros(len(of))
    if given.panel_shortening and surface is not None:
        pattern = _narrowed(f"{where}] panel_shortening", given.panel_shortening, mesh, pattern, surface)
    for k, (name, fabric) in enumerate(given.fabrics.items()):
        rows = np.flatnonzero(of == k)
        cut = _cut(f"{where}.fabrics.{name}]", fabric, _only(mesh, rows), pattern[rows])
        pattern[rows], angle[rows] = cut
    mass = np.array([f.density for f in fabrics])[of]
    strength = np.array([np.inf if f.strength is None else f.strength for f in fabrics])[of]
    group = Membranes(
        place[mesh.triangles],
        pattern,
        law,
        angle if angle.any() else None,
        mass if mass.any() else None,
        tuple(f"membrane_{n}" for n in mesh.triangle_numbers),
        strength if np.isfinite(strength).any() else None,
    )
    return group, of


def _fabric_of(where: str, given: MembranesInput, mesh: TriangleMesh) -> np.ndarray:
    """Number (e,) of the fabric of each triangle: each has one."""
    names, of = list(given.fabrics), np.full(len(mesh.triangles), -1)
    for k, fabric in enumerate(given.fabrics.values()):
        rows = np.arange(len(of)) if fabric.parts is None else mesh.triangles_of(*fabric.parts)
        twice = rows[of[rows] >= 0]
        if len(twice):
            raise SceneError(
                f"{where}.fabrics.{names[k]}]: {mesh.called(twice)} of {mesh.label} {agreed(len(twice), 'is', 'are')} "
                f"of the fabric '{names[of[twice[0]]]}' too; correct the parts of the two."
            )
        of[rows] = k
    bare = np.flatnonzero(of < 0)
    if len(bare):
        raise SceneError(
            f"{where}.fabrics]: {mesh.called(bare)} of {mesh.label} {agreed(len(bare), 'is', 'are')} of no fabric; add "
            "a group that has them to the parts of one."
        )
    return of


def _constants(where: str, fabric: FabricInput) -> tuple[float, float, float, float]:
    """E1, E2 N/m, nu12 and G N/m of a fabric."""
    alike, woven = ([key for key in keys if getattr(fabric, key) is not None] for keys in (ISOTROPIC, ORTHOTROPIC))
    if alike and woven:
        raise SceneError(
            f"{where} has '{alike[0]}' and '{woven[0]}': a fabric is alike in all directions, or has warp and weft; "
            "drop one."
        )
    if woven:
        lacking = [key for key in (*ORTHOTROPIC, "warp_direction") if getattr(fabric, key) is None]
        if lacking:
            raise SceneError(f"{where} lacks '{lacking[0]}', which a fabric with warp and weft needs; add it.")
        e1, e2, g, nu = (getattr(fabric, key) for key in ORTHOTROPIC)
        most = np.sqrt(e1 / e2)
        if not abs(nu) < most:
            raise SceneError(
                f"{where} is no material: poisson_warp is {nu:g} with stiffness_warp {e1:g} and stiffness_weft {e2:g} "
                f"N/m, and its size must be below sqrt({e1:g} / {e2:g}) = {most:.4g}, or stretching would set energy "
                "free; correct one of them."
            )
        return e1, e2, nu, g
    e = _stiffness(where, fabric)
    if fabric.poisson is None:
        raise SceneError(f"{where} lacks 'poisson'; add it.")
    return e, e, fabric.poisson, e / (2.0 * (1.0 + fabric.poisson))


def _stiffness(where: str, fabric: FabricInput) -> float:
    """E h N/m of a fabric that is alike in all directions."""
    modulus, thickness = fabric.modulus, fabric.thickness
    if fabric.stiffness is not None:
        if modulus is not None or thickness is not None:
            raise SceneError(f"{where} has a stiffness, and a modulus or thickness: their product; drop one.")
        return fabric.stiffness
    if modulus is None and thickness is None:
        raise SceneError(
            f"{where} lacks 'stiffness' (or 'modulus' and 'thickness', or those of warp and weft); add it."
        )
    if modulus is None or thickness is None:
        raise SceneError(f"{where} lacks '{'thickness' if thickness is None else 'modulus'}'; add it.")
    return modulus * thickness


def _pattern(folder: Path, given: MembranesInput, mesh: TriangleMesh) -> np.ndarray:
    """The cut of each triangle, as it stands or as the table of patterns has it."""
    pattern = flat_patterns(mesh.nodes, mesh.triangles)
    if given.patterns is None:
        return pattern
    if mesh.order == 2:
        raise SceneError(f"{folder.name}/scene.toml: [membranes] patterns are for triangles of order 1; drop them.")
    columns = {"element": whole, "side_12_m": positive, "side_23_m": positive, "side_31_m": positive}
    table = read_table(folder / given.patterns, columns)
    lengths, row_of = pattern_lengths(pattern), {int(n): row for row, n in enumerate(mesh.triangle_numbers)}
    seen: set[int] = set()
    for row, number in enumerate(table["element"]):
        if number not in row_of:
            raise SceneError(f"{table.at(row)}: {mesh.label} has no triangle {number}; correct the number.")
        if number in seen:
            raise SceneError(f"{table.at(row)}: element {number} has a pattern in an earlier row too; delete one.")
        seen.add(number)
        lengths[row_of[number]] = [table[key][row] for key in list(columns)[1:]]
    return pattern_of_lengths(lengths, replace(mesh, label=f"{folder.name}/{given.patterns}"))


def _narrowed(
    where: str,
    shortening: Sequence[tuple[float, float]],
    mesh: TriangleMesh,
    pattern: np.ndarray,
    surface: ClosedSurface,
) -> np.ndarray:
    """The cut with the panels of a wing narrower across the span, by `shortening` per cent at shares of the chord."""
    shares, percent = np.array(shortening).T
    if np.any(np.diff(shares) <= 0.0) or shares[0] < 0.0 or shares[-1] > 1.0:
        raise SceneError(f"{where}: shares of the chord must rise from 0, the nose, to 1; correct their order.")
    if percent.max() >= 100.0:
        raise SceneError(
            f"{where} of {percent.max():g} % is more than the panel is wide; give less than 100 % of the width."
        )
    rows, share, across = panels_across(surface)
    factor = 1.0 - 0.01 * np.interp(share, shares, percent)
    narrow = _only(mesh, rows)
    pattern = pattern.copy()
    pattern[rows] = shortened(pattern[rows], factor, 1.0, fibre_angles(narrow, pattern[rows], across))
    return pattern


def _cut(where: str, fabric: FabricInput, mesh: TriangleMesh, pattern: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The patterns of a fabric with its shortening, and the angles (m,) of its warp."""
    along, across = (1.0 - 0.01 * s for s in (fabric.shortening_along, fabric.shortening_across))
    flat, angle = pattern.shape[2] == 2, np.zeros(len(pattern))
    if fabric.warp_direction is not None:
        drawn = pattern if flat else laid_flat(mesh.nodes, mesh.triangles)
        angle = fibre_angles(mesh, drawn, np.array(fabric.warp_direction))
    if along == across:
        pattern = along * pattern
    elif fabric.warp_direction is None:
        raise SceneError(f"{where} is shortened along and across alike, or along its warp: add 'warp_direction'.")
    elif not flat:
        raise SceneError(
            f"{where} has curved triangles, which can be shortened along and across alike only; take order = 1."
        )
    else:
        pattern = shortened(pattern, along, across, angle)
    if flat:
        check_pattern(mesh, pattern)
    return pattern, angle


def _only(mesh: TriangleMesh, rows: np.ndarray) -> TriangleMesh:
    """Some triangles of a mesh, without parts."""
    numbers = mesh.triangle_numbers[rows]
    return replace(mesh, triangles=mesh.triangles[rows], triangle_numbers=numbers, triangle_parts={})


# Pressures, seams and cables


def _pressures(where: str, given: MembranesInput, mesh: TriangleMesh, place: np.ndarray, fixed: np.ndarray):
    for name, pressure in given.pressures.items():
        if not name.isidentifier():
            raise SceneError(f"{where}.pressures]: '{name}' cannot name a parameter; use letters, digits and _.")
        rows = None if pressure.parts is None else mesh.triangles_of(*pressure.parts)
        check_pressurised(mesh, rows)
        faces = mesh.triangles if rows is None else mesh.triangles[rows]
        encloses = _closed_by_symmetry(mesh.nodes, boundary_edges(faces), fixed)
        if pressure.closed and not encloses:
            check_closed(mesh, rows)
        yield MembranePressure(name, pressure.value, place[faces], encloses)


def _closed_by_symmetry(nodes: np.ndarray, edges: np.ndarray, fixed: np.ndarray) -> bool:
    """Whether a surface with these open edges (b,2) encloses a volume: it has none, or each stays in one of the planes
    x = 0, y = 0, z = 0, its nodes held normal to it.
    """
    near = np.abs(nodes[edges]) <= IN_PLANE * np.ptp(nodes, axis=0).max()
    return bool(np.all(np.any(np.all(near & fixed[edges], axis=1), axis=1)))


def _seams(mesh: TriangleMesh) -> dict[str, np.ndarray]:
    """Group of lines -> those of its sides (k,2) that are sides of triangles; groups without any are left out."""
    base = len(mesh.nodes)

    def keys(ends):
        ends = np.sort(ends, axis=1)
        return ends[:, 0] * base + ends[:, 1]

    sides = np.unique(keys(mesh.corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)))
    found = {}
    for name, rows in mesh.line_parts.items():
        ends = mesh.lines[rows, :2]
        ends = ends[np.isin(keys(ends), sides)]
        if len(ends):
            found[name] = ends
    return found


def _cables(where: str, name: str, cable: CableInput, mesh: TriangleMesh, place: np.ndarray):
    """Tension-only elements along the lines of a group, two for each line of second order, and where they stand."""
    if not name.isprintable() or " " in name:
        raise SceneError(f"{where}.cables]: '{name}' cannot name a cable; leave blanks out.")
    lines = mesh.lines[mesh.lines_of(*(cable.group or (name,)))]
    pairs = lines if lines.shape[1] == 2 else lines[:, [0, 2, 2, 1]].reshape(-1, 2)
    drawn = np.linalg.norm(mesh.nodes[pairs[:, 1]] - mesh.nodes[pairs[:, 0]], axis=1)
    rest = (1.0 - 0.01 * cable.shortening) * drawn
    for k, (ends, l0) in enumerate(zip(place[pairs].tolist(), rest.tolist(), strict=True)):
        stiffness, mass = cable.axial_stiffness / l0, cable.mass_per_length * l0
        yield Element(f"{name}_{k + 1}", tuple(ends), l0, stiffness, 0.0, False, mass), f"{where}.cables.{name}]"
