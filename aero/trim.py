"""The attitude in which a rigid wing does not pitch."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

# Scan step of the search for a sign change; pitching moment curves of kites have one stable zero within tens of
# degrees.
STEP = np.deg2rad(2.5)


@dataclass(frozen=True)
class Trim:
    """The trim `angle` rad, None where there is none; the moments N m at the `first` and the `last` angle that were
    looked at.
    """

    angle: float | None
    first: float
    last: float

    @property
    def rises(self) -> bool:
        """Whether the moment rises through zero: the angle between is not a stable one."""
        return self.first < 0.0 < self.last


def stable_trim(moment: Callable[[float], float], low: float, high: float) -> Trim:
    """The first angle between `low` and `high` rad where the pitching moment N m, nose-up positive, falls through zero.

    The search goes up from `low` and ends at that angle. Accurate to 1e-6 rad.
    """
    angles = np.linspace(low, high, max(2, int(np.ceil((high - low) / STEP)) + 1))
    before = first = moment(angles[0])
    for left, right in pairwise(angles):
        after = moment(right)
        if before > 0.0 >= after:
            return Trim(float(brentq(moment, left, right, xtol=1e-6)), first, after)
        before = after
    return Trim(None, first, before)
