"""The wind over time: a steady one and gusts on it."""

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
