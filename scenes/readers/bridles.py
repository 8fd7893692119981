"""The lines of a parafoil: [bridle] in scene.toml, checked and put together with the nodes of the wing."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..builders.bridles import Bridle, Joints, bridle, pilot_point, tethered
from ..builders.ram_air import attachment_nodes
from ..builders.wings import ClosedSurface
from ..schema import BridleInput, SceneError, StructureInput
from .elements import Element

TAKEN = ("tether", "belt", "pilot", "ground")  # beginnings of names of other lines and nodes of a parafoil


def check_bridle(folder: Path, given: BridleInput) -> None:
    """SceneError in one sentence for rows that cannot be on a rib."""
    where = f"{folder.name}/scene.toml: [bridle.rows]"
    if not given.rows:
        raise SceneError(f"{where} is empty; name a row of lines with its share of the chord.")
    for name, share in given.rows.items():
        if taken := next((word for word in TAKEN if name.lower().startswith(word)), None):
            raise SceneError(
                f"{where} {name} has the name of a {taken}, which is no row; call it otherwise, A for example."
            )
        if not 0.0 <= share <= 1.0:
            raise SceneError(
                f"{where} {name} is off the rib: rows lie at shares of the chord from 0, the nose, to 1; it is "
                f"{share:g}."
            )


def read_bridle(folder: Path, given: BridleInput, surface: ClosedSurface | None) -> Bridle:
    """Nodes and lines of the bridle of a parafoil; SceneError in one sentence for what cannot be."""
    assert surface is not None
    assert surface.sections is not None
    assert surface.ribs is not None
    where, ribs = f"{folder.name}/scene.toml: [bridle]", surface.sections[surface.ribs]
    pilot, down = pilot_point(surface.nodes[ribs[len(ribs) // 2]], 0.01 * given.trim, given.depth)
    shares = given.cascade, given.cascade_share, given.belt_ribs, given.belt_share
    joints = Joints(*shares, given.belt_diameter or given.diameter)
    try:
        points = attachment_nodes(surface.nodes, list(ribs), given.rows)
        places = {name: surface.nodes[at[0]] for name, at in points.items()}
        found = bridle(places, tuple(given.rows), len(ribs), pilot, given.diameter, joints)
    except ValueError as error:
        raise SceneError(f"{where}: {error}") from None
    if not given.tether_length:
        return found
    longest = max(float(np.linalg.norm(place - pilot)) for place in places.values())
    if given.tether_length < longest:
        raise SceneError(
            f"{where} tether_length is {given.tether_length:g} m, less than the {longest:.3g} m of the longest line "
            "above it; make it longer, or drop it."
        )
    if given.tether_diameter is None:
        raise SceneError(f"{where} lacks 'tether_diameter'; add it.")
    return tethered(found, down, given.tether_length, given.tether_elements, given.tether_diameter)


def bridle_lines(
    folder: Path, lines: Bridle, structure: StructureInput, index: dict[str, int], nodes: np.ndarray
) -> Iterator[tuple[Element, str]]:
    """The lines as elements, without tension as they are drawn, and where they are declared."""
    where, modulus = f"{folder.name}/scene.toml: [bridle]", structure.line_modulus
    if modulus is None:
        raise SceneError(f"{folder.name}/scene.toml: [structure] lacks 'line_modulus', which [bridle] needs; add it.")
    for line in lines.lines:
        ends = index[line.ends[0]], index[line.ends[1]]
        length = float(np.linalg.norm(nodes[ends[1]] - nodes[ends[0]]))
        area = 0.25 * np.pi * line.diameter**2
        mass = structure.line_density * area * length
        yield Element(line.name, ends, length, modulus * area / length, area, False, mass), where
