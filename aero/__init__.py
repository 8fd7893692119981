"""Aerodynamic solver: models of the flow around an interface mesh, their loads, and what is made of them.

`aero.vortex_step` is the vortex-step method for wings of strips; it loads only where there is a wing.
"""

from .line_drag import LinesInWind, line_loads, line_loads_derivative
from .model import AeroModel, Flow, Response, StripLayout, Wing
from .wind import Coefficients, Gusts, LinearField, coefficients, glide_ratio

__all__ = [
    "AeroModel",
    "Coefficients",
    "Flow",
    "Gusts",
    "LinearField",
    "LinesInWind",
    "Response",
    "StripLayout",
    "Wing",
    "coefficients",
    "glide_ratio",
    "line_loads",
    "line_loads_derivative",
]
