"""The wake of a body: strips of doublets that leave its trailing edges, their potential and velocity, and their shape.

A wake runs straight along the free stream unless it is relaxed: then the first part of each strip is made of panels
that go where the air carries them, and the rest goes on along the free stream from there.
"""

from dataclasses import dataclass, replace

import numpy as np

from .influence import PanelGeometry, doublet_matrix, induced_velocity, wake_matrix, wake_velocity

SEGMENTS = 16  # panels along a relaxed strip
FIRST = 0.05  # the first of them, and all of them together, in extents of the body
LENGTH = 2.0
CORE = 0.1  # of the vortices in it, in extents of the body: what so few panels cannot roll up is left flat


@dataclass(frozen=True, eq=False)
class Wake:
    """Strips between `sides` (s,2,k+1,3) m, two lines from the two ends of each trailing edge that go from point to
    point and then on along the unit vector `direction` (3,) without end; k = 0 is a straight wake.
    """

    sides: np.ndarray
    direction: np.ndarray

    @property
    def segments(self):
        """Panels along each strip, before its semi-infinite end."""
        return self.sides.shape[2] - 1

    @property
    def far_ends(self):
        """Points a and b (s,3) m of each strip where its semi-infinite end begins."""
        return self.sides[:, 0, -1], self.sides[:, 1, -1]

    def of(self, strips):
        """The chosen strips only."""
        return replace(self, sides=self.sides[strips])

    def geometry(self):
        """Of the finite panels (s k), strip by strip; corners b, a, then downstream."""
        a, b = self.sides[:, 0], self.sides[:, 1]
        corners = np.stack([b[:, :-1], a[:, :-1], a[:, 1:], b[:, 1:]], axis=2).reshape(-1, 3)
        return PanelGeometry.of(corners, np.arange(len(corners)).reshape(-1, 4))

    def potentials(self, points, symmetric=False):
        """Potential (p,s) of strips of unit strength, with their images in y = 0 where `symmetric`."""
        total = np.zeros((len(points), len(self.sides)))
        if not len(self.sides):
            return total
        a, b = self.far_ends
        for mirrored in (False, True) if symmetric else (False,):
            total += wake_matrix(a, b, self.direction, points, mirrored=mirrored)
            if self.segments:
                each = doublet_matrix(self.geometry(), points, mirrored=mirrored)
                total += each.reshape(len(points), len(self.sides), self.segments).sum(axis=2)
        return total

    def velocity(self, points, jumps, core):
        """Velocity (p,3) m/s at points by strips with `jumps` (s,) m^2/s, whose edges have a `core` m."""
        a, b = self.far_ends
        found = wake_velocity(a, b, self.direction, jumps, points, core=core)
        if self.segments:
            each = np.repeat(jumps, self.segments)
            found = found + induced_velocity(self.geometry(), points, np.zeros(len(each)), each, core=core)
        return found


def straight_wake(body, nodes, direction):
    """The wake along the free stream of a body on `nodes` (n,3) m."""
    return Wake(nodes[body.trailing[:, 2:]][:, :, None], direction)


def divided(wake, extent):
    """A straight wake whose first part is divided into panels, for a body of some `extent` m."""
    way = np.concatenate([[0.0], np.geomspace(FIRST, LENGTH, SEGMENTS) * extent])
    return replace(wake, sides=wake.sides[:, :, :1] + way[:, None] * wake.direction)


def carried(wake, ends, velocity):
    """The divided `wake` with its panels along the flow, and by how far its points have moved, m, the most.

    `ends` (s,2) are the nodes that its strips leave between; `velocity` gives that of the air (p,3) m/s at points. It
    is taken in the middle of each panel, where the panel's own edges leave none; lines go with the mean of the two
    strips beside them, at a free end with the one.
    """
    middle = wake.sides.mean(axis=1)
    steps = np.diff(middle, axis=1)
    v = velocity(0.5 * (middle[:, 1:] + middle[:, :-1]).reshape(-1, 3)).reshape(steps.shape)
    along = v / np.linalg.norm(v, axis=2, keepdims=True)
    length = np.linalg.norm(steps, axis=2, keepdims=True)
    offset = np.cumsum(length * along - steps, axis=1)
    total = np.zeros((ends.max() + 1, *offset.shape[1:]))
    np.add.at(total, ends, offset[:, None])
    shared = np.bincount(ends.ravel(), minlength=len(total))
    of_line = total[ends] / shared[ends][..., None, None]
    sides = wake.sides.copy()
    sides[:, :, 1:] += of_line
    return replace(wake, sides=sides), float(np.linalg.norm(of_line, axis=-1).max())
