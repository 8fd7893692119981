"""The plots of a polar, in the look of a run's report."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.figures import WIDTH, axes_at, new_figure, style
from master.studies.polar.wing import Point

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from master.studies.polar import Polar

LEFT, GAP, RIGHT, TOP, BOTTOM = 0.75, 0.85, 0.12, 0.55, 0.48  # in
TALL, BETWEEN = 2.1, 0.55  # in, of a panel and between two rows
ENTRY = 0.17  # in, of a line of the legend
MARKS = ("o", "s", "^", "D", "v", "P", "X", "<", ">")
LABELS = {
    "CL": "lift coefficient $C_L$", "CD": "drag coefficient $C_D$", "CM": "pitching moment coefficient $C_M$",
    "CS": "side force coefficient $C_S$", "Cl": "rolling moment coefficient $C_l$",
    "Cn": "yawing moment coefficient $C_n$",
}  # fmt: skip
Curve = tuple[str, list[Point]]


def polar_figures(found: "Polar") -> dict[str, "Figure"]:
    """Name -> figure: the polar, and where the wind comes from the side, side force, roll and yaw; none without any
    point that has an answer.
    """
    points = [p for p in found.points if p.converged]
    if not points:
        return {}
    x, label, curves = _curves(points)
    title = f"{found.title}, rigid"
    panels = [(x, label, "CL"), (x, label, "CD"), (_value("CD"), LABELS["CD"], "CL"), (x, label, "CM")]
    figures = {"polar": _figure(title, panels, curves, found)}
    if any(p.beta for p in points):
        figures["sideslip"] = _figure(title, [(x, label, name) for name in ("CS", "Cl", "Cn")], curves, found)
    return figures


def _curves(points: Sequence[Point]) -> tuple[Callable[[Point], float], str, list[Curve]]:
    """What the points are drawn over, its label, and the curves: over alpha one for each beta, or over beta where
    there is one alpha only.
    """
    alphas, betas = ({getattr(p, name) for p in points} for name in ("alpha", "beta"))
    over, of = ("beta", "alpha") if len(alphas) == 1 < len(betas) else ("alpha", "beta")
    symbol = {"alpha": ("α", "angle of attack α, deg"), "beta": ("β", "sideslip β, deg")}
    groups: dict[float, list[Point]] = {}
    for p in points:
        groups.setdefault(getattr(p, of), []).append(p)
    curves = [
        (f"{symbol[of][0]} = {value:g}°", sorted(own, key=lambda p: getattr(p, over))) for value, own in groups.items()
    ]
    return lambda p: float(getattr(p, over)), symbol[over][1], curves


def _value(name: str) -> Callable[[Point], float]:
    return lambda p: p.coefficients[name]


def _figure(
    title: str,
    panels: Sequence[tuple[Callable[[Point], float], str, str]],
    curves: Sequence[Curve],
    found: "Polar",
) -> "Figure":
    """Panels, two in a row, of coefficients over something; the place of the last one for the legend if it is free."""
    lines = (len(panels) + 1) // 2
    free = len(panels) % 2 == 1
    below = 0.0 if free else 0.2 + ENTRY * (np.ceil(len(curves) / 6) + 1)
    height = TOP + lines * TALL + (lines - 1) * BETWEEN + BOTTOM + below
    width = 0.5 * (WIDTH - LEFT - GAP - RIGHT)
    with style():
        figure = new_figure(height, title)
        for i, (x, label, name) in enumerate(panels):
            row, column = divmod(i, 2)
            left = LEFT + column * (width + GAP)
            axes = axes_at(figure, left, height - TOP - TALL - row * (TALL + BETWEEN), width, TALL)
            _draw(axes, x, name, curves, width)
            axes.set_xlabel(label, parse_math=True)
            if name == "CM":
                _zero(axes)
        place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (LEFT / WIDTH, 0.08 / height), "ncols": 6}
        if free:
            at = (LEFT + width + GAP) / WIDTH, (BOTTOM + TALL) / height
            place = {"loc": "upper left", "bbox_to_anchor": at, "ncols": 1 + len(curves) // 9}
        figure.legend(handles=_entries(curves), borderaxespad=0.0, handlelength=2.2, **place)
        note = f"moments about the {found.reference.about_what} {_place(found.reference.about)}"
        figure.text(0.12 / WIDTH, 1.0 - 0.28 / height, note, va="top", color="0.35")
    return figure


def _place(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{float(x) + 0.0:.4g}" for x in point) + ") m"


def _draw(axes: "Axes", x: Callable[[Point], float], name: str, curves: Sequence[Curve], width: float) -> None:
    """Curves with a mark at every point: filled within validity, hollow outside."""
    for (_, points), look in zip(curves, _looks(curves), strict=True):
        at = np.array([[x(p), p.coefficients[name]] for p in points])
        axes.plot(*at.T, color=look["color"], ls="-")
        for within in (True, False):
            chosen = np.array([p.within is within for p in points])
            fill = look["color"] if within else "white"
            axes.plot(*at[chosen].T, ls="", marker=look["marker"], color=look["color"], mfc=fill, ms=3.5, mew=0.8)
    axes.set_ylabel(LABELS[name], parse_math=True)
    axes.yaxis.set_label_coords(-0.58 / width, 0.5)
    axes.grid(True)


def _zero(axes: "Axes") -> None:
    """The line of no moment, where it is in sight."""
    low, high = axes.get_ylim()
    if low < 0.0 < high:
        axes.axhline(0.0, color="0.4", lw=0.6, zorder=1)


def _looks(curves: Sequence[Curve]) -> list[dict[str, Any]]:
    from matplotlib import colormaps

    shades = colormaps["viridis"](np.linspace(0.0, 0.86, max(len(curves), 2)))
    return [{"color": tuple(map(float, shades[i])), "marker": MARKS[i % len(MARKS)]} for i in range(len(curves))]


def _entries(curves: Sequence[Curve]) -> list[Any]:
    from matplotlib.lines import Line2D

    out = [Line2D([], [], **look, ms=3.5, label=label) for (label, _), look in zip(curves, _looks(curves), strict=True)]
    if any(not p.within for _, points in curves for p in points):
        out.append(Line2D([], [], ls="", marker="o", mfc="white", mec="0.3", ms=3.5, label="hollow: outside validity"))
    return out
