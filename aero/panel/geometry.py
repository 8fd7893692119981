"""Panels as their influence needs them: corners, normals, edges, moments of area."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from interface.vectors import cross

from .exact import pair_potentials

# The edges of the two triangles (0, 1, 2) and (0, 2, 3) of a panel, from corner to corner; the diagonal is in both.
EDGES = ((0, 1), (1, 2), (2, 0), (0, 2), (2, 3), (3, 0))
TRIANGLES = ((0, 1, 2), (0, 2, 3))
SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # entries of a symmetric tensor as they are stored
FLAT = 1e-9  # warp as a fraction of the size below which a panel is taken for flat; far above rounding
ON_IT = 0.01  # potential below which a centre lies on a triangle of its panel to rounding; beside it, it is above 0.05


@dataclass(frozen=True, eq=False)
class PanelGeometry:
    """Geometry of m panels; lengths in m.

    corners (m,4,3) counter-clockwise seen from outside, centre (m,3) of area, normal (m,3) unit, of the area vector,
    area (m,), size (m,) the longest distance of two corners, warp (m,) the distance of the two diagonals. A
    quadrilateral is two flat triangles with one shared diagonal, the first one (corners 0 and 2), or the second one
    where the first lies outside. The bilinear surface through its corners is warp/6 beside them on average: seen from a
    distance R its potential is theirs up to a fraction warp / (6 R) + 2 (warp / size)^2. `near` (m,48) and `far` (m,24)
    are what the exact potentials and the multipoles of a panel are made of.
    """

    corners: np.ndarray
    centre: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    size: np.ndarray
    warp: np.ndarray
    near: np.ndarray
    far: np.ndarray

    @classmethod
    def of(cls, nodes, panels):
        """Geometry of the `panels` (m,4), node indices, a triangle repeating its last, of `nodes` (n,3) m.

        ValueError for a panel without area.
        """
        corners = np.asarray(nodes, dtype=float)[np.asarray(panels)]
        diagonals = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        vector = 0.5 * cross(*diagonals)
        sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
        size = np.maximum(sides, np.maximum(*(np.linalg.norm(d, axis=1) for d in diagonals)))
        projected = np.linalg.norm(vector, axis=1)
        if (empty := np.flatnonzero(~(projected > 1e-14 * size**2))).size:
            raise ValueError(f"Panel {1 + empty[0]} has no area; remove it or set its corners apart.")
        normal = vector / projected[:, None]
        doubled = np.stack(
            [cross(corners[:, b] - corners[:, a], corners[:, c] - corners[:, a]) for a, b, c in TRIANGLES], 1
        )
        areas = 0.5 * np.einsum("mtc,mc->mt", doubled, normal)
        thirds = np.stack([corners[:, t].mean(axis=1) for t in TRIANGLES], 1)
        area = areas.sum(axis=1)
        centre = (areas[:, :, None] * thirds).sum(axis=1) / area[:, None]
        warp = np.abs(np.sum((corners[:, 1] - corners[:, 0]) * normal, axis=1))
        near = _near(corners, doubled, areas, size)
        far = _far(corners, centre, vector, area, areas, doubled, thirds, size)
        return cls(corners, centre, normal, area, size, warp, near, far)

    @cached_property
    def own(self):
        """Potential (m,) at each panel's own centre of its unit doublet, from inside: 1/2 of a flat panel.

        The centre of a warped panel lies a little beside its triangles; what they have there is continued through
        them, so that the influences of a closed body sum to 1 at all centres.
        """
        doublet = pair_potentials(self.near.T, self.centre.T, source=False)[0]
        inside = np.where(np.abs(doublet) < ON_IT, doublet + 0.5, np.where(doublet < 0.0, doublet + 1.0, doublet))
        return np.where(self.warp < FLAT * self.size, 0.5, inside)


def _near(corners, doubled, areas, size):
    """What the exact potentials need, (m,48): 12 coordinates of corners, unit normals of the two triangles (6), twice
    their areas (2), outward normals in the plane of the six edges (18), lengths of the edges but the second diagonal
    (5), 1 for a triangle without area (2), their areas across the panel's normal over their areas (2), nothing (1).
    """
    near = np.zeros((len(corners), 48))
    near[:, :12] = corners.reshape(-1, 12)
    own = 0.5 * np.linalg.norm(doubled, axis=2)
    some = own > 1e-14 * (size**2)[:, None]
    unit = np.where(some[:, :, None], doubled, 0.0) / np.where(some, 2.0 * own, 1.0)[:, :, None]
    near[:, 12:18] = unit.reshape(-1, 6)
    near[:, 18:20] = np.where(some, 2.0 * own, 0.0)
    lengths = []
    for k, (a, b) in enumerate(EDGES):
        edge = corners[:, b] - corners[:, a]
        length = np.linalg.norm(edge, axis=1)
        lengths.append(length)
        near[:, 20 + 3 * k : 23 + 3 * k] = cross(edge, unit[:, k // 3]) / np.where(length > 0.0, length, 1.0)[:, None]
    near[:, 38:43] = np.stack(lengths[:3] + lengths[4:], axis=1)
    near[:, 43:45] = ~some
    near[:, 45:47] = np.where(some, areas, 0.0) / np.where(some, own, 1.0)
    return near


def _far(corners, centre, vector, area, areas, doubled, thirds, size):
    """What the multipoles about the centre need, (m,24): centre (3), area vector (3), area, second moments of area over
    the area (6) and their trace, symmetric first moments of the area vector (6) and their trace, square of the size,
    nothing (2).
    """
    second, first = np.zeros((len(corners), 3, 3)), np.zeros((len(corners), 3, 3))
    for t, corner in enumerate(TRIANGLES):
        arm = thirds[:, t] - centre
        from_third = corners[:, corner] - thirds[:, t, None]
        spread = np.einsum("mki,mkj->mij", from_third, from_third) / 12.0
        second += areas[:, t, None, None] * (spread + arm[:, :, None] * arm[:, None, :])
        first += 0.5 * doubled[:, t, :, None] * arm[:, None, :]
    second /= area[:, None, None]
    far = np.zeros((len(corners), 24))
    far[:, :3], far[:, 3:6], far[:, 6] = centre, vector, area
    for k, (i, j) in enumerate(SYMMETRIC):
        far[:, 7 + k] = second[:, i, j]
        far[:, 14 + k] = 0.5 * (first[:, i, j] + first[:, j, i])
    far[:, 13], far[:, 20] = np.trace(second, axis1=1, axis2=2), np.trace(first, axis1=1, axis2=2)
    far[:, 21] = size**2
    return far
