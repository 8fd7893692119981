"""Plots of a run as matplotlib figures of 183 mm width (a page of two columns), and their PNG and SVG files.

Each function returns a `matplotlib.figure.Figure` of its own; pyplot and its global state are not used, and axes are
placed in inches, so that no layout has to be searched. Colour maps are perceptually uniform, and what is told by colour
is told by line style or marker too.
"""

import contextlib
import io
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.state import Strips

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 7.2  # in
DPI = 200
COMPRESSION = 3  # of PNG files, 1 to 9; more takes three times as long and saves little
STYLE: dict[Any, Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "axes.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": "0.88",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.1,
    "lines.markersize": 4.0,
    "legend.frameon": False,
    "hatch.linewidth": 0.5,
    "text.parse_math": False,  # names and titles are of the scene: a dollar sign is one
    "svg.hashsalt": "kitecosim",  # the same names of clip paths and markers in every file
    "svg.fonttype": "path",
}
DARK, MIDDLE, LIGHT = "#1b2a49", "#2a788e", "#7a7a7a"


@contextlib.contextmanager
def style() -> Iterator[None]:
    """Matplotlib's own defaults with STYLE on top, whatever the user's settings; they are back afterwards."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


def rendered(figure: "Figure") -> dict[str, bytes]:
    """The figure as the content of a .png and a .svg file, the same bytes for the same figure."""
    out = {}
    with style():
        png: dict[str, Any] = {"metadata": {"Software": None}, "pil_kwargs": {"compress_level": COMPRESSION}}
        svg: dict[str, Any] = {"metadata": {"Date": None, "Creator": None}}
        for kind, options in (("png", png), ("svg", svg)):
            buffer = io.BytesIO()
            figure.savefig(buffer, format=kind, dpi=DPI, **options)
            out[kind] = buffer.getvalue()
    return out


def new_figure(height: float, title: str, width: float = WIDTH) -> "Figure":
    """An empty figure of `width` x `height` in with a title, drawn without a display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    figure.text(0.12 / width, 1.0 - 0.1 / height, title, va="top", fontsize=9.0)
    return figure


def wrapped(text: str, width: float) -> str:
    """The text in lines of at most `width` in at the size of legends; a word that is longer goes on in a new line."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    font = FontProperties(size=STYLE["legend.fontsize"])

    def fits(line: str) -> bool:
        return bool(TextPath((0.0, 0.0), line, prop=font).get_extents().x1 <= 72.0 * width)

    lines = [""]
    for word in text.split():
        joined = f"{lines[-1]} {word}".lstrip()
        if fits(joined):
            lines[-1] = joined
            continue
        lines += [""] if lines[-1] else []
        for letter in word:
            lines += [] if fits(lines[-1] + letter) else [""]
            lines[-1] += letter
    return "\n".join(lines)


def axes_at(figure: "Figure", left: float, bottom: float, width: float, height: float, **options: Any) -> "Axes":
    """New axes at a place given in inches."""
    w, h = figure.get_size_inches()
    return figure.add_axes((left / w, bottom / h, width / w, height / h), **options)


def stacked(title: str, heights: Sequence[float], labels: Sequence[str], x_label: str) -> tuple["Figure", list["Axes"]]:
    """A figure of panels (heights in inches, top first) over one x axis, with room for legends on their right."""
    top, gap, bottom, left = 0.4, 0.2, 0.5, 0.92
    total = top + sum(heights) + gap * (len(heights) - 1) + bottom
    figure = new_figure(total, title)
    panels: list[Axes] = []
    at = total - top
    for height, label in zip(heights, labels, strict=True):
        at -= height
        width = WIDTH - 2.65
        panel = axes_at(figure, left, at, width, height, **({"sharex": panels[0]} if panels else {}))
        panel.set_ylabel(label)
        panel.yaxis.set_label_coords(-0.55 / width, 0.5)  # one place for all, and never beyond the margin
        panel.grid(True)
        panel.tick_params(labelbottom=False)
        panels.append(panel)
        at -= gap
    panels[-1].tick_params(labelbottom=True)
    panels[-1].set_xlabel(x_label)
    return figure, panels


def legend_beside(panel: "Axes") -> None:
    """The legend of a panel on its right."""
    panel.legend(loc="upper left", bbox_to_anchor=(1.01, 1.04), borderaxespad=0.0, handlelength=2.4)


def strip_figure(strips: Strips, title: str) -> "Figure":
    """Loads N/m, effective angle of attack deg and circulation m2/s over the arc length m along the span."""
    labels = ["load per length, N/m", "effective angle\nof attack, deg"]
    labels += [] if strips.circulation is None else ["circulation, m\u00b2/s"]
    s = strips.arc
    marks: dict[str, Any] = {"ms": 3.0 if len(s) <= 40 else 0.0}
    with style():
        x_label = "arc length along the quarter-chord line from mid-span, m (right wing positive)"
        figure, panels = stacked(title, [2.2, 1.4, 1.4][: len(labels)], labels, x_label)
        panels[0].plot(s, strips.lift, "o-", color=DARK, label="lift", **marks)
        panels[0].plot(s, strips.drag, "s--", color=MIDDLE, label="drag", **marks)
        if np.abs(strips.side).max() > 1e-9 * np.abs(strips.lift).max():
            panels[0].plot(s, strips.side, "^-.", color=LIGHT, label="side force (to\nthe right wing)", **marks)
        panels[0].axhline(0.0, color="0.3", lw=0.5)
        legend_beside(panels[0])
        panels[1].plot(s, strips.alpha, "o-", color=DARK, **marks)
        if strips.circulation is not None:
            panels[2].plot(s, strips.circulation, "o-", color=DARK, **marks)
        lift, drag = (load @ strips.width for load in (strips.lift, strips.drag))
        text = f"total lift {lift:.5g} N\ntotal drag {drag:.4g} N"
        panels[0].text(1.02, 0.0, text, transform=panels[0].transAxes, va="bottom")
        for panel, values in zip(panels[1:], (strips.alpha, strips.circulation), strict=False):
            _room(panel, values)
        half = 0.5 * strips.width.sum()
        panels[0].set_xlim(-1.02 * half, 1.02 * half)
    return figure


def _room(panel: "Axes", values: np.ndarray | None) -> None:
    """No axis finer than a fifth of what it shows: an even load is a level line, not its rounding."""
    from matplotlib.ticker import MaxNLocator

    if values is not None and np.all(np.isfinite(values)):
        middle, least = 0.5 * (values.max() + values.min()), 0.1 * np.abs(values).max()
        half = 1.1 * max(0.5 * np.ptp(values), least, 1e-12)
        panel.set_ylim(middle - half, middle + half)
        panel.yaxis.set_major_locator(MaxNLocator(5))


def polar_figure(strips: Strips, title: str) -> "Figure":
    """Section lift and drag coefficients over the angle of attack: the polars, and where the strips stand on them, both
    in the colour of the strip's distance from mid-span.

    The strips of the left wing are left halves of a diamond, those of the right wing right halves.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colors import ListedColormap, Normalize
    from matplotlib.lines import Line2D

    if strips.coefficients is None or strips.curves is None or strips.angles is None:
        raise ValueError("The strips have no section polars.")
    height = 3.6
    with style():
        figure = new_figure(height, title)
        cut = ListedColormap(colormaps["viridis"](np.linspace(0.0, 0.92, 256)))  # the palest would vanish on paper
        colours = ScalarMappable(Normalize(0.0, float(np.abs(strips.arc).max()) or 1.0), cut)
        lines: dict[str, Any] = {
            "colors": colours.to_rgba(np.abs(strips.arc)),
            "linewidths": 0.9 if len(strips.arc) <= 12 else 0.5,
        }
        near = 1e-6 * max(strips.width.sum(), 1e-12)  # a strip in the middle belongs to both wings
        wings = {"left": (strips.arc < near, _half_diamond(-1)), "right": (strips.arc > -near, _half_diamond(1))}
        for i, label in enumerate(("section lift coefficient cl, \u2013", "section drag coefficient cd, \u2013")):
            panel = axes_at(figure, 0.8 + 3.0 * i, 0.85, 2.2, height - 1.25)
            points = [np.column_stack([strips.angles, curve]) for curve in strips.curves[i]]
            panel.add_collection(LineCollection(points, **lines))
            for wing, mark in wings.values():
                panel.scatter(
                    strips.alpha[wing], strips.coefficients[i, wing], 30.0, colours.to_rgba(np.abs(strips.arc[wing])),
                    marker=mark, edgecolors="black", linewidths=0.5, zorder=3,
                )  # fmt: skip
            panel.autoscale_view()
            panel.set_xlabel("effective angle of attack, deg")
            panel.set_ylabel(label)
            panel.yaxis.set_label_coords(-0.6 / 2.2, 0.5)  # one place for both, and never beyond the margin
            panel.grid(True)
        bar = figure.colorbar(colours, cax=axes_at(figure, 6.2, 0.85, 0.14, height - 1.25))
        bar.set_label("distance from mid-span along the arc, m")
        shown = [Line2D([], [], color=MIDDLE, lw=0.9, label="polars of the strips, in their colours")]
        for name, (_, mark) in wings.items():
            label = f"strips of the {name} wing"
            shown.append(Line2D([], [], ls="", marker=mark, mfc="0.9", mec="black", mew=0.5, ms=5.5, label=label))
        figure.legend(handles=shown, loc="lower left", bbox_to_anchor=(0.4 / WIDTH, 0.08 / height), ncols=3)
    return figure


def _half_diamond(side: int) -> list[tuple[int, int]]:
    """Outline of a marker whose straight edge stands on the point: left (-1) or right (1) of it."""
    return [(0, -1), (side, 0), (0, 1), (0, -1)]
