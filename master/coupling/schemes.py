"""The coupling schemes by name, with the parameters that each one takes: what command line and comparisons offer."""

import pkgutil
from importlib import import_module
from typing import Any

from master.coupling import acceleration
from master.coupling.acceleration import Scheme
from master.coupling.acceleration.scheme import Kind
from master.coupling.exchange import Exchange, Order

# In the parallel order a relaxed displacement is at odds with the loads, which answer another one; the explicit first
# update takes a third fewer iterations on the V3 kite.
FIRST_PARALLEL = 1.0


def kinds() -> dict[str, Kind]:
    """Name -> kind of every scheme that a module of `master.coupling.acceleration` offers (its KINDS)."""
    found: dict[str, Kind] = {}
    for module in pkgutil.iter_modules(acceleration.__path__):  # those without KINDS help the others
        found |= getattr(import_module(f"{acceleration.__name__}.{module.name}"), "KINDS", {})
    return dict(sorted(found.items(), key=lambda item: (item[1].place, item[0])))


SCHEMES = kinds()


def scheme(name: str, exchange: Exchange | None = None, order: Order = "serial", **parameters: Any) -> Scheme:
    """A new scheme object by name, with `parameters` in place of the defaults of its kind.

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
    parameters = {**defaults(name, order, exchange), **parameters}
    if not kind.exact:
        return kind(**parameters)
    if exchange is None:
        raise ValueError(f"scheme {name} needs the participants, whose directional derivatives it takes.")
    exchange.require_derivatives()
    return kind(product=lambda v: exchange.derivative(v, order), **parameters)


def defaults(name: str, order: Order = "serial", exchange: Exchange | None = None) -> dict[str, Any]:
    """The default parameters of a scheme that exists, in an order of exchange, for what `exchange` couples if known."""
    found = dict(SCHEMES[name].parameters)
    if "omega0" not in found:
        return found
    if order == "parallel":
        return found | {"omega0": FIRST_PARALLEL}
    return found | getattr(exchange, "first_updates", {})
