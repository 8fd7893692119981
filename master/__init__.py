"""Coupling master: participants, the coupling loop, acceleration, convergence, report and command line.

The public names load with their modules when they are first used, so that the command line can answer without them.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from master.acceleration import IQNILS, IQNIMVJ, Aitken, ConstantRelaxation
    from master.comparison import compare
    from master.fixed_point import FixedPointResult, fixed_point
    from master.foreign import couple

__all__ = ["IQNILS", "IQNIMVJ", "Aitken", "ConstantRelaxation", "FixedPointResult", "compare", "couple", "fixed_point"]

_MODULES = {
    "compare": "comparison",
    "couple": "foreign",
    "FixedPointResult": "fixed_point",
    "fixed_point": "fixed_point",
}


class _Package(ModuleType):
    """A package in which a public name goes before the module of the same name, whichever is loaded first."""

    def __setattr__(self, name: str, value: Any) -> None:
        own = name in __all__ and isinstance(value, ModuleType)  # set by the import system after loading a module
        super().__setattr__(name, getattr(value, name) if own else value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_MODULES.get(name, 'acceleration')}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
