"""Section polars of the strips of a closed body: the drag that potential flow does not know of."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..scene import SectionPolars
from ..schema import BodyInput, SceneError
from .lifting_surface import check_overlap
from .polars import at_common_angles, read_curves
from .tables import name, number, read_table

if TYPE_CHECKING:
    from ..builders.wings import ClosedSurface


def read_body_polars(folder: Path, given: BodyInput, surface: "ClosedSurface") -> SectionPolars | None:
    """The polars of [body] for the strips of its `surface`, None where it names none.

    SceneError in one sentence for a polar that is missing, for strips that have none, and for a body without strips.
    """
    where = f"{folder.name}/scene.toml: [body]"
    if given.polars is None:
        if given.polar is not None:
            raise SceneError(f"{where} polar names one of a table; give 'polars', its file, or drop it.")
        return None
    _require_strips(where, surface)
    curves, label = read_curves(folder / given.polars), f"{folder.name}/{given.polars}"
    count = 0 if surface.trailing_edges is None else len(surface.trailing_edges)
    if given.stations is not None and given.polar is None:
        return _of_stations(folder, given, surface, curves)
    if given.polar is None and len(curves) > 1:
        raise SceneError(
            f"{label} has {len(curves)} polars, and {where} does not say which one its strips have; name it in 'polar'"
            f"{', or take a table of stations with a column polar' if given.shape == 'wing' else ''}."
        )
    key = next(iter(curves)) if given.polar is None else given.polar
    if key not in curves:
        raise SceneError(f"{where} polar '{key}' is not in {label}; add it or correct the name.")
    alpha, cl, cd, cm, ends = at_common_angles([curves[key]])
    return SectionPolars(alpha, cl, cd, cm, ends, np.zeros(1, dtype=int), np.zeros(1), np.zeros(count))


def _require_strips(where, surface):
    from aero.panel.bodies import Body

    body = Body.of(surface.nodes, surface.panels, surface.trailing_edges)
    bare = [i + 1 for i, strip in enumerate(body.strips) if not len(strip)]
    if bare or not len(body.strips):
        what = f"trailing edge {bare[0]} has no row of quads round it" if bare else "there is no trailing edge"
        raise SceneError(f"{where} polars are those of strips of quads, and {what}; mesh it so, or drop them.")


def _of_stations(folder, given, surface, curves):
    """The polars that the column `polar` of a table of stations names, blended between these."""
    table = read_table(folder / given.stations, {"x_m": number, "y_m": number, "z_m": number, "polar": name})
    for row, key in enumerate(table["polar"]):
        if key not in curves:
            label = f"{folder.name}/{given.polars}"
            raise SceneError(f"{table.at(row)}: polar '{key}' is not in {label}; add it or correct the name.")
    for row in range(len(table) - 1):
        pair = table["polar"][row], table["polar"][row + 1]
        check_overlap(f"{folder.name}/{given.polars}", curves, pair, f"{table.at(row)} and row {table.lines[row + 1]}")
    used = list(dict.fromkeys(table["polar"]))
    place = np.column_stack([table["x_m"], table["y_m"], table["z_m"]])
    span = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1))])
    polar = np.array([used.index(key) for key in table["polar"]])
    strips = _places(surface, given.strips, span, table["y_m"][0] == 0.0)
    alpha, cl, cd, cm, ends = at_common_angles([curves[key] for key in used])
    return SectionPolars(alpha, cl, cd, cm, ends, polar, span, strips)


def _places(surface, strips, span, mirrored):
    """Places (t,) m of the middles of strips along the line of stations at `span` (k,) m, `strips` between each two; of
    a left half that is the image of the right one the places of the images.
    """
    rows = surface.sections
    station = np.arange(len(rows)) - (len(rows) // 2 if mirrored else 0)
    of_node = dict(zip(rows[:, 0].tolist(), np.abs(station) / strips, strict=True))
    ends = np.array([[of_node[node] for node in pair] for pair in surface.trailing_edges.tolist()])
    return np.interp(ends, np.arange(len(span)), span).mean(axis=1)
