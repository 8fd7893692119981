"""The plot of the flown bridle with the names of its nodes and lines: on a large page, no name on top of another."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.figures import DARK, MIDDLE, STYLE, axes_at, new_figure, style
from master.report.shape import BLUE, SHEAVE, SUPPORT, seen
from master.report.state import FinalState, Frame
from master.report.views import FROM_ABOVE, FROM_LEFT, FROM_RIGHT, FROM_UPWIND, View, axis_labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDE, TALL = 16.5, 11.7  # in, a landscape A3 page
MARGIN, GAP, TOP, BOTTOM = 0.75, 0.55, 0.7, 0.8  # in, around and between the views
AIR = 0.45  # in, around what a view shows, for names
HALF = 0.065  # in, half the height of a name
DOT = 0.03  # in, half the width of the mark of a node
LEVEL = 0.02  # of the largest extent: what is no wider or higher than that is seen from one side only
FRACTIONS = (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.12, 0.88)  # places of a name along a line, best first
AWAY = (0.1, 0.2, 0.34, 0.5)  # in, from a node or the middle of a line to the end of its name, best first
TURNS = np.deg2rad([0.0, 180.0, 45.0, 135.0, -45.0, -135.0, 90.0, -90.0])  # ways to go there, best first
NODE_LOOK: dict[str, Any] = {"color": DARK, "fontweight": "bold"}
LINE_LOOK: dict[str, Any] = {"color": MIDDLE}


@dataclass(frozen=True, eq=False)
class Place:
    """Where a name of `length` in may stand: its `middle` (2,) in, its `angle` rad, and where a leader to it begins,
    (2,) in, None without one.
    """

    middle: np.ndarray
    angle: float
    length: float
    leader: np.ndarray | None = None

    @property
    def end(self) -> np.ndarray:
        """Where a leader ends (2,) in: at the name, right above, below or beside where it begins."""
        if self.leader is None:
            return self.middle
        near = np.clip(self.leader[0] - self.middle[0], -0.5 * self.length, 0.5 * self.length)
        return self.middle + np.array([near, 0.0])

    @property
    def discs(self) -> np.ndarray:
        """Centres (k,2) in of discs of radius HALF that cover the name."""
        reach = max(0.5 * self.length - HALF, 0.0)
        along = np.linspace(-reach, reach, int(np.ceil(reach / HALF)) + 1 if reach else 1)
        return self.middle + along[:, None] * np.array([np.cos(self.angle), np.sin(self.angle)])


@dataclass(eq=False)
class Sheet:
    """What is free of a view of a `size` (2,) in, with nodes at `dots` (n,2) in and `legs` (l,2,2) in of lines."""

    size: np.ndarray
    dots: np.ndarray
    legs: np.ndarray
    taken: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))

    def first_free(self, places: Iterator[Place], own: np.ndarray | None = None) -> Place | None:
        """The first place where nothing stands, best without a leader across a line; None if there is none. It is taken
        then. A name may touch its `own` dot (2,).
        """
        dots = self.dots
        if own is not None:
            dots = dots[np.linalg.norm(dots - own, axis=1) > 1e-9]
        crossing = None
        for place in places:
            discs = place.discs
            inside = np.all((discs > HALF) & (discs < self.size - HALF))
            if inside and _apart(discs, self.taken, 2.0 * HALF) and _apart(discs, dots, HALF + DOT):
                if place.leader is None or not self._crossed(place.leader, place.end):
                    self.taken = np.concatenate([self.taken, discs])
                    return place
                crossing = crossing or place
        if crossing is not None:
            self.taken = np.concatenate([self.taken, crossing.discs])
        return crossing

    def _crossed(self, start: np.ndarray, end: np.ndarray) -> bool:
        """Whether a leader crosses a line; it begins on its own."""
        begin = start + DOT * (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
        a, along = self.legs[:, 0], self.legs[:, 1] - self.legs[:, 0]

        def side(points: np.ndarray) -> np.ndarray:
            return np.asarray(along[:, 0] * (points - a)[:, 1] - along[:, 1] * (points - a)[:, 0])

        way = end - begin
        first, second = (way[0] * (p - begin)[:, 1] - way[1] * (p - begin)[:, 0] for p in (a, self.legs[:, 1]))
        return bool(np.any((side(begin) * side(end) < 0.0) & (first * second < 0.0)))


def _apart(one: np.ndarray, other: np.ndarray, distance: float) -> bool:
    return bool(np.all(np.sum((one[:, None] - other[None]) ** 2, axis=2) >= distance**2))


def labels_figure(state: FinalState, title: str, what: str = "both", in_wind: bool = True) -> "Figure | None":
    """The lines of the flown shape with the names of `what`, nodes, lines or both: from upwind, and either half
    from its own side; None for a result without a structure.

    Where there are no lines, springs are named. Names that find room in no view are listed below.
    """
    state = seen(state)
    frame = state.frame
    if frame is None:
        return None
    named = _named(frame)
    wanted = {f"line {frame.names[i]}" for i in named if what != "nodes"}
    wanted |= {f"node {frame.labels[n]}" for i in named for n in frame.chains[i] if what != "lines"}
    views = _views(frame, named)
    extents = np.array([np.maximum(np.ptp(_points(frame, own)[:, view.at], axis=0), 1e-3) for view, own in views])
    free = WIDE - 2.0 * MARGIN - GAP * (len(views) - 1) - 2.0 * AIR * len(views)
    high = TALL - TOP - BOTTOM
    scale = min(free / extents[:, 0].sum(), (high - 2.0 * AIR) / extents[:, 1].max())  # in per m
    spare = (free - scale * extents[:, 0].sum()) / len(views) + 2.0 * AIR
    told: set[str] = set()
    with style():
        figure, at = new_figure(TALL, title, WIDE), MARGIN
        for (view, own), extent in zip(views, extents, strict=True):
            size = np.array([scale * extent[0] + spare, high])
            axes = axes_at(figure, at, BOTTOM, *size)
            axes.set_title(view.title if in_wind else view.still, loc="left", pad=3.0)
            axes.set_xlabel(axis_labels(state.axes)[view.h], labelpad=1.0)
            axes.set_ylabel(axis_labels(state.axes)[view.v] if at == MARGIN else "", labelpad=1.0)
            middle = _points(frame, own)[:, view.at]
            _limits(axes, view, 0.5 * (middle.min(axis=0) + middle.max(axis=0)), size / scale)
            _draw(axes, state, view, own)
            told |= _name(axes, frame, view, own, what, size)
            at += size[0] + GAP
        text = "names of lines stand on them or beside their middle, those of nodes are bold"
        if missing := sorted(wanted - told):
            text = f"no room for {len(missing)} of {len(wanted)} names: {', '.join(missing)}"
        figure.text(MARGIN / WIDE, 0.15 / TALL, text, va="bottom", wrap=True)
    return figure


def _named(frame: Frame) -> list[int]:
    """Elements that get names: the lines, or the springs where there are no lines."""
    lines = np.flatnonzero(~frame.two_way & ~frame.canopy)
    return [int(i) for i in (lines if len(lines) else np.flatnonzero(~frame.canopy))]


def _points(frame: Frame, elements: list[int]) -> np.ndarray:
    """Nodes (n,3) m of elements."""
    return frame.position[np.unique(np.concatenate([frame.chains[i] for i in elements]))]


def _views(frame: Frame, named: list[int]) -> list[tuple[View, list[int]]]:
    """Views, and the elements that each of them shows: halves by themselves where there are two."""
    span = np.ptp(_points(frame, named), axis=0)
    if span[2] <= LEVEL * span.max():
        return [(FROM_ABOVE, named)]
    if span[1] <= LEVEL * span.max():
        return [(FROM_LEFT, named)]
    y = {i: float(frame.position[frame.chains[i], 1].mean()) for i in named}
    near = 1e-6 * float(span.max())
    halves = [(FROM_LEFT, [i for i in named if y[i] <= near]), (FROM_RIGHT, [i for i in named if y[i] >= -near])]
    return [(FROM_UPWIND, named), *((view, own) for view, own in halves if own)]


def _limits(axes: "Axes", view: View, middle: np.ndarray, size: np.ndarray) -> None:
    """Limits of a view of `size` (2,) m around its `middle` (2,) m."""
    ends = middle[0] + 0.5 * size[0] * np.array([-1.0, 1.0])
    axes.set_xlim(*(ends[::-1] if view.leftward else ends))
    axes.set_ylim(middle[1] - 0.5 * size[1], middle[1] + 0.5 * size[1])
    axes.tick_params(colors="0.4")


def _draw(axes: "Axes", state: FinalState, view: View, own: list[int]) -> None:
    """The wing pale, elements without names grey, those with names dark, pulleys and supports marked."""
    from matplotlib.collections import LineCollection, PolyCollection

    frame, at = state.frame, view.at
    if frame is None:
        return
    wing = PolyCollection(
        list(state.surface.position[state.surface.panels][..., at]), fc=(*BLUE, 0.25), ec=(*BLUE, 0.5)
    )
    wing.set(linewidth=0.4, zorder=1)
    axes.add_collection(wing, autolim=False)
    legs, element = frame.legs
    mine = np.isin(element, own)
    others = ~mine & ~frame.canopy[element] & frame.two_way[element]
    for which, colour, width in ((others, "0.8", 0.5), (mine, "0.35", 0.9)):
        lines = LineCollection(list(frame.position[legs[which]][..., at]), colors=colour, linewidths=width, zorder=2)
        axes.add_collection(lines, autolim=False)
    here = np.unique(np.concatenate([frame.chains[i] for i in own]))
    axes.plot(*frame.position[here][:, at].T, ls="", marker="o", ms=2.4, color="0.2", zorder=3)
    for nodes, mark in ((frame.sheaves, SHEAVE), (np.flatnonzero(frame.supports), SUPPORT)):
        axes.plot(*frame.position[np.intersect1d(nodes, here)][:, at].T, ls="", zorder=4, **mark)


def _name(axes: "Axes", frame: Frame, view: View, own: list[int], what: str, size: np.ndarray) -> set[str]:
    """Write the names that find room in a view of `size` (2,) in; they, each with its kind in front."""
    corner = np.array([axes.get_xlim()[0], axes.get_ylim()[0]])
    scale = size / (np.array([axes.get_xlim()[1], axes.get_ylim()[1]]) - corner)
    at = (frame.position[:, view.at] - corner) * scale  # in
    chains = [frame.chains[i] for i in own]
    nodes = np.unique(np.concatenate(chains))
    told: set[str] = set()
    sheet = Sheet(size, at[nodes], np.concatenate([np.stack([at[c[:-1]], at[c[1:]]], axis=1) for c in chains]))
    for n in nodes if what != "lines" else ():
        length = _length(frame.labels[n], "bold")
        place = sheet.first_free(_beside(at[n], length), at[n])
        if place is not None:
            _write(axes, frame.labels[n], place, size, NODE_LOOK)
            told.add(f"node {frame.labels[n]}")
    reach = {i: np.linalg.norm(np.diff(at[frame.chains[i]], axis=0), axis=1).max() for i in own}
    for i in sorted(own, key=lambda i: float(reach[i])) if what != "nodes" else ():
        place = sheet.first_free(_along(at[frame.chains[i]], _length(frame.names[i], "normal")))
        if place is not None:
            _write(axes, frame.names[i], place, size, LINE_LOOK)
            told.add(f"line {frame.names[i]}")
    return told


@cache
def _length(text: str, weight: str) -> float:
    """Length of a name with some air at its ends, in."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    font = FontProperties(size=STYLE["font.size"], weight=weight)
    return float(TextPath((0.0, 0.0), text, prop=font).vertices[:, 0].max()) / 72.0 + 0.05


def _beside(point: np.ndarray, length: float) -> Iterator[Place]:
    """Places of a level name around a point (2,) in, the near ones first, far ones with a leader."""
    for away in AWAY:
        for turn in TURNS:
            way = np.array([np.cos(turn), np.sin(turn)])
            middle = point + away * way + np.array([0.5 * length * np.round(way[0]), 0.0])
            yield Place(middle, 0.0, length, None if away == AWAY[0] else point)


def _along(points: np.ndarray, length: float) -> Iterator[Place]:
    """Places of a name on the legs between `points` (k,2) in, the longest one first; then beside its middle."""
    way = np.diff(points, axis=0)
    legs = np.argsort(-np.linalg.norm(way, axis=1), kind="stable")
    for leg in legs:
        reach = float(np.linalg.norm(way[leg]))
        if reach < length + 4.0 * DOT:
            break
        angle = float(np.arctan2(way[leg, 1], way[leg, 0]))
        angle = angle - np.pi if angle > 0.5 * np.pi else angle + np.pi if angle <= -0.5 * np.pi else angle
        for fraction in FRACTIONS:
            if min(fraction, 1.0 - fraction) * reach > 0.5 * length + 2.0 * DOT:
                yield Place(points[leg] + fraction * way[leg], angle, length)
    for fraction in FRACTIONS[:5]:
        start = points[legs[0]] + fraction * way[legs[0]]
        for place in _beside(start, length):
            yield Place(place.middle, 0.0, length, start)


def _write(axes: "Axes", text: str, place: Place, size: np.ndarray, look: dict[str, Any]) -> None:
    """A name, legible over lines, and its leader."""
    from matplotlib.patheffects import withStroke

    x, y = place.middle / size
    apart: dict[str, Any] = {"path_effects": [withStroke(linewidth=2.0, foreground="white")]}
    if place.leader is None and look is LINE_LOOK:  # on its line, which would run through it
        apart = {"bbox": {"fc": "white", "ec": "none", "alpha": 0.85, "pad": 0.4}}
    if place.leader is not None:
        ends = np.array([place.leader, place.end]) / size
        axes.plot(*ends.T, transform=axes.transAxes, color="0.55", lw=0.5, zorder=5)
    axes.text(
        x, y, text, transform=axes.transAxes, rotation=np.rad2deg(place.angle), rotation_mode="anchor", ha="center",
        va="center_baseline", zorder=6, gid="name", **apart, **look,
    )  # fmt: skip
