"""The strips of a wing, from trailing edge to trailing edge round the nose: chords, separation and profile drag."""

from dataclasses import dataclass
from functools import cached_property

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
    _noses: np.ndarray
    _with_nose: np.ndarray

    @classmethod
    def of(cls, body, nodes):
        """The strips of a `Body` whose nodes (n,3) m are at rest. The nose of each is where the line between two of its
        panels is furthest from the trailing edge there, and stays on this line when the wing deforms.
        """
        lengths = np.array([len(row) for row in body.strips], dtype=int)
        panel = np.concatenate([*body.strips, np.zeros(0, int)]).astype(int)
        of_panel = np.full(len(body.panels), -1)
        of_panel[panel] = np.repeat(np.arange(len(lengths)), lengths)
        whole = bool(len(lengths)) and bool((lengths > 0).all())
        at = body.trailing
        lines, of_line = _lines_between(body.panels, at[:, 2:], body.strips)
        tails = nodes[at[:, 2:]].mean(axis=1)
        distance = np.linalg.norm(nodes[lines].mean(axis=1) - tails[of_line], axis=1)
        order = np.lexsort((-distance, of_line))
        with_nose, first = np.unique(of_line[order], return_index=True)
        return cls(at[:, 2:], at[:, :2], body.strips, of_panel, whole, lines[order[first]], with_nose)

    def middles(self, nodes):
        """Middles (s,3) m of the trailing edges."""
        return nodes[self.ends].mean(axis=1)

    def chords(self, nodes, centre):
        """Vectors (s,3) m from the nose of each strip to the middle of its trailing edge; without rows only from the
        middle of the panels at the trailing edge.
        """
        middle = self.middles(nodes)
        fore = centre[self.edges].mean(axis=1)
        fore[self._with_nose] = nodes[self._noses].mean(axis=1)
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
        """Angles (s,) rad of the chords (s,3) to the stream, in the planes across the trailing edges, positive where
        it comes from the lower side; its `direction` is one (3,) or that at each strip (s,3).
        """
        edge = unit(nodes[self.ends[:, 1]] - nodes[self.ends[:, 0]])
        across = edge @ direction if direction.ndim == 1 else np.einsum("sc,sc->s", edge, direction)
        along = direction - across[:, None] * edge
        up = cross(chord, edge)
        chord = cross(edge, up)
        return np.arctan2(
            np.einsum("sc,sc->s", along, up) / np.linalg.norm(up, axis=1),
            np.einsum("sc,sc->s", along, chord) / np.linalg.norm(chord, axis=1),
        )

    def crossed(self, centre, normal):
        """Which strips (s,) have panels whose upper and lower side went through each other: from the one to the
        opposite one, by their `centre` (m,3) m, is against the outward `normal` (m,3) of both together.
        """
        one, other, strip = self._opposite
        inward = np.einsum("kc,kc->k", centre[one] - centre[other], normal[one] - normal[other]) < 0.0
        return np.bincount(strip[inward], minlength=len(self.ends)) > 0

    @cached_property
    def _opposite(self):
        """Panels that face each other across the chord, (k,) of one side and of the other, and their strips (k,)."""
        halves = [(row[: len(row) // 2], row[::-1][: len(row) // 2]) for row in self.rows]
        one, other = (np.concatenate([half[i] for half in halves]) for i in range(2))
        return one, other, np.repeat(np.arange(len(halves)), [len(half[0]) for half in halves])

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

    def sums(self, values):
        """Sums (s,3) of values (m,3) over the panels of strips."""
        on = self.of_panel >= 0
        found = np.zeros((len(self.ends), 3))
        np.add.at(found, self.of_panel[on], values[on])
        return found

    def means(self, values, area):
        """Means (s,3) of values (m,3) over the panels of strips, by their `area` (m,) m^2."""
        on = self.of_panel >= 0
        return (
            self.sums(values * area[:, None])
            / np.bincount(self.of_panel[on], weights=area[on], minlength=len(self.ends))[:, None]
        )

    def spread(self, values, area):
        """What strips (s,...) carry, as panels (m,...) carry it per area (m,) m^2, alike all over a strip; the panels
        beside strips carry nothing.
        """
        on = self.of_panel >= 0
        total = np.bincount(self.of_panel[on], weights=area[on], minlength=len(self.ends))
        per_area = values / total.reshape(-1, *[1] * (values.ndim - 1))
        return np.where(on.reshape(-1, *[1] * (values.ndim - 1)), per_area[self.of_panel], 0.0)


def _lines_between(panels, ends, rows):
    """The corners (k,2) of the lines between each panel and the next in `rows` of quads that begin at the edges `ends`
    (s,2), and the row of each (k,). A line is opposite the one before in its quad: the two that meet over a sewn tip
    have a side along it in common too.
    """
    lengths = np.array([len(row) for row in rows], dtype=int)
    row, line = np.arange(len(rows)), ends
    lines, of_line = [np.zeros((0, 2), dtype=int)], [row[:0]]
    for step in range(lengths.max(initial=1) - 1):
        on = lengths[row] > step + 1
        row, line = row[on], line[on]
        quad = panels[np.array([rows[i][step] for i in row], dtype=int)]
        line = quad[~(quad[:, :, None] == line[:, None, :]).any(axis=2)].reshape(-1, 2)
        lines.append(line)
        of_line.append(row)
    return np.concatenate(lines), np.concatenate(of_line)


def section_drag(polars, lift):
    """c_d (s,) at the lift coefficients `lift` (s,) of strips with `polars`, on the branch between the stalls on either
    side, that of the stall or of the end of the data beyond it; and which lie beyond (s,).
    """
    low, high = polars.stall_angles()
    low, high = np.maximum(low, polars.ends[:, 0]), np.minimum(high, polars.ends[:, 1])
    alpha = polars.alpha[:, None]
    cl = np.stack([polars.all(np.full(len(lift), at))[0] for at in polars.alpha])
    attached = (alpha >= low) & (alpha <= high)
    first, last = np.argmax(attached, axis=0), len(alpha) - 1 - np.argmax(attached[::-1], axis=0)
    below = np.count_nonzero(attached & (cl <= lift), axis=0)
    strip, at = np.arange(len(lift)), np.clip(first + below - 1, first, np.maximum(last - 1, first))
    after = np.minimum(at + 1, last)
    rise = cl[after, strip] - cl[at, strip]
    share = np.clip((lift - cl[at, strip]) / np.where(rise > 0.0, rise, 1.0), 0.0, 1.0)
    beyond = ~((cl[first, strip] <= lift) & (lift <= cl[last, strip]))
    return polars.all(polars.alpha[at] + share * (polars.alpha[after] - polars.alpha[at]))[1], beyond
