"""The vortex-step method: lifting-line strips with section polars on a deformed wing."""

from aero.polars import StripPolars

from .circulation import Circulation
from .model import VortexStepModel
from .strips import Strips, strips_between
from .surface_loads import SurfaceGrid
from .wing import VortexStep, WingLoads, WingSensitivity

__all__ = [
    "Circulation",
    "StripPolars",
    "Strips",
    "SurfaceGrid",
    "VortexStep",
    "VortexStepModel",
    "WingLoads",
    "WingSensitivity",
    "strips_between",
]
