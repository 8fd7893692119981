"""Bridles of parafoils: where lines begin on ribs, the pilot point, cascades, belts to the tips, and the tether."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

PILOT, GROUND = "pilot", "ground"  # names of nodes


@dataclass(frozen=True)
class BridleLine:
    """A line `name` between two nodes, by name, of some `diameter` m."""

    name: str
    ends: tuple[str, str]
    diameter: float


@dataclass(frozen=True, eq=False)
class Bridle:
    """Nodes that a bridle adds, by name, at their places (3,) m, those that are `held`, and its `lines`."""

    nodes: dict[str, np.ndarray]
    held: tuple[str, ...]
    lines: tuple[BridleLine, ...]


@dataclass(frozen=True)
class Joints:
    """Where lines meet above the pilot point.

    `cascade` ribs beside each other share a line of each row from the share `cascade_share` of the way from the pilot
    point to their attachments on (1: none do); all lines of the `belt_ribs` outermost ribs on each side (0: none) run
    into a belt at the share `belt_share` of that way, whose line to the pilot point has `belt_diameter` m.
    """

    cascade: int = 1
    cascade_share: float = 0.5
    belt_ribs: int = 0
    belt_share: float = 0.2
    belt_diameter: float = 0.0


def pilot_point(rib: np.ndarray, trim: float, depth: float) -> tuple[np.ndarray, np.ndarray]:
    """The pilot point (3,) m, `depth` m below the chord of the middle `rib` (n,3) m, normal to it, at the share `trim`
    of the chord from the nose on; and the unit vector (3,) downward.

    The rib stands in the plane y = 0, from the trailing edge over the upper side to the nose and back.
    """
    tail, nose = rib[0], rib[len(rib) - len(rib) // 2]
    chord = tail - nose
    down = np.cross(chord, [0.0, 1.0, 0.0])
    down *= -np.sign(down[2]) / np.linalg.norm(down)
    return nose + trim * chord + depth * down, down


def bridle(
    attachments: Mapping[str, np.ndarray],
    rows: Sequence[str],
    ribs: int,
    pilot: np.ndarray,
    diameter: float,
    joints: Joints,
) -> Bridle:
    """Lines from `attachments`, "A_1" of row A on the leftmost of an odd number of `ribs`, to the `pilot` point (3,) m.

    Lines are called as the nodes where they begin. Where ribs 3 to 5 share a line of row A, it begins at "A_3_5"; belts
    begin at "belt_left" and "belt_right". ValueError where the belts have all ribs but the middle one, or more.
    """
    middle, belts = ribs // 2, joints.belt_ribs
    if belts >= middle:
        raise ValueError(f"belt_ribs are {belts} of {middle} ribs on each side; leave some with lines of their own.")
    nodes, first, then = {PILOT: pilot}, [], []

    def meet(name: str, places: list[np.ndarray], share: float, size: float) -> None:
        nodes[name] = pilot + share * (np.mean(places, axis=0) - pilot)
        then.append(BridleLine(name, (name, PILOT), size))

    groups = rib_groups(ribs, joints.cascade, belts)
    of = {rib: group for group in groups for rib in group}
    for rib in range(ribs):
        group = of.get(rib)
        for row in rows:
            name = f"{row}_{rib + 1}"
            end = PILOT if group is not None else "belt_left" if rib < middle else "belt_right"
            if group is not None and len(group) > 1:
                end = f"{row}_{group[0] + 1}_{group[-1] + 1}"
            first.append(BridleLine(name, (name, end), diameter))
    for group in groups:
        for row in rows if len(group) > 1 else ():
            places = [attachments[f"{row}_{rib + 1}"] for rib in group]
            meet(f"{row}_{group[0] + 1}_{group[-1] + 1}", places, joints.cascade_share, diameter)
    for side, tip in (("left", range(belts)), ("right", range(ribs - belts, ribs))) if belts else ():
        places = [attachments[f"{row}_{rib + 1}"] for rib in tip for row in rows]
        meet(f"belt_{side}", places, joints.belt_share, joints.belt_diameter or diameter)
    return Bridle(nodes, (PILOT,), (*first, *then))


def rib_groups(ribs: int, each: int, belts: int = 0) -> list[tuple[int, ...]]:
    """Groups of up to `each` ribs beside each other, from left to right: the middle one of an odd number by itself, the
    others from it outward, alike on both sides, without `belts` at each tip.
    """
    middle = ribs // 2
    own = range(middle + 1, ribs - belts)
    right = [tuple(own[k : k + each]) for k in range(0, len(own), each)]
    left = [tuple(ribs - 1 - rib for rib in reversed(group)) for group in reversed(right)]
    return [*left, (middle,), *right]


def tethered(found: Bridle, down: np.ndarray, length: float, elements: int, diameter: float) -> Bridle:
    """The bridle with a straight tether of `elements` from the pilot point along the unit vector `down` (3,) to the
    ground, `length` m away, which holds it instead.
    """
    names = [PILOT, *(f"tether_{k}" for k in range(1, elements)), GROUND]
    places = found.nodes[PILOT] + np.linspace(0.0, length, elements + 1)[:, None] * down
    lines = [BridleLine(f"tether_{k + 1}", ends, diameter) for k, ends in enumerate(pairwise(names))]
    nodes = found.nodes | dict(zip(names[1:], places[1:], strict=True))
    return Bridle(nodes, (GROUND,), (*found.lines, *lines))
