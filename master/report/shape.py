"""The plot of the flown shape: three views to one scale, line tensions in colour."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from interface import SurfaceMesh, area_vectors
from master.report.figures import MIDDLE, WIDTH, axes_at, new_figure, style, wrapped
from master.report.state import FinalState, Frame
from master.report.views import FROM_ABOVE, FROM_LEFT, FROM_UPWIND, View, axis_labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEFT, GAP, RIGHT, TOP, BOTTOM = 0.55, 0.3, 0.12, 0.72, 0.48  # in
LEAST = 2.3  # in, height of the top view and width of the views, for their titles
LEGEND = LEAST - 0.4  # in, width of the text of the legend, which stands beside the top view
LINE, ENTRY, KEY = 0.136, 0.04, 0.5  # in, height of a line of the legend, more for an entry, for the bar below
FLATTEST = 1.1  # in, height of the front and side views, for the arrow of the wind
TALLEST = 9.0  # in, front and top view together
BLUE = (0.60, 0.75, 0.88)
SLACK = "#b2182b"
LOOSE = "#d95f02"
ENDS = 0.005  # of the area of a body, at either end of its loads: edges of a tip may have any
PRESSURE = "pressure coefficient $C_p$ outside, –"
TUBE, COLLAPSED = "0.58", "#d01c8b"
THICK: dict[str, Any] = {"lw": 4.0, "solid_capstyle": "butt"}
DASHES = {"slack": (0.0, (4.0, 2.5)), "loose": (0.0, (7.0, 1.5, 1.5, 1.5))}


def shape_figure(
    state: FinalState,
    title: str,
    status: str = "converged",
    wind: np.ndarray | None = None,
    gravity: np.ndarray | None = None,
) -> "Figure":
    """Undeformed and deformed structure with line tensions N and the wing surface; axes in m, equal scales.

    `wind` (3,) m/s is drawn as an arrow, or without a wind `gravity` (3,) m/s2, which may act upwards; a `status` other
    than converged is shown in red. The undeformed shape is the design shape, turned as a rigid body to the attitude of
    the wing where the scene can pitch, so that what differs is deformation. The views are those of the wind.
    """
    state, names = seen(state), axis_labels(state.axes)
    wind = None if wind is None else state.axes @ wind
    frame = state.frame
    points = state.surface.position
    if frame is not None:
        points = np.concatenate([points, frame.position, frame.undeformed])
    points = points[np.all(np.isfinite(points), axis=1)]
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3), np.ones(3))
    ranges = np.maximum(high - low, [1e-3, 1e-3, 0.25 * max(high[1] - low[1], 1e-3)]) * 1.08
    middle = 0.5 * (low + high)
    width = WIDTH - LEFT - GAP - RIGHT
    handles, labels = _entries(state)
    least = max(LEAST, LINE * sum(label.count("\n") + 1 for label in labels) + ENTRY * len(labels) + KEY)
    sideways = min((width - LEAST) / max(ranges[:2]), width / (ranges[0] + ranges[1]))
    upwards = min((TALLEST - least) / ranges[2], TALLEST / (ranges[0] + ranges[2]))
    scale = min(sideways, upwards)
    front = np.array([max(ranges[1] * scale, LEAST), max(ranges[2] * scale, FLATTEST)])
    side = np.array([width - front[0], front[1]])
    above = np.array([front[0], max(ranges[0] * scale, least)])
    height = TOP + front[1] + 0.56 + above[1] + BOTTOM
    with style():
        figure = new_figure(height, title)
        good = status == "converged"
        look: dict[str, Any] = {} if good else {"color": SLACK, "fontweight": "bold"}
        figure.text(0.12 / WIDTH, 1.0 - 0.28 / height, status if good else status.upper(), va="top", **look)
        views = {
            FROM_UPWIND: axes_at(figure, LEFT, height - TOP - front[1], *front),
            FROM_LEFT: axes_at(figure, LEFT + front[0] + GAP, height - TOP - side[1], *side),
            FROM_ABOVE: axes_at(figure, LEFT, BOTTOM, *above),
        }
        colours = None if frame is None else _colours(frame)
        pressures = _pressures(state)
        for view, axes in views.items():
            _frame_axes(axes, view, middle, scale)
            axes.set_title(view.title if wind is not None else view.still, loc="left", pad=3.0)
            _name_axes(axes, view, names)
            _draw(axes, state, view, colours, scale, pressures)
        if wind is not None and np.any(wind):
            _arrow(views[FROM_LEFT], FROM_LEFT, points, wind, f"wind {np.linalg.norm(wind):.4g} m/s")
        elif wind is None and gravity is not None and np.any(gravity):
            _arrow(views[FROM_LEFT], FROM_LEFT, points, gravity, f"gravity {np.linalg.norm(gravity):.4g} m/s\u00b2")
        key = axes_at(figure, LEFT + front[0] + GAP, BOTTOM, side[0], above[1] - 0.05)
        key.set_axis_off()
        key.legend(handles, labels, loc="upper left", borderaxespad=0.0, handlelength=2.2, labelspacing=0.35)
        shown = {"line tension, N": colours} if colours is not None else {PRESSURE: pressures}
        for label, mapping in shown.items():
            if mapping is not None:
                place = axes_at(figure, LEFT + front[0] + GAP + 0.1, BOTTOM + 0.02, min(side[0], 2.6) - 0.3, 0.12)
                ends = "neither" if mapping is colours else "both"
                bar = figure.colorbar(mapping, cax=place, orientation="horizontal", extend=ends)
                bar.set_label(label, parse_math=True)
    return figure


def seen(state: FinalState) -> FinalState:
    """The state with all points in the axes of its wind, as views show them."""
    if np.array_equal(state.axes, np.eye(3)):
        return state
    surface, frame = state.surface, state.frame
    own = {name: getattr(surface, name) @ state.axes.T for name in ("reference", "position")}
    surface = replace(surface, **own)
    if frame is not None:
        points = {name: getattr(frame, name) @ state.axes.T for name in ("reference", "undeformed", "position")}
        frame = replace(frame, **points)
    return replace(state, surface=surface, frame=frame)


def _frame_axes(axes: "Axes", view: View, middle: np.ndarray, scale: float) -> None:
    """Limits that give all views one scale (in per m), ticks at one spacing."""
    from matplotlib.ticker import MultipleLocator

    h, v = view.at
    size = np.array([axes.bbox.width, axes.bbox.height]) / axes.figure.dpi / scale
    ends = middle[h] + 0.5 * size[0] * np.array([-1.0, 1.0])
    axes.set_xlim(*(ends[::-1] if view.leftward else ends))
    axes.set_ylim(middle[v] - 0.5 * size[1], middle[v] + 0.5 * size[1])
    axes.set_aspect("equal")
    least = 0.42 / scale  # m between ticks
    decade = 10.0 ** np.floor(np.log10(least))
    step = next(m * decade for m in (1.0, 2.0, 5.0, 10.0) if m * decade >= least)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(step))
    axes.grid(True)


def _name_axes(axes: "Axes", view: View, names: tuple[str, str, str]) -> None:
    """Labels of the axes; the side view has its heights from the front view, which stands beside it."""
    axes.set_xlabel(names[view.h], labelpad=1.0)
    axes.set_ylabel(names[view.v], labelpad=1.0)
    if view == FROM_LEFT:
        axes.tick_params(labelleft=False)
        axes.set_ylabel("")


def _colours(frame: Frame) -> Any:
    """Colours of the tensions of taut lines from pale (low) to dark (high), None if no line is taut."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    taut = frame.taut
    if not taut.any():
        return None
    cut = ListedColormap(colormaps["viridis_r"](np.linspace(0.12, 1.0, 256)))  # the palest would vanish on paper
    return ScalarMappable(Normalize(0.0, float(frame.tension[taut].max())), cut)


def _pressures(state: FinalState) -> Any:
    """Colours of the pressure outside on a closed body, dark in suction, over all but the ends of its range;
    None for a sheet, and without loads.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    surface = state.surface
    values = surface.loads.C_p
    if values is None or not np.all(np.isfinite(values)) or not SurfaceMesh(surface.position, surface.panels).closed:
        return None
    cut = ListedColormap(colormaps["viridis"](np.linspace(0.0, 0.95, 256)))
    order = np.argsort(values, kind="stable")
    share = np.cumsum(surface.loads.area[order])
    low, high = np.interp([ENDS, 1.0 - ENDS], share / share[-1], values[order])
    return ScalarMappable(Normalize(float(low), float(high)), cut)


def _draw_body(axes: "Axes", state: FinalState, view: View, pressures: Any) -> None:
    """What is seen of a closed body in a view, the nearest in front, in the colours of the pressure on it."""
    from matplotlib.collections import PolyCollection

    surface = state.surface
    corners = surface.position[surface.panels]
    seen = np.flatnonzero(area_vectors(corners) @ view.viewer > 0.0)
    order = seen[np.argsort(corners[seen].mean(axis=1) @ view.viewer, kind="stable")]
    paint = pressures.to_rgba(np.asarray(surface.loads.C_p)[order])
    body = PolyCollection(list(corners[order][..., view.at]), fc=paint, ec=paint, lw=0.3, zorder=1, gid="body")
    axes.add_collection(body, autolim=False)


def _draw(axes: "Axes", state: FinalState, view: View, colours: Any, scale: float, pressures: Any) -> None:
    """Surface and structure in a view of `scale` in per m."""
    from matplotlib.collections import LineCollection, PolyCollection

    at = view.at
    surface, frame = state.surface, state.frame
    if pressures is not None and frame is None:
        _draw_body(axes, state, view, pressures)
        return
    corners = surface.position[surface.panels][..., at]
    wing = PolyCollection(list(corners), fc=(*BLUE, 0.45), ec=(*BLUE, 1.0), lw=0.5, zorder=1)
    axes.add_collection(wing, autolim=False)
    if frame is None:
        return
    legs, element = frame.legs
    now = frame.position[legs][..., at]

    def lines(which: np.ndarray | slice, segments: np.ndarray, gid: str, **look: Any) -> None:
        axes.add_collection(LineCollection(list(segments[which]), gid=gid, **look), autolim=False)

    bare = legs[~frame.canopy[element]]  # the wing surface shows the canopy, and tubes its undeformed outline
    if frame.tubes is not None:
        bare = np.concatenate([bare, frame.tubes.ends])
        parts, fallen = frame.position[frame.tubes.ends][..., at], frame.tubes.collapsed
        wide = 72.0 * scale * 2.0 * frame.tubes.radius  # points
        for gid, which, colour, z in (("tubes", ~fallen, TUBE, 3.0), ("collapsed", fallen, COLLAPSED, 3.2)):
            lines(which, parts, gid, colors=colour, linewidths=wide[which], capstyle="round", zorder=z)
    lines(slice(None), frame.undeformed[bare][..., at], "undeformed", colors="0.70", linewidths=0.6, zorder=2)
    lines((frame.two_way & ~frame.canopy)[element], now, "springs", colors="0.25", linewidths=0.8, zorder=3)
    for gid, which, colour in (("slack", frame.slack, SLACK), ("loose", frame.loose, LOOSE)):
        lines(which[element], now, gid, colors=colour, linewidths=1.2, linestyles=[DASHES[gid]], zorder=5)
    if colours is not None:
        taut = frame.taut[element]
        lines(taut, now, "taut", colors=colours.to_rgba(frame.tension[element][taut]), linewidths=1.3, zorder=4)
    for nodes, mark in ((frame.sheaves, SHEAVE), (np.flatnonzero(frame.supports), SUPPORT)):
        axes.plot(*frame.position[nodes][:, at].T, ls="", zorder=6, **mark)


SHEAVE: dict[str, Any] = {"marker": "o", "ms": 3.6, "mfc": "white", "mec": "black", "mew": 0.7}
SUPPORT: dict[str, Any] = {"marker": "^", "ms": 5.5, "mfc": "black", "mec": "black", "mew": 0.7}


def _entries(state: FinalState) -> tuple[list[Any], list[str]]:
    """Handles and labels of the legend, of what is there; labels in lines of at most LEGEND in."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[tuple[Any, str]] = []
    if len(state.surface.panels):
        entries.append((Patch(fc=(*BLUE, 0.45), ec=BLUE, lw=0.5), "wing surface (interface)"))
    frame = state.frame
    if frame is None and _pressures(state) is not None:
        entries = [(Line2D([], [], ls=""), "a closed body, in the colours of the pressure on it")]
    if frame is not None:
        kinds = (frame.two_way, frame.taut, frame.slack, frame.loose)
        springs, taut, slack, loose = (int((which & ~frame.canopy).sum()) for which in kinds)
        if frame.tubes is not None:
            collapsed, parts = int(frame.tubes.collapsed.sum()), len(frame.tubes.names)
            count = len(set(frame.tubes.tube))
            entries.append((Line2D([], [], color=TUBE, **THICK), f"tubes, width to scale ({count})"))
            if collapsed:
                text = f"collapsed tube parts ({collapsed} of {parts})"
                entries.append((Line2D([], [], color=COLLAPSED, **THICK), text))
        if springs:
            entries.append((Line2D([], [], color="0.25", lw=0.8), f"springs, two-way ({springs})"))
        if taut:
            entries.append((Line2D([], [], color=MIDDLE, lw=1.3), f"lines under tension ({taut})"))
        if loose:
            text = f"loose lines, below 1 % of the largest tension ({loose})"
            entries.append((Line2D([], [], color=LOOSE, lw=1.2, ls=DASHES["loose"]), text))
        if slack:
            entries.append((Line2D([], [], color=SLACK, lw=1.2, ls=DASHES["slack"]), f"slack lines ({slack})"))
        if len(frame.sheaves):
            entries.append((Line2D([], [], ls="", **SHEAVE), "pulleys (sheaves)"))
        entries.append((Line2D([], [], ls="", **SUPPORT), "fixed nodes"))
        text = "undeformed: design shape"
        if state.turn is not None:
            way = "nose-up" if state.turn >= 0.0 else "nose-down"
            text += f", turned rigidly {abs(state.turn):.2f}\u00b0 {way} about node {state.pivot} to fit the wing"
        entries.append((Line2D([], [], color="0.70", lw=0.8), text))
        moved = np.linalg.norm(frame.position - frame.undeformed, axis=1)
        node = frame.labels[int(np.argmax(moved))]
        size = f"{moved.max():.3f} m" if moved.max() >= 0.01 else f"{1e3 * moved.max():.3g} mm"
        entries.append((Line2D([], [], ls=""), f"drawn to scale; largest deformation {size} (node {node})"))
    with style():
        return [handle for handle, _ in entries], [wrapped(text, LEGEND) for _, text in entries]


def _arrow(axes: "Axes", view: View, points: np.ndarray, vector: np.ndarray, text: str) -> None:
    """An arrow along a vector, with a text, in the corner of the view that holds the fewest points."""
    at = view.at
    limits = np.array([axes.get_xlim(), axes.get_ylim()])
    places = (points[:, at] - limits[:, 0]) / (limits[:, 1] - limits[:, 0])
    corners = [(x, y) for y in (0.12, 0.88) for x in (0.75, 0.25)]
    corner = min(corners, key=lambda c: np.count_nonzero(np.all(np.abs(places - c) < [0.25, 0.12], axis=1)))
    size = np.array([axes.bbox.width, axes.bbox.height]) / axes.figure.dpi
    half = 0.45 * vector[at] / np.linalg.norm(vector) / size  # of an arrow of 0.9 in
    look: dict[str, Any] = {}
    if abs(half[1]) > abs(half[0]):  # an upright one and its text keep off the frame and off what is behind
        look["bbox"] = {"fc": "white", "ec": "none", "alpha": 0.85, "pad": 1.0}
        room = np.minimum(np.abs(half) + np.array([0.0, 0.25 / size[1]]), 0.5)
        corner = tuple(np.clip(corner, room, 1.0 - room))
    tail, head = tuple(np.array(corner) - half), tuple(np.array(corner) + half)
    arrow = {"arrowstyle": "-|>", "color": "black", "lw": 1.0, "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", head, tail, "axes fraction", "axes fraction", arrowprops=arrow, zorder=7)
    inward = 1.0 if corner[1] < 0.5 else -1.0
    height = corner[1] + inward * (abs(half[1]) + 0.04 / size[1])
    va = "bottom" if inward > 0.0 else "top"
    axes.text(corner[0], height, text, transform=axes.transAxes, ha="center", va=va, zorder=7, **look)
