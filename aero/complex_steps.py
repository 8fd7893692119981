"""Derivatives of analytic functions by a complex step: f(x + i h v) has h times the derivative along v as its imaginary
part; the error is of order h^2, and nothing is subtracted (Squire and Trapp 1998).
"""

import numpy as np

# h for directions whose largest entry is scaled to one: h^2 is far below rounding, h^4 far above the smallest number.
STEP = 1e-40


def moved(points, direction):
    """Points moved along the imaginary axis by the direction times STEP over its largest entry, and that entry."""
    size = float(np.abs(direction).max(initial=0.0)) or 1.0
    return points + 1j * (STEP * (direction / size)), size
