"""Coupling master: the coupling engine, FMUs of any maker, studies, reports and the command line.

The public names load with their modules when they are first used, so that the command line can answer without them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from master import moved

if TYPE_CHECKING:
    from master.coupling.acceleration import IQNILS, IQNIMVJ, Aitken, ConstantRelaxation
    from master.coupling.fixed_point import FixedPointResult, fixed_point
    from master.fmu_coupling import couple
    from master.studies import compare
    from master.studies.polar import polar

__all__ = [
    "IQNILS",
    "IQNIMVJ",
    "Aitken",
    "ConstantRelaxation",
    "FixedPointResult",
    "compare",
    "couple",
    "fixed_point",
    "polar",
]

_MODULES = {
    "compare": "studies",
    "couple": "fmu_coupling",
    "FixedPointResult": "coupling.fixed_point",
    "fixed_point": "coupling.fixed_point",
    "polar": "studies.polar",
}

moved.install()


def __getattr__(name: str) -> Any:
    if name in __all__:
        module = import_module(f"{__name__}.{_MODULES.get(name, 'coupling.acceleration')}")
        value = globals()[name] = getattr(module, name)
        return value
    if name in moved.MOVED:
        return moved.module(name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
