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
class SuctionSide:
    """The run of a strip from its stagnation line to the trailing edge on the side with the larger speed.

    `way` (k,) m to the centres of its panels, rising, `speed` (k,) m/s there, `length` m up to the trailing edge.
    """

    way: np.ndarray
    speed: np.ndarray
    length: float


def suction_side(centre, velocity, edge):
    """The `SuctionSide` of a strip whose panels have the `centre` (k,3) m and the `velocity` (k,3) m/s, from the
    trailing edge at `edge` (3,) m round the nose back to it; None where the flow does not divide on it.

    The stagnation line is where the potential along the strip is least.
    """
    points = np.concatenate([[edge], centre, [edge]])
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    at = np.cumsum(steps)[:-1]
    along = points[2:] - points[:-2]
    u = np.einsum("kc,kc->k", velocity, along) / np.linalg.norm(along, axis=1)
    potential = np.concatenate([[0.0], np.cumsum(0.5 * (u[1:] + u[:-1]) * np.diff(at))])
    low = int(np.argmin(potential))
    if not 0 < low < len(u) - 1:
        return None
    i = low if u[low] <= 0.0 else low - 1  # the flow divides between panels i and i + 1
    if not u[i] <= 0.0 < u[i + 1]:
        return None
    stagnation = at[i] - u[i] * (at[i + 1] - at[i]) / (u[i + 1] - u[i])
    upper = SuctionSide((stagnation - at[: i + 1])[::-1], -u[: i + 1][::-1], stagnation)
    lower = SuctionSide(at[i + 1 :] - stagnation, u[i + 1 :], float(steps.sum()) - stagnation)
    return upper if upper.speed.max() > lower.speed.max() else lower


def separation(way, speed, viscosity, transition="turbulent"):
    """How far from the stagnation line a boundary layer separates, m, infinite where it does not; see `criterion`."""
    peak = int(np.argmax(speed))
    factor = criterion(way, speed, viscosity, transition)
    return _first_above_one(way[peak + 1 :], factor[peak + 1 :], way[peak])


def criterion(way, speed, viscosity, transition="turbulent"):
    """Left over right side (k,) of Stratford's criterion: at 1 a boundary layer separates, from the `speed` (k,) m/s at
    the `way` (k,) m, rising, from the stagnation line, and the kinematic `viscosity` m^2/s. 0 up to the largest speed.

    `transition`: "turbulent" from the beginning, "laminar" all along, or laminar up to the "peak" of the speed.
    """
    peak, factor = int(np.argmax(speed)), np.zeros(len(way))
    if peak >= len(way) - 2:
        return factor
    x, most = way[peak:], speed[peak]
    recovered = 1.0 - (speed[peak:] / most) ** 2
    slope = np.gradient(recovered, x)
    rising = np.maximum(slope, 0.0)
    since = x - x[0] + equivalent_length(way[: peak + 1], speed[: peak + 1], viscosity, transition)
    if transition == "laminar":
        factor[peak:] = np.sqrt(recovered) * since * rising / LAMINAR
    else:
        k = np.where(np.gradient(slope, x) >= 0.0, TURBULENT_CONVEX, TURBULENT_CONCAVE)
        reynolds = 1e-6 * most * since / viscosity
        factor[peak:] = recovered * np.sqrt(since * rising) / (k * reynolds**0.1)
    return factor


def equivalent_length(way, speed, viscosity, transition):
    """Length m of the flat plate at the last speed on which a layer is as thick as after `way` (k,) m at `speed` (k,)
    m/s, from rest where the way is 0.
    """
    x, u = np.concatenate([[0.0], way]), np.concatenate([[0.0], speed]) / speed[-1]
    power = 3 if transition == "turbulent" else 5
    effective = float(np.trapezoid(u**power, x))
    if transition != "peak":
        return effective
    return AFTER_LAMINAR * (viscosity / (speed[-1] * x[-1])) ** 0.375 * (effective / x[-1]) ** 0.625 * float(x[-1])


def _first_above_one(way, factor, start):
    """Where `factor` first reaches one, between its points; infinite where it does not."""
    above = np.flatnonzero(factor >= 1.0)
    if not len(above):
        return np.inf
    i = int(above[0])
    if i == 0:
        return float(0.5 * (start + way[0])) if factor[0] > 1.0 else float(way[0])
    share = (1.0 - factor[i - 1]) / (factor[i] - factor[i - 1])
    return float(way[i - 1] + share * (way[i] - way[i - 1]))
