"""The closed surface of [body] in scene.toml: a wing, a parafoil, a box wing, or a mesh from a file."""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aero.panel.bodies import Body, BodyError
from interface.topology import agreed, listed

from ..builders.parafoils import STEEPEST, cell_widths, parafoil, rib_shares
from ..builders.profiles import Profile, cst, naca, self_crossing
from ..builders.wings import BoxWing, ClosedSurface, Planform, Stations, lofted, mirrored_wing, span_shares
from ..schema import BodyInput, SceneError, Wrong, a_file
from .coordinates import read_profile
from .meshes import read_panels
from .tables import Table, chord_length, number, read_table

PROFILE = ("profile", "upper_weights", "lower_weights", "panels", "panel_spacing", "panel_growth")
WING = ("strips", "tip", "tip_strips", "axis")
CELLS = ("cells", "equal_cells", "last_cell", "inlets")
PLANFORM = ("span", "chord", "tip_chord", "planform", "sweep", "twist", "dihedral", "arc", "strip_spacing")
BOX = ("span", "chord", "height", "corner_radius", "strips", "plate_strips", "corner_strips", "strip_spacing")
FILE = ("mesh", "unit", "groups", "trailing_edges")
STATIONS: dict[str, Callable[[str], Any]] = {
    **dict.fromkeys(("x_m", "y_m", "z_m", "twist_deg", "roll_deg"), number),
    "chord_m": chord_length,
    "profile": str,
}
MOST = 100_000  # panels, whose influence on each other no machine holds
NACA = re.compile(r"(naca[ -]?)?\d{4,5}", re.IGNORECASE)


def read_body(
    folder: Path, given: BodyInput, wind: tuple[float, ...] = (1.0, 0.0, 0.0), rows: Sequence[float] = ()
) -> ClosedSurface:
    """The body of [body]: nodes m, panels, trailing edges, and remarks on what was changed. The trailing edges of a
    mesh that names none are those sharp edges that look along the `wind` (3,), of any length. Profiles of a parafoil
    have points at the shares `rows` of the chord, where lines begin.

    Raises SceneError in one sentence for keys that are missing or mean nothing to the shape, and for a surface that
    bounds no body, or whose trailing edges are none.
    """
    where = f"{folder.name}/scene.toml: [body]"
    if given.shape == "mesh-file":
        return _from_file(folder, where, given, wind)
    try:
        if given.shape == "parafoil":
            surface = _parafoil(folder, where, given, rows)
        else:
            surface = (_wing if given.shape == "wing" else _box_wing)(folder, where, given)
    except SceneError:
        raise
    except ValueError as error:
        raise SceneError(f"{where}: {error}") from None
    return _checked(where, surface)


def files_of(folder: Path, given: BodyInput) -> list[str]:
    """The files in the scene's folder that a body is made of: mesh, tables of stations and polars, coordinates of
    profiles.
    """
    profiles = [] if given.profile is None else [given.profile]
    if given.stations is not None:
        profiles += read_table(folder / given.stations, STATIONS)["profile"]
    files = [text for text in (given.mesh, given.stations, given.polars) if text is not None]
    return files + sorted({text for text in profiles if not NACA.fullmatch(text)})


def _checked(
    where: str,
    surface: ClosedSurface,
    numbers: np.ndarray | None = None,
    wind: tuple[float, ...] = (1.0, 0.0, 0.0),
) -> ClosedSurface:
    """The surface with its trailing edges; `numbers` (m,) of its panels as elements of a file, in whose `wind` (3,) its
    edges are trailing ones.
    """
    try:
        body = Body.of(surface.nodes, surface.panels, surface.trailing_edges, downstream=wind)
    except BodyError as error:
        told = str(error) if numbers is None else error.called("element", numbers)
        raise SceneError(f"{where}: {told}") from None
    remarks = surface.remarks
    if numbers is not None and len(left := body.unnamed(surface.nodes, wind)):
        remarks += (_of_unnamed(where, numbers[left]),)
    bare = [k for k, strip in enumerate(body.strips) if not len(strip)]
    if numbers is not None and 0 < len(bare) < len(body.strips):
        remarks += (_of_bare(where, numbers[body.trailing[bare, :2]]),)
    return replace(surface, trailing_edges=body.trailing[:, 2:], remarks=remarks)


def _of_unnamed(where: str, elements: np.ndarray) -> str:
    """The remark on sharp edges with the `elements` (k,2) on their sides that are left out of the trailing edges."""
    edges = agreed(len(elements), "edge continues", "edges continue")
    return (
        f"{where}: {len(elements)} sharp {edges} the trailing edges without being named one (at the "
        f"element{listed(np.unique(elements))}): no wake leaves there; add what is missing to the group of lines"
    )


def _of_bare(where: str, elements: np.ndarray) -> str:
    """The remark on trailing edges with the `elements` (k,2) on their sides that have no strip, where others do."""
    edges = agreed(len(elements), "trailing edge has", "trailing edges have")
    return (
        f"{where}: {len(elements)} {edges} no row of quads from side to side, as at a tip that ends in a point (at the "
        f"element{listed(np.unique(elements))}): nothing is said of chords, angles and separation of strips; cut the "
        "tip there"
    )


def _required(where: str, given: BodyInput, needed: tuple[str, ...], known: tuple[str, ...], what: str) -> list[Any]:
    """Values of the `needed` keys; raises where one is missing, or where others than the `known` ones are not as they
    are by default.
    """
    for key in needed:
        if getattr(given, key) is None:
            raise SceneError(f"{where} lacks '{key}'; {what} needs it: add it.")
    defaults = BodyInput(shape=given.shape)
    for key in vars(defaults):
        if key not in ("shape", "polars", "polar", *known) and getattr(given, key) != getattr(defaults, key):
            raise SceneError(f"{where} {key} means nothing to {what}; drop it.")
    return [getattr(given, key) for key in needed]


def _check_count(where: str, strips: int, panels: int) -> None:
    """Raises where `strips` of `panels` round each profile are too many."""
    if strips * panels > MOST:
        raise SceneError(f"{where} asks for {strips * panels} panels, more than {MOST}; take fewer.")


# Wings


def _wing(folder: Path, where: str, given: BodyInput) -> ClosedSurface:
    """The wing of a planform, or of a table of stations."""
    if given.stations is not None:
        return _wing_of_stations(folder, where, given)
    needed = ("span", "chord", "strips", "panels")
    _, _, strips, panels = _required(where, given, needed, (*PROFILE, *WING, *PLANFORM), "a wing")
    _check_count(where, 2 * strips, panels)
    plan = _planform(where, given)
    profile = _profile(folder, where, given)
    sections = plan.stations(span_shares(strips, given.strip_spacing)).sections(_points(given, panels, profile))
    return mirrored_wing(sections, given.tip, given.tip_strips, profile.remarks)


def _planform(where: str, given: BodyInput) -> Planform:
    """The planform of a wing that has a span and a chord."""
    assert given.span is not None
    assert given.chord is not None
    sweep, twist, dihedral, arc = (math.radians(v) for v in (given.sweep, given.twist, given.dihedral, given.arc))
    tip = given.chord if given.tip_chord is None else given.tip_chord
    if given.planform == "elliptic" and given.tip_chord is None:
        raise SceneError(f"{where} lacks 'tip_chord'; an elliptic wing is cut where its chord is that long: add it.")
    return Planform(given.span, given.chord, tip, sweep, twist, dihedral, arc, given.axis, given.planform)


def _parafoil(folder: Path, where: str, given: BodyInput, rows: Sequence[float]) -> ClosedSurface:
    """The parafoil of a planform with cells, or of a table of ribs."""
    if given.inlets == "open":
        raise SceneError(
            f"{where} inlets cannot be open: the flow needs a closed surface; close them, and say the pressure behind "
            "them as internal_pressure_coefficient of [aero]."
        )
    of = _ribs_of_planform if given.stations is None else _ribs_of_table
    ribs, strips, remarks = of(folder, where, given, rows)
    _check_count(where, 2 * strips * (len(ribs) - 1), ribs.shape[1])
    return replace(parafoil(ribs, strips, given.tip, given.tip_strips), remarks=remarks)


def _ribs_of_planform(
    folder: Path, where: str, given: BodyInput, rows: Sequence[float]
) -> tuple[np.ndarray, int, tuple[str, ...]]:
    """Ribs (k,n,3) m of the right half, the strips of a cell, and remarks on the profile."""
    needed, keys = ("strips", "panels", "span", "chord", "cells"), (*PROFILE, *WING, *PLANFORM, *CELLS)
    known = tuple(key for key in keys if key not in ("strip_spacing", "stations"))
    strips, panels, _, _, cells = _required(where, given, needed, known, "a parafoil")
    if given.arc > STEEPEST:
        raise SceneError(
            f"{where} arc is {given.arc:g} degrees, half the angle of the circle that the wing follows; beyond "
            f"{STEEPEST:g} its tips face each other: make it smaller."
        )
    if cells % 2:
        raise SceneError(f"{where} cells must be even, so that a rib stands in the middle; there are {cells}.")
    profile, plan = _profile(folder, where, given), _planform(where, given)
    widths = cell_widths(cells // 2, given.equal_cells, given.last_cell)
    return plan.stations(rib_shares(widths)).sections(_points(given, panels, profile, rows)), strips, profile.remarks


def _ribs_of_table(
    folder: Path, where: str, given: BodyInput, rows: Sequence[float]
) -> tuple[np.ndarray, int, tuple[str, ...]]:
    """The same of a table of ribs."""
    needed, known = (
        ("stations", "strips", "panels"),
        ("panels", "panel_spacing", "panel_growth", "stations", "inlets", *WING),
    )
    file, strips, panels = _required(where, given, needed, known, "a parafoil with a table of ribs")
    table = read_table(folder / file, STATIONS)
    _check_ribs(table)
    stations, profiles, remarks = _stations(folder, given, panels, table, rows)
    ribs = stations.sections(profiles)
    ribs[0, :, 1] = 0.0
    return ribs, strips, remarks


def _wing_of_stations(folder: Path, where: str, given: BodyInput) -> ClosedSurface:
    """The wing of a table: its right half from y = 0 to the tip, or the whole from the left to the right tip."""
    keys = ("panels", "panel_spacing", "panel_growth", "stations", *WING)
    needed, what = ("stations", "panels", "strips"), "a wing with a table of stations"
    file, panels, strips = _required(where, given, needed, keys, what)
    table = read_table(folder / file, STATIONS)
    _check_order(table)
    _check_count(where, 2 * strips * len(table), panels)
    stations, profiles, remarks = _stations(folder, given, panels, table)
    stations, profiles = stations.between(strips, profiles)
    sections = stations.sections(profiles)
    if table["y_m"][0] == 0.0:
        _check_middle(table)
        sections[0, :, 1] = 0.0
        return mirrored_wing(sections, given.tip, given.tip_strips, remarks)
    return lofted(sections, given.tip, given.tip_strips, remarks)


def _stations(
    folder: Path, given: BodyInput, panels: int, table: Table, rows: Sequence[float] = ()
) -> tuple[Stations, np.ndarray, tuple[str, ...]]:
    """Stations of a table, the profile (k,panels,2) of each with points at the shares `rows`, and remarks on these."""
    known = {text: _named_profile(folder, table.at(row), text) for row, text in enumerate(table["profile"])}
    points = {text: _points(given, panels, profile, rows) for text, profile in known.items()}
    place = np.column_stack([table["x_m"], table["y_m"], table["z_m"]])
    twist, roll = (np.radians(np.array(table[key])) for key in ("twist_deg", "roll_deg"))
    stations = Stations(place, np.array(table["chord_m"]), twist, roll, given.axis)
    remarks = tuple(remark for profile in known.values() for remark in profile.remarks)
    return stations, np.stack([points[text] for text in table["profile"]]), remarks


def _check_middle(table: Table) -> None:
    """Raises where a table that begins in the plane y = 0 does so with a section that is not upright."""
    if table["roll_deg"][0] != 0.0:
        raise SceneError(f"{table.at(0)}: roll_deg must be 0 in the plane y = 0, where both halves meet; correct it.")


def _check_ribs(table: Table) -> None:
    """Raises where ribs do not lead from the plane y = 0 to the right tip, or are fewer than three in both halves."""
    if table["y_m"][0] != 0.0:
        raise SceneError(
            f"{table.at(0)}: y_m is {table['y_m'][0]:g}; the ribs of a parafoil lead from y_m = 0 to the right tip, "
            "and those on the left are their images: begin with the middle one."
        )
    if len(table) < 2:
        raise SceneError(
            f"{table.at(0)} is the only rib; a parafoil has three at least, the middle one and one at each tip: add "
            "the right one."
        )
    _check_order(table)
    _check_middle(table)


def _check_order(table: Table) -> None:
    """Raises where stations do not lead from y = 0, or from the left tip, to the right one."""
    y = table["y_m"]
    if len(y) < 2:
        raise SceneError(f"{table.at(0)} is the only station; a wing has two at least.")
    if y[0] > 0.0 or y[-1] <= 0.0:
        row = 0 if y[0] > 0.0 else len(y) - 1
        raise SceneError(
            f"{table.at(row)}: y_m is {y[row]:g}; stations lead from y_m = 0 to the right tip, or from the left tip "
            "(y_m < 0) to the right one."
        )
    places = list(zip(table["x_m"], y, table["z_m"], strict=True))
    again = next((k for k in range(1, len(places)) if places[k] == places[k - 1]), 0)
    if again:
        raise SceneError(f"{table.at(again)} is at the place of the row before; move or drop one.")
    across = next((k for k in range(1, len(y)) if y[0] == 0.0 and y[k] <= 0.0), 0)
    if across:
        raise SceneError(
            f"{table.at(across)}: y_m is {y[across]:g}; stations from the plane y = 0 on stay to the right of it: "
            "correct it, or begin at the left tip."
        )
    steps = np.diff(np.column_stack([y, table["z_m"]]), axis=0)
    back = np.flatnonzero(np.sum(steps[1:] * steps[:-1], axis=1) < 0.0)
    if len(back):
        raise SceneError(
            f"{table.at(int(back[0]) + 2)} goes back along the span, by more than a right angle; put the rows into the "
            "order of the span."
        )


def _box_wing(folder: Path, where: str, given: BodyInput) -> ClosedSurface:
    """The ring of a box wing."""
    needed = ("span", "chord", "height", "corner_radius", "strips", "plate_strips", "panels")
    known = (*PROFILE, *BOX)
    span, chord, height, radius, strips, plate, panels = _required(where, given, needed, known, "a box wing")
    _check_count(where, 2 * (2 * strips + 2 * given.corner_strips + plate), panels)
    box = BoxWing(span, height, chord, radius, strips, plate, given.corner_strips, given.strip_spacing)
    profile = _profile(folder, where, given)
    return replace(box.surface(_points(given, panels, profile)), remarks=profile.remarks)


# Profiles


def _profile(folder: Path, where: str, given: BodyInput) -> Profile:
    """The profile that [body] names, or that of its weights, closed."""
    if (given.profile is None) == (given.upper_weights is None):
        what = "no profile" if given.profile is None else "a profile and weights of another"
        raise SceneError(f"{where} has {what}; give 'profile', or 'upper_weights' of CST.")
    if given.profile is not None:
        if given.lower_weights is not None:
            raise SceneError(f"{where} lower_weights means nothing to a named profile; drop it.")
        return _named_profile(folder, f"{where} profile", given.profile)
    assert given.upper_weights is not None
    return cst(given.upper_weights, given.lower_weights or given.upper_weights).closed()


def _named_profile(folder: Path, where: str, text: str) -> Profile:
    """A NACA profile, or that of a file, closed."""
    if NACA.fullmatch(text):
        try:
            return naca(text)
        except ValueError as error:
            raise SceneError(f"{where}: {error}") from None
    try:
        path = folder / a_file(text)
    except Wrong:
        raise SceneError(f"{where}: '{text[:40]}' is no NACA profile and no file in the scene's folder.") from None
    if not path.suffix and not path.is_file():
        raise SceneError(
            f"{where}: '{text[:40]}' is no NACA profile of four or five digits, and there is no such file; correct it."
        )
    return read_profile(path).closed()


def _points(given: BodyInput, panels: int, profile: Profile, rows: Sequence[float] = ()) -> np.ndarray:
    """Points (panels,2) round the profile, some of them at the shares `rows` of its chord."""
    points = profile.points(panels, given.panel_spacing, 0.01 * given.panel_growth, rows)
    if crossing := self_crossing(points):
        raise ValueError(
            f"profile {profile.name} crosses itself, at {crossing[0]:.3g} of the chord; its upper and lower side may "
            "only meet at nose and trailing edge: correct it."
        )
    return points


# Files


def _from_file(folder: Path, where: str, given: BodyInput, wind: tuple[float, ...]) -> ClosedSurface:
    """The quads and triangles of a mesh, with its groups of lines as trailing edges."""
    (file,) = _required(where, given, ("mesh",), FILE, "a mesh from a file")
    mesh = read_panels(folder / file, given.unit, given.groups)
    names = given.trailing_edges
    edges = None if names is None else mesh.lines_of(*names) if names else np.zeros((0, 2), dtype=int)
    return _checked(mesh.label, ClosedSurface(mesh.nodes, mesh.panels, edges, mesh.remarks), mesh.numbers, wind)
