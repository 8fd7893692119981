"""The lines of a parafoil: [bridle] in scene.toml, checked and put together with the nodes of the wing."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..builders.bridles import PILOT, pilot_point, straight_lines
from ..builders.wings import ClosedSurface
from ..schema import BridleInput, SceneError, StructureInput
from .elements import Element


def check_bridle(folder: Path, given: BridleInput) -> None:
    """SceneError in one sentence for rows that cannot be on a rib."""
    where = f"{folder.name}/scene.toml: [bridle.rows]"
    if not given.rows:
        raise SceneError(f"{where} is empty; name a row of lines with its share of the chord.")
    for name, share in given.rows.items():
        if not 0.0 <= share <= 1.0:
            raise SceneError(
                f"{where} {name} is off the rib: rows lie at shares of the chord from 0, the nose, to 1; it is "
                f"{share:g}."
            )


def bridle_nodes(given: BridleInput, surface: ClosedSurface) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """Names, places (k,3) m and supports (k,3) of the nodes that a bridle adds: the pilot point, which is held."""
    assert surface.sections is not None
    assert surface.ribs is not None
    middle = surface.sections[surface.ribs[len(surface.ribs) // 2]]
    place = pilot_point(surface.nodes[middle], 0.01 * given.trim, given.depth)
    return (PILOT,), place[None], np.ones((1, 3), dtype=bool)


def bridle_lines(
    folder: Path,
    given: BridleInput,
    structure: StructureInput,
    ribs: int,
    index: dict[str, int],
    nodes: np.ndarray,
) -> Iterator[tuple[Element, str]]:
    """The lines as elements, without tension as they are drawn, and where they are declared."""
    where, modulus = f"{folder.name}/scene.toml: [bridle]", structure.line_modulus
    if modulus is None:
        raise SceneError(f"{folder.name}/scene.toml: [structure] lacks 'line_modulus', which [bridle] needs; add it.")
    for line in straight_lines(tuple(given.rows), ribs, given.diameter):
        ends = index[line.ends[0]], index[line.ends[1]]
        length = float(np.linalg.norm(nodes[ends[1]] - nodes[ends[0]]))
        area = 0.25 * np.pi * line.diameter**2
        mass = structure.line_density * area * length
        yield Element(line.name, ends, length, modulus * area / length, area, False, mass), where
