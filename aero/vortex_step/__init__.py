"""The vortex-step method: lifting-line strips with section polars on a deformed wing."""

from .circulation import Circulation
from .model import VortexStepModel
from .polars import StripPolars
from .sensitivity import WingSensitivity
from .strips import Strips, strips_between
from .surface_loads import SurfaceGrid
from .wing import VortexStep, WingLoads

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
