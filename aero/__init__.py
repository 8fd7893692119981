"""Aerodynamic solver: vortex-step method with section polars on deformed wings, drag of lines."""

from .circulation import Circulation
from .line_drag import line_loads
from .polars import StripPolars
from .sensitivity import WingSensitivity, line_loads_derivative
from .strips import Strips, strips_between
from .surface_loads import SurfaceGrid
from .vortex_step import VortexStep, WingLoads

__all__ = [
    "Circulation",
    "StripPolars",
    "Strips",
    "SurfaceGrid",
    "VortexStep",
    "WingLoads",
    "WingSensitivity",
    "line_loads",
    "line_loads_derivative",
    "strips_between",
]
