"""Sections of an inflatable wing and how far its canopy billows between the struts (LEI thesis 7.3)."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.figures import DARK, LIGHT, WIDTH, axes_at, new_figure, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEIGHT, LEFT, BOTTOM, TALL, WIDE = 4.1, 0.8, 1.3, 2.3, 2.65  # in, of the figure and of its panels
EXAGGERATIONS = (50, 20, 10, 5, 2, 1)
LEAST = 0.01  # m per m of chord, range of the profiles that fills their panel at least


@dataclass(frozen=True, eq=False)
class Sections:
    """The columns of a canopy, left tip first, of s nodes from leading to trailing edge.

    `y` (c,) m of the leading edge, `chord` (c,) m, `x` along the chord and `z` normal to it, towards suction, both
    (c,s) in chords, `strut` (c,) bool.
    """

    y: np.ndarray
    chord: np.ndarray
    x: np.ndarray
    z: np.ndarray
    strut: np.ndarray

    @property
    def camber(self) -> np.ndarray:
        """The largest distance from the chord with its sign, in chords, (c,)."""
        return np.take_along_axis(self.z, self._most, axis=1)[:, 0]

    @property
    def place(self) -> np.ndarray:
        """Where the camber is, in chords from the leading edge, (c,)."""
        return np.take_along_axis(self.x, self._most, axis=1)[:, 0]

    @property
    def _most(self) -> np.ndarray:
        return np.argmax(np.abs(self.z), axis=1)[:, None]

    @property
    def middle(self) -> np.ndarray:
        """The columns in the middle of each bay between struts, both of them where their number is even, (k,)."""
        out: list[int] = []
        for strut, group in groupby(range(len(self.strut)), key=lambda c: bool(self.strut[c])):
            bay = list(group)
            if not strut:
                out += sorted({bay[(len(bay) - 1) // 2], bay[len(bay) // 2]})
        return np.array(out, dtype=int)

    def rows(self) -> Iterator[tuple[int, float, float, float, float, int]]:
        """Column (from 1), y m, chord m, x/c, z/c and whether it is a strut (1 or 0), a row per node."""
        for c, (y, chord, strut) in enumerate(zip(self.y, self.chord, self.strut, strict=True)):
            for x, z in zip(self.x[c], self.z[c], strict=True):
                yield c + 1, float(y), float(chord), float(x), float(z), int(strut)


def sections(position: np.ndarray, grid: np.ndarray, strut: np.ndarray) -> Sections:
    """The Sections of the nodes `grid` (c,s) at `position` (n,3) m.

    With the chord t from leading to trailing edge and the span direction e through the leading edges of the neighbours,
    from left to right, the normal is n ~ t x e: the way of the panels' area vectors. A node at r from the leading edge
    has x/c = r.t / c and z/c = r.n / c.
    """
    nodes = position[grid]
    chord = nodes[:, -1] - nodes[:, 0]
    length = np.linalg.norm(chord, axis=1)
    along = chord / length[:, None]
    normal = np.cross(along, np.gradient(nodes[:, 0], axis=0))  # only its direction counts
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    x, z = (np.einsum("csk,ck->cs", nodes - nodes[:, :1], way) / length[:, None] for way in (along, normal))
    return Sections(nodes[:, 0, 1], length, x, z, strut)


def strut_columns(grid: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Which columns are struts: all their nodes between leading and trailing edge are ends of tubes, (c,) bool."""
    return np.isin(grid[:, 1:-1], ends).all(axis=1) & (grid.shape[1] > 2)


def wing_sections(wing: Any, position: np.ndarray | None) -> Sections | None:
    """The Sections of a `wing` with a grid and tubes, None without one or without a `position` of its nodes."""
    if getattr(wing, "grid", None) is None or position is None or not np.all(np.isfinite(position)):
        return None
    grid = np.asarray(wing.grid)
    return sections(position, grid, strut_columns(grid, wing.tubes.ends))


def billowing_figure(found: Sections, title: str) -> "Figure":
    """Profiles in the middle of the bays and at the struts, and camber % over the span."""
    with style():
        figure = new_figure(HEIGHT, title)
        _profiles(figure, axes_at(figure, LEFT, BOTTOM, WIDE, TALL), found)
        _cambers(axes_at(figure, LEFT + WIDE + 0.9, BOTTOM, WIDTH - LEFT - WIDE - 1.05, TALL), found)
    return figure


def _profiles(figure: "Figure", panel: "Axes", found: Sections) -> None:
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize
    from matplotlib.lines import Line2D

    distance = np.abs(found.y - 0.5 * (found.y[0] + found.y[-1]))
    right = found.y >= 0.5 * (found.y[0] + found.y[-1])
    cut = ListedColormap(colormaps["viridis"](np.linspace(0.0, 0.92, 256)))  # the palest would vanish on paper
    colours = ScalarMappable(Normalize(0.0, float(distance.max()) or 1.0), cut)
    for c in np.flatnonzero(found.strut):
        panel.plot(found.x[c], found.z[c], color="0.6", lw=0.6, zorder=2, gid="strut")
    for c in found.middle:
        look = "-" if right[c] else "--"
        panel.plot(found.x[c], found.z[c], look, color=colours.to_rgba(distance[c]), zorder=3, gid="bay")
    low, high = float(found.z.min()), float(found.z.max())
    room = 1.12 * max(high - low, LEAST)
    per_chord = WIDE / 1.06  # in
    times = next((k for k in EXAGGERATIONS if k * per_chord * room <= TALL), 1)
    half = 0.5 * max(TALL / (times * per_chord), room)
    panel.set_xlim(-0.03, 1.03)
    panel.set_ylim(0.5 * (low + high) - half, 0.5 * (low + high) + half)
    panel.set_title(f"sections; z/c drawn {times} times as large as x/c", loc="left", pad=3.0)
    panel.set_xlabel("distance along the chord x/c, \u2013", labelpad=1.0)
    panel.set_ylabel("distance from the chord z/c, \u2013")
    panel.grid(True)
    bar = figure.colorbar(colours, cax=axes_at(figure, LEFT, 0.68, WIDE, 0.1), orientation="horizontal")
    bar.set_label("distance from mid-span, m", labelpad=1.0)
    shown = [
        Line2D([], [], color=DARK, label="middle of a bay, right wing"),
        Line2D([], [], color=DARK, ls="--", label="left wing"),
        Line2D([], [], color="0.6", lw=0.6, label="at a strut"),
    ]
    figure.legend(handles=shown, loc="lower left", bbox_to_anchor=(0.4 / WIDTH, 0.03 / HEIGHT), ncols=3)


def _cambers(panel: "Axes", found: Sections) -> None:
    percent = 100.0 * found.camber
    panel.axhline(0.0, color="0.3", lw=0.5)
    panel.plot(found.y, percent, "o-", color=DARK, ms=3.0, label="canopy")
    panel.plot(found.y[found.strut], percent[found.strut], "s", color=LIGHT, ms=4.5, label="strut", zorder=3)
    half = max(0.55 * float(np.ptp(percent)), 0.5)
    middle = 0.5 * float(percent.min() + percent.max())
    panel.set_ylim(min(middle - half, -0.05 * half), max(middle + half, 0.05 * half))
    most = int(np.argmax(np.abs(percent)))
    text = f"largest {percent[most]:.2f} % at x/c {found.place[most]:.2f}, y {found.y[most]:.2f} m"
    panel.set_title(text, loc="left", pad=3.0)
    panel.set_xlabel("y of the leading edge, m (right wing positive)", labelpad=1.0)
    panel.set_ylabel("camber, % (of the chord)")
    panel.grid(True)
    panel.legend(loc="upper left", bbox_to_anchor=(0.0, -0.2), ncols=2, borderaxespad=0.0)
