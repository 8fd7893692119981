"""Section polars: tables of cl, cd, cm over the angle of attack, one row a strip."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator

# Fraction of the span to which a strip stands on a section: what rounding of the positions of a symmetric wing leaves.
ON_SECTION = 1e-6
FLAT = 1e-12  # change of lift between two table points that is rounding of a blend along the span


@dataclass(frozen=True, eq=False)
class StripPolars:
    """Coefficients of every strip as functions of its own angle of attack.

    Monotone piecewise cubics (Fritsch and Carlson 1980) through the table points: no overshoot near stall, exact for
    linear tables, continuous slope. Beyond the table the end value is held with zero slope and the strip is flagged;
    it is flagged too where a table that it is blended from has no data but its own end value.

    `alpha` (k,) rad, increasing; `coefficients` (3 of cl, cd, cm; strips; k - 1; 4), highest power first; `ends`
    (strips, 2) rad, the range in which all tables of the strip have data.
    """

    alpha: np.ndarray
    coefficients: np.ndarray
    ends: np.ndarray

    @classmethod
    def from_tables(cls, alpha, cl, cd, cm, span, strip_span, ends=None):
        """Polars of strips at `strip_span` (n,) from section tables (sections, k) that stand at `span` (sections,).

        Shape-preserving along the span too; a strip outside the outermost sections takes the nearest one. A table has
        data between its `ends` (sections, 2) rad, None: everywhere, and its end values beyond.
        """
        alpha = np.asarray(alpha, float)
        tables = np.stack([np.asarray(t, float) for t in (cl, cd, cm)])
        span = np.asarray(span, float)
        at = np.clip(np.asarray(strip_span, float), span[0], span[-1])
        one = len(span) == 1
        strips = np.repeat(tables, len(at), axis=1) if one else PchipInterpolator(span, tables, axis=1)(at)
        whole = alpha[[0, -1]]
        ends = np.tile(whole, (len(at), 1)) if ends is None else _common_ends(np.clip(ends, *whole), span, at)
        pieces = np.empty((3, len(at), len(alpha) - 1, 4))
        for low, high in np.unique(ends, axis=0):
            rows = np.flatnonzero((ends == (low, high)).all(axis=1))
            pieces[:, rows] = _pieces(alpha, strips[:, rows], low, high)
        return cls(alpha, pieces, ends)

    def of(self, strips):
        """Polars of the chosen `strips` (a slice) only."""
        return StripPolars(self.alpha, self.coefficients[:, strips], self.ends[strips])

    def mirrored(self):
        """Whether strip i has the polars of strip n - 1 - i, so that half a wing gives the whole answer.

        To 1e-6 in cl, cd and cm at the table points: what rounding of the section positions makes of a symmetric wing.
        """
        values = self.coefficients[..., 3]
        same = np.array_equal(self.ends, self.ends[::-1])
        return same and bool(np.abs(values - values[:, ::-1]).max() <= 1e-6)

    def steepest_fall(self):
        """The largest loss of lift with angle at any table point, over all strips, per rad (0 where none falls)."""
        return max(0.0, -float(self.coefficients[0, :, :, 2].min()))

    def stall_angles(self):
        """Angles (2, n) rad of the first lift minimum below and the first maximum above zero angle, at table points.

        Infinite where lift does not turn; what lies beyond, also the rise of separated flow later on, is stalled.
        """
        end = self.alpha[-1] - self.alpha[-2]
        last = self.coefficients[0, :, -1] @ end ** np.arange(3.0, -1.0, -1.0)
        cl = np.column_stack([self.coefficients[0, :, :, 3], last])  # at the table points
        zero = int(np.argmin(np.abs(self.alpha)))

        def first(angles, turned, none):
            if not len(angles):
                return np.full(len(cl), none)
            return np.where(turned.any(axis=1), angles[turned.argmax(axis=1)], none)

        low = first(self.alpha[zero:0:-1], np.diff(cl[:, zero::-1], axis=1) > FLAT, -np.inf)
        high = first(self.alpha[zero:-1], np.diff(cl[:, zero:], axis=1) < -FLAT, np.inf)
        return np.stack([low, high])

    def _piece(self, alpha):
        inside = np.clip(alpha, self.alpha[0], self.alpha[-1])
        k = np.clip(np.searchsorted(self.alpha, inside, side="right") - 1, 0, len(self.alpha) - 2)
        return inside - self.alpha[k], k, (alpha < self.alpha[0]) | (alpha > self.alpha[-1])

    def lift(self, alpha):
        """cl (n,), its slope dcl/dalpha (n,) per rad, and whether alpha left the data (n,) bool."""
        s, k, beyond = self._piece(alpha)
        c3, c2, c1, c0 = self.coefficients[0, np.arange(len(k)), k].T
        cl = ((c3 * s + c2) * s + c1) * s + c0
        slope = np.where(beyond, 0.0, (3.0 * c3 * s + 2.0 * c2) * s + c1)
        return cl, slope, (alpha < self.ends[:, 0]) | (alpha > self.ends[:, 1])

    def all(self, alpha):
        """cl, cd, cm stacked (3, n) at alpha (n,) rad."""
        s, k, _ = self._piece(alpha)
        c3, c2, c1, c0 = np.moveaxis(self.coefficients[:, np.arange(len(k)), k], -1, 0)
        return ((c3 * s + c2) * s + c1) * s + c0


def sections_beside(span, at):
    """Indices (n,) of the sections at `span` (sections,) left and right of strips at `at` (n,), from which these are
    blended; twice the same one for a strip that stands on a section or beyond the outermost ones.
    """
    at = np.clip(at, span[0], span[-1])
    near = ON_SECTION * np.ptp(span)
    left = np.clip(np.searchsorted(span, at + near, side="right") - 1, 0, len(span) - 1)
    right = np.clip(np.searchsorted(span, at - near, side="left"), 0, len(span) - 1)
    return left, right


def _common_ends(ends, span, at):
    """The range (n,2) rad in which the sections on either side of `at` (n,) have data: `ends` (sections,2) rad.
    ValueError where they have none in common.
    """
    left, right = sections_beside(span, at)
    low, high = ends.T
    common = np.stack([np.maximum(low[left], low[right]), np.minimum(high[left], high[right])], axis=1)
    apart = np.flatnonzero(common[:, 0] >= common[:, 1])
    if len(apart):
        i, j = int(left[apart[0]]), int(right[apart[0]])
        raise ValueError(f"The tables of sections {i} and {j} share no range of angles; widen one of them.")
    return common


def _pieces(alpha, values, low, high):
    """Monotone cubics (3, n, k - 1, 4) through `values` (3,n,k) over `alpha` (k,): one curve between the angles `low`
    and `high`, which the values held beyond do not bend, and one on either side of it.
    """
    cuts = sorted({0, *(int(np.argmin(np.abs(alpha - end))) for end in (low, high)), len(alpha) - 1})
    parts = [PchipInterpolator(alpha[a : b + 1], values[..., a : b + 1], axis=2).c for a, b in pairwise(cuts)]
    return np.transpose(np.concatenate(parts, axis=1), (2, 3, 1, 0))  # from (4, k - 1, 3, n)
