"""scene.toml: the table of contents of a scene, checked against what is known before anything is built."""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from aero.methods import method_options, methods, of_bodies
from aero.model import Option
from interface import misnamed, unprintable

from ..schema import (
    SECTIONS,
    AeroInput,
    BodyInput,
    BridleInput,
    Choices,
    DynamicsInput,
    MembranesInput,
    Number,
    OneOf,
    SceneError,
    Setting,
    StructureInput,
    TableOf,
    Tables,
    TrimInput,
    WingInput,
    Wrong,
    a_flag,
)
from .settings import offered_settings, setting, variant
from .tables import require_own

Check = Callable[[Any], Any]
# Sections that a scene may do without.
_OPTIONAL = ("membranes", "body", "bridle", "wing", "aero", "trim", "dynamics")
# Settings and keys of [aero] that mean something to a rigid wing, and to lines.
_RIGID_SETTINGS = ("panels_per_section", "scale", "variant")
_BODY_SETTINGS = ("scale", "variant")
_OF_LINES = ("line_normal_drag", "line_friction")


@dataclass(frozen=True)
class Description:
    """A checked scene.toml with the chosen variant: texts, what it `offers` to choose, what is `chosen` of it by name,
    the same as `choices`, and its sections.
    """

    title: str
    description: str
    offers: dict[str, Setting]
    chosen: dict[str, Any]
    choices: Choices
    structure: StructureInput | None
    membranes: MembranesInput | None
    body: BodyInput | None
    bridle: BridleInput | None
    wing: WingInput | None
    aero: AeroInput | None
    trim: TrimInput | None
    dynamics: DynamicsInput | None


def known_keys(section: str, method: Any = None) -> dict[str, tuple[Check, Any]]:
    """Key -> (check, default) of a section, the default MISSING where the key must be given; [aero] has those of its
    method too, of every method where it names none.
    """
    keys = _keys_of(SECTIONS[section])
    if section == "aero":
        method = keys["method"][1] if method is None else method
        for name in methods() if method not in methods() else (method,):
            keys |= {key: (_checked_option(option), option.default) for key, option in method_options(name).items()}
    return keys


def _keys_of(kind: type) -> dict[str, tuple[Check, Any]]:
    hints = get_type_hints(kind, include_extras=True)
    return {
        f.name: (_check(hints[f.name]), f.default if f.default_factory is MISSING else f.default_factory())
        for f in fields(kind)
        if f.name != "options"
    }


def _check(hint: Any) -> Check:
    """The check of an annotation; one that may be None is the check of what else it may be."""
    inner = next((part for part in get_args(hint) if get_origin(part) is Annotated), hint)
    check: Check = get_args(inner)[1]
    return check


def _checked_option(option: Option) -> Check:
    if isinstance(option.default, bool):
        return a_flag
    return OneOf(option.choices) if option.choices else Number(low=option.minimum, high=option.maximum)


def offered(folder: Path) -> dict[str, Setting]:
    """The settings that a scene offers, by name."""
    label = f"{folder.name}/scene.toml"
    return offered_settings(label, _parsed(folder / "scene.toml", label).get("settings", {}))


def read_description(folder: Path, settings: Mapping[str, Any]) -> Description:
    """The checked content of scene.toml with the given settings.

    Raises `SceneError` in one sentence for whatever is missing, unknown, or not what it should be.
    """
    label = f"{folder.name}/scene.toml"
    content = _parsed(folder / "scene.toml", label)
    _check_texts(label, content)
    offers = offered_settings(label, content.get("settings", {}))
    chosen = {key: option.default for key, option in offers.items()}
    for key, value in settings.items():
        if key not in offers:
            known = ", ".join(sorted(offers)) or "none"
            raise SceneError(f"scene '{folder.name}' has no setting '{key}'; its settings are: {known}.")
        chosen[key] = setting(f"setting {key} of scene '{folder.name}'", value, offers[key])
    unknown = set(content) - set(SECTIONS) - {"title", "description", "settings", "variants"}
    if unknown:
        raise SceneError(f"{label} has an unknown section [{sorted(unknown)[0]}]; known are: {', '.join(SECTIONS)}.")
    changes = variant(label, content.get("variants", {}), chosen.get("variant"), SECTIONS)
    sections = _sections(label, content, changes)
    return Description(
        str(content.get("title", folder.name)),
        str(content.get("description", "")),
        offers,
        chosen,
        Choices(**chosen),
        **sections,
    )


def _sections(label: str, content: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Name -> section, None where the scene has none."""
    absent = {section for section in _OPTIONAL if section not in content and section not in changes}
    needed = [("aero", "wing"), ("aero", "body")]
    needed += [("wing", "trim")] if "body" in absent else []
    lacks = next((n for n, o in needed if n in absent and o not in absent), None)
    if lacks:
        raise SceneError(
            f"{label} lacks a section [{lacks}]; add it ([trim] needs [wing] or [body], which need [aero]; a scene "
            "without a wing has a flow around its lines, or none)."
        )
    rigid = not any(section in content or section in changes for section in ("structure", "membranes"))
    if rigid:
        _check_rigid(label, content, changes)
        absent.add("structure")
    found: dict[str, Any] = {}
    for section in SECTIONS:
        given = content.get(section, {})
        if section in absent:
            found[section] = None
            continue
        if not isinstance(given, dict):
            raise SceneError(f"{label}: [{section}] must be a table; write its keys below a line [{section}].")
        found[section] = _section(label, section, {**given, **changes.get(section, {})})
    _check_method(label, found)
    _check_bridle(label, found)
    _check_drag(label, found)
    if rigid:
        return found
    _check_aero_of_structure(label, found)
    soft = [k for k in ("springs", "canopy", "tubes") if getattr(found["structure"], k) is not None]
    _check_membranes(label, found)
    if found["aero"] is not None and found["wing"] is None and soft:
        raise SceneError(
            f"{label} lacks a section [wing], whose flow [aero] is to describe; add it, or drop [aero] (only lines "
            f"have a flow without it, and [structure] has {soft[0]})."
        )
    trim = found["trim"]
    if trim is not None and trim.lowest_deg >= trim.highest_deg:
        raise SceneError(f"{label}: [trim] highest_deg must be above lowest_deg; correct one of them.")
    aero = found["aero"]
    if trim is not None and aero is not None and aero.options.get("follow") == "all":
        raise SceneError(
            f'{label}: [aero] follow = "all" turns all loads with a wing that [trim] lets pitch, so that nothing holds '
            "its pitch and the structure has no equilibrium; remove one of them, and hold the wing without [trim]."
        )
    return found


def _check_rigid(label: str, content: Mapping[str, Any], changes: Mapping[str, Any]) -> None:
    """`SceneError` where a scene without a structure says what only a structure gives a meaning."""
    given = {section: {**_keys(content, section), **changes.get(section, {})} for section in SECTIONS}
    if "aero" not in content and "aero" not in changes:
        raise SceneError(
            f"{label} lacks what the scene is made of: [structure] with nodes, [membranes], or [wing] or [body] and "
            "[aero] of a rigid wing; add it."
        )
    there = [section for section in ("wing", "body") if section in content or section in changes]
    if not there:
        raise SceneError(
            f"{label} lacks a section [wing] or [body], whose flow [aero] is to describe, or [structure] with lines; "
            "add it."
        )
    why = "but there is no [structure], so that the wing is rigid and held"
    for section, what in (("trim", "turns a kite"), ("dynamics", "moves a structure")):
        if section in content or section in changes:
            raise SceneError(f"{label}: [{section}] {what}, {why}; drop it or add [structure].")
    if "struts" in given["wing"]:
        raise SceneError(f"{label}: [wing] struts are nodes of a structure, {why}; drop the key or add [structure].")
    for key in _OF_LINES:
        if key in given["aero"]:
            raise SceneError(f"{label}: [aero] {key} is that of lines, {why}; drop the key or add [structure].")
    settings = content.get("settings", {})
    for key in settings if isinstance(settings, dict) else ():
        if key not in (_BODY_SETTINGS if there == ["body"] else _RIGID_SETTINGS):
            raise SceneError(
                f"{label}: [settings.{key}] means nothing to a rigid wing, without [structure]; remove it."
            )


def _check_method(label: str, found: Mapping[str, Any]) -> None:
    """`SceneError` where the method for the flow is not one for what the scene has."""
    body, wing, aero = (found[section] for section in ("body", "wing", "aero"))
    skin = found["membranes"] is not None and found["membranes"].shape == "body"
    if body is not None and found["structure"] is not None and not skin:
        raise SceneError(
            f"{label}: [body] is rigid and stands in a scene of its own; drop it, or [structure], or let [membranes] "
            'be its skin (shape = "body").'
        )
    if body is not None and wing is not None:
        raise SceneError(f"{label} has a closed [body] and the sheet of a [wing]; drop one of them.")
    if aero is None or (body is None and wing is None):
        return
    if of_bodies(aero.method) != (body is not None):
        fits = ", ".join(f'"{name}"' for name in methods() if of_bodies(name) == (body is not None))
        what = "[wing], a sheet of sections with polars," if body is None else "[body], a closed surface,"
        raise SceneError(f'{label}: [aero] method "{aero.method}" is not for {what} as {fits} is; name another one.')


def _check_bridle(label: str, found: Mapping[str, Any]) -> None:
    """`SceneError` where a bridle holds no parafoil of membranes."""
    body, membranes = found["body"], found["membranes"]
    if found["bridle"] is None:
        return
    if body is None or body.shape != "parafoil" or membranes is None or membranes.shape != "body":
        raise SceneError(
            f'{label}: [bridle] hangs on the ribs of a parafoil; add [body] with shape = "parafoil" and [membranes] '
            'with shape = "body", or drop it.'
        )


def _check_drag(label: str, found: Mapping[str, Any]) -> None:
    """`SceneError` where the drag of the strips of a body is said twice."""
    body, aero = found["body"], found["aero"]
    if body is None or aero is None or body.polars is None:
        return
    if aero.options.get("profile_drag_coefficient"):
        raise SceneError(
            f"{label}: [aero] profile_drag_coefficient stands beside [body] polars, which say the drag of strips; drop "
            "one of them."
        )


def _keys(content: Mapping[str, Any], section: str) -> Mapping[str, Any]:
    given = content.get(section, {})
    return given if isinstance(given, dict) else {}


def _check_aero_of_structure(label: str, found: Mapping[str, Any]) -> None:
    """`SceneError` where [aero] says what [structure] says."""
    aero, structure = found["aero"], found["structure"]
    if aero is None:
        return
    if aero.symmetric is not None:
        raise SceneError(
            f"{label}: [aero] symmetric is for scenes without [structure]; say it there, for structure and flow."
        )
    if aero.reference_point is not None and structure.pivot is not None:
        raise SceneError(
            f"{label}: [aero] reference_point stands beside [structure] pivot, which moments are about; drop it."
        )


def _check_membranes(label: str, found: Mapping[str, Any]) -> None:
    """`SceneError` where nodes come from nowhere, and where membranes meet what they have no part in yet."""
    structure, membranes = found["structure"], found["membranes"]
    if membranes is None:
        if structure.nodes is None:
            raise SceneError(f"{label}: [structure] lacks 'nodes'; add it.")
        return
    if found["dynamics"] is not None:
        raise SceneError(
            f"{label}: [membranes] have no dynamics yet; drop [dynamics] and solve for the static equilibrium."
        )
    if found["aero"] is not None and found["wing"] is None and found["body"] is None:
        raise SceneError(
            f"{label} lacks a section [wing], whose flow [aero] is to describe; add it, or drop [aero] (only lines "
            "have a flow without it, and there are [membranes])."
        )
    if found["body"] is not None and membranes.pressures:
        raise SceneError(
            f"{label}: [membranes.pressures] stand beside the pressure inside [body] that its flow sends; drop them "
            "and say internal_pressure_coefficient in [aero]."
        )


def _check_texts(label: str, content: Any, place: str = "") -> None:
    """`SceneError` for a text that XML, CSV or a terminal cannot show, and for a name that a spreadsheet takes for a
    formula; a description may have several lines.
    """
    if isinstance(content, str):
        text = content.replace("\n", " ").replace("\t", " ") if place == "description" else content
        if bad := unprintable(text):
            raise SceneError(f"{label}: {place} has the control character {bad}; take it away.")
    for key, value in content.items() if isinstance(content, dict) else ():
        if why := misnamed(key):
            raise SceneError(f"{label}: the name {key!r} {why}; choose another.")
        _check_texts(label, value, f"{place}.{key}" if place else key)
    for value in content if isinstance(content, list) else ():
        _check_texts(label, value, place)


def _parsed(path: Path, label: str) -> dict[str, Any]:
    require_own(path, label)
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise SceneError(f"{label} does not exist; a scene is a folder with a scene.toml.") from None
    except (ValueError, OSError, RecursionError) as error:  # TOML and Unicode errors are ValueErrors
        reason = " ".join(str(error).split())[:200]
        raise SceneError(f"{label} is not valid TOML ({reason}); mend that line.") from None


def _section(label: str, section: str, given: Mapping[str, Any]) -> Any:
    values = _checked(label, section, known_keys(section, given.get("method")), given)
    own = {f.name for f in fields(SECTIONS[section])}
    options = {key: values.pop(key) for key in list(values) if key not in own}
    return SECTIONS[section](**values, **({"options": options} if "options" in own else {}))


def _checked(label: str, section: str, known: Mapping[str, tuple[Check, Any]], given: Mapping[str, Any]) -> Any:
    """Key -> value of a section or of a table in one."""
    unknown = sorted(set(given) - set(known))
    if unknown:
        raise SceneError(f"{label}: [{section}] has an unknown key '{unknown[0]}'; known are: {', '.join(known)}.")
    values = {}
    for key, (check, default) in known.items():
        if key not in given:
            if default is MISSING:
                raise SceneError(f"{label}: [{section}] lacks '{key}'; add it.")
            values[key] = default
            continue
        try:
            values[key] = check(given[key])
        except Wrong as wanted:
            shown = str(given[key])[:40]
            raise SceneError(f"{label}: [{section}] {key} must be {wanted}; it is {shown!r}.") from None
        if isinstance(check, TableOf):
            values[key] = check.kind(**_checked(label, f"{section}.{key}", _keys_of(check.kind), values[key]))
        if isinstance(check, Tables):
            inner = _keys_of(check.kind)
            values[key] = {
                name: check.kind(**_checked(label, f"{section}.{key}.{name}", inner, table))
                for name, table in values[key].items()
            }
    return values
