"""The surface mesh that structure and flow share: open sheets or closed bodies, and the lines beside them."""

from dataclasses import dataclass, field

import numpy as np


def station_panels(sections):
    """Node indices (k n, 4) of the panels between n + 1 `sections` of k + 1 stations each, leading to trailing edge.

    The foremost panels of all strips come first, then the next ones, with the corners (fore, aft) of the strip's first
    section, then (aft, fore) of its second, so that area vectors point to suction.
    """
    first, second = sections[:-1], sections[1:]
    rows = range(sections.shape[1] - 1)
    corners = [[first[:, c], first[:, c + 1], second[:, c + 1], second[:, c]] for c in rows]
    return np.concatenate([np.stack(four, axis=1) for four in corners])


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """One surface mesh for both solvers.

    `nodes` (n,3) m in the reference configuration, `panels` (m,4) node indices (a triangle repeats its last one) whose
    area vectors point to the suction side of a sheet and outward on a closed body, `lines` (k,2) nodes of the legs that
    stand in the wind, of `diameter` (k,) m.
    """

    nodes: np.ndarray
    panels: np.ndarray
    lines: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), dtype=int), kw_only=True)
    diameter: np.ndarray = field(default_factory=lambda: np.zeros(0), kw_only=True)

    @property
    def panel_edges(self):
        """Directed edges (e,2) of all panels, each in the sense in which its panel runs round, and their panel (e,)."""
        ends = np.stack([self.panels, np.roll(self.panels, -1, axis=1)], axis=2).reshape(-1, 2)
        panel = np.repeat(np.arange(len(self.panels)), self.panels.shape[1])
        real = ends[:, 0] != ends[:, 1]  # the repeated corner of a triangle
        return ends[real], panel[real]

    @property
    def closed(self):
        """Whether the panels close bodies: every edge runs once each way. A mesh without panels is not closed."""
        ends, _ = self.panel_edges
        if not len(ends):
            return False
        n = int(ends.max()) + 1
        there, back = (ends[:, 0] * n + ends[:, 1], ends[:, 1] * n + ends[:, 0])
        return len(np.unique(there)) == len(there) and np.array_equal(np.sort(there), np.sort(back))
