"""Reads a scene: a folder with a scene.toml and its tables, checked, becomes a `Scene` that is ready to be solved."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interface import misnamed

from ..builders.interface import (
    body_interface,
    design_interface,
    edges_interface,
    face_interface,
    grid_interface,
    lines_interface,
    structural_interface,
    with_lines,
)
from ..interface import Interface
from ..members import Members, PointLoad, rigid_members
from ..scene import Scene, Source
from ..schema import SceneError, Setting
from .description import Description, offered, read_description
from .lifting_surface import design_edges, read_polars, read_sections, read_struts
from .members import check_line_ends, read_members
from .point_loads import read_loads
from .tables import Table

if TYPE_CHECKING:
    from ..builders.wings import ClosedSurface

BUILT_IN = Path(__file__).resolve().parents[1]
_TABLES = ("nodes", "springs", "canopy", "lines", "masses", "ribs", "tubes", "attachments", "loads")  # of [structure]

_DOWNWIND = (1.0, 0.0, 0.0)  # x, where a scene has no wind


def load(scene: str | Path, settings: Mapping[str, Any] | None = None) -> Scene:
    """The scene with this name or in this folder; raises `SceneError` with one sentence where anything is wrong."""
    folder = _folder(scene)
    read = read_description(folder, settings or {})
    read = _started(folder, _scaled(folder, read))
    wind = _DOWNWIND if read.aero is None else read.aero.wind_direction
    wing = read.wing
    loads: tuple[PointLoad, ...] = ()
    pivot = None
    surface = _surface(folder, read, wind)
    if read.structure is None:
        sections = None if wing is None else read_sections(folder, wing, wind)
        interface = _rigid_interface(read, surface, sections)
        members, struts = rigid_members(interface.nodes), interface.sections[:, [0, -1]]
    else:
        members = read_members(
            folder, read.structure, read.choices, read.offers, wind, read.membranes, surface, read.bridle
        )
        struts = read_struts(folder, read, members)
        sections = None if wing is None else read_sections(folder, wing, wind)
        loads, pivot = read_loads(folder, read.structure, members), read.structure.pivot
        interface = _interface(read, members, struts, sections, surface)
        check_line_ends(folder, read.structure, members, loads, interface)
    for label in (*members.labels, *members.names, *(members.membranes.seams if members.membranes else ())):
        if why := misnamed(label):  # what comes from a file of a mesh
            raise SceneError(f"{folder.name}: the name {label!r} {why}; choose another.")
    polars = None
    if wing is not None and sections is not None:
        polars = read_polars(folder, wing, sections, read.choices.scale, interface)
    elif surface is not None and read.body is not None:
        from .body_polars import read_body_polars

        polars = read_body_polars(folder, read.body, surface)
    made = Scene(
        folder.name,
        read.title,
        read.description,
        read.chosen,
        read.choices,
        read.structure,
        wing,
        read.aero,
        read.trim,
        read.dynamics,
        members,
        interface,
        struts,
        polars,
        loads,
        None if pivot is None else members.node(pivot, f"{folder.name}/scene.toml [structure] pivot"),
        Source(folder, _files(folder, read), read.offers),
        body=read.body,
    )
    _check_linear_wind(made)
    return made


def _check_linear_wind(scene: Scene) -> None:
    """SceneError where the line along which the wind grows has no length."""
    linear = None if scene.aero is None else scene.aero.linear_wind
    if linear is None:
        return
    what, about = scene.moments_about
    kite = tuple(about) if linear.kite is None else linear.kite
    if kite == linear.ground:
        where = "is" if linear.kite is not None else f"is not given, so that it is the {what},"
        raise SceneError(
            f"{scene.name}/scene.toml: [aero.linear_wind] kite {where} at the same place as ground, and the wind grows "
            "along the line between the two; move one of them."
        )


def _scaled(folder: Path, read: Description) -> Description:
    """With the reference values of [aero] at the scale of the scene."""
    scale = read.choices.scale
    if scale <= 0.0:
        raise SceneError(f"{folder.name}/scene.toml: [settings.scale] must be above zero; it is {scale:g}.")
    if read.aero is None:
        return read
    if (read.wing is not None or read.body is not None) and read.aero.reference_area is None:
        raise SceneError(f"{folder.name}/scene.toml: [aero] lacks 'reference_area'; add it.")
    aero = read.aero

    def placed(table: Any, *names: str) -> Any:
        """The table with the points of these names at the scale."""
        points = {name: _scaled_point(scale, getattr(table, name)) for name in names if table is not None}
        return None if table is None else replace(table, **points)

    linear = placed(aero.linear_wind, "ground", "kite")
    chord, span = (None if length is None else scale * length for length in (aero.reference_chord, aero.reference_span))
    scaled = replace(
        aero,
        reference_area=(aero.reference_area or 1.0) * scale**2,
        reference_chord=chord,
        reference_span=span,
        reference_point=_scaled_point(scale, aero.reference_point),
        linear_wind=linear,
        rotation=placed(aero.rotation, "centre"),
    )
    return replace(read, aero=scaled)


def _scaled_point(scale: float, point: tuple[float, ...] | None) -> tuple[float, ...] | None:
    return None if point is None else tuple(scale * x for x in point)


def _started(folder: Path, read: Description) -> Description:
    """With the trim that is chosen, and the wind turned by the angle at which the wing starts in it."""
    choices, bridle, aero = read.choices, read.bridle, read.aero
    if choices.trim is not None:
        if bridle is None:
            raise SceneError(f"{folder.name}/scene.toml: [settings.trim] means nothing without [bridle]; remove it.")
        if not -50.0 <= choices.trim <= 150.0:
            raise SceneError(
                f"{folder.name}: trim must be a number from -50 to 150, per cent of the middle chord; it is "
                f"{choices.trim:g}."
            )
        bridle = replace(bridle, trim=choices.trim)
    if choices.start_angle:
        if aero is None or read.wing is not None:
            raise SceneError(
                f"{folder.name}/scene.toml: [settings.start_angle] turns the wind of [aero] on a [body]; remove it."
            )
        aero = replace(aero, wind_direction=_turned_up(aero.wind_direction, choices.start_angle))
    return replace(read, bridle=bridle, aero=aero)


def _turned_up(direction: tuple[float, ...], angle: float) -> tuple[float, ...]:
    """A direction turned by `angle` deg about the y axis, from downwind upward."""
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    x, y, z = direction
    return c * x - s * z, y, c * z + s * x


def _surface(folder: Path, read: Description, wind: tuple[float, ...]) -> "ClosedSurface | None":
    """The closed surface of [body] in the `wind`, None without."""
    if read.body is None:
        return None
    from .bodies import read_body  # not loaded for scenes without

    rows: tuple[float, ...] = ()
    if read.bridle is not None:
        from .bridles import check_bridle

        check_bridle(folder, read.bridle)
        rows = tuple(read.bridle.rows.values())
    return read_body(folder, read.body, wind, rows)


def _interface(
    read: Description, members: Members, struts: Any, sections: Table | None, surface: "ClosedSurface | None"
) -> Interface:
    """The interface mesh for the chosen chord and number of strips, with the lines where they have drag."""
    nodes, choices = members.nodes, read.choices
    if members.wing is not None:
        found = grid_interface(nodes, members.wing.grid)
    elif surface is not None and members.membranes is not None:
        found = body_interface(surface, nodes, members.membranes.skin)
    elif members.membranes is not None and read.aero is None:
        found = face_interface(nodes, members.membranes.group.nodes)
    elif sections is None:
        found = lines_interface(nodes)
    elif choices.chord == "design":
        found = design_interface(nodes, struts, *design_edges(sections, choices.scale), choices.panels_per_section)
    else:
        found = structural_interface(nodes, struts, choices.panels_per_section)
    legs, diameter = members.line_legs()
    drag = choices.line_drag == "on" and len(legs)
    return with_lines(found, nodes, legs, diameter) if drag else found


def _rigid_interface(read: Description, surface: "ClosedSurface | None", sections: Table | None) -> Interface:
    """The interface mesh of a wing without a structure: the closed surface of [body], or strips between the rows of the
    table of sections.
    """
    if surface is not None:
        return body_interface(surface, read.choices.scale * surface.nodes)
    assert sections is not None
    return edges_interface(*design_edges(sections, read.choices.scale), read.choices.panels_per_section)


def _files(folder: Path, read: Description) -> tuple[str, ...]:
    """The files in the scene's folder that it is made of, for the chosen settings."""
    tables = [] if read.structure is None else [getattr(read.structure, key) for key in _TABLES]
    tables += [] if read.membranes is None else [read.membranes.mesh, read.membranes.profiles, read.membranes.patterns]
    if read.body is not None:
        from .bodies import files_of

        tables += files_of(folder, read.body)
    tables += [] if read.wing is None else [read.wing.struts, read.wing.sections, read.wing.polars]
    return ("scene.toml", *(t for t in tables if t))


def name_of(scene: str | Path) -> str:
    """The name of a scene given by its name or folder; SceneError as above."""
    return _folder(scene).name


def settings_of(scene: str | Path) -> dict[str, Setting]:
    """The settings that a scene offers; SceneError as above."""
    return offered(_folder(scene))


def _folder(scene: str | Path) -> Path:
    """The folder of a scene given by path or by the name of a built-in one."""
    found = None
    for folder in (Path(scene), BUILT_IN / str(scene)):
        try:
            if found is None and str(scene) and (folder / "scene.toml").exists():
                found = folder.resolve()
        except (OSError, ValueError):  # names that no file can have
            break
    if found is not None:
        return _named(found)
    known = ", ".join(available())
    shown = str(scene)[:80]
    raise SceneError(f"there is no scene '{shown}'; built-in are: {known} (or name a folder with a scene.toml).")


def _named(folder: Path) -> Path:
    """The folder, if its name can be that of a scene."""
    if why := misnamed(folder.name):
        raise SceneError(f"the folder {folder.name!r} {why}; a scene is called like its folder: rename it.")
    return folder


def available() -> list[str]:
    """Names of the built-in scenes."""
    return sorted(p.parent.name for p in BUILT_IN.glob("*/scene.toml"))
