"""Tapes and reels: parameters that are the rest lengths of lines, and the elements with these lengths."""

from functools import cached_property

import numpy as np

from ..members import with_rest_lengths
from ..schema import SceneError


class Tapes:
    """The tapes of a scene, whose value is the rest length of each of their lines, and its reels, whose value is that
    of all their lines together.
    """

    def __init__(self, scene):
        given = scene.structure
        self._scene, self._members, self._reels = scene.name, scene.members, given.reels
        self._lines = given.tapes | given.reels

    def __iter__(self):
        return iter(self._lines)

    @cached_property
    def _rest(self):
        chains, none = self._members.chains, np.zeros(0)
        return tuple(np.concatenate([none, *values]) for values in ([c.l0 for c in chains], [c.k for c in chains]))

    @property
    def rest_lengths(self):
        """Rest lengths (e,) m of all elements in the tables."""
        return self._rest[0]

    @cached_property
    def _shares(self):
        """Tape or reel -> rows of its elements, and the part of its length that each of them has."""
        names = {name: row for row, name in enumerate(self._members.names)}
        out = {}
        for parameter, elements in self._lines.items():
            reel = parameter in self._reels
            where = f"{self._scene}/scene.toml [structure.{'reels' if reel else 'tapes'}] {parameter}"
            for element in elements:
                if element not in names:
                    raise SceneError(f"{where}: line '{element}' is not in the line table; add it or correct the name.")
            rows = np.array([names[element] for element in elements])
            rest = self._rest[0][rows]
            if not reel and np.ptp(rest) > 0.0:
                raise SceneError(
                    f"{where}: its lines have different rest lengths; give them one, or a tape each, or make it a reel."
                )
            out[parameter] = rows, rest / rest.sum() if reel else np.ones(len(rows))
        return out

    @cached_property
    def starts(self):
        """Tape or reel -> rest length m in the tables."""
        return {name: float(self._rest[0][rows[0]] / shares[0]) for name, (rows, shares) in self._shares.items()}

    def spread(self, values):
        """What values (tape -> m, or m/s) mean for every element (e,); zero for elements of none."""
        out = np.zeros(len(self._rest[0]))
        for name, value in values.items():
            rows, shares = self._shares[name]
            out[rows] = shares * value
        return out

    def chains(self, lengths, modulus=None):
        """The chains with tapes of these rest lengths m, and lines of Young's modulus Pa where one is given."""
        rest, k = (a.copy() for a in self._rest)
        for name, length in lengths.items():
            rows, shares = self._shares[name]
            rest[rows] = shares * length
        area = self._members.area
        if modulus is not None:
            k = np.where(area > 0.0, modulus * area / np.where(area > 0.0, rest, 1.0), k)
        return with_rest_lengths(self._members.chains, rest, k)

    def mass(self, lengths, density):
        """Change (n,) kg of the nodal masses when tapes and reels of lines have these lengths, not those of the tables.

        `density` kg/m^3 of the lines; half of each leg's share at each of its ends, as in the tables.
        """
        m = self._members
        change = self.spread({k: v - self.starts[k] for k, v in lengths.items()}) * m.area * density
        out, start = np.zeros(len(m.nodes)), 0
        for group in m.chains:
            part = change[start : start + len(group.l0)]
            start += len(group.l0)
            if part.any():
                legs = np.linalg.norm(np.diff(m.nodes[group.nodes], axis=1), axis=2)
                legs = part[:, None] * legs / legs.sum(axis=1, keepdims=True)
                np.add.at(out, group.nodes[:, :-1], 0.5 * legs)
                np.add.at(out, group.nodes[:, 1:], 0.5 * legs)
        return out
