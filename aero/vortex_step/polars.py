"""Section polars: tables of cl, cd, cm over the angle of attack, one row a strip."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator


@dataclass(frozen=True, eq=False)
class StripPolars:
    """Coefficients of every strip as functions of its own angle of attack.

    Monotone piecewise cubics (Fritsch and Carlson 1980) through the table points: no overshoot near stall, exact for
    linear tables, continuous slope. Beyond the table the end value is held with zero slope and the strip is flagged.

    `alpha` (k,) rad, increasing; `coefficients` (3 of cl, cd, cm; strips; k - 1; 4), highest power first.
    """

    alpha: np.ndarray
    coefficients: np.ndarray

    @classmethod
    def from_tables(cls, alpha, cl, cd, cm, span, strip_span):
        """Polars of strips at `strip_span` (n,) from section tables (sections, k) that stand at `span` (sections,).

        Shape-preserving along the span too; a strip outside the outermost sections takes the nearest one.
        """
        alpha = np.asarray(alpha, float)
        tables = np.stack([np.asarray(t, float) for t in (cl, cd, cm)])
        span = np.asarray(span, float)
        at = np.clip(np.asarray(strip_span, float), span[0], span[-1])
        one = len(span) == 1
        strips = np.repeat(tables, len(at), axis=1) if one else PchipInterpolator(span, tables, axis=1)(at)
        pieces = PchipInterpolator(alpha, strips, axis=2).c  # (4, k - 1, 3, n)
        return cls(alpha, np.ascontiguousarray(np.transpose(pieces, (2, 3, 1, 0))))

    def of(self, strips):
        """Polars of the chosen `strips` (a slice) only."""
        return StripPolars(self.alpha, self.coefficients[:, strips])

    def mirrored(self):
        """Whether strip i has the polars of strip n - 1 - i, so that half a wing gives the whole answer.

        To 1e-6 in cl, cd and cm at the table points: what rounding of the section positions makes of a symmetric wing.
        """
        values = self.coefficients[..., 3]
        return bool(np.abs(values - values[:, ::-1]).max() <= 1e-6)

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

        low = first(self.alpha[zero:0:-1], np.diff(cl[:, zero::-1], axis=1) > 0.0, -np.inf)
        high = first(self.alpha[zero:-1], np.diff(cl[:, zero:], axis=1) < 0.0, np.inf)
        return np.stack([low, high])

    def _piece(self, alpha):
        inside = np.clip(alpha, self.alpha[0], self.alpha[-1])
        k = np.clip(np.searchsorted(self.alpha, inside, side="right") - 1, 0, len(self.alpha) - 2)
        return inside - self.alpha[k], k, (alpha < self.alpha[0]) | (alpha > self.alpha[-1])

    def lift(self, alpha):
        """cl (n,), its slope dcl/dalpha (n,) per rad, and whether alpha left the table (n,) bool."""
        s, k, outside = self._piece(alpha)
        c3, c2, c1, c0 = self.coefficients[0, np.arange(len(k)), k].T
        cl = ((c3 * s + c2) * s + c1) * s + c0
        slope = np.where(outside, 0.0, (3.0 * c3 * s + 2.0 * c2) * s + c1)
        return cl, slope, outside

    def all(self, alpha):
        """cl, cd, cm stacked (3, n) at alpha (n,) rad."""
        s, k, _ = self._piece(alpha)
        c3, c2, c1, c0 = np.moveaxis(self.coefficients[:, np.arange(len(k)), k], -1, 0)
        return ((c3 * s + c2) * s + c1) * s + c0
