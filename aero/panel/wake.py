"""The wake of a body: strips of doublets that leave its trailing edges, and what they add to the potential."""

from dataclasses import dataclass

import numpy as np

from .influence import PanelGeometry, doublet_matrix, wake_matrix


@dataclass(frozen=True, eq=False)
class Wake:
    """Strips between `sides` (s,2,k+1,3) m, two lines from the two ends of each trailing edge that go from point to
    point and then on along `direction` (3,) without end; k = 0 is a straight wake.
    """

    sides: np.ndarray
    direction: np.ndarray

    @property
    def segments(self):
        """Panels along each strip, before its semi-infinite end."""
        return self.sides.shape[2] - 1

    def panels(self):
        """The finite panels (s k,4,3) m of all strips, strip by strip, None without; corners b, a, then downstream."""
        if not self.segments:
            return None
        a, b = self.sides[:, 0], self.sides[:, 1]
        return np.stack([b[:, :-1], a[:, :-1], a[:, 1:], b[:, 1:]], axis=2).reshape(-1, 4, 3)

    def geometry(self):
        """Their `PanelGeometry`, None without."""
        corners = self.panels()
        return None if corners is None else PanelGeometry.of(corners.reshape(-1, 3), np.arange(4 * len(corners)).reshape(-1, 4))

    def potentials(self, points, symmetric=False):
        """Potential (p,s) of strips of unit strength, with their images in y = 0 where `symmetric`."""
        total = np.zeros((len(points), len(self.sides)))
        if not len(self.sides):
            return total
        end_a, end_b, finite = self.sides[:, 0, -1], self.sides[:, 1, -1], self.geometry()
        for mirrored in (False, True) if symmetric else (False,):
            total += wake_matrix(end_a, end_b, self.direction, points, mirrored=mirrored)
            if finite is not None:
                each = doublet_matrix(finite, points, mirrored=mirrored)
                total += each.reshape(len(points), len(self.sides), self.segments).sum(axis=2)
        return total


def straight_wake(body, nodes, direction):
    """The wake along the free stream of a body on `nodes` (n,3) m."""
    return Wake(nodes[body.trailing[:, 2:]][:, :, None], direction)
