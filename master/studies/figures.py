"""The plots of a comparison: residuals, coupling iterations and relaxation factors, in the look of a run's report."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.convergence import power_of_ten
from master.report.figures import DARK, MIDDLE, WIDTH, axes_at, new_figure, style, wrapped
from master.studies.tables import cases, fewest, status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BAD = "#b2182b"
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)))
MOST_IN_ONE = 7  # lines of a panel; with more there is a panel a scheme
LEFT, RIGHT, TOP, BOTTOM, GAP = 0.8, 2.25, 0.4, 0.5, 0.45  # in
HEIGHT, SMALL = 1.75, 1.35  # in, of a panel that spans the page and of one that does not
COLUMN_GAP, LINE = 0.15, 0.17  # in, between small panels, and of a line of a legend
BAR = 0.19  # in, of a cell in the plot of iterations

Rows = Sequence[dict[str, Any]]


def comparison_figures(rows: Rows) -> dict[str, "Figure"]:
    """Name -> figure of those that there is something to show in."""
    ran = [row for row in rows if row["coupling_iterations"] is not None]
    if not ran:
        return {}
    steady, in_time = ([row for row in ran if row[key]] for key in ("residual_history_m", "evaluations_history"))
    figures = {"residuals": residual_figure(steady)} if steady else {}
    figures["iterations"] = iteration_figure(rows)
    if in_time:
        figures["steps"] = step_figure(in_time)
    moving = [row for row in ran if len({v for v in row["omega_history"] if v is not None}) > 1]
    if moving:
        figures["omega"] = omega_figure(moving)
    return figures


def residual_figure(rows: Rows) -> "Figure":
    """Interface residual m over the coupling iterations: a panel a scene, or where lines are many one a scheme."""
    from matplotlib.ticker import FuncFormatter

    with style():
        tolerance = rows[0]["tolerance"]
        values = np.array([v for row in rows for v in row["residual_history_m"] if v is not None and v > 0.0])
        low, high = (np.log10(f(values, initial=tolerance)) for f in (np.min, np.max))
        span = 10.0 ** np.floor(low - 0.2), 10.0 ** np.ceil(high + 0.1)

        def panel(axes: "Axes", mine: Rows, others: Rows, looks: dict[str, Any]) -> None:
            axes.set_yscale("log")
            axes.minorticks_off()
            axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: power_of_ten(y)))
            for row in others:
                axes.plot(*_line(row, "residual_history_m", span[0]), color="0.8", lw=0.8)
            for row in mine:
                _drawn(axes, row, "residual_history_m", looks[row["label"]], span[0])
            axes.axhline(tolerance, color=MIDDLE, ls="--", lw=0.8)
            right = axes.get_yaxis_transform()  # x in parts of the panel
            axes.text(0.9, 0.8 * tolerance, f"tolerance {tolerance:g} m", transform=right, ha="right", va="top", size=7)
            axes.set_ylim(*span)

        return _panels(
            rows,
            "Interface residual over the coupling iterations, and how many each scheme took",
            "interface residual, m",
            panel,
        )


def step_figure(rows: Rows) -> "Figure":
    """Coupling iterations of each communication step of transient scenes."""
    with style():

        def panel(axes: "Axes", mine: Rows, others: Rows, looks: dict[str, Any]) -> None:
            for row in others:
                axes.plot(*_line(row, "evaluations_history"), color="0.8", lw=0.8)
            for row in mine:
                _drawn(axes, row, "evaluations_history", looks[row["label"]])
            axes.set_ylim(bottom=0.0)

        title = "Coupling iterations of each communication step, and how many each scheme took in all"
        return _panels(rows, title, "coupling iterations", panel, "evaluations_history", "communication step")


def omega_figure(rows: Rows) -> "Figure":
    """Relaxation factors over the coupling iterations, on an axis that is linear near zero."""
    with style():

        def panel(axes: "Axes", mine: Rows, others: Rows, looks: dict[str, Any]) -> None:
            axes.set_yscale("symlog", linthresh=1.0, linscale=1.5)
            axes.minorticks_off()
            for row in others:
                axes.plot(*_line(row, "omega_history"), color="0.8", lw=0.8)
            for row in mine:
                _drawn(axes, row, "omega_history", looks[row["label"]])
            axes.axhline(0.0, color="0.3", lw=0.5)
            ticks = [-100, -10, -1, -0.5, 0, 0.5, 1, 10, 100]
            low, high = axes.get_ylim()
            axes.set_yticks([t for t in ticks if low <= t <= high], [f"{t:g}" for t in ticks if low <= t <= high])

        return _panels(rows, "Relaxation factor over the coupling iterations", "omega, –", panel)


def iteration_figure(rows: Rows) -> "Figure":
    """Coupling iterations as bars, a panel a scene; what did not converge is hatched in red and says how it ended."""
    with style():
        groups = cases(rows)
        left = 0.3 + max(_width(row["label"]) for row in rows)
        heights = [BAR * (len(members) + 0.6) for members in groups.values()]
        total = TOP + sum(heights) + GAP * (len(heights) - 1) + BOTTOM
        figure = new_figure(total, "Coupling iterations of each scheme")
        at, first = total - TOP - 0.15, None
        most = max((row["coupling_iterations"] or 0 for row in rows), default=1)
        for height, (case, members) in zip(heights, groups.items(), strict=True):
            at -= height
            shared: dict[str, Any] = {} if first is None else {"sharex": first}
            axes = axes_at(figure, left, at + 0.1, WIDTH - left - 0.25, height, **shared)
            first = axes if first is None else first
            axes.set_title(case, loc="left", pad=3.0)
            _bars(axes, members, most)
            axes.tick_params(labelbottom=False)
            at -= GAP
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("coupling iterations")
        axes.set_xlim(0.0, 1.28 * most)
    return figure


def _bars(axes: "Axes", members: Rows, most: int) -> None:
    least = fewest(members)
    for place, row in enumerate(members):
        count, good = row["coupling_iterations"] or 0, row["status"] == "converged"
        if good:
            look: dict[str, Any] = {"color": DARK if count == least else MIDDLE}
            other = row["equilibrium"] > 1
            word = "another equilibrium" if row["communication_steps"] is None else "another end"
            note = f"{count}" + (f", {word} ({row['equilibrium']})" if other else "")
            look |= {"fc": "white", "ec": DARK, "hatch": "...."} if other else {}
            look.pop("color" if other else "", None)
        else:
            look = {"fc": "white", "ec": BAD, "hatch": "/////"}
            note = f"{status(row)}" + (f", {count}" if count else "")
        axes.barh(place, count, 0.68, lw=0.7, **look)
        axes.text(count + 0.008 * most, place, note, va="center", color="black" if good else BAD)
    axes.set_yticks(range(len(members)), [row["label"] for row in members])
    axes.set_ylim(len(members) - 0.4, -0.6)
    axes.grid(True, axis="x")
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(axis="y", length=0.0)


def _panels(
    rows: Rows, title: str, y_label: str, draw: Any, key: str = "omega_history", x_label: str = "coupling iteration"
) -> "Figure":
    """A panel a case with its legend beside, or rows of panels, a case each, with a column a scheme.

    The x axis has room for the history `key` of all rows.
    """
    groups = cases(rows)
    if max(map(len, groups.values())) <= MOST_IN_ONE:
        return _one_each(groups, title, (x_label, y_label), draw, key)
    return _by_scheme(groups, title, (x_label, y_label), draw, key)


def _one_each(groups: Mapping[str, Rows], title: str, labels: tuple[str, str], draw: Any, key: str) -> "Figure":
    looks = _looks(list(dict.fromkeys(row["label"] for rows in groups.values() for row in rows)))
    total = TOP + len(groups) * (HEIGHT + GAP) - GAP + BOTTOM + 0.15
    figure = new_figure(total, title)
    for k, (case, rows) in enumerate(groups.items()):
        at = total - TOP - 0.15 - (k + 1) * HEIGHT - k * GAP
        axes = axes_at(figure, LEFT, at, WIDTH - LEFT - RIGHT, HEIGHT)
        axes.set_title(case, loc="left", pad=3.0)
        draw(axes, rows, [], looks)
        _finish(axes, rows, key)
        axes.set_ylabel(labels[1])
        axes.yaxis.set_label_coords(-0.5 / (WIDTH - LEFT - RIGHT), 0.5)
        _legend(axes, rows, looks, RIGHT - 0.55, loc="upper left", bbox_to_anchor=(1.01, 1.04))
    axes.set_xlabel(labels[0])
    return figure


def _by_scheme(groups: Mapping[str, Rows], title: str, labels: tuple[str, str], draw: Any, key: str) -> "Figure":
    """Small multiples; the other schemes of the case are grey behind the lines of one."""
    schemes = list(dict.fromkeys(row["scheme"] for rows in groups.values() for row in rows))
    looks: dict[str, Any] = {}
    for scheme in schemes:
        looks |= _looks(
            list(dict.fromkeys(r["label"] for rows in groups.values() for r in rows if r["scheme"] == scheme))
        )
    columns = 2 if len(schemes) in (2, 4) else min(3, len(schemes))
    width = (WIDTH - LEFT - 0.15 - COLUMN_GAP * (columns - 1)) / columns
    room = width - 0.45
    blocks, total = [], TOP + 0.05  # (case, lines of schemes, the height of each line), and the height of all
    for case, rows in groups.items():
        lines = [schemes[i : i + columns] for i in range(0, len(schemes), columns)]
        legends = [max(sum(_lines(r, room) for r in rows if r["scheme"] == s) for s in line) for line in lines]
        heights = [SMALL + 0.72 + LINE * count for count in legends]
        blocks.append((case, rows, lines, heights))
        total += 0.25 + sum(heights)
    figure = new_figure(total, title)
    top = total - TOP
    for case, rows, lines, heights in blocks:
        figure.text(0.12 / WIDTH, top / total, case, va="top", fontsize=8.0, fontweight="bold")
        top -= 0.25
        for line, height in zip(lines, heights, strict=True):
            for column, scheme in enumerate(line):
                at = LEFT + column * (width + COLUMN_GAP), top - 0.18 - SMALL
                axes = axes_at(figure, *at, width, SMALL)
                mine = [row for row in rows if row["scheme"] == scheme]
                axes.set_title(scheme, loc="left", pad=3.0)
                draw(axes, mine, [row for row in rows if row["scheme"] != scheme], looks)
                _finish(axes, rows, key)
                axes.tick_params(labelleft=column == 0)
                if column == 0:
                    axes.set_ylabel(labels[1])
                    axes.yaxis.set_label_coords(-0.55 / width, 0.5)
                axes.set_xlabel(labels[0], labelpad=1.0)
                place = {"loc": "upper left", "bbox_to_anchor": (0.0, -0.38 / SMALL)}
                _legend(axes, mine, looks, room, True, **place)
            top -= height
    return figure


def _finish(axes: "Axes", rows: Rows, key: str) -> None:
    from matplotlib.ticker import MaxNLocator

    axes.grid(True)
    axes.xaxis.set_major_locator(MaxNLocator(8, integer=True, min_n_ticks=1, steps=[1, 2, 5, 10]))
    most = max(len(row[key]) for row in rows)
    axes.set_xlim(1.0 - 0.02 * most, most + 0.02 * most + 0.5)


def _legend(axes: "Axes", rows: Rows, looks: dict[str, Any], room: float, short: bool = False, **place: Any) -> None:
    from matplotlib.lines import Line2D

    entries = [Line2D([], [], **looks[row["label"]], label=wrapped(_entry(row, short), room)) for row in rows]
    axes.legend(handles=entries, borderaxespad=0.0, handlelength=2.2, labelspacing=0.25, **place)


def _entry(row: dict[str, Any], short: bool) -> str:
    """What the legend says of a row: the scheme, but for `short`, its parameters, and how many iterations it took."""
    name = row["label"].removeprefix(row["scheme"]).strip() if short else row["label"]
    if row["status"] != "converged":
        end = f"{status(row)}, {row['coupling_iterations']}"
    else:
        end = f"{row['coupling_iterations']}" + ("" if row["equilibrium"] == 1 else " *")
    return f"{name}: {end}" if name else end


def _lines(row: dict[str, Any], room: float) -> int:
    return wrapped(_entry(row, True), room).count("\n") + 1


def _looks(labels: list[str]) -> dict[str, Any]:
    """Colour and dashes of each label: colours of even steps in lightness, and dashes that tell them apart without."""
    from matplotlib import colormaps

    shades = colormaps["viridis"](np.linspace(0.0, 0.86, max(len(labels), 2)))
    return {
        label: {"color": tuple(map(float, shades[i])), "ls": DASHES[i % len(DASHES)]} for i, label in enumerate(labels)
    }


def _line(row: dict[str, Any], key: str, floor: float = -np.inf) -> tuple[np.ndarray, np.ndarray]:
    """Coupling iterations and values; those below the `floor` of the axis, such as a residual of zero, stand on it."""
    values = np.array([np.nan if v is None else max(v, floor) for v in row[key]], dtype=float)
    return np.arange(1, len(values) + 1), values


def _drawn(axes: "Axes", row: dict[str, Any], key: str, look: dict[str, Any], floor: float = -np.inf) -> None:
    """The history of a row with a mark at its end: a dot where it converged, a red cross where it did not."""
    k, values = _line(row, key, floor)
    axes.plot(k, values, **look)
    there = np.flatnonzero(np.isfinite(values))
    if len(there):
        good = row["status"] == "converged"
        mark: dict[str, Any] = {"marker": "o", "color": look["color"]} if good else {"marker": "X", "color": BAD}
        axes.plot(k[there[-1:]], values[there[-1:]], ls="", ms=4.5 if good else 6.0, zorder=4, **mark)


def _width(text: str) -> float:
    """Width of a text in inches at the size of legends."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    return float(TextPath((0.0, 0.0), text, prop=FontProperties(size=8.0)).get_extents().x1) / 72.0
