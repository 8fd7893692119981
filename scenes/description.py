"""scene.toml: the table of contents of a scene, checked against what is known before anything is built."""

import tomllib
from pathlib import Path
from typing import Any

from .tables import SceneError

# What each section may hold: key -> (types, default). A default of `...` means the key must be given.
_NUMBER = (int, float)
_KNOWN: dict[str, dict[str, tuple[Any, Any]]] = {
    "structure": {
        "nodes": (str, ...),
        "springs": (str, None),
        "canopy": (str, None),
        "lines": (str, None),
        "masses": (str, None),
        "line_modulus": (_NUMBER, 0.0),
        "line_density": (_NUMBER, 0.0),
        "gravity": (_NUMBER, 9.81),
        "symmetric": (bool, False),
        "pivot": ((str, int), None),
        "tapes": (dict, {}),
    },
    "wing": {"struts": (str, ...), "sections": (str, ...), "polars": (str, ...)},
    "aero": {
        "method": (str, "vortex-step"),
        "induction": (bool, True),
        "direction": (str, "bound"),
        "section_force": (str, "lift-drag"),
        "wind_speed": (_NUMBER, ...),
        "wind_direction": (list, [1.0, 0.0, 0.0]),
        "air_density": (_NUMBER, 1.225),
        "reference_area": (_NUMBER, ...),
    },
    "trim": {"lowest_deg": (_NUMBER, -5.0), "highest_deg": (_NUMBER, 25.0)},
}
_CHOICES = {
    ("aero", "method"): ("vortex-step",),
    ("aero", "direction"): ("bound", "control"),
    ("aero", "section_force"): ("lift-drag", "normal"),
}


def read_description(folder: Path, settings: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The checked content of scene.toml with the chosen variant merged in, and all settings with their defaults."""
    path = folder / "scene.toml"
    label = f"{folder.name}/scene.toml"
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise SceneError(f"{label} does not exist; a scene is a folder with a scene.toml.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise SceneError(f"{label} is not valid TOML: {error}; mend that line.") from None
    options = content.get("settings", {})
    if not isinstance(options, dict) or not all(isinstance(v, dict) and "default" in v for v in options.values()):
        raise SceneError(f"{label}: every [settings.NAME] must be a table with a default; add 'default = ...'.")
    chosen = {key: option["default"] for key, option in options.items()}
    for key, value in settings.items():
        if key not in options:
            known = ", ".join(sorted(options)) or "none"
            raise SceneError(f"scene '{folder.name}' has no setting '{key}'; its settings are: {known}.")
        chosen[key] = _setting(folder.name, key, value, options[key])
    if "variant" in chosen:
        variants = content.get("variants", {})
        if chosen["variant"] not in variants:
            raise SceneError(f"{label} has no [variants.{chosen['variant']}]; add it or choose another variant.")
        for section, keys in variants[chosen["variant"]].items():
            content.setdefault(section, {}).update(keys)
    checked: dict[str, Any] = {
        "title": str(content.get("title", folder.name)),
        "description": str(content.get("description", "")),
    }
    for section, keys_known in _KNOWN.items():
        if section == "trim" and section not in content:
            checked[section] = None
            continue
        checked[section] = _section(label, section, content.get(section, {}), keys_known)
    unknown = set(content) - set(_KNOWN) - {"title", "description", "settings", "variants"}
    if unknown:
        raise SceneError(f"{label} has an unknown section [{sorted(unknown)[0]}]; known are: {', '.join(_KNOWN)}.")
    checked["settings"] = options
    return checked, chosen


def _setting(scene: str, key: str, value: Any, option: dict[str, Any]) -> Any:
    default = option["default"]
    if isinstance(default, bool) or not isinstance(default, int):
        if "options" in option and value not in option["options"]:
            allowed = ", ".join(map(str, option["options"]))
            raise SceneError(f"setting {key} of scene '{scene}' cannot be '{value}'; choose one of: {allowed}.")
        return type(default)(value)
    try:
        number = int(str(value))
    except ValueError:
        raise SceneError(f"setting {key} of scene '{scene}' must be a whole number, not '{value}'.") from None
    low, high = option.get("minimum", 1), option.get("maximum", 100)
    if not low <= number <= high:
        raise SceneError(f"setting {key} of scene '{scene}' must lie between {low} and {high}, not {number}.")
    return number


def _section(label: str, section: str, given: Any, known: dict[str, tuple[Any, Any]]) -> dict[str, Any]:
    if not isinstance(given, dict):
        raise SceneError(f"{label}: [{section}] must be a table; write its keys below a line [{section}].")
    unknown = sorted(set(given) - set(known))
    if unknown:
        raise SceneError(f"{label}: [{section}] has an unknown key '{unknown[0]}'; known are: {', '.join(known)}.")
    out = {}
    for key, (types, default) in known.items():
        if key not in given:
            if default is ...:
                raise SceneError(f"{label}: [{section}] lacks '{key}'; add it.")
            out[key] = default
            continue
        value = given[key]
        if not isinstance(value, types) or (isinstance(value, bool) and types is not bool):
            raise SceneError(f"{label}: [{section}] {key} = {value!r} has the wrong type; see the scene-writing notes.")
        choices = _CHOICES.get((section, key))
        if choices and value not in choices:
            raise SceneError(f"{label}: [{section}] {key} = {value!r} is not one of: {', '.join(choices)}.")
        out[key] = value
    return out
