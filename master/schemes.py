"""The coupling schemes by name, with the parameters that each one takes: what command line and comparisons offer."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from master.acceleration import IQNILS, IQNIMVJ, Aitken, ConstantRelaxation, NewtonKrylov, Scheme
from master.exchange import Exchange, Order

# In the parallel order a relaxed displacement is at odds with the loads, which answer another one; the explicit first
# update takes a third fewer iterations on the V3 kite.
FIRST_PARALLEL = 1.0


@dataclass(frozen=True)
class Kind:
    """A kind of scheme: how to make one, its parameters with their defaults, and a line about it.

    `relaxation` names the parameter that is a factor of relaxation (of the first update, where the others follow), ""
    where there is none; `exact` kinds need the product G' v of the coupled map.
    """

    make: Callable[..., Scheme]
    parameters: Mapping[str, Any]
    relaxation: str
    description: str
    exact: bool = False

    def __call__(self, **parameters: Any) -> Scheme:
        """A fresh scheme object with `parameters` in place of the defaults."""
        return self.make(**{**self.parameters, **parameters})


SCHEMES: dict[str, Kind] = {
    "explicit": Kind(lambda: ConstantRelaxation(1.0), {}, "", "staggered exchange, x <- x~"),
    "relaxation": Kind(ConstantRelaxation, {"omega": 0.25}, "omega", "constant relaxation, x <- x + omega r"),
    "aitken": Kind(Aitken, {"omega": 0.5, "omega_max": 1.0}, "omega", "relaxation by the last two residuals"),
    "iqn-ils": Kind(
        IQNILS,
        {"omega0": IQNILS.omega0, "reuse": 10, "filter": 1e-8, "curved": 0.03, "stale": 1e-4, "max_columns": 100},
        "omega0",
        "quasi-Newton with an inverse Jacobian from least squares",
    ),
    "iqn-imvj": Kind(
        IQNIMVJ,
        {"omega0": IQNILS.omega0, "filter": 1e-8, "curved": 0.03, "max_columns": 200},
        "omega0",
        "quasi-Newton that corrects the inverse Jacobian of the step before",
    ),
    "newton-krylov": Kind(
        NewtonKrylov,
        {"eta": 0.01, "directions": 60},
        "",
        "Newton with directional derivatives, solvers in-process only",
        exact=True,
    ),
}


def scheme(name: str, exchange: Exchange | None = None, order: Order = "serial", **parameters: Any) -> Scheme:
    """A fresh scheme object by name, with `parameters` in place of the defaults of its kind.

    Newton-Krylov takes its products from `exchange`; in `order` "parallel" quasi-Newton schemes begin with an explicit
    update unless told otherwise. ValueError in one sentence for a name that does not exist, a parameter that the kind
    does not have, a value that it refuses, and participants without directional derivatives.
    """
    kind = SCHEMES.get(name)
    if kind is None:
        raise ValueError(f"there is no scheme '{name}'; choose one of: {', '.join(SCHEMES)}.")
    unknown = sorted(parameters.keys() - kind.parameters.keys())
    if unknown:
        has = f"it has: {', '.join(kind.parameters)}" if kind.parameters else "it has none"
        raise ValueError(f"scheme {name} has no parameter '{unknown[0]}'; {has}.")
    parameters = {**defaults(name, order), **parameters}
    if not kind.exact:
        return kind(**parameters)
    if exchange is None:
        raise ValueError(f"scheme {name} needs the participants, whose directional derivatives it takes.")
    exchange.require_derivatives()
    return kind(product=lambda v: exchange.derivative(v, order), **parameters)


def defaults(name: str, order: Order = "serial") -> dict[str, Any]:
    """The default parameters of a scheme that exists, in an order of exchange."""
    found = dict(SCHEMES[name].parameters)
    return found | ({"omega0": FIRST_PARALLEL} if order == "parallel" and "omega0" in found else {})
