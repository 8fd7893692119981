"""The attitudes in which a rigid wing does not pitch."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

# Scan step of the search for a sign change; pitching moment curves of kites have one stable zero within tens of
# degrees. Those of flow that never stalls bend less.
STEP, SMOOTH_STEP = np.deg2rad(2.5), np.deg2rad(10.0)
EXACT, NEAR = 1e-6, 1e-3  # rad, of angles; the latter where a look costs seconds and a flown kite deforms by more


@dataclass(frozen=True)
class TrimPoint:
    """An `angle` rad at which nothing pitches the wing, `stable` where the moment falls with the angle, and its `lift`
    there, in whatever unit it was given.
    """

    angle: float
    stable: bool
    lift: float


@dataclass(frozen=True)
class Trims:
    """All `points` between two angles, in the order of their angle, and the moments N m at the `first` and the `last`
    angle that were looked at.
    """

    points: tuple[TrimPoint, ...]
    first: float
    last: float

    @property
    def start(self) -> TrimPoint | None:
        """The first point that is stable and lifts, None without one."""
        return next((p for p in self.points if p.stable and p.lift > 0.0), None)


def trims(loads: Callable[[float], tuple[float, float]], low: float, high: float, smooth: bool = False) -> Trims:
    """The angles between `low` and `high` rad where the pitching moment N m, nose-up positive, goes through zero.

    `loads` gives moment and lift at an angle. Of two zeros within 2.5 degrees both may be missed. Angles are accurate
    to 1e-6 rad; of a `smooth` flow, which is looked at as seldom as possible, these are 10 degrees and 1e-3 rad.
    """
    if smooth:
        loads, step, accuracy = cache(loads), SMOOTH_STEP, NEAR
    else:
        step, accuracy = STEP, EXACT
    angles = np.linspace(low, high, max(2, int(np.ceil((high - low) / step)) + 1)).tolist()
    points = []
    before = first = loads(angles[0])[0]
    for left, right in pairwise(angles):
        after = loads(right)[0]
        falls, rises = before > 0.0 >= after, before < 0.0 <= after
        if falls or rises:
            angle = _zero(lambda a: loads(a)[0], (left, before), (right, after), accuracy)
            points.append(TrimPoint(angle, falls, loads(angle)[1]))
        before = after
    return Trims(tuple(points), first, before)


def _zero(moment, low, high, accuracy):
    """The zero between two angles with moments of different signs. A flow that has more than one answer may give others
    when it is asked again: then those known count.
    """
    known = dict([low, high])
    try:
        return float(brentq(moment, low[0], high[0], xtol=accuracy))
    except ValueError:
        return float(brentq(lambda a: known[a] if a in known else moment(a), low[0], high[0], xtol=accuracy))
