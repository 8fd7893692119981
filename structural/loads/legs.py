"""Loads on straight legs between two nodes: a given load per length, or the drag of the wind that they stand in."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from interface.line_drag import FRICTION, NORMAL_DRAG, line_drag, line_force_and_slopes, require_law

from .contract import Load, LoadGroup


@dataclass(frozen=True, eq=False)
class LineLoad(Load):
    """`per_length` (k,3) N/m on `Lines`, per current length, in fixed directions."""

    per_length: np.ndarray


@dataclass(frozen=True, eq=False)
class Lines(LoadGroup):
    """Legs `nodes` (k,2) that carry a `LineLoad`."""

    takes = LineLoad

    def forces(self, points, load, velocities=None):
        """See LoadGroup."""
        return line_load_forces(points, load.per_length)

    def forces_and_tangents(self, points, load, velocities=None):
        """See LoadGroup."""
        return *line_load_forces_and_tangents(points, load.per_length), None


@dataclass(frozen=True, eq=False)
class Wind(Load):
    """Uniform wind on `Legs`: `velocity` (3,) m/s, `density` kg/m^3, drag coefficients and `law` of `line_drag`."""

    velocity: np.ndarray
    density: float = 1.225
    normal_drag: float = NORMAL_DRAG
    friction: float = FRICTION
    law: Literal["inclined", "projected"] = "inclined"

    uniform = ("velocity",)

    def __post_init__(self):
        require_law(self.law)


@dataclass(frozen=True, eq=False)
class Legs(LoadGroup):
    """Legs `nodes` (k,2) of `diameter` (k,) m that stand in a `Wind`, for structures that carry their own air."""

    takes = Wind

    diameter: np.ndarray

    def forces(self, points, load, velocities=None):
        """See LoadGroup."""
        return drag_forces(points, self._speeds(points, velocities), self.diameter, load)

    def forces_and_tangents(self, points, load, velocities=None):
        """See LoadGroup. At rest the drag has no derivative by velocities that would count."""
        f, by_x, by_v = drag_forces_and_tangents(points, self._speeds(points, velocities), self.diameter, load)
        return f, by_x, None if velocities is None else by_v

    @staticmethod
    def _speeds(points, velocities):
        return np.zeros_like(points) if velocities is None else velocities


def line_load_forces(ends, load):
    """Forces N (k,2,3) at the `ends` (k,2,3) m of straight lines: half of load (k,3) N/m times current length each."""
    half = 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None] * load
    return np.stack([half, half], axis=1)


def line_load_forces_and_tangents(ends, load):
    """`line_load_forces`, and their derivative (k,6,6) N/m with respect to the ends: load (x) dl/dx / 2, l the length.

    A load keeps its direction and its size per length; a line without length has no derivative and gets zeros.
    """
    d = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(d, axis=1)[:, None]
    u = d / np.where(length > 0.0, length, 1.0)
    slope = np.concatenate([-u, u], axis=1)  # dl/dx
    half = 0.5 * length * load
    row = 0.5 * load[:, :, None] * slope[:, None, :]
    return np.stack([half, half], axis=1), np.concatenate([row, row], axis=1)


def drag_forces(ends, velocities, diameter, wind):
    """Wind forces N on the ends of legs (k,2,3): half of the drag of each leg, `line_drag` times its length.

    `ends` (k,2,3) m, `velocities` (k,2,3) m/s of the ends, `diameter` (k,) m. A leg meets the wind minus the mean
    velocity of its ends (PSM thesis eq. 4.5 and 4.6).
    """
    axis = ends[:, 1] - ends[:, 0]
    v = wind.velocity - 0.5 * (velocities[:, 0] + velocities[:, 1])
    law = wind.density, wind.normal_drag, wind.friction, wind.law
    half = 0.5 * np.linalg.norm(axis, axis=1)[:, None] * line_drag(axis, v, diameter, *law)
    return np.stack([half, half], axis=1)


def drag_forces_and_tangents(ends, velocities, diameter, wind):
    """`drag_forces`, and their derivatives (k,6,6) by positions N/m and by velocities N s/m."""
    k = len(ends)
    v = wind.velocity - 0.5 * (velocities[:, 0] + velocities[:, 1])
    law = wind.density, wind.normal_drag, wind.friction, wind.law
    force, by_axis, by_air = line_force_and_slopes(ends[:, 1] - ends[:, 0], v, diameter, *law)
    half = 0.5 * force
    by_ends = 0.5 * np.concatenate([-by_axis, by_axis], axis=2)
    by_speed = np.concatenate([-0.25 * by_air, -0.25 * by_air], axis=2)
    both = [np.concatenate([b, b], axis=1).reshape(k, 6, 6) for b in (by_ends, by_speed)]
    return np.stack([half, half], axis=1), *both
