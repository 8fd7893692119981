"""Aerodynamic solver: vortex-step method with section polars on deformed wings, drag of lines.

The public names load with their modules when they are first used: lines alone load no vortices.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

_MODULES = {
    "Circulation": "circulation",
    "StripPolars": "polars",
    "Strips": "strips",
    "SurfaceGrid": "surface_loads",
    "VortexStep": "vortex_step",
    "WingLoads": "vortex_step",
    "WingSensitivity": "sensitivity",
    "line_loads": "line_drag",
    "line_loads_derivative": "sensitivity",
    "strips_between": "strips",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
