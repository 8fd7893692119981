"""Methods for the flow around a wing, a file each: what [aero] method in scene.toml may name, with - for _. Files whose
name begins with _ are none.

A file gives `wing_loads(options)`, the names of the interface loads (`aero.model.LOADS`) that its model sends, and
`wing_model(wing)`, the model of a `Wing`. The first loads nothing of the model, so that a structure can ask. Where
[aero] has more to say of the method than all of them have, OPTIONS names these keys (`aero.model.Option`). OF_BODIES is
true where its wings are closed bodies, those of [body] in scene.toml; without it they are the sheets of [wing].
"""

import pkgutil
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from aero.model import AeroModel, Option, Wing


def methods() -> tuple[str, ...]:
    """The names of the methods that there are."""
    names = (module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_"))
    return tuple(sorted(name.replace("_", "-") for name in names))


def method_options(method: str) -> dict[str, Option]:
    """Keys of [aero] that a method has beside those of all."""
    return getattr(_module(method), "OPTIONS", {})


def of_bodies(method: str) -> bool:
    """Whether a method is for closed bodies, not for sheets."""
    return bool(getattr(_module(method), "OF_BODIES", False))


def wing_loads(method: str, options: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the interface loads that a method sends with these options of [aero]."""
    return tuple(_module(method).wing_loads(options))


def wing_model(method: str, wing: Wing) -> AeroModel:
    """The model of the flow around a wing by a method."""
    model: AeroModel = _module(method).wing_model(wing)
    return model


def _module(method: str) -> Any:
    return import_module(f"{__name__}.{method.replace('-', '_')}")
