"""Views of a kite: parallel projections in the axes of its wind, so that a kite looks alike in any wind.

Wind axes are right-handed: along the wind over the ground, across it to the right wing (of a kite that faces the wind),
and up. With the wind along x they are x, y, z.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

GLOBAL = ("x, m", "y, m", "z, m")
OF_WIND = ("along the wind, m", "across the wind, m", "z, m")


@dataclass(frozen=True)
class View:
    """A view in which axis `h` runs to the right of the picture, or to its left where `leftward`, and axis `v` up; its
    `title` in a wind, and `still` without one.
    """

    title: str
    still: str
    h: int
    v: int
    leftward: bool = False

    @property
    def at(self) -> list[int]:
        """Columns of points (n,3) that the picture shows, horizontal one first."""
        return [self.h, self.v]

    @property
    def viewer(self) -> np.ndarray:
        """Unit vector (3,) to who looks: right x up."""
        right = np.eye(3)[self.h] * (-1.0 if self.leftward else 1.0)
        return np.cross(right, np.eye(3)[self.v])


# Who stands upwind and looks downwind has the right wing (y > 0) on the left; the top view keeps that.
FROM_UPWIND = View("front view, from upwind", "front view, along x", 1, 2, leftward=True)
FROM_LEFT = View("side view, from the left", "side view, from the left", 0, 2)
FROM_RIGHT = View("side view, from the right", "side view, from the right", 0, 2, leftward=True)
FROM_ABOVE = View("top view, from above", "plan view, against z", 1, 0, leftward=True)


def wind_axes(direction: np.ndarray | None) -> np.ndarray:
    """Wind axes as rows (3,3) of unit vectors in the global frame, of a wind that blows to `direction` (3,).

    The global ones without a wind, and for one that is upright.
    """
    if direction is None:
        return np.eye(3)
    x, y = np.asarray(direction, float)[:2]
    size = np.hypot(x, y)
    if not size > 1e-9 * np.abs(direction).max():
        return np.eye(3)
    c, s = x / size, y / size
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def axis_labels(axes: np.ndarray) -> tuple[str, str, str]:
    """Labels of the axes of a picture: the global names as long as the wind blows along x."""
    return GLOBAL if np.array_equal(axes, np.eye(3)) else OF_WIND


def wind_of(aero: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Velocity (3,) m/s of the wind in the blocks of a flow, with the gust of the moment; None without a wind."""
    if not {"wind_speed", "wind_direction"} <= aero.keys():
        return None
    speed = float(aero.get("present_wind_speed", aero["wind_speed"]))
    return np.asarray(speed * aero["wind_direction"] / np.linalg.norm(aero["wind_direction"]))


def wind_at(aero: Mapping[str, np.ndarray], points: np.ndarray) -> np.ndarray | None:
    """Velocity (n,3) m/s of the undisturbed air at points (n,3) m, from the blocks of a flow; None without a wind."""
    if "wind_gradient" in aero:
        return np.asarray(aero["wind_at_origin"] + points @ aero["wind_gradient"].T)
    wind = wind_of(aero)
    return None if wind is None else np.broadcast_to(wind, points.shape)
