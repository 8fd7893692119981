"""The coupling engine: participants, exchange, acceleration, and the steady and the transient driver.

The public names load with their modules when they are first used: a fixed point needs nothing of FMUs.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from interface import StepFailed
    from master.coupling.equilibrium import CoupledResult, Coupling, solve
    from master.coupling.exchange import Connection, CoupledStepFailed, Exchange
    from master.coupling.participants import FmuParticipant, InProcessParticipant, Participant
    from master.coupling.run import Run, coupled_run
    from master.coupling.schemes import SCHEMES, scheme
    from master.coupling.simulation import Simulation, simulate
    from master.coupling.stability import static_stability
    from master.coupling.start import with_start
    from master.coupling.validity import Judgement, judgements

__all__ = [
    "SCHEMES",
    "Connection",
    "CoupledResult",
    "CoupledStepFailed",
    "Coupling",
    "Exchange",
    "FmuParticipant",
    "InProcessParticipant",
    "Judgement",
    "Participant",
    "Run",
    "Simulation",
    "StepFailed",
    "coupled_run",
    "judgements",
    "scheme",
    "simulate",
    "solve",
    "static_stability",
    "with_start",
]

_MODULES = {
    "equilibrium": ("CoupledResult", "Coupling", "solve"),
    "exchange": ("Connection", "CoupledStepFailed", "Exchange", "StepFailed"),
    "participants": ("FmuParticipant", "InProcessParticipant", "Participant"),
    "run": ("Run", "coupled_run"),
    "schemes": ("SCHEMES", "scheme"),
    "simulation": ("Simulation", "simulate"),
    "stability": ("static_stability",),
    "start": ("with_start",),
    "validity": ("Judgement", "judgements"),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
