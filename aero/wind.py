"""The wind: gusts over time, and coefficients of forces in its axes: along it, across it upwards, and to the side."""

from dataclasses import dataclass

import numpy as np

from interface import StepFailed


@dataclass(frozen=True)
class Gusts:
    """Gusts of `height` m/s, height (1 - cos(2 pi t / duration)) / 2 with t s since the beginning of each: the first at
    `start` s, then one every `interval` s (0: one only).
    """

    height: float
    start: float
    duration: float
    interval: float

    def speed(self, steady: float, t: float) -> float:
        """Wind speed m/s at time t s on a `steady` one."""
        since = t - self.start
        if self.height == 0.0 or since <= 0.0:
            return steady
        if self.interval > 0.0:
            since = since % self.interval
        if since >= self.duration:
            return steady
        return steady + 0.5 * self.height * (1.0 - np.cos(2.0 * np.pi * since / self.duration))

    def checked_speed(self, steady: float, t: float) -> float:
        """`speed`; StepFailed in one sentence for gusts that overlap, and where there would be no wind."""
        if 0.0 < self.interval < self.duration:
            raise StepFailed(
                f"a gust of {self.duration:g} s is not over when the next begins after {self.interval:g} s; make "
                "gust_interval longer or gust_duration shorter."
            )
        speed = self.speed(steady, t)
        if not speed > 0.0:
            raise StepFailed(
                f"the wind speed would be {speed:.3g} m/s at {t:.6g} s; gust_speed must be above -wind_speed."
            )
        return speed


@dataclass(frozen=True)
class Coefficients:
    """Lift, drag and side force coefficients `CL`, `CD`, `CS`."""

    CL: float
    CD: float
    CS: float


def lift_direction(direction):
    """Unit vector (3,) across the wind `direction` (3,), in the upright plane through it: where lift is positive. In an
    upright wind it is across y too.
    """
    up = np.array([0.0, 0.0, 1.0])
    across = up - (up @ direction) * direction / (direction @ direction)
    length = np.linalg.norm(across)
    if length <= 1e-9:
        across = np.cross(direction, [0.0, 1.0, 0.0])
        length = np.linalg.norm(across)
    return across / length


def coefficients(force, direction, pressure_area):
    """Coefficients of a `force` (3,) N in the wind `direction` (3,), over `pressure_area` = rho U^2 S / 2 in N."""
    across = lift_direction(direction)
    side = np.cross(across, direction)
    return Coefficients(*(float(force @ d / pressure_area) for d in (across, direction, side)))


def glide_ratio(force, direction):
    """Lift over drag of a `force` (3,) N; 0 without drag."""
    drag = force @ direction
    return (force @ lift_direction(direction)) / drag if drag != 0.0 else 0.0
