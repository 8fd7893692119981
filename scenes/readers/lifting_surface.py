"""The tables of [wing]: struts that carry strips, design sections, and the polars of these."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..builders.interface import arc_length, nearest_stations
from ..interface import Interface
from ..members import Members
from ..scene import SectionPolars
from ..schema import SceneError, WingInput
from .description import Description
from .polars import at_common_angles, read_curves
from .span_order import check_span_order
from .tables import Table, name, number, read_table

# Least range deg that polars blended in a strip share, or the whole of one: a strip in it flies on data of both.
OVERLAP = 1.0
QUARTER = 0.25  # of the chord: where the lifting line is


def read_struts(folder: Path, scene: Description, members: Members) -> np.ndarray:
    """Leading and trailing edge nodes (struts, 2) that carry strips, from the left tip to the right one; none without
    a wing.
    """
    if members.wing is not None:
        struts: np.ndarray = members.wing.grid[:, [0, -1]]
        if scene.wing is not None:
            _check_ribs(folder, scene, members, struts[:: scene.choices.canopy_subdivisions])
        return struts
    if scene.wing is not None:
        return _struts(folder, scene, members)
    if scene.aero is None and scene.dynamics is None and scene.membranes is None:
        raise SceneError(
            f"{folder.name}/scene.toml: a scene without [aero] needs tubes and ribs in [structure], [membranes] or "
            "[dynamics]."
        )
    return np.zeros((0, 2), dtype=int)


def _upwind(scene, edges):
    """Rows of the `edges` (s,2,3) m, leading and trailing, of which the second lies upwind of the first."""
    wind, chord = np.array(scene.aero.wind_direction), edges[:, 1] - edges[:, 0]
    return np.flatnonzero(chord @ wind < -0.1 * np.linalg.norm(chord, axis=1) * np.linalg.norm(wind))


def _check_ribs(folder, scene, members, ribs):
    where = f"{folder.name}/{scene.structure.ribs}"
    if scene.wing.struts is not None:
        raise SceneError(f"{folder.name}/scene.toml: [wing] struts means nothing to a wing of tubes and ribs; drop it.")
    for row in _upwind(scene, members.nodes[ribs]):
        le, te = (members.labels[n] for n in ribs[row])
        raise SceneError(
            f"{where}: the trailing edge '{te}' lies upwind of the leading edge '{le}'; swap the two nodes or turn "
            "wind_direction in scene.toml."
        )


def _struts(folder, scene, members):
    columns = {"leading_edge_node": name, "trailing_edge_node": name}
    if scene.wing.struts is None:
        raise SceneError(f"{folder.name}/scene.toml: [wing] lacks 'struts'; add it.")
    table = read_table(folder / scene.wing.struts, columns)
    if len(table) < 2:
        raise SceneError(f"{table.path.parent.name}/{table.path.name} needs at least two struts; add one.")
    pairs = [[members.node(table[column][row], table.at(row)) for column in columns] for row in range(len(table))]
    struts = np.array(pairs)
    chord = np.linalg.norm(members.nodes[struts[:, 1]] - members.nodes[struts[:, 0]], axis=1)
    if np.any(chord == 0.0):
        row = int(np.flatnonzero(chord == 0.0)[0])
        raise SceneError(f"{table.at(row)}: leading and trailing edge are one point; name two nodes apart.")
    for row in _upwind(scene, members.nodes[struts]):
        raise SceneError(
            f"{table.at(int(row))}: the trailing edge lies upwind of the leading edge; swap the two nodes or turn "
            "wind_direction in scene.toml."
        )
    check_span_order(table, "struts", members.nodes[struts.T], scene.aero.wind_direction)
    return struts


def read_sections(folder: Path, wing: WingInput, wind: tuple[float, ...]) -> Table:
    """The table of design sections, left tip first as seen facing the `wind`."""
    columns: dict[str, Callable[[str], Any]] = {"section": name, "polar": name}
    columns |= {f"{side}_{axis}_m": number for side in ("le", "te") for axis in "xyz"}
    table = read_table(folder / wing.sections, columns)
    if len(table) < 2:
        raise SceneError(f"{table.path.parent.name}/{table.path.name} needs at least two sections; add one.")
    edges = design_edges(table, 1.0)
    same = np.flatnonzero(np.all(np.diff(_quarter_chord(*edges), axis=0) == 0.0, axis=1))
    if len(same):
        raise SceneError(f"{table.at(int(same[0]) + 1)}: the quarter chord is that of the row above; move the section.")
    check_span_order(table, "sections", np.array(edges), wind)
    return table


def design_edges(sections: Table, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Leading and trailing edge (sections,3) m of the design wing."""
    le, te = (scale * np.array([sections[f"{side}_{axis}_m"] for axis in "xyz"]).T for side in ("le", "te"))
    return le, te


def read_polars(folder: Path, wing: WingInput, sections: Table, scale: float, interface: Interface) -> SectionPolars:
    """The polars of the design sections of a wing at a scale, at common angles, for the strips of its interface."""
    curves = read_curves(folder / wing.polars)
    for row, key in enumerate(sections["polar"]):
        if key not in curves:
            label = f"{folder.name}/{wing.polars}"
            raise SceneError(f"{sections.at(row)}: polar '{key}' is not in {label}; add it or correct the name.")
    used = list(dict.fromkeys(sections["polar"]))
    polar = np.array([used.index(key) for key in sections["polar"]])
    alpha, cl, cd, cm, ends = at_common_angles([curves[key] for key in used])
    from aero.polars import sections_beside  # not loaded by scenes without a wing

    span, strips = _places(*design_edges(sections, scale), interface)
    lost = np.flatnonzero(~(np.diff(span) > 0.0))
    if len(lost):
        raise SceneError(
            f"{sections.at(int(lost[0]) + 1)} stands where the row before does, to rounding of the span of "
            f"{span[-1]:g} m; correct the places of the sections."
        )
    _check_ranges(f"{folder.name}/{wing.polars}", sections, curves, sections_beside(span, strips))
    return SectionPolars(alpha, cl, cd, cm, ends, polar, span, strips)


def _check_ranges(where, sections, curves, beside):
    """`SceneError` where a strip is blended of two polars, those of the sections `beside` it, which have too few angles
    in common for a coefficient of both.
    """
    for left, right in sorted(set(zip(*(rows.tolist() for rows in beside), strict=True))):
        keys = sections["polar"][left], sections["polar"][right]
        check_overlap(where, curves, keys, f"{sections.at(left)} and row {sections.lines[right]}")


def check_overlap(where: str, curves: dict[str, np.ndarray], keys: tuple[str, str], between: str) -> None:
    """`SceneError` where two polars of a file, `where`, that strips `between` two rows blend share too few angles."""
    (low, high), (low_2, high_2) = (curves[key][0, [0, -1]] for key in keys)
    if min(high, high_2) - max(low, low_2) < min(OVERLAP, high - low, high_2 - low_2):
        raise SceneError(
            f"{where}: polar '{keys[0]}' goes from {low:g} to {high:g} deg and polar '{keys[1]}' from {low_2:g} to "
            f"{high_2:g} deg, but strips between {between} blend both; widen them until they share {OVERLAP:g} deg or "
            "more."
        )


def _quarter_chord(leading_edge, trailing_edge):
    """Points (n,3) m of the lifting line."""
    return leading_edge + QUARTER * (trailing_edge - leading_edge)


def _places(leading_edge, trailing_edge, interface):
    """Where the design sections and the strips of the interface lie on the quarter-chord line of the design, m from its
    left end. A strip lies where this line comes nearest, as the structure may be shorter or longer than the design.
    """
    line = _quarter_chord(leading_edge, trailing_edge)
    quarter = _quarter_chord(*interface.nodes[interface.sections[:, [0, -1]].T])
    span = arc_length(line)
    station = nearest_stations(0.5 * (quarter[1:] + quarter[:-1]), line)
    return span, np.interp(station, np.arange(len(line)), span)
