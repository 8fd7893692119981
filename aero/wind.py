"""The wind: gusts over time, how it changes from place to place, and coefficients of forces in its axes: along it,
across it upwards, and to the side.
"""

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


@dataclass(frozen=True, eq=False)
class LinearField:
    """A velocity of the air beside that of a uniform wind, linear in space: `offset` (3,) m/s at the point `at` (3,) m,
    and from there on the `gradient` (3,3) 1/s times the way.
    """

    at: np.ndarray
    offset: np.ndarray
    gradient: np.ndarray

    @classmethod
    def along_line(cls, wind, ground, top, share):
        """What makes the `wind` (3,) m/s at the point `top` grow from `share` of it at the point `ground`, (3,) m both,
        linearly along the line between them and alike across it: the apparent wind along a tether that turns about its
        ground station (ram-air thesis, section 4.3), with the share 0. ValueError where the points are one.
        """
        way = top - ground
        square = float(way @ way)
        if not square > 0.0:
            raise ValueError("ground_point and kite_point are one point, and a line needs two; move one of them.")
        return cls(np.array(top), np.zeros(3), (1.0 - share) * np.outer(wind, way) / square)

    @classmethod
    def rotation(cls, rate, centre):
        """What a body meets that turns as a rigid one at the angular velocity `rate` (3,) rad/s about the point
        `centre` (3,) m: -rate x (x - centre).
        """
        a, b, c = (float(w) for w in rate)
        return cls(np.array(centre), np.zeros(3), np.array([[0.0, c, -b], [-c, 0.0, a], [b, -a, 0.0]]))

    def __add__(self, other):
        """Both together."""
        return LinearField(self.at, self.offset + other.velocity(self.at), self.gradient + other.gradient)

    def velocity(self, points):
        """Velocity (...,3) m/s at points (...,3) m."""
        return self.offset + (points - self.at) @ self.gradient.T

    def inward(self, plane):
        """The field in the axes in which an `UprightPlane` is y = 0."""
        gradient = plane.inward(plane.inward(self.gradient).T).T
        return LinearField(plane.inward(self.at, point=True), plane.inward(self.offset), gradient)


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
