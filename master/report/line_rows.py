"""Tension of the lines of a parafoil by row and rib, and how the rows share a rib (ram-air thesis, table 4.4)."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from master.report.figures import DARK, LIGHT, MIDDLE, legend_beside, stacked, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = ("rib", "arc_m", "row", "element", "tension_N", "share_of_rib")
LOOKS = ((DARK, "-", "o"), (MIDDLE, "--", "s"), ("#c2571a", "-.", "^"), (LIGHT, ":", "D"))
NAME = re.compile(r"(.+)_(\d+)")  # of a line of a row, as of the node where it begins: A_6


@dataclass(frozen=True, eq=False)
class LineRows:
    """Lines that begin on the ribs of a ram-air wing, in `rows` (r) by name along the chord, on the `ribs` (k,) by
    number from the left tip; where a row has none on a rib, the element is "" and the tension nan.

    `arc` (k,) m from mid-span to the right, along the first row as drawn; `elements` (k x r) by name, `tension`
    (k,r) N.
    """

    rows: tuple[str, ...]
    ribs: np.ndarray
    arc: np.ndarray
    elements: list[list[str]]
    tension: np.ndarray

    @property
    def share(self) -> np.ndarray:
        """Of the sum of the tensions at each rib (k,r); nan where a rib has no tension at all."""
        total = np.nansum(self.tension, axis=1, keepdims=True)
        return np.divide(self.tension, total, out=np.full(self.tension.shape, np.nan), where=total > 0.0)

    @property
    def middle(self) -> int:
        """Which of the ribs is nearest to mid-span; the right one of two."""
        return int(np.argmin(np.abs(self.arc) + 1e-9 * (self.arc < 0.0)))


def line_rows(members: Any, tension: np.ndarray | None) -> LineRows | None:
    """Rows of the lines of a ram-air wing with the tension (e,) N of all elements; None without membranes that are the
    skin of a body, or without lines that begin on it and are called as the nodes there.

    Further lines of cascades and belts, and tethers, begin elsewhere and belong to no row.
    """
    skin = None if members is None or members.membranes is None else members.membranes.skin
    if skin is None or tension is None or not len(tension):
        return None
    on_skin = {members.labels[node]: node for node in skin}
    found: dict[str, dict[int, tuple[str, float, int]]] = {}
    for name, pull in zip(members.names, tension, strict=True):
        parts = NAME.fullmatch(name)
        if parts and name in on_skin:
            found.setdefault(parts[1], {})[int(parts[2])] = name, float(pull), on_skin[name]
    if not found:
        return None
    rows, ribs = tuple(found), sorted({rib for of_row in found.values() for rib in of_row})
    at = [next(of[rib][2] for of in found.values() if rib in of) for rib in ribs]
    way = np.linalg.norm(np.diff(members.nodes[at], axis=0), axis=1)
    arc = np.concatenate([[0.0], np.cumsum(way)])
    none = "", np.nan, -1
    cells = [[found[row].get(rib, none) for row in rows] for rib in ribs]
    pulls = np.array([[cell[1] for cell in of_rib] for of_rib in cells])
    names = [[cell[0] for cell in of_rib] for of_rib in cells]
    return LineRows(rows, np.array(ribs), arc - 0.5 * arc[-1], names, pulls)


def line_row_results(members: Any, tension: np.ndarray | None) -> dict[str, Any] | None:
    """Sum of the tension N of each row, and tension N and share of each row at the rib in the middle, as summary.json
    holds them; None where there are no rows.
    """
    found = line_rows(members, tension)
    if found is None:
        return None
    k = found.middle
    named = dict(zip(found.rows, np.nansum(found.tension, axis=0).tolist(), strict=True))
    at_middle = zip(found.rows, found.tension[k].tolist(), found.share[k].tolist(), strict=True)
    return {
        "row_tension_N": named,
        "middle_rib": int(found.ribs[k]),
        "at_middle_rib": {row: {"tension_N": pull, "share": share} for row, pull, share in at_middle},
    }


def line_row_rows(members: Any, tension: np.ndarray | None) -> list[tuple[str, str]]:
    """The row of the result on the rows of lines, none where there are none."""
    found = line_rows(members, tension)
    if found is None:
        return []
    k = found.middle
    shares = zip(found.rows, found.tension[k], found.share[k], strict=True)
    parts = [f"{row} {pull:.4g} N ({100.0 * share:.1f} %)" for row, pull, share in shares if np.isfinite(pull)]
    return [(f"lines at rib {found.ribs[k]} of {len(found.ribs)}", ", ".join(parts))]


def line_row_table(found: LineRows) -> tuple[list[str], Iterator[list[Any]]]:
    """Header and rows of rib_lines.csv: a row for each line, rib by rib."""

    def rows() -> Iterator[list[Any]]:
        share = found.share
        for k, rib in enumerate(found.ribs):
            for r, row in enumerate(found.rows):
                if found.elements[k][r]:
                    values = float(found.arc[k]), float(found.tension[k, r]), float(share[k, r])
                    yield [int(rib), repr(values[0]), row, found.elements[k][r], *map(repr, values[1:])]

    return list(COLUMNS), rows()


def line_row_figure(found: LineRows, title: str) -> "Figure":
    """Tension of the lines and its share of the sum at each rib, over the ribs along the span, a curve a row."""
    labels = ("tension, N", "share of the sum\nat the rib, %")
    with style():
        figure, panels = stacked(title, (2.2, 1.6), labels, "rib along the span, m from mid-span (right)")
        for panel, values in zip(panels, (found.tension, 100.0 * found.share), strict=True):
            for r, row in enumerate(found.rows):
                colour, line, mark = LOOKS[r % len(LOOKS)]
                look: dict[str, Any] = {"ls": line, "marker": mark, "ms": 3.0, "color": colour}
                look |= {"clip_on": False, "zorder": 3.0}  # slack lines are on the axis
                panel.plot(found.arc, values[:, r], **look, label=f"row {row}")
            panel.set_ylim(bottom=0.0)
        legend_beside(panels[0])
    return figure
