"""Work-precision diagrams and small multiples of a case's rows, legible in grey; matplotlib loads in here only."""

import math
from itertools import pairwise

from .harness import exponents
from .registry import Branches, Case, Curve
from .text import PYTHON, error_label

# Markers, dashes and greys tell lines apart without colour; the colours are those of Okabe and Ito.
STYLES = (
    {"color": "#000000", "marker": "o", "linestyle": "-"},
    {"color": "#0072B2", "marker": "s", "linestyle": "--"},
    {"color": "#D55E00", "marker": "^", "linestyle": "-."},
    {"color": "#009E73", "marker": "D", "linestyle": ":"},
    {"color": "#CC79A7", "marker": "v", "linestyle": (0, (5, 1, 1, 1, 1, 1))},
    {"color": "#777777", "marker": "x", "linestyle": (0, (8, 2))},
)


def label(case: Case, column):
    """Axis label with unit."""
    own = {"value": case.knob, "error": error_label(case), "time_s": "time, ms"}
    return {**own, **case.labels}[column]


def scaled(column, value):
    """The value as axes show it: times in ms."""
    return 1e3 * value if column == "time_s" else value


def draw(case: Case, rows, path):
    """Write the figure of a case as SVG: the same bytes for the same rows."""
    import matplotlib
    from matplotlib.figure import Figure

    look = {"svg.hashsalt": case.name, "svg.fonttype": "path", "font.size": 9, "axes.grid": True, "grid.alpha": 0.3}
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(look)
        figure = Figure(layout="constrained")
        (_curve if isinstance(case.plot, Curve) else _multiples)(figure, case, rows)
        figure.suptitle(case.title, fontsize=10)
        figure.supxlabel(f"{PYTHON} -m benchmarks run {case.name}", fontsize=6.5, color="0.35")
        figure.savefig(path, format=path.suffix[1:], metadata={"Date": None} if path.suffix == ".svg" else None)


def _lines(rows):
    return {s: [r for r in rows if r["series"] == s] for s in dict.fromkeys(r["series"] for r in rows)}


def _curve(figure, case, rows):
    figure.set_size_inches(6.4, 4.2)
    axes = figure.subplots()
    fitted = exponents(case, rows)
    x, y = case.plot.x, case.plot.y
    marked = "value" not in (x, y)
    logarithmic = [scale == "log" for scale in case.plot.scales]
    for k, (series, own) in enumerate(_lines(rows).items()):
        good = [r for r in own if r["status"] == "converged" and (r[y] > 0.0 or not logarithmic[1])]
        at = [[scaled(c, r[c]) for r in good] for c in (x, y)]
        style = {**STYLES[k % len(STYLES)], "markersize": 4.5, "linewidth": 1.2, "markerfacecolor": "white"}
        power = f"{case.fit.law}^{fitted[series]:.2f}" if series in fitted else ""
        axes.plot(*at, label=": ".join(t for t in (series, power) if t) or None, **style)
        for r, *place in zip(good, *at, strict=True) if k == 0 and marked else ():
            how = {"xytext": (4, 5), "textcoords": "offset points", "fontsize": 7, "color": "0.25"}
            axes.annotate(f"{r['value']:g}", place, **how)
    if marked:
        axes.margins(x=0.1, y=0.08)  # room for the numbers beside the outermost points
    axes.set_xscale(case.plot.scales[0])
    axes.set_yscale(case.plot.scales[1])
    for axis, log in zip((axes.xaxis, axes.yaxis), logarithmic, strict=True):
        if log:
            _ticks(axis)
    if not logarithmic[1]:
        axes.set_ylim(bottom=0.0)
    axes.set_xlabel(label(case, x) + (f"   (numbers: {case.knob})" if marked else ""))
    axes.set_ylabel(label(case, y))
    if len(_lines(rows)) > 1:
        axes.legend(fontsize=7.5, framealpha=0.9)


def _ticks(axis):
    """Plain numbers at 1, 2, 5 on less than two decades, else powers of ten; no labels in between."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    axis.set_minor_formatter(NullFormatter())
    if high < 100.0 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _other(plot, row):
    """Whether a row lies on the branch whose markers are filled."""
    return isinstance(plot, Branches) and row[plot.by] < plot.least


def _broken(plot, rows, y):
    """Places of the points of a line; nan where none converged, and between branches."""
    at = [[r[plot.x], r[y] if r["status"] == "converged" else math.nan] for r in rows]
    if isinstance(plot, Branches):
        jumps = [k for k, (a, b) in enumerate(pairwise(rows), 1) if abs(b[plot.by] - a[plot.by]) > plot.jump]
        for k in reversed(jumps):
            at.insert(k, [math.nan, math.nan])
    return [x for x, _ in at], [value for _, value in at]


def _multiples(figure, case, rows):
    from matplotlib.lines import Line2D

    plot = case.plot
    across = sorted({r[plot.across] for r in rows})
    lines = sorted({r[plot.lines] for r in rows})
    figure.set_size_inches(2.5 * len(across) + 1.2, 1.65 * len(plot.ys) + 0.9)
    grid = figure.subplots(len(plot.ys), len(across), sharex=True, sharey="row", squeeze=False)
    for j, value in enumerate(across):
        for i, y in enumerate(plot.ys):
            axes = grid[i][j]
            for k, line in enumerate(lines):
                own = [r for r in rows if r[plot.across] == value and r[plot.lines] == line]
                style = {**STYLES[k % len(STYLES)], "markersize": 3.5, "linewidth": 1.0}
                axes.plot(*_broken(plot, own, y), label=f"{line:g}", **style, markerfacecolor="white")
                low = [r for r in own if r["status"] == "converged" and _other(plot, r)]
                axes.plot([r[plot.x] for r in low], [r[y] for r in low], **style | {"linestyle": ""})
            if j == 0:
                axes.set_ylabel(label(case, y))
        name, _, unit = label(case, plot.across).partition(", ")
        grid[0][j].set_title(f"{name} {value:g} {unit}", fontsize=9)
        grid[-1][j].set_xlabel(label(case, plot.x))
    handles, names = grid[0][0].get_legend_handles_labels()
    if isinstance(plot, Branches):
        handles += (Line2D([], [], color=STYLES[0]["color"], marker="o", markersize=3.5, linestyle=""),)
        names += (plot.filled,)
    figure.legend(handles, names, title=label(case, plot.lines), loc="outside right upper", fontsize=7.5)
