"""Coefficients of forces in wind axes: along the wind, across it upwards, and to the side."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Coefficients:
    """Lift, drag and side force coefficients `CL`, `CD`, `CS`."""

    CL: float
    CD: float
    CS: float


def lift_direction(direction):
    """Unit vector (3,) across the wind `direction` (3,) and the span (y): where lift is positive."""
    across = np.cross(direction, [0.0, 1.0, 0.0])
    return across / np.linalg.norm(across)


def coefficients(force, direction, pressure_area):
    """Coefficients of a `force` (3,) N in the wind `direction` (3,), over `pressure_area` = rho U^2 S / 2 in N."""
    across = lift_direction(direction)
    side = np.cross(across, direction)
    return Coefficients(*(float(force @ d / pressure_area) for d in (across, direction, side)))


def glide_ratio(force, direction):
    """Lift over drag of a `force` (3,) N; 0 without drag."""
    drag = force @ direction
    return (force @ lift_direction(direction)) / drag if drag != 0.0 else 0.0
