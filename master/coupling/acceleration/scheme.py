"""What the coupling loop asks of an acceleration scheme.

Notation of all schemes: x_tilde = G(x), r = x_tilde - x.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, is_dataclass
from dataclasses import fields as dataclass_fields
from typing import Any, Protocol

import numpy as np

Field = slice | np.ndarray


class Scheme(Protocol):
    """An update rule. `fixed_point` needs `begin`, `step` and `end`; it uses the rest where a scheme has it."""

    @property
    def record(self) -> dict[str, float]:
        """What the last update used: "omega" of relaxations, "columns" and "filtered" of quasi-Newton schemes."""

    def begin(self, fields: Sequence[Field]) -> None:
        """Before the first evaluation of a call: history of earlier calls stays, the call's own starts empty."""

    def step(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """The next x. Usable without `begin` and `end`; all entries then count as one field."""

    def end(self, status: str, x: np.ndarray, r: np.ndarray) -> None:
        """After the last evaluation, with the pair that was tested but never went through `step`."""

    def restart(self) -> bool:
        """Forget what led astray and continue more carefully; False where the scheme knows no more careful way."""


@dataclass(frozen=True)
class Kind:
    """A kind of scheme by name: how to make one, its parameters with their defaults, and a line about it.

    `relaxation` names the parameter that is a factor of relaxation (of the first update, where the others follow), ""
    where there is none; `exact` kinds need the product G' v of the coupled map. `place` is that in lists.

    A module of this package that has a dict KINDS, name -> Kind, is found by `master.coupling.schemes`.
    """

    make: Callable[..., Scheme]
    parameters: Mapping[str, Any]
    relaxation: str
    description: str
    exact: bool = False
    place: float = 100.0

    def __call__(self, **parameters: Any) -> Scheme:
        """A new scheme object with `parameters` in place of the defaults."""
        return self.make(**{**self.parameters, **parameters})


def adopt(scheme: Any, earlier: Any) -> bool:
    """Let a scheme take over the history of an earlier one of its kind, keeping its own settings; False if the kinds
    differ. What follows from the settings is theirs from the next call on.
    """
    if type(scheme) is not type(earlier) or not is_dataclass(scheme):
        return False
    for entry in dataclass_fields(scheme):
        if not entry.init:
            setattr(scheme, entry.name, deepcopy(getattr(earlier, entry.name)))
    return True


def unit(a: np.ndarray, axis: int | None = None) -> Any:
    """Power of two near max |a|, 1 where that is zero or not finite: a / unit is exact, and its squares neither
    overflow nor underflow. With `axis` one for each of the others.
    """
    largest = np.max(np.abs(a), axis=axis, initial=0.0)
    return np.ldexp(1.0, np.where(np.isfinite(largest), np.minimum(np.frexp(largest)[1], 1023), 0))


def require_factor(name: str, value: float) -> None:
    """ValueError if a factor of relaxation is zero or not finite."""
    if not (math.isfinite(value) and value != 0.0):
        raise ValueError(f"{name} must be finite and not zero, got {value}.")


def require_fraction(name: str, value: float) -> None:
    """ValueError if a limit is not in [0, 1)."""
    if not (math.isfinite(value) and 0.0 <= value < 1.0):
        raise ValueError(f"{name} must be in [0, 1), got {value}.")


def require_count(name: str, value: Any, least: int) -> None:
    """ValueError if a count is not a whole number of at least `least`."""
    if isinstance(value, bool) or not (isinstance(value, int | np.integer) and value >= least):
        raise ValueError(f"{name} must be a whole number >= {least}, got {value}.")
