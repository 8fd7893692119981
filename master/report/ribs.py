"""Ribs and cells of a ram-air wing: profiles as flown, pressure along them, stress across the span between them.

What parafoil designers look at (ram-air thesis 4.4.3 and 4.4.4): how a rib's profile differs from the one that it was
cut to, the pressure coefficient along the chord beside it, and the tension that the panels between two ribs carry from
one to the other, beside Barlow's formula for it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.figures import DARK, LIGHT, MIDDLE, WIDTH, axes_at, new_figure, style
from master.report.membranes import MembraneState, membrane_state
from master.report.panels import PanelLoads

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = (
    *("rib", "side", "node_1", "node_2", "upper", "x_over_c", "z_over_c", "design_x_over_c", "design_z_over_c"),
    *("C_p", "stress_across_span_N_per_m", "barlow_N_per_m"),
)
STRIPS = 200  # of a cell at most; more of them between two rows are no cell
HALVINGS = 6  # Newton steps for the angle of Barlow's arc, whose error they square each time
WIDE, TALL = 2.55, 0.9  # in, of the axes of a profile
SHOWN = 0.7  # of the way from mid-span to the tip, where the second rib of the plot is


@dataclass(frozen=True, eq=False)
class Rib:
    """A closed row of p nodes round the profile, from the trailing edge over the upper side to the nose and back along
    the lower one; `name` its seam, `nodes` (p,) of the interface.

    `shape` and `design` (p,2) are x/c and z/c in its own plane, as flown and as drawn, both in chords of the design,
    from the nose at zero along the line to the trailing edge. Of its sides, from each node to the next: `C_p` (p,)
    outside, the mean of the panels beside; nan where there are none. `arc` m from mid-span, along the noses.
    """

    name: str
    nodes: np.ndarray
    shape: np.ndarray
    design: np.ndarray
    C_p: np.ndarray
    arc: float

    @property
    def upper(self) -> np.ndarray:
        """Which sides are on the upper side (p,)."""
        return np.arange(len(self.nodes)) < len(self.nodes) // 2

    @property
    def place(self) -> np.ndarray:
        """x/c of the middle of each side, as flown (p,)."""
        return _middle(self.shape[:, 0])

    @property
    def thickness(self) -> tuple[float, float]:
        """Largest thickness in chords of the design, as flown and as drawn."""
        return _thickness(self.shape), _thickness(self.design)


@dataclass(frozen=True, eq=False)
class Cell:
    """The skin between a rib and the next one, with a value for each of the p sides of the rib.

    `stress` (p,) N/m is the Cauchy stress across the span in the middle of the cell, force per present length; `barlow`
    (p,) N/m what Barlow's formula gives there, sigma_t t = p R with the pressure across the skin and the radius of an
    arc as wide as the panel is cut, its centre halfway up the rib (thesis 2.8 to 2.10).
    """

    stress: np.ndarray
    barlow: np.ndarray


@dataclass(frozen=True, eq=False)
class _Skin:
    """Nodes (n,3) m as drawn and as flown, panels (m,4) and their loads; `node` (n,) of the membranes that each is, and
    `sides` (e,3) m of their triangles as they are cut, from each corner to the next.
    """

    reference: np.ndarray
    position: np.ndarray
    panels: np.ndarray
    loads: PanelLoads
    node: np.ndarray
    sides: np.ndarray


def ribs(
    members: Any, blocks: dict[str, np.ndarray], interface: Any, position: np.ndarray, loads: PanelLoads
) -> list[tuple[Rib, Cell | None]]:
    """Ribs, in the order of the scene, and the cell between each and the next, None where they are not joined by rows
    of quads. None at all where the membranes are not the skin of a body.

    `interface` has reference `nodes` (n,3) m and `panels` (m,4), at `position` (n,3) m under their `loads`; the state
    of the membranes is in the `blocks`.
    """
    found = membrane_state(members, blocks)
    skin = None if found is None else members.membranes.skin
    if found is None or skin is None or not np.all(np.isfinite(position)):
        return []
    corners = members.membranes.group.pattern[:, :3]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    surface = _Skin(interface.nodes, position, np.asarray(interface.panels), loads, skin, sides)
    on_skin = np.full(len(found.position), -1)
    on_skin[skin] = np.arange(len(skin))
    rows = {name: row for name, sides in found.seams.items() if len(row := _row(on_skin[sides]))}
    if not rows:
        return []
    grid = _Grid(surface.panels)
    noses = surface.reference[[row[len(row) // 2] for row in rows.values()]]
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(noses, axis=0), axis=1))])
    made = [
        _rib(name, row, surface, grid, float(at))
        for (name, row), at in zip(rows.items(), arc - 0.5 * arc[-1], strict=True)
    ]
    triangles = _triangles(surface.panels, found, skin)
    cells = [None if triangles is None else _cell(*pair, grid, surface, found, triangles) for pair in pairwise(made)]
    return list(zip(made, [*cells, None], strict=True))


def _row(sides: np.ndarray) -> np.ndarray:
    """Nodes (p,) of a closed row of sides (p,2), none where they are no row or leave the skin."""
    closed = len(sides) >= 4 and np.all(sides >= 0) and np.array_equal(sides[:, 1], np.roll(sides[:, 0], -1))
    return sides[:, 0] if closed else np.zeros(0, dtype=int)


def _rib(name: str, row: np.ndarray, surface: _Skin, grid: "_Grid", arc: float) -> Rib:
    reference = surface.reference
    chord = np.linalg.norm(reference[row[0]] - reference[row[len(row) // 2]])
    shape, design = (_profile(nodes[row]) / chord for nodes in (surface.position, reference))
    pressure = surface.loads.C_p
    if pressure is None:
        return Rib(name, row, shape, design, np.full(len(row), np.nan), arc)
    sides = np.stack([row, np.roll(row, -1)], axis=1)
    beside = np.stack([grid.panel(sides), grid.panel(sides[:, ::-1])])
    with np.errstate(invalid="ignore"):
        values = np.where(beside >= 0, pressure[beside], 0.0).sum(axis=0) / (beside >= 0).sum(axis=0)
    return Rib(name, row, shape, design, values, arc)


def _profile(nodes: np.ndarray) -> np.ndarray:
    """x and z (p,2) m of a row of nodes (p,3) m in the plane that fits it best."""
    p = len(nodes)
    along = nodes[0] - nodes[p // 2]
    along /= np.linalg.norm(along)
    offset = nodes - nodes[p // 2]
    normal = np.linalg.svd(offset - offset.mean(axis=0), full_matrices=False)[2][-1]
    up = np.cross(normal, along)
    up /= np.linalg.norm(up)
    flat = np.stack([offset @ along, offset @ up], axis=1)
    if flat[: p // 2, 1].mean() < flat[p // 2 :, 1].mean():
        flat[:, 1] *= -1.0
    return flat


def _thickness(profile: np.ndarray) -> float:
    """Largest distance of the nodes that stand above each other."""
    p = len(profile)
    k = np.arange(1, (p + 1) // 2)
    return float(np.linalg.norm(profile[k] - profile[p - k], axis=1).max())


def _middle(values: np.ndarray) -> np.ndarray:
    """Mean of each value of a closed row and the next."""
    return 0.5 * (values + np.roll(values, -1, axis=0))


# Cells: rows of quads from one rib to the next


class _Grid:
    """Panels (m,4) of a surface by their directed sides."""

    def __init__(self, panels: np.ndarray):
        self._panels, self._base = panels, int(panels.max()) + 1
        sides = np.stack([panels, np.roll(panels, -1, axis=1)], axis=2).reshape(-1, 2)
        keys = self._keys(sides)
        self._order = np.argsort(keys, kind="stable")
        self._sorted = keys[self._order]

    def _keys(self, sides: np.ndarray) -> np.ndarray:
        return sides[:, 0] * self._base + sides[:, 1]

    def _found(self, sides: np.ndarray) -> np.ndarray:
        """Where directed sides (k,2) stand among those of all panels, four each; -1: nowhere."""
        keys = self._keys(sides)
        at = np.minimum(np.searchsorted(self._sorted, keys), len(self._sorted) - 1)
        return np.where(self._sorted[at] == keys, self._order[at], -1)

    def panel(self, sides: np.ndarray) -> np.ndarray:
        """The panel (k,) that runs through each side (k,2) in this direction, -1 without one."""
        at = self._found(sides)
        return np.where(at >= 0, at // 4, -1)

    def across(self, sides: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The quad (k,) at each side (k,2) and the side opposite, in the direction of the side; none at all where one
        is missing or a triangle.
        """
        at = self._found(sides)
        nodes = self._panels[at // 4]
        if np.any(at < 0) or np.any(nodes[:, 2] == nodes[:, 3]):
            return np.zeros(0, dtype=int), sides[:0]
        k, rows = at % 4, np.arange(len(at))
        return at // 4, np.stack([nodes[rows, (k + 3) % 4], nodes[rows, (k + 2) % 4]], axis=1)


def _between(one: Rib, other: Rib, grid: _Grid) -> tuple[np.ndarray, np.ndarray]:
    """Quads (s,p) of a cell, from one rib to the other, and the rows (s+1,p) of nodes between; empty without a cell.

    Round tips that are rows of quads themselves there is a second, longer way: that over the rest of the wing.
    """
    ways = [_way(one, other, grid, turned) for turned in (False, True)]
    found = [way for way in ways if len(way[0])]
    return min(found, key=lambda way: len(way[0])) if found else ways[0]


def _way(one: Rib, other: Rib, grid: _Grid, turned: bool) -> tuple[np.ndarray, np.ndarray]:
    """Quads (s,p) and rows (s+1,p) from one rib to the other on that side of it to which its row of nodes, or this
    row `turned`, has the panels; empty where they do not lead there.
    """
    sides = np.stack([one.nodes, np.roll(one.nodes, -1)], axis=1)
    now, quads, rows = sides[:, ::-1] if turned else sides, [], [one.nodes]
    for _ in range(STRIPS):
        found, now = grid.across(now)
        if not len(found):
            break
        quads.append(found)
        rows.append(now[:, 1] if turned else now[:, 0])
        if np.array_equal(rows[-1], other.nodes):
            return np.stack(quads), np.stack(rows)
    return np.zeros((0, 0), dtype=int), np.zeros((0, 0), dtype=int)


def _triangles(panels: np.ndarray, found: MembraneState, skin: np.ndarray) -> np.ndarray | None:
    """The two triangles (m,2) of the skin on each panel, twice the same on a triangle; None for another mesh."""
    quad = panels[:, 2] != panels[:, 3]
    last = np.cumsum(1 + quad)
    if len(found.nodes) < last[-1]:
        return None
    triangles = np.stack([last - 1 - quad, last - 1], axis=1)
    own = (found.nodes[triangles][..., :3, None] == skin[panels][:, None, None, :]).any(axis=-1)
    return triangles if own.all() else None


def _cell(
    one: Rib, other: Rib, grid: _Grid, surface: _Skin, found: MembraneState, triangles: np.ndarray
) -> Cell | None:
    quads, rows = _between(one, other, grid)
    if not len(quads):
        return None
    s = len(quads)
    middle = quads[(s - 1) // 2 : s // 2 + 1]  # both strips in the middle where they are even in number
    heights = [_heights(surface.reference[rib.nodes]) for rib in (one, other)]
    radius = arc_radius(_cut_width(rows, quads, surface, found, triangles), _middle(0.5 * np.add(*heights)))
    stress = _across_span(rows, quads, surface.position, found, triangles)[(s - 1) // 2 : s // 2 + 1]
    return Cell(stress.mean(axis=0), surface.loads.delta_p[middle].mean(axis=0) * radius)


def _cut_width(
    rows: np.ndarray, quads: np.ndarray, surface: _Skin, found: MembraneState, triangles: np.ndarray
) -> np.ndarray:
    """Width (p,) m from rib to rib of the panels of a cell as they are cut: of each of its quads the mean of the two
    sides that lead from one row to the next, each of which is a side of one of its triangles.
    """
    one, other = surface.node[rows[:-1]], surface.node[rows[1:]]  # (s,p)
    corners = found.nodes[triangles[quads]][..., :3]  # (s,p,2,3)

    def among(*nodes: np.ndarray) -> np.ndarray:
        return (corners[..., None] == np.stack(nodes, axis=-1)[:, :, None, None]).any(axis=-1)

    row, column = among(one, np.roll(one, -1, axis=1)), among(one, other)
    across = (row != np.roll(row, -1, axis=-1)) & (column == np.roll(column, -1, axis=-1))
    widths = np.where(across, surface.sides[triangles[quads]], 0.0).sum(axis=-1)
    return widths.mean(axis=-1).sum(axis=0)


def _heights(nodes: np.ndarray) -> np.ndarray:
    """Distance of each node (p,3) of a row to the one that stands on the other side."""
    p = len(nodes)
    return np.linalg.norm(nodes - nodes[-np.arange(p) % p], axis=1)


def arc_radius(width: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Radius m of arcs as long as `width` m whose centre is `height` / 2 m below their ends' line (thesis 2.3.2).

    Half the angle of the arc, phi, solves phi / cos phi = width / height, and R = width / (2 phi). Without height the
    arc is half a circle. The function whose zero that is, is convex, and Newton's method from pi/2 stays above it.
    """
    width, height = np.asarray(width, float), np.asarray(height, float)
    phi = np.full(width.shape, 0.5 * np.pi)
    for _ in range(HALVINGS):
        phi -= (height * phi - width * np.cos(phi)) / (height + width * np.sin(phi))
    return width / (2.0 * phi)


def _across_span(
    rows: np.ndarray, quads: np.ndarray, position: np.ndarray, found: MembraneState, triangles: np.ndarray
) -> np.ndarray:
    """Stress (s,p) N/m of each quad along the way from the row before to the row behind it."""
    middles = _middle_of_rows(position[rows])
    way = np.diff(middles, axis=0)
    way /= np.linalg.norm(way, axis=2)[..., None]
    rows_of = triangles[quads]  # (s,p,2)
    cosine2 = np.einsum("spk,sptk->spt", way, found.direction[rows_of]) ** 2
    stress = found.cauchy_1[rows_of] * cosine2 + found.cauchy_2[rows_of] * (1.0 - cosine2)
    area = found.area[rows_of]
    return (stress * area).sum(axis=2) / area.sum(axis=2)


def _middle_of_rows(nodes: np.ndarray) -> np.ndarray:
    """Middles (r,p,3) of the sides of closed rows of nodes (r,p,3)."""
    return 0.5 * (nodes + np.roll(nodes, -1, axis=1))


# What is written and drawn


def rib_table(found: list[tuple[Rib, Cell | None]]) -> tuple[list[str], Iterator[list[Any]]]:
    """Header and rows of ribs.csv: a row for each side of each rib, with the cell up to the next one."""

    def rows() -> Iterator[list[Any]]:
        for rib, cell in found:
            following = np.roll(rib.nodes, -1)
            places = np.hstack([_middle(rib.shape), _middle(rib.design)])
            none = np.full(len(rib.nodes), np.nan)
            of_cell = (none, none) if cell is None else (cell.stress, cell.barlow)
            values = np.column_stack([places, rib.C_p, *of_cell])
            for k, row in enumerate(values.tolist()):
                ends = int(rib.nodes[k]) + 1, int(following[k]) + 1
                yield [rib.name, k + 1, *ends, int(rib.upper[k]), *map(repr, row)]

    return list(COLUMNS), rows()


def shown(found: list[tuple[Rib, Cell | None]]) -> list[int]:
    """The ribs of the plot: that nearest to mid-span and, of the right wing, one towards the tip."""
    arc = np.array([rib.arc for rib, _ in found])
    middle = int(np.argmin(np.abs(arc) + 1e-9 * (arc < 0.0)))
    outer = int(np.argmin(np.abs(arc - SHOWN * arc.max())))
    return sorted({middle, outer}, key=lambda k: abs(arc[k]))


def rib_figure(found: list[tuple[Rib, Cell | None]], title: str) -> "Figure":
    """Of two ribs, each in a column: the profile as flown over that drawn, C_p along it, and the stress across the span
    in the cell towards the right tip, with Barlow's formula.
    """
    columns = shown(found)
    width, gap, left = WIDE, 1.0, 0.92
    heights = [TALL, 1.5, 1.5]
    total = 0.62 + sum(heights) + 2 * 0.3 + 0.95
    with style():
        figure = new_figure(total, title)
        for c, k in enumerate(columns):
            rib, cell = found[k]
            at, panels = total - 0.62, []
            for height in heights:
                at -= height
                panels.append(axes_at(figure, left + c * (width + gap), at, width, height))
                at -= 0.3
            where = "mid-span" if abs(rib.arc) < 1e-6 else f"{abs(rib.arc):.2f} m from mid-span"
            panels[0].set_title(f"{rib.name.replace('_', ' ')}, {where}", loc="left", pad=3.0)
            _draw_profile(panels[0], rib)
            _draw_pressure(panels[1], rib)
            _draw_stress(panels[2], rib, cell)
            for panel in panels:
                panel.set_xlim(-0.03, 1.03)
                panel.grid(True)
                panel.yaxis.set_label_coords(-0.52 / width, 0.5)
            panels[-1].set_xlabel("distance from the nose along the chord x/c, \u2013", labelpad=1.0)
        _legend(figure, total)
    return figure


def _draw_profile(panel: "Axes", rib: Rib) -> None:
    for profile, look in ((rib.design, {"color": "0.4", "ls": ":", "lw": 0.9}), (rib.shape, {"color": DARK})):
        closed = np.concatenate([profile, profile[:1]])
        panel.plot(*closed.T, **look)
    low, high = (f(np.concatenate([rib.design, rib.shape])[:, 1]) for f in (np.min, np.max))
    room = TALL / WIDE * 1.06  # chords, that of one scale along both axes
    panel.set_ylim(0.5 * (low + high) - 0.5 * room, 0.5 * (low + high) + 0.5 * room)
    panel.set_ylabel("z/c, \u2013")
    flown, drawn = rib.thickness
    text = f"thickness {100.0 * flown:.1f} %, drawn {100.0 * drawn:.1f} %"
    panel.text(0.98, 0.04, text, transform=panel.transAxes, ha="right", va="bottom")


def _sides(rib: Rib) -> Iterator[tuple[np.ndarray, str, str]]:
    """Order of the sides along the chord, colour and line of the upper and of the lower side."""
    for on, colour, line in ((rib.upper, DARK, "-"), (~rib.upper, MIDDLE, "--")):
        k = np.flatnonzero(on)
        yield k, colour, line


def _draw_pressure(panel: "Axes", rib: Rib) -> None:
    for k, colour, line in _sides(rib):
        panel.plot(rib.place[k], rib.C_p[k], line, color=colour)
    panel.axhline(0.0, color="0.3", lw=0.5)
    panel.invert_yaxis()
    panel.set_ylabel("pressure coefficient\noutside C_p, \u2013")


def _draw_stress(panel: "Axes", rib: Rib, cell: Cell | None) -> None:
    panel.set_ylabel("stress across the\nspan, N/m")
    if cell is None:
        panel.text(0.5, 0.5, "no cell towards the tip", transform=panel.transAxes, ha="center", color=LIGHT)
        return
    for k, colour, line in _sides(rib):
        panel.plot(rib.place[k], cell.stress[k], line, color=colour)
        panel.plot(rib.place[k], cell.barlow[k], line, color="#c2703d", lw=0.8)
    panel.axhline(0.0, color="0.3", lw=0.5)


def _legend(figure: "Figure", total: float) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=DARK, label="upper side"),
        Line2D([], [], color=MIDDLE, ls="--", label="lower side"),
        Line2D([], [], color="0.4", ls=":", lw=0.9, label="profile as drawn"),
        Line2D([], [], color="#c2703d", lw=0.8, label="Barlow's formula p R"),
    ]
    figure.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.4 / WIDTH, 0.08 / total), ncols=4)
