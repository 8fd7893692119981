"""The fabric of a ram-air wing as one mesh of triangles: the skin of a closed wing of quads, and ribs within it.

The skin keeps the nodes of the quads, so that structure and flow share one surface. Ribs fill closed rows of them, the
profile sections, with nodes of their own inside.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from .mesh import Parts, TriangleMesh

CLOSE = 1e-9  # of the longer one, within which two diagonals are alike
TILT = 0.6  # weight of z beside x where diagonals are alike; any will do that treats both sides of the wing the same
_NO_COLUMN = np.zeros(1, dtype=int)


def ram_air_mesh(
    nodes: np.ndarray,
    panels: np.ndarray,
    ribs: Sequence[np.ndarray],
    rows: int = 4,
    attachments: Mapping[str, float] | None = None,
    tips: bool = False,
    bars: bool = False,
    label: str = "ram-air wing",
) -> TriangleMesh:
    """Skin and ribs of a closed wing of `panels` (m,4), a triangle repeating its last node, on `nodes` (n,3) m.

    `ribs` are rows of nodes round the profile, each from the trailing edge over one side to the nose and back along the
    other, without the first one again; of p nodes the k-th and the (p-k)-th stand above each other, joined by a column
    of up to `rows` sides where the rib is highest and fewer where it is not. With `tips` the panels themselves close
    the first and the last of the rows, which are not filled. Triangles of panel k are 2k and 2k + 1 as far as all are
    quads. Parts: the triangles "skin", "ribs" and "rib_1" ... in the order of `ribs`; the lines "rib_1" ... round them;
    and for every name of `attachments` the points "name" on all ribs and "name_1" ... on each, the nodes of the lower
    side that are nearest to a share of the chord, 1 being the trailing edge; with `bars` also the lines
    "reinforcement_name" from these up the columns of the ribs to the upper side, and "reinforcement", all of them.

    ValueError for rows of fewer than four nodes, less than one side in a column, shares that are none, and two
    attachments at one node.
    """
    if rows < 1 or any(len(rib) < 4 for rib in ribs):
        raise ValueError("ribs need four nodes round their profile and one row of triangles, or more.")
    skin = _split(nodes, panels)
    places, triangles, parts = [nodes], [skin], {"skin": np.arange(len(skin))}
    line_parts: Parts = {}
    lines: list[np.ndarray] = []
    columns: dict[int, np.ndarray] = {}
    count, at = len(nodes), len(skin)
    for k, rib in enumerate(ribs):
        closed = tips and k in (0, len(ribs) - 1)
        inner, filled, upright = _rib(nodes, np.asarray(rib), rows, count) if not closed else _across(rib)
        columns |= {int(column[0]): column for column in upright}
        places.append(inner)
        triangles.append(filled)
        if not closed:
            parts[f"rib_{k + 1}"] = at + np.arange(len(filled))
        sides = _round(np.asarray(rib))
        line_parts[f"rib_{k + 1}"] = sum(len(row) for row in lines) + np.arange(len(sides))
        lines.append(sides)
        count, at = count + len(inner), at + len(filled)
    parts["ribs"] = np.arange(len(skin), at)
    points = attachment_nodes(nodes, ribs, attachments or {})
    if bars:
        _add_bars(lines, line_parts, columns, {name: points[name] for name in attachments or {}})
    every = np.concatenate([np.zeros((0, 2), dtype=int), *lines])
    return TriangleMesh(np.concatenate(places), np.concatenate(triangles), every, parts, line_parts, points, label)


def _add_bars(lines, line_parts, columns, attached):
    """Adds to `lines` and `line_parts` the sides of the `columns` that begin at the nodes `attached`, by name."""
    begin = sum(map(len, lines))
    at = begin
    for name, nodes in attached.items():
        found = [np.stack([c[:-1], c[1:]], axis=1) for c in (columns.get(int(n), _NO_COLUMN) for n in nodes)]
        count = sum(map(len, found))
        line_parts[f"reinforcement_{name}"] = at + np.arange(count)
        lines += found
        at += count
    line_parts["reinforcement"] = np.arange(begin, at)


def _round(rib):
    """Sides (s,2) round a rib, in order; of one that is sewn, whose lower nodes are upper ones too, each once."""
    sides = np.stack([rib, np.roll(rib, -1)], axis=1)
    first = np.unique(np.sort(sides, axis=1), axis=0, return_index=True)[1]
    sides = sides[np.sort(first)]
    return sides[sides[:, 0] != sides[:, 1]]


def attachment_nodes(nodes: np.ndarray, ribs: Sequence[np.ndarray], shares: Mapping[str, float]) -> Parts:
    """Name -> nodes of the attachments at `shares` of the chord: of each row on every rib, "name_1" ..., and all of it,
    "name"; ValueError as `ram_air_mesh`.
    """
    points: Parts = {}
    for name, share in shares.items():
        if not 0.0 <= share <= 1.0:
            raise ValueError(f"the attachment '{name}' must be at a share of the chord from 0 to 1; it is {share:g}.")
        found = []
        for k, rib in enumerate(ribs):
            lower = np.append(rib[len(rib) // 2 :], rib[0])
            chord = nodes[rib[0]] - nodes[lower[0]]
            at = (nodes[lower] - nodes[lower[0]]) @ chord / (chord @ chord)
            found.append(int(lower[np.argmin(np.abs(at - share))]))
            points[f"{name}_{k + 1}"] = np.array(found[-1:])
        points[name] = np.unique(found)
    taken = [int(n) for name in shares for n in points[name]]
    if len(set(taken)) < len(taken):
        raise ValueError(
            "two attachments are at one node; set them further apart or take more panels round the profile."
        )
    return points


def _split(nodes, panels):
    """Triangles (t,3) of panels (m,4): of quads two, along the shorter diagonal. Where both are alike it is the one
    that runs aft and upward from the middle of the wing to its sides, so that mirror images stay such.
    """
    quad = panels[:, 2] != panels[:, 3]
    a, b, c, d = panels.T
    one, other = nodes[c] - nodes[a], nodes[d] - nodes[b]
    lengths = np.linalg.norm(one, axis=1), np.linalg.norm(other, axis=1)
    even = np.abs(lengths[0] - lengths[1]) <= CLOSE * np.maximum(*lengths)
    outward = np.abs(nodes[:, 1])
    slopes = [
        (way[:, 0] + TILT * way[:, 2]) * (outward[to] - outward[start])
        for way, start, to in ((one, a, c), (other, b, d))
    ]
    first = np.where(even, slopes[0] >= slopes[1], lengths[0] < lengths[1])[:, None]
    pairs = np.where(first, np.stack([a, b, c, a, c, d], axis=1), np.stack([a, b, d, b, c, d], axis=1))
    kept = np.stack([np.ones(len(panels), dtype=bool), quad], axis=1)
    pairs[~quad, :3] = panels[~quad, :3]
    return pairs.reshape(-1, 3)[kept.ravel()]


def _rib(nodes, rib, rows, first):
    """Inner nodes (i,3) m of a rib, numbered from `first`, its triangles (t,3) and its columns from the bottom up."""
    p = len(rib)
    pairs = np.stack([rib[p - np.arange(1, (p + 1) // 2)], rib[1 : (p + 1) // 2]], axis=1)
    height = np.linalg.norm(nodes[pairs[:, 1]] - nodes[pairs[:, 0]], axis=1)
    sides = np.maximum(1, np.rint(rows * height / height.max(initial=0.0)).astype(int))
    if p % 2:  # the last column is a side of the skin
        sides[-1] = 1
    inner, columns = [np.zeros((0, 3))], [rib[:1]]
    for (low, high), count in zip(pairs, sides, strict=True):
        share = (np.arange(1, count) / count)[:, None]
        inner.append((1.0 - share) * nodes[low] + share * nodes[high])
        columns.append(np.array([low, *range(first, first + count - 1), high]))
        first += count - 1
    if p % 2 == 0:
        columns.append(rib[p // 2 : p // 2 + 1])
    triangles = [_between(one, other) for one, other in pairwise(columns)]
    return np.concatenate(inner), np.concatenate(triangles), columns


def _across(rib):
    """The same of a rib that the panels of a cap close, whose sides run from the lower to the upper side, or that is
    sewn and has none.
    """
    opposite = zip(rib[:0:-1], rib[1:], strict=True)
    columns = [np.array(pair) for pair in list(opposite)[: (len(rib) - 1) // 2] if pair[0] != pair[1]]
    return np.zeros((0, 3)), np.zeros((0, 3), dtype=int), columns


def _between(one, other):
    """Triangles (t,3) between two columns of nodes, from the bottom up: the shorter step is made first."""
    found, i, j, m, n = [], 0, 0, len(one) - 1, len(other) - 1
    while i < m or j < n:
        if j == n or (i < m and (i + 1) * n <= (j + 1) * m):
            found.append((one[i], other[j], one[i + 1]))
            i += 1
        else:
            found.append((one[i], other[j], other[j + 1]))
            j += 1
    return np.array(found, dtype=int).reshape(-1, 3)
