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
from .tables import Table, name, number, read_table

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
    if scene.aero is None and scene.dynamics is None:
        raise SceneError(
            f"{folder.name}/scene.toml: a scene without [aero] needs tubes and ribs in [structure], or [dynamics]."
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
    y = members.nodes[struts, 1].mean(axis=1)
    if np.any(np.diff(y) <= 0.0):
        row = int(np.flatnonzero(np.diff(y) <= 0.0)[0]) + 1
        raise SceneError(
            f"{table.at(row)}: struts must go from the left tip (y < 0) to the right one; reorder the rows."
        )
    return struts


def read_sections(folder: Path, wing: WingInput) -> Table:
    """The table of design sections, left tip first."""
    columns: dict[str, Callable[[str], Any]] = {"section": name, "polar": name}
    columns |= {f"{side}_{axis}_m": number for side in ("le", "te") for axis in "xyz"}
    table = read_table(folder / wing.sections, columns)
    if len(table) < 2:
        raise SceneError(f"{table.path.parent.name}/{table.path.name} needs at least two sections; add one.")
    edge = np.array([table[f"le_{axis}_m"] for axis in "xyz"]).T
    same = np.flatnonzero(np.linalg.norm(np.diff(edge, axis=0), axis=1) == 0.0)
    if len(same):
        raise SceneError(f"{table.at(int(same[0]) + 1)}: the leading edge is that of the row above; move it.")
    if edge[0, 1] >= edge[-1, 1]:
        where = f"{table.path.parent.name}/{table.path.name}"
        raise SceneError(f"{where}: sections must go from the left tip (y < 0) to the right one; reverse the rows.")
    return table


def design_edges(sections: Table, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Leading and trailing edge (sections,3) m of the design wing."""
    le, te = (scale * np.array([sections[f"{side}_{axis}_m"] for axis in "xyz"]).T for side in ("le", "te"))
    return le, te


def read_polars(folder: Path, wing: WingInput, sections: Table, scale: float, interface: Interface) -> SectionPolars:
    """The polars of the design sections of a wing at a scale, for the strips of its interface."""
    columns = {"polar": name, "alpha_deg": number, "cl": number, "cd": number, "cm": number}
    table = read_table(folder / wing.polars, columns)
    polar = np.array(table["polar"])
    values = np.array([table[c] for c in ("alpha_deg", "cl", "cd", "cm")])
    label = f"{table.path.parent.name}/{table.path.name}"
    curves: dict[str, np.ndarray] = {}
    grid = values[0, polar == polar[0]]
    for key in dict.fromkeys(table["polar"]):
        rows = np.flatnonzero(polar == key)
        alpha = values[0, rows]
        falling = np.flatnonzero(np.diff(alpha) <= 0.0)
        if len(alpha) < 2:
            raise SceneError(f"{table.at(int(rows[0]))}: polar '{key}' has one angle only; give it at least two.")
        if len(falling):
            at = table.at(int(rows[falling[0] + 1]))
            raise SceneError(f"{at}: alpha_deg of polar '{key}' does not increase; sort its rows by angle.")
        if len(alpha) != len(grid) or np.max(np.abs(alpha - grid)) > 1e-9:
            raise SceneError(f"{label}: polar '{key}' has other angles than the first one; use one list for all.")
        curves[key] = values[1:, rows]
    if np.abs(grid).max() <= 3.2 and max(np.abs(np.diff(c[0]) / np.diff(grid)).max() for c in curves.values()) > 1.0:
        raise SceneError(f"{label}: alpha_deg goes from {grid[0]:g} to {grid[-1]:g} only; write degrees, not radians.")
    for row, key in enumerate(sections["polar"]):
        if key not in curves:
            raise SceneError(f"{sections.at(row)}: polar '{key}' is not in {label}; add it or correct the name.")
    used = list(dict.fromkeys(sections["polar"]))
    cl, cd, cm = np.array([curves[key] for key in used]).transpose(1, 0, 2)
    polar = np.array([used.index(key) for key in sections["polar"]])
    return SectionPolars(np.deg2rad(grid), cl, cd, cm, polar, *_places(*design_edges(sections, scale), interface))


def _places(leading_edge, trailing_edge, interface):
    """Where the design sections and the strips of the interface lie on the quarter-chord line of the design, m from its
    left end. A strip lies where this line comes nearest, as the structure may be shorter or longer than the design.
    """
    line = leading_edge + QUARTER * (trailing_edge - leading_edge)
    edges = interface.nodes[interface.sections[:, [0, -1]]]
    quarter = edges[:, 0] + QUARTER * (edges[:, 1] - edges[:, 0])
    span = arc_length(line)
    station = nearest_stations(0.5 * (quarter[1:] + quarter[:-1]), line)
    return span, np.interp(station, np.arange(len(line)), span)
