"""The coupling schemes by name, with the parameters that each one takes: what command line and comparisons offer."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from master.acceleration import IQNILS, Aitken, ConstantRelaxation, Scheme

# First relaxation of IQN-ILS: the best factor for one eigenvalue lambda of the coupled map is 1 / (1 - lambda), 0.7 at
# lambda = -0.5 (the V3 kite at 12 m/s) and 0.15 at -6 (its design chord at 20 m/s); one in between serves both.
FIRST_RELAXATION = 0.35


@dataclass(frozen=True)
class Kind:
    """A kind of scheme: how to make one, its parameters with their defaults, and a line about it.

    `relaxation` names the parameter that is a factor of relaxation (of the first update, where the others follow), ""
    where there is none.
    """

    make: Callable[..., Scheme]
    parameters: Mapping[str, Any]
    relaxation: str
    description: str

    def __call__(self, **parameters: Any) -> Scheme:
        """A fresh scheme object with `parameters` in place of the defaults."""
        return self.make(**{**self.parameters, **parameters})


SCHEMES: dict[str, Kind] = {
    "explicit": Kind(lambda: ConstantRelaxation(1.0), {}, "", "staggered exchange, x <- x~"),
    "relaxation": Kind(ConstantRelaxation, {"omega": 0.25}, "omega", "constant relaxation, x <- x + omega r"),
    "aitken": Kind(Aitken, {"omega": 0.5, "omega_max": 1.0}, "omega", "relaxation by the last two residuals"),
    "iqn-ils": Kind(
        IQNILS,
        {"omega0": FIRST_RELAXATION, "reuse": 10, "filter": 1e-8, "stale": 1e-4, "max_columns": 100},
        "omega0",
        "quasi-Newton with an inverse Jacobian from least squares",
    ),
}


def scheme(name: str, **parameters: Any) -> Scheme:
    """A fresh scheme object by name, with `parameters` in place of the defaults of its kind.

    ValueError in one sentence for a name that does not exist, a parameter that the kind does not have, and a value that
    it refuses.
    """
    kind = SCHEMES.get(name)
    if kind is None:
        raise ValueError(f"there is no scheme '{name}'; choose one of: {', '.join(SCHEMES)}.")
    unknown = sorted(parameters.keys() - kind.parameters.keys())
    if unknown:
        has = f"it has: {', '.join(kind.parameters)}" if kind.parameters else "it has none"
        raise ValueError(f"scheme {name} has no parameter '{unknown[0]}'; {has}.")
    return kind(**parameters)
