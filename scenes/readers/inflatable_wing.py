"""The mesh of an inflatable wing: tubes divided into beams, canopy between the ribs, attachments on rigid links."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..members import Tubes, WingMesh
from ..schema import SceneError, StructureInput
from .span_order import check_span_order
from .tables import name, names, positive, read_table

# An attachment this close to a station, as part of the chord, depends on the beam node there instead of on one of
# its own: shorter beams would only stiffen the numbers.
SNAP = 0.02


def read_wing_mesh(
    folder: Path,
    structure: StructureInput,
    labels: list[str],
    nodes: np.ndarray,
    fixed: np.ndarray,
    stations: int,
    subdivisions: int,
    wind: tuple[float, ...],
) -> WingMesh:
    """The wing of the tables ribs, tubes and attachments: `stations` canopy cells along every chord, `subdivisions`
    between neighbouring ribs, which go from left to right as seen facing the `wind`.

    A tube from the leading to the trailing edge node of a rib is a strut: its beams end at the stations and where lines
    are attached. A tube between neighbouring leading edge nodes is part of the leading edge and is divided with the
    canopy. Raises `SceneError` in one sentence for whatever does not fit.
    """
    mesher = _Mesher(folder, structure, labels, nodes, fixed)
    ribs = mesher.ribs(wind)
    mesher.lay_grid(ribs, stations, subdivisions)
    mesher.lay_tubes(ribs, subdivisions)
    return mesher.finished()


class _Mesher:
    def __init__(self, folder, structure, labels, nodes, fixed):
        self.folder, self.structure, self.fixed = folder, structure, fixed.any(axis=1)
        self.labels = list(labels)
        self.place = {label: i for i, label in enumerate(labels)}
        self.points = [np.array(p) for p in nodes]
        self.rotations: dict[tuple[int, str], int] = {}  # node, hinged tube or "" -> nodal rotation
        self.beams: list[tuple[int, int, int, int, float, str]] = []

    def node(self, label, where):
        if label not in self.place:
            raise SceneError(f"{where}: node '{label}' is not in the node table; add it or correct the name.")
        return self.place[label]

    def add(self, label, point):
        if label in self.place:
            raise SceneError(
                f"{self.folder.name}/{self.structure.nodes}: the name '{label}' is taken by the mesh of the wing; "
                "rename that node."
            )
        self.place[label] = len(self.labels)
        self.labels.append(label)
        self.points.append(np.asarray(point, float))
        return self.place[label]

    def rotation(self, node, hinged=""):
        return self.rotations.setdefault((node, hinged), len(self.rotations))

    def ribs(self, wind):
        """Leading and trailing edge nodes (ribs, 2) from the left tip to the right one."""
        path = self.folder / self.structure.ribs
        table = read_table(path, {"leading_edge_node": name, "trailing_edge_node": name})
        if len(table) < 2:
            raise SceneError(f"{path.parent.name}/{path.name} needs at least two ribs; add one.")
        columns = ("leading_edge_node", "trailing_edge_node")
        ribs = np.array([[self.node(table[c][row], table.at(row)) for c in columns] for row in range(len(table))])
        points = np.array(self.points)
        for row, (le, te) in enumerate(ribs):
            if np.linalg.norm(points[te] - points[le]) == 0.0:
                raise SceneError(f"{table.at(row)}: leading and trailing edge are one point; name two nodes apart.")
        check_span_order(table, "ribs", points[ribs.T], wind)
        if len(np.unique(ribs)) < ribs.size:
            raise SceneError(f"{path.parent.name}/{path.name}: two ribs share a node; give each its own edges.")
        return ribs

    def lay_grid(self, ribs, stations, subdivisions):
        """Nodes of the canopy at equal parts of the chord and of the way from rib to rib."""
        points = np.array(self.points)
        bays = len(ribs) - 1
        grid = []
        for column in range(bays * subdivisions + 1):
            bay, part = divmod(column, subdivisions)
            bay, eta = (bay, part / subdivisions) if bay < bays else (bays - 1, 1.0)
            le, te = (1.0 - eta) * points[ribs[bay]] + eta * points[ribs[bay + 1]]
            edge = ribs[bay if part == 0 and column // subdivisions < bays else bay + 1] if eta in (0.0, 1.0) else None
            row = []
            for k in range(stations + 1):
                if edge is not None and k in (0, stations):
                    row.append(int(edge[0 if k == 0 else 1]))
                else:
                    row.append(self.add(f"w{column + 1}_{k}", le + k / stations * (te - le)))
            grid.append(row)
        self.grid = np.array(grid)

    def lay_tubes(self, ribs, subdivisions):
        path = self.folder / self.structure.tubes
        columns = {"name": name, "nodes": names, "start_diameter_m": positive, "end_diameter_m": positive}
        table = read_table(path, {**columns, "hinges": names})
        self.taken: dict[str, str] = {}
        attached = self._attachments(table["name"])
        rib_of = {tuple(map(int, rib)): row for row, rib in enumerate(ribs)}
        edges = {int(rib[0]): row for row, rib in enumerate(ribs)}
        for row, label in enumerate(table["name"]):
            if label in self.taken:
                raise SceneError(f"{table.at(row)}: tube '{label}' stands already in {self.taken[label]}; rename it.")
            self.taken[label] = table.at(row)
            if len(table["nodes"][row]) != 2:
                raise SceneError(f"{table.at(row)}: 'nodes' must name the two ends of the tube; correct the cell.")
            a, b = (self.node(n, table.at(row)) for n in table["nodes"][row])
            if np.linalg.norm(self.points[a] - self.points[b]) == 0.0:
                raise SceneError(f"{table.at(row)}: tube '{label}' has no length; name two nodes apart.")
            hinges = {self.node(n, table.at(row)) for n in table["hinges"][row]}
            if hinges - {a, b}:
                raise SceneError(f"{table.at(row)}: hinges of tube '{label}' must be ends of it; correct the cell.")
            path_nodes = [(0.0, a), (1.0, b)]
            if (a, b) in rib_of or (b, a) in rib_of:
                column = self.grid[rib_of.get((a, b), rib_of.get((b, a))) * subdivisions]
                inner = column if (a, b) in rib_of else column[::-1]
                path_nodes = list(zip(np.linspace(0.0, 1.0, len(inner)), map(int, inner), strict=True))
            elif a in edges and b in edges and abs(edges[a] - edges[b]) == 1:
                low = min(edges[a], edges[b]) * subdivisions
                inner = self.grid[low : low + subdivisions + 1, 0]
                inner = inner if edges[a] < edges[b] else inner[::-1]
                path_nodes = list(zip(np.linspace(0.0, 1.0, len(inner)), map(int, inner), strict=True))
            diameters = table["start_diameter_m"][row], table["end_diameter_m"][row]
            self._lay_tube(label, path_nodes, diameters, hinges, attached.pop(label, []))
        on_tubes = {node for beam in self.beams for node in beam[:2]}
        for node, where in self.dependent.items():
            if node in on_tubes:
                raise SceneError(f"{where}: node '{self.labels[node]}' is a part of a tube itself; drop the row.")

    def _attachments(self, tubes):
        """Tube -> nodes attached to it."""
        self.links: list[tuple[int, int]] = []  # dependent node, nodal rotation of its reference node
        self.dependent: dict[int, str] = {}  # node -> the row that says so
        if not self.structure.attachments:
            return {}
        table = read_table(self.folder / self.structure.attachments, {"node": name, "tube": name})
        out: dict[str, list[tuple[int, str]]] = {}
        seen = self.dependent
        for row in range(len(table)):
            node = self.node(table["node"][row], table.at(row))
            if table["tube"][row] not in tubes:
                raise SceneError(f"{table.at(row)}: tube '{table['tube'][row]}' is not in the tube table; correct it.")
            if node in seen:
                raise SceneError(
                    f"{table.at(row)}: node '{table['node'][row]}' is attached already in {seen[node]}; drop one."
                )
            if self.fixed[node]:
                raise SceneError(
                    f"{table.at(row)}: node '{table['node'][row]}' is fixed; only free ones can be attached to a tube."
                )
            seen[node] = table.at(row)
            out.setdefault(table["tube"][row], []).append((node, table.at(row)))
        return out

    def _lay_tube(self, label, way, diameters, hinges, attached):
        """Beams along a straight tube through the nodes `way`, more where lines are attached between."""
        start, end = self.points[way[0][1]], self.points[way[-1][1]]
        axis = end - start
        own = {n for _, n in way}
        references = []
        for node, where in attached:
            if node in own:
                raise SceneError(f"{where}: the node is an end or a station of tube '{label}' already; drop the row.")
            at = float(np.clip((self.points[node] - start) @ axis / (axis @ axis), 0.0, 1.0))
            near = min(way, key=lambda p: abs(p[0] - at))
            if abs(near[0] - at) > SNAP:
                near = (at, self.add(f"{label}_{round(1000 * at)}", start + at * axis))
                way = sorted([*way, near])
            references.append((node, near[1]))
        d0, d1 = diameters
        for k, ((f, a), (g, b)) in enumerate(pairwise(way)):
            radius = 0.5 * (d0 + 0.5 * (f + g) * (d1 - d0))
            ends = [self.rotation(n, label if n in hinges else "") for n in (a, b)]
            self.beams.append((a, b, *ends, radius, label if len(way) == 2 else f"{label}.{k + 1}"))
        self.links += [(node, self.rotation(ref, label if ref in hinges else "")) for node, ref in references]

    def finished(self):
        nodes = np.array(self.points)
        table = np.array([b[:4] for b in self.beams])
        tubes = Tubes(
            table[:, :2],
            table[:, 2:4],
            np.array([b[4] for b in self.beams]),
            tuple(b[5] for b in self.beams),
            tuple(b[5].partition(".")[0] for b in self.beams),
        )
        length = np.linalg.norm(np.diff(nodes[tubes.ends], axis=1)[:, 0], axis=1)
        tube_length = np.bincount(tubes.ends.reshape(-1), np.repeat(0.5 * length, 2), minlength=len(nodes))
        springs, canopy = self._canopy(nodes)
        rotation_nodes = np.array([node for node, _ in self.rotations], dtype=int)
        links = np.array(self.links, dtype=int).reshape(-1, 2)
        mesh = nodes, tuple(self.labels), self.grid, tubes, rotation_nodes
        return WingMesh(*mesh, links[:, 0], links[:, 1], springs, canopy, tube_length)

    def _canopy(self, nodes):
        """Springs of the fabric between the grid lines, and the fabric's mass at the nodes.

        Every cell is a piece of fabric of stiffness E t along its threads and G t in shear. An edge carries half the
        width of the cells beside it, k = E t w / 2 l, and the diagonal that a shear angle stretches takes the shear,
        k = G t d^2 / (a b). The result does not depend on how fine the grid is.
        """
        s = self.structure
        tension, shear, density = s.canopy_stiffness, s.canopy_shear_stiffness, s.canopy_density
        mass = np.zeros(len(nodes))
        springs: dict[tuple[int, int], list[Any]] = {}

        def add(label, i, j, k):
            key = (min(i, j), max(i, j))
            if key in springs:
                springs[key][-1] += k
            else:
                springs[key] = [label, (i, j), float(np.linalg.norm(nodes[i] - nodes[j])), k]

        for c, (first, second) in enumerate(pairwise(self.grid.tolist()), 1):
            for k in range(len(first) - 1):
                corners = first[k], first[k + 1], second[k + 1], second[k]
                p = nodes[list(corners)]
                chord = 0.5 * (np.linalg.norm(p[1] - p[0]) + np.linalg.norm(p[2] - p[3]))
                span = 0.5 * (np.linalg.norm(p[3] - p[0]) + np.linalg.norm(p[2] - p[1]))
                for side, (i, j), width in (
                    ("chord", (0, 1), span), ("chord", (3, 2), span), ("span", (0, 3), chord), ("span", (1, 2), chord),
                ):  # fmt: skip
                    length = np.linalg.norm(p[i] - p[j])
                    edge = c if i in (0, 1) and side == "chord" and i == 0 else c + 1
                    station = k + (i in (1, 2) and side == "span")
                    label = f"{side}_{edge if side == 'chord' else c}_{station}"
                    add(label, corners[i], corners[j], 0.5 * tension * width / length)
                for label, (i, j) in (("a", (0, 2)), ("b", (1, 3))):
                    d2 = float(np.sum((p[i] - p[j]) ** 2))
                    add(f"shear_{c}_{k}{label}", corners[i], corners[j], shear * d2 / (chord * span))
                area = 0.5 * np.linalg.norm(np.cross(p[2] - p[0], p[3] - p[1]))
                mass[list(corners)] += 0.25 * density * area
        return [tuple(v) for v in springs.values()], mass
