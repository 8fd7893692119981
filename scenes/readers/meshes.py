"""Meshes of triangles, or of panels, from files, in every format that meshio reads: Gmsh 2 and 4, VTK, STL, Abaqus,
Nastran and more.

Elements are numbered from 1 in the order of the file, points and lines included: the numbers of Gmsh, unless it was
told to renumber.
"""

import io
import warnings
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from interface.topology import agreed

from ..builders.mesh import Parts, TriangleMesh, renumbered, turned
from ..builders.mesh_checks import check_connected, check_no_loose_nodes, check_triangles, without_loose_nodes
from ..builders.topology import outward_flips
from ..schema import SceneError
from .tables import require_own

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "ft": 0.3048, "in": 0.0254}  # m
LARGEST = 100.0  # m across, beyond which a mesh whose unit is not given is taken to be in mm
SMALLEST = 1e-3  # m across, below which a given unit is doubted
GROUPS = ("gmsh:physical", "medit:ref")  # integer cell data in which formats keep the number of an element's group
DIMENSION = {"vertex": 0, "line": 1, "line3": 1, "triangle": 2, "triangle6": 2, "quad": 2}
TRIANGLES = ("vertex", "line", "line3", "triangle", "triangle6")  # elements of membranes
PANELS = ("vertex", "line", "triangle", "quad")  # elements of bodies
MISSING = (
    "reading a mesh file needs the package meshio, which is not installed; install it by pip install 'kitecosim[mesh]'."
)


def read_mesh(
    path: str | Path,
    unit: str | None = None,
    groups: str | None = None,
    drop_loose_nodes: bool = False,
    parts_may_be_apart: bool = False,
) -> TriangleMesh:
    """The mesh in a file, in m, checked, its parts named as the groups of the file are.

    `unit` of the file's lengths is one of UNITS, m by default. Groups are physical groups of Gmsh and named sets of
    other formats; a group without a name has its number. Where a format has neither (VTK), `groups` is the integer
    cell data that says which group each element is in. Triangles are turned over where neighbours disagree, closed
    surfaces outward; `remarks` say so. Nodes without elements are refused, or left out with `drop_loose_nodes`, and so
    are parts that do not hang together, unless `parts_may_be_apart`.

    Raises SceneError in one sentence with file and element numbers for whatever is wrong.
    """
    path = Path(path)
    label = f"{path.parent.name}/{path.name}" if path.parent.name else path.name
    if unit is not None and unit not in UNITS:
        raise SceneError(f"{label}: unit cannot be '{unit}'; choose one of: {', '.join(UNITS)}.")
    content, remarks = _content(path, label)
    blocks = _blocks(content, label)
    mesh = replace(_once(_assembled(content, blocks, label, groups, UNITS[unit or "m"])), remarks=remarks)
    check_triangles(mesh)
    check_size(label, mesh.nodes[np.unique(mesh.triangles)], unit, 'say unit = "mm"')
    if drop_loose_nodes:
        mesh = without_loose_nodes(mesh)
    check_no_loose_nodes(mesh)
    if not parts_may_be_apart:
        check_connected(mesh)
    return _oriented(mesh)


@dataclass(frozen=True, eq=False)
class PanelMesh:
    """Quads and triangles of a file as `panels` (m,4), a triangle repeating its last node, on `nodes` (n,3) m.

    `numbers` (m,) are those of the elements in the file; `line_groups` the groups of lines, pairs of nodes (k,2), -1 of
    nodes that no panel has.
    `label` says which file this is, `remarks` what was changed.
    """

    nodes: np.ndarray
    panels: np.ndarray
    numbers: np.ndarray
    line_groups: dict[str, np.ndarray]
    label: str
    remarks: tuple[str, ...]

    def lines_of(self, *names: str) -> np.ndarray:
        """Lines (k,2) in any of the named groups, each once; SceneError where there is no such group."""
        for name in names:
            if name not in self.line_groups:
                there = ", ".join(f"'{n}'" for n in self.line_groups) or "none"
                raise SceneError(
                    f"{self.label} has no line group '{name}'; there are: {there} (name it in the mesh, or correct the "
                    "name)."
                )
            if np.any(self.line_groups[name] < 0):
                raise SceneError(
                    f"{self.label}: lines of the group '{name}' are on no panel; mesh them with the surface."
                )
        return np.unique(np.concatenate([np.sort(self.line_groups[name], axis=1) for name in names]), axis=0)


def read_panels(path: str | Path, unit: str | None = None, groups: str | None = None) -> PanelMesh:
    """The quads and triangles in a file, in m, as they are written: nothing is turned over.

    `unit` and `groups` as in `read_mesh`. Elements that stand there once for each of their groups are one; nodes
    without a panel are left out, which `remarks` say. Raises SceneError in one sentence with file and element numbers.
    """
    path = Path(path)
    label = f"{path.parent.name}/{path.name}" if path.parent.name else path.name
    content, remarks = _content(path, label)
    blocks = _blocks(content, label, PANELS)
    named = _group_names(content, label, groups)
    panels, numbers, lines = [np.zeros((0, 4), dtype=int)], [np.zeros(0, dtype=int)], dict[str, list[np.ndarray]]()
    for (kind, data, first), at in zip(blocks, _places(content), strict=True):
        if DIMENSION[kind] == 2:
            panels.append(data if kind == "quad" else data[:, [0, 1, 2, 2]])
            numbers.append(first + np.arange(len(data)))
        elif DIMENSION[kind] == 1:
            for name, rows in named(at, 1, len(data)):
                lines.setdefault(name, []).append(data[rows])
    every, number = np.concatenate(panels), np.concatenate(numbers)
    if not len(every):
        raise SceneError(f"{label} has no quads and no triangles; a body is a surface of them: mesh its surfaces.")
    kept = np.sort(np.unique(every, axis=0, return_index=True)[1])
    points = UNITS[unit or "m"] * np.asarray(content.points, dtype=float)
    if points.shape[1] != 3:
        raise SceneError(f"{label} is flat, its nodes have two coordinates; the surface of a body has three.")
    used = np.unique(every)
    if len(used) < len(points):
        count = len(points) - len(used)
        remarks = (*remarks, f"{label}: {count} {agreed(count, 'node', 'nodes')} without a panel left out.")
    check_size(label, points[used], unit, 'say unit = "mm"')
    place = np.full(len(points), -1)
    place[used] = np.arange(len(used))
    of_lines = {name: place[np.concatenate(found)] for name, found in lines.items()}
    return PanelMesh(points[used], place[every[kept]], number[kept], of_lines, label, remarks)


def _content(path: Path, label: str) -> tuple[Any, tuple[str, ...]]:
    """What meshio makes of a file, and remarks; it prints and exits where it cannot read one: SceneError here."""
    try:
        import meshio
    except ModuleNotFoundError:
        raise SceneError(f"{label}: {MISSING}") from None
    require_own(path, label)
    if not path.is_file():
        raise SceneError(f"{label} does not exist; add the file or correct its name.")
    known = meshio.extension_to_filetypes
    endings = ["".join(path.suffixes[k:]).lower() for k in range(len(path.suffixes))]
    if not any(e in known for e in endings):
        given = f"'{path.suffix}'" if path.suffix else "a name without ending"
        raise SceneError(f"{label}: {given} is no format of meshes; save it as .msh (Gmsh 2 or 4), .vtu or .stl.")
    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said), warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            found = meshio.read(path, "gmsh" if _is_gmsh(path) else None)
    except ModuleNotFoundError as error:
        raise SceneError(f"{label} needs the package {error.name} to be read; install it, or save as .msh.") from None
    except (Exception, SystemExit) as error:  # readers of meshio raise whatever their parsing runs into
        reason = " ".join(str(error).split()) if not isinstance(error, SystemExit) else ""
        if "gmsh:physical" in reason:  # meshio wants all or none of version 4
            raise SceneError(
                f"{label}: some elements are in a physical group and others in none; save only those in groups "
                "(in Gmsh: Mesh.SaveAll = 0), or put all in groups."
            ) from None
        raise _unreadable(label, path, reason) from None
    if any("could not be read" in str(w.message) for w in caught):  # numpy, of numbers that are none
        raise _unreadable(label, path, "it ends too early")
    unclosed = "not closed" in said.getvalue()  # by Gmsh's $End...; all that the section announces has been read
    return found, (f"{label}: its last section has no end line; all of its elements are there.",) if unclosed else ()


def _is_gmsh(path: Path) -> bool:
    """Whether a .msh is one of Gmsh: Ansys has the same ending."""
    with path.open("rb") as file:
        return path.suffix.lower() == ".msh" and file.read(1) == b"$"


def _unreadable(label: str, path: Path, reason: str) -> SceneError:
    what = f" ({reason[:120]})" if reason else ""
    gmsh = path.suffix.lower() == ".msh"
    how = "in Gmsh with Mesh.MshFileVersion = 4.1 or 2.2" if gmsh else "for example as .msh or .vtu"
    return SceneError(f"{label} is not a readable {path.suffix} file{what}; save it again, {how}.")


def _blocks(content: Any, label: str, kinds: Sequence[str] = TRIANGLES) -> list[tuple[str, np.ndarray, int]]:
    """Type, nodes (e,k) and first element number of every block of cells, in the order of the file; all of one order,
    none of them other than of `kinds`.
    """
    blocks, number = [], 1
    for cells in content.cells:
        blocks.append((cells.type, np.asarray(cells.data, dtype=int), number))
        number += len(cells.data)
    blocks = [block for block in blocks if len(block[1])]
    for kind, data, first in blocks:
        if kind not in kinds:
            raise SceneError(_other_element(label, kind, data, first, kinds))
        bad = np.flatnonzero(np.any((data < 0) | (data >= len(content.points)), axis=1))
        if len(bad):
            raise SceneError(f"{label}: element {first + bad[0]} has a node that the file does not list; add the node.")
    there = {kind for kind, _, _ in blocks} - {"vertex"}
    if {"triangle", "line"} & there and {"triangle6", "line3"} & there:
        counts = ", ".join(f"{sum(len(d) for k, d, _ in blocks if k == kind)} {kind}" for kind in sorted(there))
        raise SceneError(f"{label} mixes elements of first and second order ({counts}); save all of one order.")
    return blocks


def _other_element(label: str, kind: str, data: np.ndarray, first: int, kinds: Sequence[str]) -> str:
    last = first + len(data) - 1
    which = f"element {first}" if len(data) == 1 else f"elements {first} to {last}"
    if kinds is PANELS:
        return (
            f"{label}: {which} {agreed(len(data), 'is', 'are')} of the type {kind}; a body has triangles of three and "
            "quads of four nodes, lines and points: save only these, of first order."
        )
    if kind.startswith("quad"):
        return (
            f"{label}: {which} {agreed(len(data), 'is a quad', 'are quads')} where triangles are asked; split them "
            "in the mesher (in Gmsh: without Recombine)."
        )
    return (
        f"{label}: {which} {agreed(len(data), 'is', 'are')} of the type {kind}; a mesh of membranes has triangles of "
        "three or six nodes, lines and points: save only these."
    )


def _assembled(content: Any, blocks: Sequence[Any], label: str, groups: str | None, scale: float) -> TriangleMesh:
    """The mesh of the blocks, with the parts of each dimension."""
    points = np.asarray(content.points, dtype=float)
    if len(points) and points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    order = 2 if any(kind in ("triangle6", "line3") for kind, _, _ in blocks) else 1
    found: dict[int, list[np.ndarray]] = {0: [], 1: [], 2: []}
    numbers: dict[int, list[np.ndarray]] = {0: [], 1: [], 2: []}
    parts: list[dict[str, list[np.ndarray]]] = [{}, {}, {}]
    offset = [0, 0, 0]
    named = _group_names(content, label, groups)
    for (kind, data, first), at in zip(blocks, _places(content), strict=True):
        d = DIMENSION[kind]
        found[d].append(data)
        numbers[d].append(first + np.arange(len(data)))
        for name, rows in named(at, d, len(data)):
            parts[d].setdefault(name, []).append(offset[d] + rows)
        offset[d] += len(data)
    vertices = np.concatenate([np.zeros((0, 1), dtype=int), *found[0]])[:, 0]
    of_points = {name: np.unique(vertices[np.concatenate(rows)]) for name, rows in parts[0].items()}
    for name, nodes in content.point_sets.items():
        of_points[name] = np.union1d(of_points.get(name, np.zeros(0, dtype=int)), np.asarray(nodes, dtype=int))
    return TriangleMesh(
        scale * points.reshape(-1, 3),
        np.concatenate([np.zeros((0, 3 * order), dtype=int), *found[2]]),
        np.concatenate([np.zeros((0, 1 + order), dtype=int), *found[1]]),
        _united(parts[2]),
        _united(parts[1]),
        of_points,
        label,
        np.concatenate([np.zeros(0, dtype=int), *numbers[2]]),
        np.concatenate([np.zeros(0, dtype=int), *numbers[1]]),
    )


def _once(mesh: TriangleMesh) -> TriangleMesh:
    """The mesh with elements once that stand in it once for each of their groups, as version 2 of Gmsh writes them.

    They have the same nodes in the same order, each in a group of its own; others that coincide stay as they are.
    """
    triangles, surface = _kept(mesh.triangles, mesh.triangle_parts)
    lines, line = _kept(mesh.lines, mesh.line_parts)
    return replace(
        mesh,
        triangles=mesh.triangles[triangles],
        lines=mesh.lines[lines],
        triangle_parts=surface,
        line_parts=line,
        triangle_numbers=mesh.triangle_numbers[triangles],
        line_numbers=mesh.line_numbers[lines],
    )


def _kept(elements: np.ndarray, parts: Parts) -> tuple[np.ndarray, Parts]:
    """Rows of elements to keep, and the parts with them."""
    n = len(elements)
    _, first, which = np.unique(elements, axis=0, return_index=True, return_inverse=True)
    to, own = first[which.ravel()] if n else np.zeros(0, dtype=int), np.arange(n)
    groups, apart = np.zeros(n, dtype=int), np.zeros(n, dtype=bool)
    for rows in parts.values():
        groups[rows] += 1
        apart |= np.bincount(to[rows], minlength=n) > 1
    apart |= np.bincount(to, groups == 0, n) > 0
    to = np.where(apart[to], own, to)
    kept = np.flatnonzero(to == own)
    return kept, {name: renumbered(to[rows], kept, n) for name, rows in parts.items()}


def _united(parts: dict[str, list[np.ndarray]]) -> Parts:
    return {name: np.unique(np.concatenate(rows)) for name, rows in parts.items()}


def _places(content: Any) -> list[int]:
    """Where blocks with elements stand among those of the file."""
    return [k for k, cells in enumerate(content.cells) if len(cells.data)]


def _group_names(content: Any, label: str, groups: str | None) -> Any:
    """A function of block, dimension and number of elements that lists (name, rows) of the groups in the block."""
    if groups is not None and groups not in content.cell_data:
        there = ", ".join(f"'{n}'" for n in content.cell_data) or "none"
        raise SceneError(f"{label} has no cell data '{groups}'; there are: {there} (correct the name in groups).")
    key = groups or next((k for k in GROUPS if k in content.cell_data), None)
    names = {(int(v[1]), int(v[0])): n for n, v in content.field_data.items() if np.size(v) == 2}
    sets = {n: rows for n, rows in content.cell_sets.items() if not n.startswith("gmsh:")}

    def of_block(block: int, dimension: int, count: int) -> list[tuple[str, np.ndarray]]:
        found = [(n, np.asarray(rows[block], dtype=int)) for n, rows in sets.items() if rows[block] is not None]
        if key is not None:
            tags = np.asarray(content.cell_data[key][block])
            if tags.shape != (count,) or np.any(tags != tags.astype(int)):
                raise SceneError(f"{label}: cell data '{key}' are no whole numbers; name others in groups.")
            for tag in np.unique(tags.astype(int)):
                name = names.get((dimension, int(tag)), str(tag) if tag or groups else "")
                if name:
                    found.append((name, np.flatnonzero(tags == tag)))
        return [(name, rows) for name, rows in found if len(rows)]

    return of_block


def check_size(label: str, used: np.ndarray, unit: str | None, remedy: str) -> None:
    """Raises where lengths of `used` nodes look like mm, with what to do then, or like m where another unit was
    given.
    """
    across = float(np.ptp(used, axis=0).max())
    if unit is None and across > LARGEST:
        raise SceneError(
            f'{label} is {across:.4g} m across: its lengths look like mm; {remedy}, or unit = "m" if it is that large.'
        )
    if unit not in (None, "m") and across < SMALLEST:
        raise SceneError(
            f'{label} is {across:.3g} m across with unit = "{unit}"; its lengths look like m: say unit = "m".'
        )


def _oriented(mesh: TriangleMesh) -> TriangleMesh:
    """With the triangles turned over that disagree with their neighbours, or point into what they close."""
    rows = outward_flips(mesh.nodes, mesh.triangles)
    if not len(rows):
        return mesh
    text = (
        f"{mesh.label}: {len(rows)} of {len(mesh.triangles)} triangles {agreed(len(rows), 'was', 'were')} turned over, "
        f"so that normals agree and point out of what is closed ({mesh.called(rows)})."
    )
    return replace(turned(mesh, rows), remarks=(*mesh.remarks, text))
