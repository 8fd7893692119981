"""Meshes of membranes that are made: shapes of scene.toml with their sizes and numbers of cells."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..builders import surfaces
from ..builders.mesh import TriangleMesh
from ..builders.ram_air import ram_air_mesh
from ..builders.wings import ClosedSurface
from ..schema import Choices, MembranesInput, SceneError
from .tables import name, number, read_table

# Shape -> sizes in m that it needs, second number of cells if it has one, other whole numbers, and the keys of
# [membranes] that mean something to it.
SIZES: dict[str, tuple[tuple[str, ...], str, tuple[str, ...], tuple[str, ...]]] = {
    "rectangle": (("length", "width"), "cells_across", (), ("diagonals",)),
    "disc": (("radius",), "", ("sectors",), ("share",)),
    "airbag": (("edge",), "", (), ("share", "diagonals")),
    "cylinder": (("radius", "length"), "cells_around", (), ("share", "diagonals", "caps")),
    "sphere": (("radius",), "", (), ("share",)),
    "ruled": ((), "cells_along", (), ("diagonals", "profiles")),
    "body": ((), "", ("rib_rows",), ("attachments", "panel_shortening")),
}
MOST = 500_000  # cells, of which a machine has solved as many as fit into its memory long before
STEPS = (6, 4, 10)  # of the cells around a cylinder, which its caps need


def made_mesh(
    folder: Path, given: MembranesInput, choices: Choices, order: int, surface: ClosedSurface | None = None
) -> TriangleMesh:
    """The mesh of the shape of [membranes], which may be the `surface` of [body]; SceneError in one sentence for sizes
    that it cannot have.
    """
    shape = str(given.shape)
    where = f"{folder.name}/scene.toml: [membranes"
    sizes, second, others, keys = SIZES[shape]
    known = (*sizes, "cells", *((second,) if second else ()), *others)
    if odd := sorted(given.size.keys() - set(known)):
        raise SceneError(f"{where}.size] has an unknown key '{odd[0]}'; a {shape} has: {', '.join(known)}.")
    ribs = None if surface is None or shape != "body" else surface.ribs
    counted = () if ribs is not None else ("cells",)  # those of a parafoil are known
    if lacking := [key for key in (*sizes, *counted) if key not in given.size]:
        raise SceneError(f"{where}.size] lacks '{lacking[0]}'; add it.")
    if shape == "ruled" and given.profiles is None:
        raise SceneError(f"{where}] lacks 'profiles', the table of the profiles of a ruled surface; add it.")
    defaults = MembranesInput()
    for key in ("share", "diagonals", "caps", "profiles", "attachments", "panel_shortening"):
        if key not in keys and getattr(given, key) != getattr(defaults, key):
            raise SceneError(f"{where}] {key} means nothing to a {shape}; drop it.")
    whole = {key: _count(f"{where}.size] {key}", given.size[key]) for key in known[len(sizes) :] if key in given.size}
    options = {key: getattr(given, key) for key in keys if key not in ("profiles", "panel_shortening")} | {
        "order": order
    }
    if shape == "body":
        options["bars"] = any(
            group.startswith("reinforcement")
            for name, cable in given.cables.items()
            for group in cable.group or (name,)
        )
    lengths: list[Any] = [given.size[key] for key in sizes]
    if shape == "ruled":
        assert given.profiles is not None
        lengths = [_profiles(folder / given.profiles)]
    elif shape == "body":
        lengths = [_lofted(where, surface)]
        if order == 2:
            raise SceneError(
                f"{where}] order 2 means nothing to a body, whose panels have no nodes on their sides; take 1."
            )
    between = 0 if ribs is None else len(ribs) - 1
    if ribs is not None and (choices.cells or whole.setdefault("cells", between) != between):
        raise SceneError(f"{where}.size] cells are those of the parafoil in [body], {between}; drop the others.")
    cells = _cells(whole, second, choices.cells)
    if cells[0] * (cells[1] or cells[0]) * max([1, *(whole.get(key, 1) for key in others)]) > MOST:
        raise SceneError(f"{where}.size] asks for more than {MOST} cells; take fewer.")
    try:
        mesh = MAKERS[shape](lengths, cells, whole, options)
    except ValueError as error:
        raise SceneError(f"{where}.size]: {error}") from None
    return replace(mesh, label=f"{folder.name}/scene.toml [membranes] {mesh.label}")


def _count(where: str, value: float) -> int:
    if value != int(value) or value < 1:
        raise SceneError(f"{where} must be a whole number of 1 or more; it is {value:g}.")
    return int(value)


def _cells(whole: dict[str, int], second: str, chosen: int) -> tuple[int, int | None]:
    """Numbers of cells both ways, the second None where none is given; a chosen number keeps their proportion."""
    first, other = whole["cells"], whole.get(second)
    if not chosen:
        return first, other
    if other is None:
        return chosen, None
    step = next((s for s in STEPS if other % s == 0), 1) if second == "cells_around" else 1
    return chosen, max(1, round(other * chosen / (first * step))) * step


def _profiles(path: Path) -> list[np.ndarray]:
    """Profiles (p,3) m in the order in which the table names them first."""
    table = read_table(path, {"profile": name, "x_m": number, "y_m": number, "z_m": number})
    found: dict[str, list[list[float]]] = {}
    for row, of in enumerate(table["profile"]):
        found.setdefault(of, []).append([table[key][row] for key in ("x_m", "y_m", "z_m")])
    return [np.array(points) for points in found.values()]


def _rectangle(lengths: Any, cells: Any, whole: Any, options: Any) -> TriangleMesh:
    return surfaces.rectangle(lengths[0], lengths[1], (cells[0], cells[1] or cells[0]), **options)


def _disc(lengths: Any, cells: Any, whole: Any, options: Any) -> TriangleMesh:
    return surfaces.disc(lengths[0], cells[0], whole.get("sectors", 6), **options)


def _airbag(lengths: Any, cells: Any, whole: Any, options: Any) -> TriangleMesh:
    return surfaces.airbag(lengths[0], cells[0], **options)


def _cylinder(lengths: Any, cells: Any, whole: Any, options: Any) -> TriangleMesh:
    return surfaces.cylinder(lengths[0], lengths[1], (cells[0], cells[1] or cells[0]), **options)


def _sphere(lengths: Any, cells: Any, whole: Any, options: Any) -> TriangleMesh:
    return surfaces.sphere(lengths[0], cells[0], **options)


def _ruled(lengths: Any, cells: Any, whole: Any, options: Any) -> TriangleMesh:
    return surfaces.ruled(lengths[0], cells[0], cells[1], **options)


def _lofted(where: str, surface: ClosedSurface | None) -> ClosedSurface:
    """The surface whose skin is wanted."""
    if surface is None:
        raise SceneError(f'{where}] shape "body" is the skin of a section [body]; add it.')
    if surface.sections is None:
        raise SceneError(f'{where}] shape "body" needs a [body] of the shape "wing", whose ribs are known.')
    return surface


def _body(lengths: Any, cells: Any, whole: Any, options: Any) -> TriangleMesh:
    surface, rows = lengths[0], lengths[0].sections
    strips = len(rows) - 1
    if strips % cells[0]:
        raise ValueError(f"{strips} strips of the wing are no whole number of each of {cells[0]} cells.")
    ribs = list(rows[:: strips // cells[0]] if surface.ribs is None else rows[surface.ribs])
    return ram_air_mesh(
        surface.nodes, surface.panels, ribs, whole.get("rib_rows", 4), options["attachments"], True, options["bars"]
    )


# Shape -> a function of sizes, cells, other whole numbers and options.
MAKERS: dict[str, Callable[..., TriangleMesh]] = {
    "rectangle": _rectangle,
    "disc": _disc,
    "airbag": _airbag,
    "cylinder": _cylinder,
    "sphere": _sphere,
    "ruled": _ruled,
    "body": _body,
}
