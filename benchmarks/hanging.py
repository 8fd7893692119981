"""The V3 kite hanging upside down: lengths beside the measurement and the LEI thesis, and what moves them."""

import csv
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import scenes
from scenes import StepFailed

from .registry import Table
from .text import lines, table

TOLERANCE = 1e-3  # N
# Trailing edge ends of tips and struts from the left tip, the middle of the leading edge, trailing edge ends of the
# outermost struts.
TRAILING = ("58", "52", "46", "40", "34", "26", "20", "14", "8", "2")
CENTRE, OUTER = "29", ("52", "8")
# Relative errors % of trailing edge, span, centre to tip and their mean, load cases 1 ... 5 (LEI thesis, table 7.2).
THESIS = {
    1: (-1.9, 4.4, -11.6, 6.0), 2: (19.1, 40.8, 12.2, 24.1), 3: (14.9, 43.7, 9.7, 22.8), 4: (7.1, 7.0, 4.4, 6.2),
    5: (6.1, 7.6, 2.9, 5.5),
}  # fmt: skip


def measured():
    """Load case -> lengths m: La ... Li, b, Lcs left and right (Haanen 2026, published with kite_fem)."""
    path = Path(__file__).parent / "data" / "v3_hanging_test.csv"
    with path.open(encoding="utf-8") as file:
        return {int(row[0]): np.array(row[1:], float) for row in list(csv.reader(file))[1:]}


def hung(case, change=None, **parameters):
    """The core of a load case after its first solve, and the time that took, s; `change` replaces the members."""
    scene = scenes.load("v3_hanging_test", {"variant": f"load_case_{case}"})
    if change is not None:
        object.__setattr__(scene, "members", change(scene.members))  # frozen, and shared with nobody
    core = scene.structural_core()
    core.set("solver_tolerance", TOLERANCE)
    for name, value in parameters.items():
        core.set(name, value)
    begin = time.perf_counter()
    core.step(0.0, 1.0)
    return scene, core, time.perf_counter() - begin


def lengths(scene, core):
    """La ... Li, b and Lcs (left, right) m of a solved state, (12,)."""
    place = dict(zip(scene.members.labels, core.get("position"), strict=True))
    edge = np.array([place[n] for n in TRAILING])
    outer = [np.linalg.norm(place[CENTRE] - place[n]) for n in OUTER]
    return np.array([*np.linalg.norm(np.diff(edge, axis=0), axis=1), np.linalg.norm(edge[0] - edge[-1]), *outer])


def errors(found, truth):
    """Relative errors % of the trailing edge (sum of La ... Li), the span and centre to tip, and their mean size."""
    sums = [np.array([v[:9].sum(), v[9], v[10:].mean()]) for v in (found, truth)]
    each = 100.0 * (sums[0] / sums[1] - 1.0)
    return *each, float(np.abs(each).mean())


def comparison(quick):
    """Lengths of all load cases; errors of the measured ones beside those of the thesis."""
    rows, total = [], 0.0
    truth = measured()
    for case in range(1, 2 if quick else 11):
        scene, core, seconds = hung(case)
        total += seconds
        found = lengths(scene, core)
        row = [str(case), *(f"{v:.3f}" for v in found[:10]), f"{found[10:].mean():.3f}"]
        if case in truth:
            own = errors(found, truth[case])
            row += [f"{a:+.1f} / {b:+.1f}" for a, b in zip(own[:3], THESIS[case][:3], strict=True)]
            row += [f"{own[3]:.1f} / {THESIS[case][3]:.1f}"]
        else:
            row += [""] * 4
        rows.append([*row, f"{float(core.get('residual')):.0e}", f"{seconds:.2f}"])
    names = ["case", *(f"L{c}" for c in "abcdefghi"), "b", "Lcs", "trailing edge, % (ours / thesis)"]
    names += ["span, %", "centre to tip, %", "mean, %", "residual, N", "time, s"]
    return lines(
        table(names, rows),
        f"Lengths in m. All cases together {total:.1f} s from the design shape. Lcs goes from the middle of the "
        "leading edge to the trailing edge end of the outermost strut: with that the thesis lengths follow from its "
        "errors in the stretched cases 4 and 5, with the tip they do not. Measured lengths: Haanen (2026).",
    )


def _scaled_trailing_edge(members):
    """The canopy with the trailing edge as measured when it is pulled taut (case 5), less so towards the nose."""
    grid, nodes = members.wing.grid, members.nodes
    taut = measured()[5][:9]
    columns = [int(np.flatnonzero(grid[:, -1] == members.labels.index(n))[0]) for n in TRAILING]
    factor = np.ones(len(grid) - 1)
    for length, first, last in zip(taut, columns, columns[1:], strict=False):
        arc = np.linalg.norm(np.diff(nodes[grid[first : last + 1, -1]], axis=0), axis=1).sum()
        factor[first:last] = length / arc
    place = {int(n): (c, k) for c, row in enumerate(grid) for k, n in enumerate(row)}
    groups = []
    for group in members.chains:
        l0 = group.l0.copy()
        for e, ends in enumerate(group.nodes):
            a, b = place.get(int(ends[0])), place.get(int(ends[-1]))
            if len(ends) == 2 and a and b and a[1] == b[1] and abs(a[0] - b[0]) == 1:
                l0[e] *= 1.0 + (factor[min(a[0], b[0])] - 1.0) * a[1] / (grid.shape[1] - 1)
        groups.append(replace(group, l0=l0))
    return replace(members, chains=tuple(groups))


def _front_line(change):
    """The members with the lines AI, from inner front lines to the bar, longer by `change` m; None: without them."""

    def changed(members):
        groups, area, start = [], [], 0
        for group in members.chains:
            own = np.array([n.startswith("AI_") for n in group.names])
            part = members.area[start : start + len(own)]
            start += len(own)
            if change is None:
                groups.append(group.select(~own))
                area.append(part[~own])
            else:
                groups.append(replace(group, l0=group.l0 + change * own))
                area.append(part)
        return replace(members, chains=tuple(groups), area=np.concatenate(area))

    return changed


STUDIES = (
    ("as published", None, {}),
    ("trailing edge as measured taut", _scaled_trailing_edge, {}),
    ("front lines AI 0.18 m longer", _front_line(0.18), {}),
    ("front lines AI 0.53 m longer", _front_line(0.53), {}),
    ("without the front lines AI", _front_line(None), {}),
    ("tips pressed together by 4 N", None, {"tip_load": -4.0}),
    ("tips pressed together by 8 N", None, {"tip_load": -8.0}),
    ("tubes at a third of the pressure", None, {"tube_pressure": 5000.0}),
    ("line modulus 0.55 GPa", None, {"line_modulus": 0.55e9}),
)


def causes(quick):
    """What moves the span: changes of the data and of the physics, one at a time, in load cases 1 to 5."""
    rows, truth = [], measured()
    for label, change, parameters in STUDIES[:1] if quick else STUDIES:
        row = [label]
        for case in range(1, 2 if quick else 6):
            given = dict(parameters)
            if "tip_load" in given:
                given["tip_load"] += {4: 20.0, 5: 49.0}.get(case, 0.0)
            if "tube_pressure" in given and case > 5:
                continue
            try:
                scene, core, _ = hung(case, change, **given)
                found = lengths(scene, core)
                row.append(f"{found[9]:.2f} ({errors(found, truth[case])[3]:.0f} %)")
            except StepFailed:
                row.append("not found")
        rows.append(row)
    names = ["change", *(f"case {k}, span {truth[k][9]:.2f} m" for k in range(1, 2 if quick else 6))]
    return lines(
        table(names, rows),
        "Span in m, in brackets the mean error over trailing edge, span and centre to tip; measured spans in the head.",
    )


ENTRIES = (
    Table(name="hanging.lengths", title="V3 kite hanging upside down: lengths of the ten load cases", build=comparison),
    Table(name="hanging.causes", title="V3 kite hanging upside down: what moves the span", build=causes),
)
