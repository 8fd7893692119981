"""Parafoils: the ribs of a ram-air kite between which its cells are ruled, and their closed surface.

x aft, y to the right, z up, lengths in m. Ribs are profile sections; panels of a cell are ruled between two of them, so
that each strip of cloth from rib to rib is flat across the span as it is cut. Inlets are closed.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from .wings import ClosedSurface, mirrored_wing, sewn_section

FEWEST = 3  # ribs: two cells
STEEPEST = 80.0  # deg, half the angle of the arc, beyond which the tips of a kite face each other


def cell_widths(cells: int, equal: int | None = None, last: float = 1.0) -> np.ndarray:
    """Widths (cells,) of the cells of one half, from the middle outward, over that of the first one.

    The first `equal` ones are as wide as each other (none: all), those after them narrow by equal steps to `last`.
    """
    count = cells if equal is None else equal
    if not 0 < count <= cells:
        raise ValueError(f"of {cells} cells of a half, {count} cannot be equally wide; give 1 to {cells}.")
    narrow = cells - count
    return np.concatenate([np.ones(count), 1.0 - (1.0 - last) * np.arange(1, narrow + 1) / max(narrow, 1)])


def rib_shares(widths: np.ndarray) -> np.ndarray:
    """Shares (cells + 1,) of the half span at which ribs stand, from the middle to the tip, for `widths` (cells,)."""
    ends = np.concatenate([[0.0], np.cumsum(widths)])
    return ends / ends[-1]


def parafoil(ribs: np.ndarray, strips: int, tip: str = "flat", tip_strips: int = 4) -> ClosedSurface:
    """The wing of which `ribs` (k,n,3) m are the profile sections from the plane y = 0 to the right tip, and its image.

    Between two ribs stand `strips` strips of quads on straight rulings. The sections that are ribs are `ribs` (2k - 1,)
    of the surface, from tip to tip. With `tip` "sewn" upper and lower cloth meet at the last one. ValueError for fewer
    than three ribs, left and right ones together.
    """
    if 2 * len(ribs) - 1 < FEWEST:
        raise ValueError("a parafoil needs three ribs at least, one in the middle and one at each tip.")
    if tip == "sewn":
        ribs = np.concatenate([ribs[:-1], sewn_section(ribs[-1])[None]])
    share = (np.arange(strips) / strips)[:, None, None]
    cells = [(1.0 - share) * one + share * other for one, other in pairwise(ribs)]
    surface = mirrored_wing(np.concatenate([*cells, ribs[-1:]]), tip, tip_strips)
    return replace(surface, ribs=np.arange(2 * len(ribs) - 1) * strips)


def panels_across(surface: ClosedSurface) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the skin between the sections of a wing, in two triangles a panel: rows (t,) of the triangles, the share (t,)
    of the chord at which they lie, 0 being the nose, and the direction (t,3) in which they run across the span.
    """
    assert surface.sections is not None
    sections, nodes = surface.sections, surface.nodes
    strips, p = len(sections) - 1, sections.shape[1]
    nose, tail = nodes[sections[:, p - p // 2]], nodes[sections[:, 0]]
    chord = tail - nose
    of_point = np.einsum("kpc,kc->kp", nodes[sections] - nose[:, None], chord) / np.sum(chord**2, axis=1)[:, None]
    of_panel = 0.5 * (of_point + np.roll(of_point, -1, axis=1))
    share = 0.5 * (of_panel[:-1] + of_panel[1:])
    points = nodes[sections] + np.roll(nodes[sections], -1, axis=1)
    across = points[1:] - points[:-1]
    return np.arange(2 * strips * p), np.repeat(share.ravel(), 2), np.repeat(across.reshape(-1, 3), 2, axis=0)
