"""Aerodynamic solver: vortex-step method with section polars on deformed wings."""

from .circulation import Circulation
from .polars import StripPolars
from .strips import Strips, strips_between
from .surface_loads import SurfaceGrid
from .vortex_step import VortexStep, WingLoads

__all__ = ["Circulation", "StripPolars", "Strips", "SurfaceGrid", "VortexStep", "WingLoads", "strips_between"]
