"""Names of modules in releases up to 0.1, which scripts may still import; they go with the next release."""

import sys
import warnings
from importlib import import_module
from types import ModuleType
from typing import Any

# Module of `master` -> where its content is now, by name where that is not one module.
MOVED: dict[str, str | dict[str, str]] = {
    "acceleration": "master.coupling.acceleration",
    "checkpoint": "master.coupling.checkpoint",
    "comparison": "master.studies",
    "exchange": "master.coupling.exchange",
    "fixed_point": "master.coupling.fixed_point",
    "foreign": "master.fmu_coupling",
    "march": "master.coupling.march",
    "participants": "master.coupling.participants",
    "run": {"Run": "master.coupling.run", "coupled_run": "master.coupling.run", "summary": "master.report"},
    "schemes": "master.coupling.schemes",
    "spectrum": "master.coupling.spectrum",
    "stability": "master.coupling.stability",
    "steady": "master.coupling.steady",
    "still_air": "master.coupling.participants.zero_loads",
}


class _Moved(ModuleType):
    """A module under its former name: it hands on what the present one has, and warns of the move."""

    def __getattr__(self, name: str) -> Any:
        former = self.__name__.rpartition(".")[2]
        to = MOVED[former]
        place = to if isinstance(to, str) else to.get(name)
        if place is None or name.startswith("__"):
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        value = getattr(import_module(place), name)
        warnings.warn(f"{self.__name__} has moved: take {name} from {place}.", DeprecationWarning, stacklevel=2)
        return value


def module(name: str) -> ModuleType:
    """The module of a former name."""
    return sys.modules[f"master.{name}"]


def install() -> None:
    """Let `import master.NAME` find the modules of former names; nothing is loaded before they are used."""
    for name in MOVED:
        sys.modules.setdefault(f"master.{name}", _Moved(f"master.{name}"))
