"""scene.toml: the table of contents of a scene, checked against what is known before anything is built."""

import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from aero.methods import method_options, methods
from aero.model import Option
from interface.line_drag import FRICTION, NORMAL_DRAG

from .scene_settings import INTEGRATION, options, setting, variant
from .tables import SceneError


class _Wrong(ValueError):
    """What a value should have been."""


def _file(value: Any) -> str:
    if not isinstance(value, str) or not value.isprintable() or Path(value).name != value:
        raise _Wrong("the name of a file in the scene's folder")
    return value


def _label(value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise _Wrong("the name of a node")
    return str(value)


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise _Wrong("true or false")
    return value


def _number(low: float = -math.inf, above: float = -math.inf, high: float = math.inf) -> Callable[[Any], float]:
    meaning = "a finite number"
    if high < math.inf:
        meaning = f"a number from {low:g} to {high:g}"
    elif above > -math.inf:
        meaning = f"a finite number above {above:g}"
    elif low > -math.inf:
        meaning = f"a finite number, {low:g} or more"

    def check(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise _Wrong(meaning)
        try:
            number = float(value)
        except OverflowError:
            raise _Wrong(meaning) from None
        if not math.isfinite(number) or not low <= number <= high or number <= above:
            raise _Wrong(meaning)
        return number

    return check


def _choice(*choices: str) -> Callable[[Any], str]:
    def check(value: Any) -> str:
        if not isinstance(value, str) or value not in choices:
            raise _Wrong("one of: " + ", ".join(choices))
        return value

    return check


def _method(value: Any) -> str:
    return _choice(*methods())(value)


def _direction(value: Any) -> list[float]:
    meaning = "three finite numbers that are not all zero"
    if not isinstance(value, list) or len(value) != 3:
        raise _Wrong(meaning)
    try:
        numbers = [_number()(v) for v in value]
    except _Wrong:
        raise _Wrong(meaning) from None
    if not any(numbers):
        raise _Wrong(meaning)
    return numbers


def _tapes(value: Any) -> dict[str, list[str]]:
    meaning = "a table of parameter names, each with a list of line names"
    if not isinstance(value, dict):
        raise _Wrong(meaning)
    for name, lines in value.items():
        if not name.isidentifier() or not isinstance(lines, list) or not lines:
            raise _Wrong(f"{meaning} ({name} has none)")
        if not all(isinstance(line, str) for line in lines):
            raise _Wrong(meaning)
    return value


def _values(value: Any) -> dict[str, float]:
    if not isinstance(value, dict):
        raise _Wrong("a table of names, each with a number")
    try:
        return {name: _number()(v) for name, v in value.items()}
    except _Wrong:
        raise _Wrong("a table of names, each with a finite number") from None


# Section -> key -> (check, default); a default of `...` means that the key must be given.
_KNOWN: dict[str, dict[str, tuple[Callable[[Any], Any], Any]]] = {
    "structure": {
        "nodes": (_file, ...),
        "springs": (_file, None),
        "canopy": (_file, None),
        "lines": (_file, None),
        "masses": (_file, None),
        "line_modulus": (_number(above=0.0), None),
        "line_density": (_number(low=0.0), 0.0),
        "gravity": (_number(), 9.81),
        "symmetric": (_flag, False),
        "pivot": (_label, None),
        "hold": (_label, None),
        "ribs": (_file, None),
        "tubes": (_file, None),
        "attachments": (_file, None),
        "tube_pressure": (_number(), None),
        "tube_stiffness": (_number(above=0.0), None),
        "tube_shear_stiffness": (_number(above=0.0), None),
        "wing_mass": (_number(low=0.0), None),
        "canopy_bending_stiffness": (_number(above=0.0), None),
        "canopy_stiffness": (_number(above=0.0), None),
        "canopy_shear_stiffness": (_number(above=0.0), None),
        "canopy_density": (_number(low=0.0), 0.0),
        "loads": (_file, None),
        "load_values": (_values, {}),
        "tapes": (_tapes, {}),
        "reels": (_tapes, {}),
    },
    "wing": {"struts": (_file, None), "sections": (_file, ...), "polars": (_file, ...)},
    "aero": {
        "method": (_method, "vortex-step"),
        "wind_speed": (_number(above=0.0), ...),
        "wind_direction": (_direction, [1.0, 0.0, 0.0]),
        "air_density": (_number(above=0.0), 1.225),
        "reference_area": (_number(above=0.0), None),
        "line_normal_drag": (_number(low=0.0), NORMAL_DRAG),
        "line_friction": (_number(low=0.0), FRICTION),
    },
    "trim": {"lowest_deg": (_number(), -5.0), "highest_deg": (_number(), 25.0)},
    "dynamics": {
        "scheme": (_choice(*INTEGRATION), "generalised-alpha"),
        "spectral_radius": (_number(low=0.0, high=1.0), 0.0),
        "longest_step": (_number(above=0.0), 0.01),
        "communication_step": (_number(above=0.0), 0.02),
        "stop_time": (_number(above=0.0), 10.0),
        "line_damping_time": (_number(low=0.0), 0.0),
        "spring_damping_time": (_number(low=0.0), 0.0),
        "start_in_equilibrium": (_flag, False),
        "gust_speed": (_number(), 0.0),
        "gust_start": (_number(low=0.0), 0.0),
        "gust_duration": (_number(above=0.0), 5.0),
        "gust_interval": (_number(low=0.0), 0.0),
    },
}
# Sections that a scene may do without.
_OPTIONAL = ("wing", "aero", "trim", "dynamics")


def known_keys(section: str, method: Any = None) -> dict[str, tuple[Callable[[Any], Any], Any]]:
    """Key -> (check, default) of a section; [aero] has those of its method too, of every method where it names none."""
    keys = dict(_KNOWN[section])
    if section == "aero":
        method = keys["method"][1] if method is None else method
        for name in methods() if method not in methods() else (method,):
            keys |= {key: (_checked_option(option), option.default) for key, option in method_options(name).items()}
    return keys


def _checked_option(option: Option) -> Callable[[Any], Any]:
    if isinstance(option.default, bool):
        return _flag
    return _choice(*option.choices) if option.choices else _number(low=option.minimum, high=option.maximum)


def read_description(folder: Path, settings: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The checked content of scene.toml with the chosen variant merged in, and all settings with their values.

    Raises `SceneError` in one sentence for whatever is missing, unknown, or not what it should be.
    """
    label = f"{folder.name}/scene.toml"
    content = _parsed(folder / "scene.toml", label)
    offered = options(label, content.get("settings", {}))
    chosen = {key: option["default"] for key, option in offered.items()}
    for key, value in settings.items():
        if key not in offered:
            known = ", ".join(sorted(offered)) or "none"
            raise SceneError(f"scene '{folder.name}' has no setting '{key}'; its settings are: {known}.")
        chosen[key] = setting(f"setting {key} of scene '{folder.name}'", value, offered[key])
    unknown = set(content) - set(_KNOWN) - {"title", "description", "settings", "variants"}
    if unknown:
        raise SceneError(f"{label} has an unknown section [{sorted(unknown)[0]}]; known are: {', '.join(_KNOWN)}.")
    changes = variant(label, content.get("variants", {}), chosen.get("variant"), _KNOWN)
    checked: dict[str, Any] = {"settings": offered}
    for key, default in (("title", folder.name), ("description", "")):
        checked[key] = str(content.get(key, default))
    absent = {section for section in _OPTIONAL if section not in content and section not in changes}
    lacks = next((n for n, o in (("aero", "wing"), ("wing", "trim")) if n in absent and o not in absent), None)
    if lacks:
        raise SceneError(
            f"{label} lacks a section [{lacks}]; add it ([trim] needs [wing], [wing] needs [aero]; a scene without a "
            "wing has a flow around its lines, or none)."
        )
    for section in _KNOWN:
        given = content.get(section, {})
        if section in absent:
            checked[section] = None
            continue
        if not isinstance(given, dict):
            raise SceneError(f"{label}: [{section}] must be a table; write its keys below a line [{section}].")
        merged = {**given, **changes.get(section, {})}
        checked[section] = _section(label, section, merged, known_keys(section, merged.get("method")))
    soft = [k for k in ("springs", "canopy", "tubes") if checked["structure"][k] is not None]
    if checked["aero"] is not None and checked["wing"] is None and soft:
        raise SceneError(
            f"{label} lacks a section [wing], whose flow [aero] is to describe; add it, or drop [aero] (only lines "
            f"have a flow without it, and [structure] has {soft[0]})."
        )
    if checked["trim"] and checked["trim"]["lowest_deg"] >= checked["trim"]["highest_deg"]:
        raise SceneError(f"{label}: [trim] highest_deg must be above lowest_deg; correct one of them.")
    return checked, chosen


def _parsed(path: Path, label: str) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise SceneError(f"{label} does not exist; a scene is a folder with a scene.toml.") from None
    except (ValueError, OSError, RecursionError) as error:  # TOML and Unicode errors are ValueErrors
        reason = " ".join(str(error).split())[:200]
        raise SceneError(f"{label} is not valid TOML ({reason}); mend that line.") from None


def _section(
    label: str, section: str, given: dict[str, Any], known: dict[str, tuple[Callable[[Any], Any], Any]]
) -> dict[str, Any]:
    unknown = sorted(set(given) - set(known))
    if unknown:
        raise SceneError(f"{label}: [{section}] has an unknown key '{unknown[0]}'; known are: {', '.join(known)}.")
    out = {}
    for key, (check, default) in known.items():
        if key not in given:
            if default is ...:
                raise SceneError(f"{label}: [{section}] lacks '{key}'; add it.")
            out[key] = default
            continue
        try:
            out[key] = check(given[key])
        except _Wrong as wanted:
            shown = str(given[key])[:40]
            raise SceneError(f"{label}: [{section}] {key} must be {wanted}; it is {shown!r}.") from None
    return out
