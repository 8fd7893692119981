"""Where the boundary layer of a strip separates, by Stratford's criteria on the speeds that the panels give.

From the largest speed u_m on, with the pressure that is recovered, C = 1 - (u / u_m)^2, a boundary layer separates
where (x' is the length of the flat plate on which it would be as thick at u_m, plus the way since)

    laminar     C^(1/2) x' dC/dx = 0.102                                    (Stratford 1957, R. & M. 3002)
    turbulent   C (x' dC/dx)^(1/2) = k (R 1e-6)^(1/10),  R = u_m x' / nu    (Stratford 1959, J. Fluid Mech. 5, 1-16)

with k = 0.39 where d2p/dx2 >= 0 and 0.35 else. It is meant for C < 4/7, and beyond says separation a little early.
"""

from dataclasses import dataclass

import numpy as np

LAMINAR = 0.102
TURBULENT_CONVEX, TURBULENT_CONCAVE = 0.39, 0.35
# x' at the largest speed, of a layer laminar up to there, is 38.2 (nu / u_m x)^(3/8) (mean of (u / u_m)^5)^(5/8) x: the
# momentum thickness 0.671 (nu int u^5 / u_m^6)^(1/2) of Thwaites is that of a turbulent plate, 0.0366 x' R^(-1/5)
# (Cebeci and Smith 1974).
AFTER_LAMINAR = 38.2
TRANSITIONS = ("turbulent", "peak", "laminar")


@dataclass(frozen=True, eq=False)
class SuctionSides:
    """The runs of s strips from their stagnation line to the trailing edge on the side with the larger speed.

    `way` (s,k) m to the centres of their panels, rising, and `speed` (s,k) m/s there, of which the first `count` (s,)
    are of the run and the rest repeats its last; `length` (s,) m up to the trailing edge. `count` is 0 where the flow
    does not divide.
    """

    way: np.ndarray
    speed: np.ndarray
    count: np.ndarray
    length: np.ndarray


def suction_sides(centre, velocity, edge):
    """The `SuctionSides` of strips whose panels have the `centre` (s,k,3) m and the `velocity` (s,k,3) m/s, from the
    trailing edges at `edge` (s,3) round the nose back to them.

    The stagnation line is where the potential along the strip is least.
    """
    points = np.concatenate([edge[:, None], centre, edge[:, None]], axis=1)
    steps = np.linalg.norm(np.diff(points, axis=1), axis=2)
    at, along = np.cumsum(steps, axis=1)[:, :-1], points[:, 2:] - points[:, :-2]
    u = np.einsum("skc,skc->sk", velocity, along) / np.linalg.norm(along, axis=2)
    rise = np.cumsum(0.5 * (u[:, 1:] + u[:, :-1]) * np.diff(at, axis=1), axis=1)
    low = np.argmin(np.concatenate([np.zeros((len(u), 1)), rise], axis=1), axis=1)
    row, last = np.arange(len(u)), u.shape[1] - 1
    i = np.clip(np.where(u[row, low] <= 0.0, low, low - 1), 0, last - 1)  # it divides between panels i and i + 1
    divided = (low > 0) & (low < last) & (u[row, i] <= 0.0) & (u[row, i + 1] > 0.0)
    step = np.where(divided, u[row, i + 1] - u[row, i], 1.0)
    stagnation = at[row, i] - u[row, i] * (at[row, i + 1] - at[row, i]) / step
    k, row = np.arange(u.shape[1]), row[:, None]
    before, after = np.maximum(i[:, None] - k, 0), np.minimum(i[:, None] + 1 + k, last)
    upper = (-u[row, before]).max(axis=1) > u[row, after].max(axis=1)
    of = np.where(upper[:, None], before, after)
    sign = np.where(upper, -1.0, 1.0)
    length = np.where(upper, stagnation, steps.sum(axis=1) - stagnation)
    count = np.where(divided, np.where(upper, i + 1, last - i), 0)
    return SuctionSides(sign[:, None] * (at[row, of] - stagnation[:, None]), sign[:, None] * u[row, of], count, length)


def separations(sides, viscosity, transition="turbulent"):
    """How far from the stagnation line the boundary layers of `SuctionSides` separate, (s,) m, infinite where they do
    not; see `criterion`.
    """
    way, factor = sides.way, criterion(sides, viscosity, transition)
    peak, k = _peak(sides), np.arange(way.shape[1])
    above = (factor >= 1.0) & (k > peak[:, None]) & (k < sides.count[:, None])
    row, first = np.arange(len(way)), np.argmax(above, axis=1)
    before = np.maximum(first - 1, 0)
    here, there, now = way[row, before], way[row, first], factor[row, first]
    step = np.where(now > factor[row, before], now - factor[row, before], 1.0)
    between = here + (1.0 - factor[row, before]) / step * (there - here)
    at_once = np.where(now > 1.0, 0.5 * (here + there), there)
    return np.where(above.any(axis=1), np.where(first == peak + 1, at_once, between), np.inf)


def criterion(sides, viscosity, transition="turbulent"):
    """Left over right side (s,k) of Stratford's criterion on `SuctionSides`: at 1 a boundary layer separates, in air of
    the kinematic `viscosity` m^2/s. 0 up to the largest speed.

    `transition`: "turbulent" from the beginning, "laminar" all along, or laminar up to the "peak" of the speed.
    """
    way, peak, k = sides.way, _peak(sides)[:, None], np.arange(sides.way.shape[1])
    row, end = np.arange(len(way))[:, None], sides.count[:, None]
    most = sides.speed[row, peak]
    recovered = 1.0 - (sides.speed / np.where(most > 0.0, most, 1.0)) ** 2
    slope = _slope(recovered, way, peak, end)
    rising = np.maximum(slope, 0.0)
    since = way - way[row, peak] + equivalent_lengths(sides, viscosity, transition)[:, None]
    after = (k >= peak) & (k < end) & (peak < end - 2)
    recovered, since = np.where(after, np.maximum(recovered, 0.0), 0.0), np.where(after, since, 1.0)
    if transition == "laminar":
        return np.sqrt(recovered) * since * rising / LAMINAR
    convex = _slope(slope, way, peak, end) >= 0.0
    reynolds = 1e-6 * np.where(after, most, 1.0) * since / viscosity
    return recovered * np.sqrt(since * rising) / (np.where(convex, TURBULENT_CONVEX, TURBULENT_CONCAVE) * reynolds**0.1)


def equivalent_lengths(sides, viscosity, transition):
    """Lengths (s,) m of the flat plates at the largest speed on which layers are as thick as there, from rest at the
    stagnation lines of `SuctionSides` on.
    """
    peak, row, k = _peak(sides)[:, None], np.arange(len(sides.way)), np.arange(sides.way.shape[1])
    x, most = sides.way[row[:, None], peak], sides.speed[row[:, None], peak]
    there = (sides.count[:, None] > 0) & (most > 0.0)
    x, most = np.where(there, x, 1.0), np.where(there, most, 1.0)
    power = (sides.speed / most) ** (3 if transition == "turbulent" else 5)
    zero = np.zeros((len(row), 1))
    piece = 0.5 * (np.hstack([zero, power[:, :-1]]) + power) * np.diff(sides.way, axis=1, prepend=0.0)
    effective = np.where(k <= peak, piece, 0.0).sum(axis=1)
    if transition != "peak":
        return effective
    x, most = x[:, 0], most[:, 0]
    share = np.maximum(effective / x, 0.0)
    return AFTER_LAMINAR * (viscosity / (most * x)) ** 0.375 * share**0.625 * x


def _peak(sides):
    """Where (s,) the speed is largest."""
    there = np.arange(sides.speed.shape[1]) < sides.count[:, None]
    return np.argmax(np.where(there, sides.speed, -np.inf), axis=1)


def _slope(values, way, first, end):
    """Slopes (s,k) of values (s,k) over the way (s,k): of the parabola through three neighbours between `first` and
    `end` (s,1), of the line through two at these; 0 where there are none.
    """
    row, k = np.arange(len(way))[:, None], np.arange(way.shape[1])[None]
    last = np.maximum(end - 1, first)
    before, after = np.clip(k - 1, first, last), np.clip(k + 1, first, last)
    back, ahead = way - way[row, before], way[row, after] - way
    inner = (back > 0.0) & (ahead > 0.0)
    left = (values - values[row, before]) / np.where(back > 0.0, back, 1.0)
    right = (values[row, after] - values) / np.where(ahead > 0.0, ahead, 1.0)
    found = np.where(inner, (ahead * left + back * right) / np.where(inner, back + ahead, 1.0), left + right)
    return np.where((k >= first) & (k <= last), found, 0.0)
