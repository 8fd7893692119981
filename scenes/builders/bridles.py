"""Bridles of parafoils: where lines begin on ribs, the pilot point, and the lines between."""

from dataclasses import dataclass

import numpy as np

PILOT = "pilot"  # name of the node


@dataclass(frozen=True)
class BridleLine:
    """A line `name` between two nodes, by name, of some `diameter` m."""

    name: str
    ends: tuple[str, str]
    diameter: float


def pilot_point(rib: np.ndarray, trim: float, depth: float) -> np.ndarray:
    """The pilot point (3,) m: `depth` m below the chord of the middle `rib` (n,3) m, normal to it, at the share `trim`
    of the chord from the nose on.

    The rib stands in the plane y = 0, from the trailing edge over the upper side to the nose and back.
    """
    tail, nose = rib[0], rib[len(rib) - len(rib) // 2]
    chord = tail - nose
    down = np.cross([0.0, 1.0, 0.0], chord)
    return nose + trim * chord - depth * down / np.linalg.norm(down) * np.sign(down[2])


def straight_lines(rows: tuple[str, ...], ribs: int, diameter: float) -> list[BridleLine]:
    """A line from each of the `rows` on every one of the `ribs` straight to the pilot point, rib by rib.

    They are called as the node of the rib where they begin, "A_1" of row A on the leftmost rib.
    """
    names = [f"{row}_{rib + 1}" for rib in range(ribs) for row in rows]
    return [BridleLine(name, (name, PILOT), diameter) for name in names]
