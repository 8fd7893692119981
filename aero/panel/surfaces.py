"""Which strips of a body follow each other along one surface: a wing, or the wings and end plates of a ring."""

from collections import defaultdict

import numpy as np

from aero.model import LiftingSurface
from interface.vectors import azimuth, azimuth_axes

WINGS, PLATES = ("lower wing", "upper wing"), ("left end plate", "right end plate")


def lifting_surfaces(ends, nodes, upper, aft=(1.0, 0.0, 0.0)):
    """The `LiftingSurface`s of strips that leave between the nodes `ends` (s,2) of a body on `nodes` (n,3) m, whose
    `upper` (s,3) are normals on the upper side of their trailing edges. The right is to the right of who looks against
    the direction `aft` (3,), z up.

    Strips that meet at a node follow each other. A closed ring is parted where its trailing edge changes between more
    level and more upright; wings run from left to right, what is upright from below upwards.
    """
    nodes = nodes @ azimuth_axes(azimuth(aft))
    along = nodes[ends[:, 1]] - nodes[ends[:, 0]]
    upright = np.abs(along[:, 2]) > np.abs(along[:, 1])
    parts = _parts(ends, upright)
    middle = nodes[ends].mean(axis=1)
    found = []
    for strips, ring in parts:
        _, wide, high = np.ptp(nodes[ends[strips].ravel()], axis=0)
        stands = bool(high > wide)
        axis = 2 if stands else 1
        strips = strips if middle[strips[-1], axis] >= middle[strips[0], axis] else strips[::-1]
        sign = -1.0 if not stands and upper[strips, 2].sum() < 0.0 else 1.0
        found.append((strips, ring, stands, sign))
    return _named(found, middle)


def _parts(ends, upright):
    """Strips in the order in which they follow each other, and whether they are of a ring, part by part."""
    at = defaultdict(list)
    for strip, pair in enumerate(ends.tolist()):
        for node in pair:
            at[node].append(strip)
    ring = _in_rings(ends, at)
    joined = {
        node
        for node, strips in at.items()
        if len(strips) == 2 and not (ring[strips[0]] and upright[strips[0]] != upright[strips[1]])
    }
    left, parts = set(range(len(ends))), []
    while left:
        whole = _walk(min(left), ends, at, joined, left)
        parts.append((np.array(whole), bool(ring[whole[0]])))
    return parts


def _in_rings(ends, at):
    """Whether each strip (s,) hangs together with strips of a closed ring only, every node between two."""
    ring, left = np.zeros(len(ends), dtype=bool), set(range(len(ends)))
    while left:
        joined = {node for node in at if len(at[node]) > 1}
        together, front = set(), [left.pop()]
        while front:
            strip = front.pop()
            together.add(strip)
            near = {other for node in ends[strip].tolist() if node in joined for other in at[node]}
            front += list(near & left)
            left -= near
        ring[list(together)] = all(len(at[node]) == 2 for strip in together for node in ends[strip].tolist())
    return ring


def _walk(first, ends, at, joined, left):
    """The strips from one end of the part with the strip `first` to the other; they are taken out of `left`."""
    found = [first]
    left.discard(first)
    for node in ends[first].tolist():
        found.reverse()
        strip = first
        while node in joined:
            after = next((s for s in at[node] if s != strip and s in left), None)
            if after is None:
                break
            left.discard(after)
            found.append(after)
            a, b = ends[after].tolist()
            strip, node = after, b if a == node else a
    return found


def _named(found, middle):
    """Lifting surfaces with names: those of a box wing, else a wing, or a fin, with numbers where there are several."""
    wings = [k for k, (_, ring, stands, _) in enumerate(found) if ring and not stands]
    plates = [k for k, (_, ring, stands, _) in enumerate(found) if ring and stands]
    names = {}
    if len(wings) == len(plates) == 2:
        by_height = sorted(wings, key=lambda k: middle[found[k][0], 2].mean())
        by_side = sorted(plates, key=lambda k: middle[found[k][0], 1].mean())
        names = dict(zip((*by_height, *by_side), (*WINGS, *PLATES), strict=True))
    for stands, name in ((False, "wing"), (True, "fin")):
        others = [k for k in range(len(found)) if k not in names and found[k][2] == stands]
        names |= {k: name if len(others) == 1 else f"{name} {i + 1}" for i, k in enumerate(others)}

    def place(k):
        """Wings from above downwards, then what is upright from left to right."""
        strips, _, stands, _ = found[k]
        return stands, middle[strips, 1].mean() if stands else -middle[strips, 2].mean()

    surfaces = []
    for k in sorted(names, key=place):
        strips, _, stands, sign = found[k]
        surfaces.append(LiftingSurface(names[k], strips, stands, sign))
    return tuple(surfaces)
