"""The strips of a wing, from trailing edge to trailing edge round the nose: chords, separation and profile drag."""

from dataclasses import dataclass

import numpy as np

from interface.vectors import cross

from .separation import separations, suction_sides
from .velocities import unit


@dataclass(frozen=True, eq=False)
class Strips:
    """Strips of a body: `ends` (s,2) nodes of their trailing edges, `edges` (s,2) the panels above and below these, and
    `rows` the panels of each strip in order, empty where the surface is not made of rows of quads there; `of_panel`
    (m,) is the strip of each panel, -1 beside them, and `whole` whether all strips have rows.
    """

    ends: np.ndarray
    edges: np.ndarray
    rows: tuple[np.ndarray, ...]
    of_panel: np.ndarray
    whole: bool
    _lines: np.ndarray
    _of_line: np.ndarray

    @classmethod
    def of(cls, body):
        """The strips of a `Body`."""
        lengths = np.array([len(row) for row in body.strips], dtype=int)
        strip = np.repeat(np.arange(len(lengths)), lengths)
        panel = np.concatenate([*body.strips, np.zeros(0, int)]).astype(int)
        of_panel = np.full(len(body.panels), -1)
        of_panel[panel] = strip
        whole = bool(len(lengths)) and bool((lengths > 0).all())
        at, same = body.trailing, np.flatnonzero(strip[1:] == strip[:-1])
        lines = _shared(body.panels[panel[same]], body.panels[panel[same + 1]])
        return cls(at[:, 2:], at[:, :2], body.strips, of_panel, whole, lines, strip[same])

    def middles(self, nodes):
        """Middles (s,3) m of the trailing edges."""
        return nodes[self.ends].mean(axis=1)

    def chords(self, nodes, centre):
        """Vectors (s,3) m from the nose of each strip, where the line between two of its panels is furthest from the
        trailing edge, to the middle of that; without rows only as far as the middle of the panels at the trailing edge.
        """
        middle = self.middles(nodes)
        fore = centre[self.edges].mean(axis=1)
        if len(self._lines):
            line = nodes[self._lines].mean(axis=1)
            distance = np.linalg.norm(line - middle[self._of_line], axis=1)
            order = np.lexsort((-distance, self._of_line))
            strips, first = np.unique(self._of_line[order], return_index=True)
            fore[strips] = line[order[first]]
        return middle - fore

    def skewness(self, nodes, points):
        """By how much (s,) the `points` (m,3) m of the two panels at each trailing edge lie apart along it, over how
        far they lie from it: 0 where panels on either side face each other.
        """
        edge = unit(nodes[self.ends[:, 1]] - nodes[self.ends[:, 0]])
        upper, lower = points[self.edges[:, 0]], points[self.edges[:, 1]]
        apart = np.abs(np.einsum("sc,sc->s", upper - lower, edge))
        from_edge = 0.5 * (upper + lower) - self.middles(nodes)
        across = from_edge - np.einsum("sc,sc->s", from_edge, edge)[:, None] * edge
        return apart / np.linalg.norm(across, axis=1)

    def widths(self, nodes, direction):
        """Lengths (s,) m of the trailing edges across the stream."""
        a, b = nodes[self.ends[:, 0]], nodes[self.ends[:, 1]]
        return np.linalg.norm(cross(b - a, np.broadcast_to(direction, a.shape)), axis=1)

    def angles(self, nodes, chord, direction):
        """Angles (s,) rad of the chords (s,3) to the stream in the planes across the trailing edges, positive where the
        stream comes from the lower side.
        """
        edge = unit(nodes[self.ends[:, 1]] - nodes[self.ends[:, 0]])
        along = direction - (edge @ direction)[:, None] * edge
        up = cross(chord, edge)
        chord = cross(edge, up)
        return np.arctan2(
            np.einsum("sc,sc->s", along, up) / np.linalg.norm(up, axis=1),
            np.einsum("sc,sc->s", along, chord) / np.linalg.norm(chord, axis=1),
        )

    def separations(self, nodes, centre, velocity, viscosity, transition):
        """How far along its suction side each strip separates, (s,) of the way from the stagnation line to the trailing
        edge; 1 where it does not.
        """
        found, middle = np.ones(len(self.ends)), self.middles(nodes)
        lengths = np.array([len(row) for row in self.rows], dtype=int)
        for length in np.unique(lengths[lengths > 2]):
            at = np.flatnonzero(lengths == length)
            row = np.stack([self.rows[i] for i in at])
            sides = suction_sides(centre[row], velocity[row], middle[at])
            share = separations(sides, viscosity, transition) / sides.length
            found[at] = np.where(sides.count > 0, np.minimum(share, 1.0), 1.0)
        return found

    def spread(self, values, area):
        """What strips (s,...) carry, as panels (m,...) carry it per area (m,) m^2, alike all over a strip; the panels
        beside strips carry nothing.
        """
        on = self.of_panel >= 0
        total = np.bincount(self.of_panel[on], weights=area[on], minlength=len(self.ends))
        per_area = values / total.reshape(-1, *[1] * (values.ndim - 1))
        return np.where(on.reshape(-1, *[1] * (values.ndim - 1)), per_area[self.of_panel], 0.0)


def _shared(one, other):
    """The two corners (k,2) that panels (k,4) share with others (k,4)."""
    common = (one[:, :, None] == other[:, None, :]).any(axis=2)
    common[:, 3] &= one[:, 3] != one[:, 2]
    order = np.argsort(~common, axis=1, kind="stable")[:, :2]
    return np.take_along_axis(one, order, axis=1)


def section_drag(polars, lift):
    """c_d (s,) at the lift coefficients `lift` (s,) of strips with `polars`, on the branch between the stalls on either
    side; that of the stall beyond it.
    """
    low, high = polars.stall_angles()
    alpha = polars.alpha[:, None]
    cl = np.stack([polars.all(np.full(len(lift), at))[0] for at in polars.alpha])
    attached = (alpha >= low) & (alpha <= high)
    first, last = np.argmax(attached, axis=0), len(alpha) - 1 - np.argmax(attached[::-1], axis=0)
    below = np.count_nonzero(attached & (cl <= lift), axis=0)
    strip, at = np.arange(len(lift)), np.clip(first + below - 1, first, np.maximum(last - 1, first))
    after = np.minimum(at + 1, last)
    rise = cl[after, strip] - cl[at, strip]
    share = np.clip((lift - cl[at, strip]) / np.where(rise > 0.0, rise, 1.0), 0.0, 1.0)
    return polars.all(polars.alpha[at] + share * (polars.alpha[after] - polars.alpha[at]))[1]
