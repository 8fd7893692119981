"""The plot of the span loading of closed bodies: c c_l, c_l and angles along every surface."""

from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.figures import DARK, LIGHT, MIDDLE, WIDTH, axes_at, new_figure, style
from master.report.loading import SurfaceLoading

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = (DARK, MIDDLE, "#c2571a", LIGHT)
HEIGHTS, GAP, TOP, BOTTOM, LEFT, RIGHT = (2.0, 1.6, 1.4), 0.2, 0.4, 0.5, 0.92, 1.6  # in
BETWEEN = 0.35  # in, between what is level and what is upright


def loading_figure(surfaces: tuple[SurfaceLoading, ...], title: str) -> "Figure":
    """c c_l m, c_l and the angle of the chords deg over the arc of every surface, upright ones beside the others."""
    from matplotlib.lines import Line2D

    groups = [[s for s in surfaces if s.upright == upright] for upright in (False, True)]
    groups = [group for group in groups if group]
    total = TOP + sum(HEIGHTS) + GAP * (len(HEIGHTS) - 1) + BOTTOM
    room = WIDTH - LEFT - RIGHT - BETWEEN * (len(groups) - 1)
    widths = [room] if len(groups) == 1 else [0.7 * room, 0.3 * room]
    colours = {s.name: COLOURS[k % len(COLOURS)] for k, s in enumerate(surfaces)}
    with style():
        figure = new_figure(total, title)
        left = LEFT
        rows: list[list[Axes]] = [[] for _ in HEIGHTS]
        for group, width in zip(groups, widths, strict=True):
            for k, panel in enumerate(_column(figure, left, width, total, group, rows)):
                _draw(panel, len(rows[k]), k, group, colours)
                rows[k].append(panel)
            left += width + BETWEEN
        shown = [Line2D([], [], color=colour, label=name) for name, colour in colours.items()]
        shown += [
            Line2D([], [], color="0.3", marker="o", ms=3.0, label="Trefftz plane"),
            Line2D([], [], color="0.3", ls="--", marker="x", ms=3.5, label="pressure"),
        ]
        rows[0][-1].legend(handles=shown, loc="upper left", bbox_to_anchor=(1.02, 1.04), borderaxespad=0.0)
    return figure


def _column(
    figure: "Figure", left: float, width: float, total: float, group: list[SurfaceLoading], rows: list[list["Axes"]]
) -> list["Axes"]:
    """The panels of one group of surfaces, top first, over one axis; those of a row share theirs."""
    panels: list[Axes] = []
    at = total - TOP
    for height, row in zip(HEIGHTS, rows, strict=True):
        at -= height
        shared: dict[str, Any] = {"sharex": panels[0]} if panels else {}
        shared |= {"sharey": row[0]} if row else {}
        panels.append(axes_at(figure, left, at, width, height, **shared))
        at -= GAP
    half = max(np.abs(s.arc).max() + 0.5 * s.width.max() for s in group)
    panels[0].set_xlim(-1.02 * half, 1.02 * half)
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
    upright = group[0].upright
    text = "along end plate or fin, m (up)" if upright else "along trailing edge from mid-span, m (right)"
    panels[-1].set_xlabel(text)
    return panels


def _draw(panel: "Axes", column: int, row: int, group: list[SurfaceLoading], colours: dict[str, str]) -> None:
    """One quantity of a group of surfaces: c c_l, c_l or the angle of attack."""
    labels = ("c cl, m", "cl, \u2013", "angle of the chord\nto the wind, deg")
    for k, s in enumerate(group):  # later ones are thinner, so that what lies below is seen
        thick = 1.0 + 0.8 * (len(group) - 1 - k)
        marks: dict[str, Any] = {"color": colours[s.name], "lw": thick}
        small = len(s.arc) > 40
        values = (
            (s.loading, s.by_pressure),
            (s.loading / s.chord, s.by_pressure / s.chord),
            (np.rad2deg(s.alpha),),
        )[row]
        panel.plot(s.arc, values[0], "-o", ms=0.0 if small else 2.0 + thick, **marks)
        if len(values) > 1:
            panel.plot(s.arc, values[1], "--x", ms=0.0 if small else 2.5 + thick, **marks)
    panel.axhline(0.0, color="0.3", lw=0.5)
    panel.grid(True)
    if column:
        panel.tick_params(labelleft=False)
    else:
        panel.set_ylabel(labels[row])
        panel.yaxis.set_label_coords(-0.55 / (panel.get_position().width * WIDTH), 0.5)
